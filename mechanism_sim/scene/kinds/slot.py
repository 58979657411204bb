"""A pin in a slot."""

from __future__ import annotations

from mechanism_sim.linkages.slot import PinInSlot
from mechanism_sim.scene.joint_keys import JointKind, Names, Reference, register
from mechanism_sim.scene.kinds.prismatic import AxisKeys, line_friction


class SlotKeys(AxisKeys):
    """A pin in a slot."""

    slot: Reference | None = None
    """A pin at the first point, in a slot of the second link."""


def _read(places: Names, name: str, joint: SlotKeys) -> PinInSlot:
    (a, on_a), (b, on_b) = places.ends(name, joint)
    return PinInSlot(name, a, b, on_a, on_b, joint.axis)


register(JointKind('slot', SlotKeys, _read, friction=line_friction))
