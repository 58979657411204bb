"""Readings of a cam and its follower."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.distance import PlacedCam
from mechanism_sim.joints.cam.touch import CamTouch, FramePassage
from mechanism_sim.planar.view import PairView, Told, Trajectory


class CamMode(IntEnum):
    """State of the follower, with the numbers of CamState.msg."""

    UNKNOWN = 0
    CONTACT = 1
    LIFTED = 2
    OUTER = 3
    GUIDED = 4


class CamReading(NamedTuple):
    """A cam at N instants; forces are NaN where masses are not known.

    Lift and follower count from the base circle; those of a swinging follower are angles. Angle,
    speed and torque of the cam count in its `sense`, of a clockwise one clockwise; those of a cam
    that slides are its displacement, velocity and a force, along its law.
    Pressure angle, contact and speeds are those where they touch at this cam angle, or would;
    speeds count counterclockwise about a cam that turns clockwise, as in `CamTouch`; the spin of a
    roller that rolls without slip, seen from its follower, counts counterclockwise in the world.
    """

    cam_angle: Annotated[
        Array, Told('rad or m', 'cam angle, positive in its sense', 'first', repeats=True)
    ]
    cam_speed: Annotated[
        Array, Told('rad/s or m/s', 'cam speed, positive in its sense', 'first', repeats=True)
    ]
    lift: Annotated[Array, Told('rad or m', 'lift by the law')]
    follower_position: Annotated[Array, Told('rad or m', 'follower from the base circle')]
    follower_velocity: Annotated[Array, Told('rad/s or m/s', 'speed of the follower')]
    follower_acceleration: Annotated[
        Array, Told('rad/s^2 or m/s^2', 'acceleration of the follower')
    ]
    gap: Annotated[Array, Told('m', 'distance to the cam', difference=True)]
    contact_force: Annotated[Array, Told('N', 'force on the follower, out of the cam')]
    pressure_angle: Annotated[Array, Told('rad', 'pressure angle')]
    cam_torque: Annotated[
        Array,
        Told('N m or N', 'torque of the follower on the cam, positive in its sense', 'first'),
    ]
    contact_x: Annotated[Array, Told('m', 'point of contact, x')]
    contact_y: Annotated[Array, Told('m', 'point of contact, y')]
    contact_speed: Annotated[Array, Told('m/s', 'speed of the contact along the profile')]
    sliding_speed: Annotated[Array, Told('m/s', 'sliding speed of the follower over the cam')]
    roller_speed: Annotated[Array, Told('rad/s', 'spin of the roller on its pin')]
    mode: NDArray[np.uint8]  #: (N,) of `CamMode`


def read_cam(joint: PlacedCam, view: PairView) -> CamReading:
    """A cam that its follower may leave, or in whose groove it has play."""
    cam, torque = _cam(joint, view)
    angle = cam.position
    lift, touch = joint.cam.law(angle), joint.cam.at(angle)
    follower = _follower(joint, view, lift)
    # from the frame of the cam to that of the follower, and to the world
    nx, ny = FramePassage.of(joint.cam.law).directions(touch.normal, -angle)
    x, y = nx, joint.mirror * ny
    c, s = math.cos(joint.direction), math.sin(joint.direction)
    fx, fy = view.force
    force = np.copysign(np.hypot(fx, fy), fx * (c * x - s * y) + fy * (s * x + c * y))
    gap, mode = _contact(joint, view)
    at_x, at_y, along, sliding = _touching(joint, view, touch, cam.velocity)
    roller = getattr(joint.cam.follower, 'roller', 0.0)
    spin = joint.mirror * sliding / roller if roller else np.zeros_like(sliding)
    return CamReading(
        cam.total, cam.velocity, lift, *follower[:3], gap, force, touch.pressure_angle,
        torque, at_x, at_y, along, sliding, spin, mode,
    )  # fmt: skip


def _touching(
    joint: PlacedCam, view: PairView, touch: CamTouch, rate: Array
) -> tuple[Array, Array, Array, Array]:
    """Point of contact in the world [m]; its speed along the profile, and that of sliding [m/s].

    Sliding is that of the follower over the cam; of a roller what its rolling takes up.

    Parameters
    ----------
    rate : of the cam (N,) [rad/s] or [m/s]
    """
    turn = view.turning(joint.first, joint.on_first).position
    (x, y), (c, s) = joint.profile(touch.profile), (np.cos(turn), np.sin(turn))
    x0, y0 = view.place(joint.first, (0.0, 0.0))
    return x0 + c * x - s * y, y0 + s * x + c * y, touch.rate * rate, touch.sliding * rate


def _cam(joint: PlacedCam, view: PairView) -> tuple[Trajectory, Array]:
    """Trajectory of the cam, and the torque or force on it, in the direction of its law."""
    if joint.distance.slides:
        x, y = joint.world((0.0, -1.0))
        p, v, a = (x * px + y * py for px, py in view.path(joint.first, joint.on_first))
        place = p - (x * joint.centre[0] + y * joint.centre[1])
        force = -(x * view.force[0] + y * view.force[1])
        return Trajectory(place, v, a, np.zeros_like(place)), force
    turn, sense = view.turning(joint.first, joint.on_first), joint.sense
    place, *rest = (sense * x for x in turn)
    torque = sense * view.moment_on_first(np.array(joint.centre)[:, None])
    return Trajectory(place + joint.phase, *rest), torque


def _follower(joint: PlacedCam, view: PairView, lift: Array) -> Trajectory:
    """The follower's place, from where it is on the base circle, in the direction of the lift."""
    lowest = joint.distance.lowest
    if joint.distance.swings:
        turn = view.chord(joint.second, joint.pivot, joint.on_second)
        place = joint.swing * (turn.position + joint.arm_angle - joint.direction - math.pi)
        off = np.remainder(place - lowest - lift + math.pi, 2.0 * math.pi) - math.pi
        rates = joint.swing * turn.velocity, joint.swing * turn.acceleration
        return Trajectory(lift + off, *rates, np.zeros_like(lift))
    c, s = math.cos(joint.direction), math.sin(joint.direction)
    p, v, a = (c * x + s * y for x, y in view.path(joint.second, joint.on_second))
    place = p - (c * joint.centre[0] + s * joint.centre[1]) - lowest
    return Trajectory(place, v, a, np.zeros_like(place))


def _contact(joint: PlacedCam, view: PairView) -> tuple[Array, NDArray[np.uint8]]:
    """Distance [m] to what the follower may touch, and the mode."""
    walls = [view.gap(side) for side in joint.sides]
    count = view.count
    known = [(wall, side) for wall, side in zip(walls, joint.sides, strict=True) if wall]
    if not known:
        return np.zeros(count), np.full(count, CamMode.GUIDED, np.uint8)
    mode = np.full(count, CamMode.LIFTED, np.uint8)
    for (_, closed), side in known:
        mode[closed] = CamMode.CONTACT if side == 'right' else CamMode.OUTER
    return np.min([gap for (gap, _), _ in known], axis=0), mode
