"""Misprints of [V] chapter 2 and appendix A.4, as in `test_misprints.py`; and what is right there.

Unless a test says otherwise, the derivatives to compare with are those of positions, taken
numerically with 40 digits at t = 0.3.
"""

from __future__ import annotations

from types import SimpleNamespace

import mpmath as mp
import numpy as np
import pytest
from loop_closure import close_two_angles

mp.mp.dps = 40
AT = mp.mpf('0.3')

cos, sin = np.cos, np.sin


def u(t):
    return np.array([np.cos(t), np.sin(t)])


def v(t):
    return np.array([-np.sin(t), np.cos(t)])


def close(a, b, rel=1e-9):
    return np.asarray(a) == pytest.approx(np.asarray(b), rel=rel, abs=1e-12)


def differentiated(**functions):
    """Values of functions of time; their rates as NAME1, their second derivatives as NAME2."""
    numbers = {}
    for name, f in functions.items():
        numbers[name] = float(f(AT))
        numbers[f'{name}1'], numbers[f'{name}2'] = (float(mp.diff(f, AT, k)) for k in (1, 2))
    return SimpleNamespace(**numbers)


# --- The five cases: 2.3.4, 2.4.2, 2.5.2 --------------------------------------------------------


def moving():
    """Vectors i and j that all move, and b, their sum (2.28)."""

    def thi(t):
        return mp.mpf('0.4') + t - t**2 / 2

    def thj(t):
        return mp.mpf('1.7') - 2 * t + t**2

    def ri(t):
        return mp.mpf('2.3') + t / 3 + t**2

    def rj(t):
        return mp.mpf('0.9') - t / 4 + 2 * t**2

    return differentiated(
        thi=thi,
        thj=thj,
        ri=ri,
        rj=rj,
        bx=lambda t: ri(t) * mp.cos(thi(t)) + rj(t) * mp.cos(thj(t)),
        by=lambda t: ri(t) * mp.sin(thi(t)) + rj(t) * mp.sin(thj(t)),
    )


def tied(gamma=1.7, beta=2.6):
    """Three vectors at fixed angles to each other (2.45), and d of 2.88 and 2.89."""

    def th(t):
        return mp.mpf('0.4') + t - t**2 / 2

    def ri(t):
        return mp.mpf('1.3') + t / 3 + t**2

    def rj(t):
        return mp.mpf('0.9') - t / 4 + 2 * t**2

    def rk(t):
        return mp.mpf('0.6') + t / 5 - t**2 / 3

    def total(f):
        return lambda t: (
            ri(t) * f(th(t)) + rj(t) * f(th(t) - gamma) + rk(t) * f(th(t) - beta)
        )  # fmt: skip

    x, y = total(mp.cos), total(mp.sin)
    s = differentiated(th=th, ri=ri, rj=rj, rk=rk, bx=x, by=y, dx=lambda t: -y(t), dy=x)
    s.gamma, s.beta = gamma, beta
    return s


def second_case(theta_i, whole=True):
    """theta_j by 2.32, theta_i added to the principal angle (2.33) or to the whole of it."""
    ri, rj, theta_j = 1.3, 0.9, 2.6
    b = ri * u(theta_i) + rj * u(theta_j)
    principal = np.arcsin(abs(b @ v(theta_i)) / rj)
    if not whole:
        principal += theta_i
    s, c = sin(theta_j - theta_i), cos(theta_j - theta_i)
    star = {(True, True): principal, (False, True): np.pi - principal,
            (False, False): np.pi + principal, (True, False): 2 * np.pi - principal}  # fmt: skip
    found = star[c > 0, s >= 0]
    return (found + theta_i if whole else found), theta_j


def test_v_2_33_the_principal_angle_does_not_contain_theta_i():
    found, right = second_case(0.4, whole=False)
    assert not close(u(found), u(right), rel=0.1)
    found, right = second_case(0.4)
    assert close(u(found), u(right))
    # With theta_i = pi, as in the slider-crank, 2.33 happens to be right.
    found, right = second_case(np.pi, whole=False)
    assert close(u(found), u(right))


