"""Values of a scene for which a figure is as wanted, against closed forms."""

import itertools
import math

import numpy as np
import pytest
from builders import made
from loose_valve import BEGINS, MASS, PRELOAD, RISE, valve
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.report.found import text
from mechanism_sim.scene import load_scene
from mechanism_sim.studies.find import find
from mechanism_sim.studies.goal import CycleTrial, read_goals
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
    goal = 'highest(drive_torque) = 10 N m'
    finding = find(rotor(), {'links.bar.cog': ('-0.4 m', '0.4 m')}, goal, samples=8)
    arm = (10.0 - 0.5 * SPEED) / (2.0 * 9.81)
    assert [one.value for one in finding.found] == pytest.approx([-arm, arm], rel=1e-11)
    assert [one.figure for one in finding.found] == pytest.approx([10.0, 10.0], rel=1e-11)
    assert not any(one.jump for one in finding.found)
    assert finding.unit == 'N m'
    for value, figure in finding.curve:
        assert figure == pytest.approx(0.5 * SPEED + 2.0 * 9.81 * abs(value), rel=1e-12)


@pytest.mark.slow
def test_zero_but_for_rounding_is_met_from_where_the_closed_form_says():
    """Least force of an eccentric cam: ``preload + 2 k e - m e w^2``, and nothing in flight."""
    wanted = 'lowest(normal_force.contact) = 0 N'
    (one,) = find('eccentric_cam', 'drive.speed=200 rad/s:300 rad/s', wanted, samples=6).found
    begins = math.sqrt((30.0 / 0.005 + 2.0 * 4000.0) / 0.2)
    assert (one.value, one.last) == (pytest.approx(begins, rel=1e-9), 300.0)


def test_rounding_of_measures_is_that_of_what_they_are_made_of():
    """Of the bar the torque is ``0.5 w + m g a cos(q)``, of 10.905 N m at most."""
    run = ms.simulate(rotor(), revolutions=1)
    largest = 0.5 * SPEED + 2.0 * 9.81 * ARM
    texts = 'lowest(drive_torque)', 'mean(drive_torque)', 'initial(drive_torque)'
    small = [m.rounding for m in ms.measure(run, *texts)]
    assert small == pytest.approx([1e-13 * largest, 1e-13 * 0.5 * SPEED, 1e-13 * largest], rel=0.5)
    (both,) = ms.measure(run, '2 * lowest(drive_torque) - highest(drive_torque)')
    assert both.rounding == pytest.approx(3e-13 * largest, rel=0.1)
    assert ms.measure(run, 'count(impacts)')[0].rounding == 0.0


@pytest.mark.slow
def test_processes_change_nothing():
    goal = 'highest(drive_torque) = 10 N m'
    vary, shown = {'links.bar.cog': ('-0.4 m', '0.4 m')}, []
    alone = find(rotor(), vary, goal, samples=4)
    with_two = find(
        rotor(), vary, goal, samples=4, workers=Workers(2), show=lambda *x: shown.append(x)
    )
    assert with_two == alone
    assert shown == [(k + 1, 0) for k in range(alone.evaluations)]


def test_loads_that_act_during_a_part_of_the_turn_are_varied_as_well():
    """``highest = w + m g |a|`` under a brake of the size w in half of the turn."""
    brake = {'at': 'bar', 'torque': '-0.5*bar_rate',
             'during': {'coordinate': 'bar', 'from': '-90 deg', 'to': '90 deg'}}  # fmt: skip
    goal = 'highest(drive_torque) = 10 N m'
    (found,) = find(
        rotor(loads={'brake': brake}), {'links.bar.cog': ('0 m', '0.4 m')}, goal, samples=3
    ).found
    assert found.value == pytest.approx((10.0 - 0.5 * SPEED) / (2.0 * 9.81), rel=1e-11)


def test_limits_of_the_part_of_the_turn_are_values_as_others():
    during = {'coordinate': 'bar', 'from': '0 deg', 'to': '90 deg'}
    model = rotor(loads={'brake': {'at': 'bar', 'torque': -6.0, 'during': during}}, gravity=[0, 0])
    goal = 'mean(drive_torque) = 3 N m'
    finding = find(model, {'loads.brake.during.to': ('10 deg', '355 deg')}, goal, samples=5)
    assert finding.found[0].value == pytest.approx(math.pi, rel=1e-6)


