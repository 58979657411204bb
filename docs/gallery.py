"""The pictures of docs/mechanisms.md: ``python docs/gallery.py [NAME...]``.

Every scene of the package, or those named, is drawn as docs/pictures/mechanisms/NAME.svg by the
command ``mechanism-sim draw``.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import matplotlib as mpl

from mechanism_sim.catalogue import scene_names
from mechanism_sim.cli import main as mechanism_sim

FOLDER = Path(__file__).parent / 'pictures' / 'mechanisms'
OPTIONS = {
    'adjustable_stroke_drive': "--at '0.06 s' --positions 6",
    'catapult': '--positions 5 --path arm.cup',
    'constant_velocity_slider': "--at '0.7 s' --positions 4",
    'differential': "--at '0.37 s'",
    'double_rocker_tracing': '--positions 6 --path connecting_link.tracer',
    'double_toggle_punch': '--positions 4',
    'dump_truck': "--at '6 s' --positions 3",
    'elastic_slider_crank': "--at '0.006 s' --positions 5",
    'film_advance': '--positions 6 --path coupler.end',
    'five_bar': "--at '0.1 s' --positions 6",
    'four_bar_clearance': '--positions 6',
    'four_bar_coupler_curve': (
        '--positions 3 --path coupler.near --path coupler.middle --path coupler.far'
    ),
    'four_bar_crank_rocker': '--positions 8 --path coupler.cog',
    'four_bar_crossed': '--positions 6',
    'four_bar_double_crank': "--at '0.1 s' --positions 8 --path coupler.cog",
    'four_bar_double_rocker': '--positions 8 --path coupler.cog',
    'four_bar_misaligned': '--positions 6',
    'four_bar_nominal': '--positions 8 --path coupler.cog',
    'four_bar_triple_rocker': '--positions 6 --path coupler.cog',
    'geneva': "--at '0.22 s'",
    'hand_pump': "--at '0.3 s' --positions 5 --path handle.grip",
    'linear_intermittent': "--at '0.4 s'",
    'loader': "--at '0.35 s' --positions 3 --path bucket.edge",
    'locking_pliers': '--positions 3',
    'material_handling': '--positions 4 --path coupler.A',
    'oscillating_cylinder': "--at '0.04 s' --positions 6",
    'pendulum': '--positions 9 --path bar.end',
    'punch': '--positions 3',
    'quick_return': "--at '0.1 s' --positions 6",
    'quick_return_shaper': '--positions 6',
    'rotary_engine': "--at '0.006 s' --positions 8 --path piston.start",
    'scotch_yoke': "--at '0.025 s' --positions 4",
    'scotch_yoke_offset': "--at '0.025 s' --positions 4",
    'slider_crank': "--at '0.0125 s' --positions 6 --path rod.cog",
    'slider_crank_engine': "--at '0.005 s'",
    'slider_crank_offset': "--at '0.06 s' --positions 6",
    'slider_crank_piston_driven': "--at '0.5 s' --positions 4",
    'spinning_beam': "--at '6 s'",
    'straight_line_drive': '--positions 4 --path link.end',
    'ten_links': "--at '0.7 s' --path foot.toe",
    'variable_stroke_drive': '--positions 4',
    'windshield_wiper': (
        "--at '0.3 s' --positions 4 --path left_rocker.end --path right_rocker.end"
    ),
}
"""Further options of a scene's picture; other scenes are drawn at their start."""


def draw(name: str, folder: Path = FOLDER) -> Path:
    """Draw one scene; returns the path of the picture."""
    file = folder / f'{name}.svg'
    more = shlex.split(OPTIONS.get(name, ''))
    with mpl.rc_context({'svg.fonttype': 'none'}):  # letters as paths are large
        try:
            mechanism_sim(['draw', name, '--labels', 'links', *more, '-o', str(file)])
        except SystemExit as end:
            if end.code:
                raise
    return file


def main() -> None:
    """Draw the named scenes, or all."""
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or scene_names():
        draw(name)


if __name__ == '__main__':
    main()
