"""The five cases of loop closure, against motions known beforehand, sympy, and differences."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from closure_series import Motion
from four_bars import reference
from hypothesis import assume, given
from hypothesis import strategies as st
from loop_closure import (
    close_length_and_angle,
    close_tied_directions,
    close_two_angles,
    close_two_lengths,
    close_vector,
)

from mechanism_sim.linkages.four_bar import FourBar

TURN = np.linspace(0.0, 2.0 * np.pi, 97)
lengths = st.floats(0.2, 3.0)
angles = st.floats(-3.0, 3.0)
speeds = st.floats(-3.0, 3.0)


def wrapped(angle):
    return np.angle(np.exp(1j * np.asarray(angle)))


# --- Motions known beforehand -------------------------------------------------------------------


def polynomial(coefficients, t, order=0):
    """A derivative of a polynomial of time at the instants t."""
    p = np.polynomial.Polynomial(coefficients)
    return (p.deriv(order) if order else p)(np.asarray(t, dtype=float))


def motion(coefficients, t=0.0):
    return Motion(*(np.atleast_1d(polynomial(coefficients, t, k)) for k in range(4)))


def vector(r, th):
    """The vector r u(th) (2, N) and its derivatives, from those of its length and angle."""
    e = np.exp(1j * th.value)
    z = (
        r.value,
        r.rate + 1j * r.value * th.rate,
        r.acceleration - r.value * th.rate**2
        + 1j * (2.0 * r.rate * th.rate + r.value * th.acceleration),
        r.jerk - 3.0 * r.rate * th.rate**2 - 3.0 * r.value * th.rate * th.acceleration
        + 1j * (3.0 * r.acceleration * th.rate + 3.0 * r.rate * th.acceleration
                + r.value * (th.jerk - th.rate**3)),
    )  # fmt: skip
    return Motion(*(np.array([(x * e).real, (x * e).imag]) for x in z))


def plus(*motions):
    return Motion(*(sum(parts) for parts in zip(*motions, strict=True)))


def minus(a, b):
    return Motion(*(x - y for x, y in zip(a, b, strict=True)))


#: the moving quantities of a loop, those that are lengths first
NAMES = 'ri', 'rj', 'rk', 'thi', 'thj', 'gamma', 'beta'


def two_vectors(m):
    return plus(vector(m.ri, m.thi), vector(m.rj, m.thj))


def tied_vectors(m):
    return plus(
        vector(m.ri, m.thi),
        vector(m.rj, minus(m.thi, m.gamma)),
        vector(m.rk, minus(m.thi, m.beta)),
    )


#: case: left side, unknowns, what is known, closed form
CASES = {
    1: (lambda m: vector(m.rj, m.thj), ('rj', 'thj'), (), close_vector),
    2: (two_vectors, ('ri', 'thj'), ('thi', 'rj'), close_length_and_angle),
    3: (two_vectors, ('ri', 'rj'), ('thi', 'thj'), close_two_lengths),
    4: (two_vectors, ('thi', 'thj'), ('ri', 'rj'), close_two_angles),
    5: (tied_vectors, ('rj', 'thi'), ('ri', 'rk', 'gamma', 'beta'), close_tied_directions),
}


class Loop:
    """One of the five cases, all of whose vectors move as polynomials of time.

    `close` is to find two of the motions again from the others and from the sum b of the vectors.
    """

    def __init__(self, case, polynomials, t=0.0):
        self.left, self.unknown, known, close = CASES[case]
        self.moving = {n: motion(p, t) for n, p in zip(NAMES, polynomials, strict=True)}
        self.b = self.left(SimpleNamespace(**self.moving))
        self.closure = close(self.b, *(self.moving[n] for n in known))

    @property
    def size(self):
        """A number that all values, rates and accelerations stay below."""
        found = self.closure.first, self.closure.second
        parts = [x for m in (self.b, *self.moving.values(), *found) for x in m[:3]]
        return 1.0 + max(float(np.abs(x[np.isfinite(x)]).max(initial=0.0)) for x in parts)

    def errors(self):
        """Deviations (3, B, N) of position, rate, acceleration, the larger of both unknowns."""
        c = self.closure
        off = np.array([
            np.array(x[:3]) - np.array(self.moving[n][:3])[:, None]
            for x, n in zip((c.first, c.second), self.unknown, strict=True)
        ])  # fmt: skip
        angular = np.array(c.angular)[:, None, None]
        off[:, 0] = np.where(angular, wrapped(off[:, 0]), off[:, 0])
        return np.abs(off).max(axis=0)

    def branch(self):
        """The branch in which the known motion is, at the first instant."""
        return int(np.argmin(self.errors()[0, :, 0]))

    def put_together(self, branch):
        """The left side with the motions that `close` found."""
        c = self.closure
        found = {
            n: Motion(*(x[k][branch] for k in range(3)), np.zeros(1))
            for n, x in zip(self.unknown, (c.first, c.second), strict=True)
        }
        return self.left(SimpleNamespace(**(self.moving | found)))


@st.composite
def polynomials(draw):
    """Coefficients of the quantities in NAMES."""
    value = [lengths] * 3 + [angles] * 4
    return [[draw(x), draw(speeds), draw(speeds), draw(speeds)] for x in value]


@pytest.mark.sample(2)
@pytest.mark.parametrize('case', CASES)
def test_a_known_motion_is_found_again(case):
    @given(polynomials())
    def found(p):
        loop = Loop(case, p)
        k = loop.branch()
        sine, size = abs(loop.closure.determinant[k, 0]), loop.size
        assume(sine > 0.01 and np.hypot(*loop.b.value[:, 0]) > 0.1)
        assert not loop.closure.singular[k, 0]
        bounds = 1e-14 * size / sine * np.array([1.0, size / sine, size**2 / sine**2])
        assert (loop.errors()[:, k, 0] < bounds).all()

    found()


@pytest.mark.sample(2)
@pytest.mark.parametrize('case', [2, 4, 5])
def test_both_branches_close_the_loop_and_go_on_closing_it(case):
    """Also in the branch not known beforehand the left side put together again gives b."""

    @given(polynomials())
    def closed(p):
        loop = Loop(case, p)
        sines = loop.closure.determinant[:, 0]
        assume(np.abs(sines).min() > 0.01 and np.hypot(*loop.b.value[:, 0]) > 0.1)
        assert abs(sines.sum()) < 1e-12 / np.abs(sines).min()
        total = loop.put_together(1 - loop.branch())
        for k in range(3):
            assert np.abs(total[k] - loop.b[k]).max() < 1e-14 * loop.size ** (k + 1)

    closed()


@pytest.mark.sample(2)
@pytest.mark.parametrize('case', CASES)
def test_rates_and_accelerations_by_sympy(case):
    """The closure differentiated twice by sympy, and solved as two linear equations."""
    sp = pytest.importorskip('sympy')
    t = sp.Symbol('t')
    m = {n: sp.Function(n)(t) for n in NAMES}
    u = lambda th: sp.Matrix([sp.cos(th), sp.sin(th)])  # noqa: E731
    left = {
        1: m['rj'] * u(m['thj']),
        5: m['ri'] * u(m['thi']) + m['rj'] * u(m['thi'] - m['gamma'])
        + m['rk'] * u(m['thi'] - m['beta']),
    }.get(case, m['ri'] * u(m['thi']) + m['rj'] * u(m['thj']))  # fmt: skip
    rng = np.random.default_rng(case)
    loop = Loop(case, [[*x] for x in rng.uniform(0.3, 1.5, (7, 4))])
    branch = loop.branch()
    for order in (1, 2):
        unknown = [sp.Derivative(m[n], (t, order)) for n in loop.unknown]
        equation = sp.diff(left, t, order)
        A = equation.jacobian(unknown)
        c = sp.Matrix([sp.Symbol('bx'), sp.Symbol('by')]) - equation.subs(
            dict.fromkeys(unknown, 0)
        )
        numbers = {'bx': loop.b[order][0, 0], 'by': loop.b[order][1, 0]}
        for n, x in m.items():
            values = [float(part[0]) for part in loop.moving[n][:3]]
            for k in (2, 1):
                numbers[sp.Derivative(x, (t, k))] = values[k]
            numbers[x] = values[0]
        A, c = (np.array(x.subs(numbers).evalf(20), dtype=float) for x in (A, c))
        found = loop.closure.first[order], loop.closure.second[order]
        np.testing.assert_allclose(
            [x[branch, 0] for x in found], np.linalg.solve(A, c)[:, 0], rtol=1e-11
        )


@pytest.mark.parametrize('case', CASES)
def test_rates_and_accelerations_are_those_of_the_positions(case):
    """Central differences of eighth order of the closed positions, all vectors moving."""
    rng = np.random.default_rng(10 + case)
    h = 0.01
    loop = Loop(case, [[*x] for x in rng.uniform(0.4, 1.0, (7, 4))], h * np.arange(-4, 5))
    first = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
    second = np.array(
        [-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]
    )
    c = loop.closure
    for x, angular in zip((c.first, c.second), c.angular, strict=True):
        assert np.isfinite(x.value).all()
        position = np.unwrap(x.value, axis=1) if angular else x.value
        np.testing.assert_allclose(position @ first / h, x.rate[:, 4], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(
            position @ second / h**2, x.acceleration[:, 4], rtol=1e-6, atol=1e-6
        )


# --- What cannot be closed ----------------------------------------------------------------------


def test_what_cannot_be_closed_is_nan_and_not_singular():
    far, near = np.array([[5.0], [0.0]]), np.array([[0.1], [0.0]])
    for closure in (
        close_two_angles(far, 1.0, 2.0),
        close_two_angles(near, 1.0, 2.0),
        close_length_and_angle(far, np.pi / 2, 2.0),
        close_tied_directions(near, 1.0, 0.0, np.pi / 2, 0.0),
        close_two_lengths(near, np.pi / 2, np.pi / 2),
    ):
        assert np.isnan(closure.first.value).all()
        assert np.isnan(closure.second.acceleration).all()
    for closure in (close_two_angles(far, 1.0, 2.0), close_length_and_angle(far, 1.5, 2.0)):
        assert not closure.singular.any()


def test_no_vector_has_no_direction():
    nothing = np.zeros((2, 1))
    assert np.isnan(close_vector(nothing).second.value).all()
    assert np.isnan(close_two_angles(nothing, 1.0, 1.0).first.value).all()
    assert np.isnan(close_tied_directions(nothing, 1.0, 1.0, 0.0, np.pi).second.value).all()


# --- Dead points --------------------------------------------------------------------------------


def at_a_dead_point(case, p):
    """Polynomials changed so that the unknowns move in one direction at t = 0."""
    p = dict(zip(NAMES, p, strict=True))
    if case == 2:
        p['thj'][0] = p['thi'][0] + np.pi / 2
    elif case in (3, 4):
        p['thj'][0] = p['thi'][0]
    elif case == 5:
        gamma, beta = p['gamma'][0], p['beta'][0]
        p['rj'][0] = -p['ri'][0] * np.cos(gamma) - p['rk'][0] * np.cos(gamma - beta)
    return list(p.values())


@pytest.mark.sample(1)
@pytest.mark.parametrize('case', [2, 3, 4, 5])
def test_a_motion_through_a_dead_point_is_found_there(case):
    @given(polynomials())
    def found(p):
        loop = Loop(case, at_a_dead_point(case, p))
        c = loop.closure
        # how fast the dead point is passed, which all digits depend on
        step = 1e-4
        after = Loop(case, at_a_dead_point(case, p), step).closure
        passing = np.abs(after.determinant).max() / step
        assume(passing > 0.3 and np.hypot(*loop.b.value[:, 0]) > 0.2)
        assert c.singular.all()
        errors = loop.errors()[:, :, 0]
        k = int(np.argmin(errors[1]))
        assert errors[0, k] < 1e-6
        assert errors[1, k] < 1e-7 * loop.size**2 / passing
        assert errors[2, k] < 1e-6 * loop.size**3 / passing**2

    found()


@pytest.mark.parametrize('case', [2, 4, 5])
def test_each_branch_leaves_a_dead_point_with_the_rates_given_there(case):
    """The limits are those from later instants; from earlier ones the branches change places."""
    rng = np.random.default_rng(case)
    p = at_a_dead_point(case, [[*x] for x in rng.uniform(0.4, 1.0, (7, 4))])
    p[4][1] = -1.0  # passed fast enough to have left it after h
    h = 1e-4
    before, at, after = (Loop(case, p, t).closure for t in (-h, 0.0, h))
    assert at.singular.all()
    assert not (before.singular | after.singular).any()
    for x in ('first', 'second'):
        dead, later, earlier = (getattr(c, x) for c in (at, after, before))
        expected = dead.rate + h * dead.acceleration
        np.testing.assert_allclose(later.rate, expected, atol=1e-5)
        expected = dead.rate - h * dead.acceleration
        np.testing.assert_allclose(earlier.rate, expected[::-1], atol=1e-5)
        np.testing.assert_allclose(later.acceleration, dead.acceleration, atol=0.05)


def test_a_vector_that_starts_from_nothing():
    p = [[0.0, 0.7, -0.4, 0.3]] * 3 + [[0.9, 1.3, -0.6, 0.8]] * 4
    loop = Loop(1, p)
    assert loop.closure.singular.all()
    assert (loop.errors() < 1e-14).all()


def test_accelerations_at_a_dead_point_need_third_derivatives():
    p = at_a_dead_point(4, [[1.0, 0.3, 0.2, 0.1]] * 3 + [[0.5, 1.0, 0.4, 0.2]] * 4)
    p[1], p[4] = [0.6, -0.2, 0.1, 0.0], [0.5, -2.0, 0.3, 0.0]
    loop = Loop(4, p)
    assert np.isfinite(loop.closure.first.acceleration).all()
    b = Motion(*loop.b[:3])
    closure = close_two_angles(b, loop.moving['ri'], loop.moving['rj'])
    np.testing.assert_array_equal(closure.first.rate, loop.closure.first.rate)
    assert np.isnan(closure.first.acceleration).all()


def along_x(*parts):
    """A right side that stays on the x axis."""
    return Motion(*(np.array([x, np.zeros_like(x)]) for x in parts))


def test_a_position_that_stands_alone_has_no_rates():
    """Stretched out, with b about to grow whichever way time goes."""
    one = np.ones(1)
    closure = close_two_angles(along_x(3.0 * one, 0.0 * one, 2.0 * one, 0.0 * one), 1.0, 2.0)
    assert closure.singular.all()
    np.testing.assert_array_equal(closure.first.value, 0.0)
    assert np.isnan(closure.first.rate).all()
    assert np.isnan(closure.second.acceleration).all()


def test_a_linkage_at_rest_in_a_dead_point_rests():
    closure = close_two_angles(np.array([[3.0], [0.0]]), 1.0, 2.0)
    assert closure.singular.all()
    np.testing.assert_array_equal(closure.first.rate, 0.0)


@pytest.mark.parametrize('speed', [0.3, -1.7, 11.0])
def test_a_stretched_linkage_may_turn_as_a_whole(speed):
    """Both roots are the one speed; what comes after is open, so there is no acceleration."""
    angle = Motion(TURN, *(np.full_like(TURN, x) for x in (speed, 0.0, 0.0)))
    long = Motion(np.full_like(TURN, 3.0), *np.zeros((3, TURN.size)))
    closure = close_two_angles(vector(long, angle), 1.0, 2.0)
    assert closure.singular.all()
    for x in (closure.first, closure.second):
        assert np.abs(wrapped(x.value - TURN)).max() < 1e-15
        assert np.abs(x.rate - speed).max() < 1e-14 * abs(speed)
        assert np.isnan(x.acceleration).all()


# --- Slider-crank and four-bar ------------------------------------------------------------------


def turning(th2, r2=1.0, w2=1.0):
    """The vector of a crank at steady speed."""
    zero = np.zeros_like(th2)
    return vector(Motion(zero + r2, zero, zero, zero), Motion(th2, zero + w2, zero, zero))


def from_pin_to_frame(th2, r1, r2=1.0):
    """The right side of all linkages with a frame along x: -r1 - r2, theta_1 = pi."""
    zero = np.zeros_like(th2)
    return minus(along_x(zero + r1, zero, zero, zero), turning(th2, r2))


def piston(th2, w2=1.0):
    """Motion r1 of the piston of a slider-crank, r2 = 1 and r3 = 4, at steady crank speed."""
    return close_length_and_angle(turning(th2 + np.pi, 1.0, w2), np.pi, 4.0)


def test_a_crank_driven_by_its_piston_goes_round():
    """The piston's motion from the crank, and back: both dead points are passed each turn."""
    th2 = np.linspace(0.3, 0.3 + 6.0 * np.pi, 2000)
    th2[[500, 900]] = 2.0 * np.pi, 3.0 * np.pi  # exactly at dead points
    th2 = np.sort(th2)
    w2 = 2.0
    r1 = piston(th2, w2).first
    b = along_x(r1.value[0], r1.rate[0], r1.acceleration[0])
    closure = close_two_angles(b, 1.0, 4.0)  # crank and rod: 2.95, 2.96
    assert closure.singular[0].sum() == 2
    start = int(np.argmin(np.abs(wrapped(closure.first.value[:, 0] - th2[0]))))
    crank, _ = closure.follow(th2 / w2, start)
    # Near a dead point the piston's place tells the crank angle to its square only.
    assert np.abs(wrapped(crank.value - th2)).max() < 3e-8
    assert np.abs(crank.rate - w2).max() < 1e-6
    dead = closure.singular[0]
    assert np.abs(crank.rate[dead] - w2).max() < 1e-14


