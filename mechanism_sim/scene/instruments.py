"""The measured channels and inertial units of a machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.imu import InertialUnit
from mechanism_sim.sensing.point import PointOnLink

if TYPE_CHECKING:
    from mechanism_sim.scene.machine import Machine


def channel(machine: Machine, name: str, beside: Channel | None = None) -> Channel:
    """The channel of a sensor of the scene, from the start of a run on.

    It may share the analogue part of another that differs in sampling, converter or noise only.

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
    return Channel(place, sensor.chain(), name, _drive(machine, name), beside)


def inertial_unit(machine: Machine, name: str) -> InertialUnit:
    """The inertial unit where a sensor of the scene is, from the start of a run on.

    Raises
    ------
    KeyError
        If there is no such sensor.
    """
    sensor = machine.scene.sensors[name]
    return InertialUnit(
        machine.mechanism,
        sensor.link,
        sensor.at,
        sensor.axis,
        sensor.chain(),
        name,
        sensor.transducer.transverse,
        _drive(machine, name),
    )


def _drive(machine: Machine, name: str) -> int:
    """Index of the coordinate that triggers a sensor."""
    triggered = machine.scene.sensors[name].trigger
    return machine.mechanism.coordinates.index(machine.main) if triggered else 0
