"""Displacement probes: how far the pin of a loose joint is from the centre of its bushing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.numerics.rational import Array, Modes, Rational
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.scene.sensor_keys import AnalogueKeys, InJointKeys, SensorKind, register
from mechanism_sim.scene.sensors._places import check_joint


class ProbeKeys(InJointKeys, AnalogueKeys):
    """A probe in a bushing that sees the pin, such as an eddy-current probe in a bearing."""


class Probe:
    """A source: the pin's place in its bushing, along a direction that turns with the bushing.

    Parameters
    ----------
    mechanism : the machine
    joint : its joint, the pin on the first link, the bushing on the second
    direction : [rad] in the frame of the second link
    """

    inputs = 1

    def __init__(self, mechanism: Mechanism, joint: Revolute, direction: float) -> None:
        self._mechanism, self._joint, self._direction = mechanism, joint, direction

    def through(self, chain: Rational) -> Modes:
        """The system from what is read here to what comes out of a chain."""
        return chain.modes()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Displacement (1, N) [m] at instants as those of ``motion.curve.at(segments, dt)``."""
        joint, m = self._joint, self._mechanism
        q = motion.curve.local(segments, dt).T
        pin = m.locate_all(joint.first, q, joint.on_first)
        x, y = pin - m.locate_all(joint.second, q, joint.on_second)
        angle = self._direction + m.angle_all(joint.second, q)
        return np.asarray(x * np.cos(angle) + y * np.sin(angle))[None]

    def impulses(self, motion: Motion) -> Array:
        """None (m, 1): a displacement has no impulses."""
        return np.zeros((len(motion), 1))


def _check(machine: Any, sensor: Any, where: str) -> None:
    known = [joint.name for joint in machine.bearings]
    check_joint(where, sensor.joint, known, 'joint with a pin loose in a bushing')


register(
    SensorKind(
        'displacement_probe',
        ProbeKeys,
        needs=('joint',),
        quantity='displacement',
        source=lambda machine, sensor: Probe(
            machine.mechanism, machine.mechanism.joint(sensor.joint), sensor.direction
        ),
        carrier=lambda machine, sensor: str(machine.mechanism.joint(sensor.joint).second),
        place=lambda machine, sensor: (
            f'in {sensor.joint}, at {sensor.direction:g} rad in the frame of the '
            f'{machine.mechanism.joint(sensor.joint).second}'
        ),
        check=_check,
    )
)