def test_v_2_53_zeta_star_is_an_arcsine():
    """zeta* = |alpha - theta_i + gamma| is what 2.53 is to find; the rule wants arcsin |A|."""
    zeta = 2.5
    A, B = sin(zeta), cos(zeta)  # 2.51 and 2.52
    assert A > 0 > B
    assert not close(u(np.pi - abs(zeta)), u(zeta), rel=0.1)
    assert close(u(np.pi - np.arcsin(abs(A))), u(zeta))


def test_v_2_79_direction_of_the_vector_i():
    s = moving()
    rest = s.ri * s.thi1 * v(s.thi) + s.rj1 * u(s.thj) + s.rj * s.thj1 * v(s.thj)
    b_rate = [s.bx1, s.by1]
    assert not close(s.ri1 * np.array([cos(s.thi), sin(s.thj)]) + rest, b_rate, rel=0.01)
    assert close(s.ri1 * u(s.thi) + rest, b_rate)


def test_v_2_91_no_sum_but_a_product():
    s = tied()
    across = -s.dy * cos(s.th) + s.dx * sin(s.th)
    k = -s.dy * cos(s.th - s.beta) + s.dx * sin(s.th - s.beta)
    left = (-s.dy * cos(s.th - s.gamma) + s.dx * sin(s.th - s.gamma)) * s.rj1
    rest = -s.rk1 * k + (-s.dy * s.bx1 + s.dx * s.by1)
    assert not close(-s.ri1 + across + rest, left, rel=0.1)
    assert close(-s.ri1 * across + rest, left)


def test_v_2_113_first_term_of_the_acceleration():
    s = differentiated(
        r=lambda t: 1 + t / 3 + t**2,
        th=lambda t: t - t**2,
        x=lambda t: (1 + t / 3 + t**2) * mp.cos(t - t**2),
        y=lambda t: (1 + t / 3 + t**2) * mp.sin(t - t**2),
    )
    rest = 2 * s.r1 * s.th1 * v(s.th) - s.r * s.th1**2 * u(s.th) + s.r * s.th2 * v(s.th)
    assert not close(s.r1 * u(s.th) + rest, [s.x2, s.y2], rel=0.1)
    assert close(s.r2 * u(s.th) + rest, [s.x2, s.y2])


def test_v_2_117_parentheses():
    s = moving()
    d = s.thj - s.thi
    rest = (
        ((s.thj1 - s.thi1) * s.rj * s.thj1 - s.rj2) * sin(d)
        - (2 * s.thj1 - s.thi1) * s.rj1 * cos(d)
        + (-s.thi1 * s.bx1 + s.by2) * cos(s.thi)
        - s.thi1 * s.ri1
        - s.ri * s.thi2
    )
    printed = (-s.thi1 * s.by1 + s.bx2) * sin(s.thi)  # the nearest that the parentheses can mean
    right = -(s.thi1 * s.by1 + s.bx2) * sin(s.thi)
    assert not close((rest + printed) / (s.rj * cos(d)), s.thj2, rel=0.1)
    assert close((rest + right) / (s.rj * cos(d)), s.thj2)


