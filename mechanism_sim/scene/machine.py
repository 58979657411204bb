"""A machine: what a scene comes down to, part by part, each made once when it is first asked for.

- `Machine.plan`: links, joints, drives and forces as the scene is read (`ScenePlan`)
- `Machine.assembly`: the mechanism without clearance at the start (`assemble`)
- `Machine.level`: how much mechanics the scene needs
- `Machine.ideal` and `Machine.inverse_dynamics`: motion and forces without clearance
- `Machine.system`: the compiled equations of motion; `Machine.observer` evaluates them
- `Machine.physics`: forces, gaps and energies along a motion, whatever the level
- `Machine.initial_state`: start of the equations of motion (`Start`)

`Machine.start` and `Machine.resume` begin runs. Refusals of all parts begin with the scene's name.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.hybrid.dynamics import AppliedForces
from mechanism_sim.hybrid.event_loop import EventLoop
from mechanism_sim.hybrid.observer import Instants, Observer
from mechanism_sim.hybrid.physics import DynamicPhysics, Physics
from mechanism_sim.hybrid.plotting import Rich
from mechanism_sim.hybrid.snapshot import Snapshot, State
from mechanism_sim.hybrid.system import System
from mechanism_sim.joints.contact_keys import Play, in_plane
from mechanism_sim.joints.joint_keys import contacts_of
from mechanism_sim.keys.names import SceneError, scene_errors
from mechanism_sim.linkages.forces import AppliedForce
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.ideal import FourBarMotion, IdealMotion, LinkageMotion
from mechanism_sim.linkages.loops import FourBarLoop
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw, largest_speed, time_of_angle
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.impulses import JointImpulses
from mechanism_sim.planar.inverse_dynamics import InverseDynamics, Observation
from mechanism_sim.planar.massless import inertial_motion, without_mass
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.protocols import ForceElement, Gap, Relation
from mechanism_sim.planar.shaking import ShakingForce
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.planar.switches import SwitchTable
from mechanism_sim.scene.assembly import Assembly, assemble, closed_four_bar
from mechanism_sim.scene.elastic_links import stiffened
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.scene.schema import Commands, JointPart, LinkPart, Scene
from mechanism_sim.scene.start import Start
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.imu import InertialUnit
from mechanism_sim.units import QuantityValue
from mechanism_sim.vibration.frame import Frame
from mechanism_sim.vibration.joint_forces import JointForces
from mechanism_sim.vibration.shaken_frame import ShakenFrame
from mechanism_sim.vibration.shaking import Forces, WholeMachine

Run: TypeAlias = EventLoop | NominalRun
"""A machine in motion."""

_BESIDE = 0.3
"""[rad, m] from the start, where it is looked whether links without mass make a difference."""

_COMPACT_FROM = 8
"""Free coordinates, contacts and closures from which on compact code pays: it compiles faster.

