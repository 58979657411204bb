"""Tools for indexing mechanisms of a crank: Geneva wheels and slotted racks."""

from __future__ import annotations

import math

from mechanism_sim.editor.rounding import degrees, exactly, place
from mechanism_sim.editor.sketch import Edit, Shaft, Sketch, Spot, point
from mechanism_sim.editor.tool import draws, refits
from mechanism_sim.errors import InputError
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.scene.schema import JointPart


def _crank_of(sketch: Sketch, start: Spot, what: str) -> tuple[str, Vector2, Shaft]:
    """The pin of a crank, its position [m], and that of the crank's pivot."""
    pin, at = sketch.on_link(start, f'the pin of {what} is')[0], sketch.where(start)
    shaft = sketch.pivot(pin.partition('.')[0])
    if start.handle is None or shaft is None or math.dist(shaft.at, at) < 1e-9:
        raise InputError(
            f'{what} is driven by the end of a crank that turns on the ground: press there'
        )
    return pin, at, shaft


@refits('geneva')
def _refit_geneva(sketch: Sketch, _name: str, joint: JointPart) -> list[Edit]:
    """The crank's length that fits the distance of the centres."""
    pin, wheel = joint.points
    crank, _, end = pin.partition('.')
    one, two = sketch.pivot(crank), sketch.pivot(wheel.partition('.')[0])
    if not (one and two and joint.slots and end == 'end' and one.own == crank):
        return []
    before = sketch.scene.links[crank].length
    length = math.dist(one.at, two.at) * math.sin(math.pi / joint.slots)
    if before is None or abs(before / length - 1.0) < 1e-7:
        return []
    return [Edit(('links', crank, 'length'), exactly(length, sketch.grid.unit))]


@draws(
    'geneva',
    'geneva',
    'W',
    'M8 1l1.5 4.5L14 4l-2.5 4 2.5 4-4.5-1.5L8 15l-1.5-4.5L2 12l2.5-4L2 4l4.5 1.5z',
    'Press on the end of a crank, drag to the centre of a Geneva wheel: slots fit the distance',
    'band',
)
def _geneva(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A wheel whose number of slots fits its centre distance best."""
    pin, at, shaft = _crank_of(sketch, start, 'a Geneva wheel')
    (x, y), (u, v) = shaft.at, sketch.where(end)
    radius, apart = math.dist(shaft.at, at), math.hypot(u - x, v - y)
    if apart <= radius:
        raise InputError('the centre of a Geneva wheel is beyond the pin of its crank: drag there')
    slots = max(3, min(24, round(math.pi / math.asin(radius / apart))))
    right = radius / math.sin(math.pi / slots)
    centre = x + right * (u - x) / apart, y + right * (v - y) / apart
    wheel, unit = sketch.name('wheel'), sketch.grid.unit
    base, (new,) = sketch.point(GROUND, centre)
    seen = math.dist(at, centre) < right * math.cos(math.pi / slots)
    towards = at if seen else shaft.at
    angle = math.atan2(towards[1] - centre[1], towards[0] - centre[0])
    angle += 0.0 if seen else math.pi / slots
    return [
        Edit(sketch.named(pin, wheel), {'geneva': [pin, wheel], 'slots': slots}),
        sketch.link(wheel),
        new._replace(value=[exactly(c, unit) for c in centre]),
        *sketch.joint(base, wheel),
        Edit(('guess', wheel), degrees(angle)),
    ]


@refits('rack')
def _refit_stepper(sketch: Sketch, name: str, joint: JointPart) -> list[Edit]:
    """The pitch that fits the circle of the pin."""
    pin = point(sketch.scene, joint.points[0])
    shaft = sketch.pivot(pin[0]) if pin else None
    if not (pin and shaft and joint.pitch):
        return []
    pitch = 2.0 * math.dist(sketch.poses[pin[0]].place(pin[2]), shaft.at)
    if abs(joint.pitch / pitch - 1.0) < 1e-7:
        return []
    return [Edit(('joints', name, 'pitch'), exactly(pitch, sketch.grid.unit))]


@draws(
    'rack',
    'stepper',
    'J',
    'M0 6h3v5h2V6h3v5h2V6h3v5h3v4H0z',
    'Press on the end of a crank, drag to the rail of a slotted rack, which it moves step by step',
    'band',
)
def _stepper(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A rack that slides across the line from the crank's centre to the place."""
    pin, at, shaft = _crank_of(sketch, start, 'a slotted rack')
    a, b = shaft.at, sketch.where(end)
    radius, apart = math.dist(a, at), math.dist(a, b)
    if apart <= radius:
        raise InputError('the guide of a slotted rack is beyond the pin of its crank: drag there')
    axis = math.atan2(b[1] - a[1], b[0] - a[0]) + 0.5 * math.pi
    along, aside = rotate((at[0] - a[0], at[1] - a[1]), -axis)
    rack = sketch.name('rack')
    base, edits = sketch.point(GROUND, b)
    slot = place(rotate((0.0, 0.5 * apart), axis), sketch.grid.step, sketch.grid.unit)
    # in a slot on the right; else locked, at the entry of the pin
    lies = Edit(('guess', rack), sketch.long(along if aside < 0.0 else -radius))
    link = sketch.link(rack)
    return [
        Edit(
            sketch.named(pin, rack),
            {'rack': [pin, f'{rack}.slot'], 'pitch': exactly(2.0 * radius, sketch.grid.unit)},
        ),
        link._replace(value={**link.value, 'points': {'slot': slot}}),
        *edits,
        *sketch.guide(base, rack, axis),
        lies,
    ]
