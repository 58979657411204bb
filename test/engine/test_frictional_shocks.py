"""Friction that jams contacts: impacts without collision, one and several contacts."""

from __future__ import annotations

import heyoka as hy
import numpy as np
import pytest
import scipy.linalg
from builders import made

import mechanism_sim as ms
from mechanism_sim.engine.contact.impact import jam, jam_margin, shock, stop_slide
from mechanism_sim.engine.contact.problem import ContactArrays, problem_of
from mechanism_sim.engine.events import gains
from mechanism_sim.numerics.symbolic import cramer
from test.grid.run import grid


def test_a_single_shock_is_the_painleve_impact():
    Ann, Ant, Att, mu, vt = 1.0, 0.9, 1.2, 1.5, 0.3
    (blow,) = shock([[Ann, Ant], [Ant, Att]], [0.0, vt], [-1.0, 0.0], [mu])
    assert blow[:2] == pytest.approx(jam(Ann, Ant, Att, vt, mu)[:2], rel=1e-12)
    p, q, _ = blow
    # vn stays at zero, the slip ends, and friction keeps to its cone
    assert Ann * p + Ant * q == pytest.approx(0.0, abs=1e-15)
    assert vt + Ant * p + Att * q == pytest.approx(0.0, abs=1e-15)
    assert abs(q) <= mu * p


@pytest.mark.parametrize('m', [2])
def test_shocks_of_several_contacts_keep_to_the_laws_and_never_make_energy(m):
    rng = np.random.default_rng(m)
    found = 0
    for _ in range(40):
        J = rng.normal(size=(2 * m, 2 * m + 1))
        A = J @ J.T
        slip = rng.normal(size=m)
        friction = rng.uniform(0.5, 3.0, m)
        # of which one is known to jam
        friction[0] = np.inf
        rate = np.concatenate([np.zeros(m), slip])
        acceleration = np.concatenate([-rng.uniform(0.5, 2.0, m), rng.normal(size=m)])
        try:
            blows = shock(A.tolist(), rate.tolist(), acceleration.tolist(), friction.tolist())
        except ArithmeticError:
            continue
        found += 1
        p, q = (np.array([b[k] for b in blows]) for k in (0, 1))
        x = np.concatenate([p, q])
        after = rate + A @ x
        size = 1e-8 * np.abs(rate).max()
        assert p.min() >= 0.0
        assert after[:m].min() >= -size
        assert np.abs(p * after[:m]).max() <= size * max(1.0, p.max())
        limited = np.isfinite(friction)
        assert (np.abs(q) <= friction * p * (1.0 + 1e-3) + size)[limited].all()
        assert x @ (rate + after) <= 1e-9 * np.abs(x).max() * np.abs(rate).max()
    assert found > 5


@pytest.mark.slow
def test_sliding_whose_force_grows_without_end_stops_by_a_shock():
    """A joint of the ten links, at mu = 0.3: it ended with a hundredth of its energy missing."""
    clearance = {
        'radial': 2.54e-4, 'restitution': 0.5, 'friction': 0.3, 'hypothesis': 'stronge',
        'pin_radius': 0.0,
    }  # fmt: skip
    overrides = {
        'joints.drag_link_crank.clearance': clearance, 'start': 'centred', 'drive.speed': 6.28,
    }  # fmt: skip
    solution = ms.simulate(ms.load_scene('ten_links', overrides), duration=0.15)
    shocks = [i for i in solution.impacts if i.approach_speed < 1e-9 and i.energy_loss > 1e-5]
    assert [i.t for i in shocks] == pytest.approx([0.135438], abs=1e-5)
    assert max(gains(solution.impacts)) < 1e-15
    energy = solution.energy
    exchanged = abs(energy.initial) + abs(energy.drive_work) + energy.dissipated
    assert abs(energy.residual) < 1e-8 * exchanged


def _play(friction: float | str, radial: float, pin_radius: float) -> dict[str, object]:
    return {
        'radial': radial, 'restitution': 0.2, 'friction': friction, 'hypothesis': 'newton',
        'pin_radius': pin_radius,
    }  # fmt: skip


