"""Messages of samples, from what the engine knows; events have theirs in `messages.events`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.export.ideal import WORLD
from mechanism_sim.hybrid.physics import Physics
from mechanism_sim.hybrid.sampling import Samples
from mechanism_sim.messages import (
    JointReactions,
    JointState,
    LinkageState,
    TFMessage,
    TransformStamped,
    float64_array,
    stamp,
    uint8_array,
)
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import Mechanism

Array = NDArray[np.float64]


def joint_states(physics: Physics, t: Array, o: Observation) -> Iterator[Any]:
    """JointState messages: angles and displacements of the links; the effort is the drives'.

    It is the same object every time, to be published before the next: they come by the thousand.
    """
    names = list(physics.coordinates)
    effort = np.zeros_like(o.position)
    effort[[names.index(c) for c in physics.driven]] = o.drive_torque
    rows = [np.ascontiguousarray(x.T) for x in (o.position, o.velocity, effort)]
    message = JointState(name=names)
    for time, q, v, torque in zip(t.tolist(), *rows, strict=True):
        message.header.stamp = stamp(time)
        message.position = float64_array(q)
        message.velocity = float64_array(v)
        message.effort = float64_array(torque)
        yield message


def linkage_states(physics: Physics, s: Samples) -> Iterator[Any]:
    """LinkageState messages."""
    o = s.observed
    torque = o.drive_torque[0]
    for i, time in enumerate(s.t.tolist()):
        message = LinkageState(
            time=time,
            coordinates=list(physics.coordinates),
            position=_column(o.position, i),
            velocity=_column(o.velocity, i),
            acceleration=_column(o.acceleration, i),
            joints=list(physics.clearances),
            modes=uint8_array(np.ascontiguousarray(s.modes[:, i])),
            gaps=_column(o.gap, i),
            normal_forces=_column(o.normal_force, i),
            friction_forces=_column(o.friction_force, i),
            drive_torque=float(torque[i]),
            kinetic_energy=float(o.kinetic_energy[i]),
            potential_energy=float(o.potential_energy[i]),
            drive_work=float(s.drive_work[i]),
            dissipated=float(s.dissipated[i]),
        )
        message.header.stamp = stamp(time)
        yield message


def reactions(physics: Physics, t: Array, o: Observation) -> Iterator[Any]:
    """JointReactions messages."""
    torque = o.drive_torque[0]
    for i, time in enumerate(t.tolist()):
        message = JointReactions(
            time=time,
            joints=list(physics.joints),
            force_x=_column(o.reaction[:, 0], i),
            force_y=_column(o.reaction[:, 1], i),
            moment=_column(o.reaction_moment, i),
            drive_torque=float(torque[i]),
        )
        message.header.stamp = stamp(time)
        yield message


def transforms(
    mechanism: Mechanism, t: Array, angles: Array, frame_of: Callable[[str], str]
) -> Iterator[Any]:
    """TFMessages with the frame of every link in the world; `angles` are (N, n)."""
    for time, row in zip(t.tolist(), angles.tolist(), strict=True):
        frames = []
        known = dict(zip(mechanism.coordinates, row, strict=True))
        for link in (body.name for body in mechanism.bodies):
            x, y = mechanism.locate(link, known)
            frame = TransformStamped(child_frame_id=frame_of(link))
            frame.header.stamp = stamp(time)
            frame.header.frame_id = frame_of(WORLD)
            frame.transform.translation.x = x
            frame.transform.translation.y = y
            half = 0.5 * mechanism.angle(link, known)
            frame.transform.rotation.z = float(np.sin(half))
            frame.transform.rotation.w = float(np.cos(half))
            frames.append(frame)
        yield TFMessage(transforms=frames)


def _column(rows: Array, i: int) -> Any:
    return float64_array(np.ascontiguousarray(rows[:, i]))
