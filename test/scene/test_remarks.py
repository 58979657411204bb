"""Values a thousand times off are questioned, redundant joints are named."""

from __future__ import annotations

import json

import pytest
from builders import made
from running import one_of

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.scene.check import check, render
from mechanism_sim.scene.files import find_scene, overridden, read_yaml
from mechanism_sim.scene.remarks import (
    angle_questions,
    length_questions,
    plausibility_warnings,
    unused,
)

FOUR_BAR = 'four_bar_clearance'


@pytest.mark.parametrize('name', one_of(12, ms.scene_names()))
def test_no_scene_of_the_package_is_questioned(name):
    assert plausibility_warnings(ms.load_scene(name)) == []


@pytest.mark.parametrize(
    ('override', 'said'),
    [
        ({'links.crank.inertia': '2645 kg m^2'}, 'links.crank.inertia = 2645 kg m^2'),
        ({'links.crank.inertia': '2.645e-9 kg m^2'}, 'radius of gyration is 0.0659 mm'),
        ({'gravity': ['0 m/s^2', '-9814.5 m/s^2']}, 'on Earth it is 9.81'),
        ({'joints.coupler_rocker.clearance.radial': '0.254e-9 m'}, 'clearance.radial'),
        ({'links.coupler.mass': '243.9 kg'}, 'links.coupler.mass = 243.9 kg'),
    ],
)
def test_what_is_a_thousand_times_off_is_questioned(override, said):
    machine = ms.load_scene(FOUR_BAR, override)
    assert any(
        said in warning and warning.endswith('is the unit right?')
        for warning in plausibility_warnings(machine)
    )


def test_an_oil_as_thick_as_honey_is_questioned():
    film = {'law': 'film', 'viscosity': 40, 'width': '10 mm', 'radius': '6 mm'}
    path = 'joints.coupler_rocker.clearance.contact'
    (warning,) = plausibility_warnings(ms.load_scene(FOUR_BAR, {path: film, 'start': 'centred'}))
    assert warning.startswith(f'{path}.viscosity = 40 Pa s is that of honey')
    assert (
        plausibility_warnings(ms.load_scene(FOUR_BAR, {path: film | {'viscosity': '40 mPa s'}}))
        == []
    )


def test_a_play_of_teeth_is_named_by_its_own_key():
    machine = ms.load_scene('gear_rattle')
    (joint,) = machine.plan.clearances
    tiny = ms.load_scene(machine, {f'joints.{joint}.backlash.width': '1e-9 m'})
    (warning,) = plausibility_warnings(tiny)
    assert warning.startswith(f'joints.{joint}.backlash makes a play of')


@pytest.mark.parametrize('name', one_of(12, ms.scene_names()))
def test_no_scene_of_the_package_has_keys_without_effect(name):
    assert unused(ms.load_scene(name)) == []


@pytest.mark.parametrize(
    ('scene', 'override', 'said'),
    [
        ('slider_crank', {'solver.rtol': 1e-9}, 'solver.rtol has no effect: the motion follows'),
        ('slider_crank', {'solver.atol': '1 um'}, 'solver.atol has no effect: the motion follows'),
        ('pendulum', {'solver.atol': '1 um'}, 'solver.atol has no effect: no joint has'),
        ('slider_crank', {'start': 'centred'}, "start = 'centred' has no effect"),
        ('slider_crank', {'initial.elastic': 'smooth'}, "initial.elastic = 'smooth' has no"),
        ('pendulum', {'outputs.forces': False}, 'outputs.forces = false has no effect'),
        ('four_bar_crossed', {'loads.push': {'at': 'coupler.end', 'force': ['1 N', '0 N']}},
         'loads.push has no effect: masses are missing'),
        ('slider_crank', {'tables.press': {'points': [[0, 0], [1, 2]]}},
         'tables.press has no effect: nothing refers to it'),
    ],
)  # fmt: skip
def test_keys_without_effect_are_named(scene, override, said):
    machine = ms.load_scene(scene, override)
    (found,) = unused(machine)
    assert found.startswith(said)
    assert found in check(machine).left_out


