"""Misprints of the two sources, each told from the right formula by an independent route.

[V] is Vinogradov's book, [SB] Sharif-Bakhtiar's thesis; docs/misprints.md lists all of them and
says which are shown here. Every test writes down the formula as it is printed, shows that it
fails, and shows that the corrected one holds: against derivatives of positions taken numerically
with 40 digits, against the definitions, or against the motion and forces of the product. Crank,
coupler, rocker and frame are links 2, 3, 4 and 1.

Checked and right:

[SB] 4.1-20, 4.2-1, 5.2-9, 5.2-12, 5.2-13, 5.3-2 with consistent subscripts, 5.4-2c with the D1
above.
[V] 2.29 to 2.31, 2.34 to 2.37, 2.39 to 2.44, 2.46, 2.47, 2.49 to 2.51, 2.77, 2.78, 2.80 to 2.85,
2.90, 2.93 to 2.98, 2.101, 2.102, 2.105, 2.106, 2.109, 2.110, 2.115, 2.116, 2.135 to 2.143; 4.7,
4.14 to 4.16, 4.18 to 4.20, 4.33, 4.34, 4.45, 4.48, 4.53, 4.58; 5.7 to 5.9, 5.11 to 5.13, 5.15 to
5.20, 5.29 to 5.36, 5.38 to 5.42, 5.45 to 5.51, 5.55 to 5.57, 5.61 to 5.64, 5.68 to 5.71; 6.40,
6.41, 6.67 to 6.75, 6.77 to 6.81, 6.86, 6.87, 6.140 to 6.142, 6.153, 6.157, 6.158, 6.181 to 6.183,
6.187 to 6.189, 6.194, 6.199, 6.200, 6.205 to 6.213, 6.221, 6.246, 6.247, 6.278.
[V] numbers of 4.4.3; figures 2.7, 2.11 to 2.17, 2.19, 2.25, 2.28, 2.31, 6.32; A.4.1 Out[16],
Out[17], A.4.2 Out[33], Out[34]; A.5 Out[38], Out[39], Out[41], Out[49].
"""

from __future__ import annotations

from functools import cache

import mpmath as mp
import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.linkages.four_bar import FourBar

mp.mp.dps = 40

# [SB] table 6.1
l1, l2, l3, l4, c, g, w2 = 0.387, 0.064, 0.309, 0.312, 0.000254, 9.8145, 36.6519
m2, m3, m4, S2, S3, S4 = 0.6095, 0.2439, 0.2334, 0.009, 0.185, 0.134
IG2, IG3, IG4 = 0.002645, 0.002950, 0.003176
IA3, IO4 = IG3 + m3 * S3**2, IG4 + m4 * S4**2

cos, sin = np.cos, np.sin


def u(t):
    return np.array([np.cos(t), np.sin(t)])


def v(t):
    return np.array([-np.sin(t), np.cos(t)])


def rates(*functions, at=0.3, order=1):
    """Derivatives of functions of time at one instant."""
    return [float(mp.diff(f, at, order)) for f in functions]


def close(a, b, rel=1e-9):
    return a == pytest.approx(b, rel=rel)


@cache
def loose(*overrides):
    """The thesis four-bar over a revolution and a half, sampled between its events."""
    machine = ms.load_scene('four_bar_clearance', list(overrides))
    return ms.simulate(machine, revolutions=1.5)


def state(solution, t):
    """Angles and rates of links 2, 3, 4, and everything else by name."""
    x = {name: float(values[0]) for name, values in solution.sample(t).items()}
    links = ('crank', 'coupler', 'rocker')
    return [x[f'position.{n}'] for n in links], [x[f'velocity.{n}'] for n in links], x


@pytest.fixture
def flight():
    """The loose four-bar in free flight, with rates that no closed loop would have."""
    solution = loose(
        'start=centred',
        'drive.start_angle=0.4 rad',
        'initial.velocity.coupler=-3 rad/s',
        'initial.velocity.rocker=5 rad/s',
    )
    return state(solution, 0.0)


@pytest.fixture
def following():
    """The loose four-bar with its pin in contact."""
    found = state(loose(), 0.05)
    assert found[2]['closed.coupler_rocker'] == 1.0
    return found


# --- [SB] chapter 3: kinetic energy, following --------------------------------------------------