def test_v_2_118_to_2_120_rates_of_b():
    """b stands for its rate; and the last index in the second term of 2.120 is j."""
    s = moving()

    def second_case(bx, by):
        d = s.thj - s.thi
        return (
            (s.ri1 * (s.thj1 - 2 * s.thi1) - s.ri * s.thi2) * sin(d)
            - s.ri * s.thi1 * (s.thj1 - s.thi1) * cos(d)
            - s.rj2
            + (s.bx2 + by * s.thj1) * cos(s.thj)
            + (s.by2 - bx * s.thj1) * sin(s.thj)
        ) / cos(d)

    def third_case(i, j, w, bx, by):
        """2.119, and with indices exchanged 2.120; w is that of the term r_j omega_i."""
        (r, r1, th, th1, th2), (o1, ot, ot1, rest) = i, j
        d = th - ot
        return (
            -(r1 * (2 * th1 - ot1) + r * th2) * cos(d)
            + r * w * (th1 - ot1) * sin(d)
            - o1 * ot1
            - rest
            - (s.bx2 + by * ot1) * sin(ot)
            + (s.by2 - bx * ot1) * cos(ot)
        ) / sin(d)

    i, j = (s.ri, s.ri1, s.thi, s.thi1, s.thi2), (s.rj, s.rj1, s.thj, s.thj1, s.thj2)
    of_i = (s.ri1, s.thi, s.thi1, s.ri * s.thi2)
    of_j = (s.rj1, s.thj, s.thj1, s.rj * s.thj2)
    as_printed, rates = (s.bx, s.by), (s.bx1, s.by1)
    assert not close(second_case(*as_printed), s.ri2, rel=0.1)
    assert close(second_case(*rates), s.ri2)
    assert not close(third_case(i, of_j, s.thi1, *as_printed), s.ri2, rel=0.1)
    assert close(third_case(i, of_j, s.thi1, *rates), s.ri2)
    assert not close(third_case(j, of_i, s.thj1, *as_printed), s.rj2, rel=0.1)
    assert not close(third_case(j, of_i, s.thi1, *rates), s.rj2, rel=0.1)  # 2.120: omega_i
    assert close(third_case(j, of_i, s.thj1, *rates), s.rj2)


def test_v_2_126_signs():
    s = tied()
    g, w = s.th - s.gamma, s.th1
    A = -s.dy1 * w + s.dx * w**2 - s.bx1 * w + s.by2

    def acceleration(B):
        """2.123."""
        numerator = A * cos(g) - B * sin(g)
        numerator -= s.ri2 * sin(s.gamma) + s.rk2 * sin(s.gamma - s.beta)
        return numerator / (-s.dx * sin(g) + s.dy * cos(g))

    assert not close(acceleration(-s.dx1 * w + s.dy * w**2 - s.by1 * w + s.bx2), s.th2, rel=0.1)
    assert close(acceleration(-s.dx1 * w - s.dy * w**2 + s.by1 * w + s.bx2), s.th2)


def test_v_2_129_and_2_131_second_derivatives():
    s = tied()
    g, w = s.th - s.gamma, s.th1

    def acceleration(C, K):
        """2.124 with the denominator that 2.134 should have."""
        A, B = (-s.dy1 + s.dx * w) * s.rj1, (s.dx1 + s.dy * w) * s.rj1
        D = -s.ri2 * s.dx - s.ri1 * s.dx1 - s.ri1 * s.dy * w
        L = -s.rk2 * s.dx - s.rk1 * s.dx1 - s.rk1 * s.dy * w
        Q = -s.dy1 * s.bx1 - s.dy * s.bx2 + s.dx1 * s.by1 + s.dx * s.by2
        sums = -A * cos(g) - B * sin(g) + C * cos(s.th) + D * sin(s.th)
        sums += K * cos(s.th - s.beta) + L * sin(s.th - s.beta) + Q
        return sums / (-s.dy * cos(g) + s.dx * sin(g))

    C = s.ri2 * s.dy + s.ri1 * s.dy1 - s.ri1 * s.dx * w
    K = s.rk2 * s.dy + s.rk1 * s.dy1 - s.rk1 * s.dx * w
    assert close(acceleration(C, K), s.rj2)
    C_printed = s.ri1 * s.dy + s.ri1 * s.dy1 - s.ri1 * s.dx * w
    K_printed = s.rk1 * s.dy + s.rk1 * s.dy1 - s.rk1 * s.dx * w
    assert not close(acceleration(C_printed, K), s.rj2, rel=0.05)
    assert not close(acceleration(C, K_printed), s.rj2, rel=0.05)