def test_a_piston_pushed_at_a_steady_speed_has_no_crank_speed_at_its_dead_point():
    """The speed grows as the inverse root of the distance, whatever [V] 2.4.3 says."""
    distance = np.array([0.0, 1e-6, 1e-8])
    one = np.ones(3)
    closure = close_two_angles(along_x(5.0 - distance, one, 0.0 * one, 0.0 * one), 1.0, 4.0)
    np.testing.assert_array_equal(closure.singular[0], [True, False, False])
    assert np.isnan(closure.first.rate[:, 0]).all()
    near, nearer = np.abs(closure.first.rate[0, 1:])
    assert nearer / near == pytest.approx(10.0, rel=1e-5)


@pytest.mark.parametrize('branch', [0, 1])
def test_a_parallelogram_stays_one_through_its_change_points(branch):
    """From the open branch a parallelogram, from the crossed one an antiparallelogram."""
    t = np.linspace(0.1, 0.1 + 4.0 * np.pi, 1500)
    t[[200, 800]] = np.pi, 3.0 * np.pi
    t = np.sort(t)
    closure = close_two_angles(from_pin_to_frame(t, 2.0), 2.0, 1.0)
    assert closure.singular[0].sum() == 2
    coupler, rocker = closure.follow(t, branch)
    turned = Motion(rocker.value + np.pi, *rocker[1:3])
    if abs(wrapped(turned.value[0] - t[0])) < 1e-9:
        assert np.abs(wrapped(turned.value - t)).max() < 1e-9
        assert np.abs(turned.rate - 1.0).max() < 1e-7
        assert np.abs(coupler.rate).max() < 1e-7
    else:
        assert turned.rate.max() < 0.0
        assert np.abs(np.diff(turned.rate)).max() < 0.05


