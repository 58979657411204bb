"""The loose four-bar against runs in 256-bit arithmetic by a power series of order 64.

Where neighbouring trajectories separate (e = 1: 1.8-fold per impact) only the part is compared
pointwise which double precision can hold at all; the reference says how a small error grows.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from four_bars import LINKS, TURN, loose, reference

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode

RUNS = {
    'centred_e05': ('centred', 0.5, 1.0),
    'centred_e01': ('centred', 0.1, 1.0),
    'seated_e05': ('seated', 0.5, 2.25),
    'centred_e1': ('centred', 1.0, 1.0),
}
REGULAR = ('centred_e05', 'centred_e01', 'seated_e05')
ULP = 2.2e-16


@cache
def run(name, rtol=1e-12):
    start, e, turns = RUNS[name]
    return ms.simulate(loose(e, start, rtol), revolutions=turns)


def errors(name, rtol=1e-12):
    """Times of the samples, and the errors of angles and rates there."""
    solution, ref = run(name, rtol), reference(f'four_bar_{name}')['states']
    t = np.minimum(ref['t'], solution.duration)
    seen = solution.sample(t)
    angle = [np.abs(seen[f'position.{k}'] - ref[c]) for k, c in zip(LINKS[1:], ('th3', 'th4'))]  # noqa: B905
    rate = [np.abs(seen[f'velocity.{k}'] - ref[c]) for k, c in zip(LINKS[1:], ('w3', 'w4'))]  # noqa: B905
    return t, np.max(angle, axis=0), np.max(rate, axis=0)


@pytest.mark.parametrize('name', REGULAR)
def test_angles_and_rates_are_right_to_rounding_at_fine_tolerance(name):
    _, angle, rate = errors(name, 1e-12)
    assert angle.max() < 3e-13
    assert rate.max() < 3e-10


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', REGULAR)
def test_errors_shrink_with_the_tolerance_across_all_events(name):
    tolerances = (1e-4, 1e-6, 1e-8, 1e-10)
    worst = [errors(name, rtol)[1].max() for rtol in tolerances]
    order = np.polyfit(np.log(tolerances), np.log(worst), 1)[0]
    assert order > 1.0
    assert all(e < 10.0 * rtol for e, rtol in zip(worst, tolerances, strict=True))


@pytest.mark.parametrize('name', REGULAR)
def test_every_impact_above_the_cut_of_chatter_is_there_at_its_time(name):
    ref = reference(f'four_bar_{name}')['impacts']
    mine = [i for i in run(name).impacts if i.approach_speed > 1e-4]
    theirs = ref['approach_speed'] > 1e-4
    assert len(mine) == theirs.sum()
    columns = ('t', 'approach_speed', 'normal_impulse', 'normal_angle', 'energy_loss')
    for column, tolerance in zip(columns, (None, 1e-9, 1e-9, 1e-9, 1e-11), strict=True):
        got = np.array([getattr(i, column) for i in mine])
        error = np.abs(got - ref[column][theirs])
        # a rounding of the position moves a slow impact most
        allowed = tolerance or 3e-13 + 3e-16 / ref['approach_speed'][theirs]
        assert (error < allowed).all(), column


def test_impacts_inside_one_chatter_sequence_follow_one_by_one():
    """All but the last, which stands for those that are left out."""
    ref = reference('four_bar_centred_e05')['impacts']
    mine = run('centred_e05').impacts
    assert [i.ends_chatter for i in mine] == [False] * (len(mine) - 1) + [True]
    n = len(mine) - 1
    speeds = np.array([i.approach_speed for i in mine[:n]])
    np.testing.assert_allclose(speeds, ref['approach_speed'][:n], rtol=1e-9, atol=1e-9)
    assert np.abs(np.array([i.t for i in mine[:n]]) - ref['t'][:n]).max() < 1e-11


@pytest.mark.parametrize('name', REGULAR)
def test_modes_follow_each_other_as_in_the_reference(name):
    ref = reference(f'four_bar_{name}')['modes']
    mine = run(name).modes
    words = {Mode.FREE_FLIGHT: 'flight', Mode.FOLLOWING: 'following'}
    assert [words[m.mode] for m in mine] == list(ref['mode'])
    for m, t in zip(mine, ref['t'], strict=True):
        late = t - m.t
        if m.mode is Mode.FREE_FLIGHT:
            assert abs(late) < 1e-12
        else:  # following begins with the impact that ends chatter, a little before its limit
            assert -1e-12 < late < 2e-6


@pytest.mark.parametrize(
    ('rtol', 'allowed'),
    [(1e-4, 4e-5), (1e-6, 2e-7), (1e-8, 1e-10), (1e-10, 2e-12), (1e-12, 1e-12), (1e-13, 1e-12)],
)
def test_loss_of_contact_is_found_at_every_tolerance(rtol, allowed):
    ref = reference('four_bar_seated_e05')
    modes = run('seated_e05', rtol).modes
    losses = [m.t / TURN for m in modes[1:] if m.mode is Mode.FREE_FLIGHT]
    exact = ref['first_loss_of_contact']['revolutions']
    assert exact == pytest.approx(1.0358, abs=5e-5)
    assert abs(losses[0] - exact) < allowed
    assert len(losses) == 6


def test_smallest_contact_force_before_the_first_loss():
    ref = reference('four_bar_seated_e05')['smallest_contact_force']
    s = run('seated_e05')
    t = ref['t'] + np.linspace(-1e-5, 1e-5, 201)
    force = s.sample(t, 'normal_force.coupler_rocker')['normal_force.coupler_rocker']
    assert force.min() == pytest.approx(ref['normal_force'], rel=1e-8)
    assert ref['normal_force'] == pytest.approx(0.565, abs=5e-4)
    wide = s.sample(np.linspace(0.0, 1.03 * TURN, 4001), 'normal_force.coupler_rocker')[
        'normal_force.coupler_rocker'
    ]
    assert wide.min() > ref['normal_force'] - 1e-9


@pytest.mark.parametrize('name', REGULAR)
def test_energy_books_agree_with_the_reference(name):
    ref = reference(f'four_bar_{name}')['energy']
    mine = run(name).energy
    for key in ('initial', 'final', 'drive_work', 'dissipated'):
        assert abs(getattr(mine, key) - ref[key]) < 1e-11, key
    assert abs(mine.residual) < 2e-13


@pytest.mark.parametrize(
    ('name', 'impulse', 'left_out'),
    [
        ('centred_e05', 66.6e-3, 4e-6),
        ('centred_e01', 26.5e-3, 1e-6),
        ('seated_e05', 54.8e-3, 2e-5),
    ],
)
def test_normal_impulses_add_up_to_those_of_the_reference(name, impulse, left_out):
    """But for the chatter left out, which loses at most its last rebound's momentum each time."""
    ref = reference(f'four_bar_{name}')
    total = sum(i.normal_impulse for i in run(name).impacts)
    assert total == pytest.approx(impulse, rel=2e-3)
    assert 0.0 < ref['total_normal_impulse'] - total < left_out


