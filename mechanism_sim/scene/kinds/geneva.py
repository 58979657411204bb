"""Geneva wheels."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.indexing import Geneva
from mechanism_sim.planar.mechanism import GROUND, Vector2
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Names, Reference, register
from mechanism_sim.scene.kinds.prismatic import contact_friction
from mechanism_sim.scene.rounding import degrees, exactly
from mechanism_sim.scene.sketch import Edit, Shaft, Sketch, Spot, Tool


class GenevaKeys(JointKeys):
    """A Geneva wheel."""

    geneva: Reference | None = None
    """A pin at the first point, and a Geneva wheel pivoted at the second."""
    slots: Annotated[int, Field(ge=3, le=24)] | None = None
    """Of a Geneva wheel; required for it."""


def _read(places: Names, name: str, joint: GenevaKeys) -> Geneva:
    pin, wheel = places.ends(name, joint)
    where = f'joints.{name}'
    if joint.slots is None:
        raise InputError(f"{places.name}: '{where}.slots' is missing: how many the wheel has")
    (ox, oy), on_crank = places.pivot(where, pin[0])
    (wx, wy), on_wheel = places.pivot(where, wheel[0])
    if wheel[1] != on_wheel:
        raise InputError(f'{places.name}: {where}: name the point where the wheel is pivoted')
    radius, b = math.dist(pin[1], on_crank), math.hypot(ox - wx, oy - wy)
    right = radius / math.sin(math.pi / joint.slots)
    if abs(b - right) > 1e-6 * right:
        raise InputError(
            f'{places.name}: {where}: with {joint.slots} slots and the pin {radius:.9g} m from '
            f'its centre, the centres must be {right:.9g} m apart, not {b:.9g} m: else the '
            'pin strikes the slot where it enters'
        )
    entry = right * math.cos(math.pi / joint.slots)
    towards = math.atan2(oy - wy, ox - wx)
    return Geneva(name, pin[0], wheel[0], pin[1], wheel[1], joint.slots, towards, right, entry)


def crank_of(sketch: Sketch, start: Spot, what: str) -> tuple[str, Vector2, Shaft]:
    """The pin of a crank, where it is [m], and where the crank turns.

    Raises
    ------
    InputError
        If there is no such pin.
    """
    pin, at = sketch.on_link(start, f'the pin of {what} is')[0], sketch.where(start)
    shaft = sketch.pivot(pin.partition('.')[0])
    if start.handle is None or shaft is None or math.dist(shaft.at, at) < 1e-9:
        raise InputError(
            f'{what} is driven by the end of a crank that turns on the ground: press there'
        )
    return pin, at, shaft


def _refit(sketch: Sketch, _name: str, joint: GenevaKeys) -> list[Edit]:
    """The crank's length that the distance of the centres asks for."""
    pin, wheel = joint.points
    crank, _, end = pin.partition('.')
    one, two = sketch.pivot(crank), sketch.pivot(wheel.partition('.')[0])
    if not (one and two and joint.slots and end == 'end' and one.own == crank):
        return []
    length = math.dist(one.at, two.at) * math.sin(math.pi / joint.slots)
    if abs(sketch.scene.links[crank].length / length - 1.0) < 1e-7:
        return []
    return [Edit(('links', crank, 'length'), exactly(length, sketch.grid.unit))]


def _draw(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A wheel whose centre is as far away as its slots, nearest to the place, ask for."""
    pin, at, shaft = crank_of(sketch, start, 'a Geneva wheel')
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
        sketch.link(wheel), new._replace(value=[exactly(c, unit) for c in centre]),
        *sketch.joint(base, wheel), Edit(('guess', wheel), degrees(angle)),
    ]  # fmt: skip


_TOOL = Tool(
    'geneva', 'W', 'M8 1l1.5 4.5L14 4l-2.5 4 2.5 4-4.5-1.5L8 15l-1.5-4.5L2 12l2.5-4L2 4l4.5 1.5z',
    'Press on the end of a crank, drag to the centre of a Geneva wheel: slots fit the distance',
    _draw, 'band',
)  # fmt: skip

register(
    JointKind('geneva', GenevaKeys, _read, friction=contact_friction, tools=(_TOOL,), refit=_refit)
)
