"""Paints the shapes of a mechanism, and moves what it has painted to other positions."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np
from matplotlib.patches import Circle, Polygon

from mechanism_sim.arrays import Array
from mechanism_sim.export.skeleton import Shape, zigzag
from mechanism_sim.planar.mechanism import GROUND

Move = Callable[[Array], None]
"""Takes what was painted of a shape to where its outline (k, 2) [m] is now."""

INK, FILL, GHOST = '0.15', '0.93', '0.72'


class Brush:
    """Paints shapes on axes where a metre is so many points of print.

    Parameters
    ----------
    axes : Matplotlib's, in metres, with equal aspect
    symbol : size of a joint [m]
    metre : points of print in a metre
    """

    def __init__(self, axes: Any, symbol: float, metre: float) -> None:
        self._axes, self._s, self._metre = axes, symbol, metre
        self._thickness = 1.1 * symbol * metre
        self._layers = count(1)  # links lie on each other
        self._painters: dict[str, Callable[[Shape, Array], Move | None]] = {
            'rail': self._rail,
            'support': self._support,
            'spring': self._spring,
            'wheel': self._wheel,
            'cam': self._wheel,
            'link': self._link,
            'slot': self._slot,
            'slider': self._slider,
            'pin': self._pin,
        }

    def thick(self, points: float) -> float:
        """So many points of print in metres of the drawing."""
        return points / self._metre

    def paint(self, shape: Shape, outline: Array) -> Move | None:
        """A shape whose points are at `outline` (k, 2) [m]; gives back what moves it."""
        return self._painters[shape.kind](shape, outline)

    def ghost(self, shape: Shape, outline: Array) -> None:
        """Another position of what moves, thin."""
        if shape.link == GROUND or shape.kind == 'spring':
            return
        if len(outline) > 1:
            self._line(_closed(outline), GHOST, 0.8, 1.0)
        elif shape.kind == 'pin':
            self._circle(outline[0], 0.35, GHOST, 1.1, 0.6)

    def _link(self, shape: Shape, outline: Array) -> Move | None:
        """A bar, or a plate; nothing where a slider is all there is."""
        if len(outline) < 2:
            return None
        plate, layer = len(outline) > 2, 2.0 + 0.03 * next(self._layers)
        line = _closed(outline) if plate else outline
        lines = [
            self._line(line, colour, width, layer + above)
            for above, colour, width in (
                (0.01, INK, self._thickness), (0.02, FILL, self._thickness - 1.8)
            )
        ]  # fmt: skip
        if not plate:
            return _all(lines)
        # what is behind a plate shows through
        inside = self._fill(outline, FILL, None, layer, alpha=0.6)

        def move(now: Array) -> None:
            inside.set_xy(now)
            for border in lines:
                border.set_data(*_closed(now).T)

        return move

    def _wheel(self, shape: Shape, outline: Array) -> Move:
        return _corners(self._fill(outline, FILL, INK, 1.7))

    def _spring(self, shape: Shape, outline: Array) -> Move:
        """A zigzag between straight ends."""
        line = self._line(zigzag(outline, 0.9 * self._s).T, INK, 0.9, 1.95)

        def move(now: Array) -> None:
            line.set_data(*zigzag(now, 0.9 * self._s))

        return move

    def _slot(self, shape: Shape, outline: Array) -> Move:
        width = 1.7 * self._thickness
        strokes = ((INK, width), (FILL, width - 1.8), (INK, 0.8 * width),
                   ('white', 0.8 * width - 1.6))  # fmt: skip
        return _all([self._line(outline, colour, lw, 3.0) for colour, lw in strokes])

    def _slider(self, shape: Shape, outline: Array) -> Move:
        return _corners(self._fill(outline, '0.85', INK, 3.2))

    def _pin(self, shape: Shape, outline: Array) -> Move:
        circle = self._circle(outline[0], 0.62, INK, 5.0, 1.1)
        circle.set_gid(f'pin-{shape.label}')

        def move(now: Array) -> None:
            circle.set_center((now[0, 0], now[0, 1]))

        return move

    def _rail(self, shape: Shape, outline: Array) -> Move | None:
        """A rod of a link; of the frame a line, hatched below."""
        if shape.link != GROUND:
            strokes = ((INK, 0.6), (FILL, 0.25))
            return _all(
                [
                    self._line(outline, c, w * self._thickness, 1.8, 'projecting')
                    for c, w in strokes
                ]
            )
        self._line(outline, INK, 0.9, 1.8, 'projecting')
        start, end = outline
        along = (end - start) / np.hypot(*(end - start))
        below = np.array([along[1], -along[0]])
        below = -below if below[1] > 1e-9 else below
        foot = start + 1.1 * self._s * below, end + 1.1 * self._s * below
        self._hatched(*foot, below)
        return None

    def _support(self, shape: Shape, outline: Array) -> None:
        x, y = outline[0]
        s = self._s
        corners = np.array([[x, y], [x - 1.3 * s, y - 2.2 * s], [x + 1.3 * s, y - 2.2 * s]])
        self._fill(corners, 'white', INK, 1.9)
        left, right = np.array([x - 2.0 * s, y - 2.2 * s]), np.array([x + 2.0 * s, y - 2.2 * s])
        self._hatched(left, right, np.array([0.0, -1.0]))

    def _hatched(self, start: Array, end: Array, below: Array) -> None:
        """The frame: a line with strokes on one side."""
        self._line(np.array([start, end]), INK, 1.0, 1.9, 'projecting')
        length = float(np.hypot(*(end - start)))
        along = (end - start) / length
        far = np.arange(0.75 * self._s, length, 0.8 * self._s)
        feet = start[:, None] + along[:, None] * far
        tips = feet + 0.7 * self._s * (below - along)[:, None]
        strokes = np.stack([feet, tips, np.full_like(feet, np.nan)], axis=2).reshape(2, -1)
        self._line(strokes.T, INK, 0.6, 1.9, 'projecting')

    def _line(
        self, points: Array, colour: str, width: float, layer: float, cap: str = 'round'
    ) -> Any:
        (line,) = self._axes.plot(
            *points.T, color=colour, lw=width, zorder=layer, solid_capstyle=cap,
            solid_joinstyle='round',
        )  # fmt: skip
        return line

    def _fill(
        self, corners: Array, colour: str, border: str | None, layer: float, **more: Any
    ) -> Any:
        edge = {'ec': border, 'lw': 1.0} if border else {'lw': 0.0}
        return self._axes.add_patch(Polygon(corners, fc=colour, zorder=layer, **edge, **more))

    def _circle(self, at: Array, size: float, colour: str, layer: float, width: float) -> Any:
        return self._axes.add_patch(
            Circle((at[0], at[1]), size * self._s, fc='white', ec=colour, lw=width, zorder=layer)
        )


def _closed(outline: Array) -> Array:
    return outline[[*range(len(outline)), 0]]


def _corners(polygon: Any) -> Move:
    def move(now: Array) -> None:
        polygon.set_xy(now)

    return move


def _all(lines: list[Any]) -> Move:
    """Moves lines that lie on each other."""

    def move(now: Array) -> None:
        for line in lines:
            line.set_data(*now.T)

    return move