def coupler_centre():
    """Angles of crank and coupler, and the coupler's mass centre, as functions of time."""

    def th2(t):
        return mp.mpf('0.2') + w2 * t

    def th3(t):
        return mp.mpf('1.1') - 7 * t + 3 * t**2

    def x(t):
        return l2 * mp.cos(th2(t)) + S3 * mp.cos(th3(t))

    def y(t):
        return l2 * mp.sin(th2(t)) + S3 * mp.sin(th3(t))

    return th2, th3, x, y


def test_sb_3_1_2_5_speed_of_the_coupler():
    th2, th3, x, y = coupler_centre()
    vx, vy, w_2, w_3 = rates(x, y, th2, th3)
    product = 2 * l2 * S3 * w_2 * w_3 * cos(float(th3(0.3) - th2(0.3)))
    square = (l2 * w_2) ** 2 + (S3 * w_3) ** 2
    assert not close(square - product, vx**2 + vy**2, rel=0.1)
    assert close(square + product, vx**2 + vy**2)


def test_sb_3_1_3_1_energy_of_the_rocker():
    def th4(t):
        return mp.mpf('2.1') - 5 * t + t**2

    vx, vy, w_4 = rates(lambda t: S4 * mp.cos(th4(t)), lambda t: S4 * mp.sin(th4(t)), th4)
    energy = 0.5 * m4 * (vx**2 + vy**2) + 0.5 * IG4 * w_4**2
    assert not close(0.5 * m4 * S4 * w_4**2 + 0.5 * IG4 * w_4**2, energy, rel=0.1)
    assert close(0.5 * m4 * S4**2 * w_4**2 + 0.5 * IG4 * w_4**2, energy)


def test_sb_3_1_2_total_energy(flight):
    (th2, th3, _), (w_2, w_3, w_4), x = flight

    def total(sign, arm):
        return 0.5 * (
            (m2 * S2**2 + IG2) * w_2**2
            + m3 * ((l2 * w_2) ** 2 + (S3 * w_3) ** 2)
            + sign * m3 * 2 * l2 * S3 * w_2 * w_3 * cos(th3 - th2)
            + IG3 * w_3**2
            + m4 * arm * w_4**2
            + IG4 * w_4**2
        )

    assert close(total(1, S4**2), x['energy.kinetic'])
    for printed in (total(-1, S4), total(-1, S4**2), total(1, S4)):
        assert not close(printed, x['energy.kinetic'], rel=1e-3)


def solve_following(angles, speeds, swapped_3_3_2=False, row_six_of_3_3_8c=False):
    """Crank torque, force on the rocker, a4 and a3 by [SB] 3.3-7: links 2, 3, 4 and the clearance.

    The clearance counts as a massless link c from pin to bushing centre. Unknown are
    lambda_1..3, a4, a3, ac.
    """
    (th2, th3, th4), (w_2, w_3, w_4) = angles, speeds
    q = np.array([l1, 0.0]) + l4 * u(th4) - l2 * u(th2) - l3 * u(th3)
    C, thc = np.hypot(*q), np.arctan2(q[1], q[0])
    wc = v(thc) @ (l4 * w_4 * v(th4) - l2 * w_2 * v(th2) - l3 * w_3 * v(th3)) / C
    A = np.array(
        [
            [-1, -l2 * cos(th2), l2 * sin(th2), 0, m3 * l2 * S3 * cos(th2 - th3), 0],
            [0, -l3 * cos(th3), l3 * sin(th3), 0, IA3, 0],
            [0, -C * cos(thc), C * sin(thc), 0, 0, 0],
            [0, l4 * cos(th4), -l4 * sin(th4), IO4, 0, 0],
            [0, 0, 0, -l4 * sin(th4), l3 * sin(th3), C * sin(thc)],
            [0, 0, 0, -l4 * cos(th4), l3 * cos(th3), C * cos(thc)],
        ]
    )
    difference = th3 - th2 if swapped_3_3_2 else th2 - th3
    s2, s3, s4, sc = l2 * sin(th2), l3 * sin(th3), l4 * sin(th4), C * sin(thc)
    six = s2 * w_2**2 + s3 * w_3**2 + sc * wc**2 - s4 * w_4**2
    if row_six_of_3_3_8c:
        six = -s2 * w_2**2 + s3 * w_3**2 + sc * wc**2 + s4 * w_4**2
    B = [
        -(m2 * S2 + m3 * l2) * g * cos(th2) - m3 * l2 * S3 * sin(th2 - th3) * w_3**2,
        -m3 * g * S3 * cos(th3) + m3 * l2 * S3 * sin(difference) * w_2**2,
        0,
        -m4 * g * S4 * cos(th4),
        l4 * cos(th4) * w_4**2
        - l3 * cos(th3) * w_3**2
        - C * cos(thc) * wc**2
        - l2 * cos(th2) * w_2**2,
        six,
    ]
    torque, force_y, force_x, a4, a3, _ = np.linalg.solve(A, B)
    return np.array([torque, -force_x, -force_y, a4, a3])


