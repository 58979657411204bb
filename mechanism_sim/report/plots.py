"""Pictures of a cycle: motion, phase portraits, forces as hodographs, torque and power."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.cycles.columns import unit_of
from mechanism_sim.cycles.cycle import Cycle
from mechanism_sim.export.palette import colour, numbers
from mechanism_sim.report.cycle import for_people
from mechanism_sim.report.figures import few_ticks, legend, strokes, titled
from mechanism_sim.units import typeset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_KINDS = ('position', 'velocity', 'acceleration')
_WORDS = {
    'rad': ('angle', 'angular velocity', 'angular acceleration'),
    'm': ('displacement', 'velocity', 'acceleration'),
}


def draw(cycle: Cycle) -> dict[str, Figure]:
    """The pictures of a cycle by name: those for which it has quantities."""
    figures = {'motion': _motion(cycle), 'phase': _phase(cycle)}
    if cycle.machine.physics.has_forces:
        figures |= {
            'forces': _forces(cycle), 'hodographs': _hodographs(cycle), 'drive': _drive(cycle)
        }  # fmt: skip
    if cycle.points:
        figures['paths'] = _paths(cycle)
    return figures


def _abscissa(cycle: Cycle) -> tuple[Array, str]:
    """What a cycle is drawn over: the angle of a steady drive, or time."""
    if cycle.repeats:
        return np.degrees(cycle[f'position.{cycle.drive}']), f'angle of the {cycle.drive} [deg]'
    return cycle['t'], 'time [s]'


def _lines(axes: Any, cycle: Cycle, columns: dict[str, str], words: str) -> None:
    """Columns of one unit over the cycle; values are their labels."""
    x, _ = _abscissa(cycle)
    own = numbers(cycle.machine.mechanism)
    shown, scale = for_people(unit_of(cycle.machine, next(iter(columns))))
    for (column, label), stroke in zip(columns.items(), strokes(columns, own), strict=True):
        axes.plot(x, scale * cycle[column], label=label, **stroke)
    axes.set_ylabel(f'{words} [{typeset(shown)}]')
    if cycle.repeats:
        axes.set_xlim(x.min(), x.max())
        axes.xaxis.set_major_locator(_degrees(float(np.ptp(x))))
    if len(columns) > 1:
        legend(axes)


def _degrees(width: float) -> Any:
    """Ticks where angles have them."""
    from matplotlib.ticker import MultipleLocator  # noqa: PLC0415

    return MultipleLocator(45.0 * max(1, math.ceil(width / 400.0)))


def _motion(cycle: Cycle) -> Figure:
    names = cycle.machine.physics.coordinates
    units = [unit_of(cycle.machine, f'position.{name}') for name in names]
    columns = list(dict.fromkeys(units))
    figure = titled(cycle.machine.scene.title, 6.0 * len(columns), 6.5)
    grid = figure.subplots(3, len(columns), sharex=True, squeeze=False)
    for row, kind in enumerate(_KINDS):
        for axes, unit in zip(grid[row], columns, strict=True):
            chosen = {
                f'{kind}.{name}': name for name, u in zip(names, units, strict=True) if u == unit
            }
            _lines(axes, cycle, chosen, _WORDS[unit][row])
    for axes in grid[-1]:
        axes.set_xlabel(_abscissa(cycle)[1])
    return figure


def _grid(figure: Figure, count: int, **more: Any) -> list[Any]:
    """So many panels, at most three side by side."""
    wide = min(3, count)
    panels = figure.subplots(math.ceil(count / wide), wide, squeeze=False, **more).ravel()
    for axes in panels[count:]:
        axes.remove()
    return list(panels[:count])


def _size(count: int, side: float) -> tuple[float, float]:
    return side * min(3, count), side * math.ceil(count / 3) + 0.4


def _phase(cycle: Cycle) -> Figure:
    """Rate over position of each coordinate, a dot at the start."""
    names = cycle.machine.physics.coordinates
    figure = titled(cycle.machine.scene.title, *_size(len(names), 3.0))
    own = numbers(cycle.machine.mechanism)
    for name, axes in zip(names, _grid(figure, len(names)), strict=True):
        unit = unit_of(cycle.machine, f'position.{name}')
        shown, scale = for_people(unit)
        x, y = scale * cycle[f'position.{name}'], cycle[f'velocity.{name}']
        shade = colour(own.get(name, 0))
        axes.plot(x, y, color=shade, lw=1.2)
        axes.plot(x[:1], y[:1], 'o', color=shade, ms=4.0)
        axes.set_title(name, fontsize=9.0)
        axes.set(
            xlabel=f'{_WORDS[unit][0]} [{shown}]', ylabel=f'{_WORDS[unit][1]} [{typeset(unit)}/s]'
        )
    return figure


def _forces(cycle: Cycle) -> Figure:
    columns = {f'reaction.{joint}.size': joint for joint in cycle.machine.physics.joints}
    figure = titled(cycle.machine.scene.title, 7.0, 4.0)
    axes = figure.subplots()
    _lines(axes, cycle, columns, 'force in the joint')
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(_abscissa(cycle)[1])
    return figure


def _hodographs(cycle: Cycle) -> Figure:
    """The vector of each joint's force over its direction, and of the force on the frame."""
    names = {f'reaction.{joint}': joint for joint in cycle.machine.physics.joints}
    names['shaking_force'] = 'all on the frame'
    figure = titled(cycle.machine.scene.title, *_size(len(names), 3.2))
    panels = _grid(figure, len(names), subplot_kw={'projection': 'polar'})
    for (column, label), axes in zip(names.items(), panels, strict=True):
        x, y = cycle[f'{column}.x'], cycle[f'{column}.y']
        axes.plot(np.arctan2(y, x), np.hypot(x, y), color='0.1', lw=1.1)
        axes.plot(np.arctan2(y[:1], x[:1]), np.hypot(x[:1], y[:1]), 'o', color='0.1', ms=4.0)
        axes.set_title(f'{label} [N]', fontsize=9.0)
        few_ticks(axes)
    return figure


