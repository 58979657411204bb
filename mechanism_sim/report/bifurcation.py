"""Responses over a parameter: as text, JSON and a chart."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim.report.charts.chart import Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.sections import Section, text
from mechanism_sim.studies.basins import Basins
from mechanism_sim.studies.bifurcation import Bifurcation, Response
from mechanism_sim.units import for_people

_OTHERS = 'no period found'
_COLOURED = 8
"""Periods that have a colour of their own; a longer one shares the last."""


def render(found: Bifurcation) -> str:
    """Text for people: ranges of the parameter in which a branch has one period."""
    unit = f' {found.unit}' if found.unit else ''
    rows = []
    for branch in dict.fromkeys(r.branch for r in found.responses):
        own = [r for r in found.responses if r.branch == branch]
        for first, last, count in _ranges(own):
            low, high = (f'{found.scale * r.value:.6g}{unit}' for r in (first, last))
            period = first.note or (str(first.period) if first.period else 'none found')
            rows.append((branch, low, high, count, period, f'{first.impacts:.4g}'))
    head = 'branch', 'from', 'to', 'values', 'period [turns]', 'impacts a turn there'
    places = [f'{found.scale * x:.6g}' for x in found.coexisting]
    notes = [f'several responses at {", ".join(places)}{unit}'] if places else []
    return text([Section(table=[head, *rows], notes=notes, left=1)])


def _ranges(found: list[Response]) -> list[tuple[Response, Response, int]]:
    """First and last responses of the same period one after the other, and their number."""
    ranges: list[tuple[Response, Response, int]] = []
    for r in found:
        if ranges and (ranges[-1][1].period, ranges[-1][1].note) == (r.period, r.note):
            first, _, count = ranges.pop()
            ranges.append((first, r, count + 1))
        else:
            ranges.append((r, r, 1))
    return ranges


def to_json(found: Bifurcation) -> dict[str, Any]:
    """All sections in SI units: ``measure`` of a point is its quantity ``of``."""
    return {
        'parameter': found.parameter.path,
        'of': list(found.plan.of),
        'units': list(found.units),
        'section': f'impacts.{found.plan.joint}' if found.plan.joint else 'turn',
        'coexisting': found.coexisting,
        'points': [
            {
                'value': r.value,
                'measure': x,
                'of': name,
                'period': r.period or None,
                'branch': r.branch,
                'response': r.number,
            }
            for r in found.responses
            for row in r.points.tolist()
            for name, x in zip(found.plan.of, row, strict=True)
        ],
        'responses': [
            {
                'value': r.value,
                'branch': r.branch,
                'period': r.period or None,
                'response': r.number,
                'impacts_per_turn': r.impacts,
                **({'failed': r.note} if r.note else {}),
            }
            for r in found.responses
        ],
    }


def chart(found: Bifurcation, title: str) -> Chart:
    """Sections over the parameter, coloured by period; branches by their marks."""
    marks = {'up': 'triangle-up', 'down': 'triangle-down', 'start': 'circle'}
    periods = sorted({r.period for r in found.responses}, key=lambda p: (not p, p))
    along = Axis('.'.join(found.parameter.path.split('.')[-3:]), found.unit)
    panels = []
    for k, (unit, words) in enumerate(zip(found.units, found.words, strict=True)):
        size = max(float(np.abs(r.points[:, k]).max(initial=0.0)) for r in found.responses)
        shown, scale = for_people(unit, size)
        curves = []
        for number, period in enumerate(periods):
            for branch, marker in marks.items():
                some = [r for r in found.responses if (r.period, r.branch) == (period, branch)]
                if not some:
                    continue
                x = np.concatenate([np.full(len(r.points), found.scale * r.value) for r in some])
                y = np.concatenate([scale * r.points[:, k] for r in some])
                label = f'period {period}' if period else _OTHERS
                colour = min(number, _COLOURED - 1) if period else '#9aa1aa'
                curves.append(
                    ChartCurve(x, y, f'{label}, {branch}', '', colour, form='dots', marker=marker)
                )
        panels.append(Panel(along, Axis(words, shown), tuple(curves), height=3.2))
    return Chart('bifurcation', title, tuple(panels))


def basins_text(found: Basins) -> str:
    """Kinds of responses, and the share of the places that lead to each."""
    places = [kind for *_, kind in found.cells]
    rows = [
        (str(kind), r.note or str(r.period or 'none found'), f'{r.impacts:.4g}',
         f'{100.0 * places.count(kind) / len(places):.4g} %')
        for kind, r in found.kinds.items()
    ]  # fmt: skip
    return text(
        [Section(table=[('response', 'period [turns]', 'impacts a turn', 'places'), *rows])]
    )


def basins_json(found: Basins) -> dict[str, Any]:
    """Every place in SI units."""
    paths = [p.path for p in found.parameters]
    return {
        'parameters': paths,
        'cells': [
            {
                paths[0]: x,
                paths[1]: y,
                'response': kind,
                'period': r.period or None,
                'impacts_per_turn': r.impacts,
                **({'failed': r.note} if r.note else {}),
            }
            for x, y, r, kind in found.cells
        ],
    }


def basins_chart(found: Basins, title: str) -> Chart:
    """A square for each place, in the colour of the response that it leads to."""
    along, up = (
        Axis('.'.join(p.path.split('.')[-3:]), unit)
        for p, (unit, _) in zip(found.parameters, found.written, strict=True)
    )
    (_, a), (_, b) = found.written
    curves = []
    for kind, r in found.kinds.items():
        some = [(a * x, b * y) for x, y, _, k in found.cells if k == kind]
        x, y = np.array(some).T
        label = f'response {kind}: period {r.period}' if r.period else f'{kind}: {_OTHERS}'
        colour = kind if r.period else '#9aa1aa'
        curves.append(ChartCurve(x, y, label, '', colour, form='dots', marker='square'))
    return Chart('basins', title, (Panel(along, up, tuple(curves), height=4.0),))
