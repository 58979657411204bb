"""Forces of a machine on a frame on springs, from all of it or from some of its joints."""

from __future__ import annotations

from typing import Any

from mechanism_sim.linkages.forces import AppliedForce
from mechanism_sim.planar.shaking import ShakingForce
from mechanism_sim.vibration.joint_forces import JointForces
from mechanism_sim.vibration.shaking import Forces, WholeMachine


def forces_on(machine: Any, name: str) -> Forces:
    """The forces that shake a frame of the scene."""
    joints = machine.scene.oscillators[name].joints
    if joints is None:
        elements = machine.plan.elements(machine.mechanism)
        applied = [element for element in elements if isinstance(element, AppliedForce)]
        return WholeMachine(ShakingForce(machine.mechanism, applied), machine.physics)
    return JointForces(machine.mechanism, machine.physics, machine.joint_impulses, joints)
