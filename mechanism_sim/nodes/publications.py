"""Messages of samples, serialised from samples of the engine; events have `messages.events`.

Each function gives what writes the messages of one topic: from samples of the machine at N
instants N serialised messages.
"""

from __future__ import annotations

from collections.abc import Callable
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
    uint8_array,
)
from mechanism_sim.messages.layout import Layout
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import Mechanism

Array = NDArray[np.float64]


def joint_states(physics: Physics) -> Callable[[Array, Observation], list[bytes]]:
    """JointState messages: angles and displacements of the links; the effort is the drives'."""
    names = list(physics.coordinates)
    driven, none = [names.index(c) for c in physics.driven], float64_array(np.zeros(len(names)))
    layout = Layout(JointState(name=names, position=none, velocity=none, effort=none))

    def write(t: Array, o: Observation) -> list[bytes]:
        effort = np.zeros_like(o.position)
        effort[driven] = o.drive_torque
        return layout.write(
            t, {'position': o.position.T, 'velocity': o.velocity.T, 'effort': effort.T}
        )

    return write


def linkage_states(physics: Physics) -> Callable[[Samples], list[bytes]]:
    """LinkageState messages."""
    names, joints = list(physics.coordinates), list(physics.clearances)
    each, gap = float64_array(np.zeros(len(names))), float64_array(np.zeros(len(joints)))
    message = LinkageState(coordinates=names, joints=joints)
    message.position = message.velocity = message.acceleration = each
    message.gaps = message.normal_forces = message.friction_forces = gap
    message.modes = uint8_array(np.zeros(len(joints)))
    layout = Layout(message)

    def write(s: Samples) -> list[bytes]:
        o = s.observed
        columns = {
            'position': o.position.T,
            'velocity': o.velocity.T,
            'acceleration': o.acceleration.T,
            'modes': s.modes.T,
            'gaps': o.gap.T,
            'normal_forces': o.normal_force.T,
            'friction_forces': o.friction_force.T,
            'drive_torque': o.drive_torque[0],
            'kinetic_energy': o.kinetic_energy,
            'potential_energy': o.potential_energy,
            'drive_work': s.drive_work,
            'dissipated': s.dissipated,
        }
        return layout.write(s.t, columns)

    return write


def reactions(physics: Physics, world: str) -> Callable[[Array, Observation], list[bytes]]:
    """JointReactions messages, in the frame of the world."""
    joints = list(physics.joints)
    none = float64_array(np.zeros(len(joints)))
    message = JointReactions(joints=joints, force_x=none, force_y=none, moment=none)
    message.header.frame_id = world
    layout = Layout(message)

    def write(t: Array, o: Observation) -> list[bytes]:
        columns = {
            'force_x': o.reaction[:, 0].T,
            'force_y': o.reaction[:, 1].T,
            'moment': o.reaction_moment.T,
            'drive_torque': o.drive_torque[0],
        }
        return layout.write(t, columns)

    return write


def transforms(
    mechanism: Mechanism, frame_of: Callable[[str], str]
) -> Callable[[Array, Array], list[bytes]]:
    """TFMessages with the frame of every link in the world; angles are (N, n)."""
    links = [body.name for body in mechanism.bodies]
    frames = [TransformStamped(child_frame_id=frame_of(link)) for link in links]
    for frame in frames:
        frame.header.frame_id = frame_of(WORLD)
    layout = Layout(TFMessage(transforms=frames))

    def write(t: Array, angles: Array) -> list[bytes]:
        columns: dict[str, Array] = {}
        q: Any = dict(zip(mechanism.coordinates, angles.T, strict=True))
        for i, link in enumerate(links):
            x, y = mechanism.locate_all(link, angles.T)
            half = 0.5 * mechanism.angle(link, q)  # at all instants
            inner = {'translation.x': x, 'translation.y': y,
                     'rotation.z': np.sin(half), 'rotation.w': np.cos(half)}  # fmt: skip
            columns |= {f'transforms[{i}].transform.{name}': v for name, v in inner.items()}
        return layout.write(t, columns)

    return write
