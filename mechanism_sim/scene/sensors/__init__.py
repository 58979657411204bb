"""The kinds of sensors that a scene may have: one file each."""

from importlib import import_module
from pkgutil import iter_modules

from mechanism_sim.scene.sensor_keys import SENSORS

__all__ = ['SENSORS']

for _module in sorted(found.name for found in iter_modules(__path__)):
    import_module(f'{__name__}.{_module}')
