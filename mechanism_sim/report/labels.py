"""Names on a drawing, where they cover neither each other nor much of what is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from matplotlib.textpath import TextPath

from mechanism_sim.arrays import Array
from mechanism_sim.export.shapes import Shape, coil
from mechanism_sim.export.skeleton import Skeleton, strung
from mechanism_sim.planar.points import GROUND
from mechanism_sim.report.brush import Brush

_SIZE = 7.5  # of letters [points]
_STEP = 0.6  # between points of what is in the way, in units of symbols
_NAME, _PIN, _BAR = 6.0, 2.0, 1.0  # what covering such a point costs
_LATER = 0.8  # what a place costs more than the one before it
_AWAY = np.radians([0.0, 40.0, -40.0, 80.0, -80.0, 120.0, -120.0, 160.0, -160.0])


Move = Callable[[Array], None]
"""Takes a name to where the outline (k, 2) [m] of its shape is now."""


class _Spot(NamedTuple):
    """Where a name may stand: its middle (2,) [m] and how it is turned [rad]."""

    middle: Array
    turn: float


class Labels:
    """Writes the names of links and joints, each at the best of some places.

    Parameters
    ----------
    symbol : size of a joint [m]
    low, high : corners (2,) of the drawing [m]
    """

    def __init__(self, axes: Any, brush: Brush, symbol: float, low: Array, high: Array) -> None:
        self._axes, self._brush, self._s = axes, brush, symbol
        self._low, self._high = low, high
        self._points: list[Array] = []
        self._costs: list[Array] = []
        self._placed: list[tuple[Shape, Array]] = []

    def avoid(self, line: Array, cost: float = _BAR) -> None:
        """Keep names off a line (k, 2) [m]."""
        if len(line) > 1:
            far = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
            along = np.linspace(0.0, far[-1], 2 + int(min(far[-1] / (_STEP * self._s), 2000.0)))
            line = np.stack([np.interp(along, far, x) for x in line.T], axis=1)
        self._points.append(line)
        self._costs.append(np.full(len(line), cost))

    def write(self, skeleton: Skeleton, pose: Array, joints: bool) -> Move:
        """Name all links, and joints too, at a pose (L, 3 + M); gives what moves them to others.

        Names of what else is there keep off it.
        """

        def placed(shape: Shape, pose: Array, points: Array | None = None) -> Array:
            points = shape.outline if points is None else points
            return np.asarray(skeleton.placed(shape.link, points, pose[None])[0])

        self._placed = [(shape, placed(shape, pose)) for shape in skeleton.shapes]
        for shape, outline in self._placed:
            if shape.kind in ('pin', 'support', 'cog', 'point', 'drive'):
                self.avoid(placed(shape, pose, shape.hull), _PIN)
            elif shape.kind == 'rail':
                for curve in (c for path in shape.paths for c in path.curves):
                    self.avoid(placed(shape, pose, curve), _BAR)
            elif shape.paths:
                closed = [*range(len(outline)), 0] if len(outline) > 2 else slice(None)
                self.avoid(outline[closed], _BAR)
        still = np.zeros((1, len(skeleton.mounts), 3))
        for start, end in skeleton.coiled(pose[None], still)[:, 0]:
            self.avoid(coil(start, end, skeleton.symbol), _BAR)
        for ends in strung(skeleton, pose[None])[:, 0]:
            self.avoid(ends, _BAR)
        moves = []
        for named in ('link', 'joint'):
            for shape, outline in self._placed:
                if named == 'link' and shape.kind == 'link':
                    moves.append((shape, self._link(shape.label, outline)))
                elif named == 'joint' and joints and shape.kind in ('pin', 'slider'):
                    moves.append((shape, self._joint(shape, outline)))

        def move(pose: Array) -> None:
            for shape, take in moves:
                take(placed(shape, pose))

        return move

    def _link(self, name: str, outline: Array) -> Move:
        """Along a bar, on its outer side; inside a plate; above a slider that is all there is."""
        if len(outline) != 2:
            middle, high = outline.mean(axis=0), np.array([0.0, 2.2 * self._s + self._pt(5.0)])
            beside = np.array([0.0, 0.0]) if len(outline) > 2 else high
            aside = np.array([self._half(name)[0] + 2.2 * self._s, 0.0])
            return self._beside(name, outline, [beside, high, -high, aside, -aside], middle)
        half = self._half(name)[1] + 0.55 * self._s + self._pt(1.5)
        side = half * np.sign(self._outward(outline) or 1.0)
        ways = [(share, way) for share in (0.5, 0.36, 0.64, 0.25, 0.75) for way in (side, -side)]
        best = self._best(name, (_along(outline, *way) for way in ways))
        text, way = self._text(name, _along(outline, *ways[best])), ways[best]

        def move(now: Array) -> None:
            spot = _along(now, *way)
            text.set_position(spot.middle)
            text.set_rotation(np.degrees(spot.turn))

        return move

    def _joint(self, shape: Shape, outline: Array) -> Move:
        """Beside a joint where no link goes; below a pivot of the frame or a slider."""
        at = outline.mean(axis=0)
        half, name = self._half(shape.label), shape.label
        below = np.array([0.0, -3.2 * self._s - self._pt(2.0) - half[1]])
        above = np.array([0.0, 2.2 * self._s + self._pt(3.0) + half[1]])
        aside = np.array([2.4 * self._s + half[0], 0.0])
        places = [below, above, aside, -aside]
        if shape.link != GROUND and shape.kind != 'slider':
            places = [self._from(way, half) for way in self._free(at)] + [above, below]
        return self._beside(name, outline, places, at, style='italic')

    def _from(self, way: Array, half: Array) -> Array:
        """From a joint to the middle of a name that begins beside it."""
        start = (0.9 * self._s + self._pt(3.0)) * way
        return np.asarray(start + half * np.clip(1.6 * way, -1.0, 1.0))

    def _free(self, at: Array) -> Iterator[Array]:
        """Directions from a joint, that farthest from the links that meet there first."""
        links = [x for s, x in self._placed if s.kind == 'link']
        arms = [x.mean(axis=0) - at for x in links if np.hypot(*(x - at).T).min() < 1e-3 * self._s]
        arms = [arm / np.hypot(*arm) for arm in arms if np.hypot(*arm) > self._s]
        away = -np.sum([[0.0, 0.0], *arms], axis=0)
        if np.hypot(*away) < 0.5:  # links in line
            away = np.array([-arms[0][1], arms[0][0]]) if arms else np.array([0.0, 1.0])
        angle = np.arctan2(away[1], away[0])
        for turn in angle + _AWAY:
            yield np.array([np.cos(turn), np.sin(turn)])

    def _beside(
        self, name: str, outline: Array, places: Iterable[Array], at: Array, **more: Any
    ) -> Move:
        """A name that keeps its distance from the middle of an outline."""
        # and where many parts are in one place, a line or two farther up or down
        near, up = list(places), self._pt(11.0) * np.array([0.0, 1.0])
        offsets = [x + n * np.sign(x) * up for n in (0, 1, 2) for x in near]
        best = offsets[self._best(name, (_Spot(at + offset, 0.0) for offset in offsets))]
        text = self._text(name, _Spot(at + best, 0.0), **more)

        def move(now: Array) -> None:
            text.set_position(now.mean(axis=0) + best)

        return move

    def _best(self, name: str, spots: Iterable[_Spot]) -> int:
        """Which of the places costs least."""
        points, costs = np.concatenate(self._points), np.concatenate(self._costs)
        half = self._half(name) + self._pt(1.0)
        cheapest, best, chosen = np.inf, 0, None
        for k, spot in enumerate(spots):
            along = np.array([np.cos(spot.turn), np.sin(spot.turn)])
            box = np.stack([along, [-along[1], along[0]]])
            inside = (np.abs((points - spot.middle) @ box.T) < half).all(axis=1)
            reach = np.abs(box.T) @ half
            outside = (spot.middle - reach < self._low) | (spot.middle + reach > self._high)
            cost = costs[inside].sum() + _LATER * k + 1.5 * outside.sum()
            if cost < cheapest:
                cheapest, best, chosen = cost, k, spot.middle + _GRID * half @ box
        assert chosen is not None  # noqa: S101 - there is a place
        self._points.append(chosen)
        self._costs.append(np.full(len(chosen), _NAME))
        return best

    def _half(self, name: str) -> Array:
        """Half the width and height of a name [m]."""
        box = TextPath((0.0, 0.0), _readable(name), size=_SIZE).get_extents()
        return self._pt(0.5) * np.array([box.width, _SIZE])

    def _pt(self, points: float) -> float:
        return self._brush.thick(points)

    def _outward(self, bar: Array) -> float:
        """Positive if left of a bar, from its first end, is away from the drawing's middle."""
        start, end = bar
        away = 0.5 * (start + end - self._low - self._high)
        return float((end - start)[0] * away[1] - (end - start)[1] * away[0])

    def _text(self, name: str, spot: _Spot, **more: Any) -> Any:
        ground = {'boxstyle': 'square,pad=0.05', 'fc': 'white', 'ec': 'none', 'alpha': 0.7}
        return self._axes.text(
            *spot.middle, _readable(name), fontsize=_SIZE, zorder=9, bbox=ground, ha='center',
            va='center', rotation=np.degrees(spot.turn), **more,
        )  # fmt: skip


_GRID = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, 9), [-0.9, 0.0, 0.9]), axis=-1).reshape(-1, 2)


def _readable(name: str) -> str:
    return name.replace('_', ' ')


def _along(bar: Array, share: float, aside: float) -> _Spot:
    """A place beside a bar, to its left if `aside` [m] is positive, readable from below."""
    start, end = bar
    turn = np.arctan2(*(end - start)[::-1])
    across = np.array([-np.sin(turn), np.cos(turn)])
    upright = (turn + 0.5 * np.pi) % np.pi - 0.5 * np.pi
    return _Spot(start + share * (end - start) + aside * across, float(upright))