def test_v_velocities_and_accelerations_that_are_right():
    s = moving()
    d = s.thj - s.thi
    along_i, across_i = [s.bx1, s.by1] @ u(s.thi), [s.bx1, s.by1] @ v(s.thi)
    along_j, across_j = [s.bx1, s.by1] @ u(s.thj), [s.bx1, s.by1] @ v(s.thj)
    pairs = {
        '2.80': (s.rj * s.thj1 * cos(d), -s.ri * s.thi1 - s.rj1 * sin(d) + across_i),
        '2.81': (s.ri1 * cos(d), -s.ri * s.thi1 * sin(d) - s.rj1 + along_j),
        '2.82': (-s.ri1 * sin(d), -s.ri * s.thi1 * cos(d) - s.rj * s.thj1 + across_j),
        '2.83': (s.rj1 * sin(d), -s.rj * s.thj1 * cos(d) - s.ri * s.thi1 + across_i),
        '2.84': (s.thi1 * s.ri * sin(d), -s.ri1 * cos(d) - s.rj1 + along_j),
        '2.85': (-s.thj1 * s.rj * sin(d), -s.rj1 * cos(d) - s.ri1 + along_i),
    }
    f = tied()
    g = f.th - f.gamma
    pairs['2.90'] = (
        (-f.dx * sin(g) + f.dy * cos(g)) * f.th1,
        -f.ri1 * sin(f.gamma) - f.rk1 * sin(f.gamma - f.beta) + [f.bx1, f.by1] @ v(g),
    )
    o = differentiated(
        r=lambda t: 1 + t / 3 + t**2,
        th=lambda t: t - t**2,
        x=lambda t: (1 + t / 3 + t**2) * mp.cos(t - t**2),
        y=lambda t: (1 + t / 3 + t**2) * mp.sin(t - t**2),
    )
    pairs['2.77'] = (o.r * o.th1, [o.x1, o.y1] @ v(o.th))
    pairs['2.78'] = (o.r1, [o.x1, o.y1] @ u(o.th))
    pairs['2.115'] = (o.th2, ([o.x2, o.y2] @ v(o.th) - 2 * o.r1 * o.th1) / o.r)
    pairs['2.116'] = (o.r2, [o.x2, o.y2] @ u(o.th) + o.r * o.th1**2)
    for name, (left, right) in pairs.items():
        assert close(left, right), name


def test_v_positions_that_are_right():
    """2.29 to 2.31, 2.34 to 2.37, 2.39 to 2.44, 2.46, 2.47, 2.49 to 2.51."""
    s = moving()
    b, alpha = np.hypot(s.bx, s.by), np.arctan2(s.by, s.bx)
    i, j, d = alpha - s.thi, alpha - s.thj, s.thj - s.thi
    assert close(s.rj * sin(d), b * sin(i))
    assert close(s.ri + s.rj * cos(d), b * cos(i))
    root = np.sqrt(s.rj**2 - b**2 * sin(i) ** 2)
    assert close(s.ri, b * cos(i) + root) or close(s.ri, b * cos(i) - root)
    assert close(s.rj, b * sin(i) / sin(d))
    assert close(s.ri, -b * sin(j) / sin(d))
    assert close(s.ri * sin(i), -s.rj * sin(j))
    assert close(s.ri * cos(i) + s.rj * cos(j), b)
    A = (b**2 - s.ri**2 + s.rj**2) / (2 * b * s.rj)
    assert close(A, cos(j))
    assert close((b - s.rj * A) / s.ri, cos(i))
    assert close(s.rj / s.ri * np.sqrt(1 - A**2), abs(sin(i)))
    f = tied()
    b, alpha = np.hypot(f.bx, f.by), np.arctan2(f.by, f.bx)
    across = f.ri * sin(f.gamma) + f.rk * sin(f.gamma - f.beta)
    along = f.ri * cos(f.gamma) + f.rk * cos(f.gamma - f.beta)
    assert close(across, b * sin(alpha - f.th + f.gamma))
    assert close(along + f.rj, b * cos(alpha - f.th + f.gamma))
    c, e = 2 * along, f.ri**2 + f.rk**2 + 2 * f.ri * f.rk * cos(f.beta) - b**2
    assert abs(f.rj**2 + c * f.rj + e) < 1e-12


