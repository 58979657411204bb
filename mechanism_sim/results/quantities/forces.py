"""Forces in joints and on links; efforts of drives and loads; energies."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.physics import DynamicPhysics, is_force_open
from mechanism_sim.planar.configuration import Poses
from mechanism_sim.planar.mechanism import Joint, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.protocols import MotionBound
from mechanism_sim.results.quantity import Quantity, Shown, View, direction, magnitude, vector
from mechanism_sim.scene import Machine
from mechanism_sim.scene.drives import drive_of


def of_joints(machine: Machine) -> Iterator[Quantity]:
    """``reaction.JOINT.x``, ``.y``, ``.moment``, ``.size``, ``.direction``; ``power.JOINT``.

    Of the first-named on the second-named link; the moment is about the joint's point on the
    latter, where the joint can transmit one. What redundant constraints leave open is left out.
    """
    if not machine.physics.has_forces:
        return
    for i, joint in enumerate(machine.mechanism.joints):
        friction = joint.name in machine.physics.frictions
        moment = friction or _transmits_moment(machine, joint)
        open_ = machine.physics.undetermined.get(joint.name, frozenset())
        if is_force_open(machine.physics.undetermined, joint.name):
            open_ |= {'size', 'direction'}
        yield from (q for q in _of_joint(i, joint.name, moment) if q.part not in open_)
        if friction:
            yield _loss(joint)
        if GROUND not in (joint.first, joint.second) and not open_:
            yield _power(joint)


def _of_joint(i: int, joint: str, transmits_moment: bool) -> Iterator[Quantity]:
    name, words = f'reaction.{joint}', f'force in {joint}'

    def force(view: View) -> Array:
        return np.asarray(view.observed.reaction[i])

    yield from vector(name, 'N', words, joint, force)
    if transmits_moment:
        yield Quantity(
            f'{name}.moment', 'N m', f'moment in {joint}', joint,
            lambda view: view.observed.reaction_moment[i], part='moment',
        )  # fmt: skip
    yield magnitude(name, 'N', words, joint, force, Shown.CYCLE)
    yield direction(name, words, joint, force, Shown.CYCLE)


def _loss(joint: Joint) -> Quantity:
    def loss(view: View) -> Array:
        return view.joint(joint).friction_loss

    words = f'power lost to friction in {joint.name}'
    return Quantity(f'friction_loss.{joint.name}', 'W', words, joint.name, loss, Shown.CYCLE)


def _power(joint: Joint) -> Quantity:
    def power(view: View) -> Array:
        seen = view.joint(joint)
        velocity = seen.path(joint.second, joint.on_second)[1]
        turning = seen.turning(joint.second, joint.on_second).velocity
        return np.asarray((seen.force * velocity).sum(axis=0) + seen.moment * turning)

    words = f'power through {joint.name} into {joint.second}'
    return Quantity(f'power.{joint.name}', 'W', words, joint.name, power, Shown.ASKED)


def _transmits_moment(machine: Machine, joint: Joint) -> bool:
    """True if anything but friction in an ideal joint may transmit a moment there.

    A pin in its bushing does by friction, whose force is not at the joint's point.
    """
    if not isinstance(joint, Revolute):
        return True
    gaps = machine.physics.system.gaps if isinstance(machine.physics, DynamicPhysics) else ()
    own = [gap for gap in gaps if gap.joint == joint.name]
    return any(gap.friction or isinstance(gap, MotionBound) for gap in own)


def of_links(machine: Machine) -> Iterator[Quantity]:
    """``reaction.JOINT.LINK.along`` and ``.across``: force on a moving link, in its own frame."""
    if not machine.physics.has_forces:
        return
    for i, joint in enumerate(machine.mechanism.joints):
        if is_force_open(machine.physics.undetermined, joint.name):
            continue
        for link, sign in ((joint.first, -1.0), (joint.second, 1.0)):
            if link != GROUND:
                yield from _on_link(i, joint.name, link, sign)


def _on_link(i: int, joint: str, link: str, sign: float) -> Iterator[Quantity]:
    def along(view: View) -> Array:
        (ux, uy), (x, y) = _directions(view)[link], sign * view.observed.reaction[i]
        return np.asarray(ux * x + uy * y)

    def across(view: View) -> Array:
        (ux, uy), (x, y) = _directions(view)[link], sign * view.observed.reaction[i]
        return np.asarray(ux * y - uy * x)

    for part, evaluate in (('along', along), ('across', across)):
        yield Quantity(
            f'reaction.{joint}.{link}.{part}', 'N', f'force of {joint} on {link}, {part} it',
            joint, evaluate, Shown.ASKED, part,
        )  # fmt: skip


def _directions(view: View) -> dict[str, Array]:
    """Unit vectors (2, N) along the links."""
    poses = view.once('poses', lambda: Poses(view.machine.mechanism, view.observed.local))
    return poses.along


def of_drives(machine: Machine) -> Iterator[Quantity]:
    """Efforts of drives and of unknown loads, and power.

    ``drive_torque`` of the main drive, ``drive_torque.COORDINATE`` of each, ``load.NAME``,
    ``drive_power``; ``motor.torque``, ``.speed``, ``.power`` of a motor behind its gear.
    """
    physics, main = machine.physics, machine.plan.main
    if not physics.has_forces:
        return
    for i, coordinate in enumerate(physics.driven):
        slides = coordinate in physics.displacements
        unit, words = ('N', 'drive force') if slides else ('N m', 'drive torque')
        effort = _effort(i)
        if coordinate == main:
            yield Quantity('drive_torque', unit, words, coordinate, effort)
        several = Shown.CYCLE if len(physics.driven) > 1 else Shown.ASKED
        yield Quantity(
            f'drive_torque.{coordinate}', unit, f'{words} on {coordinate}', coordinate, effort,
            several if coordinate == main else Shown.RUN,
        )  # fmt: skip
    for i, (load, unit) in enumerate(physics.unknowns.items()):
        yield Quantity(f'load.{load}', unit, f'load {load}', load, _load(i))
    if physics.driven:
        yield Quantity(
            'drive_power', 'W', 'power of the drives', '',
            lambda view: view.observed.drive_power, Shown.CYCLE,
        )  # fmt: skip
    yield from _of_motor(machine)


def _effort(i: int) -> Callable[[View], Array]:
    return lambda view: view.observed.drive_torque[i]


def _load(i: int) -> Callable[[View], Array]:
    return lambda view: view.observed.load[i]


def _of_motor(machine: Machine) -> Iterator[Quantity]:
    main = machine.plan.main
    drive = drive_of(machine.plan, main)
    if drive is None or drive.motor is None:
        return
    ratio = drive.motor.ratio
    i, row = machine.physics.coordinates.index(main), machine.drive.row

    def power(view: View) -> Array:
        return np.asarray(view.observed.drive_torque[row] * view.observed.velocity[i])

    for name, unit, evaluate in (
        ('torque', 'N m', lambda view: view.observed.drive_torque[row] / ratio),
        ('speed', 'rad/s', lambda view: ratio * view.observed.velocity[i]),
        ('power', 'W', power),
    ):
        words = f'{name} of the motor'
        yield Quantity(f'motor.{name}', unit, words, main, evaluate, Shown.ASKED)


def of_energy(machine: Machine) -> Iterator[Quantity]:
    """``energy.kinetic``, ``energy.potential``; ``energy.drive_work``, ``energy.dissipated``."""
    if not machine.physics.has_forces:
        return
    yield Quantity(
        'energy.kinetic', 'J', 'kinetic energy', '', lambda view: view.observed.kinetic_energy
    )
    yield Quantity(
        'energy.potential', 'J', 'potential energy', '',
        lambda view: view.observed.potential_energy,
    )  # fmt: skip
    yield Quantity(
        'energy.drive_work', 'J', 'work of the drives', '', lambda view: view.drive_work,
        cumulative=True,
    )  # fmt: skip
    yield Quantity(
        'energy.dissipated', 'J', 'energy dissipated, less work of loads', '',
        lambda view: view.dissipated, cumulative=True,
    )  # fmt: skip
