"""The tools that draw parts of the kinds that a scene may have."""

from importlib import import_module
from pkgutil import iter_modules

from mechanism_sim.editor.tool import REFITS, TOOLS

__all__ = ['REFITS', 'TOOLS']

for _module in sorted(found.name for found in iter_modules(__path__)):
    import_module(f'{__name__}.{_module}')
