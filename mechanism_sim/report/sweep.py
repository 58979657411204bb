"""Sweeps as text and as pictures: over values, effects, tornado, Pareto, surfaces."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError, check_known
from mechanism_sim.export.palette import GROUND, INK, LINKS
from mechanism_sim.report.charts.chart import (
    DASHES,
    MARKERS,
    ROW,
    Axis,
    Chart,
    ChartCurve,
    Mark,
    Panel,
)
from mechanism_sim.report.figures import check_picture
from mechanism_sim.strict_json import plain
from mechanism_sim.studies.design import INDICES
from mechanism_sim.studies.effects import Effect, effects, exceedances, measures_of, number
from mechanism_sim.studies.plan import REPEAT, Run, SweepPlan
from mechanism_sim.studies.runs import Row, has_failed
from mechanism_sim.studies.sweep import SweepSummary
from mechanism_sim.studies.tolerances import FirstOrder
from mechanism_sim.tables import Column
from mechanism_sim.units import counted, digits_apart, for_people, to_si, written
from mechanism_sim.units import number as digits

_WORDS = {
    'impulse': 'impulses per revolution', 'impacts': 'impacts per revolution',
    'I_n': 'impulse per impact',
}  # fmt: skip
_MOST_LINES, _MOST_TICKS, _MOST_PANELS = 8, 8, 6
_MOST_LABELS, _LEVELS = 12, 9  # largest number of labels of best runs; lines of a surface
_LOW, _HIGH = LINKS[0], LINKS[1]
_UNIT = re.compile(r'[\d.]\s*([A-Za-z°µ%][\w^*/ ]*?)\s*(?=,|]|\+-|$)')

_Finished = list[tuple[Run, Row]]
_MOST_ROWS = 40


def render(summary: SweepSummary, plan: SweepPlan, rows: Sequence[Row]) -> str:
    """The outcome of a sweep as text: its figures if they are few, its failures, its table."""
    lines = _few(plan, rows) if len(rows) <= _MOST_ROWS else []
    lines += _spreads(plan, rows)
    failed = [(run, row) for run, row in zip(plan.runs, rows, strict=True) if has_failed(row)]
    lines += [f'run {run.index} failed: {row["status"]}' for run, row in failed[:10]]
    if len(failed) > 10:
        lines.append(f'and {len(failed) - 10} more failed')
    lines += [
        f'{counted(summary.runs, "run")}, {summary.failed} failed; {summary.computed} '
        f'computed now in {summary.wall_time:.1f} s ({summary.cpu_time:.1f} s of CPU), '
        f'{summary.kept} before',
        f'  table in {summary.table}',
    ]
    if summary.windows_folder:
        lines.append(f'  {summary.windows} windows in {summary.windows_folder}')
    return '\n'.join(lines)


def _few(plan: SweepPlan, rows: Sequence[Row]) -> list[str]:
    """A line for each run: its measures, or its impacts, and what was swept."""
    measures = plan.measured
    table: list[list[str]] = []
    heads = ['run']
    unit, scale = for_people('N s', _largest(rows, 'impulse'))
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
            f'{_short(k)} = {_given(v, plan.units.get(k, ""))}' for k, v in run.given.items()
        )
        again = f', repetition {run.values[REPEAT]}' if REPEAT in run.values else ''
        table.append([str(run.index), *figures, said + again])
    left = len(heads)
    return text_table.lines([[*heads, 'swept'], *table], [left]) if table else []


def _given(value: Any, unit: str) -> str:
    """A swept value as in the file; a number with a suitable unit."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not unit:
        return str(value)
    return written(value, unit, 6)


def _largest(rows: Sequence[Row], name: str) -> float:
    """The largest size of a figure in all rows."""
    return max((abs(x) for row in rows if math.isfinite(x := number(row, name))), default=0.0)


def _text(value: float, digits: int = 6) -> str:
    return f'{value:.{digits}g}' if math.isfinite(value) else 'none'


