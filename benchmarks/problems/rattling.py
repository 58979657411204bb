"""A valve that leaves its cam and bounces, and gears that rattle: times of the impacts.

Our method is the event loop of `simulate`, which gets these scenes from their files.
The peers are written for their one coordinate alone, `benchmarks.rattling`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.integration import event_loop
from benchmarks.peers import rattling_scipy
from benchmarks.problem import (
    OURS,
    Answer,
    Method,
    Outcome,
    Problem,
    Run,
    missing,
)
from benchmarks.rattling import GEARS, VALVE, Rattling
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impacts
from mechanism_sim.scene import load_scene

TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12)


def ours(rattling: Rattling, rtol: float) -> Run:
    """The event loop of this package."""

    def hard(_: Motion, impacts: Impacts) -> Answer:
        times, speeds = np.array([(i.t, i.approach_speed) for i in impacts]).T
        return rattling.hard(times, speeds)

    machine = load_scene(rattling.name, {'solver.rtol': rtol})
    return event_loop(machine, rattling.duration, hard)


def run_numba(rattling: Rattling, rtol: float) -> Run:
    """The loop compiled by numba."""
    from benchmarks.kernels.rattling import bouncer  # noqa: PLC0415

    revolve, (low, high) = bouncer(rattling.pull), rattling.walls
    times, speeds = np.empty(10_000), np.empty(10_000)
    given = (
        rattling.constants, low, high, rattling.restitution, rattling.seated,
        rattling.stops(), rattling.longest, rattling.size, rtol, times, speeds,
    )  # fmt: skip
    revolve(*given)

    def run() -> Callable[[], Outcome]:
        steps, n = revolve(*given)
        return lambda: Outcome(rattling.hard(times[:n], speeds[:n]), steps, n)

    return run


def problem(rattling: Rattling, title: str) -> Problem:
    """The scene of that name against the times of its impacts."""
    return Problem(
        rattling.name,
        title,
        'revolution',
        rattling.duration / rattling.period,
        's',
        'Times of the impacts faster than a hundredth of the fastest, from flights in closed form '
        'in 50 digits (test/references/make_rattling.py).',
        rattling.error,
        (
            Method(
                OURS,
                TOLERANCES,
                'rtol',
                partial(ours, rattling),
                'The event loop of `simulate`, which records motion as polynomials and impacts; '
                'from the scene file.',
            ),
            Method(
                'numba DOP853 loop',
                (1e-4, *TOLERANCES),
                'rtol',
                partial(run_numba, rattling),
                'An event loop for one coordinate between walls, compiled with these equations as '
                'one function; in contact, where the motion is known, nothing is integrated.',
                lambda: missing('numba'),
            ),
            *(
                Method(name, TOLERANCES, 'rtol', rattling_scipy.prepare(rattling, solver), how)
                for name, solver, how in rattling_scipy.SOLVERS
            ),
        ),
    )


VALVE_TRAIN = problem(VALVE, 'Valve train beyond its lift-off speed, 5 revolutions of the cam')
GEAR_RATTLE = problem(GEARS, 'Rattle of a gear pair, 5 revolutions of the pinion')
