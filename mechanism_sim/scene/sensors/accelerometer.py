"""Accelerometers: the acceleration of a point of a link, or of a frame on springs."""

from __future__ import annotations

import math
from typing import Any, Literal

from mechanism_sim.errors import InputError
from mechanism_sim.scene.quantities import Offset
from mechanism_sim.scene.sensor_keys import (
    Integrator,
    OnLinkKeys,
    SensorKind,
    ShockKeys,
    Transducer,
    register,
)
from mechanism_sim.scene.sensors._places import check_link
from mechanism_sim.sensing.channel import Source
from mechanism_sim.sensing.frame_point import PointOnFrame
from mechanism_sim.sensing.point import PointOnLink


class AccelerometerKeys(OnLinkKeys, ShockKeys):
    """An accelerometer, with as much of its chain as matters."""

    at: Offset = 0.0
    """From the link's origin: along the link, as [x, y] in its frame, or a point of it by name."""
    axis: Literal['along', 'across'] = 'across'
    """What it reads: along the link, or 90 degrees counterclockwise from that."""
    instrument: str | None = None
    """A preset, of which what is given here replaces parts."""
    gravity: bool = False
    """Whether it reads acceleration less that of gravity."""
    transducer: Transducer = Transducer()
    """The seismic mass."""
    quantity: Literal['acceleration', 'velocity', 'displacement'] = 'acceleration'
    """What comes out: integrated never, once or twice."""
    integrator: Integrator | None = None
    """The integrating circuit; only where something is integrated."""
    imu: bool = False
    """Whether it is published as sensor_msgs/Imu, too."""


def _source(machine: Any, sensor: Any) -> Source:
    mechanism, transverse = machine.mechanism, sensor.transducer.transverse
    if sensor.link in machine.scene.oscillators:
        frame, forces = machine.shaken_frame(sensor.link)
        at = sensor.at if isinstance(sensor.at, tuple) else (sensor.at, 0.0)
        gravity = mechanism.gravity if sensor.gravity else (0.0, 0.0)
        return PointOnFrame(frame, forces, at, sensor.axis, gravity, transverse)
    return PointOnLink(mechanism, sensor.link, sensor.at, sensor.axis, sensor.gravity, transverse)


def _place(machine: Any, sensor: Any) -> str:
    x, y = sensor.at if isinstance(sensor.at, tuple) else (sensor.at, 0.0)
    at = f'({x:g}, {y:g}) m' if y else f'{x:g} m'
    if sensor.link in machine.links:
        return f'on the {sensor.link}, {at} from its origin, {sensor.axis} the link'
    way = 'x' if sensor.axis == 'along' else 'y'
    return f'on the oscillator {sensor.link}, at {at}, along {way}'


def _check(machine: Any, sensor: Any, where: str) -> None:
    check_link(machine, where, sensor.link, machine.scene.oscillators)
    if sensor.imu and sensor.link in machine.scene.oscillators:
        raise InputError(
            f'{where}.imu is for sensors on links; {sensor.link} is a frame on springs'
        )
    at = sensor.at if isinstance(sensor.at, tuple) else (sensor.at, 0.0)
    if sensor.link in machine.links and math.hypot(*at) > 10.0 * machine.mechanism.size:
        raise InputError(
            f'{where}.at = {math.hypot(*at):g} m lies far off the {sensor.link} (the longest link '
            f'has {machine.mechanism.size:g} m)'
        )


register(
    SensorKind(
        'accelerometer',
        AccelerometerKeys,
        needs=('link',),
        quantity='',
        source=_source,
        carrier=lambda machine, sensor: str(sensor.link),  # noqa: ARG005
        place=_place,
        check=_check,
    )
)
