"""Two masses in a row in closed form ([V] 6.13.1 to 6.13.3, A.6), the first one on the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from masses import MassSystem, chain
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.errors import InputError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class TwoMasses:
    """The first mass on a spring and damper to the ground, the second one on the first.

    Raises
    ------
    InputError
        If a mass or a stiffness is not positive.
    """

    m1: float  #: [kg]
    m2: float  #: [kg]
    k1: float  #: [N/m]
    k2: float  #: [N/m]
    c1: float = 0.0  #: [N s/m]
    c2: float = 0.0  #: [N s/m]

    def __post_init__(self) -> None:
        if not min(self.m1, self.m2, self.k1, self.k2) > 0.0:
            raise InputError('two masses on springs need positive masses and stiffnesses')

    @property
    def system(self) -> MassSystem:
        """Linear system of matrices, [V] eq. 6.184."""
        return chain([self.m1, self.m2], [self.k1, self.k2], [self.c1, self.c2])

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies without damping (2,) [rad/s], [V] eq. 6.153."""
        second = self.k2 / self.m2
        fast = second + self._excess
        return np.sqrt([self.k1 / self.m1 * (second / fast), fast])  # their product is known

    @property
    def mode_ratios(self) -> Array:
        """Amplitude of the second mass over that of the first, for both modes (2,).

        Without damping: [V] eqs. 6.157, 6.158. Their product is -m1/m2, as modes are orthogonal.
        """
        second = -self.k2 / self.m2 / self._excess
        return np.array([-self.m1 / (self.m2 * second), second])

    @property
    def _excess(self) -> float:
        """Larger square of eq. 6.153 less k2/m2 [1/s^2], without cancellation."""
        h = (self.k1 / self.m1 + self.k2 / self.m1 - self.k2 / self.m2) / 2.0
        square = self.k2 / self.m1 * (self.k2 / self.m2)
        root = math.hypot(h, math.sqrt(square))
        return root + h if h > 0.0 else square / (root - h)

    @property
    def characteristic_polynomial(self) -> Array:
        """Coefficients (5,) of [V] eq. 6.188, the highest power first [kg^2/s^j]."""
        m1, m2, k1, k2, c1, c2 = self.m1, self.m2, self.k1, self.k2, self.c1, self.c2
        return np.array([
            m1 * m2,
            m1 * c2 + m2 * (c1 + c2),
            m1 * k2 + m2 * (k1 + k2) + c1 * c2,
            c1 * k2 + c2 * k1,
            k1 * k2,
        ])  # fmt: skip

    @property
    def roots(self) -> ComplexArray:
        """Roots of the characteristic polynomial (4,) [1/s]."""
        return np.asarray(np.roots(self.characteristic_polynomial), complex)

    def amplitude_ratio(self, root: ArrayLike) -> ComplexArray:
        """Amplitude of the second mass over that of the first, d2/d1, for roots [1/s].

        [V] eq. 6.196. A.6.1 computes the inverse, d1/d2, and uses it for this.
        """
        s = np.asarray(root, complex)
        first = self.m1 * s**2 + (self.c1 + self.c2) * s + self.k1 + self.k2
        return np.asarray(first / (self.c2 * s + self.k2))

    def free_undamped(
        self, t: ArrayLike, displacement: ArrayLike, velocity: ArrayLike
    ) -> tuple[Array, Array]:
        """Displacements (y1, y2) [m] at times t [s], [V] eqs. 6.165 to 6.175; dampers left out.

        With the cosine and sine parts of 6.172 to 6.175: the arctangents of 6.177 and 6.179 do not
        know the quadrant.

        Parameters
        ----------
        t : times [s]
        displacement, velocity : of both masses at t = 0, (2,) [m, m/s]
        """
        t = np.asarray(t, np.float64)
        (d1, d2), (v1, v2) = np.asarray(displacement), np.asarray(velocity)
        w, r = self.natural_frequencies, self.mode_ratios
        modes = [
            ((r[j] * d1 - d2) * np.cos(w[i] * t) + (r[j] * v1 - v2) * np.sin(w[i] * t) / w[i])
            / (r[j] - r[i])
            for i, j in ((0, 1), (1, 0))
        ]
        return modes[0] + modes[1], r[0] * modes[0] + r[1] * modes[1]

    def steady(self, frequency: ArrayLike, p1: complex = 0.0, p2: complex = 1.0) -> ComplexArray:
        """Complex amplitudes (2, ...) [m] under force amplitudes p1, p2 [N].

        [V] eqs. 6.212, 6.213; 6.219, 6.220 and 6.222 print the sizes and angles of these wrongly.
        """
        w = np.asarray(frequency, np.float64)
        z11 = self.k1 + self.k2 - self.m1 * w**2 + 1j * w * (self.c1 + self.c2)
        z12 = -self.k2 - 1j * w * self.c2
        z22 = self.k2 - self.m2 * w**2 + 1j * w * self.c2
        found = np.array([z22 * p1 - z12 * p2, z11 * p2 - z12 * p1])
        return np.asarray(found / (z11 * z22 - z12**2))
