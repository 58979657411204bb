"""Forces of teeth on shafts in space, and loads of the two bearings of a shaft."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import HigherPair, Joint, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.rotor import Rotor
from mechanism_sim.planar.view import TOOTH_PARTS, ToothLoad
from mechanism_sim.results.quantity import Quantity, Shown, View, magnitude, vector
from mechanism_sim.scene import Machine


class BearingLoads(NamedTuple):
    """Loads of k bearings on a shaft, or of k supports on a rotor, at N instants.

    Of a support that has a mass it is the force of the ground on that.
    """

    names: tuple[str, ...]
    force: Array  #: (k, 2, N) [N] components along x and y of the world
    axial: Array  #: (k, N) [N] along the shaft towards the reader
    locating: str = ''  #: name of the locating bearing, which takes axial forces


def of_shafts(machine: Machine) -> Iterator[Quantity]:
    """Forces of teeth and of bearings, where forces are known.

    ``tooth_force.JOINT.LINK.tangential``, counterclockwise about the link's shaft, ``.radial``,
    towards it, and ``.axial``; ``bearing_force.SHAFT.BEARING.x``, ``.y``, ``.size`` of each
    bearing on the shaft, across it, and ``.axial`` of the one that locates it. What redundant
    constraints leave open is left out.
    """
    if not machine.physics.has_forces:
        return
    open_, shared = machine.physics.undetermined, set[str]()
    for joint in machine.mechanism.joints:
        for i, link in enumerate(joint.toothed if isinstance(joint, HigherPair) else ()):
            if joint.name in open_:
                shared.add(link)
            else:
                yield from _on_shaft(joint.name, i, link)
    for shaft, names in shafts_of(machine).items():
        joint = machine.mechanism.joint(shaft)
        if shaft in open_ or {joint.first, joint.second} & shared:
            continue
        for i, bearing in enumerate(names):
            yield from _of_bearing(shaft, i, bearing)
            if bearing == _locating(machine, shaft):
                yield _axial(shaft, i, bearing)


def _on_shaft(joint: str, i: int, link: str) -> Iterator[Quantity]:
    def force(part: str) -> Callable[[View], Array]:
        return lambda view: _teeth(view)[joint][i].components[part]

    for part in TOOTH_PARTS:
        words = f'{part} force of the teeth of {joint} on {link}'
        yield Quantity(
            f'tooth_force.{joint}.{link}.{part}', 'N', words, joint, force(part), Shown.PARTS, part
        )


def _of_bearing(shaft: str, i: int, bearing: str) -> Iterator[Quantity]:
    name, words = f'bearing_force.{shaft}.{bearing}', f'force of bearing {bearing} on {shaft}'

    def force(view: View) -> Array:
        return np.asarray(bearing_loads(view)[shaft].force[i])

    yield from vector(name, 'N', words, shaft, force, Shown.PARTS)
    yield magnitude(name, 'N', words, shaft, force, Shown.PARTS)


def _axial(shaft: str, i: int, bearing: str) -> Quantity:
    return Quantity(
        f'bearing_force.{shaft}.{bearing}.axial', 'N',
        f'axial force of bearing {bearing} on {shaft}', shaft,
        lambda view: bearing_loads(view)[shaft].axial[i], Shown.PARTS, 'axial',
    )  # fmt: skip


def _locating(machine: Machine, shaft: str) -> str:
    """The bearing that takes axial forces; empty of a rotor."""
    joint = machine.mechanism.joint(shaft)
    return '' if _rotor(machine, joint) else machine.scene.joints[shaft].locating or ''


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


def bearing_loads(view: View) -> dict[str, BearingLoads]:
    """Loads of the bearings of all shafts, by joint.

    Balance of forces and moments of every shaft: the plane knows the sum R of both bearings but
    for forces that it does not know, those of bevel and worm teeth. All but the teeth acts in the
    plane of the machine, z = 0: weights, inertia, springs, belts. With the forces F of teeth at
    arms r, and bearings B at z, ``sum B = R - sum F`` of those unknown to the plane, and
    ``sum z B = (-M_y, M_x)`` with the moments ``M = sum r x F``. Supports of rotors follow from
    how far they give way.
    """
    return view.once('bearing loads', lambda: _bearing_loads(view))


def _bearing_loads(view: View) -> dict[str, BearingLoads]:
    machine, found = view.machine, {}
    for name in shafts_of(machine):
        joint = machine.mechanism.joint(name)
        if rotor := _rotor(machine, joint):
            found[name] = _supports(machine, joint.second, rotor, view.observed)
        elif isinstance(joint, Revolute):
            found[name] = _bearings(view, joint)
    return found


def _teeth(view: View) -> dict[str, Sequence[ToothLoad]]:
    """Forces of teeth on shafts, by joint."""
    return view.once(
        'teeth',
        lambda: {
            joint.name: joint.tooth_loads(view.joint(joint))
            for joint in view.machine.mechanism.joints
            if isinstance(joint, HigherPair)
        },
    )


def _rotor(machine: Machine, joint: Joint) -> Rotor | None:
    """Compliance of a joint that carries a rotor."""
    own = machine.mechanism.tree_joints.get(joint.second) is joint
    return machine.mechanism.having(Rotor).get(joint.second) if own else None


def _bearings(view: View, joint: Revolute) -> BearingLoads:
    keys = view.machine.scene.joints[joint.name]
    shaft = joint.second if joint.second != GROUND else joint.first
    own = [load for loads in _teeth(view).values() for load in loads if load.link == shaft]
    sign = 1.0 if shaft == joint.second else -1.0
    across = view.joint(joint).force * sign
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
