"""A scene turned into a machine that can run: the level it needs, its equations, its runs."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.polynomial import Polynomial, polynomial

from mechanism_sim.contact.compliant import Flores, Hertz, HuntCrossley, LankaraniNikravesh
from mechanism_sim.contact.film import ShortBearing
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.audit import Audit
from mechanism_sim.hybrid.event_loop import EventLoop
from mechanism_sim.hybrid.events import Impact, ModeChange
from mechanism_sim.hybrid.physics import DynamicPhysics, Physics
from mechanism_sim.hybrid.snapshot import Snapshot, State
from mechanism_sim.hybrid.system import System
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.linkages.bearing import BearingClearance, Closure, FilmBearing
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.drive import DriveLaw, Law, TorqueLaw, speed_profile
from mechanism_sim.planar.inverse_dynamics import InverseDynamics
from mechanism_sim.planar.mechanism import GROUND, Body, Mechanism, Revolute
from mechanism_sim.planar.protocols import ForceLaw
from mechanism_sim.scene.initial import initial_state
from mechanism_sim.scene.schema import Clearance, FourBarScene, Link

CLOSING_JOINT = 'coupler_rocker'
"""The joint where the loop of a four-bar without clearance is cut."""

_COMPACT_FROM = 8
"""Free coordinates and contact rows from which on compact code pays: it compiles much faster."""


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

    def snapshot(self) -> Snapshot:
        """All that is needed to go on from here, bit by bit."""

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from there."""

    def drain(self) -> tuple[Motion, list[Impact], list[ModeChange]]:
        """Motion and events since the last call."""