def test_the_books_slider_crank_to_all_printed_digits():
    """[V] appendix A.4.1: Out[16], Out[17]."""
    ref = reference('appendix_a4')['slider_crank']
    closure = piston(np.pi / 10.0 * np.arange(21))
    r1, th3 = closure.first.value[0], closure.second.value[0]
    turned = th3 % (2.0 * np.pi)
    turned[turned < 1e-9] += 2.0 * np.pi  # as printed
    for ours, column in ((r1, ref['r1']), (turned, ref['th3'])):
        assert np.abs(ours - column['computed']).max() < 4e-15
        for x, printed in zip(ours, column['printed'], strict=True):
            assert f'{x:.6g}' == f'{2.0 * np.pi if printed == "2π" else float(printed):.6g}'


def four_bar(th2, r3=6.0, r4=5.0):
    """Coupler and rocker of [V] 2.57 for r1 = 4, r2 = 1, at unit crank speed."""
    return close_two_angles(from_pin_to_frame(th2, 4.0), r3, r4)


def test_the_books_four_bar_to_all_printed_digits():
    """[V] appendix A.4.2: Out[33], Out[34], from the plus sign of C."""
    ref = reference('appendix_a4')['four_bar']
    closure = four_bar(np.pi / 10.0 * np.arange(20))
    for motion_, column in ((closure.first, ref['th3']), (closure.second, ref['th4'])):
        ours = motion_.value[0]
        assert np.abs(ours - column['computed']).max() < 4e-15
        for x, printed in zip(ours, column['printed'], strict=True):
            assert f'{x:.6g}' == f'{float(printed):.6g}'