def _spreads(plan: SweepPlan, rows: Sequence[Row]) -> list[str]:
    """Lines on the distributions of measures over the runs, on effects, and on limits exceeded."""
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
    lines += [f'measures over {counted(len(rows), "run")}', *text_table.lines(table, 2)]
    found = effects(plan, rows)
    if found:
        units = {c.name: c.unit for c in measures}
        indices = any(e.first for e in found)
        drawn = any(e.chance is not None for e in found)
        heads = ['effect of', 'on', 'unit', 'effect', *['by chance'] * drawn, 'share of variance']
        table = [heads + ['first index', 'total index'] * indices]
        for e in found:
            unit, scale = for_people(units.get(e.measure, ''), _largest(rows, e.measure))
            share = f'{100.0 * e.share:.1f} %' if math.isfinite(e.share) else 'none'
            figures = [e.effect] if e.chance is None else [e.effect, e.chance]
            digits = 6 if e.chance is None else 3
            row = [e.factor, e.measure, unit, *(_text(scale * x, digits) for x in figures), share]
            if indices:
                row += [_index(i) if i else '' for i in (e.first, e.total)]
            table.append(row)
        note = '; by chance: 95 % of drawn runs show less of a value without effect' * drawn
        lines += [f'main effects: greatest less least mean{note}', *text_table.lines(table, 3)]
    which = 'independent runs' if plan.design and plan.design.kind == INDICES else 'runs'
    for x in exceedances(plan, rows):
        (unit,) = (c.unit for c in measures if c.name == x.measure)
        unit, scale = for_people(unit, _largest(rows, x.measure))
        ends = ('<', x.least), ('>', x.limit)
        bounds = [f'{sign} {scale * end:.6g} {unit}' for sign, end in ends if end is not None]
        fits = '' if x.capability is None else f', Cpk {x.capability:.2f}'
        lines.append(
            f'{x.measure} {" or ".join(bounds)}: {x.beyond} of {x.runs} {which}, '
            f'{100.0 * x.share:.1f} % (95 %: {100.0 * x.low:.1f} to {100.0 * x.high:.1f} %){fits}'
        )
    return lines


def _index(found: tuple[float, float, float]) -> str:
    """An index with its interval, if it has one."""
    index, low, high = found
    return f'{index:.3f} ({low:.2f} to {high:.2f})' if math.isfinite(low) else f'{index:.3f}'


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


def first_order(found: FirstOrder) -> str:
    """Tolerances to first order as text."""
    stacks: list[list[str]] = [
        ['', 'unit', 'nominal', 'deviation', 'worst case', '', 'in full runs', '']
    ]
    table: list[list[str]] = [['effect of', 'on', 'unit', 'lower end', 'upper end', 'share']]
    notes = []
    for s in found.stacks:
        unit, scale = for_people(s.unit, max(abs(s.nominal), *map(abs, s.worst)))
        figures = [s.nominal, s.deviation, *s.worst, *s.corners]
        stacks.append([s.measure, unit, *(_text(scale * x) for x in figures)])
        for c in sorted(s.contributions, key=lambda c: -c.share):
            row = [_text(scale * c.low), _text(scale * c.high), f'{100.0 * c.share:.1f} %']
            table.append([c.factor, s.measure, unit, *row])
        if not s.enough:
            most = max(s.contributions, key=lambda c: c.bent)
            notes.append(
                f'{s.measure}: first order is not enough: full runs are off by '
                f'{100.0 * s.bent:.0f} % of three deviations, most by {most.factor}; run the '
                'design'
            )
    return '\n'.join([
        'measures to first order', *text_table.lines(stacks, 2),
        'changes at the ends of tolerances, shares of variance', *text_table.lines(table, 3),
        *notes, counted(found.runs, 'run'),
    ])  # fmt: skip


def first_order_json(found: FirstOrder) -> dict[str, object]:
    """JSON of them, SI units."""
    return {
        'runs': found.runs,
        'measures': {
            s.measure: plain(s)
            | {'enough': s.enough, 'contributions': {c.factor: plain(c) for c in s.contributions}}
            for s in found.stacks
        },
    }


