"""Titles and levels of the scenes of the package, which `mechanism-sim scenes` lists.

``python docs/scene_table.py`` writes config/scenes.tsv; a test says when that is needed.
"""

from __future__ import annotations

from mechanism_sim.catalogue import SCENE_TABLE, config_folder, scene_names
from mechanism_sim.scene import load_scene


def row(name: str) -> str:
    """Name, title and level of a scene."""
    machine = load_scene(name)
    return f'{name}\t{machine.scene.title}\t{machine.level.value}'


if __name__ == '__main__':
    rows = [row(name) for name in scene_names()]
    (config_folder() / SCENE_TABLE).write_text('\n'.join(rows) + '\n', encoding='utf-8')
