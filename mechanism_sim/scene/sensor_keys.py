"""What a scene file says of a sensor: where it sits, and the chain behind it."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from mechanism_sim.scene.quantities import (
    Angle,
    Duration,
    Part,
    Position,
    Rate,
    Time,
    si,
)
from mechanism_sim.sensing import chain
from mechanism_sim.sensing.presets import PRESETS
from mechanism_sim.units import Measure, to_si_of

Order = Annotated[int, Field(strict=True, ge=1, le=12)]
Vector = tuple[Position, Position]
QUANTITIES = {'acceleration': 'm/s^2', 'velocity': 'm/s', 'displacement': 'm'}
"""What a sensor can give, by how often acceleration is integrated, and its unit."""


class Transducer(Part):
    """The seismic mass."""

    natural_frequency: Rate | None = None
    damping_ratio: Annotated[float, si(''), Field(ge=0.0, le=10.0)] = 0.02
    transverse: Annotated[float, si(''), Field(gt=-1.0, lt=1.0)] = 0.0


class Amplifier(Part):
    """Filters of the amplifier."""

    high_pass: Rate | None = None
    high_pass_order: Order = 1
    low_pass: Rate | None = None
    low_pass_order: Order = 2


class Integrator(Part):
    """The lower limit of the integrating circuit."""

    high_pass: Rate | None = None


class AntiAlias(Part):
    """The filter before sampling."""

    frequency: Rate
    order: Order = 8


class Trigger(Part):
    """Blocks begin where the main drive passes an angle."""

    angle: Angle = 0.0
    samples: Annotated[int, Field(strict=True, ge=1)] | None = None


def _reading(value: Any) -> Measure:
    """A quantity in the unit of what the sensor gives, which `Sensor` checks."""
    measure = to_si_of(value, tuple(QUANTITIES.values()))
    if not 0.0 <= measure.value < math.inf:
        raise ValueError('must be at least 0 and finite')
    return measure


Reading = Annotated[Measure, BeforeValidator(_reading)]


class Converter(Part):
    """Analogue to digital."""

    range: Reading | None = None
    bits: Annotated[int, Field(strict=True, ge=1, le=32)] | None = None
    jitter: Time = 0.0


class Hum(Part):
    """What the mains add."""

    amplitude: Reading
    frequency: Rate = 50.0


class Noise(Part):
    """White noise of the samples, and hum."""

    rms: Reading = Measure(0.0, '')
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    hum: Hum | None = None


class Sensor(Part):
    """An accelerometer on a link, with as much of its chain as matters."""

    kind: Literal['accelerometer'] = 'accelerometer'
    link: str
    at: Position | Vector = 0.0  #: from the link's origin, along it or as a vector
    axis: Literal['along', 'across'] = 'across'
    sample_rate: Rate = 10000.0
    instrument: str | None = None  #: a preset, of which what is given here overrides parts
    gravity: bool = False  #: reads acceleration less that of gravity
    transducer: Transducer = Transducer()
    amplifier: Amplifier = Amplifier()
    quantity: Literal['acceleration', 'velocity', 'displacement'] = 'acceleration'
    integrator: Integrator | None = None
    anti_alias: AntiAlias | None = None
    impact_pulse: Duration | None = None
    trigger: Trigger | None = None
    adc: Converter = Converter()
    noise: Noise = Noise()
    imu: bool = False  #: also published as sensor_msgs/Imu

    @model_validator(mode='before')
    @classmethod
    def _preset(cls, data: Any) -> Any:
        """Fill in what the instrument named here is like."""
        name = data.get('instrument') if isinstance(data, dict) else None
        if name is None:
            return data
        if name not in PRESETS:
            raise ValueError(
                f"has the unknown instrument '{name}': known are {', '.join(sorted(PRESETS))}"
            )
        return _merged(PRESETS[name], data)

    @model_validator(mode='after')
    def _sense(self) -> Sensor:
        if self.integrator and self.quantity == 'acceleration':
            raise ValueError(
                "has an integrator, but 'quantity' is acceleration: make it velocity or "
                'displacement, or leave the integrator out'
            )
        if self.imu and self.quantity != 'acceleration':
            raise ValueError(f"has 'imu', which shows acceleration, but measures {self.quantity}")
        if self.adc.jitter * self.sample_rate > 0.1:
            raise ValueError(
                f'has adc.jitter = {self.adc.jitter:g} s: it must be at most a tenth of the '
                f'sampling period, {0.1 / self.sample_rate:g} s'
            )
        if self.adc.bits and self.adc.range is None:
            raise ValueError('has adc.bits without adc.range: the steps have no size')
        hum = self.noise.hum
        for key, reading in (
            ('adc.range', self.adc.range),
            ('noise.rms', self.noise.rms),
            ('noise.hum.amplitude', hum.amplitude if hum else None),
        ):
            unit = QUANTITIES[self.quantity]
            if reading and reading.unit not in ('', unit):
                raise ValueError(
                    f'has {key} in {reading.unit}, but its quantity is {self.quantity}: '
                    f'give it in {unit}'
                )
        if self.adc.range and not self.adc.range.value:
            raise ValueError('has adc.range = 0: it must be more')
        return self

    def chain(self) -> chain.Instrument:
        """The instrument in the terms of `mechanism_sim.sensing.chain`."""
        adc, noise = self.adc, self.noise
        limit = adc.range.value if adc.range else None
        found = noise.hum
        hum = chain.Hum(found.amplitude.value, found.frequency) if found else None
        return chain.Instrument(
            sample_rate=self.sample_rate,
            transducer=chain.Transducer(**self.transducer.model_dump()),
            amplifier=chain.Amplifier(**self.amplifier.model_dump()),
            integrator=chain.Integrator(
                list(QUANTITIES).index(self.quantity),
                self.integrator.high_pass if self.integrator else None,
            ),
            anti_alias=chain.AntiAlias(**self.anti_alias.model_dump())
            if self.anti_alias
            else None,
            impact_pulse=self.impact_pulse or 0.0,
            trigger=chain.Trigger(**self.trigger.model_dump()) if self.trigger else None,
            converter=chain.Converter(limit, adc.bits, adc.jitter),
            noise=chain.Noise(noise.rms.value, noise.seed, hum),
        )


def _merged(preset: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Keys of both, those of `given` first, level by level."""
    merged = preset | given
    for key, value in preset.items():
        if isinstance(value, dict) and isinstance(given.get(key), dict):
            merged[key] = _merged(value, given[key])
    return merged
