"""A mechanism as textbooks draw it: what there is to draw, as points of links.

This is the one place of the drawing that knows the kinds of joints.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import scipy
from numpy.typing import NDArray

from mechanism_sim.cams.pair import CamPair
from mechanism_sim.cycles.points import Place, Poses
from mechanism_sim.export.cam_shapes import cam_outlines, follower_outline
from mechanism_sim.gears.involute import rack_teeth
from mechanism_sim.gears.mesh import GearMesh, Teeth
from mechanism_sim.linkages.forces import Spring
from mechanism_sim.linkages.indexing import Geneva, SlottedRack
from mechanism_sim.linkages.slot import PinInSlot
from mechanism_sim.planar.mechanism import (
    GROUND,
    Mechanism,
    Prismatic,
    Revolute,
    Vector2,
    rotate,
)
from mechanism_sim.scene import Machine

Array = NDArray[np.float64]
Kind = Literal['rail', 'support', 'spring', 'wheel', 'cam', 'link', 'slot', 'slider', 'pin']
"""In the order in which they are painted."""

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
    ) -> None:
        self.mechanism = mechanism
        self._poses = Poses(mechanism, q)
        joints = mechanism.joints
        places = [x for j in joints for x in ((j.first, j.on_first), (j.second, j.on_second))]
        springs, cams = list(springs), [j for j in joints if isinstance(j, CamPair)]
        places += [end for ends in springs for end in ends]
        places += [place for joint in cams for line in cam_outlines(joint) for place in line[::15]]
        covered = np.ptp([self._poses.at(place) for place in places], axis=(0, 2))
        self.size = max(float(covered.max()), mechanism.longest) or 1.0
        self.symbol = self.size / 60.0
        self._corners: dict[str, list[Vector2]] = {b.name: [] for b in mechanism.bodies}
        self._rails: list[tuple[str, Vector2, Vector2]] = []
        self._bodied: set[str] = set()
        self._geared: set[str] = set()
        self._hands = 0
        self._gears: list[tuple[float, tuple[Place, ...]]] = []
        self.shapes: list[Shape] = []
        for joint in joints:
            if isinstance(joint, Revolute):
                self._revolute(joint)
            elif isinstance(joint, Prismatic):
                self._prismatic(joint)
            elif isinstance(joint, PinInSlot | Geneva | SlottedRack):
                self._pin(joint)
            elif isinstance(joint, GearMesh):
                self._mesh(joint)
            elif isinstance(joint, CamPair):
                self._cam(joint)
        largest_first = sorted(self._gears, key=lambda gear: -gear[0])
        self.shapes += [Shape('wheel', places) for _, places in largest_first]
        for ends in springs:
            self.shapes.append(Shape('spring', ends))
            self.shapes += [Shape('support', (end,)) for end in ends if end[0] == GROUND]
            marks = [*marks, *ends]
        for link, at in marks:
            self._reach(link, at)
        self.shapes += [self._link(body.name) for body in mechanism.bodies]
        order = get_args(Kind)
        self.shapes.sort(key=lambda shape: order.index(shape.kind))

    def placed(self, q: Array) -> list[Array]:
        """The outlines (k, 2, N) of all shapes in the world [m] at coordinates q (n, N)."""
        poses = Poses(self.mechanism, q)
        return [np.array([poses.at(place) for place in s.outline]) for s in self.shapes]

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
        runner = self._poses.within(joint.first, (joint.second, joint.on_second))
        self._rail('rail', joint.first, joint.on_first, joint.axis, runner)
        length, width = (self.symbol * x for x in _BOX)
        corners = ((-length, -width), (length, -width), (length, width), (-length, width))
        turn = joint.axis - joint.angle
        box = [(joint.second, _plus(joint.on_second, rotate(c, turn))) for c in corners]
        self.shapes.append(Shape('slider', tuple(box), joint.name))
        self._bodied.add(joint.second)
        self._reach(joint.second, joint.on_second)

    def _pin(self, joint: PinInSlot | Geneva | SlottedRack) -> None:
        """A pin of `first`, and the slots of `second`."""
        pin = joint.first, joint.on_first
        self.shapes.append(Shape('pin', (pin,), joint.name))
        self._reach(*pin)
        way = self._poses.within(joint.second, pin)
        if isinstance(joint, PinInSlot):
            self._rail('slot', joint.second, joint.on_second, joint.axis, way)
        elif isinstance(joint, Geneva):
            self._wheel(joint, way)
        else:
            self._rack(joint, way)

    def _cam(self, joint: CamPair) -> None:
        """A cam, and what touches it of its follower."""
        ux, uy = self._poses.along[joint.second][:, 0]
        turned = float(np.arctan2(uy, ux))
        outlines = [*cam_outlines(joint), follower_outline(joint, turned, self.symbol)]
        self.shapes += [Shape('cam', outline) for outline in outlines]
        self._bodied |= {joint.first, joint.second}
        self._reach(joint.second, joint.on_second)

    def _mesh(self, joint: GearMesh) -> None:
        """The gears of a mesh, each drawn once."""
        sides = (joint.first, joint.on_first), (joint.second, joint.on_second)
        for teeth, (link, at) in zip(joint.wheels, sides, strict=True):
            if teeth.name in self._geared:
                continue
            self._geared.add(teeth.name)
            if teeth.rack:
                outline = self._straight_teeth(joint, teeth)
            else:
                outline = teeth.gear.outline(6, teeth.tooth)
                if teeth.gear.internal:  # a ring around its teeth, cut open where they end
                    rim = teeth.gear.root_radius + 2.0 * teeth.gear.module
                    turn = np.linspace(0.0, 2.0 * math.pi, 181) + np.arctan2(*outline[0, ::-1])
                    circle = rim * np.stack([np.cos(turn), np.sin(turn)], axis=1)
                    outline = np.concatenate([outline, outline[:1], circle[::-1]])
                outline = outline + at
            places = tuple((link, (float(x), float(y))) for x, y in outline)
            self._gears.append((0.0 if teeth.rack else teeth.gear.tip_radius, places))
            if link != GROUND:
                self._bodied.add(link)

    def _straight_teeth(self, joint: GearMesh, teeth: Teeth) -> Array:
        """Of a rack, as many as the motion needs, with its back (k, 2) in its link's frame."""
        guide, gear = joint.guide, teeth.gear
        assert guide is not None  # noqa: S101 - on which it slides
        towards = joint.towards + math.pi - guide.angle
        out, along = (np.array(rotate((1.0, 0.0), towards + a)) for a in (0.0, 0.5 * math.pi))
        way = rotate((1.0, 0.0), guide.axis - guide.angle)
        first = teeth.tooth * float(along @ way)
        runner = self._poses.within(joint.second, (joint.first, joint.on_first))
        pitch = gear.circular_pitch
        visited = (along @ (runner - np.array(joint.on_second)[:, None]) - first) / pitch
        low, high = math.floor(visited.min()) - 3, math.ceil(visited.max()) + 3
        x, y = rack_teeth(high - low + 1, gear.module, gear.system).T
        back = -(gear.system.dedendum + 2.0) * gear.module
        x, y = np.append(x, [back, back]), np.append(y, [y[-1], y[0]]) + first + low * pitch
        return np.array(joint.on_second) + np.outer(x, out) + np.outer(y, along)

    def _rail(self, kind: Kind, link: str, base: Vector2, axis: float, runner: Array) -> None:
        """A line of a link, as long as what runs (2, N) on it needs."""
        way = rotate((1.0, 0.0), axis)
        along = way @ (runner - np.array(base)[:, None])
        spare = 2.5 * self.symbol
        ends = float(along.min()) - spare, float(along.max()) + spare
        start, end = (_plus(base, (s * way[0], s * way[1])) for s in ends)
        self.shapes.append(Shape(kind, ((link, start), (link, end))))
        if link != GROUND:
            self._rails.append((link, start, end))

    def _wheel(self, joint: Geneva, pin: Array) -> None:
        """A Geneva wheel: slots towards its centre, and hollows for the crank's arc between."""
        link, (x, y) = joint.second, joint.on_second
        away = pin - np.array([[x], [y]])
        reach, n = np.hypot(*away), joint.slots
        inside = reach < joint.entry * (1.0 + 1e-9)
        turn = float(np.angle(np.exp(1j * n * np.arctan2(*away[::-1]))[inside].sum())) / n
        self._bodied.add(link)

        def at(r: float, angle: float) -> Place:
            return link, (x + r * math.cos(angle), y + r * math.sin(angle))

        d, mouth = joint.distance, joint.entry
        crank = math.sqrt(d * d - mouth * mouth)
        hollow = 0.5 * (crank + d - mouth)
        rim = []
        for angle in np.linspace(0.0, 2.0 * math.pi, 24 * n, endpoint=False):
            aside = (angle + math.pi / n) % (2.0 * math.pi / n) - math.pi / n
            across = d * math.sin(aside)
            r = mouth
            if abs(across) < hollow:
                r = min(r, d * math.cos(aside) - math.sqrt(hollow**2 - across**2))
            rim.append(at(r, turn + math.pi / n + angle))
        self.shapes.append(Shape('wheel', tuple(rim)))
        deepest = float(reach.min()) - self.symbol
        for k in range(n):
            direction = turn + 2.0 * math.pi * k / n
            self.shapes.append(Shape('slot', (at(deepest, direction), at(mouth, direction))))

    def _rack(self, joint: SlottedRack, pin: Array) -> None:
        """The slots that the pin visits, and their neighbours."""
        link, base = joint.second, np.array(joint.on_second)
        ux, uy = self._poses.along[link][:, 0]  # a rack does not turn
        axis = joint.axis - math.atan2(uy, ux)
        along, across = (np.array(rotate((1.0, 0.0), axis + a)) for a in (0.0, 0.5 * math.pi))
        place = (joint.first, joint.on_first)
        from_centre = self._poses.at(place) - np.array(joint.centre)[:, None]
        driven = rotate((1.0, 0.0), joint.axis + 0.5 * math.pi) @ from_centre <= 0.0
        away = (pin - base[:, None])[:, driven]
        slots = np.round(along @ away / joint.pitch).astype(int) if driven.any() else np.zeros(1)
        ends = across @ away if driven.any() else np.zeros(1)
        spare = 1.5 * self.symbol
        low, high = float(ends.min()) - spare, float(ends.max()) + spare
        for k in range(int(slots.min()) - 1, int(slots.max()) + 2):
            foot = base + k * joint.pitch * along
            line = [foot + s * across for s in (low, high)]
            ends_of_slot = tuple((link, (float(p[0]), float(p[1]))) for p in line)
            self.shapes.append(Shape('slot', ends_of_slot))
            self._reach(*ends_of_slot[0])

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
        return Shape('link', tuple((link, corner) for corner in outline), link)


def skeleton_of(machine: Machine, q: Array, marks: Iterable[Place] = ()) -> Skeleton:
    """The skeleton of a machine with its springs; the parameters are those of `Skeleton`."""
    elements = machine.plan.elements(machine.mechanism)
    springs = [(e.first, e.second) for e in elements if isinstance(e, Spring)]
    return Skeleton(machine.mechanism, q, marks, springs)


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