@pytest.mark.slow
def test_the_least_is_where_it_is_balanced():
    """The root mean square of the moment of a weight opposite to the bar."""
    points = {'bar': {'mass': 2.0, 'inertia': 0.05, 'cog': ARM, 'points': {'w': [-0.1, 0.0]}}}
    model = rotor(links=points, loads={}, masses={'weight': {'at': 'bar.w', 'mass': 1.0}})
    goal = 'rms(drive_torque)'
    finding = find(model, {'masses.weight.mass': ('1 kg', '20 kg')}, minimise=goal, samples=9)
    assert finding.found[0].value == pytest.approx(2.0 * ARM / 0.1, rel=1e-6)
    at = finding.curve[0]
    assert at == pytest.approx((1.0, 9.81 * (2.0 * ARM - 0.1) / math.sqrt(2.0)), rel=1e-12)
    assert 'end of the range' not in text(finding)
    beside = find(model, {'masses.weight.mass': ('1 kg', '2 kg')}, minimise=goal, samples=3)
    assert text(beside).startswith('masses.weight.mass = 2 kg: ')
    assert 'end of the range' in text(beside)


def test_a_figure_that_steps_across_the_goal_is_marked():
    brake = {'at': 'bar', 'torque': '-1 if t > 0 else 0'}
    stepped = rotor(loads={'a': brake, 'b': {'at': 'bar', 'force': ['100 if x > 5 else 0', 0]}})
    goal = 'mean(drive_torque) = 1 N m'
    finding = find(stepped, {'links.bar.cog': ('0.1 m', '0.3 m')}, goal, samples=3)
    assert {round(one.figure, 12) for one in finding.found} <= {1.0}


@pytest.mark.slow
def test_a_count_is_met_all_along_a_stretch():
    """A follower stays on its cam from the stiffness on that its deceleration takes."""
    limits = {'springs.s.stiffness': (2e3, 6e3)}
    (one,) = find(valve(1700.0), limits, 'count(impacts) = 0', samples=5).found
    part, speed = np.linspace(0.0, 1.0, 200_001), 1700.0 * math.pi / 30.0
    lift = RISE * (part - np.sin(2.0 * math.pi * part) / (2.0 * math.pi))
    bent = RISE * 2.0 * math.pi * np.sin(2.0 * math.pi * part) / math.radians(BEGINS) ** 2
    least = (-MASS * (9.81 + bent * speed**2) / (PRELOAD + lift)).max()
    assert one.value == pytest.approx(least, rel=1e-6)
    assert one.last == pytest.approx(6e3, rel=1e-12)


def test_what_cannot_run_leaves_a_gap_and_its_reason():
    goal = 'largest(position.piston) = 0.5 m'
    upright = load_scene('slider_crank', {'drive.start_angle': '90 deg'})  # over a short rod
    finding = find(upright, {'links.rod.length': ('0.02 m', '0.6 m')}, goal, samples=6)
    assert [round(value, 6) for value, _ in finding.failed] == [0.02, 0.039487]
    assert 'cannot be assembled' in finding.failed[0][1]
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


def test_the_wanted_value_of_a_share_may_be_in_percent():
    (goal,) = read_goals('share(drive_torque > 0) = 52.38 %')
    assert goal.value('') == 0.5238
    with pytest.raises(InputError, match=r'52.38 % has the unknown unit'):
        goal.value('m')
    with pytest.raises(InputError, match=r'52,38 % has a decimal comma'):
        read_goals('share(drive_torque > 0) = 52,38 %')[0].value('')


def test_a_path_that_is_none_is_refused():
    with pytest.raises(InputError):
        find(rotor(), {'links.bar.lenth': ('1', '2')}, minimise='mean(drive_torque)')


@pytest.mark.slow
@pytest.mark.parametrize('limits', [('-10 rpm', '10 rpm'), ('0 rpm', '10 rpm')])
def test_speeds_about_zero_are_refused_where_cycles_are_turns(limits):
    speeds = {'drive.speed': limits}
    with pytest.raises(InputError, match='standstill'):
        find(rotor(), speeds, minimise='mean(drive_torque)')
    found = find(rotor(), speeds, minimise='mean(drive_torque)', samples=2, duration=0.1)
    assert len(found.curve) >= 2


