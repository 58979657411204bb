"""An ideal accelerometer: the acceleration of a point of a link along an axis of that link."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.planar.mechanism import GROUND, Mechanism, Vector2

Array = NDArray[np.float64]


class IdealAccelerometer:
    """Reads the acceleration of a point from the motion of the links, exactly.

    The point is ``p = sum_k s_k R(theta_k) d_k``, so that its acceleration is
    ``sum_k R(theta_k) ((s'' - s theta'^2) d + (s theta'' + 2 s' theta') E d)``, E turning by 90
    degrees; s is 1 for arms of fixed length, and theta is 0 for those of the ground.

    Parameters
    ----------
    mechanism : the machine
    link : its link that carries the sensor
    at : [m] in the link's frame; one number: along its x axis
    axis : 'along' the link's x axis or 'across' it (counterclockwise)
    """

    def __init__(
        self,
        mechanism: Mechanism,
        link: str,
        at: float | Vector2,
        axis: Literal['along', 'across'],
    ) -> None:
        index = mechanism.coordinates.index
        place = at if isinstance(at, tuple) else (at, 0.0)
        self._arms = [
            (
                None if frame == GROUND else index(frame),
                None if slide is None else index(slide),
                np.array(d),
            )
            for (frame, slide), d in mechanism.point(link, place).items()
        ]
        frame, offset = mechanism.frame(link)
        self._frame = None if frame == GROUND else index(frame)
        self._turn = offset + (0.0 if axis == 'along' else 0.5 * np.pi)

    def read(self, motion: PiecewisePolynomial, t: Array) -> Array:
        """Acceleration [m/s^2] at times `t` (N,) [s]; at an event, what holds after it."""
        k, dt = motion.find(t)
        q, v, a = (motion.at(k, dt, d).T for d in (0, 1, 2))
        rest = np.zeros(len(t))
        axis = self._turn + (rest if self._frame is None else q[self._frame])
        reading = np.zeros(len(t))
        for i, j, (x, y) in self._arms:
            angle, w, alpha = (rest, rest, rest) if i is None else (q[i], v[i], a[i])
            s, rate, second = (rest + 1.0, rest, rest) if j is None else (q[j], v[j], a[j])
            # components of the arm along the axis and across it, the axis being at `angle`
            cosine, sine = np.cos(angle - axis), np.sin(angle - axis)
            along, across = x * cosine - y * sine, -(x * sine + y * cosine)
            reading += (second - s * w**2) * along + (s * alpha + 2.0 * rate * w) * across
        return reading
