"""Where links and points of them are, and how points move, at many instants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.evaluation import Evaluation
from mechanism_sim.numerics.symbolic import add, dense, mul
from mechanism_sim.planar.frames import Frames, Parameters
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint, Point, product

Array = NDArray[np.float64]


class Paths:
    """Position, velocity and acceleration of points, compiled from where the mechanism has them.

    Parameters
    ----------
    places : P points of links, or sums over arms
    """

    def __init__(self, mechanism: Mechanism, places: Sequence[LinkPoint | Point]) -> None:
        self._count = len(places)
        parameters = Parameters()
        frames = Frames(mechanism.coordinates, parameters)
        expressions = []
        for k, place in enumerate(places):
            point = place if isinstance(place, dict) else mechanism.point(*place)
            for jet in frames.position(point, f'point{k}'):
                pull = add(*(mul(s, frames.a[n]) for n, s in jet.gradient.items()), jet.curvature)
                expressions += [dense(x) for x in (jet.value, jet.rate, pull)]
        motion = [*frames.q.values(), *frames.v.values(), *frames.a.values()]
        self._function = Evaluation(
            compiled.function(expressions, motion), parameters.values, [len(expressions)]
        )

    def __call__(self, q: Array, v: Array, a: Array) -> Array:
        """The points at N instants, in the ground's frame.

        Parameters
        ----------
        q, v, a : (n, N) coordinates, rates, accelerations

        Returns
        -------
        (P, 3, 2, N): position [m], velocity [m/s], acceleration [m/s^2] of each, x and y
        """
        (rows,) = self._function(np.concatenate([q, v, a]))
        return rows.reshape(self._count, 2, 3, -1).swapaxes(1, 2)


class Poses:
    """Where links are at N instants, and how they are turned.

    Parameters
    ----------
    q : (n, N) coordinates
    """

    def __init__(self, mechanism: Mechanism, q: Array) -> None:
        links = [GROUND, *(body.name for body in mechanism.bodies)]
        places = [
            mechanism.point(link, at, deformed=False)
            for link in links
            for at in ((0.0, 0.0), (1.0, 0.0))
        ]
        still = np.zeros_like(q)
        self._beams, self._q = mechanism.beams, dict(zip(mechanism.coordinates, q, strict=True))
        at = Paths(mechanism, places)(q, still, still)[:, 0]
        self._origin = {link: at[2 * i] for i, link in enumerate(links)}
        self.along = {link: at[2 * i + 1] - at[2 * i] for i, link in enumerate(links)}
        """Unit vectors (2, N) along the x axis of each link."""

    def at(self, place: LinkPoint) -> Array:
        """A point of a link in the world (2, N) [m]."""
        link, at = place
        ux, uy = self.along[link]
        x, y = np.reshape(at, (2, 1))
        arms = self._beams[link].arms(at) if link in self._beams else {}
        for names, (dx, dy) in arms.items():
            size, *_ = product(names, lambda name: (self._q[f'{link}.{name}'], 0.0, 0.0))
            x, y = x + size * dx, y + size * dy
        return np.asarray(self._origin[link] + np.array([ux * x - uy * y, uy * x + ux * y]))

    def within(self, link: str, place: LinkPoint) -> Array:
        """A point of any link in the frame of this one (2, N) [m]."""
        x, y = self.at(place) - self._origin[link]
        ux, uy = self.along[link]
        return np.array([ux * x + uy * y, ux * y - uy * x])
