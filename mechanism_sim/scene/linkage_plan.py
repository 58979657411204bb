"""From a linkage that is written out to its plan, refusing what does not fit together."""

from __future__ import annotations

from mechanism_sim.planar.drive import Law, TorqueLaw
from mechanism_sim.planar.mechanism import Body, Mechanism, closing_joints
from mechanism_sim.scene.cam_joints import cam_play
from mechanism_sim.scene.gear_joints import backlashes, check_bearings, in_mesh
from mechanism_sim.scene.linkage import LinkageScene
from mechanism_sim.scene.linkage_drives import is_straight, read_drives, read_laws
from mechanism_sim.scene.linkage_forces import read_forces
from mechanism_sim.scene.linkage_joints import read_bodies, read_joints
from mechanism_sim.scene.places import Places
from mechanism_sim.scene.plan import Plan
from mechanism_sim.scene.schema import Play
from mechanism_sim.scene.wheels import read_wheel

_PLACES, _PACES = ('rad', 'm'), ('rad/s', 'm/s')


def linkage_plan(name: str, scene: LinkageScene) -> Plan:
    """The plan of a scene that names its links and joints.

    Raises
    ------
    InputError
        One sentence: where, what, what is allowed, the nearest.
    """
    places = Places(name, scene)
    for gear in scene.gears:  # those that mesh with none, too
        read_wheel(places, gear)
    joints, drives = read_joints(places), read_drives(places)
    straight = [c for c, drive in drives.items() if is_straight(drive)]
    closing = closing_joints(places.links, joints, (), straight)
    check_bearings(places, joints, closing)
    massless = tuple(Body(link, 0.0, 0.0, (0.0, 0.0)) for link in places.links)
    tree = Mechanism(massless, joints, closing)
    laws: dict[str, tuple[Law, ...]] = {}
    begins: dict[str, tuple[float, float]] = {}
    for c, drive in drives.items():
        laws[c], begins[c] = read_laws(places, c, drive, tree)
    guess = places.values('guess', scene.guess, tree, _PLACES)
    given = places.values('initial.position', scene.initial.position, tree, _PLACES)
    begun = {c: x for c, (x, _) in begins.items()}
    joints = in_mesh(places, joints, tree, {**guess, **given, **begun})
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
        if (play := j.clearance or cam_play(j)) is not None
    }
    plays |= backlashes(places, joints)
    return Plan(
        read_bodies(places, tree, drives),
        joints,
        closing,
        scene.gravity,
        plays,
        laws or {free: (TorqueLaw(free),)},
        begins,
        (
            given,
            places.values('initial.velocity', scene.initial.velocity, tree, _PACES),
        ),
        (silent, frozenset(c for c, drive in drives.items() if drive.speed is None)),
        guess,
        places.points,
        read_forces(places, tree),
        all(scene.links[x].mass is not None or x in weighing for x in places.links),
    )
