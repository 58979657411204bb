"""Charts on paper: the renderer that draws a `Chart` with Matplotlib."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogFormatterSciNotation, MaxNLocator, MultipleLocator

from mechanism_sim.export.palette import GROUND, IMPACT, INK
from mechanism_sim.report.charts.chart import (
    DASHES,
    LOOKS,
    MARKERS,
    SMALL,
    Chart,
    ChartCurve,
    Panel,
)
from mechanism_sim.report.picture import Picture
from mechanism_sim.units import number, typeset

_SHAPES = dict(zip(MARKERS, 'os^DvPX*<>phd+x1234', strict=True))
_TOP, _FOOT, _TITLE = 0.27, 0.45, 0.3  # [in] of a legend, of an axis with its words, of titles
_ROUND = 34  # letters above a round panel
_LETTERS = 14.0  # letters of a legend in an inch
_NAMES = 6.0  # letters of names in an inch that are not slanted
_LETTER = 0.073  # [in]
_ALONE = 1.4  # times as high as others is a row that is alone
_CAP = 2.5  # [points] of bars of error
_PLAIN = 1e-3, 1e5  # numbers along a logarithmic axis that need no powers of ten
_NARROW = 3.0  # [in] panel with room for few numbers only


def paint(chart: Chart) -> Picture:
    """A picture of a chart; artists of a curve have its place in the chart as their id."""
    chart = chart.readable()
    rows = chart.rows
    heights = [max(p.height for p in row) for row in rows]
    if len(rows) == 1:
        heights = [_ALONE * heights[0] if rows[0][0].form == 'plain' else heights[0]]
    extra = [_room(row, chart.width / chart.columns) for row in rows]
    feet = sum(_FOOT for row, below in zip(rows, [*rows[1:], ()], strict=True)
               if not _shared(row[0], below[0] if below else None))  # fmt: skip
    size = chart.width, sum(heights) + sum(extra) + feet + _TITLE
    figure = Picture(size, layout='constrained')
    title = textwrap.fill(chart.title, int(_LETTERS * chart.width))
    figure.suptitle(title, fontsize=10.0)
    if chart.note:
        figure.supxlabel(chart.note, fontsize='x-small')
    grid = figure.add_gridspec(len(rows), chart.columns, height_ratios=heights)
    scales: dict[str, Any] = {}
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            k = i * chart.columns + j
            above = figure.axes[k - chart.columns] if i else None
            joined = i and _shared(rows[i - 1][j], panel)
            axes = figure.add_subplot(
                grid[i, j], projection='polar' if panel.form == 'polar' else None,
                sharex=above if joined else None,
                sharey=scales.get(panel.scale) if panel.scale else None,
            )  # fmt: skip
            scales.setdefault(panel.scale, axes)
            below = rows[i + 1][j] if i + 1 < len(rows) and j < len(rows[i + 1]) else None
            _paint(axes, panel, f'{chart.key or "chart"}-{k}', _shared(panel, below))
    for axes, panel in zip(figure.axes, chart.panels, strict=True):
        # ends of the axes, once all is drawn that has the same scale
        for name, axis in (('x', panel.x), ('y', panel.y)):
            if axis.low != axis.high:  # neither is given, or they are of one instant
                getattr(axes, f'set_{name}lim')(axis.low, axis.high)
    named = [bool(p.y.names) for p in chart.panels]
    figure.align_ylabels([a for a, n in zip(figure.axes, named, strict=True) if not n])
    return figure


def _room(row: Sequence[Panel], width: float) -> float:
    """Height of legends and titles above a row of panels [in]."""
    letters = max(sum(len(text) + 8 for text in p.entries) for p in row)
    lines = np.ceil(letters / (_LETTERS * width))
    return _TOP * max(float(lines), float(any(p.title for p in row)))


def _shared(panel: Panel, below: Panel | None) -> bool:
    return below is not None and panel.form == below.form == 'plain' and panel.x == below.x


def _legend(axes: Any, panel: Panel, artists: Mapping[str, Any]) -> None:
    """Legend above a panel, in as many columns as fit; beside a round panel."""
    entries = panel.entries
    longest = max(map(len, entries))
    width = axes.figure.get_figwidth() * axes.get_position().width
    side, edge = ('right', 1.0) if panel.title else ('left', 0.0)
    place: dict[str, Any] = {
        'loc': f'lower {side}', 'bbox_to_anchor': (edge, 1.0),
        'ncols': max(1, int(1.3 * _LETTERS * width) // (longest + 8)),
    }  # fmt: skip
    if panel.form == 'polar':  # beside it, for above is its title
        place = {'loc': 'upper left', 'bbox_to_anchor': (1.15, 1.0)}
    # a power of ten that the numbers leave out stands above the axis, too, at its other end
    axes.yaxis.set_offset_position('right' if side == 'left' else 'left')
    axes.legend(
        [artists[e] for e in entries], entries, borderaxespad=0.2, frameon=False,
        fontsize=7.5, handlelength=2.6, **place,
    )  # fmt: skip


class _Beside(MaxNLocator):
    """Ticks of a panel so wide [in], no more than there is room for their numbers side by side.

    Matplotlib by itself takes numbers to have three letters.
    """

    def __init__(self, side: Any, wide: float) -> None:
        super().__init__(steps=[1, 2, 2.5, 5, 10])
        self._side, self._wide = side, wide

    def tick_values(self, vmin: float, vmax: float) -> Any:
        """Places of the ticks."""
        most = 4 if self._wide < _NARROW else min(max(self._side.get_tick_space(), 1), 9)
        room = (self._wide - 0.6) / _LETTER
        for self._nbins in range(most, 0, -1):
            ticks = super().tick_values(vmin, vmax)
            shown = [x for x in ticks if vmin <= x <= vmax]
            texts = self._side.get_major_formatter().format_ticks(shown)
            if sum(len(text) + 2 for text in texts) <= room:
                break
        return ticks


class _Decades(LogFormatterSciNotation):
    """Numbers along a logarithmic axis: powers of ten only where they are far from 1."""

    def __init__(self, side: Any) -> None:
        super().__init__()
        self._side = side

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The number at a tick, empty where there is no room for one."""
        text = super().__call__(x, pos)
        low, high = sorted(self._side.get_view_interval())
        return number(x, 3) if text and low >= _PLAIN[0] and high <= _PLAIN[1] else str(text)


