"""A machine: the parts derived from a scene, each made once when first needed.

- `Machine.plan`: links, joints, drives and forces as the scene is read (`ScenePlan`)
- `Machine.assembly`: the mechanism without clearance at the start (`assemble`)
- `Machine.level`: how much mechanics the scene needs
- `Machine.drive`: the drive whose revolutions count, also of those that bring all again
  (`MainDrive`)
- `Machine.nominal`: motion and forces without clearance (`Nominal`)
- `Machine.equations`: the compiled equations of motion (`EquationsOfMotion`)
- `Machine.physics`: forces, gaps and energies along a motion, whatever the level
- `Machine.initial_state`: start of the equations of motion (`Start`)

`Machine.start` and `Machine.resume` begin runs. Refusals of all parts begin with the scene's name.
"""

from __future__ import annotations

import hashlib
import json
import math
import pickle
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import islice, takewhile
from typing import Any, TypeAlias

from mechanism_sim.engine.event_loop import EventLoop
from mechanism_sim.engine.physics import DynamicPhysics, Physics
from mechanism_sim.engine.plotting import Rich
from mechanism_sim.engine.snapshot import Snapshot, State
from mechanism_sim.errors import InputError, nearest, quoted
from mechanism_sim.joints.contact_keys import ClearanceSpec, in_plane
from mechanism_sim.joints.joint_keys import bounds_of, contacts_of
from mechanism_sim.keys.names import SceneError, scene_errors
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.drive import (
    DriveLaw,
    Law,
    LawSource,
    largest_speed,
    times_of_angles,
    unrolled,
)
from mechanism_sim.planar.impulses import JointImpulses
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Revolute
from mechanism_sim.scene.assembly import Assembly, assemble, rates_of_points
from mechanism_sim.scene.elastic_links import stiffened
from mechanism_sim.scene.equations import EquationsOfMotion
from mechanism_sim.scene.frame_forces import forces_on
from mechanism_sim.scene.level import Level
from mechanism_sim.scene.nominal import Nominal
from mechanism_sim.scene.plan import ScenePlan, announce, keeps_speed, ordered_laws
from mechanism_sim.scene.repetition import Repetition, repetition
from mechanism_sim.scene.schema import Commands, JointPart, Scene
from mechanism_sim.scene.sensor_keys import check_impulses
from mechanism_sim.scene.start import Start
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.units import QuantityValue
from mechanism_sim.vibration.frame import Frame
from mechanism_sim.vibration.shaken_frame import ShakenFrame

Run: TypeAlias = EventLoop | NominalRun
"""A machine in motion."""

_SILENT = {'title', 'description', 'duration', 'outputs', 'sensors', 'oscillators', 'measures'}
"""Keys that do not rule the motion."""


