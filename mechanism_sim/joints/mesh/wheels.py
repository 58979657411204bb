"""Gears of a scene: where they are on their links, and pairs on their carrier."""

from __future__ import annotations

import math
from typing import NamedTuple

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.joints.mesh.involute import Gear, ToothSystem, transverse
from mechanism_sim.joints.mesh.pair import Pair, Path, path_with_rack
from mechanism_sim.keys.gear_keys import GearPart
from mechanism_sim.keys.names import Names
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.planar.points import GROUND, Vector2, rotate

_FITS = 1e-6  # of a module: how exact a centre distance must be


class Wheel(NamedTuple):
    """A gear of a scene on its link."""

    name: str
    part: GearPart
    link: str
    at: Vector2  #: [m] in the link's frame

    @property
    def system(self) -> ToothSystem:
        """The rack in the plane of rotation: lower in modules, for the module is larger there."""
        part, c = self.part, math.cos(self.part.helix_angle)
        angle = transverse(part.pressure_angle, part.helix_angle)
        return ToothSystem(angle, part.addendum * c, part.dedendum * c)

    @property
    def module(self) -> float:
        """Module in the plane of rotation [m]."""
        return self.part.module / math.cos(self.part.helix_angle)

    @property
    def gear(self) -> Gear:
        """Gear in the plane of rotation."""
        shift = self.part.shift * math.cos(self.part.helix_angle)
        return Gear(self.part.teeth or 0, self.module, self.system, shift, self.part.internal)


def read_wheel(names: Names, name: str) -> Wheel:
    """A gear by name."""
    gears = names.scene.gears
    if name not in gears:
        raise InputError(
            f"there is no gear '{name}'{nearest(name, gears)}; gears: "
            f"{', '.join(gears) or 'none'}; they stand under 'gears'"
        )
    part, where = gears[name], f'gears.{name}'
    if (part.teeth is None) != part.rack:
        raise InputError(f"{where}: {'a rack has no' if part.rack else 'a gear has'} 'teeth'")
    if part.rack and (part.internal or part.shift):
        raise InputError(f'{where}: a rack is not internal, and has no shift')
    if not abs(part.helix_angle) < math.radians(60.0):
        raise InputError(f'{where}.helix_angle must be less than 60 deg')
    wheel = Wheel(name, part, *names.find(f'gears.{name}.at', part.at))
    try:
        _ = wheel.system if part.rack else wheel.gear
    except InputError as error:
        raise InputError(f'{where}: {error}') from error
    return wheel


class Placed(NamedTuple):
    """A pair on its carrier; gears in the plane of rotation."""

    carrier: str
    towards: float  #: [rad] from the first centre to the second, in the carrier's frame
    reach: float  #: [m] from the first centre to the pitch point in that direction
    pressure_angle: float  #: [rad] working
    path: Path  #: [m] along the line of action, as the first drives
    backlash: float  #: [m] along the working pitch circle
    tight: str  #: what would leave no backlash
    facing: tuple[float, float]  #: as of `GearMesh`
    half: float  #: [rad] N times half the angle of a tooth of the first at the pitch point
    waves: tuple[float, float]  #: as of `GearMesh`
    bearings: tuple[str, ...]  #: shafts, and the guide of a rack
    guide: Prismatic | None = None


def place(names: Names, one: Wheel, two: Wheel) -> Placed:
    """Two gears, or a gear and a rack, where they stand on their carrier."""
    return _with_rack(names, one, two) if two.part.rack else _pair(names, one, two)


def _pair(names: Names, one: Wheel, two: Wheel) -> Placed:
    gears = one.gear, two.gear
    if one.part.internal and two.part.internal:
        raise InputError('one of the gears must have external teeth')
    signs = tuple(-1.0 if g.internal else 1.0 for g in gears)
    carrier, (here, there) = _carrier(names, one, two)
    x, y = there.at[0] - here.at[0], there.at[1] - here.at[1]
    distance = math.hypot(x, y)
    pinion, wheel = gears if signs[0] > 0.0 else gears[::-1]
    tight = Pair(pinion, wheel).centre_distance
    slip = distance - tight if min(signs) > 0.0 else tight - distance
    if slip < -_FITS * one.module:
        raise InputError(
            f'the teeth of {one.name} and {two.name} jam: the distance of their centres is '
            f'{distance:.9g} m, without backlash it is {tight:.9g} m'
        )
    try:
        pair = Pair(pinion, wheel, tight if abs(slip) <= _FITS * one.module else distance)
    except InputError as error:
        raise InputError(
            f'{error}; without backlash the distance of the centres is {tight:.9g} m'
        ) from error
    left = pair.backlash if slip > _FITS * one.module else 0.0
    towards = math.atan2(y, x)
    radii = pair.pitch_radii if pinion is gears[0] else pair.pitch_radii[::-1]
    path = pair.path if pinion is gears[0] else Path(-pair.path.end, -pair.path.start)
    return Placed(
        carrier, towards, signs[1] * radii[0], pair.pressure_angle, path, left,
        f'a centre distance of {tight:.9g} m',
        (towards + (0.0 if signs[1] > 0.0 else math.pi),
         towards + (math.pi if signs[0] > 0.0 else 0.0)),
        gears[0].teeth * gears[0].half_angle(radii[0]),
        (signs[0] * gears[0].teeth, signs[1] * gears[1].teeth), (*here.by, *there.by),
    )  # fmt: skip


