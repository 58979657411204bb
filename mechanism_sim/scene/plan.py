"""The mechanism of a scene: links, joints, drives and forces that fit together.

A `ScenePlan` is all of a machine that follows from reading its scene: names are resolved,
everything is in SI units, teeth are in mesh and belts put on. Loops are not closed yet, nothing is
compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import islice, takewhile

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.clock import take_off_turns
from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.snapshot import State
from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import ClearanceSpec
from mechanism_sim.joints.kinds import KINDS
from mechanism_sim.keys.names import Names, kind_of
from mechanism_sim.linkages.forces import DriveEffort, UnknownForce
from mechanism_sim.linkages.formulas import FormulaState
from mechanism_sim.linkages.nominal import NominalRun
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import DriveLaw, Law, LawSource, TorqueLaw, unrolled
from mechanism_sim.planar.frames import STATE
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import (
    HigherPair,
    Mechanism,
    bending_guides,
    closing_joints,
)
from mechanism_sim.planar.protocols import ForceElement, Relation
from mechanism_sim.scene.drives import drive_key, is_straight, read_drives, read_laws, read_motor
from mechanism_sim.scene.elastic_links import read_beams
from mechanism_sim.scene.loads import read_loads
from mechanism_sim.scene.loads.applied import read_effort
from mechanism_sim.scene.reading import (
    Values,
    check_coordinate,
    floats,
    read_bodies,
    read_frictions,
    read_joints,
    read_rotors,
    read_values,
)
from mechanism_sim.scene.schema import DrivePart, Scene
from mechanism_sim.scene.start_points import moved_by, solved, split
from mechanism_sim.scene.tilted_links import check_tilts, without_mass
from mechanism_sim.units import QuantityValue

_AHEAD = 4096  # number of pieces of an endless motion that are checked beforehand

_PLACES, _PACES = ('rad', 'm'), ('rad/s', 'm/s')


class ScenePlan(Names):
    """Links, joints, drives and forces of a scene, in SI units.

    Attributes
    ----------
    bodies : the moving links; those without mass data are massless
    joints : joints between bodies
    closing : joints that are cut for a tree without clearances
    clearances : clearances by loose joint
    touching : contacts of those that have some beside their constraint or clearance, as stops
    laws : laws by driven coordinate, in order of time
    sources : sources of further laws by coordinate, for motions without end
    begins : by coordinate driven by torque or force, and by elastic coordinate: value and
        rate at the start
    given : values and rates of coordinates that the scene sets outright, and rates that `initial`
        gives of points, for which the start is solved
    floating : the same of coordinates that only the machine with its clearances has
    assumed : coordinates of `begins` with assumed values, and those with assumed rates
    guess : rough values of coordinates
    frictions : dry friction of ideal joints, for a tree of the mechanism
    states : states of first order
    efforts : given efforts of prescribed drives
    motors : motors of driven coordinates with a torque not linear in speed
    weighed : True if every link has the mass properties needed for forces
    """

    scene: Scene

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        joints, drives = read_joints(self), read_drives(self)
        elastic = read_beams(self, joints, drives)
        straight = [c for c, drive in drives.items() if is_straight(drive)]
        bending = bending_guides([*elastic.values()], joints)
        self.closing = closing_joints(self.links, joints, bending, straight)
        for kind in KINDS.values():
            kind.check_all(self, joints, self.closing)
        check_tilts(self, joints)
        rotors = read_rotors(self)
        massless = tuple(
            elastic.get(link) or without_mass(self, link, rotors.get(link)) for link in self.links
        )
        tree = Mechanism(massless, joints, self.closing)
        self.bodies = read_bodies(self, tree, drives, elastic, rotors)
        # links that no joint carries are placed by their centres of gravity
        tree = Mechanism(self.bodies, joints, self.closing)
        positions = self._read_drives(drives, tree)
        begun = {c: x for c, (x, _) in self.begins.items()}
        start = {**self.guess, **positions, **begun}
        for kind in KINDS.values():
            joints = kind.assembled(self, joints, tree, start)
        self.joints = tuple(
            keys.kind_keys.mounted(joint, start, self._turns)
            for joint in joints
            for keys in [scene.joints[joint.name]]
        )
        self.begins |= {c: (positions.get(c, 0.0), 0.0) for c in tree.deformations}
        self.clearances: dict[str, ClearanceSpec] = {
            joint.name: spec
            for joint in sorted(self.joints, key=lambda x: scene.joints[x.name].kind_keys.last)
            for keys in [scene.joints[joint.name]]
            if (spec := keys.kind_keys.clearance_spec(joint)) is not None
        }
        self.touching: dict[str, ClearanceSpec] = {
            name: spec
            for name, keys in scene.joints.items()
            if (spec := keys.kind_keys.touches(name)) is not None
        }
        self._loads = read_loads(self, tree)
        self.states = [x for x in self._loads(tree) if isinstance(x, FormulaState)]
        self.efforts: dict[str, Callable[[Mechanism], DriveEffort]] = {
            c: read_effort(self, f'{drive_key(self, c)}.effort', c, drive.effort, tree)
            for c, drive in drives.items()
            if drive.effort is not None
        }
        said, moving = split(self, 'initial.velocity', scene.initial.velocity, tree, 'm/s')
        rates = read_values(self, 'initial.velocity', said, tree, _PACES)
        self.given = positions, rates, moving
        self.frictions = read_frictions(self, self.clearances)
        self.motors = tuple(
            motor
            for c, drive in drives.items()
            if (motor := read_motor(self, c, drive, tree)) is not None
        )
        weighing = {mass.at.partition('.')[0] for mass in scene.masses.values()} | elastic.keys()
        self.weighed = all(scene.links[x].mass is not None or x in weighing for x in self.links)
        self.floating = _read_floating(self, tree)

    # --- drives and the start -------------------------------------------------------------------

    def _read_drives(self, drives: Mapping[str, DrivePart], tree: Mechanism) -> Values:
        """Laws of the drives and where they begin; the positions that the scene sets outright."""
        straight = tree.displacements
        given, self.guess, guessed = _read_places(self, drives, tree)
        self.laws: dict[str, tuple[Law, ...]] = {}
        self.sources: dict[str, LawSource] = {}
        self.begins: dict[str, tuple[float, float]] = {}
        positions, self._turns = dict(given), dict[str, int]()
        for c in given.keys() - straight:  # angles that many turns make lose no digits here
            self._turns[c], positions[c] = take_off_turns(given[c])
        for c, drive in drives.items():
            check_coordinate(drive_key(self, c), c, tree)
            self.laws[c], source, self.begins[c], self._turns[c] = read_laws(
                self, c, drive, c in straight, given.get(c), self.guess.get(c, 0.0)
            )
            if source:
                self.sources[c] = source
        if not self.laws:
            if not tree.coordinates:
                raise InputError('joints: all links are welded to the ground: nothing can move')
            free = tree.coordinates[0]
            self.laws = {free: (TorqueLaw(free),)}
        said = {*positions, *guessed}
        silent = (
            c
            for c, drive in drives.items()
            if drive.start_angle is None
            and drive.start_position is None
            and drive.position is None
            and c not in said
        )
        paceless = (c for c, drive in drives.items() if drive.speed is None)
        self.assumed = frozenset(silent), frozenset(paceless)
        return positions

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
    def rigid(self) -> dict[str, ClearanceSpec]:
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
        """True if the scene gives initial positions other than that of the main drive."""
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

    def laws_until(
        self, c: str, end: float, most: int | None = _AHEAD
    ) -> tuple[tuple[Law, ...], float]:
        """The laws of a coordinate up to a time [s], and up to which time they hold.

        That is less where a source has more than `most` laws, as are looked at beforehand.
        """
        laws = self.laws[c]
        every = unrolled(laws, self.sources.get(c))
        count = None if most is None else len(laws) + most
        first = islice(every, count)
        found = (next(first), *takewhile(lambda law: law.valid_from <= end, first))
        beyond = next(every, None) if len(found) == count else None
        return found, min(end, beyond.valid_from) if beyond else end

    def law_at(self, c: str, t: float = 0.0) -> tuple[float, float, float]:
        """Value, rate and acceleration, a time [s] from the start, by a coordinate's first law."""
        value, rate, half, third, *_ = *self._local[c][1], 0.0, 0.0, 0.0
        return (
            value + t * (rate + t * (half + t * third)),
            rate + t * (2.0 * half + 3.0 * t * third),
            2.0 * half + 6.0 * third * t,
        )

    def outside_at_start(
        self, names: Sequence[str], t: float = 0.0, turns: Mapping[str, int] | None = None
    ) -> Array:
        """Values (k, 1) of what `Frames.outside` names, at the turns of the start, or others."""
        turned = self.turned | dict(turns or {})
        known = {'time': t, **{f'{c}.turns': n for c, n in turned.items()}}
        known |= {f'{STATE}{k}': x.start for k, x in enumerate(self.states)}
        found = [known.get(name, 0.0) for name in names]
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
        """Closures of the ideal mechanism as numbers, with some coordinates given."""
        return self._loops.holding(held)


