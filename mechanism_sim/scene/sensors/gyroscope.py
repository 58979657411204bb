"""Gyroscopes: the angular velocity of a link."""

from __future__ import annotations

from typing import Any

from mechanism_sim.keys.quantities import Offset
from mechanism_sim.scene.sensor_keys import SENSORS, AnalogueKeys, OnLinkKeys
from mechanism_sim.sensing.point import Attitude


@SENSORS.add('gyroscope')
class GyroscopeKeys(OnLinkKeys, AnalogueKeys):
    """A gyroscope; its reading jumps at an impact."""

    at: Offset = 0.0
    """From the link's origin; counts on elastic links, which turn with their cross-sections."""

    reads = 'angular_velocity'

    def source(self, machine: Any) -> Attitude:
        """The rotation of the cross-section at a point."""
        at = self.at if isinstance(self.at, tuple) else (self.at, 0.0)
        return Attitude(machine.mechanism, str(self.link), 1, at)

    def place(self, machine: Any) -> str:
        """Place of the sensor in words: its link."""
        return f'on the {self.link}'