@dataclass(frozen=True)
class Machine(Rich):
    """The mechanism of a scene, ready to run.

    Attributes
    ----------
    name : name of the scene
    scene : content of the scene, in SI units
    questions : questions on contents of its file only, such as units
    """

    name: str
    scene: Scene = field(hash=False)  # its dictionaries have none
    questions: tuple[str, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        return f'<{type(self).__name__} {self.name}: {self.scene.title}>'

    # --- as it is read --------------------------------------------------------------------------

    @cached_property
    def plan(self) -> ScenePlan:
        """Links, joints, drives and forces."""
        with scene_errors(self.name):
            found = ScenePlan(self.scene)
            if found.given[2]:
                found.given[1].update(rates_of_points(found))
            return found

    @property
    def bearings(self) -> list[Revolute]:
        """The joints with a pin loose in a bushing."""
        joints = self.mechanism.joints
        return [j for j in joints if isinstance(j, Revolute) and j.name in self.plan.clearances]

    @property
    def mechanism(self) -> Mechanism:
        """Bodies and joints, cut where joints are loose; links without mass data are massless."""
        return self.plan.loose

    @cached_property
    def fingerprint(self) -> str:
        """Fingerprint of all that determines the motion, in a few letters."""
        content = self.scene.to_document(exclude=_SILENT)
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]

    @cached_property
    def drive(self) -> MainDrive:
        """Main drive of the machine."""
        return MainDrive(self.plan, self)

    # --- its start, and the level of its mechanics ----------------------------------------------

    @cached_property
    def assembly(self) -> Assembly:
        """The mechanism without clearance at the start."""
        with scene_errors(self.name):
            return assemble(self.plan)

    @property
    def torque_driven(self) -> bool:
        """True if a coordinate is free or moved by a torque: the motion is not known before."""
        return bool(self.plan.powered) or self.assembly.freedom > 0

    @cached_property
    def touching(self) -> dict[str, ClearanceSpec]:
        """Active contacts of joints in addition to constraints and clearances.

        None where drives and closed loops say all of the motion.
        """
        acts = self.torque_driven or self.plan.clearances
        return self.plan.touching if acts else {}

    @property
    def has_contacts(self) -> bool:
        """True if parts may part and meet."""
        return bool(self.plan.clearances or self.touching)

    @cached_property
    def level(self) -> Level:
        """The cheapest level that is exact for the scene."""
        if contacts := {**self.plan.clearances, **self.touching}:
            own = {**self.plan.rigid, **self.touching}
            rigid = any(c.wall == 'rigid' for c in own.values())
            slipping = {j.name for j in self.plan.joints if isinstance(j, HigherPair) and j.slips}
            if rigid or contacts.keys() - slipping:
                return Level.NONSMOOTH if rigid else Level.COMPLIANT
            return Level.SMOOTH
        if self.torque_driven or self.plan.states:
            return Level.SMOOTH
        wanted = self.scene.outputs.forces and self.plan.weighed and not self.without_forces
        return Level.INVERSE_DYNAMICS if wanted else Level.KINEMATIC

    @cached_property
    def without_forces(self) -> dict[str, str]:
        """Joints whose motion needs infinite forces, and why."""
        pairs = (j for j in self.plan.joints if isinstance(j, HigherPair))
        return {pair.name: why for pair in pairs if (why := pair.without_forces)}

    @cached_property
    def rigid(self) -> Machine:
        """Copy with rigid links and shafts, or itself if nothing is compliant."""
        stiff = not self.plan.ideal.deformations
        return self if stiff else replace(self, scene=_rigid_scene(self.plan, self.assembly))

    # --- its mechanics --------------------------------------------------------------------------

    @cached_property
    def nominal(self) -> Nominal:
        """Motion and forces without clearance."""
        forces = self.level is Level.INVERSE_DYNAMICS
        return Nominal(self.name, self.plan, self.assembly, forces)

    @cached_property
    def equations(self) -> EquationsOfMotion:
        """The equations of motion, compiled when first needed."""
        return EquationsOfMotion(self.name, self.plan, self.assembly)

    @cached_property
    def physics(self) -> Physics:
        """Forces, gaps and energies along a motion of this machine."""
        nominal = self.nominal
        if self.level.dynamic:
            return DynamicPhysics(self.equations.observer, nominal.undetermined, self.plan.main)
        forces = nominal.inverse_dynamics if nominal.forces else None
        open_ = nominal.undetermined if forces else {}
        return NominalPhysics(nominal.motion, self.mechanism, forces, open_)

    def initial_state(self) -> State:
        """Start of the equations of motion."""
        return self._initial_state

    @cached_property
    def _initial_state(self) -> State:
        with scene_errors(self.name):
            return Start(self.plan, self.nominal, self.equations, self.drive.period).state()

    # --- runs -----------------------------------------------------------------------------------

    def start(self, law: Law | None = None, state: State | None = None) -> Run:
        """A new run of the machine, under the scene's laws or another of its main drive.

        A free motion begins at the scene's start, or at another state.
        """
        laws = ordered_laws(self.plan) | ({} if law is None else {self.plan.main: (law,)})
        first = [each[0] for each in laws.values()]
        run: Run
        if self.level.dynamic:
            solver = self.scene.solver
            run = EventLoop(
                self.equations.system,
                first,
                state or self.initial_state(),
                solver.rtol,
                solver.atol,
                min(self.drive.period / 8.0, 0.1),
                compact=self.equations.compact,
                fastest=self.drive.fastest,
            )
        else:
            run = self.nominal.run(first, loads=True)
        announce(self.plan, run, laws)
        return run

    def snapshot(self, run: Run) -> Snapshot:
        """State from which another run of this machine continues this one."""
        return replace(run.snapshot(), machine=self.fingerprint)

    def resume(self, snapshot: Snapshot) -> Run:
        """A bit-identical continuation of another run of this machine."""
        if not isinstance(snapshot, Snapshot):
            raise InputError(
                f'resume = {quoted(snapshot)} is not a snapshot, as .snapshot of a solution is'
            )
        if snapshot.machine != self.fingerprint:
            raise InputError(
                f'the snapshot is of a machine other than {self.name}: give the same scene with '
                'the same overrides'
            )
        run = self.start()
        run.restore(snapshot)
        return run

    # --- what measures it, and what it shakes ---------------------------------------------------

    def channel(self, name: str, beside: Channel | None = None) -> Channel:
        """The measured channel of a sensor, to be fed with motion from the start of a run on.

        It may share the analogue part of a channel `beside` it, fed with the same motions, that
        differs in sampling, converter and noise only.

        Raises
        ------
        KeyError
            If there is no such sensor.
        """
        sensor = self.scene.sensors[name]
        trigger = sensor.trigger_in(self)
        return Channel(sensor.source(self), sensor.chain(), name, trigger, beside)

    def oscillator(self, name: str) -> ShakenFrame:
        """A frame of the scene on its springs, at the start of a run.

        ``machine.oscillator('frame').take(solution.motion)`` gives its motion, a function of time;
        `take` may also be called with the motion of one `Piece` after the other.
        """
        return ShakenFrame(self.frame(name), forces_on(self, name))

    def frame(self, name: str) -> Frame:
        """A frame of the scene on its springs; InputError if there is none of that name."""
        frames = self.scene.oscillators
        if name not in frames:
            raise SceneError(
                f"{self.name}: there is no oscillator '{name}'{nearest(name, frames)}; "
                f'oscillators: {", ".join(frames) or "none"}'
            )
        return frames[name]

    @cached_property
    def joint_impulses(self) -> JointImpulses:
        """The impulses in all joints, from steps of the velocities."""
        with scene_errors(self.name):
            check_impulses(self)
        gaps, _ = contacts_of(self.scene.joints, self.mechanism, self.plan.clearances)
        gaps += bounds_of(self.scene.joints, self.mechanism, self.touching)
        return JointImpulses(self.mechanism, gaps, self.plan.loop_closures, self.plan.prescribed)


