"""Piecewise polynomials: evaluation, boundaries, whole turns, fits and shifts."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf
from numpy.polynomial import Polynomial

from mechanism_sim.numerics.polynomials import (
    Nodes,
    PiecewisePolynomial,
    chebyshev_nodes,
    evaluate,
    fit_powers,
    gauss_nodes,
    shift_powers,
)

RNG = np.random.default_rng(5)
STARTS = np.array([0.0, 0.25, 0.75, 2.0])
DURATIONS = np.array([0.25, 0.5, 1.25, 1.0])


@pytest.fixture
def curve():
    return PiecewisePolynomial(
        STARTS, np.zeros(4), DURATIONS, np.zeros((4, 3), dtype=np.int64),
        RNG.normal(size=(4, 3, 6)),
    )  # fmt: skip


@pytest.mark.parametrize('derivative', [0, 1, 2, 5, 6])
def test_values_and_derivatives_agree_with_numpy_polynomials(curve, derivative):
    t = np.linspace(0.0, 3.0, 101)
    got = curve(t, derivative)
    for row, x in zip(got, t, strict=True):
        k = max(i for i in range(4) if STARTS[i] <= x)
        exact = [Polynomial(c).deriv(derivative)(x - STARTS[k]) for c in curve.coefficients[k]]
        np.testing.assert_allclose(row, exact, rtol=1e-13, atol=1e-12)


def test_a_boundary_belongs_to_the_later_segment_and_the_end_to_the_last(curve):
    assert curve.locate(STARTS).tolist() == [0, 1, 2, 3]
    assert curve.locate(np.nextafter(STARTS[1:], 0.0)).tolist() == [0, 1, 2]
    assert curve.locate(np.array([3.0])).tolist() == [3]
    np.testing.assert_array_equal(curve(STARTS), curve.coefficients[:, :, 0])


def test_many_times_in_each_segment_are_the_same_as_one_by_one(curve):
    segments = np.array([2, 0, 3])
    dt = RNG.uniform(0.0, 0.2, (3, 5))
    flat = curve.at(np.repeat(segments, 5), dt.ravel(), 1)
    np.testing.assert_allclose(curve.at(segments, dt, 1), flat, rtol=1e-14)


@pytest.mark.parametrize('shape', [(3,), (3, 5), Nodes((0.0, 0.3, 1.0))])
def test_several_derivatives_at_once_are_those_asked_for_one_by_one(curve, shape):
    segments = np.array([2, 0, 3])
    dt = shape if isinstance(shape, Nodes) else RNG.uniform(0.0, 0.2, shape)
    for found, d in zip(curve.locals(segments, dt, (2, 0, 1)), (2, 0, 1), strict=True):
        np.testing.assert_array_equal(found, curve.local(segments, dt, d))


@pytest.mark.parametrize('shape', [(3,), (3, 5), (0,)])
def test_machine_code_has_the_bits_of_array_operations(curve, shape, monkeypatch):
    segments = np.array([2, 0, 3])[: shape[0]]
    dt = RNG.uniform(-0.1, 0.2, shape)
    orders = (0, 3, 1, 7)
    monkeypatch.setattr(evaluate, 'run', evaluate.function)
    plain = curve.locals(segments, dt, orders)
    evaluate.compile()
    assert evaluate.is_compiled
    for compiled, arrays in zip(curve.locals(segments, dt, orders), plain, strict=True):
        np.testing.assert_array_equal(compiled, arrays)


@pytest.mark.parametrize('t', [-1e-9, 3.0 + 1e-9, np.nan])
def test_a_time_outside_is_refused_with_the_interval(curve, t):
    with pytest.raises(ValueError, match=r'outside of the solution.*solved \[0, 3\] s'):
        curve(np.array([1.0, t]))


def test_rounding_at_either_end_is_not_outside(curve):
    curve(np.array([np.nextafter(3.0, 4.0), np.nextafter(0.0, -1.0)]))


def test_nothing_can_be_sampled_where_there_is_nothing():
    empty = PiecewisePolynomial(
        np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 1), dtype=np.int64),
        np.zeros((0, 1, 2)),
    )  # fmt: skip
    with pytest.raises(ValueError, match='the solution is empty'):
        empty(np.array([0.0]))


def test_whole_turns_count_in_the_angle_and_in_no_derivative():
    turns = np.array([[7, 0]], dtype=np.int64)
    curve = PiecewisePolynomial(
        np.zeros(1), np.zeros(1), np.ones(1), turns, np.array([[[0.5, 2.0], [0.25, 1.0]]])
    )
    np.testing.assert_allclose(curve(np.array([0.5]))[0], [1.5 + 14.0 * np.pi, 0.75], rtol=1e-15)
    np.testing.assert_array_equal(curve(np.array([0.5]), 1)[0], [2.0, 1.0])


def test_the_low_part_of_a_start_is_not_lost():
    low = 3e-17
    curve = PiecewisePolynomial(
        np.array([0.3]), np.array([low]), np.array([1.0]), np.zeros((1, 1), dtype=np.int64),
        np.array([[[0.0, 1e10]]]),
    )  # fmt: skip
    assert curve(np.array([0.3]))[0, 0] == -1e10 * low


@given(st.lists(st.floats(-10, 10), min_size=1, max_size=7), st.floats(-2, 2))
def test_a_shifted_polynomial_is_the_binomial_expansion(coefficients, by):
    exact, x = [Fraction(c) for c in coefficients], Fraction(by)
    moved = [
        float(sum(comb(k, j) * c * x ** (k - j) for k, c in enumerate(exact) if k >= j))
        for j in range(len(exact))
    ]
    got = shift_powers(np.array([coefficients]), np.array([by]))[0]
    scale = sum(map(abs, coefficients)) * (1.0 + abs(by)) ** len(coefficients)
    np.testing.assert_allclose(got, moved, rtol=0, atol=4e-16 * scale + 1e-300)


def test_rows_are_shifted_each_by_its_own_amount():
    rows, by = RNG.normal(size=(4, 5)), np.array([0.0, 0.5, -1.0, 3.0])
    t = 0.7
    for row, x, moved in zip(rows, by, shift_powers(rows, by), strict=True):
        assert Polynomial(moved)(t - x) == pytest.approx(Polynomial(row)(t), rel=1e-12)


def test_gauss_nodes_integrate_every_polynomial_of_degree_2n_minus_1_exactly():
    x, w = gauss_nodes(6)
    for k in range(12):
        assert w @ x**k == pytest.approx(1.0 / (k + 1), rel=1e-14)
    assert abs(w @ x**12 - 1.0 / 13.0) > 1e-9


def test_a_fit_goes_through_its_nodes_and_recovers_a_polynomial():
    width = 0.37
    powers = RNG.normal(size=(2, 9)) / width ** np.arange(9)
    nodes = width * chebyshev_nodes(9)
    fitted = fit_powers(np.array([Polynomial(p)(nodes) for p in powers]), width)
    for p, q in zip(powers, fitted, strict=True):
        for t in (nodes, np.linspace(0.0, width, 50)):
            np.testing.assert_allclose(Polynomial(q)(t), Polynomial(p)(t), atol=1e-14)


def test_a_fit_of_a_smooth_function_reaches_rounding():
    """exp on [0, 0.1]: the interpolation error of degree 14 is 1e-29, what is left is rounding."""
    width, nodes = 0.1, chebyshev_nodes(15)
    fitted = fit_powers(np.exp(width * nodes), width)
    t = np.linspace(0.0, width, 400)
    with mp.workdps(30):
        exact = np.array([float(mp.exp(mpf(float(x)))) for x in t])
    assert np.abs(Polynomial(fitted)(t) - exact).max() < 2e-15


def test_chebyshev_nodes_are_the_roots_of_the_chebyshev_polynomial():
    roots = np.sort(np.polynomial.Chebyshev.basis(7, domain=[0, 1]).roots().real)
    np.testing.assert_allclose(chebyshev_nodes(7), roots, atol=1e-15)


def test_values_at_many_instants_are_those_at_each(curve):
    """Coefficients are gathered block by block: no bit depends on how many instants there are."""
    t = np.sort(RNG.uniform(0.0, 3.0, 5000))
    for derivative in range(3):
        many = curve(t, derivative)
        one_by_one = np.concatenate([curve(t[k : k + 1], derivative) for k in range(len(t))])
        assert np.array_equal(many, one_by_one)
    k, dt = curve.within(np.sort(RNG.uniform(0.0, 0.2, (1500, 2)), axis=1))
    rows = np.concatenate([curve.local(k[i : i + 1], dt[i : i + 1]) for i in range(len(k))])
    assert np.array_equal(curve.local(k, dt), rows)
