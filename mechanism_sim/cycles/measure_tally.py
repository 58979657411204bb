"""Figures of what is known at every instant, accumulated over the pieces of a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.cycles.measure_text import EXTREMES, Figure, Value, as_row
from mechanism_sim.cycles.quantities import Quantities
from mechanism_sim.cycles.time_integrals import EXACT, Estimate, TimeIntegrals
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.solution import Piece
from mechanism_sim.numerics.extremes import GLANCES, ExtremeSearch
from mechanism_sim.numerics.monotone import Monotone, joined, monotone
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.numerics.quadrature import parts_of
from mechanism_sim.scene import Machine
from mechanism_sim.units import product

_NODES = 5  # of the fewest looks into a step: what is narrower than one of them may hide

_FORMS = {'mean': 'value', 'integral': 'value', 'rms': 'square', 'work': 'power'}
"""Of what figures are integrals over time: an argument, its square, or the power it is part of."""


def speed_of(machine: Machine, f: Figure) -> str:
    """The column of the speed that goes with the torque or force of a drive."""
    kind, _, coordinate = f.argument.partition('.')
    driven = machine.physics.driven
    if kind != 'drive_torque' or f.names != (f.argument,):
        raise InputError(
            f'work({f.argument}): it is of drive_torque or drive_torque.COORDINATE; of anything '
            "else write 'integral(FORCE * SPEED)'"
        )
    return f'velocity.{coordinate or driven[0]}'


def unit_of_figure(quantities: Quantities, f: Figure) -> str:
    """The unit of what a figure is of."""
    with np.errstate(all='ignore'):
        return f.evaluate(lambda name: Value(np.ones(1), quantities.units[name])).unit


class Tally:
    """Figures of what is known at every instant of one window."""

    def __init__(
        self, machine: Machine, quantities: Quantities, figures: Sequence[Figure]
    ) -> None:
        self._machine, self._quantities = machine, quantities
        self._arguments = list(dict.fromkeys(f.argument for f in figures))
        self._by_argument = {f.argument: f for f in figures}
        self._units = {a: unit_of_figure(quantities, f) for a, f in self._by_argument.items()}
        wanted = {f.function for f in figures}
        self._extreme = [
            a
            for a in self._arguments
            if any(f.argument == a and f.function in EXTREMES for f in figures)
        ]
        self._conditions = [
            a
            for a in self._arguments
            if any(f.argument == a and f.function == 'share' for f in figures)
        ]
        self._ends = bool(wanted & {'change', 'initial', 'final'})
        self._works = {f.argument: speed_of(machine, f) for f in figures if f.function == 'work'}
        self._search = ExtremeSearch([(a, self._units[a]) for a in self._extreme])
        self._unbounded: dict[str, bool] = {}
        self._rows = list(
            dict.fromkeys(
                (_FORMS[f.function], f.argument) for f in figures if f.function in _FORMS
            )
        )
        self._integrals = TimeIntegrals(len(self._rows))
        self._true, self._span = dict.fromkeys(self._conditions, 0.0), 0.0
        self._struck = dict.fromkeys(self._works, 0.0)  # [J] work in impacts
        self._parts: dict[str, list[Monotone]] = {
            f.argument: [] for f in figures if f.function == 'percentile'
        }
        self._largest: dict[str, float] = {}  # magnitudes so far of what is cut into parts
        self._longest = 0.0  # [s] of the parts that are looked at
        self._first: Array | None = None
        self._last: Array | None = None

    def _values(
        self, piece: Piece, arguments: Sequence[str], k: NDArray[np.intp], dt: Array | Nodes
    ) -> tuple[Array, dict[str, Array]]:
        """Expressions (C, N) at instants, and the quantities in them by name."""
        seen = self._quantities.at(piece.motion, piece.balance, k, dt)
        count = len(next(iter(seen.values())))
        units = self._quantities.units
        with np.errstate(invalid='ignore', divide='ignore', over='ignore'):
            rows = [
                as_row(self._by_argument[a].evaluate(lambda n: Value(seen[n], units[n])).x, count)
                for a in arguments
            ]
        return np.array(rows).reshape(len(arguments), count), seen

    def add(self, piece: Piece, since: float, until: float) -> None:
        """Enter the part of a piece within a window [s]."""
        motion, curve = piece.motion, piece.motion.curve
        if not self._arguments or since == math.inf:
            return
        start, end = curve.spans(since, until)
        if not len(start):
            return
        self._longest = max(self._longest, float((end - start).max()))
        k = curve.locate(0.5 * (start + end))
        if self._extreme:
            self._search.add(
                lambda t: self._values(piece, self._extreme, *curve.within(t))[0],
                start,
                end,
                lambda some: self._values(piece, self._extreme, k[some], GLANCES)[0],
            )
            for limit in self._machine.physics.no_limits(motion):
                if since <= limit.t <= until:
                    at = self._values(piece, self._extreme, *curve.find(np.array([limit.t])))[0]
                    lost = ~np.isfinite(at[:, 0])
                    self._unbounded |= dict.fromkeys(np.array(self._extreme)[lost].tolist(), True)
        self._integrals.add(lambda k, dt: self._integrands(piece, k, dt), motion, since, until)
        every = parts_of(curve, since, until)
        for a, kept in self._parts.items():
            part, self._largest[a] = monotone(
                lambda k, dt, a=a: self._values(piece, [a], k, dt)[0],  # type: ignore[misc]
                every, self._largest.get(a, 0.0),
            )  # fmt: skip
            kept.append(part)
        if self._conditions:
            self._time_true(piece, since, until)
        for impact in piece.impacts if self._struck else ():
            if since <= impact.t < until and len(self._machine.physics.driven) == 1:
                for a in self._struck:
                    self._struck[a] += impact.drive_work
        if self._ends:
            for t, first in ((start[:1], True), (end[-1:], False)):
                row = self._values(piece, self._arguments, *curve.find(t))[0][:, 0]
                if not first:
                    self._last = row
                elif self._first is None:
                    self._first = row

    def _integrands(self, piece: Piece, k: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """What is integrated, in rows."""
        arguments = list(dict.fromkeys(a for _, a in self._rows))
        x, seen = self._values(piece, arguments, k, dt)
        rows = []
        for form, name in self._rows:
            row = x[arguments.index(name)]
            with np.errstate(invalid='ignore', over='ignore'):
                speed = seen[self._works[name]] if form == 'power' else 1.0
                rows.append(row * (row if form == 'square' else speed))
        return np.array(rows)

    def _time_true(self, piece: Piece, since: float, until: float) -> None:
        """Enter for how long conditions hold; they change where what they compare is equal."""
        curve = piece.motion.curve
        every = parts_of(curve, since, until)
        self._span += float((every.end - every.begin).sum())
        for name in self._true:
            figure, places = self._by_argument[name], [every.begin, every.end]
            owners = [every.segment, every.segment]
            for i in range(figure.comparisons):
                key = f'{name} {i}'
                part, self._largest[key] = monotone(
                    self._difference(piece, figure, i), every, self._largest.get(key, 0.0)
                )
                of = np.flatnonzero(np.sign(part.first) * np.sign(part.last) < 0.0)
                share = 0.5 * (part.crossings(0.0, of) + 1.0)
                places.append(part.begin[of] + part.width[of] * share)
                owners.append(part.segment[of])
            segment, place = np.concatenate(owners), np.concatenate(places)
            order = np.lexsort((place, segment))
            segment, place = segment[order], place[order]
            same = np.flatnonzero(segment[1:] == segment[:-1])
            if not len(same):
                continue
            width = place[same + 1] - place[same]
            middle = 0.5 * (place[same + 1] + place[same])
            holds = self._values(piece, [name], segment[same], middle[:, None])[0][0] != 0.0
            self._true[name] += float(width[holds].sum())

    def _difference(
        self, piece: Piece, figure: Figure, i: int
    ) -> Callable[[NDArray[np.intp], Array | Nodes], Array]:
        """The left less the right side of a comparison in a condition, as a function."""

        def values(k: NDArray[np.intp], dt: Array | Nodes) -> Array:
            seen = self._quantities.at(piece.motion, piece.balance, k, dt)
            count, units = len(next(iter(seen.values()))), self._quantities.units
            with np.errstate(invalid='ignore', divide='ignore', over='ignore'):
                x = figure.difference(i, lambda n: Value(seen[n], units[n]))
                return as_row(x, count)[None]

        return values

    def result(self, f: Figure) -> tuple[Value, str]:
        """The value of a figure of this window, and its resolution.

        Steps are as short as the machine's own loads ask for; what the text of a measure makes of
        the motion may be narrower.
        """
        value, note = self._result(f)
        if note == EXACT and f.may_be_narrow and f.function not in ('change', 'initial', 'final'):
            note = (
                f'what the text makes narrower than {self._longest / _NODES:.1g} s may be missed'
            )
        return value, note

    def _result(self, f: Figure) -> tuple[Value, str]:
        name, unit, kind = f.argument, self._units[f.argument], f.function
        note = EXACT
        if kind in EXTREMES:
            i = self._extreme.index(name)
            low, high = float(self._search.least[i]), float(self._search.greatest[i])
            x = {'highest': high, 'lowest': low, 'largest': max(-low, high), 'range': high - low}[
                kind
            ]
            if self._unbounded.get(name):
                x = math.inf if kind in ('largest', 'range') else math.nan
                note = 'it grows beyond all bounds at a singular position'
            return Value(x, unit), note
        if kind in ('change', 'initial', 'final'):
            if self._first is None or self._last is None:
                return Value(math.nan, unit), note
            i = self._arguments.index(name)
            first, last = float(self._first[i]), float(self._last[i])
            return Value(
                {'change': last - first, 'initial': first, 'final': last}[kind], unit
            ), note
        if kind == 'share':
            return Value(self._true[name] / self._span if self._span else math.nan), note
        if kind == 'percentile':
            return self._percentile(f)
        return self._integrated(f)

    def _integrated(self, f: Figure) -> tuple[Value, str]:
        """A figure that is an integral over time, or follows from one."""
        name, unit, kind = f.argument, self._units[f.argument], f.function
        found = self._integrals
        i = self._rows.index((_FORMS[kind], name))
        if kind == 'work':
            unit, e = 'J', found.integral(i)
            e = e._replace(value=e.value + self._struck[name])
        elif kind == 'integral':
            unit, e = product(unit, 's'), found.integral(i)
        else:
            e = found.root(i) if kind == 'rms' else found.mean(i)
        if not found.time:
            return Value(0.0 if kind == 'work' else math.nan, unit), EXACT
        return Value(e.value, unit), e.note(unit)

    def _percentile(self, f: Figure) -> tuple[Value, str]:
        """The level that is not exceeded for a share of the time."""
        unit, kept = self._units[f.argument], self._parts[f.argument]
        part = joined(kept) if kept else None
        if part is None or not len(part.low):
            return Value(math.nan, unit), EXACT
        x = part.quantile((f.percent or 0.0) / 100.0)
        size = float(np.abs(part.first).max())
        if part.lost:
            return Value(x, unit), f'of the time but {part.lost:.3g} s, when it is not finite'
        return Value(x, unit), Estimate(x, part.error, size).note(unit)
