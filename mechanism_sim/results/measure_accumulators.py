"""Figures of quantities in time, accumulated over the pieces of a run."""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.audit import recovers
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.expressions import ExpressionNode, numbers
from mechanism_sim.numerics.extremes import GLANCES, ExtremeSearch
from mechanism_sim.numerics.monotone import Monotone, joined, monotone
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.numerics.quadrature import (
    Assumptions,
    Parts,
    Values,
    integrate,
    parts_of,
    where_steep,
)
from mechanism_sim.results.measure_text import EXTREMES, Figure, as_row
from mechanism_sim.results.path_distance import PathDistances
from mechanism_sim.results.quantity import Quantity, View, evaluated
from mechanism_sim.results.ranges import travel
from mechanism_sim.results.run import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.tolerances import TOLERANCES
from mechanism_sim.units import product

_AUDIT, _ROUNDING = TOLERANCES.audit, TOLERANCES.rounding

EXACT = 'of the motion'
R = TypeVar('R', str, tuple[str, str])

_FORMS = {'mean': 'value', 'integral': 'value', 'rms': 'square', 'work': 'power'}
"""Integrands of figures: an argument, its square, or the power of which it is part."""


def speed_of(machine: Machine, f: Figure) -> str:
    """The column of the speed that goes with the torque or force of a drive."""
    kind, _, coordinate = f.argument.partition('.')
    if kind != 'drive_torque' or f.names != (f.argument,):
        raise InputError(
            f'work({f.argument}): it applies to drive_torque or drive_torque.COORDINATE; '
            "otherwise write 'integral(FORCE * SPEED)'"
        )
    return f'velocity.{coordinate or machine.plan.main}'


def _apart(rows: Sequence[R], own: Collection[str]) -> list[list[R]]:
    """Arguments, or pairs of a form and an argument: those with parts of their `own` apart."""
    groups: dict[str, list[R]] = {}
    for row in rows:
        argument = row if isinstance(row, str) else row[1]
        groups.setdefault(argument if argument in own else '', []).append(row)
    return list(groups.values())