def first_order_table(found: FirstOrder) -> list[Column]:
    """A row for each measure and factor."""
    rows = [(s, c) for s in found.stacks for c in s.contributions]
    keys = 'slope', 'deviation', 'share', 'low', 'high', 'bent'
    return [
        Column('measure', [s.measure for s, _ in rows]),
        Column('factor', [c.factor for _, c in rows]),
        *(Column(key, [float(getattr(c, key)) for _, c in rows], '' if key == 'share' else 'SI')
          for key in keys),
    ]  # fmt: skip


def check_charts(plan: SweepPlan, file: str | None, over: str | None, option: str) -> None:
    """Refuse charts that cannot be drawn, before anything is computed."""
    if file is None:
        return
    check_picture(option, file, folder_too=option == '--plots')
    swept = [c for c in plan.columns if c != REPEAT]
    if over is not None:
        check_known(over, swept, f'--over {over}: this is not swept', 'swept are:')
    numeric = [c for c in swept if _is_numeric(plan, c)]
    if (over or option == '--plot') and (over or next(iter(numeric), None)) not in numeric:
        raise InputError(
            f'{option} {file}: this needs a swept value that is a number in every run'
        )


class SweepCharts:
    """The charts of a sweep whose runs are finished; `known` are effects found otherwise."""

    def __init__(
        self, plan: SweepPlan, rows: Sequence[Row], known: Sequence[Effect] | None = None
    ) -> None:
        self.plan = plan
        pairs = zip(plan.runs, rows, strict=True)
        self._done: _Finished = [(run, row) for run, row in pairs if not has_failed(row)]
        if not self._done:
            raise RunError('no run of the sweep was finished: there is nothing to draw')
        self._units = {c.name: c.unit for c in plan.own} | {'impulse': 'N s', 'I_n': 'N s'}
        self._swept = [c for c in plan.columns if c != REPEAT]
        self._numeric = [c for c in self._swept if _is_numeric(plan, c)]
        self._effects = effects(plan, rows) if known is None else known

    def charts(self, over: str | None, pareto: Sequence[str] = ()) -> Iterator[Chart]:
        """All that there are; `pareto` are two measures, of which a minus means the greatest."""
        if over or self._numeric:
            yield self.over(over)
        if self._effects:
            yield self.effects()
            yield from self.tornados()
        if pareto:
            yield self.pareto(*pareto)
        yield from self.surfaces()

    def over(self, path: str | None = None) -> Chart:
        """Figures over a swept value, the last one unless given.

        A line for each combination of the others, if they are few. Repetitions are dots beside
        their mean; bars are 95 % confidence intervals of a run.
        """
        path = path or self._numeric[-1]
        lines: dict[str, dict[float, list[Row]]] = {}
        swept = {c: [run.given.get(c) for run, _ in self._done] for c in self._swept}
        for run, row in self._done:
            others = ', '.join(
                f'{_short(k)} {_value(v, swept[k], self.plan, k)}'
                for k, v in run.given.items() if k not in (path, REPEAT)
            )  # fmt: skip
            x = float(run.values[path] or 0.0)
            lines.setdefault(others, {}).setdefault(x, []).append(row)
        if len(lines) > _MOST_LINES:
            merged: dict[float, list[Row]] = {}
            for places in lines.values():
                for x, rows in places.items():
                    merged.setdefault(x, []).extend(rows)
            lines = {'': merged}
        joined = len(lines) > 1 or len(next(iter(lines.values()))) < len(self._done)
        axis, by = self._axis(path)
        panels: list[Panel] = []
        for name in measures_of(self.plan)[:_MOST_PANELS]:
            y, scale = self._measure(name)
            curves = [
                curve
                for k, (label, places) in enumerate(lines.items())
                for curve in _line(places, name, (by, scale), '' if panels else label, k, joined)
            ]
            panels.append(Panel(axis, y, tuple(curves), height=2.4))
        wide = min(3, len(panels))
        return Chart('over', self.plan.title, tuple(panels), columns=wide, width=1.0 + 3.0 * wide)

    def effects(self) -> Chart:
        """Main effects: a row for each measure, a column for each factor, means with errors.

        Bars are two standard errors of a mean; the share is that of the variance which the factor
        explains by itself, and the index that of Sobol where the design gives it.
        """
        known = {(e.measure, e.factor): e for e in self._effects}
        if not known:
            raise InputError('--effects: nothing that is swept changes a measure')
        factors = list(dict.fromkeys(factor for _, factor in known))
        panels = []
        for name in dict.fromkeys(e.measure for e in self._effects):
            y, scale = self._measure(name)
            for factor in factors:
                e = known.get((name, factor))
                levels = e.levels if e else ()
                numbers = all(isinstance(level.x, float | int) for level in levels)
                x, by = self._axis(factor, every=False) if numbers else (Axis(_short(factor)), 1.0)
                at = [by * float(level.x) if numbers else k for k, level in enumerate(levels)]
                mean = np.array([scale * level.mean for level in levels])
                error = np.array([2.0 * scale * level.error for level in levels])
                curve = ChartCurve(
                    np.array(at, float), mean, of=factor, marker='circle', error=error
                )
                said = (
                    f'{100.0 * e.share:.0f} % of variance' if e and math.isfinite(e.share) else ''
                )
                said += f', total index {e.total[0]:.2f}' if e and e.total else ''
                if not numbers:
                    x = Axis(x.words, names=tuple(str(level.x) for level in levels))
                panels.append(Panel(x, y, (curve,), said, height=1.6, scale=y.words))
        wide = 1.2 + 2.1 * len(factors)
        title = self.plan.title
        return Chart('effects', title, tuple(panels), columns=len(factors), width=wide)

    def tornados(self) -> Iterator[Chart]:
        """Yield the means of each measure at the lowest and highest level of each factor."""
        for name in dict.fromkeys(e.measure for e in self._effects):
            found = [e for e in self._effects if e.measure == name]
            found.sort(key=lambda e: abs(e.levels[-1].mean - e.levels[0].mean))
            axis, scale = self._measure(name)
            mean = scale * float(np.mean([number(row, name) for _, row in self._done]))
            curves = []
            for row, e in enumerate(found):
                for level, shade, word in ((0, _LOW, 'lowest'), (-1, _HIGH, 'highest')):
                    ends = np.array([mean, scale * e.levels[level].mean])
                    high = np.full(2, row + 0.36)
                    curves.append(ChartCurve(
                        ends, high, f'{word} value', e.factor, shade, form='area', look='body',
                        low=high - 0.72,
                    ))  # fmt: skip
            names = tuple(self._range(e) for e in found)
            y = Axis('', '', -0.5, len(found) - 0.5, names=names)
            panel = Panel(
                axis, y, tuple(curves), height=1.4 * ROW * (len(found) + 1), marks=(Mark(mean),)
            )
            yield Chart(f'tornado-{name}', f'{name}: effect of each value', (panel,))

    def _range(self, e: Effect) -> str:
        """A factor with its lowest and highest level."""
        ends = [e.levels[k].x for k in (0, -1)]
        low, high = (_value(x, ends, self.plan, e.factor) for x in ends)
        return f'{_short(e.factor)}: {low} to {high}'

    def pareto(self, first: str, second: str) -> Chart:
        """Two measures of all runs; those that no other beats in both are joined."""
        signs, axes, columns = [], [], []
        for text in (first, second):
            name = text.strip().removeprefix('-')
            wrong = f"--pareto: there is no measure '{name}'"
            check_known(name, measures_of(self.plan), wrong, 'measures are')
            axis, scale = self._measure(name)
            signs.append(-1.0 if text.strip().startswith('-') else 1.0)
            axes.append(axis)
            columns.append(scale * np.array([number(row, name) for _, row in self._done]))
        x, y = columns
        front = pareto_front(signs[0] * x, signs[1] * y)
        said = np.array([f'run {run.index}' for run, _ in self._done])
        labels = said[front].tolist() if len(front) <= _MOST_LABELS else ()
        curves = (
            ChartCurve(x, y, 'runs', form='dots', marker='circle-open', notes=said.tolist()),
            ChartCurve(
                x[front], y[front], 'no run is better in both', colour=INK, marker='circle',
                texts=labels, notes=said[front].tolist(),
            ),
        )  # fmt: skip
        return Chart(
            'pareto', self.plan.title, (Panel(axes[0], axes[1], curves, height=4.2),), width=6.5
        )

    def surfaces(self) -> Iterator[Chart]:
        """Response surfaces of each measure over the two values with the largest effects.

        Lines of equal values: of a full grid between its means, else of a quadratic fit to all
        runs, in which the other values have their means.
        """
        for name in dict.fromkeys(e.measure for e in self._effects):
            own = [e for e in self._effects if e.measure == name and e.factor in self._numeric]
            own.sort(key=lambda e: -e.effect)
            if len(own) > 1:
                chart = self._surface(name, own[0].factor, own[1].factor)
                yield from [chart] if chart else []

    def _surface(self, name: str, first: str, second: str) -> Chart | None:
        from contourpy import contour_generator  # noqa: PLC0415 - half a second, with Matplotlib

        (x_axis, x_by), (y_axis, y_by) = (
            self._axis(path, every=False) for path in (first, second)
        )
        axis, scale = self._measure(name)
        values = np.array([scale * number(row, name) for _, row in self._done])
        places = np.array(
            [[float(run.values[c] or 0.0) for c in self._numeric] for run, _ in self._done]
        )
        known = np.isfinite(values)
        i, j = (self._numeric.index(path) for path in (first, second))
        found = response_surface(places[known], values[known], i, j)
        if found is None:
            return None
        x, y, z = found
        levels = np.linspace(z.min(), z.max(), _LEVELS + 2)[1:-1]
        lines = contour_generator(x_by * x, y_by * y, z)
        shown = digits_apart(levels, 3)
        curves = [
            ChartCurve(
                line[:, 0], line[:, 1], of=name, colour=_ramp(k / (_LEVELS - 1)), look='strong',
                texts=[
                    digits(level, shown) if n == len(line) // 2 else '' for n in range(len(line))
                ],
            )
            for k, level in enumerate(levels)
            for line in map(np.asarray, lines.lines(level))
        ]  # fmt: skip
        at = x_by * places[known, i], y_by * places[known, j]
        dots = ChartCurve(at[0], at[1], colour=GROUND, form='dots', look='fine', marker='circle')
        panel = Panel(x_axis, y_axis, (dots, *curves), height=4.2)
        return Chart(f'surface-{name}', f'{axis.title} over two values', (panel,), width=6.5)

    def _measure(self, name: str) -> tuple[Axis, float]:
        """The axis of a figure, and by what its SI values are multiplied."""
        size = max((abs(x) for _, row in self._done if math.isfinite(x := number(row, name))),
                   default=0.0)  # fmt: skip
        unit, scale = for_people(self._units.get(name, ''), size)
        return Axis(_WORDS.get(name, name.replace('_', ' ')), unit), scale

    def _axis(self, path: str, every: bool = True) -> tuple[Axis, float]:
        """The axis of a swept value in the unit of the sweep file, its SI values times the other.

        Parameters
        ----------
        every : write single values if they are few and do not collide
        """
        unit, by = unit_of(self.plan, path)
        words = _short(path)
        at = sorted({by * float(run.values[path] or 0.0) for run, _ in self._done})
        apart = np.diff(at).min() / (at[-1] - at[0]) if len(at) > 1 else 1.0
        if every and len(at) <= _MOST_TICKS and apart > 0.5 / _MOST_TICKS:
            shown = digits_apart(at, 6)
            return Axis(words, unit, names=tuple(digits(x, shown) for x in at), at=tuple(at)), by
        return Axis(words, unit), by


