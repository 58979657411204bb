"""Drives by position and by speed over time, against closed forms and mechanics done by hand."""

from __future__ import annotations

import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from builders import made
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.analysis.open_run import open_run
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.planar.drive import TWO_PI

INPUTS = Path(__file__).parent / 'inputs'
SERVO = str(INPUTS / 'position_law.yaml')
BY_POSITION = {'drive': {'position': '90 deg + 60 deg*sin(pi*t)'}}

ARM = {
    'title': 'An arm that a servo turns',
    'mechanism': 'linkage',
    'links': {'ground': {}, 'arm': {'length': '1 m', 'mass': '2 kg', 'inertia': '0.5 kg m^2'}},
    'joints': {'pivot': {'revolute': ['ground', 'arm']}},
}


def arm(duration=4.0, **drive):
    return ms.simulate(made({**ARM, 'drive': {'coordinate': 'arm', **drive}}), duration=duration)


def four_bar_torque(angle, speed, acceleration):
    """Torque on the crank of `position_law.yaml`, from its kinetic energy alone.

    d/dt (J w^2 / 2) / w = J a + J' w^2 / 2 with the inertia J(angle) that the crank feels: from
    positions of all centres of gravity in 30 digits, and their derivatives by mpmath.
    """
    g, a, b, c = (mp.mpf(x) / 1000 for x in (200, 60, 180, 100))

    def places(x):
        crank = mp.expj(x) * a
        to = g - crank
        d = abs(to)
        turn = mp.acos((b * b + d * d - c * c) / (2 * b * d))
        coupler = mp.arg(to) + turn
        rocker = mp.arg(crank + b * mp.expj(coupler) - g)
        return [
            (mp.mpf('0.1'), mp.mpf('50e-6'), crank / 2, x),
            (mp.mpf('0.2'), mp.mpf('600e-6'), crank + mp.expj(coupler) * b / 2, coupler),
            (mp.mpf('0.2'), mp.mpf('200e-6'), g + mp.expj(rocker) * c / 2, rocker),
        ]

    def inertia(x):
        total = mp.mpf(0)
        for i, (mass, own, _, _) in enumerate(places(x)):
            step = mp.mpf(10) ** -12
            (_, _, p, u), (_, _, q, v) = places(x - step)[i], places(x + step)[i]
            total += mass * abs((q - p) / (2 * step)) ** 2 + own * ((v - u) / (2 * step)) ** 2
        return total

    with mp.workdps(50):
        step, x = mp.mpf(10) ** -8, mp.mpf(angle)
        slope = (inertia(x + step) - inertia(x - step)) / (2 * step)
        return float(inertia(x) * acceleration + slope * mp.mpf(speed) ** 2 / 2)


@pytest.mark.parametrize(('overrides', 'tail'), [({}, 1e-12), (BY_POSITION, 1e-13)])
def test_a_servo_swings_a_four_bar_as_its_formula_says(overrides, tail):
    """Drake, issue 19234; angles by hand, torques from the kinetic energy."""
    solution = ms.simulate(ms.load_scene(SERVO, overrides), duration=4.0)
    t = np.linspace(0.0, 4.0, 4001)
    found = solution.sample(t)
    rate = math.pi if overrides else 3.14159265
    size = math.radians(60.0) if overrides else 3.2898681337 / rate
    angle = math.pi / 2 + size * np.sin(rate * t)
    assert np.abs(found['position.crank'] - angle).max() <= tail
    assert np.abs(found['velocity.crank'] - rate * size * np.cos(rate * t)).max() <= 1e-11
    faster = -(rate**2) * size * np.sin(rate * t)
    assert np.abs(found['acceleration.crank'] - faster).max() <= 1e-10
    assert np.abs(found['acceleration.crank']).max() == pytest.approx(10.335425560, abs=1e-7)
    torque = found['drive_torque']
    assert torque.min() == pytest.approx(-0.00972, abs=5e-6)
    for k in (137, 1000, 1501, int(torque.argmin()), 3333):
        by_hand = four_bar_torque(angle[k], rate * size * math.cos(rate * t[k]), faster[k])
        assert torque[k] == pytest.approx(by_hand, abs=1e-12)


def test_ten_thousand_times_as_long_it_has_the_same_digits():
    """After 40,000 s: sines of the time in exact arithmetic, as of everything that turns."""
    machine = made({**ARM, 'drive': {'coordinate': 'arm', 'position': '1 + sin(pi*t) + 2*pi*t'}})
    law = machine.plan.sources['arm'].after(machine.drive.laws[-1])
    engine = machine.start()
    engine.advance(20.0, final=True)
    assert engine.time == 20.0
    source = machine.plan.sources['arm']
    late = [source._law(40_000.0 + k / 8, 0, 0.0) for k in range(8)]
    assert law is not None
    for k, law in enumerate(late):
        with mp.workdps(40):
            t = mp.mpf(40_000) + mp.mpf(k) / 8
            exact = 1 + mp.sin(mp.pi * t) + 2 * mp.pi * t
            turns, (angle, speed, *_) = law.about(40_000 + k / 8)
            found = mp.mpf(turns) * mp.mpf(TWO_PI.numerator) / TWO_PI.denominator + angle
            assert abs(found - exact) <= 1e-14
            assert abs(speed - mp.pi * (2 + mp.cos(mp.pi * t))) <= 1e-13


def test_a_periodic_table_of_the_time_repeats_in_formulas_of_loads():
    """A wheel under the torque of a table of one period of 0.8 s; its speed in closed form."""
    t = np.linspace(0.0, 0.8, 65)
    points = [[f'{x!r} s', f'{2.0 + math.sin(2.0 * math.pi * x / 0.8)!r} N m'] for x in t.tolist()]
    points[-1][1] = points[0][1]
    scene = {
        **ARM,
        'drive': {'coordinate': 'arm', 'torque': {}},
        'tables': {'push': {'points': points, 'interpolation': 'quintic', 'periodic': True}},
        'loads': {'push': {'at': 'arm', 'torque': 'push(t)'}},
    }
    solution = ms.simulate(made(scene), duration=20.3)
    rate = 2.0 * math.pi / 0.8
    inertia = 0.5
    t = np.linspace(0.0, 20.3, 999)
    exact = (2.0 * t + (1.0 - np.cos(rate * t)) / rate) / inertia
    assert np.abs(solution.sample(t)['velocity.arm'] - exact).max() <= 1e-7  # of the spline
    table = made(scene).scene.tables['push'].curve
    values = table(np.array([0.3, 0.3 + 0.8 * 7, -0.5]))
    assert values == pytest.approx([values[0]] * 3, abs=1e-12)
