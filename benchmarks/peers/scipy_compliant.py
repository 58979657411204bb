"""The loose bearing as a stiff spring and damper, by SciPy's stiff methods."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.peers.scipy_events import Equations, Rates
from benchmarks.problem import Outcome, Run, run_once
from mechanism_sim.arrays import Array
from mechanism_sim.errors import RunError


def damping_ratio(e: float) -> float:
    """Damping ratio of a spring and damper that cannot pull and gives back the speed e v.

    ``e = exp(-(pi - 2 a) tan(a))`` with ``a = asin(ratio)``: contact ends where the force does.
    """
    return math.sin(
        brentq(
            lambda a: (math.pi - 2.0 * a) * math.tan(a) + math.log(e), 0.0, 0.5 * math.pi - 1e-9
        )
    )


def simulate(four_bar: LooseFourBar, method: str, stiffness: float, rtol: float) -> Outcome:
    """One call of `solve_ivp` over the whole run, blind to contact."""
    eq, ratio = Equations(four_bar), damping_ratio(four_bar.restitution)

    def rates(t: float, y: Array) -> Rates:
        if eq.gap(t, y) >= 0.0:
            return eq.flight(t, y)
        b = eq.bearing(t, y)
        damping = 2.0 * ratio * math.sqrt(stiffness * b.mass)
        return eq.rates_under_force(y, b, max(0.0, damping * b.approach - stiffness * b.gap))

    def jacobian(t: float, y: Array) -> Array:
        # Differences would step out of the contact, which is 1e-10 m deep.
        J = np.zeros((4, 4))
        J[0, 2] = J[1, 3] = 1.0
        b = eq.bearing(t, y)
        if b.gap < 0.0:
            arms = np.array([b.k3, -b.k4])
            rows = np.outer(arms / [-eq.I3, -eq.I4], arms)
            J[2:, :2] = stiffness * rows
            J[2:, 2:] = 2.0 * ratio * math.sqrt(stiffness * b.mass) * rows
        return J

    run = solve_ivp(
        rates, (0.0, four_bar.duration), eq.start, method, rtol=rtol, atol=0.01 * rtol,
        t_eval=[four_bar.duration], jac=jacobian,
    )  # fmt: skip
    if not run.success:
        raise RunError(f'{method} failed: {run.message}')
    return Outcome(run.y[:2, -1])


def prepare(method: str, rtol: float) -> Callable[[LooseFourBar, float], Run]:
    """Prepare a run by a method at a tolerance."""
    return lambda four_bar, stiffness: run_once(
        lambda: simulate(four_bar, method, stiffness, rtol)
    )


LSODA, RADAU = (
    Peer(
        f'SciPy {method}, compliant',
        stiffnesses,
        'stiffness [N/m]',
        prepare(method, rtol),
        '`solve_ivp` over the whole run, a spring and damper that cannot pull, damped for the '
        f'restitution; Jacobian given; rtol {rtol:g}, below which the error no longer falls.',
    )
    for method, rtol, stiffnesses in (
        ('LSODA', 1e-7, (1e7, 1e8, 1e9, 1e10, 6.6e10)),
        ('Radau', 1e-5, (1e7, 1e8, 1e9, 1e10)),
    )
)