def test_a_length_in_another_unit_than_the_others_is_questioned(tmp_path):
    """A crank of 64 m beside mm, where texts still have their units; the same in mm is none."""
    links = {'crank': {'length': '64 m', 'mass': '1 kg', 'inertia': '1000 kg m^2'},
             'rod': {'length': '387 mm', 'mass': '1 kg', 'inertia': '0.01 kg m^2',
                     'points': {'middle': ['190 mm', '0 mm']}}}  # fmt: skip
    scene = {
        'title': 'double pendulum', 'mechanism': 'linkage', 'links': links,
        'joints': {'a': {'revolute': ['ground', 'crank']},
                   'b': {'revolute': ['crank.end', 'rod']}},
    }  # fmt: skip
    path = tmp_path / 'swing.yaml'
    path.write_text(json.dumps(scene))
    said = 'links.crank.length = 64 m: the lengths in other units are about 288 mm: is the unit'
    machine = ms.load_scene(str(path))
    assert [warning for warning in plausibility_warnings(machine) if 'other units' in warning] == [
        f'{said} right?'
    ]
    for length in ('64 mm', '6.4 cm', '64000 mm', '0.064', 0.064):
        assert not ms.load_scene(str(path), {'links.crank.length': length}).questions


def test_every_thousandfold_length_of_the_package_is_questioned():
    """The first length in mm of each scene that has another to compare it with."""
    count = 0
    for name in ms.scene_names():
        content = read_yaml(find_scene(name), 'scene')
        parts = [link for link in content['links'].values() if isinstance(link, dict)]
        lengths = [part for part in parts if str(part.get('length')).endswith(' mm')]
        assert not [*length_questions(content)]
        if len(lengths) > 1:
            lengths[0]['length'] = lengths[0]['length'].replace(' mm', ' m')
            assert len([*length_questions(content)]) == 1, name
            count += 1
    assert count > 20


PRESS = """
links:
  crank: {length: 50 mm, mass: 5 kg, inertia: 0.02 kg m^2}
  rod: {length: 250 mm, mass: 4 kg, inertia: 0.03 kg m^2}
  ram: {mass: 20 kg}
joints:
  shaft: {revolute: [ground, crank]}
  pin: {revolute: [crank.end, rod]}
  wrist: {revolute: [rod.end, ram]}
  guide: {prismatic: [ground, ram]}
drive: {coordinate: crank, motor: {stall_torque: 300 N m, no_load_speed: 100 rpm}}
tables: {punch: {points: [[0 deg, 0 N], [330 deg, 20 kN], [360 deg, 0 N]]}}
loads: {punching: {at: ram, force: [-punch(crank), 0]}}
guess: {rod: 0 deg, ram: 300 mm}
duration: 4 s
"""
TO_350 = {'points': [['0 deg', '0 N'], ['350 deg', '20 kN']]}
LEVEL = {'points': [['0 deg', '1 N'], ['180 deg', '1 N']]}
LONG = {'points': [['0 deg', '1 N'], ['720 deg', '1 N']]}
DRIVE = {'coordinate': 'crank'}
RUN_UP = {'points': [['0 s', '60 rpm'], ['1 s', '90 rpm']]}


@pytest.mark.parametrize(
    ('override', 'said'),
    [
        ({}, "not periodic, but crank turns on: punch(crank) stays at 0 N beyond 360 deg"),
        ({'drive': DRIVE | {'speed': '90 rpm'}}, "is 'periodic: true' missing?"),
        ({'drive': DRIVE | {'position': '400 deg*sin(t)'}}, 'crank turns on'),
        ({'drive': DRIVE | {'profile': RUN_UP}, 'duration': None}, 'crank turns on'),
        ({'tables.punch': TO_350}, "beyond 350 deg: is 'periodic: true' with points"),
        ({'tables.punch': TO_350 | {'periodic': True}}, 'repeats every 350 deg, no whole part'),
        ({'tables.punch.periodic': True}, ''),
        ({'tables.punch': LONG}, ''),  # two turns
        ({'tables.punch': LEVEL | {'periodic': True}}, ''),
        ({'tables.punch': LONG | {'periodic': True}}, ''),
        ({'drive': DRIVE | {'position': '60 deg*sin(t)'}}, ''),
        ({'drive': DRIVE | {'torque': 0}}, ''),  # it may swing
        ({'loads.punching.force': ['-punch(rod)', 0]}, ''),
        ({'links.crank.length': '400 mm', 'guess.ram': '600 mm'}, ''),  # it cannot turn round
    ],
)  # fmt: skip
def test_a_table_over_an_angle_that_turns_on_comes_again(override, said):
    machine = ms.load_scene(made(PRESS), override)
    found = [warning for warning in plausibility_warnings(machine) if 'punch' in warning]
    assert len(found) == bool(said)
    assert said in ''.join(found)


