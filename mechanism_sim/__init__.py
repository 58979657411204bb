"""Simulator of real (loose, rattling, vibrating) planar machines.

``scene = load_scene('four_bar_clearance')``; ``solution = simulate(scene, revolutions=10)``.
"""

from __future__ import annotations

# Where ROS 2 built this package, its generated messages live in another folder of that name.
from pkgutil import extend_path as _extend_path
from typing import Any as _Any

__path__ = _extend_path(__path__, __name__)

from mechanism_sim.hybrid import plotting as _plotting
from mechanism_sim.numerics.lazy_sympy import postpone_sympy as _postpone_sympy

__all__ = [
    'animate',
    'cycle',
    'draw',
    'equations',
    'explore',
    'load_scene',
    'measure',
    'open_run',
    'play',
    'scene_names',
    'simulate',
    'stream',
]


def _plot() -> _Any:
    from mechanism_sim.report.lines import plot  # noqa: PLC0415 - Matplotlib takes half a second

    return plot


def _html() -> _Any:
    from mechanism_sim.report.rich import html  # noqa: PLC0415

    return html


def __dir__() -> list[str]:
    """The public names, and nothing else."""
    return sorted([*__all__, '__version__'])


_plotting.register_plot(_plot, _html)
_postpone_sympy()


def __getattr__(name: str) -> _Any:
    """The public functions, imported when first used: most commands need few of the rooms."""
    if name == 'cycle':
        from mechanism_sim.results.cycle import cycle  # noqa: PLC0415

        return cycle
    if name == 'equations':
        from mechanism_sim.report.typeset import equations  # noqa: PLC0415

        return equations
    if name == 'measure':
        from mechanism_sim.results.measures import measure  # noqa: PLC0415

        return measure
    if name == 'open_run':
        from mechanism_sim.analysis.open_run import open_run  # noqa: PLC0415

        return open_run
    if name in ('explore', 'play'):
        from mechanism_sim.pages import notebook  # noqa: PLC0415

        return getattr(notebook, name)
    if name in ('animate', 'draw'):
        from mechanism_sim.report import shown  # noqa: PLC0415

        return getattr(shown, name)
    if name in ('simulate', 'stream'):
        from mechanism_sim.results import simulate  # noqa: PLC0415

        return getattr(simulate, name)
    if name in __all__:
        from mechanism_sim import scene  # noqa: PLC0415

        return getattr(scene, name)
    if name == '__version__':
        from mechanism_sim.catalogue import installed_version  # noqa: PLC0415

        return installed_version() or 'unknown'
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