def _scale(axes: Any, panel: Panel, wide: float) -> None:
    """Scales and ticks of both axes of a panel that is so wide [in]."""
    for name, axis in (('x', panel.x), ('y', panel.y)):
        side = getattr(axes, f'{name}axis')
        if axis.log:
            getattr(axes, f'set_{name}scale')('log')
            side.set_major_formatter(_Decades(side))
            side.set_minor_formatter(_Decades(side))
        if axis.every:
            side.set_major_locator(MultipleLocator(axis.every))
        if name == 'x' and not (axis.log or axis.every or axis.names):
            side.set_major_locator(_Beside(side, wide))
        if axis.names:
            getattr(axes, f'set_{name}ticks')(axis.places, axis.names)
            if name == 'x' and sum(map(len, axis.names)) > _NAMES * wide:
                axes.tick_params(axis='x', rotation=25.0)
            side.set_minor_locator(MultipleLocator(1e300))
        if axis.names and name == 'y':
            axes.tick_params(axis='y', length=0.0)
            axes.grid(visible=False)


def _paint(axes: Any, panel: Panel, key: str, bare: bool) -> None:
    """One panel; `bare` if the one below has its x."""
    artists: dict[str, Any] = {}
    for i, curve in enumerate(panel.curves):
        for artist in _draw(axes, panel, curve):
            artist.set_gid(f'{key}-{i}')
        artists.setdefault(curve.label, _sample(curve))
    for mark in panel.marks:
        across = axes.axhline if mark.level else axes.axvline
        across(mark.at, color=GROUND, lw=0.7, ls=':', zorder=1.0)
        at = (1.0, mark.at) if mark.level else (mark.at, 1.0)
        how = axes.get_yaxis_transform() if mark.level else axes.get_xaxis_transform()
        axes.annotate(mark.text, at, (0, 2), how, 'offset points', fontsize=7.0, color=GROUND,
                      ha='right' if mark.level else 'center')  # fmt: skip
    if len(panel.impact_times):
        style: dict[str, Any] = {'color': IMPACT, 'ms': 5.0, 'mew': 0.7, 'ls': '', 'zorder': 5.0}
        axes.plot(
            panel.impact_times, np.full(len(panel.impact_times), 0.97), '|', gid=f'{key}-struck',
            transform=axes.get_xaxis_transform(), label='impact', **style,
        )  # fmt: skip
        artists['impact'] = Line2D([], [], marker='|', **style)
    if panel.entries:
        _legend(axes, panel, artists)
    if panel.form == 'polar':
        axes.set_rlabel_position(panel.free)
        axes.tick_params(labelsize=6.5, pad=0.0)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        unit = f' [{typeset(panel.y.unit)}]'
        title = f'{panel.title}{unit}' if panel.title else panel.y.title
        axes.set_title(
            '\n'.join(textwrap.fill(x, _ROUND) for x in title.split('\n')), fontsize=8.5
        )
        return
    if panel.title:
        axes.set_title(panel.title, fontsize=9.0, loc='left')
    wide = axes.figure.get_figwidth() / axes.get_gridspec().ncols
    _scale(axes, panel, wide)
    if panel.form == 'equal':
        axes.set_aspect('equal', adjustable='datalim')
    small = panel.height <= SMALL
    letter = _LETTER * (0.8 if small else 1.0)
    high = panel.height * (_ALONE if axes.get_gridspec().nrows == 1 else 1.0)
    axes.set_ylabel(_filled(panel.y.title, high / letter), fontsize=7.5 if small else 9)
    if bare:
        axes.tick_params(labelbottom=False)
    else:
        axes.set_xlabel(_filled(panel.x.title, (wide - 0.6) / _LETTER))


