"""Studies as text, as JSON and as pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mechanism_sim.export.palette import INK
from mechanism_sim.report.charts.chart import Axis, Chart, ChartCurve, Mark, Panel
from mechanism_sim.strict_json import plain
from mechanism_sim.units import for_people

if TYPE_CHECKING:  # each is slow to load, and a command needs but one
    from mechanism_sim.studies.adjustment import Adjustment
    from mechanism_sim.studies.find import Finding
    from mechanism_sim.studies.identification import Result
    from mechanism_sim.studies.lift_off import LiftOff
    from mechanism_sim.studies.periodic import PeriodicResponse
    from mechanism_sim.studies.statistics import Statistics

_MEAN = 'mean', 'half_width', 'unit'
_UNLIKE = 0.01  # of the simulations
_SHOWN = 5  # failures
_STABLE = {
    True: 'stable',
    False: 'unstable',
    None: 'stable or not is not known: a multiplier has the size 1 but for its error',
}


def periodic(response: PeriodicResponse) -> str:
    """A periodic response for people."""
    sizes = ', '.join(f'{abs(m):.4g}' for m in response.multipliers)
    unit, scale = for_people('N s', response.impulse)
    return '\n'.join(
        [
            f'repeats every {response.period} revolutions, to {response.residual:.2g}; '
            f'{_STABLE[response.stable]}',
            f'  {response.impacts} impacts, {scale * response.impulse:.6g} {unit} in a period',
            f'  Floquet multipliers of size {sizes} (to {response.spread:.2g})'
            if sizes
            else '  no Floquet multipliers: closed contacts leave nothing free once a period',
        ]
    )


def periodic_json(response: PeriodicResponse | None) -> dict[str, object]:
    """JSON of it; a machine that does not repeat has ``period: null``."""
    if response is None:
        return {'period': None}
    keys = 'period', 'residual', 'stable', 'impacts', 'impulse'
    return {key: getattr(response, key) for key in keys} | {
        'position': list(response.state.q),
        'velocity': list(response.state.v),
        'multipliers': [[m.real, m.imag] for m in response.multipliers],
        'spread': response.spread,
    }


def statistics(found: Statistics) -> str:
    """Means for people."""
    kept = found.revolutions - found.skipped
    lines = [f'{kept} revolutions after {found.skipped}; a revolution:']
    for m in found.means:
        line = f'  {m.name.replace("_", " "):18} {m.mean:12.6g} +- {m.half_width:.2g} {m.unit}'
        lines.append(line.rstrip())
    lines.append(
        f'  I_n (impulse per impact) {found.I_n:.6g} +- {found.I_n_half_width:.2g} N s'
        if math.isfinite(found.I_n)
        else '  no impacts'
    )
    for m in found.measures:
        unit, scale = for_people(m.unit, abs(m.mean))
        lines.append(f'  {m.name}  {m.shown(scale)} {unit}'.rstrip())
    return '\n'.join(lines)


def statistics_json(found: Statistics) -> dict[str, object]:
    """JSON of it."""
    keys = 'revolutions', 'skipped', 'I_n', 'I_n_half_width'
    rows = {'means': found.means, 'measures': found.measures}
    return {key: plain(getattr(found, key)) for key in keys} | {
        kind: {m.name: {k: plain(getattr(m, k)) for k in _MEAN} for m in means}
        for kind, means in rows.items()
    }


def lift_offs(found: Sequence[LiftOff]) -> str:
    """As text."""
    lines = []
    for x in found:
        where = f'at {_degrees(x.least_force_at)} of the drive'
        lines.append(f'{x.joint}: least contact force {x.least_force:.6g} N, {where}')
        if x.lift_off_speed is None or x.lift_off_at is None:
            force = 'never' if x.least_force > 0.0 else 'at any speed'
            lines.append(f'  contact is lost {force}, of the speeds that were tried')
            continue
        rpm = x.lift_off_speed * 30.0 / math.pi
        lines.append(
            f'  contact is lost from {x.lift_off_speed:.9g} rad/s ({rpm:.7g} rpm) on, first at '
            f'{_degrees(x.lift_off_at)}'
        )
    return '\n'.join(lines)


def _degrees(angle: float) -> str:
    return f'{math.degrees(angle) % 360.0:.6g} deg'


def finding_text(finding: Finding) -> str:
    """For people; values of the parameter are in SI units."""
    unit, scale = for_people(finding.unit)
    path, lines = finding.parameter.path, []
    wanted = '' if finding.wanted is None else f' = {scale * finding.wanted:.6g} {unit}'
    for one in finding.found:
        note = ' (it steps across the wanted value there)' if one.jump else ''
        if finding.wanted is None and one.value in (finding.curve[0][0], finding.curve[-1][0]):
            note = ' (the end of the range: it may be less beyond)'
        shown = f'{finding.goal.name} = {scale * one.figure:.9g} {unit}'
        lines.append(f'{path} = {one.value:.12g}: {shown}{note}')
    if not lines:
        figures = [scale * y for _, y in finding.curve if math.isfinite(y)]
        lines.append(
            f'{finding.goal.name}{wanted} for no {path} between {finding.parameter.low:.6g} and '
            f'{finding.parameter.high:.6g}: of the values tried it goes from '
            f'{min(figures):.6g} to {max(figures):.6g} {unit}'
        )
    lines += [f'  not at {path} = {value:.6g}: {reason}' for value, reason in finding.failed]
    return '\n'.join(lines)


def finding_json(finding: Finding) -> dict[str, Any]:
    """JSON of it, SI units."""
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
    }


def adjustment_text(found: Adjustment) -> str:
    """For people; values of the parameters are in SI units."""
    ends = found.ends
    lines = [
        f'{path} = {value:.12g}' + (' (the end of its range)' if path in ends else '')
        for path, value in found.values.items()
    ]
    for name, figure in found.measures.items():
        wanted = found.wanted[name]
        unit, scale = for_people(found.units[name], abs(figure))
        miss = '' if found.reached or wanted is None else f', wanted {scale * wanted:.9g} {unit}'
        lines.append(f'{name} = {scale * figure:.9g} {unit}{miss}')
    if not found.reached:
        lines.append('no values between the limits were found that give what is wanted; the '
                     'nearest are above')  # fmt: skip
    elif len(found.values) > len(found.measures) and None not in found.wanted.values():
        lines.append(
            f'one of many: {len(found.values)} keys are varied for {len(found.measures)} '
            f'measure{"s" * (len(found.measures) > 1)}'
        )
    lines.append(f'{found.evaluations} cycles computed, {len(found.failed)} failed at first')
    for values, reason in found.failed[:_SHOWN]:
        where = ', '.join(f'{path} = {value:.6g}' for path, value in values.items())
        lines.append(f'  not at {where}: {reason}')
    return '\n'.join(lines)


def adjustment_json(found: Adjustment) -> dict[str, Any]:
    """JSON of it, SI units."""
    keys = 'values', 'measures', 'units', 'wanted', 'reached', 'evaluations'
    failed = [{'values': values, 'reason': reason} for values, reason in found.failed]
    return {key: plain(getattr(found, key)) for key in keys} | {'failed': failed}


def finding_chart(finding: Finding, title: str) -> Chart:
    """The figure over the parameter, with what was wanted and found."""
    unit, scale = for_people(finding.unit)
    x, y = np.array(finding.curve).T
    curves = [ChartCurve(x, scale * y, finding.goal.name, marker='circle')]
    if found := finding.found:
        at, figures = (np.array([getattr(f, k) for f in found]) for k in ('value', 'figure'))
        curves.append(
            ChartCurve(at, scale * figures, 'found', '', INK, form='dots', marker='circle-open',
                  texts=[f'{value:.4g}' for value in at])
        )  # fmt: skip
    wanted = finding.wanted
    marks = () if wanted is None else (Mark(scale * wanted, 'wanted', level=True),)
    axis = Axis(finding.parameter.path, 'SI', log=finding.parameter.logarithmic)
    panel = Panel(axis, Axis(finding.goal.name, unit), tuple(curves), marks=marks)
    return Chart('find', title, (panel,))


def unlike(found: Result) -> bool:
    """True if hardly any simulation is as far from what is expected as the signal is."""
    return found.likeness < _UNLIKE


def fit_text(found: Result) -> str:
    """For people; in SI units."""
    lines = [f'{found.simulations} simulations, {found.failed} failed; all together with 95 %:']
    for e in found.estimates:
        note = '' if e.identified else '   the signal does not tell'
        if e.identified and not (e.parameter.low < e.low and e.high < e.parameter.high):
            note = '   at the limit of its range: widen it'
        interval = f'{e.low:.5g} to {e.high:.5g}'
        lines.append(f'  {e.parameter.name:12} {e.value:11.5g}   {interval}{note}')
    pairs = [
        (abs(found.correlation[i, j]), i, j) for i in range(len(found.estimates)) for j in range(i)
    ]
    for size, i, j in sorted(pairs, reverse=True):
        if size > 0.5:
            names = [found.estimates[k].parameter.name for k in (j, i)]
            lines.append(f'  errors of {" and ".join(names)}: correlation '
                         f'{found.correlation[i, j]:.2f}')  # fmt: skip
    lines.append(
        f'misfit {found.misfit:.2f} standard deviations, as much as that of '
        f'{100.0 * found.likeness:.0f} % of the simulations'
    )
    if unlike(found):
        lines.append(
            'no simulation is like this signal: the machine, its chain or its noise is not that '
            'of the scene, and the values above are not to be trusted'
        )
    return '\n'.join(lines)


def fit_json(found: Result) -> dict[str, object]:
    """JSON of it."""
    return {
        'parameters': {
            e.parameter.name: {
                'path': e.parameter.path,
                'value': e.value,
                'low': e.low,
                'high': e.high,
                'range': [e.parameter.low, e.parameter.high],
                'identified': e.identified,
            }
            for e in found.estimates
        },
        'correlation': plain(found.correlation.tolist()),
        **{k: getattr(found, k) for k in ('simulations', 'failed', 'misfit', 'likeness')},
        'plausible': not unlike(found),
    }
