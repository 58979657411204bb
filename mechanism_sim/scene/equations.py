"""The equations of motion of a machine, compiled when first needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mechanism_sim.engine.dynamics import AppliedForces
from mechanism_sim.engine.observer import Observer
from mechanism_sim.engine.system import System
from mechanism_sim.joints.joint_keys import bounds_of, contacts_of
from mechanism_sim.keys.names import SceneError
from mechanism_sim.planar.closures import closures, independent
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.massless import inertial_motion, without_mass
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import ForceElement, Gap, Relation
from mechanism_sim.planar.switches import SwitchTable
from mechanism_sim.scene.assembly import Assembly
from mechanism_sim.scene.plan import ScenePlan
from mechanism_sim.scene.singular_start import neighbours
from mechanism_sim.tolerances import TOLERANCES

_BESIDE = 0.3
"""[rad, m] from the start, where it is looked whether links without mass make a difference."""


def moving(gap: Gap, frames: Frames) -> set[str]:
    """The coordinates that open or close a gap."""
    return {c for c, slope in gap.value(frames).gradient.items() if slope is not None}


_COMPACT_FROM = 8
"""Free coordinates, contacts and closures from which on compact code pays: it compiles faster.

Four fifths of the start of large machines were LLVM's optimisation.
"""


@dataclass(frozen=True)
class EquationsOfMotion:
    """The equations of motion of a machine, with its clearances and without.

    Attributes
    ----------
    name : name of the scene
    assembly : initial configuration of the mechanism without clearance
    """

    name: str
    plan: ScenePlan
    assembly: Assembly

    @cached_property
    def system(self) -> System:
        """The compiled equations of motion."""
        plan, mechanism = self.plan, self.plan.loose
        gaps, films = contacts_of(plan.scene.joints, mechanism, plan.clearances)
        frames = Frames(mechanism.coordinates, Parameters())
        for gap in gaps:
            if not moving(gap, frames):
                raise SceneError(
                    f'{self.name}: joints.{gap.joint} has a clearance that never opens nor '
                    'closes: its links move along it only; leave the joint out'
                )
        # `validation` has seen to what drives alone move
        bounds = bounds_of(plan.scene.joints, mechanism, plan.touching)
        gaps += [gap for gap in bounds if not moving(gap, frames) <= {*plan.prescribed}]
        closing = self._independent(plan.loop_closures, plan.loops(plan.prescribed))
        return self._compiled(mechanism, closing, gaps, films)

    @cached_property
    def observer(self) -> Observer:
        """Forces, accelerations and gaps of `system` in given states."""
        return Observer(self.system)

    @cached_property
    def ideal_observer(self) -> Observer:
        """`observer` of the mechanism without clearance."""
        if not self.plan.clearances and not self.plan.touching:
            return self.observer
        plan, ideal = self.plan, self.plan.ideal
        loops = plan.kinematics(plan.prescribed)
        closing = self._independent(closures(ideal, ideal.cut), loops)
        return Observer(self._compiled(ideal, closing, [], []))

    def _independent(self, closing: Sequence[Relation], loops: Kinematics) -> Sequence[Relation]:
        """Closures without the rows that follow from others, where there may be such rows.

        They are those that are most independent at a position beside the start where the rank is
        that of the motion; the audit looks whether those left out vanish with them.
        """
        if not (closing and self.assembly.dependent):
            return closing
        q, _ = converted(self.plan.ideal, loops.mechanism, self.assembly.q, self.assembly.v)
        near = np.column_stack([q, neighbours(loops, q)])
        rows = loops.directions(near)
        sizes = np.linalg.svd(rows, compute_uv=False)
        ranks = (sizes > TOLERANCES.branches.singular).sum(axis=1)
        least = np.where(ranks == ranks.max(), sizes[:, ranks.max() - 1], 0.0)
        return independent(closing, loops.rows, rows[int(least.argmax())])

    def _compiled(
        self,
        mechanism: Mechanism,
        closing: Sequence[Relation],
        gaps: Sequence[Gap],
        films: Sequence[ForceElement],
    ) -> System:
        plan = self.plan
        drive = plan.scene.drive
        laws = [law for laws in plan.laws.values() for law in laws]
        degree = max(law.degree if isinstance(law, DriveLaw) else 1 for law in laws)
        degree = max(degree, *(x.degree for x in plan.sources.values()), 1)
        if drive and drive.commands:
            degree = max(degree, 2)  # commanded speeds are joined by ramps
        return System(
            mechanism,
            gaps,
            plan.prescribed,
            degree,
            closing,
            plan.powered,
            AppliedForces(
                [*films, *plan.elements(mechanism)],
                [replace(m, characteristic=m.characteristic.on(mechanism)) for m in plan.motors],
                plan.frictions(mechanism),
            ),
            self._constraint_mass(mechanism) if closing else 0.0,
        )

    def _constraint_mass(self, mechanism: Mechanism) -> float:
        """Mass [kg] added along closures if free coordinates have no inertia by themselves."""
        prescribed, at = self.plan.prescribed, self.assembly
        q, _ = converted(self.plan.ideal, mechanism, at.q, at.v)
        free = [i for i, c in enumerate(mechanism.coordinates) if c not in prescribed]
        beside = np.random.default_rng(3).normal(0.0, _BESIDE, (3, len(q)))
        for shift in (np.zeros(len(q)), *beside):
            moved = inertial_motion(mechanism, q + shift)[:, free]
            if without_mass(moved, np.zeros((0, len(free)))).size:
                return mechanism.total_mass
        return 0.0

    @property
    def compact(self) -> bool:
        """True if the equations are so long that compact code pays."""
        system = self.system
        rows = len(system.dynamics.contacts.rows) + len(system.dynamics.equations.relation_jets)
        tabulated = any(isinstance(s, SwitchTable) for s in system.switches)
        many = len(system.free) + rows >= _COMPACT_FROM
        flexible = any(x.flexible for x in self.plan.loose.extensions.values())
        more = (
            system.elements
            or system.constraint_mass
            or system.dynamics.frictional_joints
            or flexible
        )
        worn = any(getattr(c, 'profile', None) for c in self.plan.clearances.values())
        # few of them may be long, as of a loose Geneva wheel with friction: 40 s of compilation
        return bool(more) or tabulated or many or worn or system.taylor(True).terms.long
