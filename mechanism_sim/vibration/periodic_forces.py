"""The steady vibration of a linear system under periodic forces, and bounds of what it leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.numerics.fourier import PeriodicSpectrum
from mechanism_sim.vibration.systems import impedance, state_matrix

_BEYOND = 4.0  # times the largest root: from there on a system is all but its masses
_EACH = 20000  # harmonics that are looked at one by one, in search of the largest response
_SPREAD = 400  # further ones
_BLOCK = 2048
_MORE = 128  # harmonics of the forces that are known at least


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
        """Frequencies of the harmonics [rad/s]: j w, where [V] eqs. 6.128 to 6.133 have w."""
        return self.frequency * np.arange(1.0, len(self.amplitudes) + 1.0)

    def __call__(self, t: ArrayLike) -> Array:
        """Values at times t [s], of any shape."""
        t = np.asarray(t, np.float64)
        phases = np.exp(1j * t[..., None] * self.frequencies)
        return np.asarray(self.mean + (phases @ self.amplitudes).real)


def known_harmonics(count: int) -> int:
    """Number of force harmonics for the error of leaving out those beyond `count`."""
    return max(_MORE, 2 * count)


class SteadyVibration:
    """Coordinates ``B z`` (m,) where ``M z'' + C z' + K z`` (n,) are periodic forces.

    Parameters
    ----------
    forces : n of them, in more harmonics than those that are asked for
    frequency : of their first harmonic [rad/s]
    matrices : M, C, K, each (n, n)
    B : (m, n)
    mean : (m,) of the coordinates
    amplitudes : (count, m) of the coordinates
    impulses : (n,) sums of magnitudes of the impulses in a period, which are in no `rest`
    """

    def __init__(
        self,
        forces: PeriodicSpectrum,
        frequency: float,
        matrices: tuple[Array, Array, Array],
        B: Array,
        mean: Array,
        amplitudes: ComplexArray,
        impulses: Array | None = None,
    ) -> None:
        self._forces, self._w = forces, frequency
        self._M, self._C, self._K = matrices
        self._B, self._mean, self.amplitudes = B, mean, amplitudes
        self._impulses = impulses if impulses is not None and impulses.any() else None

    def series(self, row: int, order: int) -> FourierSeries:
        """A coordinate, or its rate (order 1) or acceleration (2), as a Fourier series."""
        k = np.arange(1.0, len(self.amplitudes) + 1.0)
        # a harmonic that is not excited may be a resonance
        excited = k[self._forces.amplitudes[:, : len(k)].any(axis=0)]
        gains = np.abs(self._gains(excited, row)) * (excited * self._w)[:, None] ** order
        most = gains.max(axis=0, initial=0.0)
        if order == 0:
            most = np.maximum(most, np.abs(self._B[row] @ np.linalg.pinv(self._K)))
        error = float(np.where(self._forces.error > 0.0, most * self._forces.error, 0.0).sum())
        amplitudes = (1j * k * self._w) ** order * self.amplitudes[:, row]
        mean = float(self._mean[row]) if order == 0 else 0.0
        return FourierSeries(self._w, mean, amplitudes, error, self._rest(row, order))

    def _gains(self, k: Array, row: int) -> ComplexArray:
        """Amplitudes (N, n) of a coordinate per force in N harmonics; infinite at resonances."""
        found = []
        for first in range(0, len(k), _BLOCK):
            Z = impedance(self._M, self._C, self._K, self._w * k[first : first + _BLOCK])
            with np.errstate(invalid='ignore'):
                own = np.einsum('i,kij->kj', self._B[row], _inverses(Z))
            found.append(np.where(np.isnan(own), np.inf, own))
        return np.concatenate(found) if found else np.zeros((0, len(self._K)), complex)

    def _rest(self, row: int, order: int) -> float:
        """Bound of the root mean square of all harmonics beyond those that are asked for.

        Those that are known by the forces are known themselves. Of the others the bound is that
        of the forces times the largest response to any of them; impulses, whose harmonics never
        fall, are summed one by one.
        """
        F = self._forces.amplitudes
        k = np.arange(len(self.amplitudes) + 1.0, F.shape[1] + 1.0)
        parts = self._gains(k, row), F[:, len(self.amplitudes) :].T
        with np.errstate(invalid='ignore'):
            z = np.where(parts[1] != 0.0, parts[0] * parts[1], 0.0).sum(axis=1)
        known = np.abs(z) * (k * self._w) ** order
        return float(np.hypot(np.sqrt((known**2).sum() / 2.0), self._beyond(row, order)))

    def _beyond(self, row: int, order: int) -> float:
        """Bound beyond the harmonics that are known of the forces."""
        rest = self._forces.rest
        if not rest.any() and self._impulses is None:
            return 0.0
        count, (M, C, K) = self._forces.amplitudes.shape[1], (self._M, self._C, self._K)
        try:
            roots = np.linalg.eigvals(state_matrix(M, C, K))
            last = np.linalg.inv(M)
        except np.linalg.LinAlgError:
            return float(np.inf)
        far = int(_BEYOND * np.abs(roots).max(initial=0.0) / self._w) + count + 1
        each = np.arange(count + 1.0, min(far, count + _EACH) + 1.0)
        near = np.round(np.abs(roots) / self._w)[:, None] + np.arange(-2.0, 3.0)
        spread = np.round(np.geomspace(each[-1], 10.0 * far, _SPREAD))
        k = np.unique(np.concatenate([each, near.ravel(), spread]))
        k = k[k > count]
        gains = np.abs(self._gains(k, row)) * (k * self._w)[:, None] ** order
        most = gains.max(axis=0)
        if order == 2:
            most = np.maximum(most, np.abs(self._B[row] @ last))
        total = float(np.where(rest > 0.0, most * rest, 0.0).sum())
        if self._impulses is not None:
            if order == 2:
                return float(np.inf)
            k = np.arange(count + 1.0, count + far + _EACH)
            gains = np.abs(self._gains(k, row)) * (k * self._w)[:, None] ** order
            # from there on they fall as k^(order - 2)
            squares = (gains**2).sum(axis=0) + gains[-1] ** 2 * k[-1] / (3.0 - 2.0 * order)
            size = 2.0 * self._impulses * self._w / (2.0 * np.pi)
            total += float((np.sqrt(squares / 2.0) * size).sum())
        return total


def _inverses(Z: ComplexArray) -> ComplexArray:
    """Inverses of matrices (N, n, n); infinite where one is singular."""
    try:
        return np.asarray(np.linalg.inv(Z))
    except np.linalg.LinAlgError:
        if len(Z) == 1:
            return np.full(Z.shape, np.inf, complex)
        half = len(Z) // 2
        return np.concatenate([_inverses(Z[:half]), _inverses(Z[half:])])
