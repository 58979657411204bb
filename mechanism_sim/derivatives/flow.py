"""Derivatives of a known run: smooth motion by collocation, events by their jumps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, IndexArray, Mask
from mechanism_sim.derivatives.collocation import COUNT, Steps, powers, rule, solve
from mechanism_sim.derivatives.influences import (
    NUMBERS,
    Influence,
    LawTable,
    behind,
    built_in,
    influences,
    own,
)
from mechanism_sim.derivatives.jumps import (
    Jumps,
    NoDerivativeError,
    Saltation,
    Side,
    Variation,
)
from mechanism_sim.derivatives.linearised import LinearEquations, Points, Selected
from mechanism_sim.derivatives.numeric_keys import NumericKey
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impact, Mode
from mechanism_sim.engine.physics import DynamicPhysics
from mechanism_sim.planar.switches import SwitchTable
from mechanism_sim.scene import Machine

_MEMORY = 2e6  # numbers in the equations that are solved at once
_MOST = 1024  # segments
_PARTS = [
    0.0,
    *(0.5 * 4.0**-k for k in range(6, -1, -1)),
    *(1.0 - 0.5 * 4.0**-k for k in range(1, 7)),
    1.0,
]
_GROUP = 16  # segments that are joined before states go across them
_SHORT = 1e-8  # of usual segments: of one in which nothing can happen

CHATTER = (
    'the rest of a chatter is left out; derivatives beyond are those of a contact that stays '
    'closed from this impact on'
)
"""Text of a limit at the cut-off of Zeno chatter."""


_SEATED = (
    'this key pushes a contact that is closed at the start; derivatives are those of a contact '
    'that stays closed'
)


@dataclass(frozen=True)
class DerivativeLimit:
    """An instant across which derivatives do not exist, or have another meaning."""

    t: float  #: [s]
    where: str  #: name of the joint, drive or load, if it is one
    text: str  #: description of the event, and of the derivatives beyond it
    ends: bool  #: True if derivatives end there

    def __str__(self) -> str:
        place = f' in {self.where}' if self.where else ''
        return f't = {self.t:.9g} s{place}: {self.text}'


@dataclass(frozen=True)
class Flow:
    """Derivatives of a motion of m segments by P keys; not a number beyond a limit that ends them.

    Attributes
    ----------
    coefficients : (m, n, d, P) of the motion's polynomials, at fixed times
    states : (m, s, d, P) of the polynomials of states of first order
    shift : (m, P) of the instants at which segments begin [s]; constant between events
    approach : (m, a, P) of the speeds of initial contact of compliant contacts
    impacts : (i, len(NUMBERS), P) of the fields `NUMBERS` of impacts
    final : (2f + s, P) of free coordinates, their rates, states at the end
    limits : limits in the order of time
    begun : limits at the start by column of a key; the column of one that ends is NaN
    """

    coefficients: Array
    states: Array
    shift: Array
    approach: Array
    impacts: Array
    final: Array
    limits: tuple[DerivativeLimit, ...]
    begun: dict[int, DerivativeLimit]


class Flows:
    """Computes derivatives along motions of a machine.

    Parameters
    ----------
    machine : machine whose equations are integrated
    influence : derivatives (..., P) of the numbers of its runs
    end : [s] end of the laws
    keys : keys of the P columns; None for a number of the initial state
    """

    def __init__(
        self,
        machine: Machine,
        influence: Influence,
        end: float,
        keys: Sequence[NumericKey | None] = (),
    ) -> None:
        physics = machine.physics
        assert isinstance(physics, DynamicPhysics)  # noqa: S101 - its equations are integrated
        self.system = system = physics.system
        self.influence, self.laws = influence, own(machine, end).laws
        self.count = influence.start.shape[1]
        index = system.parameters
        moved = {*np.flatnonzero(_moves(influence.parameters)).tolist(), *index.approach}
        for rows, symbols in zip(influence.rows, index.switches, strict=True):
            moved |= {i for j, i in enumerate(symbols) if _moves(rows[:, j].reshape(1, -1))[0]}
        powered = influence.laws[len(system.prescribed) :]
        for table, symbols in zip(powered, index.torques, strict=True):
            columns = table.numbers.swapaxes(0, 1).reshape(len(symbols), -1)
            moved |= {i for i, m in zip(symbols, _moves(columns), strict=True) if m}
        beside = {}
        for column, key in enumerate(keys):
            if key and built_in(key):
                others = [m.physics for m in key.beside]
                known = [LinearEquations(x, []) for x in others if isinstance(x, DynamicPhysics)]
                beside[column] = key.step, known
        self.equations = LinearEquations(physics, sorted(moved), beside)
        self.jumps = Jumps(self.equations, influence)
        self.free = [system.coordinates.index(c) for c in system.free]
        self.width = len(self.free) + len(system.states)

    @classmethod
    def by_state(cls, machine: Machine, end: float, keys: Sequence[NumericKey] = ()) -> Flows:
        """Derivatives by the 2f + s numbers of a state at the start of runs up to `end` [s].

        Those by P `keys` at a fixed start are the columns behind them.
        """
        width = machine.equations.system.width
        known = behind(influences(machine, keys, end), width)
        return cls(machine, known, end, [*[None] * width, *keys])

    def transition(
        self, motion: Motion, impacts: Sequence[Impact]
    ) -> tuple[Array, tuple[DerivativeLimit, ...]]:
        """State transition matrix (2f + s, 2f + s + P) of a motion, and its limits.

        Rows are free coordinates, their rates and states of first order, in their own units, at
        the end, columns those at the start and P keys. Directions that a closed contact or loop
        forbids decay to nothing.
        """
        flow = self.along(motion, impacts, np.eye(self.system.width, self.count))
        return flow.final, flow.limits

    def along(self, motion: Motion, impacts: Sequence[Impact], start: Array | None = None) -> Flow:
        """Derivatives along a motion from the machine's start, or with derivatives `start`.

        Parameters
        ----------
        start : (2f + s, P)
        """
        return _Walk(self, motion, impacts, start).flow()

    def prescribed(self, t: Array, k: int) -> Array:
        """Taylor coefficients (N, d + 1, P) of derivatives of a prescribed coordinate."""
        base, numbers = self.laws[k], self.influence.laws[k].numbers
        which = _law_at(base, t)
        since, numbers = (t - base.start[which])[:, None], numbers[which]
        found = np.zeros((len(t), max(numbers.shape[1], 3), self.count))
        for j in range(numbers.shape[1]):
            for i in range(numbers.shape[1] - 1, j - 1, -1):
                found[:, j] = found[:, j] * since + math.comb(i, j) * numbers[:, i]
        return found

    def parameters(self, motion: Motion, at: Points, segments: IndexArray) -> Array:
        """Derivatives (N, c, P) of the chosen parameters in segments, one point of each."""
        index, influence, chosen = self.system.parameters, self.influence, self.equations.chosen
        found = np.repeat(influence.parameters[chosen][None], len(segments), axis=0)
        place = {i: k for k, i in enumerate(chosen)}
        switches = zip(self.system.switches, index.switches, influence.rows, strict=True)
        for switch, symbols, rows in switches:
            if not isinstance(switch, SwitchTable) or not place.keys() & set(symbols):
                continue
            off = np.abs(switch.every_row[:, :, None] - at.parameters[symbols]).max(axis=1)
            for j, i in enumerate(symbols):
                if i in place:
                    found[:, place[i]] = rows[off.argmin(axis=0), j]
        curve, p = motion.curve, len(self.system.prescribed)
        for k, symbols in enumerate(index.torques):
            which = _law_at(self.laws[p + k], curve.start[segments])
            numbers = influence.laws[p + k].numbers[which]
            turns = curve.turns[segments, self.system.driven_index[p + k]]
            numbers[:, 0] += numbers[:, 1] * (2.0 * np.pi * turns)[:, None]
            for j, i in enumerate(symbols):
                if i in place:
                    found[:, place[i]] = numbers[:, j]
        return found

    def torques(self, motion: Motion) -> Array:
        """Derivatives (m, k, 3, P) of the coefficients of the torque laws of a motion."""
        p, t = len(self.system.prescribed), motion.curve.start
        found = np.zeros((*motion.torques.shape, self.count))
        for k in range(found.shape[1]):
            found[:, k] = self.influence.laws[p + k].numbers[_law_at(self.laws[p + k], t)]
        return found


class _Events(NamedTuple):
    """Events at the ends of segments."""

    number: dict[int, int]  #: index of an event by that of its segment
    sides: tuple[Side, ...]  #: states before and after all events

    def at(self, segments: Sequence[int]) -> list[Side]:
        """Sides before and after the events at the ends of some segments."""
        return [side.some([self.number[j] for j in segments]) for side in self.sides]


class _Blows(NamedTuple):
    """E single impacts in a chunk: maps of any state before, with its approaches, and keys."""

    segment: IndexArray  #: (E,) indices of the segments of the chunk that they end
    impact: IndexArray  #: (E,) numbers of the impacts
    shift: Array  #: (E, 2f + s + a + P) derivatives of their instants
    every: Array  #: (E, 2f + s + len(NUMBERS), 2f + s + a + 1 + P) of state, log; shift between


def _moves(rows: Array) -> Mask:
    return np.asarray(np.abs(rows).max(axis=1, initial=0.0) > 0.0)


def _law_at(table: LawTable, t: Array) -> IndexArray:
    """Indices of the consecutive laws in force at times (N,); at a boundary the later law."""
    slack = 4.0 * np.spacing(np.abs(t).max(initial=1e-300))
    found = np.searchsorted(table.start, t + slack, side='right') - 1
    return np.asarray(np.maximum(found, 0), dtype=np.intp)


def _derivative(powers: Array, x: Any, order: int) -> Array:
    """Derivatives (..., P) of polynomials (..., d, P) of x."""
    value = np.zeros(())
    for j in range(powers.shape[-2] - 1, order - 1, -1):
        value = value * x + math.perm(j, order) * powers[..., j, :]
    return np.asarray(value)


def _product(A: Array, x: Array) -> Array:
    """Product of N arrays (..., n) with N matrices (n, P)."""
    wide = np.reshape(A, (len(A), math.prod(A.shape[1:-1]), A.shape[-1]))
    return np.asarray(wide @ x).reshape(*A.shape[:-1], x.shape[-1])


def _within(bounds: IndexArray) -> Iterator[IndexArray]:
    """Indices of the second elements of all groups between bounds, of the third, and so on."""
    for r in range(1, int(np.diff(bounds).max(initial=1))):
        yield bounds[:-1][np.diff(bounds) > r] + r


def _after(turns: Array, before: Array) -> Array:
    """Maps (N, W, W + P) across one element after another."""
    W = turns.shape[1]
    found = np.asarray(turns[..., :W] @ before)
    found[..., W:] += turns[..., W:]
    return found


def _grouped(turns: Array, bounds: IndexArray) -> Array:
    """Maps across groups of segments, by those across each."""
    found = turns[bounds[:-1]]
    for k in _within(bounds):
        which = np.searchsorted(bounds, k, side='right') - 1
        found[which] = _after(turns[k], found[which])
    return found


def _composed(blows: _Blows, ends: Array) -> Array:
    """Products of maps across impacts and maps (E, W, W + P) across the segments before."""
    W = ends.shape[1]
    shift = blows.shift[:, None, :W] @ ends
    shift[..., W:] += blows.shift[:, None, W:]
    found = blows.every[..., :W] @ ends + blows.every[..., W : W + 1] * shift
    found[..., W:] += blows.every[..., W + 1 :]
    return np.asarray(found)


class _Walk:
    """Propagation of variations along one motion."""

    def __init__(
        self, flows: Flows, motion: Motion, impacts: Sequence[Impact], start: Array | None
    ) -> None:
        self._of, self._motion, self._impacts = flows, motion, list(impacts)
        system, influence, m = flows.system, flows.influence, len(motion)
        self._state = influence.start if start is None else start
        self._approach = influence.approach if start is None else np.zeros(
            (len(system.parameters.approach), flows.count)
        )  # fmt: skip
        n, s = len(system.coordinates), len(system.states)
        depth = max(COUNT + 2, system.degree + 1, 3)
        self._coefficients = np.full((m, n, depth, flows.count), np.nan)
        self._states = np.full((m, s, COUNT + 1, flows.count), np.nan)
        self._shift, self._moved = np.zeros((m, flows.count)), np.arange(m) == 0
        self._approaches = np.full((m, len(self._approach), flows.count), np.nan)
        self._logged = np.full((len(impacts), len(NUMBERS), flows.count), np.nan)
        self._limits: list[DerivativeLimit] = []
        self._begun: dict[int, DerivativeLimit] = {}
        self._struck = self._by_segment()
        self._next = self._following()

    def _by_segment(self) -> dict[int, list[int]]:
        """Impacts at the start of a segment, by the impacts' numbers."""
        rigid = [i for i, impact in enumerate(self._impacts) if not impact.duration]
        begun = self._motion.curve.begun_by([self._impacts[i].t for i in rigid])
        found: dict[int, list[int]] = {}
        for i, k in zip(rigid, begun.tolist(), strict=True):
            found.setdefault(k, []).append(i)
        found.pop(0, None)  # those of the start belong to it
        return found

    def _following(self) -> IndexArray:
        """Index (m,) of the segment after each, skipping those too short for an event.

        After its release a load may appear in another row for a rounding of time.
        """
        h, m = self._motion.curve.duration, len(self._motion)
        near = np.isin(np.arange(m), [x - 1 for x in self._struck] + [*self._struck])
        own = np.where((h < _SHORT * np.median(h)) & ~near, m - 1, np.arange(m))
        return np.append(np.minimum.accumulate(own[::-1])[::-1], m - 1)[1:]

    def flow(self) -> Flow:
        """Propagate the variations along the motion, and collect the derivatives."""
        curve, m, width = self._motion.curve, len(self._motion), self._of.width * COUNT
        most = int(min(max(_MEMORY / width**2, 1.0), _MOST))
        for first in range(0, m, most):
            if not self._chunk(first, min(first + most, m)):
                break
        ends = np.append(np.flatnonzero(self._moved), m)
        known = np.concatenate([self._shift[ends[:-1]], np.zeros((1, self._of.count))])
        times = np.append(curve.start, curve.end)[ends]
        shift = np.array([np.interp(curve.start, times, x) for x in known.T]).reshape(-1, m).T
        found = (
            self._coefficients, self._states, shift, self._approaches, self._logged, self._state
        )  # fmt: skip
        for x in found:
            x[..., [p for p, limit in self._begun.items() if limit.ends]] = np.nan
        limits = sorted(self._limits, key=lambda limit: limit.t)
        return Flow(*found, tuple(limits), self._begun)

    def _begin(self) -> None:
        """Derivatives at the start where keys change contacts or switches there."""
        of, f, t = self._of, len(self._of.free), float(self._motion.curve.start[0])
        at = of.equations.points(self._motion, np.array([0]), np.zeros(1), damped=False)
        side, modes = self._side(at), self._motion.modes[0].tolist()
        laws = [[_derivative(x[:1], 0.0, order) for order in range(3)] for x in self._laws]
        x = self._variation(0, laws, np.concatenate([self._state, self._approach]))
        for p, others in enumerate(of.influence.begun):
            closed = {i for now, _ in others for i, mode in enumerate(now) if mode != modes[i]}
            if not others:
                continue
            where = ', '.join(of.system.gaps[i].name for i in sorted(closed))
            text, ends = _SEATED, False
            try:
                of.jumps.begin(side, others)
                if closed:
                    self._state[f : 2 * f, p] = of.jumps.seated(side, x, p)
            except NoDerivativeError as error:
                text, ends = f'{error}; there are no derivatives by it', True
            if closed or ends:
                self._begun[p] = DerivativeLimit(t, where, text, ends)

    def _chunk(self, first: int, last: int) -> bool:
        """Segments `first` to `last - 1` and the events at their ends; False at a limit."""
        of, motion = self._of, self._motion
        k, f, system = np.arange(first, last), len(self._of.free), self._of.system
        places, curve, P = rule().nodes, self._motion.curve, self._of.count
        at = of.equations.points(motion, k, places)
        self._given = of.parameters(motion, Points(*(x[:, ::COUNT] for x in at)), k)
        begun = curve.start[k] + curve.start_low[k]
        self._laws = [of.prescribed(begun, j) for j in range(len(system.prescribed))]
        if not first and any(of.influence.begun):
            self._begin()
        h = curve.duration[k, None]
        self._ends = [[_derivative(x, h, order) for order in range(3)] for x in self._laws]
        steps = self._steps(k - first, at, np.zeros(len(k)), curve.duration[k])
        # from the start of each segment to that of the next, approaches being parts of the state
        turns = self._across(steps)
        self._refine(turns, k)
        # single impacts are linear maps, too: they join the maps of their segments, so that only
        # other events interrupt the products of maps
        count, w, W = len(k), f + of.width, turns.shape[1]
        events = self._events(first, last)
        blows = self._blows(first, events)
        ends = turns[blows.segment]
        turns[blows.segment, :w] = _composed(blows, ends)[:, :w]
        states, alive, done = np.empty((count + 1, W, P)), True, count
        states[0, :w], states[0, w:] = self._state, self._approach
        jumps = events.number.keys() - {*blows.segment.tolist()}
        # maps are multiplied in groups first: states at few boundaries need one product each
        bounds = np.array(sorted({*range(0, count, _GROUP), *(j + 1 for j in jumps), count}))
        grouped = _grouped(turns, bounds)
        for start, end, turn in zip(bounds[:-1], bounds[1:], grouped, strict=True):
            j, now = int(end) - 1, states[end]
            now[:] = turn[:, :W] @ states[start] + turn[:, W:]
            if j in jumps:
                self._state, self._approach = now[:w], now[w:]
                if not self._jump(first + j, j, *events.at([j])):
                    alive, done = False, j + 1
                    now[:w] = np.nan
                    break
                now[:w], now[w:] = self._state, self._approach
        # then the states inside of all groups, at once for equal places in them
        for inner in _within(bounds[bounds <= done]):
            turn = turns[inner - 1]
            states[inner] = turn[..., :W] @ states[inner - 1] + turn[..., W:]
        self._state, self._approach = states[done, :w], states[done, w:]
        self._strike(first, blows, ends, states[:done])
        if not alive:
            self._shift[first + done :] = np.nan
        self._approaches[first : first + done] = states[:done, w:]
        rates = _product(steps.rates[:done, ..., :W], states[:done])
        rates += steps.rates[:done, ..., W:]
        kept = slice(first, first + done)
        q, others = powers(states[:done, :w], rates, curve.duration[kept], f)
        self._coefficients[kept] = 0.0
        self._coefficients[kept, of.free, : q.shape[2]] = q
        self._states[kept] = others
        for i, law in zip(system.prescribed_index, self._laws, strict=True):
            self._coefficients[kept, i, : law.shape[1]] = law[:done]
        return alive

    def _steps(self, which: IndexArray, at: Points, since: Array, h: Array) -> Steps:
        """Variations in segments of the chunk, or parts of them.

        Parameters
        ----------
        which : (N,) indices of the segments
        at : points at the nodes of each segment
        since, h : (N,) [s] from the starts of the segments, and durations
        """
        of, slopes, given = self._of, self._of.equations.slopes(at), self._given[which]
        count, w = len(which), of.width

        def by_node(x: Array) -> Array:
            """(N, K, f + s, columns)."""
            return x.reshape(w, -1, count, COUNT).transpose(2, 3, 0, 1)

        own_ = by_node(slopes.parameters)
        forced = _product(own_, given)
        for column, x in slopes.built_in.items():
            forced[..., column] += by_node(x)[..., 0]
        dt = since[:, None] + np.outer(h, rule().nodes.fractions)
        for j, (i, law) in enumerate(zip(of.system.prescribed_index, self._laws, strict=True)):
            for order, slope in enumerate((slopes.q[:, i], slopes.v[:, i], slopes.a_p[:, j])):
                moved = _derivative(law[which, None], dt[:, :, None], order)
                forced += by_node(slope) * moved[:, :, None]
        touches = [of.equations.chosen.index(i) for i in of.system.parameters.approach]
        columns = np.concatenate([own_[..., touches], forced], axis=3)
        return solve(slopes, of.free, h, columns)

    def _across(self, steps: Steps) -> Array:
        """Maps (N, W, W + P) of states with their approaches, which stay, across steps."""
        count, w, C = steps.end.shape
        W = C - self._of.count
        found = np.zeros((count, W, C))
        found[:, :w] = steps.end
        found[:, range(w, W), range(w, W)] = 1.0
        return found

    def _refine(self, turns: Array, k: IndexArray) -> None:
        """Split segments beside ends of touches into parts as long as their distance.

        There the force is a broken power of a depth that is zero, which no polynomial follows.
        """
        of, motion = self._of, self._motion
        closed = motion.modes > Mode.FREE_FLIGHT
        changed = np.pad((closed[1:] != closed[:-1]).any(axis=1), 1)
        which = np.flatnonzero((closed.any(axis=1) & (changed[1:] | changed[:-1]))[k])
        if not of.system.compliant or not len(which):
            return
        whole, found = motion.curve.duration[k[which]], turns[which][:0]
        for begin, end in pairwise(_PARTS):
            since, h = begin * whole, (end - begin) * whole
            dt = since[:, None] + np.outer(h, rule().nodes.fractions)
            at = of.equations.points(motion, np.repeat(k[which], COUNT), dt.ravel())
            part = self._across(self._steps(which, at, since, h))
            found = _after(part, found) if len(found) else part
        turns[which] = found

    # --- events -------------------------------------------------------------------------------

    def _events(self, first: int, last: int) -> _Events:
        """The events at the ends of some segments."""
        of, motion, curve = self._of, self._motion, self._motion.curve
        k = np.arange(first, min(last, len(motion) - 1))
        if not len(k):
            return _Events({}, ())
        after = self._next[k]
        if of.system.switches:
            old, new = (
                of.equations.points(motion, x, np.zeros(len(k))).parameters for x in (k, after)
            )
            kept = np.isin(np.arange(len(old)), of.system.parameters.stabilisation, invert=True)
            changed = (old != new)[kept].any(axis=0)
        else:
            changed = np.zeros(len(k), dtype=bool)
            for x in (motion.modes, motion.approach, motion.acting):
                changed |= (x[k] != x[after]).any(axis=1) if x.size else False
        for table in of.laws:
            changed |= _law_at(table, curve.start[after]) != _law_at(table, curve.start[k])
        changed |= np.isin(k + 1, [*self._struck])
        changed &= np.isin(k, self._next) | (k == 0)
        which = np.flatnonzero(changed)
        if not len(which):
            return _Events({}, ())
        sides = []
        for segments, dt in (
            (k[which], curve.duration[k[which]]), (after[which], np.zeros(len(which))),
        ):  # fmt: skip
            at = of.equations.points(motion, segments, dt, damped=False)
            sides.append(self._side(at))
        return _Events({j: i for i, j in enumerate(which.tolist())}, tuple(sides))

    def _side(self, at: Points) -> Side:
        """One side of events at points."""
        of = self._of
        rates, a = of.equations.slopes(at).rate, np.zeros(at.q.shape)
        a[of.free], a[of.system.prescribed_index] = rates[: len(of.free)], at.a_p
        return Side(at, rates, a)

    def _blows(self, first: int, events: _Events) -> _Blows:
        """Single impacts among the events of the chunk."""
        of, w = self._of, len(self._state)
        struck = {j: self._struck.get(int(self._next[first + j]), []) for j in events.number}
        which = [j for j, own in struck.items() if len(own) == 1]
        C = of.count + w + len(self._approach)
        if not which:
            none = np.zeros(0, dtype=np.intp)
            return _Blows(none, none, np.zeros((0, C)), np.zeros((0, w + len(NUMBERS), C + 1)))
        before, after = events.at(which)
        own_ = [i for symbols in of.system.parameters.switches for i in symbols]
        switched = (before.at.parameters[own_] != after.at.parameters[own_]).any(axis=0)
        states = np.eye(C - of.count, C)
        x = self._variation(which, self._ends, states)
        numbers = [struck[j][0] for j in which]
        impacts = [self._impacts[i] for i in numbers]
        alone, found = of.jumps.blows(before, after, x, impacts, len(states))
        alone &= ~switched
        every = np.concatenate([found.free, found.impacts[0]], axis=1)
        segments, own_impacts = np.array([which, numbers], dtype=np.intp)[:, alone]
        return _Blows(segments, own_impacts, found.shift[alone], every[alone])

    def _strike(self, first: int, blows: _Blows, ends: Array, states: Array) -> None:
        """Collect the single impacts at the ends of some segments that begin with `states`.

        Parameters
        ----------
        ends : (E, 2f + s + a, 2f + s + a + P) maps across the segments
        """
        known, W = blows.segment < len(states), ends.shape[1]
        segment, impact = blows.segment[known], blows.impact[known]
        x = _product(ends[known, :, :W], states[segment]) + ends[known, :, W:]
        shift, log = blows.shift[known, None], blows.every[known, len(self._state) :]
        dt = _product(shift[..., :W], x) + shift[..., W:]
        logged = _product(log[..., :W], x) + log[..., W : W + 1] * dt + log[..., W + 1 :]
        k = self._next[first + segment]
        self._shift[k], self._moved[k], self._logged[impact] = dt[:, 0], True, logged
        for i, at in zip(impact.tolist(), k.tolist(), strict=True):
            self._note_chatter(at, [self._impacts[i]])

    def _note_chatter(self, k: int, impacts: Sequence[Impact]) -> None:
        t = float(self._motion.curve.start[k])
        chatters = [i.joint for i in impacts if i.ends_chatter]
        self._limits += [DerivativeLimit(t, joint, CHATTER, False) for joint in chatters]

    def _jump(self, old: int, j: int, before: Side, after: Side) -> bool:
        """Propagate derivatives across the event after segment `old`; False if there are none."""
        of, k = self._of, int(self._next[old])
        t = float(self._motion.curve.start[k])
        x = self._variation(j, self._ends, np.concatenate([self._state, self._approach]))
        struck = self._struck.get(k, [])
        impacts = [self._impacts[i] for i in struck]
        where = ', '.join(dict.fromkeys(i.joint for i in impacts)) or self._changed(old, k)
        try:
            if impacts:
                found = of.jumps.struck(before, after, x, impacts)
                of.jumps.check_switches(before, after, self._switched(before, after))
            else:
                found = self._passed((old, k), before, after, x)
        except NoDerivativeError as error:
            text = f'{error}; there are no derivatives beyond it'
            self._limits.append(DerivativeLimit(t, where, text, True))
            return False
        self._state, self._shift[k], self._approach = found.free, found.shift, found.approach
        self._moved[k] = True
        for i, row in zip(struck, found.impacts, strict=False):
            self._logged[i] = row
        self._note_chatter(k, impacts)
        return True

    def _variation(
        self, j: int | list[int], laws: Sequence[Sequence[Array]], state: Array
    ) -> Variation:
        """Derivatives at the j-th of some points of the chunk, with those of prescribed motion.

        Parameters
        ----------
        state : (2f + s + a, C) with speeds of initial contact; the last P columns are keys
        """
        of, system = self._of, self._of.system
        n, f, first = len(system.coordinates), len(of.free), state.shape[1] - of.count
        given = self._given[j]
        lead = given.shape[:-2]
        q, v = np.zeros((2, *lead, n, state.shape[1]))
        a_p = np.zeros((*lead, len(system.prescribed), state.shape[1]))
        q[..., of.free, :], v[..., of.free, :] = state[:f], state[f : 2 * f]
        for m, (i, ends) in enumerate(zip(system.prescribed_index, laws, strict=True)):
            q[..., i, first:], v[..., i, first:], a_p[..., m, first:] = (x[j] for x in ends)
        parameters = np.zeros((*given.shape[:-1], state.shape[1]))
        parameters[..., first:] = given
        states, approach = state[2 * f : f + of.width], state[f + of.width :]
        for m, i in enumerate(system.parameters.approach):
            parameters[..., of.equations.chosen.index(i), :] = approach[m]
        wide = np.broadcast_to(states, (*lead, *states.shape))
        return Variation(q, v, a_p, wide, parameters, approach)

    def _passed(self, ends: tuple[int, int], before: Side, after: Side, x: Variation) -> Saltation:
        """Saltation across an event without impact between two segments."""
        of, motion, curve = self._of, self._motion, self._motion.curve
        sizes, m = of.equations.sizes, len(of.system.gaps)
        old, new = motion.modes[[*ends]].tolist()
        rows, gaps = [], []
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            slid = a in (Mode.SLIDING_FORWARD, Mode.SLIDING_BACKWARD)
            if a != b and slid and b > Mode.FREE_FLIGHT:
                rows.append(m + i)
            if a == Mode.FREE_FLIGHT < b:
                gaps.append(i)
        switched = self._switched(before, after)
        guards = Selected.none(sizes, len(rows) + len(gaps) + len(switched))
        for column, row in enumerate(rows):
            guards.row[row, column] = 1.0
        for column, i in enumerate(gaps, start=len(rows)):
            guards.gap[i, column] = 1.0
        for column, j in enumerate(switched, start=len(rows) + len(gaps)):
            guards.switch[j, column] = 1.0
        law = None
        for j, table in enumerate(of.laws):
            first, then = _law_at(table, curve.start[[*ends]])
            if first != then:
                law = of.influence.laws[j].start[then]
        if gaps and not of.system.compliant and not of.equations.system.rated[gaps[0]]:
            raise NoDerivativeError('a contact closes without an approach')
        return of.jumps.passed(before, after, x, guards, law)

    def _switched(self, before: Side, after: Side) -> list[int]:
        """The switches whose rows an event changes."""
        if not (index := self._of.system.parameters.switches):
            return []
        old, new = before.at.parameters, after.at.parameters
        return [j for j, symbols in enumerate(index) if (old[symbols] != new[symbols]).any()]

    def _changed(self, *ends: int) -> str:
        """Joints whose contact changes between two segments."""
        old, new = self._motion.modes[[*ends]]
        names = [gap.name for gap in self._of.system.gaps]
        return ', '.join(dict.fromkeys(names[i] for i in np.flatnonzero(old != new)))
