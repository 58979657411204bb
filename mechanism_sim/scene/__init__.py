"""Scenes: YAML with units, checked at the door and turned into machines that run."""

from mechanism_sim.catalogue import scene_names
from mechanism_sim.scene.machine import Level, Machine
from mechanism_sim.scene.simulate import load_scene, run_length, simulate, span, stream

__all__ = [
    'Level',
    'Machine',
    'load_scene',
    'run_length',
    'scene_names',
    'simulate',
    'span',
    'stream',
]
