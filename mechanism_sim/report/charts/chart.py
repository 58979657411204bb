"""A chart as plain data: panels with axes, curves and marks, in the units of the reader.

It contains all decisions: common panels, colours and dashes, order of drawing,
labels and their order. `mechanism_sim.report.painting` draws it with Matplotlib,
`mechanism_sim.pages.charts` writes it for the page; both show the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, Literal, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export import palette
from mechanism_sim.units import for_people, typeset

Over = Literal['time', 'angle', 'frequency', 'polar', 'value', 'other']

PANEL, SMALL, ROW = 1.9, 1.15, 0.28  #: heights of panels [in]: usual, one of several, of a band
ROUND = 2.8  #: height of round ones

DASHES: tuple[tuple[float, ...], ...] = (
    (), (3.7, 1.6), (6.4, 1.6, 1.0, 1.6), (1.0, 1.6), (5.0, 1.0), (2.0, 1.0), (3.0, 1.0, 1.0, 1.0),
)  # fmt: skip
"""Dash patterns of lines, in widths of the line; the first is solid."""


MARKERS = (
    'circle', 'square', 'triangle-up', 'diamond', 'triangle-down', 'cross', 'x', 'star',
    'triangle-left', 'triangle-right', 'pentagon', 'hexagon', 'diamond-tall', 'cross-thin',
    'x-thin', 'y-down', 'y-up', 'y-left', 'y-right',
)  # fmt: skip
"""Shapes of points; with ``-open`` they are hollow."""


class Look(NamedTuple):
    """Width of a line [points], and opacity."""

    width: float
    opacity: float


LOOKS = {
    '': Look(1.2, 1.0), 'strong': Look(2.2, 1.0), 'fine': Look(0.7, 0.6),
    'earlier': Look(0.8, 0.45), 'ideal': Look(4.0, 0.28), 'range': Look(0.0, 0.25),
    'body': Look(0.4, 1.0), 'wear': Look(0.0, 0.6),
}  # fmt: skip
"""Looks of a quantity; of the main one; of many together; of turns before the last; of the ideal
machine, beneath; of the range of many turns; of areas by themselves; of wear."""


@dataclass(frozen=True)
class Axis:
    """A quantity and its unit along an axis."""

    words: str
    unit: str = ''
    #: ends of the axis; None for those of the data
    low: float | None = None
    high: float | None = None
    log: bool = False
    every: float | None = None  #: distance of ticks; None for an automatic one
    #: labels at the positions `at` instead of numbers; `at` is by default 0, 1, ...
    names: tuple[str, ...] = ()
    at: tuple[float, ...] = ()

    @property
    def title(self) -> str:
        """The words with the unit."""
        return f'{self.words} [{typeset(self.unit)}]'.strip() if self.unit else self.words

    @property
    def places(self) -> tuple[float, ...]:
        """Positions of the names along the axis."""
        return self.at or tuple(map(float, range(len(self.names))))


TIME = Axis('time', 's')
DIRECTION = Axis('direction', 'deg')


@dataclass(frozen=True, eq=False)
class ChartCurve:
    """Curve of one quantity, drawn in one way."""

    #: (N,) in the units of the axes, of round panels direction [deg] and size; where they are not
    #: a number a line breaks. None at all: an entry of the legend only
    x: Array
    y: Array
    label: str = ''  #: text in the legend; curves of the same label share an entry
    #: quantity, as ``velocity.crank``: pointing at its links and joints highlights it
    of: str = ''
    colour: int | str = 0  #: index in the palette, or a colour
    dash: int = 0  #: index in `DASHES`
    #: form of drawing; steps change midway between points, an area lies between `low` and y
    form: Literal['line', 'dots', 'stems', 'steps', 'area'] = 'line'
    look: str = ''  #: one of `LOOKS`
    marker: str = ''  #: marker of the points, one of `MARKERS`
    #: (N,) lower edge of an area; half the height of bars of error
    low: Array | None = None
    error: Array | None = None
    when: Array | None = None  #: (N,) times in the run [s], where x is another quantity
    texts: Sequence[str] = ()  #: labels of the points; may be empty
    notes: Sequence[str] = ()  #: hover texts of the points
    group: str = ''  #: group shown and hidden together by the legend; by default the quantity

    @property
    def shade(self) -> str:
        """The colour, as #rrggbb."""
        return self.colour if isinstance(self.colour, str) else palette.colour(self.colour)

    def start(self) -> ChartCurve:
        """A dot where it begins."""
        when = None if self.when is None else self.when[:1]
        return replace(
            self, x=self.x[:1], y=self.y[:1], label='', form='dots', marker='circle', when=when
        )


@dataclass(frozen=True)
class Mark:
    """A dotted line across a panel from below to above, or at a level; its text at the end."""

    at: float
    text: str = ''
    level: bool = False


NOTHING = np.empty(0)
Along = Literal['x', 'y']


