"""A mechanism as textbooks draw it: what there is to draw, as points of links.

This is the one place of the drawing that knows the kinds of joints.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.cycles.points import Paths, Place
from mechanism_sim.planar.mechanism import (
    GROUND,
    Mechanism,
    PinInSlot,
    Prismatic,
    Revolute,
    Vector2,
    rotate,
)

Array = NDArray[np.float64]
Kind = Literal['rail', 'support', 'spring', 'link', 'slot', 'slider', 'pin']

_BOX = 1.7, 1.1
"""Half length and half width of a slider, in units of the drawing's symbols."""


@dataclass(frozen=True)
class Shape:
    """A part of the drawing.

    Attributes
    ----------
    kind : how it is painted
    outline : its points on links
    label : of the link or joint; none if empty
    """

    kind: Kind
    outline: tuple[Place, ...]
    label: str = ''

    @property
    def link(self) -> str:
        """The link that carries it, or its first end."""
        return self.outline[0][0]


class Skeleton:
    """What a mechanism looks like whose coordinates go through q.

    Rails and slots are as long as the motion needs.

    Parameters
    ----------
    q : (n, N)
    marks : points to which their links reach too
    springs : their ends

    Attributes
    ----------
    symbol : size of a joint [m]
    shapes : in the order in which they are painted
    """

    def __init__(
        self,
        mechanism: Mechanism,
        q: Array,
        marks: Iterable[Place] = (),
        springs: Iterable[tuple[Place, Place]] = (),
    ) -> None:
        self.mechanism = mechanism
        self._q = q
        self.symbol = self._symbol()
        self._corners: dict[str, list[Vector2]] = {b.name: [] for b in mechanism.bodies}
        self._rails: list[tuple[str, Vector2, Vector2]] = []
        self._sliders: set[str] = set()
        self.shapes: list[Shape] = []
        for joint in mechanism.joints:
            if isinstance(joint, Revolute):
                self._revolute(joint)
            elif isinstance(joint, Prismatic):
                self._prismatic(joint)
            else:
                self._slot(joint)
        for ends in springs:
            self.shapes.append(Shape('spring', ends))
            self.shapes += [Shape('support', (end,)) for end in ends if end[0] == GROUND]
            marks = [*marks, *ends]
        for link, at in marks:
            self._reach(link, at)
        self.shapes += [self._link(body.name) for body in mechanism.bodies]
        order = Kind.__args__  # type: ignore[attr-defined]
        self.shapes.sort(key=lambda shape: order.index(shape.kind))

    def placed(self, q: Array) -> list[Array]:
        """The outlines (k, 2, N) of all shapes in the world [m] at coordinates q (n, N)."""
        places = [place for shape in self.shapes for place in shape.outline]
        found, first = [], 0
        positions = _located(self.mechanism, places, q)
        for shape in self.shapes:
            found.append(positions[first : first + len(shape.outline)])
            first += len(shape.outline)
        return found

    def _symbol(self) -> float:
        """A sixtieth of what the joints cover."""
        joints = self.mechanism.joints
        places = [x for j in joints for x in ((j.first, j.on_first), (j.second, j.on_second))]
        at = _located(self.mechanism, places, self._q)
        return float(max(np.ptp(at[:, 0]), np.ptp(at[:, 1]))) / 60.0

    def _reach(self, link: str, at: Vector2) -> None:
        if link != GROUND:
            self._corners[link].append(at)

    def _revolute(self, joint: Revolute) -> None:
        sides = [(joint.first, joint.on_first), (joint.second, joint.on_second)]
        for side in sides:
            self._reach(*side)
        ground = [side for side in sides if side[0] == GROUND]
        self.shapes += [Shape('support', (side,)) for side in ground]
        self.shapes.append(Shape('pin', ((ground or sides)[0],), joint.name))

    def _prismatic(self, joint: Prismatic) -> None:
        """A box on `second`, on a rail of `first`."""
        self._rail('rail', joint.first, joint.on_first, joint.axis, joint.second, joint.on_second)
        length, width = (self.symbol * x for x in _BOX)
        corners = ((-length, -width), (length, -width), (length, width), (-length, width))
        turn = joint.axis - joint.angle
        box = [(joint.second, _plus(joint.on_second, rotate(c, turn))) for c in corners]
        self.shapes.append(Shape('slider', tuple(box), joint.name))
        self._sliders.add(joint.second)
        self._reach(joint.second, joint.on_second)

    def _slot(self, joint: PinInSlot) -> None:
        """A slot in `second`, and the pin of `first` in it."""
        self._rail('slot', joint.second, joint.on_second, joint.axis, joint.first, joint.on_first)
        self.shapes.append(Shape('pin', ((joint.first, joint.on_first),), joint.name))
        self._reach(joint.first, joint.on_first)

    def _rail(
        self, kind: Kind, link: str, base: Vector2, axis: float, runner: str, at: Vector2
    ) -> None:
        """A line of a link, as long as what runs on it needs."""
        way = rotate((1.0, 0.0), axis)
        places: list[Place] = [(link, base), (link, _plus(base, way)), (runner, at)]
        origin, ahead, where = _located(self.mechanism, places, self._q)
        along = ((where - origin) * (ahead - origin)).sum(axis=0)
        spare = 2.5 * self.symbol
        ends = float(along.min()) - spare, float(along.max()) + spare
        start, end = (_plus(base, (s * way[0], s * way[1])) for s in ends)
        self.shapes.append(Shape(kind, ((link, start), (link, end))))
        if link != GROUND:
            self._rails.append((link, start, end))

    def _link(self, link: str) -> Shape:
        """A link through its joints, meeting its rails where they are nearest."""
        corners = self._corners[link]
        for owner, start, end in self._rails:
            if owner == link:
                corners.append(_nearest(start, end, corners))
        distinct: list[Vector2] = []
        for corner in corners:
            if all(math.dist(corner, other) > 1e-9 for other in distinct):
                distinct.append(corner)
        body = self.mechanism.body(link)
        if len(distinct) == 1 and link not in self._sliders:
            distinct.append(body.cog)  # a pendulum
        return Shape(
            'link', tuple((link, corner) for corner in _around(distinct, self.symbol)), link
        )


