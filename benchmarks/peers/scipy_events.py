"""SciPy's `solve_ivp` as its documentation shows it: one call per arc, terminal events."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, hypot, sin
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.problem import Outcome, Run, run_once
from mechanism_sim.arrays import Array

Rates = tuple[float, float, float, float]

STABILISATION = 500.0  #: [1/s] of Baumgarte's terms in following
SLOWEST = 1e-6  #: [m/s] rebounds slower than this end a chatter sequence
HAIR = 1e-15  #: [m] by which an arc starts on the right side: `solve_ivp` sees its own first root


class Bearing(NamedTuple):
    """Pin in bushing, as if the pin were held at its distance from the centre."""

    gap: float  #: [m]
    approach: float  #: rate at which the gap closes [m/s]
    force: float  #: that keeps it closed [N]
    k3: float  #: arms of the force on coupler and rocker [m]
    k4: float
    mass: float  #: felt along the normal [kg]
    moment3: float  #: without contact, about the crank pin and the rocker's pivot [N m]
    moment4: float


class Equations:
    """Equations of motion of coupler and rocker; states are (th3, th4, w3, w4).

    Plain floats and the functions of `math`: on four numbers NumPy's cost several times as much.
    """

    def __init__(self, four_bar: LooseFourBar) -> None:
        f = self._f = four_bar
        (self.I3, self.I4), (self._m3, self._m4) = f.inertias, f.moments
        self._centripetal = f.crank * f.crank_speed**2
        self.start = np.array([f.coupler_angle, f.rocker_angle, f.coupler_rate, f.rocker_rate])

    def gap(self, t: float, y: Array) -> float:
        """Clearance less the pin's distance from the centre [m]."""
        f, (th3, th4, _, _) = self._f, y.tolist()
        th2 = f.crank_angle + f.crank_speed * t
        x = f.crank * cos(th2) + f.coupler * cos(th3) - f.ground - f.rocker * cos(th4)
        z = f.crank * sin(th2) + f.coupler * sin(th3) - f.rocker * sin(th4)
        return f.clearance - hypot(x, z)

    def flight(self, t: float, y: Array) -> Rates:
        """Rates in flight."""
        f, (th3, th4, w3, w4) = self._f, y.tolist()
        th2 = f.crank_angle + f.crank_speed * t
        moment3 = self._m3 * (self._centripetal * sin(th2 - th3) - f.gravity * cos(th3))
        return w3, w4, moment3 / self.I3, -self._m4 * f.gravity * cos(th4) / self.I4

    def bearing(self, t: float, y: Array) -> Bearing:
        """Pin in bushing."""
        f, (th3, th4, w3, w4) = self._f, y.tolist()
        th2 = f.crank_angle + f.crank_speed * t
        s2, c2, s3, c3, s4, c4 = sin(th2), cos(th2), sin(th3), cos(th3), sin(th4), cos(th4)
        x = f.crank * c2 + f.coupler * c3 - f.ground - f.rocker * c4
        z = f.crank * s2 + f.coupler * s3 - f.rocker * s4
        r = hypot(x, z)
        nx, nz = x / r, z / r
        v2, v3, v4 = f.crank * f.crank_speed, f.coupler * w3, f.rocker * w4
        vx, vz = v4 * s4 - v3 * s3 - v2 * s2, v2 * c2 + v3 * c3 - v4 * c4
        sliding = vz * nx - vx * nz
        k3, k4 = f.coupler * (nz * c3 - nx * s3), f.rocker * (nz * c4 - nx * s4)
        moment3 = self._m3 * (self._centripetal * (s2 * c3 - c2 * s3) - f.gravity * c3)
        moment4 = -self._m4 * f.gravity * c4
        q2, q3, q4 = self._centripetal, v3 * w3, v4 * w4
        outward = (
            k3 * moment3 / self.I3 - k4 * moment4 / self.I4 + sliding * sliding / r
            + (q4 * c4 - q2 * c2 - q3 * c3) * nx + (q4 * s4 - q2 * s2 - q3 * s3) * nz
        )  # fmt: skip
        mass = 1.0 / (k3 * k3 / self.I3 + k4 * k4 / self.I4)
        approach = vx * nx + vz * nz
        return Bearing(f.clearance - r, approach, mass * outward, k3, k4, mass, moment3, moment4)

    def rates_under_force(self, y: Array, b: Bearing, force: float) -> Rates:
        """Rates under a contact force [N]."""
        _, _, w3, w4 = y.tolist()
        return w3, w4, (b.moment3 - force * b.k3) / self.I3, (b.moment4 + force * b.k4) / self.I4

    def rates_in_contact(self, t: float, y: Array) -> Rates:
        """Rates in contact, with Baumgarte's terms for gap and rate."""
        b, a = self.bearing(t, y), STABILISATION
        return self.rates_under_force(y, b, b.force + b.mass * a * (2.0 * b.approach - a * b.gap))

    def force(self, t: float, y: Array) -> float:
        """Contact force [N]."""
        return self.bearing(t, y).force

    def displace(self, t: float, y: Array, gap: float, impulse: float) -> Array:
        """The state moved to a gap [m] along the normal, after a normal impulse [N s]."""
        b = self.bearing(t, y)
        push = (gap - b.gap) * b.mass
        arms = np.array([-b.k3 / self.I3, b.k4 / self.I4])
        moved: Array = y + np.concatenate([push * arms, impulse * arms])
        return moved


