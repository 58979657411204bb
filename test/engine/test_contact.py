"""Impulses of simultaneous contacts, and the end of chatter."""

from __future__ import annotations

import numpy as np
import pytest
from blows import ImpactLaw, simultaneous_impact
from hypothesis import given
from hypothesis import strategies as st

from mechanism_sim.engine.contact.chatter import ChatterRule, remaining_time
from mechanism_sim.engine.contact.problem import horizon_of
from mechanism_sim.numerics.complementarity import solve_frictional_lcp


def padded(A, b):
    """With tangents that no contact has."""
    m = len(b)
    return np.pad(np.asarray(A, float), (0, m)), np.pad(np.asarray(b, float), (0, m))


def frictionless(A, b):
    """Normal impulses (m,) without friction."""
    return solve_frictional_lcp(*padded(A, b), [0.0] * len(b))[0][: len(b)]


def newton_impulses(A, rate, restitution):
    """Normal impulses of frictionless contacts in impact."""
    laws = [ImpactLaw(e) for e in restitution]
    return [blow.normal for blow in simultaneous_impact(*padded(A, rate), laws)]


@st.composite
def problems(draw, least=1):
    m = draw(st.integers(least, 4))
    row = st.lists(st.floats(-1, 1), min_size=5, max_size=5)
    rows = draw(st.lists(row, min_size=m, max_size=m))
    J = np.array(rows)
    A = J @ J.T + 1e-3 * np.eye(m)
    b = np.array(draw(st.lists(st.floats(-2, 2), min_size=m, max_size=m)))
    return A, b


@given(problems())
def test_complementarity_holds_of_what_is_solved(problem):
    A, b = problem
    x = np.array(frictionless(A, b))
    gap = A @ x + b
    scale = 1.0 + np.abs(b).max()
    assert (x >= 0.0).all()
    assert gap.min() > -1e-11 * scale
    assert np.abs(x * gap).max() < 1e-9 * scale * (1.0 + x.max())


@given(problems(least=2))
def test_the_solution_minimises_the_energy_of_the_contact(problem):
    """A second route: projected Gauss-Seidel on ``x A x/2 + b x`` over ``x >= 0``."""
    A, b = problem
    x = np.array(frictionless(A, b))

    def energy(y):
        return 0.5 * y @ A @ y + b @ y

    y = np.zeros(len(b))
    for _ in range(300):
        for i in range(len(b)):
            y[i] = max(0.0, y[i] - (A[i] @ y + b[i]) / A[i, i])
    assert energy(x) <= energy(y) + 1e-9


@given(st.floats(0.1, 10.0), st.floats(1e-6, 5.0), st.floats(0.0, 1.0))
def test_a_single_contact_rebounds_by_newtons_coefficient(compliance, speed, e):
    (p,) = newton_impulses(np.array([[compliance]]), [-speed], [e])
    assert p == pytest.approx((1.0 + e) * speed / compliance, rel=1e-14)
    assert -speed + compliance * p == pytest.approx(e * speed, abs=1e-14 * speed + 1e-18)


def test_a_separating_contact_gets_no_impulse():
    assert newton_impulses(np.array([[2.0]]), [0.3], [0.5]) == [0.0]


@given(problems(least=2), st.floats(0.0, 1.0))
def test_equal_restitution_never_creates_energy(problem, e):
    A, v = problem
    rate = np.minimum(v, 0.0)
    p = np.array(newton_impulses(A, rate, [e] * len(v)))
    gained = p @ (rate + 0.5 * A @ p)
    assert gained < 1e-9


