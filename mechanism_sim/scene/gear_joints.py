"""Gears of a scene, their meshes and other transmissions."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from mechanism_sim.errors import InputError
from mechanism_sim.gears.compliance import Elasticity, middle, touching
from mechanism_sim.gears.involute import Gear, ToothSystem, transverse
from mechanism_sim.gears.mesh import GearMesh, Harmonic, Teeth
from mechanism_sim.gears.pair import Pair, Path, path_with_rack
from mechanism_sim.gears.transmission import Transmission
from mechanism_sim.planar.mechanism import (
    GROUND,
    Joint,
    Mechanism,
    Prismatic,
    Vector2,
    rotate,
)
from mechanism_sim.scene.files import nearest
from mechanism_sim.scene.gear_keys import GearPart
from mechanism_sim.scene.linkage import LinkageJoint
from mechanism_sim.scene.places import Places
from mechanism_sim.scene.schema import Play

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
        """In the plane of rotation [m]."""
        return self.part.module / math.cos(self.part.helix_angle)

    @property
    def gear(self) -> Gear:
        """In the plane of rotation.

        Raises
        ------
        InputError
            If such teeth cannot be cut.
        """
        shift = self.part.shift * math.cos(self.part.helix_angle)
        return Gear(self.part.teeth or 0, self.module, self.system, shift, self.part.internal)


def read_wheel(places: Places, name: str) -> Wheel:
    """A gear by name.

    Raises
    ------
    InputError
        If there is none, its keys contradict each other, or its teeth cannot be cut.
    """
    gears = places.scene.gears
    if name not in gears:
        raise InputError(
            f"{places.name}: there is no gear '{name}'{nearest(name, gears)}; gears: "
            f"{', '.join(gears) or 'none'}; they stand under 'gears'"
        )
    part, where = gears[name], f'{places.name}: gears.{name}'
    if (part.teeth is None) != part.rack:
        raise InputError(f"{where}: {'a rack has no' if part.rack else 'a gear has'} 'teeth'")
    if part.rack and (part.internal or part.shift):
        raise InputError(f'{where}: a rack is not internal, and has no shift')
    if not abs(part.helix_angle) < math.radians(60.0):
        raise InputError(f'{where}.helix_angle must be less than 60 deg')
    wheel = Wheel(name, part, *places.find(f'gears.{name}.at', part.at))
    try:
        _ = wheel.system if part.rack else wheel.gear
    except InputError as error:
        raise InputError(f'{where}: {error}') from error
    return wheel


class _Placed(NamedTuple):
    """A pair on its carrier."""

    carrier: str
    towards: float
    reach: float
    pressure_angle: float
    path: Path  #: as the first drives
    backlash: float  #: [m] along the working pitch circle
    tight: str  #: what would leave no backlash
    facing: tuple[float, float]
    half: float  #: [rad] N times half the angle of a tooth of the first at the pitch point
    waves: tuple[float, float]
    bearings: tuple[str, ...]  #: shafts, and the guide of a rack
    guide: Prismatic | None = None


def read_mesh(places: Places, name: str, joint: LinkageJoint) -> GearMesh:
    """Two gears in mesh; their phase is set by `in_mesh`.

    Raises
    ------
    InputError
        If they do not mesh, are not where they should be, or have no common carrier.
    """
    where = f'{places.name}: joints.{name}'
    one, two = (read_wheel(places, gear) for gear in joint.points)
    if one.part.rack:
        raise InputError(f'{where}.mesh: name the gear first, then the rack')
    if one.link == two.link:
        raise InputError(f'{where}.mesh: {one.name} and {two.name} are fixed to one link')
    for key, unit, scale in (('module', 'mm', 1e-3), ('pressure_angle', 'deg', math.pi / 180.0)):
        a, b = getattr(one.part, key), getattr(two.part, key)
        if a != b:
            raise InputError(
                f'{where}.mesh: {one.name} and {two.name} do not mesh: their '
                f'{key.replace("_", " ")}s are {a / scale:g} {unit} and {b / scale:g} {unit}'
            )
    if abs(one.part.helix_angle) != abs(two.part.helix_angle):
        raise InputError(
            f'{where}.mesh: {one.name} and {two.name} do not mesh: helical gears on parallel '
            'shafts have equal helix angles, of opposite hands'
        )
    try:
        placed = _with_rack(places, one, two) if two.part.rack else _pair(places, one, two)
        play = _play(joint, placed, one.gear.base_pitch)
        elasticity = _elasticity(joint, one, placed)
    except InputError as error:
        raise InputError(f'{where}: {error}') from error
    return GearMesh(
        name, one.link, two.link, one.at, two.at, placed.carrier, placed.waves,
        one.gear.base_pitch, placed.pressure_angle, placed.towards, placed.reach,
        placed.facing, placed.guide, bearings=placed.bearings, play=play,
        errors=_errors(where, joint, placed, one.gear.base_pitch), elasticity=elasticity,
        wheels=(Teeth(one.name, one.gear), _teeth(one, two)),
        contact_ratio=(placed.path.end - placed.path.start) / one.gear.base_pitch,
        helix_angle=math.atan(abs(math.tan(one.part.helix_angle)) * abs(placed.reach)
                              / one.gear.pitch_radius),
    )  # fmt: skip


def _teeth(one: Wheel, two: Wheel) -> Teeth:
    """The second, or the rack that is the second."""
    return Teeth(two.name, one.gear, rack=True) if two.part.rack else Teeth(two.name, two.gear)


def _pair(places: Places, one: Wheel, two: Wheel) -> _Placed:
    gears = one.gear, two.gear
    if one.part.internal and two.part.internal:
        raise InputError('one of the gears must have external teeth')
    signs = tuple(-1.0 if g.internal else 1.0 for g in gears)
    carrier, (here, there) = _carrier(places, one, two)
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
    return _Placed(
        carrier, towards, signs[1] * radii[0], pair.pressure_angle, path, left,
        f'a centre distance of {tight:.9g} m',
        (towards + (0.0 if signs[1] > 0.0 else math.pi),
         towards + (math.pi if signs[0] > 0.0 else 0.0)),
        gears[0].teeth * gears[0].half_angle(radii[0]),
        (signs[0] * gears[0].teeth, signs[1] * gears[1].teeth), (*here.by, *there.by),
    )  # fmt: skip


def _with_rack(places: Places, one: Wheel, two: Wheel) -> _Placed:
    gear = one.gear
    if gear.internal:
        raise InputError(f'the rack {two.name} needs a gear with external teeth')
    for n, joint in places.scene.joints.items():
        if not joint.prismatic:
            continue
        (a, on_a), (b, on_b) = (places.find(f'joints.{n}', p) for p in joint.points)
        shaft = _axes(places, one).get(a)
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
    reference = path_with_rack(gear)
    # the rack's tips reach less deep if it stands off
    start = reference.start + out / math.sin(gear.system.pressure_angle)
    path = Path(start, reference.end)
    if path.end - path.start < gear.base_pitch:
        raise InputError(
            'a pair of teeth lets go before the next one touches: without backlash the pitch '
            f'line is {tight:.9g} m from the centre'
        )
    slope = side * 2.0 / gear.module  # E n . t, with the pitch line on that side of the centre
    return _Placed(
        guide.first, guide.axis + side * 0.5 * math.pi, gear.pitch_radius,
        gear.system.pressure_angle, path, 2.0 * out * math.tan(gear.system.pressure_angle),
        f'a pitch line {tight:.9g} m from the centre',
        (guide.axis + side * 0.5 * math.pi, -along),
        gear.teeth * gear.half_angle(gear.pitch_radius), (gear.teeth, slope),
        (*shaft.by, guide.name), guide,
    )  # fmt: skip


class _Axis(NamedTuple):
    """Where a link turns about a gear's centre, and the joints on the way to it."""

    at: Vector2  #: [m] in the link's frame
    by: tuple[str, ...] = ()


