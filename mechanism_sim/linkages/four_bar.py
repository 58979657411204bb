"""The ideal four-bar linkage in closed form: position, velocity, acceleration.

Links are vectors ``l2 u(th2) + l3 u(th3) - l4 u(th4) - l1 u(0) = 0`` ([V] 2.3.1, second case: two
unknown angles). All functions are vectorised over the crank angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mechanism_sim.arrays import Array

Branch = Literal['open', 'crossed']


@dataclass(frozen=True)
class FourBar:
    """Lengths between joints [m] and the branch in which the linkage is assembled."""

    ground: float
    crank: float
    coupler: float
    rocker: float
    branch: Branch = 'open'

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """Of ground, crank, coupler and rocker [m]."""
        return self.ground, self.crank, self.coupler, self.rocker

    def positions(self, th2: Array) -> tuple[Array, Array]:
        """Angles th3, th4 of coupler and rocker [rad], in (-pi, pi].

        The diagonal from crank pin to rocker pivot and the two links beyond it form a triangle,
        solved by the law of cosines; the branch says on which side of the diagonal the
        coupler-rocker pin lies ([V] 2.3.1). Where the triangle cannot be closed the angles are
        NaN.
        """
        return self.close(self.ground - self.crank * np.cos(th2), -self.crank * np.sin(th2))

    def close(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Angles th3, th4 for which ``l3 u(th3) - l4 u(th4)`` is the vector (x, y) [m]."""
        d = np.hypot(x, y)
        side = 1.0 if self.branch == 'open' else -1.0
        with np.errstate(invalid='ignore', divide='ignore'):
            cosine = (d * d + self.coupler**2 - self.rocker**2) / (2.0 * d * self.coupler)
            th3 = np.arctan2(y, x) + side * np.arccos(cosine)
        th4 = np.arctan2(self.coupler * np.sin(th3) - y, self.coupler * np.cos(th3) - x)
        return np.arctan2(np.sin(th3), np.cos(th3)), th4

    def rates(self, th2: Array, w2: Array, th3: Array, th4: Array) -> tuple[Array, Array]:
        """Angular velocities w3, w4 [rad/s]: the closure differentiated once ([V] 2.4)."""
        s = np.sin(th3 - th4)
        w3 = -self.crank * w2 * np.sin(th2 - th4) / (self.coupler * s)
        w4 = self.crank * w2 * np.sin(th3 - th2) / (self.rocker * s)
        return w3, w4

    def accelerations(
        self, th2: Array, w2: Array, a2: Array, th3: Array, th4: Array, w3: Array, w4: Array
    ) -> tuple[Array, Array]:
        """Angular accelerations a3, a4 [rad/s^2]: the closure differentiated twice ([V] 2.5).

        Projected on the direction of the rocker and of the coupler, one unknown drops out each.
        """
        l2, l3, l4 = self.crank, self.coupler, self.rocker
        s = np.sin(th3 - th4)
        a3 = -(
            l2 * (a2 * np.sin(th2 - th4) + w2**2 * np.cos(th2 - th4))
            + l3 * w3**2 * np.cos(th3 - th4)
            - l4 * w4**2
        ) / (l3 * s)
        a4 = -(
            l2 * (a2 * np.sin(th2 - th3) + w2**2 * np.cos(th2 - th3))
            + l3 * w3**2
            - l4 * w4**2 * np.cos(th4 - th3)
        ) / (l4 * s)
        return a3, a4

    def motion(self, th2: Array, w2: Array, a2: Array) -> tuple[Array, Array, Array]:
        """Angles, rates and accelerations of crank, coupler, rocker, each (3, N)."""
        th3, th4 = self.positions(th2)
        w3, w4 = self.rates(th2, w2, th3, th4)
        a3, a4 = self.accelerations(th2, w2, a2, th3, th4, w3, w4)
        shape = np.shape(th2)
        rows = ((th2, th3, th4), (w2, w3, w4), (a2, a3, a4))
        angle, rate, acceleration = (
            np.array([np.broadcast_to(x, shape) for x in row]) for row in rows
        )
        return angle, rate, acceleration
