"""Trains: the formulas of [V] 5.9 and 5.10, rolling in space, moments by gear."""

from __future__ import annotations

import math

import numpy as np
import pytest
from book_trains import (
    compound_planetary,
    differential,
    gear_box,
    planetary,
    planets_fit,
)
from willis import Mesh, Train

from mechanism_sim.errors import InputError

RANDOM = np.random.default_rng(51)
BOX = {'2': 20, '5': 40, '7': 18, '4': 42, '6': 28, '3': 32, '8': 19, '9': 21}
AXLES = {'2': 13, '3': 47, '4': 16, '5': 22, '6': 22}


def teeth(*names):
    return dict(zip(names, RANDOM.integers(12, 120, len(names)).tolist(), strict=True))


def test_planetary_trains_of_1000_random_teeth():
    """[V] eqs. 5.63, 5.64."""
    for _ in range(1000):
        n2, n4, n5 = RANDOM.integers(12, 120, 3).tolist()
        train = planetary(n2, n4, n5)
        n25, w2 = n2 / n5, RANDOM.uniform(-50, 50)
        found = train.speeds({'2': w2, '5': 0.0})
        assert found['3'] == pytest.approx(w2 * n25 / (1 + n25), rel=1e-12)
        assert found['4'] == pytest.approx(found['3'] - (w2 - found['3']) * n2 / n4, abs=1e-10)


def test_compound_planetary_trains_of_1000_random_teeth():
    """[V] eqs. 5.68, 5.69."""
    for _ in range(1000):
        n = teeth('2', '3', '4', '5', '6')
        n24, n56, w2 = n['2'] / n['4'], n['5'] / n['6'], RANDOM.uniform(-50, 50)
        found = compound_planetary(n).speeds({'2': w2, '6': 0.0})
        assert found['7'] == pytest.approx(w2 * n24 * n56 / (1 + n24 * n56), rel=1e-12)
        assert found['4'] == pytest.approx(w2 * n24 * (1 + n56) / (1 + n24 * n56), rel=1e-12)
        assert found['4'] == pytest.approx(found['5'], rel=1e-12)


def test_differentials_of_1000_random_teeth():
    """[V] eqs. 5.70, 5.71."""
    for _ in range(1000):
        n = teeth('2', '3', '4', '5')
        n['6'] = n['5']
        w2, w5 = RANDOM.uniform(-50, 50, 2)
        found = differential(n).speeds({'2': w2, '5': w5})
        assert found['3'] == pytest.approx(-w2 * n['2'] / n['3'], rel=1e-12)
        assert w5 + found['6'] == pytest.approx(2 * found['3'], abs=1e-11)


def test_bevel_planet_rolls_on_both_axles_in_space():
    """Velocities of the gears agree where their pitch cones touch."""
    found = differential(AXLES).speeds({'2': 40.0, '6': -3.0})
    x, y = np.eye(3)[:2]
    planet = found['3'] * x + found['4'] * y
    for axle, side in (('5', 1), ('6', -1)):
        point = np.array([side * AXLES['4'], AXLES[axle], 0.0])
        np.testing.assert_allclose(
            np.cross(found[axle] * x, point), np.cross(planet, point), atol=1e-11
        )


def test_gear_box_of_the_book():
    """[V] eqs. 5.55 to 5.57, for Figure 5.31."""
    n = {name: float(count) for name, count in BOX.items()}
    expected = {
        1: n['2'] / n['5'] * n['7'] / n['4'],
        2: n['2'] / n['5'] * n['6'] / n['3'],
        3: -n['2'] / n['5'] * n['8'] / n['9'] * n['9'] / n['4'],
    }
    for gear, e in expected.items():
        box = gear_box(BOX, gear)
        assert box.freedom == 1
        assert 1 / box.ratio('2', 'out') == pytest.approx(e, rel=1e-13)


def test_degrees_of_freedom():
    assert planetary(20, 20, 60).freedom == 2
    assert Train({'2': 20, '4': 30}, (Mesh('2', '4', '3'),)).freedom == 2  # [V] Figure 5.32
    assert compound_planetary(dict.fromkeys('23456', 20)).freedom == 2
    assert differential(AXLES).freedom == 2
    ring = Mesh('a', 'b'), Mesh('b', 'c'), Mesh('c', 'a')
    assert Train({'a': 20, 'b': 20, 'c': 20}, ring).freedom == 0  # an odd ring locks
    more = tuple(Mesh(g, p, 'c', internal=g == 'ring') for p in 'pqr' for g in ('sun', 'ring'))
    many = Train({'sun': 20, 'ring': 60, 'p': 20, 'q': 20, 'r': 20}, more)
    assert many.freedom == 2  # further planets repeat the first


def test_whatever_is_held_or_driven():
    """All six uses of a planetary train agree with Willis' formula."""
    n2, n5 = 24, 66
    for driver, driven, held in (('2', '3', '5'), ('2', '5', '3'), ('3', '5', '2')):
        train = planetary(n2, 21, n5)
        forward = train.ratio(driver, driven, (held,))
        assert forward * train.ratio(driven, driver, (held,)) == pytest.approx(1.0)
        w = {driver: 1.0, driven: 1.0 / forward, held: 0.0}
        assert (w['5'] - w['3']) * n5 == pytest.approx(-(w['2'] - w['3']) * n2)


