"""Coupler curves: the sextic that they are, by elimination and by fitting, and their cognates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from coupler_curve import cognates, coupler_curve, coupler_point
from numpy.polynomial import polynomial
from scipy.signal import convolve2d

from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import classify, crank_limits, crank_turns

CURVES = [
    (FourBar(4.0, 1.0, 6.0, 5.0), (3.0, 2.0)),  # [V] Figure 2.28: a bar on the middle
    (FourBar(4.0, 1.0, 6.0, 5.0, 'crossed'), (2.0, -1.5)),
    (FourBar(1.0, 2.2, 1.9, 2.0), (0.7, 1.1)),  # double-crank
    (FourBar(4.0, 1.0, 7.0, 3.0), (3.0, 1.0)),  # triple-rocker, [V] Figure 2.11
    (FourBar(3.0, 2.0, 1.0, 2.6), (0.4, -0.9)),  # double-rocker
    (FourBar(2.0, 2.5, 2.2, 1.0), (1.0, 0.8)),  # rocker-crank
]


def sextic(f, point):
    """Coefficients (7, 7) of x^i y^j of the curve: the coupler's angle eliminated.

    With the point m = p e^(i alpha) from the crank pin and n from the rocker pin, the pins stay at
    their distances from the pivots if

        2 Re(conj(z) m e^(i th)) = |z|^2 + |m|^2 - crank^2
        2 Re(conj(z - ground) n e^(i th)) = |z - ground|^2 + |n|^2 - rocker^2

    two linear equations in cos th and sin th, solved by Cramer's rule; the squares add to one.
    """
    m, n = complex(*point), complex(*point) - f.coupler

    def pivot(at, arm, length):
        """Factors of cos th, of sin th, and the right side, as polynomials in x and y."""
        x, y = np.zeros((2, 2)), np.zeros((2, 2))
        x[0, 0], x[1, 0], y[0, 1] = -at, 1.0, 1.0
        square = np.zeros((3, 3))
        square[0, 0], square[1, 0] = at**2 + abs(arm) ** 2 - length**2, -2.0 * at
        square[2, 0] = square[0, 2] = 1.0
        return 2.0 * (arm.real * x + arm.imag * y), 2.0 * (arm.real * y - arm.imag * x), square

    a, b, r = pivot(0.0, m, f.crank)
    c, d, s = pivot(f.ground, n, f.rocker)

    def minus(p, q):
        return convolve2d(*p) - convolve2d(*q)

    cosine, sine, determinant = minus((r, d), (s, b)), minus((s, a), (r, c)), minus((a, d), (b, c))
    result = convolve2d(cosine, cosine) + convolve2d(sine, sine)
    result[:5, :5] -= convolve2d(determinant, determinant)
    return result


def whole_curve(f, point, samples=400):
    """Points of all circuits: of both branches of a crank that turns, or on both its sides."""
    if crank_turns(f):
        other = replace(f, branch='crossed' if f.branch == 'open' else 'open')
        circuits = [coupler_curve(x, point, samples) for x in (f, other)]
    else:
        circuits = [coupler_curve(f, point, samples, below) for below in (False, True)]
    return np.concatenate(circuits, axis=1)


def residual(coefficients, z):
    """The polynomial at points, less what rounding of its terms may leave."""
    size = polynomial.polyval2d(*np.abs(z), np.abs(coefficients))
    return np.abs(polynomial.polyval2d(*z, coefficients)) / size


@pytest.mark.parametrize(('f', 'point'), CURVES)
def test_coupler_curves_are_tricircular_sextics(f, point):
    c = sextic(f, point)
    assert residual(c, whole_curve(f, point)).max() < 1e-13
    i, j = np.indices(c.shape)
    assert np.abs(c[i + j > 6]).max() < 1e-12
    # the terms of sixth degree are those of (x^2 + y^2)^3: thrice through the circular points
    top = {(6, 0): 1.0, (4, 2): 3.0, (2, 4): 3.0, (0, 6): 1.0}
    for k in range(7):
        assert c[k, 6 - k] == pytest.approx(
            c[6, 0] * top.get((k, 6 - k), 0.0), abs=1e-10 * c[6, 0]
        )
    # those of fifth degree contain (x^2 + y^2)^2, those of fourth x^2 + y^2
    for degree, factor in ((5, [1.0, 0.0, 2.0, 0.0, 1.0]), (4, [1.0, 0.0, 1.0])):
        k = np.arange(degree + 1)
        _, rest = polynomial.polydiv(c[k, degree - k], factor)
        assert np.abs(rest).max() < 1e-10 * np.abs(c).max()


@pytest.mark.parametrize(('f', 'point'), CURVES)
def test_the_only_sextic_through_points_of_the_curve_is_that_of_elimination(f, point):
    """Fitted to points alone, without a word of where they come from."""
    z = whole_curve(f, point)
    centre, scale = z.mean(axis=1, keepdims=True), np.abs(z - z.mean(axis=1, keepdims=True)).max()
    i, j = np.array([(i, j) for i in range(7) for j in range(7 - i)]).T
    u, v = (z - centre) / scale
    table = u[:, None] ** i * v[:, None] ** j
    _, values, right = np.linalg.svd(table)
    assert values[-1] < 1e-12 * values[0]
    assert values[-2] > 1e-9 * values[0]
    fitted = np.zeros((7, 7))
    fitted[i, j] = right[-1]
    # compared off the curve, where no values vanish
    far = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 200))
    there = polynomial.polyval2d(*far, fitted)
    ours = polynomial.polyval2d(*(far * scale + centre), sextic(f, point))
    factor = (there @ ours) / (there @ there)
    assert np.abs(there * factor - ours).max() < 1e-4 * np.abs(ours).max()


@pytest.mark.parametrize(('f', 'point'), CURVES)
def test_cognates_trace_the_same_curve(f, point):
    least, greatest = crank_limits(f)
    th2 = np.linspace(least, greatest, 203)[1:-1]
    target = coupler_point(f, point, th2)
    assert np.isfinite(target).all()
    th3, _ = f.positions(th2)
    for cognate in cognates(f, point):
        both = [
            replace(cognate, linkage=replace(cognate.linkage, branch=branch)).trace(th3)
            for branch in ('open', 'crossed')
        ]
        off = np.array([np.hypot(*(trace - target)) for trace in both])
        assert np.nanmin(off, axis=0).max() < 1e-9 * f.coupler
        # and by itself, swept by its own crank: on the same sextic
        own = whole_curve(cognate.linkage, cognate.point)
        turn = np.exp(1j * cognate.angle)
        world = turn * (own[0] + 1j * own[1]) + complex(*cognate.pivot)
        assert residual(sextic(f, point), np.array([world.real, world.imag])).max() < 1e-12


def test_cognates_of_a_crank_rocker():
    """A crank-rocker again, here seen from its rocker, and a double-rocker."""
    f, point = CURVES[0]
    assert [str(classify(c.linkage.lengths)) for c in cognates(f, point)] == [
        'double-rocker', 'rocker-crank',
    ]  # fmt: skip


def test_the_three_linkages_stand_on_a_triangle_like_the_coupler():
    f, point = CURVES[0]
    first, second = cognates(f, point)
    ends = [complex(*c.pivot) + c.linkage.ground * np.exp(1j * c.angle) for c in (first, second)]
    assert ends[0] == pytest.approx(ends[1])
    assert ends[0] == pytest.approx(f.ground * complex(*point) / f.coupler)


@pytest.mark.parametrize('point', [(0.0, 0.0), (6.0, 0.0)])
def test_joints_of_the_coupler_trace_circles(point):
    f = FourBar(4.0, 1.0, 6.0, 5.0)
    x, y = coupler_curve(f, point)
    radius = np.hypot(x, y) if point == (0.0, 0.0) else np.hypot(x - 4.0, y)
    assert radius == pytest.approx(1.0 if point == (0.0, 0.0) else 5.0)
    with pytest.raises(ValueError, match='circle'):
        cognates(f, point)


def test_no_circuit_breaks_at_its_limits():
    random = np.random.default_rng(4)
    for joints in random.standard_normal((300, 4, 2)):
        o2, a, b, o4 = joints
        sides = [np.hypot(*(p - q)) for p, q in ((o4, o2), (a, o2), (b, a), (o4, b))]
        for below in (False, True):
            assert np.isfinite(coupler_curve(FourBar(*sides), (0.3, 0.4), 61, below)).all()


@pytest.mark.parametrize(('f', 'point'), CURVES)
def test_curves_are_closed_and_without_jumps(f, point):
    rough, fine = (coupler_curve(f, point, n) for n in (1001, 4001))
    assert np.abs(fine[:, 0] - fine[:, -1]).max() < 1e-6
    steps = [np.hypot(*np.diff(z, axis=1)).max() for z in (rough, fine)]
    assert steps[1] < 0.3 * steps[0]
