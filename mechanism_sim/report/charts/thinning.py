"""Lines of many points, thinned so that no extreme is lost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array

MOST = 4000
"""Points that a line keeps: about two for every pixel across a wide page."""
_LEAST, _FINE = 1e-9, 1e-3  # lowest level, and logarithm of the ratio of levels
_PARTS = 4  # parts of the time between positions
_ROUNDING = 1e-6  # [deg] by which ends of segments may overlap


class SampledLine(NamedTuple):
    """Values (N,) at nondecreasing positions (N,), such as times [s].

    A position may occur twice: before an event and after it.
    """

    at: Array
    values: Array


class BinExtremes:
    """The least and the largest value of C rows in each of n bins, and their first and last.

    Memory does not grow with what is entered.
    """

    def __init__(self, start: float, end: float, rows: int, bins: int = MOST // 2) -> None:
        self._start, self._per_place = start, bins / (end - start)
        self._least = np.full((bins, rows), np.inf)
        self._largest = np.full((bins, rows), -np.inf)
        self._at_least, self._at_largest = np.zeros((2, bins, rows))
        self._first: tuple[float, Array] | None = None
        self._last: tuple[float, Array] | None = None

    def add(self, at: Array, values: Array) -> None:
        """Enter values (C, N) at places (N,) that do not fall; NaN is left out."""
        if not len(at):
            return
        if self._first is None:
            self._first = float(at[0]), values[:, 0].copy()
        self._last = float(at[-1]), values[:, -1].copy()
        bins = len(self._least)
        of = np.clip(((at - self._start) * self._per_place).astype(np.intp), 0, bins - 1)
        firsts = np.flatnonzero(np.diff(of, prepend=-1))
        rows = np.arange(len(values))
        for a, b in zip(firsts, [*firsts[1:], len(at)], strict=True):
            k, part = of[a], values[:, a:b]
            for worst, kept, places, better in (
                (np.inf, self._least, self._at_least, np.less),
                (-np.inf, self._largest, self._at_largest, np.greater),
            ):
                known = np.where(np.isnan(part), worst, part)
                best = known.argmin(axis=1) if worst > 0.0 else known.argmax(axis=1)
                found = known[rows, best]
                new = better(found, kept[k])
                kept[k, new], places[k, new] = found[new], at[a + best[new]]

    def lines(self) -> list[SampledLine]:
        """The C rows, two points or one of each bin in which there is something, and the ends."""
        at = np.stack([self._at_least, self._at_largest], axis=1)
        values = np.stack([self._least, self._largest], axis=1)
        order = np.argsort(at, axis=1, kind='stable')
        at, values = (
            np.take_along_axis(x, order, axis=1).reshape(-1, x.shape[2]).T for x in (at, values)
        )
        if self._first and self._last:
            (start, first), (end, last) = self._first, self._last
            ends = np.full((len(at), 1), start), np.full((len(at), 1), end)
            at = np.concatenate([ends[0], at, ends[1]], axis=1)
            values = np.concatenate([first[:, None], values, last[:, None]], axis=1)
        return [_tidy(*row) for row in zip(at, values, strict=True)]


class Envelope:
    """The least and the largest value of C rows over a span of a drive [deg], of all spans."""

    def __init__(self, rows: int, bins: int = 720, span: float = 360.0) -> None:
        self._span = span
        self._least = np.full((bins, rows), np.inf)
        self._largest = np.full((bins, rows), -np.inf)

    def add(self, angle: Array, values: Array) -> None:
        """Enter values (C, N) at angles (N,) [deg] of any turn, and on lines between them.

        Lines between samples count where the drive does not turn back: else a turn of few samples
        would leave out most of the angles.
        """
        bins = len(self._least)
        way = np.sign(angle[-1] - angle[0]) * angle
        if (np.diff(way) > -_ROUNDING).all():
            way = np.maximum.accumulate(way)
            step = self._span / bins
            between = np.arange(math.ceil(way[0] / step), math.floor(way[-1] / step) + 1) * step
            at = np.clip(np.searchsorted(way, between), 1, len(way) - 1)
            width = way[at] - way[at - 1]
            share = np.divide(way[at] - between, width, out=np.zeros(len(at)), where=width > 0.0)
            inside = values[:, at] + share * (values[:, at - 1] - values[:, at])
            angle = np.append(angle, np.sign(angle[-1] - angle[0]) * between)
            values = np.concatenate([values, inside], axis=1)
        of = np.rint(angle * (bins / self._span)).astype(np.intp) % bins
        order = np.argsort(of, kind='stable')
        of, values = of[order], values[:, order]
        firsts = np.flatnonzero(np.diff(of, prepend=-1))
        for reduce, kept in ((np.fmin, self._least), (np.fmax, self._largest)):
            kept[of[firsts]] = reduce(kept[of[firsts]], reduce.reduceat(values, firsts, axis=1).T)

    def rows(self) -> list[Array]:
        """Angles of the span [deg], with least and greatest values (3, N), for each row."""
        bins, span = len(self._least), self._span
        at = np.arange(bins + 1) * (span / bins)
        found = []
        for pair in zip(self._least.T, self._largest.T, strict=True):
            known = np.isfinite(pair[0])
            filled = np.full((2, len(at)), np.nan)
            if known.any():
                filled[:] = [np.interp(at, at[:-1][known], x[known], period=span) for x in pair]
            found.append(np.array([at, *filled]))
        return found

    @classmethod
    def of(cls, angle: Array, values: Array, span: float = 360.0) -> Array | None:
        """Envelope of a row (N,) over angles (N,) [deg]; None if the drive turns back."""
        sense = 1.0 if angle[-1] > angle[0] else -1.0
        if (sense * np.diff(angle) < 0.0).any():
            return None
        found = cls(1, span=span)
        found.add(angle, values[None])
        return found.rows()[0]


class HeldLevels:
    """Levels that rows do not exceed in a share of the time, to 0.1 %: of their magnitudes."""

    def __init__(self, names: Iterable[str]) -> None:
        self._times = dict.fromkeys(names, np.zeros(0))
        self.names = [*self._times]

    def add_steps(self, values: Array, share: Array, time: Array) -> None:
        """Enter all rows (C, N) at even places of steps, by cubics from place to place.

        Parameters
        ----------
        share : (N,) of its step that is over at each place, 0 to 1
        time : (N,) [s] to the next place
        """
        rate = np.gradient(values, axis=1)
        for ends, way in ((share == 0.0, 1), (share == 1.0, -1)):
            k = np.flatnonzero(ends)
            near, next_, far = (values[:, k + way * i] for i in range(3))
            rate[:, k] = way * (2.0 * next_ - 1.5 * near - 0.5 * far)
        k = np.flatnonzero(share != 1.0)
        for u in (np.arange(_PARTS) + 0.5) / _PARTS:
            a, b = values[:, k], values[:, k + 1]
            bend = (1.0 - u) * (rate[:, k] - (b - a)) - u * (rate[:, k + 1] - (b - a))
            between = a + u * (b - a) + u * (1.0 - u) * bend
            for name, row in zip(self.names, between, strict=True):
                self.add(name, row, time[k] / _PARTS)

    def add(self, name: str, values: Array, time: Array) -> None:
        """Enter values (N,) of a row, each of which holds for a time (N,) [s]."""
        known = np.isfinite(values)
        size = np.log(np.maximum(np.abs(values[known]), _LEAST) / _LEAST)
        times = np.bincount((size / _FINE).astype(int), time[known])
        held = np.zeros(max(len(times), len(self._times[name])))
        held[: len(times)] = times
        held[: len(self._times[name])] += self._times[name]
        self._times[name] = held

    def reached(self, name: str, share: float) -> float:
        """Level not exceeded in a share of the time, at most 0.1 % above it; 0 of nothing."""
        passed = np.cumsum(self._times[name])
        if not len(passed) or not passed[-1]:
            return 0.0
        return _LEAST * math.exp(_FINE * (np.searchsorted(passed, share * passed[-1]) + 1.0))


def _tidy(at: Array, values: Array) -> SampledLine:
    """Line without empty bins and repeated points."""
    known = np.isfinite(values)
    at, values = at[known], values[known]
    new = (np.diff(at, prepend=np.nan) != 0.0) | (np.diff(values, prepend=np.nan) != 0.0)
    return SampledLine(at[new], values[new])


def thinned(blocks: Iterable[tuple[Array, Array]], count: int, span: tuple[float, float],
            most: int = MOST) -> list[SampledLine]:  # fmt: skip
    """Lines of C rows that come in blocks: places (N,), values (C, N).

    Parameters
    ----------
    count : number of all positions; all are kept if not above `most`
    span : range of the positions
    """
    found: Iterator[tuple[Array, Array]] = iter(blocks)
    if count <= most:
        parts = list(found)
        at = np.concatenate([at for at, _ in parts])
        return [SampledLine(at, row) for row in np.concatenate([x for _, x in parts], axis=1)]
    at, values = next(found)
    extremes = BinExtremes(*span, len(values), most // 2)
    extremes.add(at, values)
    for at, values in found:
        extremes.add(at, values)
    return extremes.lines()


def thin(line: SampledLine, most: int = MOST) -> SampledLine:
    """One line with its extremes."""
    if len(line.at) <= most:
        return line
    span = float(line.at[0]), float(line.at[-1])
    return thinned([(line.at, line.values[None])], len(line.at), span, most)[0]


def tallest(at: Array, size: Array, bins: int) -> NDArray[np.intp]:
    """Indices of the drawn items of many: the largest in each bin.

    Parameters
    ----------
    at, size : (N,) place and size of each item; where there are no more than `bins`, all are kept
    """
    if len(at) <= bins:
        return np.arange(len(at))
    width = (float(at.max()) - float(at.min())) / bins or 1.0
    of = np.minimum((at - at.min()) / width, bins - 1).astype(int)
    order = np.lexsort((np.arange(len(at)), -size, of))
    first = np.flatnonzero(np.diff(of[order], prepend=-1))
    return np.sort(order[first])
