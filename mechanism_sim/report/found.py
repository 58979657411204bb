"""Results of `find`, as text, as JSON and as pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from mechanism_sim import text_table
from mechanism_sim.export.palette import INK
from mechanism_sim.report.charts.chart import Axis, Chart, ChartCurve, Mark, Panel
from mechanism_sim.strict_json import plain
from mechanism_sim.studies.find import Finding
from mechanism_sim.studies.goal import GREATEST
from mechanism_sim.studies.optimum import Optimum
from mechanism_sim.studies.parameters import Parameter
from mechanism_sim.studies.synthesis import PathFourBar
from mechanism_sim.studies.trials import EXACT, NONE
from mechanism_sim.units import counted, for_people

_SHOWN = 5  # failures
_MOST = 24  # designs of a front


def text(found: Finding | Optimum) -> str:
    """Format a result as text; values of parameters are in SI units."""
    return _finding_text(found) if isinstance(found, Finding) else _optimum_text(found)


def to_json(found: Finding | Optimum) -> dict[str, Any]:
    """JSON of it, SI units."""
    return _finding_json(found) if isinstance(found, Finding) else _optimum_json(found)


def chart(found: Finding | Optimum, title: str) -> Chart:
    """The figure over the parameter, or the front."""
    return _finding_chart(found, title) if isinstance(found, Finding) else _front(found, title)


def four_bars_text(found: Sequence[PathFourBar]) -> str:
    """A line for each four-bar that takes a path."""
    posed = any(one.orientation for one in found)
    rows = [['rms [mm]', 'largest [mm]', 'ground, crank, coupler, rocker [mm]', 'point [mm]',
             'transmission [deg]', 'branch', *['turned [deg]'] * posed]]  # fmt: skip
    for one in found:
        lengths, point = ([f'{1e3 * x:.6g}' for x in row] for row in (one.lengths, one.point))
        angles = [f'{math.degrees(x):.1f}' for x in one.transmission]
        rows.append([f'{1e3 * one.rms:.4g}', f'{1e3 * one.largest:.4g}', ', '.join(lengths),
                     ', '.join(point), ' to '.join(angles), one.branch,
                     *[f'{math.degrees(one.turned):.4g}'] * posed])  # fmt: skip
    return '\n'.join(text_table.lines(rows, 0))


def four_bars_json(found: Sequence[PathFourBar]) -> dict[str, Any]:
    """JSON of them, SI units."""
    return {'four_bars': [plain(one) for one in found]}


def _finding_text(finding: Finding) -> str:
    unit, scale = for_people(finding.unit)
    key, path, lines = finding.parameter, finding.parameter.path, []
    wanted = '' if finding.wanted is None else f' = {scale * finding.wanted:.9g} {unit}'
    for one in finding.found:
        note = ' (it jumps across the wanted value there)' if one.jump else ''
        if finding.wanted is None and one.value in (finding.curve[0][0], finding.curve[-1][0]):
            less = 'more' if finding.goal.kind == GREATEST else 'less'
            note = f' (the end of the range: it may be {less} beyond)'
        shown = f'{finding.goal.name} = {scale * one.figure:.9g} {unit}'
        span = '' if one.last is None else f' to {_shown(key, one.last)}'
        lines.append(f'{path} = {_shown(key, one.value)}{span}: {shown.rstrip()}{note}')
    if not lines:
        figures = [scale * y for _, y in finding.curve if math.isfinite(y)]
        lines.append(
            f'{finding.goal.name}{wanted} for no {path} between {_shown(key, key.low, 6)} and '
            f'{_shown(key, key.high, 6)}: of the values tried it goes from '
            f'{min(figures):.6g} to {max(figures):.6g} {unit}'
        )
    lines += [
        f'  not at {path} = {_shown(key, value, 6)}: {reason}' for value, reason in finding.failed
    ]
    return '\n'.join(lines)


def _finding_json(finding: Finding) -> dict[str, Any]:
    return {
        'path': finding.parameter.path,
        'measure': finding.goal.name,
        'unit': finding.unit,
        'wanted': finding.wanted,
        'found': plain(finding.found),
        'curve': plain(finding.curve),
        'failed': [{'value': value, 'reason': reason} for value, reason in finding.failed],
        'values': finding.values,
        'measures': finding.measures,
        'evaluations': finding.evaluations,
        'gradients': NONE,
    }


def _optimum_text(found: Optimum) -> str:
    ends, keys = found.ends, {p.path: p for p in found.parameters}
    lines = _front_lines(found) if found.front else []
    lines += [
        f'{path} = {_shown(keys[path], value)}'
        + (' (the end of its range)' if path in ends else '')
        for path, value in found.values.items()
    ]
    for name, figure in found.measures.items():
        wanted = found.wanted[name]
        unit, scale = for_people(found.units[name], abs(figure))
        miss = '' if found.reached or wanted is None else f', wanted {scale * wanted:.9g} {unit}'
        lines.append(f'{name} = {scale * figure:.9g} {unit}{miss}')
    for c in found.constraints:
        unit, scale = for_people(c.unit, max(abs(c.value), abs(c.limit)))
        note = ' (at its limit)' if c.active else ''
        kept = f'holds{note}' if c.holds else 'does not hold'
        lines.append(f'{c.text} {kept}: {scale * c.value:.9g} {unit}')
    broken = [c for c in found.constraints if not c.holds]
    if broken:
        lines.append('no values between the limits were found at which all constraints hold; '
                     'those nearest to it are above')  # fmt: skip
    elif not found.reached:
        lines.append('no values between the limits were found that give what is wanted; the '
                     'nearest are above')  # fmt: skip
    elif len(found.values) > len(found.measures) and None not in found.wanted.values():
        lines.append(
            f'one of many solutions: {len(found.values)} keys are varied for '
            f'{counted(len(found.measures), "measure")}'
        )
    how = {EXACT: '; exact gradients', NONE: ''}.get(found.gradients, '; gradients by differences')
    lines.append(f'{found.evaluations} cycles computed, {len(found.failed)} failed at first{how}')
    for values, reason in found.failed[:_SHOWN]:
        where = ', '.join(
            f'{path} = {_shown(keys[path], value, 6)}' for path, value in values.items()
        )
        lines.append(f'  not at {where}: {reason}')
    return '\n'.join(lines)


def _shown(key: Parameter, value: Any, digits: int = 12) -> str:
    """A value in the unit in which its limits are written."""
    if not isinstance(value, float):
        return str(value)
    return f'{key.scale * value:.{digits}g} {key.unit or key.si}'.rstrip()


def _front_lines(found: Optimum) -> list[str]:
    """A line for each of some designs of a front, evenly from its one end to the other."""
    front, names = found.front, [*found.measures]
    chosen = np.unique(np.linspace(0, len(front) - 1, _MOST).round().astype(int))
    largest = {n: max(abs(d.measures[n]) for d in front) for n in names}
    shown = {n: for_people(found.units[n], largest[n]) for n in names}
    units = {p.path: p.unit or p.si for p in found.parameters}
    keys = [f'{path} [{u}]' if u else path for path, u in units.items()]
    rows = [[*keys, *(f'{n} [{u}]' if u else n for n, (u, _) in shown.items())]]
    for k in chosen:
        figures = [f'{scale * front[k].measures[n]:.6g}' for n, (_, scale) in shown.items()]
        values = [front[k].values[p.path] for p in found.parameters]
        numbers = [
            _shown(replace(p, unit='', si=''), x, 6)
            for p, x in zip(found.parameters, values, strict=True)
        ]
        rows.append([*numbers, *figures])
    some = f', {len(chosen)} of them are' if len(chosen) < len(front) else ''
    lines = [f'front of {len(front)} designs{some}', *text_table.lines(rows, 0)]
    return [*lines, 'nearest to the best of all:']


def _optimum_json(found: Optimum) -> dict[str, Any]:
    keys = (
        'values', 'measures', 'units', 'wanted', 'reached', 'evaluations', 'gradients', 'refused',
    )  # fmt: skip
    failed = [{'values': values, 'reason': reason} for values, reason in found.failed]
    more = {'constraints': [plain(c._asdict()) for c in found.constraints], 'failed': failed}
    front = {'front': [plain(d._asdict()) for d in found.front]} if found.front else {}
    return {key: plain(getattr(found, key)) for key in keys} | more | front


def _front(found: Optimum, title: str) -> Chart:
    """The front between each measure and the next, over all that was tried."""
    tried = {column.name: np.array(column.values, float) for column in found.table
             if column.name in found.measures}  # fmt: skip
    panels = []
    for names in pairwise(found.measures):
        axes, values, every = [], [], []
        for name in names:
            front = np.array([d.measures[name] for d in found.front])
            unit, scale = for_people(found.units[name], float(np.abs(front).max()))
            axes.append(Axis(name, unit))
            values.append(scale * np.append(front, found.measures[name]))
            every.append(scale * tried[name])
        (x, y), (u, v) = values, every
        near = (u < x.max() + 2.0 * np.ptp(x)) & (v < y.max() + 2.0 * np.ptp(y))
        curves = (
            ChartCurve(u[near], v[near], 'tried', colour=1, form='dots', marker='circle-open'),
            ChartCurve(x[:-1], y[:-1], 'front', marker='circle'),
            ChartCurve(x[-1:], y[-1:], 'nearest to the best of all', '', INK, form='dots',
                       marker='circle-open'),
        )  # fmt: skip
        panels.append(Panel(axes[0], axes[1], curves, height=3.2))
    return Chart('front', title, tuple(panels))


def _finding_chart(finding: Finding, title: str) -> Chart:
    """The figure over the parameter, with the target and the solutions."""
    unit, scale = for_people(finding.unit)
    key, (x, y) = finding.parameter, np.array(finding.curve).T
    x = key.scale * x
    curves = [ChartCurve(x, scale * y, finding.goal.name, marker='circle')]
    if found := finding.found:
        at, figures = (np.array([getattr(f, k) for f in found]) for k in ('value', 'figure'))
        at = key.scale * at
        curves.append(
            ChartCurve(at, scale * figures, 'found', '', INK, form='dots', marker='circle-open',
                  texts=[f'{value:.4g}' for value in at])
        )  # fmt: skip
    wanted = finding.wanted
    marks = () if wanted is None else (Mark(scale * wanted, 'wanted', level=True),)
    axis = Axis(key.path, key.unit or key.si, log=key.logarithmic)
    panel = Panel(axis, Axis(finding.goal.name, unit), tuple(curves), marks=marks)
    return Chart('find', title, (panel,))
