"""Sweeps as text and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.report.charts.chart import DASHES, MARKERS, Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.figures import check_picture
from mechanism_sim.strict_json import plain
from mechanism_sim.studies.effects import effects, exceedances, measures_of, number
from mechanism_sim.studies.plan import REPEAT, SweepPlan
from mechanism_sim.studies.runs import Row, has_failed
from mechanism_sim.studies.sweep import SweepSummary
from mechanism_sim.units import for_people

_PANELS = (
    ('impulse', 1e3, 'impulses per revolution', 'mN s'),
    ('impacts', 1.0, 'impacts per revolution', ''),
    ('I_n', 1e3, 'impulse per impact', 'mN s'),
)
_MOST_ROWS, _MOST_TICKS = 40, 8


def render(summary: SweepSummary, plan: SweepPlan, rows: Sequence[Row]) -> str:
    """The outcome of a sweep for people: its figures if they are few, its failures, its table."""
    lines = _few(plan, rows) if len(rows) <= _MOST_ROWS else []
    lines += _spreads(plan, rows)
    failed = [(run, row) for run, row in zip(plan.runs, rows, strict=True) if has_failed(row)]
    lines += [f'run {run.index} failed: {row["status"]}' for run, row in failed[:10]]
    if len(failed) > 10:
        lines.append(f'and {len(failed) - 10} more failed')
    return '\n'.join(
        [
            *lines,
            f'{summary.runs} runs, {summary.failed} failed; {summary.computed} computed now in '
            f'{summary.wall_time:.1f} s ({summary.cpu_time:.1f} s of CPU), {summary.kept} before',
            f'  table in {summary.table}',
            *(
                [f'  {summary.windows} windows in {summary.windows_folder}']
                if summary.windows_folder
                else []
            ),
        ]
    )


def _few(plan: SweepPlan, rows: Sequence[Row]) -> list[str]:
    """A line for each run: its measures, or its impacts, and what was swept."""
    measures = plan.measured
    table: list[list[str]] = []
    heads = ['run']
    scale, unit = _of_impulses(rows)
    if measures:
        shown = [(c.name, *for_people(c.unit, _largest(rows, c.name))) for c in measures]
        heads += [f'{name} [{u}]' if u else name for name, u, _ in shown]
    else:
        heads += ['impacts', f'impulse [{unit}]', f'I_n [{unit}]']
    for run, row in zip(plan.runs, rows, strict=True):
        if has_failed(row):
            continue
        if measures:
            figures = [_text(number(row, name) * by) for name, _, by in shown]
        else:
            figures = [
                _mean_text(row, name, by)
                for name, by in (('impacts', 1.0), ('impulse', scale), ('I_n', scale))
            ]
        said = ', '.join(
            f'{k.rpartition(".")[2]} = {_given(v, plan.units.get(k, ""))}'
            for k, v in run.given.items()
        )
        again = f', repetition {run.values[REPEAT]}' if REPEAT in run.values else ''
        table.append([str(run.index), *figures, said + again])
    left = len(heads)
    return text_table.lines([[*heads, 'swept'], *table], [left]) if table else []


def _given(value: Any, unit: str) -> str:
    """A swept value as the file has it; of a design with the unit in which people read it."""
    if not isinstance(value, float) or not unit:
        return str(value)
    shown, scale = for_people(unit)
    return f'{scale * value:.6g} {shown}'


def _largest(rows: Sequence[Row], name: str) -> float:
    """The largest size of a figure in all rows."""
    return max((abs(x) for row in rows if math.isfinite(x := number(row, name))), default=0.0)


def _of_impulses(rows: Sequence[Row]) -> tuple[float, str]:
    """The scale and the unit in which impulses are read."""
    large = max((abs(number(row, 'impulse')) for row in rows), default=0.0)
    return (1.0, 'N s') if large >= 1.0 else (1e3, 'mN s')


def _text(value: float) -> str:
    return f'{value:.6g}' if math.isfinite(value) else 'none'


def _spreads(plan: SweepPlan, rows: Sequence[Row]) -> list[str]:
    """How measures are distributed over the runs, what does it, and who exceeds limits."""
    measures = plan.measured
    if not measures or len(rows) < 2:
        return []
    lines = []
    table: list[list[str]] = [
        ['', 'unit', 'least', '5 %', 'median', '95 %', 'greatest', 'mean', 'deviation']
    ]
    for c in measures:
        y = np.array([number(row, c.name) for row in rows])
        y = y[np.isfinite(y)]
        if len(y) > 1:
            unit, scale = for_people(c.unit, float(np.abs(y).max()))
            figures = [y.min(), *np.percentile(y, [5, 50, 95]), y.max(), y.mean(), y.std(ddof=1)]
            table.append([c.name, unit, *(_text(scale * float(x)) for x in figures)])
    lines += [f'measures over {len(rows)} runs', *text_table.lines(table, 2)]
    found = effects(plan, rows)
    if found:
        units = {c.name: c.unit for c in measures}
        indices = any(e.first for e in found)
        heads = ['effect of', 'on', 'unit', 'effect', 'share of variance']
        table = [heads + ['first index', 'total index'] * indices]
        for e in found:
            unit, scale = for_people(units.get(e.measure, ''), _largest(rows, e.measure))
            share = f'{100.0 * e.share:.1f} %' if math.isfinite(e.share) else 'none'
            row = [e.factor, e.measure, unit, _text(scale * e.effect), share]
            if indices:
                row += [
                    f'{i[0]:.3f} ({i[1]:.2f} to {i[2]:.2f})' if i else ''
                    for i in (e.first, e.total)
                ]
            table.append(row)
        lines += ['main effects: greatest less least mean', *text_table.lines(table, 3)]
    for x in exceedances(plan, rows):
        (unit,) = (c.unit for c in measures if c.name == x.measure)
        unit, scale = for_people(unit, _largest(rows, x.measure))
        lines.append(
            f'{x.measure} > {scale * x.limit:.6g} {unit}: {x.beyond} of {x.runs} runs, '
            f'{100.0 * x.share:.1f} % (95 %: {100.0 * x.low:.1f} to {100.0 * x.high:.1f} %)'
        )
    return lines


def to_json(summary: SweepSummary, plan: SweepPlan, rows: Sequence[Row]) -> dict[str, Any]:
    """The outcome as JSON: the summary, and effects and shares of what was measured."""
    if not plan.measures:
        return dict(vars(summary))
    return vars(summary) | {
        'units': {c.name: c.unit for c in plan.own},
        'effects': plain(effects(plan, rows)),
        'exceedances': plain(exceedances(plan, rows)),
    }


def _mean_text(row: Row, name: str, scale: float) -> str:
    mean, half = number(row, name) * scale, number(row, f'{name}_half_width') * scale
    return f'{mean:.4g} +- {half:<7.2g}' if math.isfinite(mean) else 'none'


@dataclass(frozen=True)
class SweepChart:
    """A picture to be drawn of a sweep, over the values at the path `over`."""

    file: Path
    over: str


def chart_of(plan: SweepPlan, file: str | None, over: str | None) -> SweepChart | None:
    """Charts that are asked for; none without a file."""
    if file is None:
        if over is not None:
            raise InputError('--over needs --plot FILE')
        return None
    path = check_picture('--plot', file)
    swept = [c for c in plan.columns if c != REPEAT]
    if over is not None and over not in swept:
        raise InputError(
            f'--over {over}: this is not swept{nearest(over, swept)}; swept are: '
            f'{", ".join(swept)}'
        )
    numeric = [c for c in swept if all(isinstance(r.values[c], float | int) for r in plan.runs)]
    chosen = over or (numeric[-1] if numeric else None)
    if chosen not in numeric:
        raise InputError(f'--plot {file}: this needs a swept value that is a number in every run')
    return SweepChart(path, chosen)


def sweep_chart(asked: SweepChart, plan: SweepPlan, rows: Sequence[Row]) -> Chart:
    """Impulses, impacts and I_n over a swept value, a line for each of the other values.

    Bars are 95 % confidence intervals; repetitions are put together.
    """
    lines, x = _lines(asked, plan, rows), _axis(asked, plan)
    panels: list[Panel] = []
    for name, scale, words, unit in _PANELS:
        curves = [
            _curve(places, name, scale, '' if panels else label, k)
            for k, (label, places) in enumerate(lines.items())
        ]
        panels.append(Panel(x, Axis(words, unit, low=0.0), tuple(curves), height=2.4))
    return Chart('sweep', '', tuple(panels), columns=len(panels), width=9.5)


Lines = dict[str, dict[float, list[Row]]]


def _lines(asked: SweepChart, plan: SweepPlan, rows: Sequence[Row]) -> Lines:
    """Finished rows by line of the picture and by place on it."""
    lines: Lines = {}
    for run, row in zip(plan.runs, rows, strict=True):
        if has_failed(row):
            continue
        others = ', '.join(
            f'{k.rpartition(".")[2]} {v}' for k, v in run.given.items() if k != asked.over
        )
        x = float(run.values[asked.over] or 0.0)
        lines.setdefault(others, {}).setdefault(x, []).append(row)
    return lines


def _curve(
    places: dict[float, list[Row]], name: str, scale: float, label: str, k: int
) -> ChartCurve:
    xs = sorted(places)
    means = [[number(row, name) * scale for row in places[x]] for x in xs]
    halves = [[number(row, f'{name}_half_width') * scale for row in places[x]] for x in xs]
    y = np.array([sum(m) / len(m) for m in means])
    error = np.array([math.hypot(*h) / len(h) for h in halves])
    marker = MARKERS[k % len(MARKERS)]
    return ChartCurve(np.array(xs), y, label, '', k, k % len(DASHES), marker=marker, error=error)


def _axis(asked: SweepChart, plan: SweepPlan) -> Axis:
    """The values as the file has them, with their units, where there is room for them."""
    said: dict[float, Any] = {
        float(run.values[asked.over] or 0.0): run.given.get(asked.over) for run in plan.runs
    }
    words = '.'.join(asked.over.split('.')[-3:])
    if len(said) <= _MOST_TICKS and None not in said.values():
        return Axis(words, names=tuple(map(str, said.values())), at=tuple(said))
    return Axis(words, 'SI')


def effects_chart(plan: SweepPlan, rows: Sequence[Row]) -> Chart:
    """Main effects: a row for each measure, a column for each factor, means with errors.

    Bars are two standard errors of a mean; the share is that of the variance which the factor
    explains by itself, and the index that of Sobol where the design gives it.
    """
    found = {(e.measure, e.factor): e for e in effects(plan, rows)}
    factors = list(dict.fromkeys(factor for _, factor in found))
    units = {c.name: c.unit for c in plan.own}
    panels = []
    for name in (n for n in measures_of(plan) if any(m == n for m, _ in found)):
        unit, scale = for_people(units.get(name, ''), _largest(rows, name))
        for factor in factors:
            e = found.get((name, factor))
            of, along = for_people(plan.units.get(factor, ''))
            levels = e.levels if e else ()
            numbers = all(isinstance(level.x, float | int) for level in levels)
            x = [along * float(level.x) if numbers else k for k, level in enumerate(levels)]
            mean, error = (
                np.array([by * getattr(level, k) for level in levels])
                for by, k in ((scale, 'mean'), (2.0 * scale, 'error'))
            )
            curve = ChartCurve(
                np.array(x, np.float64), mean, of=factor, marker='circle', error=error
            )
            said = f'{100.0 * e.share:.0f} %' if e and math.isfinite(e.share) else ''
            said += f', total index {e.total[0]:.2f}' if e and e.total else ''
            short = '.'.join(factor.split('.')[-3:])
            names = () if numbers else tuple(str(level.x) for level in levels)
            panels.append(Panel(Axis(short, of, names=names), Axis(name, unit), (curve,), said,
                                height=1.6, scale=name))  # fmt: skip
    if not panels:
        raise InputError('--effects: nothing that is swept changes a measure')
    wide = 1.2 + 2.1 * len(factors)
    return Chart('effects', '', tuple(panels), columns=len(factors), width=wide)
