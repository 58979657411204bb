"""Paints the shapes of a mechanism on Matplotlib axes, and moves them to other poses."""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.transforms import Affine2D

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import ACCENT, INK, PAPER, colour, tint
from mechanism_sim.export.shapes import OPEN, Shape, ShapePath, coil, subdivided
from mechanism_sim.export.skeleton import Skeleton, strung
from mechanism_sim.planar.points import GROUND

GHOST = '0.72'


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
        """So many points of print in metres of the drawing."""
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

    def ghost(self, pose: Array, shade: str = GHOST) -> None:
        """Links and sliders at another pose (L, 3 + M), as lines."""
        for shape in self._skeleton.shapes:
            if shape.link == GROUND or shape.kind in ('bushing', 'pin', 'point', 'cog', 'drive'):
                continue
            x, y, angle = pose[self._skeleton.links.index(shape.link), :3].tolist()
            bare = shape.kind == 'link' and len(shape.outline) < 2
            curve = _spine(shape) if not bare else None
            if curve is not None:
                if shape.bends:
                    curve = subdivided(curve, shape.symbol)
                path = self._deformed(shape.link, ShapePath('line', (curve,)), pose)
                frame = Affine2D().rotate(angle).translate(x, y)
                self._patch(path, frame, zorder=1.2, fc='none', ec=shade, lw=0.8)

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
    """How Matplotlib fills and borders a path of a link of this number."""
    shade = colour(number)
    if style in OPEN:
        return {'fc': 'none', 'ec': INK, 'lw': 1.0 if style == 'line' else 0.6}
    if style in ('body', 'plate'):
        alpha = 1.0 if style == 'body' else 0.75
        return {'fc': (tint(shade), alpha), 'ec': shade, 'lw': 0.9}
    if style == 'paper':
        return {'fc': PAPER, 'ec': INK, 'lw': 0.9}
    return {'fc': INK if style == 'ink' else ACCENT, 'ec': 'none', 'lw': 0.0}


def _spine(shape: Shape) -> Array:
    """A bar's ends, or the edge of another shape."""
    return shape.outline if len(shape.outline) == 2 else _closed(shape.outline)


def _closed(outline: Array) -> Array:
    return np.concatenate([outline, outline[:1]])
