"""Pictures of mechanisms: bars, pivots, sliders on their rails, ghosts of other positions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle as endless
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.cycles.cycle import Cycle
from mechanism_sim.export.skeleton import Shape, bounds, skeleton_of, zigzag
from mechanism_sim.planar.mechanism import GROUND

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_SIDES = 7.5, 6.0
"""Width and height of a picture at most [in]."""

_INK, _FILL, _GHOST = '0.15', '0.93', '0.72'
_PATHS = ('-', '--', '-.', ':')


def draw(
    cycle: Cycle, t: float, positions: int = 1, labels: Literal['all', 'links', 'none'] = 'all'
) -> Figure:
    """A machine at one instant, with the paths of the cycle's points.

    Parameters
    ----------
    t : [s] within the cycle
    positions : this one, and as many others as ghosts, evenly over the cycle
    labels : of links and joints, of links only, or none
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - takes half a second

    sweep = _coordinates(cycle, cycle.t)
    skeleton = skeleton_of(cycle.machine, sweep, cycle.points.values())
    here = cycle.at(np.array([t]))
    now = skeleton.placed(_coordinates(cycle, np.array([t])))
    since = np.arange(1, positions) / positions * cycle.duration
    others = cycle.t[0] + (t - cycle.t[0] + since) % cycle.duration
    ghosts = skeleton.placed(_coordinates(cycle, others)) if positions > 1 else []
    low, high = bounds(skeleton, [*skeleton.placed(sweep), *now])
    figure = Figure()
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    inch = float(max((high - low) / _SIDES))  # [m] in the drawing
    brush = _Brush(axes, skeleton.symbol, 72.0 / inch, 0.5 * (low + high))
    for k in range(positions - 1):
        for shape, outline in zip(skeleton.shapes, ghosts, strict=True):
            brush.ghost(shape, outline[:, :, k])
    for name, line in zip(cycle.points, endless(_PATHS)):
        x, y = cycle[f'position.{name}.x'], cycle[f'position.{name}.y']
        axes.plot(x, y, color='0.35', lw=0.9, ls=line, zorder=4.0, label=name)
        at = (here[f'position.{name}.{axis}'] for axis in 'xy')
        axes.plot(*at, 'o', color=_INK, ms=3.0, zorder=4.5)
    outlines = [outline[:, :, 0] for outline in now]
    links, boxes = (
        [x for s, x in zip(skeleton.shapes, outlines, strict=True) if s.kind == kind]
        for kind in ('link', 'slider')
    )
    for shape, outline in zip(skeleton.shapes, outlines, strict=True):
        brush.paint(shape, outline)
        if labels != 'none' and shape.kind == 'link':
            brush.name_link(shape.label, outline)
        elif labels == 'all' and shape.label:
            brush.name_joint(shape, outline.mean(axis=0), links, boxes)
    title = brush.thick(14.0)
    axes.text(
        0.5 * (low[0] + high[0]), high[1] + 0.6 * title, cycle.machine.scene.title,
        ha='center', va='bottom', fontsize=10.0,
    )  # fmt: skip
    if len(cycle.points) > 1:
        axes.legend(loc='lower right', frameon=False, fontsize=7.0)
    top = high[1] + 2.6 * title
    figure.set_size_inches((high[0] - low[0]) / inch, (top - low[1]) / inch)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], top), aspect='equal')
    axes.set_axis_off()
    return figure


def _coordinates(cycle: Cycle, t: Array) -> Array:
    return cycle.solution.samples(t).observed.position