def _read_places(
    plan: ScenePlan, drives: Mapping[str, DrivePart], tree: Mechanism
) -> tuple[Values, Values, list[str]]:
    """Coordinates given by `initial`, all with a value, and names of those with a guess."""
    initial, guess = plan.scene.initial.position, plan.scene.guess
    outright, placed = split(plan, 'initial.position', initial, tree)
    rough, near = split(plan, 'guess', guess, tree)
    given = read_values(plan, 'initial.position', outright, tree, _PLACES)
    guessed = read_values(plan, 'guess', rough, tree, _PLACES)
    own = {
        c: start
        for c, drive in drives.items()
        for start in (drive.start_angle, drive.start_position)
        if start is not None
    }
    found, order = dict(guessed), tree.coordinates
    for targets, exact in ((placed, True), (near, False)):
        if not targets:
            continue
        held = given if exact else own | given
        every = solved(tree, targets, own | guessed, held, exact)
        at = np.array([every[c] for c in order])
        moved = {c: every[c] for c in moved_by(tree, targets, at) if c not in held}
        given = given | moved if exact else given
        found = every | guessed
        guessed = guessed | moved
    return given, found, [*guessed]


def _read_floating(plan: ScenePlan, tree: Mechanism) -> tuple[Values, Values]:
    """Values and rates of the coordinates that only the machine with its clearances has."""
    initial = plan.scene.initial
    found: list[Values] = []
    for kind, part, unit in (
        ('position', initial.position, 'm'),
        ('velocity', initial.velocity, 'm/s'),
    ):
        found.append({})
        for c, measure in part.items():
            if not isinstance(measure, QuantityValue) or not floats(plan, c, measure, tree):
                continue
            where, loose, link = f'initial.{kind}.{c}', plan.loose, c.partition('.')[0]
            if c not in loose.coordinates or (c in plan.links and c in loose.displacements):
                raise InputError(
                    f'{where} cannot be set: {link} hangs on a joint without clearance, so '
                    f"that its only coordinate is '{link}', "
                    f'{kind_of(link in loose.displacements)}'
                )
            lies = '.' in c
            found[-1][c] = plan.measure(where, measure, True, ('', unit)) if lies else (
                measure.value
            )  # fmt: skip
    return found[0], found[1]


