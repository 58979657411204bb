"""One degree of freedom: free and forced, transient and steady, for any damping ([V] 6.2 to 6.8).

    m y'' + c y' + k y = F,    y'' + 2 a y' + wn^2 y = F/m,    a = c/2m = xi wn

The roots of the characteristic equation, [V] eq. 6.21, are complex (underdamped), equal (critical
damping) or real (overdamped). One formula holds for all, and at resonance too (`exponentials`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from exponentials import first_difference, second_difference
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.errors import InputError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class FreeResponse(NamedTuple):
    """Motion over time."""

    displacement: Array  #: [m or rad]
    velocity: Array  #: [m/s or rad/s]


@dataclass(frozen=True, eq=False)
class Oscillator:
    """A mass on a spring and a damper; or many at once: the fields may be arrays that broadcast.

    Natural frequency and rate of decay are what is kept, so that nothing is lost where the one is
    close to the other (critical damping), or to the frequency of a force (resonance).
    """

    natural_frequency: float | Array  #: wn = sqrt(k/m) [rad/s]; 0 without a spring
    decay_rate: float | Array = 0.0  #: a = c/2m = xi wn [1/s]
    mass: float | Array = 1.0  #: [kg], or moment of inertia [kg m^2]

    def __post_init__(self) -> None:
        for name in ('natural_frequency', 'decay_rate', 'mass'):
            value = np.asarray(getattr(self, name))
            if not np.isfinite(value).all() or (value < 0.0).any():
                words = name.replace('_', ' ')
                raise InputError(f'the {words} of an oscillator is a number, and not negative')
        if (np.asarray(self.mass) == 0.0).any():
            raise InputError('an oscillator needs a mass')

    @classmethod
    def of_coefficients(cls, mass: float, damping: float, stiffness: float) -> Self:
        """From m [kg], c [N s/m] and k [N/m], [V] eq. 6.17."""
        if not mass > 0.0 or not stiffness >= 0.0:
            raise InputError('an oscillator needs a mass, and a stiffness that is not negative')
        return cls(float(np.sqrt(stiffness / mass)), damping / (2.0 * mass), mass)

    @classmethod
    def of_ratio(cls, natural_frequency: float, damping_ratio: float, mass: float = 1.0) -> Self:
        """From wn [rad/s] and xi, 1 for critical damping, [V] eq. 6.16."""
        return cls(natural_frequency, damping_ratio * natural_frequency, mass)

    @property
    def damping(self) -> float | Array:
        """Coefficient c of the damper [N s/m]."""
        return 2.0 * self.mass * self.decay_rate

    @property
    def stiffness(self) -> float | Array:
        """Stiffness k of the spring [N/m]."""
        return self.mass * self.natural_frequency**2

    @property
    def damping_ratio(self) -> Array:
        """The book's xi, [V] eq. 6.17; infinite without a spring, NaN without a damper too."""
        with np.errstate(divide='ignore', invalid='ignore'):
            return np.asarray(np.divide(self.decay_rate, self.natural_frequency))

    @property
    def period(self) -> Array:
        """Of free vibrations without damping [s], [V] eq. 6.7; eq. 6.8 inverts it wrongly."""
        with np.errstate(divide='ignore'):
            return np.asarray(np.divide(2.0 * np.pi, self.natural_frequency))

    @property
    def damped_frequency(self) -> Array:
        """Frequency of free vibrations [rad/s], [V] eq. 6.76; NaN where there is no vibration."""
        wn, a = np.asarray(self.natural_frequency), np.asarray(self.decay_rate)
        square = (wn - a) * (wn + a)
        return np.sqrt(np.where(square > 0.0, square, np.nan))

    @property
    def roots(self) -> tuple[ComplexArray, ComplexArray]:
        """Roots of the characteristic equation [1/s], [V] eq. 6.21: slower first, or conjugate."""
        wn, a = np.broadcast_arrays(self.natural_frequency, self.decay_rate)
        square = (wn - a) * (wn + a)
        spread = np.sqrt(np.abs(square))
        sum_ = a + spread
        with np.errstate(divide='ignore', invalid='ignore'):
            slow = np.where(sum_ > 0.0, -wn * (wn / sum_), 0.0)  # -a + spread would cancel
        real = square <= 0.0
        return (
            np.where(real, slow + 0j, -a + 1j * spread),
            np.where(real, -sum_ + 0j, -a - 1j * spread),
        )

    def free(
        self, t: ArrayLike, displacement: ArrayLike, velocity: ArrayLike = 0.0
    ) -> FreeResponse:
        """Free vibration from initial displacement and velocity ([V] 6.3, 6.6).

        Parameters
        ----------
        t : times [s], not negative
        displacement, velocity : at t = 0 [m, m/s]; all are broadcast
        """
        slow, fast = self.roots
        y0, v0, t = np.asarray(displacement), np.asarray(velocity), np.asarray(t, np.float64)
        rest = v0 - slow * y0
        y = (y0 * np.exp(slow * t) + rest * first_difference(slow, fast, t)).real
        return FreeResponse(y, (slow * y + rest * np.exp(fast * t)).real)

    def forced(
        self,
        t: ArrayLike,
        force: ArrayLike,
        frequency: ArrayLike,
        displacement: ArrayLike = 0.0,
        velocity: ArrayLike = 0.0,
    ) -> FreeResponse:
        """Response to a harmonic force from t = 0 on ([V] 6.4, 6.7), at any frequency.

        Parameters
        ----------
        t : times [s], not negative
        force : complex amplitude [N]; P0 for P0 cos(w t), -i P0 for P0 sin(w t)
        frequency : w of the force [rad/s], not negative; 0 for a constant force
        displacement, velocity : at t = 0 [m, m/s]; all are broadcast
        """
        w, t = np.asarray(frequency, np.float64), np.asarray(t, np.float64)
        strength = np.asarray(force) / self.mass
        near, far = self._roots_from(w)
        carrier = np.exp(1j * w * t)
        answer = carrier * second_difference(near, far, 0.0, t)
        # the rate is x times the answer and the difference over the others, for any of the three
        # nodes x: the smallest, so that a standstill comes out as one
        slow, fast = self.roots
        rate = np.where(
            w < np.abs(slow),
            1j * w * answer + first_difference(slow, fast, t),
            slow * answer + carrier * first_difference(far, 0.0, t),
        )
        free = self.free(t, displacement, velocity)
        return FreeResponse(
            free.displacement + (strength * answer).real, free.velocity + (strength * rate).real
        )

    def receptance(self, frequency: ArrayLike) -> ComplexArray:
        """Steady displacement per force [m/N], [V] eq. 6.94; infinite at undamped resonance.

        Its angle is minus the phase lag: [V] eq. 6.98 takes the angle of 6.97 with the wrong sign.
        """
        w = np.asarray(frequency, np.float64)
        denominator = np.asarray(self.mass * (self._detuning(w) + 2j * self.decay_rate * w))
        none = denominator == 0.0
        return np.where(none, np.inf, 1.0 / np.where(none, 1.0, denominator))

    def steady(self, t: ArrayLike, force: ArrayLike, frequency: ArrayLike) -> FreeResponse:
        """Steady vibration under a harmonic force, as `forced` ([V] 6.5, 6.8)."""
        w = np.asarray(frequency, np.float64)
        y = np.asarray(force) * self.receptance(w) * np.exp(1j * w * np.asarray(t))
        return FreeResponse(y.real, (1j * w * y).real)

    def phase_lag(self, frequency: ArrayLike) -> Array:
        """How far the steady response lags behind the force [rad], 0 to pi.

        [V] eq. 6.90, whose arctangent is negative above resonance: there, too, the response lags.
        """
        w = np.asarray(frequency, np.float64)
        return np.asarray(np.arctan2(2.0 * self.decay_rate * w, self._detuning(w)))

    @property
    def peak_frequency(self) -> Array:
        """Where the steady displacement is greatest [rad/s]: wn sqrt(1 - 2 xi^2), or 0."""
        wn, a = np.asarray(self.natural_frequency), np.asarray(self.decay_rate)
        least = np.sqrt(2.0) * a
        return np.asarray(np.sqrt(np.maximum((wn - least) * (wn + least), 0.0)))

    @property
    def peak_receptance(self) -> Array:
        """Greatest displacement per force [m/N], [V] eq. 6.91 with sqrt(1 - xi^2)."""
        return np.abs(self.receptance(self.peak_frequency))

    def transmissibility(self, frequency: ArrayLike) -> ComplexArray:
        """Displacement per displacement of the base; force on the base per force ([V] 6.10)."""
        w = np.asarray(frequency, np.float64)
        return np.asarray((self.stiffness + 1j * w * self.damping) * self.receptance(w))

    def _roots_from(self, w: Array) -> tuple[ComplexArray, ComplexArray]:
        """The roots less i w; near resonance the difference would cancel in the first."""
        slow, fast = self.roots
        a, wn = np.asarray(self.decay_rate), np.asarray(self.natural_frequency)
        weak = a < wn / 2.0  # there the distance may be far less than the frequencies
        sum_ = np.where(weak, slow.imag + w, 1.0)
        near = np.where(weak, (self._detuning(w) - a**2) / sum_, slow.imag - w)
        return slow.real + 1j * near, fast - 1j * w

    def _detuning(self, w: Array) -> Array:
        """wn^2 - w^2, also where they are close."""
        wn = np.asarray(self.natural_frequency)
        return np.asarray((wn - w) * (wn + w))
