"""A measurement chain as one transfer function: transducer, amplifier, integrator, filter.

After [SB] 7.2 (accelerometer, conditioning amplifier with filters and integrator, data
acquisition); what follows the last filter is in `mechanism_sim.sensing.channel`. The parts of a
chain are the keys that a scene gives of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Any

import scipy
from pydantic import Field

from mechanism_sim.keys.quantities import Angle, Part, Rate, Time, UnitValue, si
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.numerics.rational import Rational
from mechanism_sim.units import QuantityValue, to_si_of

Order = Annotated[int, Field(strict=True, ge=1, le=12)]
QUANTITIES = {
    'acceleration': 'm/s^2', 'velocity': 'm/s', 'displacement': 'm', 'angular_velocity': 'rad/s',
    'angle': 'rad', 'force': 'N', 'strain': '',
}  # fmt: skip
"""Measured quantities with units; the first three by how often acceleration is integrated."""


class Transducer(Part):
    """The seismic mass on a spring; its reading is the deflection times the square of omega."""

    natural_frequency: Rate | None = None
    """Natural frequency of the seismic mass; the transducer is ideal if not given."""
    damping_ratio: Annotated[float, si(''), Field(ge=0.0, le=10.0)] = 0.02
    """Of the seismic mass."""
    transverse: Annotated[float, si(''), Field(gt=-1.0, lt=1.0)] = 0.0
    """Transverse sensitivity, relative to that along the axis."""

    def transfer(self) -> Rational:
        """``omega^2 / (s^2 + 2 zeta omega s + omega^2)``, of acceleration to reading."""
        if self.natural_frequency is None:
            return Rational()
        omega, zeta = TWO_PI * self.natural_frequency, self.damping_ratio
        root = omega * abs(1.0 - zeta**2) ** 0.5
        apart = complex(0.0, root) if zeta < 1.0 else complex(root, 0.0)
        return Rational((), (-zeta * omega + apart, -zeta * omega - apart), omega**2)


class Amplifier(Part):
    """Filters of the amplifier."""

    high_pass: Rate | None = None
    """Lower cut-off frequency; no high-pass if not given."""
    high_pass_order: Order = 1
    """Of the Butterworth filter."""
    low_pass: Rate | None = None
    """Upper cut-off frequency; no low-pass if not given."""
    low_pass_order: Order = 2
    """Of the Butterworth filter."""

    def transfer(self) -> Rational:
        """Transfer function of both filters; at the corner frequencies 3 dB are lost."""
        low = _butterworth(self.low_pass, self.low_pass_order, 'lowpass')
        return _butterworth(self.high_pass, self.high_pass_order, 'highpass') * low


class Integrator(Part):
    """An integrating circuit."""

    high_pass: Rate | None = None
    """Lower cut-off frequency of the integrating circuit; none if not given."""

    def transfer(self, times: int) -> Rational:
        """``1 / (s + omega)`` for each time, omega of the lower limit."""
        return Rational((), (complex(-TWO_PI * (self.high_pass or 0.0)),) * times)


class AntiAlias(Part):
    """The filter before sampling."""

    frequency: Rate
    """Cut-off of the Butterworth filter."""
    order: Order = 8
    """Of the filter."""

    def transfer(self) -> Rational:
        """Transfer function of the filter."""
        return _butterworth(self.frequency, self.order, 'lowpass')


class Trigger(Part):
    """Blocks begin where the main drive passes an angle."""

    angle: Angle = 0.0
    """Of the main drive, where blocks begin."""
    samples: Annotated[int, Field(strict=True, ge=1)] | None = None
    """Of a block; without it a block ends where the next begins."""


def _reading(value: Any) -> QuantityValue:
    """A quantity in the unit of the measured one, which the sensor checks."""
    measure = to_si_of(value, tuple(QUANTITIES.values()))
    if not 0.0 <= measure.value < math.inf:
        raise ValueError('must be at least 0 and finite')
    return measure


Reading = Annotated[QuantityValue, UnitValue(_reading, tuple(QUANTITIES.values()))]


class Converter(Part):
    """Analogue-to-digital converter."""

    range: Reading | None = None
    """Largest magnitude, in the unit of the measured quantity."""
    bits: Annotated[int, Field(strict=True, ge=1, le=32)] | None = None
    """Of the samples; only with a range."""
    jitter: Time = 0.0
    """Standard deviation of the sampling instants."""

    @property
    def step(self) -> float:
        """Distance of two of its 2^bits levels from -range to range; 0 if samples are exact."""
        return 2.0 * self.range.value / 2**self.bits if self.range and self.bits else 0.0


class Hum(Part):
    """Mains hum."""

    amplitude: Reading
    """In the unit of the measured quantity."""
    frequency: Rate = 50.0
    """Of the mains."""


class Noise(Part):
    """White noise of the samples, and hum."""

    rms: Reading = QuantityValue(0.0, '')
    """Of white noise, in the unit of the measured quantity."""
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    """Of noise and jitter."""
    hum: Hum | None = None
    """Mains hum."""


@dataclass(frozen=True)
class Instrument:
    """All of an instrument; its default is ideal."""

    sample_rate: float  #: [Hz]
    transducer: Transducer = field(default_factory=Transducer)
    amplifier: Amplifier = field(default_factory=Amplifier)
    #: one of `QUANTITIES`; acceleration is integrated for velocity and displacement
    quantity: str = 'acceleration'
    integrator: Integrator | None = None
    anti_alias: AntiAlias | None = None
    #: [s] how long an impact lasts, as half of a sine; without, it is an impulse
    impact_pulse: float | None = None
    trigger: Trigger | None = None
    adc: Converter = field(default_factory=Converter)
    noise: Noise = field(default_factory=Noise)

    def stages(self) -> dict[str, Rational]:
        """The transfer functions of the stages, in the order of the signal."""
        times = ('acceleration', 'velocity', 'displacement').index(self.quantity)
        return {
            'transducer': self.transducer.transfer(),
            'amplifier': self.amplifier.transfer(),
            'integrator': (self.integrator or Integrator()).transfer(times),
            'anti_alias': self.anti_alias.transfer() if self.anti_alias else Rational(),
        }

    def transfer(self) -> Rational:
        """Transfer function of acceleration [m/s^2] to the sampled signal [m/s^2, m/s or m]."""
        product = Rational()
        for stage in self.stages().values():
            product = product * stage
        return product


def _butterworth(frequency: float | None, order: int, kind: str) -> Rational:
    """A Butterworth filter, ``kind`` 'lowpass' or 'highpass', with its corner [Hz]; or nothing."""
    if frequency is None:
        return Rational()
    corner = TWO_PI * frequency
    return Rational.of(*scipy.signal.butter(order, corner, kind, analog=True, output='zpk'))


def half_sine(duration: float) -> Rational:
    """A unit impulse spread over a duration [s], as two impulses seen through an oscillator.

    ``(pi / 2 T) sin(pi t / T)`` on [0, T] has the transform ``H(s) (1 + e^(-s T))``; this is H.
    """
    omega = math.pi / duration
    return Rational((), (1j * omega, -1j * omega), 0.5 * omega**2)
