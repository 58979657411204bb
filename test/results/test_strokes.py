"""Strokes, dwells and time ratios of a cycle: from reversals of the motion, by known laws."""

import math

import numpy as np
import pytest
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.report import cycle as report
from mechanism_sim.results.strokes import find_swings

TURN = 2.0 * math.pi


def cam(*segments, speed=-1.0):
    """The machine `rise_dwell_return` with segments (from, to [deg], rise [mm])."""
    law = [
        {'from': f'{a} deg', 'to': f'{b} deg', 'rise': f'{rise} mm', 'curve': 'cycloidal'}
        for a, b, rise in segments
    ]
    change = {'joints.contact.law.segments': law, 'drive.speed': speed}
    return ms.load_scene('rise_dwell_return', change)


def follower(machine, **how):
    return ms.cycle(machine, samples=36, **how).swings()['follower']


SYMMETRIC = ((20, 110, 10), (150, 240, -10))
"""Rises and returns in 90 deg, dwells of 40 and 140 deg."""


@pytest.mark.sample(3)
@pytest.mark.parametrize('start', [None, 0.0, 45.0, 130.0, 200.0, 300.0])
def test_a_symmetric_cam_with_dwells_has_a_time_ratio_of_one(start):
    turn = {} if start is None else {'start': -math.radians(start)}
    swing = follower(cam(*SYMMETRIC), **turn)
    assert swing.time_ratio == pytest.approx(1.0, abs=1e-9)
    assert (swing.rising, swing.falling) == pytest.approx((TURN / 4, TURN / 4), abs=1e-9)
    assert swing.standing == pytest.approx(math.pi, abs=1e-9)
    at = {round(1e3 * x.position): x.duration for x in swing.dwells}
    assert at == pytest.approx({40: math.radians(40.0), 30: math.radians(140.0)}, abs=1e-9)
    assert [round(1e3 * x.way, 9) for x in swing.strokes] in ([10.0, -10.0], [-10.0, 10.0])


def test_a_cycle_of_several_periods_has_the_strokes_of_one():
    one, three = (follower(cam(*SYMMETRIC), periods=n) for n in (1, 3))
    assert three.period == pytest.approx(TURN, rel=1e-14)
    assert three.time_ratio == pytest.approx(1.0, abs=1e-9)
    for a, b in zip(one.strokes, three.strokes, strict=True):
        assert a == pytest.approx(b, abs=1e-9)


def test_a_stop_on_the_way_does_not_end_a_stroke():
    swing = follower(cam((0, 40, 4), (90, 130, 6), (180, 270, -10)))
    assert [x.duration for x in swing.strokes] == pytest.approx(
        np.radians([130.0, 90.0]), abs=1e-9
    )
    assert swing.time_ratio == pytest.approx(130.0 / 90.0, abs=1e-8)
    stops = [(x.position, x.duration) for x in swing.dwells]
    assert np.transpose(stops) == pytest.approx(
        np.array([[0.034, 0.04, 0.03], np.radians([50.0, 50.0, 90.0])]), abs=1e-9
    )


def test_several_strokes_have_no_time_ratio():
    machine = cam((0, 60, 10), (60, 150, -4), (150, 210, 4), (210, 300, -10))
    found = ms.cycle(machine, samples=36)
    swing = found.swings()['follower']
    assert [x.way for x in swing.strokes] == pytest.approx([10e-3, -4e-3, 4e-3, -10e-3], abs=1e-12)
    assert [x.duration for x in swing.strokes] == pytest.approx(
        np.radians([60.0, 90.0, 60.0, 90.0]), abs=1e-9
    )
    assert swing.time_ratio is None
    assert (swing.rising, swing.falling) == pytest.approx(np.radians([120.0, 180.0]), abs=1e-9)
    text = report.render(found)
    assert 'in 4 strokes: up 10 in 1.0472 s, down 4 in 1.5708 s, up 4 in' in text
    assert 'time ratio' not in text


def test_strokes_and_dwells_are_told_in_text_and_json():
    args = ['cycle', 'rise_dwell_return', '--set', 'joints.contact.law.segments=[{from: 0 deg, '
            'to: 90 deg, rise: 10 mm, curve: cycloidal}, {from: 180 deg, to: 270 deg, '
            'rise: -10 mm, curve: cycloidal}]']  # fmt: skip
    found = run_json(*args)['swings']['follower']
    assert found['time_ratio'] == pytest.approx(1.0, abs=1e-9)
    assert [x['stop'] - x['start'] for x in found['strokes']] == (
        pytest.approx([0.01, -0.01], abs=1e-12)
    )
    assert sum(x['end'] - x['begin'] for x in found['dwells']) == pytest.approx(math.pi, abs=1e-9)
    text = run(*args).stdout
    assert 'time ratio 1; stands at 40 mm for 1.5708 s, at 30 mm for 1.5708 s' in text


