"""A rod whose tip slides on a rough floor, where friction may leave no force consistent.

P. Painleve (1895); F. Genot and B. Brogliato, New results on Painleve paradoxes, European Journal
of Mechanics A 18 (1999).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from mechanism_sim.arrays import Array
from test.hard.bodies import GRAVITY, Floor, ThrownBody, residual
from test.hard.case import Figure, hard_case

HALF = 1.0  # [m] half the length of the rod, of 1 kg
INERTIA = HALF**2 / 3.0


def _rod(angle: float, spin: float, slide: float, mu: float) -> ThrownBody:
    """A rod on its tip: its angle, its rate, and the velocity of the tip along x."""
    c, s = math.cos(angle), math.sin(angle)
    # the tip lies at -HALF (c, s) from the centre
    x, y = 0.0, HALF * s
    vx, vy = slide - HALF * s * spin, HALF * c * spin
    floor = Floor('body', 0.0, mu, at=(-HALF, 0.0))
    return ThrownBody([floor], (angle, x, y), (spin, vx, vy), inertia=INERTIA, closed=True)


def _compliance(angle: float) -> tuple[float, float, float]:
    """Rates of the tip per unit impulse: upwards by upwards, by along x, and along x [1/kg]."""
    up, along = -HALF * math.cos(angle), HALF * math.sin(angle)
    return (
        1.0 + up * up / INERTIA,
        up * along / INERTIA,
        1.0 + along * along / INERTIA,
    )


@hard_case(
    "Painleve's paradox: friction presses the sliding tip down faster than the normal force lifts "
    'it, and no finite force is consistent.',
    'An impact without collision that ends with the tip at rest: two linear equations for its two '
    'impulses.',
)
def rod_that_jams() -> list[Figure]:
    """The impulse at once, the state after it, and the energy."""
    angle, mu, slide = 1.1, 2.0, 3.0
    # sliding to +x jams where the tip trails behind: it must point against the sliding
    errors, gain, count = 0.0, -math.inf, 0
    for sign in (1.0, -1.0):
        a = angle if sign > 0.0 else math.pi - angle
        nn, nt, tt = _compliance(a)
        if nn - mu * math.copysign(1.0, sign * slide) * nt > 0.0:
            a = math.pi - a
            nn, nt, tt = _compliance(a)
        rod = _rod(a, 0.0, sign * slide, mu)
        rod.until(0.01)
        p, q = np.linalg.solve([[nn, nt], [nt, tt]], [0.0, -sign * slide])
        impact = rod.impacts[0]
        count += 1
        errors = max(errors, abs(impact.normal_impulse - p), abs(impact.tangential_impulse - q))
        gain = max(gain, -impact.energy_loss)
    return [
        Figure('jams found of 2, less 2', count - 2, 0.0),
        Figure('error of the impulses', errors, 1e-12, 'N s'),
        Figure('energy made', max(gain, 0.0), 0.0, 'J'),
    ]


@hard_case(
    'A rod that slides towards the jamming edge, where the force divides by almost nothing.',
    'Cartesian equations of the sliding rod, by DOP853, as long as it slides.',
)
def rod_at_the_jamming_edge() -> list[Figure]:
    """The motion beside the other route, the energy, and how near to the edge it came."""
    mu = 1.6
    worst = largest = 0.0
    nearest = math.inf
    for angle, spin, slide in ((0.55, 0.9, -2.0), (0.7, 0.5, -4.0), (1.35, -0.5, -3.0)):
        nn, nt, _ = _compliance(angle)
        direction = math.copysign(1.0, slide)
        if nn - mu * direction * nt <= 0.0:
            continue
        rod = _rod(angle, spin, slide, mu)
        rod.until(0.35)
        slides = next((m.t for m in rod.modes[1:]), 0.35)
        until = 0.999 * slides

        def rate(_: float, y: Array, direction: float = direction) -> list[float]:
            c, s = math.cos(y[0]), math.sin(y[0])
            pivot, across, _ = _compliance(y[0])
            bias = -GRAVITY + HALF * s * y[3] ** 2
            N = -bias / (pivot - mu * direction * across)
            T = -mu * direction * N
            turn = (-HALF * c * N + HALF * s * T) / INERTIA
            return [y[3], y[4], y[5], turn, T, N - GRAVITY]

        start = [*rod.at(0.0), *rod.at(0.0, 1)]
        path = solve_ivp(rate, (0.0, until), start, 'DOP853', rtol=1e-11, atol=1e-12)
        worst = max(worst, float(np.abs(path.y[:3, -1] - rod.at(until)).max()))
        for a in path.y[0]:
            pivot, across, _ = _compliance(float(a))
            nearest = min(nearest, (pivot - mu * direction * across) / pivot)
        largest = max(largest, abs(residual(rod.audit.energy)))
    return [
        Figure('difference from the other route', worst, 1e-8, 'm'),
        Figure('energy residual', largest, 1e-9, 'J'),
        Figure('nearest to the edge', nearest),
    ]
