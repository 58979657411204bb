"""The drives of a linkage that is written out."""

from __future__ import annotations

from itertools import pairwise

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.clock import take_off_turns
from mechanism_sim.keys.names import Names, kind_of
from mechanism_sim.linkages.formulas import FormulaTorque
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw, speed_profile
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.motor import InductionMotor, Motor, PointsOfTorque
from mechanism_sim.scene.formula_keys import check_formula, scope_of
from mechanism_sim.scene.schema import Commands, DrivePart, MotorPart

_WAYS = 'profile', 'torque', 'force', 'motor'
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
    paces = [drive.speed, *(p for _, p in (drive.profile.points if drive.profile else []))]
    return (
        drive.start_position is not None
        or drive.force is not None
        or any(p is not None and p.unit == 'm/s' for p in paces)
    )


def read_laws(
    names: Names, c: str, drive: DrivePart, straight: bool, start: float | None, guess: float
) -> tuple[tuple[Law, ...], tuple[float, float], int]:
    """The laws of a driven coordinate, its value and rate at the start, and whole turns beside.

    Parameters
    ----------
    start, guess : its value as `initial` gives it, before the drive itself, and as `guess` does
    """
    where = drive_key(names, c)
    ways = [way for way in _WAYS if getattr(drive, way) is not None]
    if len(ways) > 1:
        raise InputError(f'{where}.{ways[0]} and {where}.{ways[1]} exclude each other: keep one')
    if drive.profile and drive.speed is not None:
        raise InputError(
            f'{where}.speed and {where}.profile exclude each other: a profile gives every speed, '
            'the first at its first point'
        )
    wrong = {'torque', 'motor', 'start_angle'} if straight else {'force', 'start_position'}
    for key in sorted(wrong):
        if getattr(drive, key) is not None:
            raise InputError(f'{where}.{key} does not fit: {c} is {kind_of(straight)}')
    own = drive.start_position if straight else drive.start_angle
    value = start if start is not None else guess if own is None else own
    turns, value = (0, value) if straight else take_off_turns(value)
    speed = 0.0 if drive.speed is None else names.measure(
        f'{where}.speed', drive.speed, straight, ('rad/s', 'm/s'))  # fmt: skip
    begin = value, speed
    powered = drive.torque or drive.force or drive.motor
    if powered and drive.effort is not None:
        raise InputError(
            f"{where}.effort and {where}.{ways[0]} exclude each other: 'effort' is what a drive "
            "supplies whose motion is prescribed, by 'speed' or 'profile'"
        )
    reason = _POWERED if powered else 'a displacement takes none' if straight else ''
    _check_commands(where, drive.commands, reason)
    if powered:
        if drive.motor:
            return (_motor_law(where, c, drive.motor),), begin, turns
        f, t = drive.force, drive.torque
        if f:
            constant = f.constant + _number(f.formula)
            return (TorqueLaw(c, (constant, f.per_position, f.per_speed)),), begin, turns
        assert t is not None  # noqa: S101 - one of the three is there
        constant = t.constant + _number(t.formula)
        return (TorqueLaw(c, (constant, t.per_angle, t.per_speed)),), begin, turns
    if drive.profile:
        for (before, _), (after, _) in pairwise(drive.profile.points):
            if after <= before:
                raise InputError(
                    f'{where}.profile.points: times must rise, but {after:g} s follows '
                    f'{before:g} s'
                )
        points = [
            (t, names.measure(f'{where}.profile.points', p, straight, ('rad/s', 'm/s')))
            for t, p in drive.profile.points
        ]
        laws = speed_profile(c, value, points, drive.profile.ramp == 'smooth', straight, turns)
        return tuple(laws), (value, points[0][1]), turns
    if drive.speed is None:
        raise InputError(
            f"'{where}.speed' is missing: a speed, a profile, a torque, a force or a motor moves "
            f'{c}'
        )
    return (DriveLaw(c, (value, speed), straight=straight, turns=turns),), begin, turns


def _number(formula: float | str | None) -> float:
    """What a formula adds if it is a number alone."""
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
