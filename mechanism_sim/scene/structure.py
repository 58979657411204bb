"""The joints and bodies of a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from mechanism_sim.errors import InputError
from mechanism_sim.planar.joint_friction import JointFriction
from mechanism_sim.planar.mechanism import Body, Joint, Mechanism
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.scene.elastic_links import loaded
from mechanism_sim.scene.kinds import KINDS
from mechanism_sim.scene.places import Places
from mechanism_sim.scene.schema import DrivePart, JointPart
from mechanism_sim.scene.tilted_links import tilted


def read_joints(places: Places) -> tuple[Joint, ...]:
    """All joints; every link must hang on the ground by them."""
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
    kind = KINDS[joint.kind]
    for key in joint.model_fields_set - kind.keys.model_fields.keys():
        if getattr(joint, key):
            raise InputError(
                f'{places.name}: {where}.{key} has no meaning in a {joint.kind} joint'
            )
    return kind.read(places, name, joint)


def read_frictions(places: Places) -> Callable[[Mechanism], list[JointFriction]]:
    """Friction in ideal joints."""
    rubs = {}
    for name, joint in places.scene.joints.items():
        given, kind = joint.friction, KINDS[joint.kind]
        if given is None:
            continue
        where = f'{places.name}: joints.{name}.friction'
        keys, needed = kind.rubs_by
        for key in given.model_fields_set - {'coefficient', *keys}:
            if getattr(given, key) is not None:
                raise InputError(f'{where}.{key} has no meaning in a {kind.name} joint')
        if needed and getattr(given, keys[0]) is None:
            raise InputError(f"{where} needs a '{keys[0]}', as {keys[0]}: 10 mm")
        if given.coefficient and kind.play(joint) and not kind.slips:
            raise InputError(
                f"{where}: the joint is loose: give the friction of its walls in its 'clearance', "
                "'lift_off', 'groove' or 'backlash'"
            )
        if given.coefficient or given.efficiency:
            rubs[name] = given

    def made(mechanism: Mechanism) -> list[JointFriction]:
        makers = ((name, KINDS[places.scene.joints[name].kind].friction) for name in rubs)
        return [x for name, make in makers if make for x in make(name, rubs[name], mechanism)]

    return made


def read_rotors(places: Places) -> dict[str, Rotor]:
    """What gives way of the links that are rotors, by link."""
    found: dict[str, Rotor] = {}
    for name, joint in places.scene.joints.items():
        make = KINDS[joint.kind].rotor
        if make is None:
            continue
        link, rotor = make(places, name, joint)
        own = places.scene.links[link]
        if link in found or own.elastic or own.tilt:
            raise InputError(
                f'{places.name}: joints.{name}: {link} gives way already, as a rotor in another '
                "joint or by its key 'elastic' or 'tilt': leave one of them out"
            )
        found[link] = rotor
    return found


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
    places: Places,
    tree: Mechanism,
    drives: Mapping[str, DrivePart],
    elastic: Mapping[str, Body],
    rotors: Mapping[str, Rotor],
) -> tuple[Body, ...]:
    """The moving links with what they weigh, point masses and flywheels included."""
    found = []
    for name, mass in places.scene.masses.items():
        if places.find(f'masses.{name}.at', mass.at)[0] == GROUND:
            raise InputError(
                f'{places.name}: masses.{name}.at: a mass on the ground moves nothing'
            )
    tilting = {
        places.find(f'joints.{name}', point)[0]
        for name, joint in places.scene.joints.items()
        if joint.kind == 'prismatic' and joint.clearance
        for point in joint.points
    }
    for link in places.links:
        given = places.scene.links[link]
        if link in elastic:
            carried = [(m.mass, places.find('masses', m.at)) for m in places.scene.masses.values()]
            lumps = [(mass, point) for mass, (on, point) in carried if on == link]
            spin = drives[link].added_inertia if link in drives else 0.0
            found.append(loaded(elastic[link], lumps, spin))
            continue
        cog = given.cog if isinstance(given.cog, tuple) else (given.cog, 0.0)
        turns = tree.frame(link)[0] != GROUND or link in tilting
        if given.mass and given.inertia is None and turns:
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
        added = drives[link].added_inertia if link in drives else 0.0
        body = Body(link, body.mass, body.inertia + added, body.cog)
        if link in rotors:
            if given.mass is not None and not body.mass:
                raise InputError(
                    f"{places.name}: 'links.{link}.mass' is 0: the axis of the rotor could move "
                    'without moving any mass: give it more'
                )
            rotor = rotors[link]
            body = replace(
                body,
                mass=body.mass + rotor.mass,
                inertia=body.inertia + rotor.inertia,
                rotor=rotor,
            )
        found.append(tilted(body, places, added))
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
