"""Parts that touch in a joint: their outlines for a workshop, and the lines that go with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array


@dataclass(frozen=True)
class Polygon:
    """A polygon.

    Parameters
    ----------
    name : what it is; its layer
    points : (2, n) [m]
    closed : the last point is joined to the first
    """

    name: str
    points: Array
    closed: bool = True


@dataclass(frozen=True)
class Circle:
    """A circle.

    Parameters
    ----------
    name : what it is; its layer
    radius : [m]
    centre : [m]
    """

    name: str
    radius: float
    centre: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Outline:
    """Parts seen along their shafts.

    Parameters
    ----------
    edges : what is cut
    guides : lines of thought: pitch curves, base circles
    shafts : [m]
    """

    edges: tuple[Polygon, ...]
    guides: tuple[Polygon | Circle, ...]
    shafts: tuple[tuple[float, float], ...] = ((0.0, 0.0),)

    @property
    def box(self) -> Array:
        """Lower left and upper right corner, the shafts being inside, (2, 2) [m]."""
        corners = [np.array(self.shafts).T]
        for part in (*self.edges, *self.guides):
            if isinstance(part, Circle):
                around = part.radius * np.array([[-1.0, 1.0], [-1.0, 1.0]])
                corners.append(np.array(part.centre)[:, None] + around)
            else:
                corners.append(part.points)
        everything = np.concatenate(corners, axis=1)
        return np.array([everything.min(axis=1), everything.max(axis=1)])
