"""Charts of a cycle: motion, phase portraits, forces as hodographs, torque and power, paths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

from mechanism_sim.analysis.series import Series, sampled
from mechanism_sim.export.palette import numbers
from mechanism_sim.report.charts.chart import Axis, Chart, ChartCurve, Over, Panel, joined
from mechanism_sim.report.charts.lines import against, chart, columns, hodograph
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.quantities.motion import RATES


def charts(cycle: Cycle) -> Iterator[Chart]:
    """The charts of a cycle."""
    physics = cycle.machine.physics
    names, known = cycle.machine.physics.coordinates, catalogue(cycle.machine)
    units = len({known[f'position.{name}'].unit for name in names})
    rows = [_panels(cycle, [f'{kind}.{name}' for name in names]) for kind in RATES]
    if len(rows[0]) != units:  # of many coordinates each has a row
        rows, units = list(zip(*rows, strict=True)), len(RATES)
    yield _chart(cycle, 'motion', list(chain(*rows)), units)
    found = [
        replace(panel, title=name, height=2.3)
        for name in physics.coordinates
        for panel in _over(cycle, f'position.{name}', f'velocity.{name}')
    ]
    beside = min(3, len(found))
    title = cycle.machine.scene.title
    yield Chart('phase', title, tuple(found), columns=beside, width=max(3.2 * beside, 4.5))
    if physics.has_forces:
        sizes = _panels(cycle, [f'reaction.{joint}.size' for joint in physics.joints])
        yield _chart(cycle, 'forces', [replace(p, y=replace(p.y, low=0.0)) for p in sizes])
        yield _hodographs(cycle)
        torques = _panels(cycle, cycle.drive_torques)
        others = ['drive_power'], ['energy.kinetic', 'energy.potential'], ['shaking_moment']
        yield _chart(cycle, 'drive', [*torques, *chain(*(_panels(cycle, n) for n in others))], 1)
    if cycle.points:
        yield _paths(cycle)


def _over(cycle: Cycle, what: str, *names: str) -> tuple[Panel, ...]:
    """The panels of columns over time, the angle of the drive, or another column."""
    own = numbers(cycle.machine.mechanism)
    return chart(_shown(cycle, names), '', against(cycle, what), own).panels


def _shown(cycle: Cycle, names: Sequence[str]) -> list[Series]:
    ends = cycle.extremes()
    return [
        replace(s, values=ends[s.name].without_rounding(s.values)) if s.name in ends else s
        for s in sampled(cycle, names, cycle.t)
    ]


def _panels(cycle: Cycle, names: Sequence[str]) -> tuple[Panel, ...]:
    return _over(cycle, 'angle' if cycle.repeats else 'time', *names)


def _chart(cycle: Cycle, key: str, found: list[Panel], beside: int = 0) -> Chart:
    beside = beside or columns(found)
    kind: Over = 'angle' if cycle.repeats else 'time'
    title = cycle.machine.scene.title
    return Chart(key, title, tuple(found), kind, columns=beside, width=(8.0, 11.0)[beside > 1])


def _hodographs(cycle: Cycle) -> Chart:
    """The vector of each joint's force over its direction, and of the force on the frame."""
    joints = map(cycle.machine.mechanism.joint, cycle.machine.physics.joints)
    forces = {f'reaction.{j.name}.size': f'{j.name}: {j.first} on {j.second}' for j in joints}
    forces['shaking_force.size'] = 'all on the frame'
    found = [
        replace(hodograph(cycle, size), title=forces[size.name])
        for size in _shown(cycle, [*forces])
    ]
    single = Chart('hodographs', cycle.machine.scene.title, tuple(found), 'polar')
    return replace(joined(single.title, [single], 3), key='hodographs')


def _paths(cycle: Cycle) -> Chart:
    """All paths in one panel, true to scale."""
    found: list[ChartCurve] = []
    for name in cycle.points:
        (panel,) = _over(cycle, f'position.{name}.x', f'position.{name}.y')
        for c in panel.curves:
            dash = sum(x.shade == c.shade and x.form == 'line' for x in found)
            found.append(
                replace(c, label=name if c.label else '', dash=dash, of=f'position.{name}')
            )
    panel = replace(panel, x=Axis('x', 'm'), y=Axis('y', 'm'), curves=tuple(found), title='')
    if len(cycle.points) == 1:
        panel = replace(panel, title=name)
    return Chart('paths', cycle.machine.scene.title, (panel,), width=6.0)