# --- e = 1: chaos -----------------------------------------------------------------------------


def test_elastic_impacts_are_as_right_as_double_precision_allows():
    """The error at every sample is that of a start which is some roundings off."""
    growth = reference('four_bar_centred_e1')['growth_of_a_start_1e-20_rad_off_in_th4']
    for rtol in (1e-13, 1e-15):
        t, angle, _ = errors('centred_e1', rtol)
        possible = np.maximum.accumulate(growth['factor']) * 4.0 * ULP
        early = t < 0.5 * TURN
        assert (angle[early] < 20.0 * possible[early] + 1e-14).all()
        assert angle[t < 0.25 * TURN].max() < 1e-11
        assert angle[early].max() < 1e-7


def test_a_start_one_rounding_off_ends_as_far_away_as_the_reference():
    """So no tolerance brings e = 1 closer to the reference over a whole revolution."""
    machine = loose(1.0, rtol=1e-13)
    state = machine.initial_state()
    position = {'rocker': float(np.nextafter(state.q[1], 4.0)), 'coupler': state.q[0]}
    near = loose(
        1.0, rtol=1e-13, initial__position__rocker=position['rocker'],
        initial__position__coupler=position['coupler'],
    )  # fmt: skip
    other = ms.simulate(near, revolutions=1.0)
    ref = reference('four_bar_centred_e1')['states']
    t = np.minimum(ref['t'], other.duration)
    apart = np.abs(
        other.sample(t, 'position.rocker')['position.rocker']
        - run('centred_e1', 1e-13).sample(t, 'position.rocker')['position.rocker']
    )
    _, error, _ = errors('centred_e1', 1e-13)
    half = t < 0.5 * TURN
    assert apart[half].max() > 1e-11
    assert error[half].max() < 100.0 * apart[half].max()
    assert apart[~half].max() > 1e-6


def test_elastic_impacts_of_the_first_half_revolution_are_all_there():
    ref = reference('four_bar_centred_e1')['impacts']
    early = ref['t'] < 0.5 * TURN
    for rtol in (1e-13, 1e-15):
        mine = np.array([i.t for i in run('centred_e1', rtol).impacts])
        mine = mine[mine < 0.5 * TURN]
        assert len(mine) == early.sum()
        assert np.abs(mine - ref['t'][early]).max() < 1e-7


def test_elastic_impacts_of_a_revolution_in_number_and_impulse():
    """54 impacts, 1411 mN s together; beyond half a revolution only sums mean anything."""
    ref = reference('four_bar_centred_e1')
    assert len(ref['impacts']['t']) == 54
    for rtol in (1e-10, 1e-12, 1e-13, 1e-15):
        s = run('centred_e1', rtol)
        assert abs(len(s.impacts) - 54) <= 5
        assert sum(i.normal_impulse for i in s.impacts) == pytest.approx(1.411, rel=0.06)
        assert s.energy.dissipated == pytest.approx(0.0, abs=1e-15)
        assert abs(s.energy.residual) < 1e-12


def test_time_runs_backwards_where_nothing_is_lost():
    """Quarter of a revolution there and back, 13 impacts each way."""
    there = run('centred_e1', 1e-13)
    t = 0.25 * TURN
    seen = {k: float(v[0]) for k, v in there.sample(t).items()}
    back = loose(
        1.0, rtol=1e-13, drive__speed='-36.6519 rad/s', drive__start_angle=seen['position.crank'],
        initial__position__coupler=seen['position.coupler'],
        initial__position__rocker=seen['position.rocker'],
        initial__velocity__coupler=-seen['velocity.coupler'],
        initial__velocity__rocker=-seen['velocity.rocker'],
    )  # fmt: skip
    returned = ms.simulate(back, duration=t)
    forward = [i for i in there.impacts if i.t < t]
    assert len(returned.impacts) == len(forward) > 10
    for a, b in zip(forward, reversed(returned.impacts), strict=True):
        assert a.t == pytest.approx(t - b.t, abs=1e-9)
        assert a.normal_impulse == pytest.approx(b.normal_impulse, rel=1e-6)
    end = returned.sample(t)
    start = there.sample(0.0)
    for name in LINKS[1:]:
        assert abs(end[f'position.{name}'] - start[f'position.{name}'])[0] < 1e-9
        assert abs(end[f'velocity.{name}'] + start[f'velocity.{name}'])[0] < 1e-6
