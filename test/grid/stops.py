"""Machines with stops, discs and bars that touch, and welds, rigid and compliant, with friction.

Levers and blocks that are rigid and have no friction have a second route: SciPy from one impact to
the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Machine
from test.grid.case import Draft, Failure, Family, Random, Scene
from test.grid.four_bars import decades, pick

Array = NDArray[np.float64]

TOLERANCE = 1e-9
"""How far times [s], and impulses relative to the largest, may be off the second route."""
_COMPARED = 4
"""Impacts, from the first on, that are compared: later ones amplify rounding."""
_G = 9.81


class Route(NamedTuple):
    """Coordinates q with inertias that do not change, and gaps between them."""

    start: Array  #: (2 n,) places and rates
    inertia: Array  #: (n,)
    force: Callable[[Array], Array]  #: of the places
    gaps: Sequence[Callable[[Array], tuple[float, Array]]]  #: value and gradient
    restitution: float
    duration: float

    def hits(self) -> list[tuple[float, int, float]]:
        """Time, number of the gap and impulse of the first impacts."""
        n, t, y = len(self.inertia), 0.0, self.start.copy()
        found: list[tuple[float, int, float]] = []

        def rates(_: float, y: Array) -> Array:
            return np.concatenate([y[n:], self.force(y[:n]) / self.inertia])

        def event(gap: Callable[[Array], tuple[float, Array]]) -> Any:
            def value(_: float, y: Array) -> float:
                return gap(y[:n])[0]

            value.terminal, value.direction = True, -1.0  # type: ignore[attr-defined]
            return value

        while t < self.duration and len(found) < _COMPARED:
            part = solve_ivp(
                rates, (t, self.duration), y, 'DOP853', rtol=1e-13, atol=1e-14, max_step=0.02,
                events=[event(gap) for gap in self.gaps],
            )  # fmt: skip
            t, y = float(part.t[-1]), part.y[:, -1].copy()
            if part.status != 1:
                break
            k = next(i for i, times in enumerate(part.t_events) if len(times))
            row = self.gaps[k](y[:n])[1]
            impulse = -(1.0 + self.restitution) * (row @ y[n:]) / (row @ (row / self.inertia))
            y[n:] += row / self.inertia * impulse
            found.append((t, k, float(impulse)))
        return found


def _contact(random: Random, k: int) -> Scene:
    """Restitution; every third is compliant."""
    e = float(random.uniform(0.2, 0.95))
    found: Scene = {'restitution': e, 'hypothesis': pick(random, ('newton', 'poisson', 'stronge'))}
    if k % 3 == 2:
        law = pick(random, ('hertz', 'hunt_crossley', 'lankarani_nikravesh', 'flores'))
        found['contact'] = {'law': law, 'stiffness': decades(random, 5.0, 8.0)}
    return found


def _lever(random: Random, length: float) -> Scene:
    return {
        'length': length, 'mass': float(random.uniform(0.2, 2.0)),
        'inertia': float(random.uniform(0.001, 0.05)), 'cog': float(random.uniform(0.0, length)),
    }  # fmt: skip


def _pendulum(random: Random, k: int) -> tuple[Draft, Route | None]:
    """A lever between two stops, or before one; every second on the end of a welded one."""
    arm, e, radius = _lever(random, 0.5), _contact(random, k // 8), float(random.uniform(0.1, 1.0))
    low, high = sorted(float(x) for x in random.uniform(-3.0, 3.0, 2))
    high = max(high, low + 0.1)
    start, rate = float(random.uniform(low, high)), float(random.uniform(-8.0, 8.0))
    stops: Scene = {'lower': low, 'upper': high, 'radius': radius, **e}
    if k // 8 % 2:
        del stops[pick(random, ('lower', 'upper'))]
    scene: Scene = {
        'title': 'a lever between stops', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': {'ground': {}, 'arm': arm},
        'joints': {'p': {'revolute': ['ground', 'arm'], 'stops': stops}},
        'initial': {'position': {'arm': start}, 'velocity': {'arm': rate}},
    }  # fmt: skip
    m, s = arm['mass'], arm['cog']
    J = arm['inertia'] + m * s * s
    if k // 8 % 4 > 1:  # a link beside it, welded
        tip = _lever(random, 0.2)
        scene['links']['tip'] = tip
        scene['joints']['w'] = {'fixed': ['arm.end', 'tip'], 'angle': 0.0}
        m, s = m + tip['mass'], (m * s + tip['mass'] * (0.5 + tip['cog'])) / (m + tip['mass'])
        J += tip['inertia'] + tip['mass'] * (0.5 + tip['cog']) ** 2
    if 'contact' in stops:
        return Draft(scene, duration=1.0), None
    one = np.array([radius])
    gaps: list[Callable[[Array], tuple[float, Array]]] = []
    if 'lower' in stops:
        gaps.append(lambda q: (radius * (q[0] - low), one))
    if 'upper' in stops:
        gaps.append(lambda q: (radius * (high - q[0]), -one))
    return Draft(scene, duration=1.0), Route(
        np.array([start, rate]), np.array([J]), lambda q: -m * _G * s * np.cos(q), gaps,
        e['restitution'], 1.0,
    )  # fmt: skip


def _block(random: Random, k: int) -> tuple[Draft, Route | None]:
    """A block on a spring between the ends of its guide."""
    e, mass, stiffness = _contact(random, k // 8), *random.uniform([0.2, 10.0], [3.0, 200.0])
    slope, low, high = (float(x) for x in random.uniform([-3.0, -0.4, 0.05], [3.0, -0.05, 0.4]))
    start, rate = float(random.uniform(low, high)), float(random.uniform(-3.0, 3.0))
    scene: Scene = {
        'title': 'a block between stops', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': {'ground': {}, 'block': {'mass': mass}},
        'joints': {'g': {'prismatic': ['ground', 'block'], 'axis': slope,
                         'stops': {'lower': low, 'upper': high, **e}}},
        'loads': {'spring': {'at': 'block', 'force': [f'-{stiffness}*x', f'-{stiffness}*y']}},
        'initial': {'position': {'block': start}, 'velocity': {'block': rate}},
    }  # fmt: skip
    frictional = k // 8 % 4 == 3
    if frictional:
        scene['joints']['g']['friction'] = {'coefficient': float(random.uniform(0.05, 0.5))}
    if frictional or 'contact' in e:
        return Draft(scene, duration=1.0), None
    one = np.ones(1)
    return Draft(scene, duration=1.0), Route(
        np.array([start, rate]), np.array([mass]),
        lambda q: -stiffness * q - mass * _G * math.sin(slope),
        [lambda q: (q[0] - low, one), lambda q: (high - q[0], -one)], e['restitution'], 1.0,
    )  # fmt: skip


def _detent(random: Random, k: int) -> tuple[Draft, Route | None]:
    """Two levers with round ends, one on a torsion spring."""
    one, two, e = _lever(random, 0.15), _lever(random, 0.1), _contact(random, k // 8)
    r1, r2 = (float(x) for x in random.uniform(0.005, 0.02, 2))
    stiffness, rest = float(random.uniform(0.5, 5.0)), float(random.uniform(1.8, 2.4))
    start, rate = np.array([1.5, rest]), float(random.uniform(-8.0, -3.0))
    joint: Scene = {'contact': ['lever.end', 'arm.end'], 'radii': [r1, r2], **e}
    if 'contact' in e:
        joint['contact'], joint['compliance'] = ['lever.end', 'arm.end'], e['contact']
    frictional = k // 8 % 4 == 1
    if frictional:
        joint['friction'] = {'coefficient': float(random.uniform(0.05, 0.5))}
    scene: Scene = {
        'title': 'a detent', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': {'ground': {'points': {'b': [0.2, 0.0]}}, 'lever': one, 'arm': two},
        'joints': {'a': {'revolute': ['ground', 'lever']},
                   'b': {'revolute': ['ground.b', 'arm']}, 'c': joint},
        'springs': {'s': {'between': ['ground', 'arm'], 'stiffness': f'{stiffness} N m/rad',
                          'free_angle': rest}},
        'initial': {'position': {'lever': start[0], 'arm': start[1]},
                    'velocity': {'lever': rate}},
    }  # fmt: skip
    if frictional or 'contact' in e:
        return Draft(scene, duration=0.5), None
    m, s = (np.array([x[key] for x in (one, two)]) for key in ('mass', 'cog'))
    J = np.array([x['inertia'] for x in (one, two)]) + m * s * s

    def force(q: Array) -> Array:
        spring = np.array([0.0, stiffness * (q[1] - rest)])
        return np.asarray(-m * _G * s * np.cos(q) - spring)

    def gap(q: Array) -> tuple[float, Array]:
        (c1, c2), (s1, s2) = np.cos(q), np.sin(q)
        apart = np.array([0.15 * c1 - 0.2 - 0.1 * c2, 0.15 * s1 - 0.1 * s2])
        slopes = np.array([[-0.15 * s1, 0.1 * s2], [0.15 * c1, -0.1 * c2]])
        far = float(np.hypot(*apart))
        return far - r1 - r2, apart @ slopes / far

    begun = np.array([*start, rate, 0.0])
    return Draft(scene, duration=0.5), Route(begun, J, force, [gap], e['restitution'], 0.5)


def _balls(random: Random, k: int) -> tuple[Draft, None]:
    """One or two balls that fall on a bar, on each other and off its end."""
    e = _contact(random, k // 8)
    law = {'compliance': e.pop('contact')} if 'contact' in e else {}
    slope, far = float(random.uniform(-0.5, 0.5)), float(random.uniform(0.3, 1.0))
    rough: Scene = {}
    if k // 8 % 2:
        rough = {'friction': {'coefficient': float(random.uniform(0.05, 0.8))}}
    surface = {**e, **law, **rough}
    links: Scene = {'ground': {'points': {
        'l': [-far, -far * math.sin(slope)], 'r': [far, far * math.sin(slope)]}}}  # fmt: skip
    joints: Scene = {}
    position: Scene = {}
    count = 1 + k // 8 % 3 // 2
    for i in range(count):
        ball, r = f'ball{i}', float(random.uniform(0.03, 0.1))
        links[ball] = {'mass': float(random.uniform(0.1, 2.0)), 'inertia': decades(random, -4, -2)}
        joints[f'c{i}'] = {'contact': [ball, 'ground.l'], 'to': 'ground.r', 'radii': [r, 0.02],
                           **surface}  # fmt: skip
        position |= {f'{ball}.x': float(random.uniform(-0.2, 0.2)), f'{ball}.y': 0.4 + 0.3 * i}
        if i:
            joints['between'] = {'contact': ['ball0', 'ball1'], 'radii': [0.05, 0.05], **surface}
    scene: Scene = {
        'title': 'balls on a bar', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': links, 'joints': joints,
        'initial': {'position': position,
                    'velocity': {'ball0.x': float(random.uniform(-1.0, 1.0))}},
    }  # fmt: skip
    return Draft(scene, duration=0.8), None


def _elbow(random: Random, k: int) -> tuple[Draft, None]:
    """A double pendulum whose elbow does not turn over."""
    e = _contact(random, k // 8)
    low = float(random.uniform(-2.5, -0.5))
    scene: Scene = {
        'title': 'an elbow', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': {'ground': {}, 'upper': _lever(random, 0.4), 'fore': _lever(random, 0.3)},
        'joints': {'shoulder': {'revolute': ['ground', 'upper']},
                   'elbow': {'revolute': ['upper.end', 'fore'],
                             'stops': {'lower': low, 'upper': 0.0, **e}}},
        'initial': {'position': {'upper': float(random.uniform(-3.0, 3.0)), 'fore': 0.0},
                    'velocity': {'upper': float(random.uniform(-5.0, 5.0))}},
    }  # fmt: skip
    scene['initial']['position']['fore'] = (
        scene['initial']['position']['upper'] + float(random.uniform(0.1, 0.9)) * low
    )
    return Draft(scene, duration=1.0), None


def _slot(random: Random, k: int) -> tuple[Draft, None]:
    """A pin that swings in a slot with ends, with play in it or without."""
    e, pin = _contact(random, k // 8), _lever(random, 0.3)
    stops: Scene = {'lower': -0.1, 'upper': float(random.uniform(0.05, 0.3)), **e}
    if k // 8 % 2:
        stops |= {'friction': float(random.uniform(0.05, 0.5)), 'pin_radius': 0.01}
    joint: Scene = {'slot': ['pin', 'ground'], 'axis': float(random.uniform(-1.0, 1.0)),
                    'stops': stops}  # fmt: skip
    if k // 8 % 4 == 2:
        joint['clearance'] = {'radial': decades(random, -4.0, -3.0), 'restitution': 0.5}
        if 'contact' in e:
            joint['clearance']['contact'] = e['contact']
    scene: Scene = {
        'title': 'a pin in a slot with ends', 'mechanism': 'linkage', 'gravity': [0.0, -_G],
        'links': {'ground': {}, 'pin': pin}, 'joints': {'s': joint}, 'start': 'centred',
        'initial': {'position': {'pin': 0.0, 'pin.x': pin['cog'], 'pin.y': 0.0},
                    'velocity': {'pin': float(random.uniform(-5.0, 5.0))}},
    }  # fmt: skip
    return Draft(scene, duration=0.8), None


def _four_bar(random: Random, k: int) -> tuple[Draft, None]:
    """A four-bar that a torque turns until its rocker meets a stop."""
    e = _contact(random, k // 8)
    bar: Scene = {'mass': 1.0, 'inertia': 0.01, 'cog': 0.15}
    scene: Scene = {
        'title': 'a four-bar against a stop', 'mechanism': 'linkage',
        'links': {'ground': {'points': {'pivot': [0.387, 0.0]}},
                  'crank': {'length': 0.064, 'mass': 1.0, 'inertia': 0.001, 'cog': 0.032},
                  'coupler': {'length': 0.309, **bar}, 'rocker': {'length': 0.312, **bar}},
        'joints': {'ground_crank': {'revolute': ['ground', 'crank']},
                   'crank_coupler': {'revolute': ['crank.end', 'coupler']},
                   'coupler_rocker': {'revolute': ['coupler.end', 'rocker.end']},
                   'rocker_ground': {'revolute': ['ground.pivot', 'rocker'], 'stops': {
                       'lower': 1.6, 'upper': float(random.uniform(2.15, 2.3)), **e}}},
        'drive': {'torque': {'constant': float(random.uniform(0.1, 1.0)), 'per_speed': -0.01}},
        'guess': {'coupler': 1.0, 'rocker': 2.0}, 'start': 'centred',
    }  # fmt: skip
    if k // 8 % 2:
        loose: Scene = {'radial': decades(random, -4.0, -3.3), 'restitution': 0.5}
        if 'contact' in e:
            loose['contact'] = e['contact']
        scene['joints']['coupler_rocker']['clearance'] = loose
    return Draft(scene, duration=0.6), None


def _cart(random: Random, k: int) -> tuple[Draft, None]:
    """A hammer on a cart: a stop in the second of two guides, a bumper before the first."""
    e = _contact(random, k // 8)
    bumper = {**e, 'compliance': e['contact']} if 'contact' in e else dict(e)
    bumper['contact'] = ['cart', 'ground.wall']
    scene: Scene = {
        'title': 'a cart against a bumper', 'mechanism': 'linkage',
        'links': {'ground': {'points': {'wall': [0.5, 0.0]}},
                  'cart': {'mass': float(random.uniform(0.5, 5.0))},
                  'hammer': {'mass': float(random.uniform(0.5, 5.0))}},
        'joints': {'rail': {'prismatic': ['ground', 'cart']},
                   'guide': {'prismatic': ['cart', 'hammer'], 'axis': 0.3,
                             'stops': {'lower': -0.1, 'upper': 0.1, **e}},
                   'bumper': {**bumper, 'radii': [0.05, 0.1]}},
        'initial': {'velocity': {'cart': float(random.uniform(0.5, 3.0)),
                                 'hammer': float(random.uniform(-2.0, 2.0))}},
    }  # fmt: skip
    return Draft(scene, duration=1.0), None


_MAKERS: tuple[Callable[[Random, int], tuple[Draft, Route | None]], ...] = (
    _pendulum, _block, _detent, _balls, _elbow, _slot, _four_bar, _cart,
)  # fmt: skip


def _draft(random: Random, k: int) -> Draft:
    return _MAKERS[k % len(_MAKERS)](random, k)[0]


def _judge(random: Random, k: int, _: Machine, solution: Solution) -> dict[str, float]:
    """First impacts against those of the second route, where there is one."""
    route = _MAKERS[k % len(_MAKERS)](random, k)[1]
    if route is None:
        return {}
    hits, found = route.hits(), solution.impacts[:_COMPARED]
    if len(hits) != len(found):
        raise Failure('impacts', f'{len(found)} impacts, by the second route {len(hits)}')
    largest = max((impulse for *_, impulse in hits), default=1.0)
    off = {
        'time': max(
            (abs(float(h.t) - t) for h, (t, *_) in zip(found, hits, strict=True)), default=0.0
        ),
        'impulse': max(
            (abs(h.normal_impulse - p) / largest for h, (*_, p) in zip(found, hits, strict=True)),
            default=0.0,
        ),
    }
    worst = max(off, key=lambda name: off[name])
    if not off[worst] <= TOLERANCE:
        raise Failure('figure', f'{worst} is off by {off[worst]:.3g}')
    return off


FAMILIES = (Family('stops', 64, _draft, structures=8, judge=_judge),)