@dataclass(frozen=True)
class Machine:
    """The four-bar of a scene.

    Attributes
    ----------
    name : of the scene
    scene : its content, in SI units
    """

    name: str
    scene: FourBarScene

    @property
    def level(self) -> Level:
        """The cheapest level that is exact for the scene."""
        if self.clearances:
            asked = any(c.contact for c in self.clearances.values())
            return Level.COMPLIANT if asked else Level.NONSMOOTH
        if self.torque_driven:
            return Level.SMOOTH
        known = all(link.mass for link in self.links.values())
        wanted = self.scene.outputs.forces and known
        return Level.INVERSE_DYNAMICS if wanted else Level.KINEMATIC

    @property
    def torque_driven(self) -> bool:
        """Whether the crank is moved by a torque, so that its motion is not known beforehand."""
        return self.scene.drive.torque is not None or self.scene.drive.motor is not None

    @property
    def dynamic(self) -> bool:
        """Whether the motion comes from equations of motion."""
        return self.level in (Level.SMOOTH, Level.NONSMOOTH, Level.COMPLIANT)

    @property
    def links(self) -> dict[str, Link]:
        """The moving links."""
        links = self.scene.links
        return {'crank': links.crank, 'coupler': links.coupler, 'rocker': links.rocker}

    @cached_property
    def clearances(self) -> dict[str, Clearance]:
        """The joints with clearance."""
        joints = self.scene.joints
        found = {name: getattr(joints, name).clearance for name in type(joints).model_fields}
        return {name: clearance for name, clearance in found.items() if clearance}

    @cached_property
    def linkage(self) -> FourBar:
        """Lengths and branch."""
        links = self.scene.links
        return FourBar(
            links.ground.length,
            links.crank.length,
            links.coupler.length,
            links.rocker.length,
            self.scene.branch,
        )

    @cached_property
    def mechanism(self) -> Mechanism:
        """Bodies and joints, cut where joints are loose; links without mass data are massless."""
        return self._cut_at(tuple(self.clearances) or (CLOSING_JOINT,))

    @cached_property
    def ideal(self) -> Mechanism:
        """The mechanism as if no joint were loose."""
        return self._cut_at((CLOSING_JOINT,))

    def _cut_at(self, cut: tuple[str, ...]) -> Mechanism:
        links = self.scene.links
        turning = {'crank': self.scene.drive.flywheel}
        bodies = [
            Body(
                name,
                link.mass or 0.0,
                (link.inertia or 0.0) + turning.get(name, 0.0),
                (link.cog or 0.0, 0.0),
            )
            for name, link in self.links.items()
        ]
        origin = (0.0, 0.0)
        return Mechanism(
            tuple(bodies),
            (
                Revolute('ground_crank', GROUND, 'crank', origin, origin),
                Revolute('crank_coupler', 'crank', 'coupler', (links.crank.length, 0.0), origin),
                Revolute(
                    CLOSING_JOINT,
                    'coupler',
                    'rocker',
                    (links.coupler.length, 0.0),
                    (links.rocker.length, 0.0),
                ),
                Revolute('rocker_ground', 'rocker', GROUND, origin, (links.ground.length, 0.0)),
            ),
            cut,
            self.scene.gravity,
        )

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """The laws of the crank, in the order in which they take over."""
        drive, given = self.scene.drive, self.scene.initial.position.crank
        angle = drive.start_angle if given is None else given
        if drive.torque:
            t = drive.torque
            return (TorqueLaw('crank', (t.constant, t.per_angle, t.per_speed)),)
        if drive.motor:
            m = drive.motor
            return (TorqueLaw('crank', (m.stall_torque, 0.0, -m.stall_torque / m.no_load_speed)),)
        if drive.profile:
            profile = drive.profile
            return tuple(speed_profile('crank', angle, profile.points, profile.ramp == 'smooth'))
        return (DriveLaw('crank', (angle, drive.speed or 0.0)),)

    @property
    def law(self) -> Law:
        """The first law of the crank."""
        return self.laws[0]

    @property
    def start_of_crank(self) -> tuple[float, float]:
        """Angle [rad] and speed [rad/s] of the crank at time zero."""
        if isinstance(self.law, DriveLaw):
            angle, speed, *_ = *self.law.coefficients, 0.0
            return angle, speed
        drive, given = self.scene.drive, self.scene.initial.position.crank
        return (drive.start_angle if given is None else given), drive.speed or 0.0

    @cached_property
    def inverse_dynamics(self) -> InverseDynamics:
        """Forces of the ideal mechanism."""
        return InverseDynamics(self.ideal, [Closure(CLOSING_JOINT, self.ideal)], ['crank'])

    @cached_property
    def system(self) -> System:
        """The compiled equations of motion."""
        films = [
            FilmBearing(name, self.mechanism, film)
            for name, c in self.clearances.items()
            if (film := oil_film(c))
        ]
        gaps = [] if films else [
            BearingClearance(
                name, self.mechanism, c.radial, c.restitution, c.friction, c.hypothesis,
                c.pin_radius, force_law(c), c.contact.creep_speed if c.contact else 1.0,
            )
            for name, c in self.clearances.items()
        ]  # fmt: skip
        closures = [] if gaps or films else [Closure(CLOSING_JOINT, self.mechanism)]
        degree = max(law.degree if isinstance(law, DriveLaw) else 1 for law in self.laws)
        driven = (), ('crank',)
        prescribed, powered = driven if self.torque_driven else driven[::-1]
        return System(self.mechanism, gaps, prescribed, degree, closures, powered, films)

    @cached_property
    def ideal_system(self) -> System:
        """The torque-driven mechanism without clearance."""
        return System(self.ideal, [], (), 1, [Closure(CLOSING_JOINT, self.ideal)], ('crank',))

    @cached_property
    def physics(self) -> Physics:
        """What follows from a motion of this machine."""
        if self.dynamic:
            return DynamicPhysics(self.system)
        forces = self.inverse_dynamics if self.level is Level.INVERSE_DYNAMICS else None
        return NominalPhysics(self.linkage, self.mechanism, forces)

    @property
    def _fastest(self) -> float:
        """Largest speed of the crank that is known beforehand [rad/s]."""
        drive = self.scene.drive
        speeds = [self.start_of_crank[1]]
        if drive.profile:
            speeds += [speed for _, speed in drive.profile.points]
        return max(map(abs, speeds))

    @property
    def period(self) -> float:
        """Duration of a crank revolution at the largest speed [s]; infinite for one at rest."""
        return 2.0 * math.pi / self._fastest if self._fastest else math.inf

    def time_of(self, revolutions: float) -> float:
        """When the crank has turned so far [s].

        Raises
        ------
        InputError
            If its law does not say, or never turns it so far.
        """
        if self.torque_driven:
            raise InputError(
                'how fast a torque turns the crank is not known beforehand: give a duration in '
                'seconds, not revolutions'
            )
        wanted, turned = 2.0 * math.pi * revolutions, 0.0
        laws = [law for law in self.laws if isinstance(law, DriveLaw)]
        for law, later in zip(laws, [*laws[1:], None], strict=True):
            end = later.valid_from if later else math.inf
            t = self._reached(law, wanted - turned, end)
            if t is not None:
                return t
            if later is None:
                break
            ends = [law.valid_from - law.reference_time, end - law.reference_time]
            turned += float(abs(np.diff(polynomial.polyval(ends, law.coefficients))[0]))
        raise InputError('the crank is at rest: give a duration in seconds, not revolutions')

    @staticmethod
    def _reached(law: DriveLaw, angle: float, end: float) -> float | None:
        """When a law has turned by `angle` [rad] since it took over, if before `end` [s]."""
        if law.degree == 1 and law.valid_from == law.reference_time:
            speed = abs(law.coefficients[1])
            t = law.valid_from + angle / speed if speed else math.inf
            return t if t <= end and t < math.inf else None
        began = law.valid_from - law.reference_time
        start = polynomial.polyval(began, law.coefficients)
        hits = []
        for sign in (1.0, -1.0):
            shifted = Polynomial(np.array(law.coefficients)) - (start + sign * angle)
            roots = np.asarray(shifted.trim().roots())
            real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
            hits += [float(x) for x in real[real > began]]
        times = [law.reference_time + root for root in hits]
        return min((t for t in times if t <= end), default=None)

    @property
    def allowed_penetration(self) -> float:
        """Violation of a gap [m] that tolerance or rounding explain; beyond it a run fails."""
        solver = self.scene.solver
        allowed = max(1e3 * solver.rtol * self.mechanism.size, solver.atol, 1e-12)
        return min([allowed, *(0.1 * c.radial for c in self.clearances.values())])

    def start(self, law: Law | None = None) -> Run:
        """A new run of the machine, under the scene's laws or another of the same crank."""
        laws = self.laws if law is None else (law,)
        run: Run
        if self.dynamic:
            solver = self.scene.solver
            run = EventLoop(
                self.system,
                laws[:1],
                initial_state(self),
                solver.rtol,
                solver.atol,
                min(self.period / 8.0, 0.1),
                compact=self.system.elements != ()
                or len(self.system.free) + len(self.system.dynamics.rows) >= _COMPACT_FROM,
                fastest=self._fastest,
            )
        elif isinstance(laws[0], DriveLaw):
            run = NominalRun(self.linkage, laws[0])
        else:
            raise TypeError('an ideal four-bar whose crank a torque moves has equations of motion')
        for later in laws[1:]:
            run.change_law(later)
        return run

    @cached_property
    def fingerprint(self) -> str:
        """Of all that rules the motion, in a few letters."""
        content = self.scene.model_dump(exclude={'title', 'description', 'outputs', 'sensors'})
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
        return initial_state(self)

    def prepare(self) -> None:
        """Compile all that a run will need, so that it does not wait later."""
        run = self.start()
        run.advance(1e-6 * min(self.period, 1.0), final=True, most=1)
        motion, *_ = run.drain()
        Audit(self.physics).add(motion, [])


