"""Markers: what viewers draw of a machine, and the shapes of its links among them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.export.ideal import WORLD
from mechanism_sim.export.skeleton import Shape, Skeleton
from mechanism_sim.messages import ColorRGBA, Marker, MarkerArray, Point
from mechanism_sim.planar.mechanism import GROUND, Revolute, Vector2
from mechanism_sim.planar.view import Kind

Array = NDArray[np.float64]
Colour = tuple[float, float, float, float]
"""Red, green, blue, and how opaque, 0 to 1 each."""

STEEL: Colour = (0.55, 0.60, 0.66, 1.0)
INK: Colour = (0.15, 0.16, 0.18, 1.0)
PLATE: Colour = (0.55, 0.60, 0.66, 0.6)
FRAME: Colour = (0.42, 0.40, 0.36, 1.0)
WHITE: Colour = (0.95, 0.95, 0.95, 1.0)

NAMESPACES: dict[Kind, str] = {
    'rail': 'guides',
    'support': 'supports',
    'wheel': 'wheels',
    'cam': 'cams',
    'link': 'links',
    'slot': 'slots',
    'slider': 'sliders',
    'pin': 'pins',
}
"""Of the kinds of shapes; springs, which change their shape, are not among them."""

_LAYER = 0.5  # between kinds of shapes, in units of the drawing's symbols
_TURN = np.linspace(0.0, 2.0 * math.pi, 49)


def frame_of(link: str, prefix: str) -> str:
    """The frame of a link in ``/tf``; that of the ground is the world."""
    return f'{prefix}{WORLD if link == GROUND else link}'


def marker(
    namespace: str,
    number: int,
    frame: str,
    kind: int,
    colour: Colour,
    scale: tuple[float, float, float],
    points: Iterable[Vector2] = (),
    height: float = 0.0,
) -> Any:
    """A Marker that stays until another of its namespace and number takes its place.

    Parameters
    ----------
    kind : one of the constants of Marker
    scale : [m] what it means depends on the kind
    points : in its frame [m]
    height : of the points above the plane of motion [m]
    """  # fmt: skip
    message = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
    message.header.frame_id = frame
    message.pose.orientation.w = 1.0
    message.scale.x, message.scale.y, message.scale.z = map(float, scale)
    message.color = ColorRGBA(r=colour[0], g=colour[1], b=colour[2], a=colour[3])
    message.points = [Point(x=float(x), y=float(y), z=float(height)) for x, y in points]
    return message


def disc(
    namespace: str, number: int, frame: str, colour: Colour, radius: float, at: Vector2,
    height: float, thickness: float,
) -> Any:  # fmt: skip
    """A flat CYLINDER; radius, place, height and thickness in [m]."""
    size = 2.0 * radius, 2.0 * radius, thickness
    message = marker(namespace, number, frame, Marker.CYLINDER, colour, size)
    position = message.pose.position
    position.x, position.y, position.z = float(at[0]), float(at[1]), float(height)
    return message


def shapes(skeleton: Skeleton, prefix: str) -> Any:
    """MarkerArray of all that keeps its shape, locked to the frames of the links.

    A namespace is a kind of shapes, see `NAMESPACES`, and ``bushings`` those of revolute joints.
    """
    brush = _Brush(skeleton, prefix)
    for shape in skeleton.shapes:
        if shape.kind in NAMESPACES:
            brush.paint(shape)
    for made in brush.markers:
        made.frame_locked = True
    return MarkerArray(markers=brush.markers)


class _Brush:
    """Makes markers of shapes, numbered within their namespaces."""

    def __init__(self, skeleton: Skeleton, prefix: str) -> None:
        self.markers: list[Any] = []
        self._mechanism, self._s = skeleton.mechanism, skeleton.symbol
        self._prefix = prefix
        self._count: Counter[str] = Counter()

    def paint(self, shape: Shape) -> None:
        """Add what shows a shape; nothing for a link that is but a slider."""
        corners = [at for _, at in shape.outline]
        s, link = self._s, shape.link
        name = NAMESPACES[shape.kind]
        height = _LAYER * s * get_args(Kind).index(shape.kind)
        # links lie on each other
        height += 0.01 * _LAYER * s * self._count[name]
        if shape.kind == 'pin':
            self._pin(shape.label, height)
        elif shape.kind == 'support':
            (x, y) = corners[0]
            foot = [(x - 1.3 * s, y - 2.2 * s), (x + 1.3 * s, y - 2.2 * s), (x, y)]
            self._plate(name, link, foot, FRAME, height)
        elif shape.kind in ('wheel', 'cam'):
            self._line(name, link, _closed(corners), INK, 0.2, height)
        elif shape.kind == 'slot':
            self._line(name, link, corners, WHITE, 0.9, height)
        elif shape.kind == 'rail':
            ground = link == GROUND
            colour, width = (FRAME, 0.2) if ground else (STEEL, 0.6)
            self._line(name, link, corners, colour, width, height)
        elif len(corners) > 2:
            self._plate(name, link, corners, PLATE, height)
            width = 0.2 if shape.kind == 'slider' else 1.0
            self._line(name, link, _closed(corners), INK if width < 1.0 else STEEL, width, height)
        elif len(corners) == 2:
            self._line(name, link, corners, STEEL, 1.1, height)

    def _pin(self, name: str, height: float) -> None:
        """On the first-named link; in a revolute joint in a bushing on the second-named one."""
        joint, s = self._mechanism.joint(name), self._s
        frame, number = frame_of(joint.first, self._prefix), self._number('pins')
        self.markers.append(
            disc('pins', number, frame, WHITE, 0.6 * s, joint.on_first, height, 0.1 * s)
        )
        if isinstance(joint, Revolute):
            x, y = joint.on_second
            ring = [(x + 0.75 * s * math.cos(a), y + 0.75 * s * math.sin(a)) for a in _TURN]
            self._line('bushings', joint.second, ring, INK, 0.3, height)

    def _line(
        self, name: str, link: str, points: Sequence[Vector2], colour: Colour, width: float,
        height: float,
    ) -> None:  # fmt: skip
        size = width * self._s, 0.0, 0.0
        self._add(name, link, Marker.LINE_STRIP, colour, size, points, height)

    def _plate(
        self, name: str, link: str, corners: Sequence[Vector2], colour: Colour, height: float
    ) -> None:
        """A convex plate, as a fan of triangles."""
        fan = [
            corner
            for second, third in pairwise(corners[1:])
            for corner in (corners[0], second, third)
        ]
        self._add(name, link, Marker.TRIANGLE_LIST, colour, (1.0, 1.0, 1.0), fan, height)

    def _add(
        self, name: str, link: str, kind: int, colour: Colour,
        scale: tuple[float, float, float], points: Sequence[Vector2], height: float,
    ) -> None:  # fmt: skip
        frame = frame_of(link, self._prefix)
        made = marker(name, self._number(name), frame, kind, colour, scale, points, height)
        self.markers.append(made)

    def _number(self, name: str) -> int:
        self._count[name] += 1
        return self._count[name] - 1


def _closed(corners: Sequence[Vector2]) -> list[Vector2]:
    return [*corners, corners[0]]
