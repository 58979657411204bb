"""Pictures of mechanisms: bars, pivots, sliders on their rails, ghosts of other positions."""

from __future__ import annotations

from itertools import cycle as endless
from typing import Literal

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.cycles.cycle import Cycle
from mechanism_sim.export.skeleton import bounds, skeleton_of
from mechanism_sim.report.brush import INK, Brush
from mechanism_sim.report.labels import Labels
from mechanism_sim.report.picture import Picture

_SIDES = 7.5, 6.0
"""Width and height of a picture at most [in]."""

PATHS = ('-', '--', '-.', ':')


def draw(
    cycle: Cycle,
    t: float,
    positions: int = 1,
    labels: Literal['all', 'links', 'none'] = 'all',
    magnified: float = 1.0,
) -> Picture:
    """A machine at one instant, with the paths of the cycle's points.

    Parameters
    ----------
    t : [s] within the cycle
    positions : this one, and as many others as ghosts, evenly over the cycle
    labels : of links and joints, of links only, or none
    magnified : how many times as large elastic links deform here
    """
    sweep = _coordinates(cycle, cycle.t)
    skeleton = skeleton_of(cycle.machine, sweep, cycle.points.values(), magnified)
    here = cycle.at(np.array([t]))
    now = skeleton.placed(_coordinates(cycle, np.array([t])))
    since = np.arange(1, positions) / positions * cycle.duration
    others = cycle.t[0] + (t - cycle.t[0] + since) % cycle.duration
    ghosts = skeleton.placed(_coordinates(cycle, others)) if positions > 1 else []
    low, high = bounds(skeleton, [*skeleton.placed(sweep), *now])
    figure = Picture()
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    inch = float(max((high - low) / _SIDES))  # [m] in the drawing
    brush = Brush(axes, skeleton.symbol, 72.0 / inch)
    names = Labels(axes, brush, skeleton.symbol, low, high)
    for k in range(positions - 1):
        for shape, outline in zip(skeleton.shapes, ghosts, strict=True):
            brush.ghost(shape, outline[:, :, k])
    for name, line in zip(cycle.points, endless(PATHS)):
        path = np.stack([cycle[f'position.{name}.{axis}'] for axis in 'xy'], axis=1)
        axes.plot(*path.T, color='0.35', lw=0.9, ls=line, zorder=4.0, label=name)
        at = (here[f'position.{name}.{axis}'] for axis in 'xy')
        axes.plot(*at, 'o', color=INK, ms=3.0, zorder=4.5)
        names.avoid(path)
    outlines = [outline[:, :, 0] for outline in now]
    for shape, outline in zip(skeleton.shapes, outlines, strict=True):
        brush.paint(shape, outline)
    if labels != 'none':
        names.write(skeleton.shapes, outlines, labels == 'all')
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
