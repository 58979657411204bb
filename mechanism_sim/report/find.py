"""What a search for a value found: as text, as JSON, as a picture of the whole curve."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim.export.palette import INK
from mechanism_sim.report.charts.chart import Axis, Chart, Curve, Mark, Panel
from mechanism_sim.strict_json import plain
from mechanism_sim.studies.find import Finding, within_limits
from mechanism_sim.units import for_people


def text(finding: Finding) -> str:
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
        low, high = (scale * x for x in within_limits(finding))
        lines.append(
            f'{finding.goal.name}{wanted} for no {path} between {finding.parameter.low:.6g} and '
            f'{finding.parameter.high:.6g}: of the values tried it goes from {low:.6g} to '
            f'{high:.6g} {unit}'
        )
    lines += [f'  not at {path} = {value:.6g}: {reason}' for value, reason in finding.failed]
    return '\n'.join(lines)


def to_json(finding: Finding) -> dict[str, Any]:
    """The same as JSON, SI units."""
    return {
        'path': finding.parameter.path,
        'measure': finding.goal.name,
        'unit': finding.unit,
        'wanted': finding.wanted,
        'found': [{'value': f.value, 'figure': f.figure, 'jump': f.jump} for f in finding.found],
        'curve': [[x, plain(y)] for x, y in finding.curve],
        'failed': [{'value': value, 'reason': reason} for value, reason in finding.failed],
    }


def chart(finding: Finding, title: str) -> Chart:
    """The figure over the parameter, with what was wanted and found."""
    unit, scale = for_people(finding.unit)
    x, y = np.array(finding.curve).T
    curves = [Curve(x, scale * y, finding.goal.name, marker='circle')]
    if found := finding.found:
        at, figures = (np.array([getattr(f, k) for f in found]) for k in ('value', 'figure'))
        curves.append(
            Curve(at, scale * figures, 'found', '', INK, form='dots', marker='circle-open',
                  texts=[f'{value:.4g}' for value in at])
        )  # fmt: skip
    wanted = finding.wanted
    marks = () if wanted is None else (Mark(scale * wanted, 'wanted', level=True),)
    axis = Axis(finding.parameter.path, 'SI', log=finding.parameter.logarithmic)
    panel = Panel(axis, Axis(finding.goal.name, unit), tuple(curves), marks=marks)
    return Chart('find', title, (panel,))