def test_sb_3_3_7_equations_of_following(following):
    angles, speeds, x = following
    found = np.array(
        [
            x['drive_torque'],
            x['reaction.coupler_rocker.x'],
            x['reaction.coupler_rocker.y'],
            x['acceleration.rocker'],
            x['acceleration.coupler'],
        ]
    )
    np.testing.assert_allclose(solve_following(angles, speeds), found, rtol=1e-8)
    for variant in ({'swapped_3_3_2': True}, {'row_six_of_3_3_8c': True}):
        wrong = solve_following(angles, speeds, **variant)
        assert np.abs(wrong / found - 1.0).max() > 0.05


# --- [SB] chapter 4: free flight ----------------------------------------------------------------


def solve_4_1_19(th2, th3, weight):
    """[SB] 4.1-19 as printed: a3, w3^2 and the force on the crank, without a crank torque."""
    A = [
        [0, 0, l2 * sin(th2), -l2 * cos(th2)],
        [-m3 * S3 * sin(th3), -m3 * S3 * cos(th3), 1, 0],
        [m3 * S3 * cos(th3), -m3 * S3 * sin(th3), 0, 1],
        [IG3, 0, S3 * sin(th3), -S3 * cos(th3)],
    ]
    B = [
        -m2 * g * S2 * cos(th2),
        m3 * l2 * w2**2 * cos(th2),
        m3 * (l2 * w2**2 * sin(th2) + weight * g),
        0,
    ]
    return np.linalg.solve(A, B)


def equation_4_1_20(th2, th3):
    return m3 * S3 / IA3 * (l2 * w2**2 * sin(th2 - th3) - g * cos(th3))


def test_sb_4_1_19_makes_a_state_an_unknown(flight):
    (th2, th3, _), (_, w_3, _), x = flight
    a3, w3_squared, Fx, Fy = solve_4_1_19(th2, th3, weight=-1)
    assert not close(w3_squared, w_3**2, rel=0.5)
    assert not close(Fx, -x['reaction.crank_coupler.x'], rel=1e-2)
    # The angular acceleration is right all the same, and with w3 as the state it is, so is F.
    assert close(a3, x['acceleration.coupler'])
    assert close(a3, equation_4_1_20(th2, th3))
    Fx = m3 * (l2 * w2**2 * cos(th2) + S3 * w_3**2 * cos(th3) + S3 * a3 * sin(th3))
    Fy = m3 * (l2 * w2**2 * sin(th2) + S3 * w_3**2 * sin(th3) - S3 * a3 * cos(th3) - g)
    assert close(Fx, -x['reaction.crank_coupler.x'])
    assert close(Fy, -x['reaction.crank_coupler.y'])
    # The crank's moment equation gives the torque that 4.1-7 and 4.1-18c leave out.
    torque = l2 * (Fx * sin(th2) - Fy * cos(th2)) + m2 * g * S2 * cos(th2)
    assert close(torque, x['drive_torque'])
    assert abs(torque) > 0.1


def test_sb_4_1_18e_sign_of_the_weight(flight):
    (th2, th3, _), _, x = flight
    printed, right = (solve_4_1_19(th2, th3, weight)[0] for weight in (1, -1))
    assert not close(printed, x['acceleration.coupler'], rel=1e-2)
    assert close(right, x['acceleration.coupler'])


# --- [SB] chapters 5 and 7: impact --------------------------------------------------------------


