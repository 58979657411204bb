"""Prismatic joints: a guide along which a point slides."""

from __future__ import annotations

from typing import Any

from mechanism_sim.joints.contact_keys import OF_PINS, Clearance, ClearanceSpec, Friction
from mechanism_sim.joints.joint_keys import KINDS, Contacts, JointKeys, Reference
from mechanism_sim.joints.prismatic.contact import corners
from mechanism_sim.joints.stops import StopKeys
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Angle
from mechanism_sim.planar.joint_friction import ContactFriction, LineFriction
from mechanism_sim.planar.mechanism import Mechanism, Prismatic


class AxisKeys(StopKeys):
    """Joints that slide along a line."""

    axis: Angle = 0.0
    """Direction of sliding: in the first link of a prismatic joint, in the second's slot."""

    def frictions(self, given: Friction, joint: Any, mechanism: Mechanism) -> list[LineFriction]:
        """Friction along a guide or a slot."""
        return [LineFriction(joint.name, mechanism, given.coefficient, given.length or 0.0)]


class PinKeys(JointKeys):
    """A pin in slots that it leaves."""

    friction_keys = (), False

    def frictions(
        self, given: Friction, joint: Any, mechanism: Mechanism
    ) -> list[ContactFriction]:
        """Friction of the pin in its slot."""
        return [ContactFriction(joint.name, mechanism, given.coefficient, joint.touch(mechanism))]


@KINDS.add('prismatic')
class PrismaticKeys(AxisKeys):
    """A guide."""

    prismatic: Reference | None = None
    """A guide: the second point slides along `axis` through the first."""
    angle: Angle = 0.0
    """Of the second link in the first."""

    friction_keys = ('length',), False

    def read(self, names: Names, name: str) -> Prismatic:
        """A guide."""
        (a, on_a), (b, on_b) = names.ends(name)
        return Prismatic(name, a, b, on_a, on_b, self.axis, self.angle)

    def contacts(self, spec: ClearanceSpec, joint: Any, mechanism: Mechanism) -> Contacts:
        """The four corners of the block."""
        if not isinstance(spec, Clearance):  # as a guide has
            return (), ()
        size = spec.length or 0.0, spec.height or 0.0
        gaps = corners(mechanism, joint.name, size, spec.radial, **spec.behaviour())
        return [*gaps], ()

    def clearance_objection(self, given: Clearance) -> str:
        """An objection to a clearance of it; empty if there is none."""
        if not (given.length and given.height):
            return (
                "has a clearance that needs 'length' and 'height', those of the block in its guide"
            )
        if wrong := [key for key in OF_PINS if getattr(given, key)]:
            return f'has a clearance with {wrong[0]}, which applies to pins in bushings'
        if given.pin_radius:
            return 'has a clearance with pin_radius: a block has none'
        if given.film:
            return 'has a clearance with a film, which is for pins'
        return ''
