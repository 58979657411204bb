"""The pictures of docs/mechanisms.md: ``python docs/gallery.py [NAME...]``.

Draws every scene of the package, or those named, as docs/pictures/mechanisms/NAME.svg.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl

import mechanism_sim as ms
from mechanism_sim.catalogue import scene_names
from mechanism_sim.cycles.cycle import instant
from mechanism_sim.report import drawing, figures

FOLDER = Path(__file__).parent / 'pictures' / 'mechanisms'


class View(NamedTuple):
    """What of a scene is drawn: an instant [s], others as ghosts, paths of points."""

    at: float = 0.0
    positions: int = 1
    paths: tuple[str, ...] = ()


COG = ('coupler.cog',)
VIEWS = {
    'adjustable_stroke_drive': View(0.06, 6),
    'catapult': View(0.0, 5, ('arm.cup',)),
    'constant_velocity_slider': View(0.7, 4),
    'double_rocker_tracing': View(0.0, 6, ('connecting_link.tracer',)),
    'double_toggle_punch': View(0.0, 4),
    'dump_truck': View(6.0, 3),
    'film_advance': View(0.0, 6, ('coupler.end',)),
    'five_bar': View(0.1, 6),
    'four_bar_clearance': View(0.0, 6),
    'four_bar_coupler_curve': View(0.0, 3, ('coupler.near', 'coupler.middle', 'coupler.far')),
    'four_bar_crank_rocker': View(0.0, 8, COG),
    'four_bar_crossed': View(0.0, 6),
    'four_bar_double_crank': View(0.1, 8, COG),
    'four_bar_double_rocker': View(0.0, 8, COG),
    'four_bar_measured': View(0.0, 1),
    'four_bar_nominal': View(0.0, 8, COG),
    'four_bar_triple_rocker': View(0.0, 6, COG),
    'geneva': View(0.22),
    'hand_pump': View(0.3, 5, ('handle.grip',)),
    'linear_intermittent': View(0.4),
    'loader': View(0.35, 3, ('bucket.edge',)),
    'locking_pliers': View(0.0, 3),
    'material_handling': View(0.0, 4, ('coupler.A',)),
    'oscillating_cylinder': View(0.04, 6),
    'pendulum': View(0.0, 9, ('bar.end',)),
    'punch': View(0.0, 3),
    'quick_return': View(0.1, 6),
    'quick_return_shaper': View(0.0, 6),
    'rotary_engine': View(0.006, 8, ('piston.start',)),
    'scotch_yoke': View(0.025, 4),
    'scotch_yoke_offset': View(0.025, 4),
    'slider_crank': View(0.0125, 6, ('rod.cog',)),
    'slider_crank_engine': View(0.005),
    'slider_crank_offset': View(0.06, 6),
    'slider_crank_piston_driven': View(0.5, 4),
    'straight_line_drive': View(0.0, 4, ('link.end',)),
    'ten_links': View(0.7, 1, ('foot.toe',)),
    'variable_stroke_drive': View(0.0, 4),
    'windshield_wiper': View(0.3, 4, ('left_rocker.end', 'right_rocker.end')),
}


def draw(name: str) -> Path:
    """Draw one scene, and say where the picture is."""
    view = VIEWS.get(name, View())
    alone = view.positions == 1 and not view.paths
    found, t = instant(ms.load_scene(name), t=view.at, points=view.paths, still=alone)
    file = FOLDER / f'{name}.svg'
    with figures.style(), mpl.rc_context({'svg.fonttype': 'none'}):  # letters as paths are large
        figures.save(drawing.draw(found, t, view.positions, labels='links'), file, cropped=True)
    return file


def main() -> None:
    """Draw what is named, or everything."""
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or scene_names():
        print(draw(name).name)


if __name__ == '__main__':
    main()
