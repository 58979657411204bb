"""Tools for the joints of linkages: pins, sliders and guides, slots, rotors."""

from __future__ import annotations

import math

from mechanism_sim.editor.rounding import degrees
from mechanism_sim.editor.sketch import GONE, ORIGIN, Edit, Pose, Sketch, Spot, referred
from mechanism_sim.editor.tool import draws
from mechanism_sim.errors import InputError
from mechanism_sim.planar.points import GROUND, Vector2


@draws(
    'revolute',
    'pin',
    'N',
    'M8 4a4 4 0 1 1 0 8 4 4 0 0 1 0-8zm0 2.5a1.5 1.5 0 1 0 0 3 1.5 1.5 0 0 0 0-3z',
    'Press on a point of a link, drag to a point of another: they are pinned together',
    'band',
)
def _pin(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A pin between two points, which the machine brings together."""
    (one, new), (two, newer) = sketch.reference(start), sketch.reference(end)
    if one.partition('.')[0] == two.partition('.')[0]:
        raise InputError('a pin joins points of two links: press on one, drag to the other')
    return [Edit(sketch.named(one, two), {'revolute': [one, two]}), *new, *newer]


@draws(
    'prismatic',
    'slider',
    'S',
    'M3 5h10v6H3zM0 12.5h16V14H0z',
    'Press on the free end of a link, drag along the rail; release on another link, or '
    'press on a pin of both, and the rail is on that',
    'band',
)
def _slider(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A block pinned to a link, on a rail of the frame or of another link.

    A pin that joins both becomes the block's.
    """
    handle, gone = start.handle, []
    carrier = end.handle.members[-1][0] if end.handle else end.link
    if handle and handle.joint:
        first, last = handle.members
        pin, other = (last, first) if carrier != last[0] else (first, last)
        carrier, gone = other[0], [Edit(('joints', handle.key), GONE)]
    else:
        pin = handle.members[-1] if handle else (GROUND, '')
    if handle is None or GROUND in (pin[0], *(x for x, _ in handle.members if gone)):
        raise InputError(
            'a slider is put on the free end of a link, or on a pin of two links: press there, '
            'drag along its guide'
        )
    at, own = handle.at, referred(*pin)
    axis = _round_axis(at, end.at) if math.dist(at, end.at) > sketch.grid.step else 0.0
    if carrier in ('', GROUND, pin[0]):
        block, along, guide = sketch.slider('slider', at, axis)
        lies = [Edit(('guess', block), sketch.long(along))]
    else:
        block, guide, lies = sketch.name('slider'), [], []
        pose = sketch.poses[carrier]
        sketch.poses[block] = Pose(*at, pose.angle)
        (_, y), (_, v) = pose.within(at), pose.within(sketch.where(end))
        if abs(y) < 2.0 * sketch.grid.step > abs(v):  # along a bar, from its origin
            base, axis = carrier, 0.0
        else:
            base, guide = sketch.point(carrier, at)
            axis = _round_axis(pose.within(at), pose.within(sketch.where(end)))
        guide += sketch.guide(base, block, axis)
    return [sketch.link(block), *gone, *guide, *sketch.joint(own, block), *lies]


@draws(
    'prismatic',
    'guide',
    'U',
    'M0 7h16v2H0zm5-3h6v2H5zm0 6h6v2H5z',
    'Press on a link or the frame, drag along the rail: to a link that slides on it, or to '
    'where a block is to be',
    'band',
)
def _guide(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A link that slides on another, or a new block on a link or on the frame."""
    a, b, apart = sketch.ends(start, end, 'guide')
    base, edits = sketch.reference(start)
    on = base.partition('.')[0]
    met = [(x, n) for x, n in end.handle.members if x not in (GROUND, on)] if end.handle else []
    pose = sketch.poses.get(on, ORIGIN)
    if met:
        runner, far = met[0][0], referred(*met[0])
    elif end.link not in ('', on):
        runner = end.link
        far, more = sketch.point(runner, b)
        edits += more
    else:
        block = sketch.name('slider')
        axis = _round_axis(pose.within(a), pose.within(b))
        guess = Edit(('guess', block), sketch.long(apart))
        return [*sketch.guide(base, block, axis), sketch.link(block), *edits, guess]
    (joint,) = sketch.guide(base, far, math.atan2(b[1] - a[1], b[0] - a[0]) - pose.angle)
    turned = sketch.poses[runner].angle - pose.angle
    joint.value['angle'] = degrees(turned, 6)
    known = runner in sketch.scene.rough  # may no longer be an angle
    return [joint, *edits, *([Edit(('guess', runner), GONE)] if known else [])]


@draws(
    'slot',
    'slot',
    'O',
    'M4 5h8a3 3 0 0 1 0 6H4a3 3 0 0 1 0-6zm0 1.3a1.7 1.7 0 0 0 0 3.4h2.2a2.4 2.4 0 0 1 '
    '0-3.4zm5.8 0a2.4 2.4 0 0 1 0 3.4H12a1.7 1.7 0 0 0 0-3.4z',
    'Press on a pin, drag to the link with the slot; where there is nothing, a yoke slides '
    'that way',
    'band',
)
def _slot(sketch: Sketch, start: Spot, end: Spot) -> list[Edit]:
    """A slot of a link through its point, or origin, and the pin; or one across a new yoke."""
    pin, edits = sketch.on_link(start, 'the pin of a slot is')
    at = sketch.where(start)
    if end.handle is None and not end.link:
        axis = _round_axis(at, sketch.where(end))
        yoke, along, guide = sketch.slider('yoke', at, axis)
        joint = {'slot': [pin, yoke], 'axis': degrees(axis + 0.5 * math.pi)}
        guess = Edit(('guess', yoke), sketch.long(along))
        return [
            Edit(sketch.named(pin, yoke), joint),
            *edits,
            sketch.link(yoke),
            *guide,
            guess,
        ]
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


def _round_axis(a: Vector2, b: Vector2) -> float:
    """The direction from one position to another, to a whole degree [rad]."""
    return math.radians(round(math.degrees(math.atan2(b[1] - a[1], b[0] - a[0]))))


@draws(
    'rotor',
    'rotor',
    'Z',
    'M7 1h2v14H7zM1 7h14v2H1zm3-3h8v8H4z',
    'Click: an unbalanced disk on a compliant support',
)
def _disk(sketch: Sketch, start: Spot, _end: Spot) -> list[Edit]:
    """A disk of 10 kg, a millimetre off its axis, on one support."""
    base, edits = sketch.point(GROUND, sketch.where(start))
    disk = sketch.name('disk')
    joint = {'rotor': [base, disk], 'supports': {'bearings': {'stiffness': '50 N/mm'}}}
    values = {'mass': '10 kg', 'inertia': '0.04 kg m^2', 'cog': '1 mm'}
    made = [Edit(sketch.named(base, disk), joint), Edit(('links', disk), values), *edits]
    return [*made, *sketch.masses(), *sketch.driven(disk)]


@draws(
    'stops',
    'stops',
    'Shift+K',
    'M1 2h2v12H1zm12 0h2v12h-2zM5 6h6v4H5z',
    'Click on a pin or a block: it stops 30 degrees, or a quarter of its way, to either side',
)
def _stops(sketch: Sketch, start: Spot, _end: Spot) -> list[Edit]:
    """Stops on both sides of a pin or a guide: at 30 degrees, or a quarter of its travel."""
    name = start.handle.key if start.handle and start.handle.joint else ''
    way = sketch.sliding(start)
    if way and (not name or sketch.scene.joints[name].kind != 'prismatic'):
        name = way.joint
    joint = sketch.scene.joints.get(name)
    if joint is None or joint.kind not in ('revolute', 'prismatic'):
        raise InputError('stops are put on a pin of two links, or on a block in its guide')
    if joint.stops or joint.clearance:
        raise InputError(f'{name} has {"stops" if joint.stops else "a clearance"} already')
    if joint.kind == 'prismatic':
        if way is None:
            raise InputError('stops are put on a block that slides on the frame')
        reach = max(0.25 * abs(way.along), 20.0 * sketch.grid.step)
        limits = {k: sketch.long(way.along + d * reach) for k, d in _SIDES}
    else:
        one, two = (sketch.poses[x.partition('.')[0]].angle if x.partition('.')[0] != GROUND
                    else 0.0 for x in joint.points)  # fmt: skip
        limits = {k: degrees(two - one + d * math.radians(30.0)) for k, d in _SIDES}
        limits['radius'] = '50 mm'
    return [Edit(('joints', name, 'stops'), {**limits, 'restitution': 0.5}), *sketch.masses()]


_SIDES = ('lower', -1.0), ('upper', 1.0)