@dataclass(frozen=True, eq=False)
class Panel:
    """Axes with their curves."""

    x: Axis
    y: Axis
    curves: tuple[ChartCurve, ...]
    title: str = ''
    #: ``equal`` where both axes have one scale; ``polar``, with a direction and a size
    form: Literal['plain', 'equal', 'polar'] = 'plain'
    height: float = PANEL  #: height [in]
    scale: str = ''  #: name of a common range of y
    marks: tuple[Mark, ...] = ()
    #: x of impacts, marked at the upper edge
    impact_times: Array = field(default_factory=lambda: NOTHING)

    @property
    def entries(self) -> list[str]:
        """Entries of the legend: labels in order, and impacts; none for a single titled curve."""
        labels = dict.fromkeys(c.label for c in self.curves if c.label)
        found = [label for label in labels if label != self.title]
        found += ['impact'] * bool(len(self.impact_times))
        said = f'{self.title} {self.x.words} {self.y.words}'
        return [] if len(found) == 1 and found[0] in said and not len(self.impact_times) else found

    @property
    def free(self) -> float:
        """Direction [deg] in which a round panel has most room for the numbers of its circles."""
        reach = np.zeros(8)
        for c in self.curves:
            known = np.isfinite(c.x) & np.isfinite(c.y)
            np.maximum.at(reach, np.mod(c.x[known] // 45.0, 8).astype(int), c.y[known])
        return 22.5 + 45.0 * int(np.argmin(np.round(reach / (reach.max() or 1.0), 1)))

    @property
    def sizes(self) -> list[tuple[Along, str, float]]:
        """Units and largest values: along y, and along x if that is a length or beside y."""
        found = [_size('y', self.y, [c.y for c in self.curves] + [c.low for c in self.curves])]
        if self.form == 'equal' or (self.x.unit == 'm' and not self.x.log):
            found.append(_size('x', self.x, [c.x for c in self.curves]))
        return found

    def in_unit(self, along: Along, unit: str, factor: float) -> Panel:
        """The panel with another unit along an axis: values there are `factor` times as large."""

        def times(part: Any, *names: str) -> Any:
            values = {name: getattr(part, name) for name in names}
            return replace(part, **{n: factor * v for n, v in values.items() if v is not None})

        axis = times(replace(getattr(self, along), unit=unit), 'low', 'high', 'every')
        own = ('y', 'low', 'error') if along == 'y' else ('x',)
        curves = tuple(times(c, *own) for c in self.curves)
        marks = tuple(times(m, 'at') if m.level == (along == 'y') else m for m in self.marks)
        return replace(self, curves=curves, marks=marks, **{along: axis})


def _size(along: Along, axis: Axis, values: Iterable[Array | None]) -> tuple[Along, str, float]:
    known = np.concatenate([NOTHING, *(v for v in values if v is not None)])
    return along, axis.unit, float(np.abs(known[np.isfinite(known)]).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Chart:
    """One or several panels under a title."""

    key: str  #: unique among all charts of a report
    title: str
    panels: tuple[Panel, ...]
    #: quantity of the horizontal axes: for ``time`` the time of the run [s], for ``value`` the
    #: varied value of a family of runs
    over: Over = 'other'
    joint: str = ''  #: the joint, sensor or part that it is about; empty if it is about several
    columns: int = 1  #: panels side by side; panels above each other with the same x share it
    width: float = 8.0  #: width of a picture [in]
    note: str = ''  #: text below all panels

    @property
    def rows(self) -> list[tuple[Panel, ...]]:
        """The panels, row by row."""
        return [
            self.panels[k : k + self.columns] for k in range(0, len(self.panels), self.columns)
        ]

    def readable(self) -> Chart:
        """Chart with large forces in kN, small energies in mJ and the like, as tables have them.

        Axes of one unit keep one; so do those of a panel that compares x and y.
        """
        sizes: dict[str, float] = {}
        for _, unit, size in chain(*(p.sizes for p in self.panels)):
            sizes[unit] = max(sizes.get(unit, 0.0), size)
        units = {unit: for_people(unit, size) for unit, size in sizes.items()}
        panels = list(self.panels)
        for k, p in enumerate(self.panels):
            for along, unit, _ in p.sizes:
                panels[k] = panels[k].in_unit(along, *units[unit])
        return replace(self, panels=tuple(panels))


@dataclass(frozen=True)
class ChartSection:
    """A subject with its charts."""

    key: str
    title: str
    text: str  #: one or two sentences on the charts; may be empty
    charts: tuple[Chart, ...]
    #: a table beside the charts, line by line: what, and its value with its unit
    rows: tuple[tuple[str, str], ...] = ()
    table: tuple[tuple[str, ...], ...] = ()  #: another one, of more columns, its head first


def joined(title: str, charts: Sequence[Chart], columns: int = 1) -> Chart:
    """The panels of several charts in one picture; those of round ones have their titles."""
    panels = [
        replace(p, title=p.title or (c.title if p.form == 'polar' else ''))
        for c in charts
        for p in c.panels
    ]
    side = 1.15 * ROUND if panels[0].form == 'polar' else 8.0 if columns == 1 else 6.0
    columns = min(columns, len(panels))
    return Chart('', title, tuple(panels), charts[0].over, columns=columns, width=columns * side)


def polar(
    key: str,
    title: str,
    unit: str,
    curves: Sequence[ChartCurve],
    joint: str = '',
    words: str = 'size',
) -> Chart:
    """A round chart that has all of its curves."""
    size = Axis(words, unit, 0.0, rim(curves))
    panel = Panel(DIRECTION, size, tuple(curves), form='polar', height=ROUND)
    return Chart(key, title, (panel,), 'polar', joint, width=1.4 * ROUND)


def rim(curves: Sequence[ChartCurve]) -> float:
    """The size at the edge of a round panel that has all of its curves."""
    return 1.08 * (max((float(np.nanmax(c.y)) for c in curves if len(c.y)), default=0.0) or 1.0)


def whole(count: float) -> float:
    """Distance of ticks at whole numbers, over a given number."""
    ten = 10.0 ** math.floor(math.log10(max(count / 8.0, 1.0)))
    return float(next(k * ten for k in (1, 2, 5, 10) if k * ten >= count / 8.0))
