"""Cross-sections of beams, and how they change along a beam that tapers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.polynomial import legendre

from mechanism_sim.arrays import Array

Shape: TypeAlias = Literal['rectangle', 'circle', 'any']

_NODES = 4  # nodes of Gauss' quadrature: second moments are of the fourth degree in the sizes


def geometry(shape: Shape, sizes: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Area [m^2], second moment of area [m^4] and distance of the outer fibres [m].

    Parameters
    ----------
    sizes : width, and height in the plane [m]; or diameter [m]; or these three
    """
    if shape == 'circle':
        (d,) = sizes
        return 0.25 * math.pi * d**2, math.pi * d**4 / 64.0, 0.5 * d
    if shape == 'rectangle':
        width, height = sizes
        return width * height, width * height**3 / 12.0, 0.5 * height
    area, moment, fibre = sizes
    return area, moment, fibre


@dataclass(frozen=True)
class Taper:
    """Sections along a beam, whose sizes change linearly between points."""

    length: float  #: [m] length of the beam
    shape: Shape
    #: [m] with rising places, and the sizes of the section there, see `geometry`; two of the same
    #: place are a step, before the first and after the last the sizes stay
    points: tuple[tuple[float, tuple[float, ...]], ...]

    @cached_property
    def _intervals(self) -> tuple[Array, Array, Array]:
        """Breaks of the taper (k + 1,) [m], and the sizes at both ends of intervals (k, n)."""
        place, sizes = np.array([x for x, _ in self.points]), np.array([s for _, s in self.points])
        breaks = np.unique([0.0, *place[(place > 0.0) & (place < self.length)], self.length])
        starts, ends = [], []
        for a, b in pairwise(breaks.tolist()):
            i = np.searchsorted(place, a, 'right') - 1
            if i < 0 or i == len(place) - 1:
                held = sizes[max(i, 0)]
                starts.append(held)
                ends.append(held)
                continue
            rate = (sizes[i + 1] - sizes[i]) / (place[i + 1] - place[i])
            starts.append(sizes[i] + rate * (a - place[i]))
            ends.append(sizes[i] + rate * (b - place[i]))
        return breaks, np.array(starts), np.array(ends)

    @property
    def breaks(self) -> Array:
        """Breaks (k + 1,) [m]: the ends, and points where the taper changes."""
        return self._intervals[0]

    @property
    def even(self) -> bool:
        """True if it does not taper at all."""
        _, starts, ends = self._intervals
        return bool((starts == starts[0]).all() and (ends == starts[0]).all())

    def geometry(self, x: float | Array) -> tuple[Array, Array, Array]:
        """Area, second moment and outer fibre at positions x (...,) [m], see `geometry`."""
        breaks, starts, ends = self._intervals
        x = np.asarray(x, float)
        i = np.clip(np.searchsorted(breaks, x, 'right') - 1, 0, len(starts) - 1)
        share = ((x - breaks[i]) / (breaks[i + 1] - breaks[i]))[..., None]
        sizes = starts[i] + share * (ends[i] - starts[i])
        return geometry(self.shape, [*np.moveaxis(sizes, -1, 0)])

    def nodes(self, count: int, end: float) -> tuple[Array, Array]:
        """Nodes and weights (N,) [m] of quadrature from 0 to `end`, `count` in each interval."""
        return nodes(self.breaks, count, end)

    def moments(self) -> tuple[float, float, float]:
        """Integrals of area over mean area times 1 [m], x [m^2] and x^2 [m^3]."""
        x, weights = self.nodes(_NODES, self.length)
        share = weights * self.shares(x)[0]
        return float(share.sum()), float(share @ x), float(share @ x**2)

    @cached_property
    def means(self) -> tuple[float, float]:
        """Mean area [m^2], and mean second moment of area [m^4]."""
        x, weights = self.nodes(_NODES, self.length)
        area, moment, _ = self.geometry(x)
        return float(weights @ area) / self.length, float(weights @ moment) / self.length

    def shares(self, x: float | Array) -> tuple[Array, Array]:
        """Area and second moment over their means at positions x (...,) [m]."""
        area, moment, _ = self.geometry(x)
        return area / self.means[0], moment / self.means[1]


def nodes(breaks: Array, count: int, end: float) -> tuple[Array, Array]:
    """Nodes and weights (N,) of Gauss' quadrature from 0 to `end`, `count` in each interval."""
    places, weights = legendre.leggauss(count)
    ends = np.array([*breaks[breaks < end], end])
    half = 0.5 * np.diff(ends)[:, None]
    middle = 0.5 * (ends[1:] + ends[:-1])[:, None]
    return (middle + half * places).ravel(), (half * weights).ravel()
