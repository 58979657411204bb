"""Points and vectors of a planar mechanism: as sums of arms that turn with its links."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

GROUND = 'ground'

Vector2 = tuple[float, float]
Slide: TypeAlias = str | tuple[str, ...] | None
"""The displacement that scales a vector, or several whose product does."""
Arm: TypeAlias = tuple[str, Slide]
"""The angle with which a vector turns (or the ground), and the displacement that scales it."""
Point: TypeAlias = dict[Arm, Vector2]
"""A point of the mechanism as a sum over its arms: R(theta) (x, y), or s R(theta) (x, y)."""

Spread: TypeAlias = dict[Arm, Any]
"""The same of one point, or of K points at once, whose vectors are arrays (2, K)."""
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


def factors(slide: Slide) -> tuple[str, ...]:
    """The displacements whose product scales an arm."""
    return () if slide is None else (slide,) if isinstance(slide, str) else slide


def product(slide: Any, course: Callable[[Any], Sequence[Any]]) -> tuple[Any, Any, Any]:
    """What scales an arm, with its first two time derivatives, from those of coordinates."""
    names = factors(slide)
    if not names:
        return 1.0, 0.0, 0.0
    s, ds, dds = course(names[0])
    for name in names[1:]:
        r, dr, ddr = course(name)
        s, ds, dds = s * r, ds * r + s * dr, dds * r + 2.0 * ds * dr + s * ddr
    return s, ds, dds
