"""Trains that were found for a ratio, as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim import text_table
from mechanism_sim.gears.teeth import Choice, Stage

#: rows for people; JSON has all
SHOWN = 20


def render(found: Sequence[Choice]) -> str:
    """The best ones as a table, and how many there are."""
    rows = [('teeth', 'ratio', '', 'error', 'in all')]
    for choice in found[:SHOWN]:
        stages = '  '.join(map(_stage, choice.stages))
        error = f'{choice.error:+.3e}' if choice.error else 'exact'
        exact = str(choice.ratio) if choice.ratio.denominator > 1 else ''
        rows.append((stages, f'{float(choice.ratio):.9g}', exact, error, str(choice.teeth)))
    trains = f'{len(found)} train{"s" if len(found) > 1 else ""} found'
    if found[SHOWN:]:
        trains += f', the first {SHOWN} are shown'
    return '\n'.join([*text_table.lines(rows, 3, ''), trains])


def to_json(found: Sequence[Choice]) -> dict[str, object]:
    """All of them; modules in metres."""
    return {
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


def _stage(stage: Stage) -> str:
    module = '' if stage.module is None else f' ({1e3 * stage.module:g} mm)'
    return f'{stage.driver}:{stage.driven}{module}'
