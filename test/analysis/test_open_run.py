"""One way to ask a bag, another program's bag, a solution and a cycle."""

from __future__ import annotations

import numpy as np
import pytest
from bags import write_bag
from builders import simulated
from running import run as command

import mechanism_sim as ms
from mechanism_sim.analysis.collectors import field_ranges
from mechanism_sim.errors import InputError
from mechanism_sim.messages import JointState, serialize
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from ros_interfaces.stamps import stamp

NAMES = 'reaction.coupler_rocker.size', 'position.coupler.cog.x'


def foreign(path, velocities, unknown=()):
    """A bag of a pendulum's angle as any program may write it, its rate unknown at times."""
    with BagWriter(path) as bag:
        bag.add_topic('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        for t in np.linspace(0.0, 2.0, 81):
            message = JointState(name=['rod', 'slide'], position=[np.sin(3.0 * t), t])
            if velocities:
                rate = np.nan if t in unknown else 3.0 * np.cos(3.0 * t)
                message.velocity = [rate, 1.0]
            message.header.stamp = stamp(t)
            bag.write('/joint_states', serialize(message), int(t * 1e9))
    return path


def test_all_sources_give_the_same_numbers(tmp_path):
    record = simulated('four_bar_clearance', duration=0.05)
    bag = write_bag(tmp_path / 'run.mcap', record)
    t = np.linspace(0.0, 0.05, 20)
    given = record.piece.sample(t, *NAMES)
    for source in (bag, str(bag), record.piece):
        found = ms.open_run(source).columns(NAMES, t)
        assert found.units['reaction.coupler_rocker.size'] == 'N'
        for name in NAMES:
            assert np.array_equal(found[name], given[name])
    cycle = ms.cycle(ms.load_scene('four_bar_nominal'), samples=8)
    found = ms.open_run(cycle).columns(['drive_torque'], cycle.t)
    assert np.array_equal(found['drive_torque'], cycle['drive_torque'])


def test_an_angle_of_the_drive_may_be_asked_for():
    run = ms.open_run(ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=2))
    turns = np.array([0.5, 1.25])
    found = run.columns(['position.crank'], turns=turns)
    assert found['position.crank'] == pytest.approx(2.0 * np.pi * turns, rel=1e-12)
    with pytest.raises(InputError, match='either times or turns'):
        run.columns(['position.crank'])


@pytest.mark.parametrize(('velocities', 'error'), [(True, 8.3e-8), (False, 7.1e-4)])
def test_joint_states_of_another_program_are_a_run(tmp_path, velocities, error):
    """Between instants by Hermite's polynomials where there are velocities, else straight.

    Their errors are at most h^4 max|x''''| / 384 and h^2 max|x''| / 8.
    """
    run = ms.open_run(foreign(tmp_path / 'other.mcap', velocities))
    t = np.linspace(0.1, 1.9, 301)
    found = run.columns(['position.rod', 'position.slide'], t)
    off = np.abs(found['position.rod'] - np.sin(3.0 * t)).max()
    assert error / 10.0 < off < error
    assert found['position.slide'] == pytest.approx(t, abs=1e-12)
    assert ('velocity.rod' in run.series) == velocities
    with pytest.raises(InputError, match="did you mean 'position\\.rod'"):
        run.columns(['position.rods'], t)
    with pytest.raises(InputError, match='is recorded from 0 s to 2 s'):
        run.columns(['position.rod'], np.array([3.0]))


def test_samples_without_a_value_are_counted(tmp_path):
    found = field_ranges(read_bag(foreign(tmp_path / 'other.mcap', True, unknown=(0.5, 1.0))))
    known = {f.quantity: (f.samples, f.unknown) for f in found}
    assert known['/joint_states.velocity[rod]'] == (81, 2)
    assert known['/joint_states.position[rod]'] == (81, 0)


def test_times_of_a_clock_are_exact_to_the_nanosecond(tmp_path):
    """A float of seconds since 1970 has steps of 0.2 us; all count from the start of the bag."""
    begin = 1_700_000_000_123_456_789
    path = tmp_path / 'clock.mcap'
    with BagWriter(path) as bag:
        bag.add_topic('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        for k in range(5):
            t = begin + 10_000_000 * k
            message = JointState(name=['rod'], position=[0.1 * k])
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(t, 10**9)
            bag.write('/joint_states', serialize(message), t)
    run = ms.open_run(path)
    assert run.series['position.rod'].t.tolist() == [0.0, 0.01, 0.02, 0.03, 0.04]
    done = command('analyze', str(path))
    assert 'time   0 s to 0.04 s (from 2023-11-14 22:13:20 UTC on)' in done.stdout
