"""Benchmarks as text, as JSON and as a work-precision picture."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import middleware_report as middleware
from benchmarks.loose_joints import LooseCost, StretchCost
from benchmarks.measure import Measurement, Row
from benchmarks.middleware import Figure
from benchmarks.problem import OURS
from benchmarks.scaling import Cost
from mechanism_sim import output, strict_json, text_table
from mechanism_sim.export.palette import INK
from mechanism_sim.report.charts.chart import DASHES, MARKERS, Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.figures import paint, save

_PREFIXES = ((1.0, 's'), (1e-3, 'ms'), (1e-6, 'us'), (1e-9, 'ns'))
_FLOOR = 1e-16  #: where an error of exactly zero is drawn


def _time(seconds: float) -> str:
    """A duration with a fitting unit."""
    scale, unit = next((p for p in _PREFIXES if abs(seconds) >= p[0]), _PREFIXES[-1])
    return f'{seconds / scale:.3g} {unit}'


def render(found: Measurement, machine: Mapping[str, Any]) -> str:
    """A table for people, and under it what an accuracy costs."""
    p = found.problem
    head = (
        'method', 'setting', f'CPU per {p.unit}', 'median', f'error [{p.error_unit}]', 'steps',
        'impacts', 'prepared in',
    )  # fmt: skip
    table = text_table.lines([head, *map(_cells, found.rows)], 2, '', rule=True)
    failed = [
        f'{row.method.name} at {row.tolerance:g} failed: {row.failure}'
        for row in found.rows
        if row.failure
    ]
    skipped = [f'{name} left out: {reason}' for name, reason in found.skipped.items()]
    return '\n'.join(
        [f'{p.name}: {p.title}', f'reference: {p.reference}', '', *table, '', *failed, *skipped,
         *ratios(found), '', footer(machine)]
    )  # fmt: skip


def _cells(row: Row) -> tuple[str, ...]:
    counts = ['' if x is None else str(x) for x in (row.steps, row.impacts)]
    return (
        row.method.name,
        f'{row.method.setting} {row.tolerance:g}',
        _time(row.fastest),
        _time(row.median),
        f'{row.error:.1e}',
        *counts,
        _time(row.compile_time),
    )


def ratios(found: Measurement) -> list[str]:
    """CPU time of every method against this package's, each at the cheapest setting that serves.

    Two comparisons: at the problem's goal (or the method's own best error if it does not get
    there), and at the method's own best error.
    """
    p, lines = found.problem, []
    names = dict.fromkeys(row.method.name for row in found.rows)
    for name in names:
        theirs = found.cheapest(name, p.goal)
        if theirs is None or name == OURS:
            continue
        ours = found.cheapest(OURS, max(p.goal, theirs.error))
        if ours is None:
            continue
        short = ', its best' if theirs.error > p.goal else ''
        lines.append(
            f'  {name}: {_ratio(theirs.fastest / ours.fastest)} times the CPU of {OURS} '
            f'({_time(theirs.fastest)} at {theirs.error:.1e}{short}, '
            f'{_time(ours.fastest)} at {ours.error:.1e})'
        )
    head = f'cheapest setting with an error of at most {p.goal:g} {p.error_unit}:'
    return [head, *lines] if lines else []


def _ratio(x: float) -> str:
    return f'{x:.2f}' if x < 10 else f'{x:.0f}'


def footer(machine: Mapping[str, Any]) -> str:
    """The machine in a line."""
    libraries = ', '.join(f'{name} {v}' for name, v in machine['libraries'].items())
    return (
        f'{machine["processor"]}, {machine["cores"]} cores, {machine["system"]}, '
        f'Python {machine["python"]}; {libraries}'
    )


class Pages:
    """Output of a benchmark: texts, JSON, and files in a folder if one is given.

    Attributes
    ----------
    found : measurements so far
    text : of each measurement, for people
    """

    def __init__(self, folder: str | None) -> None:
        self.found: list[Measurement] = []
        self.text: list[str] = []
        self._costs: list[Cost] = []
        self._loose: dict[str, object] = {}
        self._figures: list[Figure] = []
        self._folder = Path(folder) if folder else None
        if self._folder:
            output.make_folder(self._folder)

    def add(self, found: Measurement, machine: Mapping[str, Any]) -> None:
        """Add a measurement, and write NAME.svg, NAME.json and NAME.txt."""
        self.found.append(found)
        name = found.problem.name
        self._add(name, render(found, machine), to_json([found], machine))
        if self._folder:
            save(paint(precision_chart(found, machine)), self._folder / f'{name}.svg')

    def add_scaling(self, costs: Sequence[Cost], machine: Mapping[str, Any]) -> None:
        """Add costs by size, and write scaling.svg, scaling.json and scaling.txt."""
        self._costs += costs
        content = {'machine': dict(machine), 'scaling': strict_json.plain(costs)}
        self._add('scaling', render_scaling(costs, machine), content)
        if self._folder:
            save(paint(costs_chart(costs, machine)), self._folder / 'scaling.svg')

    def add_loose_joints(
        self,
        costs: Sequence[LooseCost],
        machine: Mapping[str, Any],
        stretches: Sequence[StretchCost] = (),
        skipped: Mapping[str, str] | None = None,
    ) -> None:
        """Add costs of loose joints, and write loose_joints.json and loose_joints.txt."""
        self._loose = {
            'loose_joints': [asdict(c) | {'cpu_per_event': c.cpu_per_event} for c in costs],
            'stretches': strict_json.plain(list(stretches)),
        }
        left_out = [f'{name} left out: {reason}' for name, reason in (skipped or {}).items()]
        parts = [render_loose_joints(costs), render_stretches(stretches), '\n'.join(left_out)]
        text = '\n\n'.join(part for part in (*parts, footer(machine)) if part)
        self._add('loose_joints', text, {'machine': dict(machine), **self._loose})

    def add_middleware(self, figures: Sequence[Figure], machine: Mapping[str, Any]) -> None:
        """Add figures of the middleware, and write middleware.json and middleware.txt."""
        self._figures += figures
        content = {'machine': dict(machine), 'rows': middleware.to_json(figures)}
        self._add('middleware', f'{middleware.render(figures)}\n\n{footer(machine)}', content)

    def _add(self, name: str, text: str, content: object) -> None:
        self.text.append(text)
        if self._folder:
            data = strict_json.dumps(content, indent=1)
            output.write_text(self._folder / f'{name}.json', data + '\n')
            output.write_text(self._folder / f'{name}.txt', text + '\n')

    def to_json(self, machine: Mapping[str, Any]) -> dict[str, object]:
        """All of it."""
        found = to_json(self.found, machine, middleware.to_json(self._figures))
        found |= {'scaling': strict_json.plain(self._costs)} if self._costs else {}
        return found | self._loose


def listing(listed: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """List of all benchmarks as text."""
    lines = []
    for p in listed['problems']:
        lines.append(f'{p["name"]}: {p["title"]}')
        lines += [
            f'  {m["name"]}' + (f' (left out: {m["missing"]})' if m['missing'] else '')
            for m in p['methods']
        ]
    lines.append('scaling: cost against links, sample rate, sensors and length of the run')
    lines.append('loose_joints: machines by how many of their joints are loose, beside peers')
    lines.append('middleware: messages, round trips and runs of nodes on every middleware found')
    lines.append('all: everything')
    return '\n'.join(lines)


def render_scaling(costs: Sequence[Cost], machine: Mapping[str, Any]) -> str:
    """Costs by size for people."""
    lines = []
    for family in dict.fromkeys(c.family for c in costs):
        lines += [family, f'  {"":>12}  {"CPU time":>20}  peak memory']
        for c in costs:
            if c.family == family:
                memory = '' if c.peak_memory is None else f'{c.peak_memory / 2**20:8.1f} MiB'
                lines.append(
                    f'  {c.size:>12g}  {_time(c.cpu_per_unit) + " per " + c.unit:>20}  {memory}'
                )
    return '\n'.join([*lines, '', footer(machine)])


def render_loose_joints(costs: Sequence[LooseCost]) -> str:
    """Costs of loose joints for people; times one is that of the same machine with the fewest."""
    lines = [f'{"":34}{"CPU per":>11}  {"times":>6}{"CPU per":>11}  {"impacts":>8}{"steps":>8}',
             f'{"machine":<22}{"loose":>5}{"":7}{"revolution":>11}  {"one":>6}{"event":>11}  '
             f'{"in a revolution":>16}']  # fmt: skip
    for c in costs:
        one = next(x for x in costs if x.machine == c.machine and not x.friction)
        lines.append(
            f'{c.machine:<22}{c.loose:>5} {"mu 0.1" if c.friction else "":<6}{_time(c.cpu):>11}  '
            f'{c.cpu / one.cpu:>6.1f}{_time(c.cpu_per_event):>11}  '
            f'{c.impacts:>8.1f}{c.steps:>8.1f}'
        )
    return '\n'.join(lines)


def render_stretches(costs: Sequence[StretchCost]) -> str:
    """Errors and costs until a contact stays closed, for people; nothing if there are none."""
    if not costs:
        return ''
    methods = list(dict.fromkeys(c.method for c in costs))
    rows: dict[tuple[object, ...], dict[str, StretchCost]] = {}
    for c in costs:
        rows.setdefault((c.machine, c.loose, c.friction), {})[c.method] = c
    lines = [
        f'{"until a contact stays closed":<34}{"":17}'
        + ''.join(f'{m:>{20 if m == OURS else 27}}' for m in methods),
        f'{"machine":<22}{"loose":>5}{"":7}{"span":>9}{"impacts":>8}'
        + ''.join(f'{"error [m]":>11}{"CPU":>9}' + f'{"times":>7}' * (m != OURS) for m in methods),
    ]
    for row in rows.values():
        ours = row[OURS]
        line = (
            f'{ours.machine:<22}{ours.loose:>5} {"mu 0.1" if ours.friction else "":<6}'
            f'{_time(ours.duration):>9}{ours.impacts:>8}'
        )
        for c in row.values():
            times = '' if c.method == OURS else f'{_ratio(c.cpu / ours.cpu):>7}'
            line += f'{_error(c):>11}{_time(c.cpu):>9}{times}' if c.cpu > 0.0 else f'{"":27}'
        lines.append(line.rstrip())
    failures = [
        f'{method}, {count} of {len(rows)}: {failure}'
        for (method, failure), count in Counter((c.method, c.failure) for c in costs).items()
        if failure
    ]
    limited = ['+ a finer setting would take too long'] * any(c.limited for c in costs)
    return '\n'.join([*lines, '', *failures, *limited]).rstrip()


def _error(cost: StretchCost) -> str:
    """Rounding alone comes to 1e-15 m."""
    small = '<1e-15' if cost.error < 1e-15 else f'{cost.error:.0e}'
    return small + '+' * cost.limited


def to_json(
    found: Sequence[Measurement],
    machine: Mapping[str, Any],
    more: Sequence[Mapping[str, object]] = (),
) -> dict[str, object]:
    """Rows ``method, tolerance, cpu_per_unit, error, unit`` and more; times in seconds."""
    keys = 'name', 'title', 'reference', 'unit', 'error_unit'
    return {
        'machine': dict(machine),
        'problems': [
            {
                **{key: getattr(m.problem, key) for key in keys},
                'methods': {row.method.name: row.method.how for row in m.rows},
                'skipped': m.skipped,
            }
            for m in found
        ],
        'rows': [*(_row(m, row) for m in found for row in m.rows), *more],
    }


def _row(found: Measurement, row: Row) -> dict[str, object]:
    own = {
        'problem': found.problem.name,
        'method': row.method.name,
        'setting': row.method.setting,
        'cpu_per_unit': row.fastest,
        'cpu_per_unit_median': row.median,
        'repeats': len(row.times),
        'error_unit': found.problem.error_unit,
        'unit': found.problem.unit,
    }
    same = 'tolerance', 'error', 'steps', 'impacts', 'compile_time', 'failure'
    found_json: dict[str, object] = strict_json.plain(own | {k: getattr(row, k) for k in same})
    return found_json


def costs_chart(costs: Sequence[Cost], machine: Mapping[str, Any]) -> Chart:
    """CPU time over size, a panel for each family."""
    panels = []
    for family in dict.fromkeys(c.family for c in costs):
        chosen = [c for c in costs if c.family == family]
        sizes = tuple(float(c.size) for c in chosen)
        times = np.array([c.cpu_per_unit for c in chosen])
        log = times.max() > 5.0 * times.min()
        high = None if log else 1.2 * float(times.max())
        x = Axis(family, log=max(sizes) > 8, names=tuple(f'{n:g}' for n in sizes), at=sizes)
        y = Axis(f'CPU time per {chosen[0].unit}', 's', None if log else 0.0, high, log)
        panels.append(Panel(x, y, (ChartCurve(np.array(sizes), times, family, marker='circle'),)))
    return Chart('scaling', '', tuple(panels), columns=2, width=8.5, note=_short(machine))


def _short(machine: Mapping[str, Any]) -> str:
    return f'{machine["processor"]}, {machine["cores"]} cores, Python {machine["python"]}'


def precision_chart(found: Measurement, machine: Mapping[str, Any]) -> Chart:
    """CPU time over error, a line for each method."""
    p, curves = found.problem, []
    for k, name in enumerate(dict.fromkeys(row.method.name for row in found.rows)):
        rows = [r for r in found.rows if r.method.name == name and math.isfinite(r.error)]
        hollow = '-open' * (k % 2)
        curves.append(
            ChartCurve(
                np.array([max(row.error, _FLOOR) for row in rows]),
                np.array([row.fastest for row in rows]), name, '', INK if name == OURS else k,
                k % len(DASHES), look='strong' if name == OURS else '',
                marker=MARKERS[k % len(MARKERS)] + hollow,
            )
        )  # fmt: skip
    errors = [float(x) for c in curves for x in c.x] or [1.0]
    low, high = 1.5 * max(errors), min(errors) / 1.5
    panel = Panel(
        Axis('error', p.error_unit, low, high, log=True),
        Axis(f'CPU time per {p.unit}', 's', log=True), tuple(curves), height=3.2,
    )  # fmt: skip
    note = f'{_short(machine)}; more exact to the right, cheaper below'
    return Chart('precision', p.title, (panel,), width=8.5, note=note)