# --- Mechanisms: 2.3.5, 2.4.3, 2.5.3 ------------------------------------------------------------


def crank(t):
    return mp.mpf('0.8') + 2 * t - t**2


def slider_crank(r2=1, r3=4):
    """A slider-crank whose crank moves at a changing speed; theta_1 = pi."""

    def th3(t):
        return mp.asin(-r2 * mp.sin(crank(t)) / r3)

    return differentiated(
        th2=crank, th3=th3, r1=lambda t: r2 * mp.cos(crank(t)) + r3 * mp.cos(th3(t))
    )


def test_v_figures_2_6_and_2_8_the_ratio_of_rod_and_crank():
    """r1 is the changing distance of the piston; A.4.1 and figure 2.7 have r3/r2 = 4."""
    r1 = [float(mp.cos(a) + mp.sqrt(16 - mp.sin(a) ** 2)) for a in np.linspace(0, np.pi, 50)]
    ratios = 4 / np.array(r1)
    assert ratios.min() == pytest.approx(0.8)
    assert ratios.max() == pytest.approx(4 / 3)


def test_v_2_3_5_crank_limits_of_the_triple_rocker():
    """Lengths 4-1-7-3 close where 16 <= b^2 = 17 - 8 cos theta_2, not from pi/2 to 3 pi/2."""

    def b(th2):
        return np.array([[4.0 - cos(th2)], [-sin(th2)]])

    limit = np.arccos(1 / 8)
    assert limit < 0.93 * np.pi / 2
    closes = [not np.isnan(close_two_angles(b(x), 7.0, 3.0).first.value[0, 0])
              for x in (limit - 1e-9, limit + 1e-9, np.pi / 2 - 0.1)]  # fmt: skip
    assert closes == [False, True, True]


def test_v_2_4_3_the_rod_is_fastest_along_the_axis():
    """omega_3 is extreme where theta_3 = 0; where theta_3 is least or greatest, it vanishes."""
    th2 = np.linspace(0, 2 * np.pi, 721)
    th3 = np.arcsin(-sin(th2) / 4)
    w3 = -cos(th2) / (4 * cos(th3))  # 2.93
    assert abs(th3[np.argmax(w3)]) < 1e-12
    assert abs(w3[np.argmin(th3)]) < 1e-12


def test_v_2_4_3_a_steady_piston_makes_no_finite_crank_speed_at_the_dead_points():
    """By 2.95, at unit piston speed and ever nearer to r1 = r2 + r3."""
    speeds = []
    for distance in (1e-4, 1e-6, 1e-8):
        x = 5 - distance
        th2 = np.arccos((x**2 + 1 - 16) / (2 * x))
        th3 = -np.arcsin(sin(th2) / 4)
        speeds.append(abs(cos(th3) / sin(th3 - th2)))
    np.testing.assert_allclose(np.diff(np.log10(speeds)), 1.0, atol=1e-4)


def test_v_slider_crank_formulas_that_are_right():
    s = slider_crank()
    a, w, r1 = s.th2 - s.th3, s.th21, s.r11
    assert close(s.th31, -w * cos(s.th2) / (4 * cos(s.th3)))  # 2.93
    assert close(r1, -w * sin(a) / cos(s.th3))  # 2.94
    assert close(w, r1 * cos(s.th3) / sin(-a))  # 2.95
    assert close(s.th31, r1 * cos(s.th2) / (4 * sin(a)))  # 2.96
    numerator = -w * (s.th31 - w) * cos(a) + s.r12 * cos(s.th3) - r1 * s.th31 * sin(s.th3)
    assert close(s.th22, numerator / sin(-a))  # 2.137
    numerator = (
        -4 * s.th31 * (w - s.th31) * cos(a) + s.r12 * cos(s.th2) - r1 * w * sin(s.th2)
    )  # fmt: skip
    assert close(s.th32, numerator / (4 * sin(a)))  # 2.138