def test_a_figure_without_a_value_is_no_figure():
    """The cycle of a bar is one turn: a window in the second is not reached."""
    goal = 'mean(drive_torque, from 1 revolutions to 2 revolutions) = 1 N m'
    with pytest.raises(InputError, match='before the window begins'):
        find(rotor(), {'drive.speed': ('10 rad/s', '20 rad/s')}, goal, samples=3)
    late = 'mean(drive_torque, from 0.5 s) = 1 N m'  # turns of 0.63 s and 0.42 s
    finding = find(rotor(), {'drive.speed': ('10 rad/s', '15 rad/s')}, late, samples=2)
    assert [value for value, _ in finding.failed] == [15.0]
    assert 'has no finite value' in finding.failed[0][1]


BOTH = {'drive.speed': ('2 rad/s', '20 rad/s'), 'links.bar.cog': ('0.05 m', '0.4 m')}


@pytest.mark.slow
def test_two_keys_are_found_for_two_goals():
    """``highest = 0.5 w + m g a`` and ``mean = 0.5 w``, of which w and a follow."""
    found = find(
        rotor(), BOTH, ['highest(drive_torque) = 10 Nm', 'mean(drive_torque) = 5 Nm'], samples=4
    )
    assert found.reached
    assert found.values['drive.speed'] == pytest.approx(10.0, rel=1e-8)
    assert found.values['links.bar.cog'] == pytest.approx(5.0 / (2.0 * 9.81), rel=1e-8)
    assert found.measures['highest(drive_torque)'] == pytest.approx(10.0, rel=1e-8)
    assert found.evaluations > 4


@pytest.mark.slow
def test_more_keys_than_goals_give_one_of_many():
    found = find(rotor(), BOTH, 'highest(drive_torque) = 10 N m', samples=4)
    assert found.reached
    w, a = found.values.values()
    assert 0.5 * w + 2.0 * 9.81 * a == pytest.approx(10.0, rel=1e-8)
    assert 'one of many solutions: 2 keys are varied for 1 measure' in text(found)


@pytest.mark.slow
def test_a_goal_beyond_the_limits_is_not_reached():
    found = find(rotor(), BOTH, 'highest(drive_torque) = 30 N m', samples=4)
    assert not found.reached
    assert found.ends == [*BOTH]
    assert found.measures['highest(drive_torque)'] == pytest.approx(
        10.0 + 2.0 * 9.81 * 0.4, rel=1e-5
    )
    said = text(found)
    assert 'wanted 30 N m' in said
    assert 'drive.speed = 20 rad/s' in said
    assert '(the end of its range)' in said


@pytest.mark.slow
def test_two_weights_balance_a_bar():
    """The least of ``|(1 - 0.2 m1, 0.2 - 0.2 m2)|``, a cone without derivatives at its tip."""
    points = {'w': [-0.2, 0.0], 'u': [0.0, -0.2]}
    bar = {'mass': 2.0, 'inertia': 0.05, 'cog': [0.5, 0.1], 'points': points}
    masses = {'one': {'at': 'bar.w', 'mass': 1.0}, 'two': {'at': 'bar.u', 'mass': 1.0}}
    model = rotor(links={'bar': bar}, loads={}, masses=masses)
    vary = {f'masses.{name}.mass': (0.2, 8.0) for name in masses}
    found = find(model, vary, minimise='rms(drive_torque)', samples=5)
    assert [*found.values.values()] == pytest.approx([5.0, 1.0], rel=1e-5)
    assert not found.ends


@pytest.mark.slow
def test_the_command_varies_several_keys():
    """Both dead centres of a slider-crank, l + r and l - r; Pyslvs, issue 35."""
    args = ('--vary', 'links.crank.length=40 mm:150 mm', '--vary', 'links.rod.length=0.3 m:0.6 m',
            '--so-that', 'highest(position.piston) = 0.5 m',
            '--so-that', 'lowest(position.piston) = 300 mm', '--values', '4')  # fmt: skip
    found = run_json('find', 'slider_crank', *args)
    lengths = {'links.crank.length': 0.1, 'links.rod.length': 0.4}
    assert found['values'] == pytest.approx(lengths, rel=1e-8)
    assert found['measures']['lowest(position.piston)'] == pytest.approx(0.3, rel=1e-8)
    assert found['evaluations'] > 4
    said = run('find', 'slider_crank', *args).stdout
    assert 'links.crank.length = 100 mm' in said
    assert 'lowest(position.piston) = 300 mm' in said
    alone = run_json('find', 'slider_crank', *args[2:6], '--values', '3')
    assert alone['values'] == pytest.approx({'links.rod.length': 0.45}, rel=1e-9)
    assert alone['measures'] == pytest.approx({'highest(position.piston)': 0.5})
    assert alone['evaluations'] > 3


