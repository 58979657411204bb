"""A scene turned into a machine that can run: the level it needs, its equations, its start."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import Protocol

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.audit import Audit
from mechanism_sim.hybrid.event_loop import EventLoop, State
from mechanism_sim.hybrid.events import Impact, ModeChange
from mechanism_sim.hybrid.physics import LoosePhysics, Physics
from mechanism_sim.hybrid.system import Array, System
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.linkages.bearing import BearingClearance, Closure
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.inverse_dynamics import InverseDynamics
from mechanism_sim.planar.mechanism import GROUND, Body, Mechanism, Revolute
from mechanism_sim.scene.schema import Clearance, FourBarScene, Link

CLOSING_JOINT = 'coupler_rocker'
"""The joint where the loop of the four-bar is cut."""


class Level(Enum):
    """How much mechanics a scene needs; the value is what people read."""

    KINEMATIC = 'kinematic'
    INVERSE_DYNAMICS = 'inverse dynamics'
    NONSMOOTH = 'nonsmooth dynamics'


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

    def change_law(self, law: DriveLaw) -> None:
        """Announce another law of the drive."""

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
        if self.scene.joints.coupler_rocker.clearance:
            return Level.NONSMOOTH
        known = all(link.mass for link in self.links.values())
        wanted = self.scene.outputs.forces and known
        return Level.INVERSE_DYNAMICS if wanted else Level.KINEMATIC

    @property
    def links(self) -> dict[str, Link]:
        """The moving links."""
        links = self.scene.links
        return {'crank': links.crank, 'coupler': links.coupler, 'rocker': links.rocker}

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
        """Bodies and joints; links without mass properties count as massless."""
        links = self.scene.links
        bodies = [
            Body(name, link.mass or 0.0, link.inertia or 0.0, (link.cog or 0.0, 0.0))
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
            (CLOSING_JOINT,),
            self.scene.gravity,
        )

    @cached_property
    def law(self) -> DriveLaw:
        """The law of the crank."""
        start = self.scene.initial.position.crank
        angle = self.scene.drive.start_angle if start is None else start
        return DriveLaw('crank', (angle, self.scene.drive.speed))

    @cached_property
    def inverse_dynamics(self) -> InverseDynamics:
        """Forces of the ideal mechanism."""
        closure = Closure(CLOSING_JOINT, self.mechanism)
        return InverseDynamics(self.mechanism, [closure], ['crank'])

    @property
    def _clearance(self) -> Clearance:
        clearance = self.scene.joints.coupler_rocker.clearance
        if clearance is None:
            raise ValueError(f'{CLOSING_JOINT} of {self.name} has no clearance')
        return clearance

    @cached_property
    def system(self) -> System:
        """The compiled equations of the loose mechanism."""
        clearance = self._clearance
        gap = BearingClearance(
            CLOSING_JOINT, self.mechanism, clearance.radial, clearance.restitution
        )
        return System(self.mechanism, [gap], ['crank'], self.law.degree)

    @cached_property
    def physics(self) -> Physics:
        """What follows from a motion of this machine."""
        if self.level is Level.NONSMOOTH:
            return LoosePhysics(self.system)
        forces = self.inverse_dynamics if self.level is Level.INVERSE_DYNAMICS else None
        return NominalPhysics(self.linkage, self.mechanism, forces)

    @property
    def period(self) -> float:
        """Duration of a crank revolution [s]; infinite for a crank at rest."""
        speed = abs(self.scene.drive.speed)
        return 2.0 * math.pi / speed if speed else math.inf

    @property
    def allowed_penetration(self) -> float:
        """Violation of a gap [m] that tolerance or rounding explain; beyond it a run fails."""
        solver = self.scene.solver
        allowed = max(1e3 * solver.rtol * self.mechanism.size, solver.atol, 1e-12)
        clearance = self.scene.joints.coupler_rocker.clearance
        return min(allowed, 0.1 * clearance.radial) if clearance else allowed

    def start(self, law: DriveLaw | None = None) -> Run:
        """A new run of the machine, under the scene's law or another of the same crank."""
        law = law or self.law
        if self.level is not Level.NONSMOOTH:
            return NominalRun(self.linkage, law)
        return EventLoop(
            self.system,
            [law],
            self.initial_state(),
            self.scene.solver.rtol,
            self.scene.solver.atol,
            min(self.period / 8.0, 0.1),
        )

    def prepare(self) -> None:
        """Compile all that a run will need, so that it does not wait later."""
        run = self.start()
        run.advance(1e-6 * min(self.period, 1.0), final=True, most=1)
        motion, *_ = run.drain()
        Audit(self.physics).add(motion, [])

    def initial_state(self) -> State:
        """Where a loose four-bar starts.

        ``centred``: the nominal mechanism, pin at the centre, in flight. ``seated``: the pin rests
        on the bushing in the direction of the nominal force of the coupler on the rocker; nominal
        rates. Coordinates given in `initial` replace those.

        Raises
        ------
        InputError
            If given coordinates put the pin outside of its bushing.
        """
        clearance = self._clearance
        _, (angle, speed, *_) = self.law.about(Fraction(0))
        # In extended precision: after a few dozen impacts the last digit of the start counts.
        crank = np.array([[angle], [speed], [0.0]], dtype=np.longdouble)
        q, v, a = (x.astype(float) for x in self.linkage.motion(*crank))
        seated = self.scene.start == 'seated'
        if seated:
            force = self.inverse_dynamics(q, v, a).reaction[2, :, 0]
            if not force.any():
                raise InputError(
                    f'{self.name}: start = seated, but no force presses the pin of '
                    f"{CLOSING_JOINT} on its bushing; write 'start: centred'"
                )
            n = force / np.hypot(*force)
            q[1:, 0] = self._displaced(angle, q[1:, 0], clearance.radial * n)
        given = self.scene.initial
        for i, name in enumerate(('coupler', 'rocker')):
            position, rate = getattr(given.position, name), getattr(given.velocity, name)
            if position is not None:
                q[i + 1, 0] = position
                seated = False
            if rate is not None:
                v[i + 1, 0] = rate
                seated = False
        self._check_inside(q, clearance.radial)
        turns = (0, 0)
        return State(Fraction(0), turns, tuple(q[1:, 0]), tuple(v[1:, 0]), (seated,))

    def _displaced(self, crank: float, near: Array, Q: Array) -> Array:
        """Angles of coupler and rocker with the pin displaced by Q [m] from the bushing centre."""
        l = self.linkage  # noqa: E741 - the lengths
        angles = np.array(
            l.close(l.ground - l.crank * np.cos(crank) + Q[0], -l.crank * np.sin(crank) + Q[1])
        )
        if np.isnan(angles).any():
            raise InputError(
                f'{self.name}: the mechanism cannot be assembled with the pin of {CLOSING_JOINT} '
                'seated: its clearance is too large'
            )
        return angles + 2.0 * np.pi * np.round((near - angles) / (2.0 * np.pi))

    def _check_inside(self, q: Array, clearance: float) -> None:
        value = self.system.gap_values(q)
        gap = float(self.system.gaps[0].distance(value[0])[0])
        if gap < -1e-6 * clearance:
            raise InputError(
                f'{self.name}: initial.position puts the pin of {CLOSING_JOINT} '
                f'{clearance - gap:.6g} m from the centre of its bushing; the radial clearance is '
                f'{clearance:g} m'
            )