class _Brush:
    """Paints shapes on axes where a metre is so many points of print."""

    def __init__(self, axes: Any, symbol: float, metre: float, centre: Array) -> None:
        self._axes, self._s, self._metre, self._centre = axes, symbol, metre, centre
        self._thickness = 1.1 * symbol * self._metre
        self._layer = 2.0  # links lie on each other
        self._painters: dict[str, Callable[[Shape, Array], None]] = {
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

    def paint(self, shape: Shape, outline: Array) -> None:
        """A shape whose points are at `outline` (k, 2) [m]."""
        self._painters[shape.kind](shape, outline)

    def ghost(self, shape: Shape, outline: Array) -> None:
        """Another position of what moves, thin."""
        if shape.link == GROUND or shape.kind == 'spring':
            return
        if len(outline) > 1:
            closed = outline[[*range(len(outline)), 0]]
            self._axes.plot(*closed.T, color=_GHOST, lw=0.8, zorder=1.0)
        elif shape.kind == 'pin':
            self._circle(outline[0], 0.35, _GHOST, 1.1, 0.6)

    def name_link(self, name: str, outline: Array) -> None:
        """Along a bar, on its outer side; inside a plate; above a slider that is all there is."""
        middle = outline.mean(axis=0)
        x, y = middle
        if len(outline) != 2:
            y += 2.2 * self._s + self.thick(5.0) if len(outline) == 1 else 0.0
            self._text(x, y, name, ha='center', va='center')
            return
        across = self._outward(outline[1] - outline[0], middle)
        turn = np.degrees(np.arctan2(-across[0], across[1]))
        x, y = middle + (0.6 * self._s + self.thick(6.0)) * across
        self._text(
            x, y, name, rotation=(turn + 90.0) % 180.0 - 90.0, rotation_mode='anchor',
            ha='center', va='center',
        )  # fmt: skip

    def name_joint(
        self, shape: Shape, at: Array, links: Sequence[Array], boxes: Sequence[Array]
    ) -> None:
        """Beside a joint where no link goes; below a pivot of the frame or a slider.

        A pin in a slider has its name above that of the slider.
        """
        if shape.link == GROUND or shape.kind == 'slider':
            x, y = at - [0.0, 3.2 * self._s + self.thick(2.0)]
            self._text(x, y, shape.label, ha='center', va='top', style='italic')
            return
        if any(np.hypot(*(x.mean(axis=0) - at)) < 1e-3 * self._s for x in boxes):
            above = at[1] + 2.2 * self._s + self.thick(14.0)
            self._text(at[0], above, shape.label, ha='center', va='center', style='italic')
            return
        arms = [x.mean(axis=0) - at for x in links if np.hypot(*(x - at).T).min() < 1e-3 * self._s]
        arms = [arm / np.hypot(*arm) for arm in arms if np.hypot(*arm) > self._s]
        away = -np.sum([[0.0, 0.0], *arms], axis=0)
        if np.hypot(*away) < 0.5:  # links in line: on the side where their names are not
            away = -self._outward(arms[0], at) if arms else np.array([0.0, 1.0])
        away = away / np.hypot(*away)
        x, y = at + (0.9 * self._s + self.thick(3.0)) * away
        side = 'left' if away[0] > 0.3 else 'right' if away[0] < -0.3 else 'center'
        height = 'bottom' if away[1] > 0.3 else 'top' if away[1] < -0.3 else 'center'
        self._text(x, y, shape.label, ha=side, va=height, style='italic')

    def _outward(self, along: Array, at: Array) -> Array:
        """Unit vector across a line, away from the middle of the drawing."""
        across = np.array([-along[1], along[0]]) / np.hypot(*along)
        return np.asarray(-across if across @ (at - self._centre) < 0.0 else across)

    def _text(self, x: float, y: float, text: str, **more: Any) -> None:
        ground = {'boxstyle': 'square,pad=0.05', 'fc': 'white', 'ec': 'none', 'alpha': 0.7}
        text = text.replace('_', ' ')
        self._axes.text(x, y, text, fontsize=7.5, zorder=9, bbox=ground, **more)

    def _link(self, shape: Shape, outline: Array) -> None:
        """A bar, or a plate; nothing where a slider is all there is."""
        if len(outline) < 2:
            return
        self._layer += 0.01
        line = outline if len(outline) == 2 else outline[[*range(len(outline)), 0]]
        if len(outline) > 2:  # what is behind a plate shows through
            self._axes.fill(*outline.T, fc=_FILL, alpha=0.6, lw=0.0, zorder=self._layer)
        for colour, width in ((_INK, self._thickness), (_FILL, self._thickness - 1.8)):
            self._layer += 0.01
            self._axes.plot(
                *line.T, color=colour, lw=width, solid_capstyle='round', solid_joinstyle='round',
                zorder=self._layer,
            )  # fmt: skip

    def _wheel(self, shape: Shape, outline: Array) -> None:
        self._axes.fill(*outline.T, fc=_FILL, ec=_INK, lw=1.0, zorder=1.7)

    def _spring(self, shape: Shape, outline: Array) -> None:
        """A zigzag between straight ends."""
        line = zigzag(outline, 0.9 * self._s)
        self._axes.plot(*line, color=_INK, lw=0.9, zorder=1.95)

    def _slot(self, shape: Shape, outline: Array) -> None:
        width = 1.7 * self._thickness
        for colour, lw in ((_INK, width), (_FILL, width - 1.8), (_INK, 0.8 * width),
                           ('white', 0.8 * width - 1.6)):  # fmt: skip
            self._axes.plot(*outline.T, color=colour, lw=lw, solid_capstyle='round', zorder=3.0)

    def _slider(self, shape: Shape, outline: Array) -> None:
        self._axes.fill(*outline.T, fc='0.85', ec=_INK, lw=1.0, zorder=3.2)

    def _pin(self, shape: Shape, outline: Array) -> None:
        self._circle(outline[0], 0.62, _INK, 5.0, 1.1)

    def _circle(self, at: Array, size: float, colour: str, zorder: float, width: float) -> None:
        from matplotlib.patches import Circle  # noqa: PLC0415

        self._axes.add_patch(
            Circle((at[0], at[1]), size * self._s, fc='white', ec=colour, lw=width, zorder=zorder)
        )

    def _rail(self, shape: Shape, outline: Array) -> None:
        """A rod of a link; of the frame a line, hatched below."""
        if shape.link != GROUND:
            for colour, width in ((_INK, 0.6), (_FILL, 0.25)):
                self._axes.plot(*outline.T, color=colour, lw=width * self._thickness, zorder=1.8)
            return
        self._axes.plot(*outline.T, color=_INK, lw=0.9, zorder=1.8)
        start, end = outline
        along = (end - start) / np.hypot(*(end - start))
        below = np.array([along[1], -along[0]])
        below = -below if below[1] > 1e-9 else below
        foot = start + 1.1 * self._s * below, end + 1.1 * self._s * below
        self._hatched(*foot, below)

    def _support(self, shape: Shape, outline: Array) -> None:
        x, y = outline[0]
        s = self._s
        self._axes.fill(
            [x, x - 1.3 * s, x + 1.3 * s], [y, y - 2.2 * s, y - 2.2 * s],
            fc='white', ec=_INK, lw=1.0, zorder=1.9,
        )  # fmt: skip
        left, right = np.array([x - 2.0 * s, y - 2.2 * s]), np.array([x + 2.0 * s, y - 2.2 * s])
        self._hatched(left, right, np.array([0.0, -1.0]))

    def _hatched(self, start: Array, end: Array, below: Array) -> None:
        """The frame: a line with strokes on one side."""
        self._axes.plot(*zip(start, end, strict=True), color=_INK, lw=1.0, zorder=1.9)
        length = float(np.hypot(*(end - start)))
        along = (end - start) / length
        far = np.arange(0.75 * self._s, length, 0.8 * self._s)
        feet = start[:, None] + along[:, None] * far
        tips = feet + 0.7 * self._s * (below - along)[:, None]
        strokes = np.stack([feet, tips, np.full_like(feet, np.nan)], axis=2).reshape(2, -1)
        self._axes.plot(*strokes, color=_INK, lw=0.6, zorder=1.9)
