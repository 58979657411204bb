"""Links and joints of a planar mechanism, and the tree that is left when loops are cut."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

GROUND = 'ground'

Vector2 = tuple[float, float]
Point = dict[str, Vector2]
"""A point of the mechanism as a sum over coordinates: R(theta) (x, y) for the angle of a link,
s (x, y) for a displacement s; and (x, y) itself for the ground."""


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
class Prismatic:
    """A prismatic joint: a point of the second link slides along a line of the first."""

    name: str
    first: str
    second: str
    on_first: Vector2  #: [m] a point of the line, in the frame of `first`
    on_second: Vector2  #: [m] the sliding point, in the frame of `second`
    axis: float = 0.0  #: [rad] direction of the line, in the frame of `first`
    angle: float = 0.0  #: [rad] of the frame of `second` relative to that of `first`


@dataclass(frozen=True)
class PinInSlot:
    """A pin of the first link in a straight slot of the second: a higher pair."""

    name: str
    first: str
    second: str
    on_first: Vector2  #: [m] the pin, in the frame of `first`
    on_second: Vector2  #: [m] a point of the slot, in the frame of `second`
    axis: float = 0.0  #: [rad] direction of the slot, in the frame of `second`


Joint = Revolute | Prismatic | PinInSlot


@dataclass(frozen=True)
class Mechanism:
    """Links, joints, and which joints are cut so that the rest is a tree.

    A link that no uncut joint ties to the ground, not even by way of others, floats: its centre of
    gravity is placed by two displacements. Coordinates are the absolute angles of the links, in
    the order of `bodies`, then the displacements [m] of the floating ones.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Revolute, ...]
    cut: tuple[str, ...]
    gravity: Vector2 = (0.0, 0.0)  #: [m/s^2]

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names: of the links for their angles, ``LINK.x`` and ``LINK.y`` for displacements."""
        return (*(body.name for body in self.bodies), *self.displacements)

    @cached_property
    def displacements(self) -> tuple[str, ...]:
        """The coordinates that are displacements."""
        return tuple(f'{link}.{axis}' for link in self.floating for axis in 'xy')

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
    def _tree(self) -> tuple[dict[str, Revolute], tuple[str, ...]]:
        """The joint that carries each link, in an order from the ground outwards; and floaters."""
        carried: dict[str, Revolute] = {}
        floating: list[str] = []
        left = [body.name for body in self.bodies]
        while left:
            reached = {GROUND, *carried, *floating}
            for link, j in ((link, j) for link in left for j in self.joints):
                ends = (j.first, j.second)
                if link in ends and j.name not in self.cut and reached & {*ends}:
                    carried[link] = j
                    break
            else:
                link = left[0]
                floating.append(link)
            left.remove(link)
        return carried, tuple(floating)

    @property
    def tree_joints(self) -> dict[str, Revolute]:
        """The joint that carries each link but the floating ones, from the ground outwards."""
        return self._tree[0]

    @property
    def floating(self) -> tuple[str, ...]:
        """The links that no joint carries."""
        return self._tree[1]

    def body(self, name: str) -> Body:
        """The link of that name."""
        return next(b for b in self.bodies if b.name == name)

    def parent(self, link: str) -> str:
        """The link that carries `link` in the tree."""
        j = self.tree_joints[link]
        return j.second if j.first == link else j.first

    def point(self, link: str, at: Vector2 = (0.0, 0.0)) -> Point:
        """The point `at` (in the link's frame, [m]) as a sum over coordinates."""
        if link == GROUND:
            return {GROUND: at}
        if link in self.floating:
            cog = self.body(link).cog
            arm = (at[0] - cog[0], at[1] - cog[1])
            slides = {f'{link}.x': (1.0, 0.0), f'{link}.y': (0.0, 1.0)}
            return slides | ({link: arm} if arm != (0.0, 0.0) else {})
        j = self.tree_joints[link]
        here, there = (j.on_first, j.on_second) if j.first == link else (j.on_second, j.on_first)
        result = dict(self.point(self.parent(link), there))
        offset = (at[0] - here[0], at[1] - here[1])
        if offset != (0.0, 0.0):
            result[link] = offset
        return result

    def locate(self, link: str, q: Mapping[str, float], at: Vector2 = (0.0, 0.0)) -> Vector2:
        """World coordinates [m] of a point of a link; the default is its proximal joint."""
        x = y = 0.0
        for name, (dx, dy) in self.point(link, at).items():
            if name in self.displacements:
                x += q[name] * dx
                y += q[name] * dy
                continue
            angle = 0.0 if name == GROUND else q[name]
            x += math.cos(angle) * dx - math.sin(angle) * dy
            y += math.sin(angle) * dx + math.cos(angle) * dy
        return x, y

    def angle(self, link: str, q: Mapping[str, float]) -> float:
        """Angle of a link [rad]."""
        return 0.0 if link == GROUND else q[link]

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
