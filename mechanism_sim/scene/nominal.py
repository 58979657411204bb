"""A machine without clearance: its motion under prescribed drives, and the forces in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from mechanism_sim.keys.names import SceneError
from mechanism_sim.linkages.drive_range import DriveRange, drive_range
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.ideal import FourBarMotion, IdealMotion, LinkageMotion
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.inverse_dynamics import InverseDynamics
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.scene.assembly import Assembly
from mechanism_sim.scene.plan import ScenePlan

_TURNS = 16
"""Turns from the start that are tried of a machine that need not come back after one."""


@dataclass(frozen=True)
class Nominal:
    """The mechanism without clearance, `ScenePlan.ideal`.

    Attributes
    ----------
    name : of the scene
    assembly : where it is at the start
    forces : whether forces are asked of its runs
    """

    name: str
    plan: ScenePlan
    assembly: Assembly
    forces: bool

    @property
    def linkage(self) -> FourBar:
        """Lengths and branch of a four-bar whose links' angles are those from joint to joint."""
        loop = self.assembly.loop
        if loop is None or any(loop.turned):
            raise SceneError(
                f'{self.name}: this is for four-bars only, whose links have their joints on their '
                'x axes'
            )
        return loop.linkage

    @cached_property
    def motion(self) -> IdealMotion:
        """The motion under any drives.

        Closed forms know two branches of a four-bar; through a change point neither goes on.
        """
        if self.assembly.loop:
            return FourBarMotion(self.assembly.loop, self.plan.ideal.coordinates)
        return LinkageMotion(self.plan.kinematics(self.plan.prescribed))

    @cached_property
    def reach(self) -> float:
        """How far from its start a single drive is followed [rad, m].

        A turn where all is as before after one; a slider as far as it never goes between links.
        """
        if self.plan.main in self.plan.ideal.displacements:
            return 2.0 * math.pi * _TURNS * self.plan.ideal.size
        again = not any(isinstance(j, HigherPair) for j in self.plan.joints)
        return 2.0 * math.pi * (1 if again else _TURNS)

    @cached_property
    def drive_range(self) -> DriveRange | None:
        """Between which limits the drive moves all links; None if not a single one does."""
        prescribed, at = self.plan.prescribed, self.assembly
        if len(self.plan.laws) != 1 or len(prescribed) != 1 or at.freedom or at.overdriven:
            return None
        return drive_range(self.plan.kinematics(prescribed), at.q, self.reach)

    @cached_property
    def inverse_dynamics(self) -> InverseDynamics:
        """Forces of the ideal mechanism."""
        return self._inverse_dynamics(inertia=True)

    @cached_property
    def statics(self) -> NominalPhysics:
        """The ideal mechanism with the forces that it has without inertia, at actual speeds."""
        return NominalPhysics(self.motion, self.plan.loose, self._inverse_dynamics(inertia=False))

    def _inverse_dynamics(self, inertia: bool) -> InverseDynamics:
        plan, ideal = self.plan, self.plan.ideal
        return InverseDynamics(
            ideal,
            closures(ideal, ideal.closing),
            plan.prescribed,
            plan.elements(ideal),
            plan.frictions(ideal),
            inertia,
            plan.unknowns(ideal),
            {c: effort(ideal) for c, effort in plan.efforts.items()},
        )

    def run(self, laws: Sequence[Law], loads: bool = False) -> NominalRun:
        """A run under prescribed drives.

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
        at, ideal = self.assembly, self.plan.ideal
        edges: Edges | None = None  # where something begins or ceases to act along the motion
        if self.forces:
            edges = self.inverse_dynamics.edges  # those of the closures among them
        elif isinstance(self.motion, LinkageMotion):
            edges = self.motion.kinematics.edges
        return NominalRun(
            self.motion,
            prescribed,
            at.q,
            ideal.size,
            edges,
            slope=at.slope,
            steep=self.inverse_dynamics.steep if loads and self.forces else None,
            turns=[self.plan.turned.get(c, 0) for c in ideal.coordinates],
        )
