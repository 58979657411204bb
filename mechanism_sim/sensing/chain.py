"""A measurement chain as one transfer function: transducer, amplifier, integrator, filter.

After [SB] 7.2 (accelerometer, conditioning amplifier with filters and integrator, data
acquisition); what follows the last filter is in `mechanism_sim.sensing.sampling`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import scipy

from mechanism_sim.numerics.rational import Rational

TWO_PI = 2.0 * math.pi


@dataclass(frozen=True)
class Transducer:
    """A seismic mass on a spring: what it shows is its deflection times the square of omega_n.

    Attributes
    ----------
    natural_frequency : [Hz]
    damping_ratio : of the seismic mass
    transverse : part of the acceleration across the axis that is read, too
    """

    natural_frequency: float | None = None
    damping_ratio: float = 0.02
    transverse: float = 0.0

    def transfer(self) -> Rational:
        """``omega^2 / (s^2 + 2 zeta omega s + omega^2)``, of acceleration to reading."""
        if self.natural_frequency is None:
            return Rational()
        omega, zeta = TWO_PI * self.natural_frequency, self.damping_ratio
        root = omega * abs(1.0 - zeta**2) ** 0.5
        apart = complex(0.0, root) if zeta < 1.0 else complex(root, 0.0)
        return Rational((), (-zeta * omega + apart, -zeta * omega - apart), omega**2)


@dataclass(frozen=True)
class Amplifier:
    """A charge amplifier: Butterworth filters of given orders; corner frequencies in Hz."""

    high_pass: float | None = None
    high_pass_order: int = 1
    low_pass: float | None = None
    low_pass_order: int = 2

    def transfer(self) -> Rational:
        """Of both filters; at the corner frequencies 3 dB are lost."""
        low = butterworth(self.low_pass, self.low_pass_order, 'lowpass')
        return butterworth(self.high_pass, self.high_pass_order, 'highpass') * low


@dataclass(frozen=True)
class Integrator:
    """Integrates once for velocity, twice for displacement.

    Attributes
    ----------
    times : how often
    high_pass : [Hz] its lower limit; without one it is a pure integral
    """

    times: int = 0
    high_pass: float | None = None

    def transfer(self) -> Rational:
        """``1 / (s + omega)`` for each time, omega of the lower limit."""
        return Rational((), (complex(-TWO_PI * (self.high_pass or 0.0)),) * self.times)


@dataclass(frozen=True)
class AntiAlias:
    """The filter before sampling: Butterworth; corner frequency in Hz."""

    frequency: float
    order: int = 8

    def transfer(self) -> Rational:
        """Of the filter."""
        return butterworth(self.frequency, self.order, 'lowpass')


@dataclass(frozen=True)
class Trigger:
    """Every block begins where the main drive passes an angle.

    Attributes
    ----------
    angle : [rad]
    samples : of a block; without, a block ends where the next begins
    """

    angle: float = 0.0
    samples: int | None = None


@dataclass(frozen=True)
class Converter:
    """Analogue to digital.

    Attributes
    ----------
    range : largest magnitude that is shown, in units of what is measured
    bits : of the converter, which has 2^bits steps from -range to range
    jitter : [s] standard deviation of the sampling instants, less than half a period
    """

    range: float | None = None
    bits: int | None = None
    jitter: float = 0.0


@dataclass(frozen=True)
class Hum:
    """Hum of the mains; amplitude in units of what is measured, frequency in Hz."""

    amplitude: float
    frequency: float = 50.0


@dataclass(frozen=True)
class Noise:
    """White noise of the samples, of a standard deviation in units of what is measured."""

    rms: float = 0.0
    seed: int = 0
    hum: Hum | None = None


@dataclass(frozen=True)
class Instrument:
    """All of an instrument; its default is ideal.

    Attributes
    ----------
    sample_rate : [Hz]
    impact_pulse : [s] how long an impact lasts, as half of a sine; 0: an impulse
    """

    sample_rate: float
    transducer: Transducer = Transducer()
    amplifier: Amplifier = Amplifier()
    integrator: Integrator = Integrator()
    anti_alias: AntiAlias | None = None
    impact_pulse: float = 0.0
    trigger: Trigger | None = None
    converter: Converter = Converter()
    noise: Noise = Noise()

    def stages(self) -> dict[str, Rational]:
        """The transfer functions of the stages, in the order of the signal."""
        return {
            'transducer': self.transducer.transfer(),
            'amplifier': self.amplifier.transfer(),
            'integrator': self.integrator.transfer(),
            'anti_alias': self.anti_alias.transfer() if self.anti_alias else Rational(),
        }

    def transfer(self) -> Rational:
        """Of acceleration [m/s^2] to what is sampled [m/s^2, m/s or m]."""
        product = Rational()
        for stage in self.stages().values():
            product = product * stage
        return product


def butterworth(frequency: float | None, order: int, kind: str) -> Rational:
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
