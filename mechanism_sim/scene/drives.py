"""The drives of a linkage that is written out."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.clock import take_off_turns
from mechanism_sim.keys.names import Names, kind_of
from mechanism_sim.linkages.formulas import FormulaTorque
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw
from mechanism_sim.planar.endless_laws import LawSource
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.motor import InductionMotor, Motor, PointsOfTorque
from mechanism_sim.scene.drive_motion import course_laws, moves
from mechanism_sim.scene.formula_keys import check_formula, scope_of
from mechanism_sim.scene.motion_keys import SpeedPart
from mechanism_sim.scene.schema import Commands, DrivePart, MotorPart

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
    """Where the scene says what moves a driven coordinate."""
    return f'drives.{coordinate}' if coordinate in names.scene.drives else 'drive'


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
    """The laws of a driven coordinate, and where it begins.

    Attributes
    ----------
    source : continues the laws behind the last one
    begin : value and rate
    turns : whole turns beside the value
    """

    laws: tuple[Law, ...]
    source: LawSource | None
    begin: tuple[float, float]
    turns: int


def read_laws(
    names: Names, c: str, drive: DrivePart, straight: bool, start: float | None, guess: float
) -> DrivenStart:
    """The laws of a driven coordinate, and its start.

    Parameters
    ----------
    start, guess : its value as `initial` gives it, before the drive itself, and as `guess` does
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
        laws, source = course_laws(names, f'{where}.position', drive.position, first, straight)
    elif drive.moves:
        laws, source = moves(names, f'{where}.moves', drive.moves, first, straight)
    elif isinstance(course := drive.profile or drive.speed, SpeedPart):
        key = 'profile' if drive.profile else 'speed'
        laws, source = course_laws(names, f'{where}.{key}', course, first, straight)
    else:
        laws, source = (_steady(names, where, drive, first),), None
    turns, (value, *rates) = laws[0].about(Fraction(0))
    return DrivenStart(laws, source, (value, rates[0] if rates else 0.0), turns)


def _check_ways(where: str, c: str, drive: DrivePart, straight: bool) -> None:
    """Refuse keys that exclude each other, or do not fit the coordinate."""
    ways = [way for way in _WAYS if getattr(drive, way) is not None]
    if len(ways) > 1:
        raise InputError(f'{where}.{ways[0]} and {where}.{ways[1]} exclude each other: keep one')
    course = ways[0] if ways and ways[0] in _WAYS[:3] else ''
    if course and drive.speed is not None:
        raise InputError(
            f'{where}.speed and {where}.{course} exclude each other: a profile gives every speed, '
            'the first at its first point'
            if course == 'profile'
            else f'{where}.speed and {where}.{course} exclude each other: keep one'
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
    if course in ('position', 'moves') or isinstance(drive.speed, SpeedPart):
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
    """The straight line of a direct-current motor; nothing beside another characteristic."""
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