def _axes(places: Places, wheel: Wheel) -> dict[str, _Axis]:
    """The links that turn about a gear's centre.

    Raises
    ------
    InputError
        If one does so with a clearance.
    """
    found = {wheel.link: _Axis(wheel.at)}
    waiting = [n for n, joint in places.scene.joints.items() if joint.revolute]
    while True:
        for n in waiting:
            ends = dict(places.find(f'joints.{n}', p) for p in places.scene.joints[n].points)
            here = [x for x in ends if x in found and math.dist(ends[x], found[x].at) < 1e-9]
            if here:
                by = (*found[here[0]].by, n)
                found = {x: _Axis(at, by) for x, at in ends.items()} | found
                waiting.remove(n)
                break
        else:
            break
        if places.scene.joints[n].clearance:
            raise InputError(
                f'the shaft of {wheel.name} has a clearance ({n}), so that its centre is nowhere '
                'fixed: gears need ideal bearings'
            )
    return found


def _carrier(places: Places, one: Wheel, two: Wheel) -> tuple[str, tuple[_Axis, _Axis]]:
    """The link on which both gears turn, the ground if possible, and their centres on it."""
    a, b = (_axes(places, x) for x in (one, two))
    both = [x for x in (GROUND, *places.links) if x in a and x in b]
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