@pytest.mark.parametrize('branch', [0, 1])
def test_the_fourth_case_agrees_with_the_four_bar(branch):
    closure = four_bar(TURN)
    linkage = FourBar(4.0, 1.0, 6.0, 5.0, 'open' if branch else 'crossed')
    q, v, a = linkage.motion(TURN, np.ones_like(TURN), np.zeros_like(TURN))
    for row, x, turn in ((1, closure.first, 0.0), (2, closure.second, np.pi)):
        assert np.abs(wrapped(x.value[branch] + turn - q[row])).max() < 2e-15
        assert np.abs(x.rate[branch] - v[row]).max() < 2e-15
        assert np.abs(x.acceleration[branch] - a[row]).max() < 5e-15


# --- Figures of [V] chapter 2 that state facts ---------------------------------------------------


def test_v_figure_2_7_rod_of_the_slider_crank():
    """It lies along the slider's axis in the dead points, and swings by arcsin(r2/r3)."""
    th2 = np.pi / 2 * np.arange(4)
    th3 = piston(th2).second.value[0]
    np.testing.assert_allclose(th3, [0.0, -np.arcsin(0.25), 0.0, np.arcsin(0.25)], atol=1e-15)
    assert np.abs(piston(TURN).second.value[0]).max() <= np.arcsin(0.25) + 1e-15


