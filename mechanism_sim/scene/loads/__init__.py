"""The kinds of loads that a scene may have: one file each."""

from importlib import import_module
from pkgutil import iter_modules

from mechanism_sim.scene.load_keys import LOADS, read_loads

__all__ = ['LOADS', 'read_loads']

for _module in sorted((found.name for found in iter_modules(__path__)), reverse=True):
    import_module(f'{__name__}.{_module}')
