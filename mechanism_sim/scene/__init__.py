"""Scenes: YAML with units, checked on input and turned into machines that run."""

from mechanism_sim.catalogue import scene_names
from mechanism_sim.scene.level import Level
from mechanism_sim.scene.load import Source, load_scene, over_range, placed, run_length, span
from mechanism_sim.scene.machine import Machine

__all__ = [
    'Level',
    'Machine',
    'Source',
    'load_scene',
    'over_range',
    'placed',
    'run_length',
    'scene_names',
    'span',
]
