"""Charts of quantities of a run by their names: over the drive, turn upon turn, or over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mechanism_sim.export.palette import numbers
from mechanism_sim.report.charts.chart import Chart
from mechanism_sim.report.charts.charted_run import ChartedRun, ChartWindow
from mechanism_sim.report.charts.lines import OVER_TIME, Abscissa, columns, panels
from mechanism_sim.tolerances import TOLERANCES

_ROUNDING = TOLERANCES.rounding


def quantities(
    charted: ChartedRun,
    key: str,
    title: str,
    names: Sequence[str],
    joint: str = '',
    run: bool = False,
) -> list[Chart]:
    """Quantities in one unit over the drive, and over a long run; none if all are rounding."""
    values = [charted.run.series(name) for name in names]
    if not any(np.abs(s.values).max() > _nothing(charted, s.unit) for s in values):
        return []
    found = [over_drive(charted, key, title, names, joint)]
    if run and charted.turns and charted.long:
        title = f'{title} over {charted.whole}'
        found.append(over_time(charted, f'{key}-run', title, names, joint))
    return found


def _nothing(charted: ChartedRun, unit: str) -> float:
    """Size below which values are rounding, for machines of any size; all forces may be it."""
    size, lines = charted.record.machine.mechanism.size, charted.run.lines
    if unit not in ('N', 'N m'):
        return _ROUNDING.solved * {'m': size, 'rad': 1.0}.get(unit, 0.0)
    forces = [x.values for name, x in lines.items() if charted.run.quantities[name].unit == 'N']
    energy = lines['energy.kinetic'].values
    largest = max(float(np.abs(x).max()) for x in [*forces, energy / size])
    return _ROUNDING.acceleration * largest * (size if unit == 'N m' else 1.0)


def over_drive(
    charted: ChartedRun, key: str, title: str, names: Sequence[str], joint: str = ''
) -> Chart:
    """Quantities in one unit over the angle of the drive in its last turns, their ideal beneath.

    Over time, and all over the run, if the drive makes no turns.
    """
    return _chart(charted, key, title, names, joint, charted.detail, charted.over)


def over_time(
    charted: ChartedRun, key: str, title: str, names: Sequence[str], joint: str = '',
    window: ChartWindow | None = None,
) -> Chart:  # fmt: skip
    """Quantities in one unit over time: of all the run, or of a window of it."""
    window = window or charted.run
    if window is charted.run and charted.long:
        # in a long run each covers earlier ones: the largest are drawn first
        names = sorted(names, key=lambda name: -np.abs(charted.run.lines[name].values).max())
    return _chart(charted, key, title, names, joint, window, OVER_TIME)


def _chart(
    charted: ChartedRun, key: str, title: str, names: Sequence[str], joint: str,
    window: ChartWindow, over: Abscissa,
) -> Chart:  # fmt: skip
    found, ideal = [window.series(name) for name in names], charted.ideal
    if bool(over.span) == bool(charted.turns) and ideal is not None:
        found += [ideal.series(name, ideal=True) for name in names if name in ideal.quantities]
    if not over.span:
        over = over._replace(axis=replace(over.axis, low=window.start, high=window.end))
    t = charted.record.piece.impacts.column('t')
    impact_times = t[(t >= window.start) & (t <= window.end)]
    own = numbers(charted.record.machine.mechanism)
    made = panels(found, over, own, impact_times, charted.run.reach if over.span else {})
    return Chart(key, title, tuple(made), over.kind, joint, columns(made))
