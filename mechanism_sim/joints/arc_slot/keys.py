"""A pin in a slot along an arc."""

from __future__ import annotations

from mechanism_sim.errors import InputError
from mechanism_sim.joints.arc_slot.constraint import PinInArc
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.prismatic.keys import PinKeys
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Length


@KINDS.add('arc_slot')
class ArcSlotKeys(PinKeys):
    """A pin in a slot along an arc."""

    arc_slot: Reference | None = None
    """A pin at the first point, in a slot of the second link whose centre is the second point."""
    radius: Length | None = None
    """Of the centre line of such a slot; required for it."""

    def read(self, names: Names, name: str) -> PinInArc:
        """A pin on a circle of the second link."""
        (a, on_a), (b, on_b) = names.ends(name)
        if self.radius is None:
            raise InputError(
                f"joints.{name}.radius is missing: that of the slot's centre line, such as '80 mm'"
            )
        return PinInArc(name, a, b, on_a, on_b, self.radius)
