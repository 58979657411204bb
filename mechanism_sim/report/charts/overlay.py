"""The charts of several runs together: each quantity, and its differences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.report.charts.chart import (
    DASHES,
    NOTHING,
    SMALL,
    Axis,
    Chart,
    ChartCurve,
    ChartSection,
    Panel,
)

_DIFFERENCE = 0.6  # height of differences, as a share of a panel's
_ALIKE = 1e-9  # share of the largest value: smaller differences are rounding
_LONG = 40  # letters of a cell
_MAIN = '', 'strong', 'fine', 'wear'

Runs = Sequence[tuple[int, str]]
"""Numbers and names of runs with a quantity."""


def overlaid(runs: Sequence[Sequence[ChartSection]], names: Sequence[str]) -> list[ChartSection]:
    """The sections of several runs: each quantity has a panel with the lines of all that have it.

    Below it stand the differences from the first run. A run has one colour and one dash in all
    charts. Ideal machines and earlier turns, which charts of a single run show beneath, are left
    out, and texts and tables about single runs.
    """
    found = []
    for key in dict.fromkeys(section.key for run in runs for section in run):
        own = [next((s for s in run if s.key == key), None) for run in runs]
        first = next(s for s in own if s)
        by_run = [{c.key: c for c in s.charts} if s else {} for s in own]
        charts = [
            chart
            for name in dict.fromkeys(name for charts in by_run for name in charts)
            for chart in _together([charts.get(name) for charts in by_run], names)
        ]
        rows = [{what: x[:_LONG] for what, x in s.rows} if s else {} for s in own]
        told = list(dict.fromkeys(what for some in rows for what in some))
        table = [(what, *(some.get(what, '–') for some in rows)) for what in told]
        head = [('figure', *names)] if table else []
        if charts or table:
            found.append(replace(
                first, text='', charts=tuple(charts), rows=(), table=(*head, *table)
            ))  # fmt: skip
    return found


def _together(charts: Sequence[Chart | None], names: Sequence[str]) -> Iterator[Chart]:
    """One chart, if its axes are alike in all runs, else one for each run."""
    known = [(k, chart) for k, chart in enumerate(charts) if chart]
    first = known[0][1]
    if any(_axes(chart) != _axes(first) for _, chart in known):
        for k, chart in known:
            yield from _together([chart if i == k else None for i in range(len(names))], names)
        return
    alone = [names[k] for k, _ in known] if len(known) < len(names) else []
    runs = [(k, names[k]) for k, _ in known]
    panels: list[Panel] = []
    for same in zip(*(chart.panels for _, chart in known), strict=True):
        panels += _panels(same, runs)
    entries = tuple(
        ChartCurve(NOTHING, NOTHING, name, colour=k, dash=k % len(DASHES), group=name)
        for k, name in runs
    )
    panels[0] = replace(panels[0], curves=(*entries, *panels[0].curves))
    numbers = '-'.join(str(k) for k, _ in known)
    yield replace(
        first, panels=tuple(panels), columns=1,
        key=f'{first.key}-{numbers}' if alone else first.key,
        title=f'{first.title}, {" and ".join(alone)}' if alone else first.title,
    )  # fmt: skip


def _axes(chart: Chart) -> list[tuple[str, str, str]]:
    """Axes of the panels, equal where charts can be drawn together."""
    return [(p.x.title, p.y.title, '' if p.y.names else p.title) for p in chart.panels]


def _panels(same: Sequence[Panel], runs: Runs) -> Iterator[Panel]:
    """The panels in place of one: one for each quantity, with its differences; bands by run."""
    first = same[0]
    if first.y.names:
        for panel, (_, name) in zip(same, runs, strict=True):
            kept = tuple(c for c in panel.curves if c.look != 'ideal')
            yield replace(panel, curves=kept, title=name, impact_times=NOTHING)
        return
    x, y = (_span([getattr(p, axis) for p in same]) for axis in 'xy')
    lines = [[c for c in p.curves if len(c.x) and c.look in _MAIN] for p in same]
    own = list(dict.fromkeys(c.of for curves in lines for c in curves))
    plain = first.form == 'plain' and not (x.log or y.log)
    split = plain and all(c.form in ('line', 'steps') for curves in lines for c in curves)
    for part in [[name] for name in own] if split else [own]:
        each = [[c for c in curves if c.of in part] for curves in lines]
        told = next((c.label for curves in each for c in curves), '') if len(own) > 1 else ''
        drawn = tuple(_of(c, *run) for curves, run in zip(each, runs, strict=True) for c in curves)
        yield replace(
            first, x=x, y=y, curves=drawn, title=first.title or (told if split else ''),
            impact_times=NOTHING, height=min(first.height, 1.4 * SMALL) if split else first.height,
        )  # fmt: skip
        if split and (less := _differences(each, runs)):
            away = Axis('difference', y.unit)
            yield Panel(x, away, less, height=_DIFFERENCE * SMALL)


def _span(axes: Sequence[Axis]) -> Axis:
    """An axis that holds all."""
    low, high = ([getattr(a, end) for a in axes] for end in ('low', 'high'))
    return replace(
        axes[0], low=None if None in low else min(low), high=None if None in high else max(high)
    )


def _of(c: ChartCurve, k: int, name: str) -> ChartCurve:
    """A line as it is drawn of a run."""
    look = '' if c.look == 'strong' else c.look
    return replace(
        c, label='', of=f'{c.of} {name}', group=name, colour=k, look=look,
        dash=k % len(DASHES) if c.form == 'line' else c.dash,
    )  # fmt: skip


def _differences(each: Sequence[Sequence[ChartCurve]], runs: Runs) -> tuple[ChartCurve, ...]:
    """Lines of the others less that of the first run, where both are known and go on along x."""
    known = [_onward(curves[0]) if curves else None for curves in each]
    if known[0] is None:
        return ()
    one, found = known[0], []
    for two, run in list(zip(known, runs, strict=True))[1:]:
        if two is None:
            continue
        x = np.unique(np.concatenate([one[0], two[0]]))
        a, b = (np.interp(x, own[0], own[1], left=np.nan, right=np.nan) for own in (one, two))
        less = b - a
        size = np.abs(one[1]).max(initial=0.0)
        if np.nanmax(np.abs(less), initial=0.0) > _ALIKE * size:
            found.append(_of(replace(each[0][0], x=x, y=less, when=None, notes=()), *run))
    return tuple(found)


def _onward(c: ChartCurve) -> Array | None:
    """Places and values (2, N) of a line that goes on along x; None of one that turns back."""
    x, y = np.array([c.x, c.y])[:, np.isfinite(c.x) & np.isfinite(c.y)]
    along = np.maximum.accumulate(x)
    return np.array([along, y]) if np.ptp(x) > 1e6 * (along - x).max() else None
