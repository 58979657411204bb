"""Values of a scene for which a figure is as wanted, against closed forms."""

import math

import numpy as np
import pytest
from builders import made
from running import run

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.report.studies import finding_text as text
from mechanism_sim.studies.find import find, read_goal
from mechanism_sim.studies.runs import Workers

SPEED, ARM = 12.0, 0.25


def rotor(**changes):
    """A bar that turns about its end at a constant speed, with a brake."""
    scene = {
        'title': 'bar',
        'links': {'bar': {'mass': 2.0, 'inertia': 0.05, 'cog': ARM}},
        'masses': {'weight': {'at': 'bar.start', 'mass': 1.0}},
        'joints': {'O': {'revolute': ['ground', 'bar']}},
        'gravity': [0.0, -9.81],
        'drive': {'coordinate': 'bar', 'speed': SPEED},
        'loads': {'brake': {'at': 'bar', 'torque': '-0.5*bar_rate'}},
    }
    return made(scene | changes, 'bar')


def test_every_crossing_is_found_to_rounding():
    """``highest = 0.5 w + m g |a|`` has the wanted value at two arms."""
    goal = read_goal('highest(drive_torque) = 10 N m', None)
    finding = find(rotor(), ('links.bar.cog', '-0.4 m', '0.4 m'), goal, 8)
    arm = (10.0 - 0.5 * SPEED) / (2.0 * 9.81)
    assert [one.value for one in finding.found] == pytest.approx([-arm, arm], rel=1e-11)
    assert [one.figure for one in finding.found] == pytest.approx([10.0, 10.0], rel=1e-11)
    assert not any(one.jump for one in finding.found)
    assert finding.unit == 'N m'
    for value, figure in finding.curve:
        assert figure == pytest.approx(0.5 * SPEED + 2.0 * 9.81 * abs(value), rel=1e-12)


def test_processes_change_nothing():
    goal = read_goal('highest(drive_torque) = 10 N m', None)
    vary, shown = ('links.bar.cog', '-0.4 m', '0.4 m'), []
    alone = find(rotor(), vary, goal, 4)
    with_two = find(rotor(), vary, goal, 4, Workers(2), lambda *x: shown.append(x))
    assert with_two == alone
    assert shown == [(1, 0), (2, 0), (3, 0), (4, 0)]


def test_loads_that_act_during_a_part_of_the_turn_are_varied_as_well():
    """``highest = w + m g |a|`` under a brake of the size w in half of the turn."""
    brake = {'at': 'bar', 'torque': '-0.5*bar_rate',
             'during': {'coordinate': 'bar', 'from': '-90 deg', 'to': '90 deg'}}  # fmt: skip
    goal = read_goal('highest(drive_torque) = 10 N m', None)
    (found,) = find(
        rotor(loads={'brake': brake}), ('links.bar.cog', '0 m', '0.4 m'), goal, 3
    ).found
    assert found.value == pytest.approx((10.0 - 0.5 * SPEED) / (2.0 * 9.81), rel=1e-11)


def test_limits_of_the_part_of_the_turn_are_values_as_others():
    during = {'coordinate': 'bar', 'from': '0 deg', 'to': '90 deg'}
    model = rotor(loads={'brake': {'at': 'bar', 'torque': -6.0, 'during': during}}, gravity=[0, 0])
    goal = read_goal('mean(drive_torque) = 3 N m', None)
    finding = find(model, ('loads.brake.during.to', '10 deg', '355 deg'), goal, 5)
    assert finding.found[0].value == pytest.approx(math.pi, rel=1e-6)


def test_the_least_is_where_it_is_balanced():
    """The root mean square of the moment of a weight opposite to the bar."""
    points = {'bar': {'mass': 2.0, 'inertia': 0.05, 'cog': ARM, 'points': {'w': [-0.1, 0.0]}}}
    model = rotor(links=points, loads={}, masses={'weight': {'at': 'bar.w', 'mass': 1.0}})
    goal = read_goal(None, 'rms(drive_torque)')
    finding = find(model, ('masses.weight.mass', '1 kg', '20 kg'), goal, 9)
    assert finding.found[0].value == pytest.approx(2.0 * ARM / 0.1, rel=1e-6)
    at = finding.curve[0]
    assert at == pytest.approx((1.0, 9.81 * (2.0 * ARM - 0.1) / math.sqrt(2.0)), rel=1e-12)
    assert 'end of the range' not in text(finding)
    beside = find(model, ('masses.weight.mass', '1 kg', '2 kg'), goal, 3)
    assert text(beside).startswith('masses.weight.mass = 2: ')
    assert 'end of the range' in text(beside)


def test_a_figure_that_steps_across_the_goal_is_marked():
    brake = {'at': 'bar', 'torque': '-1 if t > 0 else 0'}
    stepped = rotor(loads={'a': brake, 'b': {'at': 'bar', 'force': ['100 if x > 5 else 0', 0]}})
    goal = read_goal('mean(drive_torque) = 1 N m', None)
    finding = find(stepped, ('links.bar.cog', '0.1 m', '0.3 m'), goal, 3)
    assert {round(one.figure, 12) for one in finding.found} <= {1.0}


def test_what_cannot_run_leaves_a_gap_and_its_reason():
    goal = read_goal('largest(position.piston) = 0.5 m', None)
    finding = find(ms.load_scene('slider_crank'), ('links.rod.length', '0.02 m', '0.6 m'), goal, 6)
    assert [round(value, 6) for value, _ in finding.failed] == [0.02, 0.039487]
    assert 'cannot follow its drive' in finding.failed[0][1]
    assert np.isnan([figure for _, figure in finding.curve[:2]]).all()
    (one,) = finding.found
    assert one.value == pytest.approx(0.5 - 0.05, rel=1e-11)  # crank and rod in line


@pytest.mark.parametrize(
    ('args', 'said'),
    [
        ((), 'give one of'),
        (('--so-that', 'most(x) = 3'), 'functions: highest'),
        (('--so-that', 'mean(x)'), 'write MEASURE = VALUE'),
        (('--so-that', 'mean(drive_torqe) = 1'), "did you mean 'drive_torque'"),
        (('--so-that', 'mean(drive_torque) = 1 m'), 'the wanted value 1 m'),
        (('--minimise', 'drive_torque'), "write for example 'largest(drive_torque)'"),
    ],
)
def test_goals_that_are_none_are_refused(args, said):
    done = run('find', 'slider_crank', '--vary', 'links.rod.mass=1:2', '--values', '2', *args)
    assert done.returncode == 2
    assert said in done.stderr


def test_a_path_that_is_none_is_refused():
    with pytest.raises(InputError):
        find(rotor(), ('links.bar.lenth', '1', '2'), read_goal(None, 'mean(drive_torque)'))


def test_a_figure_without_a_value_is_no_figure():
    """The cycle of a bar is one turn: a window in the second is not reached."""
    goal = read_goal('mean(drive_torque, from 1 revolutions to 2 revolutions) = 1 N m', None)
    with pytest.raises(InputError, match='before the window begins'):
        find(rotor(), ('drive.speed', '10 rad/s', '20 rad/s'), goal, 3)
    late = read_goal('mean(drive_torque, from 0.5 s) = 1 N m', None)  # turns of 0.63 s and 0.42 s
    finding = find(rotor(), ('drive.speed', '10 rad/s', '15 rad/s'), late, 2)
    assert [value for value, _ in finding.failed] == [15.0]
    assert 'has no finite value' in finding.failed[0][1]
