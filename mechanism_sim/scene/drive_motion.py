"""Prescribed motions of drives as laws: by formulas, tables, splines and moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice, pairwise, takewhile

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names
from mechanism_sim.numerics.time_series import TimeSeries
from mechanism_sim.planar.drive import DriveLaw, curve_laws, speed_profile
from mechanism_sim.planar.endless_laws import FormulaLaws, LawSource, RepeatedLaws, unrolled
from mechanism_sim.scene.motion_keys import (
    CoursePart,
    MovePart,
    MovesPart,
    SpeedPart,
)

_AHEAD, _MOST = 10.0, 256
"""[s] of motions without end that are looked at beforehand if a scene has no duration, and pieces
at most."""

Motion = tuple[tuple[DriveLaw, ...], LawSource | None]
"""Laws in the order in which they take over, and what goes on behind them."""

_UNITS = ('rad', 'm'), ('rad/s', 'm/s'), ('rad/s^2', 'm/s^2'), ('rad/s^3', 'm/s^3')


def course_laws(
    names: Names, where: str, course: CoursePart, start: DriveLaw, straight: bool
) -> Motion:
    """The laws of a coordinate by its position or its speed over time.

    Parameters
    ----------
    start : where a coordinate whose speed is given is at time zero
    """
    rate = isinstance(course, SpeedPart)
    if course.unit and (course.unit.startswith('m') != straight):
        kind = 'slides' if straight else 'turns'
        raise InputError(
            f'{where} is in {course.unit}, but {start.coordinate} {kind}: give it in '
            f'{course.units()[straight]}'
        )
    if course.formula is not None:
        series = TimeSeries(course.tree(), course.formula)
        try:
            laws = FormulaLaws(start.coordinate, series, straight, rate)
            first = laws.first(start.coefficients[0], start.turns)
            return _endless(names, where, laws, first)
        except InputError as error:
            raise InputError(f'{where}: {error}') from error
    try:
        course.check_rising()
        found = _through_points(course, start, straight)
    except ValueError as error:
        raise InputError(f'{where} {error}') from error
    if not course.periodic:
        return tuple(found), None
    begin, end = course.given[0][0], course.given[-1][0]
    cycle = [law for law in found if begin <= law.valid_from < end]
    turns = 0 if straight else _turns(found, begin, end)
    source = RepeatedLaws(cycle, Fraction(end) - Fraction(begin), turns)
    return _endless(names, where, source, source.first())


def _through_points(course: CoursePart, start: DriveLaw, straight: bool) -> list[DriveLaw]:
    """The laws by points; speeds without a spline are joined by ramps."""
    ramped = isinstance(course, SpeedPart) and course.interpolation in (None, 'linear')
    if isinstance(course, SpeedPart) and ramped:
        return speed_profile(
            start.coordinate, start.coefficients[0], [(t, x.value) for t, x in course.given],
            course.ramp == 'smooth', straight, start.turns,
        )  # fmt: skip
    breaks, rows = course.spline()
    rate = isinstance(course, SpeedPart)
    return curve_laws(start.coordinate, breaks, rows, start if rate else None, straight)


def _turns(laws: Sequence[DriveLaw], begin: float, end: float) -> int:
    """Whole turns of an angle from one time [s] to another, in which it turns nearly so far."""
    places = []
    for t in (begin, end):
        law = next(x for x in reversed(laws) if x.valid_from <= t)
        turns, (angle, *_) = law.about(Fraction(t))
        places.append(turns + angle / (2.0 * math.pi))
    return round(places[1] - places[0])


def _endless(names: Names, where: str, source: LawSource, first: DriveLaw) -> Motion:
    """The first laws of a source, which must not jump."""
    ahead = names.scene.duration or _AHEAD
    known = (x for x in islice(unrolled([first], source), _MOST) if isinstance(x, DriveLaw))
    laws = list(takewhile(lambda law: law.valid_from <= ahead, known))
    for before, law in pairwise(laws):
        if not law.continues(before):
            raise InputError(
                f'{where} jumps in place or speed at t = {law.valid_from:.6g} s, which no drive '
                'can follow: let its parts meet there with one speed'
            )
    return tuple(laws), source


def moves(names: Names, where: str, given: MovesPart, start: DriveLaw, straight: bool) -> Motion:
    """The laws of moves from rest to rest, which may repeat."""

    def limits(step: MovePart) -> MoveLimits:
        values = []
        for key, units in zip(('speed', 'acceleration', 'jerk'), _UNITS[1:], strict=True):
            quantity = getattr(step, key) or getattr(given, key)
            if quantity is None:
                values.append(math.inf)
            else:
                values.append(names.measure(f'{where}.{key}', quantity, straight, units))
        return MoveLimits(*values)

    steps: list[tuple[float, float | MoveLimits]] = []
    goal = first = start.coefficients[0] + start.turns * 2.0 * math.pi
    for i, step in enumerate(given.steps):
        if step.dwell is not None:
            steps.append((0.0, step.dwell))
            continue
        key = 'to' if step.to is not None else 'by'
        place = names.measure(f'{where}.steps.{i}.{key}', getattr(step, key), straight, _UNITS[0])
        goal = place if key == 'to' else goal + place
        steps.append((goal, limits(step)))
    laws = move_laws(start, steps)
    if not given.repeat:
        return tuple(laws), None
    gone = goal - first
    off = gone if straight else math.remainder(gone, 2.0 * math.pi)
    if abs(off) > 1e-9 * max(abs(goal), abs(first)):
        raise InputError(
            f'{where}.repeat: the moves begin at {first:g} and end at {goal:g} '
            f'{_UNITS[0][straight]}: end where they begin'
            f'{"" if straight else ", or whole turns on"}'
        )
    period = Fraction(laws[-1].valid_from)
    if not period:
        raise InputError(f'{where}.steps go nowhere and rest nowhere: nothing repeats')
    turns = 0 if straight else round(gone / (2.0 * math.pi))
    source = RepeatedLaws(laws[:-1], period, turns)
    return _endless(names, where, source, source.first())


@dataclass(frozen=True)
class MoveLimits:
    """Largest sizes of the derivatives of a motion, all positive."""

    speed: float  #: [rad/s, m/s]
    acceleration: float  #: [rad/s^2, m/s^2]
    jerk: float = math.inf  #: [rad/s^3, m/s^3]


def phases(distance: float, limits: MoveLimits) -> list[tuple[float, float, float]]:
    """Duration [s], acceleration at its start and jerk of each phase of a move.

    Up to seven: acceleration rises, stays and falls; steady speed; the same to come to rest.
    (L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 3.4.)

    Parameters
    ----------
    distance : [rad, m], with its sign
    """
    v, a, j = limits.speed, limits.acceleration, limits.jerk
    way, sign = abs(distance), math.copysign(1.0, distance)
    rise = 0.0 if math.isinf(j) else min(a / j, math.sqrt(v / j))  # [s] of the jerk
    ramp = v / a + rise if math.isinf(j) or v * j >= a * a else 2.0 * rise  # [s] up to full speed
    steady = way / v - ramp
    if steady < 0.0:  # full speed is not reached
        steady = 0.0
        if math.isinf(j) or way * j * j >= 2.0 * a**3:
            rise = 0.0 if math.isinf(j) else a / j
            ramp = 0.5 * rise + math.sqrt(0.25 * rise * rise + way / a)
        else:
            rise = math.cbrt(0.5 * way / j)
            ramp = 2.0 * rise
    peak = (way / (steady + ramp)) / (ramp - rise) * sign  # acceleration that goes all the way
    jerk = peak / rise if rise else 0.0
    hold = max(0.0, ramp - 2.0 * rise)
    found = [(rise, 0.0, jerk), (hold, peak, 0.0), (rise, peak, -jerk), (steady, 0.0, 0.0)]
    found += [(rise, 0.0, -jerk), (hold, -peak, 0.0), (rise, -peak, jerk)]
    return [phase for phase in found if phase[0] > 0.0]


def move_laws(
    start: DriveLaw, steps: Sequence[tuple[float, float | MoveLimits]]
) -> list[DriveLaw]:
    """The laws of moves one after the other, the first from rest at time zero.

    Parameters
    ----------
    start : where the coordinate is at first
    steps : goal [rad, m] and limits of each move; or nothing and how long it rests [s]
    """
    laws = [replace(start, coefficients=(start.coefficients[0], 0.0))]
    goal, time = start.about(Fraction(0))[1][0] + start.turns * 2.0 * math.pi, 0.0
    for place, how in steps:
        if not isinstance(how, MoveLimits):
            time += how
            continue
        for duration, acceleration, jerk in phases(place - goal, how) if place != goal else ():
            turns, (angle, rate, *_) = laws[-1].about(Fraction(time))
            row = angle, rate, 0.5 * acceleration, jerk / 6.0
            laws.append(DriveLaw(start.coordinate, row, time, time, start.straight, turns))
            time += duration
        goal = place
        laws.append(DriveLaw(start.coordinate, (goal, 0.0), time, time, start.straight))
    if time > laws[-1].valid_from:  # it rests at the end
        laws.append(DriveLaw(start.coordinate, (goal, 0.0), time, time, start.straight))
    later = [*laws[1:], None]  # where a move follows at once, nothing rests
    return [
        law
        for law, after in zip(laws, later, strict=True)
        if after is None or after.valid_from > law.valid_from
    ]
