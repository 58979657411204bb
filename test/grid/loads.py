"""Machines under loads of any width and order, whose figures follow from another route.

Ideal cranks and yokes have closed forms, whose integrals SciPy's adaptive quadrature takes with
the places of all pulses and steps. Wheels and sliders that are free are integrated by DOP853, in
stretches that begin and end beside pulses, and in steps that are short within.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad_vec, solve_ivp

from mechanism_sim.cycles.measures import measure
from mechanism_sim.hybrid.solution import Solution
from mechanism_sim.numerics.fourier import spectrum
from mechanism_sim.scene import Machine
from test.grid.case import Draft, Failure, Family, Random, Scene

Array = NDArray[np.float64]

TOLERANCE = 1e-8
"""Of a figure: how far it may be off the second route, if a run does not say more."""

_REACH = 9.0  # widths, beyond which a pulse is nothing to rounding
_HARMONICS = 6
_FIGURES = 'mean', 'rms', 'highest', 'lowest'


class Term(NamedTuple):
    """A part of a load: what it is a function of, and how."""

    kind: str  #: pulse, bell, ramp, step, wave, table
    of: str  #: name of a variable in formulas
    size: float
    place: float
    width: float  #: of a wave 1 over its order

    @property
    def text(self) -> str:
        """The formula."""
        away = f'({self.of} - {self.place})/{self.width}'
        return {
            'pulse': f'{self.size}*exp(-({away})**2)',
            'bell': f'{self.size}/(1 + ({away})**2)',
            'ramp': f'{self.size}*tanh({away})',
            'step': f'({self.size} if {self.of} > {self.place} else 0)',
            'wave': f'{self.size}*sin({away})',
            'table': f'{self.size}*triangle({away})',
        }[self.kind]

    def value(self, x: Array) -> Array:
        """Of the variable."""
        away = (x - self.place) / self.width
        if self.kind == 'step':
            return np.where(x > self.place, self.size, 0.0)
        shapes: Mapping[str, Callable[[Array], Array]] = {
            'pulse': lambda u: np.exp(-np.minimum(u * u, 700.0)),
            'bell': lambda u: 1.0 / (1.0 + u * u),
            'ramp': np.tanh,
            'wave': np.sin,
            'table': lambda u: np.maximum(1.0 - np.abs(u), 0.0),
        }
        return np.asarray(self.size * shapes[self.kind](away))

    @property
    def edges(self) -> list[float]:
        """Places between which a quadrature finds it smooth."""
        if self.kind == 'wave':
            return []
        if self.kind == 'step':
            return [self.place]
        away = [0.0, 1.0] if self.kind == 'table' else [0.0, 1.0, 3.0, _REACH, 30.0, 300.0]
        return sorted({self.place + sign * u * self.width for u in away for sign in (-1.0, 1.0)})


TRIANGLE = {'triangle': {'points': [[-1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]}}


def _terms(random: Random, names: Sequence[tuple[str, float, float]], size: float) -> list[Term]:
    """One to three terms of variables that run from a value to another."""
    found = []
    for _ in range(int(random.integers(1, 4))):
        name, low, high = names[int(random.integers(len(names)))]
        kind = str(random.choice(['pulse', 'pulse', 'bell', 'ramp', 'step', 'wave', 'table']))
        place = float(random.uniform(low + 0.15 * (high - low), high - 0.15 * (high - low)))
        width = float(10.0 ** random.uniform(-4.0, 0.0)) * min(1.0, 0.1 * (high - low))
        if kind == 'wave':
            width = 1.0 / float(random.integers(1, 501))
            if name == 't':
                width /= 5.0
        amount = size * float(random.uniform(0.2, 1.0)) * (1.0 if random.random() < 0.5 else -1.0)
        found.append(Term(kind, name, amount, place, width))
    return found


def _formula(terms: Sequence[Term]) -> str:
    return ' + '.join(x.text for x in terms)


def _sum(terms: Sequence[Term], known: Mapping[str, Any]) -> Array:
    return np.asarray(sum(x.value(known[x.of]) for x in terms))


# --- ideal machines ------------------------------------------------------------------------------


class _Ideal(NamedTuple):
    """A crank that turns steadily, and what its drive must supply at times t (N,)."""

    speed: float
    torque: Callable[[Array], Array]
    edges: list[float]  #: [s]


def _crank(random: Random, _: int) -> tuple[Draft, _Ideal]:
    speed, mass, arm = float(random.uniform(5.0, 40.0)), 1.0, float(random.uniform(0.0, 0.2))
    turn = 2.0 * math.pi
    terms = _terms(random, [('crank', 0.0, turn), ('t', 0.0, turn / speed)], 5.0)
    scene: Scene = {
        'title': 'a crank', 'mechanism': 'linkage', 'gravity': [0.0, -9.81], 'tables': TRIANGLE,
        'links': {'ground': {},
                  'crank': {'mass': mass, 'inertia': 0.01, 'cog': arm, 'length': 0.2}},
        'joints': {'O': {'revolute': ['ground', 'crank.start']}},
        'loads': {'f': {'at': 'crank', 'torque': _formula(terms)}},
        'drive': {'coordinate': 'crank', 'speed': f'{speed} rad/s', 'start_angle': 0.0},
    }  # fmt: skip

    def torque(t: Array) -> Array:
        known = {'crank': speed * t, 't': t}
        return np.asarray(mass * 9.81 * arm * np.cos(speed * t) - _sum(terms, known))

    edges = [x / speed if term.of == 'crank' else x for term in terms for x in term.edges]
    return Draft(scene, revolutions=1.0), _Ideal(speed, torque, edges)


def _yoke(random: Random, _: int) -> tuple[Draft, _Ideal]:
    """A Scotch yoke: ``x = r cos q`` exactly; loads on its yoke over its place and the time."""
    speed, r, mass = float(random.uniform(5.0, 40.0)), 0.05, 1.5
    turn = 2.0 * math.pi
    terms = _terms(random, [('yoke', -r, r), ('t', 0.0, turn / speed)], 50.0)
    terms = [x._replace(width=x.width * r if x.of == 'yoke' else x.width) for x in terms]
    own = _terms(random, [('crank', 0.0, turn)], 2.0)
    scene: Scene = {
        'title': 'a yoke', 'mechanism': 'linkage', 'gravity': [0.0, 0.0], 'tables': TRIANGLE,
        'links': {'crank': {'length': r, 'cog': 0.0, 'mass': 0.8, 'inertia': 7e-4},
                  'yoke': {'mass': mass}},
        'joints': {'ground_crank': {'revolute': ['ground', 'crank']},
                   'crank_yoke': {'slot': ['crank.end', 'yoke'], 'axis': '90 deg'},
                   'ground_yoke': {'prismatic': ['ground', 'yoke']}},
        'loads': {'f': {'at': 'yoke', 'force': [_formula(terms), 0.0]},
                  'g': {'at': 'crank', 'torque': _formula(own)}},
        'drive': {'coordinate': 'crank', 'speed': f'{speed} rad/s', 'start_angle': 0.0},
        'guess': {'yoke': f'{r} m'},
    }  # fmt: skip

    def torque(t: Array) -> Array:
        q = speed * t
        x, slope = r * np.cos(q), -r * np.sin(q)
        force = -mass * speed * speed * x - _sum(terms, {'yoke': x, 't': t})
        return np.asarray(force * slope - _sum(own, {'crank': q}))

    edges = [x / speed for term in own for x in term.edges]
    for term in terms:
        for x in term.edges:
            if term.of == 't':
                edges.append(x)
            elif abs(x) < r:
                q = math.acos(x / r)
                edges += [q / speed, (turn - q) / speed]
    return Draft(scene, revolutions=1.0), _Ideal(speed, torque, edges)


def _judge_ideal(ideal: _Ideal, machine: Machine, solution: Solution) -> dict[str, float]:
    period = 2.0 * math.pi / ideal.speed
    inner = sorted({x for x in ideal.edges if 0.0 < x < period})
    w = ideal.speed

    def integrand(t: float) -> Array:
        T = float(ideal.torque(np.array(t)))
        waves = [np.exp(-1j * k * w * t) * T for k in range(1, _HARMONICS + 1)]
        return np.array([T, T * T, abs(T), *(x.real for x in waves), *(x.imag for x in waves)])

    nodes = np.concatenate([[0.0], inner, np.linspace(0.0, period, 9)[1:]])
    nodes = np.unique(nodes)
    found = sum(
        quad_vec(integrand, a, b, epsabs=1e-14, epsrel=1e-11, limit=20000, norm='max')[0]
        for a, b in pairwise(nodes.tolist())
    )
    mean, square, size = found[:3] / period
    highest = _highest(ideal.torque, nodes)
    lowest = -_highest(lambda at: -ideal.torque(at), nodes)
    largest = max(abs(highest), abs(lowest))
    wanted = {
        'mean': mean, 'rms': math.sqrt(square), 'highest': highest,
        'lowest': lowest,
    }  # fmt: skip
    names = [f'{name}(drive_torque)' for name in _FIGURES]
    seen = {
        name: float(x.value)
        for name, x in zip(_FIGURES, measure(machine, solution, *names), strict=True)
    }
    scale = {
        'mean': size,
        'rms': wanted['rms'],
        **dict.fromkeys(('highest', 'lowest'), largest),
    }
    off = {f'off.{name}': abs(seen[name] - wanted[name]) / scale[name] for name in _FIGURES}
    assert solution.energy is not None
    work = solution.energy.drive_work
    off['off.work'] = max(abs(work - mean * period * w) - solution.energy.error, 0.0) / (
        size * period * w
    )
    harmonics = found[3 : 3 + _HARMONICS] + 1j * found[3 + _HARMONICS :]
    starts = np.append(solution.motion.curve.start, period)
    own = spectrum(lambda at: solution.sample(at)['drive_torque'][None], starts, _HARMONICS)
    amplitudes = np.asarray(own.amplitudes)[0]
    off['off.harmonics'] = float(np.abs(amplitudes - 2.0 * harmonics / period).max()) / size
    return off


def _highest(f: Callable[[Array], Array], nodes: Array) -> float:
    """Of a function between nodes: from a grid, and ever finer ones beside its best places."""
    t = np.concatenate([np.linspace(a, b, 4000) for a, b in pairwise(nodes.tolist())])
    width = np.concatenate([np.full(4000, (b - a) / 3999) for a, b in pairwise(nodes.tolist())])
    values = f(t)
    best = np.argsort(values)[-400:]
    at, step = t[best], width[best]
    for _ in range(8):
        near = np.clip(at[:, None] + step[:, None] * np.linspace(-1.0, 1.0, 21), 0.0, nodes[-1])
        seen = f(near.ravel()).reshape(near.shape)
        at, step = near[np.arange(len(at)), seen.argmax(axis=1)], 0.1 * step
    return float(seen.max())


# --- machines that are free ----------------------------------------------------------------------


class _Free(NamedTuple):
    """A coordinate that loads move: ``inertia x'' = f(x, x', t)``."""

    name: str
    inertia: float
    start: tuple[float, float]  #: place, rate
    duration: float
    terms: list[Term]
    names: Mapping[str, str]  #: of variables: x, v or t

    def force(self, t: Any, x: Any, v: Any) -> Array:
        """All of the loads."""
        known = {name: {'x': x, 'v': v, 't': t}[what] for name, what in self.names.items()}
        return _sum(self.terms, known)


def _wheel(random: Random, _: int) -> tuple[Draft, _Free]:
    speed, inertia, T = float(random.uniform(5.0, 40.0)), float(random.uniform(0.02, 0.2)), 0.3
    angle = speed * T
    names = [('wheel', 0.0, angle), ('t', 0.0, T), ('wheel_rate', 0.9 * speed, 1.1 * speed)]
    terms = _terms(random, names, 0.5)
    scene: Scene = {
        'title': 'a wheel', 'mechanism': 'linkage', 'tables': TRIANGLE,
        'links': {'ground': {}, 'wheel': {'mass': 1.0, 'inertia': inertia}},
        'joints': {'O': {'revolute': ['ground', 'wheel']}},
        'loads': {f'f{k}': {'at': 'wheel', 'torque': x.text} for k, x in enumerate(terms)},
        'drive': {'coordinate': 'wheel', 'speed': f'{speed} rad/s', 'torque': {}},
    }  # fmt: skip
    names_of = {'wheel': 'x', 't': 't', 'wheel_rate': 'v'}
    return Draft(scene, duration=T), _Free('wheel', inertia, (0.0, speed), T, terms, names_of)


def _slider(random: Random, _: int) -> tuple[Draft, _Free]:
    speed, mass, T = float(random.uniform(0.5, 3.0)), float(random.uniform(0.2, 5.0)), 1.0
    names = [('x', 0.0, speed * T), ('t', 0.0, T), ('vx', 0.9 * speed, 1.1 * speed)]
    terms = _terms(random, names, mass * speed)
    scene: Scene = {
        'title': 'a slider', 'mechanism': 'linkage', 'tables': TRIANGLE,
        'links': {'block': {'mass': mass}},
        'joints': {'guide': {'prismatic': ['ground', 'block']}},
        'loads': {'f': {'at': 'block', 'force': [_formula(terms), 0.0]}},
        'drive': {'coordinate': 'block', 'speed': f'{speed} m/s', 'force': {}},
    }  # fmt: skip
    names_of = {'x': 'x', 't': 't', 'vx': 'v'}
    return Draft(scene, duration=T), _Free('block', mass, (0.0, speed), T, terms, names_of)


def _judge_free(free: _Free, solution: Solution) -> dict[str, float]:
    x, v = _integrated(free)
    T = free.duration
    seen = solution.sample(np.array([T]))
    name = free.name
    size = max(abs(free.start[1]), abs(v))
    return {
        'off.position': abs(float(seen[f'position.{name}'][0]) - x) / (size * T),
        'off.velocity': abs(float(seen[f'velocity.{name}'][0]) - v) / size,
    }


def _integrated(free: _Free) -> tuple[float, float]:
    """Place and rate at the end, by DOP853 from one edge of a term to the next."""
    borders = [(free.names[x.of], edge) for x in free.terms for edge in x.edges]

    def of(what: str, t: float, y: Array) -> float:
        return float({'t': t, 'x': y[0], 'v': y[1]}[what])

    def rate(t: float, y: Array) -> list[float]:
        return [float(y[1]), float(free.force(t, y[0], y[1])) / free.inertia]

    def event(what: str, edge: float) -> Callable[[float, Array], float]:
        def away(t: float, y: Array) -> float:
            return of(what, t, y) - edge

        away.terminal = True  # type: ignore[attr-defined] # read by SciPy
        return away

    t, y = 0.0, np.array(free.start)
    while t < free.duration:
        slopes = {'t': 1.0, 'x': abs(y[1]), 'v': abs(rate(t, y)[1])}
        longest = free.duration
        for x in free.terms:
            what = free.names[x.of]
            near = abs(of(what, t, y) - x.place)
            if x.kind in ('pulse', 'bell', 'ramp', 'table'):
                longest = min(longest, max(0.2 * x.width, 0.2 * near) / max(slopes[what], 1e-9))
        end = min(free.duration, t + 5.0 * longest)
        events = [
            event(*b) for b in borders if abs(of(b[0], t, y) - b[1]) > 1e-13 * max(1.0, abs(b[1]))
        ]
        found = solve_ivp(
            rate, (t, end), y, 'DOP853', rtol=1e-12, atol=1e-13, max_step=longest, events=events
        )
        t, y = float(found.t[-1]), found.y[:, -1]
    return float(y[0]), float(y[1])


# --- the family ----------------------------------------------------------------------------------

_KINDS = (_crank, _yoke, _wheel, _slider)


def _made(random: Random, k: int) -> tuple[Draft, Any]:
    return _KINDS[k % len(_KINDS)](random, k)


def _draft(random: Random, k: int) -> Draft:
    return _made(random, k)[0]


def _judge(random: Random, k: int, machine: Machine, solution: Solution) -> dict[str, float]:
    """Figures against the second route."""
    _, known = _made(random, k)
    if isinstance(known, _Ideal):
        off = _judge_ideal(known, machine, solution)
    else:
        off = _judge_free(known, solution)
    worst = max(off, key=lambda name: off[name])
    if not off[worst] <= TOLERANCE:
        raise Failure('figure', f'{worst.removeprefix("off.")} is off by {off[worst]:.3g}: {off}')
    return off


FAMILIES = (Family('loads', 200, _draft, judge=_judge),)