@pytest.mark.slow
def test_the_greatest_is_found_along_one_key():
    """``range = 2 m g |a|`` of a bar is greatest at the larger end."""
    finding = find(rotor(), {'links.bar.cog': (-0.4, 0.3)}, maximise='range(drive_torque)')
    assert finding.found[0].value == pytest.approx(-0.4, rel=1e-6)
    assert 'it may be more beyond' in text(finding)


LEAST = {'minimise': 'highest(drive_torque)'}


@pytest.mark.slow
@pytest.mark.parametrize('sign', ['>=', pytest.param('=', marks=pytest.mark.slow)])
def test_the_least_under_constraints(sign):
    """``highest = mean + range/2``: both at their limits, of which w = 6 and a follow."""
    bounds = [f'mean(drive_torque) {sign} 3 N m', '4 N m < range(drive_torque)']
    found = find(rotor(), BOTH, **LEAST, subject_to=bounds, samples=6)
    assert found.reached
    assert found.values == pytest.approx(
        {'drive.speed': 6.0, 'links.bar.cog': 1.0 / 9.81}, rel=1e-7
    )
    assert found.measures['highest(drive_torque)'] == pytest.approx(5.0, rel=1e-7)
    assert [(c.holds, c.active, c.limit, c.unit) for c in found.constraints] == [
        (True, True, 3.0, 'N m'), (True, True, 4.0, 'N m'),
    ]  # fmt: skip
    assert 'range(drive_torque) > 4 N m holds (at its limit): 4 N m' in text(found)


@pytest.mark.slow
def test_a_constraint_of_two_measures_and_one_that_does_not_matter():
    """``range <= mean`` is ``a <= 0.5 w / (2 m g)``, so the greatest range is that of the mean."""
    found = find(
        rotor(), BOTH, maximise='range(drive_torque)', samples=6,
        subject_to=['range(drive_torque) < mean(drive_torque)', 'mean(drive_torque) <= 4 N m',
                    'highest(drive_torque) < 1 kN m'],
    )  # fmt: skip
    assert found.measures['range(drive_torque)'] == pytest.approx(4.0, rel=1e-7)
    assert [c.active for c in found.constraints] == [True, True, False]


@pytest.mark.slow
def test_targets_under_constraints():
    goal = 'highest(drive_torque) = 6 N m'
    found = find(rotor(), BOTH, goal, subject_to='mean(drive_torque) < 2 N m', samples=6)
    assert found.reached
    assert found.measures['highest(drive_torque)'] == pytest.approx(6.0, rel=1e-8)
    assert found.values['drive.speed'] <= 4.0 * (1.0 + 1e-9)


@pytest.mark.slow
def test_targets_that_constraints_forbid():
    far = find(
        rotor(), BOTH, 'highest(drive_torque) = 10 N m', subject_to='mean(drive_torque) < 2 N m',
        samples=6,
    )  # fmt: skip
    assert not far.reached
    assert far.measures['highest(drive_torque)'] == pytest.approx(2.0 + 19.62 * 0.4, rel=1e-6)


@pytest.mark.slow
def test_constraints_that_contradict_each_other_are_told():
    bounds = ['mean(drive_torque) < 0.5 N m', 'range(drive_torque) > 4 N m']  # 0.5 w is 1 or more
    found = find(rotor(), BOTH, **LEAST, subject_to=bounds, samples=6)
    assert not found.reached
    assert 'no values between the limits were found at which all constraints hold' in (text(found))


@pytest.mark.slow
def test_a_front_of_two_measures():
    """At the least speed allowed ``highest = 1.5 + range/2``: the front comes near to it."""
    found = find(
        rotor(), BOTH, **LEAST, maximise='range(drive_torque)', evaluations=400,
        subject_to='mean(drive_torque) > 1.5 N m',
    )  # fmt: skip
    pairs = np.array([[*d.measures.values()] for d in found.front])[:, :2]
    assert len(pairs) > 10
    assert (np.diff(pairs, axis=0) > 0.0).all()  # more range costs more torque
    least = pairs[:, 0] - (1.5 + 0.5 * pairs[:, 1])
    assert least.min() > -1e-9
    assert np.median(least) < 0.2  # of 9.5, from the one end to the other
    assert found.values in [d.values for d in found.front]