def test_a_motion_that_does_not_repeat_has_no_strokes():
    machine = ms.load_scene('pendulum')
    found = ms.cycle(machine, samples=36, duration=2.0)
    swing = found.swings()['bar']
    assert (swing.period, swing.strokes, swing.time_ratio) == (None, (), None)
    assert 'in 2 s' in report.render(found)


def test_turns_are_whole_or_not_told():
    """A wheel of twice the teeth makes half a turn in each of the pinion's; a rack makes none."""
    found = ms.cycle(ms.load_scene('gear_pair'), samples=36, periods=3)
    assert {name: swing.turns for name, swing in found.swings().items()} == {
        'pinion': 3, 'wheel': 0
    }  # fmt: skip
    assert found.swings()['wheel'].gained == pytest.approx(-3.0 * math.pi, rel=1e-12)
    assert 'wheel goes over 540 deg in 0.3 s' in report.render(found)
    two = ms.cycle(ms.load_scene('gear_pair'), samples=36, periods=4).swings()['wheel']
    assert (two.turns, two.period) == (-2, pytest.approx(0.2, rel=1e-12))


@pytest.mark.slow
def test_what_turns_one_way_stands_in_its_dwells_only():
    """A wheel of four slots is locked in three quarters of each turn of its crank."""
    crank, wheel = ms.cycle(ms.load_scene('geneva'), periods=4).swings().values()
    assert (crank.standing, crank.strokes) == (0.0, ())
    assert (wheel.turns, wheel.period) == (-1, pytest.approx(2.0, rel=1e-12))
    assert wheel.standing == pytest.approx(0.75 * 2.0, rel=1e-9)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('scene', 'name', 'size', 'moves', 'stands'),
    [
        ('geneva', 'wheel', TURN / 4.0, 0.125, 0.375),
        ('linear_intermittent', 'rack', 0.08, 0.5, 0.5),
    ],
)
def test_what_is_indexed_moves_in_a_part_of_the_turn(scene, name, size, moves, stands):
    """A pin is in one of four slots during 90 degrees, on a rack during 180 degrees."""
    found = ms.cycle(scene)
    swing = found.swings()[name]
    assert swing.turns == 0
    assert swing.strokes == ()
    assert abs(swing.gained) == pytest.approx(size, rel=1e-9)
    assert swing.standing == pytest.approx(stands, rel=1e-6)
    assert swing.period - swing.standing == pytest.approx(moves, rel=1e-6)
    assert f'in {moves:g} s; stands at' in report.render(found)
    twice = report.render(ms.cycle(scene, periods=2))
    assert f'in 2 moves of {moves:g} s; stands at' in twice


@pytest.mark.slow
def test_what_moves_on_in_some_turns_only_is_not_told_as_indexed():
    """A slider behind a wheel of four slots does the same after four turns, not after one."""
    content = {
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': {'centre': [0.1, 0.0]}},
            'crank': {'length': 0.1 / math.sqrt(2.0)},
            'wheel': {'points': {'pin': [0.02, 0.0]}},
            'rod': {'length': 0.08},
            'slider': {},
        },
        'joints': {
            'axle': {'revolute': ['ground', 'crank']},
            'centre': {'revolute': ['ground.centre', 'wheel']},
            'pin': {'geneva': ['crank.end', 'wheel'], 'slots': 4},
            'big': {'revolute': ['wheel.pin', 'rod']},
            'small': {'revolute': ['rod.end', 'slider']},
            'guide': {'prismatic': ['ground.centre', 'slider']},
        },
        'drive': {'coordinate': 'crank', 'speed': TURN},
        'guess': {'slider': 0.1},
    }
    once, all_ = (ms.cycle(content, periods=n).swings()['slider'] for n in (1, 4))
    assert once.period is None
    assert all_.period == pytest.approx(4.0)


def test_a_rotation_with_a_way_back_shows_it():
    """An angle that gains 8 rad in 1 s, loses what is more than a turn in the next, and rests."""
    back = 8.0 - TURN
    smooth = np.array([0.0, 0.0, 3.0, -2.0])
    powers = np.array([8.0 * smooth, -back * smooth, 0.0 * smooth])
    powers[1:, 0] = 8.0, TURN
    start = np.arange(3.0)
    curve = PiecewisePolynomial(
        start, np.zeros(3), np.ones(3), np.zeros((3, 1), np.int64), powers[:, None, :]
    )
    found = find_swings(['a'], [True], curve, (0.0, 3.0), [8.0], 3.0)['a']
    assert (found.turns, found.time_ratio, found.rising) == (1, None, None)
    assert [x.way for x in found.strokes] == pytest.approx([8.0, -back], rel=1e-12)
    assert found.dwells == (pytest.approx((2.0, 3.0, TURN), rel=1e-9),)
    assert found.standing == pytest.approx(1.0, rel=1e-9)
    # the same as a displacement does not repeat itself
    straight = find_swings(['a'], [False], curve, (0.0, 3.0), [8.0], 3.0)['a']
    assert (straight.turns, straight.period, straight.strokes) == (0, None, ())
