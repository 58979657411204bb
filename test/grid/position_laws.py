"""Drives by position, by speed over time and by moves, under a pendulum that is free.

The law is evaluated by closed forms, by B-splines, or by its own search for the peak speed; the
pendulum on the driven link is integrated by DOP853 under it, between the corners of the law.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Machine
from test.grid.case import Draft, Failure, Family, Random, Scene

TOLERANCE = 1e-9
"""[rad, m] off the second route, beside what a free pendulum multiplies."""

_LENGTH, _MASS, _COG, _INERTIA, _GRAVITY = 0.5, 0.7, 0.4, 0.05, 9.81

Motion = Callable[[float], tuple[float, float, float]]
"""Position, rate and acceleration of the drive at a time [s]."""


class _Known(NamedTuple):
    motion: Motion
    corners: tuple[float, ...]  #: [s] where a derivative of it jumps
    duration: float  #: [s]


def _waves(random: Random) -> tuple[Scene, _Known]:
    """A sum of sines, and a speed beside them."""
    n = int(random.integers(1, 4))
    rows = [(float(random.uniform(0.05, 0.4)), float(random.uniform(0.5, 9.0)),
             float(random.uniform(-3.0, 3.0))) for _ in range(n)]  # fmt: skip
    speed = float(random.choice([0.0, 1.3, -4.0]))
    text = ' + '.join([f'{speed!r}*t', *(f'{a!r}*sin({w!r}*t + {p!r})' for a, w, p in rows)])

    def motion(t: float) -> tuple[float, float, float]:
        return (
            speed * t + sum(a * math.sin(w * t + p) for a, w, p in rows),
            speed + sum(a * w * math.cos(w * t + p) for a, w, p in rows),
            -sum(a * w * w * math.sin(w * t + p) for a, w, p in rows),
        )

    return {'position': text}, _Known(motion, (), 6.0)


def _ramp(random: Random) -> tuple[Scene, _Known]:
    """A steep passage from one place to another, of any width."""
    size, middle = float(random.uniform(0.2, 1.5)), float(random.uniform(0.5, 3.0))
    width = float(10.0 ** random.uniform(-1.5, 0.0))
    text = f'{size!r}*tanh((t - {middle!r})/{width!r})'

    def motion(t: float) -> tuple[float, float, float]:
        u = math.tanh((t - middle) / width)
        slope = (1.0 - u * u) / width
        return size * u, size * slope, -2.0 * size * u * slope / width

    away = (middle - 6.0 * width, middle, middle + 6.0 * width)
    return {'position': text}, _Known(motion, tuple(x for x in away if 0.0 < x < 4.0), 4.0)


def _dwells(random: Random) -> tuple[Scene, _Known]:
    """A cycloid between dwells, by conditions; the acceleration has corners."""
    size, begin = float(random.uniform(-1.5, 1.5)), float(random.uniform(0.1, 1.0))
    long = float(random.uniform(0.3, 2.0))
    u = f'(t - {begin!r})/{long!r}'
    rise = f'{size!r}*({u} - sin(2*pi*{u})/(2*pi))'
    text = f'(0 if t < {begin!r} else {rise}) if t < {begin + long!r} else {size!r}'

    def motion(t: float) -> tuple[float, float, float]:
        s = min(max((t - begin) / long, 0.0), 1.0)
        turn = 2.0 * math.pi * s
        return (
            size * (s - math.sin(turn) / (2.0 * math.pi)),
            size * (1.0 - math.cos(turn)) / long,
            size * 2.0 * math.pi * math.sin(turn) / long**2,
        )

    return {'position': text}, _Known(motion, (begin, begin + long), begin + long + 1.0)


def _table(random: Random) -> tuple[Scene, _Known]:
    """Points of a period at uneven times, which may turn on; cubic or quintic."""
    degree = int(random.choice([3, 5]))
    period, n = float(random.uniform(0.8, 3.0)), int(random.integers(9, 40))
    t = np.linspace(0.0, period, n)
    t[1:-1] += random.uniform(-0.2, 0.2, n - 2) * period / n
    y = 0.4 * np.sin(2.0 * np.pi * t / period + 1.0) + 0.1 * np.sin(6.0 * np.pi * t / period)
    y[-1] = y[0]
    turns = int(random.choice([0, 0, 1, -2]))
    slope = 2.0 * math.pi * turns / period
    spline = make_interp_spline(t, y, k=degree, bc_type='periodic')
    curves = [spline, spline.derivative(1), spline.derivative(2)]

    def motion(x: float) -> tuple[float, float, float]:
        a, b, c = (float(curve(x % period)) for curve in curves)
        return a + slope * x, b + slope, c

    points = [[x, z + slope * x] for x, z in zip(t.tolist(), y.tolist(), strict=True)]
    points[-1][1] = points[0][1] + 2.0 * math.pi * turns
    how = {3: 'cubic', 5: 'quintic'}[degree]
    keys = {'position': {'points': points, 'interpolation': how, 'periodic': True}}
    corners = [x + k * period for k in range(3) for x in t.tolist()]
    return keys, _Known(motion, tuple(x for x in corners if x < 2.2 * period), 2.2 * period)


def _moves(random: Random) -> tuple[Scene, _Known]:
    """To and fro with dwells, under limits of which any may be reached."""
    v, a = float(10.0 ** random.uniform(-0.3, 0.7)), float(10.0 ** random.uniform(0.3, 1.5))
    j = float(10.0 ** random.uniform(1.0, 2.5)) if random.random() < 0.8 else math.inf
    way, dwell = float(random.uniform(0.1, 2.0)), float(random.choice([0.0, 0.1, 0.6]))

    def ramp(peak: float) -> tuple[float, float]:
        """Time up to a peak speed, and of the jerk in it [s]."""
        if math.isinf(j):
            return peak / a, 0.0
        return (peak / a + a / j, a / j) if peak >= a * a / j else (2 * math.sqrt(peak / j),) * 2

    low, high = 0.0, v
    if v * ramp(v)[0] > way:
        for _ in range(200):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if middle * ramp(middle)[0] > way else (middle, high)
    peak, (up, rise) = high, ramp(high)
    rise = min(rise, up / 2.0)
    steady = max(0.0, way / peak - up)
    top = peak / (up - rise)
    one = 2.0 * up + steady

    def ramped(t: float) -> tuple[float, float, float]:
        """Way, speed and acceleration after a time [s] of a move that has not slowed down yet."""
        jerk = top / rise if rise else 0.0
        first = min(t, rise)
        x, w, z = jerk * first**3 / 6.0, jerk * first**2 / 2.0, jerk * first if rise else top
        held = min(max(t - rise, 0.0), up - 2.0 * rise)
        x, w = x + w * held + top * held**2 / 2.0, w + top * held
        last = min(max(t - up + rise, 0.0), rise)
        x += w * last + top * last**2 / 2.0 - jerk * last**3 / 6.0
        w, z = w + top * last - jerk * last**2 / 2.0, (z if t < up - rise else top - jerk * last)
        after = max(t - up, 0.0)
        return x + w * after, w, 0.0 if t >= up else z

    def motion(t: float) -> tuple[float, float, float]:
        s = t % (2.0 * (one + dwell))
        back = s >= one + dwell
        s -= (one + dwell) * back
        if s >= one:  # at rest
            x, w, z = way, 0.0, 0.0
        elif s <= one / 2.0:
            x, w, z = ramped(s)
        else:
            x, w, z = ramped(one - s)
            x, z = way - x, -z
        return (way - x, -w, -z) if back else (x, w, z)

    limits = {'speed': v, 'acceleration': a} | ({} if math.isinf(j) else {'jerk': j})
    rest = [{'dwell': dwell}] if dwell else []
    steps = [{'to': way}, *rest, {'by': -way}, *rest]
    corners = [0.0, rise, up - rise, up, one - up, one - up + rise, one - rise, one]
    every = [k * (one + dwell) + x for k in range(3) for x in corners]
    end = 2.6 * (one + dwell)
    return (
        {'moves': {**limits, 'steps': steps, 'repeat': True}},
        _Known(motion, tuple(x for x in every if 0.0 < x < end), end),
    )


def _speeds(random: Random) -> tuple[Scene, _Known]:
    """A speed by formula, from a start of its own."""
    a, w, c = (float(random.uniform(*x)) for x in ((0.3, 3.0), (0.5, 6.0), (-2.0, 2.0)))
    start = float(random.uniform(-3.0, 3.0))

    def motion(t: float) -> tuple[float, float, float]:
        return (
            start + c * t + a * math.sin(w * t) / w,
            c + a * math.cos(w * t),
            -a * w * math.sin(w * t),
        )

    keys = {'speed': f'{c!r} + {a!r}*cos({w!r}*t)', 'start_angle': start}
    return keys, _Known(motion, (), 5.0)


_KINDS = _waves, _ramp, _dwells, _table, _moves, _speeds


def _drawn(random: Random, k: int) -> tuple[Draft, _Known]:
    keys, known = _KINDS[k % len(_KINDS)](random)
    scene: Scene = {
        'title': 'A pendulum on a link driven over time',
        'mechanism': 'linkage',
        'gravity': [0.0, -_GRAVITY],
        'links': {
            'ground': {},
            'arm': {'length': _LENGTH, 'mass': 1.0, 'inertia': 0.1, 'cog': 0.2},
            'rod': {'length': 0.8, 'mass': _MASS, 'inertia': _INERTIA, 'cog': _COG},
        },
        'joints': {
            'pivot': {'revolute': ['ground', 'arm']},
            'pin': {'revolute': ['arm.end', 'rod']},
        },
        'guess': {'rod': -1.4},
        'drive': {'coordinate': 'arm', **keys},
    }
    return Draft(scene, duration=known.duration), known


def _judge(random: Random, k: int, _machine: Machine, solution: Solution) -> dict[str, float]:
    known = _drawn(random, k)[1]
    t = np.linspace(0.0, known.duration, 101)
    found: Any = solution.sample(t)
    exact = np.array([known.motion(x) for x in t.tolist()])
    off = {
        'position': float(np.abs(found['position.arm'] - exact[:, 0]).max()),
        'rod': float(np.abs(found['position.rod'] - _rod(known, t)).max()),
    }
    for name, value in off.items():
        if not value <= TOLERANCE * (1.0 if name == 'position' else 10.0):
            raise Failure('figure', f'{name} is off by {value:.3g}')
    return off


def _rod(known: _Known, times: Any) -> Any:
    """Angles of the rod at times, integrated between the corners of the law."""

    def rate(t: float, y: Any) -> list[float]:
        x, v, a = known.motion(t)
        ax = _LENGTH * (-a * math.sin(x) - v * v * math.cos(x))
        ay = _LENGTH * (a * math.cos(x) - v * v * math.sin(x))
        across = -ax * math.sin(y[0]) + (ay + _GRAVITY) * math.cos(y[0])
        return [y[1], -_MASS * _COG * across / (_INERTIA + _MASS * _COG**2)]

    ends = sorted({0.0, *known.corners, known.duration})
    y, found = [-1.4, 0.0], np.zeros(len(times))
    for begin, end in pairwise(ends):
        shrink = 1e-13 * max(1.0, end)  # within, so that the law on either side is its own
        inside = (times >= begin) & (times <= end)
        if end - begin <= 4.0 * shrink:
            continue
        run = solve_ivp(
            lambda t, y, a=begin + shrink, b=end - shrink: rate(min(max(t, a), b), y),
            (begin, end), y, 'DOP853', rtol=1e-12, atol=1e-13, dense_output=True,
        )  # fmt: skip
        if inside.any():
            found[inside] = run.sol(times[inside])[0]
        y = run.y[:, -1]
    return found


def _draft(random: Random, k: int) -> Draft:
    return _drawn(random, k)[0]


FAMILIES = (Family('position_laws', 60, _draft, judge=_judge),)
