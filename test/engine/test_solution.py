"""Solutions: columns by name, the later side at events, balance at any time."""

from __future__ import annotations

import numpy as np
import pytest
from builders import without_work
from four_bars import LINKS, SPEED, TURN, loose
from scipy.interpolate import CubicSpline

import mechanism_sim as ms
from mechanism_sim.engine.energy_terms import EnergyTerms
from mechanism_sim.engine.events import StopReason

JOINTS = ('ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground')
MOTION = {f'{kind}.{k}' for kind in ('position', 'velocity', 'acceleration') for k in LINKS}
FORCES = {f'reaction.{j}.{axis}' for j in JOINTS for axis in 'xy'} | {'drive_torque'} | {
    f'energy.{k}' for k in ('kinetic', 'potential', 'drive_work', 'dissipated')
}  # fmt: skip
GAP = {
    f'{kind}.coupler_rocker'
    for kind in ('gap', 'normal_force', 'friction_force', 'closed', 'mode')
}


@pytest.fixture(scope='module')
def run():
    """Impacts through several revolutions, so that times are counted from several bases."""
    return ms.simulate(loose(1.0), revolutions=4.0)


@pytest.fixture(scope='module')
def seated():
    return ms.simulate(loose(0.5, 'seated'), revolutions=1.4)


def test_columns_are_those_of_the_contract(run):
    table = run.sample(np.linspace(0.0, run.duration, 7))
    assert set(table) == {'t'} | MOTION | FORCES | GAP
    assert all(np.shape(column) == (7,) for column in table.values())
    assert run.stop_reason is StopReason.COMPLETE
    assert run.stats.switches >= len(run.impacts)
    assert run.stats.steps >= run.stats.switches


def test_columns_of_ideal_scenes_leave_out_what_they_do_not_know():
    ideal = ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=0.1)
    assert set(ideal.sample(0.0)) == {'t'} | MOTION | FORCES
    bare = ms.simulate(ms.load_scene('four_bar_crossed'), revolutions=0.1)
    assert set(bare.sample(0.0)) == {'t'} | MOTION
    assert bare.energy is None
    assert bare.impacts == bare.modes == []