def _with_rack(names: Names, one: Wheel, two: Wheel) -> Placed:
    gear = one.gear
    if gear.internal:
        raise InputError(f'the rack {two.name} needs a gear with external teeth')
    for n, joint in names.scene.joints.items():
        if not joint.prismatic:
            continue
        (a, on_a), (b, on_b) = names.connected(n)
        shaft = _axes(names, one).get(a)
        if b == two.link and a != one.link and shaft is not None:
            centre = shaft.at
            guide = Prismatic(n, a, b, on_a, on_b, joint.axis, joint.angle)
            break
    else:
        raise InputError(
            f'{two.link}, the link of the rack {two.name}, must slide on the link that carries '
            f"the shaft of {one.name}: add a joint 'prismatic: [CARRIER, {two.link}]'"
        )
    x, y = rotate((two.at[0] - on_b[0], two.at[1] - on_b[1]), guide.angle)
    # the rack's point from the centre, where the displacement is zero
    along, away = rotate((on_a[0] + x - centre[0], on_a[1] + y - centre[1]), -guide.axis)
    tight = gear.pitch_radius + gear.shift * gear.module
    if abs(away) < tight - _FITS * gear.module:
        raise InputError(
            f"the teeth of {one.name} and {two.name} jam: the rack's pitch line is "
            f'{abs(away):.9g} m from the centre, without backlash it is {tight:.9g} m'
        )
    side = math.copysign(1.0, away)
    out = abs(away) - tight
    out = out if out > _FITS * gear.module else 0.0
    path = path_with_rack(gear, out)
    if path.end - path.start < gear.base_pitch:
        raise InputError(
            'a pair of teeth separates before the next one engages: without backlash the pitch '
            f'line is {tight:.9g} m from the centre'
        )
    slope = side * 2.0 / gear.module  # E n . t, with the pitch line on that side of the centre
    return Placed(
        guide.first, guide.axis + side * 0.5 * math.pi, gear.pitch_radius,
        gear.system.pressure_angle, path, 2.0 * out * math.tan(gear.system.pressure_angle),
        f'a pitch line {tight:.9g} m from the centre',
        (guide.axis + side * 0.5 * math.pi, -along),
        gear.teeth * gear.half_angle(gear.pitch_radius), (gear.teeth, slope),
        (*shaft.by, guide.name), guide,
    )  # fmt: skip


class _Axis(NamedTuple):
    """Axis of a link's rotation about a gear's centre, and the joints on the path to it."""

    at: Vector2  #: [m] in the link's frame
    by: tuple[str, ...] = ()


def _axes(names: Names, wheel: Wheel) -> dict[str, _Axis]:
    """The links that turn about a gear's centre."""
    found = {wheel.link: _Axis(wheel.at)}
    waiting = [n for n, joint in names.scene.joints.items() if joint.revolute]
    while True:
        for n in waiting:
            ends = dict(names.connected(n))
            here = [x for x in ends if x in found and math.dist(ends[x], found[x].at) < 1e-9]
            if here:
                by = (*found[here[0]].by, n)
                found = {x: _Axis(at, by) for x, at in ends.items()} | found
                waiting.remove(n)
                break
        else:
            break
        if names.scene.joints[n].clearance:
            raise InputError(
                f'the shaft of {wheel.name} has a clearance ({n}), so that its centre is not '
                'fixed: gears need ideal bearings'
            )
    return found


def _carrier(names: Names, one: Wheel, two: Wheel) -> tuple[str, tuple[_Axis, _Axis]]:
    """The link on which both gears turn, the ground if possible, and their centres on it."""
    a, b = (_axes(names, x) for x in (one, two))
    both = [x for x in (GROUND, *names.links) if x in a and x in b]
    both = [
        x for x in both
        if x not in (one.link, two.link) and math.dist(a[x].at, b[x].at) > 1e-9
    ]  # fmt: skip
    if not both:
        raise InputError(
            f'{one.name} and {two.name} have no common carrier: both must be pivoted on the '
            'ground or on one link, at two points of it'
        )
    return both[0], (a[both[0]], b[both[0]])
