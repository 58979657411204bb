"""Excitation by a moving base, and by any periodic force as a Fourier series ([V] 6.10, 6.11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.errors import InputError
from mechanism_sim.vibration.single import Oscillator, Response

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def relative_transmissibility(oscillator: Oscillator, frequency: ArrayLike) -> ComplexArray:
    """Steady displacement of the mass against its base, per displacement of the base.

    [V] eq. 6.119 without its stray c: the mass is shaken by m w^2 Yb. 6.118 has the wrong sign.
    """
    w = np.asarray(frequency, np.float64)
    return np.asarray(oscillator.mass * w**2 * oscillator.receptance(w))


def base_excited(
    oscillator: Oscillator,
    t: ArrayLike,
    amplitude: ArrayLike,
    frequency: ArrayLike,
    displacement: ArrayLike = 0.0,
    velocity: ArrayLike = 0.0,
) -> Response:
    """Absolute motion of a mass whose base moves as Re(amplitude e^(i w t)) from t = 0 on.

    Spring and damper pass the force (k + i c w) times the base's displacement ([V] 6.10).

    Parameters
    ----------
    t : times [s], not negative
    amplitude : complex, of the base [m]
    frequency : of the base [rad/s]
    displacement, velocity : of the mass at t = 0, absolute [m, m/s]; all are broadcast
    """
    passed = oscillator.stiffness + 1j * np.asarray(frequency) * oscillator.damping
    return oscillator.forced(t, np.asarray(amplitude) * passed, frequency, displacement, velocity)


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """A periodic function, mean + sum_j Re(amplitudes[j - 1] e^(i j w t)).

    In the terms of [V] eq. 6.120 the mean is a_0/2 and an amplitude a_j - i b_j.
    """

    frequency: float  #: w of the first harmonic [rad/s]
    mean: float
    amplitudes: ComplexArray  #: (harmonics,)

    @classmethod
    def of_samples(cls, samples: ArrayLike, period: float) -> Self:
        """Through N equidistant samples of one period, whose last is a step before its end.

        Harmonics up to (N - 1)/2: what a function contains beyond them is folded back.

        Raises
        ------
        InputError
            If there are no samples in one row, or no period.
        """
        y = np.asarray(samples, np.float64)
        if y.ndim != 1 or not len(y) or not period > 0.0:
            raise InputError('a Fourier series needs the samples of one period, and its length')
        spectrum = np.fft.rfft(y) / len(y)
        kept = (len(y) - 1) // 2
        return cls(2.0 * np.pi / period, float(spectrum[0].real), 2.0 * spectrum[1 : kept + 1])

    @classmethod
    def of_function(
        cls,
        function: Callable[[Array], Array],
        period: float,
        harmonics: int,
        breaks: Sequence[float] = (),
    ) -> Self:
        """By quadrature of [V] eqs. 6.121, 6.122.

        Parameters
        ----------
        function : of times (N,) [s]; smooth but for the breaks
        period : [s]
        harmonics : so many
        breaks : times inside the period at which the function jumps or bends [s]

        Raises
        ------
        InputError
            If there is no period, or a break is not inside of it.
        """
        if not period > 0.0 or harmonics < 0 or any(not 0.0 < b < period for b in breaks):
            raise InputError('a Fourier series needs a period, and breaks inside of it')
        ends = np.array([0.0, *sorted(breaks), period])
        nodes, weights = np.polynomial.legendre.leggauss(2 * harmonics + 40)
        half = np.diff(ends)[:, None] / 2.0
        t = (ends[:-1, None] + half * (1.0 + nodes)).ravel()
        values = np.ravel(half * weights) * function(t)
        w = 2.0 * np.pi / period
        phases = np.exp(-1j * w * np.outer(np.arange(1, harmonics + 1), t))
        return cls(w, float(values.sum()) / period, 2.0 / period * (phases @ values))

    @property
    def frequencies(self) -> Array:
        """Of the harmonics [rad/s]: j w, where [V] eqs. 6.128 to 6.133 have w in all of them."""
        return self.frequency * np.arange(1.0, len(self.amplitudes) + 1.0)

    def __call__(self, t: ArrayLike) -> Array:
        """Values at times t [s], of any shape."""
        t = np.asarray(t, np.float64)
        phases = np.exp(1j * t[..., None] * self.frequencies)
        return np.asarray(self.mean + (phases @ self.amplitudes).real)

    def passed(self, response: Callable[[Array], ComplexArray]) -> FourierSeries:
        """The series behind a linear system, given by its frequency response at w (N,) [rad/s]."""
        constant = complex(response(np.zeros(1))[0])
        amplitudes = self.amplitudes * response(self.frequencies)
        return FourierSeries(self.frequency, self.mean * constant.real, amplitudes)


def periodic_response(
    oscillator: Oscillator,
    t: ArrayLike,
    force: FourierSeries,
    displacement: float = 0.0,
    velocity: float = 0.0,
) -> Response:
    """Response to a periodic force [N] from t = 0 on: the sum over its harmonics ([V] 6.11).

    The steady part alone is ``force.passed(oscillator.receptance)``, where a cosine is answered by
    a cosine: [V] eq. 6.128 answers it by a sine.
    """
    t = np.asarray(t, np.float64)
    frequencies = np.concatenate([[0.0], force.frequencies])
    amplitudes = np.concatenate([[force.mean], force.amplitudes])
    parts = oscillator.forced(t[..., None], amplitudes, frequencies)
    free = oscillator.free(t, displacement, velocity)
    return Response(
        free.displacement + parts.displacement.sum(axis=-1),
        free.velocity + parts.velocity.sum(axis=-1),
    )
