"""Refusals begin with the name of the scene, once, wherever a part of a machine is built."""

import pytest

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import scene_errors
from mechanism_sim.scene.check import check


def test_nested_parts_name_the_scene_once():
    refused = pytest.raises(InputError, match=r'^press: joints\.pin: no$')
    with refused, scene_errors('press'), scene_errors('press'):
        raise InputError('joints.pin: no')


@pytest.mark.parametrize(
    ('scene', 'overrides', 'said'),
    [
        (
            'slider_crank_engine',
            {
                'joints.crank_pin.revolute': ['crank.end', 'rod'],
                'joints.crank_pin.friction': {'coefficient': 0.1, 'radius': '5 mm'},
            },
            'crank_pin',
        ),
        ('four_bar_clearance', {'links.rocker.length': '1 mm'}, 'assembled'),
        ('four_bar_clearance', {'initial.velocity.rocker': '1 m/s'}, 'it is an angle'),
        (
            'watched_compressor',
            {'joints.crank_rod.friction': {'coefficient': 0.1, 'radius': '5 mm'}},
            'impulses in joints are not known',
        ),
    ],
)
def test_a_refusal_names_its_scene_once(scene, overrides, said):
    with pytest.raises(InputError, match=said) as refused:
        check(ms.load_scene(scene, overrides))
    text = str(refused.value)
    assert text.startswith(f'{scene}: ')
    assert text.count(f'{scene}: ') == 1
