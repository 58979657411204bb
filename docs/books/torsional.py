"""Torsional vibrations: disks on shafts ([V] 6.12).

A disk on a shaft is an oscillator whose mass is a moment of inertia, [V] eqs. 6.134 to 6.137:
``Oscillator.of_coefficients(inertia, damping, stiffness)``.
"""

from __future__ import annotations

import numpy as np
from masses import MassSystem, chain
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def disk_inertia(mass: ArrayLike, diameter: ArrayLike) -> Array:
    """Polar moment of inertia of a disk of even thickness [kg m^2], from [kg] and [m]."""
    return np.asarray(np.multiply(mass, np.square(diameter)) / 8.0)


def shaft_stiffness(
    shear_modulus: ArrayLike, length: ArrayLike, diameter: ArrayLike, bore: ArrayLike = 0.0
) -> Array:
    """Torque per angle of a round shaft [N m/rad]: G pi (d^4 - b^4)/(32 l).

    Parameters
    ----------
    shear_modulus : G [Pa]
    length, diameter, bore : [m]
    """
    outer, inner = np.square(diameter), np.square(bore)
    polar = np.pi / 32.0 * (outer - inner) * (outer + inner)
    return np.asarray(polar * shear_modulus / length)


def in_series(*stiffnesses: ArrayLike) -> Array:
    """Stiffness of shafts one behind the other [N m/rad]."""
    return np.asarray(1.0 / sum(np.divide(1.0, k) for k in stiffnesses))


def referred(value: ArrayLike, ratio: ArrayLike) -> Array:
    """Inertia, stiffness or damping of a geared shaft, referred to another shaft.

    Parameters
    ----------
    value : on its own shaft [kg m^2, N m/rad or N m s/rad]
    ratio : speed of its shaft over that of the other
    """
    return np.asarray(value * np.square(ratio))


def disks(inertias: ArrayLike, stiffnesses: ArrayLike, dampings: ArrayLike = 0.0) -> MassSystem:
    """Disks one behind the other on a shaft that is free at both ends.

    Parameters
    ----------
    inertias : (n,) [kg m^2]
    stiffnesses, dampings : of the n - 1 shafts between them [N m/rad, N m s/rad]
    """
    k = np.atleast_1d(np.asarray(stiffnesses, np.float64))
    c = np.broadcast_to(np.asarray(dampings, np.float64), k.shape)
    return chain(inertias, np.concatenate([[0.0], k]), np.concatenate([[0.0], c]))
