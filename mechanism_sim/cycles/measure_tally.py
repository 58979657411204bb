"""Figures of what is known at every instant, accumulated over the pieces of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.cycles.measure_series import EXACT
from mechanism_sim.cycles.measure_text import EXTREMES, Figure, Value, as_row
from mechanism_sim.cycles.quantities import Quantities
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.audit import rules
from mechanism_sim.hybrid.solution import Piece
from mechanism_sim.numerics.extremes import GLANCES, ExtremeSearch
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.scene import Machine
from mechanism_sim.units import product

_BISECTIONS = 50
_LOOKS = np.linspace(0.0, 1.0, 13)


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
    return f.evaluate(lambda name: Value(np.ones(1), quantities.units[name])).unit


@dataclass
class _Mean:
    """Integrals over what was entered so far."""

    of_x: float = 0.0
    of_square: float = 0.0
    time: float = 0.0


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
        self._integrals = wanted & {'mean', 'rms', 'integral', 'work', 'percentile'}
        self._conditions = [
            a
            for a in self._arguments
            if any(f.argument == a and f.function == 'share' for f in figures)
        ]
        self._kept = [
            a
            for a in self._arguments
            if any(f.argument == a and f.function == 'percentile' for f in figures)
        ]
        self._ends = bool(wanted & {'change', 'initial', 'final'})
        self._works = {f.argument: speed_of(machine, f) for f in figures if f.function == 'work'}
        self._search = ExtremeSearch([(a, self._units[a]) for a in self._extreme])
        self._unbounded: dict[str, bool] = {}
        self._means = {a: _Mean() for a in self._arguments}
        self._true, self._span, self._looks = dict.fromkeys(self._conditions, 0.0), 0.0, 0
        self._work = dict.fromkeys(self._works, 0.0)
        self._samples: list[tuple[Array, Array]] = []
        self._count = 0
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
        if self._integrals:
            self._integrate(piece, k, start, end)
        if self._conditions:
            self._time_true(piece, start, end)
        for impact in piece.impacts if self._work else ():
            if since <= impact.t < until and len(self._machine.physics.driven) == 1:
                for a in self._work:
                    self._work[a] += impact.drive_work
        if self._ends:
            for t, first in ((start[:1], True), (end[-1:], False)):
                row = self._values(piece, self._arguments, *curve.find(t))[0][:, 0]
                if not first:
                    self._last = row
                elif self._first is None:
                    self._first = row

    def _time_true(self, piece: Piece, start: Array, end: Array) -> None:
        """Enter for how long conditions hold; where one changes between two looks is located."""
        curve, width = piece.motion.curve, (end - start)[:, None]
        t = start[:, None] + width * _LOOKS

        def holds(condition: str, t: Array) -> Array:
            seen = self._values(piece, [condition], *curve.within(t))[0]
            return np.asarray(seen.reshape(t.shape) != 0.0)

        self._span += float(width.sum())
        self._looks += t.size
        for name in self._true:
            now = holds(name, t)
            times = np.diff(t, axis=1)
            both = np.logical_and(now[:, :-1], now[:, 1:])
            self._true[name] += float(times[both].sum())
            row, column = np.nonzero(now[:, :-1] != now[:, 1:])
            if not len(row):
                continue
            low, high, first = t[row, column], t[row, column + 1], now[row, column]
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                same = holds(name, middle[:, None])[:, 0] == first
                low, high = np.where(same, middle, low), np.where(same, high, middle)
            before, after = low - t[row, column], t[row, column + 1] - low
            self._true[name] += float(np.where(first, before, after).sum())

    def _integrate(self, piece: Piece, k: NDArray[np.intp], start: Array, end: Array) -> None:
        curve = piece.motion.curve
        for rule, which in rules(piece.motion, k):
            a, width = start[which], (end - start)[which]
            t = a[:, None] + width[:, None] * np.array(rule.places.fractions)
            into = (t - curve.start[k[which], None]) - curve.start_low[k[which], None]
            x, seen = self._values(piece, self._arguments, k[which], into)
            weights = (width[:, None] * rule.weights).ravel()
            self._count += len(weights)
            for row, name in zip(x, self._arguments, strict=True):
                mean = self._means[name]
                mean.of_x += float(row @ weights)
                mean.of_square += float((row * row) @ weights)
                mean.time += float(weights.sum())
                if speed := self._works.get(name):
                    self._work[name] += float((row * seen[speed]) @ weights)
            if self._kept:
                rows = [self._arguments.index(name) for name in self._kept]
                self._samples.append((x[rows], weights))

    def result(self, f: Figure) -> tuple[Value, str]:
        """The value of a figure of this window, and its resolution."""
        name, unit, kind = f.argument, self._units[f.argument], f.function
        mean = self._means[name]
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
        if kind == 'work':
            return Value(self._work[name], 'J'), note
        if kind == 'share':
            x = self._true[name] / self._span if self._span else math.nan
            if not name.startswith('closed.'):  # which is constant in a step
                note = f'changes seen at {self._looks} instants, located to rounding'
            return Value(x), note
        if not mean.time:
            return Value(math.nan, product(unit, 's') if kind == 'integral' else unit), note
        if any(word in name for word in ('<', '>', 'abs(', 'sign(', 'min(', 'max(', ' if ')):
            note = f'of {self._count} instants'
        if kind == 'integral':
            return Value(mean.of_x, product(unit, 's')), note
        if kind == 'mean':
            return Value(mean.of_x / mean.time, unit), note
        if kind == 'rms':
            return Value(math.sqrt(max(mean.of_square / mean.time, 0.0)), unit), note
        i = self._kept.index(name)
        seen = np.concatenate([rows[i] for rows, _ in self._samples])
        weights = np.concatenate([w for _, w in self._samples])
        order = np.argsort(seen, kind='stable')
        seen, weights = seen[order], weights[order]
        below = np.cumsum(weights) - 0.5 * weights
        value = np.interp((f.percent or 0.0) / 100.0 * weights.sum(), below, seen)
        return Value(float(value), unit), f'of {len(seen)} instants'
