"""Periodic functions of the crank angle: series and splines, roots and tips."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.arrays import Array

Curve = Callable[[Array, int], Array]
"""Derivative of given order by the crank angle, (k, N), at crank angles (N,) [rad]."""

TURN = 2.0 * np.pi
_EPS = float(np.finfo(float).eps)
_MOST_SAMPLES = 1 << 13


@dataclass(frozen=True)
class Fourier:
    """A Fourier series of k functions."""

    order: Array  #: (M,) 0, 1, 2, ...
    coefficient: NDArray[np.complex128]  #: (k, M)

    def __call__(self, angle: Array, derivative: int = 0) -> Array:
        """Derivative (k, N) at angles (N,) [rad]."""
        wave = np.exp(1j * np.outer(self.order, angle))
        return np.asarray(((self.coefficient * (1j * self.order) ** derivative) @ wave).real)


def resolve(function: Callable[[Array], Array], what: str) -> Fourier:
    """The Fourier series of a periodic function (N,) -> (k, N), with all terms above rounding."""
    n = 512  # a pulse of a force as narrow as that is met
    check = TURN * np.array([0.0123, 0.2718, 0.5772, 0.9159])  # at no fraction of the turn
    while n <= _MOST_SAMPLES:
        values = np.asarray(function(TURN * np.arange(n, dtype=np.float64) / n), dtype=np.float64)
        if not np.isfinite(values).all():
            raise ValueError(f'{what} is not finite everywhere')
        size = float(np.abs(values).max())
        terms = np.fft.rfft(values) / n
        height = np.abs(terms).max(axis=0)
        if height[n // 3 :].max() <= 1e-13 * size:
            terms[:, 1:] *= 2.0
            count = 1 + max(np.flatnonzero(height > 4.0 * _EPS * size), default=0)
            series = Fourier(np.arange(count, dtype=float), terms[:, :count])
            if np.abs(series(check) - function(check)).max() <= 1e-10 * size:
                return series
        n *= 2
    raise ValueError(
        f'{what} is not a smooth function of the crank angle with period 2 pi; '
        'a force may be given as samples instead'
    )


def root(function: Callable[[Array], Array], a: float, b: float) -> float:
    """The root in a bracket; an end where rounding hides the change of sign."""

    def value(x: float) -> float:
        return float(function(np.array([x]))[0])

    ends = value(a), value(b)
    if ends[0] * ends[1] >= 0.0 or not all(map(math.isfinite, ends)):
        return float(a) if abs(ends[0]) < abs(ends[1]) else float(b)
    return float(scipy.optimize.brentq(value, a, b, xtol=1e-300, rtol=4.0 * _EPS))


def tip(function: Callable[[Array], Array], a: float, b: float) -> tuple[float, float]:
    """Place and value of the maximum between two places."""
    found = scipy.optimize.minimize_scalar(
        lambda x: -float(function(np.array([x]))[0]),
        bounds=(a, b),
        method='bounded',
        options={'xatol': 1e-9 * (b - a)},
    )
    return float(found.x), -float(found.fun)


def with_tips(
    function: Callable[[Array], Array], x: Array, closed: bool = True
) -> tuple[Array, Array]:
    """Places and values, with peaks and troughs added that pass zero between two places."""
    values = function(x)
    if closed:
        values[-1] = values[0]
    places, heights = [x], [values]
    for sign in (1.0, -1.0):
        for i in peaks(sign * values, 0.0):
            if sign * values[i] > 0.0:
                continue
            place, height = tip(_scaled(function, sign), x[i - 1], x[i + 1])
            if height > 0.0:
                places.append(np.array([place]))
                heights.append(np.array([sign * height]))
    x, values = np.concatenate(places), np.concatenate(heights)
    order = np.argsort(x)
    return x[order], values[order]


def peaks(values: Array, level: float) -> list[int]:
    """Where values are highest among neighbours and, for all that is known, may pass a level."""
    left, here, right = values[:-2], values[1:-1], values[2:]
    with np.errstate(invalid='ignore'):
        reach = here + (here - np.minimum(left, right))
    return (1 + np.flatnonzero((here >= left) & (here >= right) & (reach >= level))).tolist()


def _scaled(function: Callable[[Array], Array], factor: float) -> Callable[[Array], Array]:
    return lambda x: factor * function(x)