def test_one_time_many_times_and_times_in_any_order(seated):
    t = np.array([0.1, 0.02, 0.1, 0.17])
    table = seated.sample(t)
    np.testing.assert_array_equal(table['t'], t)
    for k, x in enumerate(t):
        one = seated.sample(x)
        for name in MOTION | FORCES | GAP:
            np.testing.assert_allclose(one[name][0], table[name][k], rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize('t', [-1e-6, 1.0, [0.0, 1.0], 1e9])
def test_times_outside_of_the_solution_are_refused(seated, t):
    with pytest.raises(ms.InputError, match=r'outside of the solution.*solved \[0, 0\.24'):
        seated.sample(t)


def test_at_an_impact_the_later_side_holds(run):
    """To the last bit of the impact's own time, whatever base time was counted from."""
    at = np.array([i.t for i in run.impacts])
    assert (at > 2.0 * TURN).sum() > 50
    now, before = run.sample(at), run.sample(np.nextafter(at, 0.0))
    for k, impact in enumerate(run.impacts):
        speed = {}
        for side, table in (('after', now), ('before', before)):
            th2, th3, th4 = (table[f'position.{name}'][k] for name in LINKS)
            rate = 1j * (
                0.064 * SPEED * np.exp(1j * th2)
                + 0.309 * table['velocity.coupler'][k] * np.exp(1j * th3)
                - 0.312 * table['velocity.rocker'][k] * np.exp(1j * th4)
            )
            speed[side] = (np.exp(-1j * impact.normal_angle) * rate).real
        assert speed['before'] == pytest.approx(impact.approach_speed, rel=1e-8)
        assert speed['after'] == pytest.approx(-impact.rebound_speed, rel=1e-8)
        assert abs(now['gap.coupler_rocker'][k]) < 1e-15


def test_modes_are_those_of_the_samples(seated):
    for change, following in zip(seated.modes[:-1], seated.modes[1:], strict=True):
        t = np.linspace(change.t, following.t, 7)[:-1]
        closed = seated.sample(t, 'closed.coupler_rocker')['closed.coupler_rocker']
        assert (closed == (change.mode == 2)).all()


@pytest.mark.parametrize('which', ['run', 'seated'])
def test_energies_add_up_at_any_time(which, request):
    solution = request.getfixturevalue(which)
    at = np.array([i.t for i in solution.impacts])
    even = np.linspace(0.0, solution.duration, 3001)
    t = np.concatenate([even, at, np.nextafter(at, 0.0), np.nextafter(at, 9.0)])
    s = solution.sample(
        t, 'energy.kinetic', 'energy.potential', 'energy.dissipated', 'energy.drive_work'
    )
    total = s['energy.kinetic'] + s['energy.potential']
    balance = total - s['energy.drive_work'] + s['energy.dissipated']
    assert np.abs(balance - balance[0]).max() < 1e-12
    assert np.ptp(total) > 0.1
    end = solution.sample(solution.duration, 'energy.drive_work', 'energy.dissipated')
    assert end['energy.drive_work'][0] == pytest.approx(solution.energy.drive_work, abs=1e-13)
    assert end['energy.dissipated'][0] == pytest.approx(solution.energy.dissipated, abs=1e-16)
    assert solution.energy.initial == pytest.approx(balance[0], rel=1e-14)


def test_velocities_and_accelerations_are_derivatives_of_the_samples(seated):
    t = np.linspace(0.01, 0.16, 1501)  # following, no event
    s = without_work(seated, t)
    for name in LINKS:
        spline = CubicSpline(t, s[f'position.{name}'])
        inner = slice(20, -20)
        velocity, acceleration = spline(t, 1)[inner], spline(t, 2)[inner]
        assert np.abs(velocity - s[f'velocity.{name}'][inner]).max() < 2e-5
        assert np.abs(acceleration - s[f'acceleration.{name}'][inner]).max() < 2.0


def test_gap_and_reaction_follow_from_the_angles(seated):
    s = without_work(seated, np.linspace(0.0, seated.duration, 999))
    z = [np.exp(1j * s[f'position.{k}']) for k in LINKS]
    Q = 0.064 * z[0] + 0.309 * z[1] - 0.387 - 0.312 * z[2]
    assert np.abs(s['gap.coupler_rocker'] - (2.54e-4 - np.abs(Q))).max() < 1e-15
    assert s['gap.coupler_rocker'].min() > -1e-15
    force = s['reaction.coupler_rocker.x'] + 1j * s['reaction.coupler_rocker.y']
    closed = s['closed.coupler_rocker'] > 0.5
    pressed = s['normal_force.coupler_rocker'] * Q / 2.54e-4
    assert np.abs(force - pressed)[closed].max() < 1e-8
    assert np.abs(force[~closed]).max() == 0.0
    assert 0.02 < (~closed).mean() < 0.5
    assert s['normal_force.coupler_rocker'][closed].min() > 0.0


def test_drive_torque_balances_the_crank(seated):
    """Moments on the crank alone: the reaction at its pin and its weight."""
    s = seated.sample(
        np.linspace(0.0, seated.duration, 300),
        'position.crank',
        'reaction.crank_coupler.x',
        'reaction.crank_coupler.y',
        'drive_torque',
    )
    th2 = s['position.crank']
    x, y = s['reaction.crank_coupler.x'], s['reaction.crank_coupler.y']
    pin = 0.064 * (np.cos(th2) * y - np.sin(th2) * x)
    weight = 0.6095 * 9.8145 * 0.009 * np.cos(th2)
    np.testing.assert_allclose(s['drive_torque'], pin + weight, atol=1e-12)


def test_all_weights_and_inertias_reach_the_ground(seated):
    s = without_work(seated, np.linspace(0.005, 0.16, 4001))
    t = s['t']
    z = {k: np.exp(1j * s[f'position.{k}']) for k in LINKS}
    momentum = np.zeros(len(t), dtype=complex)
    for mass, cog, link, carried in (
        (0.6095, 0.009, 'crank', 0.0), (0.2439, 0.185, 'coupler', 0.064),
        (0.2334, 0.134, 'rocker', 0.0),
    ):  # fmt: skip
        rate = cog * s[f'velocity.{link}'] * z[link] + carried * SPEED * z['crank']
        momentum += 1j * mass * rate
    push = CubicSpline(t, momentum)(t, 1)[50:-50]
    ground = s['reaction.ground_crank.x'] + 1j * s['reaction.ground_crank.y']
    ground = ground - (s['reaction.rocker_ground.x'] + 1j * s['reaction.rocker_ground.y'])
    weight = -1j * 9.8145 * (0.6095 + 0.2439 + 0.2334)
    assert np.abs(push - (ground[50:-50] + weight)).max() < 1e-4


def test_books_of_a_later_part_start_where_the_earlier_ones_ended(run):
    """A stream forgets what it has published; its balance go on."""
    c, half = run.motion.curve, len(run.motion) // 2
    later = type(run.motion)(
        type(c)(*(x[half:] for x in (c.start, c.start_low, c.duration, c.turns, c.coefficients))),
        run.motion.modes[half:],
        run.motion.approach[half:],
        run.motion.torques[half:],
    )
    begin = c.start[half]
    so_far = run.sample(np.nextafter(begin, 0.0), 'energy.drive_work', 'energy.dissipated')
    impacts = [i for i in run.impacts if i.t >= begin]
    work = type(run.balance.work)(*(x[half:] for x in run.balance.work))
    balance = EnergyTerms(
        work, impacts, so_far['energy.drive_work'][0],
        so_far['energy.dissipated'][0],
    )  # fmt: skip
    t = np.linspace(begin, run.duration, 100)
    part = type(run)(**(vars(run) | {'motion': later, 'balance': balance}))
    for name in ('energy.drive_work', 'energy.dissipated', 'position.rocker'):
        np.testing.assert_allclose(
            part.sample(t, name)[name], run.sample(t, name)[name], atol=1e-12
        )


def test_segments_alike_are_told_of_any_part_and_of_very_many(monkeypatch):
    """Turn by turn those of an ideal machine; of what is not remembered each is by itself."""
    solution = ms.simulate(ms.load_scene('four_bar_nominal'), revolutions=3)
    motion, every = solution.motion, np.arange(len(solution.motion))
    whole = motion.alike(every)
    assert len(set(whole)) < 0.5 * len(every)
    part = every[len(every) // 2 :]
    numbers = motion.alike(part)
    assert ((numbers[:, None] == numbers) == (whole[part][:, None] == whole[part])).all()
    monkeypatch.setattr('mechanism_sim.engine.dense_output._KEYS', 7)
    np.testing.assert_array_equal(motion.alike(every), whole)
    monkeypatch.setattr('mechanism_sim.engine.dense_output._REMEMBERED', 3)
    few = motion.alike(every)
    np.testing.assert_array_equal(few[whole < 3], whole[whole < 3])
    assert len(set(few[whole >= 3])) == (whole >= 3).sum()
