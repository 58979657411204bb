"""The largest loads of a run and how long they last, as rows for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from mechanism_sim.analysis.summary import LoadPeak, LoadSummary
from mechanism_sim.units import number, written

SHARE = 0.999
"""Of the time: the load that is not exceeded meanwhile stands beside the largest one."""

_BRIEF = 1.5  # times the load of that share: what is larger is a peak


def load_rows(
    drive: str, loads: LoadSummary, levels: Mapping[str, float] | None = None
) -> list[tuple[str, ...]]:
    """Table of the largest loads, the head first.

    Parameters
    ----------
    drive : the coordinate whose angle is told
    levels : loads not exceeded in `SHARE` of the time [N, N m] by the names in `loads`
    """
    units = [(peak, 'N') for peak in loads.joints]
    units += [(peak, 'N m') for peak in (loads.drive_torque, *loads.moments)]
    rows = [(*_row(peak, unit), *_level(peak, unit, levels)) for peak, unit in units]
    columns = 6 if any(row[4] for row in rows) else 4
    held = [f'{100.0 * SHARE:g} % of the time at most'] if levels is not None else []
    head = 'joint', 'largest', 'at [s]', drive, 'above half for', 'impulse', *held
    return [row[:columns] + row[6:] for row in (head, *rows)]


def _row(peak: LoadPeak, unit: str) -> tuple[str, ...]:
    angle = '' if peak.crank_angle is None else f'{math.degrees(peak.crank_angle):.4g} deg'
    first = peak.name, written(peak.value, unit), number(peak.time, 6), angle
    if peak.duration is None or peak.impulse is None:
        return *first, '', ''
    least = '' if peak.whole else '>= '
    lasts, impulse = written(peak.duration, 's'), written(peak.impulse, f'{unit} s')
    return *first, f'{least}{lasts}', f'{least}{impulse}'


def _level(peak: LoadPeak, unit: str, levels: Mapping[str, float] | None) -> tuple[str, ...]:
    if levels is None:
        return ()
    return (written(levels[peak.name], unit) if peak.name in levels else '',)


def peaks_of(loads: LoadSummary, levels: Mapping[str, float]) -> Iterator[str]:
    """A clause for each largest load that is but a peak: how long it lasts, what it carries."""
    for peak, unit in [(x, 'N') for x in loads.joints] + [(loads.drive_torque, 'N m')]:
        level = levels.get(peak.name, math.inf)
        if abs(peak.value) > _BRIEF * level and peak.whole and peak.duration and peak.impulse:
            yield (
                f'{peak.name}: a peak of {written(peak.duration, "s")} with '
                f'{written(peak.impulse, f"{unit} s")}, {written(abs(peak.value), unit)} high; '
                f'for {100.0 * SHARE:g} % of the time at most {written(level, unit)}'
            )
