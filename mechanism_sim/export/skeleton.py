"""A mechanism as textbooks draw it: what there is to draw, as points of links."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.cycles.points import Place, Poses
from mechanism_sim.linkages.forces import Spring
from mechanism_sim.planar.mechanism import (
    GROUND,
    HigherPair,
    Mechanism,
    Prismatic,
    Revolute,
    Vector2,
    rotate,
)
from mechanism_sim.planar.view import Kind
from mechanism_sim.scene import Machine

_BENDS = 17  # points along the axis of an elastic link
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
    size : of wheels, of which the largest are painted first
    """

    kind: Kind
    outline: tuple[Place, ...]
    label: str = ''
    size: float = 0.0

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
    magnified : how many times as large elastic links deform here

    Attributes
    ----------
    size : what joints, cams and the longest link cover [m]
    symbol : size of a joint, a sixtieth of it [m]
    shapes : in the order in which they are painted
    """

    def __init__(
        self,
        mechanism: Mechanism,
        q: Array,
        marks: Iterable[Place] = (),
        springs: Iterable[tuple[Place, Place]] = (),
        magnified: float = 1.0,
    ) -> None:
        self.mechanism = mechanism
        self._magnified = magnified
        self._poses = Poses(mechanism, q)
        joints = mechanism.joints
        places = [x for j in joints for x in ((j.first, j.on_first), (j.second, j.on_second))]
        springs, pairs = list(springs), [j for j in joints if isinstance(j, HigherPair)]
        places += [end for ends in springs for end in ends]
        places += [place for pair in pairs for place in pair.covered()]
        covered = np.ptp([self._poses.at(place) for place in places], axis=(0, 2))
        self.size = max(float(covered.max()), mechanism.longest) or 1.0
        self.symbol = self.size / 60.0
        self._corners: dict[str, list[Vector2]] = {b.name: [] for b in mechanism.bodies}
        self._rails: list[tuple[str, Vector2, Vector2]] = []
        self._bodied: set[str] = set()
        self._drawn: set[str] = set()
        self._hands = 0
        self.shapes: list[Shape] = []
        for joint in joints:
            if isinstance(joint, Revolute):
                self._revolute(joint)
            elif isinstance(joint, Prismatic):
                self._prismatic(joint)
            else:
                joint.draw(self)
        for ends in springs:
            self.shapes.append(Shape('spring', ends))
            self.shapes += [Shape('support', (end,)) for end in ends if end[0] == GROUND]
            marks = [*marks, *ends]
        for mark in marks:
            self.reach(mark)
        self.shapes += [self._link(body.name) for body in mechanism.bodies]
        order = get_args(Kind)
        self.shapes.sort(key=lambda shape: (order.index(shape.kind), -shape.size))

    def placed(self, q: Array) -> list[Array]:
        """The outlines (k, 2, N) of all shapes in the world [m] at coordinates q (n, N)."""
        poses = Poses(self.mechanism, q)
        bent = Poses(self.mechanism, q, self._magnified) if self._magnified != 1.0 else poses
        return [
            np.array([(bent if s.kind == 'link' else poses).at(place) for place in s.outline])
            for s in self.shapes
        ]

    def _revolute(self, joint: Revolute) -> None:
        sides = [(joint.first, joint.on_first), (joint.second, joint.on_second)]
        for side in sides:
            self.reach(side)
        ground = [side for side in sides if side[0] == GROUND]
        self.shapes += [Shape('support', (side,)) for side in ground]
        self.shapes.append(Shape('pin', ((ground or sides)[0],), joint.name))

    def _prismatic(self, joint: Prismatic) -> None:
        """A box on `second`, on a rail of `first`."""
        runner = self._poses.within(joint.first, (joint.second, joint.on_second))
        self.rail('rail', (joint.first, joint.on_first), joint.axis, runner)
        length, width = (self.symbol * x for x in _BOX)
        corners = ((-length, -width), (length, -width), (length, width), (-length, width))
        turn = joint.axis - joint.angle
        box = [(joint.second, _plus(joint.on_second, rotate(c, turn))) for c in corners]
        self.shapes.append(Shape('slider', tuple(box), joint.name))
        self._bodied.add(joint.second)
        self.reach((joint.second, joint.on_second))

    def at(self, place: Place) -> Array:
        """A point of a link in the world (2, N) [m]."""
        return self._poses.at(place)

    def within(self, link: str, place: Place) -> Array:
        """A point of any link in the frame of this one (2, N) [m]."""
        return self._poses.within(link, place)

    def turned(self, link: str) -> float:
        """Angle of a link in the world at the first instant [rad]."""
        ux, uy = self._poses.along[link][:, 0]
        return float(np.arctan2(uy, ux))

    def first(self, name: str) -> bool:
        """Whether nothing of that name has been drawn yet."""
        known = name in self._drawn
        self._drawn.add(name)
        return not known

    def add(
        self, kind: Kind, outline: Sequence[Place], label: str = '', size: float = 0.0
    ) -> None:
        """A shape, which gives its links bodies; of wheels the largest are painted first."""
        self.shapes.append(Shape(kind, tuple(outline), label, size))
        if kind in ('wheel', 'cam'):
            self._bodied |= {link for link, _ in outline}

    def pin(self, place: Place, label: str) -> None:
        """A pin, to which its link reaches."""
        self.shapes.append(Shape('pin', (place,), label))
        self.reach(place)

    def reach(self, place: Place) -> None:
        """Its link reaches to a point."""
        link, at = place
        if link != GROUND:
            self._corners[link].append(at)

    def rail(self, kind: Kind, place: Place, axis: float, runner: Array) -> None:
        """A line of a link, as long as what runs (2, N) on it, in the link's frame, needs."""
        link, base = place
        way = rotate((1.0, 0.0), axis)
        along = way @ (runner - np.array(base)[:, None])
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
        cog = self.mechanism.body(link).cog
        if len(set(corners)) == 1 and link not in self._bodied:
            corners.append(cog)  # a pendulum
            if math.dist(corners[0], cog) < 0.5 * self.symbol:  # a rotor: a hand shows its turn
                self._hands += 1
                corners[-1] = corners[0][0] + 6.0 * self._hands * self.symbol, corners[0][1]
        distinct: list[Vector2] = []
        for corner in corners:
            if all(math.dist(corner, other) > 1e-9 for other in distinct):
                distinct.append(corner)
        outline = _around(distinct or [cog], self.symbol)
        if beam := self.mechanism.beams.get(link):  # there and back along its axis
            along = np.linspace(0.0, beam.length, _BENDS).tolist()
            outline = (*((x, 0.0) for x in along), *((x, 0.0) for x in along[-2:0:-1]))
        return Shape('link', tuple((link, corner) for corner in outline), link)


