"""The flexible slider-crank of the IVP test set (B. Simeon): two bending modes, two of stretch."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks import flexible_slider_crank as simeon
from benchmarks.four_bar import reference
from benchmarks.integration import event_loop, run_solve_ivp, solve_ivp_methods
from benchmarks.peers.exudyn_beams import method, prepare_slider_crank
from benchmarks.problem import OURS, Answer, Method, Problem, Run
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.scene import Machine, load_scene

STRETCH = 'rod.stretch1', 'rod.stretch2'


def error(answer: Answer) -> float:
    """Largest error of the slider's place and of the rod's deflection in the middle (2,) [m]."""
    right = reference('elastic_slider_crank')
    return float(np.abs(answer - [float(right[x]) for x in ('slider', 'bend1')]).max())


def elongations(machine: Machine) -> Answer:
    """Elongations of the middle and of the end of the rod (2, 2) by its coordinates."""
    return machine.mechanism.having(Beam)['rod'].elongation(np.array([0.5, 1.0]) * simeon.L2).T


def stretching(**changes: Any) -> Machine:
    """The scene with the rod of the test set, which stretches, too, and its start."""
    whole = {
        'links.rod.elastic.stretch': 2,
        'links.rod.elastic.foreshortening': False,
        'initial': None,
        **changes,
    }
    nodes, start = elongations(load_scene('elastic_slider_crank', whole)), simeon.closed_start()
    q, v = (np.linalg.solve(nodes, start[part]).tolist() for part in (slice(5, 7), slice(12, 14)))
    bends = dict(zip(('rod.bend1', 'rod.bend2'), start[10:12].tolist(), strict=True))
    initial = {
        'position': dict(zip(STRETCH, q, strict=True)),
        'velocity': bends | dict(zip(STRETCH, v, strict=True)),
    }
    return load_scene('elastic_slider_crank', whole | {'initial': initial})


def ours(rtol: float) -> Run:
    """The event loop of `simulate`."""
    machine = stretching(**{'solver.rtol': rtol})
    wanted = [machine.mechanism.coordinates.index(c) for c in ('slider', 'rod.bend1')]

    def answer(motion: Motion, _: Any) -> Answer:
        return np.asarray(motion.curve(np.array([simeon.END]))[0])[wanted]

    return event_loop(machine, simeon.END, answer)


def scipy(name: str, rtol: float) -> Run:
    """`solve_ivp` on the test set's coordinates."""
    run = run_solve_ivp(simeon.rates(), simeon.closed_start(), simeon.END, name, rtol, 7)

    def narrowed() -> Any:
        outcome = run()
        return lambda: (found := outcome())._replace(answer=found.answer[2:4])

    return narrowed


PROBLEM = Problem(
    'elastic_slider_crank',
    'Flexible slider-crank of the IVP test set, 100 ms',
    'run',
    1.0,
    'm',
    "Place of the slider and deflection of the rod's middle, by DOP853 on the matrices of the "
    'test set, its mass along the rod put right (test/references/make_elastic_slider_crank.py).',
    error,
    (
        Method(
            OURS,
            (1e-6, 1e-8, 1e-10, 1e-12),
            'rtol',
            ours,
            'The event loop of `simulate`: seven coordinates, the closed loop as a constraint, '
            'from the scene file.',
        ),
        *solve_ivp_methods(
            scipy,
            ('DOP853',),
            "`solve_ivp` on the test set's seven coordinates in index 1, written by hand; "
            '`numpy.linalg.solve` on 10 equations a call.',
        ),
        method(prepare_slider_crank, 4, (1000, 4000, 16000)),
        method(prepare_slider_crank, 8, (4000, 16000)),
    ),
)
