"""SciPy's DOP853 stepped by hand, with an event loop of its own for the thesis mechanism.

Written as one would with SciPy, care and time:

* scalar right-hand sides on plain floats (NumPy scalars cost three times as much);
* one `DOP853` object per arc, started with the last step size instead of a fresh guess; after an
  impact the first step is tied to the ballistic estimate of the next one, so that chatter costs
  one step a bounce;
* dense output only where an event is possible: always in flight, in following only where the
  contact force came near zero at one of the stages of the step; then samples of the guard,
  minima refined between them, and `brentq` on the dense output;
* the step is then taken again so that it ends at the event, with one Newton correction: steps of
  flight are long, and on them the dense output is far coarser than the step itself;
* in following the state is projected onto the contact after every step, positions and rates,
  through the mass matrix;
* chatter ends in following at the first rebound slower than `cut`, if the contact force holds.
  In doubles a `cut` below 1e-7 m/s means nothing: such a bounce is 1e-16 m high.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, hypot, sin
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

from benchmarks.four_bar import LooseFourBar, Peer
from benchmarks.problem import Outcome, run_once
from mechanism_sim.arrays import Array

# Table 6.1 in SI, crank = 2, coupler = 3, rocker = 4, frame = 1; S: joint to mass centre
l1, l2, l3, l4, c = 0.387, 0.064, 0.309, 0.312, 0.000254
S3, S4, m3, m4, IG3, IG4 = 0.185, 0.134, 0.2439, 0.2334, 0.002950, 0.003176
w2, g = 36.6519, 9.8145
IA3, IO4 = IG3 + m3 * S3**2, IG4 + m4 * S4**2
SWING3, FALL3, FALL4 = m3 * S3 * l2 * w2**2 / IA3, m3 * S3 * g / IA3, m4 * S4 * g / IO4
NODES = np.linspace(0, 1, 10)[1:]


State = tuple[float, ...]
Rate = Callable[[float, Array], State]
Guard = Callable[[Any, Any], Any]


@dataclass(slots=True)
class Bearing:
    """Gap, normal, and rates of the pin relative to the bushing."""

    gap: float
    approach: float
    sliding: float
    k3: float
    k4: float

    @property
    def mass(self) -> float:
        """Mass felt along the normal [kg]."""
        return 1 / (self.k3**2 / IA3 + self.k4**2 / IO4)

    def strike(self, w3: float, w4: float, e: float) -> tuple[float, float, float]:
        """Normal impulse [N s], and the rates after an impact with restitution e."""
        p = (1 + e) * self.mass * self.approach
        return p, w3 - p * self.k3 / IA3, w4 + p * self.k4 / IO4


def bearing(t: float, th3: float, th4: float, w3: float, w4: float) -> Bearing:
    """Pin and bushing at one instant."""
    s2, c2, s3, c3 = sin(w2 * t), cos(w2 * t), sin(th3), cos(th3)
    s4, c4 = sin(th4), cos(th4)
    x, y = l2 * c2 + l3 * c3 - l1 - l4 * c4, l2 * s2 + l3 * s3 - l4 * s4
    r = hypot(x, y)
    nx, ny = x / r, y / r
    vx = -l2 * w2 * s2 - l3 * w3 * s3 + l4 * w4 * s4
    vy = l2 * w2 * c2 + l3 * w3 * c3 - l4 * w4 * c4
    k3, k4 = l3 * (ny * c3 - nx * s3), l4 * (ny * c4 - nx * s4)
    return Bearing(c - r, vx * nx + vy * ny, vy * nx - vx * ny, k3, k4)


def gap(t: Any, y: Any) -> Any:
    """Gap [m]; t and the rows of y may be arrays."""
    th2, th3, th4 = w2 * t, y[0], y[1]
    qx = l2 * np.cos(th2) + l3 * np.cos(th3) - l1 - l4 * np.cos(th4)
    qy = l2 * np.sin(th2) + l3 * np.sin(th3) - l4 * np.sin(th4)
    return c - np.hypot(qx, qy)


def flight(t: float, y: Array) -> State:
    """Rates in flight."""
    th3, th4, w3, w4 = y.tolist()
    return (w3, w4, SWING3 * sin(w2 * t - th3) - FALL3 * cos(th3), -FALL4 * cos(th4))


def accelerate_in_contact(
    t: float, th3: float, th4: float, w3: float, w4: float
) -> tuple[float, float, float]:
    """Accelerations of coupler and rocker in contact, and the contact force."""
    th2 = w2 * t
    s2, c2, s3, c3, s4, c4 = sin(th2), cos(th2), sin(th3), cos(th3), sin(th4), cos(th4)
    x, y = l2 * c2 + l3 * c3 - l1 - l4 * c4, l2 * s2 + l3 * s3 - l4 * s4
    r = hypot(x, y)
    nx, ny = x / r, y / r
    p3, p4 = l3 * w3, l4 * w4
    sliding = (l2 * w2 * c2 + p3 * c3 - p4 * c4) * nx + (l2 * w2 * s2 + p3 * s3 - p4 * s4) * ny
    q2, q3, q4 = l2 * w2 * w2, p3 * w3, p4 * w4
    bend = (q4 * c4 - q2 * c2 - q3 * c3) * nx + (q4 * s4 - q2 * s2 - q3 * s3) * ny
    k3, k4 = l3 * (ny * c3 - nx * s3), l4 * (ny * c4 - nx * s4)
    a3, a4 = SWING3 * (s2 * c3 - c2 * s3) - FALL3 * c3, -FALL4 * c4
    force = k3 * a3 - k4 * a4 + bend + sliding * sliding / r
    force /= k3 * k3 / IA3 + k4 * k4 / IO4
    return a3 - force * k3 / IA3, a4 + force * k4 / IO4, force


def contact_force(t: float, y: Array) -> float:
    """Contact force [N], as if in contact."""
    th3, th4, w3, w4 = y.tolist()
    return accelerate_in_contact(t, th3, th4, w3, w4)[2]


def project(t: float, th3: float, th4: float, w3: float, w4: float) -> State:
    """Nearest state in contact, in the metric of the mass matrix: positions, then rates."""
    now = bearing(t, th3, th4, w3, w4)
    push = now.mass * now.gap
    th3, th4 = th3 + push * now.k3 / IA3, th4 - push * now.k4 / IO4
    now = bearing(t, th3, th4, w3, w4)
    _, w3, w4 = now.strike(w3, w4, 0.0)
    return th3, th4, w3, w4


def first_fall(guard: Guard, dense: Any, a: float, b: float, values: Any) -> float | None:
    """First time in (a, b] at which a guard, positive after a, falls through zero, or None."""
    times = a + NODES * (b - a)
    left = a
    for i, (t, value) in enumerate(zip(times, values, strict=True)):
        if value <= 0:
            tries = 0
            while guard(left, dense(left)) <= 0:  # still at the root it started from
                left, tries = left + (t - left) / 8, tries + 1
                if tries == 40:
                    return float(t)
            return float(brentq(lambda x: guard(x, dense(x)), left, t, xtol=1e-17, rtol=1e-15))
        bottom = 0 < i < len(times) - 1 and values[i - 1] >= value < values[i + 1]
        if bottom and 2 * value < max(values[i - 1], values[i + 1]) - value:  # may dip between
            span = (times[i - 1], times[i + 1])
            low = minimize_scalar(lambda x: guard(x, dense(x)), bounds=span, method='bounded')
            if low.fun <= 0:
                return float(brentq(lambda x: guard(x, dense(x)), span[0], low.x, rtol=1e-15))
        left = t
    return None


def exact(fun: Rate, dense: Any, t: float) -> tuple[Array, Array]:
    """State at t inside a step, from one step of the method which ends there, and its rate."""
    a = dense.t_old
    solver = DOP853(fun, a, dense.y_old, t, rtol=1, atol=1, first_step=t - a)
    solver.step()
    return solver.y, solver.f


def land(fun: Rate, guard: Guard, dense: Any, t: float) -> tuple[float, Array]:
    """Time and state of the event which the dense output puts at t."""
    y, rate = exact(fun, dense, t)
    if guard is gap:
        slope = -bearing(t, *y.tolist()).approach
    else:
        before = t - 0.01 * (dense.t - dense.t_old)
        slope = (guard(t, dense(t)) - guard(before, dense(before))) / (t - before)
    shift = -guard(t, y) / slope
    return t + shift, y + shift * rate


def simulate(four_bar: LooseFourBar, rtol: float, cut: float = 1e-6) -> Outcome:
    """The run of a four-bar with the measures of the thesis; chatter ends below `cut` [m/s]."""
    y: State = (
        four_bar.coupler_angle, four_bar.rocker_angle, four_bar.coupler_rate, four_bar.rocker_rate
    )  # fmt: skip
    e, touching = four_bar.restitution, four_bar.seated
    t, end, step = 0.0, four_bar.duration, None
    steps = impacts = 0
    low = high = 0.0  # contact force over the stages of a step

    def record_force(t: float, y: Array) -> State:
        nonlocal low, high
        th3, th4, w3, w4 = y.tolist()
        a3, a4, force = accelerate_in_contact(t, th3, th4, w3, w4)
        if force < low:
            low = force
        elif force > high:
            high = force
        return (w3, w4, a3, a4)

    while t < end:  # one arc of flight or of following
        fun, guard = (record_force, contact_force) if touching else (flight, gap)
        first = None if step is None else min(step, end - t)
        solver = DOP853(fun, t, y, end, rtol=rtol, atol=0.1 * rtol, first_step=first)
        event = None
        while event is None and solver.status == 'running':
            low, high = np.inf, 0.0
            solver.step()
            steps += 1
            a, b = solver.t_old, solver.t
            if not touching:
                dense = solver.dense_output()
                grid = a + NODES * (b - a)
                event = first_fall(guard, dense, a, b, guard(grid, dense(grid)))
            elif low < 0.4 * high or low < 0:
                dense = solver.dense_output()
                values = [guard(x, dense(x)) for x in a + NODES * (b - a)]
                event = first_fall(guard, dense, a, b, values)
            if event is not None:
                event, landed = land(fun, guard, dense, event)
            t = b if event is None else event
            if touching and event is None:
                y = project(t, *solver.y.tolist())
                solver.y = np.array(y)
                solver.f = solver.fun(t, solver.y)
        step = solver.h_abs
        y = tuple((solver.y if event is None else landed).tolist())
        if event is None:
            break
        if touching:
            touching = False
            continue
        now = bearing(t, *y)
        ratio = e
        if e * now.approach < cut:
            seated = project(t, *y)
            if accelerate_in_contact(t, *seated)[2] > 0:
                touching, ratio = True, 0.0
        impacts += 1
        if touching:
            y = seated
            continue
        _, w3, w4 = now.strike(y[2], y[3], ratio)
        y = (y[0], y[1], w3, w4)
        # ballistic estimate of the next impact: the gap opens at e v and is pulled back at `pull`
        pull = accelerate_in_contact(t, *y)[2] / now.mass
        if pull > 0:
            step = min(step, 1.2 * 2 * ratio * now.approach / pull)
    return Outcome(np.array(y[:2]), steps, impacts)


PEER = Peer(
    'SciPy DOP853 tuned',
    (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
    'rtol',
    lambda four_bar, rtol: run_once(lambda: simulate(four_bar, rtol)),
    'A hand-written event loop around `scipy.integrate.DOP853`, plain floats in the right-hand '
    'side, dense output only where an event is possible, projection onto the contact.',
    any_restitution=True,
)
