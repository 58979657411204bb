"""Simulator of real (loose, rattling, vibrating) planar machines.

``scene = load_scene('four_bar_clearance')``; ``solution = simulate(scene, revolutions=10)``.
"""

from __future__ import annotations

# Where ROS 2 built this package, its generated messages live in another folder of that name.
from pkgutil import extend_path
from typing import Any

__path__ = extend_path(__path__, __name__)

__all__ = ['cycle', 'load_scene', 'scene_names', 'simulate', 'stream']


def __getattr__(name: str) -> Any:
    """The public functions, imported when first used: most commands need few of the rooms."""
    if name == 'cycle':
        from mechanism_sim.cycles.cycle import cycle  # noqa: PLC0415

        return cycle
    if name in __all__:
        from mechanism_sim import scene  # noqa: PLC0415

        return getattr(scene, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
