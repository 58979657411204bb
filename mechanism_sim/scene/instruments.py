"""The measured channels of a machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.point import PointOnLink

if TYPE_CHECKING:
    from mechanism_sim.scene.machine import Machine


def channel(machine: Machine, name: str) -> Channel:
    """The channel of a sensor of the scene, from the start of a run on.

    Raises
    ------
    KeyError
        If there is no such sensor.
    """
    sensor, mechanism = machine.scene.sensors[name], machine.mechanism
    place = PointOnLink(
        mechanism,
        sensor.link,
        sensor.at,
        sensor.axis,
        sensor.gravity,
        sensor.transducer.transverse,
    )
    drive = mechanism.coordinates.index(machine.main) if sensor.trigger else 0
    return Channel(place, sensor.chain(), name, drive)