# --- the mechanism --------------------------------------------------------------------------


def keeps_speed(plan: ScenePlan, c: str) -> bool:
    """True of a coordinate that a drive keeps at one speed for ever, or at rest."""
    law, *others = plan.laws[c]
    alone = not others and c not in plan.sources
    return alone and isinstance(law, DriveLaw) and law.degree <= 1


def ordered_laws(plan: ScenePlan) -> dict[str, Sequence[Law]]:
    """The laws of a scene in the order of its equations."""
    return {c: plan.laws[c] for c in (*plan.prescribed, *plan.powered)}


def restart(plan: ScenePlan, run: EventLoop, state: State) -> None:
    """Begin a run anew from another state, where the laws of all drives begin."""
    laws = ordered_laws(plan)
    run.restart(state, [each[0] for each in laws.values()])
    announce(plan, run, laws)


def announce(
    plan: ScenePlan, run: EventLoop | NominalRun, laws: Mapping[str, Sequence[Law]]
) -> None:
    """Give a run the laws after its first one.

    Nothing of its own follows others than those of the scene.
    """
    later = (law for each in laws.values() for law in each[1:])
    for law in sorted(later, key=lambda x: x.valid_from):
        run.change_law(law)
    run.go_on_by({c: x for c, x in plan.sources.items() if laws[c] is plan.laws[c]})
