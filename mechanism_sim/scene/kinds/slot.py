"""A pin in a slot."""

from __future__ import annotations

from mechanism_sim.linkages.slot import PinInSlot
from mechanism_sim.scene.contact_keys import Clearance
from mechanism_sim.scene.joint_keys import JointKind, Reference, register
from mechanism_sim.scene.kinds.prismatic import AxisKeys, line_friction
from mechanism_sim.scene.names import Names


class SlotKeys(AxisKeys):
    """A pin in a slot."""

    slot: Reference | None = None
    """A pin at the first point, in a slot of the second link."""


def _read(places: Names, name: str, joint: SlotKeys) -> PinInSlot:
    (a, on_a), (b, on_b) = places.ends(name)
    return PinInSlot(name, a, b, on_a, on_b, joint.axis)


def _wrong_play(given: Clearance) -> str:
    if given.length or given.height:
        return 'has a clearance with length or height, which are of blocks in guides'
    if wrong := [key for key in ('misalignment', 'along', 'axial') if getattr(given, key)]:
        return f'has a clearance with {wrong[0]}, which is of pins in bushings'
    if given.contact and given.contact.law == 'film':
        return 'has a clearance with a film, which is for pins in bushings'
    return ''


register(JointKind('slot', SlotKeys, _read, wrong_play=_wrong_play, friction=line_friction))
