"""Defaults of SDF, by its specification."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.imports import import_machine

ARM = (
    '<model name="m"><link name="arm"><pose>0.5 0 0 0 0 0</pose>{}</link><joint name="j" '
    'type="revolute"><parent>world</parent><child>arm</child><pose>-0.5 0 0 0 0 0</pose>'
    '<axis><xyz>0 1 0</xyz></axis></joint></model>'
)
INERTIAL = '<inertial><mass>3</mass></inertial>'
NO_GRAVITY = 'the world has no gravity in the file: 0 0 -9.8 m/s^2 by SDF'
NO_MASS = 'arm: it has no <inertial>: 1 kg and 1 kg m^2 by SDF'


@pytest.mark.parametrize(
    ('gravity', 'inertial', 'g', 'mass', 'words'),
    [
        ('', '', 9.8, 1.0, [NO_GRAVITY, NO_MASS]),
        ('', INERTIAL, 9.8, 3.0, [NO_GRAVITY]),
        ('<gravity>0 0 -2</gravity>', '<visual name="v"/>', 2.0, 1.0, [NO_MASS]),
        ('<gravity>0 0 0</gravity>', INERTIAL, 0.0, 3.0, []),
    ],
)
def test_a_world_and_its_links_have_the_gravity_and_masses_of_sdf(
    tmp_path, gravity, inertial, g, mass, words
):
    """A bar let go, whose angular acceleration is m g d/(J + m d^2): they had neither."""
    file = tmp_path / 'm.sdf'
    world = f'<world name="w">{gravity}{ARM.format(inertial)}</world>'
    file.write_text(f'<sdf version="1.9">{world}</sdf>')
    found = import_machine(file)
    assert [x for x in found.notes if 'defines no drive' not in x] == words
    run = ms.simulate(ms.load_scene(dict(found.data)), duration=0.01)
    turning = run.sample(np.zeros(1), 'acceleration.arm')['acceleration.arm'][0]
    assert turning == pytest.approx(-0.5 * mass * g / (1.0 + 0.25 * mass), rel=1e-12)


def test_a_model_without_a_world_has_no_gravity_of_its_own(tmp_path):
    file = tmp_path / 'm.sdf'
    file.write_text(f'<sdf version="1.9">{ARM.format(INERTIAL)}</sdf>')
    found = import_machine(file)
    assert 'gravity' not in found.data
    assert any(x.startswith('the file has no gravity: --set') for x in found.notes)


@pytest.mark.parametrize('offset', ['0', '0.5'])
def test_a_joint_that_mimics_another_keeps_its_ratio(tmp_path, offset):
    """It was a joint of its own, without a word: the machine had a freedom more."""
    arms = ''.join(
        f'<link name="{x}"><pose>{k} 0 0 0 0 0</pose>{INERTIAL}</link><joint name="j{x}" '
        f'type="revolute"><parent>world</parent><child>{x}</child><axis><xyz>0 0 1</xyz>{more}'
        '</axis></joint>'
        for k, (x, more) in enumerate({
            'a': '',
            'b': '<mimic joint="ja" axis="axis"><multiplier>-2</multiplier>'
                 f'<offset>{offset}</offset><reference>0</reference></mimic>',
        }.items())
    )  # fmt: skip
    file = tmp_path / 'm.sdf'
    file.write_text(f'<sdf version="1.11"><model name="m">{arms}</model></sdf>')
    found = import_machine(file, overrides={'drive': {'coordinate': 'a', 'speed': '3 rad/s'}})
    run = ms.simulate(ms.load_scene(dict(found.data)), duration=0.01)
    assert run.sample(0.0, 'velocity.b')['velocity.b'][0] == pytest.approx(-6.0)
    told = 'jb: it follows ja from where both are at the start' in found.notes
    assert told is (offset != '0')