def _is_numeric(plan: SweepPlan, path: str) -> bool:
    """True if a swept value is a number in every run."""
    return all(isinstance(run.values[path], float | int) for run in plan.runs)


def unit_of(plan: SweepPlan, path: str) -> tuple[str, float]:
    """The unit in which a sweep gives a value, and by what SI values are multiplied."""
    si = plan.units.get(path, '')
    texts = [str(run.given.get(path)) for run in plan.runs]
    texts += [factor.text for factor in plan.factors if factor.path == path]
    said = {found[1].strip() for text in texts if (found := _UNIT.search(text))}
    if len(said) == 1:
        unit = said.pop()
        try:
            return unit, 1.0 / to_si(f'1 {unit}', si)
        except (ValueError, KeyError):
            pass
    return for_people(si) if si else ('', 1.0)


def response_surface(
    places: Array, values: Array, i: int, j: int
) -> tuple[Array, Array, Array] | None:
    """Values (m, n) over columns i (n,) and j (m,) of `places` (N, k), the others at their means.

    Means at the nodes of a grid that is complete, else a quadratic function by least squares;
    None of too few runs for it.
    """
    xs, ys = np.unique(places[:, i]), np.unique(places[:, j])
    if len(xs) > 1 and len(ys) > 1 and len(xs) * len(ys) <= len(values):
        at = [[values[(places[:, i] == x) & (places[:, j] == y)] for x in xs] for y in ys]
        if all(len(cell) for row in at for cell in row):
            return xs, ys, np.array([[cell.mean() for cell in row] for row in at])
    mean, half = places.mean(axis=0), np.ptp(places, axis=0) / 2.0
    if not half.all():
        return None
    terms = _quadratic((places - mean) / half)
    if len(values) < 1.5 * terms.shape[1]:
        return None
    fit = np.linalg.lstsq(terms, values, rcond=None)[0]
    fine = 40
    x, y = (np.linspace(places[:, k].min(), places[:, k].max(), fine) for k in (i, j))
    grid = np.zeros((fine * fine, places.shape[1]))
    grid[:, i] = np.tile((x - mean[i]) / half[i], fine)
    grid[:, j] = np.repeat((y - mean[j]) / half[j], fine)
    return x, y, (_quadratic(grid) @ fit).reshape(fine, fine)


