"""Simulator of planar machines with clearance, impacts and vibration.

``solution = simulate('four_bar_clearance', revolutions=10)``: a scene by name, path, YAML text,
dictionary, `Scene` or machine. ``__init__.pyi`` says all of it to editors.
"""

from __future__ import annotations

# Where ROS 2 built this package, its generated messages live in another folder of that name.
from importlib import import_module as _import_module
from pkgutil import extend_path as _extend_path
from typing import Any as _Any

__path__ = _extend_path(__path__, __name__)

from mechanism_sim.engine import plotting as _plotting
from mechanism_sim.numerics.lazy_sympy import postpone_sympy as _postpone_sympy

_ROOMS = {
    'analysis.measure': ('measure',),
    'analysis.open_run': ('open_run',),
    'catalogue': ('scene_names',),
    'errors': ('InputError', 'RunError'),
    'pages.notebook': ('explore', 'play'),
    'pages.writing': ('report',),
    'report.shown': ('animate', 'draw', 'plot'),
    'report.typeset': ('equations',),
    'results.cycle': ('cycle',),
    'results.simulate': ('simulate', 'stream'),
    'scene.load': ('load_scene',),
    'scene.schema': ('DrivePart', 'JointPart', 'LinkPart', 'Scene', 'SensorPart'),
    'studies.basins': ('basins',),
    'studies.bifurcation': ('bifurcation',),
    'studies.continuation': ('branches',),
    'studies.ensemble': ('ensemble',),
    'studies.find': ('find',),
    'studies.four_bars': ('find_four_bars',),
    'studies.life': ('life',),
    'studies.lyapunov': ('lyapunov',),
    'studies.sweep': ('sweep',),
}
_HOMES = {name: module for module, names in _ROOMS.items() for name in names}

__all__ = list(_HOMES)


def __dir__() -> list[str]:
    """The public names, and nothing else."""
    return sorted([*__all__, '__version__'])


_plotting.register(
    plot='mechanism_sim.report.lines:plot',
    html='mechanism_sim.report.rich:html',
    report='mechanism_sim.pages.writing:report',
    progress='mechanism_sim.report.progress:in_notebook',
)
_postpone_sympy()


def __getattr__(name: str) -> _Any:
    """The public functions, imported when first used: most commands need few of the rooms."""
    if name == 'report':  # a room, which is called as the function is
        return _import_module('mechanism_sim.report')
    if name in _HOMES:
        return getattr(_import_module(f'mechanism_sim.{_HOMES[name]}'), name)
    if name == '__version__':
        from mechanism_sim.catalogue import installed_version  # noqa: PLC0415

        return installed_version() or 'unknown'
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
