"""Sweeps as text and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.report.figures import check_picture
from mechanism_sim.report.sweep_charts import is_numeric
from mechanism_sim.strict_json import plain
from mechanism_sim.studies.effects import effects, exceedances, number
from mechanism_sim.studies.plan import REPEAT, SweepPlan
from mechanism_sim.studies.runs import Row, has_failed
from mechanism_sim.studies.sweep import SweepSummary
from mechanism_sim.units import for_people

_MOST_ROWS = 40


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
    # the scale and the unit in which impulses are read
    large = max((abs(number(row, 'impulse')) for row in rows), default=0.0)
    scale, unit = (1.0, 'N s') if large >= 1.0 else (1e3, 'mN s')
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


def check_charts(plan: SweepPlan, file: str | None, over: str | None, option: str) -> None:
    """Refuse charts that cannot be drawn, before anything is computed."""
    if file is None:
        return
    check_picture(option, file, folder_too=option == '--plots')
    swept = [c for c in plan.columns if c != REPEAT]
    if over is not None and over not in swept:
        raise InputError(
            f'--over {over}: this is not swept{nearest(over, swept)}; swept are: '
            f'{", ".join(swept)}'
        )
    numeric = [c for c in swept if is_numeric(plan, c)]
    if (over or option == '--plot') and (over or next(iter(numeric), None)) not in numeric:
        raise InputError(
            f'{option} {file}: this needs a swept value that is a number in every run'
        )
