"""Modes of contact along time, as bands: spell by spell, or as shares of the time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.series import Series
from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Mode
from mechanism_sim.report.charts.chart import ROW, TIME, Axis, ChartCurve, Panel

MODES: dict[int, str] = {
    Mode.UNKNOWN: '#dfe3e8', Mode.FREE_FLIGHT: '#2a5b8a', Mode.FOLLOWING: '#e6a065',
    Mode.STICKING: '#a8500f', Mode.SLIDING_FORWARD: '#f0c896',
    Mode.SLIDING_BACKWARD: '#cf7d33', Mode.RECOVERING: '#c3bfe0',
}  # fmt: skip
"""Colours of the modes of contact; flight is told apart in grey, too."""

_SINGLE = 400  # spells of one gap that are drawn one by one
_SHARES = 400  # bins of which the shares of modes are drawn if there are more
_HALF = 0.36  # height of a band, of half a row


@dataclass(frozen=True)
class Spells:
    """Times (k + 1,) [s] at which one mode follows another, and the modes (k,) between them."""

    marks: Array
    modes: NDArray[np.uint8]

    @classmethod
    def of(cls, s: Series) -> Spells:
        """Spells of a mode's numbers over time."""
        starts = np.flatnonzero(np.diff(s.values, prepend=np.nan) != 0.0)
        return cls(np.append(s.t[starts], s.t[-1]), s.values[starts].astype(np.uint8))


def shares(found: Spells, edges: Array) -> dict[int, Array]:
    """Share of the time between edges (n + 1,) [s] that each mode has, (n,) by its number."""
    lasted = np.diff(found.marks)
    shared = {}
    for mode in np.unique(found.modes).tolist():
        passed = np.append(0.0, np.cumsum(np.where(found.modes == mode, lasted, 0.0)))
        shared[mode] = np.diff(np.interp(edges, found.marks, passed)) / np.diff(edges)
    return shared


def modes(rows: Mapping[str, Spells], x: Axis = TIME) -> Panel:
    """A band for each gap, the first one on top."""
    curves = [
        replace(c, y=row + _HALF * (2.0 * c.y - 1.0), low=row + _HALF * (2.0 * c.low - 1.0))
        for row, spells in zip(range(len(rows))[::-1], rows.values(), strict=True)
        for c in (_blocks if len(spells.modes) <= _SINGLE else _stacked)(spells)
        if c.low is not None
    ]
    names = tuple(rows)[::-1]
    y = Axis('', '', -0.5, len(rows) - 0.5, names=names)
    curves.sort(key=lambda c: list(MODES.values()).index(c.shade))
    return Panel(x, y, tuple(curves), height=ROW * max(len(rows), 1))


def _curve(mode: int, x: Array, low: Array, high: Array) -> ChartCurve:
    name = Mode(mode).name.replace('_', ' ').lower()
    return ChartCurve(x, high, name, '', MODES[mode], form='area', look='body', low=low)


def _blocks(found: Spells) -> Iterator[ChartCurve]:
    for mode in np.unique(found.modes).tolist():
        own = found.modes == mode
        start, end = found.marks[:-1][own], found.marks[1:][own]
        nothing = np.full(len(start), np.nan)
        x = np.array([start, end, nothing]).T.ravel()[:-1]
        level = np.where(np.isnan(x), np.nan, 0.0)
        yield _curve(mode, x, level, level + 1.0)


def _stacked(found: Spells) -> Iterator[ChartCurve]:
    edges = np.linspace(found.marks[0], found.marks[-1], _SHARES + 1)
    below = np.zeros(_SHARES)
    shared = shares(found, edges)
    x = np.repeat(edges, 2)[1:-1]
    for mode in sorted(shared, key=lambda mode: (mode == Mode.FREE_FLIGHT, mode)):
        above = below + shared[mode]
        yield _curve(mode, x, np.repeat(below, 2), np.repeat(above, 2))
        below = above
