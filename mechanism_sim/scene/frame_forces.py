"""Forces of a machine on a frame on springs, from all of it or from some of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.physics import Physics, outside
from mechanism_sim.linkages.forces import AppliedForce
from mechanism_sim.numerics.polynomials import Times
from mechanism_sim.planar.impulses import JointImpulses
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.shaking import ShakingForce
from mechanism_sim.vibration.shaken_frame import Forces, WholeMachine

Places = tuple[Array, Array]
"""Coordinates (n, N), and what is in the joints there."""


def forces_on(machine: Any, name: str) -> Forces:
    """The forces that shake a frame of the scene."""
    joints = machine.scene.oscillators[name].joints
    return whole_machine(machine) if joints is None else JointForces(machine, joints)


def whole_machine(machine: Any) -> WholeMachine:
    """The forces of all of a machine on its ground."""
    tree, plan = machine.mechanism, machine.plan
    applied = [element for element in plan.elements(tree) if isinstance(element, AppliedForce)]
    return WholeMachine(ShakingForce(tree, applied, plan.unknowns(tree)), machine.physics)


class JointWrenches:
    """Wrenches (j, 3, N) in all joints of a machine, of the first on the second link [N, N m]."""

    def __init__(self, machine: Any) -> None:
        self.mechanism: Mechanism = machine.mechanism
        self._physics: Physics = machine.physics
        self._impulses: JointImpulses = machine.joint_impulses

    def index(self, joint: str) -> int:
        """Row of a joint by name."""
        return [j.name for j in self.mechanism.joints].index(joint)

    def read(self, motion: Motion, segments: IndexArray, dt: Times) -> Places:
        """Coordinates (n, N) without whole turns, and the wrenches, as of ``motion.curve.at``."""
        seen = self._physics.observe(motion, segments, dt)
        wrenches = np.concatenate([seen.reaction, seen.reaction_moment[:, None]], axis=1)
        return seen.local, wrenches

    def impulses(self, motion: Motion, segments: IndexArray, step: Array) -> Places:
        """Coordinates, and impulses [N s, N m s] where the rates make a `step` (n, N)."""
        dt, names, curve = np.zeros(len(segments)), self.mechanism.coordinates, motion.curve
        q, outer = curve.local(segments, dt).T, self._impulses.outside
        known = outside(outer, names, curve, segments, dt, motion.state_curve)
        return q, self._impulses(q, step, known)


class JointForces:
    """Forces of joints on the ground; moments about the origin.

    Parameters
    ----------
    joints : names, each of a joint of the ground
    """

    def __init__(self, machine: Any, joints: Sequence[str]) -> None:
        self._wrenches, self._mechanism = JointWrenches(machine), machine.mechanism
        self._joints = [(self._wrenches.index(x), self._mechanism.joint(x)) for x in joints]

    def read(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Force x, y [N] and moment [N m] (3, N)."""
        return self._on_ground(*self._wrenches.read(motion, segments, dt))

    def impulses(self, motion: Motion, segments: IndexArray, step: Array) -> Array:
        """Their integrals (3, N) [N s, N m s] where the rates make a `step` (n, N)."""
        return self._on_ground(*self._wrenches.impulses(motion, segments, step))

    def _on_ground(self, q: Array, wrenches: Array) -> Array:
        """Sum (3, N) of wrenches (j, 3, N) of first-named on second-named links."""
        total = np.zeros((3, q.shape[1]))
        for i, joint in self._joints:
            fx, fy, moment = wrenches[i]
            x, y = self._mechanism.locate_all(joint.second, q, joint.on_second)
            sign = 1.0 if joint.second == GROUND else -1.0
            total += sign * np.array([fx, fy, moment + x * fy - y * fx])
        return total
