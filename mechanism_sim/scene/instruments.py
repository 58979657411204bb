"""The measured channels and inertial units of a machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.scene.dynamic_model import DynamicModel
from mechanism_sim.scene.schema import SensorPart
from mechanism_sim.scene.sensors import SENSORS
from mechanism_sim.sensing.channel import Channel, Source
from mechanism_sim.sensing.imu import InertialUnit

_SHOCKS = 'acceleration', 'force'
"""What impacts make impulses of, which samples without a filter do not show."""


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
    sensor = machine.scene.sensors[name]
    return SENSORS[sensor.kind].source(machine, sensor)


def carrier(machine: DynamicModel, name: str) -> str:
    """The link or frame that carries a sensor of the scene.

    Raises
    ------
    KeyError
        If there is no such sensor.
    """
    sensor = machine.scene.sensors[name]
    return SENSORS[sensor.kind].carrier(machine, sensor)


def check_sensors(machine: DynamicModel) -> None:
    """Refuse sensors that are nowhere on this machine."""
    for name, sensor in machine.scene.sensors.items():
        where = f'{machine.name}: sensors.{name}'
        if not name.isidentifier():
            raise InputError(
                f"{machine.name}: the sensor name '{name}' must be letters, digits and _"
            )
        SENSORS[sensor.kind].check(machine, sensor, where)
        if sensor.trigger and machine.main in machine.mechanism.displacements:
            raise InputError(f'{where}.trigger needs a drive that turns; {machine.main} slides')


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
        place = SENSORS[sensor.kind].place(machine, sensor)
        said = [f'{sensor.kind} {place}', f'{sensor.sample_rate:g} Hz', *_chain(sensor)]
        notes.append(f'sensor {name}: {", ".join(said)}')
    return notes


def _chain(sensor: SensorPart) -> list[str]:
    """What of a sensor is not ideal."""
    transducer, amplifier, adc = sensor.transducer, sensor.amplifier, sensor.adc
    integrated = sensor.quantity != 'acceleration'
    ideal = ['ideal: no impacts in it'] if sensor.measures in _SHOCKS else ['ideal']
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
        (adc.range, lambda r: f'range {r.value:g} {sensor.unit}'),
        (adc.bits, lambda n: f'{n} bits'),
        (adc.jitter, lambda s: f'jitter {s:g} s'),
        (sensor.noise.rms.value, lambda x: f'noise {x:g} {sensor.unit}'),
        (sensor.noise.hum, lambda h: f'hum {h.amplitude.value:g} at {h.frequency:g} Hz'),
    )
    return [say(value) for value, say in parts if value] or ideal
