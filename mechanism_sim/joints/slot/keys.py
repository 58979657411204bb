"""A pin in a slot."""

from __future__ import annotations

from mechanism_sim.joints.contact_keys import OF_PINS, Clearance
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.prismatic.keys import AxisKeys
from mechanism_sim.joints.slot.constraint import PinInSlot
from mechanism_sim.keys.names import Names


@KINDS.add('slot')
class SlotKeys(AxisKeys):
    """A pin in a slot."""

    slot: Reference | None = None
    """A pin at the first point, in a slot of the second link."""

    friction_keys = (), False

    def read(self, names: Names, name: str) -> PinInSlot:
        """A pin on a line of the second link."""
        (a, on_a), (b, on_b) = names.ends(name)
        return PinInSlot(name, a, b, on_a, on_b, self.axis)

    def clearance_objection(self, given: Clearance) -> str:
        """An objection to a clearance of it; empty if there is none."""
        if given.length or given.height:
            return 'has a clearance with length or height, which apply to blocks in guides'
        if wrong := [key for key in OF_PINS if getattr(given, key)]:
            return f'has a clearance with {wrong[0]}, which applies to pins in bushings'
        if given.film:
            return 'has a clearance with a film, which is for pins in bushings'
        return ''
