"""What a search for a value found: as text, as JSON, as a picture of the whole curve."""

from __future__ import annotations

from typing import Any

from mechanism_sim.report.cycle import for_people
from mechanism_sim.report.figures import titled
from mechanism_sim.strict_json import plain
from mechanism_sim.study.find import Finding, within_limits


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


def picture(finding: Finding, title: str) -> Any:
    """The figure over the parameter, with what was wanted and found."""
    unit, scale = for_people(finding.unit)
    figure = titled(title)
    axes = figure.subplots()
    x, y = zip(*finding.curve, strict=True)
    axes.plot(x, [scale * value for value in y], '.-', lw=1.0, ms=4.0)
    if finding.wanted is not None:
        axes.axhline(scale * finding.wanted, color='0.5', lw=0.8, ls='--')
    for one in finding.found:
        axes.plot([one.value], [scale * one.figure], 'o', color='k', mfc='none', ms=8.0)
        axes.annotate(f'{one.value:.4g}', (one.value, scale * one.figure), (6, 6),
                      textcoords='offset points', fontsize=8.0)  # fmt: skip
    if finding.parameter.logarithmic:
        axes.set_xscale('log')
    axes.set_xlabel(f'{finding.parameter.path} (SI units)')
    axes.set_ylabel(f'{finding.goal.name} [{unit}]' if unit else finding.goal.name)
    return figure
