"""Forces of teeth on shafts in space, and what the two bearings of a shaft carry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mechanism_sim.hybrid.sampling import Samples
from mechanism_sim.hybrid.system import Array
from mechanism_sim.planar.mechanism import GROUND, HigherPair, Revolute
from mechanism_sim.planar.view import ToothLoad
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView


def shaft_columns(machine: Machine, samples: Samples) -> dict[str, Array]:
    """Arrays (N,) [N] by column; empty where forces are not known.

    ``tooth_force.JOINT.LINK.tangential``, counterclockwise about the link's shaft, ``.radial``,
    towards it, and ``.axial``; ``bearing_force.SHAFT.BEARING.x``, ``.y``, ``.size`` of each
    bearing on the shaft, across it, and ``.axial`` of the one that locates it. Of a support of a
    rotor that has a mass it is the force of the ground on that.
    """
    if not machine.physics.has_forces:
        return {}
    found: dict[str, Array] = {}
    loads: list[ToothLoad] = []
    for joint in machine.mechanism.joints:
        if isinstance(joint, HigherPair):
            for load in joint.tooth_loads(_view(machine, joint, samples)):
                loads.append(load)
                parts = load.components
                found |= {f'tooth_force.{joint.name}.{load.link}.{k}': x for k, x in parts.items()}
    return found | dict(_bearings(machine, samples, loads)) | dict(_supports(machine, samples))


def _supports(machine: Machine, samples: Samples) -> Iterator[tuple[str, Array]]:
    """Forces of the supports of rotors."""
    mechanism, o = machine.mechanism, samples.observed
    index = mechanism.coordinates.index
    for joint in mechanism.joints:
        rotor = mechanism.rotors.get(joint.second)
        if rotor is None or mechanism.tree_joints.get(joint.second) is not joint:
            continue
        own = [index(f'{joint.second}.{name}') for name in rotor.names]
        spin = o.velocity[index(joint.second)]
        for name, _ in rotor.supports:
            x, y = rotor.support_force(name, o.position[own], o.velocity[own], spin)
            head = f'bearing_force.{joint.name}.{name}'
            yield f'{head}.x', x
            yield f'{head}.y', y
            yield f'{head}.size', np.hypot(x, y)


def _view(machine: Machine, joint: HigherPair | Revolute, samples: Samples) -> JointView:
    return JointView(machine.mechanism, joint, machine.physics, samples.observed, samples.modes)


def _bearings(
    machine: Machine, samples: Samples, loads: Sequence[ToothLoad]
) -> Iterator[tuple[str, Array]]:
    """Balance of forces and moments of every shaft that has bearings.

    The plane knows the sum R of both bearings but for forces that it does not know, those of bevel
    and worm teeth. All but the teeth acts in the plane of the machine, z = 0: weights, inertia,
    springs, belts. With the forces F of teeth at arms r, and bearings B at z,
    ``sum B = R - sum F`` of those unknown to the plane, and ``sum z B = (-M_y, M_x)`` with the
    moments ``M = sum r x F``.
    """
    for joint in machine.mechanism.joints:
        keys = machine.scene.joints.get(joint.name)
        given = getattr(keys, 'bearings', None)
        if keys is None or not given or not isinstance(joint, Revolute):
            continue
        shaft = joint.second if joint.second != GROUND else joint.first
        own = [load for load in loads if load.link == shaft]
        across = _view(machine, joint, samples).force * (1.0 if shaft == joint.second else -1.0)
        across = across - sum((x.force[:2] for x in own if not x.in_plane), np.zeros(()))
        moment = sum((np.cross(x.arm, x.force, axis=0) for x in own), np.zeros_like(across[:1]))
        (one, a), (two, b) = given.items()
        levers = np.array([-moment[1], moment[0]]) if own else np.zeros_like(across)
        second = (levers - a * across) / (b - a)
        for name, (x, y) in ((one, across - second), (two, second)):
            head = f'bearing_force.{joint.name}.{name}'
            yield f'{head}.x', x
            yield f'{head}.y', y
            yield f'{head}.size', np.hypot(x, y)
        axial = -sum((x.force[2] for x in own), np.zeros(across.shape[1]))
        yield f'bearing_force.{joint.name}.{keys.locating}.axial', axial
