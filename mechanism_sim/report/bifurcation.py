"""Responses over a parameter: as text, JSON and a chart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from mechanism_sim.report.charts.chart import Axis, Chart, ChartCurve, Panel
from mechanism_sim.report.sections import Section, text
from mechanism_sim.studies.basins import Basins
from mechanism_sim.studies.bifurcation import Bifurcation, Response
from mechanism_sim.studies.continuation import ResponseBranch
from mechanism_sim.units import for_people

_OTHERS, _CONVERGES = 'no period found', 'not settled'
_COLOURED = 8  # periods that have a colour of their own; a longer one shares the last


def render(result: tuple[Bifurcation, Sequence[ResponseBranch]]) -> str:
    """Ranges of the parameter in which a branch has one period, as text."""
    found, branches = result
    unit = f' {found.unit}' if found.unit else ''
    rows, failed = [], []
    for branch in dict.fromkeys(r.branch for r in found.responses):
        own = [r for r in found.responses if r.branch == branch]
        for first, last, count in _ranges(own):
            low, high = (f'{found.scale * r.value:.6g}{unit}' for r in (first, last))
            rows.append((branch, low, high, count, told(first), _impacts(first)))
            if first.note:
                place = ' to '.join(dict.fromkeys((low, high)))
                failed.append(f'{branch}, {place}: {first.note}')
    head = 'branch', 'from', 'to', 'values', 'period [turns]', 'impacts a turn there'
    values, several = sorted({r.value for r in found.responses}), {*found.coexisting}
    stretches = [[*group] for one, group in groupby(values, several.__contains__) if one]
    places = [
        ' to '.join(f'{found.scale * x:.6g}' for x in dict.fromkeys((group[0], group[-1])))
        for group in stretches
    ]
    notes = [*failed, *([f'several responses at {", ".join(places)}{unit}'] if places else [])]
    for followed in branches:
        ends = sorted(p.value for p in followed.points)
        low, high = (f'{found.scale * x:.9g}{unit}' for x in (ends[0], ends[-1]))
        share = sum(p.stable for p in followed.points) / len(followed.points)
        notes.append(
            f'branch of period {followed.period} from {low} to {high}, {100.0 * share:.0f} % of '
            'its points stable'
        )
        notes += [
            f'  {e.kind} at {found.scale * e.value:.9g}{unit}{f" in {e.joint}" * bool(e.joint)}'
            for e in followed.events
        ]
    return text([Section(table=[head, *rows], notes=notes, left=1)])


def told(response: Response) -> str:
    """The period of a response, or that there is none, or that it is not known yet."""
    if response.note:
        return 'no run'
    if not response.settled:
        return 'not settled'
    return str(response.period) if response.period else 'none found'


def _impacts(response: Response) -> str:
    """Impacts a turn, where there was a run."""
    return '-' if response.note else f'{response.impacts:.4g}'


def _ranges(found: list[Response]) -> list[tuple[Response, Response, int]]:
    """First and last responses of the same period one after the other, and their number."""
    ranges: list[tuple[Response, Response, int]] = []
    for r in found:
        if ranges and (told(ranges[-1][1]), ranges[-1][1].note) == (told(r), r.note):
            first, _, count = ranges.pop()
            ranges.append((first, r, count + 1))
        else:
            ranges.append((r, r, 1))
    return ranges


def to_json(result: tuple[Bifurcation, Sequence[ResponseBranch]]) -> dict[str, Any]:
    """All sections in SI units: ``measure`` of a point is its quantity ``of``."""
    found, branches = result
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
                'settled': r.settled,
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
                'impacts_per_turn': None if r.note else r.impacts,
                'settled': r.settled,
                **({'failed': r.note} if r.note else {}),
            }
            for r in found.responses
        ],
        'branches': [
            {
                'period': branch.period,
                'events': [e._asdict() for e in branch.events],
                'points': [
                    {
                        'value': p.value,
                        'measure': p.points.tolist(),
                        'stable': p.stable,
                        'multipliers': [[m.real, m.imag] for m in p.multipliers],
                        'impacts': p.impacts,
                    }
                    for p in branch.points
                ],
            }
            for branch in branches
        ],
    }


def chart(found: Bifurcation, title: str, branches: Sequence[ResponseBranch] = ()) -> Chart:
    """Sections over the parameter, coloured by period; directions by marks, branches as lines."""
    marks = {'up': 'triangle-up', 'down': 'triangle-down', 'start': 'circle'}
    ran = [r for r in found.responses if not r.note]
    kinds = sorted({(r.period, r.settled) for r in ran}, key=lambda x: (not x[0], *x))
    periods = [period for period, _ in kinds]
    along = Axis('.'.join(found.parameter.path.split('.')[-3:]), found.unit)
    panels = []
    for k, (words, (shown, scale)) in enumerate(zip(found.words, scales(found), strict=True)):
        curves = []
        for number, (period, settled) in enumerate(kinds):
            for branch, marker in marks.items():
                own = period, settled, branch
                some = [r for r in ran if (r.period, r.settled, r.branch) == own]
                if not some:
                    continue
                x = np.concatenate([np.full(len(r.points), found.scale * r.value) for r in some])
                y = np.concatenate([scale * r.points[:, k] for r in some])
                label = f'period {period}' if period else _OTHERS if settled else _CONVERGES
                colour = min(number, _COLOURED - 1) if period else '#9aa1aa'
                curves.append(
                    ChartCurve(x, y, f'{label}, {branch}', '', colour, form='dots', marker=marker)
                )
        for followed in branches:
            number = min(periods.index(followed.period), _COLOURED - 1)
            curves += _lines(found, followed, k, scale, number)
        panels.append(Panel(along, Axis(words, shown), tuple(curves), height=3.2))
    return Chart('bifurcation', title, tuple(panels), 'value')


def scales(found: Bifurcation) -> list[tuple[str, float]]:
    """Unit in which each quantity of the section is drawn, and the size of 1 SI unit in it."""
    sizes = [
        max(float(np.abs(r.points[:, k]).max(initial=0.0)) for r in found.responses)
        for k in range(len(found.units))
    ]
    return [for_people(unit, size) for unit, size in zip(found.units, sizes, strict=True)]


def _lines(
    found: Bifurcation, branch: ResponseBranch, k: int, scale: float, colour: int
) -> Iterator[ChartCurve]:
    """Each turn of a branch as a line: where it is stable, and dashed where it is not."""
    x = np.array([found.scale * p.value for p in branch.points])
    stable = np.array([p.stable for p in branch.points])
    count = max(len(p.points) for p in branch.points)
    y = np.full((count, len(x)), np.nan)
    for j, p in enumerate(branch.points):
        y[: len(p.points), j] = scale * p.points[:, k]
    for kind, shown, dash in (('stable', stable, 0), ('unstable', ~stable, 1)):
        # up to the neighbours, so that lines meet
        wide = shown | (np.append(shown[1:], False) | np.append(False, shown[:-1])) & bool(dash)
        if shown.any():
            for row in y:
                label = f'period {branch.period}, {kind}'
                yield ChartCurve(x, np.where(wide, row, np.nan), label, '', colour, dash)


def basins_text(found: Basins) -> str:
    """Kinds of responses, and the share of the places that lead to each."""
    places = [kind for *_, kind in found.cells]
    rows = [
        (str(kind), told(r), _impacts(r), f'{100.0 * places.count(kind) / len(places):.4g} %')
        for kind, r in found.kinds.items()
    ]  # fmt: skip
    head = 'response', 'period [turns]', 'impacts a turn', 'places'
    why = [f'response {kind}: {r.note}' for kind, r in found.kinds.items() if r.note]
    return text([Section(table=[head, *rows], notes=why)])


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
                'impacts_per_turn': None if r.note else r.impacts,
                'settled': r.settled,
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
        none = 'no run' if r.note else _OTHERS if r.settled else _CONVERGES
        label = f'response {kind}: period {r.period}' if r.period else f'{kind}: {none}'
        colour = kind if r.period else '#d5d9de' if r.note else '#9aa1aa'
        curves.append(ChartCurve(x, y, label, '', colour, form='dots', marker='square'))
    return Chart('basins', title, (Panel(along, up, tuple(curves), height=4.0),))
