"""How a cam and its follower move on the ground, and the frame in which they are described."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, TypeAlias

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import Names
from mechanism_sim.planar.points import GROUND, Vector2, rotate

Frame: TypeAlias = tuple[Vector2, float, Literal[1, -1]]
"""Centre [m], direction [rad] and sense of a `CamPair`."""


class Guide(NamedTuple):
    """How a cam or a follower moves on the ground."""

    swings: bool  #: or turns
    at: Vector2  #: [m] its pivot, or its point when its displacement is zero, in the world
    arm: Vector2  #: [m] from its pivot to its point, in its own frame
    axis: float = 0.0  #: [rad] along which it slides
    angle: float = 0.0  #: [rad] of its frame if it slides


def find_guide(names: Names, where: str, link: str, at: Vector2, what: str) -> Guide:
    """How a point `at` [m] of a link is carried by the ground.

    Parameters
    ----------
    where : the joint that asks
    what : ``cam`` or ``follower``
    """
    for name, joint in names.scene.joints.items():
        if joint.kind not in ('revolute', 'prismatic'):
            continue
        (a, on_a), (b, on_b) = names.connected(name)
        if {a, b} != {GROUND, link}:
            continue
        if joint.clearance:
            raise InputError(f'{where}: the joint {name} of its {what} cannot be loose')
        if joint.revolute:
            pivot, own = (on_a, on_b) if a == GROUND else (on_b, on_a)
            return Guide(True, pivot, (at[0] - own[0], at[1] - own[1]))
        if a == GROUND:
            x, y = rotate((at[0] - on_b[0], at[1] - on_b[1]), joint.angle)
            start = on_a[0] + x, on_a[1] + y
            return Guide(False, start, (0.0, 0.0), joint.axis, joint.angle)
    moves = 'turn or slide' if what == 'cam' else 'slide or swing'
    raise InputError(
        f"{where}: the {what} {link} must {moves} on the ground: add a joint 'prismatic: [ground, "
        f"{link}]' or 'revolute: [ground, {link}]'"
    )


def around(cam: Guide, follower: Guide, clockwise: bool) -> Frame:
    """For a cam that turns, `clockwise` where its angle grows."""
    if cam.arm != (0.0, 0.0):
        raise InputError('name the point where the cam turns on the ground')
    (x, y), (px, py) = cam.at, follower.at
    direction = math.atan2(py - y, px - x) if follower.swings else follower.axis
    return cam.at, direction, -1 if clockwise else 1


def along(cam: Guide, follower: Guide) -> Frame:
    """For a cam that slides: the centre is abreast of the pivot of a swinging follower."""
    (x, y), (px, py) = cam.at, follower.at
    if follower.swings:
        way, across = rotate((px - x, py - y), -cam.axis)
        dx, dy = rotate((way, 0.0), cam.axis)
        direction = cam.axis + math.copysign(0.5 * math.pi, across)
        return (x + dx, y + dy), direction, -1 if across > 0.0 else 1
    across = math.sin(follower.axis - cam.axis)
    if abs(across) < 1.0 - 1e-15:
        given, *right = (
            math.degrees(a) for a in (follower.axis, cam.axis + 0.5 * math.pi,
                                      cam.axis - 0.5 * math.pi)
        )  # fmt: skip
        raise InputError(
            'a cam that slides moves followers that slide square to it: the axis of its follower '
            f'must be {right[0]:g} or {right[1]:g} deg, not {given:g} deg'
        )
    return cam.at, follower.axis, -1 if across > 0.0 else 1