def skeleton_of(
    machine: Machine, q: Array, marks: Iterable[Place] = (), magnified: float = 1.0
) -> Skeleton:
    """The skeleton of a machine with its springs; the parameters are those of `Skeleton`."""
    elements = machine.plan.elements(machine.mechanism)
    springs = [(e.first, e.second) for e in elements if isinstance(e, Spring)]
    return Skeleton(machine.mechanism, q, marks, springs, magnified)


def bounds(skeleton: Skeleton, outlines: Sequence[Array]) -> tuple[Array, Array]:
    """The lower left and upper right corner (2,) [m], with room for symbols and labels.

    Parameters
    ----------
    outlines : (k, 2, N) [m] each, as `Skeleton.placed` gives them
    """
    everything = np.concatenate([x.swapaxes(0, 1).reshape(2, -1) for x in outlines], axis=1)
    low, high = everything.min(axis=1), everything.max(axis=1)
    room = 5.0 * skeleton.symbol
    centre = 0.5 * (low + high)
    half = np.maximum(0.5 * (high - low) + room, [0.0, 18.0 * skeleton.symbol])
    return centre - half, centre + half


def zigzag(ends: Array, width: float) -> Array:
    """A spring between two points (2, 2), a row each, straight at its ends: (2, 17) [m]."""
    start, end = ends
    way = end - start
    across = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), 1e-300)
    share = np.array([0.0, *np.linspace(0.15, 0.85, 15), 1.0])
    aside = np.array([0.0, 0.0, *(width * (-1.0) ** np.arange(13)), 0.0, 0.0])
    return np.asarray(start[:, None] + way[:, None] * share + across[:, None] * aside)


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
    """The corners of a plate that all of them lie on.

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
    return tuple(corners[i] for i in scipy.spatial.ConvexHull(at).vertices)
