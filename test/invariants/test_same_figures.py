"""Equality of a figure wherever it is asked for.

A cycle, ``solve --measure``, a column of a sweep, statistics, and a bag that is read back.
"""

from __future__ import annotations

import numpy as np
import pytest
from four_bars import loose

import mechanism_sim as ms
from mechanism_sim.analysis.measure import measure
from mechanism_sim.analysis.record import read_record
from mechanism_sim.engine.audit import Audit
from mechanism_sim.errors import RunError
from mechanism_sim.results.cycle import cycle
from mechanism_sim.results.measure_text import read_all
from mechanism_sim.results.measures import EXACT, Measurement
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.run_bag import RunBag
from mechanism_sim.studies.runs import compute
from mechanism_sim.studies.statistics import statistics

SAME = {'rel': 1e-12, 'abs': 1e-13}
TEXTS = (
    'mean(drive_torque)', 'rms(drive_torque)', 'mean(drive_power)', 'work(drive_torque)',
    'integral(drive_power)', 'rms(velocity.{part})', 'mean(abs(drive_torque))',
    'largest(drive_torque)', 'highest(reaction.{joint})', 'lowest(acceleration.{part})',
    'percentile(drive_torque, 90)', 'share(drive_torque > 0)',
)  # fmt: skip


def of_a_sweep(machine, texts, extent):
    task = SweepTask('key', machine.name, machine.scene, extent, measures=tuple(texts))
    return compute(task).row


def of_a_bag(machine, solution, texts, folder):
    with RunBag(folder / 'run.mcap', machine, solution.duration) as bag:
        bag.add(solution)
    record = read_record(folder / 'run.mcap')
    taken = Measurement(record.machine, texts, record.start, record.end)
    taken.add(record.piece)
    return {m.text: m.value for m in taken.found()}


@pytest.mark.parametrize(
    ('name', 'part', 'joint'),
    [
        # its load jumps twice
        pytest.param('punch', 'coupler', 'crank_coupler', marks=pytest.mark.slow),
        pytest.param('four_bar_nominal', 'rocker', 'coupler_rocker', marks=pytest.mark.slow),
        ('four_bar_clearance', 'rocker', 'coupler_rocker'),
    ],
)
def test_a_figure_is_the_same_number_at_every_door(name, part, joint, tmp_path):
    machine = ms.load_scene(name)
    texts = [text.format(part=part, joint=joint) for text in TEXTS]
    one = cycle(machine)
    solution = ms.simulate(machine, duration=float(one.t[-1]))
    found = {m.text: m for m in measure(machine, solution, *texts)}
    assert {m.resolution for m in found.values()} == {EXACT}
    value = {text: m.value for text, m in found.items()}

    row = of_a_sweep(machine, texts, Extent(None, solution.duration, 0))
    recorded = of_a_bag(machine, solution, texts, tmp_path)
    for text in texts:
        assert row[text] == pytest.approx(value[text], **SAME), text
        assert recorded[text] == pytest.approx(value[text], **SAME), text
    for column in ('drive_torque', 'drive_power'):
        assert one.mean(column) == pytest.approx(value[f'mean({column})'], **SAME)
    assert one.rms('drive_torque') == pytest.approx(value['rms(drive_torque)'], **SAME)
    assert one.rms(f'velocity.{part}') == pytest.approx(value[f'rms(velocity.{part})'], **SAME)
    work = value['work(drive_torque)']
    assert one.mean_power * one.duration == pytest.approx(work, rel=1e-10, abs=1e-13)
    assert solution.energy.drive_work == pytest.approx(work, rel=1e-10, abs=1e-13)
    ends = one.extremes()
    force = ends[f'reaction.{joint}.size'].greatest.value
    assert force == pytest.approx(value[f'highest(reaction.{joint})'], **SAME)
    assert row[f'largest_force.{joint}'] == pytest.approx(force, **SAME)
    low = ends[f'acceleration.{part}'].least.value
    assert low == pytest.approx(value[f'lowest(acceleration.{part})'], **SAME)
    largest = row[f'largest_torque.{machine.plan.main}']
    assert abs(largest) == pytest.approx(value['largest(drive_torque)'], **SAME)


@pytest.mark.slow
def test_means_over_revolutions_are_the_mean_over_the_whole():
    machine = loose(0.5, 'seated')
    texts = ['mean(reaction.coupler_rocker)', 'mean(drive_torque)', 'integral(drive_power)']
    found = statistics(machine, 22, 2, measures=read_all(texts, 'test'))
    solution = ms.simulate(machine, revolutions=22)
    since = {'since': 2.0 * machine.drive.period, 'until': 22.0 * machine.drive.period}
    whole = {m.text: m.value for m in measure(machine, solution, *texts, **since)}
    row = of_a_sweep(machine, texts, Extent(22, None, 2))
    for m in found.measures:
        times = 20.0 if m.name.startswith('integral') else 1.0
        assert m.mean * times == pytest.approx(whole[m.name], rel=1e-10)
        assert row[m.name] == pytest.approx(whole[m.name], rel=1e-10)


def test_statistics_count_what_friction_takes():
    clearance = 'joints.coupler_rocker.clearance'
    friction = {f'{clearance}.friction': 0.1, f'{clearance}.pin_radius': '5 mm'}
    machine = ms.load_scene('four_bar_clearance', {'drive.speed': '450 rpm', **friction})
    found = {m.name: m.mean for m in statistics(machine, 20, 0).means}
    solution = ms.simulate(machine, revolutions=20)
    assert found['dissipated'] * 20 == pytest.approx(solution.energy.dissipated, rel=1e-12)
    row = of_a_sweep(machine, [], Extent(20, None, 0))
    assert row['dissipated'] == found['dissipated']
    assert solution.energy.dissipated > 1.05 * sum(i.energy_loss for i in solution.impacts)


def test_what_a_touch_loses_is_counted_once():
    contact = {'law': 'hunt_crossley', 'stiffness': 1e10}
    machine = loose(0.5, 'seated', joints__coupler_rocker__clearance__contact=contact)
    row = of_a_sweep(machine, [], Extent(1, None, 0))
    solution = ms.simulate(machine, revolutions=1)
    assert row['dissipated'] == pytest.approx(solution.energy.dissipated, rel=1e-12)


@pytest.mark.slow
def test_statistics_fail_where_a_solution_fails(monkeypatch):
    machine = loose(0.5, 'seated')
    monkeypatch.setattr(
        Audit, 'max_penetration', property(lambda _: 1.0, lambda _, __: None), raising=False
    )
    for run in (
        lambda: ms.simulate(machine, revolutions=1),
        lambda: statistics(machine, 20, 0),
    ):
        with pytest.raises(RunError, match='1 m'):
            run()
    assert 'm' in str(of_a_sweep(machine, [], Extent(1, None, 0))['status'])


def test_the_mean_of_a_load_that_jumps_is_split_at_its_jumps():
    """Beside the trapezoidal rule on thousands of instants of each segment by itself."""
    one = cycle(ms.load_scene('punch'))
    curve = one.solution.motion.curve
    total = 0.0
    for k in range(len(curve)):
        places = np.linspace(0.0, curve.duration[k], 6001)
        seen = one.machine.physics.observe(one.solution.motion, np.array([k]), places[None])
        square = seen.drive_torque[0] ** 2
        total += float(np.trapezoid(square, places))
    assert one.rms('drive_torque') == pytest.approx(np.sqrt(total / one.duration), rel=1e-7)
    assert one.rms('drive_torque') == pytest.approx(180.68, abs=0.01)
