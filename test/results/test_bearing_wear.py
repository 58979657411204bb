"""Sums of wear by direction, against closed forms."""

import numpy as np
import pytest
from builders import made

import mechanism_sim as ms
from mechanism_sim.results.bearing_wear import LOAD_SLIP, wear_sums

RADIUS, WEIGHT = 8e-3, 20.0 * 9.81
HANGER = {
    'links': {'shaft': {'mass': 1.0, 'inertia': 1e-3}, 'hanger': {'mass': 20.0}},
    'joints': {
        'ground_shaft': {'revolute': ['ground', 'shaft']},
        'bearing': {
            'revolute': ['shaft', 'hanger'],
            'clearance': {'radial': '0.1 mm', 'restitution': 0.0},
        },
        'ground_hanger': {'prismatic': ['ground', 'hanger'], 'axis': '90 deg'},
    },
    'gravity': [0.0, -9.81],
    'start': 'centred',
}


@pytest.mark.parametrize('count', [72, 180])
@pytest.mark.parametrize('speed', ['300 rpm', '-300 rpm'])
def test_a_shaft_wears_evenly_that_turns_under_a_weight(speed, count):
    """Steps are long then: 0.3 rad with 8 nodes had left every place of 180 off by a half."""
    machine = made(HANGER, drive={'coordinate': 'shaft', 'speed': speed})
    run = ms.simulate(machine, revolutions=3)
    turns = np.array([1.0, 3.0]) * machine.drive.period
    bushing, pin = wear_sums(machine, run, 'bearing', count, turns, RADIUS)[:, LOAD_SLIP, 0]
    way = 2.0 * 2.0 * np.pi * RADIUS * WEIGHT
    assert pin == pytest.approx(np.full(count, way / count), rel=0.003)
    assert bushing[count // 4] == pytest.approx(way, rel=1e-9)