def _filled(title: str, letters: float) -> str:
    """A title in lines of limited length, broken between words only."""
    return textwrap.fill(title, int(letters), break_long_words=False, break_on_hyphens=False)


def _stroke(curve: ChartCurve) -> dict[str, Any]:
    look = LOOKS[curve.look]
    pattern = DASHES[curve.dash % len(DASHES)]
    hollow = curve.marker.endswith('-open')
    return {
        'color': curve.shade, 'lw': look.width, 'alpha': look.opacity,
        'ls': '' if curve.form == 'dots' else (0, pattern) if pattern else '-',
        'marker': _SHAPES.get(curve.marker.removesuffix('-open'), ''), 'ms': 3.4,
        'mfc': 'white' if hollow else curve.shade, 'mew': 0.8,
    }  # fmt: skip


def _draw(axes: Any, panel: Panel, curve: ChartCurve) -> list[Any]:
    """The artists of a curve; the last one has its data."""
    x = np.radians(curve.x) if panel.form == 'polar' else curve.x
    y, label = curve.y, curve.label or '_nolegend_'
    if curve.form == 'area' and curve.low is not None:
        look = LOOKS[curve.look]
        area = axes.fill_between(
            x, curve.low, y, color=curve.shade, alpha=look.opacity, lw=look.width, label=label
        )
        return [area]
    stroke = _stroke(curve)
    found = []
    if curve.form == 'stems':
        rays = (
            np.repeat(x, 3),
            np.array([np.zeros(len(y)), y, np.full(len(y), np.nan)]).T.ravel(),
        )
        many = stroke | {'marker': '', 'alpha': min(stroke['alpha'], 0.6)}
        found += axes.plot(*rays, label='_nolegend_', rasterized=len(x) > 2000, **many)
        stroke |= {'ls': '', 'lw': 0.0}
    step = {'drawstyle': 'steps-mid'} if curve.form == 'steps' else {}
    found += axes.plot(x, y, label=label, **stroke, **step)
    if curve.error is not None:
        axes.errorbar(x, y, curve.error, fmt='none', ecolor=curve.shade, elinewidth=0.9,
                      capsize=_CAP)  # fmt: skip
    for at, text in zip(zip(x, y, strict=True), curve.texts, strict=False):
        axes.annotate(text, at, (4, 4), textcoords='offset points', fontsize=7.0, color=INK)
    return found


def _sample(curve: ChartCurve) -> Any:
    """Sign of a curve in the legend."""
    if curve.form == 'area':
        return Patch(color=curve.shade, alpha=LOOKS[curve.look].opacity, lw=0.0)
    return Line2D([], [], **_stroke(curve))
