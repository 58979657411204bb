"""Draw-wire sensors: the distance of two points, by the length of a wire between them."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import Reference
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.scene.sensor_keys import SENSORS, AnalogueKeys
from mechanism_sim.sensing.channel import DirectSource


class WireLength(DirectSource):
    """A source: the distance of two points of links of a mechanism."""

    def __init__(self, mechanism: Mechanism, ends: tuple[LinkPoint, LinkPoint]) -> None:
        self._mechanism, self._ends = mechanism, ends

    def reading(self, q: Array) -> Array:
        """Length (N,) [m]."""
        a, b = (self._mechanism.trace(end, q)[0] for end in self._ends)
        return np.asarray(np.hypot(*(b - a)))


@SENSORS.add('draw_wire')
class DrawWireKeys(AnalogueKeys):
    """A draw-wire sensor: its case at one point, the end of its wire at another."""

    between: Reference | None = None
    """Required: the points, LINK.POINT, between which its wire is taut."""

    needs: ClassVar[tuple[str, ...]] = ('between',)
    reads = 'displacement'

    def _ends(self, machine: Any, where: str = '') -> tuple[LinkPoint, LinkPoint]:
        a, b = (machine.plan.find(f'{where}.between', end) for end in self.between or ())
        return a, b

    def source(self, machine: Any) -> WireLength:
        """The length of the wire."""
        return WireLength(machine.mechanism, self._ends(machine))

    def carrier(self, machine: Any) -> str:
        """The link of its case."""
        return self._ends(machine)[0][0]

    def place(self, machine: Any) -> str:
        """Ends of the wire in words."""
        return 'from {} to {}'.format(*self.between or ())

    def check(self, machine: Any, where: str) -> None:
        """Refuse points that there are not, or that cannot move apart."""
        a, b = self._ends(machine, where)
        if a[0] == b[0]:
            raise InputError(f'{where}.between: both points are of {a[0]}: name two links')