def simulate(four_bar: LooseFourBar, method: str, rtol: float) -> Outcome:
    """A run by `solve_ivp`, from event to event."""
    eq, e, end = Equations(four_bar), four_bar.restitution, four_bar.duration

    def contact_begins(t: float, y: Array) -> float:
        return eq.gap(t, y)

    def contact_ends(t: float, y: Array) -> float:
        return eq.force(t, y)

    for event in (contact_begins, contact_ends):
        event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    t, y, closed = 0.0, eq.start, four_bar.seated
    steps = impacts = 0
    first: float | None = None
    while t < end:
        arc = solve_ivp(
            eq.rates_in_contact if closed else eq.flight,
            (t, end),
            y,
            method,
            events=contact_ends if closed else contact_begins,
            rtol=rtol,
            atol=0.1 * rtol,
            first_step=first,
            max_step=end / 64.0,
        )
        steps += len(arc.t) - 1
        t, y = float(arc.t[-1]), arc.y[:, -1]
        if arc.status == 0:
            break
        b = eq.bearing(t, y)
        first = None
        if closed:
            closed = False
            y = eq.displace(t, y, HAIR, b.mass * b.approach)
            continue
        impacts += 1
        closed = e * b.approach < SLOWEST and b.force > 0.0
        y = eq.displace(
            t, y, 0.0 if closed else HAIR, (1.0 + e * (not closed)) * b.mass * b.approach
        )
        if not closed and b.force > 0.0:  # the flight it begins, if it falls back
            first = min(0.5 * e * b.approach * b.mass / b.force, end - t)
    return Outcome(y[:2], steps, impacts)


def prepare(method: str) -> Callable[[LooseFourBar, float], Run]:
    """Prepare a run by a method of `solve_ivp`."""
    return lambda four_bar, rtol: run_once(lambda: simulate(four_bar, method, rtol))


HOW = (
    '`solve_ivp` with terminal events, arc by arc, plain floats in the right-hand side; arcs '
    'start a hair off the event, the first step after a rebound is half the flight expected.'
)
RK45, DOP853, LSODA, RADAU = (
    Peer(f'SciPy {method}', settings, 'rtol', prepare(method), HOW, any_restitution=everywhere)
    for method, settings, everywhere in (
        ('RK45', (1e-4, 1e-6, 1e-8, 1e-10), False),
        ('DOP853', (1e-6, 1e-8, 1e-10, 1e-12), True),
        ('LSODA', (1e-6, 1e-8, 1e-10, 1e-12), False),
        ('Radau', (1e-4, 1e-6, 1e-8, 1e-10), False),
    )
)
