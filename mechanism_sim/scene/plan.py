"""What a scene's mechanism is: links, joints, drives and forces that fit together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from mechanism_sim.hybrid.clock import take_off_turns
from mechanism_sim.linkages.forces import DriveEffort, UnknownForce
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw
from mechanism_sim.planar.joint_friction import JointFriction
from mechanism_sim.planar.mechanism import (
    Body,
    HigherPair,
    Joint,
    Mechanism,
    bending_guides,
    closing_joints,
)
from mechanism_sim.planar.motor import Motor
from mechanism_sim.planar.points import Vector2
from mechanism_sim.scene.contact_keys import Play
from mechanism_sim.scene.drives import drive_key, is_straight, read_drives, read_laws, read_motor
from mechanism_sim.scene.elastic_links import read_beams
from mechanism_sim.scene.gears import read_wheel
from mechanism_sim.scene.kinds import KINDS
from mechanism_sim.scene.kinds.mesh import backlashes, check_bearings, in_mesh
from mechanism_sim.scene.load_keys import Elements
from mechanism_sim.scene.loads import read_loads
from mechanism_sim.scene.loads.applied import read_effort
from mechanism_sim.scene.places import Places
from mechanism_sim.scene.schema import Scene
from mechanism_sim.scene.structure import read_bodies, read_frictions, read_joints, read_rotors
from mechanism_sim.scene.tilted_links import check_tilts, without_mass

_PLACES, _PACES = ('rad', 'm'), ('rad/s', 'm/s')


@dataclass(frozen=True)
class Plan:
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
    turned : whole turns of angles at the start which `begins` and `given` leave out
    guess : rough values of coordinates
    points : named points of the links, in their frames [m]
    elements : springs, dampers and loads
    frictions : of ideal joints
    unknowns : loads of size one whose size is to be found
    efforts : what prescribed drives supply, where it is given
    motors : of the driven coordinates that have one whose torque is no straight line over speed
    weighed : whether every link has the mass properties that forces need
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    closing: tuple[str, ...]
    gravity: Vector2
    axial_gravity: float
    clearances: dict[str, Play]
    laws: dict[str, tuple[Law, ...]]
    begins: dict[str, tuple[float, float]]
    given: tuple[dict[str, float], dict[str, float]] = field(default_factory=lambda: ({}, {}))
    floating: tuple[dict[str, float], dict[str, float]] = field(default_factory=lambda: ({}, {}))
    assumed: tuple[frozenset[str], frozenset[str]] = (frozenset(), frozenset())
    turned: dict[str, int] = field(default_factory=dict)
    guess: dict[str, float] = field(default_factory=dict)
    points: dict[str, dict[str, Vector2]] = field(default_factory=dict)
    elements: Elements = lambda _: []
    frictions: Callable[[Mechanism], list[JointFriction]] = lambda _: []
    unknowns: Callable[[Mechanism], list[UnknownForce]] = lambda _: []
    efforts: Mapping[str, Callable[[Mechanism], DriveEffort]] = field(default_factory=dict)
    motors: tuple[Motor, ...] = ()
    weighed: bool = True

    def mechanism(self, cut: Sequence[str]) -> Mechanism:
        """The tree that is left when some joints are cut."""
        return Mechanism(self.bodies, self.joints, tuple(cut), self.gravity, self.axial_gravity)

    @property
    def ideal(self) -> Mechanism:
        """The mechanism without clearance."""
        return self.mechanism(self.closing)

    @property
    def loose(self) -> Mechanism:
        """The mechanism cut at its loose joints, and where loops are left then."""
        if not self.clearances:
            return self.ideal
        links, cut = [body.name for body in self.bodies], [*self.clearances]
        cut += [j for j in self.bending if j not in cut]
        straight = [c for c in self.laws if c in self.ideal.displacements]
        while True:
            found = self.mechanism(closing_joints(links, self.joints, cut, straight))
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

    @property
    def prescribed(self) -> list[str]:
        """The coordinates whose motion is given."""
        return [c for c, laws in self.laws.items() if isinstance(laws[0], DriveLaw)]

    @property
    def powered(self) -> list[str]:
        """The coordinates that a torque or a force moves."""
        return [c for c in self.laws if c not in self.prescribed]


def plan_of(name: str, scene: Scene) -> Plan:
    """The plan of a scene that names its links and joints."""
    places = Places(name, scene)
    for gear in scene.gears:  # those that mesh with none, too
        read_wheel(places, gear)
    joints, drives = read_joints(places), read_drives(places)
    straight = [c for c, drive in drives.items() if is_straight(drive)]
    elastic = read_beams(places, joints, drives)
    bending = bending_guides([*elastic.values()], joints)
    closing = closing_joints(places.links, joints, bending, straight)
    check_bearings(places, joints, closing)
    check_tilts(places, joints)
    rotors = read_rotors(places)
    massless = tuple(
        elastic.get(link) or replace(without_mass(places, link), rotor=rotors.get(link))
        for link in places.links
    )
    tree = Mechanism(massless, joints, closing)
    laws: dict[str, tuple[Law, ...]] = {}
    begins: dict[str, tuple[float, float]] = {}
    turned: dict[str, int] = {}
    given = places.values('initial.position', scene.initial.position, tree, _PLACES)
    for c in given.keys() - tree.displacements:  # angles that many turns make lose no digits here
        turned[c], given[c] = take_off_turns(given[c])
    for c, drive in drives.items():
        laws[c], begins[c], turned[c] = read_laws(places, c, drive, tree)
    guess = places.values('guess', scene.guess, tree, _PLACES)
    begun = {c: x for c, (x, _) in begins.items()}
    start = {**guess, **given, **begun}
    joints = tuple(
        KINDS[scene.joints[joint.name].kind].mounted(joint, start, turned)
        for joint in in_mesh(places, joints, tree, start)
    )
    begins |= {c: (given.get(c, 0.0), 0.0) for c in tree.deformations}
    free = tree.coordinates[0]
    silent = frozenset(
        c
        for c, drive in drives.items()
        if drive.start_angle is None and drive.start_position is None and c not in given | guess
    )
    weighing = {mass.at.partition('.')[0] for mass in scene.masses.values()}
    plays: dict[str, Play] = {
        joint: play
        for joint, j in scene.joints.items()
        if (play := KINDS[j.kind].play(j)) is not None
    }
    plays |= backlashes(places, joints)
    loads = read_loads(places, tree)
    efforts = {
        c: read_effort(places, f'{drive_key(places, c)}.effort', c, drive.effort, tree)
        for c, drive in drives.items()
        if drive.effort is not None
    }
    plan = Plan(
        read_bodies(places, tree, drives, elastic, rotors),
        joints,
        closing,
        scene.gravity,
        scene.axial_gravity,
        plays,
        laws or {free: (TorqueLaw(free),)},
        begins,
        (
            given,
            places.values('initial.velocity', scene.initial.velocity, tree, _PACES),
        ),
        ({}, {}),
        (silent, frozenset(c for c, drive in drives.items() if drive.speed is None)),
        turned,
        guess,
        places.points,
        lambda m: [x for x in loads(m) if not isinstance(x, UnknownForce)],
        read_frictions(places),
        lambda m: [x for x in loads(m) if isinstance(x, UnknownForce)],
        efforts,
        tuple(m for c, drive in drives.items() if (m := read_motor(c, drive)) is not None),
        all(
            scene.links[x].mass is not None or x in weighing or x in elastic for x in places.links
        ),
    )
    initial = (
        ('position', scene.initial.position, 'm'),
        ('velocity', scene.initial.velocity, 'm/s'),
    )
    if not any(places.floats(c, m, tree) for _, part, _ in initial for c, m in part.items()):
        return plan
    floating = [places.floating(f'initial.{kind}', part, tree, plan.loose, unit)
                for kind, part, unit in initial]  # fmt: skip
    return replace(plan, floating=(floating[0], floating[1]))