def test_a_link_that_gears_turn_is_one_that_turns_on():
    table = {'points': [['0 deg', '0 N m'], ['350 deg', '3 N m']]}
    loads = {'drag': {'at': 'wheel', 'torque': 'drag(wheel)'}}
    machine = ms.load_scene('gear_pair', {'tables.drag': table, 'loads': loads})
    assert any('but wheel turns on' in warning for warning in plausibility_warnings(machine))


def test_questions_come_first():
    machine = ms.load_scene(FOUR_BAR, {'links.crank.inertia': '2645 kg m^2'})
    lines = render(check(machine)).splitlines()
    assert lines[1] == 'questions'
    assert 'links.crank.inertia' in lines[2]


def parallelogram(**crank):
    """Three equal cranks on one rod: the third one adds nothing."""
    points = {'p': [0.0, 0.0], 'q': [0.2, 0.0], 'r': [0.4, 0.0]}
    ground = {'A': [0.0, 0.0], 'B': [0.2, 0.0], 'C': [0.4, 0.0]}
    joints = {name: {'revolute': [f'ground.{name}', name.lower()]} for name in 'ABC'}
    ends = {'P': 'a.end', 'Q': 'b.end', 'R': 'c.end'}
    joints |= {k: {'revolute': [end, f'rod.{k.lower()}']} for k, end in ends.items()}
    return made(
        {
            'title': 'three cranks',
            'links': {
                'ground': {'points': ground},
                **{name: {'length': 0.1} | crank for name in 'abc'},
                'rod': {'points': points} | crank,
            },
            'joints': joints,
            'drive': {'coordinate': 'a', 'speed': 6.0, 'start_angle': 0.7},
            'guess': {'b': 0.7, 'c': 0.7, 'rod': 0.0},
        },
        'three',
    )


def test_the_joint_that_is_redundant_is_named():
    notes = check(parallelogram()).notes
    assert any(note.startswith('R is redundant beside the joints named before') for note in notes)


def test_forces_that_are_not_determined_name_it_too():
    notes = check(parallelogram(mass=1.0, inertia=0.001)).notes
    open_ = next(note for note in notes if note.startswith('not determined'))
    assert 'reaction.R' in open_


def test_what_is_said_to_be_left_out_is_nowhere_in_the_notes():
    """Friction of an ideal joint is no friction in the clearance of another."""
    pin = {'joints.pinion_bearing.friction': {'coefficient': 0.1, 'radius': '10 mm'}}
    name = next(iter(ms.load_scene('gear_rattle').scene.joints))
    pin = {key.replace('pinion_bearing', name): value for key, value in pin.items()}
    found = check(ms.load_scene('gear_rattle', pin))
    assert f'{name}: friction, coefficient 0.1' in '\n'.join(found.notes)
    said = [item for item in found.left_out if 'friction' in item]
    assert said == ['friction in the clearance of mesh: none given']
    rubbing = {**pin, 'joints.mesh.backlash.friction': 0.1}
    assert not [x for x in check(ms.load_scene('gear_rattle', rubbing)).left_out if 'frict' in x]


@pytest.mark.parametrize(('override', 'said'), [
    ({'drive.start_angle': 60}, 'drive.start_angle = 60: angles without a unit are in radians, '
     'this one is 3437.75 deg: is the unit right?'),
    ({'drive.start_angle': '60'}, 'drive.start_angle = 60'),
    ({'initial.position.rocker': 122}, 'initial.position.rocker = 122'),
    ({'sensors.rocker_accelerometer.axis': -90}, 'accelerometer.axis = -90'),
    ({'drive.start_angle': '3437.75 deg'}, ''), ({'drive.start_angle': 6.28}, ''),
    ({'drive.speed': 60}, ''),
])  # fmt: skip
def test_degrees_without_a_unit_are_questioned(override, said):
    content = overridden('a file', read_yaml(find_scene(FOUR_BAR), 'scene'), override)
    found = [*angle_questions(content)]
    assert len(found) == bool(said)
    assert all(said in x and x.endswith('is the unit right?') for x in found)


