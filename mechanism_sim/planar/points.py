"""Points and vectors of a planar mechanism: as sums of arms that turn with its links."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from mechanism_sim.arrays import Array

GROUND = 'ground'

Vector2 = tuple[float, float]
_Slide: TypeAlias = str | tuple[str, ...] | None
"""The displacement that scales a vector, or several whose product does."""
Arm: TypeAlias = tuple[str, _Slide]
"""The angle with which a vector turns (or the ground), and the displacement that scales it."""
Point: TypeAlias = dict[Arm, Vector2]
"""A point of the mechanism as a sum over its arms: R(theta) (x, y), or s R(theta) (x, y)."""

Spread: TypeAlias = dict[Arm, Any]
"""Arms of one point, or of K points at once, whose vectors are arrays (2, K)."""
LinkPoint: TypeAlias = tuple[str, Vector2]
"""A link, and a point in its frame [m]."""


def rotate(v: Vector2, angle: float) -> Vector2:
    """A vector turned by an angle [rad]; exact for quarter turns."""
    quarters = angle / (0.5 * math.pi)
    if quarters == round(quarters):
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
    else:
        c, s = math.cos(angle), math.sin(angle)
    return c * v[0] - s * v[1], s * v[0] + c * v[1]


def factors(slide: _Slide) -> tuple[str, ...]:
    """The displacements whose product scales an arm."""
    return () if slide is None else (slide,) if isinstance(slide, str) else slide


def product(slide: Any, trajectory: Callable[[Any], Sequence[Any]]) -> tuple[Any, Any, Any]:
    """Scale of an arm, with its first two time derivatives, from those of coordinates."""
    names = factors(slide)
    if not names:
        return 1.0, 0.0, 0.0
    s, ds, dds = trajectory(names[0])
    for name in names[1:]:
        r, dr, ddr = trajectory(name)
        s, ds, dds = s * r, ds * r + s * dr, dds * r + 2.0 * ds * dr + s * ddr
    return s, ds, dds


def trace(
    point: Point, trajectory: Callable[[str], Sequence[Any]], count: int, orders: int = 3
) -> Array:
    """A point at N instants with its time derivatives, (orders, 2, N) [m, s].

    Of ``p = sum_k s_k R(theta_k) d_k``, with E turning by 90 degrees, they are

    ``p' = sum R (s' d + s theta' E d)`` and
    ``p'' = sum R ((s'' - s theta'^2) d + (s theta'' + 2 s' theta') E d)``.

    That is where a point is, in numbers; `Frames.position` is the same in symbols.

    Parameters
    ----------
    trajectory : value, rate and acceleration (N,) of a coordinate by name, at least the first
        `orders`
    orders : 1 for the position, 2 for the velocity beside it, 3 for the acceleration
    """
    found = np.zeros((orders, 2, count))

    def known(name: str) -> tuple[Any, ...]:
        return (*(() if name == GROUND else trajectory(name)[:orders]), 0.0, 0.0, 0.0)[:3]

    turned: dict[str, tuple[Any, ...]] = {}
    for (frame, slide), (x, y) in point.items():
        if frame not in turned:
            angle, *rates = known(frame)
            turned[frame] = (np.cos(angle), np.sin(angle), *rates)
        (cosine, sine, w, alpha), (s, rate, second) = turned[frame], product(slide, known)
        dx, dy = cosine * x - sine * y, sine * x + cosine * y
        found[0, 0] += s * dx
        found[0, 1] += s * dy
        if orders > 1:
            found[1, 0] += rate * dx - s * w * dy
            found[1, 1] += rate * dy + s * w * dx
        if orders > 2:
            along, across = second - s * w**2, s * alpha + 2.0 * rate * w
            found[2, 0] += along * dx - across * dy
            found[2, 1] += along * dy + across * dx
    return found
