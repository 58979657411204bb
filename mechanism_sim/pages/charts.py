"""Charts on a page: the renderer that writes a `Chart` as plotly.js takes it."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import DARK, GROUND, IMPACT, INK, LINKS
from mechanism_sim.export.stage import packed
from mechanism_sim.report.charts.bands import MODES
from mechanism_sim.report.charts.chart import DASHES, LOOKS, Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.charts.subjects import sections
from mechanism_sim.tolerances import TOLERANCES
from mechanism_sim.units import typeset

__all__ = ['NIGHT', 'Chart', 'brief', 'figure', 'places', 'sections']

_GRID, _LINE, _ZERO = '#e9ecf0', '#b6bec7', '#cdd3da'

NIGHT = dict(zip(LINKS, DARK, strict=True)) | {
    INK: '#e4e7eb', GROUND: '#a3adb8', _GRID: '#2b323a', _LINE: '#5b6570', _ZERO: '#4a535d',
    '#ffffff': '#1d2329', IMPACT: '#f0a04b', MODES[1]: '#6db3f2',
}  # fmt: skip
"""Colours on dark ground, by those on paper."""

_INCH = 118.0  # [pixels] of a panel's height
_WIDTH = 560.0  # [pixels] that legends are sure of
_LETTER, _KEY, _LEGEND = 6.3, 46.0, 19.0  # [pixels] of a letter and a sample of legends, of lines
_FOOT, _GAP, _HEAD, _TITLE = 44, 16, 10, 18  # [pixels] below and above panels, of their titles
_DISC, _ROUND = 260, 32  # [pixels] of round ones, and around them
_DIGITS = 5  # letters of numbers before the unit on their circles
_APART = 0.17  # distance of adjacent panels, as a share of the width
_PIXEL = 1.25  # pixels in a point of a line
_AXIS = {
    'showline': True, 'linecolor': _LINE, 'linewidth': 1, 'ticks': 'outside', 'ticklen': 4,
    'tickcolor': _LINE, 'gridcolor': _GRID, 'gridwidth': 1, 'zeroline': True,
    'zerolinecolor': _ZERO, 'zerolinewidth': 1, 'automargin': True, 'exponentformat': 'power',
    'title': {'standoff': 6, 'font': {'size': 12, 'color': GROUND}},
}  # fmt: skip
_CIRCLE = {
    'gridcolor': _GRID, 'linecolor': _LINE, 'tickfont': {'size': 10, 'color': GROUND},
    'exponentformat': 'power',
}  # fmt: skip
_NOTHING = 'rgba(0,0,0,0)'
_ROUNDING = TOLERANCES.rounding.acceleration  # of its size: a curve that changes less is constant
_LAYOUT = {
    'font': {
        'family': 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif',
        'size': 12, 'color': INK,
    },
    'colorway': LINKS, 'paper_bgcolor': _NOTHING, 'plot_bgcolor': _NOTHING,
    'hovermode': 'closest',
    'hoverlabel': {'bgcolor': '#ffffff', 'bordercolor': _LINE, 'font': {'color': INK}},
    'modebar': {'bgcolor': _NOTHING, 'color': _LINE, 'activecolor': INK},
    'xaxis': _AXIS, 'yaxis': _AXIS,
    'polar': {
        'bgcolor': _NOTHING,
        'angularaxis': {
            **_CIRCLE, 'ticksuffix': '°', 'dtick': 45, 'thetaunit': 'degrees',
            'direction': 'counterclockwise', 'rotation': 0,
        },
        'radialaxis': {**_CIRCLE, 'nticks': 5, 'rangemode': 'tozero', 'showline': False},
    },
}  # fmt: skip
# else what bends gently gets corners
_TEMPLATE = {'layout': _LAYOUT, 'data': {'scatter': [{'line': {'simplify': False}}]}}

_Json = dict[str, Any]


def figure(chart: Chart) -> _Json:
    """``data``, ``layout`` and ``columns``, the headings of what a chart is as a table.

    Traces have the place of their panel and curve as ``meta``. ``narrow`` is what changes in the
    layout where panels have no room beside each other.
    """
    page, narrow = _PlotlyFigure(chart, chart.columns), {}
    if chart.columns > 1:
        other = _PlotlyFigure(chart, 1).layout
        narrow = {key: value for key, value in other.items() if value != page.layout[key]}
    return {'data': page.data, 'layout': page.layout, 'columns': page.columns, 'narrow': narrow}


class _PlotlyFigure:
    """Panels on a figure of plotly, so many beside each other, row by row."""

    def __init__(self, chart: Chart, columns: int) -> None:
        self.chart = chart = chart.readable()
        self._beside = columns
        self.data: list[_Json] = []
        self.columns: list[_Json] = []
        self.layout: _Json = {'template': _TEMPLATE}
        self._scales: dict[str, str] = {}
        rows = replace(chart, columns=columns).rows
        shared = [self._axis_along(k) for k in range(len(chart.panels))]
        heads, feet = [], []
        for i, row in enumerate(rows):
            heads.append(max(self._head(p) for p in row))
            k = i * columns
            last = not {*shared[k : k + columns]} <= {*shared[k + columns :]}
            feet.append((_FOOT if last else _GAP) if row[0].form != 'polar' else 0)
        tall = [
            _DISC if row[0].form == 'polar' else _INCH * max(p.height for p in row) for row in rows
        ]
        inner = sum(tall) + sum(heads[1:]) + sum(feet[:-1])
        round_ = rows[0][0].form == 'polar'
        side = _beside(rows[0]) if round_ else {'l': 56, 'r': 16}
        self.layout |= {
            'margin': {**side, 't': heads[0], 'b': _ROUND if round_ else feet[-1]},
            'height': round(inner + heads[0] + (_ROUND if round_ else feet[-1])),
        }
        self._title = _TITLE / inner  # of the height between the margins
        top = inner
        for i, row in enumerate(rows):
            for j, panel in enumerate(row):
                domain = [(top - tall[i]) / inner, top / inner]
                wide = (1.0 - _APART * (columns - 1)) / columns
                across = [j * (wide + _APART), j * (wide + _APART) + wide]
                self._add(panel, i * columns + j, domain, across)
            top -= tall[i] + feet[i] + (heads[i + 1] if i + 1 < len(rows) else 0)

    def _axis_along(self, k: int) -> str:
        """The axis along x: panels above each other, where there are columns, share one."""
        panels, columns = self.chart.panels, self.chart.columns
        first = next(p for p in range(k % columns, k + 1, columns) if panels[p].x == panels[k].x)
        return f'x{first + 1}' if first else 'x'

    def _head(self, panel: Panel) -> int:
        """Height of title and legend above a panel [pixels]."""
        texts = panel.entries
        across = sum(len(text) * _LETTER + _KEY for text in texts)
        lines = int(np.ceil(across / (_WIDTH / self._beside)))
        marked = any(m.text and not m.level for m in panel.marks)
        least = _ROUND if panel.form == 'polar' else _HEAD
        title = bool(panel.title)
        return round(least + _LEGEND * lines + _TITLE * title + 14 * marked)

    def _add(self, panel: Panel, k: int, domain: list[float], across: list[float]) -> None:
        n = '' if not k else str(k + 1)
        if panel.form == 'polar':
            self.layout['polar' + n] = {
                'domain': {'x': across, 'y': domain},
                'radialaxis': {
                    'angle': panel.free, 'tickangle': panel.free,
                    'ticksuffix': f' {typeset(panel.y.unit)}', 'showticksuffix': 'last',
                    'range': [panel.y.low, panel.y.high], 'title': {'text': ''},
                },
            }  # fmt: skip
            where: _Json = {'subplot': 'polar' + n}
        else:
            x = self._axis_along(k)
            where = {'xaxis': x, 'yaxis': 'y' + n}
            name = 'xaxis' + x[1:]
            axis = self.layout.get(name) or _axis(panel.x, panel, 'x')
            self.layout[name] = axis | {'domain': across, 'anchor': 'y' + n}
            self.layout['yaxis' + n] = _axis(panel.y, panel, 'y') | {'domain': domain, 'anchor': x}
            if panel.form == 'equal':
                self.layout['yaxis' + n] |= {'scaleanchor': x}
            if panel.scale:
                first = self._scales.setdefault(panel.scale, 'y' + n)
                if first != 'y' + n:
                    self.layout['yaxis' + n]['matches'] = first
        self._legend(panel, n, domain, across)
        seen: set[str] = set()
        for i, curve in enumerate(panel.curves):
            entry = curve.label in panel.entries and curve.label not in seen
            seen.add(curve.label)
            *more, main = (
                trace | where | {'showlegend': False, 'legend': 'legend' + n, 'meta': [k, i]}
                for trace in _traces(panel, curve)
            )
            self.data += [*more, main | {'showlegend': entry}]
            if len(curve.x) > 1 or curve.label:
                self._column(panel, curve)
        for mark in panel.marks:
            self._mark(mark, panel, where)
        if len(panel.impact_times):
            self._mark_impacts(panel, k, n, where)
        if panel.title:
            self.layout.setdefault('annotations', []).append({
                'text': panel.title, 'x': across[0], 'y': domain[1], 'xref': 'paper',
                'yref': 'paper', 'xanchor': 'left', 'yanchor': 'bottom', 'showarrow': False,
                'font': {'size': 12},
            })  # fmt: skip

    def _column(self, panel: Panel, curve: ChartCurve) -> None:
        """The last trace as columns of a table; no heading stands twice."""
        ideal = 'ideal machine' if curve.look == 'ideal' else ''
        words = dict.fromkeys((panel.title, curve.label or curve.of, ideal, panel.y.title))
        heading = ': '.join(filter(None, words))
        same = sum(column['heading'] == heading for column in self.columns)
        self.columns.append({
            'trace': len(self.data) - 1, 'heading': heading, 'x': panel.x.title,
            'y': f'{heading} ({same + 1})' if same else heading,
        })  # fmt: skip

    def _legend(self, panel: Panel, n: str, domain: list[float], across: list[float]) -> None:
        """Above its panel and its title, where there are no curves."""
        if panel.entries:
            self.layout['legend' + n] = {
                'orientation': 'h', 'x': across[0], 'xanchor': 'left', 'yanchor': 'bottom',
                'y': domain[1] + self._title * bool(panel.title),
                'bgcolor': _NOTHING, 'font': {'size': 11}, 'itemwidth': 30,
            }  # fmt: skip

    def _mark(self, mark: Any, panel: Panel, where: _Json) -> None:
        """A dotted line, and its text at the end."""
        along, across = ('y', 'x') if mark.level else ('x', 'y')
        axis = panel.y if mark.level else panel.x
        edge = f'{where[f"{across}axis"]} domain'
        refs = {f'{along}ref': where[f'{along}axis'], f'{across}ref': edge}
        self.layout.setdefault('shapes', []).append({
            'type': 'line', f'{along}0': mark.at, f'{along}1': mark.at, f'{across}0': 0,
            f'{across}1': 1, 'layer': 'below', 'line': {'color': _LINE, 'width': 1, 'dash': 'dot'},
            **refs,
        })  # fmt: skip
        if mark.text:
            self.layout.setdefault('annotations', []).append({
                along: float(np.log10(mark.at)) if axis.log else mark.at, across: 1.0,
                'yanchor': 'bottom', 'text': mark.text, 'showarrow': False,
                'font': {'size': 10, 'color': GROUND}, **refs,
            })  # fmt: skip

    def _mark_impacts(self, panel: Panel, k: int, n: str, where: _Json) -> None:
        """Impacts at the upper edge, on an axis of their own that lies over that of the panel."""
        own = f'{100 + k}'
        self.layout['yaxis' + own] = {
            'overlaying': 'y' + n, 'anchor': where['xaxis'], 'range': [0.0, 1.0],
            'visible': False, 'fixedrange': True,
        }  # fmt: skip
        self.data.append({
            'type': 'scatter', 'mode': 'markers', 'x': packed(places(panel.impact_times)),
            'y': packed(brief(np.full(len(panel.impact_times), 0.97))), 'name': 'impact',
            'marker': {'symbol': 'line-ns', 'size': 7, 'line': {'color': IMPACT, 'width': 1}},
            'hoverinfo': 'skip', 'xaxis': where['xaxis'], 'yaxis': 'y' + own,
            'showlegend': True, 'legend': 'legend' + n, 'meta': [k, 'struck'],
        })  # fmt: skip


def _beside(row: Sequence[Panel]) -> _Json:
    """Margins of round panels: the number of the last circle lies outside of it."""
    found = {'l': float(_ROUND), 'r': float(_ROUND)}
    for panel in row:
        way = round(np.cos(np.radians(panel.free)))  # 0: there is room above or below
        if way:
            reach = _LETTER * (_DIGITS + len(typeset(panel.y.unit))) - 5.0
            found['r' if way > 0 else 'l'] = max(_ROUND, reach)
    return found


def _axis(axis: Axis, panel: Panel, side: str) -> _Json:
    title = axis.title
    if side == 'y':
        title = '<br>'.join(textwrap.wrap(title, int(_INCH * panel.height / _LETTER))) or title
    found: _Json = {'title': {'text': title}}
    ends = [axis.low, axis.high]
    if axis.log:
        ends = [None if end is None else float(np.log10(end)) for end in ends]
        found |= {'type': 'log', 'dtick': 1, 'tickformat': '~g' if side == 'x' else ''}
    if ends != [None, None]:
        found |= {'range': ends}
    if axis.every:
        found |= {'dtick': axis.every}
    if axis.names:
        found |= {'tickvals': axis.places, 'ticktext': axis.names}
        if side == 'y':
            found |= {'showgrid': False, 'zeroline': False, 'ticks': '', 'fixedrange': True}
    return found


def pale(shade: str, opacity: float) -> str:
    """A colour, partly transparent, in which that on dark ground can take its place."""
    return f'{shade}{round(255 * opacity):02x}'


def _traces(panel: Panel, curve: ChartCurve) -> Iterator[_Json]:
    """Traces of a curve; the last one has its data."""
    round_ = panel.form == 'polar'
    look = LOOKS[curve.look]
    width = round(_PIXEL * look.width, 2)
    pattern = DASHES[curve.dash % len(DASHES)]
    dash = ','.join(f'{width * part:.2g}px' for part in pattern) if pattern else 'solid'
    same: _Json = {
        'type': 'scatterpolar' if round_ else 'scatter', 'name': curve.label or curve.of,
        **({'legendgroup': curve.group or curve.of} if curve.group or curve.of else {}),
    }  # fmt: skip
    line = {'color': curve.shade, 'width': width, 'dash': dash}
    if curve.form == 'area' and curve.low is not None:
        shade = curve.shade if look.opacity == 1.0 else pale(curve.shade, look.opacity)
        yield same | _data(*_outline(curve), round_) | {
            'mode': 'lines', 'fill': 'toself', 'fillcolor': shade,
            'line': {'width': width, 'color': shade}, 'hoveron': 'fills',
            'hoverinfo': 'name' if curve.look == 'body' else 'skip',
        }  # fmt: skip
        return
    stems = curve.form == 'stems'
    mode = [] if curve.form == 'dots' or stems else ['lines']
    mode += ['markers'] if curve.marker else []
    mode += ['text'] if any(curve.texts) else []
    trace = same | _data(curve.x, curve.y, round_) | {'mode': '+'.join(mode) or 'none'}
    if look.opacity < 1.0 and curve.look != 'ideal':
        trace['opacity'] = look.opacity
    if curve.look == 'ideal':
        line |= {'color': pale(curve.shade, look.opacity)}
        trace |= {'hoverinfo': 'skip'}
    trace['line'] = line | ({'shape': 'hvh'} if curve.form == 'steps' else {})
    if curve.marker:
        trace['marker'] = {'symbol': curve.marker, 'size': 5, 'color': curve.shade}
    if any(curve.texts):
        trace |= {'text': list(curve.texts), 'textposition': 'top center',
                  'textfont': {'size': 10, 'color': INK}}  # fmt: skip
    if curve.error is not None:
        trace['error_y'] = {'array': packed(brief(curve.error)), 'thickness': 1, 'width': 3}
    if curve.when is not None:
        trace['customdata'] = packed(places(curve.when))
    if curve.notes:
        trace['hovertext'] = list(curve.notes)
    if curve.look != 'ideal' and len(curve.x):
        trace['hovertemplate'] = _hover(panel, curve)
    if stems and len(curve.x):
        blank = np.full(len(curve.y), np.nan)
        rays = np.array([np.zeros(len(curve.y)), curve.y, blank]).T.ravel()
        yield same | _data(np.repeat(curve.x, 3), rays, round_) | {
            'mode': 'lines', 'hoverinfo': 'skip', 'opacity': min(look.opacity, 0.6),
            'line': line | {'width': max(1.0, width)},
        }  # fmt: skip
    yield trace


def _hover(panel: Panel, curve: ChartCurve) -> str:
    """Text beside a point."""
    x, y = (typeset(axis.unit) for axis in (panel.x, panel.y))
    of_x, of_y = (_format(axis.unit, v) for axis, v in ((panel.x, curve.x), (panel.y, curve.y)))
    said = ['%{hovertext}'] if curve.notes else []
    if panel.form == 'polar':
        said += [f'%{{r:{of_y}}} {y}', f'%{{theta:.1f}} {x}']
    else:
        said += [f'%{{x:{of_x}}} {x}', f'%{{y:{of_y}}} {y}']
    if curve.when is not None and panel.x.unit != 's':
        said += [f'%{{customdata:{_format("s", curve.when)}}} s']
    return '<br>'.join(said) + '<extra></extra>'


def _format(unit: str, values: Array) -> str:
    """Digits beside a point: microseconds, else five, or more where values differ by less."""
    known = values[np.isfinite(values)]
    span, size = (np.ptp(known), np.abs(known).max()) if len(known) else (0.0, 0.0)
    fine = span > _ROUNDING * size
    if unit == 's':
        return f'.{max(6, 4 - math.floor(math.log10(span))) if fine else 6}f'
    return f'.{5 + max(0, math.floor(math.log10(size / span))) if fine else 5}g'


def _data(x: Array, y: Array, round_: bool) -> _Json:
    if not len(x):
        return {'x': [None], 'y': [None]}
    if round_:
        return {'theta': packed(brief(x)), 'r': packed(brief(y))}
    return {'x': packed(places(x)), 'y': packed(brief(y))}


def _outline(curve: ChartCurve) -> tuple[Array, Array]:
    """Around an area: along its upper edge and back along the lower, part by part."""
    assert curve.low is not None  # noqa: S101 - it is an area
    parts = np.split(np.arange(len(curve.x)), np.flatnonzero(np.isnan(curve.x)))
    xs: list[Array] = []
    ys: list[Array] = []
    nothing = np.array([np.nan])
    for part in parts:
        own = part[~np.isnan(curve.x[part])]
        xs += [curve.x[own], curve.x[own][::-1], nothing]
        ys += [curve.y[own], curve.low[own][::-1], nothing]
    return np.concatenate(xs)[:-1], np.concatenate(ys)[:-1]


def brief(x: ArrayLike) -> NDArray[Any]:
    """Numbers with seven digits, half the data, unless they change by less of their size."""
    values = np.asarray(x, np.float64)
    return places(values, _ROUNDING * float(np.abs(values[np.isfinite(values)]).max(initial=0.0)))


def places(x: NDArray[np.float64], rounding: float = 0.0) -> NDArray[Any]:
    """Times or the like, as briefly as tells them apart on any screen, but for rounding."""
    known = x[np.isfinite(x)]
    span = float(np.ptp(known)) if len(known) else 0.0
    short = np.asarray(x, np.float32)
    alike = not len(known) or span < rounding
    fine = alike or np.spacing(np.abs(np.float32(known)).max()) < 3e-5 * span
    return short if fine else np.asarray(x)
