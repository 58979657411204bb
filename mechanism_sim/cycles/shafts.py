"""Forces of teeth on shafts in space, and what the two bearings of a shaft carry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.hybrid.sampling import Samples
from mechanism_sim.hybrid.system import Array
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import HigherPair, Joint, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.planar.view import ToothLoad
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.joint_view import JointView


class BearingLoads(NamedTuple):
    """What k bearings do to a shaft, or k supports to a rotor, at N instants.

    Of a support that has a mass it is the force of the ground on that.
    """

    names: tuple[str, ...]
    force: Array  #: (k, 2, N) [N] along x and y of the world
    axial: Array  #: (k, N) [N] along the shaft towards the reader
    locating: str = ''  #: which of them takes axial forces


def shaft_columns(machine: Machine, samples: Samples) -> dict[str, Array]:
    """Arrays (N,) [N] by column; empty where forces are not known.

    ``tooth_force.JOINT.LINK.tangential``, counterclockwise about the link's shaft, ``.radial``,
    towards it, and ``.axial``; ``bearing_force.SHAFT.BEARING.x``, ``.y``, ``.size`` of each
    bearing on the shaft, across it, and ``.axial`` of the one that locates it.
    """
    if not machine.physics.has_forces:
        return {}
    found: dict[str, Array] = {}
    for joint, load in _tooth_loads(machine, samples.observed, samples.modes):
        parts = load.components
        found |= {f'tooth_force.{joint}.{load.link}.{k}': x for k, x in parts.items()}
    for joint, loads in bearing_loads(machine, samples.observed, samples.modes).items():
        for name, (x, y), axial in zip(loads.names, loads.force, loads.axial, strict=True):
            head = f'bearing_force.{joint}.{name}'
            found |= {f'{head}.x': x, f'{head}.y': y, f'{head}.size': np.hypot(x, y)}
            if name == loads.locating:
                found[f'{head}.axial'] = axial
    return found


def shafts_of(machine: Machine) -> dict[str, tuple[str, ...]]:
    """The joints that have bearings or supports of their own, with the names of these."""
    found = {}
    for joint in machine.mechanism.joints:
        keys = machine.scene.joints.get(joint.name)
        if rotor := _rotor(machine, joint):
            found[joint.name] = tuple(name for name, _ in rotor.supports)
        elif isinstance(joint, Revolute) and keys and keys.bearings:
            found[joint.name] = tuple(keys.bearings)
    return found


def bearing_loads(
    machine: Machine, observed: Observation, modes: NDArray[np.uint8]
) -> dict[str, BearingLoads]:
    """What the bearings of all shafts carry, by joint.

    Balance of forces and moments of every shaft: the plane knows the sum R of both bearings but
    for forces that it does not know, those of bevel and worm teeth. All but the teeth acts in the
    plane of the machine, z = 0: weights, inertia, springs, belts. With the forces F of teeth at
    arms r, and bearings B at z, ``sum B = R - sum F`` of those unknown to the plane, and
    ``sum z B = (-M_y, M_x)`` with the moments ``M = sum r x F``. Supports of rotors follow from
    how far they give way.
    """
    teeth = [load for _, load in _tooth_loads(machine, observed, modes)]
    found = {}
    for name in shafts_of(machine):
        joint = machine.mechanism.joint(name)
        if rotor := _rotor(machine, joint):
            found[name] = _supports(machine, joint.second, rotor, observed)
        elif isinstance(joint, Revolute):
            found[name] = _bearings(machine, joint, observed, modes, teeth)
    return found


def _rotor(machine: Machine, joint: Joint) -> Rotor | None:
    """What gives way in a joint that carries a rotor."""
    own = machine.mechanism.tree_joints.get(joint.second) is joint
    return machine.mechanism.rotors.get(joint.second) if own else None


def _view(
    machine: Machine, joint: HigherPair | Revolute, observed: Observation, modes: NDArray[np.uint8]
) -> JointView:
    return JointView(machine.mechanism, joint, machine.physics, observed, modes)


def _tooth_loads(
    machine: Machine, observed: Observation, modes: NDArray[np.uint8]
) -> Iterator[tuple[str, ToothLoad]]:
    """Forces of teeth on shafts, with their joints."""
    for joint in machine.mechanism.joints:
        if isinstance(joint, HigherPair):
            for load in joint.tooth_loads(_view(machine, joint, observed, modes)):
                yield joint.name, load


def _bearings(
    machine: Machine,
    joint: Revolute,
    observed: Observation,
    modes: NDArray[np.uint8],
    teeth: Sequence[ToothLoad],
) -> BearingLoads:
    keys = machine.scene.joints[joint.name]
    shaft = joint.second if joint.second != GROUND else joint.first
    own = [load for load in teeth if load.link == shaft]
    sign = 1.0 if shaft == joint.second else -1.0
    across = _view(machine, joint, observed, modes).force * sign
    across = across - sum((x.force[:2] for x in own if not x.in_plane), np.zeros(()))
    moment = sum((np.cross(x.arm, x.force, axis=0) for x in own), np.zeros_like(across[:1]))
    (one, a), (two, b) = keys.bearings.items()
    levers = np.array([-moment[1], moment[0]]) if own else np.zeros_like(across)
    second = (levers - a * across) / (b - a)
    axial = -sum((x.force[2] for x in own), np.zeros(across.shape[1]))
    along = np.array([axial if name == keys.locating else 0.0 * axial for name in (one, two)])
    force = np.array([across - second, second])
    return BearingLoads((one, two), force, along, keys.locating or '')


def _supports(machine: Machine, link: str, rotor: Rotor, observed: Observation) -> BearingLoads:
    index = machine.mechanism.coordinates.index
    own = [index(f'{link}.{name}') for name in rotor.names]
    q, v, spin = observed.local[own], observed.velocity[own], observed.velocity[index(link)]
    names = tuple(name for name, _ in rotor.supports)
    force = np.array([rotor.support_force(name, q, v, spin) for name in names])
    return BearingLoads(names, force, np.zeros((len(names), q.shape[1])))
