"""The figures of a row: those of every run, and those of its joints, drives and measures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from mechanism_sim.results.measure_text import Measure, read_all
from mechanism_sim.results.measures import OVERLOADS, Measurement
from mechanism_sim.scene import Machine
from mechanism_sim.studies.schema import WindowsPart


class ResultColumn(NamedTuple):
    """A column of numbers of a table of runs."""

    name: str
    unit: str
    meaning: str


PER_TURN = '1/rev'
"""Unit of numbers of events per revolution of the crank, or a cycle of `life`; a number without
a unit, such as `impacts.JOINT` here, counts the whole window."""

MEANS = (
    ResultColumn('impacts', PER_TURN, 'impacts per revolution'),
    ResultColumn('impulse', 'N s', 'sum of normal impulses per revolution'),
    ResultColumn('losses_of_contact', PER_TURN, 'losses of contact per revolution'),
    ResultColumn('share_of_flight', '', 'share of the time in flight, mean of the loose joints'),
    ResultColumn('dissipated', 'J', 'energy dissipated, less work of loads, per revolution'),
    ResultColumn('I_n', 'N s', 'normal impulse per impact'),
)
"""Figures with a confidence interval: of `StatisticsAccumulator.table`, and the ratio of two."""

FIGURES = (
    *(
        column
        for mean in MEANS
        for column in (
            mean,
            ResultColumn(
                f'{mean.name}_half_width', mean.unit, 'half of its 95 % confidence interval'
            ),
        )
    ),
    ResultColumn(
        'revolutions',
        '',
        'of the crank that these figures are made of; none where it slides or swings: they are '
        'of the whole window',
    ),
    ResultColumn('largest_impulse', 'N s', 'of an impact'),
    ResultColumn('largest_force', 'N', 'in any joint, between impacts'),
    ResultColumn('max_penetration', 'm', 'deepest violation of an open gap, whole run'),
    ResultColumn('energy_residual', 'J', 'residual of the energy balance, whole run'),
)
"""Numbers of a row, besides its steps, its digest and its status."""

RESERVED = {*(c.name for c in FIGURES), 'run', 'steps', 'digest', 'status'}


def overloads_of(sensor: str) -> str:
    """The column of how many samples of a sensor were cut at the end of its range."""
    return f'sum(sensors.{sensor}.{OVERLOADS})'


def of_converters(machine: Machine, windows: WindowsPart | None) -> list[ResultColumn]:
    """Columns of the numbers of cut samples, for each sensor that has a range."""
    sensors, what = machine.scene.sensors, ' of its windows' if windows else ''
    return [
        ResultColumn(overloads_of(name), '', f'samples{what} cut at the end of the range')
        for name in (windows.sensors_of(machine.scene) if windows else sensors)
        if sensors[name].adc.range
    ]


def of_sensors(machine: Machine, given: Sequence[Measure] = ()) -> list[Measure]:
    """Root mean square and extreme of what every sensor reads, and what cuts, but for `given`."""
    texts = [f'{f}(sensors.{name})' for name in machine.scene.sensors for f in ('rms', 'largest')]
    texts += [column.name for column in of_converters(machine, None)]
    known = {m.text for m in given}
    return read_all([text for text in texts if text not in known], machine.name)


def own_columns(machine: Machine, measures: Sequence[Measure] = ()) -> list[ResultColumn]:
    """Figures that a machine has beside `FIGURES`: of joints and drives, and measures."""
    physics, found = machine.physics, []
    if physics.has_forces:
        found += [
            ResultColumn(f'largest_force.{joint}', 'N', 'in this joint, between impacts')
            for joint in physics.joints
        ]
        found += [
            ResultColumn(
                f'largest_torque.{c}',
                'N' if c in physics.displacements else 'N m',
                'of this drive, between impacts, with its sign',
            )
            for c in physics.driven
        ]
    for joint in physics.clearances:
        found += [
            ResultColumn(f'impacts.{joint}', '', 'in this joint, in the whole window'),
            ResultColumn(f'largest_impulse.{joint}', 'N s', 'of an impact in this joint'),
        ]
    if measures:
        units = Measurement(machine, measures).units()
        found += [ResultColumn(m.name, units[m.name], m.text) for m in measures]
    return found
