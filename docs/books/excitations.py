"""One oscillator excited by its base, and by any periodic force ([V] 6.10, 6.11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from oscillator import FreeResponse, Oscillator

from mechanism_sim.errors import InputError
from mechanism_sim.numerics.fourier import spectrum
from mechanism_sim.vibration.periodic_forces import FourierSeries

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
_PARTS = 128  # of a period, in each of which a function is looked at 16 times


@dataclass(frozen=True, eq=False)
class PeriodicForce(FourierSeries):
    """Fourier series of a force, as input of a linear system."""

    def passed(self, response: Callable[[Array], ComplexArray]) -> PeriodicForce:
        """Series at the output of a linear system, by its frequency response at w (N,) [rad/s].

        Of the rest is known only that nothing comes of none.
        """
        constant = complex(response(np.zeros(1))[0])
        gains = np.asarray(response(self.frequencies))
        most = max(abs(constant), float(np.abs(gains).max(initial=0.0)))
        rest = 0.0 if self.rest == 0.0 else np.inf
        mean = self.mean * constant.real
        return PeriodicForce(
            self.frequency, mean, self.amplitudes * gains, self.error * most, rest
        )


def series_of(
    function: Callable[[Array], Array],
    period: float,
    harmonics: int,
    breaks: Sequence[float] = (),
) -> PeriodicForce:
    """A periodic function as a series, [V] eqs. 6.121, 6.122; see `numerics.fourier`.

    Parameters
    ----------
    function : of times (N,) [s]; smooth but for the breaks, no feature shorter than a
        thousandth of the period between them
    period : [s]
    harmonics : so many
    breaks : times inside the period at which the function jumps or bends [s]
    """
    if not period > 0.0 or harmonics < 0 or any(not 0.0 < b < period for b in breaks):
        raise InputError('a Fourier series needs a period, and breaks inside of it')
    edges = np.union1d(np.linspace(0.0, period, _PARTS + 1), np.asarray(breaks, float))
    found = spectrum(lambda t: np.asarray(function(t))[None], edges, harmonics)
    return PeriodicForce(
        2.0 * np.pi / period,
        float(found.mean[0]),
        found.amplitudes[0],
        float(found.error[0]),
        float(found.rest[0]),
    )


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
) -> FreeResponse:
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


def periodic_response(
    oscillator: Oscillator,
    t: ArrayLike,
    force: PeriodicForce,
    displacement: float = 0.0,
    velocity: float = 0.0,
) -> FreeResponse:
    """Response to a periodic force [N] from t = 0 on: the sum over its harmonics ([V] 6.11).

    The steady part alone is ``force.passed(oscillator.receptance)``, where a cosine is answered by
    a cosine: [V] eq. 6.128 answers it by a sine.
    """
    t = np.asarray(t, np.float64)
    frequencies = np.concatenate([[0.0], force.frequencies])
    amplitudes = np.concatenate([[force.mean], force.amplitudes])
    parts = oscillator.forced(t[..., None], amplitudes, frequencies)
    free = oscillator.free(t, displacement, velocity)
    return FreeResponse(
        free.displacement + parts.displacement.sum(axis=-1),
        free.velocity + parts.velocity.sum(axis=-1),
    )