def _play(joint: LinkageJoint, placed: _Placed, base_pitch: float) -> float:
    """Free way of the teeth to either side, along the line of action [m]."""
    backlash = joint.backlash
    if backlash is None:
        if placed.backlash:
            raise InputError(
                f'the teeth have a backlash of {placed.backlash:.3g} m: take {placed.tight}, or '
                "give them a 'backlash'"
            )
        return 0.0
    width = backlash.width if backlash.width is not None else placed.backlash
    if not width:
        raise InputError(
            'backlash.width is missing, and the distance of the centres leaves no play: give a '
            'width, or set the gears further apart'
        )
    if not joint.elasticity and backlash.restitution is None:
        raise InputError("'backlash.restitution' is missing: the teeth are rigid")
    if joint.elasticity and (backlash.contact or backlash.restitution is not None):
        raise InputError(
            'elastic teeth rebound by themselves: leave out backlash.restitution and '
            'backlash.contact'
        )
    largest = 0.5 * base_pitch / math.cos(placed.pressure_angle)
    if width >= largest:
        raise InputError(
            f'backlash.width is {width:.3g} m, as much as a tooth is thick: it must be less than '
            f'{largest:.3g} m'
        )
    return 0.5 * width * math.cos(placed.pressure_angle)


def _elasticity(joint: LinkageJoint, one: Wheel, placed: _Placed) -> Elasticity | None:
    given = joint.elasticity
    if given is None:
        return None
    pitch = one.gear.base_pitch
    asked = given.variation
    variation = touching(placed.path, pitch) if isinstance(asked, str) else asked
    lead = placed.half - middle(placed.path, pitch)
    return Elasticity(given.stiffness, given.damping, variation, 0.0, lead)


def _errors(
    where: str, joint: LinkageJoint, placed: _Placed, base_pitch: float
) -> tuple[Harmonic, ...]:
    error = joint.error
    if error is None:
        return ()
    if error.amplitude + sum(error.eccentricity) > 0.25 * base_pitch:
        raise InputError(
            f'{where}.error is more than half the thickness of a tooth: all of it must be less '
            f'than {0.25 * base_pitch:.3g} m'
        )
    found = []
    if error.amplitude:
        found.append(Harmonic(0, error.order * placed.waves[0], error.amplitude))
    for member, size in enumerate(error.eccentricity):
        if size and member and placed.guide:
            raise InputError(f'{where}.error.eccentricity: a rack has none: give [X, 0]')
        if size:
            found.append(Harmonic(member, 1.0, size))
    return tuple(found)


