"""What a scene's mechanism is: links, joints, drives and forces that fit together.

A `Plan` is all of a machine that follows from reading its scene: names are resolved, everything is
in SI units, teeth are in mesh and belts put on. Loops are not closed yet, nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.clock import take_off_turns
from mechanism_sim.joints.contact_keys import Play
from mechanism_sim.joints.kinds import KINDS
from mechanism_sim.keys.names import Names, kind_of
from mechanism_sim.linkages.forces import DriveEffort, UnknownForce
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw
from mechanism_sim.planar.joint_friction import JointFriction
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import (
    HigherPair,
    Joint,
    Mechanism,
    bending_guides,
    closing_joints,
)
from mechanism_sim.planar.points import GROUND, Vector2
from mechanism_sim.planar.protocols import ForceElement, Relation
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.scene.drives import drive_key, is_straight, read_drives, read_laws, read_motor
from mechanism_sim.scene.elastic_links import loaded, read_beams
from mechanism_sim.scene.loads import read_loads
from mechanism_sim.scene.loads.applied import read_effort
from mechanism_sim.scene.schema import DrivePart, Scene
from mechanism_sim.scene.tilted_links import check_tilts, tilted, without_mass
from mechanism_sim.units import QuantityValue

_PLACES, _PACES = ('rad', 'm'), ('rad/s', 'm/s')

Values = dict[str, float]


class Plan(Names):
    """Links, joints, drives and forces of a scene, in SI units.

    Attributes
    ----------
    bodies : the moving links; those without mass data are massless
    joints : between them
    closing : which of them are cut to make a tree if none is loose
    clearances : of the loose ones
    laws : of the driven coordinates, in the order in which they take over
    begins : of the coordinates moved by a torque or a force, and of the elastic ones, value and
        rate at the start
    given : values and rates of coordinates that the scene sets outright
    floating : the same of coordinates that only the machine with its clearances has
    assumed : of `begins`, the coordinates of whose values and of whose rates nobody said anything
    guess : rough values of coordinates
    frictions : of ideal joints, of a tree of the mechanism
    efforts : what prescribed drives supply, where it is given
    motors : of the driven coordinates that have one whose torque is no straight line over speed
    weighed : whether every link has the mass properties that forces need
    """

    scene: Scene

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        joints, drives = self._read_joints(), read_drives(self)
        elastic = read_beams(self, joints, drives)
        straight = [c for c, drive in drives.items() if is_straight(drive)]
        bending = bending_guides([*elastic.values()], joints)
        self.closing = closing_joints(self.links, joints, bending, straight)
        for kind in KINDS.values():
            kind.check_all(self, joints, self.closing)
        check_tilts(self, joints)
        rotors = self._read_rotors()
        massless = tuple(
            elastic.get(link) or without_mass(self, link, rotors.get(link)) for link in self.links
        )
        tree = Mechanism(massless, joints, self.closing)
        positions = self._read_drives(drives, tree)
        begun = {c: x for c, (x, _) in self.begins.items()}
        start = {**self.guess, **positions, **begun}
        for kind in KINDS.values():
            joints = kind.assembled(self, joints, tree, start)
        self.joints = tuple(
            keys.kind_keys.mounted(keys, joint, start, self._turns)
            for joint in joints
            for keys in [scene.joints[joint.name]]
        )
        self.begins |= {c: (positions.get(c, 0.0), 0.0) for c in tree.deformations}
        self.clearances: dict[str, Play] = {
            joint.name: play
            for joint in sorted(self.joints, key=lambda x: scene.joints[x.name].kind_keys.last)
            for keys in [scene.joints[joint.name]]
            if (play := keys.kind_keys.play(keys, joint)) is not None
        }
        self._loads = read_loads(self, tree)
        self.efforts: dict[str, Callable[[Mechanism], DriveEffort]] = {
            c: read_effort(self, f'{drive_key(self, c)}.effort', c, drive.effort, tree)
            for c, drive in drives.items()
            if drive.effort is not None
        }
        self.bodies = self._read_bodies(tree, drives, elastic, rotors)
        rates = self._values('initial.velocity', scene.initial.velocity, tree, _PACES)
        self.given = positions, rates
        self.frictions = self._read_frictions()
        self.motors = tuple(
            motor for c, drive in drives.items() if (motor := read_motor(c, drive)) is not None
        )
        weighing = {mass.at.partition('.')[0] for mass in scene.masses.values()} | elastic.keys()
        self.weighed = all(scene.links[x].mass is not None or x in weighing for x in self.links)
        self.floating = self._read_floating(tree)

    # --- joints and bodies ----------------------------------------------------------------------

    def _read_joints(self) -> tuple[Joint, ...]:
        """All joints; every link must hang on the ground by them."""
        joints = []
        for name, joint in self.scene.joints.items():
            where = f'joints.{name}'
            if not name.isidentifier():
                raise InputError(
                    f"{where}: the name '{name}' cannot be used; names are letters, digits and _"
                )
            for key in joint.model_fields_set - joint.kind_keys.model_fields.keys():
                if getattr(joint, key):
                    raise InputError(f'{where}.{key} has no meaning in a {joint.kind} joint')
            joints.append(joint.kind_keys.read(joint, self, name))
        reached, grown = {GROUND}, True
        while grown:
            ends = [{j.first, j.second} for j in joints if {j.first, j.second} & reached]
            grown = not set().union(*ends) <= reached
            reached |= set().union(*ends)
        if apart := [link for link in self.links if link not in reached]:
            raise InputError(
                f'the link {apart[0]} is not connected to the ground by joints; add a joint of it '
                "under 'joints'"
            )
        return tuple(joints)

    def _read_rotors(self) -> dict[str, Rotor]:
        """Compliance of shaft and supports of the links that are rotors, by link."""
        found: dict[str, Rotor] = {}
        for name, joint in self.scene.joints.items():
            if not joint.kind_keys.gives_way:
                continue
            link, rotor = joint.kind_keys.rotor_of(joint, self, name)
            own = self.scene.links[link]
            if link in found or own.elastic or own.tilt:
                raise InputError(
                    f'joints.{name}: {link} gives way already, as a rotor in another joint or by '
                    "its key 'elastic' or 'tilt': leave one of them out"
                )
            found[link] = rotor
        return found

    def _read_frictions(self) -> Callable[[Mechanism], list[JointFriction]]:
        """Friction in ideal joints, of a tree of the mechanism."""
        rubs = []
        for name, joint in self.scene.joints.items():
            given, own = joint.friction, joint.kind_keys
            if given is None or own.rubs_by is None:
                continue
            where, (keys, needed) = f'joints.{name}.friction', own.rubs_by
            for key in given.model_fields_set - {'coefficient', *keys}:
                if getattr(given, key) is not None:
                    raise InputError(f'{where}.{key} has no meaning in a {joint.kind} joint')
            if needed and getattr(given, keys[0]) is None:
                raise InputError(f"{where} needs a '{keys[0]}', as {keys[0]}: 10 mm")
            if given.coefficient and name in self.clearances and not own.rubs_loose:
                raise InputError(
                    f'{where}: the joint is loose: give the friction of its walls in its '
                    "'clearance', 'lift_off', 'groove' or 'backlash'"
                )
            if given.coefficient or given.efficiency:
                rubs.append((name, joint, given))
        return lambda m: [
            x
            for name, joint, given in rubs
            for x in joint.kind_keys.frictions(joint, given, m.joint(name), m)
        ]

    def _read_bodies(
        self,
        tree: Mechanism,
        drives: Mapping[str, DrivePart],
        elastic: Mapping[str, Body],
        rotors: Mapping[str, Rotor],
    ) -> tuple[Body, ...]:
        """The moving links with what they weigh, point masses and flywheels included."""
        carried: dict[str, list[_Mass]] = {link: [] for link in self.links}
        for name, mass in self.scene.masses.items():
            on, at = self.find(f'masses.{name}.at', mass.at)
            if on == GROUND:
                raise InputError(f'masses.{name}.at: a mass on the ground moves nothing')
            carried[on].append(_Mass(mass.mass, 0.0, at))
        tilting = {  # blocks with play in their guides turn
            link
            for name, joint in self.scene.joints.items()
            if joint.kind == 'prismatic' and joint.clearance
            for link, _ in self.connected(name)
        }
        found = []
        for link in self.links:
            given, added = self.scene.links[link], 0.0
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
            found.append(tilted(replace(body, inertia=inertia), self, added))
        return tuple(found)

    # --- drives and the start -------------------------------------------------------------------

    def _read_drives(self, drives: Mapping[str, DrivePart], tree: Mechanism) -> Values:
        """Laws of the drives and where they begin; the positions that the scene sets outright."""
        initial, straight = self.scene.initial.position, tree.displacements
        given = self._values('initial.position', initial, tree, _PLACES)
        self.guess = self._values('guess', self.scene.guess, tree, _PLACES)
        self.laws: dict[str, tuple[Law, ...]] = {}
        self.begins: dict[str, tuple[float, float]] = {}
        positions, self._turns = dict(given), dict[str, int]()
        for c in given.keys() - straight:  # angles that many turns make lose no digits here
            self._turns[c], positions[c] = take_off_turns(given[c])
        for c, drive in drives.items():
            self.laws[c], self.begins[c], self._turns[c] = read_laws(
                self, c, drive, c in straight, given.get(c), self.guess.get(c, 0.0)
            )
        if not self.laws:
            free = tree.coordinates[0]
            self.laws = {free: (TorqueLaw(free),)}
        said = positions | self.guess
        silent = (
            c
            for c, drive in drives.items()
            if drive.start_angle is None and drive.start_position is None and c not in said
        )
        paceless = (c for c, drive in drives.items() if drive.speed is None)
        self.assumed = frozenset(silent), frozenset(paceless)
        return positions

    def _values(
        self,
        where: str,
        given: Mapping[str, QuantityValue],
        tree: Mechanism,
        units: tuple[str, str],
    ) -> Values:
        """Quantities by coordinate, in the first of the units for angles, else in the second."""
        return {
            c if '.' in c and c in tree.coordinates else self.coordinate(where, c): self.measure(
                f'{where}.{c}', m, c in tree.displacements, units
            )
            for c, m in given.items()
            if not (where.startswith('initial') and self._floats(c, m, tree))
        }

    def _floats(self, name: str, measure: QuantityValue, tree: Mechanism) -> bool:
        """True if a quantity is one of a link that hangs on loose joints, and of `tree` is none.

        That is its place, ``LINK.x`` and ``LINK.y``, or the angle of a link that a guide of
        `tree` carries.
        """
        link, _, axis = name.partition('.')
        if axis:
            return link in self.links and axis in ('x', 'y') and name not in tree.coordinates
        return name in tree.displacements and measure.unit.startswith('rad')

    def _read_floating(self, tree: Mechanism) -> tuple[Values, Values]:
        """Values and rates of the coordinates that only the machine with its clearances has."""
        initial = self.scene.initial
        found: list[Values] = []
        for kind, part, unit in (
            ('position', initial.position, 'm'),
            ('velocity', initial.velocity, 'm/s'),
        ):
            found.append({})
            for c, measure in part.items():
                if not self._floats(c, measure, tree):
                    continue
                where, loose, link = f'initial.{kind}.{c}', self.loose, c.partition('.')[0]
                if c not in loose.coordinates or (c in self.links and c in loose.displacements):
                    raise InputError(
                        f'{where} cannot be set: {link} hangs on a joint without clearance, so '
                        f"that its only coordinate is '{link}', "
                        f'{kind_of(link in loose.displacements)}'
                    )
                lies = '.' in c
                found[-1][c] = self.measure(where, measure, True, ('', unit)) if lies else (
                    measure.value
                )  # fmt: skip
        return found[0], found[1]

    # --- the mechanism --------------------------------------------------------------------------

    def mechanism(self, cut: Sequence[str]) -> Mechanism:
        """The tree that is left when some joints are cut."""
        scene = self.scene
        return Mechanism(self.bodies, self.joints, tuple(cut), scene.gravity, scene.axial_gravity)

    @cached_property
    def ideal(self) -> Mechanism:
        """The mechanism without clearance."""
        return self.mechanism(self.closing)

    @cached_property
    def loose(self) -> Mechanism:
        """The mechanism cut at its loose joints, and where loops are left then."""
        if not self.clearances:
            return self.ideal
        cut = [*self.clearances, *(j for j in self.bending if j not in self.clearances)]
        straight = [c for c in self.laws if c in self.ideal.displacements]
        while True:
            found = self.mechanism(closing_joints(self.links, self.joints, cut, straight))
            # a link whose angle is driven must not be carried by a guide: it would lose its angle
            guides = [
                found.tree_joints[c].name
                for c in self.laws
                if c in found.displacements and c not in straight
            ]
            if not guides:
                return found
            cut += guides

    @property
    def bending(self) -> list[str]:
        """The guides of elastic links."""
        return bending_guides(self.bodies, self.joints)

    @property
    def elastic(self) -> list[str]:
        """The joints that have forces of their own instead of constraints."""
        return [j.name for j in self.joints if isinstance(j, HigherPair) and j.elastic]

    @property
    def rigid(self) -> dict[str, Play]:
        """The clearances of joints whose contacts the engine opens and closes."""
        return {name: c for name, c in self.clearances.items() if name not in self.elastic}

    def elements(self, tree: Mechanism) -> list[ForceElement]:
        """Springs, dampers and loads."""
        return [x for x in self._loads(tree) if not isinstance(x, UnknownForce)]

    def unknowns(self, tree: Mechanism) -> list[UnknownForce]:
        """Loads of size one whose size is to be found."""
        return [x for x in self._loads(tree) if isinstance(x, UnknownForce)]

    # --- how it is driven -----------------------------------------------------------------------

    @property
    def main(self) -> str:
        """The coordinate whose revolutions count: the first that is driven."""
        return next(iter(self.laws))

    @cached_property
    def prescribed(self) -> list[str]:
        """The coordinates whose motion is given."""
        return [c for c, laws in self.laws.items() if isinstance(laws[0], DriveLaw)]

    @property
    def powered(self) -> list[str]:
        """The coordinates that a torque or a force moves."""
        return [c for c in self.laws if c not in self.prescribed]

    @property
    def placed_outright(self) -> bool:
        """True if the scene itself says where links start, beside the main drive."""
        return bool((self.given[0].keys() | self.given[1]) - {self.main}) or any(self.floating)

    @cached_property
    def _local(self) -> dict[str, tuple[int, tuple[float, ...]]]:
        """Whole turns, and the first law in powers of the time, of prescribed coordinates."""
        laws = ((c, self.laws[c][0]) for c in self.prescribed)
        return {c: law.about(Fraction(0)) for c, law in laws if isinstance(law, DriveLaw)}

    @cached_property
    def held(self) -> dict[str, tuple[float, float]]:
        """Values and rates at the start of the coordinates that drives move."""
        return self.begins | {
            c: (local[0], local[1] if len(local) > 1 else 0.0)
            for c, (_, local) in self._local.items()
        }

    @cached_property
    def turned(self) -> dict[str, int]:
        """Whole turns of angles at the start that `held` and `given` leave out."""
        return self._turns | {c: turns for c, (turns, _) in self._local.items()}

    def law_at(self, c: str, t: float = 0.0) -> tuple[float, float, float]:
        """Value, rate and acceleration, a time [s] from the start, by a coordinate's first law."""
        value, rate, half, third, *_ = *self._local[c][1], 0.0, 0.0, 0.0
        return (
            value + t * (rate + t * (half + t * third)),
            rate + t * (2.0 * half + 3.0 * t * third),
            2.0 * half + 6.0 * third * t,
        )

    def outside_at_start(self, names: Sequence[str], t: float = 0.0) -> Array:
        """Values (k, 1) of what `Frames.outside` names, at the turns of the start."""
        found = [t if n == 'time' else self.turned.get(n.removesuffix('.turns'), 0) for n in names]
        return np.reshape(np.array(found, float), (-1, 1))

    @cached_property
    def _ideal_loops(self) -> Kinematics:
        return Kinematics(self.ideal, closures(self.ideal, self.ideal.cut), ())

    def kinematics(self, held: Sequence[str]) -> Kinematics:
        """The closures of the mechanism without clearance, with some coordinates given."""
        return self._ideal_loops.holding(held)

    @property
    def loop_closures(self) -> list[Relation]:
        """The closures of the loops that ideal joints close in the mechanism with clearances."""
        joints = [joint for joint in self.loose.cut if joint not in self.clearances]
        return closures(self.loose, joints)

    @cached_property
    def _loops(self) -> Kinematics:
        return Kinematics(self.loose, self.loop_closures, ())

    def loops(self, held: Sequence[str]) -> Kinematics:
        """The same as numbers, with some coordinates given."""
        return self._loops.holding(held)


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
