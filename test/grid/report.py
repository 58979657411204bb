"""The grid of valid runs as text and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from test.grid.case import Outcome


def render(outcome: Outcome) -> str:
    """One case that failed."""
    return f'{outcome.name}: {outcome.kind}: {outcome.reason}'


def summary(outcomes: Sequence[Outcome]) -> str:
    """A table of the families, and the totals."""
    lines = []
    for family in dict.fromkeys(o.family for o in outcomes):
        own = [o for o in outcomes if o.family == family]
        runs, worst = _runs(own), max((o.figures.get('residual', 0.0) for o in own), default=0.0)
        lines.append(
            f'  {family:26} {len(runs):4} runs, {sum(not o.ok for o in runs):3} failed, largest '
            f'energy residual {worst:.2g} of what was exchanged'
        )
    count = _counts(outcomes)
    lines.append(
        f'{count["runs"]} runs, {count["failed"]} failed, {count["jams"]} jams confirmed, '
        f'{count["drafts"] - count["runs"]} drafts refused rightly, {count["cpu_time"]:.0f} s CPU'
    )
    kinds = Counter(o.kind for o in outcomes if o.ok is False)
    return '\n'.join([*lines, *(f'  {kind}: {n}' for kind, n in kinds.most_common())])


def to_json(outcomes: Sequence[Outcome]) -> dict[str, object]:
    """Rows ``name, ok, reason`` of the runs, the drafts that were refused rightly, and counts."""
    keys = 'name', 'family', 'ok', 'kind', 'reason'
    return {
        'cases': [
            {**{key: getattr(o, key) for key in keys}, **o.figures} for o in _runs(outcomes)
        ],
        'refused': [{'name': o.name, 'reason': o.reason} for o in outcomes if o.ok is None],
        **_counts(outcomes),
    }


def _runs(outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [o for o in outcomes if o.ok is not None]


def _counts(outcomes: Sequence[Outcome]) -> dict[str, float]:
    runs = _runs(outcomes)
    return {
        'runs': len(runs),
        'failed': sum(not o.ok for o in runs),
        'jams': sum(bool(o.ok and o.reason) for o in runs),
        'drafts': len(outcomes),
        'cpu_time': sum(o.cpu_time for o in outcomes),
    }
