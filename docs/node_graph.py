"""The picture of nodes and topics in the README: ``python docs/node_graph.py``."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.path import Path as Line

FILE = Path(__file__).parent / 'pictures' / 'nodes.svg'
STYLE = {
    'font.family': 'DejaVu Sans', 'font.size': 9.0, 'svg.fonttype': 'none',
    'svg.hashsalt': 'mechanism_sim',
}  # fmt: skip
HALF, HEIGHT = 0.72, 0.26
NODES = {
    'crank_drive': (0.9, 1.9), 'linkage': (4.3, 1.9), 'sensors': (6.6, 3.5),
    'recorder': (9.0, 1.9),
}  # fmt: skip
OTHERS = {'you': (0.9, 3.5), 'MCAP file': (11.2, 1.9)}
ARROWS = (
    # where it runs, what it says, where the text stands and how, whether it is a result
    ([(1.62, 1.9), (3.58, 1.9)], 'drive', (2.6, 1.96), 'center', True),
    ([(5.02, 1.9), (8.28, 1.9)],
     'motion, joint_states, linkage_state,\njoint_reactions, impacts,\nmode_changes, /tf, scene',
     (6.65, 1.96), 'center', True),
    ([(4.3, 2.16), (4.3, 3.5), (5.88, 3.5)], 'motion', (4.4, 3.56), 'left', True),
    ([(7.32, 3.5), (9.0, 3.5), (9.0, 2.16)], 'KIND/NAME, imu/NAME', (7.42, 3.56), 'left',
     True),
    ([(9.72, 1.9), (10.48, 1.9)], '', (0.0, 0.0), 'left', True),
    ([(0.9, 3.24), (0.9, 2.16)], 'command/velocity, command/effort\nplay, pause, step, reset',
     (1.0, 2.54), 'left', True),
    ([(1.2, 1.64), (1.2, 1.15), (8.7, 1.15), (8.7, 1.64)], 'drive, /clock', (5.0, 1.21), 'center',
     True),
    ([(9.3, 1.64), (9.3, 0.6), (0.6, 0.6), (0.6, 1.64)],
     'progress (and /diagnostics, from all nodes to you)', (4.42, 0.66), 'left', False),
    ([(4.3, 1.64), (4.3, 0.6)], '', (0.0, 0.0), 'left', None),
)  # fmt: skip


def draw() -> Figure:
    """Boxes are nodes; full arrows carry results, the broken one keeps all in step."""
    figure = Figure(figsize=(9.0, 2.93))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_aspect('equal')
    axes.set_xlim(0.0, 12.1)
    axes.set_ylim(0.2, 4.14)
    for name, (x, y) in {**NODES, **OTHERS}.items():
        rounding = 0.08 if name in NODES else HEIGHT
        box = f'round,pad=0,rounding_size={rounding}'
        axes.add_patch(
            FancyBboxPatch(
                (x - HALF, y - HEIGHT), 2.0 * HALF, 2.0 * HEIGHT, boxstyle=box, ec='0.15', lw=1.0,
                fc='0.94' if name in NODES else 'white', zorder=3,
            )
        )  # fmt: skip
        axes.text(x, y, name, ha='center', va='center', zorder=4)
    for points, text, at, side, result in ARROWS:
        line = {'color': '0.15'} if result else {'color': '0.5', 'ls': (0, (4, 3))}
        arrow = '-' if result is None else '-|>'
        axes.add_patch(
            FancyArrowPatch(path=Line(points), arrowstyle=arrow, mutation_scale=10, lw=0.9, **line)
        )
        colour = '0.15' if result else '0.4'
        axes.text(*at, text, ha=side, va='bottom', color=colour, linespacing=1.15)
    return figure


if __name__ == '__main__':
    with mpl.rc_context(STYLE):
        draw().savefig(FILE, facecolor='white', metadata={'Date': None})
