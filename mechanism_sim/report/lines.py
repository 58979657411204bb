"""Plots of quantities of a run over time, the angle of the drive, or another quantity."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mechanism_sim.analysis.open_run import Asked, AskedSignals
from mechanism_sim.analysis.series import Series, drawn
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import numbers
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.report.charts.chart import Chart
from mechanism_sim.report.charts.lines import OVER_TIME, against_recorded, chart
from mechanism_sim.report.charts.lines import against as over
from mechanism_sim.report.figures import paint
from mechanism_sim.report.picture import Picture
from mechanism_sim.results.catalogue import flat
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.run import Piece, part_of
from mechanism_sim.units import argument

_MOST = 100  # lines that axes and legend have room for


def draw(chart: Chart) -> Picture:
    """A picture of a chart with distinct lines."""
    names = list(dict.fromkeys(c.of for p in chart.panels for c in p.curves if len(c.x)))
    if len(names) > _MOST:
        raise InputError(
            f'{len(names)} lines, {names[0]} to {names[-1]}, are more than the {_MOST} that can '
            'be distinguished: choose some of them'
        )
    return paint(chart)


def plot(
    run: Piece | Cycle,
    *names: str | Sequence[str],
    against: str = '',
    start: float | str | None = None,
    end: float | str | None = None,
) -> Picture:
    """Plot quantities of a run by their names.

    Parameters
    ----------
    names : names of `Piece.sample` or `Cycle`, or the first part of several, as ``normal_force``;
        without any an overview: angles, gaps with their modes, forces, torque
    against : ``'time'``, ``'angle'`` of the first drive, or the name of a quantity: against
        ``position.LINK.POINT.x`` the path of a point is true to scale, against the direction of a
        vector its hodograph is round. Of a cycle that repeats its angle unless told
    start, end : range of the run [s]; default: all of it
    """
    piece = run.solution if isinstance(run, Cycle) else run
    first, last = float(piece.motion.curve.start[0]), piece.motion.curve.end
    if isinstance(run, Cycle):
        first, last = run.t[0], run.t[-1]
        against = against or ('angle' if run.repeats else 'time')
    begin, finish = part_of(float(first), float(last), start, end)
    abscissa = over(run, against or 'time')
    series = drawn(run, [*flat(names)] or [*_usual(piece)], begin, finish)
    if not names:
        series = [_in_turn(s) for s in series]
    t = piece.impacts.column('t')
    impact_times = t[(begin <= t) & (t <= finish)]
    own = numbers(run.machine.mechanism)
    return draw(chart(series, run.machine.scene.title, abscissa, own, impact_times))


def plot_recorded(
    asked: Asked | AskedSignals,
    *names: str | Sequence[str],
    against: str = 'time',
    start: float | str | None = None,
    end: float | str | None = None,
) -> Picture:
    """Plot numbers of a bag of another program or of a file of signals, as `plot`."""
    run = asked if isinstance(asked, AskedSignals) else asked.messages
    assert run is not None  # noqa: S101 - of other bags there is a run
    part = argument('start', start, 's'), argument('end', end, 's')
    series = asked.series([*flat(names)] or run.usual, *part)
    given = None if against == 'time' else asked.recorded(against)
    return draw(
        chart(series, run.path.name, against_recorded(given, series) if given else OVER_TIME)
    )


def _usual(piece: Piece) -> Iterator[str]:
    """The quantities of an overview: angles, and contacts or else joint forces, and drives."""
    physics = piece.physics
    yield from (f'position.{c}' for c in physics.coordinates)
    if physics.clearances:
        yield from ('gap', 'mode', 'normal_force')
    elif physics.has_forces:
        yield from (f'reaction.{joint}.size' for joint in physics.joints)
    if physics.has_forces:
        yield 'drive_torque'


def _in_turn(s: Series) -> Series:
    """An angle that makes turns, within a turn."""
    if s.unit != 'rad' or np.ptp(s.values) < TWO_PI + 1e-6:
        return s
    angle = np.mod(s.values, TWO_PI)
    ends = np.flatnonzero(np.abs(np.diff(angle)) > 0.5 * TWO_PI) + 1
    t, values = np.insert(s.t, ends, s.t[ends]), np.insert(angle, ends, np.nan)
    return replace(s, t=t, values=values)