def read_transmission(places: Places, name: str, joint: LinkageJoint) -> Transmission:
    """Two links with a ratio.

    Raises
    ------
    InputError
        If there is no ratio, or one of the links is the carrier.
    """
    where = f'{places.name}: joints.{name}'
    if joint.ratio is None:
        raise InputError(f"{where}.ratio is missing: how fast the second turns, such as '1/2'")
    own = f'joints.{name}'
    (a, on_a), (b, on_b) = (places.find(f'{own}.transmission', p) for p in joint.points)
    carrier, _ = places.find(f'{own}.carrier', joint.carrier or GROUND)
    if carrier in (a, b):
        raise InputError(f'{where}: {carrier} carries the transmission: name two other links')
    return Transmission(
        name, a, b, on_a, on_b, Fraction(joint.ratio), joint.phase, carrier
    )  # fmt: skip


def check_bearings(places: Places, joints: tuple[Joint, ...], closing: Collection[str]) -> None:
    """Refuse gears whose shafts cannot all be joints of the tree.

    Raises
    ------
    InputError
    """
    for mesh in (j for j in joints if isinstance(j, GearMesh)):
        if torn := [n for n in mesh.bearings if n in closing]:
            raise InputError(
                f'{places.name}: joints.{mesh.name}: the shafts of gears form a closed loop, of '
                f'which {torn[0]} is one: leave out a mesh of that loop, or make it a transmission'
            )


def in_mesh(
    places: Places, joints: tuple[Joint, ...], tree: Mechanism, start: Mapping[str, float]
) -> tuple[Joint, ...]:
    """The joints, with the teeth of all gears in spaces at the start.

    Every gear may be fixed to its link at any angle. Where meshes close a ring, as those of two
    planets between sun and ring gear do, the last one may not fit.

    Parameters
    ----------
    start : coordinates; others are zero

    Raises
    ------
    InputError
        If the teeth of a mesh meet teeth.
    """
    q = {c: start.get(c, 0.0) for c in tree.coordinates}
    teeth: dict[str, float] = {}  # by gear: angle of a tooth in its link [rad], of a rack [m]
    placed: dict[str, GearMesh] = {}
    waiting = [j for j in joints if isinstance(j, GearMesh)]
    while waiting:
        near = [j for j in waiting if {*places.scene.joints[j.name].points} & teeth.keys()]
        mesh = near[0] if near else waiting[0]
        waiting.remove(mesh)
        one, two = places.scene.joints[mesh.name].points
        at = mesh.places(tree, q)
        phase = sum(w * x for w, x in zip(mesh.waves, at, strict=True))
        (w, v), (here, there) = mesh.waves, mesh.facing
        # a tooth of the one on the line of centres faces a space of the other
        both = phase - math.pi
        if one not in teeth:
            known = both - v * (there - teeth[two]) if two in teeth else w * here
            teeth[one] = here - known / w
        first = w * (here - teeth[one])
        if two not in teeth:
            teeth[two] = there - (both - first) / v
        second = v * (there - teeth[two])
        off = math.remainder(first + second - both, 2.0 * math.pi) / (2.0 * math.pi)
        if abs(off) > 1e-6:
            raise InputError(
                f'{places.name}: joints.{mesh.name}: the train cannot be assembled: the teeth of '
                f'{one} and {two} are {abs(off):.3g} pitches off, for other meshes hold both; '
                'change the angle between the planets, or the numbers of teeth'
            )
        elasticity = mesh.elasticity and replace(mesh.elasticity, tooth=first)
        errors = tuple(replace(e, start=at[e.member]) for e in mesh.errors)
        wheels = tuple(x._replace(tooth=teeth[x.name]) for x in mesh.wheels)
        placed[mesh.name] = replace(
            mesh, phase=phase, elasticity=elasticity, errors=errors, wheels=wheels
        )
    return tuple(placed.get(j.name, j) for j in joints)


def backlashes(places: Places, joints: tuple[Joint, ...]) -> dict[str, Play]:
    """How loose the meshes are that have play or give way."""
    found = {}
    for mesh in (j for j in joints if isinstance(j, GearMesh)):
        given = places.scene.joints[mesh.name].backlash
        if mesh.elastic:
            found[mesh.name] = Play(radial=mesh.play, restitution=0.0)
        elif given:
            found[mesh.name] = Play(
                radial=mesh.play, restitution=given.restitution or 0.0,
                hypothesis=given.hypothesis, contact=given.contact,
            )  # fmt: skip
    return found