class FigureAccumulator:
    """Figures of quantities in time over one window."""

    def __init__(
        self,
        machine: Machine,
        quantities: Mapping[str, Quantity],
        static: bool,
        figures: Sequence[Figure],
    ) -> None:
        self._machine, self._quantities, self._static = machine, quantities, static
        self._distances = {
            f: PathDistances(machine, f.path, f.names) for f in figures if f.path is not None
        }
        figures = [f for f in figures if f.path is None]
        self._by_argument = {f.argument: f for f in figures}
        units = {name: quantity.unit for name, quantity in quantities.items()}
        self._units = {a: f.unit(units) for a, f in self._by_argument.items()}
        wanted = {f.function for f in figures}
        self._extreme = list(dict.fromkeys(f.argument for f in figures if f.function in EXTREMES))
        self._ends = bool(wanted & {'change', 'initial', 'final'})
        self._works = {f.argument: speed_of(machine, f) for f in figures if f.function == 'work'}
        # what may be steep is looked at in parts of its own, all else together
        self._steep = {f.argument: f for f in figures if f.steep}
        size = machine.mechanism.size
        differences: dict[Hashable, float] = {
            (a, self._units[a]): size
            for a in self._extreme
            if (known := quantities.get(a)) and known.difference
        }
        self._searches = [
            (own, ExtremeSearch([(a, self._units[a]) for a in own], differences))
            for own in _apart(self._extreme, self._steep)
        ]
        self._unbounded: dict[str, bool] = {}
        rows = list(
            dict.fromkeys(
                (_FORMS[f.function], f.argument) for f in figures if f.function in _FORMS
            )
        )
        self._integrals = [
            (own, TimeIntegrals(len(own), machine.physics.corners))
            for own in _apart(rows, {f.argument for f in figures if f.steep or f.corners})
        ]
        self._true = {f.argument: 0.0 for f in figures if f.function == 'share'}
        self._span = 0.0
        self._impact_works = dict.fromkeys(self._works, 0.0)  # [J] work in impacts
        self._parts: dict[str, list[Monotone]] = {
            f.argument: [] for f in figures if f.function == 'percentile'
        }
        self._largest: dict[Hashable, float] = {}  # magnitudes so far of what is cut into parts
        self._first: Array | None = None
        self._last: Array | None = None

    @property
    def _arguments(self) -> list[str]:
        return [*self._by_argument]

    def _seen(self, piece: Piece, k: NDArray[np.intp], dt: Array | Nodes) -> dict[str, Array]:
        """The quantities (N,) by name, at instants as those of ``curve.at(k, dt)``."""
        view = View(self._machine, piece.motion, k, dt, piece.balance, static=self._static)
        return evaluated(self._quantities, view)

    def _values(
        self, piece: Piece, arguments: Sequence[str], k: NDArray[np.intp], dt: Array | Nodes
    ) -> tuple[Array, dict[str, Array]]:
        """Expressions (C, N) at instants, and the quantities in them by name."""
        seen = self._seen(piece, k, dt)
        count = len(next(iter(seen.values())))
        rows = [as_row(numbers(self._by_argument[a].tree, seen), count) for a in arguments]
        return np.array(rows).reshape(len(arguments), count), seen

    def add(self, piece: Piece, since: float, until: float) -> None:
        """Enter the part of a piece within a window [s]."""
        motion, curve = piece.motion, piece.motion.curve
        if since == math.inf:
            return
        for distances in self._distances.values():
            distances.add(piece, since, until, lambda t: self._seen(piece, *curve.find(t)))
        if not self._arguments:
            return
        start, end = curve.spans(since, until)
        if not len(start):
            return
        every = parts_of(curve, since, until)
        parts = {a: self._steep_parts(piece, f, every) for a, f in self._steep.items()}
        self._look_for_extremes(piece, parts, since, until)
        for rows, integrals in self._integrals:
            of, own = self._by_argument[rows[0][1]], parts.get(rows[0][1], every)
            integrals.add(
                lambda k, dt, rows=rows: self._integrands(piece, rows, k, dt),  # type: ignore[misc]
                motion,
                self._cut(piece, of.argument, of.corners, own) if of.corners else own,
            )
        for a, kept in self._parts.items():
            part, self._largest[a] = monotone(
                lambda k, dt, a=a: self._values(piece, [a], k, dt)[0],  # type: ignore[misc]
                parts.get(a, every), self._largest.get(a, 0.0),
            )  # fmt: skip
            kept.append(part)
        if self._true:
            self._time_true(piece, every, parts)
        for impact in piece.impacts if self._impact_works else ():
            if since <= impact.t < until and len(self._machine.physics.driven) == 1:
                for a in self._impact_works:
                    self._impact_works[a] += impact.drive_work
        if self._ends:
            first, self._last = (
                self._values(piece, self._arguments, *curve.find(t))[0][:, 0]
                for t in (start[:1], end[-1:])
            )
            self._first = first if self._first is None else self._first

    def _look_for_extremes(
        self, piece: Piece, steep: Mapping[str, Parts], since: float, until: float
    ) -> None:
        """Enter extremes, and instants of unbounded forces."""
        motion, curve = piece.motion, piece.motion.curve
        for own, search in self._searches:
            search.enlarge(travel(self._machine, motion))

            def values(t: Array, own: list[str] = own) -> Array:
                return self._values(piece, own, *curve.within(t))[0]

            if own[0] in steep:
                k, begin, end, _ = steep[own[0]]
                search.add(values, curve.times(k, begin), curve.times(k, end))
                continue
            start, last = curve.spans(since, until)
            k = curve.locate(0.5 * (start + last))

            def glance(
                some: NDArray[np.intp] | slice,
                k: NDArray[np.intp] = k,
                own: list[str] = own,
            ) -> Array:
                return self._values(piece, own, k[some], GLANCES)[0]

            search.add(values, start, last, glance)
        if self._extreme:
            for limit in self._machine.physics.no_limits(motion):
                if since <= limit.t <= until:
                    at = self._values(piece, self._extreme, *curve.find(np.array([limit.t])))[0]
                    lost = ~np.isfinite(at[:, 0])
                    self._unbounded |= dict.fromkeys(np.array(self._extreme)[lost].tolist(), True)

    def _steep_parts(self, piece: Piece, figure: Figure, parts: Parts) -> Parts:
        """Parts short enough for the steep functions in the text of a figure."""
        for name, argument in figure.steep:
            parts = where_steep(self._of_text(piece, argument), name, parts)
        return parts

    def _of_text(self, piece: Piece, node: ExpressionNode) -> Values:
        """A part of the text of a figure as a function of time."""

        def values(k: NDArray[np.intp], dt: Array | Nodes) -> Array:
            seen = self._seen(piece, k, dt)
            return as_row(numbers(node, seen), len(next(iter(seen.values()))))[None]

        return values

    def _integrands(
        self,
        piece: Piece,
        wanted: Sequence[tuple[str, str]],
        k: NDArray[np.intp],
        dt: Array | Nodes,
    ) -> Array:
        """Integrands, in rows."""
        arguments = list(dict.fromkeys(a for _, a in wanted))
        x, seen = self._values(piece, arguments, k, dt)
        rows = []
        for form, name in wanted:
            row = x[arguments.index(name)]
            with np.errstate(invalid='ignore', over='ignore'):
                speed = seen[self._works[name]] if form == 'power' else 1.0
                rows.append(row * (row if form == 'square' else speed))
        return np.array(rows)

    def _time_true(self, piece: Piece, all_parts: Parts, steep: Mapping[str, Parts]) -> None:
        """Enter the times in which conditions hold; they change where both sides are equal."""
        self._span += float((all_parts.end - all_parts.begin).sum())
        for name in self._true:
            every = steep.get(name, all_parts)
            k, begin, end, _ = self._cut(piece, name, self._by_argument[name].compared, every)
            if not len(k):
                continue
            holds = self._values(piece, [name], k, 0.5 * (begin + end)[:, None])[0][0] != 0.0
            self._true[name] += float((end - begin)[holds].sum())

    def _cut(
        self, piece: Piece, name: str, nodes: Sequence[ExpressionNode], every: Parts
    ) -> Parts:
        """Parts that end where expressions in the text of an argument are zero, too."""
        places, owners = [every.begin, every.end], [every.segment, every.segment]
        for node in nodes:
            key = name, node
            part, self._largest[key] = monotone(
                self._of_text(piece, node), every, self._largest.get(key, 0.0)
            )
            of = np.flatnonzero(np.sign(part.first) * np.sign(part.last) < 0.0)
            share = 0.5 * (part.crossings(0.0, of) + 1.0)
            places.append(part.begin[of] + part.width[of] * share)
            owners.append(part.segment[of])
        segment, place = np.concatenate(owners), np.concatenate(places)
        order = np.lexsort((place, segment))
        segment, place = segment[order], place[order]
        kept = np.flatnonzero((segment[1:] == segment[:-1]) & (place[1:] > place[:-1]))
        segment, begin, end = segment[kept], place[kept], place[kept + 1]
        alone = np.bincount(segment, minlength=len(piece.motion))[segment] == 1
        return Parts(segment, begin, end, alone & np.isin(segment, every.segment[every.whole]))

    def result(self, f: Figure) -> tuple[float, str]:
        """The value of a figure of this window, and its resolution."""
        name, kind, note = f.argument, f.function, EXACT
        if f in self._distances:
            x, why = self._distances[f].result(largest=kind == 'largest_distance')
            return x, why or note
        if kind in EXTREMES:
            own, search = next(x for x in self._searches if name in x[0])
            i = own.index(name)
            low, high = float(search.least[i]), float(search.greatest[i])
            largest = max(-low, high) + 0.0  # of what is zero all the time: without a sign
            x = {'highest': high, 'lowest': low, 'largest': largest, 'range': high - low}[kind]
            if self._unbounded.get(name):
                x = math.inf if kind in ('largest', 'range') else math.nan
                note = 'it tends to infinity at a singular position'
            return x, note
        if kind in ('change', 'initial', 'final'):
            if self._first is None or self._last is None:
                return math.nan, note
            i = self._arguments.index(name)
            first, last = float(self._first[i]), float(self._last[i])
            return {'change': last - first, 'initial': first, 'final': last}[kind], note
        if kind == 'share':
            return self._true[name] / self._span if self._span else math.nan, note
        if kind == 'percentile':
            # the level that is not exceeded for a share of the time
            unit, kept = self._units[f.argument], self._parts[f.argument]
            part = joined(kept) if kept else None
            if part is None or not len(part.low):
                return math.nan, EXACT
            level = part.quantile((f.percent or 0.0) / 100.0)
            size = float(np.abs(part.first).max())
            if part.lost:
                return level, f'of the time but {part.lost:.3g} s, when it is not finite'
            return level, Estimate(level, part.error, size).note(unit)
        # a figure that is an integral over time, or follows from one
        e, unit, time = self._estimate(f)
        if not time:
            return 0.0 if f.function == 'work' else math.nan, EXACT
        return e.value, e.note(unit)

    def rounding(self, f: Figure) -> float:
        """Size of the errors of a figure by rounding: what differs by less is the same.

        Measured by the largest value of what it is a figure of, as that of `ExtremeSearch`: the
        lowest force of a contact is one of hundreds of newtons less as much.
        """
        name, kind, size = f.argument, f.function, 0.0
        if f in self._distances or kind == 'share':
            return size
        if kind in EXTREMES:
            own, search = next(x for x in self._searches if name in x[0])
            return float(search.rounding[own.index(name)])
        if kind in ('change', 'initial', 'final'):
            ends = [x[self._arguments.index(name)] for x in (self._first, self._last)
                    if x is not None]  # fmt: skip
            size = max(map(abs, ends), default=0.0)
        elif kind == 'percentile':
            size = max((float(np.abs(x.first).max(initial=0.0)) for x in self._parts[name]),
                       default=0.0)  # fmt: skip
        else:
            size = self._estimate(f)[0].size
        return _ROUNDING.value * float(size)

    def _estimate(self, f: Figure) -> tuple[Estimate, str, float]:
        """A figure over time with its error, its unit, and the duration [s] of its window."""
        name, unit, kind = f.argument, self._units[f.argument], f.function
        row = _FORMS[kind], name
        rows, found = next(x for x in self._integrals if row in x[0])
        i = rows.index(row)
        if kind == 'work':
            unit, e = 'J', found.integral(i)
            e = e._replace(value=e.value + self._impact_works[name])
        elif kind == 'integral':
            unit, e = product(unit, 's'), found.integral(i)
        else:
            e = found.root(i) if kind == 'rms' else found.mean(i)
        return e, unit, found.time


