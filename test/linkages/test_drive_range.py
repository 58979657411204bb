"""Limits of a drive, against closed forms and against linkages that turn fully."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builders import made

from mechanism_sim.linkages.drive_range import drive_range, placed_at
from mechanism_sim.linkages.grashof import crank_limits

TURN = 2.0 * math.pi


def four_bar(ground, crank, coupler, rocker, start, reach=TURN):
    """The range of a four-bar's crank from an angle [rad], and the machine."""
    machine = made(
        {
            'links': {
                'ground': {'points': {'far': [f'{ground} m', '0 m']}},
                'crank': {'length': f'{crank} m'},
                'coupler': {'length': f'{coupler} m'},
                'rocker': {'length': f'{rocker} m'},
            },
            'joints': {
                'a': {'revolute': ['ground', 'crank']},
                'b': {'revolute': ['crank.end', 'coupler']},
                'c': {'revolute': ['coupler.end', 'rocker.end']},
                'd': {'revolute': ['rocker', 'ground.far']},
            },
            'drive': {'coordinate': 'crank', 'speed': '0 rad/s', 'start_angle': f'{start} rad'},
            'guess': {'coupler': '20 deg', 'rocker': '70 deg'},
            'duration': 0.1,
        }
    )
    plan = machine.plan
    return drive_range(plan.kinematics(plan.prescribed), machine.assembly.q, reach), machine


@pytest.mark.sample(3)
@pytest.mark.parametrize('seed', range(6))
def test_limits_of_four_bars_are_those_of_their_triangles(seed):
    """Law of cosines: ground and crank leave the other two links the shortest or longest side."""
    random = np.random.default_rng(seed)
    while True:
        lengths = random.uniform(0.3, 1.0, 4).round(3)
        ordered = np.sort(lengths)
        if ordered[0] + ordered[3] > ordered[1] + ordered[2] and 2 * ordered[3] < ordered.sum():
            break
    ground, crank, coupler, rocker = lengths
    lows = abs(coupler - rocker), coupler + rocker
    cosines = [(ground**2 + crank**2 - x**2) / (2.0 * ground * crank) for x in lows]
    near, far = (math.acos(min(1.0, max(-1.0, x))) for x in cosines)
    start = round(0.5 * (near + far), 3)
    found, machine = four_bar(*lengths, start)
    low = near if near else -far
    high = far if far < math.pi else TURN - near
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-12)
    assert crank_limits(machine.nominal.linkage) == pytest.approx((near, far))
    for place in (found.at_low, found.at_high):  # coupler and rocker in line
        q = dict(zip(machine.plan.ideal.coordinates, place, strict=True))
        assert math.sin(q['coupler'] - q['rocker']) == pytest.approx(0.0, abs=1e-7)


def test_positions_between_limits_stay_on_their_branch():
    """Up to the limits themselves, where the branches meet; none beyond."""
    found, machine = four_bar(1.0, 0.9, 0.6, 0.75, 0.8)
    kinematics = machine.plan.kinematics(machine.plan.prescribed)
    loop, q = machine.assembly.loop, machine.assembly.q
    for share in (1e-9, 0.01, 0.5, 0.99, 1.0 - 1e-9):
        angle = found.low + share * (found.high - found.low)
        place = placed_at(kinematics, q, angle)
        links = [machine.plan.ideal.coordinates.index(x) for x in loop.links[1:]]
        expected = np.exp(1j * np.array(loop.positions(angle)))
        assert np.exp(1j * place[links]) == pytest.approx(expected, abs=1e-9)
    assert placed_at(kinematics, q, found.high + 1e-9) is None
    assert placed_at(kinematics, q, found.low - 1e-9) is None


def test_a_crank_that_turns_fully_has_no_limits():
    """Also where it passes the change points of a parallelogram."""
    assert not four_bar(0.387, 0.064, 0.309, 0.312, 0.3)[0].limited
    assert not four_bar(1.0, 0.5, 1.0, 0.5, 0.7)[0].limited


def test_limits_beyond_the_reach_are_not_looked_for():
    found, _ = four_bar(1.0, 0.9, 0.6, 0.7, 0.8, reach=0.01)
    assert (found.low, found.high) == (-math.inf, math.inf)


def test_a_driven_slider_comes_to_both_dead_points():
    """|rod - crank| and rod + crank from the pivot of the crank."""
    machine = made(
        {
            'links': {'crank': {'length': '0.2 m'}, 'rod': {'length': '0.5 m'}, 'slider': {}},
            'joints': {
                'a': {'revolute': ['ground', 'crank']},
                'b': {'revolute': ['crank.end', 'rod']},
                'c': {'revolute': ['rod.end', 'slider']},
                's': {'prismatic': ['ground', 'slider'], 'axis': '0 deg'},
            },
            'drive': {'coordinate': 'slider', 'speed': '1 mm/s', 'start_position': '0.55 m'},
            'guess': {'crank': '60 deg', 'rod': '-20 deg'},
            'duration': 0.1,
        }
    )
    plan = machine.plan
    found = drive_range(plan.kinematics(plan.prescribed), machine.assembly.q, 10.0)
    assert (found.low, found.high) == pytest.approx((0.3, 0.7), abs=1e-13)
