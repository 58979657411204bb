"""Whirl orbits: the ellipse on which the axis of a rotor moves ([V] 6.14.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Orbit:
    """x = Re(X e^(i w t)), y = Re(Y e^(i w t)): two circles run through in opposite directions.

    x + i y = p e^(i w t) + q e^(-i w t), p forward with the rotation, q backward. The fields may
    be arrays: many orbits at once.
    """

    x: complex | ComplexArray  #: complex amplitude X [m]
    y: complex | ComplexArray  #: complex amplitude Y [m]

    @property
    def forward(self) -> ComplexArray:
        """Amplitude p of the circle with the rotation [m]."""
        return np.asarray((self.x + 1j * np.asarray(self.y)) / 2.0)

    @property
    def backward(self) -> ComplexArray:
        """Amplitude q of the circle against the rotation [m]."""
        return np.asarray(np.conj(self.x - 1j * np.asarray(self.y)) / 2.0)

    @property
    def semi_axes(self) -> tuple[Array, Array]:
        """The longer one, and the shorter one: negative if the whirl is backward [m]."""
        p, q = np.abs(self.forward), np.abs(self.backward)
        return np.asarray(p + q), np.asarray(p - q)

    @property
    def inclination(self) -> Array:
        """Angle of the longer axis from x [rad], -pi/2 to pi/2; 0 for a circle."""
        turned = self.forward * self.backward
        angle = np.angle(turned) / 2.0
        return np.asarray(np.where(turned == 0.0, 0.0, angle))

    def points(self, angle: ArrayLike) -> Array:
        """The curve (2, ...) [m] at angles w t of the rotor [rad]."""
        turn = np.exp(1j * np.asarray(angle, np.float64))
        return np.array([(self.x * turn).real, (self.y * turn).real])
