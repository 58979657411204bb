"""Forces of a machine on a frame on springs, from all of it or from some of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.physics import Physics, outside
from mechanism_sim.linkages.forces import AppliedForce
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.planar.impulses import JointImpulses
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.shaking import ShakingForce
from mechanism_sim.vibration.shaken_frame import Forces, WholeMachine


def forces_on(machine: Any, name: str) -> Forces:
    """The forces that shake a frame of the scene."""
    joints = machine.scene.oscillators[name].joints
    if joints is None:
        elements = machine.plan.elements(machine.mechanism)
        applied = [element for element in elements if isinstance(element, AppliedForce)]
        return WholeMachine(ShakingForce(machine.mechanism, applied), machine.physics)
    return JointForces(machine.mechanism, machine.physics, machine.joint_impulses, joints)


class JointForces:
    """Forces of joints on the ground; moments about the origin.

    Parameters
    ----------
    mechanism : the machine
    physics : what follows from its motion, with forces
    impulses : likewise from steps of its velocities
    joints : names, each of a joint of the ground
    """

    def __init__(
        self,
        mechanism: Mechanism,
        physics: Physics,
        impulses: JointImpulses,
        joints: Sequence[str],
    ) -> None:
        self._mechanism, self._physics, self._impulses = mechanism, physics, impulses
        names = [joint.name for joint in mechanism.joints]
        self._joints = [(names.index(name), mechanism.joint(name)) for name in joints]

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Force x, y [N] and moment [N m] (3, N)."""
        seen = self._physics.observe(motion, segments, dt)
        wrenches = np.concatenate([seen.reaction, seen.reaction_moment[:, None]], axis=1)
        return self._on_ground(seen.local, wrenches)

    def impulses(self, motion: Motion, segments: NDArray[np.intp], step: Array) -> Array:
        """Their integrals (3, N) [N s, N m s] where the rates make a `step` (n, N)."""
        dt, names = np.zeros(len(segments)), self._mechanism.coordinates
        q = motion.curve.local(segments, dt).T
        curve, states = motion.curve, motion.state_curve
        known = outside(self._impulses.outside, names, curve, segments, dt, states)
        return self._on_ground(q, self._impulses(q, step, known))

    def _on_ground(self, q: Array, wrenches: Array) -> Array:
        """Sum (3, N) of wrenches (j, 3, N) of first-named on second-named links."""
        total = np.zeros((3, q.shape[1]))
        for i, joint in self._joints:
            fx, fy, moment = wrenches[i]
            x, y = self._mechanism.locate_all(joint.second, q, joint.on_second)
            sign = 1.0 if joint.second == GROUND else -1.0
            total += sign * np.array([fx, fy, moment + x * fy - y * fx])
        return total