class Strike:
    """The first impact after the free flight, with the coefficients [SB] 5.3-1."""

    def __init__(self):
        solution = loose('start=centred')
        self.e, self.impact = 0.5, solution.impacts[0]
        self.angles, self.after, _ = state(solution, self.impact.t)
        _, th3, th4 = self.angles
        # Rates before: those after, less what the impulse did (along n, which is u(eta)).
        eta, P = self.impact.normal_angle, self.impact.normal_impulse
        self.eta = eta
        before = state(solution, np.nextafter(self.impact.t, 0.0))[1]
        np.testing.assert_allclose(
            before[1:],
            [
                self.after[1] + l3 * (v(th3) @ u(eta)) * P / IA3,
                self.after[2] - l4 * (v(th4) @ u(eta)) * P / IO4,
            ],
            rtol=1e-9,
        )
        self.before = before
        self.rho, self.gamma = contact_arm(eta, th4)
        alpha = th4 - self.gamma
        self.mu3 = l3 * sin(eta - th3)
        self.mu4 = l4 * sin(eta - th4)
        self.mu5 = l2 * sin(eta - self.angles[0])
        self.mu6 = self.rho * sin(eta - th4 + alpha)


def contact_arm(eta, th4, xi=c):
    """Length and angle of the line from the rocker's pivot to the point of contact."""
    arm = l4 * u(th4) + xi * u(eta)
    return np.hypot(*arm), np.arctan2(arm[1], arm[0])


@pytest.fixture(scope='module')
def strike():
    return Strike()


def test_sb_5_2_11_angle_of_the_contact_arm():
    eta, th4, xi = 0.9, 2.1, 0.05
    rho, gamma = contact_arm(eta, th4, xi)
    alpha = th4 - gamma
    assert close(rho, (l4**2 + xi**2 + 2 * l4 * xi * cos(eta - th4)) ** 0.5)  # 5.2-12
    assert close(sin(alpha), xi / rho * sin(th4 - eta))  # 5.2-9
    assert not close(rho * sin(alpha), l4 * sin(th4) + xi * sin(eta), rel=0.1)
    assert close(rho * sin(gamma), l4 * sin(th4) + xi * sin(eta))


def test_sb_5_3_1f_arm_of_the_tangential_impulse():
    eta, th4, xi = 0.9, 2.1, 0.05
    arm = l4 * u(th4) + xi * u(eta)
    moment = arm[0] * v(eta)[1] - arm[1] * v(eta)[0]
    assert not close(l4 * cos(eta - th4 + xi), moment, rel=0.1)
    assert close(l4 * cos(eta - th4) + xi, moment)


def test_sb_5_3_2_2b_tangential_speed_of_the_bushing():
    eta, th4, xi, w_4 = 0.9, 2.1, 0.05, -7.0

    def point(t, axis):
        """The point of the rocker that is in contact, carried along."""
        turned = [mp.mpf(th4) + w_4 * t, mp.mpf(eta) + w_4 * t]
        f = mp.cos if axis == 0 else mp.sin
        return l4 * f(turned[0]) + xi * f(turned[1])

    speed = np.array(rates(lambda t: point(t, 0), lambda t: point(t, 1), at=0)) @ v(eta)
    rho, gamma = contact_arm(eta, th4, xi)
    alpha = th4 - gamma
    assert not close(rho * w_4 * cos(eta - th4 - alpha), speed, rel=0.1)
    assert close(rho * w_4 * cos(eta - th4 + alpha), speed)


def test_sb_5_3_2_holds_for_the_impacts_of_the_product(strike):
    s = strike
    assert close(s.mu4, s.mu6)
    A = [[IA3, 0, s.mu3], [0, IO4, -s.mu4], [-s.mu3, s.mu6, 0]]
    _, w_3, w_4 = s.before
    B = [IA3 * w_3, IO4 * w_4, s.e * (s.mu3 * w_3 - s.mu6 * w_4) + (1 + s.e) * s.mu5 * w2]
    right = np.linalg.solve(A, B)
    np.testing.assert_allclose(right, [*s.after[1:], s.impact.normal_impulse], rtol=1e-9)
    A[2] = [-s.mu3, -s.mu6, 0]  # as 5.4-1 prints this row
    printed = np.linalg.solve(A, B)
    assert not close(printed[2], s.impact.normal_impulse, rel=0.1)


