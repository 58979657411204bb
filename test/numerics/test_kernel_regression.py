"""Kernel regression: what it says of samples left out, by leaving them out."""

from __future__ import annotations

import numpy as np
import pytest

from mechanism_sim.numerics.kernel_regression import KernelRegression, explained


def cases(n, seed, noise=0.05):
    """Five inputs that know about y, and twenty that do not."""
    rng = np.random.default_rng(seed)
    y = rng.uniform(-1.0, 1.0, n)
    known = np.column_stack([y, y**2, np.sin(2.0 * y), np.exp(y), y**3])
    known += noise * rng.normal(size=known.shape)
    return np.hstack([known, rng.normal(size=(n, 20))]), y


def test_left_out_predictions_are_those_of_smaller_systems():
    """A second route: the linear system without a row and a column, solved anew."""
    x, y = cases(40, 1)
    fit = KernelRegression(x, y)
    matrix = np.linalg.inv(fit._inverse)
    ridge_free = matrix.copy()
    np.fill_diagonal(ridge_free, 101.0)
    target = (y - y.mean()) / y.std()
    for i in (0, 17, 39):
        keep = np.arange(40) != i
        alpha = np.linalg.solve(matrix[np.ix_(keep, keep)], target[keep])
        predicted = y.mean() + y.std() * (ridge_free[i, keep] @ alpha)
        assert fit.left_out(x[i])[i] == pytest.approx(predicted, abs=1e-7)
        assert fit.residuals[i] == pytest.approx(y[i] - predicted, abs=1e-7)


def test_it_finds_a_function_among_noise():
    x, y = cases(80, 2)
    fit = KernelRegression(x, y)
    assert np.sqrt(np.mean(fit.residuals**2)) < 0.1 * y.std()


@pytest.mark.parametrize('level', [0.8, 0.95])
def test_intervals_hold_the_truth_as_often_as_they_say(level):
    x, y = cases(60, 3, noise=0.3)
    fit = KernelRegression(x, y)
    others, truths = cases(400, 4, noise=0.3)
    limits = np.array([fit.interval(other, level) for other in others])
    inside = np.mean((limits[:, 0] <= truths) & (truths <= limits[:, 1]))
    # of 60 samples the level itself is uncertain by 3 to 5 %
    assert inside == pytest.approx(level, abs=0.08)


def test_inputs_that_know_nothing_leave_all_open():
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(60, 10)), rng.uniform(-1.0, 1.0, 60)
    low, high = KernelRegression(x, y).interval(rng.normal(size=10))
    assert high - low > 1.6


def test_constant_inputs_and_strange_cases_do_no_harm():
    x, y = cases(40, 6)
    x[:, 7] = 1.0
    assert np.isfinite(KernelRegression(x, y).left_out(1e6 * np.ones(25))).all()


def test_explained_variance_is_that_of_a_parabola():
    y = np.linspace(-1.0, 1.0, 200)
    x = np.column_stack([y**2 - 3.0 * y, np.sin(40.0 * y), np.ones(200)])
    assert explained(x, y) == pytest.approx([1.0, 0.0, 0.0], abs=0.05)
