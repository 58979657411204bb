"""Measures as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mechanism_sim import strict_json, text_table
from mechanism_sim.results.measures import Measured
from mechanism_sim.results.time_integrals import EXACT
from mechanism_sim.units import for_people


def lines(found: Sequence[Measured], indent: str = '  ') -> list[str]:
    """A line for each measure, in the units in which people read; nothing without any."""
    if not found:
        return []
    rows = []
    for m in found:
        unit, scale = for_people(m.unit, abs(m.value))
        said = [m.text] * (m.name != m.text) + [m.resolution] * (m.resolution != EXACT)
        value = 'none' if math.isnan(m.value) else f'{scale * m.value:.6g}{_interval(m, scale)}'
        rows.append((m.name, value, unit, '; '.join(said)))
    kept = text_table.lines(rows, (0, 2, 3), indent + '  ')
    return [f'{indent}measures', *kept]


def _interval(m: Measured, scale: float) -> str:
    """Of a mean over revolutions."""
    return f' +- {scale * m.half_width:.2g}' if math.isfinite(m.half_width) else ''


def rows(found: Sequence[Measured]) -> tuple[tuple[str, str], ...]:
    """Pairs of words and value, for a page."""
    pairs = []
    for m in found:
        unit, scale = for_people(m.unit, abs(m.value))
        what = m.name if m.name == m.text else f'{m.name}: {m.text}'
        value = 'none'
        if not math.isnan(m.value):
            value = f'{scale * m.value:.6g}{_interval(m, scale)} {unit}'.rstrip()
        pairs.append((what, value if m.resolution == EXACT else f'{value} ({m.resolution})'))
    return tuple(pairs)


def to_json(found: Sequence[Measured]) -> dict[str, object]:
    """The key ``measures``: value in SI units, unit, text and resolution by name."""
    if not found:
        return {}
    return {
        'measures': {
            m.name: {
                'value': strict_json.plain(m.value),
                'unit': m.unit,
                'text': m.text,
                'resolution': m.resolution,
                **({'half_width': m.half_width} if math.isfinite(m.half_width) else {}),
            }
            for m in found
        }
    }
