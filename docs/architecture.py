"""The picture of the rooms in docs/architecture.md: ``python docs/architecture.py``.

It is drawn from the layers that import-linter checks (pyproject.toml), so that it cannot differ
from them.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[1]
FILE = ROOT / 'docs' / 'pictures' / 'architecture.svg'
WIDTH, ROW, GAP = 720, 46, 8
WORDS = {
    'cli': 'commands',
    'editor': 'drawing scenes in a browser',
    'pages': 'pages of runs, live view',
    'thesis': 'what only [SB] asks for',
    'nodes': 'ROS nodes',
    'analysis': 'runs from bags',
    'report': 'text, charts',
    'export': 'shapes, URDF',
    'imports': 'URDF, DXF',
    'studies': 'many runs: sweeps, searches, means; modes, responses',
    'messages': 'message classes, events',
    'recording': 'MCAP read and write',
    'results': 'runs, quantities by name, cycles, measures',
    'derivatives': 'by numbers of scenes',
    'scene': 'YAML to machine, kinds of joints, sensors, loads',
    'sensing': 'instruments',
    'linkages': 'ideal motion',
    'joints': 'a folder a kind',
    'vibration': 'linear theory',
    'engine': 'contact laws, event loop, solutions, audit',
    'planar': 'bodies, tree, equations',
}
"""Contents of the packages; the lowest three layers are drawn by their names alone."""


def layers() -> list[list[str]]:
    """Rooms from top to bottom, those of a layer side by side."""
    config = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))
    contracts = config['tool']['importlinter']['contracts']
    (rooms,) = (c['layers'] for c in contracts if c.get('containers') == ['mechanism_sim'])
    return [re.split(r'\s*[|:]\s*', layer) for layer in rooms]


def draw() -> str:
    """The picture as SVG."""
    rows = [*layers(), ['zenoh_rclpy', 'ros_interfaces']]
    height = len(rows) * (ROW + GAP) + GAP + 16
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'width="{WIDTH}" font-family="DejaVu Sans, sans-serif">',
        '<title>Rooms of mechanism_sim: each imports only rooms below it</title>',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
    ]
    for k, row in enumerate(rows):
        beside = k == len(rows) - 1
        y = GAP + k * (ROW + GAP) + (16 if beside else 0)
        wide = (WIDTH - GAP * (len(row) + 1)) / len(row)
        for i, room in enumerate(row):
            x = GAP + i * (wide + GAP)
            fill = '#f3e9dc' if beside else '#e6eef7'
            middle = x + 0.5 * wide
            words = WORDS.get(room, '')
            lines += [
                f'<rect x="{x:.1f}" y="{y}" width="{wide:.1f}" height="{ROW}" rx="5" '
                f'fill="{fill}" stroke="#1f4e79"/>',
                f'<text x="{middle:.1f}" y="{y + (19 if words else 28)}" font-size="13" '
                f'font-weight="bold" text-anchor="middle" fill="#12304d">{escape(room)}</text>',
            ]
            if words:
                lines.append(
                    f'<text x="{middle:.1f}" y="{y + 36}" font-size="10.5" '
                    f'text-anchor="middle" fill="#333333">{escape(words)}</text>'
                )
    return '\n'.join([*lines, '</svg>', ''])


if __name__ == '__main__':
    FILE.write_text(draw(), encoding='utf-8')
