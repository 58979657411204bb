"""Load cells: the force in a joint along a direction, impacts included."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import Times
from mechanism_sim.scene.frame_forces import JointWrenches
from mechanism_sim.scene.sensor_keys import (
    SENSORS,
    InJointKeys,
    ShockKeys,
    check_impulses,
    check_joint,
)
from mechanism_sim.sensing.channel import DirectSource
from mechanism_sim.vibration.shaken_frame import VelocitySteps


class LoadCell(DirectSource):
    """A source: the force of the first on the second link of a joint, along a direction.

    Parameters
    ----------
    joint : name
    direction : [rad] in the frame of the joint's second link
    """

    def __init__(self, machine: Any, joint: str, direction: float) -> None:
        self._wrenches, self._mechanism = JointWrenches(machine), machine.mechanism
        self._row = self._wrenches.index(joint)
        self._link, self._direction = self._mechanism.joint(joint).second, direction
        self._steps = VelocitySteps()

    def read(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Force (1, N) [N] at instants as those of ``motion.curve.at(segments, dt)``."""
        return self._along(*self._wrenches.read(motion, segments, dt))[None]

    def impulses(self, motion: Motion) -> Array:
        """Impulses of the force (m, 1) [N s] at the instants at which the m pieces begin."""
        steps = self._steps(motion.curve)
        found = np.zeros((len(motion), 1))
        sudden = np.flatnonzero(steps.any(axis=0))
        if sudden.size:
            found[sudden, 0] = self._along(
                *self._wrenches.impulses(motion, sudden, steps[:, sudden])
            )
        return found

    def _along(self, q: Array, wrenches: Array) -> Array:
        angle = self._direction + self._mechanism.angle_all(self._link, q)
        x, y = wrenches[self._row, :2]
        return np.asarray(x * np.cos(angle) + y * np.sin(angle))


@SENSORS.add('load_cell')
class LoadCellKeys(InJointKeys, ShockKeys):
    """A load cell between a joint and its second link."""

    reads = 'force'

    def source(self, machine: Any) -> LoadCell:
        """The joint's force along the direction, with its impulses."""
        return LoadCell(machine, str(self.joint), self.direction)

    def check(self, machine: Any, where: str) -> None:
        """Refuse machines whose forces, or whose impulses, are not known."""
        check_joint(where, self.joint, [j.name for j in machine.mechanism.joints], 'joint')
        if not (machine.level.dynamic or machine.scene.outputs.forces):
            raise InputError(f"{where}: a load cell needs 'outputs.forces: true'")
        check_impulses(machine)
