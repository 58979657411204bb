"""One coordinate between walls by SciPy: with its own events, and with an event loop of ours.

In contact, where the motion is known, nothing is integrated: `brentq` finds where the pull away
from the wall rises through zero.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

from benchmarks.problem import Answer, Outcome, Run, run_once
from benchmarks.rattling import Rattling

LOWEST = 1e-12  #: [m] bounces that count as contact
NODES = np.linspace(0.0, 1.0, 9)[1:]


class Landing(NamedTuple):
    """End of an arc of flight: at a wall (1: the lower, -1: the upper), or at a stop (0)."""

    t: float
    y: Answer
    side: int
    steps: int
    last: float  #: [s] step


Fly = Callable[..., Landing]
"""Of `Rattling`, time, state (2,), stop, side of the wall just left or 0, first step, rtol."""


def release(r: Rattling, t: float, stop: float, side: int) -> float:
    """Time at which contact with a wall ends, or `stop` [s]."""
    wall = r.walls[(1 - side) // 2]

    def pull(t: float) -> float:
        return side * r.pull(t, wall, 0.0, r.constants)

    while t < stop:
        ahead = min(t + r.longest, stop)
        if pull(ahead) > 0.0:
            return float(brentq(pull, t, ahead, xtol=1e-17, rtol=1e-15)) if pull(t) < 0.0 else t
        t = ahead
    return stop


def simulate(r: Rattling, fly: Fly, rtol: float) -> Outcome:
    """The run, from event to event."""
    t, side, steps, impacts = 0.0, int(r.seated), 0, []
    y = np.array([r.walls[0] if side else 0.5 * sum(r.walls), 0.0])
    left, first = 0, r.longest
    for stop in r.stops().tolist():
        while t < stop:
            if side:
                t = release(r, t, stop, side)
                if t < stop:
                    y = np.array([r.walls[(1 - side) // 2], 0.0])
                    side, left, first = 0, 0, 0.05 * r.longest
                continue
            t, y, hit, count, last = fly(r, t, y, stop, left, min(first, stop - t), rtol)
            steps, left, first = steps + count, 0, last
            if not hit:
                continue
            wall, back = r.walls[(1 - hit) // 2], -r.restitution * hit * float(y[1])
            impacts.append((t, -hit * float(y[1])))
            y, left = np.array([wall, hit * back]), hit
            away = hit * r.pull(t, wall, 0.0, r.constants)
            if away < 0.0:
                if back * back <= -2.0 * away * LOWEST:
                    side = hit
                first = min(last, -1.2 * back / away)
    times, speeds = np.array(impacts).T
    return Outcome(r.hard(times, speeds), steps, len(impacts))


def events(
    r: Rattling, t: float, y: Answer, stop: float, _: int, first: float, rtol: float
) -> Landing:
    """Flight by `solve_ivp` with terminal events."""
    walls = [(side, wall) for side, wall in zip((1, -1), r.walls, strict=True)
             if np.isfinite(wall)]  # fmt: skip
    guards: list[Any] = []
    for side, wall in walls:

        def guard(_: float, y: Answer, side: int = side, wall: float = wall) -> float:
            return side * (float(y[0]) - wall)

        guard.terminal, guard.direction = True, -1  # type: ignore[attr-defined]
        guards.append(guard)
    arc = solve_ivp(
        rate(r), (t, stop), y, 'DOP853', events=guards, rtol=rtol,
        atol=[rtol * r.size, rtol * r.size / r.longest], first_step=first,
        max_step=5.0 * r.longest,
    )  # fmt: skip
    hit = next((walls[i][0] for i, x in enumerate(arc.t_events) if len(x)), 0)
    last = float(arc.t[-2] - arc.t[-3]) if len(arc.t) > 3 else first
    return Landing(float(arc.t[-1]), arc.y[:, -1], hit, len(arc.t) - 1, last)


def fly_by_steps(
    r: Rattling, t: float, y: Answer, stop: float, left: int, first: float, rtol: float
) -> Landing:
    """Flight by `DOP853`, its dense output looked at, the last step taken again to its end."""
    atol, fun = np.array([rtol * r.size, rtol * r.size / r.longest]), rate(r)
    solver = DOP853(fun, t, y, stop, rtol=rtol, atol=atol, first_step=first)
    fresh, steps, last = not left and y[1] == 0.0, 0, first
    while solver.status == 'running':
        solver.step()
        steps += 1
        a, b = t, solver.t
        if fresh and steps == 1:  # what starts with neither speed nor acceleration strikes later
            t = b
            continue
        dense = solver.dense_output()
        times = a + NODES * (b - a)
        z = dense(times)[0]
        for side, wall in zip((1, -1), r.walls, strict=True):
            below = np.flatnonzero(side * (z - wall) <= 0.0)
            if not below.size:
                continue
            end = float(times[below[0]])
            begin = float(times[below[0] - 1]) if below[0] else a
            while below[0] == 0 and left == side and steps == 1:
                begin = 0.5 * (a + end)  # away from the root it started from
                if side * (dense(begin)[0] - wall) > 0.0:
                    break
                end = begin
            hit = float(brentq(_off, begin, end, (dense, wall), xtol=1e-17))
            again = DOP853(fun, a, dense.y_old, hit, rtol=1, atol=1, first_step=hit - a)
            again.step()
            shift = (wall - again.y[0]) / again.y[1]
            return Landing(hit + shift, again.y + shift * again.f, side, steps, last)
        last, t = b - a, b
    return Landing(stop, solver.y, 0, steps, last)


def _off(t: float, dense: Any, wall: float) -> float:
    return float(dense(t)[0]) - wall


def rate(r: Rattling) -> Callable[[float, Answer], tuple[float, float]]:
    """Rates of way and speed."""
    pull, constants = r.pull, r.constants

    def rates(t: float, y: Answer) -> tuple[float, float]:
        z, v = y.tolist()
        return v, pull(t, z, v, constants)

    return rates


def prepare(rattling: Rattling, fly: Fly) -> Callable[[float], Run]:
    """A run by tolerance."""
    return lambda rtol: run_once(lambda: simulate(rattling, fly, rtol))


_EVENTS = '`solve_ivp` with terminal events, arc by arc, plain floats in the right-hand side.'
SOLVERS = (
    ('SciPy DOP853', events, _EVENTS),
    (
        'SciPy DOP853 tuned',
        fly_by_steps,
        'A hand-written event loop around `scipy.integrate.DOP853`, plain floats in the '
        'right-hand side; events are sought on the dense output, and the step is taken again to '
        'end there.',
    ),
)