def test_large_reduction_by_nearly_equal_gears():
    """Ferguson: 1 - 101*99/(100*100) of the carrier's speed, a difference of products."""
    n = {'s': 101, 'p': 100, 'q': 99, 'o': 100}
    train = Train(n, (Mesh('s', 'p', 'c'), Mesh('q', 'o', 'c')), (('p', 'q'),))
    assert train.ratio('c', 'o', ('s',)) == pytest.approx(10_000, rel=1e-10)


def test_torques_of_a_planetary_train_gear_by_gear():
    """Tooth forces F on the planet are equal by its moments, its pin carries 2 F."""
    n2, n4, n5 = 24, 21, 66
    train = planetary(n2, n4, n5)
    flow = train.flow({'2': 100.0, '5': 0.0}, {'2': 3.0}, ('3', '5'))
    force = 3.0 / n2  # in units where a radius is a number of teeth
    assert flow.torque['5'] == pytest.approx(force * n5)
    assert flow.torque['3'] == pytest.approx(-2 * force * (n2 + n4))
    assert flow.torque['4'] == 0.0
    assert sum(flow.power.values()) == pytest.approx(0.0, abs=1e-9)
    speeds = train.speeds({'2': 100.0, '5': 0.0})
    rolling = force * n2 * (100.0 - speeds['3'])
    assert flow.rolling == pytest.approx({'2-4': rolling, '4-5': rolling})


def test_a_differential_shares_its_torque_whatever_the_speeds():
    for w5 in (0.0, 5.0, -30.0):
        flow = differential(AXLES).flow({'2': 60.0, '5': w5}, {'2': -8.0}, ('5', '6'))
        each = 8.0 * AXLES['3'] / AXLES['2'] / 2
        assert [flow.torque[n] for n in '56'] == pytest.approx([-each, -each])
        assert sum(flow.power.values()) == pytest.approx(0.0, abs=1e-9)


def test_power_of_any_train_is_conserved():
    for _ in range(100):
        train = compound_planetary(teeth('2', '3', '4', '5', '6'))
        w2, w6, torque = RANDOM.uniform(-9, 9, 3)
        flow = train.flow({'2': w2, '6': w6}, {'2': torque}, ('6', '7'))
        size = max(map(abs, flow.power.values()))
        assert sum(flow.power.values()) == pytest.approx(0.0, abs=1e-11 * size)
        assert sum(flow.torque.values()) == pytest.approx(  # of the whole on the frame
            0.0, abs=1e-11 * max(map(abs, flow.torque.values()))
        )


def test_planets_fit():
    assert planets_fit(24, 21, 66, 3)
    assert not planets_fit(24, 21, 66, 4)
    assert not planets_fit(24, 21, 67, 1)
    assert planets_fit(24, 12, 48, 4)
    assert not planets_fit(18, 36, 90, 6)  # neighbours touch


def test_mounted_planets_stand_on_teeth_and_spaces():
    """Turn the sun by whole teeth, carrier following: a planet comes where the next is to be."""
    n2, n4, n5 = 24, 21, 66
    for planets in range(2, 12):
        # the ring is held; the carrier moves to the next planet's place
        turned = planetary(n2, n4, n5).speeds({'3': 2 * math.pi / planets, '5': 0.0})
        pitches = turned['2'] / (2 * math.pi / n2)
        apart = (n2 + n4) * math.sin(math.pi / planets) > n4 + 2
        whole = abs(pitches - round(pitches)) < 1e-9
        assert planets_fit(n2, n4, n5, planets) == (whole and apart)


SIMPLE = planetary(24, 21, 66)


@pytest.mark.parametrize(
    ('make', 'sentence'),
    [
        (lambda: SIMPLE.speeds({'2': 1.0}), 'leave open that of 4, 5, 3'),
        (lambda: SIMPLE.speeds({'2': 1.0, '3': 1.0, '5': 0.0}), 'do not let 2, 3, 5 turn'),
        (lambda: SIMPLE.speeds({'9': 1.0}), 'no member 9; there are 2, 4, 5, 3'),
        (lambda: SIMPLE.speeds({'2': math.nan, '5': 0.0}), 'finite'),
        (lambda: SIMPLE.ratio('2', '5', ('5',)), '5 stands still'),
        (lambda: SIMPLE.flow({'2': 1, '5': 0}, {'2': 1.0}, ('3',)), 'need a support'),
        (lambda: SIMPLE.flow({'2': 1, '5': 0}, {'2': 1.0}, ('2', '3')), 'given and looked for'),
        (lambda: SIMPLE.flow({'2': 1, '5': 0}, {'2': 1.0}, ('3', '4', '5')), 'several torques'),
        (lambda: SIMPLE.flow({'2': 1, '5': 0}, {'2': math.inf}, ('3', '5')), 'finite'),
        (lambda: Train({'a': 20}, (Mesh('a', 'b'),)), 'teeth of b'),
        (lambda: Train({'a': 20}, (Mesh('a', 'a'),)), 'twice'),
        (lambda: Train({'a': 0}, ()), '0 teeth'),
        (lambda: Train({'a': 9, 'b': 9}, (Mesh('a', 'b'),), (), frozenset('b')), 'a carrier'),
        (lambda: Train({'a': 9}, (), (('a', 'a'),)), 'joined to itself'),
        (lambda: gear_box(BOX, 4), 'gears 1, 2 and 3'),
    ],
)
def test_wrong_trains_are_refused_by_name(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()