def _balanced(solution: ms.Solution) -> bool:
    energy = solution.energy
    exchanged = abs(energy.initial) + abs(energy.drive_work) + energy.dissipated
    return bool(abs(energy.residual) < 1e-9 * exchanged)


@pytest.mark.slow
def test_sliding_that_jams_at_a_finite_force_is_stopped():
    """At a Genot-Brogliato point the force is 0/0: beyond it, contacts pulled with -9 kN."""
    overrides = {
        'joints.crank_coupler.clearance': _play(3.0, 2.54e-4, 0.01),
        'joints.rocker_ground.clearance': _play(3.0, 5e-5, 0.005),
        'joints.coupler_rocker': None, 'drive.speed': 120.0,
    }  # fmt: skip
    solution = ms.simulate(ms.load_scene('four_bar_clearance', overrides), revolutions=1)
    assert _balanced(solution)
    assert max(gains(solution.impacts)) < 1e-15


@pytest.mark.slow
def test_four_rough_joints_do_not_chatter_at_the_scale_of_rounding():
    """At 0.0188 s they struck each other 5e9 times a second, from heights of 1e-16 m."""
    joints = {'crank_coupler': 0.01, 'ground_crank': 0.005, 'coupler_rocker': 0.01,
              'rocker_ground': 0.005}  # fmt: skip
    overrides = {
        f'joints.{name}.clearance': _play('rough', 2.54e-4, pin) for name, pin in joints.items()
    }
    overrides |= {'drive.speed': 120.0, 'gravity': [0.0, 0.0]}
    solution = ms.simulate(ms.load_scene('four_bar_clearance', overrides), duration=0.0195)
    assert _balanced(solution)
    assert len(solution.impacts) < 3000


def test_rates_are_kept_though_a_rounding_of_positions_turns_the_normal():
    """In a clearance of 1 um they came out 4e-12 m/s off, and slips never counted as ended."""
    name = 'four_bar_friction_059'
    (case,) = grid(only=[name])
    run = made(case.draft().scene, name).start()
    run.advance(0.0045, final=True)
    for ulps in (1, 3, -2):
        run._state[1] += ulps * np.spacing(run._state[1])
        run._present.project()
        assert run._gaps.closed(0)
        assert abs(run._gaps.terms().rate[0]) < 1e-14


@pytest.mark.parametrize('m', [1, 2, 3])
def test_sliding_is_stopped_by_impulses_that_keep_all_contacts(m):
    rng = np.random.default_rng(m)
    found = 0
    for _ in range(200):
        J = rng.normal(size=(2 * m, 2 * m + 1))
        A = J @ J.T
        slip = np.sign(rng.normal(size=m))
        speed = slip * rng.uniform(0.1, 1.0, m)
        # the coefficient at which the equations of the forces are singular
        N, T = A[:m, :m], A[:m, m:] * slip
        jamming = [x.real for x in scipy.linalg.eigvals(N, T) if not x.imag and x.real > 0.0]
        if not jamming:
            continue
        mu = min(jamming)
        rate = np.concatenate([np.zeros(m), speed])
        assert jam_margin(A, [mu] * m, slip) == pytest.approx(0.0, abs=1e-9)
        try:
            blows = stop_slide(A, rate, [mu] * m, slip)
        except ArithmeticError:
            continue
        found += 1
        x = np.array([[b.normal for b in blows], [b.tangential for b in blows]]).ravel()
        after = rate + A @ x
        assert x[:m].min() >= -1e-9 * x[:m].max()
        assert np.abs(after[:m]).max() < 1e-9
        # one slip has stopped, the others go on; friction is that of slipping
        assert np.sort(slip * after[m:])[0] == pytest.approx(0.0, abs=1e-9)
        assert x[m:] == pytest.approx(-mu * slip * x[:m], rel=1e-6, abs=1e-9)
        assert x @ (rate + after) < 0.0
    assert found > 5


