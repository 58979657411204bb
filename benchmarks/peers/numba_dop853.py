"""A loop with DOP853 for this one mechanism, compiled by numba: the strongest competitor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.problem import Answer, Outcome, Run, missing, run_once

if TYPE_CHECKING:
    from benchmarks.kernels.loose_equations import Constants


def constants(four_bar: LooseFourBar) -> Constants:
    """The mechanism as its compiled loop takes it."""
    from benchmarks.kernels.loose_equations import Constants  # noqa: PLC0415

    f = four_bar
    I3, I4 = f.inertias
    moment3, moment4 = f.moments[0] / I3, f.moments[1] / I4
    return Constants(
        f.ground,
        f.crank,
        f.coupler,
        f.rocker,
        f.clearance,
        f.crank_speed,
        f.crank_angle,
        I3,
        I4,
        moment3 * f.crank * f.crank_speed**2,
        moment3 * f.gravity,
        moment4 * f.gravity,
        f.restitution,
        f.ground,
    )


def initial(four_bar: LooseFourBar) -> Answer:
    """Angles and rates of coupler and rocker at the start (4,)."""
    f = four_bar
    return np.array([f.coupler_angle, f.rocker_angle, f.coupler_rate, f.rocker_rate])


def prepare(four_bar: LooseFourBar, rtol: float) -> Run:
    """Compile, and be ready to run."""
    from benchmarks.kernels.loose_four_bar import revolve  # noqa: PLC0415

    p, start, times = constants(four_bar), initial(four_bar), np.empty(0)
    seated, end = four_bar.seated, four_bar.duration
    revolve(p, start, seated, 1e-9, rtol, times)

    def work() -> Outcome:
        *angles, steps, impacts = revolve(p, start, seated, end, rtol, times)
        return Outcome(np.array(angles), steps, impacts)

    return run_once(work)


PEER = Peer(
    'numba DOP853 loop',
    (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13),
    'rtol',
    prepare,
    'An event loop written for this mechanism alone, compiled as one function: DOP853 with its '
    'dense output, flight in two angles, following in the contact angle.',
    lambda: missing('numba'),
    any_restitution=True,
)
