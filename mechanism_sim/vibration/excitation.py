"""Periodic excitation as a Fourier series ([V] 6.11)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """A periodic function, mean + sum_j Re(amplitudes[j - 1] e^(i j w t)) and a rest.

    In the terms of [V] eq. 6.120 the mean is a_0/2 and an amplitude a_j - i b_j.
    """

    frequency: float  #: w of the first harmonic [rad/s]
    mean: float
    amplitudes: ComplexArray  #: (harmonics,)
    error: float = 0.0  #: what the mean and each amplitude may be off
    rest: float = 0.0  #: root mean square of all higher harmonics together, at most

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
        """The series behind a linear system, given by its frequency response at w (N,) [rad/s].

        Of the rest is known only that nothing comes of none.
        """
        constant = complex(response(np.zeros(1))[0])
        gains = np.asarray(response(self.frequencies))
        most = max(abs(constant), float(np.abs(gains).max(initial=0.0)))
        rest = 0.0 if self.rest == 0.0 else np.inf
        mean = self.mean * constant.real
        return FourierSeries(
            self.frequency, mean, self.amplitudes * gains, self.error * most, rest
        )
