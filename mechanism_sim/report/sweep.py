"""Sweeps as text and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.report.figures import check_picture, save
from mechanism_sim.sweep.plan import REPEAT, Plan
from mechanism_sim.sweep.row import Value
from mechanism_sim.sweep.run import Summary, has_failed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PANELS = (
    ('impulse', 1e3, 'sum of normal impulses\nper revolution [mN s]'),
    ('impacts', 1.0, 'impacts per revolution'),
    ('I_n', 1e3, '$I_n$, impulse per impact\n[mN s]'),
)
_STYLES = (('o', '-'), ('s', '--'), ('^', '-.'), ('D', ':'), ('v', '-'), ('P', '--'))
_MOST_ROWS, _MOST_TICKS = 40, 8


def render(summary: Summary, plan: Plan, rows: Sequence[dict[str, Value]]) -> str:
    """The outcome of a sweep for people: its figures if they are few, its failures, its table."""
    lines = []
    if len(rows) <= _MOST_ROWS:
        lines += ['  run   impacts           impulse [mN s]        I_n [mN s]  swept']
    failed = [(run, row) for run, row in zip(plan.runs, rows, strict=True) if has_failed(row)]
    for run, row in zip(plan.runs, rows, strict=True):
        if len(rows) > _MOST_ROWS or has_failed(row):
            continue
        figures = [_mean_text(row, name, scale) for name, scale, _ in _PANELS]
        said = ', '.join(f'{k.rpartition(".")[2]} = {v}' for k, v in run.given.items())
        again = f', repetition {run.values[REPEAT]}' if REPEAT in run.values else ''
        lines.append(f'{run.index:5d}  {figures[1]}  {figures[0]}  {figures[2]}  {said}{again}')
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


def _mean_text(row: dict[str, Value], name: str, scale: float) -> str:
    mean, half = _number(row, name) * scale, _number(row, f'{name}_half_width') * scale
    return f'{mean:8.4g} +- {half:<7.2g}' if math.isfinite(mean) else f'{"none":^19}'


def _number(row: dict[str, Value], name: str) -> float:
    value = row.get(name)
    return float(value) if isinstance(value, int | float) else math.nan


@dataclass(frozen=True)
class Chart:
    """A picture to be drawn of a sweep, over the values at the path `over`."""

    file: Path
    over: str


def chart_of(plan: Plan, file: str | None, over: str | None) -> Chart | None:
    """What is asked for; nothing without a file.

    Raises
    ------
    InputError
        If it cannot be drawn, before anything is computed.
    """
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
    return Chart(path, chosen)


def draw(chart: Chart, plan: Plan, rows: Sequence[dict[str, Value]]) -> None:
    """Draw impulses, impacts and I_n over a swept value, a line for each of the other values.

    Bars are 95 % confidence intervals; repetitions are put together.
    """
    import matplotlib as mpl  # noqa: PLC0415 - slow to import, and seldom needed
    from matplotlib.figure import Figure  # noqa: PLC0415

    style: dict[Any, Any] = {
        'font.size': 9.0, 'axes.spines.top': False, 'axes.spines.right': False,
        'svg.hashsalt': 'mechanism_sim',
    }  # fmt: skip
    with mpl.rc_context(style):
        figure = Figure(figsize=(9.5, 3.4), layout='constrained')
        panels: list[Axes] = list(figure.subplots(1, len(_PANELS)))
        lines = _lines(chart, plan, rows)
        for axes, (name, scale, label) in zip(panels, _PANELS, strict=True):
            _panel(axes, lines, name, scale)
            axes.set_ylabel(label)
            axes.set_ylim(bottom=0.0)
            _ticks(axes, chart, plan)
        figure.supxlabel(chart.over, fontsize=9.0)
        if len(lines) > 1:
            figure.legend(
                *panels[0].get_legend_handles_labels(), loc='outside upper center',
                ncols=min(len(lines), 4), frameon=False, handlelength=3.0,
            )  # fmt: skip
        save(figure, chart.file)


Lines = dict[str, dict[float, list[dict[str, Value]]]]


def _lines(chart: Chart, plan: Plan, rows: Sequence[dict[str, Value]]) -> Lines:
    """Finished rows by line of the picture and by place on it."""
    lines: Lines = {}
    for run, row in zip(plan.runs, rows, strict=True):
        if has_failed(row):
            continue
        others = ', '.join(
            f'{k.rpartition(".")[2]} {v}' for k, v in run.given.items() if k != chart.over
        )
        x = float(run.values[chart.over] or 0.0)
        lines.setdefault(others, {}).setdefault(x, []).append(row)
    return lines


def _panel(axes: Axes, lines: Lines, name: str, scale: float) -> None:
    for k, (label, places) in enumerate(lines.items()):
        xs = sorted(places)
        means = [[_number(row, name) * scale for row in places[x]] for x in xs]
        halves = [[_number(row, f'{name}_half_width') * scale for row in places[x]] for x in xs]
        y = [sum(m) / len(m) for m in means]
        error = [math.hypot(*h) / len(h) for h in halves]
        marker, line = _STYLES[k % len(_STYLES)]
        shade = str(0.6 * k / max(1, len(lines) - 1))
        axes.errorbar(
            xs, y, error, label=label, color=shade, marker=marker, linestyle=line,
            markersize=4.0, linewidth=1.0, capsize=2.5,
        )  # fmt: skip


def _ticks(axes: Axes, chart: Chart, plan: Plan) -> None:
    """The values as the file has them, with their units, where there is room for them."""
    said: dict[float, Any] = {
        float(run.values[chart.over] or 0.0): run.given.get(chart.over) for run in plan.runs
    }
    if len(said) <= _MOST_TICKS and None not in said.values():
        axes.set_xticks(list(said), [str(v) for v in said.values()], rotation=30, ha='right')
    else:
        axes.set_xlabel('SI')