def _located(mechanism: Mechanism, places: Sequence[Place], q: Array) -> Array:
    """Points in the world (P, 2, N) [m]."""
    still = np.zeros_like(q)
    return Paths(mechanism, places)(q, still, still)[:, 0]


def _plus(a: Vector2, b: Vector2) -> Vector2:
    return a[0] + b[0], a[1] + b[1]


def _nearest(start: Vector2, end: Vector2, others: Sequence[Vector2]) -> Vector2:
    """The point of a segment that is nearest to the middle of other points."""
    if not others:
        return 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    x, y = (sum(each) / len(others) for each in zip(*others, strict=True))
    dx, dy = end[0] - start[0], end[1] - start[1]
    share = ((x - start[0]) * dx + (y - start[1]) * dy) / (dx * dx + dy * dy)
    share = min(max(share, 0.0), 1.0)
    return start[0] + share * dx, start[1] + share * dy


def _around(corners: Sequence[Vector2], thin: float) -> tuple[Vector2, ...]:
    """Corners in their order around the middle, so that their outline does not cross itself.

    Of corners on one line, or nearly so, both ends.
    """
    if len(corners) < 3:
        return tuple(corners)
    at = np.array(corners)
    at -= at.mean(axis=0)
    _, _, (along, across) = np.linalg.svd(at, full_matrices=False)
    if np.ptp(at @ across) < thin:
        place = at @ along
        return corners[int(place.argmin())], corners[int(place.argmax())]
    order = np.argsort(np.arctan2(at[:, 1], at[:, 0]))
    return tuple(corners[i] for i in order)
