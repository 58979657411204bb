"""Machines under loads of any width and order, whose figures follow from another route.

Ideal cranks and yokes have closed forms, whose integrals SciPy's adaptive quadrature takes with
the places of all pulses and steps. Wheels and sliders that are free are integrated by DOP853, in
stretches that begin and end beside pulses, and in steps that are short within.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad_vec, solve_ivp

from mechanism_sim.analysis.measure import measure
from mechanism_sim.numerics.fourier import spectrum
from mechanism_sim.results.run import Solution
from mechanism_sim.scene import Machine
from test.grid.case import Draft, Failure, Family, Random, Scene

Array = NDArray[np.float64]

TOLERANCE = 1e-8
"""Of a figure: how far it may be off the second route, if a run does not say more."""

_REACH = 9.0  # widths, beyond which a pulse is nothing to rounding
_HARMONICS = 6
_LEAST = 1e-9  # [N m, J] of a figure, where a load acts before or after
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
    """Cranks that turn steadily, and what each of d drives must supply at times t (N,)."""

    duration: float  #: [s]
    speeds: Mapping[str, float]  #: by the names of the cranks
    torques: Callable[[Array], Array]  #: (d, N)
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
        return np.array([mass * 9.81 * arm * np.cos(speed * t) - _sum(terms, known)])

    edges = [x / speed if term.of == 'crank' else x for term in terms for x in term.edges]
    return Draft(scene, revolutions=1.0), _Ideal(turn / speed, {'crank': speed}, torque, edges)


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
        return np.array([force * slope - _sum(own, {'crank': q})])

    edges = [x / speed for term in own for x in term.edges]
    for term in terms:
        for x in term.edges:
            if term.of == 't':
                edges.append(x)
            elif abs(x) < r:
                q = math.acos(x / r)
                edges += [q / speed, (turn - q) / speed]
    return Draft(scene, revolutions=1.0), _Ideal(turn / speed, {'crank': speed}, torque, edges)


def _arm(random: Random, _: int) -> tuple[Draft, _Ideal]:
    """Two links in a row, each driven steadily; loads of either over both angles and the time."""
    lengths = random.uniform(0.1, 0.3, 2)
    masses, centres = random.uniform(0.5, 2.0, 2), lengths * random.uniform(0.0, 1.0, 2)
    speeds = random.uniform(5.0, 40.0, 2) * random.choice([-1.0, 1.0], 2)
    starts = random.uniform(0.0, 1.0, 2)
    T = 2.0 * math.pi / float(np.abs(speeds).max())
    names = dict(zip(('crank', 'arm'), zip(starts, speeds, strict=True), strict=True))
    ranges = [(n, *sorted((q, q + w * T))) for n, (q, w) in names.items()]
    terms = [_terms(random, [*ranges, ('t', 0.0, T)], 5.0) for _ in names]
    scene: Scene = {
        'title': 'two driven links in a row', 'mechanism': 'linkage', 'gravity': [0.0, -9.81],
        'tables': TRIANGLE,
        'links': {'ground': {}, **{
            n: {'mass': masses[k], 'inertia': 0.01, 'cog': centres[k], 'length': lengths[k]}
            for k, n in enumerate(names)}},
        'joints': {'O': {'revolute': ['ground', 'crank.start']},
                   'P': {'revolute': ['crank.end', 'arm.start']}},
        'loads': {n: {'at': n, 'torque': _formula(x)} for n, x in zip(names, terms, strict=True)},
        'drives': {n: {'speed': f'{w} rad/s', 'start_angle': q} for n, (q, w) in names.items()},
    }  # fmt: skip
    weights = 9.81 * (masses * centres + np.array([masses[1] * lengths[0], 0.0]))
    coupling = masses[1] * lengths[0] * centres[1]

    def torques(t: Array) -> Array:
        q = starts[:, None] + speeds[:, None] * np.atleast_1d(t)
        turned = coupling * np.sin(q[0] - q[1])
        inertia = np.array([turned * speeds[1] ** 2, -turned * speeds[0] ** 2])
        known = {'crank': q[0], 'arm': q[1], 't': np.atleast_1d(t)}
        loads = np.array([_sum(x, known) for x in terms])
        found: Array = inertia + weights[:, None] * np.cos(q) - loads
        return found.reshape(2, *np.shape(t))

    edges = []
    for term in (x for of in terms for x in of):
        q, w = names.get(term.of, (0.0, 1.0))
        edges += [(x - q) / w for x in term.edges]
    return Draft(scene, duration=T), _Ideal(
        T, {n: w for n, (_, w) in names.items()}, torques, edges
    )


def _judge_ideal(ideal: _Ideal, machine: Machine, solution: Solution) -> dict[str, float]:
    period = ideal.duration
    inner = sorted({x for x in ideal.edges if 0.0 < x < period})
    base = 2.0 * math.pi / period

    def integrand(t: float) -> Array:
        T = ideal.torques(np.array(t))
        waves = [np.exp(-1j * k * base * t) * T for k in range(1, _HARMONICS + 1)]
        return np.array([T, T * T, abs(T), *(x.real for x in waves), *(x.imag for x in waves)])

    nodes = np.concatenate([[0.0], inner, np.linspace(0.0, period, 9)[1:]])
    nodes = np.unique(nodes)
    found = sum(
        quad_vec(integrand, a, b, epsabs=1e-14, epsrel=1e-11, limit=20000, norm='max')[0]
        for a, b in pairwise(nodes.tolist())
    )
    starts = np.append(solution.motion.curve.start, period)
    off: dict[str, float] = {}
    work = exchanged = 0.0
    for d, (drive, w) in enumerate(ideal.speeds.items()):
        column = f'drive_torque.{drive}' if d else 'drive_torque'

        def torque(t: Array, sign: float = 1.0, d: int = d) -> Array:
            return np.asarray(sign * ideal.torques(t)[d])

        mean, square, size = found[:3, d] / period
        highest, lowest = _highest(torque, nodes), -_highest(lambda t: torque(t, -1.0), nodes)
        wanted = {'mean': mean, 'rms': math.sqrt(square), 'highest': highest, 'lowest': lowest}
        largest = max(abs(highest), abs(lowest))
        scale = {'mean': size, 'rms': wanted['rms'], 'highest': largest, 'lowest': largest}
        seen = measure(machine, solution, *(f'{name}({column})' for name in _FIGURES))
        for name, x in zip(_FIGURES, seen, strict=True):
            size_of = max(scale[name], _LEAST)
            off[f'off.{name}.{drive}'] = abs(float(x.value) - wanted[name]) / size_of
        work, exchanged = work + mean * period * w, exchanged + size * period * abs(w)
        harmonics = found[3 : 3 + _HARMONICS, d] + 1j * found[3 + _HARMONICS :, d]

        def seen_torque(at: Array, column: str = column) -> Array:
            return solution.sample(at, column)[column][None]

        own = spectrum(seen_torque, starts, _HARMONICS)
        amplitudes = np.asarray(own.amplitudes)[0]
        off[f'off.harmonics.{drive}'] = float(
            np.abs(amplitudes - 2.0 * harmonics / period).max()
        ) / max(size, _LEAST)
    assert solution.energy is not None
    struck = sum(i.drive_work for i in solution.impacts)
    missing = abs(solution.energy.drive_work - struck - work) - solution.energy.error
    off['off.work'] = max(missing, 0.0) / max(exchanged, _LEAST)
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


class _Ring(NamedTuple):
    """A bushing at the end of a crank, in which a pin without friction flies and strikes."""

    arm: float
    speed: float  #: [rad/s] of the crank
    radial: float
    restitution: float

    def relative(self, t: float, y: Array) -> tuple[Array, Array]:
        """Place and rate of the pin, seen from the centre."""
        c, s = math.cos(self.speed * t), math.sin(self.speed * t)
        way = np.array([-s, c]) * self.speed
        return y[:2] - self.arm * np.array([c, s]), y[2:] - self.arm * way

    def gap(self, t: float, y: Array) -> float:
        """[m]."""
        return self.radial - float(np.hypot(*self.relative(t, y)[0]))

    def struck(self, t: float, y: Array) -> Array:
        """The state after an impact; the crank is driven and does not give way."""
        at, rate = self.relative(t, y)
        normal = at / np.hypot(*at)
        lost = (1.0 + self.restitution) * (normal @ rate)
        return np.asarray(y - lost * np.array([0.0, 0.0, *normal]))


class _Free(NamedTuple):
    """Coordinates that loads move: ``inertia x'' = f(x, x', t)`` of each of n."""

    names: tuple[str, ...]
    inertia: float
    start: list[float]  #: places, then rates
    duration: float
    terms: list[list[Term]]  #: of each
    variables: tuple[str, ...]  #: their names in formulas: places, then rates, then the time
    ring: _Ring | None = None
    crank: _Ideal | None = None  #: that drives the ring

    def rate(self, t: float, y: Array) -> Array:
        """Of the state."""
        known = dict(zip(self.variables, (*y, t), strict=True))
        forces = [float(_sum(x, known)) / self.inertia if x else 0.0 for x in self.terms]
        return np.array([*y[len(self.names) :], *forces])


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
    variables = 'wheel', 'wheel_rate', 't'
    return Draft(scene, duration=T), _Free(
        ('wheel',), inertia, [0.0, speed], T, [terms], variables
    )


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
    variables = 'x', 'vx', 't'
    return Draft(scene, duration=T), _Free(('block',), mass, [0.0, speed], T, [terms], variables)


def _loose(random: Random, _: int) -> tuple[Draft, _Free]:
    """A disk whose pin flies in the bushing of a driven crank; it ends amidst a flight."""
    speed, arm, mass = float(random.uniform(2.0, 20.0)), float(random.uniform(0.05, 0.2)), 0.7
    ring = _Ring(arm, speed, float(random.uniform(0.005, 0.03)), float(random.uniform(0.4, 1.0)))
    T = 1.5 / speed
    own = _terms(random, [('crank', 0.0, 1.5), ('t', 0.0, T)], 5.0)
    v, c = arm * speed, ring.radial
    names = [('x', 0.5 * arm, arm), ('y', 0.0, arm), ('vx', -v, v), ('vy', -v, v), ('t', 0.0, T)]
    terms = [_terms(random, names, mass * v * speed) for _ in 'xy']
    place = (np.array([arm, 0.0]) + 0.6 * c * random.uniform(-1.0, 1.0, 2)).tolist()
    rate = (np.array([0.0, v]) + 5.0 * c * speed * random.uniform(-1.0, 1.0, 2)).tolist()
    scene: Scene = {
        'title': 'a disk in a loose pin', 'mechanism': 'linkage', 'gravity': [0.0, 0.0],
        'tables': TRIANGLE,
        'links': {'ground': {},
                  'crank': {'mass': 1.0, 'inertia': 0.01, 'cog': 0.0, 'length': arm},
                  'disk': {'mass': mass, 'inertia': 0.01, 'cog': 0.0, 'length': 0.1}},
        'joints': {'O': {'revolute': ['ground', 'crank.start']},
                   'P': {'revolute': ['crank.end', 'disk.start'],
                         'clearance': {'radial': c, 'restitution': ring.restitution}}},
        'loads': {'g': {'at': 'crank', 'torque': _formula(own)},
                  'f': {'at': 'disk', 'force': [_formula(x) for x in terms]}},
        'drive': {'coordinate': 'crank', 'speed': f'{speed} rad/s', 'start_angle': 0.0},
        'initial': {
            'position': {'disk': 0.0, 'disk.x': place[0], 'disk.y': place[1]},
            'velocity': {'disk': 0.0, 'disk.x': rate[0], 'disk.y': rate[1]}},
    }  # fmt: skip
    variables = 'x', 'y', 'vx', 'vy', 't'
    free = _Free(('disk.x', 'disk.y'), mass, [*place, *rate], T, terms, variables, ring)
    T = _amidst(free)

    def torque(t: Array) -> Array:
        return np.array([-_sum(own, {'crank': speed * t, 't': t})])

    edges = [x / speed if term.of == 'crank' else x for term in own for x in term.edges]
    crank = _Ideal(T, {'crank': speed}, torque, edges)
    return Draft(scene, duration=T), free._replace(duration=T, crank=crank)


def _amidst(free: _Free) -> float:
    """[s] Within the last flight before the fourth impact, or before one that is short."""
    _, struck = _integrated(free, 4)
    ends = [0.0, *struck] if len(struck) == 4 else [0.0, *struck, free.duration]
    long = [k for k, (a, b) in enumerate(pairwise(ends)) if b - a < 0.01 * free.duration]
    last = long[0] if long else len(ends) - 1
    return 0.5 * (ends[last - 1] + ends[last]) if last else ends[1]


def _judge_free(free: _Free, machine: Machine, solution: Solution) -> dict[str, float]:
    state, struck = _integrated(free)
    T, n = free.duration, len(free.names)
    seen = solution.sample(np.array([T]))
    off = _judge_ideal(free.crank, machine, solution) if free.crank else {}
    if len(struck) != len(solution.impacts):
        raise Failure('impacts', f'{len(solution.impacts)} impacts, not {len(struck)}')
    size = max(1e-3, *map(abs, free.start[n:]), float(np.abs(state[n:]).max()))
    for k, name in enumerate(free.names):
        x, v = (float(seen[f'{of}.{name}'][0]) for of in ('position', 'velocity'))
        off[f'off.position.{name}'] = abs(x - state[k]) / (size * T)
        off[f'off.velocity.{name}'] = abs(v - state[n + k]) / size
    for impact, t in zip(solution.impacts, struck, strict=True):
        off['off.impact'] = max(off.get('off.impact', 0.0), abs(impact.t - t) / T)
    return off


def _integrated(free: _Free, most: int | None = None) -> tuple[Array, list[float]]:
    """State at the end, and times of impacts: by DOP853 from one edge of a term to the next.

    Parameters
    ----------
    most : impacts, after which it ends
    """
    index = {name: k for k, name in enumerate(free.variables)}
    terms = [x for of in free.terms for x in of]
    borders = [(index[x.of], edge) for x in terms for edge in x.edges]
    ring, struck = free.ring, list[float]()

    def event(k: int, edge: float) -> Callable[[float, Array], float]:
        def away(t: float, y: Array) -> float:
            return float((t if k == len(y) else y[k]) - edge)

        away.terminal = True  # type: ignore[attr-defined] # read by SciPy
        return away

    def touch(t: float, y: Array) -> float:
        assert ring is not None
        return ring.gap(t, y)

    touch.terminal, touch.direction = True, -1.0  # type: ignore[attr-defined]
    touching = [touch] if ring else []
    t, y = 0.0, np.array(free.start)
    while t < free.duration and (most is None or len(struck) < most):
        now, slopes = [*y, t], [*np.abs(free.rate(t, y)), 1.0]
        longest = free.duration if ring is None else 0.02 * ring.radial / max(slopes[:2])
        for x in terms:
            k = index[x.of]
            if x.kind in ('pulse', 'bell', 'ramp', 'table'):
                near = 0.2 * max(x.width, abs(now[k] - x.place))
                longest = min(longest, near / max(slopes[k], 1e-9))
        end = min(free.duration, t + 5.0 * longest)
        near_by = {b: 1e-13 * max(1.0, abs(b[1])) for b in borders}
        ahead = [b for b in borders if abs(now[b[0]] - b[1]) > near_by[b]]
        events = [event(*b) for b in ahead]
        found = solve_ivp(
            free.rate, (t, end), y, 'DOP853', rtol=1e-12, atol=1e-13, max_step=longest,
            events=[*touching, *events],
        )  # fmt: skip
        t, y = float(found.t[-1]), found.y[:, -1]
        for b, at in zip(ahead, found.t_events[len(touching) :], strict=True):
            k, edge = b
            if len(at) and k < len(y):  # a rate may stay where it is: on the side it came to
                y[k] = edge + math.copysign(0.5 * near_by[b], y[k] - found.y[k, 0])
        if ring and len(found.t_events[0]):
            y = ring.struck(t, y)
            struck.append(t)
    return y, struck


# --- the families --------------------------------------------------------------------------------

_Makers = tuple[Callable[[Random, int], tuple[Draft, Any]], ...]


def _draft(makers: _Makers, random: Random, k: int) -> Draft:
    return makers[k % len(makers)](random, k)[0]


def _judge(
    makers: _Makers, random: Random, k: int, machine: Machine, solution: Solution
) -> dict[str, float]:
    """Figures against the second route."""
    known = makers[k % len(makers)](random, k)[1]
    of_kind = _judge_ideal if isinstance(known, _Ideal) else _judge_free
    off = of_kind(known, machine, solution)
    worst = max(off, key=lambda name: off[name])
    if not off[worst] <= TOLERANCE:
        raise Failure('figure', f'{worst.removeprefix("off.")} is off by {off[worst]:.3g}: {off}')
    return off


def _family(name: str, count: int, *makers: Any) -> Family:
    """Cases of some makers in turn."""
    return Family(name, count, partial(_draft, makers), judge=partial(_judge, makers))


FAMILIES = (
    _family('loads', 200, _crank, _yoke, _wheel, _slider),
    _family('loads_drives', 60, _arm),
    _family('loads_loose', 60, _loose),
)
