"""The frames on springs of a machine, and what can be said of them without running it."""

from __future__ import annotations

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.linkages.forces import AppliedForce
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.impulses import JointImpulses
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.shaking import ShakingForce
from mechanism_sim.scene.clearances import gaps_and_films
from mechanism_sim.scene.dynamic_model import DynamicModel
from mechanism_sim.scene.nominal_model import Level
from mechanism_sim.vibration.frame import Frame, Mount
from mechanism_sim.vibration.joint_forces import JointForces
from mechanism_sim.vibration.shaking import Forces, WholeMachine

_FASTEST = 1e6
"""[Hz] Natural frequencies beyond it are those of no frame."""


def read_frame(machine: DynamicModel, name: str) -> Frame:
    """A frame of the scene."""
    parts = machine.scene.oscillators
    if name not in parts:
        known = ', '.join(parts) or 'none'
        raise InputError(
            f"{machine.name}: there is no oscillator '{name}'{nearest(name, parts)}; "
            f'oscillators: {known}'
        )
    part, where = parts[name], f'{machine.name}: oscillators.{name}'
    mounts = tuple(Mount(m.at, m.stiffness, m.damping) for m in part.mounts.values())
    frame = Frame(part.mass, part.inertia, part.cog, mounts)
    if not frame.held:
        raise InputError(
            f'{where}.mounts do not hold it in every direction: give each direction a stiffness, '
            'and a frame that can turn two mounts apart, or leave out its inertia'
        )
    if frame.frequencies[-1] > _FASTEST:
        raise InputError(
            f'{where}: its highest natural frequency of {frame.frequencies[-1]:.3g} Hz is above '
            f'{_FASTEST:g} Hz: check mass, inertia and stiffness'
        )
    return frame


def forces_on(machine: DynamicModel, name: str) -> Forces:
    """What shakes a frame of the scene."""
    joints, mechanism = machine.scene.oscillators[name].joints, machine.mechanism
    if joints is None:
        elements = machine.plan.elements(mechanism)
        applied = [element for element in elements if isinstance(element, AppliedForce)]
        return WholeMachine(ShakingForce(mechanism, applied), machine.physics)
    return JointForces(mechanism, machine.physics, joint_impulses(machine), joints)


def joint_impulses(machine: DynamicModel) -> JointImpulses:
    """The impulses in all joints of a machine, from steps of its velocities."""
    check_impulses(machine)
    mechanism = machine.mechanism
    gaps, _ = gaps_and_films(mechanism, machine.clearances)
    closing = closures(mechanism, [j for j in mechanism.cut if j not in machine.clearances])
    return JointImpulses(mechanism, gaps, closing, machine.plan.prescribed)


def check_impulses(machine: DynamicModel) -> None:
    """Refuse machines whose impacts make friction in ideal joints: steps do not tell it apart."""
    rubbing = [n for n, j in machine.scene.joints.items() if j.friction and j.friction.coefficient]
    if rubbing and machine.level is Level.NONSMOOTH:
        raise InputError(
            f'{machine.name}: joints.{rubbing[0]}.friction: beside rigid contacts with clearance '
            'impulses in joints are not known, which load cells and the joints of frames ask for; '
            'leave out the friction, or give the clearances a contact with a stiffness'
        )


def check_oscillators(machine: DynamicModel) -> None:
    """Refuse frames that cannot be."""
    for name, part in machine.scene.oscillators.items():
        where = f'{machine.name}: oscillators.{name}'
        if not name.isidentifier():
            raise InputError(
                f"{machine.name}: the oscillator name '{name}' must be letters, digits and _"
            )
        if name in (GROUND, *machine.links):
            raise InputError(f"{machine.name}: the oscillator '{name}' has the name of a link")
        read_frame(machine, name)
        if not machine.plan.weighed:
            raise InputError(f'{where}: what shakes it needs the masses of all links')
        if part.joints is None:
            continue
        check_impulses(machine)
        if not (machine.dynamic or machine.scene.outputs.forces):
            raise InputError(f"{where}.joints: their forces need 'outputs.forces: true'")
        grounded = [j.name for j in machine.mechanism.joints if GROUND in (j.first, j.second)]
        for joint in part.joints:
            if joint not in grounded:
                raise InputError(
                    f"{where}.joints: '{joint}' is no joint of the ground"
                    f'{nearest(joint, grounded)}; those are: {", ".join(grounded)}'
                )


def oscillator_notes(machine: DynamicModel) -> list[str]:
    """What can be said of the frames of a scene."""
    notes = []
    carried = sum(body.mass for body in machine.mechanism.bodies)
    for name, part in machine.scene.oscillators.items():
        frame = read_frame(machine, name)
        pitches = ', '.join(f'{f:.4g}' for f in frame.frequencies)
        by = 'the machine' if part.joints is None else ', '.join(part.joints)
        notes.append(
            f'oscillator {name}: {frame.mass:g} kg on {len(frame.mounts)} '
            f'mount{"s" * (len(frame.mounts) > 1)}, natural frequencies {pitches} Hz, shaken by '
            f'{by}; it does not move the machine, whose moving links have '
            f'{carried / frame.mass:.2g} of its mass'
        )
    return notes
