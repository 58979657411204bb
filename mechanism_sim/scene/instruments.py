"""The measured channels and inertial units of a machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mechanism_sim.scene.dynamic_model import DynamicModel
from mechanism_sim.scene.oscillators import forces_on, read_frame
from mechanism_sim.scene.sensor_keys import QUANTITIES, Sensor
from mechanism_sim.sensing.channel import Channel, Source
from mechanism_sim.sensing.frame_point import PointOnFrame
from mechanism_sim.sensing.imu import InertialUnit
from mechanism_sim.sensing.point import PointOnLink


def channel(machine: DynamicModel, name: str, beside: Channel | None = None) -> Channel:
    """The channel of a sensor of the scene, from the start of a run on.

    It may share the analogue part of another that differs in sampling, converter or noise only.

    Raises
    ------
    KeyError
        If there is no such sensor.
    InputError
        If it is on a frame, and what shakes that is not known.
    """
    chain = machine.scene.sensors[name].chain()
    return Channel(source(machine, name), chain, name, _drive(machine, name), beside)


def source(machine: DynamicModel, name: str) -> Source:
    """What a sensor of the scene is mounted on, from the start of a run on.

    Raises
    ------
    KeyError
        If there is no such sensor.
    InputError
        If it is on a frame, and what shakes that is not known.
    """
    sensor, mechanism = machine.scene.sensors[name], machine.mechanism
    transverse = sensor.transducer.transverse
    if sensor.link in machine.scene.oscillators:
        frame, forces = read_frame(machine, sensor.link), forces_on(machine, sensor.link)
        at = sensor.at if isinstance(sensor.at, tuple) else (sensor.at, 0.0)
        gravity = mechanism.gravity if sensor.gravity else (0.0, 0.0)
        return PointOnFrame(frame, forces, at, sensor.axis, gravity, transverse)
    return PointOnLink(mechanism, sensor.link, sensor.at, sensor.axis, sensor.gravity, transverse)


def inertial_unit(machine: DynamicModel, name: str) -> InertialUnit:
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


def _drive(machine: DynamicModel, name: str) -> int:
    """Index of the coordinate that triggers a sensor."""
    triggered = machine.scene.sensors[name].trigger
    return machine.mechanism.coordinates.index(machine.main) if triggered else 0


def sensor_notes(machine: DynamicModel) -> list[str]:
    """What the sensors of a scene are, and what lies between them and their samples."""
    notes = []
    for name, sensor in machine.scene.sensors.items():
        x, y = sensor.at if isinstance(sensor.at, tuple) else (sensor.at, 0.0)
        at = f'({x:g}, {y:g}) m' if y else f'{x:g} m'
        if sensor.link in machine.links:
            place = f'on the {sensor.link}, {at} from its origin, {sensor.axis} the link'
        else:
            way = 'x' if sensor.axis == 'along' else 'y'
            place = f'on the oscillator {sensor.link}, at {at}, along {way}'
        said = [f'{sensor.kind} {place}', f'{sensor.sample_rate:g} Hz', *_chain(sensor)]
        notes.append(f'sensor {name}: {", ".join(said)}')
    return notes


def _chain(sensor: Sensor) -> list[str]:
    """What of a sensor is not ideal."""
    transducer, amplifier, adc = sensor.transducer, sensor.amplifier, sensor.adc
    integrated = sensor.quantity != 'acceleration'
    lower = sensor.integrator.high_pass if sensor.integrator else None
    parts: tuple[tuple[Any, Callable[[Any], str]], ...] = (
        (transducer.natural_frequency, lambda f: f'transducer of {f:g} Hz'),
        (amplifier.high_pass, lambda f: f'high-pass {f:g} Hz'),
        (amplifier.low_pass, lambda f: f'low-pass {f:g} Hz'),
        (integrated, lambda _: f'integrated to {sensor.quantity}'),
        (lower, lambda f: f'from {f:g} Hz on'),
        (sensor.anti_alias, lambda a: f'anti-alias filter {a.frequency:g} Hz'),
        (sensor.impact_pulse, lambda s: f'impacts last {s:g} s'),
        (sensor.trigger, lambda t: f'triggered at {t.angle:g} rad'),
        (adc.range, lambda r: f'range {r.value:g} {QUANTITIES[sensor.quantity]}'),
        (adc.bits, lambda n: f'{n} bits'),
        (adc.jitter, lambda s: f'jitter {s:g} s'),
        (sensor.noise.rms.value, lambda x: f'noise {x:g} {QUANTITIES[sensor.quantity]}'),
        (sensor.noise.hum, lambda h: f'hum {h.amplitude.value:g} at {h.frequency:g} Hz'),
    )
    return [say(value) for value, say in parts if value] or ['ideal: no impacts in it']
