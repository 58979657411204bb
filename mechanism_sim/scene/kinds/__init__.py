"""The kinds of joints that a scene may have: one file each."""

from importlib import import_module
from pkgutil import iter_modules

from mechanism_sim.scene.joint_keys import KINDS

__all__ = ['KINDS']

for _module in sorted(found.name for found in iter_modules(__path__)):
    import_module(f'{__name__}.{_module}')
for _name in sorted(KINDS):  # one module may have loaded another
    KINDS[_name] = KINDS.pop(_name)