def _drive(cycle: Cycle) -> Figure:
    units = [unit_of(cycle.machine, name) for name in cycle.drive_torques]
    kinds = list(dict.fromkeys(units))
    figure = titled(cycle.machine.scene.title, 7.0, 2.2 * (len(kinds) + 3))
    panels = figure.subplots(len(kinds) + 3, 1, sharex=True)
    for kind, axes in zip(kinds, panels, strict=False):
        chosen = {
            name: name.partition('.')[2] or cycle.drive
            for name, u in zip(cycle.drive_torques, units, strict=True)
            if u == kind
        }
        _lines(axes, cycle, chosen, 'torque of the drive' if kind == 'N m' else 'force of drive')
    power, energy, shaking = panels[len(kinds) :]
    _lines(power, cycle, {'drive_power': ''}, 'power of the drive')
    _lines(energy, cycle, {'energy.kinetic': 'kinetic', 'energy.potential': 'potential'}, 'energy')
    _lines(shaking, cycle, {'shaking_moment': ''}, 'moment on the frame')
    shaking.set_xlabel(_abscissa(cycle)[1])
    return figure


def _paths(cycle: Cycle) -> Figure:
    figure = titled(cycle.machine.scene.title, 5.5, 4.5)
    axes = figure.subplots()
    own = numbers(cycle.machine.mechanism)
    for name, stroke in zip(cycle.points, strokes(cycle.points, own), strict=True):
        x, y = (1e3 * cycle[f'position.{name}.{axis}'] for axis in 'xy')
        axes.plot(x, y, label=name, **stroke)
        axes.plot(x[:1], y[:1], 'o', color=stroke['color'], ms=4.0)
    axes.set_aspect('equal', adjustable='datalim')
    axes.set(xlabel='x [mm]', ylabel='y [mm]')
    legend(axes)
    return figure