def _quadratic(u: Array) -> Array:
    """1, each, and each times each (N, ...)."""
    a, b = np.triu_indices(u.shape[1])
    return np.hstack([np.ones((len(u), 1)), u, u[:, a] * u[:, b]])


def pareto_front(x: Array, y: Array) -> list[int]:
    """The points of which no other has both less, along x."""
    found: list[int] = []
    for k in np.lexsort((y, x)).tolist():
        if math.isfinite(x[k] + y[k]) and (not found or y[k] < y[found[-1]]):
            found.append(k)
    return found


def _line(
    places: Mapping[float, list[Row]], name: str, scales: tuple[float, float], label: str, k: int,
    joined: bool,
) -> Iterator[ChartCurve]:  # fmt: skip
    """Means over places; of several runs at a place each as a dot."""
    by, scale = scales
    xs = np.array(sorted(places))
    each = [[scale * number(row, name) for row in places[x]] for x in xs]
    halves = [[scale * number(row, f'{name}_half_width') for row in places[x]] for x in xs]
    mean = np.array([np.mean(values) for values in each])
    error = np.array([math.hypot(*half) / len(half) for half in halves])
    yield ChartCurve(
        by * xs, mean, label, '', k, k % len(DASHES), form='line' if joined else 'dots',
        marker=MARKERS[k % len(MARKERS)], error=error if np.isfinite(error).any() else None,
    )  # fmt: skip
    if max(map(len, each)) > 1:
        at = np.repeat(by * xs, [len(values) for values in each])
        dots = np.concatenate(each)
        yield ChartCurve(at, dots, colour=k, form='dots', look='fine', marker='circle-open')


def _value(value: Any, others: Iterable[Any], plan: SweepPlan, path: str) -> str:
    """A swept value with its unit, told apart from others; of a design in that of the file."""
    if not isinstance(value, float | int) or isinstance(value, bool):
        return str(value)
    unit, by = unit_of(plan, path)
    numbers = [by * x for x in others if isinstance(x, float | int)]
    return f'{digits(by * value, digits_apart(numbers))} {unit}'.rstrip()


def _short(path: str) -> str:
    """A path in words, without its section."""
    parts = path.split('.')
    return ' '.join(x for x in parts[len(parts) > 2 :] if x != 'clearance').replace('_', ' ')


def _ramp(share: float) -> str:
    """A colour from blue to red."""
    ends = np.array([[0x2A, 0x5B, 0x8A], [0x9A, 0xA1, 0xAA], [0xC4, 0x34, 0x2D]], float)
    return '#' + ''.join(f'{round(np.interp(2.0 * share, range(3), c)):02x}' for c in ends.T)
