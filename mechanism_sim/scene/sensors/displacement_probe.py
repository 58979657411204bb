"""Displacement probes: how far the pin of a loose joint is from the centre of its bushing."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.scene.sensor_keys import SENSORS, AnalogueKeys, InJointKeys, check_joint
from mechanism_sim.sensing.channel import DirectSource


class Probe(DirectSource):
    """A source: the pin's place in its bushing, along a direction that turns with the bushing.

    Parameters
    ----------
    mechanism : the machine
    joint : its joint, the pin on the first link, the bushing on the second
    direction : [rad] in the frame of the second link
    """

    def __init__(self, mechanism: Mechanism, joint: Revolute, direction: float) -> None:
        self._mechanism, self._joint, self._direction = mechanism, joint, direction

    def reading(self, q: Array) -> Array:
        """Displacement (N,) [m]."""
        joint, m = self._joint, self._mechanism
        pin, bushing = (m.trace(point, q)[0] for point in joint.points)
        x, y = pin - bushing
        angle = self._direction + m.angle_all(joint.second, q)
        return np.asarray(x * np.cos(angle) + y * np.sin(angle))


@SENSORS.add('displacement_probe')
class ProbeKeys(InJointKeys, AnalogueKeys):
    """A probe in a bushing that sees the pin, such as an eddy-current probe in a bearing."""

    reads = 'displacement'

    def source(self, machine: Any) -> Probe:
        """The pin's place in its bushing."""
        joint = machine.mechanism.joint(self.joint)
        return Probe(machine.mechanism, joint, self.direction)

    def check(self, machine: Any, where: str) -> None:
        """Refuse joints without a bushing."""
        known = [joint.name for joint in machine.bearings]
        check_joint(where, self.joint, known, 'joint with a pin loose in a bushing')
