"""Measures in a summary and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mechanism_sim import strict_json
from mechanism_sim.report.sections import Section, SummaryRow
from mechanism_sim.results.measure_accumulators import EXACT
from mechanism_sim.results.measures import Measured
from mechanism_sim.units import for_people, number


def section(found: Sequence[Measured]) -> list[Section]:
    """A table with a line for each measure; nothing without any."""
    return [Section('measures', table=rows(found), left=(0, 2, 3))] if found else []


def rows(found: Sequence[Measured]) -> list[SummaryRow]:
    """A row for each measure, in suitable units."""
    made = []
    for m in found:
        unit, scale = for_people(m.unit, abs(m.value))
        half = f' +- {scale * m.half_width:.2g}' if math.isfinite(m.half_width) else ''
        value = 'none' if math.isnan(m.value) else f'{number(scale * m.value, 6)}{half}'
        said = [m.text] * (m.name != m.text) + [m.resolution] * (m.resolution != EXACT)
        made.append(SummaryRow(m.name, value, unit, '; '.join(said)))
    return made


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