class Estimate(NamedTuple):
    """A figure, and its error."""

    value: float
    error: float
    size: float  #: reference magnitude of the error

    def note(self, unit: str) -> str:
        """`EXACT`, or a remark on the accuracy of the figure."""
        if not math.isfinite(self.value):
            return 'it is not finite for a part of the time'
        if self.error <= _AUDIT.promised * self.size:
            return EXACT
        return f'its error may be up to {self.error:.1g} {unit}'.rstrip()


class TimeIntegrals:
    """Integrals of C functions over time, entered piece by piece.

    Every mean, root mean square, integral and work that is told of a motion is taken here, so that
    the same figure is the same number wherever it is asked for.
    """

    def __init__(self, count: int, corners: bool = False) -> None:
        self.time, self._corners = 0.0, corners
        self._sums = np.zeros((3, count))  # value, error, size
        self._largest = np.zeros(count)

    def add(self, values: Values, motion: Motion, parts: Parts) -> None:
        """Enter parts of a motion, in the order of time.

        Parameters
        ----------
        values : (C, K n) as for `mechanism_sim.numerics.quadrature.integrate`
        """
        if not len(parts.segment) or not len(self._largest):
            return
        flags, kind = recovers(motion, parts.segment), Assumptions(corners=self._corners)
        found = integrate(values, parts, flags, self._largest, assumed=kind)
        self._largest = found.largest
        self._sums += [x.sum(axis=1) for x in (found.value, found.error, found.size)]
        self.time += float((parts.end - parts.begin).sum())

    def integral(self, i: int) -> Estimate:
        """Integral of function i."""
        return Estimate(*self._sums[:, i].tolist())

    def mean(self, i: int) -> Estimate:
        """Mean of function i; not a number without any time."""
        return Estimate(*(self._sums[:, i] / (self.time or math.nan)).tolist())

    def root(self, i: int) -> Estimate:
        """The root of the mean of function i, which is a square."""
        square = self.mean(i)
        if not math.isfinite(square.value):
            return square
        value = math.sqrt(max(square.value, 0.0))
        # the root of a square that is nothing but error is off by the root of that error
        least = math.sqrt(square.error)
        return Estimate(value, square.error / max(value, least) if least else 0.0, value)