def test_lists_of_values_are_tried_whole():
    """Speeds of a gear pair: the torque of a brake in proportion to the speed of the wheel."""
    teeth = {'gears.pinion.teeth': (18, 20), 'gears.wheel.teeth': ['38', '40', '42']}
    goal = 'mean(drive_torque) = 3.1 N m'
    found = find('gear_pair', teeth, goal)
    assert found.values == {'gears.pinion.teeth': 20, 'gears.wheel.teeth': 40}
    assert isinstance(found.values['gears.pinion.teeth'], int)
    assert found.evaluations == 9
    speed = {'drive.speed': {'values': ['10 rad/s', '600 rpm']}}
    assert find('gear_pair', speed, goal).values['drive.speed'] == pytest.approx(20.0 * math.pi)


@pytest.mark.slow
def test_lists_and_limits_together():
    """``0.5 w + 2 g a = 10`` with w of a list that leaves one solution: a = 0.255."""
    vary = {'drive.speed': [2.0, 6.0, 10.0], 'links.bar.cog': (0.05, 0.3)}
    found = find(rotor(), vary, 'highest(drive_torque) = 10 N m', samples=6, evaluations=30)
    assert found.values == pytest.approx({'drive.speed': 10.0, 'links.bar.cog': 5.0 / 19.62})


@pytest.mark.slow
def test_an_interrupted_search_goes_on(tmp_path, monkeypatch):
    """The way is the same, so that cycles of the journal are not computed again."""
    how = {**LEAST, 'subject_to': 'range(drive_torque) > 4 N m', 'samples': 4}
    whole, file, at, calls = find(rotor(), BOTH, **how), tmp_path / 'a.csv', CycleTrial.at, []

    def counted(trial, values):
        calls.append(values)
        if len(calls) == 11:
            raise KeyboardInterrupt
        return at(trial, values)

    monkeypatch.setattr(CycleTrial, 'at', counted)
    with pytest.raises(KeyboardInterrupt):
        find(rotor(), BOTH, **how, file=file)
    again = find(rotor(), BOTH, **how, file=file)
    assert again.values == whole.values
    assert again.evaluations == whole.evaluations == len(calls) - 1
    assert len(file.read_text().splitlines()) == whole.evaluations + 1
    other = how | {'subject_to': 'range(drive_torque) > 5 N m'}  # a limit is no other cycle
    assert find(rotor(), BOTH, **other, file=file).reached
    with pytest.raises(InputError, match='is of another search'):
        find(rotor(), BOTH, minimise='mean(drive_torque)', file=file)


@pytest.mark.slow
def test_the_command_writes_scene_table_and_picture(tmp_path):
    files = [tmp_path / f'found.{end}' for end in ('yaml', 'csv', 'svg')]
    found = run_json(
        'find', 'slider_crank', '--vary', 'links.crank.length=40 mm:150 mm',
        '--vary', 'links.rod.length=0.3 m:0.6 m', '--minimise', 'highest(position.piston)',
        '--maximise', 'range(position.piston)', '--subject-to', 'range(position.piston) < 200 mm',
        '--values', '8', '--evaluations', '30', *(x for file in files for x in ('-o', str(file))),
    )  # fmt: skip
    scene, table, picture = files
    assert found['evaluations'] == len(table.read_text().splitlines()) - 1
    assert found['values'] in [design['values'] for design in found['front']]
    assert '<svg' in picture.read_text()
    lengths = load_scene(scene).scene.to_document()['links']
    assert lengths['rod']['length'] == pytest.approx(found['values']['links.rod.length'])
    assert found['constraints'][0]['holds'] is True


