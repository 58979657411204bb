"""Damping from decaying vibrations, and the energy loss of a cycle ([V] 6.9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.errors import InputError

Array = NDArray[np.float64]


def logarithmic_decrement(maxima: ArrayLike) -> float:
    """Logarithm of the ratio of consecutive maxima, [V] eq. 6.102.

    Of more than two it is the slope of the straight line that fits their logarithms best.

    Parameters
    ----------
    maxima : consecutive maxima, a damped period apart, (n,) [any unit]

    Raises
    ------
    InputError
        If there are fewer than two, or one is not positive.
    """
    y = np.asarray(maxima, np.float64)
    if y.ndim != 1 or len(y) < 2 or not (y > 0.0).all():
        raise InputError('a logarithmic decrement needs two positive maxima or more')
    n = np.arange(len(y)) - (len(y) - 1) / 2.0
    return float(-(n @ np.log(y)) / (n @ n))


def decrement(ratio: ArrayLike) -> Array:
    """Logarithmic decrement of the damping ratio xi < 1: [V] eqs. 6.102, 6.103."""
    xi = np.asarray(ratio, np.float64)
    return np.asarray(2.0 * np.pi * xi / np.sqrt((1.0 - xi) * (1.0 + xi)))


def damping_ratio(decrement: ArrayLike) -> Array:
    """The book's xi of a logarithmic decrement d: d/sqrt(4 pi^2 + d^2).

    [V] eq. 6.104 has a minus under the root.
    """
    d = np.asarray(decrement, np.float64)
    return np.asarray(d / np.hypot(2.0 * np.pi, d))


def damping_coefficient(
    decrement: ArrayLike, mass: ArrayLike, natural_frequency: ArrayLike
) -> Array:
    """Coefficient c [N s/m], [V] eq. 6.105 with a plus under the root.

    Parameters
    ----------
    decrement : logarithmic decrement
    mass : mass [kg]
    natural_frequency : without damping [rad/s]
    """
    return np.asarray(2.0 * np.multiply(mass, natural_frequency) * damping_ratio(decrement))


def energy_loss(damping: ArrayLike, amplitude: ArrayLike, frequency: ArrayLike) -> Array:
    """Work of the damper in one cycle of a steady vibration [J], [V] eq. 6.111.

    Parameters
    ----------
    damping : coefficient c [N s/m]
    amplitude : of the displacement [m]
    frequency : [rad/s]
    """
    return np.asarray(np.pi * np.multiply(damping, frequency) * np.abs(amplitude) ** 2)


def loss_factors(ratio: ArrayLike) -> tuple[Array, Array]:
    """Energy lost in a cycle at the damped frequency over the greatest potential and kinetic one.

    2 d (1 - xi^2) and 2 d, with the decrement d. [V] takes the energies for the same, and has
    sqrt(1 - xi^2) in eq. 6.113, because the approximation 6.107 is put into 6.112.
    """
    xi = np.asarray(ratio, np.float64)
    kinetic = 2.0 * decrement(xi)
    return np.asarray(kinetic * (1.0 - xi) * (1.0 + xi)), kinetic
