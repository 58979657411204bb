"""The drives of a linkage that is written out."""

from __future__ import annotations

from mechanism_sim.errors import InputError
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw, speed_profile
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.linkage import LinkageDrive
from mechanism_sim.scene.places import Places, kind_of
from mechanism_sim.scene.plan import POWERED, check_commands, check_motor, check_times, motor_law

_WAYS = 'profile', 'torque', 'force', 'motor'


def read_drives(places: Places) -> dict[str, LinkageDrive]:
    """The drives by coordinate, the main one first.

    Raises
    ------
    InputError
        If it is not clear which coordinate they move.
    """
    scene, found = places.scene, {}
    if scene.drive:
        default = 'crank' if 'crank' in places.links else None
        coordinate = scene.drive.coordinate or default
        if coordinate is None:
            raise InputError(
                f"{places.name}: 'drive.coordinate' is missing: name the driven link; links: "
                f'{", ".join(places.links)}'
            )
        found[coordinate] = scene.drive
    for coordinate, drive in scene.drives.items():
        if coordinate in found:
            raise InputError(f'{places.name}: drives.{coordinate}: it has a drive already')
        check_commands(f'drives.{coordinate}', drive.commands, "only the main 'drive' takes them")
        found[coordinate] = drive
    for coordinate in found:
        places.coordinate('drive.coordinate', coordinate)
    return found


def is_straight(drive: LinkageDrive) -> bool:
    """Whether what is given of a drive belongs to a displacement."""
    paces = [drive.speed, *(p for _, p in (drive.profile.points if drive.profile else []))]
    return (
        drive.start_position is not None
        or drive.force is not None
        or any(p is not None and p.unit == 'm/s' for p in paces)
    )


def read_laws(
    places: Places, c: str, drive: LinkageDrive, tree: Mechanism
) -> tuple[tuple[Law, ...], tuple[float, float]]:
    """The laws of a driven coordinate, and its value and rate at the start.

    Raises
    ------
    InputError
        If what is given does not fit together, or the coordinate.
    """
    where = f'{places.name}: the drive of {c}'
    straight = c in tree.displacements
    ways = [way for way in _WAYS if getattr(drive, way) is not None]
    if len(ways) > 1:
        raise InputError(f'{where}: {ways[0]} and {ways[1]} exclude each other: keep one')
    if drive.profile and drive.speed is not None:
        raise InputError(
            f'{where}: speed and profile exclude each other: a profile gives every speed, the '
            'first at its first point'
        )
    wrong = {'torque', 'motor', 'start_angle'} if straight else {'force', 'start_position'}
    for key in sorted(wrong):
        if getattr(drive, key) is not None:
            raise InputError(f"{where}: '{key}' does not fit: {c} is {kind_of(straight)}")
    start = drive.start_position if straight else drive.start_angle
    start = places.values('initial.position', places.scene.initial.position, tree,
                         ('rad', 'm')).get(c, start)  # fmt: skip
    value = start if start is not None else places.values(
        'guess', places.scene.guess, tree, ('rad', 'm')).get(c, 0.0)  # fmt: skip
    speed = 0.0 if drive.speed is None else places.measure(
        f'the speed of {c}', drive.speed, straight, ('rad/s', 'm/s'))  # fmt: skip
    begin = value, speed
    powered = drive.torque or drive.force or drive.motor
    reason = POWERED if powered else 'a displacement takes none' if straight else ''
    check_commands(where, drive.commands, reason)
    if powered:
        if drive.motor:
            check_motor(where, drive.motor)
            return (motor_law(c, drive.motor.stall_torque, drive.motor.no_load_speed),), begin
        f, t = drive.force, drive.torque
        if f:
            return (TorqueLaw(c, (f.constant, f.per_position, f.per_speed)),), begin
        assert t is not None  # noqa: S101 - one of the three is there
        return (TorqueLaw(c, (t.constant, t.per_angle, t.per_speed)),), begin
    if drive.profile:
        check_times(f'{where}: profile.points', drive.profile.points)
        points = [
            (t, places.measure(f'a speed of {c}', p, straight, ('rad/s', 'm/s')))
            for t, p in drive.profile.points
        ]
        laws = speed_profile(c, value, points, drive.profile.ramp == 'smooth', straight)
        return tuple(laws), (value, points[0][1])
    if drive.speed is None:
        raise InputError(
            f"{where}: 'speed' is missing: a speed, a profile, a torque, a force or a motor "
            'moves it'
        )
    return (DriveLaw(c, (value, speed), straight=straight),), begin
