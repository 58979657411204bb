"""The drives of a linkage that is written out, by formulas, tables, splines and moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice, pairwise, takewhile
from typing import NamedTuple

from mechanism_sim.engine.clock import take_off_turns
from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names, kind_of
from mechanism_sim.linkages.formulas import FormulaTorque
from mechanism_sim.numerics.time_series import TimeSeries
from mechanism_sim.planar.drive import (
    TWO_PI,
    DriveLaw,
    FormulaLaws,
    Law,
    LawSource,
    RepeatedLaws,
    TorqueLaw,
    curve_laws,
    speed_profile,
    unrolled,
)
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.motor import InductionMotor, Motor, PointsOfTorque
from mechanism_sim.scene.formula_keys import check_formula, scope_of
from mechanism_sim.scene.motion_keys import (
    MotionProfile,
    MovePart,
    MovesPart,
    SpeedPart,
)
from mechanism_sim.scene.schema import Commands, DrivePart, MotorPart

_AHEAD, _MOST = 10.0, 256
"""[s] of motions without end that are looked at beforehand if a scene has no duration, and pieces
at most."""

Motion = tuple[tuple[DriveLaw, ...], LawSource | None]
"""Laws in the order in which they take over, and what goes on behind them."""

_UNITS = ('rad', 'm'), ('rad/s', 'm/s'), ('rad/s^2', 'm/s^2'), ('rad/s^3', 'm/s^3')
_SLOWEST = 1e-20  # [rad/s, m/s] of a steady drive: powers of it are numbers
_WAYS = 'position', 'moves', 'profile', 'torque', 'force', 'motor'
_POWERED = 'they are of speeds; a torque takes commands of effort without this key'


def read_drives(names: Names) -> dict[str, DrivePart]:
    """The drives by coordinate, the main one first."""
    scene, found = names.scene, {}
    if scene.drive:
        default = 'crank' if 'crank' in names.links else None
        coordinate = scene.drive.coordinate or default
        if coordinate is None:
            raise InputError(
                "'drive.coordinate' is missing: name the driven link; links: "
                f'{", ".join(names.links)}'
            )
        found[coordinate] = scene.drive
    for coordinate, drive in scene.drives.items():
        if coordinate in found:
            raise InputError(f'drives.{coordinate}: it has a drive already')
        _check_commands(f'drives.{coordinate}', drive.commands, "only the main 'drive' takes them")
        found[coordinate] = drive
    for coordinate in found:
        names.coordinate('drive.coordinate', coordinate)
    return found


def drive_key(names: Names, coordinate: str) -> str:
    """Path in the scene of the drive of a coordinate."""
    return f'drives.{coordinate}' if coordinate in names.scene.drives else 'drive'


def drive_of(names: Names, coordinate: str) -> DrivePart | None:
    """Keys of the drive of a coordinate; None where it has none."""
    return read_drives(names).get(coordinate)


def is_straight(drive: DrivePart) -> bool:
    """True if a drive is given by quantities of a displacement."""
    units = [x.unit for x in (drive.speed, drive.position, drive.profile, drive.acceleration) if x]
    if drive.moves:
        units += [drive.moves.speed.unit, drive.moves.acceleration.unit]
        units += [x.unit for step in drive.moves.steps if (x := step.to or step.by)]
    return (
        drive.start_position is not None
        or drive.force is not None
        or any(unit.startswith('m') for unit in units)
    )


class DrivenStart(NamedTuple):
    """The laws of a driven coordinate, and where it begins."""

    laws: tuple[Law, ...]
    source: LawSource | None  #: continues the laws behind the last one
    begin: tuple[float, float]  #: value and rate
    turns: int  #: whole turns added to the value


def read_laws(
    names: Names, c: str, drive: DrivePart, straight: bool, start: float | None, guess: float
) -> DrivenStart:
    """The laws of a driven coordinate, and its start.

    Parameters
    ----------
    start, guess : its value by `initial`, which precedes the drive's own, and by `guess`
    """
    where = drive_key(names, c)
    _check_ways(where, c, drive, straight)
    own = drive.start_position if straight else drive.start_angle
    value = start if start is not None else guess if own is None else own
    turns, value = (0, value) if straight else take_off_turns(value)
    if drive.torque or drive.force or drive.motor:
        speed = 0.0
        if isinstance(drive.speed, SpeedPart):
            raise InputError(
                f'{where}.speed of what is moved by a torque or a force is a quantity'
            )
        if drive.speed is not None:
            speed = names.measure(f'{where}.speed', drive.speed, straight, ('rad/s', 'm/s'))
        return DrivenStart((_power(where, c, drive),), None, (value, speed), turns)
    first = DriveLaw(c, (value,), straight=straight, turns=turns)
    if drive.position is not None:
        for key, given in (
            ('start_position', drive.start_position),
            ('start_angle', drive.start_angle),
            (f'initial.position.{c}', start),
        ):
            if given is not None:
                raise InputError(
                    f'{where}.position gives every position, that at the start, too: leave '
                    f"out '{key}'"
                )
        laws, source = _profile_laws(names, f'{where}.position', drive.position, first, straight)
    elif drive.moves:
        laws, source = moves(names, f'{where}.moves', drive.moves, first, straight)
    elif isinstance(profile := drive.profile or drive.speed, SpeedPart):
        key = 'profile' if drive.profile else 'speed'
        laws, source = _profile_laws(names, f'{where}.{key}', profile, first, straight)
    else:
        laws, source = (_steady(names, where, drive, first),), None
    turns, (value, *rates) = laws[0].about(Fraction(0))
    return DrivenStart(laws, source, (value, rates[0] if rates else 0.0), turns)


def _check_ways(where: str, c: str, drive: DrivePart, straight: bool) -> None:
    """Refuse keys that exclude each other, or do not fit the coordinate."""
    ways = [way for way in _WAYS if getattr(drive, way) is not None]
    if len(ways) > 1:
        raise InputError(f'{where}.{ways[0]} and {where}.{ways[1]} exclude each other: keep one')
    timed = ways[0] if ways and ways[0] in _WAYS[:3] else ''
    if timed and drive.speed is not None:
        raise InputError(
            f'{where}.speed and {where}.{timed} exclude each other: a profile gives every speed, '
            'the first at its first point'
            if timed == 'profile'
            else f'{where}.speed and {where}.{timed} exclude each other: keep one'
        )
    if drive.acceleration is not None and (ways or isinstance(drive.speed, SpeedPart)):
        other = ways[0] if ways else 'speed over time'
        raise InputError(f'{where}.acceleration and {where}.{other} exclude each other: keep one')
    wrong = {'torque', 'motor', 'start_angle'} if straight else {'force', 'start_position'}
    for key in sorted(wrong):
        if getattr(drive, key) is not None:
            raise InputError(f'{where}.{key} does not fit: {c} is {kind_of(straight)}')
    powered = drive.torque or drive.force or drive.motor
    if powered and drive.effort is not None:
        raise InputError(
            f"{where}.effort and {where}.{ways[0]} exclude each other: 'effort' is what a drive "
            "supplies whose motion is prescribed, by 'position', 'speed', 'moves' or 'profile'"
        )
    reason = _POWERED if powered else 'a displacement takes none' if straight else ''
    if timed in ('position', 'moves') or isinstance(drive.speed, SpeedPart):
        reason = 'they change a steady speed, and this one is given over time'
    _check_commands(where, drive.commands, reason)


def _power(where: str, c: str, drive: DrivePart) -> TorqueLaw:
    """The law of a torque, a force or a motor."""
    if drive.motor:
        return _motor_law(where, c, drive.motor)
    if f := drive.force:
        return TorqueLaw(c, (f.constant + _number(f.formula), f.per_position, f.per_speed))
    t = drive.torque
    assert t is not None  # noqa: S101 - one of the three is there
    return TorqueLaw(c, (t.constant + _number(t.formula), t.per_angle, t.per_speed))


def _steady(names: Names, where: str, drive: DrivePart, first: DriveLaw) -> DriveLaw:
    """The law of a speed, or of a speed and an acceleration."""
    if drive.speed is None and drive.acceleration is None:
        raise InputError(
            f"'{where}.speed' is missing: a speed, a position, moves, a profile, a torque, a "
            f'force or a motor moves {first.coordinate}'
        )
    assert not isinstance(drive.speed, SpeedPart)  # noqa: S101 - that is a course
    speed = half = 0.0
    if drive.speed is not None:
        speed = names.measure(f'{where}.speed', drive.speed, first.straight, ('rad/s', 'm/s'))
        if speed and not _SLOWEST <= abs(speed) <= 1.0 / _SLOWEST:
            raise InputError(
                f'{where}.speed = {speed:g} {"m/s" if first.straight else "rad/s"} is out of '
                f'bounds: it must be 0, or from {_SLOWEST:g} to {1.0 / _SLOWEST:g} in either way'
            )
    if drive.acceleration is not None:
        units = 'rad/s^2', 'm/s^2'
        half = 0.5 * names.measure(
            f'{where}.acceleration', drive.acceleration, first.straight, units
        )
    return replace(first, coefficients=(*first.coefficients, speed, *([half] if half else [])))


def _number(formula: float | str | None) -> float:
    """Constant that a formula adds if it is a number alone."""
    return formula if isinstance(formula, float) else 0.0


def _check_commands(where: str, commands: Commands | None, reason: str) -> None:
    """Refuse commands of speed for a drive that can take none, for a `reason` (empty: it can)."""
    if commands and reason:
        raise InputError(f'{where}.commands: {reason}')


def read_motor(names: Names, coordinate: str, drive: DrivePart, tree: Mechanism) -> Motor | None:
    """The motor of a drive whose torque is no straight line over its speed, if it has one."""
    motor, affine = drive.motor, drive.torque or drive.force
    if affine and isinstance(text := affine.formula, str):
        key, unit = ('torque', 'N m') if drive.torque else ('force', 'N')
        check_formula(names, f'{drive_key(names, coordinate)}.{key}', text, unit, tree, {})
        return Motor(coordinate, FormulaTorque(text, scope_of(names, tree)(tree)))
    if motor is None or not (motor.curve or motor.induction):
        return None
    if motor.curve:
        return Motor(coordinate, PointsOfTorque(motor.curve.curve), motor.ratio)
    assert motor.induction is not None  # noqa: S101 - one of the two is there
    by_formula = InductionMotor.of_data_sheet(**dict(motor.induction))
    return Motor(coordinate, by_formula, motor.ratio)


def _motor_law(where: str, coordinate: str, motor: MotorPart) -> TorqueLaw:
    """The straight line of a direct-current motor; empty for another characteristic."""
    if motor.stall_torque is None or motor.no_load_speed is None:
        return TorqueLaw(coordinate)
    if motor.no_load_speed == 0.0:
        raise InputError(f'{where}.motor.no_load_speed must not be zero')
    if motor.stall_torque * motor.no_load_speed < 0.0:
        raise InputError(
            f'{where}.motor: stall_torque {motor.stall_torque:g} N m and no_load_speed '
            f'{motor.no_load_speed:g} rad/s have opposite signs: it would run away; give both the '
            'sign in which it turns'
        )
    torque, ratio = motor.stall_torque, motor.ratio
    return TorqueLaw(coordinate, (torque * ratio, 0.0, -torque / motor.no_load_speed * ratio**2))


def _profile_laws(
    names: Names, where: str, profile: MotionProfile, start: DriveLaw, straight: bool
) -> Motion:
    """The laws of a coordinate by its position or its speed over time.

    Parameters
    ----------
    start : value at time zero of a coordinate whose speed is given
    """
    rate = isinstance(profile, SpeedPart)
    if profile.unit and (profile.unit.startswith('m') != straight):
        kind = 'slides' if straight else 'turns'
        raise InputError(
            f'{where} is in {profile.unit}, but {start.coordinate} {kind}: give it in '
            f'{profile.units()[straight]}'
        )
    if profile.formula is not None:
        series = TimeSeries(profile.tree(), profile.formula)
        try:
            laws = FormulaLaws(start.coordinate, series, straight, rate)
            first = laws.first(start.coefficients[0], start.turns)
            return _endless(names, where, laws, first)
        except InputError as error:
            raise InputError(f'{where}: {error}') from error
    try:
        profile.check_rising()
        found = _through_points(profile, start, straight)
    except ValueError as error:
        raise InputError(f'{where} {error}') from error
    if not profile.periodic:
        return tuple(found), None
    begin, end = profile.given[0][0], profile.given[-1][0]
    cycle = [law for law in found if begin <= law.valid_from < end]
    way, period = _place(found[-1], end) - _place(cycle[0], begin), Fraction(end) - Fraction(begin)
    if not rate:
        way = TWO_PI * (0 if straight else round(way / TWO_PI))
    source = RepeatedLaws(cycle, period, way)
    if rate and begin:  # the position at time zero, in an earlier period
        off = float(_place(start, 0.0) - _place(source.first(), 0.0))
        cycle = [
            replace(law, coefficients=(law.coefficients[0] + off, *law.coefficients[1:]))
            for law in cycle
        ]
        source = RepeatedLaws(cycle, period, way)
    return _endless(names, where, source, source.first())


def _place(law: DriveLaw, t: float) -> Fraction:
    """Position of a law at a time [s], with all turns [rad or m]."""
    turns, (place, *_) = law.about(Fraction(t))
    return turns * TWO_PI + Fraction(place)


def _through_points(profile: MotionProfile, start: DriveLaw, straight: bool) -> list[DriveLaw]:
    """The laws by points; speeds without a spline are joined by ramps."""
    ramped = isinstance(profile, SpeedPart) and profile.interpolation in (None, 'linear')
    if isinstance(profile, SpeedPart) and ramped:
        return speed_profile(
            start.coordinate, start.coefficients[0], [(t, x.value) for t, x in profile.given],
            profile.ramp == 'smooth', straight, start.turns,
        )  # fmt: skip
    breaks, rows = profile.spline()
    rate = isinstance(profile, SpeedPart)
    return curve_laws(start.coordinate, breaks, rows, start if rate else None, straight)


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
    farthest = abs(first)
    for i, step in enumerate(given.steps):
        if step.dwell is not None:
            steps.append((0.0, step.dwell))
            continue
        key = 'to' if step.to is not None else 'by'
        place = names.measure(f'{where}.steps.{i}.{key}', getattr(step, key), straight, _UNITS[0])
        goal = place if key == 'to' else goal + place
        farthest = max(farthest, abs(goal))
        steps.append((goal, limits(step)))
    laws = _move_laws(start, steps)
    if not given.repeat:
        return tuple(laws), None
    gone = goal - first
    off = gone if straight else math.remainder(gone, 2.0 * math.pi)
    if abs(off) > 1e-9 * farthest:
        raise InputError(
            f'{where}.repeat: the moves begin at {first:g} and end at {goal:g} '
            f'{_UNITS[0][straight]}: end where they begin'
            f'{"" if straight else ", or whole turns on"}'
        )
    period = Fraction(laws[-1].valid_from)
    if not period:
        raise InputError(f'{where}.steps have neither a move nor a dwell: nothing repeats')
    turns = 0 if straight else round(gone / (2.0 * math.pi))
    source = RepeatedLaws(laws[:-1], period, turns * TWO_PI)
    return _endless(names, where, source, source.first())


@dataclass(frozen=True)
class MoveLimits:
    """Largest sizes of the derivatives of a motion, all positive."""

    speed: float  #: [rad/s, m/s]
    acceleration: float  #: [rad/s^2, m/s^2]
    jerk: float = math.inf  #: [rad/s^3, m/s^3]


_SHORTEST = 1e-12
"""Phases below this share of a ramp are rounding, and no time: none begins and ends in them."""


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
    if steady < _SHORTEST * ramp:  # full speed is not reached, or but just
        steady = 0.0
        if math.isinf(j) or way * j * j >= 2.0 * a**3:
            rise = 0.0 if math.isinf(j) else a / j
            ramp = 0.5 * rise + math.sqrt(0.25 * rise * rise + way / a)
        else:
            rise = math.cbrt(0.5 * way / j)
            ramp = 2.0 * rise
    if ramp - 2.0 * rise < _SHORTEST * ramp:
        ramp = 2.0 * rise
    peak = (way / (steady + ramp)) / (ramp - rise) * sign  # acceleration over all of it
    jerk = peak / rise if rise else 0.0
    hold = ramp - 2.0 * rise
    found = [(rise, 0.0, jerk), (hold, peak, 0.0), (rise, peak, -jerk), (steady, 0.0, 0.0)]
    found += [(rise, 0.0, -jerk), (hold, -peak, 0.0), (rise, -peak, jerk)]
    return [phase for phase in found if phase[0] > 0.0]


def _move_laws(
    start: DriveLaw, steps: Sequence[tuple[float, float | MoveLimits]]
) -> list[DriveLaw]:
    """The laws of moves one after the other, the first from rest at time zero.

    Parameters
    ----------
    start : initial value of the coordinate
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
    if time > laws[-1].valid_from:  # rest at the end
        laws.append(DriveLaw(start.coordinate, (goal, 0.0), time, time, start.straight))
    later = [*laws[1:], None]  # no rest between successive moves
    return [
        law
        for law, after in zip(laws, later, strict=True)
        if after is None or after.valid_from > law.valid_from
    ]