Four fifths of the start of large machines were LLVM's optimisation.
"""

_SILENT = {'title', 'description', 'duration', 'outputs', 'sensors', 'oscillators', 'measures'}
"""Keys that do not rule the motion."""


class Level(Enum):
    """How much mechanics a scene needs; the value is what people read."""

    KINEMATIC = 'kinematic'
    INVERSE_DYNAMICS = 'inverse dynamics'
    SMOOTH = 'smooth dynamics'
    NONSMOOTH = 'nonsmooth dynamics'
    COMPLIANT = 'compliant contact'


@dataclass(frozen=True)
class Machine(Rich):
    """The mechanism of a scene, ready to run.

    Attributes
    ----------
    name : of the scene
    scene : its content, in SI units
    questions : about what its file says and its content in SI units does not, as units
    """

    name: str
    scene: Scene
    questions: tuple[str, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        return f'<{type(self).__name__} {self.name}: {self.scene.title}>'

    # --- as it is read --------------------------------------------------------------------------

    @cached_property
    def plan(self) -> ScenePlan:
        """Links, joints, drives and forces."""
        with scene_errors(self.name):
            return ScenePlan(self.scene)

    @property
    def links(self) -> dict[str, LinkPart]:
        """The moving links as the scene has them."""
        return {name: link for name, link in self.scene.links.items() if name != GROUND}

    @property
    def clearances(self) -> dict[str, Play]:
        """The joints with clearance."""
        return self.plan.clearances

    @property
    def bearings(self) -> list[Revolute]:
        """The joints with a pin loose in a bushing."""
        joints = self.mechanism.joints
        return [j for j in joints if isinstance(j, Revolute) and j.name in self.clearances]

    @property
    def mechanism(self) -> Mechanism:
        """Bodies and joints, cut where joints are loose; links without mass data are massless."""
        return self.plan.loose

    @cached_property
    def fingerprint(self) -> str:
        """Of all that rules the motion, in a few letters."""
        content = self.scene.to_document(exclude=_SILENT)
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]

    @property
    def allowed_penetration(self) -> float:
        """Violation of a gap [m] that tolerance or rounding explain; beyond it a run fails."""
        solver = self.scene.solver
        allowed = max(1e3 * solver.rtol * self.mechanism.size, solver.atol, 1e-12)
        played = [c.radial for c in self.clearances.values() if c.radial]
        return min([allowed, *(0.1 * radial for radial in played)])

    # --- its main drive -------------------------------------------------------------------------

    @property
    def main(self) -> str:
        """The coordinate whose revolutions count: the first that is driven."""
        return self.plan.main

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws of the main drive, in the order in which they take over."""
        return self.plan.laws[self.main]

    @property
    def law(self) -> Law:
        """The first law of the main drive."""
        return self.laws[0]

    @property
    def start_of_crank(self) -> tuple[float, float]:
        """Angle [rad] and speed [rad/s] of the main drive's coordinate at time zero."""
        return self.plan.begins.get(self.main, (0.0, 0.0))

    @property
    def commands(self) -> Commands | None:
        """Commands of speed that the main drive takes, if any."""
        return self.scene.drive.commands if self.scene.drive else None

    @property
    def fastest(self) -> float:
        """Largest speed of the main drive that is known beforehand [rad/s]."""
        commanded = self.commands.fastest if self.commands else 0.0
        return max(abs(self.start_of_crank[1]), largest_speed(self.laws), commanded)

    @property
    def period(self) -> float:
        """Duration of a revolution at the largest speed [s]; infinite for a drive at rest."""
        straight = self.main in self.mechanism.displacements
        fastest = self.fastest / (self.mechanism.size if straight else 1.0)
        return 2.0 * math.pi / fastest if fastest else math.inf

    def time_of(self, revolutions: float) -> float:
        """When the main drive has turned so far [s]."""
        cure = "--duration, or 'duration' in the scene"
        if not isinstance(self.law, DriveLaw):
            raise InputError(
                f'how fast {self.main} turns is not known beforehand: give a duration in seconds, '
                f'not revolutions: {cure}'
            )
        if self.law.straight:
            raise InputError(
                f'{self.main} is driven straight, it makes no revolutions: give a duration in '
                f'seconds: {cure}'
            )
        t = time_of_angle(self.laws, 2.0 * math.pi * revolutions)
        if t is None:
            raise InputError(
                f'{self.main} is at rest: give a duration in seconds, not revolutions: {cure}'
            )
        return t

    # --- its start, and how much mechanics it needs ---------------------------------------------

    @cached_property
    def closed_form(self) -> FourBarLoop | None:
        """The four-bar that it is without clearance, if its motion has a closed form."""
        return closed_four_bar(self.plan)

    @property
    def linkage(self) -> FourBar:
        """Lengths and branch of a four-bar whose links' angles are those from joint to joint."""
        loop = self.closed_form
        if loop is None or any(loop.turned):
            raise SceneError(
                f'{self.name}: this is for four-bars only, whose links have their joints on their '
                'x axes'
            )
        return loop.linkage

    @cached_property
    def assembly(self) -> Assembly:
        """The mechanism without clearance at the start."""
        with scene_errors(self.name):
            return assemble(self.plan, self.closed_form)

    def at_start(self, mechanism: Mechanism) -> Array:
        """Coordinates (n,) of the ideal mechanism, however it is cut, at the start."""
        return converted(self.plan.ideal, mechanism, self.assembly.q, self.assembly.v)[0]

    @property
    def starts_singular(self) -> bool:
        """True if a driven mechanism starts in a singular position."""
        return self.closed_form is None and self.assembly.slope is not None

    @property
    def torque_driven(self) -> bool:
        """True if a coordinate is free or moved by a torque: the motion is not known before."""
        return bool(self.plan.powered) or self.assembly.freedom > 0

    @property
    def dynamic(self) -> bool:
        """True if the motion comes from equations of motion."""
        return self.level in (Level.SMOOTH, Level.NONSMOOTH, Level.COMPLIANT)

    @cached_property
    def level(self) -> Level:
        """The cheapest level that is exact for the scene."""
        if self.clearances:
            rigid = any(c.wall == 'rigid' for c in self.plan.rigid.values())
            slipping = {j.name for j in self.plan.joints if isinstance(j, HigherPair) and j.slips}
            if rigid or self.clearances.keys() - slipping:
                return Level.NONSMOOTH if rigid else Level.COMPLIANT
            return Level.SMOOTH
        if self.torque_driven:
            return Level.SMOOTH
        wanted = self.scene.outputs.forces and self.plan.weighed and not self.without_forces
        return Level.INVERSE_DYNAMICS if wanted else Level.KINEMATIC

    @cached_property
    def without_forces(self) -> dict[str, str]:
        """Joints whose motion takes forces without limit, and why."""
        pairs = (j for j in self.plan.joints if isinstance(j, HigherPair))
        return {pair.name: why for pair in pairs if (why := pair.without_forces)}

    def started_at(self, angle: float) -> Machine:
        """Copy with its main drive at another angle [rad] at the start."""
        scene = self.scene
        if not scene.drive:
            raise SceneError(f"{self.name}: there is no 'drive' to start at an angle")
        position = {c: x for c, x in scene.initial.position.items() if c != self.main}
        changed: dict[str, Any] = {
            'drive': scene.drive.model_copy(update={'start_angle': angle}),
            'initial': scene.initial.model_copy(update={'position': position}),
        }
        if self.closed_form:
            near = zip(self.closed_form.links[1:], self.closed_form.positions(angle), strict=True)
            found = {c: QuantityValue(float(x), 'rad') for c, x in near if math.isfinite(x)}
            changed['guess'] = {**scene.guess, **found}
        return self._changed(changed)

    def _changed(self, keys: dict[str, Any]) -> Machine:
        return replace(self, scene=self.scene.model_copy(update=keys))

    @cached_property
    def rigid(self) -> Machine:
        """Copy with rigid links, and shafts that do not give way.

        It starts where this one does, although guides carry some links now.
        """
        ideal, scene = self.plan.ideal, self.scene
        if not ideal.deformations:
            return self
        guides = [ideal.joint(j) for j in self.plan.bending]
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
            return self._changed(changed)
        tree = self._changed(changed | {'guess': {}}).plan.ideal
        q, _ = converted(ideal, tree, self.assembly.q, self.assembly.v)
        guess = {
            c: QuantityValue(x, 'm' if c in tree.displacements else 'rad')
            for c, x in zip(tree.coordinates, q.tolist(), strict=True)
        }
        return self._changed(changed | {'guess': guess})

    # --- without clearance ----------------------------------------------------------------------

    @cached_property
    def ideal(self) -> IdealMotion:
        """The motion of the mechanism without clearance.

        Closed forms know two branches of a four-bar; through a change point neither goes on.
        """
        if self.closed_form:
            return FourBarMotion(self.closed_form, self.plan.ideal.coordinates)
        return LinkageMotion(self.plan.kinematics(self.plan.prescribed))

    @cached_property
    def inverse_dynamics(self) -> InverseDynamics:
        """Forces of the ideal mechanism."""
        return self._inverse_dynamics(inertia=True)

    @cached_property
    def statics(self) -> NominalPhysics:
        """The ideal mechanism with the forces that it has without inertia, at actual speeds."""
        return NominalPhysics(self.ideal, self.mechanism, self._inverse_dynamics(inertia=False))

    def _inverse_dynamics(self, inertia: bool) -> InverseDynamics:
        plan, ideal = self.plan, self.plan.ideal
        return InverseDynamics(
            ideal,
            closures(ideal, ideal.cut),
            plan.prescribed,
            plan.elements(ideal),
            plan.frictions(ideal),
            inertia,
            plan.unknowns(ideal),
            {c: effort(ideal) for c, effort in plan.efforts.items()},
        )

    def nominal(self, laws: Sequence[Law], loads: bool = False) -> NominalRun:
        """A run of the mechanism without clearance under prescribed drives.

        Parameters
        ----------
        loads : whether its pieces must be short enough for loads, too

        Raises
        ------
        TypeError
            If a torque moves it: then it has equations of motion.
        """
        prescribed = [law for law in laws if isinstance(law, DriveLaw)]
        if len(prescribed) < len(laws):
            raise TypeError('a mechanism that a torque moves has equations of motion')
        at, ideal, forces = self.assembly, self.plan.ideal, self.level is Level.INVERSE_DYNAMICS
        edges: Edges | None = None  # where something begins or ceases to act along the motion
        if forces:
            edges = self.inverse_dynamics.edges  # those of the closures among them
        elif isinstance(self.ideal, LinkageMotion):
            edges = self.ideal.kinematics.edges
        return NominalRun(
            self.ideal,
            prescribed,
            at.q,
            ideal.size,
            edges,
            slope=at.slope,
            steep=self.inverse_dynamics.steep if loads and forces else None,
            turns=[self.plan.turned.get(c, 0) for c in ideal.coordinates],
        )

    # --- equations of motion --------------------------------------------------------------------

    @cached_property
    def system(self) -> System:
        """The compiled equations of motion."""
        mechanism = self.mechanism
        gaps, films = contacts_of(self.scene.joints, mechanism, self.clearances)
        frames = Frames(mechanism.coordinates, Parameters())
        for gap in gaps:
            if all(slope is None for slope in gap.value(frames).gradient.values()):
                raise SceneError(
                    f'{self.name}: joints.{gap.joint} has a clearance that never opens nor '
                    'closes: its links move along it only; leave the joint out'
                )
        return self._compiled(mechanism, self.plan.loop_closures, gaps, films)

    @cached_property
    def observer(self) -> Observer:
        """Forces, accelerations and gaps of `system` in given states."""
        return Observer(self.system)

    @cached_property
    def ideal_observer(self) -> Observer:
        """`observer` of the mechanism without clearance."""
        if not self.clearances:
            return self.observer
        ideal = self.plan.ideal
        return Observer(self._compiled(ideal, closures(ideal, ideal.cut), [], []))

    def _compiled(
        self,
        mechanism: Mechanism,
        closing: Sequence[Relation],
        gaps: Sequence[Gap],
        films: Sequence[ForceElement],
    ) -> System:
        plan = self.plan
        laws = [law for laws in plan.laws.values() for law in laws]
        degree = max(law.degree if isinstance(law, DriveLaw) else 1 for law in laws)
        if self.commands:
            degree = max(degree, 2)  # commanded speeds are joined by ramps
        return System(
            mechanism,
            gaps,
            plan.prescribed,
            degree,
            closing,
            plan.powered,
            AppliedForces(
                [*films, *plan.elements(mechanism)], plan.motors, plan.frictions(mechanism)
            ),
            self._lent(mechanism) if closing else 0.0,
        )

    def _lent(self, mechanism: Mechanism) -> float:
        """Mass [kg] added along closures if free coordinates have no inertia by themselves."""
        prescribed, q = self.plan.prescribed, self.at_start(mechanism)
        free = [i for i, c in enumerate(mechanism.coordinates) if c not in prescribed]
        beside = np.random.default_rng(3).normal(0.0, _BESIDE, (3, len(q)))
        for shift in (np.zeros(len(q)), *beside):
            moved = inertial_motion(mechanism, q + shift)[:, free]
            if without_mass(moved, np.zeros((0, len(free)))).size:
                return sum(b.mass + b.inertia / mechanism.size**2 for b in mechanism.bodies)
        return 0.0

    @cached_property
    def physics(self) -> Physics:
        """Forces, gaps and energies along a motion of this machine."""
        if self.dynamic:
            return DynamicPhysics(self.observer)
        forces = self.inverse_dynamics if self.level is Level.INVERSE_DYNAMICS else None
        return NominalPhysics(self.ideal, self.mechanism, forces)

    def initial_state(self) -> State:
        """Start of the equations of motion."""
        return self._initial_state

    @cached_property
    def _initial_state(self) -> State:
        with scene_errors(self.name):
            return Start(
                self.plan,
                self.assembly,
                self.observer,
                self.joint_forces_at_start,
                lambda q, v, a, t: self._seen_at_start(q, v, a, t).acceleration,
                min(self.period, 1.0),
            ).state()

    def joint_forces_at_start(self, q: Array, v: Array) -> Array:
        """Forces in the joints of the ideal mechanism (j, 2) [N], first- on second-named link.

        At coordinates and rates (n, 1), with the accelerations and torques of the start.
        """
        plan, ideal = self.plan, self.ideal
        if self.torque_driven:
            none = np.zeros((len(plan.prescribed), 1))
            return self._seen_at_start(q, v, none, 0.0).reaction[:, :, 0]
        if self.starts_singular:
            raise InputError(
                'start = seated, but the forces that press pins on bushings are not determined: '
                "the start is a singular position, such as a dead point; write 'start: centred', "
                'or start beside it'
            )
        rates = np.array([plan.law_at(ideal.coordinates[i])[1:] for i in ideal.driven]).T
        _, _, a, _ = ideal.motion(q, *rates[:, :, None])
        dynamics = self.inverse_dynamics
        outside = plan.outside_at_start(dynamics.outside)
        return dynamics(q, v, a, outside).reaction[:, :, 0]

    def _seen_at_start(self, q: Array, v: Array, a: Array, t: float) -> Observation:
        """The ideal machine under its first laws, a time [s] from the start.

        Parameters
        ----------
        q, v : coordinates and rates (n, N)
        a : accelerations (p, N) of the prescribed coordinates
        """
        plan, observer, count = self.plan, self.ideal_observer, q.shape[1]
        torques, places = [], plan.ideal.coordinates
        for c in plan.powered:
            i, law = places.index(c), plan.laws[c][0]
            assert isinstance(law, TorqueLaw)  # noqa: S101 - it is powered
            constant, per_angle, per_speed = law.after(plan.turned.get(c, 0))
            torques.append(constant + per_angle * q[i] + per_speed * v[i])
        outside = np.repeat(plan.outside_at_start(observer.system.outside, t), count, axis=1)
        modes = np.zeros((0, count), np.uint8)
        given = np.reshape(torques, (-1, count))
        return observer.observe(Instants(q, v, a, modes, given, outside=outside))

    # --- runs -----------------------------------------------------------------------------------

    def start(self, law: Law | None = None) -> Run:
        """A new run of the machine, under the scene's laws or another of its main drive."""
        laws = {**self.plan.laws, **({} if law is None else {self.main: (law,)})}
        system_order = [*self.plan.prescribed, *self.plan.powered]
        first = [laws[c][0] for c in system_order]
        run: Run
        if self.dynamic:
            solver = self.scene.solver
            run = EventLoop(
                self.system,
                first,
                self.initial_state(),
                solver.rtol,
                solver.atol,
                min(self.period / 8.0, 0.1),
                compact=self._large,
                fastest=self.fastest,
            )
        else:
            run = self.nominal(first, loads=True)
        following = (x for c in system_order for x in laws[c][1:])
        for later in sorted(following, key=lambda x: x.valid_from):
            run.change_law(later)
        return run

    @property
    def _large(self) -> bool:
        """True if the equations are so long that compact code pays."""
        system = self.system
        rows = len(system.dynamics.contacts.rows) + len(system.dynamics.equations.relation_jets)
        tabulated = any(isinstance(s, SwitchTable) for s in system.switches)
        many = len(system.free) + rows >= _COMPACT_FROM
        flexible = any(x.flexible for x in self.mechanism.extensions.values())
        more = system.elements or system.lent or system.dynamics.rubs or flexible
        return bool(more) or tabulated or many

    def snapshot(self, run: Run) -> Snapshot:
        """State from which another run of this machine goes on where this one stands."""
        return replace(run.snapshot(), machine=self.fingerprint)

    def resume(self, snapshot: Snapshot) -> Run:
        """A run that goes on where another of this machine stood, bit by bit."""
        if snapshot.machine != self.fingerprint:
            raise InputError(
                f'the snapshot is of another machine than {self.name}: give the same scene with '
                'the same overrides'
            )
        run = self.start()
        run.restore(snapshot)
        return run

    @cached_property
    def ways(self) -> set[object]:
        """Of the drives, those that were tried and found free, see `mechanism_sim.scene.gate`."""
        return set()

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
        source = sensor.source(self)
        return Channel(source, sensor.chain(), name, self._trigger(name), beside)

    def inertial_unit(self, name: str) -> InertialUnit:
        """The inertial unit in the place of a sensor, to be fed likewise.

        Raises
        ------
        KeyError
            If there is no such sensor.
        """
        sensor = self.scene.sensors[name]
        return InertialUnit(
            self.mechanism,
            sensor.link,
            sensor.at,
            sensor.axis,
            sensor.chain(),
            name,
            sensor.transducer.transverse,
            self._trigger(name),
        )

    def _trigger(self, sensor: str) -> int:
        """Index of the coordinate that triggers a sensor."""
        triggered = self.scene.sensors[sensor].trigger
        return self.mechanism.coordinates.index(self.main) if triggered else 0

    def oscillator(self, name: str) -> ShakenFrame:
        """A frame of the scene on its springs, at the start of a run.

        ``machine.oscillator('frame').take(solution.motion)`` gives its motion, a function of time;
        `take` may also be called with the motion of one `Piece` after the other.
        """
        return ShakenFrame(*self.shaken_frame(name))

    def shaken_frame(self, name: str) -> tuple[Frame, Forces]:
        """A frame on springs, and the forces of the machine on it; raises as `frame`."""
        return self.frame(name), self.forces_on(name)

    def frame(self, name: str) -> Frame:
        """A frame of the scene on its springs; InputError if there is none of that name."""
        frames = self.scene.oscillators
        if name not in frames:
            raise SceneError(
                f"{self.name}: there is no oscillator '{name}'{nearest(name, frames)}; "
                f'oscillators: {", ".join(frames) or "none"}'
            )
        return frames[name]

    def forces_on(self, name: str) -> Forces:
        """The forces that shake a frame of the scene."""
        joints = self.scene.oscillators[name].joints
        if joints is None:
            elements = self.plan.elements(self.mechanism)
            applied = [element for element in elements if isinstance(element, AppliedForce)]
            return WholeMachine(ShakingForce(self.mechanism, applied), self.physics)
        return JointForces(self.mechanism, self.physics, self.joint_impulses, joints)

    @cached_property
    def joint_impulses(self) -> JointImpulses:
        """The impulses in all joints, from steps of the velocities."""
        self.check_impulses()
        gaps, _ = contacts_of(self.scene.joints, self.mechanism, self.clearances)
        return JointImpulses(self.mechanism, gaps, self.plan.loop_closures, self.plan.prescribed)

    def check_impulses(self) -> None:
        """Refuse impacts beside friction in ideal joints: steps do not tell one from the other."""
        joints = self.scene.joints.items()
        rubbing = [name for name, j in joints if j.friction and j.friction.coefficient]
        if rubbing and self.level is Level.NONSMOOTH:
            raise SceneError(
                f'{self.name}: joints.{rubbing[0]}.friction: beside rigid contacts with clearance '
                'impulses in joints are not known, which load cells and the joints of frames ask '
                'for; leave out the friction, or give the clearances a contact with a stiffness'
            )
