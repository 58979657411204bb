"""Machines on Matplotlib axes: shapes and names, at an instant or moving, ghosts and paths."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import count
from itertools import cycle as endless
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath
from matplotlib.transforms import Affine2D

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import ACCENT, INK, PAPER, colour, tint
from mechanism_sim.export.shapes import OPEN, Shape, ShapePath, coil, subdivided
from mechanism_sim.export.skeleton import Skeleton, bounds, scale_of, skeleton_of, strung
from mechanism_sim.planar.points import GROUND
from mechanism_sim.report.picture import Picture
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.quantities.motion import choose_points

_SIDES = 7.5, 6.0  # width and height of a picture at most [in]

PATHS = ('-', '--', '-.', ':')
_SIZE = 7.5  # size of letters [points]
_STEP = 0.6  # distance of sampled points of obstacles, in symbols
_NAME, _PIN, _BAR = 6.0, 2.0, 1.0  # cost of covering such a point
_LATER = 0.8  # added cost of each further position
_AWAY = np.radians([0.0, 40.0, -40.0, 80.0, -80.0, 120.0, -120.0, 160.0, -160.0])


Move = Callable[[Array], None]
"""Takes a name to where the outline (k, 2) [m] of its shape is now."""
_GHOST = '0.72'


class Brush:
    """Paints a machine on axes in metres with equal aspect.

    Parameters
    ----------
    metre : points of print in a metre
    """

    def __init__(self, axes: Any, skeleton: Skeleton, metre: float) -> None:
        self._axes, self._skeleton, self._metre = axes, skeleton, metre
        self._layers = count()
        self._frames = {link: Affine2D() for link in skeleton.links}
        self._swaying = {name: Affine2D() for name in skeleton.mounts}
        self._coils: Any = None
        self._bent: list[tuple[str, ShapePath, Any]] = []

    def thick(self, points: float) -> float:
        """Length in metres of the drawing of a number of points of print."""
        return points / self._metre

    def paint(self, pose: Array) -> None:
        """The whole machine at a pose of `Skeleton.poses` (L, 3 + M), its frames at rest."""
        self._coils = LineCollection(
            [], colors=INK, linewidths=0.9, zorder=1.0, joinstyle='round', capstyle='round'
        )
        self._axes.add_collection(self._coils, autolim=False)
        for shape in self._skeleton.shapes:
            known = self._swaying if shape.kind == 'frame' else self._frames
            frame = known.get(shape.label if shape.kind == 'frame' else shape.link, Affine2D())
            for path in shape.paths:
                layer = 1.5 + 0.002 * next(self._layers)
                patch = self._patch(path, frame, zorder=layer, **_look(path.style, shape.number))
                patch.set_gid(f'{shape.kind}-{shape.label}')
                if shape.bends:
                    self._bent.append((shape.link, path, patch))
        self.move(pose)

    def move(self, pose: Array, sway: Array | None = None) -> None:
        """Move what was painted to another pose (L, 3 + M), and sway (F, 3) of frames."""
        skeleton = self._skeleton
        sway = np.zeros((len(skeleton.mounts), 3)) if sway is None else sway
        for frame, (x, y, angle) in zip(self._frames.values(), pose[:, :3].tolist(), strict=True):
            frame.clear().rotate(angle).translate(x, y)
        for link, path, patch in self._bent:
            patch.set_path(_outline(self._deformed(link, path, pose)))
        for (name, (cog, _)), (x, y, angle) in zip(
            skeleton.mounts.items(), sway.tolist(), strict=True
        ):
            self._swaying[name].clear().rotate_around(*cog, angle).translate(x, y)
        ends = skeleton.coiled(pose[None], sway[None])[:, 0]
        coils = [coil(start, end, skeleton.symbol) for start, end in ends]
        self._coils.set_segments([*coils, *strung(skeleton, pose[None])[:, 0]])

    def ghost(self, pose: Array) -> None:
        """Links and sliders at another pose (L, 3 + M), as lines."""
        for shape in self._skeleton.shapes:
            if shape.link == GROUND or shape.kind in ('bushing', 'pin', 'point', 'cog', 'drive'):
                continue
            x, y, angle = pose[self._skeleton.links.index(shape.link), :3].tolist()
            bare = shape.kind == 'link' and len(shape.outline) < 2
            if not bare:  # a bar's ends, or the edge of another shape
                curve = shape.outline if len(shape.outline) == 2 else _closed(shape.outline)
                if shape.bends:
                    curve = subdivided(curve, shape.symbol)
                path = self._deformed(shape.link, ShapePath('line', (curve,)), pose)
                frame = Affine2D().rotate(angle).translate(x, y)
                self._patch(path, frame, zorder=1.2, fc='none', ec=_GHOST, lw=0.8)

    def _patch(self, path: ShapePath, frame: Affine2D, **how: Any) -> Any:
        patch = PathPatch(_outline(path), joinstyle='round', capstyle='round', **how)
        patch.set_transform(frame + self._axes.transData)
        return self._axes.add_artist(patch)

    def _deformed(self, link: str, path: ShapePath, pose: Array) -> ShapePath:
        return ShapePath(
            path.style, tuple(self._skeleton.deformed(link, c, pose) for c in path.curves)
        )


def _outline(path: ShapePath) -> Outline:
    closed = path.style not in OPEN
    return Outline.make_compound_path(*(Outline(_closed(c) if closed else c) for c in path.curves))


def _look(style: str, number: int) -> dict[str, Any]:
    """Fill and edge of a path for Matplotlib, of a link of this number."""
    shade = colour(number)
    if style in OPEN:
        return {'fc': 'none', 'ec': INK, 'lw': 1.0 if style == 'line' else 0.6}
    if style in ('body', 'plate'):
        alpha = 1.0 if style == 'body' else 0.75
        return {'fc': (tint(shade), alpha), 'ec': shade, 'lw': 0.9}
    if style == 'paper':
        return {'fc': PAPER, 'ec': INK, 'lw': 0.9}
    return {'fc': INK if style == 'ink' else ACCENT, 'ec': 'none', 'lw': 0.0}


def _closed(outline: Array) -> Array:
    return np.concatenate([outline, outline[:1]])


class _Spot(NamedTuple):
    """Candidate position of a name: its middle (2,) [m] and rotation [rad]."""

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
        """Label a link: along a bar, on its outer side; inside a plate; above a lone slider.

        Beside a bar, too, that is shorter than its name.
        """
        if len(outline) != 2:
            middle, high = outline.mean(axis=0), np.array([0.0, 2.2 * self._s + self._pt(5.0)])
            beside = np.array([0.0, 0.0]) if len(outline) > 2 else high
            aside = np.array([self._half(name)[0] + 2.2 * self._s, 0.0])
            return self._beside(name, outline, [beside, high, -high, aside, -aside], middle)
        half, gap = self._half(name), 0.55 * self._s + self._pt(1.5)
        side = (half[1] + gap) * np.sign(self._outward(outline) or 1.0)
        ways = [(share, way) for share in (0.5, 0.36, 0.64, 0.25, 0.75) for way in (side, -side)]
        spots, middle = [_along(outline, *way) for way in ways], outline.mean(axis=0)
        if 2.0 * half[0] > np.hypot(*(outline[1] - outline[0])):
            aside = half[0] + 2.0 * gap
            spots += [
                _Spot(middle + np.array([x, y * self._pt(_SIZE)]), 0.0)
                for y in (0.0, 1.0, -1.0) for x in (aside, -aside)
            ]  # fmt: skip
        best = self._best(name, spots)
        text = self._text(name, spots[best])
        if best >= len(ways):
            return _following(text, spots[best].middle - middle)
        way = ways[best]

        def move(now: Array) -> None:
            spot = _along(now, *way)
            text.set_position(spot.middle)
            text.set_rotation(np.degrees(spot.turn))

        return move

    def _joint(self, shape: Shape, outline: Array) -> Move:
        """Label a joint away from links; below a pivot of the frame or a slider."""
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
        """Vector from a joint to the centre of a name that begins beside it."""
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
        return _following(self._text(name, _Spot(at + best, 0.0), **more), best)

    def _best(self, name: str, spots: Iterable[_Spot]) -> int:
        """Index of the candidate position of least cost."""
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


def _following(text: Any, offset: Array) -> Move:
    """Keep a name at an offset from the middle of an outline."""
    return lambda now: text.set_position(now.mean(axis=0) + offset)


def _readable(name: str) -> str:
    return name.replace('_', ' ')


def _along(bar: Array, share: float, aside: float) -> _Spot:
    """A place beside a bar, to its left if `aside` [m] is positive, readable from below."""
    start, end = bar
    turn = np.arctan2(*(end - start)[::-1])
    across = np.array([-np.sin(turn), np.cos(turn)])
    upright = (turn + 0.5 * np.pi) % np.pi - 0.5 * np.pi
    return _Spot(start + share * (end - start) + aside * across, float(upright))


def draw(
    cycle: Cycle,
    t: float,
    positions: int = 1,
    labels: Literal['all', 'links', 'none'] = 'all',
    magnified: float = 0.0,
) -> Picture:
    """A machine at one instant, with the paths of the cycle's points.

    Parameters
    ----------
    t : [s] within the cycle
    positions : this one, and as many others as ghosts, evenly over the cycle
    labels : labels of links and joints, of links only, or none
    magnified : magnification of elastic deformations; 0 for a visible one
    """
    sweep = _coordinates(cycle, cycle.t)
    skeleton = skeleton_of(cycle.machine, sweep, magnified)
    (now,) = skeleton.poses(_coordinates(cycle, np.array([t])))
    since = np.arange(1, positions) / positions * cycle.duration
    others = cycle.t[0] + (t - cycle.t[0] + since) % cycle.duration
    passed = skeleton.poses(sweep)
    low, high = bounds(skeleton, np.concatenate([passed, now[None]]))
    figure = Picture()
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    inch = float(max((high - low) / _SIDES))  # [m] in the drawing
    brush = Brush(axes, skeleton, 72.0 / inch)
    names = Labels(axes, brush, skeleton.symbol, low, high)
    if positions > 1:
        for pose in skeleton.poses(_coordinates(cycle, others)):
            brush.ghost(pose)
    points = choose_points(cycle.machine, cycle.points)
    for (name, (link, at)), line in zip(points.items(), endless(PATHS)):
        path = skeleton.placed(link, np.array([at]), passed)[:, 0]
        trace(axes, skeleton, name, path, line)
        here = skeleton.placed(link, np.array([at]), now[None])[0]
        axes.plot(*here.T, 'o', color=INK, ms=3.0, zorder=4.5)
        names.avoid(path)
    brush.paint(now)
    if labels != 'none':
        names.write(skeleton, now, labels == 'all')
    title = brush.thick(14.0)
    axes.text(
        0.5 * (low[0] + high[0]), high[1] + 0.6 * title, cycle.machine.scene.title,
        ha='center', va='bottom', fontsize=10.0,
    )  # fmt: skip
    if len(cycle.points) > 1:
        axes.legend(loc='lower right', frameon=False, fontsize=7.0)
    bottom, top = low[1] - 1.4 * title, high[1] + 2.6 * title
    rule(axes, skeleton, (low[0] + title, bottom + 0.5 * title), high[0] - low[0])
    figure.set_size_inches((high[0] - low[0]) / inch, (top - bottom) / inch)
    axes.set(xlim=(low[0], high[0]), ylim=(bottom, top), aspect='equal')
    axes.set_axis_off()
    return figure


def trace(axes: Any, skeleton: Skeleton, point: str, path: Array, line: Any) -> None:
    """The path (k, 2) of a point of a link, in the colour of its link."""
    link = point.partition('.')[0]
    shade = colour(skeleton.links.index(link) if link in skeleton.links else -1)
    axes.plot(*path.T, color=shade, lw=1.0, ls=line, zorder=1.4, label=point)


def rule(axes: Any, skeleton: Skeleton, at: Sequence[float] | Array, width: float) -> None:
    """The scale bar of a drawing that is so wide [m]."""
    length, text = scale_of(skeleton, width)
    x = np.array([at[0], at[0] + length])
    axes.plot(
        x, [at[1]] * 2, color=INK, lw=1.6, solid_capstyle='butt', zorder=8.0, marker='|', ms=5
    )
    axes.annotate(
        text, (x[1], at[1]), (4.0, 0.0), textcoords='offset points', va='center',
        fontsize=7.0, color=INK,
    )  # fmt: skip


def _coordinates(cycle: Cycle, t: Array) -> Array:
    return cycle.solution.view(t).observed.local
