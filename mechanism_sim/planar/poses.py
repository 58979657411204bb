"""Positions of points of links, and directions of links, at many instants."""

from __future__ import annotations

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint


class Poses:
    """Places of links at N instants, and their directions.

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
