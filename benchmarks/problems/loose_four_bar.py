"""The thesis mechanism with one loose bearing, from several starts and with several restitutions.

Our method is the event loop of `simulate`, which records all polynomials and impacts; gathering
them in arrays is not timed. Peers keep no more than the final angles need.
"""

from __future__ import annotations

from functools import partial

from benchmarks.four_bar import LooseFourBar, peers, scene_overrides
from benchmarks.integration import event_loop, positions
from benchmarks.problem import OURS, Method, Problem, Run
from mechanism_sim.scene import load_scene

TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)


def ours(start: str, e: float, end: float, rtol: float) -> Run:
    """The event loop of this package up to `end` [s]."""
    machine = load_scene('four_bar_clearance', scene_overrides(start, e) | {'solver.rtol': rtol})
    at_end = positions(end)
    return event_loop(machine, end, lambda *run: at_end(*run)[1:])


def problem(
    name: str,
    start: str,
    e: float,
    revolutions: float | None = None,
    note: str = '',
    goal: float = 1e-9,
) -> Problem:
    """The thesis mechanism from a start, with a restitution, over a number of revolutions."""
    four_bar = LooseFourBar.thesis(start, e, revolutions)
    everyone = name == 'four_bar_clearance'
    turns = f'{four_bar.revolutions:g} revolution{"s" * (four_bar.revolutions > 1.0)}'
    return Problem(
        name,
        f'Loose four-bar, {start} start, e = {e:g}, {turns}',
        'revolution',
        four_bar.revolutions,
        'rad',
        'Final angles of coupler and rocker by power series of order 64 in 256-bit arithmetic '
        f'(test/references/make_four_bar_clearance.py).{note}',
        four_bar.error,
        (
            Method(
                OURS,
                TOLERANCES,
                'rtol',
                partial(ours, start, e, four_bar.duration),
                'The event loop of `simulate`, which records motion as polynomials and impacts.',
            ),
            *(peer.method(four_bar) for peer in peers() if everyone or peer.any_restitution),
        ),
        goal,
    )


CENTRED = problem('four_bar_clearance', 'centred', 0.5)
PLASTIC = problem('four_bar_clearance_e01', 'centred', 0.1)
SEATED = problem('four_bar_clearance_seated', 'seated', 0.5)
ELASTIC = problem(
    'four_bar_clearance_e1',
    'centred',
    1.0,
    0.5,
    ' The motion is chaotic: in this half revolution with 28 impacts a start 1e-16 rad off grows '
    'to 4e-10 rad, in a whole one to 1e-4 rad.',
    1e-8,
)