def test_chatter_ends_where_what_is_left_out_is_below_the_tolerance():
    """A ball of rebound speed v under a: all bounces to come are replaced by rest at once."""
    size, rtol, a, e = 0.4, 1e-8, 50.0, 0.5
    rule = ChatterRule(rtol, 0.0, size)
    v = np.sqrt(2.0 * a * 0.01 * rtol * size * (1.0 - e))
    assert rule.ends(0.999 * v, -a, e)
    assert not rule.ends(1.001 * v, -a, e)
    # displacement left out: the bounces' mean height times their duration, felt as an impulse
    left_out = sum(2.0 * (v * e**k) ** 2 / (2.0 * a) for k in range(60))
    assert left_out < 0.02 * rtol * size


@pytest.mark.parametrize('acceleration', [0.0, 1e-9, 30.0])
def test_chatter_never_ends_where_nothing_presses(acceleration):
    assert not ChatterRule(1e-4, 1e-3, 1.0).ends(1e-12, acceleration, 0.5)


@pytest.mark.parametrize('restitution', [1.0, 1.0 - 1e-12, 0.999])
def test_elastic_bounces_end_only_near_rounding(restitution):
    """Whatever the tolerance: they cost no energy; but for ever they are not resolved."""
    rule = ChatterRule(1e-12, 0.0, 0.4)
    assert not rule.ends(np.sqrt(2.0 * 50.0 * 1e-12), -50.0, restitution)
    assert rule.ends(np.sqrt(2.0 * 50.0 * 1e-13), -50.0, restitution)


def test_elastic_bounces_do_not_end_by_a_wide_tolerance():
    assert not ChatterRule(1e-3, 1e-3, 0.4).ends(np.sqrt(2.0 * 50.0 * 1e-12), -50.0, 1.0)


def test_an_absolute_tolerance_and_a_violated_gap_end_chatter_too():
    v = np.sqrt(2.0 * 50.0 * 1e-9)
    assert not ChatterRule(1e-12, 0.0, 0.4).ends(v, -50.0, 0.5)
    assert ChatterRule(1e-12, 1e-8, 0.4).ends(v, -50.0, 0.5)
    assert ChatterRule(1e-12, 0.0, 0.4).ends(v, -50.0, 0.5, depth=1e-9)


@given(st.floats(1e-9, 1e-3), st.floats(0.1, 100.0), st.floats(0.05, 1.95), st.floats(2.05, 4.0))
def test_a_bounce_counts_if_it_rises_farther_than_the_gap_was_violated(depth, a, low, high):
    """It begins that deep: what tops less than as far above zero is the last one."""
    rule = ChatterRule(1e-12, 0.0, 1e-9)

    def top(v):
        return -depth + v * (v / a) - 0.5 * a * (v / a) ** 2

    for rise, last in ((low, True), (high, False)):
        v = np.sqrt(2.0 * a * rise * depth)
        assert (top(v) < depth) == last  # of the flight itself
        assert rule.ends(v, -a, 0.5, depth) == last


@pytest.mark.parametrize(('rebound', 'fall'), [(0.3, 9.81), (2e-6, 4e3)])
def test_no_step_is_longer_than_a_hundred_flights_that_fall_back_steadily(rebound, fall):
    """Off the powers of two, at which roots are looked for; what does not fall back has none."""
    flight = max(np.roots([-0.5 * fall, rebound, 0.0]))
    assert 99.0 < horizon_of(rebound, -fall) / flight < 101.0
    assert horizon_of(rebound, fall) == horizon_of(-rebound, -fall) == np.inf


@pytest.mark.parametrize('restitution', [0.0, 0.3, 0.95])
def test_bounces_that_are_left_out_last_as_long_as_all_their_flights(restitution):
    rebound, fall, left, speed = 0.2, 9.81, 0.0, 0.2
    while speed > 1e-18:
        left, speed = left + 2.0 * speed / fall, restitution * speed
    assert remaining_time(rebound, -fall, restitution) == pytest.approx(left, rel=1e-12)
    assert remaining_time(rebound, fall, restitution) == remaining_time(rebound, -fall, 1.0) == 0
    assert remaining_time(-1e-16, -fall, restitution) == 0
