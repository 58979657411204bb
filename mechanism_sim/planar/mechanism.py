"""Links and joints of a planar mechanism, and the tree that is left when loops are cut."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

GROUND = 'ground'

Vector2 = tuple[float, float]
Point = dict[str, Vector2]
"""A point of the mechanism: sum over frames f of R(theta_f) (x, y); ground's frame is fixed."""


@dataclass(frozen=True)
class Body:
    """A rigid link. Its frame sits in its proximal joint, x along the link."""

    name: str
    mass: float  #: [kg]
    inertia: float  #: [kg m^2] about the centre of gravity
    cog: Vector2  #: [m] centre of gravity in the link's frame


@dataclass(frozen=True)
class Revolute:
    """A revolute joint between two links, at a point of each."""

    name: str
    first: str
    second: str
    on_first: Vector2  #: [m] in the frame of `first`
    on_second: Vector2  #: [m] in the frame of `second`


@dataclass(frozen=True)
class Mechanism:
    """Links, joints, and which joints are cut so that the rest is a tree.

    Coordinates are the absolute angles of the links, in the order of `bodies`; the links come in
    an order in which each is joined to the ground or to an earlier one by a joint that is not cut.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Revolute, ...]
    cut: tuple[str, ...]
    gravity: Vector2 = (0.0, 0.0)  #: [m/s^2]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates: those of the links."""
        return tuple(body.name for body in self.bodies)

    def joint(self, name: str) -> Revolute:
        """The joint of that name."""
        return next(j for j in self.joints if j.name == name)

    @cached_property
    def size(self) -> float:
        """Longest distance between two points of one link [m]: the scale of rounding errors.

        The points are its joints, its origin and its centre of gravity.
        """
        ends: dict[str, list[Vector2]] = {b.name: [(0.0, 0.0), b.cog] for b in self.bodies}
        for j in self.joints:
            ends.setdefault(j.first, []).append(j.on_first)
            ends.setdefault(j.second, []).append(j.on_second)
        return max(
            math.hypot(a[0] - b[0], a[1] - b[1])
            for points in ends.values()
            for a in points
            for b in points
        )

    @cached_property
    def tree_joints(self) -> dict[str, Revolute]:
        """The joint that carries each link, from the ground outwards."""
        carried: dict[str, Revolute] = {}
        for body in self.bodies:
            for j in self.joints:
                known = (j.first, j.second)
                other = known[1] if known[0] == body.name else known[0]
                reached = other == GROUND or other in carried
                if body.name in known and j.name not in self.cut and reached:
                    carried[body.name] = j
                    break
            else:
                raise ValueError(f'link {body.name} is not joined to the ground by uncut joints')
        return carried

    def parent(self, link: str) -> str:
        """The link that carries `link` in the tree."""
        j = self.tree_joints[link]
        return j.second if j.first == link else j.first

    def point(self, link: str, at: Vector2 = (0.0, 0.0)) -> Point:
        """The point `at` (in the link's frame, [m]) as a sum of rotating vectors."""
        if link == GROUND:
            return {GROUND: at}
        j = self.tree_joints[link]
        here, there = (j.on_first, j.on_second) if j.first == link else (j.on_second, j.on_first)
        result = dict(self.point(self.parent(link), there))
        offset = (at[0] - here[0], at[1] - here[1])
        if offset != (0.0, 0.0):
            result[link] = offset
        return result

    def locate(self, link: str, angles: Mapping[str, float], at: Vector2 = (0.0, 0.0)) -> Vector2:
        """World coordinates [m] of a point of a link; the default is its proximal joint."""
        x = y = 0.0
        for frame, (dx, dy) in self.point(link, at).items():
            angle = 0.0 if frame == GROUND else angles[frame]
            x += math.cos(angle) * dx - math.sin(angle) * dy
            y += math.sin(angle) * dx + math.cos(angle) * dy
        return x, y

    def separation(self, joint: str) -> Point:
        """Point of the first link minus point of the second link at a cut joint."""
        j = self.joint(joint)
        return subtract(self.point(j.first, j.on_first), self.point(j.second, j.on_second))


def subtract(a: Point, b: Point) -> Point:
    """The vector from b to a."""
    result = dict(a)
    for frame, (x, y) in b.items():
        ax, ay = result.get(frame, (0.0, 0.0))
        result[frame] = (ax - x, ay - y)
    return {f: xy for f, xy in result.items() if xy != (0.0, 0.0)}