def test_sb_5_4_2_solution_of_the_smooth_impact(strike):
    s = strike
    _, w_3, w_4 = s.before
    F = IA3 * IO4 * (1 + s.e) * (s.mu3 * w_3 - s.mu6 * w_4 + s.mu5 * w2)
    D1 = IA3 * s.mu6 * s.mu4 + IO4 * s.mu3 * s.mu3
    assert close(F / D1, s.impact.normal_impulse)
    assert not close(F / (IA3 * s.mu6 * s.mu4 + IO4 * s.mu3), s.impact.normal_impulse, rel=0.1)
    rest = (s.mu3 * w_3 + s.mu5 * w2) * (1 + s.e) * IA3 * s.mu4
    right = ((IO4 * s.mu3 * s.mu3 - s.e * IA3 * s.mu6 * s.mu4) * w_4 + rest) / D1
    printed = ((IO4 * s.mu3 - s.e * IA3 * s.mu4) * w_4 + rest) / D1
    assert close(right, s.after[2])
    assert not close(printed, s.after[2], rel=0.1)


def test_sb_7_3_the_index_sums_normal_impulses():
    """Without friction the tangential impulses of chapter 5 are zero, and so is their sum."""
    impacts = loose('start=centred').impacts
    assert sum(abs(i.tangential_impulse) for i in impacts) == 0.0
    assert sum(i.normal_impulse for i in impacts) / len(impacts) > 1e-4


# --- [V] chapter 2 ------------------------------------------------------------------------------

# A vector of unknown direction and one of unknown length, at fixed angles to each other (2.45).
ri, rj, rk, gamma, beta, thi = 1.3, 0.8, 0.6, 0.7, 1.9, 0.4


def fifth_case():
    """Sum of the three vectors: length and angle."""
    b = ri * u(thi) + rj * u(thi - gamma) + rk * u(thi - beta)
    return np.hypot(*b), np.arctan2(b[1], b[0])


def test_v_2_48_square_of_the_sum():
    b, _ = fifth_case()
    right = (
        ri**2
        + rj**2
        + rk**2
        + 2 * ri * rk * cos(beta)
        + 2 * rj * ri * cos(gamma)
        + 2 * rj * rk * cos(gamma - beta)
    )
    assert not close(right + 2 * ri * rk * cos(gamma) * cos(gamma - beta), b**2, rel=0.01)
    assert close(right, b**2)
    # 2.49 is printed without the extra term.
    linear = 2 * ri * cos(gamma) + 2 * rk * cos(gamma - beta)
    constant = ri**2 + rk**2 + 2 * ri * rk * cos(beta) - b**2
    assert abs(rj**2 + linear * rj + constant) < 1e-12


def test_v_2_52_cosine_of_zeta():
    b, alpha = fifth_case()
    printed = (ri * cos(gamma) + rk * cos(gamma - beta)) / b
    assert not close(printed, cos(alpha - thi + gamma), rel=0.1)
    assert close(printed + rj / b, cos(alpha - thi + gamma))


def test_v_2_134_denominator_of_the_fifth_case():
    """T_j multiplies the unknown rate of r_j once the unknown rate of theta_i has dropped out."""
    dx = -ri * sin(thi) - rj * sin(thi - gamma) - rk * sin(thi - beta)
    dy = ri * cos(thi) + rj * cos(thi - gamma) + rk * cos(thi - beta)
    wi, rj_rate = 1.7, -0.9
    b_rate = np.array([dx, dy]) * wi + rj_rate * u(thi - gamma)  # 2.87, r_i and r_k constant
    numerator = -dy * b_rate[0] + dx * b_rate[1]
    printed = -dy * cos(thi - gamma) + dy * sin(thi - gamma)
    right = -dy * cos(thi - gamma) + dx * sin(thi - gamma)
    assert not close(numerator / printed, rj_rate, rel=0.1)
    assert close(numerator / right, rj_rate)


