"""Slotted racks."""

from __future__ import annotations

import math

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.indexing import SlottedRack
from mechanism_sim.planar.mechanism import GROUND, rotate
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Names, Reference, register
from mechanism_sim.scene.kinds.geneva import crank_of
from mechanism_sim.scene.kinds.prismatic import contact_friction
from mechanism_sim.scene.quantities import Length
from mechanism_sim.scene.rounding import exactly, place
from mechanism_sim.scene.sketch import Edit, Sketch, Spot, Tool, point


class RackKeys(JointKeys):
    """A slotted rack."""

    rack: Reference | None = None
    """A pin at the first point, and a slotted rack; one slot is at the second."""
    pitch: Length | None = None
    """Of the slots of a rack; required for it."""


def _read(places: Names, name: str, joint: RackKeys) -> SlottedRack:
    pin, rack = places.ends(name, joint)
    where = f'joints.{name}'
    centre, on_crank = places.pivot(where, pin[0])
    guides = [
        j for n, j in places.scene.joints.items()
        if j.prismatic
        and [places.find(f'joints.{n}', p)[0] for p in j.points] == [GROUND, rack[0]]
    ]  # fmt: skip
    if not guides:
        raise InputError(
            f'{places.name}: {where}: {rack[0]} must slide on the ground: add a joint '
            f"'prismatic: [ground, {rack[0]}]'"
        )
    pitch = 2.0 * math.dist(pin[1], on_crank)
    if joint.pitch is None or abs(joint.pitch - pitch) > 1e-6 * pitch:
        raise InputError(
            f"{places.name}: '{where}.pitch' must be twice the radius of the pin's circle, "
            f'{pitch:.9g} m: else the pin strikes the slot where it enters'
        )
    return SlottedRack(name, pin[0], rack[0], pin[1], rack[1], pitch, guides[0].axis, centre)


def _refit(sketch: Sketch, name: str, joint: RackKeys) -> list[Edit]:
    """The pitch that the circle of the pin asks for."""
    pin = point(sketch.scene, joint.points[0])
    shaft = sketch.pivot(pin[0]) if pin else None
    if not (pin and shaft and joint.pitch):
        return []
    pitch = 2.0 * math.dist(sketch.poses[pin[0]].place(pin[2]), shaft.at)
    if abs(joint.pitch / pitch - 1.0) < 1e-7:
        return []
    return [Edit(('joints', name, 'pitch'), exactly(pitch, sketch.grid.unit))]


def _draw(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A rack that slides across the line from the crank's centre to the place."""
    pin, at, shaft = crank_of(sketch, start, 'a slotted rack')
    a, b = shaft.at, sketch.where(end)
    radius, apart = math.dist(a, at), math.dist(a, b)
    if apart <= radius:
        raise InputError('the guide of a slotted rack is beyond the pin of its crank: drag there')
    axis = math.atan2(b[1] - a[1], b[0] - a[0]) + 0.5 * math.pi
    along, aside = rotate((at[0] - a[0], at[1] - a[1]), -axis)
    rack = sketch.name('rack')
    base, edits = sketch.point(GROUND, b)
    slot = place(rotate((0.0, 0.5 * apart), axis), sketch.grid.step, sketch.grid.unit)
    # in a slot on the right; else locked, where the pin will enter
    lies = Edit(('guess', rack), sketch.long(along if aside < 0.0 else -radius))
    link = sketch.link(rack)
    return [
        Edit(
            sketch.named(pin, rack),
            {'rack': [pin, f'{rack}.slot'], 'pitch': exactly(2.0 * radius, sketch.grid.unit)},
        ),
        link._replace(value={**link.value, 'points': {'slot': slot}}), *edits,
        *sketch.guide(base, rack, axis), lies,
    ]  # fmt: skip


_TOOL = Tool(
    'stepper', 'J', 'M0 6h3v5h2V6h3v5h2V6h3v5h3v4H0z',
    'Press on the end of a crank, drag to the rail of a slotted rack, which it moves step by step',
    _draw, 'band',
)  # fmt: skip

register(
    JointKind('rack', RackKeys, _read, friction=contact_friction, tools=(_TOOL,), refit=_refit)
)
