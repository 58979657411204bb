"""Prismatic joints: a guide along which a point slides."""

from __future__ import annotations

import math

from mechanism_sim.errors import InputError
from mechanism_sim.planar.joint_friction import ContactFriction, JointFriction, LineFriction
from mechanism_sim.planar.mechanism import GROUND, HigherPair, Mechanism, Prismatic
from mechanism_sim.planar.touch import Touch
from mechanism_sim.scene.contact_keys import Clearance, Friction
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Names, Reference, register
from mechanism_sim.scene.quantities import Angle
from mechanism_sim.scene.rounding import degrees
from mechanism_sim.scene.sketch import (
    GONE,
    ORIGIN,
    Edit,
    Pose,
    Sketch,
    Spot,
    Tool,
    referred,
    round_axis,
)


class AxisKeys(JointKeys):
    """What slides."""

    axis: Angle = 0.0
    """Direction of sliding: in the first link of a prismatic joint, in the second's slot."""


class PrismaticKeys(AxisKeys):
    """A guide."""

    prismatic: Reference | None = None
    """A guide: the second point slides along `axis` through the first."""
    angle: Angle = 0.0
    """Of the second link in the first."""


def _read(places: Names, name: str, joint: PrismaticKeys) -> Prismatic:
    (a, on_a), (b, on_b) = places.ends(name, joint)
    return Prismatic(name, a, b, on_a, on_b, joint.axis, joint.angle)


def line_friction(name: str, given: Friction, mechanism: Mechanism) -> list[JointFriction]:
    """Friction along a guide or a slot."""
    return [LineFriction(name, mechanism, given.coefficient, given.length or 0.0)]


def contact_friction(name: str, given: Friction, mechanism: Mechanism) -> list[JointFriction]:
    """Friction of a pin in a slot that it leaves."""
    joint = mechanism.joint(name)
    assert isinstance(joint, HigherPair)  # noqa: S101 - of such kinds
    touch = joint.touch(mechanism)
    assert isinstance(touch, Touch)  # noqa: S101 - and of no teeth
    return [ContactFriction(name, mechanism, given.coefficient, touch)]


def _wrong_play(given: Clearance) -> str:
    if not (given.length and given.height):
        return "has a clearance that needs 'length' and 'height', those of the block in its guide"
    if wrong := [key for key in ('misalignment', 'along', 'axial') if getattr(given, key)]:
        return f'has a clearance with {wrong[0]}, which is of pins in bushings'
    if given.pin_radius:
        return 'has a clearance with pin_radius: a block has none'
    if given.contact and given.contact.law == 'film':
        return 'has a clearance with a film, which is for pins'
    return ''


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
            'drag its way'
        )
    at, own = handle.at, referred(*pin)
    axis = round_axis(at, end.at) if math.dist(at, end.at) > sketch.grid.step else 0.0
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
            axis = round_axis(pose.within(at), pose.within(sketch.where(end)))
        guide += sketch.guide(base, block, axis)
    return [sketch.link(block), *gone, *guide, *sketch.joint(own, block), *lies]


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
        axis = round_axis(pose.within(a), pose.within(b))
        guess = Edit(('guess', block), sketch.long(apart))
        return [*sketch.guide(base, block, axis), sketch.link(block), *edits, guess]
    (joint,) = sketch.guide(base, far, math.atan2(b[1] - a[1], b[0] - a[0]) - pose.angle)
    turned = sketch.poses[runner].angle - pose.angle
    joint.value['angle'] = degrees(turned, 6)
    known = runner in sketch.scene.guess  # which may be an angle no more
    return [joint, *edits, *([Edit(('guess', runner), GONE)] if known else [])]


_TOOLS = (
    Tool(
        'slider', 'S', 'M3 5h10v6H3zM0 12.5h16V14H0z',
        'Press on the free end of a link, drag along the rail; let go on another link, or press '
        'on a pin of both, and the rail is on that', _slider, 'band',
    ),
    Tool(
        'guide', 'U', 'M0 7h16v2H0zm5-3h6v2H5zm0 6h6v2H5z',
        'Press on a link or the frame, drag along the rail: to a link that slides on it, or to '
        'where a block is to be', _guide, 'band',
    ),
)  # fmt: skip

register(
    JointKind(
        'prismatic', PrismaticKeys, _read,
        wrong_play=_wrong_play, friction=line_friction, rubs_by=(('length',), False), tools=_TOOLS,
    )
)  # fmt: skip
