"""Shapes of parts of a machine: curves in the frames of links, made once for every viewer.

A shape has a kind, a link and the curves that define it; its paths are painted, as
polygons and lines, from back to front. Viewers (figures, pages, markers) paint paths by their
style and the colour of the link, independent of kinds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.view import SLOT, Kind, circle, points_of

Style = Literal['body', 'plate', 'paper', 'ink', 'line', 'thin', 'accent']
"""How a path is painted: closed curves filled in the link's colour, the same but see-through, in
the colour of the paper, of ink, or of what drives; open curves as a line, or a thin one."""

OPEN = 'line', 'thin'

BAR, BOX, PIN, BUSHING, MARK = 0.55, (1.7, 1.1), 0.62, (0.82, 1.15), 0.32
"""Sizes in units of symbols: half width of bars; half length and width of sliders; radius of pins;
inner and outer radius of the bushings of loose joints; radius of marked points."""

_FINE = 0.015  # tolerance of edges of bodies, in symbols

COIL = np.stack(
    [
        [0.0, *np.linspace(0.15, 0.85, 15), 1.0],
        [0.0, 0.0, *(0.9 * (-1.0) ** np.arange(13)), 0.0, 0.0],
    ],
    axis=1,
)
"""A spring (17, 2): how far along the line between its ends, 0 to 1; across it, in symbols."""


class ShapePath(NamedTuple):
    """Curves that are painted together, filled by the even-odd rule."""

    style: Style
    curves: tuple[Array, ...]  #: (k, 2) [m] each, in the link's frame


@dataclass(frozen=True, eq=False)
class Shape:
    """A part of a drawing."""

    kind: Kind  #: kind of the part
    link: str  #: link that carries it
    #: (k, 2) [m] defining curves in the link's frame: a single point, ends, corners
    curves: tuple[Array, ...]
    symbol: float  #: size of a joint in this drawing [m]
    label: str = ''  #: label of the link or joint; empty for none
    size: float = 0.0  #: size of wheels and hands, the largest of which are painted first
    number: int = -1  #: index of the moving link, which selects its colour; -1 for the ground
    bends: bool = False  #: True for an elastic link, whose edges have points enough to bend

    @property
    def outline(self) -> Array:
        """The first of the curves (k, 2) [m]."""
        return self.curves[0]

    @cached_property
    def paths(self) -> tuple[ShapePath, ...]:
        """Paths in the order of painting, from back to front."""
        return tuple(
            ShapePath(style, self._fine(curves if style in OPEN else _turned(curves), style))
            for style, curves in _BUILDERS.get(self.kind, _body)(self)
        )

    @property
    def edges(self) -> tuple[Array, ...]:
        """Curves of a body in full, holes clockwise; `paths` are simplified for pictures.

        Empty for shapes that are built from a few points.
        """
        return () if self.kind in _BUILDERS else _turned(self.curves)

    @cached_property
    def hull(self) -> Array:
        """Points (k, 2) [m] around all painted curves, or the outline if there are none."""
        curves = [curve for path in self.paths for curve in path.curves]
        points = np.concatenate(curves or [self.outline])
        return points if self.bends else around(points)

    def _fine(self, curves: tuple[Array, ...], style: Style) -> tuple[Array, ...]:
        if not self.bends:
            return curves
        return tuple(subdivided(c, 0.5 * self.symbol, style not in OPEN) for c in curves)


def coil(start: Array, end: Array, symbol: float) -> Array:
    """A spring between two points (2,) of the world, (17, 2) [m]."""
    way = end - start
    across = np.array([-way[1], way[0]]) * symbol / max(float(np.hypot(*way)), 1e-300)
    return np.asarray(start + COIL @ np.stack([way, across]))


def subdivided(curve: Array, longest: float, closed: bool = False) -> Array:
    """A curve (k, 2) with points added on edges longer than a limit [m]."""
    ends = np.concatenate([curve, curve[:1]]) if closed else curve
    counts = np.ceil(np.hypot(*np.diff(ends, axis=0).T) / longest).astype(int).clip(1)
    at = [i + np.arange(n) / n for i, n in enumerate(counts)]
    along = np.concatenate(at if closed else [*at, [float(len(counts))]])
    return np.stack([np.interp(along, np.arange(len(ends)), x) for x in ends.T], axis=1)


def rounded(points: Array, radius: float) -> Array:
    """The edge of the convex plate (k, 2) [m] with a margin around points (n, 2) [m]."""
    return around((points[:, None] + circle(radius, points=24)).reshape(-1, 2))


def around(points: Array) -> Array:
    """Corners of the convex hull of points (n, 2), counterclockwise; all points of a line."""
    if len(points) < 3 or min(np.ptp(points, axis=0)) == 0.0:
        return points
    return np.asarray(points[scipy.spatial.ConvexHull(points).vertices])


def inside(hull: Array, point: Array, spare: float) -> bool:
    """True if a point (2,) is inside a counterclockwise convex polygon (k, 2), or near it [m]."""
    way, to = np.roll(hull, -1, axis=0) - hull, point - hull
    off = way[:, 0] * to[:, 1] - way[:, 1] * to[:, 0]
    return bool((off >= -spare * np.hypot(*way.T)).all())


def _turned(curves: tuple[Array, ...]) -> tuple[Array, ...]:
    """Closed curves, clockwise inside an odd number of others: holes by either fill rule."""
    depths = [
        sum(encloses(other, c[:2].mean(axis=0)) for other in curves if other is not c)
        for c in curves
    ]
    return tuple(
        curve[:: 1 if (area(curve) > 0.0) == (depth % 2 == 0) else -1]
        for curve, depth in zip(curves, depths, strict=True)
    )


def encloses(curve: Array, point: Array) -> bool:
    """True if a closed curve (k, 2) encloses a point (2,), by crossings of a ray along x."""
    (x, y), (u, v) = curve.T, np.roll(curve, -1, axis=0).T
    across = (y > point[1]) != (v > point[1])
    along = x[across] + (point[1] - y[across]) / (v - y)[across] * (u - x)[across]
    return bool(np.count_nonzero(along > point[0]) % 2)


def area(curve: Array) -> float:
    """Area within a closed curve (k, 2), positive if it runs counterclockwise."""
    (x, y), (u, v) = curve.T, np.roll(curve, -1, axis=0).T
    return 0.5 * float(x @ v - y @ u)


def simplified(curve: Array, tolerance: float) -> Array:
    """A closed curve (k, 2) without points that are within a tolerance of chords.

    D. H. Douglas, T. K. Peucker, Cartographica 10(2), 1973, from the first point and the one
    farthest from it.
    """
    points, each = np.concatenate([curve, curve[:1]]), np.arange(len(curve))
    far = int(np.hypot(*(curve - curve[0]).T).argmax())
    kept = np.unique([0, far, len(curve)])
    while True:  # all spans between kept points at once
        span = np.searchsorted(kept, each, 'right') - 1
        first, last = points[kept[:-1]][span], points[kept[1:]][span]
        way, to = last - first, curve - first
        square = (way * way).sum(axis=1)
        share = np.clip((to * way).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        off = np.hypot(*(to - share[:, None] * way).T)
        off[kept[:-1]] = 0.0
        most = np.maximum.reduceat(off, kept[:-1])
        apart = np.flatnonzero((off == most[span]) & (off > tolerance))
        if not apart.size:
            return np.asarray(curve[kept[:-1]])
        kept = np.union1d(kept, apart[np.unique(span[apart], return_index=True)[1]])


def _body(shape: Shape) -> list[ShapePath]:
    fine = tuple(simplified(curve, _FINE * shape.symbol) for curve in shape.curves)
    return [ShapePath('body', fine)]


def _link(shape: Shape) -> list[ShapePath]:
    """A bar or a plate around all corners; empty for a link that is only a slider or a wheel."""
    corners = np.concatenate(shape.curves)
    if len(corners) < 2:
        return []
    thick = BAR * shape.symbol
    return [ShapePath('body' if len(shape.outline) < 3 else 'plate', (rounded(corners, thick),))]


def _frame(shape: Shape) -> list[ShapePath]:
    return [ShapePath('plate', (rounded(shape.outline, 1.5 * shape.symbol),))]


def _slot(shape: Shape) -> list[ShapePath]:
    inner, outer = (rounded(shape.outline, x * shape.symbol) for x in (SLOT, SLOT + 0.35))
    return [ShapePath('body', (outer, inner)), ShapePath('paper', (inner,))]


def _rail(shape: Shape) -> list[ShapePath]:
    """A rod of a link; for the frame a line, hatched below the slider.

    For a guide with clearance each wall, hatched on its outer side.
    """
    if shape.link != GROUND:
        return [ShapePath('body', (rounded(shape.outline, 0.6 * BAR * shape.symbol),))]
    start, end = shape.outline
    along = (end - start) / np.hypot(*(end - start))
    below = np.array([along[1], -along[0]])
    if shape.label:  # a wall: the slider is on its other side
        below = -below if shape.label == 'left wall' else below
        return _hatched(shape.outline, below, shape.symbol)
    below = -below if below[1] > 1e-9 else below
    foot = shape.outline + 1.1 * shape.symbol * below
    return [ShapePath('line', (shape.outline,)), *_hatched(foot, below, shape.symbol)]


def _support(shape: Shape) -> list[ShapePath]:
    at, s = shape.outline[0], shape.symbol
    foot = at + s * np.array([[-1.3, -2.2], [1.3, -2.2]])
    line = at + s * np.array([[-2.0, -2.2], [2.0, -2.2]])
    triangle = np.array([at, *foot])
    return [ShapePath('paper', (triangle,)), *_hatched(line, np.array([0.0, -1.0]), s)]


def _hatched(line: Array, below: Array, s: float) -> list[ShapePath]:
    """The frame: a line (2, 2) with strokes on one side."""
    length = float(np.hypot(*(line[1] - line[0])))
    along = (line[1] - line[0]) / length
    feet = line[0] + np.arange(0.75 * s, length, 0.8 * s)[:, None] * along
    strokes = tuple(np.array([foot, foot + 0.7 * s * (below - along)]) for foot in feet)
    return [ShapePath('line', (line,)), ShapePath('thin', strokes)]


def _belt(shape: Shape) -> list[ShapePath]:
    return [ShapePath('line', shape.curves)]


def _disc(style: Style, *radii: float) -> Callable[[Shape], list[ShapePath]]:
    def build(shape: Shape) -> list[ShapePath]:
        at = shape.outline[0]
        return [ShapePath(style, tuple(circle(r * shape.symbol, at, 32) for r in radii))]

    return build


def _cog(shape: Shape) -> list[ShapePath]:
    """A disc, quartered."""
    at, radius = shape.outline[0], 0.5 * shape.symbol
    quarters = []
    for start in (0.0, np.pi):
        turn = start + np.linspace(0.0, 0.5 * np.pi, 9)
        quarters.append(at + radius * np.vstack([[0.0, 0.0], points_of(np.exp(1j * turn))]))
    return [ShapePath('paper', (circle(radius, at, 32),)), ShapePath('ink', tuple(quarters))]


def _drive(shape: Shape) -> list[ShapePath]:
    """An arrow: straight from the first point towards the second, or round the first one."""
    (at, towards), s = shape.outline, shape.symbol
    if shape.label == 'straight':
        reach, line = complex(4.0, 0.0), np.array([0.0, 4.0], complex)
    else:
        line = 3.4 * np.exp(1j * np.radians(np.linspace(-65.0, 65.0, 25)))
        reach = complex(line[-1])
    ahead = np.gradient(line)
    ahead /= np.abs(ahead)
    head = reach + ahead[-1] * np.array([1.7, 0.8j, -0.8j])
    band = np.concatenate([line + 0.15j * ahead, (line - 0.15j * ahead)[::-1]])
    way = complex(*(towards - at)) / math.dist(towards, at)
    sides = (x.conj() if shape.label == 'clockwise' else x for x in (band, head))
    return [ShapePath('accent', (points_of(s * way * x) + at,)) for x in sides]


_BUILDERS: dict[Kind, Callable[[Shape], list[ShapePath]]] = {
    'frame': _frame,
    'rail': _rail,
    'support': _support,
    'belt': _belt,
    'link': _link,
    'slot': _slot,
    'bushing': _disc('body', BUSHING[1], BUSHING[0]),
    'pin': _disc('paper', PIN),
    'cog': _cog,
    'point': _disc('ink', MARK),
    'drive': _drive,
}
"""Shapes of the kinds that are not just bodies: wheels, cams, sliders."""