@pytest.mark.slow
def test_limits_are_taken_as_the_command_takes_them():
    """Texts, pairs and lists; keys of one coordinate of a point."""
    goal = 'largest(position.piston) = 0.5 m'
    path = 'links.rod.length'
    for vary in (f'{path}=0.2 m:0.6 m', [f'{path}=200 mm:600 mm'], {path: '0.2 m:60 cm'}):
        assert find('slider_crank', vary, goal, samples=5).values[path] == pytest.approx(0.45)
    assert find('slider_crank', {path: '0.4 m,0.45 m'}, goal).values == {path: 0.45}
    bar = {'mass': 2.0, 'inertia': 0.05, 'cog': [ARM, 0.0]}
    found = find(rotor(links={'bar': bar}), 'links.bar.cog.x=10 cm:40 cm',
                 'highest(drive_torque) = 10 N m', samples=3)  # fmt: skip
    assert found.values['links.bar.cog.x'] == pytest.approx((10.0 - 0.5 * SPEED) / (2.0 * 9.81))
    assert 'links.bar.cog.x = 20.38' in text(found)
    assert ' cm: ' in text(found)


PENDULUM = {
    'title': 'damped pendulum',
    'mechanism': 'linkage',
    'links': {'bar': {'mass': 1.0, 'inertia': 0.02, 'cog': 0.2}},
    'joints': {'O': {'revolute': ['ground', 'bar']}},
    'gravity': [0.0, -9.81],
    'duration': 0.5,
    'initial': {'position': {'bar': -1.0}, 'velocity': {'bar': 0.0}},
    'loads': {'brake': {'at': 'bar', 'torque': '-0.05*bar_rate'}},
}
SWUNG = {'links.bar.mass': ('0.5 kg', '2 kg'), 'links.bar.inertia': (0.01, 0.06)}


@pytest.mark.slow
def test_exact_gradients_lead_where_differences_lead_in_fewer_cycles():
    """Mass and inertia that give an angle and a rate, as they are of known ones."""
    known = CycleTrial.of(load_scene(PENDULUM), read_goals(['final(position.bar) = 0',
                          'final(velocity.bar) = 0']), {})  # fmt: skip
    angle, rate = (x.value for x in known.at({'links.bar.mass': 1.3, 'links.bar.inertia': 0.03}))
    goals = [f'final(position.bar) = {angle!r} rad', f'final(velocity.bar) = {rate!r} rad/s']
    exact = find(PENDULUM, SWUNG, goals, samples=4, gradients='exact')
    other = find(PENDULUM, SWUNG, goals, samples=4)
    assert (exact.gradients, other.gradients) == ('exact', 'differences')
    assert exact.evaluations < other.evaluations
    for found in (exact, other):
        assert found.reached
        assert [*found.values.values()] == pytest.approx([1.3, 0.03], rel=1e-6)
    lengths = {'links.crank.length': '40 mm:50 mm', 'links.rod.length': '0.3 m:0.4 m'}
    both = ['highest(position.piston) = 0.4 m', 'lowest(position.piston) = 300 mm']
    ideal = find('slider_crank', lengths, both, samples=3, gradients='exact')
    assert ideal.gradients == 'differences'
    assert ideal.reached  # although it is at a limit, 50 mm
    assert 'follows from its drives' in ideal.refused


@pytest.mark.slow
def test_an_optimum_with_exact_gradients_is_that_without():
    how = {'minimise': 'final(velocity.bar)', 'subject_to': 'final(position.bar) < -1.5 rad'}
    found, other = (
        find(PENDULUM, SWUNG, samples=4, gradients=kind, **how)
        for kind in ('exact', 'differences')
    )
    assert found.gradients == 'exact'
    assert found.reached
    assert found.evaluations < other.evaluations
    assert [*found.measures.values()] == pytest.approx([*other.measures.values()], rel=1e-7)


