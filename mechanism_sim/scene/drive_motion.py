"""Prescribed motions of drives as laws: by formulas, tables, splines and moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import islice, pairwise, takewhile

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names
from mechanism_sim.numerics.time_series import TimeSeries
from mechanism_sim.planar.drive import DriveLaw, curve_laws, speed_profile
from mechanism_sim.planar.endless_laws import FormulaLaws, LawSource, RepeatedLaws, unrolled
from mechanism_sim.planar.moves import MoveLimits, move_laws
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
        raise InputError(f'{where}.steps have neither a move nor a dwell: nothing repeats')
    turns = 0 if straight else round(gone / (2.0 * math.pi))
    source = RepeatedLaws(laws[:-1], period, turns)
    return _endless(names, where, source, source.first())
