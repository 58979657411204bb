"""Plots of anything over time, or over the angle of the drive; axes say their units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series, instants, sampled
from mechanism_sim.errors import InputError
from mechanism_sim.export.palette import numbers
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.report.charts.lines import OVER_TIME, Abscissa, chart, over_angle
from mechanism_sim.report.figures import paint
from mechanism_sim.report.picture import Picture
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.solution import Piece

TIME = OVER_TIME

_MOST = 100  # lines that axes and legend have room for


def over_angle_of(record: Record) -> Abscissa:
    """Over the angle of the main drive of a recorded run."""
    return _over_angle_of(record.piece, record.machine.main)


def draw(
    series: Sequence[Series], title: str, over: Abscissa = TIME,
    numbers: Mapping[str, int] | None = None, impacts: Sequence[float] = (),
) -> Picture:  # fmt: skip
    """Lines over a common abscissa, as `mechanism_sim.report.charts.lines.chart` has them."""
    if len(series) > _MOST:
        raise InputError(
            f'{len(series)} lines, {series[0].name} to {series[-1].name}, are more than the '
            f'{_MOST} that can be told apart: ask for some of them'
        )
    return paint(chart(series, title, over, numbers or {}, np.array(impacts, np.float64)))


def plot(
    run: Piece | Cycle,
    *names: str,
    against: Literal['time', 'angle', ''] = '',
    start: float | None = None,
    end: float | None = None,
) -> Picture:
    """Plot quantities of a run by their names.

    Parameters
    ----------
    names : of `Piece.sample` or `Cycle`, or the first part of several, such as ``normal_force``;
        without any an overview: angles, gaps with their modes, forces, torque
    against : ``'time'``, or ``'angle'`` of the first drive; of a cycle that repeats its angle
        unless told
    start, end : [s] of the run; all of it unless told
    """
    if against not in ('time', 'angle', ''):
        raise InputError(f"against '{against}': choose 'time' or 'angle'")
    piece = run.solution if isinstance(run, Cycle) else run
    first, last = float(piece.motion.curve.start[0]), piece.motion.curve.end
    if isinstance(run, Cycle):
        first, last = run.t[0], run.t[-1]
    begin, finish = (first if start is None else start), (last if end is None else end)
    if not first <= begin < finish <= last * (1.0 + 1e-12):
        raise InputError(
            f'from {begin:g} s to {finish:g} s is no part of the run, which goes from {first:g} s '
            f'to {last:g} s'
        )
    t = instants(piece, float(begin), min(finish, last))
    wanted = names or _usual(piece)
    series, title = sampled(run, wanted, t, between=True), run.machine.scene.title
    if isinstance(run, Cycle):
        against = against or ('angle' if run.repeats else 'time')
    if not names:
        series = list(_overview(series))
    physics, over = piece.physics, TIME
    if against == 'angle':
        over = _over_angle_of(piece, (*physics.driven, *physics.coordinates)[0])
    own = {name: k for x in (physics.joints, physics.coordinates) for k, name in enumerate(x)}
    if isinstance(run, Cycle):
        own = numbers(run.machine.mechanism)
    struck = [i.t for i in piece.impacts if begin <= i.t <= finish]
    return draw(series, title, over, own, struck)


def _over_angle_of(piece: Piece, drive: str) -> Abscissa:
    if drive in piece.physics.displacements:
        raise InputError(f'{drive} is driven straight, it has no angle')
    return over_angle(piece, drive)


def _usual(piece: Piece) -> list[str]:
    """What is worth seeing of a run."""
    loose = ['gap', 'mode', 'normal_force'] if piece.physics.clearances else []
    forces = ['drive_torque'] if piece.physics.has_forces else []
    if forces and not loose:
        forces = [*(f'reaction.{joint}' for joint in piece.physics.joints), *forces]
    return [*(f'position.{c}' for c in piece.physics.coordinates), *loose, *forces]


def _overview(series: Sequence[Series]) -> Iterator[Series]:
    """Angles within a turn, and of forces their sizes."""
    by_name = {s.name: s for s in series}
    for s in series:
        _, _, joint = s.name.removesuffix('.x').partition('.')
        if not s.name.startswith('reaction.'):
            yield _in_turn(s)
        elif s.name.endswith('.x'):
            y = by_name[f'reaction.{joint}.y']
            yield Series(f'reaction.{joint}', s.unit, s.t, np.hypot(s.values, y.values))


def _in_turn(s: Series) -> Series:
    """An angle that makes turns, within a turn."""
    if s.unit != 'rad' or np.ptp(s.values) < TWO_PI + 1e-6:
        return s
    angle = np.mod(s.values, TWO_PI)
    ends = np.flatnonzero(np.abs(np.diff(angle)) > 0.5 * TWO_PI) + 1
    return Series(s.name, s.unit, np.insert(s.t, ends, s.t[ends]), np.insert(angle, ends, np.nan))
