"""A machine without clearance: its motion under prescribed drives, and the forces in it."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.keys.names import SceneError
from mechanism_sim.linkages.drive_range import DriveRange, drive_range
from mechanism_sim.linkages.four_bar import FourBar, FourBarLoop
from mechanism_sim.linkages.ideal import FourBarMotion, IdealMotion, LinkageMotion
from mechanism_sim.linkages.mobility import PART, RANK_TOLERANCE
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.inverse_dynamics import InverseDynamics
from mechanism_sim.planar.mechanism import HigherPair, Revolute
from mechanism_sim.scene.assembly import Assembly
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.scene.singular_start import neighbours
from mechanism_sim.tolerances import TOLERANCES

_TURNS = 16  # turns from the start that are tried of a machine that need not come back after one


@dataclass(frozen=True)
class Nominal:
    """The mechanism without clearance, `ScenePlan.ideal`.

    Attributes
    ----------
    name : name of the scene
    assembly : initial configuration
    forces : True if its runs need forces
    """

    name: str
    plan: ScenePlan
    assembly: Assembly
    forces: bool

    @property
    def four_bar(self) -> FourBarLoop:
        """The four-bar that it is, whose links' angles are those from joint to joint."""
        loop = self.assembly.loop
        if loop is None or any(loop.turned):
            raise SceneError(
                f'{self.name}: this is for four-bars only, whose links have their joints on their '
                'x axes'
            )
        return loop

    @property
    def linkage(self) -> FourBar:
        """Lengths and branch of `four_bar`."""
        return self.four_bar.linkage

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
        """Range from its start over which a single drive is followed [rad, m].

        A turn where all is as before after one; a slider as far as it never goes between links.
        """
        if self.plan.main in self.plan.ideal.displacements:
            return 2.0 * math.pi * _TURNS * self.plan.ideal.size
        again = not any(isinstance(j, HigherPair) for j in self.plan.joints)
        return 2.0 * math.pi * (1 if again else _TURNS)

    @cached_property
    def generic(self) -> Array:
        """Coordinates (n, N) of positions where the closures have the rank of the motion."""
        moving, q = self.plan.kinematics(self.plan.prescribed), self.assembly.q
        near = np.column_stack([q, neighbours(moving, q)])
        ranks = np.linalg.matrix_rank(moving.directions(near), tol=TOLERANCES.branches.singular)
        return np.asarray(near[:, ranks == ranks.max()])

    @cached_property
    def undetermined(self) -> dict[str, frozenset[str]]:
        """Parts of the forces in joints, by joint, that redundant constraints leave open.

        Among ``x``, ``y`` and ``moment``: what some forces of the joints alone, without any load,
        may be. Of a guide, what is not its moment is along its normal.
        """
        if not self.assembly.redundant:
            return {}
        soft, found = {*self.plan.elastic, *self.plan.clearances}, dict[str, frozenset[str]]()
        for q in self.generic.T:
            for joint, parts in self.open_forces(q, soft).items():
                found[joint] = found.get(joint, frozenset()) | parts
        return found

    def open_forces(self, q: Array, soft: Collection[str] = ()) -> dict[str, frozenset[str]]:
        """Parts of the forces in joints, by joint, that the constraints at q (n,) leave open.

        What is open of a force along a normal, as of a guide, is all of it.

        Parameters
        ----------
        soft : joints that give way, so that their forces are known
        """
        stresses = self.inverse_dynamics.self_stresses(q, RANK_TOLERANCE)
        joints = self.plan.ideal.joints
        names = [joint.name for joint in joints]
        given = stresses[:, [name in soft for name in names]].reshape(len(stresses), -1)
        if given.any():  # only such as leave alone what gives way
            firm = scipy.linalg.null_space(given.T, rcond=RANK_TOLERANCE)
            stresses = np.einsum('ks,kjc->sjc', firm, stresses)
        weights = np.array([1.0, 1.0, 1.0 / self.plan.ideal.size])
        open_ = (np.abs(stresses * weights) > PART).any(axis=0)
        normal = [not isinstance(joint, Revolute) for joint in joints]
        open_[normal, :2] = open_[normal, :2].any(axis=1, keepdims=True)
        return {
            name: frozenset(np.array(['x', 'y', 'moment'])[parts].tolist())
            for name, parts in zip(names, open_, strict=True)
            if parts.any()
        }

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
        dynamics = self._inverse_dynamics(inertia=False)
        return NominalPhysics(self.motion, self.plan.loose, dynamics, self.undetermined)

    @property
    def undetermined_names(self) -> list[str]:
        """`undetermined` as quantities are named; whole joints where all of the force is."""
        return [
            name
            for joint, parts in self.undetermined.items()
            for name in (
                [f'reaction.{joint}']
                if {'x', 'y'} <= parts
                else [f'reaction.{joint}.{part}' for part in sorted(parts)]
            )
        ]

    @property
    def undetermined_text(self) -> str:
        """Forces that redundant constraints leave open, in a sentence."""
        count = self.assembly.redundant
        return (
            f'not determined, for {count} of the closure equations follow{"s" * (count == 1)} '
            f'from the others: {", ".join(self.undetermined_names)}'
        )

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

    def run(self, laws: Sequence[Law], loads: bool = False) -> NominalRun:
        """A run under prescribed drives.

        Parameters
        ----------
        loads : limit its pieces to lengths suitable for loads, too

        Raises
        ------
        TypeError
            If a torque moves it: then it has equations of motion.
        """
        prescribed = [law for law in laws if isinstance(law, DriveLaw)]
        if len(prescribed) < len(laws):
            raise TypeError('a mechanism that a torque moves has equations of motion')
        at, ideal = self.assembly, self.plan.ideal
        edges = self.inverse_dynamics.edges if loads and self.forces else None
        asked = {*(self.motion.edges.outside if self.motion.edges else ())}
        if self.forces:
            asked |= {*self.inverse_dynamics.outside}
        run = NominalRun(
            self.motion,
            prescribed,
            at.q,
            ideal.size,
            edges if edges and edges.of_loads else None,
            slope=at.slope,
            steep=self.inverse_dynamics.steep if loads and self.forces else None,
            turns=[self.plan.turned.get(c, 0) for c in ideal.coordinates],
        )
        run.timed = 'time' in asked
        return run
