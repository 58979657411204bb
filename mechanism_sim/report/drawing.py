"""Pictures of mechanisms at an instant, with ghosts of other positions and paths of points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle as endless
from typing import Any, Literal

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import INK, colour
from mechanism_sim.export.skeleton import Skeleton, bounds, scale_of, skeleton_of
from mechanism_sim.report.brush import Brush, Labels
from mechanism_sim.report.picture import Picture
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.quantities.motion import choose_points

_SIDES = 7.5, 6.0
"""Width and height of a picture at most [in]."""

PATHS = ('-', '--', '-.', ':')


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
    labels : of links and joints, of links only, or none
    magnified : how many times as much elastic links deform; 0: visibly
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
