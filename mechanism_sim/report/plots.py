"""Pictures of a cycle: motion, phase portraits, forces as hodographs, torque and power."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

from mechanism_sim.analysis.series import Series
from mechanism_sim.export.palette import numbers
from mechanism_sim.report.charts.chart import Axis, Chart, Curve, Over, Panel, joined
from mechanism_sim.report.charts.lines import (
    OVER_TIME,
    Drawn,
    colours,
    columns,
    over_angle,
    panels,
)
from mechanism_sim.report.charts.motion import hodograph
from mechanism_sim.report.figures import paint
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.units import for_people

_KINDS = ('position', 'velocity', 'acceleration')
_WORDS = {
    'rad': ('angle', 'angular velocity', 'angular acceleration'),
    'm': ('displacement', 'velocity', 'acceleration'),
}


def draw(cycle: Cycle) -> dict[str, Any]:
    """The pictures of a cycle by name: those for which it has quantities."""
    return {chart.key: paint(chart) for chart in charts(cycle)}


def charts(cycle: Cycle) -> Iterator[Chart]:
    """The charts of a cycle."""
    yield _motion(cycle)
    yield _phase(cycle)
    if cycle.machine.physics.has_forces:
        sizes = {f'reaction.{joint}.size': joint for joint in cycle.machine.physics.joints}
        found = _lines(cycle, sizes, 'force in the joint')
        yield _chart(cycle, 'forces', [replace(p, y=replace(p.y, low=0.0)) for p in found])
        yield _hodographs(cycle)
        yield _drive(cycle)
    if cycle.points:
        yield _paths(cycle)


def _chart(cycle: Cycle, key: str, found: list[Panel], beside: int = 0) -> Chart:
    beside = beside or columns(found)
    over: Over = 'angle' if cycle.repeats else 'time'
    title = cycle.machine.scene.title
    return Chart(key, title, tuple(found), over, columns=beside, width=(8.0, 11.0)[beside > 1])


def _lines(cycle: Cycle, labels: Mapping[str, str], words: str) -> list[Panel]:
    """Columns of one unit over the cycle, by their labels."""
    over = over_angle(cycle.solution, cycle.drive) if cycle.repeats else OVER_TIME
    unit = catalogue(cycle.machine)[next(iter(labels))].unit
    own = numbers(cycle.machine.mechanism)
    drawn = [
        Drawn(Series(column, unit, cycle['t'], cycle[column]), label, shade)
        for (column, label), shade in zip(labels.items(), colours(labels, own), strict=True)
    ]
    return panels(drawn, over, words, unit)


def _motion(cycle: Cycle) -> Chart:
    names = cycle.machine.physics.coordinates
    units = {name: catalogue(cycle.machine)[f'position.{name}'].unit for name in names}
    different = list(dict.fromkeys(units.values()))
    rows = [
        [
            panel
            for unit in different
            for panel in _lines(
                cycle, {f'{kind}.{n}': n for n in names if units[n] == unit}, _WORDS[unit][row]
            )
        ]
        for row, kind in enumerate(_KINDS)
    ]
    if len(rows[0]) == len(different):
        return _chart(cycle, 'motion', list(chain(*rows)), len(different))
    # of many coordinates each has a row
    return _chart(cycle, 'motion', list(chain(*zip(*rows, strict=True))), len(_KINDS))


def _phase(cycle: Cycle) -> Chart:
    """Rate over position of each coordinate, a dot at the start."""
    own, found = numbers(cycle.machine.mechanism), []
    for name in cycle.machine.physics.coordinates:
        unit = catalogue(cycle.machine)[f'position.{name}'].unit
        shown, scale = for_people(unit)
        position, rate = _WORDS[unit][:2]
        line = Curve(scale * cycle[f'position.{name}'], cycle[f'velocity.{name}'],
                     of=f'velocity.{name}', colour=own.get(name, 0))  # fmt: skip
        axes = Axis(position, shown), Axis(rate, f'{unit}/s')
        found.append(Panel(*axes, (line, line.start()), name, height=2.3))
    beside = min(3, len(found))
    title = cycle.machine.scene.title
    return Chart('phase', title, tuple(found), columns=beside, width=max(3.2 * beside, 4.5))


def _hodographs(cycle: Cycle) -> Chart:
    """The vector of each joint's force over its direction, and of the force on the frame."""
    forces = {f'reaction.{joint}': joint for joint in cycle.machine.physics.joints}
    forces['shaking_force'] = 'all on the frame'
    found = [
        hodograph('', title, column, cycle['t'], (cycle[f'{column}.x'], cycle[f'{column}.y']), k)
        for k, (column, title) in zip([*range(len(forces) - 1), -1], forces.items(), strict=True)
    ]
    return replace(joined(cycle.machine.scene.title, found, 3), key='hodographs')


def _drive(cycle: Cycle) -> Chart:
    found = []
    units = {name: catalogue(cycle.machine)[name].unit for name in cycle.drive_torques}
    for unit in dict.fromkeys(units.values()):
        labels = {
            name: name.partition('.')[2] or cycle.drive for name in units if units[name] == unit
        }
        words = 'torque of the drive' if unit == 'N m' else 'force of the drive'
        found += _lines(cycle, labels, words)
    found += _lines(cycle, {'drive_power': 'power'}, 'power of the drive')
    found += _lines(cycle, {f'energy.{x}': x for x in ('kinetic', 'potential')}, 'energy')
    found += _lines(cycle, {'shaking_moment': 'moment'}, 'moment on the frame')
    return _chart(cycle, 'drive', found, 1)


def _paths(cycle: Cycle) -> Chart:
    found: list[Curve] = []
    own = numbers(cycle.machine.mechanism)
    for name, shade in zip(cycle.points, colours(cycle.points, own), strict=True):
        x, y = (1e3 * cycle[f'position.{name}.{axis}'] for axis in 'xy')
        dash = sum(c.colour == shade and c.form == 'line' for c in found)
        line = Curve(x, y, name, f'position.{name}', shade, dash)
        found += [line, line.start()]
    title = '' if len(cycle.points) > 1 else next(iter(cycle.points))
    panel = Panel(Axis('x', 'mm'), Axis('y', 'mm'), tuple(found), title, 'equal', height=4.0)
    return Chart('paths', cycle.machine.scene.title, (panel,), width=6.0)