def steady_slider_crank(w2=10):
    """That of A.4.1: steady crank speed."""

    def th3(t):
        return mp.asin(-mp.sin(w2 * t) / 4)

    return differentiated(
        th2=lambda t: w2 * t, th3=th3, r1=lambda t: mp.cos(w2 * t) + 4 * mp.cos(th3(t))
    )


def test_a_4_1_in_28_acceleration_of_the_slider():
    """In[28], and Out[28] after it, leave out the cosine of 2.136."""
    s = steady_slider_crank()
    w2, w3 = s.th21, s.th31
    coriolis = s.r11 * w3 * sin(s.th3)
    printed = (coriolis - w2 * (w2 - w3)) / cos(s.th3)
    right = (coriolis - w2 * (w2 - w3) * cos(s.th2 - s.th3)) / cos(s.th3)
    assert not close(printed, s.r12, rel=0.1)
    assert close(right, s.r12)
    assert close(s.th32, (w2**2 * sin(s.th2) + 4 * w3**2 * sin(s.th3)) / (4 * cos(s.th3)))  # 2.135


def a_4_1_forces(th2, sign, w2=10.0, mass_a=5.0, mass_b=20.0, moment=10.0):
    """f12x, f12y, f32x, f32y, f13, P4 of In[44] to In[47]; `sign` of the inertia in In[44]."""
    th3 = np.arcsin(-sin(th2) / 4)
    w3 = -w2 * cos(th2) / (4 * cos(th3))
    a3 = (w2**2 * sin(th2) + 4 * w3**2 * sin(th3)) / (4 * cos(th3))
    a_a = -(w2**2) * u(th2)
    a_b = a_a + 4 * a3 * v(th3) - 4 * w3**2 * u(th3)
    x2, y2, x3, y3 = *u(th2), *(4 * u(th3))
    A = np.array([
        [1, 0, 1, 0, 0, 0],
        [0, 1, 0, 1, 0, 0],
        [0, 0, y2, -x2, 0, 0],
        [0, 0, -1, 0, 0, -1],
        [0, 0, 0, -1, 1, 0],
        [0, 0, -y3, x3, 0, 0],
    ])  # fmt: skip
    c = [*(sign * mass_a * a_a), moment, *(mass_b * a_b), 0.0]
    v_b = w2 * v(th2) + 4 * w3 * v(th3)
    return np.linalg.solve(A, c), mass_a * a_a + mass_b * a_b, (v_b, mass_b * a_b)


def test_a_4_1_in_44_sign_of_the_inertia_force():
    """The forces from outside make up the momentum of both masses; In[46] has the sign right."""
    for th2 in (0.5, 2.0, 4.0):
        printed, momentum, _ = a_4_1_forces(th2, -1.0)
        right, _, (v_b, inertia_b) = a_4_1_forces(th2, 1.0)
        for f, holds in ((printed, False), (right, True)):
            outside = np.array([f[0] - f[5], f[1] + f[4]])
            assert bool(close(outside, momentum, rel=1e-9)) is holds
        # Moment and slider force together drive the slider: the power balance.
        assert close(10.0 * 10.0 - right[5] * v_b[0], inertia_b @ v_b)


def test_a_4_1_the_slider_force_has_spikes_at_the_dead_points():
    near = [abs(a_4_1_forces(x + np.pi, 1.0)[0][5]) for x in (1e-3, 1e-5, 1e-7)]
    np.testing.assert_allclose(np.diff(np.log10(near))[1], 2.0, atol=1e-2)


def test_a_4_2_in_6_angle_of_b():
    """In[6] takes the crank's angle; Out[6] is that of the vector b, as it must be."""
    th2 = 0.3 * np.pi
    b = np.array([4.0 - cos(th2), -sin(th2)])
    length = np.hypot(*b)
    A = (length**2 - 36 + 25) / (2 * length * 5)
    below = np.arctan2(5 / 6 * np.sqrt(1 - A**2), (length - 5 * A) / 6)
    printed = -1.21687  # theta_3 in Out[33]
    assert not close(th2 - below, printed, rel=0.1)
    assert close(np.arctan2(b[1], b[0]) - below, printed, rel=5e-6)


