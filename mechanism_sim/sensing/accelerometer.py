"""An ideal accelerometer: the acceleration of a point of a link along an axis of that link."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.planar.mechanism import Mechanism

Array = NDArray[np.float64]


class IdealAccelerometer:
    """Reads the acceleration of a point from the motion of the links, exactly.

    The point is ``p = sum_f R(theta_f) d_f`` over the links f that carry it, so that
    ``p'' = sum_f R(theta_f) (E d_f theta_f'' - d_f theta_f'^2)``, E turning by 90 degrees.

    Parameters
    ----------
    mechanism : the machine
    link : its link that carries the sensor
    at : [m] from the proximal joint, along the link
    axis : 'along' the link (outwards) or 'across' it (counterclockwise)
    """

    def __init__(
        self, mechanism: Mechanism, link: str, at: float, axis: Literal['along', 'across']
    ) -> None:
        self._arms = [
            (mechanism.coordinates.index(frame), np.array(arm))
            for frame, arm in mechanism.point(link, (at, 0.0)).items()
            if frame in mechanism.coordinates
        ]
        self._displacements = {mechanism.coordinates.index(d) for d in mechanism.displacements}
        self._link = mechanism.coordinates.index(link)
        self._turn = 0.0 if axis == 'along' else 0.5 * np.pi

    def read(self, motion: PiecewisePolynomial, t: Array) -> Array:
        """Acceleration [m/s^2] at times `t` (N,) [s]; at an event, what holds after it."""
        k = motion.locate(t)
        dt = (t - motion.start[k]) - motion.start_low[k]
        angle, rate, acceleration = (motion.at(k, dt, d).T for d in (0, 1, 2))
        axis = angle[self._link] + self._turn
        reading = np.zeros(len(t))
        for i, (x, y) in self._arms:
            if i in self._displacements:
                reading += (x * np.cos(axis) + y * np.sin(axis)) * acceleration[i]
                continue
            # Components of the arm along the axis and across it, the axis being at `angle`.
            c, s = np.cos(angle[i] - axis), np.sin(angle[i] - axis)
            along, across = x * c - y * s, -(x * s + y * c)
            reading += across * acceleration[i] - along * rate[i] ** 2
        return reading
