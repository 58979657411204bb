"""A beam that spins up (Kane, Ryan and Banerjee): the more modes, the nearer to the beam."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks.four_bar import reference
from benchmarks.integration import event_loop, positions
from benchmarks.peers.exudyn_beams import method, prepare_spinning_beam
from benchmarks.problem import OURS, Answer, Method, Problem, Run
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.scene import load_scene

END = 8.0  #: [s] near the largest deflection


def error(answer: Answer) -> float:
    """Error of the tip's deflection (1,) [m]."""
    return float(abs(answer[0] - float(reference('spinning_beam')['deflection'])))


def ours(modes: float) -> Run:
    """The event loop of `simulate`, with so many modes."""
    machine = load_scene('spinning_beam', {'links.arm.elastic.modes': int(modes)})
    at_end, tip = positions(END), machine.mechanism.having(Beam)['arm'].deflection(10.0)
    return event_loop(machine, END, lambda *run: np.array([tip @ at_end(*run)[1:]]))


PROBLEM = Problem(
    'spinning_beam',
    'Beam that spins up, 8 s',
    'run',
    1.0,
    'm',
    'Deflection of the tip by chains of rigid segments with springs between them, extrapolated '
    'to infinitely many (test/references/make_spinning_beam.py).',
    error,
    (
        Method(
            OURS,
            (1, 2, 3, 4, 6),
            'modes',
            ours,
            'The event loop of `simulate`: modes of a cantilever without stretch, rtol 1e-12. '
            'What more of them leave is of third order in the deflection, 4 % of the length here.',
        ),
        method(partial(prepare_spinning_beam, END), 4, (800, 3200)),
        method(partial(prepare_spinning_beam, END), 8, (1600, 6400)),
    ),
    1e-3,
)