def test_v_inverted_slider_crank_formulas_that_are_right():
    """Figure 1.14b with link 3 as the driver: theta_2 = pi/2, r2 = 1, r3 = 2."""

    def b(t, f, offset):
        return -2 * f(crank(t)) - offset

    def angle(t):
        return mp.atan2(b(t, mp.sin, 1), b(t, mp.cos, 0))

    s = differentiated(
        th3=crank, th1=angle, r1=lambda t: mp.hypot(b(t, mp.sin, 1), b(t, mp.cos, 0))
    )
    w1, w3, a3, d = s.th11, s.th31, s.th32, s.th3 - s.th1
    assert close(w1, -2 / s.r1 * w3 * cos(d))  # 2.97
    assert close(s.r11, 2 * w3 * sin(d))  # 2.98
    numerator = -s.r11 * w1 + 2 * w3 * (w3 - w1) * sin(d) - 2 * a3 * cos(d)
    assert close(s.th12, numerator / s.r1)  # 2.139
    assert close(s.r12, 2 * a3 * sin(d) + 2 * w3 * (w3 - w1) * cos(d))  # 2.140


def five_bar(r3, r5, r1=2):
    """theta_3 and r4 of 2.64."""

    def b(t):
        return r1 - mp.expj(crank(t))

    def r4(t):
        return mp.sqrt(abs(b(t)) ** 2 - (r3 - r5) ** 2)

    return differentiated(
        th2=crank, r4=r4, th3=lambda t: mp.arg(b(t)) + mp.pi / 2 - mp.atan2(r3 - r5, r4(t))
    )


def test_v_2_144_the_offset_changes_with_r4():
    s = five_bar(1.5, 0.7)
    w2, w3, a2, d, k = s.th21, s.th31, s.th22, s.th3 - s.th2, (0.7 - 1.5) / s.r4
    assert close(w3, -w2 * sin(d) / s.r4)  # 2.101
    assert close(s.r41, w2 * (cos(d) + k * sin(d)))  # 2.102
    assert close(s.th32, (-w3 * s.r41 - a2 * sin(d) + w2 * (w2 - w3) * cos(d)) / s.r4)  # 2.143
    printed = a2 * (cos(d) + k * sin(d)) + w2 * (w3 - w2) * (-sin(d) + k * cos(d))
    assert not close(printed, s.r42, rel=0.01)
    assert close(printed - w2 * k * s.r41 / s.r4 * sin(d), s.r42)
    # In the book's example r3 = r5, and the term vanishes.
    s = five_bar(1.5, 1.5)
    d = s.th3 - s.th2
    printed = s.th22 * cos(d) - s.th21 * (s.th31 - s.th21) * sin(d)
    assert close(printed, s.r42)


def scotch_yoke(th4, r1=2):
    """r3 and r4 of 2.65 for theta_3 = 0."""
    return differentiated(
        th2=crank,
        r3=lambda t: r1 - mp.cos(crank(t)),
        r4=lambda t: -mp.sin(crank(t)) / mp.sin(th4),
    )


def test_v_2_3_5_frequency_of_the_scotch_yoke():
    """r4 = r2 sin theta_2 has the crank's frequency, not twice that."""
    th2 = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    b = np.array([2 - cos(th2), -sin(th2)])
    r4 = np.linalg.solve(np.array([u(0.0), u(3 * np.pi / 2)]).T, b)[1]
    harmonics = np.abs(np.fft.rfft(r4)) / 64
    assert harmonics[2] < 1e-15
    assert harmonics[1] == pytest.approx(0.5)