def test_v_figure_2_31_dead_points_of_the_piston():
    """The piston rests where crank and rod are in line, and only there."""
    closure = piston(TURN)
    in_line = np.abs(np.sin(TURN - closure.second.value[0])) < 1e-9
    np.testing.assert_array_equal(np.abs(closure.first.rate[0]) < 1e-9, in_line)
    assert in_line.sum() == 3


def test_v_figures_2_11_to_2_13_triple_rocker():
    """Lengths 4-1-7-3: all links rock, the crank about pi, between +-arccos(1/8) from 0."""
    limit = np.arccos(1.0 / 8.0)
    th2 = np.linspace(limit, 2.0 * np.pi - limit, 201)
    inside, outside = four_bar(th2[1:-1], r3=7.0, r4=3.0), four_bar(TURN[:13], r3=7.0, r4=3.0)
    assert np.isfinite(inside.first.value).all()
    assert np.isnan(outside.first.value[:, TURN[:13] < limit]).all()
    # At its limits coupler and rocker are in line: dead points, without a limit of the rates.
    ends = four_bar(th2[[0, -1]], r3=7.0, r4=3.0)
    assert ends.singular.all()
    assert np.isnan(ends.first.rate).all()
    for rocking in (inside.first.value, inside.second.value):
        assert (np.ptp(np.unwrap(rocking), axis=1) < np.pi).all()


