"""The gallery of scenes: picture, title and description from the scenes themselves."""

from __future__ import annotations

import re
from typing import Any

import yaml

from mechanism_sim.catalogue import config_folder

PAGE = 'docs/mechanisms'
SECTIONS = {
    'Slider-cranks and their inversions': (
        'slider_crank', 'slider_crank_piston_driven', 'slider_crank_offset',
        'slider_crank_engine', 'rotary_engine', 'quick_return', 'oscillating_cylinder',
        'hand_pump',
    ),
    'Four-bars': (
        'four_bar_crank_rocker', 'four_bar_double_crank', 'four_bar_double_rocker',
        'four_bar_triple_rocker', 'four_bar_coupler_curve', 'four_bar_crossed',
        'four_bar_nominal', 'four_bar_clearance', 'four_bar_measured', 'four_bar_on_frame',
        'four_bar_misaligned', 'bearing_run_up', 'four_bar_governed',
    ),
    'Elastic links': (
        'elastic_slider_crank', 'four_bar_elastic', 'spinning_beam', 'thesis_complete',
    ),
    'Five-bar and Scotch yokes': (
        'five_bar', 'scotch_yoke', 'scotch_yoke_offset', 'arc_slot_yoke',
    ),
    'Intermittent motion': ('geneva', 'linear_intermittent'),
    'Cams': (
        'valve_train', 'eccentric_cam', 'oscillating_roller', 'groove_cam', 'measured_cam',
        'offset_roller_cam', 'rise_dwell_return', 'sliding_cam',
    ),
    'Gears': (
        'gear_pair', 'gear_rattle', 'gear_housing', 'mesh_stiffness', 'gear_box', 'planetary',
        'compound_planetary', 'helical_shafts', 'bevel_pair', 'worm_drive', 'differential',
        'belt_drive', 'watched_compressor', 'rack_and_pinion', 'gear_four_bar', 'whole_machine',
    ),
    'Without a drive': ('pendulum', 'catapult', 'hydraulic_arm', 'detent'),
    'Vibrations': (
        'mass_on_spring', 'unbalanced_machine', 'half_car', 'vibration_absorber',
        'torsional_shaft', 'rotor_on_supports', 'overhung_rotor', 'two_disk_rotor',
        'rotor_run_up',
    ),
    'Compound mechanisms': (
        'loader', 'dump_truck', 'windshield_wiper', 'punch', 'double_toggle_punch',
        'toggle_press', 'variable_stroke_drive', 'adjustable_stroke_drive',
        'constant_velocity_slider', 'quick_return_shaper', 'film_advance', 'material_handling',
        'double_rocker_tracing', 'straight_line_drive', 'locking_pliers', 'ten_links',
        'andrews_squeezer', 'slider_with_play', 'wedge', 'rubbing_compressor',
    ),
}  # fmt: skip
"""Scenes by heading."""

FREEDOMS = {
    'detent': 2, 'differential': 2, 'half_car': 2, 'loader': 2, 'mass_on_spring': 2,
    'torsional_shaft': 3, 'unbalanced_machine': 2, 'vibration_absorber': 3,
}  # fmt: skip
"""Degrees of freedom of links and joints, before drives are counted, of scenes with several."""


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx: all scenes are appended to their page."""
    app.connect('source-read', _append)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _append(_app: Any, page: str, source: list[str]) -> None:
    if page == PAGE:
        source[0] += gallery()


def gallery() -> str:
    """All scenes as Markdown, a section for each kind."""
    return ''.join(_section(title, names) for title, names in SECTIONS.items())


def _section(title: str, names: tuple[str, ...]) -> str:
    return '\n'.join(['', f'## {title}', '', '| | |', '|---|---|', *map(_row, names), ''])


def _row(name: str) -> str:
    text = (config_folder() / f'{name}.yaml').read_text(encoding='utf-8')
    scene = yaml.safe_load(text)
    above = ' '.join(re.findall('^# (.*)$', text.partition('title:')[0], re.MULTILINE))
    title, description = _plain(scene['title']), _plain(scene.get('description') or above)
    freedoms = f'<br>{FREEDOMS[name]} degrees of freedom' if name in FREEDOMS else ''
    picture = f'<img src="pictures/mechanisms/{name}.svg" alt="{title}" width="360">'
    words = f'**{title}**<br>[`{name}`](../config/{name}.yaml)<br>{description}{freedoms}'
    return f'| {picture} | {words} |'


def _plain(text: str) -> str:
    """Text escaped for a table of Markdown, apart from code in backticks."""
    text = ' '.join(text.split()).replace('|', r'\|').replace('<', '&lt;').replace('"', '&quot;')
    parts = re.split('(`[^`]*`)', text)
    return ''.join(x if x.startswith('`') else re.sub('([*_])', r'\\\1', x) for x in parts)
