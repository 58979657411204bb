"""The charts of two runs, one upon the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from mechanism_sim.report.charts.chart import (
    DOTTED,
    NOTHING,
    Chart,
    ChartCurve,
    ChartSection,
    Panel,
)

FIRST, SECOND = 'A', 'B'
"""Names of the runs in legends."""


def overlaid(first: Sequence[ChartSection], second: Sequence[ChartSection]) -> list[ChartSection]:
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


def _together(one: ChartSection, two: ChartSection) -> ChartSection:
    charts: list[Chart] = []
    others = {chart.key: chart for chart in two.charts}
    for chart in one.charts:
        other = others.pop(chart.key, None)
        if other and _axes(chart) == _axes(other):
            pairs = zip(chart.panels, other.panels, strict=True)
            charts.append(replace(chart, panels=tuple(_both(*pair) for pair in pairs)))
        else:
            charts += [_marked(chart, FIRST), *([_marked(other, SECOND)] if other else [])]
    charts += [_marked(chart, SECOND) for chart in others.values()]
    return replace(one, charts=tuple(charts), rows=tuple(_rows(one.rows, two.rows)))


def _only(section: ChartSection, name: str) -> ChartSection:
    charts = tuple(_marked(chart, name) for chart in section.charts)
    return replace(
        section, charts=charts, rows=tuple((k, f'{name}: {x}') for k, x in section.rows)
    )


def _marked(chart: Chart, name: str) -> Chart:
    panels = tuple(replace(p, curves=tuple(_named(p, name))) for p in chart.panels)
    return replace(chart, key=f'{chart.key}-{name}', title=f'{chart.title}, {name}', panels=panels)


def _axes(chart: Chart) -> list[tuple[str, str, str]]:
    """Axes of the panels, equal where charts can be overlaid; those of mode bands never are."""
    return [
        (p.x.title, p.y.title, p.title) if not p.y.names else ('', '', str(id(p)))
        for p in chart.panels
    ]


def _named(panel: Panel, name: str) -> Iterator[ChartCurve]:
    """The lines of a run, but for those of its ideal machine; in the legend all have its name."""
    kept = [c for c in panel.curves if c.look != 'ideal']
    plain = not any(c.label for c in kept) and next((c for c in kept if not c.look), None)
    for c in kept:
        label = f'{c.label} {name}' if c.label else name if c is plain else ''
        dash, marker = c.dash, c.marker
        if name == SECOND:
            dash = DOTTED if c.form == 'line' else c.dash
            marker = marker and f'{marker.removesuffix("-open")}-open'
        yield replace(c, label=label, of=f'{c.of} {name}', dash=dash, marker=marker)


def _both(one: Panel, two: Panel) -> Panel:
    """The lines of both; axes of time, and of sizes, hold both."""
    axes = {}
    for name in ('x', 'y'):
        a, b = getattr(one, name), getattr(two, name)
        low = None if a.low is None or b.low is None else min(a.low, b.low)
        high = None if a.high is None or b.high is None else max(a.high, b.high)
        axes[name] = replace(a, low=low, high=high)
    curves = (*_named(one, FIRST), *_named(two, SECOND))
    return replace(one, curves=curves, struck=NOTHING, **axes)


def _rows(
    one: Iterable[tuple[str, str]], two: Iterable[tuple[str, str]]
) -> Iterator[tuple[str, str]]:
    others = dict(two)
    for what, value in one:
        other = others.get(what, '–')
        yield what, value if value == other else f'{FIRST}: {value}; {SECOND}: {other}'
