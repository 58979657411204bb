"""Trains that were found for a ratio, as text and as JSON."""

from __future__ import annotations

from mechanism_sim import text_table
from mechanism_sim.studies.teeth import TrainSearch
from mechanism_sim.units import counted

#: rows of text; JSON has all
SHOWN = 20


def render(search: TrainSearch) -> str:
    """The best choices as a table, their number, and the searched range."""
    found = search.found
    rows = [('teeth', 'ratio', '', 'error', 'in all')]
    for choice in found[:SHOWN]:
        stages = '  '.join(map(str, choice.stages))
        error = f'{choice.error:+.3e}' if choice.error else 'exact'
        exact = str(choice.ratio) if choice.ratio.denominator > 1 else ''
        rows.append((stages, f'{float(choice.ratio):.9g}', exact, error, str(choice.teeth)))
    trains = f'{counted(len(found), "train")} found'
    if found[SHOWN:]:
        trains += f', the first {SHOWN} are shown'
    beside = [f'just outside: {search.outside}'] if search.outside else []
    searched = f'searched: {search.limits}'
    return '\n'.join([*text_table.lines(rows, 3, ''), trains, searched, *beside])


def to_json(search: TrainSearch) -> dict[str, object]:
    """All of them; modules in metres."""
    found, outside = search.found, search.outside
    return {
        'limits': search.limits,
        'just_outside': outside and outside._asdict(),
        'count': len(found),
        'choices': [
            {
                'stages': [stage._asdict() for stage in choice.stages],
                'ratio': float(choice.ratio),
                'exact_ratio': str(choice.ratio),
                'error': choice.error,
                'teeth': choice.teeth,
            }
            for choice in found
        ],
    }
