"""Equations of motion through positions where loops become singular, and from such positions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mechanism_sim as ms
from mechanism_sim.engine.singular import time_of_touch, truncate
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.errors import InputError
from test.hard.n_four_bar import exact_n_four_bar, n_four_bar
from test.hard.singular import linkage

GRAVITY = 9.8145
ARM, SPAN = 0.08, 0.2  # [m] crank and rocker, ground and coupler


def parallelogram(angle: float, speed: float, torque: float, **more):
    """A four-bar whose crank a torque turns; angle in degrees."""
    overrides = {
        'links.ground': {'length': SPAN},
        'links.crank': {'length': ARM, 'mass': 0.5, 'inertia': 3e-4, 'cog': 0.04},
        'links.coupler': {'length': SPAN, 'mass': 0.6, 'inertia': 2e-3, 'cog': 0.09},
        'links.rocker': {'length': ARM, 'mass': 0.7, 'inertia': 4e-4, 'cog': 0.03},
        'drive': {
            'torque': {'constant': torque},
            'speed': f'{speed} rad/s',
            'start_angle': f'{angle} deg',
        },
    }
    return ms.load_scene('four_bar_nominal', overrides | more)


def exact_parallelogram(angle: float, speed: float, torque: float, until: float):
    """Crank angle and rate while the coupler only translates: one equation for one freedom."""
    inertia = 3e-4 + 0.5 * 0.04**2 + 4e-4 + 0.7 * 0.03**2 + 0.6 * ARM**2
    weight = GRAVITY * (0.5 * 0.04 + 0.7 * 0.03 + 0.6 * ARM)
    found = solve_ivp(
        lambda _, y: [y[1], (torque - weight * math.cos(y[0])) / inertia],
        (0.0, until),
        [math.radians(angle), speed],
        'DOP853',
        rtol=1e-13,
        atol=1e-13,
    )
    return found.y[:, -1]


@pytest.mark.sample(1)
@pytest.mark.parametrize('rtol', [1e-7, 1e-9, 1e-12])
def test_a_window_collapses_into_a_line_ten_times_and_keeps_its_branch(rtol):
    solution = ms.simulate(n_four_bar(1, rtol), duration=10.0)
    end, (angle, rate) = solution.sample(10.0), exact_n_four_bar(1, 10.0)
    assert abs(angle) // math.pi == 9
    error = max(1e-9, 30.0 * rtol)
    assert end['position.rod0'][0] == pytest.approx(angle, abs=error)
    assert end['velocity.rod0'][0] == pytest.approx(rate, abs=3.0 * error)
    assert end['position.rod1'][0] == pytest.approx(end['position.rod0'][0], abs=1e-12)
    assert abs(solution.energy.residual) < 1e-9 + 30.0 * rtol


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('angle', 'speed'), [(20.0, 6.0), (20.0, -6.0), (0.0, 6.0), (179.9999, 9.0)]
)
def test_a_parallelogram_moved_by_a_torque_goes_through_its_change_points(angle, speed):
    branch = {'branch': 'crossed'} if angle > 90.0 else {}
    solution = ms.simulate(parallelogram(angle, speed, 0.5, **branch), duration=2.0)
    exact, end = exact_parallelogram(angle, speed, 0.5, 2.0), solution.sample(2.0)
    behind = end['position.rocker'][0] - end['position.crank'][0]
    assert math.remainder(behind, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-11)
    assert end['position.crank'][0] == pytest.approx(exact[0], abs=1e-8)
    assert end['velocity.crank'][0] == pytest.approx(exact[1], abs=1e-7)
    balance = solution.energy
    assert abs(balance.residual) < 1e-10 * (abs(balance.drive_work) + balance.initial + 1.0)


def test_one_piece_leads_across_each_change_point():
    """Its polynomial ends before the powers that rounding spoils; no other does."""
    solution = ms.simulate(parallelogram(20.0, 6.0, 0.5), duration=2.0)
    curve = solution.motion.curve
    across = (curve.coefficients[:, :, -1] == 0.0).all(axis=1)
    crank = curve(np.append(curve.start, curve.end))[:, 0]
    passes = np.floor(crank[1:] / math.pi) != np.floor(crank[:-1] / math.pi)
    assert passes.sum() > 3
    assert np.flatnonzero(across).tolist() == np.flatnonzero(passes).tolist()
    crossings = solution.physics._crossings(solution.motion, np.arange(len(curve)))
    angle = curve.at(crossings.segments, crossings.touch)[:, 0]
    assert len(angle) == passes.sum()
    assert np.remainder(angle + 1.0, math.pi) == pytest.approx(1.0, abs=1e-6)


def test_a_load_of_time_acts_from_a_change_point_on():
    load = {'loads.pull': {'at': 'crank.end', 'torque': '2*cos(40*t)'}}
    solution = ms.simulate(parallelogram(0.0, 6.0, 0.0, **load), duration=0.3)
    wanted = solve_ivp(
        lambda t, y: [y[1], (2.0 * math.cos(40.0 * t) - WEIGHT * math.cos(y[0])) / INERTIA],
        (0.0, 0.3), [0.0, 6.0], 'DOP853', rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    end = solution.sample(0.3, 'position.crank', 'velocity.crank')
    assert end['position.crank'][0] == pytest.approx(wanted.y[0, -1], abs=1e-9)
    assert end['velocity.crank'][0] == pytest.approx(wanted.y[1, -1], abs=1e-8)


INERTIA = 3e-4 + 0.5 * 0.04**2 + 4e-4 + 0.7 * 0.03**2 + 0.6 * ARM**2
WEIGHT = GRAVITY * (0.5 * 0.04 + 0.7 * 0.03 + 0.6 * ARM)


def crank_path(torque, y, begin, end, event=None):
    """Crank angle and rate of the parallelogram under a constant torque."""
    return solve_ivp(
        lambda _, y: [y[1], (torque - WEIGHT * math.cos(y[0])) / INERTIA],
        (begin, end),
        y,
        'DOP853',
        rtol=1e-13,
        atol=1e-13,
        events=event,
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('begin', 'end', 'speed'),
    [(180.0, 360.0, 6.0), (90.0, 180.0, 16.0), (0.0, 180.0, 6.0), (0.0, 180.0, -6.0)],
)
def test_a_load_may_begin_and_end_at_a_change_point(begin, end, speed):
    machine = linkage(
        links={
            'ground': {'points': {'pivot': [SPAN, 0.0]}},
            'crank': {'length': ARM, 'mass': 0.5, 'inertia': 3e-4, 'cog': 0.04},
            'coupler': {'length': SPAN, 'mass': 0.6, 'inertia': 2e-3, 'cog': 0.09},
            'rocker': {'length': ARM, 'mass': 0.7, 'inertia': 4e-4, 'cog': 0.03},
        },
        joints={
            'a': {'revolute': ['ground', 'crank']},
            'b': {'revolute': ['crank.end', 'coupler']},
            'c': {'revolute': ['coupler.end', 'rocker.end']},
            'd': {'revolute': ['ground.pivot', 'rocker']},
        },
        gravity=[0, -GRAVITY],
        loads={
            'brake': {
                'at': 'crank',
                'torque': -0.3,
                'during': {'coordinate': 'crank', 'from': f'{begin} deg', 'to': f'{end} deg'},
            }
        },
        drive={
            'coordinate': 'crank',
            'start_angle': '20 deg',
            'speed': f'{speed} rad/s',
            'torque': {'constant': 0.5},
        },
        guess={'coupler': 0.0, 'rocker': '20 deg'},
    )
    low, high = math.radians(begin), math.radians(end)
    t, y, changes = 0.0, [math.radians(20.0), speed], 0
    edges = [lambda _, y, at=at: math.sin(0.5 * (y[0] - at)) for at in (low, high)]
    for edge in edges:
        edge.terminal = True

    def torque(y):
        ahead = y[0] + math.copysign(1e-7, y[1])
        return 0.2 if low <= ahead % (2.0 * math.pi) < high else 0.5

    while t < 2.0:
        path = crank_path(torque(y), y, t, 2.0, edges)
        t, y = path.t[-1], path.y[:, -1]
        if t < 2.0:  # beyond the edge, lest it is found again
            changes += 1
            path = crank_path(torque(y), y, t, t + 1e-8)
            t, y = path.t[-1], path.y[:, -1]
    solution = ms.simulate(machine, duration=2.0)
    found = solution.sample(2.0, 'position.crank', 'velocity.crank', 'position.rocker')
    assert changes > 1
    assert found['position.crank'][0] == pytest.approx(y[0], abs=1e-8)
    assert found['velocity.crank'][0] == pytest.approx(y[1], abs=1e-7)
    behind = found['position.rocker'][0] - found['position.crank'][0]
    assert math.remainder(behind, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-11)
    assert abs(solution.energy.residual) < 1e-10


@pytest.mark.parametrize('off', [-1e-3, -1e-5, -1e-6, -1e-8, 0.0, 1e-8, 1e-6, 1e-4])
def test_another_torque_may_begin_near_a_change_point_or_at_it(off):
    def on_the_line(_, y):
        return y[0]

    on_the_line.terminal = True
    machine, start = parallelogram(20.0, -9.0, 0.5), [math.radians(20.0), -9.0]
    at = crank_path(0.5, start, 0.0, 1.0, on_the_line).t[-1] + off
    (law,) = machine.plan.laws['crank']
    run = machine.start()
    run.advance(at - 0.02)
    run.change_law(replace(law, coefficients=(0.1, 0.0, 0.0), valid_from=at))
    run.advance(1.0, final=True)
    changed = crank_path(0.5, start, 0.0, at).y[:, -1]
    exact = crank_path(0.1, changed, at, 1.0).y[:, -1]
    angle, rate = (
        dict(zip(machine.equations.system.free, x, strict=True))
        for x in (run.state.q, run.state.v)
    )
    off_angle = math.remainder(angle['crank'] - exact[0], 2.0 * math.pi)
    assert off_angle == pytest.approx(0.0, abs=1e-9)
    assert rate['crank'] == pytest.approx(exact[1], abs=1e-8)
    behind = math.remainder(angle['crank'] - angle['rocker'], 2.0 * math.pi)
    assert behind == pytest.approx(0.0, abs=1e-11)


def test_rest_at_a_change_point_is_refused_for_nothing_decides_the_branch():
    with pytest.raises(InputError, match=r'at rest in a singular position.*start beside it'):
        ms.simulate(parallelogram(0.0, 0.0, 0.5), duration=1.0)


def test_a_slider_crank_of_equal_arms_goes_through_the_position_where_its_rod_folds():
    length, g = 0.1, 9.81
    machine = linkage(
        links={
            'ground': {},
            'crank': {'length': length, 'mass': 0.5, 'inertia': 1e-3, 'cog': 0.05},
            'rod': {'length': length, 'mass': 0.4, 'inertia': 5e-4, 'cog': 0.04},
            'slider': {'mass': 0.3},
        },
        joints={
            'main': {'revolute': ['ground', 'crank']},
            'pin': {'revolute': ['crank.end', 'rod']},
            'wrist': {'revolute': ['rod.end', 'slider']},
            'guide': {'prismatic': ['ground', 'slider']},
        },
        gravity=[0, -g],
        drive={
            'coordinate': 'crank',
            'start_angle': '30 deg',
            'speed': '10 rad/s',
            'torque': {'constant': 0.2},
        },
        guess={'rod': '-30 deg', 'slider': 2.0 * length * math.cos(math.pi / 6.0)},
    )

    def rate(_, y):
        """The rod stays at -angle, the slider at 2 l cos(angle): a reduced inertia J(angle)."""
        s, c = math.sin(y[0]), math.cos(y[0])
        ahead, behind = length + 0.04, length - 0.04
        inertia = 1e-3 + 0.5 * 0.05**2 + 5e-4
        inertia += 0.4 * ((ahead * s) ** 2 + (behind * c) ** 2) + 0.3 * (2.0 * length * s) ** 2
        slope = 2.0 * s * c * (0.4 * (ahead**2 - behind**2) + 0.3 * 4.0 * length**2)
        weight = g * c * (0.5 * 0.05 + 0.4 * behind)
        return [y[1], (0.2 - weight - 0.5 * slope * y[1] ** 2) / inertia]

    solution = ms.simulate(machine, duration=1.0)
    start = [math.pi / 6.0, 10.0]
    exact = solve_ivp(rate, (0.0, 1.0), start, 'DOP853', rtol=1e-13, atol=1e-13).y[:, -1]
    end = solution.sample(1.0, 'position.crank', 'position.rod')
    assert exact[0] > 4.0 * math.pi
    assert end['position.crank'][0] == pytest.approx(exact[0], abs=1e-9)
    assert end['position.rod'][0] == pytest.approx(-exact[0], abs=1e-9)


@pytest.mark.slow
def test_forces_are_limits_at_the_position_or_said_to_have_none():
    def near(windows):
        machine = n_four_bar(windows)
        solution = ms.simulate(machine, duration=1.0)
        crossings = machine.physics._crossings(solution.motion, np.arange(len(solution.motion)))
        (k,), (touch,) = crossings.segments, crossings.touch
        at = solution.motion.curve.start[k] + touch
        return solution, machine.physics.no_limits(solution.motion), at

    solution, unbounded, at = near(1)
    assert not unbounded
    shifts = np.array([-1e-3, -1e-6, -1e-9, 0.0, 1e-9, 1e-6, 1e-3])
    seen = solution.sample(
        at + shifts,
        'reaction.left0.x',
        'acceleration.rod0',
        'reaction.left0.y',
        'reaction.right0.y',
        'position.rod0',
        'velocity.rod0',
    )
    # the bar's weight hangs on both of its ends, which fall with it: by moments about its middle
    bar = seen['acceleration.rod0'] * np.cos(seen['position.rod0'])
    bar -= seen['velocity.rod0'] ** 2 * np.sin(seen['position.rod0'])
    pull = seen['reaction.left0.y'] - seen['reaction.right0.y']
    np.testing.assert_allclose(pull, bar + 9.81, atol=1e-8)
    middle = 0.5 * (seen['reaction.left0.x'][2] + seen['reaction.left0.x'][4])
    assert seen['reaction.left0.x'][3] == pytest.approx(middle, rel=1e-9)

    # two windows: the middle rod carries more, and only bars in line with the rods could help it
    solution, unbounded, at = near(2)
    assert [x.t for x in unbounded] == [pytest.approx(at)]
    assert 'left0' in unbounded[0].joints
    seen = solution.sample(at + np.array([1e-6, 1e-5, 0.0]), 'reaction.left0.x')
    force = seen['reaction.left0.x']
    assert force[0] == pytest.approx(10.0 * force[1], rel=1e-2)
    assert np.isnan(force[2])


def test_where_forces_have_no_limit_is_told_by_the_main_drive():
    """It was told by the wheel, whose motion is given, under the name of the rod."""
    machine = n_four_bar(2, wheel='2 rad/s')
    (found,) = machine.physics.no_limits(ms.simulate(machine, duration=0.8).motion)
    assert machine.plan.main == 'rod0'
    assert found.drive == pytest.approx(0.0, abs=1e-9)


def test_a_pause_before_a_singular_position_changes_nothing(tmp_path):
    whole = ms.simulate(n_four_bar(1), duration=3.0)
    for pause in (0.6, 0.7084, 0.70845, 0.72, 1.2153):
        part = ms.simulate(n_four_bar(1), duration=pause)
        part.snapshot.save(tmp_path / 'pause.json')
        snapshot = Snapshot.load(tmp_path / 'pause.json')
        rest = ms.simulate(n_four_bar(1), duration=3.0, resume=snapshot)
        for name in ('position.rod0', 'velocity.rod1'):
            assert rest.sample(3.0, name)[name][0] == whole.sample(3.0, name)[name][0]


@pytest.mark.slow
def test_a_loose_third_bar_strikes_while_the_first_two_go_through_their_change_points():
    rods = {
        f'rod{i}': {'length': ARM, 'mass': 0.5, 'inertia': 3e-4, 'cog': 0.04} for i in range(3)
    }
    bars = {
        f'bar{i}': {'length': SPAN, 'mass': 0.6, 'inertia': 2e-3, 'cog': 0.09} for i in range(2)
    }
    pivots = {f'pivot{i}': [i * SPAN, 0.0] for i in range(3)}
    joints = {f'pivot{i}': {'revolute': [f'ground.pivot{i}', f'rod{i}']} for i in range(3)}
    for i in range(2):
        joints[f'left{i}'] = {'revolute': [f'rod{i}.end', f'bar{i}']}
        joints[f'right{i}'] = {'revolute': [f'bar{i}.end', f'rod{i + 1}.end']}
    joints['right1']['clearance'] = {'radial': '0.1 mm', 'restitution': 0.5, 'friction': 0.1}
    machine = linkage(
        links={'ground': {'points': pivots}, **rods, **bars},
        joints=joints,
        gravity=[0, -9.81],
        drive={
            'coordinate': 'rod0',
            'torque': {'constant': 0.3},
            'start_angle': '60 deg',
            'speed': '8 rad/s',
        },
        guess={'rod1': '60 deg', 'rod2': '60 deg'},
        start='centred',
    )
    solution = ms.simulate(machine, duration=1.0)
    end, balance = solution.sample(1.0), solution.energy
    assert end['position.rod0'][0] > 4.0 * math.pi
    assert end['position.rod1'][0] == pytest.approx(end['position.rod0'][0], abs=1e-11)
    assert len(solution.impacts) > 50
    assert abs(balance.residual) < 1e-9 * (balance.drive_work + balance.dissipated)


def test_a_distance_touches_zero_where_its_series_does_and_not_above():
    at, order = 0.3, np.arange(20.0)
    factorial = np.array([math.factorial(int(k)) for k in order])
    # sin(t - at)^2
    series = -0.5 * 2.0**order / factorial * np.cos(0.5 * np.pi * order - 2.0 * at)
    series[0] += 0.5
    assert time_of_touch(series, 0.5) == pytest.approx(at, rel=1e-7)
    assert time_of_touch(series, 0.2) is None
    assert time_of_touch(series + 1e-3 * (order == 0.0), 0.5) is None


def test_a_series_ends_where_rounding_takes_over():
    true = 0.1 ** np.arange(12.0)
    spoilt = true + 1e-9 * 2.0 ** np.arange(12.0) * np.array([1.0, -1.0] * 6)
    series = spoilt[None].copy()
    error = truncate(series, 1.0, np.ones(1))
    kept = int(np.count_nonzero(series))
    assert 6 <= kept <= 9
    assert abs(series.sum() - true.sum()) < error < 1e-6
