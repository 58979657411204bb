"""A machine whose loops are closed: where it is at the start, and how it moves without play."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from enum import Enum
from functools import cached_property
from typing import Any, Self

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.ideal import FourBarMotion, IdealMotion, LinkageMotion
from mechanism_sim.linkages.loops import FourBarLoop
from mechanism_sim.linkages.nominal import NominalPhysics, NominalRun
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.inverse_dynamics import InverseDynamics
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.switched_functions import Edges
from mechanism_sim.scene.assembly import Assembly, assemble, closed_four_bar
from mechanism_sim.scene.contact_keys import in_plane
from mechanism_sim.scene.elastic_links import stiffened
from mechanism_sim.scene.joint_keys import KINDS
from mechanism_sim.scene.model import MachineModel
from mechanism_sim.scene.schema import JointPart
from mechanism_sim.units import Measure


class Level(Enum):
    """How much mechanics a scene needs; the value is what people read."""

    KINEMATIC = 'kinematic'
    INVERSE_DYNAMICS = 'inverse dynamics'
    SMOOTH = 'smooth dynamics'
    NONSMOOTH = 'nonsmooth dynamics'
    COMPLIANT = 'compliant contact'


class NominalModel(MachineModel):
    """A machine without clearance, at the start and in motion."""

    @cached_property
    def closed_form(self) -> FourBarLoop | None:
        """The four-bar that it is without clearance, if its motion has a closed form."""
        return closed_four_bar(self)

    @property
    def linkage(self) -> FourBar:
        """Lengths and branch of a four-bar whose links' angles are those from joint to joint."""
        loop = self.closed_form
        if loop is None or any(loop.turned):
            raise InputError(
                f'{self.name}: this is for four-bars only, whose links have their joints on their '
                'x axes'
            )
        return loop.linkage

    @cached_property
    def assembly(self) -> Assembly:
        """Where the mechanism without clearance is at the start."""
        return assemble(self, self.closed_form)

    @cached_property
    def rigid(self) -> Self:
        """The same machine with rigid links, and shafts that do not give way."""
        elastic = self.plan.ideal.deformations
        if not elastic:
            return self
        scene = self.scene
        links = {name: stiffened(link) for name, link in scene.links.items()}
        given = {
            kind: {c: x for c, x in getattr(scene.initial, kind).items() if c not in elastic}
            for kind in ('position', 'velocity')
        }
        joints = {
            name: JointPart.model_validate({'revolute': j.points})
            if KINDS[j.kind].rotor
            else j.model_copy(update={'clearance': in_plane(j.clearance)})
            for name, j in scene.joints.items()
        }
        changed = {
            'links': links, 'joints': joints, 'initial': scene.initial.model_copy(update=given),
        }  # fmt: skip
        found = replace(self, scene=scene.model_copy(update=changed))
        guides = [self.plan.ideal.joint(j) for j in self.plan.bending]
        return self._guided(found, {link for j in guides for link in (j.first, j.second)})

    def _guided(self, rigid: Self, links: Collection[str]) -> Self:
        """It starts where this one does, although guides carry some links now."""
        if not links:
            return rigid
        parts = {
            kind: {c: x for c, x in getattr(rigid.scene.initial, kind).items()
                   if c not in links and '.' not in c}
            for kind in ('position', 'velocity')
        }  # fmt: skip
        changed = {'initial': rigid.scene.initial.model_copy(update=parts), 'guess': {}}
        rigid = replace(rigid, scene=rigid.scene.model_copy(update=changed))
        tree = rigid.plan.ideal
        q, _ = converted(self.plan.ideal, tree, self.assembly.q, self.assembly.v)
        guess = {
            c: Measure(x, 'm' if c in tree.displacements else 'rad')
            for c, x in zip(tree.coordinates, q.tolist(), strict=True)
        }
        return replace(rigid, scene=rigid.scene.model_copy(update={'guess': guess}))

    @property
    def starts_singular(self) -> bool:
        """Whether a driven mechanism starts in a singular position."""
        return self.closed_form is None and self.assembly.slope is not None

    @property
    def torque_driven(self) -> bool:
        """Whether any coordinate is free or moved by a torque: the motion is not known before."""
        return bool(self.plan.powered) or self.assembly.freedom > 0

    @property
    def dynamic(self) -> bool:
        """Whether the motion comes from equations of motion."""
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

    @cached_property
    def ideal(self) -> IdealMotion:
        """The motion of the mechanism without clearance.

        Closed forms know two branches of a four-bar; through a change point neither goes on.
        """
        if self.closed_form:
            return FourBarMotion(self.closed_form, self.plan.ideal.coordinates)
        return LinkageMotion(self.kinematics(self.plan.prescribed))

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
        efforts = {c: effort(ideal) for c, effort in self.plan.efforts.items()}
        return InverseDynamics(
            ideal,
            closing,
            self.plan.prescribed,
            loads,
            self.plan.frictions(ideal),
            inertia,
            self.plan.unknowns(ideal),
            efforts,
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
        at, ideal = self.assembly, self.plan.ideal
        acts = loads and self.level is Level.INVERSE_DYNAMICS
        steep = self.inverse_dynamics.steep if acts else None
        return NominalRun(
            self.ideal, prescribed, at.q, ideal.size, self._edges(), slope=at.slope, steep=steep,
            turns=[self.turned.get(c, 0) for c in ideal.coordinates],
        )  # fmt: skip

    def _edges(self) -> Edges | None:
        """Where something begins or ceases to act in the course of an ideal motion."""
        if self.level is Level.INVERSE_DYNAMICS:
            return self.inverse_dynamics.edges  # those of the closures among them
        return self.ideal.kinematics.edges if isinstance(self.ideal, LinkageMotion) else None

    def started_at(self, angle: float) -> Self:
        """The same machine with its main drive at another angle [rad] at the start."""
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
