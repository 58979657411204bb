"""Integrals of many functions at once: right to the error they state, however they are batched."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import beta

from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.numerics.quadrature import Assumptions, Integrals, Parts, integrate, parts_of


class Functions:
    """Functions of time on consecutive intervals, and how often they were evaluated."""

    def __init__(self, edges, *functions):
        self.start, self.width = np.asarray(edges[:-1]), np.diff(edges)
        self.functions, self.count = functions, 0

    def __call__(self, k, dt):
        if not isinstance(dt, np.ndarray):
            dt = np.outer(self.width[k], dt.fractions)
        t = (self.start[k, None] + dt).ravel()
        self.count += t.size
        return np.array([f(t) for f in self.functions])

    def parts(self, first=0, last=None):
        k = np.arange(len(self.width))[first:last]
        return Parts(k, np.zeros(len(k)), self.width[k], np.ones(len(k), bool))

    def integrals(self, **options):
        return integrate(self, self.parts(), **options)


RUNGE = (math.atan(12.0) + math.atan(8.0)) / 20.0
CASES = {
    'smooth': (np.exp, math.e - 1.0),
    'oscillating': (lambda t: np.cos(40.0 * t), math.sin(40.0) / 40.0),
    'narrow': (lambda t: np.exp(-(((t - 0.3) / 0.01) ** 2)), 0.01 * math.sqrt(math.pi)),
    'pole beside': (lambda t: 1.0 / (1.0 + (20.0 * (t - 0.4)) ** 2), RUNGE),
    'corner': (lambda t: np.abs(t - 0.3333), (0.3333**2 + 0.6667**2) / 2.0),
    'jump': (lambda t: (t > 0.3333) * 1.0, 0.6667),
    'root': (np.sqrt, 2.0 / 3.0),
    'power 3/2': (lambda t: t**1.5, 0.4),
    'power 7/2': (lambda t: t**3.5, 1.0 / 4.5),
    'logarithm': (np.log, -1.0),
    'singular, integrable': (lambda t: t**-0.7, 1.0 / 0.3),
    'chirp': (
        lambda t: np.sin(1.0 / (t + 0.02)),
        quad(lambda t: math.sin(1.0 / (t + 0.02)), 0.0, 1.0, limit=500, epsabs=1e-14)[0],
    ),
}


@pytest.mark.parametrize('intervals', [1, 4, 7])
@pytest.mark.parametrize('name', CASES)
def test_an_integral_is_off_by_no_more_than_it_says(name, intervals):
    function, right = CASES[name]
    found = Functions(np.linspace(0.0, 1.0, intervals + 1), function).integrals()
    value, error = found.value.sum(), found.error.sum()
    assert abs(value - right) <= error
    if name != 'singular, integrable':
        middles = np.arange(0.5, 2000.0) / 2000.0
        assert error <= 2e-9 * np.abs(function(middles)).mean()


def test_what_is_resolved_is_evaluated_at_eight_places_only():
    f = Functions(np.linspace(0.0, 1.0, 101), np.exp, lambda t: np.cos(3.0 * t))
    f.integrals()
    assert f.count == 800


def test_what_cannot_be_integrated_is_said():
    edges = np.linspace(0.0, 1.0, 4)
    lost = Functions(edges, lambda t: np.where(t > 0.5, np.nan, 1.0)).integrals()
    assert np.isnan(lost.value[0, 1:]).all()
    assert np.isinf(lost.error[0, 1:]).all()
    assert lost.value[0, 0] == pytest.approx(1.0 / 3.0, rel=1e-14)
    grows = Functions(edges, lambda t: 1.0 / t).integrals()
    assert grows.error[0, 0] > 0.1 * grows.value[0, 0]


def test_noise_costs_a_bounded_number_of_evaluations_and_states_its_error():
    f = Functions([0.0, 1.0], lambda t: np.sin(1e9 * t))
    found = f.integrals()
    assert f.count < 2000
    assert abs(found.value[0, 0]) <= found.error[0, 0]


def test_noise_far_below_what_came_before_does_not_matter():
    edges = np.linspace(0.0, 2.0, 101)

    def function(t):
        return np.where(t < 1.0, np.cos(t), 2e-14 * np.sin(1e9 * t))

    f = Functions(edges, function)
    found = f.integrals()
    assert f.count == 800
    assert found.error.sum() < 1e-11


def test_powers_at_both_ends_of_an_interval():
    f = Functions([0.0, 1.0, 2.0], lambda t: (t % 1.0) ** 1.5 * (1.0 - t % 1.0) ** 0.5)
    found = f.integrals(powers=np.array([True, True]))
    assert found.value[0] == pytest.approx([beta(2.5, 1.5)] * 2, rel=1e-14)
    assert (np.abs(found.value - beta(2.5, 1.5)) <= found.error).all()
    assert found.error.max() < 1e-12


def test_results_do_not_depend_on_batches_nor_on_company():
    edges = np.cumsum(np.random.default_rng(1).uniform(0.001, 0.01, 1500))
    narrow = lambda t: np.exp(-(((t - 3.0) / 0.001) ** 2)) + 1e-6 * np.abs(np.sin(t))  # noqa: E731
    several = Functions(edges, np.sin, narrow, lambda t: np.sign(np.cos(9.0 * t)))
    whole = several.integrals()
    largest, pieces = None, []
    for first, last in ((0, 1), (1, 700), (700, None)):
        pieces.append(integrate(several, several.parts(first, last), largest=largest))
        largest = pieces[-1].largest
    value, error = (
        np.concatenate([getattr(piece, name) for piece in pieces], axis=1)
        for name in ('value', 'error')
    )
    assert np.array_equal(value, whole.value)
    np.testing.assert_allclose(error, whole.error, rtol=1e-12)
    alone = Functions(edges, narrow).integrals()
    assert np.array_equal(alone.value[0], whole.value[1])
    np.testing.assert_allclose(alone.error[0], whole.error[1], rtol=1e-12)


def test_a_window_has_the_parts_of_its_segments():
    start, width = np.array([1e6, 1e6, 1e6]), np.array([3e-11, 1e-10, 1.0])
    low = np.array([0.0, 3e-11, 1.3e-10])
    curve = PiecewisePolynomial(start, low, width, np.zeros((3, 1), np.int64), np.ones((3, 1, 1)))
    whole = parts_of(curve)
    assert whole.whole.all()
    assert np.array_equal(whole.end, width)  # steps shorter than the rounding of the time
    some = parts_of(curve, 1e6 + 0.25, 1e6 + 0.75)
    assert some.segment.tolist() == [2]
    assert not some.whole.any()
    assert (some.end - some.begin).tolist() == pytest.approx([0.5], abs=1e-9)
    nothing = integrate(Functions([0.0, 1.0], np.exp), parts_of(curve, 2e6))
    assert isinstance(nothing, Integrals)
    assert nothing.value.size == 0


FORETOLD = {
    'a pole as far as that of a Taylor step': (
        lambda t: 1.0 / (t + 0.74),
        lambda t: np.log(t + 0.74),
    ),
    'waves, three radians a step': (lambda t: np.cos(30.0 * t), lambda t: np.sin(30.0 * t) / 30.0),
    'a square that vanishes between': (
        lambda t: np.sin(15.0 * t) ** 2,
        lambda t: 0.5 * t - np.sin(30.0 * t) / 60.0,
    ),
}


@pytest.mark.parametrize('name', FORETOLD)
def test_what_steps_foretell_costs_one_evaluation_and_states_its_error(name):
    """Where coefficients are known to go on falling, none is doubted so far that steps are cut."""
    f, primitive = FORETOLD[name]
    edges = np.linspace(0.0, 1.0, 11)
    functions = Functions(edges, f)
    found = functions.integrals(assumed=Assumptions(foretold=True))
    assert functions.count == 8 * 10
    off = np.abs(found.value[0] - np.diff(primitive(edges)))
    assert (off <= found.error[0]).all()
    assert found.error.sum() < 1e-8 * found.size.sum()


def test_what_is_not_foretold_after_all_is_parted():
    """A corner is no series: its coefficients do not fall."""
    functions = Functions([0.0, 1.0], lambda t: np.abs(t - 0.3))
    found = functions.integrals(assumed=Assumptions(foretold=True))
    assert functions.count > 100
    assert abs(found.value[0, 0] - 0.29) <= found.error[0, 0] < 1e-8


def corner_under(amplitude, places):
    """A small corner on a large smooth function, at a place of each of many intervals."""

    def values(k, dt):
        t = dt if isinstance(dt, np.ndarray) else np.tile(dt.fractions, (len(k), 1))
        return (20.0 + np.sin(t) + amplitude * np.abs(t - places[k, None])).reshape(1, -1)

    m = len(places)
    parts = Parts(np.arange(m), np.zeros(m), np.ones(m), np.ones(m, bool))
    right = 21.0 - math.cos(1.0) + 0.5 * amplitude * (places**2 + (1.0 - places) ** 2)
    return values, parts, right


def test_small_corners_under_smooth_functions_are_found_by_other_nodes():
    """Where they are looked for, also beside the ends of intervals, where no node is."""
    values, parts, right = corner_under(1e-3, np.linspace(0.0, 1.0, 4801))
    missed = []
    for corners in (False, True):
        found = integrate(values, parts, assumed=Assumptions(corners=corners))
        off = np.abs(found.value[0] - right)
        missed.append(np.count_nonzero(off > found.error[0]))
        assert off.max() < 1e-7 * right.max()
    assert missed[0] > 800
    assert missed[1] == 0