def test_v_2_103_and_2_145_sign_of_the_horizontal_slider():
    s = scotch_yoke(3 * mp.pi / 2)
    assert not close(-s.th21 * sin(s.th2), s.r31, rel=0.1)
    assert close(s.th21 * sin(s.th2), s.r31)
    printed = -s.th22 * sin(s.th2) - s.th21**2 * cos(s.th2)
    assert not close(printed, s.r32, rel=0.1)
    assert close(-printed, s.r32)


def test_v_2_146_sign_of_the_vertical_slider():
    """Printed for theta_4 = pi/2, as in 2.4.3; the text says 3 pi/2, as in 2.3.5."""
    up, down = scotch_yoke(mp.pi / 2), scotch_yoke(3 * mp.pi / 2)
    printed = -down.th22 * cos(down.th2) + down.th21**2 * sin(down.th2)
    assert not close(printed, down.r42, rel=0.1)
    assert close(-printed, down.r42)
    assert close(printed, up.r42)
    assert close(-up.th21 * cos(up.th2), up.r41)  # 2.104, which says pi/2


def loader_rates(th_i, th_j, r_i, r_j, r_rates, b_rate):
    """Two angular velocities: the rates of r_i u_i + r_j u_j = b as two linear equations."""
    A = np.array([r_i * v(th_i), r_j * v(th_j)]).T
    return np.linalg.solve(A, b_rate - r_rates[0] * u(th_i) - r_rates[1] * u(th_j))


def test_v_2_107_and_2_108_rates_of_the_second_loop():
    th2, th8, th9, w2, r8, r8_rate, r9, r10 = 0.3, 0.6, 1.9, 0.7, 1.1, 0.8, 0.8, 1.6
    w8, w9 = loader_rates(th8, th9, r8, r9, (r8_rate, 0.0), r10 * w2 * v(th2))
    printed = -(r8_rate * cos(th9 - th8) + r10 * w2 * sin(th2 - th9)) / (r8 * sin(th8 - th9))
    assert not close(printed, w8, rel=0.1)
    assert close(-printed, w8)  # r8 sin(theta_9 - theta_8) below
    printed = -(r8_rate + r10 * w2 * sin(th2 - th9)) / (r9 * sin(th8 - th9))
    right = -(r8_rate + r10 * w2 * sin(th2 - th8)) / (r9 * sin(th8 - th9))
    assert not close(printed, w9, rel=0.1)
    assert close(right, w9)


def test_v_rates_of_the_first_and_third_loop_are_right():
    th2, th3, r2, r3, r3_rate = 0.3, 1.4, 1.0, 0.9, 0.8
    w2, w3 = loader_rates(th2, th3, r2, r3, (0.0, r3_rate), np.zeros(2))
    assert close(w2, -r3_rate / (r2 * sin(th3 - th2)))  # 2.105
    assert close(w3, r3_rate / (r3 * np.tan(th3 - th2)))  # 2.106
    th9, th13, th14, w9, r12, r13, r14, r15 = 1.1, 0.5, 2.2, -0.6, 0.4, 1.1, 0.8, 1.2
    b_rate = -r12 * w9 * v(th9) + r15 * w2 * v(th2)
    w13, w14 = loader_rates(th13, th14, r13, r14, (0.0, 0.0), b_rate)
    above = r12 * w9 * sin(th9 - th14) - r15 * w2 * sin(th2 - th14)
    assert close(w13, above / (r13 * sin(th14 - th13)))  # 2.109
    above = r12 * w9 * sin(th9 - th13) - r15 * w2 * sin(th2 - th13)
    assert close(w14, above / (r14 * sin(th13 - th14)))  # 2.110


def test_v_2_6_angles_of_the_four_slotted_wheel():
    """2.147 and 2.148 give pi/2 for both, as r2/r1 = cos(beta/2) = 1/sqrt 2 needs; not pi."""
    gamma = 2 * np.pi / 4
    beta = np.pi - gamma
    assert gamma == pytest.approx(np.pi / 2)
    assert beta == pytest.approx(np.pi / 2)
    assert not close(cos(np.pi / 2), 1 / np.sqrt(2), rel=0.1)
    assert close(cos(beta / 2), 1 / np.sqrt(2))