@pytest.mark.parametrize('N', [3, 4, 6, 8])
def test_v_2_149_time_in_the_slot(N):
    """The pin enters where the crank is square to the slot, half a pitch off the centres."""
    half = np.pi / N
    r2, w = np.sin(half), 2.5  # distance of the centres: 1
    pin = np.array([1.0, 0.0]) - np.cos(half) * u(-half)  # along the slot, from the wheel
    assert close(np.hypot(*pin), r2)
    assert abs(pin @ u(-half)) < 1e-12
    tau = 2 * np.arctan2(pin[1], pin[0]) / w
    assert not close((np.pi * N - 2) / (N * w), tau, rel=0.1)
    assert close(np.pi * (N - 2) / (N * w), tau)


def test_v_2_121_angular_acceleration_with_changing_lengths():
    """Two vectors of given, changing lengths add up to a given vector (fourth case)."""

    def thi_(t):
        return mp.mpf('0.4') + t - t**2 / 2

    def thj_(t):
        return mp.mpf('2.0') - 2 * t + t**2

    def ri_(t):
        return mp.mpf('1.3') + t / 3 + t**2

    def rj_(t):
        return mp.mpf('0.9') - t / 4 + 2 * t**2

    def bx(t):
        return ri_(t) * mp.cos(thi_(t)) + rj_(t) * mp.cos(thj_(t))

    def by(t):
        return ri_(t) * mp.sin(thi_(t)) + rj_(t) * mp.sin(thj_(t))

    functions = (thi_, thj_, ri_, rj_, bx, by)
    ti, tj, r_i, r_j, *_ = (float(f(0.3)) for f in functions)
    wi, wj, ri1, rj1, bx1, by1 = rates(*functions)
    ai, aj, ri2, rj2, bx2, by2 = rates(*functions, order=2)

    def acceleration(r, r1, r2_own, last, w, other, th, th_other):
        """2.121 with its third term, an acceleration of a length, given."""
        return (
            (-w * r * (other - w) - r2_own) * cos(th_other - th)
            + r1 * (other - 2 * w) * sin(th_other - th)
            - last
            + (bx2 + by1 * other) * cos(th_other)
            + (by2 - bx1 * other) * sin(th_other)
        ) / (r * sin(th_other - th))

    assert not close(acceleration(r_i, ri1, ri2, ri2, wi, wj, ti, tj), ai, rel=0.1)
    assert close(acceleration(r_i, ri1, ri2, rj2, wi, wj, ti, tj), ai)
    # 2.122, for which printed is the acceleration of r_j again
    assert not close(acceleration(r_j, rj1, rj2, rj2, wj, wi, tj, ti), aj, rel=0.1)
    assert close(acceleration(r_j, rj1, rj2, ri2, wj, wi, tj, ti), aj)


def test_v_2_141_and_2_142_are_right():
    """The four-bar's own formulas, against the closed form of the product."""
    th2, w_2, a_2 = np.linspace(0.0, 6.0, 13), 3.0, -7.0
    (_, th3, th4), (_, w3, w4), (_, a3, a4) = FourBar(l1, l2, l3, l4).motion(
        th2, np.full(13, w_2), np.full(13, a_2)
    )
    th4 = th4 + np.pi  # [V] draws the rocker from the pin to the frame
    a3_printed = (
        -l3 * w3 * (w4 - w3) * cos(th4 - th3)
        + l2 * a_2 * sin(th2 - th4)
        + l2 * w_2 * (w_2 - w4) * cos(th2 - th4)
    ) / (l3 * sin(th4 - th3))
    a4_printed = (
        -l4 * w4 * (w3 - w4) * cos(th3 - th4)
        + l2 * a_2 * sin(th2 - th3)
        + l2 * w_2 * (w_2 - w3) * cos(th2 - th3)
    ) / (l4 * sin(th3 - th4))
    np.testing.assert_allclose(a3_printed, a3, rtol=1e-10)
    np.testing.assert_allclose(a4_printed, a4, rtol=1e-10)


def test_v_figure_1_15c_the_coupler_revolves_too():
    """[V] 1.7 names two revolving links of the double-crank; its coupler makes full turns too."""
    th2 = np.linspace(0.0, 2.0 * np.pi, 721)
    for branch in ('open', 'crossed'):
        th3, th4 = FourBar(1.0, 3.5, 4.0, 5.0, branch).positions(th2)
        for th in (th3, th4):
            turned = np.unwrap(th)[-1] - np.unwrap(th)[0]
            assert close(turned, 2.0 * np.pi)
