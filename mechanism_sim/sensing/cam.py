"""What there is to read of a cam and its follower."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.cams.pair import CamPair
from mechanism_sim.sensing.joint_view import Array, Course, JointView


class CamMode(IntEnum):
    """Where the follower is; the numbers are those of CamState.msg."""

    UNKNOWN = 0
    CONTACT = 1
    LIFTED = 2
    OUTER = 3
    GUIDED = 4


class CamReading(NamedTuple):
    """A cam at N instants; forces are NaN where masses are not known.

    Lift and follower count from the base circle; those of a swinging follower are angles.
    """

    cam_angle: Array  #: (N,) [rad] that the law is asked for
    cam_speed: Array  #: (N,) [rad/s]
    lift: Array  #: (N,) [m] or [rad] of the law
    follower_position: Array  #: (N,) [m] or [rad] likewise: in contact the lift, but for play
    follower_velocity: Array  #: (N,) [m/s] or [rad/s]
    follower_acceleration: Array  #: (N,) [m/s^2] or [rad/s^2]
    gap: Array  #: (N,) [m] to the cam, or the nearer wall of its groove
    contact_force: Array  #: (N,) [N] of the cam on the follower along the normal out of the cam
    pressure_angle: Array  #: (N,) [rad] where the follower touches at this cam angle
    cam_torque: Array  #: (N,) [N m] of the follower on the cam, in the sense of the cam angle
    mode: NDArray[np.uint8]  #: (N,) of `CamMode`


def read_cam(joint: CamPair, view: JointView) -> CamReading:
    """A cam that its follower may leave, or in whose groove it has play."""
    cam = view.turning(joint.first)
    angle = joint.sense * cam.position + joint.phase
    lift, touch = joint.cam.law(angle), joint.cam.at(angle)
    follower = _follower(joint, view, lift)
    # from the frame of the cam to that of the follower, and to the world
    nx, ny = touch.normal
    x = nx * np.cos(angle) + ny * np.sin(angle)
    y = joint.mirror * (ny * np.cos(angle) - nx * np.sin(angle))
    c, s = math.cos(joint.direction), math.sin(joint.direction)
    fx, fy = view.force
    force = np.copysign(np.hypot(fx, fy), fx * (c * x - s * y) + fy * (s * x + c * y))
    gap, mode = _contact(joint, view)
    torque = joint.sense * view.moment_on_first(np.array(joint.centre)[:, None])
    return CamReading(
        angle, joint.sense * cam.velocity, lift, *follower, gap, force, touch.pressure_angle,
        torque, mode,
    )  # fmt: skip


def _follower(joint: CamPair, view: JointView, lift: Array) -> Course:
    """The follower's place, from where it is on the base circle, in the direction of the lift."""
    lowest = joint.distance.lowest
    if joint.distance.swings:
        turn = view.turning(joint.second)
        place = joint.swing * (turn.position + joint.arm_angle - joint.direction - math.pi)
        off = np.remainder(place - lowest - lift + math.pi, 2.0 * math.pi) - math.pi
        return Course(lift + off, joint.swing * turn.velocity, joint.swing * turn.acceleration)
    c, s = math.cos(joint.direction), math.sin(joint.direction)
    p, v, a = (c * x + s * y for x, y in view.path(joint.second, joint.on_second))
    return Course(p - (c * joint.centre[0] + s * joint.centre[1]) - lowest, v, a)


def _contact(joint: CamPair, view: JointView) -> tuple[Array, NDArray[np.uint8]]:
    """Distance [m] to what the follower may touch, and the mode."""
    walls = [view.gap(side if len(joint.sides) > 1 else '') for side in joint.sides]
    count = view.observed.position.shape[1]
    known = [(wall, side) for wall, side in zip(walls, joint.sides, strict=True) if wall]
    if not known:
        return np.zeros(count), np.full(count, CamMode.GUIDED, np.uint8)
    mode = np.full(count, CamMode.LIFTED, np.uint8)
    for (_, closed), side in known:
        mode[closed] = CamMode.CONTACT if side == 'right' else CamMode.OUTER
    return np.min([gap for (gap, _), _ in known], axis=0), mode
