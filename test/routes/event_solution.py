"""Motion between walls by SciPy's DOP853 and events of our own: the second route to flights.

The coordinates have constant inertias; one with a prescribed motion has an infinite inertia, and
its acceleration is given. A wall is a gap that is a function of the coordinates only; at most one
wall is touched at a time. Every step of the integrator is turned into a Chebyshev series of the
guard, all roots of which are found, so that no crossing is missed; at a root the step is taken
again to end there. Impacts follow Newton's restitution without friction. Nothing here knows of
the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.integrate import DOP853

Function = Callable[..., Any]
DEGREE = 15
#: [in units of the gap, m] bounces that stay below this height end in contact
LOWEST_BOUNCE = 1e-12


@dataclass(frozen=True)
class Wall:
    """A gap; all functions take coordinates (n,) or (n, N)."""

    name: str
    value: Function  #: of q
    row: Function  #: of q: derivatives by the coordinates, (n,) or (n, N)
    bend: Function  #: of q and v: second derivative in time without accelerations


@dataclass(frozen=True)
class Machine:
    """``inertia q'' = inertia acceleration(t, q, v) + row force``."""

    inertia: tuple[float, ...]
    acceleration: Function
    walls: tuple[Wall, ...]
    restitution: float
    longest_step: float
    stops: tuple[float, ...] = ()  #: times at which something is not smooth

    @property
    def mobility(self):
        """Inverse inertias."""
        return 1.0 / np.array(self.inertia)

    def across(self, wall, q, v):
        """Rate of a gap."""
        return (wall.row(q) * v).sum(axis=0)

    def falling(self, wall, t, q, v):
        """Second derivative of a gap in flight."""
        return (wall.row(q) * self.acceleration(t, q, v)).sum(axis=0) + wall.bend(q, v)

    def compliance(self, wall, q):
        """Inverse of the mass felt at a wall."""
        row = wall.row(q)
        return (row.T * row.T * self.mobility).sum(axis=-1)

    def force(self, wall, t, q, v):
        """Of contact that lasts; negative where it would pull."""
        return -self.falling(wall, t, q, v) / self.compliance(wall, q)

    def rate(self, t, y, wall=None):
        """Derivative of the state (2 n,), in flight or in contact."""
        q, v = np.split(y, 2)
        a = self.acceleration(t, q, v)
        if wall is not None:
            a = a + self.mobility * wall.row(q) * self.force(wall, t, q, v)
        return np.concatenate([v, a])


class Impact(NamedTuple):
    """At a wall."""

    t: float
    wall: str
    impulse: float
    approach: float
    loss: float
    drive_work: float  #: of whatever keeps a prescribed coordinate on its way


class Change(NamedTuple):
    """From flight to lasting contact, or back."""

    t: float
    wall: str
    touches: bool


class Step(NamedTuple):
    """Part of a motion."""

    start: float
    end: float
    dense: Function
    wall: Wall | None


@dataclass
class Motion:
    """Solution of a machine: its impacts and changes of mode."""

    machine: Machine
    impacts: list[Impact] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)

    def sample(self, times):
        """Coordinates and rates, (2 n, N)."""
        ends = np.array([s.end for s in self.steps])
        places = np.minimum(np.searchsorted(ends, times), len(ends) - 1)
        return np.array([self.steps[i].dense(t) for i, t in zip(places, times, strict=True)]).T

    def integral(self, power):
        """Of ``power(t, q, v, force, row)`` over time; force and row are zero in flight."""
        nodes, weights = np.polynomial.legendre.leggauss(8)
        total = 0.0
        for start, end, dense, wall in self.steps:
            t = start + (end - start) * (nodes + 1) / 2
            q, v = np.split(dense(t), 2)
            force, row = np.zeros_like(t), np.zeros_like(q)
            if wall is not None:
                force, row = self.machine.force(wall, t, q, v), wall.row(q)
            total += weights @ power(t, q, v, force, row) * (end - start) / 2
        return total

    def drive_work(self, i):
        """Done by whatever keeps coordinate i on its prescribed way, against contacts."""
        lasting = self.integral(lambda _t, _q, v, force, row: -force * row[i] * v[i])
        return lasting + sum(impact.drive_work for impact in self.impacts)

    @property
    def loss(self):
        """At impacts."""
        return sum(impact.loss for impact in self.impacts)


def apart(motion, impacts, joints, hard):
    """Deviations of another solution's impacts from those here, both in order of time.

    Parameters
    ----------
    impacts : with `t`, `joint`, `normal_impulse` and `approach_speed`
    joints : names of the other solution's gaps by name of wall
    hard : approach [m/s] above which impacts are compared; the others end bounces

    Returns
    -------
    times [s] and impulses, relative to the greatest: the greatest differences
    """
    here = [i for i in motion.impacts if i.approach > hard]
    there = [i for i in impacts if i.approach_speed > hard]
    assert [joints[i.wall] for i in here] == [i.joint for i in there]
    times = [abs(a.t - b.t) for a, b in zip(here, there, strict=True)]
    impulses = [abs(a.impulse - b.normal_impulse) for a, b in zip(here, there, strict=True)]
    return max(times), max(impulses) / max(i.impulse for i in here)


def falls(guard, a, b):
    """Times in (a, b] at which a smooth function falls through zero, and its slopes there."""
    series = Chebyshev.interpolate(guard, DEGREE, domain=[a, b])
    c = np.abs(series.coef)
    if c[0] > c[1:].sum():
        return []
    slope = series.deriv()
    roots = series.roots()
    real = roots.real[(np.abs(roots.imag) < 1e-9 * (b - a)) & (roots.real > a) & (roots.real <= b)]
    return [(float(t), float(slope(t))) for t in sorted(real) if slope(t) < 0.0]


def solve(machine, q, v, duration, wall=None, rtol=1e-13, atol=1e-16):
    """Motion from t = 0 on, in flight or in contact with a wall."""
    motion, t, y = Motion(machine), 0.0, np.concatenate([q, v]).astype(float)
    left = first = None  # the wall just left and whether by a rebound; the first step to take
    for stop in (*(s for s in machine.stops if 0.0 < s < duration), duration):
        while t < stop:
            t, y, wall, left, first = _arc(motion, t, y, stop, wall, left, first, rtol, atol)
    return motion


def _arc(motion, t, y, stop, wall, left, first, rtol, atol):
    """One arc without events; the state from which the next one starts."""
    machine, touching = motion.machine, wall

    def rate(t, y):
        return machine.rate(t, y, touching)

    longest = machine.longest_step
    start = min(x for x in (first, longest, stop - t) if x is not None)
    solver = DOP853(rate, t, y, stop, longest, rtol, atol, first_step=start)
    while solver.status == 'running':
        message = solver.step()
        assert solver.status != 'failed', message
        a, b, dense = solver.t_old, solver.t, solver.dense_output()
        found = _first_event(machine, touching, left, a, b, dense)
        if found is None:
            motion.steps.append(Step(a, b, dense, touching))
            left = None
            continue
        event, slope, hit, guard = found
        now = DOP853(rate, a, dense.y_old, event, rtol=1, atol=1, first_step=event - a)
        now.step()
        shift = -guard(event, now.y) / slope
        event, state = event + shift, now.y + shift * now.f
        motion.steps.append(Step(a, event, dense, touching))
        if touching is not None:
            motion.changes.append(Change(event, touching.name, touches=False))
            return event, state, None, (hit, False), longest / 100
        state, seated, first = _strike(motion, event, state, hit)
        return event, state, hit if seated else None, None if seated else (hit, True), first
    return solver.t, solver.y, wall, left, None


def _first_event(machine, touching, left, a, b, dense):
    """Time, slope, wall and guard of the first event in (a, b], or None."""
    if touching is not None:

        def force(t, y):
            return machine.force(touching, t, *np.split(y, 2))

        roots = falls(lambda t: force(t, dense(t)), a, b)
        return (*roots[0], touching, force) if roots else None
    found = []
    for wall in machine.walls:

        def gap(_, y, wall=wall):
            return wall.value(np.split(y, 2)[0])

        def seen(t, gap=gap):
            return gap(t, dense(t))

        if left is None or left[0] is not wall:
            roots = falls(seen, a, b)
        elif left[1]:  # the root it starts from is taken out
            zero = gap(a, dense.y_old)
            roots = falls(lambda t, seen=seen, zero=zero: (seen(t) - zero) / (t - a), a, b)
            roots = [(t, slope * (t - a)) for t, slope in roots]
        else:  # it starts from a triple root
            roots = falls(seen, a + 0.3 * (b - a), b)
        found += [(*root, wall, gap) for root in roots]
    return min(found, key=lambda f: f[0], default=None)


def _strike(motion, t, y, wall):
    """State after an impact, whether contact lasts, and the first step to take."""
    machine, (q, v) = motion.machine, np.split(y, 2)
    e, row, mass = machine.restitution, wall.row(q), 1.0 / machine.compliance(wall, q)
    approach = -float(machine.across(wall, q, v))
    assert approach > 0.0, 'a wall is struck from the inside'
    falling = float(machine.falling(wall, t, q, v))
    seated = falling < 0.0 and (e * approach) ** 2 < -2.0 * falling * LOWEST_BOUNCE
    impulse = (1.0 + (0.0 if seated else e)) * mass * approach
    loss = 0.5 * mass * approach**2 * (1.0 - (0.0 if seated else e) ** 2)
    driven = np.isinf(machine.inertia)
    work = -impulse * float(row[driven] @ v[driven])
    motion.impacts.append(Impact(t, wall.name, impulse, approach, loss, work))
    v = v + machine.mobility * row * impulse
    if seated:
        motion.changes.append(Change(t, wall.name, touches=True))
        q = q - machine.mobility * row * mass * wall.value(q)
        return np.concatenate([q, v]), True, None
    # about four times as long as the flight, should it fall straight back
    back = 8.0 * e * approach / -falling if falling < 0.0 else np.inf
    return np.concatenate([q, v]), False, min(back, machine.longest_step)