def test_exact_slopes_are_those_of_differences():
    """Central differences of cycles, as a second route."""
    trial = CycleTrial.of(load_scene(PENDULUM), read_goals(minimise='rms(velocity.bar)'), {})
    at = {'links.bar.mass': 1.3, 'links.bar.inertia': 0.03}
    for (path, value), slope in zip(at.items(), trial.slopes(at, [*at])[0], strict=True):
        ends = [trial.at({**at, path: value * (1.0 + h)})[0].value for h in (1e-5, -1e-5)]
        assert slope == pytest.approx((ends[0] - ends[1]) / (2e-5 * value), rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize('counts', [(1,), pytest.param((1, 2), marks=pytest.mark.slow)])
def test_a_front_has_all_designs_that_none_dominates_and_workers_change_nothing(tmp_path, counts):
    """Dominance by comparing all pairs of the table of what was tried."""
    goals = {'minimise': 'highest(drive_torque)', 'maximise': 'range(drive_torque)'}
    tables, fronts = [], []
    for count in counts:
        file = tmp_path / f'{count}.csv'
        found = find(rotor(), BOTH, **goals, samples=6, evaluations=30, file=file,
                     workers=Workers(count))  # fmt: skip
        tables.append(file.read_bytes())
        fronts.append(found.front)
    assert tables[0] == tables[-1]
    assert fronts[0] == fronts[-1]
    tried = {c.name: c.values for c in found.table}
    pairs = list(zip(tried['highest(drive_torque)'], tried['range(drive_torque)'], strict=True))
    best = {
        (a, b) for a, b in pairs
        if not any(c <= a and d >= b and (c, d) != (a, b) for c, d in pairs)
    }  # fmt: skip
    assert {tuple(design.measures.values()) for design in found.front} == best


@pytest.mark.slow
def test_a_search_that_was_killed_ends_in_the_same_bytes(tmp_path):
    """A journal that ends within a line, as a kill leaves it, and no table."""
    how = {'so_that': ['highest(drive_torque) = 10 Nm', 'mean(drive_torque) = 5 Nm'], 'samples': 4}
    file = tmp_path / 'tried.csv'
    whole = find(rotor(), BOTH, **how, file=file)
    table, journal = file.read_bytes(), tmp_path / 'tried.csv.journal'
    lines = journal.read_bytes().splitlines(keepends=True)
    file.unlink()
    journal.write_bytes(b''.join(lines[: len(lines) // 2]) + lines[len(lines) // 2][:20])
    again = find(rotor(), BOTH, **how, file=file)
    assert file.read_bytes() == table
    assert again.values == whole.values
    assert len(journal.read_bytes().splitlines()) == len(lines)


@pytest.mark.sample(9)
@pytest.mark.parametrize(
    ('vary', 'how', 'said'),
    [
        ('links.rod.length=0.3 m:0.3 m', {}, 'the second value must be larger'),
        ('links.rod.length=0.4 m:0.3 m', {}, 'the second value must be larger'),
        (['links.rod.length=0.3 m:0.4 m'] * 2, {}, 'two ranges of'),
        ('links.rod.length=300:400 mm', {}, "others have none, such as '300'"),
        ({'links.rod.length': 0.3}, {}, "write 'LOW:HIGH', (LOW, HIGH) or a list"),
        ('links.rod.length.x=0.3 m:0.4 m', {}, 'is a plain value'),
        ('links.rod.length=0.3 m:0.4 m', {'minimize': 'x'}, "did you mean 'minimise'"),
        ('links.rod.length=0.3 m:0.4 m', {'gradients': 'some'}, 'one of exact, differences'),
        (
            'links.rod.length=0.3 m:0.4 m',
            {'so_that': 'mean(t) / (mean(t) - mean(t)) = 1'},
            'no finite value',
        ),
        ('links.rod.length=0.3 m:0.4 m', {'so_that': 'mean(drive_torqe) = 1'}, 'did you mean'),
    ],
)
def test_odd_inputs_are_answered_by_one_sentence(vary, how, said):
    with pytest.raises(InputError) as refused:
        find('slider_crank', vary, **({'so_that': 'mean(t) = 1 s'} | how))
    assert said in str(refused.value)
    assert '\n' not in str(refused.value)


def test_a_goal_that_is_never_met_is_told():
    goal = 'largest(position.piston) = 2 m'
    one = find('slider_crank', 'links.rod.length=0.2 m:0.6 m', goal, samples=3)
    assert not one.found
    assert text(one).startswith(
        f'{goal[:-3]}2000 mm for no links.rod.length between 0.2 m and 0.6 m: '
    )
    done = run('find', 'slider_crank', '--vary', 'links.rod.length=0.2 m:0.6 m', '--so-that', goal,
               '--values', '3')  # fmt: skip
    assert done.returncode == 1
    assert 'it goes from 250 to 650 mm' in done.stdout


@pytest.mark.slow
def test_the_optimum_of_a_press_is_that_of_a_grid():
    """Three lengths under two constraints: no point of a grid between all limits is better.

    The nearest of those that hold both is as near to it as the step of the grid.
    """
    vary = {'links.crank.length': (0.04, 0.06), 'links.coupler.length': (0.345, 0.365),
            'links.upper_toggle.length': (0.23, 0.27)}  # fmt: skip
    bounds = 'largest(drive_torque) < 120 N m', 'largest(reaction.crank_coupler) < 3 kN'
    goal = 'range(position.punch)'
    found = find('double_toggle_punch', vary, maximise=goal, subject_to=bounds)
    best = found.measures[goal]
    assert found.reached
    assert sum(c.active for c in found.constraints) >= 1
    trial = CycleTrial.of(
        load_scene('double_toggle_punch'), read_goals(maximise=goal, subject_to=bounds), {}
    )
    whole = [np.linspace(*ends, 6) for ends in vary.values()]
    near = [np.clip(x * np.linspace(0.998, 1.002, 5), *vary[path])
            for path, x in found.values.items()]  # fmt: skip
    for grid, gap in ((whole, 0.15), (near, 0.02)):
        held = []
        for values in itertools.product(*grid):
            stroke, torque, force = trial.at(dict(zip(vary, values, strict=True)))
            if torque.value < 120.0 and force.value < 3e3:
                held.append(stroke.value)
        assert max(held) <= best * (1.0 + 1e-7)
        assert max(held) >= best * (1.0 - gap)


@pytest.mark.sample(15)
@pytest.mark.parametrize(
    ('args', 'said'),
    [
        (('--vary', 'links.rod.length=1:2'), 'there are two ranges'),
        (('--vary', 'links.rod.mass=2:1'), 'the second value must be larger'),
        (('--vary', 'links.rod.mas=1:2'), "did you mean 'mass'"),
        (('--vary', 'drive.speed=1:2', '-o', 'a.svg'), 'curve of one key'),
        (('--so-that', 'mean(drive_torque) = 2 Nm'), 'every measure has one wanted value'),
        (('--minimise', 'mean(drive_torque)'), 'give one of --so-that'),
        (('--vary', 'drive.speed'), 'write NAME=LOW:HIGH'),
        (('--vary', 'drive.speed=1,5 rpm:2 rpm'), 'a decimal comma, 1,5'),
        (('--vary', 'drive.speed=1,5 rpm'), 'some values have a unit, others have none'),
        (('--vary', 'drive.speed=fast,slow'), 'fast'),
        (('--subject-to', 'mean(drive_torque)'), 'write MEASURE < VALUE'),
        (('--subject-to', '1 < mean(drive_torque) < 2'), 'write MEASURE < VALUE'),
        (('--subject-to', 'mean(drive_torque) < 2 m'), 'the wanted value 2 m'),
        (('--subject-to', 'mean(drive_torque) < range(t)'), 'the units differ in kind'),
        (('--restart',), 'needs a table'),
        (('-o', 'a.doc'), 'the ending must be .yaml'),
        (('-o', 'a.csv', '-o', 'b.npz'), 'are of one kind'),
    ],
)  # fmt: skip
def test_mistakes_of_several_keys_are_one_sentence(args, said):
    first = '--vary', 'links.rod.length=0.3 m:0.6 m', '--so-that', 'mean(drive_torque) = 1 Nm'
    done = run('find', 'slider_crank', *first, *args)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_design_that_cannot_run_is_never_the_best_and_values_have_their_unit():
    """Costs of designs that hardly differ, over the range of these, were above that of none."""
    goal = '--minimise', 'largest(velocity.piston)'
    done = run('find', 'slider_crank', '--vary', 'drive.speed=0 rpm,59.99999 rpm,60 rpm', *goal)
    assert done.stdout.splitlines()[0] == 'drive.speed = 59.99999 rpm'
    assert 'not at drive.speed = 0' in done.stdout
    bare = run('find', 'slider_crank', '--vary', 'drive.speed=2,1', *goal).stdout
    assert bare.splitlines()[0] == 'drive.speed = 1 rad/s'


def test_a_scene_that_is_there_is_not_overwritten(tmp_path):
    file = tmp_path / 'best.yaml'
    args = 'find', 'slider_crank', '--vary', 'drive.speed=2,1', '--minimise', 'rms(drive_torque)'
    assert run(*args, '-o', str(file)).returncode == 0
    text = file.read_text(encoding='utf-8')
    again = run(*args, '-o', str(file))
    assert (again.returncode, file.read_text(encoding='utf-8')) == (2, text)
    assert 'exists already, not overwriting: choose another name, or remove it' in again.stderr