def oil_film(clearance: Clearance) -> ShortBearing | None:
    """The film of a lubricated bearing; ``None`` for a dry one."""
    contact = clearance.contact
    if contact is None or contact.law != 'film':
        return None
    given = (contact.viscosity, contact.width, contact.radius)
    viscosity, width, radius = (value or 0.0 for value in given)  # checked to be there
    return ShortBearing(viscosity, width, radius, clearance.radial)


def force_law(clearance: Clearance) -> ForceLaw | None:
    """The law of a compliant contact; ``None`` for a rigid one."""
    contact, e = clearance.contact, clearance.restitution
    if contact is None or contact.law == 'film' or contact.stiffness is None:
        return None
    if contact.law == 'hertz':
        return Hertz(contact.stiffness, contact.exponent)
    laws: dict[str, Callable[[float, float, float], ForceLaw]] = {
        'hunt_crossley': HuntCrossley,
        'lankarani_nikravesh': LankaraniNikravesh,
        'flores': Flores,
    }
    return laws[contact.law](contact.stiffness, e, contact.exponent)


def joint_forces(machine: Machine, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Forces in the joints of the ideal mechanism (j, 2) [N], first-named on second-named link.

    `a` counts only where the crank is prescribed; a torque sets its own acceleration.
    """
    law = machine.law
    if isinstance(law, DriveLaw):
        return machine.inverse_dynamics(q, v, a).reaction[:, :, 0]
    constant, per_angle, per_speed = law.coefficients
    torque = constant + per_angle * q[:1] + per_speed * v[:1]
    none = np.zeros((0, 1))
    seen = machine.ideal_system.observe(q, v, none, none.astype(np.uint8), torque)
    return seen.reaction[:, :, 0]
