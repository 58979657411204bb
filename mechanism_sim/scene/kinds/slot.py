"""A pin in a slot."""

from __future__ import annotations

import math

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.slot import PinInSlot
from mechanism_sim.scene.contact_keys import Clearance
from mechanism_sim.scene.joint_keys import JointKind, Names, Reference, register
from mechanism_sim.scene.kinds.prismatic import AxisKeys, line_friction
from mechanism_sim.scene.rounding import degrees
from mechanism_sim.scene.sketch import ORIGIN, Edit, Sketch, Spot, Tool, round_axis


class SlotKeys(AxisKeys):
    """A pin in a slot."""

    slot: Reference | None = None
    """A pin at the first point, in a slot of the second link."""


def _read(places: Names, name: str, joint: SlotKeys) -> PinInSlot:
    (a, on_a), (b, on_b) = places.ends(name, joint)
    return PinInSlot(name, a, b, on_a, on_b, joint.axis)


def _wrong_play(given: Clearance) -> str:
    if given.length or given.height:
        return 'has a clearance with length or height, which are of blocks in guides'
    if wrong := [key for key in ('misalignment', 'along', 'axial') if getattr(given, key)]:
        return f'has a clearance with {wrong[0]}, which is of pins in bushings'
    if given.contact and given.contact.law == 'film':
        return 'has a clearance with a film, which is for pins in bushings'
    return ''


def _draw(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A slot of a link through its point, or origin, and the pin; or one across a new yoke."""
    pin, edits = sketch.on_link(start, 'the pin of a slot is')
    at = sketch.where(start)
    if end.handle is None and not end.link:
        axis = round_axis(at, sketch.where(end))
        yoke, along, guide = sketch.slider('yoke', at, axis)
        joint = {'slot': [pin, yoke], 'axis': degrees(axis + 0.5 * math.pi)}
        guess = Edit(('guess', yoke), sketch.long(along))
        return [
            Edit(sketch.named(pin, yoke), joint), *edits, sketch.link(yoke), *guide, guess,
        ]  # fmt: skip
    slotted = sketch.reference(end)[0] if end.handle else end.link
    link = slotted.partition('.')[0]
    if link == pin.partition('.')[0]:
        raise InputError('a slot is in another link than its pin: drag from the pin to that link')
    pose = sketch.poses.get(link, ORIGIN)
    through = end.handle.at if end.handle else pose.place((0.0, 0.0))
    way = at[0] - through[0], at[1] - through[1]
    axis = math.remainder(math.atan2(way[1], way[0]) - pose.angle, math.pi)
    joint = {'slot': [pin, slotted]}
    if math.hypot(*way) > sketch.grid.step and abs(axis) > 1e-3:
        joint['axis'] = degrees(axis, 4)
    return [Edit(sketch.named(pin, link), joint), *edits]


_TOOL = Tool(
    'slot', 'O',
    'M4 5h8a3 3 0 0 1 0 6H4a3 3 0 0 1 0-6zm0 1.3a1.7 1.7 0 0 0 0 3.4h2.2a2.4 2.4 0 0 1 '
    '0-3.4zm5.8 0a2.4 2.4 0 0 1 0 3.4H12a1.7 1.7 0 0 0 0-3.4z',
    'Press on a pin, drag to the link with the slot; where there is nothing, a yoke slides that '
    'way', _draw, 'band',
)  # fmt: skip

register(
    JointKind(
        'slot', SlotKeys, _read, wrong_play=_wrong_play, friction=line_friction, tools=(_TOOL,)
    )
)
