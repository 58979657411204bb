"""The hard cases as text, as JSON and as a table for the documentation."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mechanism_sim import strict_json
from test.hard.case import Figure, Outcome


def render(outcome: Outcome) -> str:
    """One case for people."""
    state = 'ok' if outcome.ok else 'FAILED'
    lines = [f'{outcome.case.name}: {state} ({outcome.cpu_time:.2g} s CPU)']
    lines += [f'  {f.name}: {_value(f)}{_bound(f)}' for f in outcome.figures]
    if outcome.failure:
        lines.append(f'  {outcome.failure}')
    return '\n'.join(lines)


def to_json(outcomes: Sequence[Outcome]) -> dict[str, object]:
    """Rows ``name, figure, bound, ok``, one for each figure of each case."""
    rows: list[dict[str, object]] = []
    for o in outcomes:
        figures = o.figures or (Figure(o.failure, math.nan),)
        rows += [
            {
                'name': o.case.name,
                'measured': f.name,
                'figure': strict_json.plain(f.value),
                'unit': f.unit,
                'bound': strict_json.plain(f.bound),
                'ok': f.ok,
            }
            for f in figures
        ]
    return {'cases': rows}


def markdown(outcomes: Sequence[Outcome]) -> str:
    """The page of the documentation."""
    lines = [
        '# Hard cases',
        '',
        'Where simulators of machines and of contact break. Made by',
        '`python -m test.hard --markdown FILE`; the tests run the same.',
        '',
    ]
    for o in outcomes:
        lines += [f'## {o.case.name}', '', o.case.hard, '', f'*Truth:* {o.case.truth}', '']
        lines += ['| measured | figure | bound |', '|---|---|---|']
        lines += [f'| {f.name} | {_value(f)} | {_limit(f)} |' for f in o.figures]
        lines.append('')
    return '\n'.join(lines)


def _value(f: Figure) -> str:
    return f'{f.value:.4g}{" " + f.unit if f.unit else ""}'


def _limit(f: Figure) -> str:
    return f'{f.bound:g}' if math.isfinite(f.bound) else 'reported'


def _bound(f: Figure) -> str:
    if not math.isfinite(f.bound):
        return ''
    return f' (bound {f.bound:g}{"" if f.ok else ", NOT KEPT"})'