@lru_cache(maxsize=64)
def _ways_tried(_scene: bytes) -> dict[object, str]:
    return {}


def _rigid_scene(plan: ScenePlan, assembly: Assembly) -> Scene:
    """A scene with elastic links made rigid, and shafts that do not give way.

    It starts where that of `plan` does, assembled so, although guides carry some links now.
    """
    ideal, scene = plan.ideal, plan.scene
    guides = [ideal.joint(j) for j in plan.bending]
    carried = {link for j in guides for link in (j.first, j.second)}
    initial = {
        kind: {
            c: x
            for c, x in getattr(scene.initial, kind).items()
            if c not in ideal.deformations and not (carried and (c in carried or '.' in c))
        }
        for kind in ('position', 'velocity')
    }
    changed: dict[str, Any] = {
        'links': {name: stiffened(link) for name, link in scene.links.items()},
        'joints': {
            name: JointPart.model_validate({'revolute': j.points})
            if j.kind_keys.gives_way
            else j.model_copy(update={'clearance': in_plane(j.clearance)})
            for name, j in scene.joints.items()
        },
        'initial': scene.initial.model_copy(update=initial),
    }
    if not carried:
        return scene.model_copy(update=changed)
    tree = ScenePlan(scene.model_copy(update=changed | {'guess': {}})).ideal
    q, _ = converted(ideal, tree, assembly.q, assembly.v)
    guess = {
        c: QuantityValue(x, 'm' if c in tree.displacements else 'rad')
        for c, x in zip(tree.coordinates, q.tolist(), strict=True)
    }
    return scene.model_copy(update=changed | {'guess': guess})


