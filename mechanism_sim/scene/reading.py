"""Reading joints, bodies and values of coordinates of a scene, in SI units."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from mechanism_sim.errors import InputError, a_or_an
from mechanism_sim.keys.names import Names
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.joint_friction import JointFriction
from mechanism_sim.planar.mechanism import Joint, Mechanism
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.scene.elastic_links import loaded
from mechanism_sim.scene.schema import DrivePart
from mechanism_sim.scene.tilted_links import tilted
from mechanism_sim.units import QuantityValue

Values = dict[str, float]


def read_joints(names: Names) -> tuple[Joint, ...]:
    """All joints; every link must hang on the ground by them."""
    joints = []
    for name, joint in names.scene.joints.items():
        where = f'joints.{name}'
        if not name.isidentifier():
            raise InputError(
                f"{where}: the name '{name}' cannot be used; names are letters, digits and _"
            )
        joints.append(joint.kind_keys.read(names, name))
    held = [{*j.links} for j in joints]
    held += [{p.partition('.')[0] for p in x.between} for x in names.scene.bushings.values()]
    reached, grown = {GROUND}, True
    while grown:
        ends = [x for x in held if x & reached]
        grown = not set().union(*ends) <= reached
        reached |= set().union(*ends)
    if apart := [link for link in names.links if link not in reached]:
        raise InputError(
            f'the link {apart[0]} is not connected to the ground by joints; add a joint of it '
            "under 'joints'"
        )
    return tuple(joints)


def read_rotors(names: Names) -> dict[str, Rotor]:
    """Compliance of shaft and supports of the links that are rotors, by link."""
    found: dict[str, Rotor] = {}
    for name, joint in names.scene.joints.items():
        if not joint.kind_keys.gives_way:
            continue
        link, rotor = joint.kind_keys.rotor_of(names, name)
        own = names.scene.links[link]
        if link in found or own.elastic or own.tilt:
            raise InputError(
                f'joints.{name}: {link} is compliant already, as a rotor in another joint or by '
                "its key 'elastic' or 'tilt': leave one of them out"
            )
        found[link] = rotor
    return found


def read_frictions(
    names: Names, loose: Container[str]
) -> Callable[[Mechanism], list[JointFriction]]:
    """Friction in ideal joints, of a tree of the mechanism."""
    frictional = []
    for name, joint in names.scene.joints.items():
        given, own = joint.friction, joint.kind_keys
        if given is None or own.friction_keys is None:
            continue
        where, (keys, needed) = f'joints.{name}.friction', own.friction_keys
        for key in given.model_fields_set - {'coefficient', *keys}:
            if getattr(given, key) is not None:
                raise InputError(f'{where}.{key} has no meaning in {a_or_an(joint.kind)} joint')
        if needed and getattr(given, keys[0]) is None:
            raise InputError(f"{where} needs a '{keys[0]}', as {keys[0]}: 10 mm")
        if given.coefficient and name in loose and not own.friction_when_loose:
            raise InputError(
                f'{where}: the joint is loose: give the friction of its walls in its '
                "'clearance', 'lift_off', 'groove' or 'backlash'"
            )
        if given.coefficient or given.efficiency:
            frictional.append((name, joint, given))
    return lambda m: [
        x
        for name, joint, given in frictional
        for x in joint.kind_keys.frictions(given, m.joint(name), m)
    ]


def read_bodies(
    names: Names,
    tree: Mechanism,
    drives: Mapping[str, DrivePart],
    elastic: Mapping[str, Body],
    rotors: Mapping[str, Rotor],
) -> tuple[Body, ...]:
    """The moving links with what they weigh, point masses and flywheels included."""
    carried: dict[str, list[_Mass]] = {link: [] for link in names.links}
    for name, mass in names.scene.masses.items():
        on, at = names.find(f'masses.{name}.at', mass.at)
        if on == GROUND:
            raise InputError(f'masses.{name}.at: a mass on the ground moves nothing')
        carried[on].append(_Mass(mass.mass, 0.0, at))
    tilting = {  # blocks with play in their guides turn
        link
        for name, joint in names.scene.joints.items()
        if joint.kind == 'prismatic' and joint.clearance
        for link, _ in names.connected(name)
    }
    found = []
    for link in names.links:
        given, added = names.scene.links[link], 0.0
        if link in drives:
            added = drives[link].added_inertia
        if link in elastic:
            lumps = [(mass.size, mass.at) for mass in carried[link]]
            found.append(loaded(elastic[link], lumps, added))
            continue
        turns = tree.frame(link)[0] != GROUND or link in tilting
        if given.mass and given.inertia is None and turns:
            raise InputError(
                f"'links.{link}.inertia' is missing: the link has a mass and turns; give its "
                'moment of inertia about the centre of gravity (0 for a point mass)'
            )
        cog = given.cog if isinstance(given.cog, tuple) else (given.cog, 0.0)
        own = _Mass(given.mass or 0.0, given.inertia or 0.0, cog)
        body = _together(link, [own, *carried[link]])
        if given.mass is not None and not body.mass and link in rotors:
            raise InputError(
                f"'links.{link}.mass' is 0: the axis of the rotor could move without moving "
                'any mass: give it more'
            )
        rotor = rotors.get(link)
        inertia = body.inertia + added
        if rotor:
            body = replace(body, mass=body.mass + rotor.mass, extension=rotor)
            inertia += rotor.inertia
        found.append(tilted(replace(body, inertia=inertia), names, added))
    return tuple(found)


def read_values(
    names: Names,
    where: str,
    given: Mapping[str, QuantityValue],
    tree: Mechanism,
    units: tuple[str, str],
) -> Values:
    """Quantities by coordinate, in the first of the units for angles, else in the second."""
    for c in given:
        check_coordinate(f'{where}.{c}', c, tree)
    return {
        c if '.' in c and c in tree.coordinates else names.coordinate(where, c): names.measure(
            f'{where}.{c}', m, c in tree.displacements, units
        )
        for c, m in given.items()
        if not (where.startswith('initial') and floats(names, c, m, tree))
    }


def check_coordinate(where: str, link: str, tree: Mechanism) -> None:
    """Refuse the name of a link that moves with another, and has no coordinate."""
    if link not in tree.welded:
        return
    carrier = link
    while carrier in tree.welded:
        carrier = tree.parent(carrier)
    what = 'does not move' if carrier == GROUND else f'moves with {carrier}: name that'
    raise InputError(f'{where}: {link} is welded and {what}')


def floats(names: Names, name: str, measure: QuantityValue, tree: Mechanism) -> bool:
    """True if a quantity is one of a link that hangs on loose joints, and of `tree` is none.

    That is its place, ``LINK.x`` and ``LINK.y``, or the angle of a link that a guide of
    `tree` carries.
    """
    link, _, axis = name.partition('.')
    if axis:
        return link in names.links and axis in ('x', 'y') and name not in tree.coordinates
    return name in tree.displacements and measure.unit.startswith('rad')


class _Mass(NamedTuple):
    """A part of a link."""

    size: float  #: [kg]
    inertia: float  #: [kg m^2]
    at: Vector2  #: [m]


def _together(link: str, parts: Iterable[_Mass]) -> Body:
    """One rigid body of several masses, by the parallel axis theorem."""
    parts = list(parts)
    mass = sum(part.size for part in parts)
    if len(parts) == 1 or not mass:
        return Body(link, *parts[0])
    x, y = (sum(m * at[k] for m, _, at in parts) / mass for k in (0, 1))
    inertia = sum(i + m * ((at[0] - x) ** 2 + (at[1] - y) ** 2) for m, i, at in parts)
    return Body(link, mass, inertia, (x, y))