def test_v_figures_2_14_to_2_17_five_bar():
    """r1 = 5, r3 = r5 = 1.5, r2 = 1: the slider is as far as b is long, and square to link 3."""
    b = from_pin_to_frame(TURN, 5.0)
    closure = close_tied_directions(b, 1.5, 1.5, np.pi / 2, np.pi)
    r4, th3 = closure.first.value[0], closure.second.value[0]
    np.testing.assert_allclose(r4, np.hypot(*b.value), rtol=1e-15)
    np.testing.assert_allclose(th3, np.arctan2(b.value[1], b.value[0]) + np.pi / 2, rtol=1e-15)
    assert r4.min() == pytest.approx(4.0, abs=1e-15)
    assert r4.max() == pytest.approx(6.0, abs=1e-15)
    assert not closure.singular.any()


def test_v_figures_2_19_and_2_20_scotch_yoke():
    """r1 = 2, r2 = 1: both sliders have the crank's frequency and nothing above it."""
    th2 = TURN[:-1]
    closure = close_two_lengths(from_pin_to_frame(th2, 2.0), 0.0, 3.0 * np.pi / 2)
    r3, r4 = closure.first.value[0], closure.second.value[0]
    assert r3.max() == pytest.approx(3.0)
    assert r4.max() == pytest.approx(1.0)
    for r in (r3, r4):
        harmonics = np.abs(np.fft.rfft(r)) / th2.size
        assert harmonics[1] == pytest.approx(0.5)
        assert harmonics[2:].max() < 1e-15


