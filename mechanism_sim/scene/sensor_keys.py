"""What a scene file says of a sensor: where it sits, and the chain behind it."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from mechanism_sim.scene.quantities import (
    Angle,
    Duration,
    Part,
    Position,
    Quantity,
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
    """Of the seismic mass; without it the transducer is ideal."""
    damping_ratio: Annotated[float, si(''), Field(ge=0.0, le=10.0)] = 0.02
    """Of the seismic mass."""
    transverse: Annotated[float, si(''), Field(gt=-1.0, lt=1.0)] = 0.0
    """Part of what is across the axis that is read, too."""


class Amplifier(Part):
    """Filters of the amplifier."""

    high_pass: Rate | None = None
    """Below it the signal fades; without it nothing does."""
    high_pass_order: Order = 1
    """Of the Butterworth filter."""
    low_pass: Rate | None = None
    """Above it the signal fades; without it nothing does."""
    low_pass_order: Order = 2
    """Of the Butterworth filter."""


class Integrator(Part):
    """The lower limit of the integrating circuit."""

    high_pass: Rate | None = None
    """Lower limit of the integrating circuit; without it there is none."""


class AntiAlias(Part):
    """The filter before sampling."""

    frequency: Rate
    """Cut-off of the Butterworth filter."""
    order: Order = 8
    """Of the filter."""


class Trigger(Part):
    """Blocks begin where the main drive passes an angle."""

    angle: Angle = 0.0
    """Of the main drive, where blocks begin."""
    samples: Annotated[int, Field(strict=True, ge=1)] | None = None
    """Of a block; without it a block ends where the next begins."""


def _reading(value: Any) -> Measure:
    """A quantity in the unit of what the sensor gives, which `Sensor` checks."""
    measure = to_si_of(value, tuple(QUANTITIES.values()))
    if not 0.0 <= measure.value < math.inf:
        raise ValueError('must be at least 0 and finite')
    return measure


Reading = Annotated[Measure, Quantity(_reading, tuple(QUANTITIES.values()))]


class Converter(Part):
    """Analogue to digital."""

    range: Reading | None = None
    """Largest magnitude, in the unit of `quantity`."""
    bits: Annotated[int, Field(strict=True, ge=1, le=32)] | None = None
    """Of the samples; only with a range."""
    jitter: Time = 0.0
    """Standard deviation of the sampling instants."""


class Hum(Part):
    """What the mains add."""

    amplitude: Reading
    """In the unit of `quantity`."""
    frequency: Rate = 50.0
    """Of the mains."""


class Noise(Part):
    """White noise of the samples, and hum."""

    rms: Reading = Measure(0.0, '')
    """Of white noise, in the unit of `quantity`."""
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    """Of noise and jitter."""
    hum: Hum | None = None
    """What the mains add."""


class Sensor(Part):
    """An accelerometer on a link, with as much of its chain as matters."""

    kind: Literal['accelerometer'] = 'accelerometer'
    """What it is."""
    link: str
    """The moving link, or the frame on springs, that carries it."""
    at: Position | Vector = 0.0
    """From the link's origin: along the link, or as [x, y] in its frame."""
    axis: Literal['along', 'across'] = 'across'
    """What it reads: along the link, or 90 degrees counterclockwise from that."""
    sample_rate: Rate = 10000.0
    """In simulated time."""
    instrument: str | None = None
    """A preset, of which what is given here replaces parts."""
    gravity: bool = False
    """Whether it reads acceleration less that of gravity."""
    transducer: Transducer = Transducer()
    """The seismic mass."""
    amplifier: Amplifier = Amplifier()
    """Its filters."""
    quantity: Literal['acceleration', 'velocity', 'displacement'] = 'acceleration'
    """What comes out: integrated never, once or twice."""
    integrator: Integrator | None = None
    """The integrating circuit; only where something is integrated."""
    anti_alias: AntiAlias | None = None
    """The filter before sampling."""
    impact_pulse: Duration | None = None
    """How long impacts last, as half a sine; without it they are impulses."""
    trigger: Trigger | None = None
    """Blocks that begin at an angle of the drive; {} is enough."""
    adc: Converter = Converter()
    """Analogue to digital."""
    noise: Noise = Noise()
    """What is added to the samples."""
    imu: bool = False
    """Whether it is published as sensor_msgs/Imu, too."""

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
