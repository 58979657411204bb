"""The charts of two runs, one upon the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from mechanism_sim.pages.charts.section import Chart, Section

Figure = dict[str, Any]

FIRST, SECOND = 'A', 'B'
"""What the runs are called in legends."""


def overlaid(first: Sequence[Section], second: Sequence[Section]) -> list[Section]:
    """The sections of two runs: a chart that both have holds the lines of both.

    Lines of the second run are dotted, in the colour that the quantity has in the first one.
    Machines with ideal joints, which charts of a single run show beneath, are left out.
    """
    found = []
    others = {section.key: section for section in second}
    for section in first:
        other = others.pop(section.key, None)
        found.append(_together(section, other) if other else _only(section, FIRST))
    return [*found, *(_only(section, SECOND) for section in others.values())]


def _together(one: Section, two: Section) -> Section:
    charts: list[Chart] = []
    others = {chart.key: chart for chart in two.charts}
    for chart in one.charts:
        other = others.pop(chart.key, None)
        if other and _axes(chart.figure) == _axes(other.figure):
            figure = {
                'data': [*_named(chart.figure, FIRST), *_named(other.figure, SECOND)],
                'layout': _layout(chart.figure['layout'], other.figure['layout']),
            }
            charts.append(replace(chart, figure=figure))
        else:
            charts += [_marked(chart, FIRST), *([_marked(other, SECOND)] if other else [])]
    charts += [_marked(chart, SECOND) for chart in others.values()]
    return replace(one, charts=tuple(charts), rows=tuple(_rows(one.rows, two.rows)))


def _only(section: Section, name: str) -> Section:
    charts = tuple(_marked(chart, name) for chart in section.charts)
    return replace(
        section, charts=charts, rows=tuple((k, f'{name}: {x}') for k, x in section.rows)
    )


def _marked(chart: Chart, name: str) -> Chart:
    figure = {**chart.figure, 'data': list(_named(chart.figure, name))}
    return replace(chart, key=f'{chart.key}-{name}', title=f'{chart.title}, {name}', figure=figure)


def _axes(figure: Figure) -> set[str]:
    return {name for name in figure['layout'] if name.startswith(('xaxis', 'yaxis', 'polar'))}


def _named(figure: Figure, name: str) -> Iterator[Figure]:
    for trace in figure['data']:
        label = trace.get('name') or ''
        if label == 'ideal machine' or label.endswith(', ideal'):
            continue
        made = {**trace, 'name': f'{label} {name}'.strip()}
        if 'legendgroup' in trace:
            made['legendgroup'] = f'{trace["legendgroup"]} {name}'
        if name == SECOND and 'lines' in (trace.get('mode') or ''):
            made['line'] = {**trace.get('line', {}), 'dash': 'dot'}
        yield made


def _layout(one: Figure, two: Figure) -> Figure:
    """Axes of time that hold both; a legend, for now there are two of everything."""
    merged = {**one, 'showlegend': True}
    for name in one:
        ranges = [layout[name].get('range') for layout in (one, two) if name.startswith('xaxis')]
        if len(ranges) == 2 and all(ranges):
            low, high = (f(x) for f, x in zip((min, max), zip(*ranges, strict=True), strict=True))
            merged[name] = {**one[name], 'range': [low, high]}
    return merged


def _rows(
    one: Iterable[tuple[str, str]], two: Iterable[tuple[str, str]]
) -> Iterator[tuple[str, str]]:
    others = dict(two)
    for what, value in one:
        other = others.get(what, '–')
        yield what, value if value == other else f'{FIRST}: {value}; {SECOND}: {other}'
