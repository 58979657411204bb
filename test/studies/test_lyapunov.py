"""Lyapunov exponents: of a ball whose multipliers are known, and of the loose four-bar."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bouncing_ball import ball, speed
from builders import made
from gear_rattle import ExactRattle, rattle
from loose_valve import valve
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.engine.events import Impacts
from mechanism_sim.errors import InputError
from mechanism_sim.report.studies import exponents_text
from mechanism_sim.studies.lyapunov import LyapunovExponents, horizon
from mechanism_sim.studies.periodic import PoincareMap, find_periodic


def test_exponents_of_a_ball_that_bounces_once_a_turn():
    """Its map has the determinant ``e^2``: between its flips both multipliers have the size e.

    The scene's table follows the crank: of its four exponents two are those of the ball.
    """
    e, gamma = 0.5, 1.3
    found = ms.lyapunov(ball(gamma), revolutions=20, skip=60, count=2)
    T = 2.0 * math.pi / speed(gamma)
    steady = (1.0 + e**2) - (1.0 + e) ** 2 * math.sqrt(
        gamma**2 - (math.pi * (1.0 - e) / (1.0 + e)) ** 2
    )
    multipliers = np.abs(np.roots([1.0, -steady, e**2]))
    expected = np.log(np.sort(multipliers)[::-1]) / T
    assert sum(found.values) == pytest.approx(expected.sum(), rel=1e-6)
    assert math.isinf(found.horizon)


def test_a_force_over_time_needs_a_clock_whose_writing_is_shown():
    """A block on a spring, whose two exponents are together ``-c/m``."""
    scene = {
        'links': {'block': {'mass': 1.0}, 'clock': {'mass': 1.0, 'inertia': 1.0}},
        'joints': {'guide': {'prismatic': ['ground', 'block']},
                   'axle': {'revolute': ['ground', 'clock']}},
        'springs': {'k': {'between': ['ground', 'block'], 'stiffness': 1.0, 'damping': 0.2,
                          'free_length': 0.0}},
        'gravity': [0.0, 0.0],
        'initial': {'position': {'block': 0.3}},
        'loads': {'f': {'at': 'block', 'force': ['cos(2.8*t)', 0.0]}},
    }  # fmt: skip
    with pytest.raises(InputError, match=r'write cos\(clock\) instead of cos\(2\.8\*t\)'):
        ms.lyapunov(made(scene))
    with pytest.raises(InputError, match=r'write cos\(clock\) instead of cos\(2\.8\*t\)'):
        ms.bifurcation(made(scene), {'springs.k.stiffness': (1.0, 2.0, 2)})
    scene['loads']['f']['force'] = ['cos(clock)', 0.0]
    scene['drive'] = {'coordinate': 'clock', 'speed': '2.8 rad/s'}
    found = ms.lyapunov(made(scene), revolutions=20, skip=5, count=2)
    assert sum(found.values) == pytest.approx(-0.2, rel=1e-6)


@pytest.mark.sample(1)
@pytest.mark.parametrize(('speed', 'e'), [(6.0, 0.8), (10.0, 0.9)])
def test_exponents_of_gear_rattle_are_those_of_its_exact_map(speed, e):
    """Chaotic and not: over turns in which a chaotic motion still has most of its digits."""
    found = ms.lyapunov(rattle(speed, e), revolutions=20, skip=0, count=2)
    exact = ExactRattle(speed, e).growths(30)[10:].mean(axis=0) / found.period
    assert found.values == pytest.approx(exact.tolist(), abs=1e-3 * abs(exact).max())
    assert (found.values[0] > 0.0) == (speed == 6.0)


@pytest.mark.slow
def test_the_loose_four_bar_is_chaotic_and_loses_its_digits():
    """Two runs that begin 1e-9 apart part as fast as the exponent says."""
    found = ms.lyapunov('four_bar_clearance', revolutions=100, skip=20)
    assert found.values[0] - found.half_widths[0] > 0.0
    assert 0.1 < found.horizon / found.period < 100.0


def test_the_commands_say_it(tmp_path):
    scene = tmp_path / 'ball.yaml'
    scene.write_text(ball(1.3), encoding='utf-8')
    found = run_json('lyapunov', str(scene), '--revolutions', '20', '--skip', '30')
    (exponent,) = found['exponents']
    assert exponent['low'] <= exponent['value'] <= exponent['high'] < 0.0
    assert found['horizon'] is None
    same = 'statistics', str(scene), '--exponents', '1', '--revolutions', '20', '--skip', '30'
    assert run_json(*same) == found
    done = run('lyapunov', str(scene), '--exponents', '9')
    assert done.returncode == 2
    assert 'it has 4 exponents, not 9' in done.stderr


@pytest.mark.sample(1)
@pytest.mark.parametrize('scene', ['four_bar_clearance', 'hydraulic_arm'])
def test_digits_of_a_run_hold_as_long_as_it_says(scene):
    """Beside the same run with a hundredth of the tolerance: through impacts, and with states."""
    length = {'revolutions': 4} if scene == 'four_bar_clearance' else {'duration': 0.5}
    coarse, fine = (
        ms.simulate(ms.load_scene(scene, {'solver.rtol': rtol}), **length)
        for rtol in (1e-10, 1e-12)
    )
    found = horizon(coarse)
    assert math.isinf(found.time)
    assert 3.0 < found.left < found.digits == pytest.approx(10.0)
    names = [f'position.{c}' for c in coarse.physics.system.free]
    t = np.linspace(0.0, coarse.duration, 200)
    a, b = (run.sample(t, *names) for run in (coarse, fine))
    off = max(np.abs(a[n] - b[n]).max() / np.ptp(a[n]) for n in names)
    assert off <= 10.0**-found.left


def test_a_horizon_reads_every_impact_but_once(monkeypatch):
    """A long run has many windows, of which none looks through all impacts."""
    run, read, every = ms.simulate('four_bar_clearance', revolutions=5), [], Impacts.__iter__
    monkeypatch.setattr(Impacts, '__iter__', lambda own: read.append(len(own)) or every(own))
    horizon(run)
    assert len(run.motion) > 3 * 64
    assert sum(read) == len(run.impacts)


def test_solve_says_until_when_its_digits_hold():
    done = run('solve', 'slider_crank', '--horizon')
    assert done.returncode == 2
    assert 'it has no free motion, so all of its digits hold' in done.stderr
    found = run_json('solve', 'four_bar_clearance', '--revolutions', '14', '--horizon')['horizon']
    assert 1.0 < found['time'] < 2.4
    assert found['left'] == 0.0


def test_digits_that_hold_do_not_depend_on_the_scale_of_a_state():
    """A filter between a crank and a block on a spring: the same run, but for rounding."""
    left = []
    for scale in (1.0, 1e-6):
        machine = made(
            {
                'links': {'block': {'mass': 1.0}, 'clock': {'mass': 1.0, 'inertia': 1.0}},
                'joints': {'guide': {'prismatic': ['ground', 'block']},
                           'axle': {'revolute': ['ground', 'clock']}},
                'springs': {'k': {'coordinate': 'block', 'stiffness': 100.0, 'damping': 1.0}},
                'gravity': [0.0, 0.0],
                'states': {'push': {'start': 1.0, 'rate': '(cos(clock) - push)/0.3',
                                    'scale': scale}},
                'loads': {'f': {'at': 'block', 'force': ['1000*push', 0.0]}},
                'drive': {'coordinate': 'clock', 'speed': '9 rad/s'},
            }
        )  # fmt: skip
        left.append(horizon(ms.simulate(machine, duration=2.0)).left)
    assert left[1] == pytest.approx(left[0], abs=0.1)


def test_an_interval_that_holds_zero_decides_nothing():
    found = LyapunovExponents(40, 5, 0.1, (0.009,), (0.9,))
    assert found.undecided
    assert math.isinf(found.horizon)
    assert 'not decided' in exponents_text(found)
    sure = LyapunovExponents(40, 5, 0.1, (0.9,), (0.009,))
    assert not sure.undecided
    assert 'chaotic' in exponents_text(sure)


@pytest.mark.sample(1)
@pytest.mark.parametrize('rpm', [2500.0, 3000.0])
def test_what_a_closed_contact_ends_is_no_rounding_of_a_multiplier(rpm):
    """A loose follower that rides on its cam for part of every turn: its start is forgotten."""
    found = ms.lyapunov(valve(rpm), revolutions=20, skip=5, count=2)
    assert found.values == (-math.inf, -math.inf)


def shaken(table, ball):
    """A ball over a table that has a drive of its own beside the crank."""
    return ms.load_scene({
        'title': 'x', 'mechanism': 'linkage', 'gravity': [0, -9.81],
        'links': {
            'crank': {'length': '1 mm', 'mass': '1 kg', 'inertia': '1 kg mm^2'},
            'table': {'mass': '1 kg'}, 'ball': {'mass': '0.1 kg'},
        },
        'joints': {
            'gc': {'revolute': ['ground', 'crank']},
            'gt': {'prismatic': ['ground', 'table'], 'axis': '90 deg'},
            'gb': {'prismatic': ['ground', 'ball'], 'axis': '90 deg'},
            'hit': {'contact': ['table', 'ball'], 'radii': ['5 mm', '10 mm'], 'restitution': 0.8},
        },
        'drive': {'coordinate': 'crank', 'speed': '1200 rpm'}, 'drives': {'table': table},
        'initial': {'position': {'ball': ball}},
    })  # fmt: skip


@pytest.mark.slow
def test_laws_of_other_drives_begin_again_with_every_turn_that_begins_anew():
    """One impact a turn: both multipliers have the size e; a ball that rests forgets all."""
    move = {'position': '0.6 mm * sin(40*pi*t + 4.34260464886179)'}
    machine = shaken(move, '18.62506818778339 mm')
    section, state = PoincareMap(machine), machine.initial_state()
    ends = [section.map(state, turns)[0] for turns in (1, 2, 1, 3, 1)]
    assert ends[0] == ends[2] == ends[4]
    response = find_periodic(machine, transient=5)
    assert (response.period, response.impacts) == (1, 1)
    assert np.abs(response.multipliers) == pytest.approx(0.8, rel=1e-9)
    found = ms.lyapunov(machine, revolutions=20, skip=5, count=2)
    assert sum(found.values) == pytest.approx(2.0 * math.log(0.8) / 0.05, rel=1e-6)
    for table in ({'position': '0.3 mm * sin(40*pi*t)'}, {'speed': '0 m/s'}):
        resting = shaken(table, '18 mm')
        assert ms.lyapunov(resting, revolutions=20, skip=20, count=2).values == (-math.inf,) * 2
        assert find_periodic(resting, transient=20).multipliers == ()


@pytest.mark.sample(1)
@pytest.mark.parametrize('crank', [2.8, 1.9])
def test_loads_over_time_know_nothing_of_the_turns_of_a_crank(crank):
    """``x'' = -2 x - 0.3 x' + cos(1.4 t)`` beside a crank that is no more than a clock."""
    machine = ms.load_scene({
        'title': 'x', 'mechanism': 'linkage', 'gravity': [0, 0],
        'links': {
            'mass': {'mass': '1 kg'}, 'crank': {'length': '1 m', 'mass': '1 kg', 'inertia': 1},
        },
        'joints': {
            'gc': {'revolute': ['ground', 'crank']}, 'gm': {'prismatic': ['ground', 'mass']},
        },
        'loads': {'f': {'at': 'mass', 'force': ['-2*x - 0.3*vx + cos(1.4*t)', 0]}},
        'drive': {'coordinate': 'crank', 'speed': crank},
    })  # fmt: skip
    section, state = PoincareMap(machine), machine.initial_state()
    for _ in range(3):
        state, _, _ = section.map(state, 1)
    end = ms.simulate(machine, duration=3.0 * machine.drive.period).to_frame('position')
    assert state.q[0] == pytest.approx(end['position.mass'].iloc[-1], rel=1e-9)
    found = ms.lyapunov(machine, revolutions=20, skip=0, count=2)
    assert sum(found.values) == pytest.approx(-0.3, rel=1e-9)
    response = find_periodic(machine)
    if crank == 2.8:  # twice the frequency of the force
        assert response.period == 2
        size = math.exp(-0.15 * 2.0 * machine.drive.period)
        assert np.abs(response.multipliers) == pytest.approx(size, rel=1e-9)
    else:
        assert response is None


@pytest.mark.slow
def test_turns_that_keep_their_time_end_no_rounding_too_late():
    """A segment of a rounding has no derivatives: beside a force too small to matter they fail."""
    timed = {'loads.p': {'at': 'ball', 'force': ['0 N', '1e-12*cos(3*t)']}}
    exact, found = (
        ms.lyapunov(ms.load_scene(ball(1.3), more), revolutions=100, skip=60, count=2).values
        for more in ({}, timed)
    )
    assert found == pytest.approx(exact, rel=1e-9)
