"""A scene turned into a machine that can run: the level it needs, its equations, its runs."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import Any, Protocol

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.audit import Audit
from mechanism_sim.hybrid.event_loop import EventLoop
from mechanism_sim.hybrid.events import Impact, ModeChange
from mechanism_sim.hybrid.physics import DynamicPhysics, Physics
from mechanism_sim.hybrid.snapshot import Snapshot, State
from mechanism_sim.hybrid.system import System
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.ideal import FourBarMotion, IdealMotion, LinkageMotion
from mechanism_sim.linkages.loops import FourBarLoop
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import DriveLaw, Law, largest_speed, time_of_angle
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.inverse_dynamics import InverseDynamics
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.known import Edges
from mechanism_sim.planar.mechanism import GROUND, Mechanism, Revolute
from mechanism_sim.planar.protocols import ForceElement, Gap, Relation
from mechanism_sim.planar.switches import Table
from mechanism_sim.scene.assembly import Assembly, assemble, closed_four_bar
from mechanism_sim.scene.clearances import gaps_and_films
from mechanism_sim.scene.contact_keys import Play
from mechanism_sim.scene.initial import initial_state
from mechanism_sim.scene.instruments import channel, inertial_unit
from mechanism_sim.scene.oscillators import forces_on, read_frame
from mechanism_sim.scene.plan import Plan, plan_of
from mechanism_sim.scene.schema import Commands, Scene
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.imu import InertialUnit
from mechanism_sim.units import Measure
from mechanism_sim.vibration.shaken_frame import ShakenFrame

_COMPACT_FROM = 8
"""Free coordinates, contacts and closures from which on compact code pays: it compiles faster."""


class Level(Enum):
    """How much mechanics a scene needs; the value is what people read."""

    KINEMATIC = 'kinematic'
    INVERSE_DYNAMICS = 'inverse dynamics'
    SMOOTH = 'smooth dynamics'
    NONSMOOTH = 'nonsmooth dynamics'
    COMPLIANT = 'compliant contact'


class Run(Protocol):
    """A machine in motion: the event loop, or closed-form pieces."""

    events: int

    @property
    def steps(self) -> int:
        """Number of pieces of motion so far."""

    @property
    def time(self) -> float:
        """Time [s] up to which the motion is known."""

    def advance(self, until: float, final: bool = False, most: int | None = None) -> None:
        """Go on to `until` [s]."""

    def change_law(self, law: Law) -> None:
        """Announce another law of the drive."""

    def preview(self, until: float) -> Motion | None:
        """What is known beyond `time` of a motion up to `until` [s]."""

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Let impacts of a joint have another coefficient from now on. KeyError: it has none."""

    def snapshot(self) -> Snapshot:
        """All that is needed to go on from here, bit by bit."""

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from there."""

    def drain(self) -> tuple[Motion, list[Impact], list[ModeChange]]:
        """Motion and events since the last call."""


@dataclass(frozen=True)
class Machine:
    """The mechanism of a scene, ready to run.

    Attributes
    ----------
    name : of the scene
    scene : its content, in SI units
    """

    name: str
    scene: Scene

    @cached_property
    def plan(self) -> Plan:
        """Links, joints, drives and forces.

        Raises
        ------
        InputError
            If they do not fit together.
        """
        return plan_of(self.name, self.scene)

    @cached_property
    def level(self) -> Level:
        """The cheapest level that is exact for the scene."""
        if self.clearances:
            contacts = self.plan.rigid.values()
            asked = any(c.contact for c in contacts) or not contacts
            return Level.COMPLIANT if asked else Level.NONSMOOTH
        if self.torque_driven:
            return Level.SMOOTH
        wanted = self.scene.outputs.forces and self.plan.weighed
        return Level.INVERSE_DYNAMICS if wanted else Level.KINEMATIC

    @property
    def torque_driven(self) -> bool:
        """Whether any coordinate is free or moved by a torque: the motion is not known before."""
        return bool(self.plan.powered) or self.assembly.freedom > 0

    @property
    def dynamic(self) -> bool:
        """Whether the motion comes from equations of motion."""
        return self.level in (Level.SMOOTH, Level.NONSMOOTH, Level.COMPLIANT)

    @property
    def links(self) -> dict[str, Any]:
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
    def linkage(self) -> FourBar:
        """Lengths and branch of a four-bar whose links' angles are those from joint to joint.

        Raises
        ------
        InputError
            If it is another mechanism.
        """
        loop = self.closed_form
        if loop is None or any(loop.turned):
            raise InputError(
                f'{self.name}: this is for four-bars only, whose links have their joints on their '
                'x axes'
            )
        return loop.linkage

    @cached_property
    def mechanism(self) -> Mechanism:
        """Bodies and joints, cut where joints are loose; links without mass data are massless."""
        return self.plan.loose

    @property
    def main(self) -> str:
        """The coordinate whose revolutions count: the first that is driven."""
        return next(iter(self.plan.laws))

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

    def started_at(self, angle: float) -> Machine:
        """The same machine with its main drive at another angle [rad] at the start.

        Raises
        ------
        InputError
            If it has no drive.
        """
        scene, update = self.scene, {'start_angle': angle}
        if not scene.drive:
            raise InputError(f"{self.name}: there is no 'drive' to start at an angle")
        position = {c: x for c, x in scene.initial.position.items() if c != self.main}
        changed: dict[str, Any] = {
            'drive': scene.drive.model_copy(update=update),
            'initial': scene.initial.model_copy(update={'position': position}),
        }
        if self.closed_form:
            near = zip(self.closed_form.links[1:], self.closed_form.positions(angle), strict=True)
            found = {c: Measure(float(x), 'rad') for c, x in near if math.isfinite(x)}
            changed['guess'] = {**scene.guess, **found}
        return replace(self, scene=scene.model_copy(update=changed))

    @cached_property
    def closed_form(self) -> FourBarLoop | None:
        """The four-bar that it is without clearance, if its motion has a closed form."""
        return closed_four_bar(self)

    @property
    def starts_singular(self) -> bool:
        """Whether a driven mechanism starts in a singular position."""
        return self.closed_form is None and self.assembly.slope is not None

    @cached_property
    def ideal(self) -> IdealMotion:
        """The motion of the mechanism without clearance.

        Closed forms know two branches of a four-bar; through a change point neither goes on.
        """
        if self.closed_form:
            return FourBarMotion(self.closed_form, self.plan.ideal.coordinates)
        return LinkageMotion(self.kinematics(self.plan.prescribed))

    def kinematics(self, held: Sequence[str]) -> Kinematics:
        """The closures of the mechanism without clearance, with some coordinates given."""
        ideal = self.plan.ideal
        return Kinematics(ideal, closures(ideal, ideal.cut), held)

    @property
    def placed_outright(self) -> bool:
        """Whether the scene itself says where links start, beside the main drive."""
        given = self.plan.given
        return bool((given[0].keys() | given[1]) - {self.main})

    @cached_property
    def held(self) -> dict[str, tuple[float, float]]:
        """Values and rates at the start of the coordinates that drives move."""
        held = dict(self.plan.begins)
        for c in self.plan.prescribed:
            law = self.plan.laws[c][0]
            if isinstance(law, DriveLaw):
                _, local = law.about(Fraction(0))
                held[c] = (local[0], local[1] if len(local) > 1 else 0.0)
        return held

    @cached_property
    def assembly(self) -> Assembly:
        """Where the mechanism without clearance is at the start.

        Raises
        ------
        InputError
            If it cannot be assembled.
        """
        return assemble(self)

    @cached_property
    def inverse_dynamics(self) -> InverseDynamics:
        """Forces of the ideal mechanism."""
        return self._inverse_dynamics(inertia=True)

    @cached_property
    def statics(self) -> NominalPhysics:
        """The ideal mechanism with the forces that it has without inertia, at actual speeds."""
        return NominalPhysics(self.ideal, self.mechanism, self._inverse_dynamics(inertia=False))

    def _inverse_dynamics(self, inertia: bool) -> InverseDynamics:
        ideal = self.plan.ideal
        closing, loads = closures(ideal, ideal.cut), self.plan.elements(ideal)
        return InverseDynamics(ideal, closing, self.plan.prescribed, loads, inertia)

    @cached_property
    def system(self) -> System:
        """The compiled equations of motion.

        Raises
        ------
        InputError
            If a gap can never change.
        """
        mechanism = self.mechanism
        gaps, films = gaps_and_films(mechanism, self.clearances)
        frames = Frames(mechanism.coordinates, Parameters())
        for gap in gaps:
            if all(slope is None for slope in gap.value(frames).gradient.values()):
                raise InputError(
                    f'{self.name}: joints.{gap.joint} has a clearance that never opens nor '
                    'closes: its links move along it only; leave the joint out'
                )
        closing = closures(mechanism, [j for j in mechanism.cut if j not in self.clearances])
        return self._compiled(mechanism, gaps, closing, films)

    @cached_property
    def ideal_system(self) -> System:
        """The equations of motion of the mechanism without clearance."""
        ideal = self.plan.ideal
        return self._compiled(ideal, [], closures(ideal, ideal.cut), [])

    def _compiled(
        self,
        mechanism: Mechanism,
        gaps: Sequence[Gap],
        closing: Sequence[Relation],
        films: Sequence[ForceElement],
    ) -> System:
        laws = [law for laws in self.plan.laws.values() for law in laws]
        degree = max(law.degree if isinstance(law, DriveLaw) else 1 for law in laws)
        if self.commands:
            degree = max(degree, 2)  # commanded speeds are joined by ramps
        elements = [*films, *self.plan.elements(mechanism)]
        prescribed, powered = self.plan.prescribed, self.plan.powered
        return System(mechanism, gaps, prescribed, degree, closing, powered, elements)

    @cached_property
    def physics(self) -> Physics:
        """What follows from a motion of this machine."""
        if self.dynamic:
            return DynamicPhysics(self.system)
        forces = self.inverse_dynamics if self.level is Level.INVERSE_DYNAMICS else None
        return NominalPhysics(self.ideal, self.mechanism, forces)

    def oscillator(self, name: str) -> ShakenFrame:
        """A frame of the scene on its springs, at the start of a run.

        ``machine.oscillator('frame').take(solution.motion)`` gives its motion, a function of time;
        `take` may also be called with the motion of one `Piece` after the other.

        Raises
        ------
        InputError
            If there is none of that name, or what shakes it is not known.
        """
        return ShakenFrame(read_frame(self, name), forces_on(self, name))

    @property
    def commands(self) -> Commands | None:
        """What commands of speed the main drive takes, if any."""
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
        """When the main drive has turned so far [s].

        Raises
        ------
        InputError
            If its law does not say, or never turns it so far.
        """
        if not isinstance(self.law, DriveLaw):
            raise InputError(
                f'how fast {self.main} turns is not known beforehand: give a duration in seconds, '
                'not revolutions'
            )
        if self.law.straight:
            raise InputError(
                f'{self.main} is driven straight, it makes no revolutions: give a duration in '
                'seconds'
            )
        t = time_of_angle(self.laws, 2.0 * math.pi * revolutions)
        if t is None:
            raise InputError(
                f'{self.main} is at rest: give a duration in seconds, not revolutions'
            )
        return t

    @property
    def allowed_penetration(self) -> float:
        """Violation of a gap [m] that tolerance or rounding explain; beyond it a run fails."""
        solver = self.scene.solver
        allowed = max(1e3 * solver.rtol * self.mechanism.size, solver.atol, 1e-12)
        played = [c.radial for c in self.clearances.values() if c.radial]
        return min([allowed, *(0.1 * radial for radial in played)])

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
            run = self.nominal(first)
        for later in sorted(
            (x for c in system_order for x in laws[c][1:]), key=lambda x: x.valid_from
        ):
            run.change_law(later)
        return run

    def nominal(self, laws: Sequence[Law]) -> NominalRun:
        """A run of the mechanism without clearance under prescribed drives.

        Raises
        ------
        TypeError
            If a torque moves it: then it has equations of motion.
        """
        prescribed = [law for law in laws if isinstance(law, DriveLaw)]
        if len(prescribed) < len(laws):
            raise TypeError('a mechanism that a torque moves has equations of motion')
        q, slope, size = self.assembly.q, self.assembly.slope, self.plan.ideal.size
        return NominalRun(self.ideal, prescribed, q, size, self._edges(), slope=slope)

    def _edges(self) -> Edges | None:
        """Where something begins or ceases to act in the course of an ideal motion."""
        if self.level is Level.INVERSE_DYNAMICS:
            return self.inverse_dynamics.edges  # those of the closures among them
        return self.ideal.kinematics.edges if isinstance(self.ideal, LinkageMotion) else None

    @property
    def _large(self) -> bool:
        """Whether the equations are so long that compact code pays."""
        system = self.system
        tabulated = any(isinstance(s, Table) for s in system.switches)
        many = len(system.free) + self._rows >= _COMPACT_FROM
        return bool(system.elements) or tabulated or many

    @property
    def _rows(self) -> int:
        """How many contacts and closures the equations of motion are solved for."""
        return len(self.system.dynamics.rows) + len(self.system.dynamics.relation)

    @cached_property
    def fingerprint(self) -> str:
        """Of all that rules the motion, in a few letters."""
        silent = {'title', 'description', 'duration', 'outputs', 'sensors', 'oscillators'}
        content = self.scene.model_dump(exclude=silent)
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]

    def snapshot(self, run: Run) -> Snapshot:
        """What it takes for another run of this machine to go on where this one stands."""
        return replace(run.snapshot(), machine=self.fingerprint)

    def resume(self, snapshot: Snapshot) -> Run:
        """A run that goes on where another of this machine stood, bit by bit.

        Raises
        ------
        InputError
            If the snapshot is of another machine.
        """
        if snapshot.machine != self.fingerprint:
            raise InputError(
                f'the snapshot is of another machine than {self.name}: give the same scene with '
                'the same overrides'
            )
        run = self.start()
        run.restore(snapshot)
        return run

    def initial_state(self) -> State:
        """Where a run of the equations of motion starts, see `mechanism_sim.scene.initial`."""
        return self._initial_state

    @cached_property
    def _initial_state(self) -> State:
        return initial_state(self)

    @cached_property
    def ways(self) -> set[object]:
        """Of the drives, those that were tried and found free, see `mechanism_sim.scene.way`."""
        return set()

    def channel(self, name: str, beside: Channel | None = None) -> Channel:
        """The measured channel of a sensor, to be fed with motion from the start of a run on.

        It may share the analogue part of a channel `beside` it, fed with the same motions, that
        differs in sampling, converter and noise only.

        Raises
        ------
        KeyError
            If there is no such sensor.
        """
        return channel(self, name, beside)

    def inertial_unit(self, name: str) -> InertialUnit:
        """The inertial unit in the place of a sensor, to be fed likewise.

        Raises
        ------
        KeyError
            If there is no such sensor.
        """
        return inertial_unit(self, name)

    def prepare(self) -> None:
        """Compile all that a run will need, so that it does not wait later."""
        run = self.start()
        run.advance(1e-6 * min(self.period, 1.0), final=True, most=1)
        motion, *_ = run.drain()
        Audit(self.physics).add(motion, [])
