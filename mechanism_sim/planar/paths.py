"""Where links and points of them are, and how points move, at many instants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint, Point


class Paths:
    """Position, velocity and acceleration of points.

    Parameters
    ----------
    places : P points of links, or sums over arms
    """

    def __init__(self, mechanism: Mechanism, places: Sequence[LinkPoint | Point]) -> None:
        self._mechanism = mechanism
        self._points = [x if isinstance(x, dict) else mechanism.point(*x) for x in places]

    def __call__(self, q: Array, v: Array, a: Array) -> Array:
        """The points at N instants, in the ground's frame.

        Parameters
        ----------
        q, v, a : (n, N) coordinates, rates, accelerations

        Returns
        -------
        (P, 3, 2, N): position [m], velocity [m/s], acceleration [m/s^2] of each, x and y
        """
        found = [self._mechanism.trace(point, q, v, a) for point in self._points]
        return np.reshape(found, (len(found), 3, 2, -1))


class Poses:
    """Where links are at N instants, and how they are turned.

    Parameters
    ----------
    q : (n, N) coordinates
    """

    def __init__(self, mechanism: Mechanism, q: Array) -> None:
        self._mechanism, self._q = mechanism, q
        links = [GROUND, *(body.name for body in mechanism.bodies)]
        angles = {link: mechanism.angle_all(link, q) for link in links}
        self.along = {link: np.array([np.cos(x), np.sin(x)]) for link, x in angles.items()}
        """Unit vectors (2, N) along the x axis of each link."""

    def at(self, place: LinkPoint) -> Array:
        """A point of a link in the world (2, N) [m]."""
        link, at = place
        return self._mechanism.locate_all(link, self._q, at)

    def within(self, link: str, place: LinkPoint) -> Array:
        """A point of any link in the frame of this one (2, N) [m]."""
        x, y = self.at(place) - self.at((link, (0.0, 0.0)))
        ux, uy = self.along[link]
        return np.array([ux * x + uy * y, ux * y - uy * x])