def loader(t):
    """[V] 2.66 to 2.68 with the data of 2.3.6, r2 = 1; both cylinders lengthen at unit speed.

    Angles and rates of lift arm 2, bellcrank 9 and bucket 14, and of 3, 8 and 13.
    """
    zero = np.zeros_like(t)

    def still(r, th=0.0):
        return vector(Motion(zero + r, *zero_rates), Motion(zero + th, *zero_rates))

    def bar(r, th):
        return vector(Motion(zero + r, *zero_rates), Motion(*th[:3], zero))

    def solution(closure, branch):
        return (Motion(*(x[branch] for x in m[:3])) for m in (closure.first, closure.second))

    zero_rates = zero, zero, zero
    cylinder = Motion(0.76 + t, zero + 1.0, zero, zero)
    th2, th3 = solution(close_two_angles(still(-0.6, np.pi / 2), 1.0, cylinder), 1)
    b = plus(still(-0.14), bar(1.6, th2))
    th8, th9 = solution(close_two_angles(b, cylinder, 0.8), 1)
    b = plus(bar(-0.4, th9), bar(1.2, th2))
    th13, th14 = solution(close_two_angles(b, 1.1, 0.8), 0)
    return th2, th9, th14, th3, th8, th13


def test_v_figure_2_25_loader():
    """The bucket's angle is smallest in its low position, where the cylinders are shortest."""
    t = np.linspace(0.0, 0.8, 801)  # at 0.84 r2/v lift arm and cylinder are in line
    lift_arm, _, bucket, *others = loader(t)
    for angle in (lift_arm, bucket):
        assert (np.diff(np.unwrap(angle.value)) > 0.0).all()
        assert angle.rate.min() > 0.0
    for angle in (lift_arm, bucket, *others):
        slope = np.gradient(np.unwrap(angle.value), t, edge_order=2)
        assert np.abs(slope - angle.rate)[:-20].max() < 1e-3


def test_v_figure_2_28_crank_rocker():
    """Lengths 4-1-6-5: the crank goes round, the rocker does not."""
    _, rocker = (x.value for x in (four_bar(TURN).first, four_bar(TURN).second))
    assert np.isfinite(rocker).all()
    assert (np.ptp(np.unwrap(rocker), axis=1) < np.pi).all()
