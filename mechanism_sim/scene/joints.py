"""The joints and bodies of a linkage that is written out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.indexing import Geneva, SlottedRack
from mechanism_sim.linkages.slot import PinInSlot
from mechanism_sim.planar.mechanism import (
    GROUND,
    Body,
    Joint,
    Mechanism,
    Prismatic,
    Revolute,
    Vector2,
)
from mechanism_sim.scene.cam_joints import read_cam
from mechanism_sim.scene.cam_keys import CamKeys
from mechanism_sim.scene.gear_joints import read_mesh, read_transmission
from mechanism_sim.scene.places import Places
from mechanism_sim.scene.schema import KINDS, DrivePart, JointPart

_BELONGS = {
    'axis': ('prismatic', 'slot'),
    'angle': ('prismatic',),
    'slots': ('geneva',),
    'pitch': ('rack',),
    **dict.fromkeys(CamKeys.model_fields, ('cam',)),
    'backlash': ('mesh',),
    'elasticity': ('mesh',),
    'error': ('mesh',),
    'ratio': ('transmission',),
    'phase': ('cam', 'transmission'),
    'carrier': ('transmission',),
}


def keys_of(joint: JointPart) -> list[str]:
    """The keys that have a meaning in a joint of this kind."""
    others = set(KINDS) - {joint.kind}
    firm = joint.kind in ('prismatic', 'mesh', 'transmission')
    keys = [joint.kind, *JointPart.__annotations__, *JointPart.model_fields]
    return [
        key
        for key in dict.fromkeys(keys)
        if key not in others
        and joint.kind in _BELONGS.get(key, (joint.kind,))
        and not (firm and key == 'clearance')
    ]


def read_joints(places: Places) -> tuple[Joint, ...]:
    """All joints; every link must hang on the ground by them.

    Raises
    ------
    InputError
        If a point is not there, keys do not fit the kind, or a link hangs on nothing.
    """
    joints = tuple(_joint(places, name, j) for name, j in places.scene.joints.items())
    _check_connected(places, joints)
    return joints


def _joint(places: Places, name: str, joint: JointPart) -> Joint:
    where = f'joints.{name}'
    if not name.isidentifier():
        raise InputError(
            f"{places.name}: {where}: the name '{name}' cannot be used; names are letters, "
            'digits and _'
        )
    for key, kinds in _BELONGS.items():
        if getattr(joint, key) and joint.kind not in kinds:
            raise InputError(
                f'{places.name}: {where}.{key} has no meaning in a {joint.kind} joint'
            )
    if joint.kind == 'mesh':
        return read_mesh(places, name, joint)
    (a, on_a), (b, on_b) = (places.find(f'{where}.{joint.kind}', p) for p in joint.points)
    if a == b:
        raise InputError(
            f'{places.name}: {where}.{joint.kind} ties the link {a} to itself: give points of '
            'two links'
        )
    if joint.kind == 'transmission':
        return read_transmission(places, name, joint)
    if joint.kind == 'revolute':
        return Revolute(name, a, b, on_a, on_b)
    if joint.kind == 'slot':
        return PinInSlot(name, a, b, on_a, on_b, joint.axis)
    if joint.kind == 'geneva':
        return _geneva(places, name, joint, (a, on_a), (b, on_b))
    if joint.kind == 'rack':
        return _rack(places, name, joint, (a, on_a), (b, on_b))
    if joint.kind == 'cam':
        return read_cam(places, name, joint, (a, on_a), (b, on_b))
    return Prismatic(name, a, b, on_a, on_b, joint.axis, joint.angle)


def _geneva(
    places: Places,
    name: str,
    joint: JointPart,
    pin: tuple[str, Vector2],
    wheel: tuple[str, Vector2],
) -> Geneva:
    where = f'joints.{name}'
    if joint.slots is None:
        raise InputError(f"{places.name}: '{where}.slots' is missing: how many the wheel has")
    (ox, oy), on_crank = places.pivot(where, pin[0])
    (wx, wy), on_wheel = places.pivot(where, wheel[0])
    if wheel[1] != on_wheel:
        raise InputError(f'{places.name}: {where}: name the point where the wheel is pivoted')
    radius, b = math.dist(pin[1], on_crank), math.hypot(ox - wx, oy - wy)
    right = radius / math.sin(math.pi / joint.slots)
    if abs(b - right) > 1e-6 * right:
        raise InputError(
            f'{places.name}: {where}: with {joint.slots} slots and the pin {radius:.9g} m from '
            f'its centre, the centres must be {right:.9g} m apart, not {b:.9g} m: else the '
            'pin strikes the slot where it enters'
        )
    entry = right * math.cos(math.pi / joint.slots)
    towards = math.atan2(oy - wy, ox - wx)
    return Geneva(name, pin[0], wheel[0], pin[1], wheel[1], joint.slots, towards, right, entry)


def _rack(
    places: Places,
    name: str,
    joint: JointPart,
    pin: tuple[str, Vector2],
    rack: tuple[str, Vector2],
) -> SlottedRack:
    where = f'joints.{name}'
    centre, on_crank = places.pivot(where, pin[0])
    guides = [
        j for n, j in places.scene.joints.items()
        if j.prismatic
        and [places.find(f'joints.{n}', p)[0] for p in j.points] == [GROUND, rack[0]]
    ]  # fmt: skip
    if not guides:
        raise InputError(
            f'{places.name}: {where}: {rack[0]} must slide on the ground: add a joint '
            f"'prismatic: [ground, {rack[0]}]'"
        )
    pitch = 2.0 * math.dist(pin[1], on_crank)
    if joint.pitch is None or abs(joint.pitch - pitch) > 1e-6 * pitch:
        raise InputError(
            f"{places.name}: '{where}.pitch' must be twice the radius of the pin's circle, "
            f'{pitch:.9g} m: else the pin strikes the slot where it enters'
        )
    return SlottedRack(name, pin[0], rack[0], pin[1], rack[1], pitch, guides[0].axis, centre)


def _check_connected(places: Places, joints: Iterable[Joint]) -> None:
    reached, grown = {GROUND}, True
    while grown:
        ends = [{j.first, j.second} for j in joints if {j.first, j.second} & reached]
        grown = not set().union(*ends) <= reached
        reached |= set().union(*ends)
    apart = [link for link in places.links if link not in reached]
    if apart:
        raise InputError(
            f'{places.name}: the link {apart[0]} is not connected to the ground by joints; '
            "add a joint of it under 'joints'"
        )


def read_bodies(
    places: Places, tree: Mechanism, drives: Mapping[str, DrivePart]
) -> tuple[Body, ...]:
    """The moving links with what they weigh, point masses and flywheels included.

    Raises
    ------
    InputError
        If a link that turns has a mass, but no inertia.
    """
    found = []
    for name, mass in places.scene.masses.items():
        if places.find(f'masses.{name}.at', mass.at)[0] == GROUND:
            raise InputError(
                f'{places.name}: masses.{name}.at: a mass on the ground moves nothing'
            )
    for link in places.links:
        given = places.scene.links[link]
        cog = given.cog if isinstance(given.cog, tuple) else (given.cog, 0.0)
        turns = tree.frame(link)[0] != GROUND
        if given.mass is not None and given.inertia is None and turns:
            raise InputError(
                f"{places.name}: 'links.{link}.inertia' is missing: the link has a mass and "
                'turns; give its moment of inertia about the centre of gravity (0 for a point '
                'mass)'
            )
        parts = [(given.mass or 0.0, given.inertia or 0.0, cog)]
        for name, mass in places.scene.masses.items():
            on, at = places.find(f'masses.{name}.at', mass.at)
            if on == link:
                parts.append((mass.mass, 0.0, at))
        body = _together(link, parts)
        if link in drives:
            body = Body(link, body.mass, body.inertia + drives[link].flywheel, body.cog)
        found.append(body)
    return tuple(found)


def _together(link: str, parts: Iterable[tuple[float, float, Vector2]]) -> Body:
    """One rigid body of several masses, by the parallel axis theorem."""
    parts = list(parts)
    mass = sum(m for m, _, _ in parts)
    if len(parts) == 1 or not mass:
        m, inertia, cog = parts[0]
        return Body(link, m, inertia, cog)
    x, y = (sum(m * at[k] for m, _, at in parts) / mass for k in (0, 1))
    inertia = sum(i + m * ((at[0] - x) ** 2 + (at[1] - y) ** 2) for m, i, at in parts)
    return Body(link, mass, inertia, (x, y))
