"""Gyroscopes: the angular velocity of a link."""

from __future__ import annotations

from mechanism_sim.scene.quantities import Offset
from mechanism_sim.scene.sensor_keys import (
    AnalogueKeys,
    OnLinkKeys,
    SensorKind,
    register,
)
from mechanism_sim.scene.sensors._places import check_link
from mechanism_sim.sensing.imu import Attitude


class GyroscopeKeys(OnLinkKeys, AnalogueKeys):
    """A gyroscope; at an impact what it reads jumps."""

    at: Offset = 0.0
    """From the link's origin; counts on elastic links, which turn with their cross-sections."""


register(
    SensorKind(
        'gyroscope',
        GyroscopeKeys,
        needs=('link',),
        quantity='angular_velocity',
        source=lambda machine, sensor: Attitude(
            machine.mechanism,
            sensor.link,
            1,
            sensor.at if isinstance(sensor.at, tuple) else (sensor.at, 0.0),
        ),
        carrier=lambda machine, sensor: str(sensor.link),  # noqa: ARG005
        place=lambda machine, sensor: f'on the {sensor.link}',  # noqa: ARG005
        check=lambda machine, sensor, where: check_link(machine, where, sensor.link),
    )
)
