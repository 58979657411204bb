"""Displacement probes: how far the pin of a loose joint is from the centre of its bushing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.scene.sensor_keys import AnalogueKeys, InJointKeys, check_joint, register
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

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Displacement (1, N) [m] at instants as those of ``motion.curve.at(segments, dt)``."""
        joint, m = self._joint, self._mechanism
        q = motion.curve.local(segments, dt).T
        pin = m.locate_all(joint.first, q, joint.on_first)
        x, y = pin - m.locate_all(joint.second, q, joint.on_second)
        angle = self._direction + m.angle_all(joint.second, q)
        return np.asarray(x * np.cos(angle) + y * np.sin(angle))[None]


@register('displacement_probe')
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
