"""Values a thousand times off are questioned, redundant joints are named."""

from __future__ import annotations

import pytest
from running import one_of

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.scene.build import build
from mechanism_sim.scene.check import check, render
from mechanism_sim.scene.doubts import doubts
from mechanism_sim.scene.schema import Scene

FOUR_BAR = 'four_bar_clearance'


@pytest.mark.parametrize('name', one_of(12, ms.scene_names()))
def test_no_scene_of_the_package_is_questioned(name):
    assert doubts(ms.load_scene(name)) == []


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
    assert any(said in doubt and doubt.endswith('is the unit right?') for doubt in doubts(machine))


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
    return build(
        'three',
        Scene.model_validate(
            {
                'title': 'three cranks',
                'mechanism': 'linkage',
                'links': {
                    'ground': {'points': ground},
                    **{name: {'length': 0.1} | crank for name in 'abc'},
                    'rod': {'points': points} | crank,
                },
                'joints': joints,
                'drive': {'coordinate': 'a', 'speed': 6.0, 'start_angle': 0.7},
                'guess': {'b': 0.7, 'c': 0.7, 'rod': 0.0},
            }
        ),
    )


def test_the_joint_that_is_redundant_is_named():
    notes = check(parallelogram()).notes
    assert any(note.startswith('R is redundant beside the joints named before') for note in notes)


def test_forces_that_are_not_determined_name_it_too():
    with pytest.raises(InputError, match='slot: R is one'):
        parallelogram(mass=1.0, inertia=0.001)
