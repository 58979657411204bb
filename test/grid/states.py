"""Force elements and states of first order of any size, against other routes.

Circuits are linear: an exponential of their matrix. All else (servos at their limits, stops,
dampers by tables, valves that reverse, gas) is integrated from event to event by DOP853.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Machine
from test.grid.case import Draft, Failure, Family, Random, Scene
from test.routes.switched import switched

Array = NDArray[np.float64]

TOLERANCE = 1e-8
"""Of a figure at the end of a run, in its scale."""

_G = 9.81


class _Right(NamedTuple):
    """Quantities at the end of a run, by another route."""

    names: list[str]
    value: Callable[[], Array]
    scale: Array


def _block(mass: float, axis: str = '0 deg', **parts: Any) -> Scene:
    return {
        'title': 'a block', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': {'ground': {}, 'block': {'mass': mass, 'inertia': 0.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block'], 'axis': axis}}, **parts,
    }  # fmt: skip


def _arm(mass: float, inertia: float, cog: float, **parts: Any) -> Scene:
    return {
        'title': 'an arm', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': {'ground': {'points': {'low': [0.05, -0.25]}},
                  'arm': {'mass': mass, 'inertia': inertia, 'cog': cog, 'length': 0.3}},
        'joints': {'pivot': {'revolute': ['ground', 'arm']}}, **parts,
    }  # fmt: skip


def _circuit(random: Random) -> tuple[Draft, _Right]:
    """One to three states in a linear circuit with a block on a spring, under a sine."""
    n, end = int(random.integers(1, 4)), 1.0
    mass, k, c = random.uniform(0.5, 3.0), random.uniform(20.0, 300.0), random.uniform(0.1, 3.0)
    w = float(random.uniform(1.0, 20.0))
    A = np.zeros((4 + n, 4 + n))  # of x, v, the states, sin(w t), cos(w t)
    A[2 : 2 + n, 2 : 2 + n] = random.uniform(-4.0, 4.0, (n, n)) - 5.0 * np.eye(n)
    A[2 : 2 + n, :2] = random.uniform(-3.0, 3.0, (n, 2))
    A[2 : 2 + n, 2 + n] = random.uniform(-5.0, 5.0, n)
    gains = random.uniform(-20.0, 20.0, n)
    A[0, 1], A[1, 0], A[1, 1], A[1, 2 : 2 + n] = 1.0, -k / mass, -c / mass, gains / mass
    A[2 + n, 3 + n], A[3 + n, 2 + n] = w, -w
    begin = random.uniform(-1.0, 1.0, n)
    known = ['block', 'block_rate', *(f's{i}' for i in range(n)), f'sin({w!r}*t)']
    states = {f's{i}': {'start': float(begin[i]), 'rate': _sum(A[2 + i], known)} for i in range(n)}
    scene = _block(
        float(mass), states=states,
        springs={'spring': {'coordinate': 'block', 'stiffness': f'{k!r} N/m',
                            'damping': f'{c!r} N s/m'}},
        loads={'push': {'at': 'block', 'force': [_sum(gains, known[2:]), 0.0]}},
    )  # fmt: skip
    names = ['position.block', 'velocity.block', *(f'state.s{i}' for i in range(n))]

    def value() -> Array:
        return np.asarray(expm(end * A) @ [0.0, 0.0, *begin, 0.0, 1.0])[: 2 + n]

    return Draft(scene, duration=end), _Right(names, value, np.ones(2 + n))


def _sum(factors: Any, names: list[str]) -> str:
    pairs = zip(np.asarray(factors).tolist(), names, strict=False)
    return ' + '.join(f'({x!r})*{name}'.replace('(-', '(0 - ') for x, name in pairs if x) or '0'


def _servo(random: Random) -> tuple[Draft, _Right]:
    """P, PD or PID on an arm, with a limit or without, to a target that may move."""
    mass, cog, inertia = random.uniform(0.5, 3.0), random.uniform(0.05, 0.2), 0.02
    J = inertia + mass * cog**2
    p = float(random.uniform(5.0, 40.0))
    i = float(random.choice([0.0, random.uniform(5.0, 40.0)]))
    d = float(random.uniform(0.2, 3.0))
    limit = float(random.choice([0.0, random.uniform(0.5, 2.5) * mass * _G * cog]))
    place, way, w = random.uniform(-1.0, 1.0), random.choice([0.0, 0.3]), random.uniform(1.0, 6.0)
    keys = {
        'coordinate': 'arm', 'p': f'{p!r} N m/rad', 'i': f'{i!r} N m/rad/s',
        'd': f'{d!r} N m s/rad',
        'target': _sum([place, way], ['1', f'sin({float(w)!r}*t)']),
        'target_rate': _sum([way * w], [f'cos({float(w)!r}*t)']),
        **({'limit': f'{limit!r} N m'} if limit else {}),
    }  # fmt: skip
    scene = _arm(float(mass), inertia, float(cog), servos={'servo': keys})

    def wanted(t: float, y: Array) -> tuple[float, float]:
        error = place + way * math.sin(w * t) - y[0]
        return p * error + d * (way * w * math.cos(w * t) - y[1]) + i * y[2], error

    def guards(t: float, y: Array) -> list[float]:
        return [wanted(t, y)[0] - limit, wanted(t, y)[0] + limit] if limit else []

    def rates(t: float, y: Array, above: Any) -> list[float]:
        effort, error = wanted(t, y)
        given = effort if not limit or not (above[0] or not above[1]) else (
            limit if above[0] else -limit)  # fmt: skip
        return [y[1], (given - mass * _G * cog * math.cos(y[0])) / J, error + (given - effort) / p]

    names = ['position.arm', 'velocity.arm', *(['state.servo.integral'] if i else [])]
    end = 1.5
    return Draft(scene, duration=end), _Right(
        names,
        lambda: switched(rates, guards, [0.0, 0.0, 0.0], end)[: len(names)],
        np.ones(len(names)),
    )


def _stops(random: Random) -> tuple[Draft, _Right]:
    """A block between a bump stop and a check strap, with a damper by a table."""
    mass, speed = float(random.uniform(0.5, 3.0)), float(random.uniform(1.0, 4.0))
    ends = float(random.uniform(-0.3, -0.1)), float(random.uniform(0.1, 0.3))
    k, c = random.uniform(500.0, 5000.0, 2).tolist(), random.uniform(0.0, 60.0, 2).tolist()
    x = np.array([-2.0, -0.3, 0.0, 0.3, 2.0])
    y = np.cumsum(random.uniform(0.1, 3.0, 5))
    y -= y[2]
    points = [[f'{a!r} m/s', f'{b!r} N'] for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    springs = {
        name: {'coordinate': 'block', 'free_length': at, 'stiffness': f'{k[n]!r} N/m',
               'damping': f'{c[n]!r} N s/m', 'acts': acts}
        for n, (name, at, acts) in enumerate(
            [('low', ends[0], 'below'), ('high', ends[1], 'above')])
    }  # fmt: skip
    springs['damper'] = {'coordinate': 'block', 'damping': 'table'}
    scene = _block(
        mass, springs=springs, tables={'table': {'points': points}},
        drive={'coordinate': 'block', 'speed': f'{speed!r} m/s', 'force': {}},
    )  # fmt: skip

    def pulls(s: Array) -> list[float]:
        return [k[n] * (s[0] - ends[n]) + c[n] * s[1] for n in (0, 1)]

    def guards(_: float, s: Array) -> list[float]:
        low, high = pulls(s)
        return [ends[0] - s[0], -low, s[0] - ends[1], high, *(s[1] - x)]

    def rates(_: float, s: Array, above: Any) -> list[float]:
        n = sum(above[4:])
        damped = y[0] if n == 0 else y[-1] if n == 5 else (
            y[n - 1] + (s[1] - x[n - 1]) * (y[n] - y[n - 1]) / (x[n] - x[n - 1]))  # fmt: skip
        low, high = pulls(s)
        force = damped + low * (above[0] and above[1]) + high * (above[2] and above[3])
        return [s[1], -force / mass]

    end = 1.0
    return Draft(scene, duration=end), _Right(
        ['position.block', 'velocity.block'],
        lambda: switched(rates, guards, [0.0, speed], end), np.ones(2),
    )  # fmt: skip


def _cylinder(random: Random) -> tuple[Draft, _Right]:
    """A cylinder that lifts an arm: a chamber, a valve that follows the arm with a lag."""
    mass, cog, inertia = float(random.uniform(20.0, 80.0)), 0.3, 2.0
    J, end = inertia + mass * cog**2, 0.6
    area, volume = 1e-3, float(random.uniform(2e-4, 6e-4))
    bulk, flow = float(random.uniform(2e8, 1e9)), float(random.uniform(2e-8, 8e-8))
    gain, lag = float(random.uniform(5.0, 20.0)), float(random.uniform(0.01, 0.05))
    target, damping = float(random.uniform(0.0, 0.2)), float(random.uniform(500.0, 3000.0))
    lever = 0.3 * 0.25 / math.hypot(0.25, 0.25)
    start = mass * _G * cog / (lever * area) * float(random.uniform(0.8, 1.2))
    supply = 4.0 * start
    scene = _arm(
        mass, inertia, cog,
        springs={'cylinder': {'between': ['ground.low', 'arm.end'],
                              'force': f'{damping!r}*rate - {area!r}*p'}},
        states={
            'p': {'start': f'{start!r} Pa', 'rate': (
                f'{bulk!r}/({volume!r} + {area!r}*(cylinder.length - 0.3))*({flow!r}*valve*sqrt('
                f'{supply!r} - p if valve > 0 else p) - {area!r}*cylinder.rate)')},
            'valve': {'start': 0.0, 'rate': f'({gain!r}*({target!r} - arm) - valve)/{lag!r}'},
        },
    )  # fmt: skip

    def rates(_: float, y: Array, above: Any) -> list[float]:
        q, v, p, valve = y
        rod = 0.3 * np.array([math.cos(q), math.sin(q)])
        d = rod - [0.05, -0.25]
        length = float(np.hypot(*d))
        rate = float(v * (rod[0] * d[1] - rod[1] * d[0]) / length)
        torque = -(damping * rate - area * p) * float(rod[0] * d[1] - rod[1] * d[0]) / length
        through = flow * valve * math.sqrt(supply - p if above[0] else p)
        return [
            v, (torque - mass * _G * cog * math.cos(q)) / J,
            bulk / (volume + area * (length - 0.3)) * (through - area * rate),
            (gain * (target - q) - valve) / lag,
        ]  # fmt: skip

    scale = np.array([1.0, 1.0, start, 1.0])
    return Draft(scene, duration=end), _Right(
        ['position.arm', 'velocity.arm', 'state.p', 'state.valve'],
        lambda: switched(rates, lambda _, y: [y[3]], [0.0, 0.0, start, 0.0], end, scale), scale,
    )  # fmt: skip


def _gas(random: Random) -> tuple[Draft, _Right]:
    """A block on a gas spring, damped by the square of its speed."""
    mass, n = float(random.uniform(1.0, 5.0)), float(random.choice([1.0, 1.2, 1.4]))
    column, force = float(random.uniform(0.1, 0.4)), mass * _G * float(random.uniform(0.6, 2.0))
    drag = float(random.uniform(0.0, 5.0))
    spring = {
        'coordinate': 'block', 'gas': {'force': force, 'column': column, 'exponent': n},
        'free_length': 0.4, 'force': f'{drag!r}*rate*abs(rate)', 'preload': '1 N',
    }  # fmt: skip
    scene = _block(
        mass, '90 deg', springs={'gas': spring}, initial={'position': {'block': '400 mm'}}
    )

    def rates(_: float, y: Array, above: Any) -> list[float]:
        push = force * (column / (column + y[0] - 0.4)) ** n
        drags = drag * y[1] ** 2 * (1.0 if above[0] else -1.0)
        return [y[1], (push - 1.0 - drags) / mass - _G]

    end = 1.0
    return Draft(scene, duration=end), _Right(
        ['position.block', 'velocity.block'],
        lambda: switched(rates, lambda _, y: [y[1]], [0.4, 0.0], end), np.ones(2),
    )  # fmt: skip


_MAKERS = _circuit, _servo, _stops, _cylinder, _gas


def _draft(random: Random, k: int) -> Draft:
    return _MAKERS[k % len(_MAKERS)](random)[0]


def _judge(random: Random, k: int, _: Machine, solution: Solution) -> dict[str, float]:
    """Errors of quantities at the end."""
    right = _MAKERS[k % len(_MAKERS)](random)[1]
    table = solution.sample(np.array([solution.duration]), *right.names)
    seen = np.array([table[name][0] for name in right.names])
    off = np.abs(seen - right.value()) / right.scale
    figures = {f'off.{name}': float(x) for name, x in zip(right.names, off, strict=True)}
    if not off.max() <= TOLERANCE:
        raise Failure('figure', f'off the second route: {figures}')
    return figures


FAMILIES = (Family('states', 60, _draft, judge=_judge),)