@pytest.mark.parametrize(('keys', 'said'), [
    ({'drive': {'position': '90 deg + 60*sin(pi*t)'}}, 'drive.position: 60*sin(pi*t) is in rad, '
     '3437.75 deg: is a unit missing?'),
    ({'drive': {'position': '-7*cos(2*t)'}}, 'drive.position: -7*cos(2*t) is in rad, 401.07 deg'),
    ({'drive': {'position': '90 deg + 60 deg*sin(20*t)'}}, ''),
    ({'drive': {'position': '30*t + 2*pi*sin(t)'}}, ''),
    ({'drive': {'position': '60*(pi/180)*sin(t) + 60*sin(t)*pi/180 + 60*sin(t)/10'}}, ''),
    ({'drive': {'position': '120*sin(t)/2'}}, '120*sin(t)/2 is in rad, 3437.75 deg'),
    ({'loads': {'stop': {'at': 'arm', 'torque': '-5 N m/rad*(arm - 90)'}}},
     'loads.stop.torque: 90 is in rad, 5156.62 deg: is a unit missing?'),
    ({'loads': {'stop': {'at': 'arm', 'torque': '-5 if arm > 90 else 0'}}}, ': 90 is in rad'),
    ({'loads': {'stop': {'at': 'arm', 'torque': '-5 if arm > 90 deg else 30'}}}, ''),
    ({'loads': {'stop': {'at': 'arm', 'torque': '-5*arm - 90'}}}, ''),
    ({'loads': {'stop': {'at': 'arm', 'torque': '-0.1*(arm_rate - 90)'}}}, ''),
    ({'drive': {'coordinate': 'block', 'position': '60*sin(t)'}}, ''),
])  # fmt: skip
def test_degrees_without_a_unit_in_formulas_are_questioned(keys, said):
    arm = {
        'links': {'arm': {'length': 1.0, 'mass': 1.0, 'inertia': 1.0}, 'block': {'mass': 1.0}},
        'joints': {'pin': {'revolute': ['ground', 'arm']},
                   'rail': {'prismatic': ['ground', 'block']}},
        'drives': {'block': {'position': '30*sin(t)'}},
    }  # fmt: skip
    drive = {'coordinate': 'arm', **keys.get('drive', {'torque': {}})}
    drives = {'arm': {'speed': 1.0}} if drive['coordinate'] == 'block' else arm['drives']
    machine = made({**arm, **keys, 'drive': drive, 'drives': drives})
    found = [x for x in plausibility_warnings(machine) if 'in rad' in x]
    assert len(found) == bool(said)
    assert all(said in x for x in found)


def test_degrees_in_a_guess_are_questioned_but_not_metres_of_what_slides():
    scene = read_yaml(find_scene('slider_crank'), 'scene')
    machine = ms.load_scene(scene | {'guess': {'rod': -12.6}}, name='found')
    question = 'guess.rod = -12.6: angles without a unit are in radians, this one is -721.927 deg'
    assert machine.questions == (f'{question}: is the unit right?',)
    assert len([*angle_questions(scene | {'guess': {'rod': -12.6, 'piston': 7.0}})]) == 1
    assert not [x for name in ms.scene_names()
                for x in angle_questions(read_yaml(find_scene(name), 'scene'))]  # fmt: skip


@pytest.mark.parametrize(
    ('keys', 'asked'), [({'angle': '90 deg'}, 1), ({'angle': 0}, 0),
                        ({'angle': '90 deg', 'axis': '90 deg'}, 0)]
)  # fmt: skip
def test_a_guide_with_an_angle_instead_of_an_axis_is_questioned(keys, asked):
    scene = read_yaml(find_scene('slider_crank'), 'scene')
    guide = {'prismatic': ['ground.rail', 'piston'], **keys}
    asks = 'joints.ground_piston slides along 0 deg of its first link, and its angle turns only'
    far = scene['links'] | {'ground': {'points': {'rail': ['0 m', '1 m']}}}
    turned = scene | {'links': far, 'joints': scene['joints'] | {'ground_piston': guide}}
    assert sum(question.startswith(asks) for question in angle_questions(turned)) == asked
    if asked:
        with pytest.raises(InputError, match=f'cannot be assembled.*; {asks}'):
            ms.load_scene(turned)


@pytest.mark.parametrize(('axis', 'asks'), [('along', True), ('across', False), ('60 deg', False)])
def test_a_sensor_across_its_guide_is_asked_about(axis, asks):
    """The piston slides along y, and keeps the direction of its x axis: that is 'along' it."""
    upright = ms.load_scene('slider_crank', {
        'joints.ground_piston.axis': '90 deg', 'guess': {'rod': '90 deg', 'piston': '250 mm'},
        'sensors': {'head': {'link': 'piston', 'axis': axis, 'sample_rate': '1 kHz'}},
    })  # fmt: skip
    said = [
        warning
        for warning in plausibility_warnings(upright)
        if warning.startswith('sensors.head.axis: the piston')
    ]
    assert len(said) == asks
    samples = ms.open_run(ms.simulate(upright, revolutions=1)).signal('head').longest
    assert bool(samples.any()) is not asks
