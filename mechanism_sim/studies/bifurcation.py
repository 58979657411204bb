"""Responses over a parameter: Poincare sections, their periods, and which of them coexist.

The parameter goes up and down; each value begins where the value before it came to, so that a
response is followed beyond where another start would leave it (hysteresis). At every value the
motion settles, then its section is taken: once in each turn of the drive, or at the impacts of a
joint. A. H. Nayfeh and B. Balachandran, Applied Nonlinear Dynamics, Wiley 1995, chapters 3 and 5.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.arguments import check_options, listed, public
from mechanism_sim.arrays import Array
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.events import Impact
from mechanism_sim.engine.snapshot import State
from mechanism_sim.errors import InputError, RunError, check_known
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial
from mechanism_sim.planar.configuration import converted
from mechanism_sim.ranges import check_counts
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.run import Piece, Runner
from mechanism_sim.scene import Machine, Source, load_scene
from mechanism_sim.scene.files import check_scene
from mechanism_sim.studies.parameters import Parameter, Vary, parameters, read_counted
from mechanism_sim.studies.periodic import CLOCK, without_turns
from mechanism_sim.studies.runs import Call, Row, Show, Workers
from mechanism_sim.tables import Column, Tabular
from mechanism_sim.units import unrounded

_OF_IMPACTS = {
    'approach_speed': ('m/s', 'approach speed'),
    'normal_impulse': ('N s', 'normal impulse'),
    'loss': ('J', 'energy lost'),
}
"""Quantities of a section at impacts: units and words."""
DIRECTIONS = 'up', 'down'
_NOTHING: dict[str, Any] = {'period': 0, 'impacts': 0.0, 'points': [], 'returns': []}
START = 'start'
_RETURN = 1e-2  # share of the free travel in clearances within which sections are the same
ONE = 5.0 * _RETURN
"""Share of the free travel within which sections of two runs are of one response."""
_OF_RANGE = 1e-4  # share of the range of a rate or displacement within which sections are the same
APART = 0.381966
"""Share of a turn before its end at which sections are compared. Machines often begin at an
impact, and at that very instant rates have two values."""
_MOST_POINTS = 400  # number of points of a section at impacts that are kept: the last ones
_FEWEST = 10
"""Least number of turns of a run, or a quarter of the transient if more: a motion that repeats
earlier may be an unstable one near the start of the run."""
_SHARED, _LEAST = 4000, {'transient': 8, 'keep': 16}
"""Number of turns of all values in one direction, and least numbers for each: runs at neighbouring
values begin near their limits, and their sections fill a diagram together."""
_SEEN = 4  # least number of turns over which a transient is compared with as many before
_SETTLED = 1e-3
"""Share of the distance within which sections are the same: remainder of a transient."""
_PATIENT = 8  # factor on the planned turns for motions that still converge
_EVEN, _FALLEN, _STEADY = 0.8, 0.8, 0.95
"""Criteria of a decay: least ratio of its logarithmic rates, largest remaining share, and least
share of turns with a decrease. They hold where no motion repeats."""
_CLEAR = 10.0  # least ratio of the distance between turns of a period to the rest of the transient
_BENT = 0.5  # largest difference between steps from response to response on one branch, relative
_SEEN_AHEAD, _NUDGE = 2, 1e-5
"""Number of turns compared in a run from an extrapolated start, and offset of that start over the
distance within which sections are the same. The offset grows if the extrapolated response has
become unstable."""


@dataclass(frozen=True)
class SectionPlan:
    """Sections of a motion: their quantities, and the turns at which they are taken."""

    of: tuple[str, ...]  #: names of the quantities of a section
    joint: str = ''  #: joint at whose impacts it is taken; once a turn of the drive if empty
    #: turns of the drive until the motion has settled, and of the section; fewer where it repeats
    #: itself before, and of more than 100 values of `bifurcation` if not given, but for those that
    #: begin as the scene does
    transient: int = 60
    keep: int = 60
    longest: int = 16  #: longest period considered [turns]


TURNS = dict.fromkeys(('transient', 'keep', 'longest'), 'int')
"""Numbers of turns of a `SectionPlan`."""


@dataclass(frozen=True, eq=False)
class Response:
    """A response at one value of the parameter.

    Attributes
    ----------
    value : value of the parameter, in its SI unit
    branch : start of its run: ``up`` or ``down`` from the neighbour, or ``start`` of the scene
    period : turns of the drive after which it repeats; 0 if it does not within the longest
    number : index among those that coexist at this value, the first is 0
    points : (P, K) section, a column for each of its quantities
    returns : (R, 2 f) positions and rates once a turn, over their scales
    impacts : number of impacts per turn
    note : reason if there is no response
    state : state at the end of a turn, with the crank where the scene begins
    settled : False if it still converges: its period may be unknown, and it does not count among
        coexisting ones
    """

    value: float
    branch: str
    period: int
    points: Array
    returns: Array
    impacts: float
    number: int = 0
    note: str = ''
    state: State | None = None
    settled: bool = True


@dataclass(frozen=True, eq=False, repr=False)
class Bifurcation(Tabular):
    """Responses over a parameter, in the order of values; see `Response`.

    Attributes
    ----------
    unit, scale : unit of the parameter as written, and value in it of 1 in SI units
    units, words : units and words of the quantities of the section
    """

    machine: Machine
    parameter: Parameter
    unit: str
    scale: float
    plan: SectionPlan
    units: tuple[str, ...]
    words: tuple[str, ...]
    responses: tuple[Response, ...]

    @property
    def coexisting(self) -> list[float]:
        """Values at which several responses were found."""
        return sorted({r.value for r in self.responses if r.number})

    def columns(self) -> list[Column]:
        """The columns of the table."""
        rows = [(r, k) for r in self.responses for k in range(len(r.points))]
        given = [unrounded(self.scale * r.value) for r, _ in rows]
        quantities = enumerate(zip(self.plan.of, self.units, self.words, strict=True))
        return [
            Column(self.parameter.path, given, self.unit, 'varied'),
            Column('branch', [r.branch for r, _ in rows], '', 'how the response was reached'),
            Column('period', [r.period for r, _ in rows], '', 'turns of the drive; 0: none found'),
            Column('response', [r.number for r, _ in rows], '', 'of those that coexist'),
            *(
                Column(name, [float(r.points[k, i]) for r, k in rows], unit, words)
                for i, (name, unit, words) in quantities
            ),
            Column('settled', [int(r.settled) for r, _ in rows], '', '0: it still converges'),
        ]


@public
def bifurcation(
    scene: Source,
    vary: Vary,
    of: str | Sequence[str] = (),
    *,
    at_impacts: str | None = None,
    starts: bool = False,
    workers: int | Workers | None = 1,
    show: Show | None = None,
    **when: int,
) -> Bifurcation:
    """Sections of the motion over a parameter swept up and down.

    >>> import mechanism_sim as ms
    >>> found = ms.bifurcation('four_bar_clearance', {'drive.speed': ('100 rpm', '120 rpm', 2)},
    ...                        transient=2, keep=4)
    >>> len(found.responses)
    4

    Parameters
    ----------
    vary : lowest and highest value, and their number, by dotted path, also as text
        ``'100 rpm:600 rpm:51'``; or a text ``PATH=LOW:HIGH:NUMBER``
    of : quantities of the section: of the catalogue, or of `_OF_IMPACTS` with `at_impacts`
    at_impacts : joint at whose impacts the section is taken, instead of once a turn
    starts : add a run from the scene's own start at each value
    when : ``transient``, ``keep``, ``longest`` of `SectionPlan`
    """
    when = check_options(bifurcation, when, TURNS)
    machine = load_scene(scene)
    ranges = read_counted('vary', vary)
    if len(ranges) != 1:
        raise InputError(f'bifurcation: one key is varied, not {len(ranges)}; `basins` takes two')
    ((parameter, values, written),) = varied(machine, ranges)
    plan, units, words = section(machine, listed(of, 'of'), at_impacts, when)
    path = parameter.path
    content = machine.scene.to_document()
    changes = [{path: value} for value in values]
    for ends in (changes[0], changes[-1]):  # invalid values are refused before any run
        check_scene(machine.name, content, ends)
    shared = paced(plan, len(values), when)
    tasks = [
        Call(way, follow, (machine.name, content, changes[::sign], path, plan, way, shared))
        for way, sign in zip(DIRECTIONS, (1, -1), strict=True)
    ]
    if starts:
        tasks += [
            Call(str(k), follow, (machine.name, content, [one], path, plan, START))
            for k, one in enumerate(changes)
        ]
    with Workers.of(workers) as makers:
        rows = makers.do_all(tasks, show)
    found = [read_response(each, len(plan.of)) for row in rows for each in row['responses']]
    return Bifurcation(machine, parameter, *written, plan, units, words, tuple(_numbered(found)))


def varied(
    machine: Machine, vary: Mapping[str, tuple[Any, Any, int]]
) -> list[tuple[Parameter, list[float], tuple[str, float]]]:
    """Each varied key, its values, its unit as written and the value in it of 1 in SI units."""
    check_counts(', '.join(vary), [count for *_, count in vary.values()])
    found = []
    for path, (low, high, count) in vary.items():
        (parameter,) = parameters(machine, [path], '', limits={path: (low, high)})
        values = np.linspace(parameter.low, parameter.high, count).tolist()
        found.append((parameter, values, (parameter.unit, parameter.scale)))
    return found


def section(
    machine: Machine, of: Sequence[str], joint: str | None, when: Mapping[str, int]
) -> tuple[SectionPlan, tuple[str, ...], tuple[str, ...]]:
    """The plan of the sections, units and words of their quantities; refused if it cannot be."""
    for name, turns in when.items():
        if turns < 1:
            raise InputError(f'{name} must be at least 1')
    if not machine.drive.steady or not machine.drive.fastest:
        raise InputError(f'{machine.name}: sections need a drive at constant speed; {CLOCK}')
    if not machine.level.dynamic or not machine.equations.system.free:
        raise InputError(f'{machine.name}: without a free motion every turn is like the other')
    if joint is not None:
        wrong = f"{machine.name}: there is no loose joint '{joint}'"
        check_known(joint, machine.physics.clearances, wrong, 'loose:')
        names = tuple(of) or ('approach_speed',)
        for name in names:
            check_known(name, _OF_IMPACTS, f"'{name}' is not of impacts", 'known are')
        found = [_OF_IMPACTS[name] for name in names]
    else:
        names = tuple(of) or (f'velocity.{machine.equations.system.free[-1]}',)
        known_ones = catalogue(machine)
        quantities = [known_ones.find(name) for name in names]
        names = tuple(q.name for q in quantities)
        found = [(q.unit, q.words) for q in quantities]
    plan = SectionPlan(names, joint or '', **when)
    units, words = zip(*found, strict=True)
    return plan, tuple(units), tuple(words)


def paced(plan: SectionPlan, count: int, asked: Collection[str]) -> SectionPlan:
    """Plan for each of several consecutive values, apart from requested numbers."""
    share = _SHARED // count
    fewer = {n: min(getattr(plan, n), max(x, share)) for n, x in _LEAST.items() if n not in asked}
    return replace(plan, **fewer)


def follow(
    name: str,
    content: Mapping[str, Any],
    changes: Sequence[Mapping[str, float]],
    path: str,
    plan: SectionPlan,
    branch: str,
    shared: SectionPlan | None = None,
) -> Row:
    """Responses at values of a key in order, each started from the end of the one before.

    Those of the branch `START` begin as their scenes say.

    Parameters
    ----------
    content : content of the scene, as of a file
    changes : changes of each scene, by path, with a value of `path`
    shared : plan of runs that begin near their limits
    """
    state: State | None = None
    before: Machine | None = None
    trend = _Trend()
    found: list[dict[str, Any]] = []
    for change in changes:
        value, why = change[path], ''
        try:
            machine = Machine(name, check_scene(name, content, change))
            why = '' if machine.drive.fastest else 'the crank is at rest'
            own = _begin(machine)
        except InputError as error:  # some values of a range may be invalid
            why = str(error)
        if why:
            found.append(_NOTHING | {'note': why, 'value': value, 'branch': branch, 'state': None})
            state, trend = None, _Trend()
            continue
        if state and before:
            state = _carried(state, before, machine)
        shift = None if before is None else own - _begin(before)
        for begin, seen in _starts(state, shift, trend.step()):
            try:
                near = shared if shared and begin else plan
                settled = _settled(machine, own, near, begin, seen)
                if settled:
                    response, state, ends = settled
                    break
            except RunError as error:
                response, state, ends = _NOTHING | {'note': str(error)}, None, None
        found.append(response | {'value': value, 'branch': branch, 'state': state})
        state, before = None if branch == START else state, machine
        trend.enter(ends)
    return {'responses': found}


def _starts(
    state: State | None, shift: Array | None, step: Array | None
) -> Iterator[tuple[State | None, int]]:
    """Starts of a run, the best first, and the turns that tell whether it has settled.

    Where a machine cannot begin as the one before ended, it begins as its scene says.

    Parameters
    ----------
    shift : (2 f,) difference of the starts of both scenes
    """
    if state and shift is not None:
        if step is not None:
            yield _moved(state, shift + step), _SEEN_AHEAD
        yield _moved(state, shift), _SEEN
    yield None, _SEEN


class _Trend:
    """Extrapolation of the next response by a parabola through three of a branch."""

    def __init__(self) -> None:
        self._before: list[Ends] = []

    def enter(self, ends: Ends | None) -> None:
        """Enter the response at the next of values that are evenly spaced, if there is one."""
        if ends is None or not len(ends.states):
            self._before = []
        elif self._before and len(self._before[-1].states) == len(ends.states):
            self._before = [*self._before[-2:], ends]
        else:
            self._before = [ends]

    def step(self) -> Array | None:
        """Extrapolated change of positions and rates at the next value, beside the start's (2 f,).

        None where the responses are not those of one branch, or do not repeat.
        """
        if len(self._before) < 3:
            return None
        first, second, third = self._before
        step, at = self._between(second, third, -1)
        before, _ = self._between(first, second, at)
        size, bend = (np.abs(x / third.near).max() for x in (step, step - before))
        ahead: Array = 2.0 * step - before + _NUDGE * third.near
        return ahead if bend <= max(1.0, _BENT * size) else None

    @staticmethod
    def _between(old: Ends, new: Ends, at: int) -> tuple[Array, int]:
        """The step to a turn of a response from the nearest of the one before, and its place."""
        steps = without_turns(new.states[at] - old.states, new.turns)
        nearest_one = int(np.abs(steps / new.near).max(axis=1).argmin())
        return steps[nearest_one], nearest_one


class Ends(NamedTuple):
    """Positions and rates at the ends of the last turns of a response, as many as its period."""

    states: Array  #: (period, 2 f) difference from those at the start of the scene
    near: Array  #: (2 f,) tolerances of equality
    turns: Array  #: (2 f,) period of a position; 0 without one


def _begin(machine: Machine) -> Array:
    """Positions and rates (2 f,) with which a scene begins, were its joints ideal."""
    plan, start = machine.plan, machine.nominal.assembly
    found = converted(plan.ideal, plan.loose, start.q, start.v)
    free = [plan.loose.coordinates.index(c) for c in machine.equations.system.free]
    return np.concatenate([x[free] for x in found])


def _carried(state: State, before: Machine, machine: Machine) -> State | None:
    """A state with its states of first order over the scales of another machine; None of others.

    They are moved by what lies between their starts, as positions and rates are.
    """
    old, new = (one.equations.system.states for one in (before, machine))
    if len(old) != len(new):
        return None
    moved = [
        (x * a.scale + (b.start - a.start)) / b.scale
        for x, a, b in zip(state.states, old, new, strict=True)
    ]
    return replace(state, states=tuple(moved))


def _moved(state: State, step: Array) -> State:
    """A state of one machine as one of another: moved by what lies between their starts.

    With other lengths, or at another speed of the crank, contacts would open or strike: a
    thousandth of the rates is as much as the speed of many impacts.
    """
    q, v = (np.array([*state.q, *state.v]) + step).reshape(2, -1)
    still = (0,) * len(state.turns)
    return replace(state, q=tuple(q.tolist()), v=tuple(v.tolist()), turns=still)


def _settled(
    machine: Machine, own: Array, plan: SectionPlan, state: State | None, seen: int
) -> tuple[dict[str, Any], State, Ends] | None:
    """The section of a machine after its transient, and the state at the end.

    A transient of so many turns at least is compared with as many before. What still converges
    goes on for more turns than planned. None where it was foretold, but does not settle: it may
    be near what has become unstable.

    Parameters
    ----------
    own : (2 f,) positions and rates with which the scene begins
    """
    try:
        engine = machine.start(state=state)
    except InputError as error:  # some starts of a range may not be
        raise RunError(str(error)) from error
    if not isinstance(engine, EventLoop):
        raise RunError(f'{machine.name}: a motion in closed form has no sections')
    accumulator, runner = _SectionAccumulator(machine, own, plan), Runner(machine, engine)
    turns, most = max(_FEWEST, plan.transient // 4), plan.transient + plan.keep
    if seen < _SEEN:
        turns = max(3 * seen, plan.transient // 4)

    def go_on(final: bool = False) -> None:
        for _ in runner.to(turns * machine.drive.period, [accumulator.add], final):
            pass

    keep = 0
    while turns < most and not keep:
        go_on()
        keep = accumulator.settled(seen)
        turns += 0 if keep else turns // 2 if seen == _SEEN else 1
    if seen < _SEEN and not keep:
        return None
    turns, converges = min(turns, most), False
    while not keep:
        go_on()
        keep = accumulator.settled(seen)
        more = 0 if keep else accumulator.due()
        converges = turns + more > _PATIENT * most
        if converges or not more:
            break
        turns += more
    go_on(final=True)
    found = accumulator.found(turns, keep)
    if converges:
        found |= {'period': 0, 'settled': False}
    return found, replace(engine.state, time=Fraction(0)), accumulator.ends(found['period'])


def measure(machine: Machine) -> tuple[list[str], Array, Array]:
    """Names of positions and rates (2 f,), their scales, and turns after which they are the same.

    A turn is 0 where that never is.
    """
    free = machine.equations.system.free
    names = [f'{kind}.{c}' for kind in ('position', 'velocity') for c in free]
    slides = np.array([c in machine.mechanism.displacements for c in free])
    size = machine.mechanism.size
    play = min((c.radial for c in machine.plan.clearances.values() if c.radial), default=0.0)
    place = np.where(slides, play or 1e-3 * size, (play or 1e-3 * size) / size)
    turns = np.concatenate([np.where(slides, 0.0, TWO_PI), np.zeros(len(free))])
    return names, np.concatenate([place, machine.drive.fastest * place]), turns


class _Fall(NamedTuple):
    """Decay of a transient, or departure from an unstable motion."""

    share: float  #: factor of the change in a turn
    left: float  #: remaining change, over the distance within which sections are the same
    even: bool  #: True if it is monotonic turn by turn, or geometric


class _SectionAccumulator:
    """Sections of a run, taken piece by piece."""

    def __init__(self, machine: Machine, own: Array, plan: SectionPlan) -> None:
        self._plan, self._turn, self._begin = plan, machine.drive.period, own
        self._edges: Array = self._turn * np.arange(_PATIENT * (plan.transient + plan.keep) + 1.0)
        self._names, self._scale, self._turns = measure(machine)
        self._states: list[Array] = []
        self._ends: list[Array] = []
        self._points: list[Array] = []
        self._impacts: list[Impact] = []

    def add(self, piece: Piece) -> None:
        """Enter the piece that follows."""
        curve = piece.motion.curve
        self._impacts += piece.impacts
        if not len(curve):
            return
        seen = self._due(self._edges[1:] - APART * self._turn, self._states, curve)
        ends = self._due(self._edges[1:], self._ends, curve)
        if len(seen) or len(ends):
            found = piece.sample(np.concatenate([seen, ends]), *self._names)
            rows = np.array([found[n] for n in self._names]).T
            self._states.append(rows[: len(seen)])
            self._ends.append(rows[len(seen) :])
        if not self._plan.joint and len(t := self._due(self._edges, self._points, curve)):
            chosen = piece.sample(t, *self._plan.of)
            self._points.append(np.array([chosen[n] for n in self._plan.of]).T)

    @staticmethod
    def _due(t: Array, taken: Sequence[Array], curve: PiecewisePolynomial) -> Array:
        """Times up to the end of a piece, but for rounding, that follow on those taken."""
        left = t[sum(map(len, taken)) :]
        return np.asarray(np.minimum(left[left <= curve.end * (1.0 + 1e-12)], curve.end))

    def found(self, turns: int, settled: int) -> dict[str, Any]:
        """Period, section and impacts per turn of the last of a number of turns, as plain data."""
        keep, states = settled or self._plan.keep, np.concatenate(self._states)
        p = self._told(states, settled)
        kept = p or keep
        # impacts at the very end of a turn are in that turn or in the next: count between turns
        end = turns - APART
        last = [i for i in self._impacts if end - kept < i.t / self._turn <= end]
        own = [i for i in last if i.joint == self._plan.joint][-_MOST_POINTS:]
        points = (
            np.array([[getattr(i, n) for n in self._plan.of] for i in own])
            if self._plan.joint
            else np.concatenate(self._points)[-kept:]
        )
        return {
            'period': p,
            'points': points.tolist(),
            'returns': (states[-kept:] / self._scale).tolist(),
            'impacts': len(last) / kept,
        }

    def ends(self, period: int) -> Ends:
        """The ends of the last turns, of a given number."""
        ends = np.concatenate(self._ends)
        near = self._near(np.concatenate(self._states))
        return Ends(ends[len(ends) - period :] - self._begin, near, self._turns)

    def settled(self, seen: int) -> int:
        """Turns over which the motion has repeated itself, 0 if it has not.

        What is left of the transient follows from how it has died out, as a geometric series.
        """
        states = np.concatenate(self._states)
        near = self._near(states)
        for p in range(1, self._plan.longest + 1):
            m = p * -(-seen // p)
            if len(states) < 2 * m + p:
                return 0
            off = (self._off(states[-2 * m - p :], p) / near).max(axis=1)
            before, now = off[:m].max(), off[m:].max()
            share = now / max(before, 1e-300)
            left = m / p * now * share / (1.0 - share) if share < 1.0 else math.inf
            slight = 1e3 * now if seen == _SEEN else 1e6 * now  # foretold, it must be seen to fall
            if now <= 1.0 and min(left, slight) <= _SETTLED:
                return 2 * (m + p)  # half of it is looked at for the period
        return 0

    def due(self) -> int:
        """Further turns until the period of a converging motion is known; 0 if none converges.

        A period is told if what is left of the transient is small beside what tells its turns
        apart: near a flip the turns of one that dies out slowly are two for long.
        """
        states = np.concatenate(self._states)
        p = self._told(states, 0)
        falls = (self._fall(states, q) for q in range(1, self._plan.longest + 1))
        if p:
            before = [self._off(states[-p - q :], q) / self._near(states) for q in range(1, p)]
            apart = min((float(x.max()) for x in before), default=math.inf)
            fall = self._fall(states, p)
            if fall is None or fall.left <= min(1.0, apart / _CLEAR):
                return 0
        else:
            fall = next((x for x in falls if x and x.even), None)
            if fall is None:
                return 0
        most = _PATIENT * (self._plan.transient + self._plan.keep)
        if fall.share >= 1.0:
            return len(states) // 2
        turns = math.log(max(2.0 * fall.left, 1.0)) / -math.log(fall.share)
        return math.ceil(min(turns, most)) + 2 * self._plan.longest

    def _told(self, states: Array, settled: int) -> int:
        """Period of the last turns: of the settled ones, or of those to keep."""
        keep = settled or self._plan.keep
        # twice the longest period tells it; of what still settles the later half is looked at
        looked = keep // 2 - 1 if settled else max(keep // 2, min(keep, 2 * self._plan.longest))
        return self._period(states[-(looked + 1) :])

    def _fall(self, states: Array, p: int) -> _Fall | None:
        """Decay or growth of the change in p turns over the later half, if it is monotonic."""
        m = p * max(-(-_SEEN // p), (len(states) // 2 - p) // (4 * p))
        if len(states) < 4 * m + p:
            return None
        off = (self._off(states[-4 * m - p :], p) / self._near(states)).max(axis=1)
        sizes = off.reshape(4, m).max(axis=1)
        falls = -np.diff(np.log(np.maximum(sizes, 1e-300)))
        if falls.min() <= 0.0 <= falls.max():
            return None
        ways = np.sign(off[p:] - off[:-p]) == -np.sign(falls[0])
        steady = ways.mean() >= _STEADY
        share = math.exp(-float(falls.mean()) / m)
        if share >= 1.0:
            return _Fall(share, math.inf, True) if steady and sizes[0] > _SETTLED else None
        even = falls.min() >= _EVEN * falls.max() and sizes[3] <= _FALLEN * sizes[0]
        left = float(sizes[3]) * share**p / (1.0 - share**p)
        return _Fall(share, left, bool(even or steady))

    def _near(self, states: Array) -> Array:
        """Tolerances within which sections count as equal (2 f,)."""
        near = _RETURN * self._scale
        return np.maximum(near, np.where(self._turns, 0.0, _OF_RANGE * np.ptp(states, axis=0)))

    def _off(self, states: Array, p: int) -> Array:
        """Deviations of sections from those p turns before (N - p, 2 f)."""
        return np.abs(without_turns(states[p:] - states[:-p], self._turns))

    def _period(self, states: Array) -> int:
        """Fewest turns after which all sections come back, 0 if none."""
        near = self._near(states)
        for p in range(1, min(self._plan.longest, len(states) // 2) + 1):
            if (self._off(states, p) <= near).all():
                return p
        return 0


def read_response(row: Mapping[str, Any], width: int) -> Response:
    """A response of a row; its section has a given number of quantities."""
    points = np.array(row['points'], dtype=float).reshape(-1, width)
    returns = np.array(row['returns'], dtype=float)
    returns = returns.reshape(len(returns), -1) if len(returns) else np.empty((0, 0))
    return Response(
        row['value'], row['branch'], row['period'], points, returns, row['impacts'], 0,
        row.get('note', ''), row['state'], row.get('settled', True),
    )  # fmt: skip


def _numbered(found: Iterable[Response]) -> list[Response]:
    """Responses in the order of values, those that coexist numbered."""
    by_value: dict[float, list[Response]] = {}
    for response in found:
        by_value.setdefault(response.value, []).append(response)
    numbered = []
    for value in sorted(by_value):
        kinds: list[Response] = []
        for response in by_value[value]:
            alike = (k for k, kind in enumerate(kinds) if same(kind, response))
            none = bool(response.note) or not response.settled  # its limit is not known
            number = 0 if none else next(alike, len(kinds))
            if number == len(kinds) and not none:
                kinds.append(response)
            numbered.append(replace(response, number=number))
    return numbered


def same(a: Response, b: Response) -> bool:
    """True if two sections are those of one response, from any of its turns on."""
    if a.period != b.period or a.returns.shape[1:] != b.returns.shape[1:]:
        return False
    if a.period == 0:  # attractors that do not repeat: by where they are
        low, high = (
            np.minimum(a.returns.min(0), b.returns.min(0)),
            np.maximum(a.returns.max(0), b.returns.max(0)),
        )
        shared = np.minimum(a.returns.max(0), b.returns.max(0)) - np.maximum(
            a.returns.min(0), b.returns.min(0)
        )
        return bool((shared >= 0.5 * (high - low)).all())
    shifts = range(a.period)
    off = min(float(np.abs(np.roll(b.returns, k, axis=0) - a.returns).max()) for k in shifts)
    return off <= ONE