@pytest.mark.parametrize('n', [1, 2, 3, 4])
def test_cramers_rule_needs_no_pivots(n):
    rng = np.random.default_rng(n)
    A, b = rng.normal(size=(n, n)), rng.normal(size=n)
    if n > 1:
        A[0, 0] = 0.0
    symbols = [[hy.make_vars(f'a{i}{k}') for k in range(n)] for i in range(n)]
    right = [hy.make_vars(f'b{i}') for i in range(n)]
    x, det = cramer(symbols, right)
    given = [*(s for row in symbols for s in row), *right]
    found = hy.cfunc([*x, det], given)([*A.ravel(), *b])
    assert found[:n] == pytest.approx(np.linalg.solve(A, b), rel=1e-10)
    assert found[n] == pytest.approx(np.linalg.det(A), rel=1e-10)


LOOSE = {
    'four_bar_clearance': ('ground_crank', 'crank_coupler', 'coupler_rocker', 'rocker_ground'),
    'ten_links': (
        'crank_upper_rod', 'crank_lower_rod', 'upper_rod_shoulder', 'lower_rod_strut',
        'shoulder_shank', 'shank_foot', 'strut_foot',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', LOOSE)
def test_forces_of_many_contacts_are_those_of_a_dense_solution(name):
    """Of any mix of open, sticking and sliding contacts, few and many, some without friction."""
    loose = {'radial': '0.1 mm', 'restitution': 0.5}
    clearances = {j: loose | {'friction': 0.2 * (j != LOOSE[name][1])} for j in LOOSE[name]}
    machine = ms.load_scene(name, {f'joints.{j}.clearance': c for j, c in clearances.items()})
    system = machine.equations.system
    dynamics, m = system.dynamics, len(system.gaps)
    mu, frictional = np.array(dynamics.contacts.friction), dynamics.contacts.frictional
    assert 0 < len(frictional) < m
    margin = system.run.compile_now([dynamics.exact.jam_margin])
    sliding = dynamics.sliding
    assert not sliding.sticks
    forces_alone = system.run.compile_now([*sliding.N, *sliding.T, sliding.jam_margin])
    rng = np.random.default_rng(3)
    for k in range(20):
        state = rng.uniform(-1.0, 1.0, 2 * len(system.free))
        parameters = np.array(system.parameters.values)
        modes = rng.integers(0, 4, m)  # open, sticking, sliding either way
        modes[((mu == 0.0) | (k % 2 == 0)) & (modes == 1)] = 2
        slips = np.choose(modes, [0.0, 0.0, 1.0, -1.0])
        parameters[system.parameters.closed] = modes > 0
        parameters[system.parameters.sticks] = modes[frictional] == 1
        parameters[system.parameters.slips] = slips[frictional]
        inputs = np.array([*state, *parameters, 0.3])
        seen = system.functions.contact_function(inputs)
        terms = problem_of(
            ContactArrays(seen, system.contact_layout, np.zeros((2, m)), *[None] * 2)
        )
        C, free = terms.compliance, terms.free_acceleration
        normal, stuck = np.flatnonzero(modes > 0), m + np.flatnonzero(modes == 1)
        rows = np.concatenate([normal, stuck])
        follow = np.zeros((2 * m, len(rows)))  # all forces by those that are unknown
        follow[rows, np.arange(len(rows))] = 1.0
        smooth = C[np.ix_(rows, rows)]
        follow[m + normal, np.arange(len(normal))] -= (mu * slips)[normal]
        kept = (C @ follow)[rows]
        forces = follow @ np.linalg.solve(kept, -free[rows])
        assert terms.acceleration == pytest.approx(free + C @ forces, rel=1e-7, abs=1e-6)
        wanted = np.linalg.det(kept) / np.linalg.det(smooth)
        assert margin(inputs)[0] == pytest.approx(wanted, rel=1e-7)
        if k % 2 == 0:  # nothing sticks; parameters ask for no stabilisation
            *alone, last = forces_alone(inputs)
            assert alone == pytest.approx(forces, rel=1e-7, abs=1e-7 * np.abs(forces).max())
            assert last == pytest.approx(wanted, rel=1e-7)
