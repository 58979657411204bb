"""Markers: what viewers draw of a machine, and the shapes of its links among them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any, get_args

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export.ideal import frame_of
from mechanism_sim.export.palette import ACCENT, INK, PAPER, colour, rgb, tint
from mechanism_sim.export.shapes import OPEN, Shape, Style
from mechanism_sim.export.skeleton import Skeleton
from mechanism_sim.export.triangles import triangles
from mechanism_sim.messages import ColorRGBA, Marker, MarkerArray, Point
from mechanism_sim.planar.points import Vector2
from mechanism_sim.planar.view import Kind

Colour = tuple[float, float, float, float]
"""Red, green, blue, and how opaque, 0 to 1 each."""

STEEL: Colour = (0.55, 0.60, 0.66, 1.0)

NAMESPACES: dict[Kind, str] = {
    'frame': 'frames',
    'belt': 'belts',
    'wheel': 'wheels',
    'cam': 'cams',
    'rail': 'guides',
    'support': 'supports',
    'link': 'links',
    'slot': 'slots',
    'slider': 'sliders',
    'bushing': 'bushings',
    'pin': 'pins',
    'cog': 'centres_of_gravity',
    'point': 'points',
    'drive': 'drives',
}
"""Of the kinds of shapes."""

_LAYER = 0.5  # between kinds of shapes, in units of the drawing's symbols
_EDGE = 0.12  # width of lines, likewise


def marker(
    namespace: str,
    number: int,
    frame: str,
    kind: int,
    colour: Colour,
    scale: tuple[float, float, float],
    points: Iterable[Vector2] | Array = (),
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


def shapes(skeleton: Skeleton, prefix: str) -> Any:
    """MarkerArray of all that stands still in the frames of the links, and keeps its shape."""
    made = [
        each
        for shape, each, _ in painted(skeleton, prefix)
        if not (shape.link in skeleton.bendings or sways(skeleton, shape))
    ]
    return MarkerArray(markers=made)


def sways(skeleton: Skeleton, shape: Shape) -> bool:
    """True if a shape is a frame on springs that is known to sway."""
    return shape.kind == 'frame' and shape.label in skeleton.sways


def painted(skeleton: Skeleton, prefix: str) -> list[tuple[Shape, Any, Array]]:
    """Markers of the shapes, locked to the frames of links: shape, marker, its points (k, 2) [m].

    A namespace is a kind of shapes, see `NAMESPACES`: what is filled as triangles, then edges.
    """
    made: list[tuple[Shape, Any, Array]] = []
    count: Counter[str] = Counter()
    kinds, s = get_args(Kind), skeleton.symbol
    for shape in skeleton.shapes:
        name, frame = NAMESPACES[shape.kind], frame_of(shape.link, prefix)
        for path in shape.paths:
            # links lie on each other
            height = _LAYER * s * (kinds.index(shape.kind) + 0.02 * count[name])
            fill, edge = _colours(path.style, shape.number)
            if fill is not None:
                corners = triangles(path.curves).reshape(-1, 2)
                filled = marker(
                    name, count[name], frame, Marker.TRIANGLE_LIST, fill, (1.0, 1.0, 1.0),
                    corners, height,
                )  # fmt: skip
                made.append((shape, filled, corners))
                count[name] += 1
            if edge is not None:
                lines = (np.stack([c, np.roll(c, -1, axis=0)], axis=1) for c in path.curves)
                if path.style in OPEN:
                    lines = (np.stack([c[:-1], c[1:]], axis=1) for c in path.curves)
                ends = np.concatenate(list(lines)).reshape(-1, 2)
                drawn = marker(
                    name, count[name], frame, Marker.LINE_LIST, edge,
                    (_EDGE * s, 0.0, 0.0), ends, height + 0.1 * _LAYER * s,
                )  # fmt: skip
                made.append((shape, drawn, ends))
                count[name] += 1
    for _, each, _ in made:
        each.frame_locked = True
    return made


def _colours(style: Style, number: int) -> tuple[Colour | None, Colour | None]:
    """Of what is filled, and of its edge."""
    own, ink = (*rgb(colour(number)), 1.0), (*rgb(INK), 1.0)
    if style in OPEN:
        return None, ink
    if style in ('body', 'plate'):
        return (*rgb(tint(colour(number))), 1.0 if style == 'body' else 0.75), own
    if style == 'paper':
        return (*rgb(PAPER), 1.0), ink
    return (*rgb(INK if style == 'ink' else ACCENT), 1.0), None
