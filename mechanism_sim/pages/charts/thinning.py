"""Lines of many points, thinned so that no extreme is lost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST = 4000
"""Points that a line keeps: about two for every pixel across a wide page."""


class Line(NamedTuple):
    """Values (N,) at places (N,) that do not fall, such as times [s].

    A place may occur twice: before an event and after it.
    """

    at: Array
    values: Array


class Extremes:
    """The least and the largest value of C rows in each of n bins between two places.

    Memory does not grow with what is entered.
    """

    def __init__(self, start: float, end: float, rows: int, bins: int = MOST // 2) -> None:
        self._start, self._per_place = start, bins / (end - start)
        self._least = np.full((bins, rows), np.inf)
        self._largest = np.full((bins, rows), -np.inf)
        self._at_least, self._at_largest = np.zeros((2, bins, rows))

    def add(self, at: Array, values: Array) -> None:
        """Enter values (C, N) at places (N,) that do not fall; what is no number is left out."""
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

    def lines(self) -> list[Line]:
        """The C rows, two points or one of each bin in which there is something."""
        return [
            _joined(*columns)
            for columns in zip(
                self._at_least.T, self._least.T, self._at_largest.T, self._largest.T, strict=True
            )
        ]


def _joined(at_least: Array, least: Array, at_largest: Array, largest: Array) -> Line:
    known = np.isfinite(least)
    at = np.array([at_least, at_largest])[:, known]
    values = np.array([least, largest])[:, known]
    order = np.argsort(at, axis=0, kind='stable')
    at, values = (np.take_along_axis(x, order, axis=0).T for x in (at, values))
    wanted = np.ones(at.shape, bool)
    wanted[:, 1] = at[:, 1] > at[:, 0]
    wanted[:, 1] |= values[:, 1] != values[:, 0]
    return Line(at[wanted], values[wanted])


def thinned(blocks: Iterable[tuple[Array, Array]], count: int, span: tuple[float, float],
            most: int = MOST) -> list[Line]:  # fmt: skip
    """Lines of C rows that come in blocks: places (N,), values (C, N).

    Parameters
    ----------
    count : of all places together; if there are no more than `most`, all are kept
    span : of the places, from and to
    """
    found: Iterator[tuple[Array, Array]] = iter(blocks)
    if count <= most:
        parts = list(found)
        at = np.concatenate([at for at, _ in parts])
        return [Line(at, row) for row in np.concatenate([x for _, x in parts], axis=1)]
    at, values = next(found)
    extremes = Extremes(*span, len(values), most // 2)
    extremes.add(at, values)
    for at, values in found:
        extremes.add(at, values)
    return extremes.lines()


def thin(line: Line, most: int = MOST) -> Line:
    """One line with its extremes."""
    if len(line.at) <= most:
        return line
    span = float(line.at[0]), float(line.at[-1])
    return thinned([(line.at, line.values[None])], len(line.at), span, most)[0]