_CURE = "--duration, or 'duration' in the scene"


@dataclass(frozen=True)
class MainDrive:
    """The drive of the coordinate `ScenePlan.main`; lengths and speeds in m if it slides."""

    plan: ScenePlan
    machine: Machine = field(repr=False, compare=False)

    @cached_property
    def ways_tried(self) -> dict[object, str]:
        """Ways that were tried, with why one cannot be gone; equal scenes share them."""
        return _ways_tried(pickle.dumps(self.plan.scene))

    @cached_property
    def repetition(self) -> Repetition:
        """Period of the machine in turns of this drive."""
        return repetition(self.machine.rigid.nominal, self.period)

    @cached_property
    def row(self) -> int:
        """Row of its effort among those of all drives, in which prescribed ones come first."""
        return self.machine.physics.driven.index(self.plan.main)

    @property
    def laws(self) -> tuple[Law, ...]:
        """Laws of the drive, in the order in which they take over."""
        return self.plan.laws[self.plan.main]

    @property
    def law(self) -> Law:
        """The first of its laws."""
        return self.laws[0]

    @property
    def source(self) -> LawSource | None:
        """Source of the laws behind the last one."""
        return self.plan.sources.get(self.plan.main)

    @property
    def start(self) -> tuple[float, float]:
        """Angle [rad] and speed [rad/s] at time zero."""
        return self.plan.begins.get(self.plan.main, (0.0, 0.0))

    @property
    def commands(self) -> Commands | None:
        """Commands of speed that it takes, if any."""
        return drive.commands if (drive := self.plan.scene.drive) else None

    @cached_property
    def fastest(self) -> float:
        """Largest speed that is known beforehand [rad/s]."""
        commanded = self.commands.fastest if self.commands else 0.0
        return max(abs(self.start[1]), largest_speed(self.laws), commanded)

    @cached_property
    def period(self) -> float:
        """Duration of a revolution at the largest speed [s]; infinite for a drive at rest."""
        mechanism = self.plan.loose
        straight = self.plan.main in mechanism.displacements
        fastest = self.fastest / (mechanism.size if straight else 1.0)
        return 2.0 * math.pi / fastest if fastest else math.inf

    @property
    def steady(self) -> bool:
        """True if it is prescribed one constant speed for ever."""
        return keeps_speed(self.plan, self.plan.main)

    def laws_until(self, end: float) -> list[Law]:
        """The laws that take over before a time [s], and the first in any case."""
        later = islice(unrolled(self.laws, self.source), 1, None)
        return [self.law, *takewhile(lambda law: law.valid_from < end, later)]

    def time_of(self, revolutions: float) -> float:
        """Time at which the drive has made a number of revolutions [s]."""
        t = next(self.times_of([revolutions]), None)
        if t is None:
            main = self.plan.main
            raise InputError(
                f'{main} is at rest: give a duration in seconds, not revolutions: {_CURE}'
            )
        return t

    def times_of(self, revolutions: Iterable[float]) -> Iterator[float]:
        """Times at which the drive has made rising numbers of revolutions [s], while it does."""
        main = self.plan.main
        if not isinstance(self.law, DriveLaw):
            raise InputError(
                f'how fast {main} turns is not known beforehand: give a duration in seconds, '
                f'not revolutions: {_CURE}'
            )
        if self.law.straight:
            raise InputError(
                f'{main} slides: it makes no revolutions: give a duration in seconds: {_CURE}'
            )
        angles = (2.0 * math.pi * x for x in revolutions)
        return times_of_angles(unrolled(self.laws, self.source), angles)
