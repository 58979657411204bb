"""Chapter 6 of [V] and A.6: as printed it fails, as corrected it holds by a second route."""

from __future__ import annotations

import math

import numpy as np
import pint
import pytest
import state_space
from damping import (
    damping_coefficient,
    damping_ratio,
    decrement,
    energy_loss,
    logarithmic_decrement,
    loss_factors,
)
from excitations import PeriodicForce, base_excited, periodic_response, relative_transmissibility
from oscillator import Oscillator
from rotors import DiskRotor, Rotor, influence_coefficients, peak_radius
from two_masses import TwoMasses

from mechanism_sim.vibration.shafts import shaft_rigidity
from mechanism_sim.vibration.systems import state_matrix

WN, XI, M, P0 = 7.0, 0.15, 2.0, 3.0
OSCILLATOR = Oscillator.of_ratio(WN, XI, M)
UNITS = pint.UnitRegistry()


def late(o, force, w):
    """Displacement and velocity when the start is forgotten, by the state space, and the times."""
    a = float(o.decay_rate)
    t = 45.0 / a + np.linspace(0.0, 4.0 * math.pi / w, 400)
    A = state_matrix(*(np.array([[x]]) for x in (o.mass, o.damping, o.stiffness)))
    b = state_space.input_vector(np.array([[o.mass]]), [force])
    return t, *state_space.forced(A, t, b, [w], np.zeros(2))


def test_v_6_8_frequency_in_hertz():
    """Turns counted over 100 s of free vibration; as printed it is the period squared, over it."""
    o = Oscillator.of_coefficients(2.0, 0.0, 50.0)
    t = np.linspace(0.0, 100.0, 200_001)
    upward = np.count_nonzero(np.diff(np.sign(o.free(t, 0.0, 1.0).displacement)) > 0)
    assert upward / 100.0 == pytest.approx(math.sqrt(50.0 / 2.0) / (2 * math.pi), rel=0.01)
    assert upward / 100.0 == pytest.approx(1.0 / o.period, rel=0.01)
    assert 1 / (2 * math.pi * math.sqrt(50.0 / 2.0)) < 0.05 * upward / 100.0


def test_v_6_63_resonance_in_time():
    """The limit of 6.62 from both sides; as printed p0 and a frequency are missing."""
    p0, t = P0 / M, np.linspace(0.1, 9.0, 50)

    def off(w):
        return p0 / (WN**2 - w**2) * (np.sin(w * t) - w / WN * np.sin(WN * t))

    printed = (-np.sin(WN * t) + WN * t * np.cos(WN * t)) / (-2 * WN)
    limit = (off(WN * (1 + 1e-5)) + off(WN * (1 - 1e-5))) / 2
    undamped = Oscillator(WN, 0.0, M)
    np.testing.assert_allclose(p0 / WN * printed, limit, atol=1e-8)
    np.testing.assert_allclose(
        undamped.forced(t, -1j * P0, WN).displacement, p0 / WN * printed, rtol=1e-11, atol=1e-15
    )
    assert np.abs(printed - limit).max() > 1.0


def test_v_6_64_force_per_mass():
    """A force P0 where p0 = P0/m belongs, as in 6.62: 6.64 to 6.66, 6.89, 6.91, 6.92 to 6.98."""
    w = 4.0
    _, y, _ = late(OSCILLATOR, P0, w)
    size = math.hypot(WN**2 - w**2, 2 * XI * WN * w)
    assert np.abs(y).max() == pytest.approx(P0 / M / size, rel=1e-4)
    assert abs(P0 / size / np.abs(y).max() - 1) > 0.9
    # the chain below 6.65 says the same: its first member is P0/k times the mass
    static = P0 / OSCILLATOR.stiffness
    assert static == pytest.approx(P0 / M / WN**2, rel=1e-15)
    assert static == pytest.approx(P0 / WN**2 / M, rel=1e-15)


def test_v_6_90_the_response_lags_above_resonance_too():
    """Maxima of the response come after those of the force at any frequency."""
    for w in (0.5 * WN, 0.99 * WN, 1.01 * WN, 2.0 * WN, 5.0 * WN):
        t, y, v = late(OSCILLATOR, -1j * P0, w)
        lag = np.angle(np.exp(1j * (w * t - np.arctan2(w * y, v))))  # y = D sin(w t - lag)
        np.testing.assert_allclose(lag, OSCILLATOR.phase_lag(w), atol=1e-9)
        assert lag.min() > 0.0
        printed = math.atan(2 * XI * WN * w / (WN**2 - w**2))
        assert (printed < 0.0) == (w > WN)  # called a lead in the text
        assert (abs(printed - lag[0]) > 3.0) == (w > WN)


def test_v_6_91_greatest_amplitude():
    w = WN * np.sqrt(1 - 2 * XI**2)
    greatest = abs(OSCILLATOR.receptance(np.linspace(0.5 * WN, 1.5 * WN, 1_000_001))).max()
    assert w == pytest.approx(OSCILLATOR.peak_frequency, rel=1e-15)
    assert OSCILLATOR.peak_receptance == pytest.approx(greatest, rel=1e-10)
    right = 1 / (M * 2 * XI * WN**2 * math.sqrt(1 - XI**2))
    assert right == pytest.approx(greatest, rel=1e-10)
    assert abs(1 / (M * 2 * XI * WN**2 * math.sqrt(1 - 2 * XI**2)) / greatest - 1) > 0.01


def test_v_6_98_angle_of_the_frequency_response():
    """With the angle of 6.97, which is negative, the response would come before the force."""
    w = 0.7 * WN
    H = M * OSCILLATOR.receptance(w)
    phi = -math.atan(2 * XI * WN * w / (WN**2 - w**2))  # 6.97
    t, y, _ = late(OSCILLATOR, P0, w)
    np.testing.assert_allclose((P0 / M * abs(H) * np.exp(1j * (w * t + phi))).real, y, atol=1e-12)
    assert abs(abs(H) * np.exp(1j * phi) / H - 1) < 1e-14
    assert abs(abs(H) * np.exp(-1j * phi) / H - 1) > 0.5  # 6.99
    printed = (P0 / M * abs(H) * np.exp(1j * (w * t - phi))).real
    assert np.abs(printed - y).max() > 0.5 * np.abs(y).max()


@pytest.mark.parametrize('xi', [0.01, 0.2, 0.7, 0.95])
def test_v_6_104_and_6_105_damping_from_the_decrement(xi):
    o = Oscillator.of_ratio(WN, xi, M)
    peaks = o.free(2 * np.pi / o.damped_frequency * np.arange(6), 1.0).displacement
    d = logarithmic_decrement(peaks)
    assert d == pytest.approx(decrement(xi), rel=1e-12)
    assert damping_ratio(d) == pytest.approx(xi, rel=1e-12)
    assert damping_coefficient(d, M, WN) == pytest.approx(o.damping, rel=1e-12)
    square = 4 * math.pi**2 - d**2
    if square > 0:
        assert d / math.sqrt(square) - xi > 0.8 * xi**3  # d = 2 pi xi/sqrt(1 - xi^2)
    else:
        assert xi == 0.95  # no damping ratio at all


def test_v_6_108_force_times_velocity_is_power():
    force, speed = UNITS.Quantity(3.0, 'N'), UNITS.Quantity(2.0, 'm/s')
    assert (force * speed).check('[power]')
    assert not (force * speed).check('[energy]')


def test_v_6_110_work_of_the_damper():
    """The integrand is the square of the velocity; as printed it is that of the displacement."""
    w = float(OSCILLATOR.damped_frequency)
    t, y, v = late(OSCILLATOR, P0, w)
    half = slice(0, 200)  # 400 samples of two periods, both ends included
    step = t[1] - t[0]
    size = abs(P0 * OSCILLATOR.receptance(w))
    work = np.trapezoid(OSCILLATOR.damping * v**2, dx=step) / 2
    assert energy_loss(OSCILLATOR.damping, size, w) == pytest.approx(work, rel=1e-8)
    assert np.trapezoid(OSCILLATOR.damping * y[half] ** 2, dx=step) < 0.05 * work


def test_v_6_113_loss_over_energy():
    """Potential and kinetic energy differ off wn, and 6.113 is right for neither."""
    w = float(OSCILLATOR.damped_frequency)
    _, y, v = late(OSCILLATOR, P0, w)
    potential = OSCILLATOR.stiffness * np.abs(y).max() ** 2 / 2
    kinetic = M * np.abs(v).max() ** 2 / 2
    loss = energy_loss(OSCILLATOR.damping, abs(P0 * OSCILLATOR.receptance(w)), w)
    factors = loss_factors(XI)
    assert factors[0] == pytest.approx(loss / potential, rel=1e-3)
    assert factors[1] == pytest.approx(loss / kinetic, rel=1e-3)
    assert kinetic / potential == pytest.approx(1 - XI**2, rel=1e-3)
    assert loss / potential == pytest.approx(2 * math.pi * w * 2 * XI / WN, rel=1e-3)  # 6.112
    printed = 2 * decrement(XI) * math.sqrt(1 - XI**2)
    assert all(abs(printed / f - 1) > 0.01 for f in factors)


def test_v_6_11_a_sum_of_periodic_functions_need_not_be_periodic():
    """cos(t) + cos(sqrt(2) t) is 2 at t = 0 only: n turns of one are not m of the other."""
    n = np.arange(1, 1_000_000)
    turns = math.sqrt(2) * n
    assert (n * np.abs(turns - np.round(turns))).min() > 1 / 3
    assert (2 * n**2 - np.round(turns).astype(int) ** 2 != 0).all()  # in integers, exactly


def test_v_6_118_and_6_119_relative_motion():
    """By the absolute motion of mass and base; as printed the sign is wrong."""
    Yb, w = 0.01, 4.0
    t = 45.0 / (XI * WN) + np.linspace(0, 2, 50)
    base = Yb * np.sin(w * t)
    absolute = base_excited(OSCILLATOR, t, -1j * Yb, w).displacement
    H = OSCILLATOR.receptance(w)
    right = (-1j * M * Yb * w**2 * H * np.exp(1j * w * t)).real
    np.testing.assert_allclose(absolute - base, right, atol=1e-14)
    assert np.abs(absolute - base + right).max() > np.abs(right).max()  # 6.118
    assert relative_transmissibility(OSCILLATOR, w) == pytest.approx(M * w**2 * H)
    # 2 xi wn c y' of 6.119 has the dimension of a force times an acceleration over a length
    c, speed = UNITS.Quantity(1.0, 'N s/m'), UNITS.Quantity(1.0, 'm/s')
    assert not (UNITS.Quantity(1.0, '1/s') * c * speed).check('[acceleration]')
    assert (UNITS.Quantity(1.0, '1/s') * speed).check('[acceleration]')


def test_v_6_128_to_6_133_harmonics():
    """A harmonic j is answered at j w, and a cosine by a cosine."""
    w, a, b = 2.0, 3.0, -1.5
    force = PeriodicForce(w, 0.0, np.array([0.0, 0.0, a - 1j * b]))
    t = 45.0 / (XI * WN) + np.linspace(0, 4, 200)
    y = periodic_response(OSCILLATOR, t, force).displacement

    def terms(frequency, of_the_cosine):
        D = 1 / (M * math.hypot(WN**2 - frequency**2, 2 * XI * WN * frequency))
        phi = math.atan2(2 * XI * WN * frequency, WN**2 - frequency**2)
        angle = frequency * t - phi
        return a * D * of_the_cosine(angle) + b * D * np.sin(angle)

    np.testing.assert_allclose(y, terms(3 * w, np.cos), atol=1e-13)
    for printed in (terms(w, np.cos), terms(3 * w, np.sin), terms(w, np.sin)):
        assert np.abs(printed - y).max() > 0.5 * np.abs(y).max()


def test_v_6_177_and_6_179_quadrant_of_the_phases():
    """The book's own case, figure 6.19: the first mass is displaced; arctan turns it round."""
    two = TwoMasses(1.0, 1.0, 1.0, 1.0)
    (w1, w2), (r1, r2) = two.natural_frequencies, two.mode_ratios
    D10, D20, V10, V20 = 1.0, 0.0, 0.3, 0.0
    s1, s2 = (-r2 * V10 + V20) / w1, (-r1 * V10 + V20) / w2
    D1 = math.hypot(r2 * D10 - D20, s1) / (r2 - r1)
    D2 = math.hypot(r1 * D10 - D20, s2) / (r1 - r2)
    printed = [math.atan(s1 / (r2 * D10 - D20)), math.atan(s2 / (r1 * D10 - D20))]
    right = [math.atan2(s1, r2 * D10 - D20), math.atan2(s2, r1 * D10 - D20)]

    def first(phases, t):
        return D1 * np.cos(w1 * t + phases[0]) + D2 * np.cos(w2 * t + phases[1])

    t = np.linspace(0.0, 20.0, 100)
    start = np.array([D10, D20, V10, V20])
    y = state_space.free(two.system.state_matrix, t, start)[0]
    np.testing.assert_allclose(first(right, t), y, atol=1e-12)
    np.testing.assert_allclose(two.free_undamped(t, start[:2], start[2:])[0], y, atol=1e-12)
    assert first(printed, 0.0) == pytest.approx(math.sqrt(0.2))  # and not D10 = 1


def test_v_6_190_and_6_193_roots_of_the_first_mode():
    """Of the polynomial 6.189; as printed the motion grows."""
    xi, root5 = 0.2, math.sqrt(5)
    two = TwoMasses(1.0, 1.0, WN**2, WN**2, 2 * xi * WN, 2 * xi * WN)
    c = 2 * xi * WN
    polynomial = [1, 3 * c, 3 * WN**2 + c**2, 2 * c * WN**2, WN**4]
    np.testing.assert_allclose(two.characteristic_polynomial, polynomial, rtol=1e-15)
    bending = np.sqrt(4 * xi**2 * (7 - 3 * root5) - (12 - 4 * root5) + 0j)
    slow = (-(3 - root5) / 2 * xi + math.sqrt(2) / 4 * bending) * WN
    fast_bending = np.sqrt(4 * xi**2 * (7 + 3 * root5) - (12 + 4 * root5) + 0j)
    fast = (-(3 + root5) / 2 * xi + math.sqrt(2) / 4 * fast_bending) * WN  # 6.194
    found = two.roots[two.roots.imag > 0]
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex([slow, fast]), rtol=1e-12)
    printed = np.sqrt(4 * xi**2 * (7 - 3 * root5) + (12 - 4 * root5) + 0j)
    printed = ((3 + root5) / 2 * xi + math.sqrt(2) / 4 * printed) * WN
    assert printed.real > 0.0
    assert abs(np.polyval(polynomial, printed)) > WN**4
    # the critical values that follow, 6.199 and 6.200, are right
    for xi, oscillating in ((0.61803, 4), (0.61804, 2), (1.61803, 2), (1.61804, 0)):
        c = 2 * xi * WN
        roots = TwoMasses(1.0, 1.0, WN**2, WN**2, c, c).roots
        assert np.count_nonzero(np.abs(roots.imag) > 1e-9) == oscillating


def test_v_6_13_3_damping_of_the_example():
    """For xi = 0.05 and k/m = 10/s^2 c/m is 0.316/s, and the lowest critical value 12 times xi."""
    c = 2 * 0.05 * math.sqrt(10.0)
    assert c == pytest.approx(0.316, abs=5e-4)
    assert Oscillator.of_coefficients(1.0, c, 10.0).damping_ratio == pytest.approx(0.05)
    assert Oscillator.of_coefficients(1.0, 0.0316, 10.0).damping_ratio == pytest.approx(
        0.005, 1e-3
    )
    assert 0.618034 / 0.05 > 12.0


def test_v_6_214_which_force_is_zero():
    """With p2 = 0, as the text has it, 6.214 and 6.215 are zero; they are those of p1 = 0."""
    two, w, p = TwoMasses(1.0, 1.0, 10.0, 10.0, 0.3, 0.3), 2.5, 0.7
    k, c = 10.0, 0.3
    z11, z12, z22 = 2 * k - w**2 + 2j * w * c, -k - 1j * w * c, k - w**2 + 1j * w * c
    quotients = np.array([-z12 * p, z11 * p]) / (z11 * z22 - z12**2)
    np.testing.assert_allclose(quotients, two.steady(w, 0.0, p), rtol=1e-14)
    assert np.abs(two.steady(w, p, 0.0) - quotients).max() > 0.1 * np.abs(quotients).max()


def sizes_and_angles():
    """Two equal masses under p2, by the linear system; and the sums that 6.219 to 6.222 share."""
    m, k, c, w = 1.3, 10.0, 0.4, 2.7
    two = TwoMasses(m, m, k, k, c, c)
    D = np.linalg.solve(two.system.impedance(w), [0.0, 1.0])
    long = k**4 - 6 * k**3 * m * w**2 - 6 * k * m * w**4 * (c**2 + m**2 * w**2)
    long += k**2 * (2 * c**2 * w**2 + 11 * m**2 * w**4)
    short = w**4 * (c**4 + 7 * c**2 * m**2 * w**2 + m**4 * w**4)
    R = k**2 - c**2 * w**2 - 3 * k * m * w**2 + m**2 * w**4
    Q = 2 * c * k - 3 * c * m * w**2
    return m, k, c, w, D, long, short, R, Q


def test_v_6_219_and_6_220_grouping():
    """Both fractions are one, with the sum of the denominators; a factor w^2 lacks in 6.220."""
    m, k, c, w, D, long, short, _, _ = sizes_and_angles()
    np.testing.assert_allclose(TwoMasses(m, m, k, k, c, c).steady(w), D, rtol=1e-13)
    first, second = k**2 + c**2 * w**2, 4 * c**2 * w**2 + (-2 * k + m * w**2) ** 2
    assert math.sqrt(first / (long + short)) == pytest.approx(abs(D[0]), rel=1e-12)
    assert math.sqrt(second / (long + short)) == pytest.approx(abs(D[1]), rel=1e-12)
    assert abs(first / long + short / short - abs(D[0]) ** 2) > 0.5
    printed = 4 * c**2 + (-2 * k + m * w**2) ** 2
    assert abs(math.sqrt(printed / (long + short)) / abs(D[1]) - 1) > 1e-3


def test_v_6_222_two_factors_of_the_frequency():
    """6.221 is right; 6.222 adds terms of unlike dimension."""
    m, k, c, w, D, _, _, R, Q = sizes_and_angles()
    tangent = (-k * w * Q + c * w * R) / (c * w**2 * Q + k * R)
    assert tangent == pytest.approx(D[0].imag / D[0].real, rel=1e-11)
    far = -2 * k + m * w**2
    right = (-far * w * Q - 2 * c * w * R) / (-2 * c * w**2 * Q + far * R)
    assert right == pytest.approx(D[1].imag / D[1].real, rel=1e-11)
    printed = (-far * w * Q - 2 * c * R) / (-2 * c * w * Q + far * R)
    assert abs(printed / right - 1) > 0.1


def test_v_6_231_and_6_233_side_of_the_deflection():
    """A root has no sign: above the critical speed r is negative, and rc needs it so."""
    rotor, e = Rotor(M, 1e-3, (M * WN**2, M * WN**2)), 1e-3
    for w in (0.5 * WN, 1.2 * WN, 3.0 * WN):
        x = rotor.whirl(w).points(0.0)[0]
        signed = e * w**2 / (WN**2 - w**2)
        assert x == pytest.approx(signed, rel=1e-14)
        assert (math.sqrt(signed**2) == pytest.approx(signed)) == (w < WN)  # 6.231
        centre = rotor.mass_centre(w).points(0.0)[0]
        assert centre == pytest.approx(signed + e, rel=1e-13)
        assert centre == pytest.approx(e * WN**2 / (WN**2 - w**2), rel=1e-13)


def test_v_6_14_1_the_mass_centre_comes_near_beyond_the_root_of_two():
    """The text has rc < e for all speeds above the critical one; right above it rc is large."""
    rotor = Rotor(M, 1e-3, (M * WN**2, M * WN**2))
    for ratio, nearer in ((1.05, False), (1.4, False), (1.42, True), (5.0, True)):
        distance = np.hypot(*rotor.mass_centre(ratio * WN).points(0.3))
        assert (distance < 1e-3) == nearer


def test_v_6_14_3_synchronous_means_a_constant_angle():
    """Not phi = 0: a damped rotor whirls synchronously at an angle that does not change."""
    rotor = Rotor(M, 1e-3, (M * WN**2,) * 2, (2 * M * WN * 0.1,) * 2)
    w, t = 0.9 * WN, 45.0 / (0.1 * WN) + np.linspace(0.0, 3.0, 50)
    angle = np.angle(np.exp(-1j * w * t) * (rotor.motion(t, w).T @ [1.0, 1.0j]))
    assert np.ptp(angle) < 1e-12
    assert angle[0] < -0.7


def test_v_6_245_sign_and_quadrant():
    """The angle of z0 is negative, as the text below says, and goes on to -pi."""
    rotor = Rotor(M, 1e-3, (M * WN**2,) * 2, (2 * M * WN * 0.1,) * 2)
    for w in (0.5 * WN, 2.0 * WN):
        t = 45.0 / (0.1 * WN) + np.linspace(0.0, 3.0, 5)
        z = rotor.motion(t, w).T @ [1.0, 1.0j] * np.exp(-1j * w * t)
        printed = math.atan(2 * w * WN * 0.1 / (WN**2 - w**2))
        right = -math.atan2(2 * w * WN * 0.1, WN**2 - w**2)
        np.testing.assert_allclose(np.angle(z), right, atol=1e-12)
        assert np.abs(np.angle(z) - printed).min() > 0.2


def test_v_6_237_equation_of_the_whirl():
    """z'' by differences of the path; with the sign printed nothing balances."""
    m, e, k, c, w = M, 1e-3, M * WN**2, 2 * M * WN * 0.1, 0.8 * WN
    rotor, h = Rotor(m, e, (k, k), (c, c)), 1e-4
    before, z, after = (rotor.motion(2.0 + h * np.array([-1, 0, 1]), w).T @ [1.0, 1.0j]).tolist()
    rate, second = (after - before) / (2 * h), (after - 2 * z + before) / h**2
    push = m * e * w**2 * np.exp(2j * w)
    assert abs(m * second + c * rate + k * z - push) < 1e-5 * abs(push)
    assert abs(m * second - c * rate - k * z) > 0.5 * abs(push)
    assert abs(c * rate + k * z - push) > 0.5 * abs(push)


def test_v_6_253_acceleration_of_the_mass_centres():
    """A disk turned by 6.253: with a position for the acceleration the rotor would whirl less."""
    rotor, w, e = Rotor(M, 1e-3, (M * WN**2,) * 2, (0.4, 0.4)), 0.8 * WN, 1e-3
    z = rotor.whirl(w).x
    force = M * -(w**2) * (z + e) + (0.4j * w + M * WN**2) * z
    assert abs(force) < 1e-14 * M * WN**2
    assert abs(M * (z + e) + (0.4j * w + M * WN**2) * z) > 0.5 * abs(M * WN**2 * z)


# 6.14.4: the data of the example
SPAN, PLACES, EI = 1.2, np.array([0.325, 0.675]), shaft_rigidity(200e9, 0.05)
DISK = 7860 * math.pi * 0.25**2 / 4 * 0.05


def test_v_6_273_to_6_275_the_span_is_missing():
    """By integrating moments along the beam (unit loads); as printed they are L times that."""
    alpha = influence_coefficients(PLACES, SPAN, EI)
    x = np.linspace(0.0, SPAN, 200_001)
    moments = [np.where(x < a, x * (SPAN - a), a * (SPAN - x)) / SPAN for a in PLACES]
    work = [[np.trapezoid(p * q, x) / EI for p in moments] for q in moments]
    np.testing.assert_allclose(alpha, work, rtol=1e-8)
    l1, l2, l3 = 0.325, 0.35, 0.525
    printed = np.array([
        l1**2 * (l2 + l3) ** 2 / (3 * EI),
        l3**2 * (l1 + l2) ** 2 / (3 * EI),
        l1 * l3 / (6 * EI) * (SPAN**2 - l1**2 - l3**2),
    ])  # fmt: skip
    np.testing.assert_allclose(printed / SPAN, [alpha[0, 0], alpha[1, 1], alpha[0, 1]], rtol=1e-14)


def test_v_6_14_4_second_critical_speed():
    """241.533 is right, 1061.81 is not: 6.278 and the general eigenvalue problem agree."""
    K = np.linalg.inv(influence_coefficients(PLACES, SPAN, EI))
    found = DiskRotor(np.full(2, DISK), np.zeros(2), K, np.zeros((2, 2))).critical_speeds
    squares = np.roots([DISK**2, -DISK * (K[0, 0] + K[1, 1]), np.linalg.det(K)])  # 6.278
    np.testing.assert_allclose(np.sort(np.sqrt(squares)), found, rtol=1e-12)
    np.testing.assert_allclose(found, [241.5332, 1060.8119], rtol=5e-8)
    assert abs(found[1] - 1061.81) > 0.9


# A.6: the data of the example
TWO = TwoMasses(20.0, 10.0, 2000.0, 3000.0, 50.0, 50.0)
PRINTED_ROOTS = np.array([-4.25552 + 21.6862j, -4.25552 - 21.6862j,
                          -0.74448 - 7.80195j, -0.74448 + 7.80195j])  # fmt: skip
PRINTED_RATIOS = np.array([-0.632843 - 0.0269852j, -0.632843 + 0.0269852j,
                           0.794814 + 0.0121931j, 0.794814 - 0.0121931j])  # fmt: skip


def test_a_6_1_roots_and_ratios_are_right():
    for root, ratio in zip(PRINTED_ROOTS, PRINTED_RATIOS, strict=True):
        nearest = TWO.roots[np.abs(TWO.roots - root).argmin()]
        assert nearest == pytest.approx(root, abs=1e-4)
        assert 1 / TWO.amplitude_ratio(nearest) == pytest.approx(ratio, abs=1e-6)
    K, C = TWO.system.stiffness, TWO.system.damping
    for root in TWO.system.damped_modes.roots:
        assert abs(np.linalg.det(TWO.system.mass * root**2 + C * root + K)) < 1e-6


def test_a_6_1_the_ratio_is_used_upside_down():
    """In[25] multiplies u1 by d1/d2 to make u2; so the amplitudes of Out[32] are wrong."""
    a12, b12 = 0.2326, 0.518345
    t = np.array([0.1, 0.5])
    right = state_space.free(TWO.system.state_matrix, t, [0.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(right[0], [0.05682068, -0.03591185], atol=5e-9)
    np.testing.assert_allclose(right[1], [0.04145348, -0.03899110], atol=5e-9)
    np.testing.assert_allclose(TWO.system.free(t, [0, 0], [1, 0])[0], right[:2], atol=1e-15)
    np.testing.assert_allclose(
        TWO.system.damped_modes.free(t, [0, 0], [1, 0]).displacement, right[:2], atol=1e-14
    )
    slow, fast = np.exp(-0.74448 * t), np.exp(-4.25552 * t)
    printed = -b12 * slow * np.sin(7.80195 * t) + a12 * fast * np.sin(21.6862 * t)
    assert np.abs(printed - right[0]).min() > 0.1
    # with d2/d1 the four conditions of the book give the amplitudes that fit
    basis = np.array([fast * np.cos(21.6862 * t), fast * np.sin(21.6862 * t),
                      slow * np.cos(7.80195 * t), slow * np.sin(7.80195 * t)])  # fmt: skip
    fitting = [0.000973917, 0.0205165, -0.000973917, 0.0715839]
    np.testing.assert_allclose(fitting @ basis, right[0], atol=1e-7)


def test_a_6_1_in_25_sign_of_a_frequency():
    """The sine with a12 has the frequency of lambda two beside the angle of the ratio of one."""
    root = TWO.roots[0]
    ratio = TWO.amplitude_ratio(root)
    t, h = 0.13, 1e-4
    assert root.imag > 0.0

    def residual(sign):
        """Force that remains on the first mass, and the spring's, for the motion of In[24, 25]."""
        s = t + h * np.array([-1.0, 0.0, 1.0])
        u1 = np.exp(root.real * s) * np.sin(root.imag * s)
        u2 = abs(ratio) * np.exp(root.real * s) * np.sin(sign * root.imag * s + np.angle(ratio))
        u = np.array([u1, u2])
        rate, second = (u[:, 2] - u[:, 0]) / (2 * h), (u[:, 2] - 2 * u[:, 1] + u[:, 0]) / h**2
        S = TWO.system
        spring = S.stiffness @ u[:, 1]
        return np.abs(S.mass @ second + S.damping @ rate + spring).max(), np.abs(spring).max()

    rest, size = residual(1.0)
    assert rest < 1e-4 * size
    rest, size = residual(-1.0)  # Im of lambda two
    assert rest > 0.5 * size


def test_a_6_1_unit_of_the_dampers():
    """N/(m s) times a velocity is no force."""
    speed = UNITS.Quantity(1.0, 'm/s')
    assert (UNITS.Quantity(50.0, 'N s/m') * speed).check('[force]')
    assert not (UNITS.Quantity(50.0, 'N/(m s)') * speed).check('[force]')


def test_a_6_2_out_12_signs():
    """Out[12] lacks the minus before the quotient and has the sign of 5 i w wrong."""
    for w in (3.0, 10.0, 30.0):
        first, second = np.linalg.solve(TWO.system.impedance(w), [0.0, 1.0])
        quartic = 60000 + 2500j * w - 1125 * w**2 - 20j * w**3 + 2 * w**4
        assert (60 + 1j * w) / (2 * quartic) == pytest.approx(first, rel=1e-12)  # Out[11]
        assert -(-250 - 5j * w + w**2) / (5 * quartic) == pytest.approx(second, rel=1e-12)
        for sign in (-1.0, 1.0):
            printed = sign * (-250 + 5j * w + w**2) / (5 * quartic)
            assert abs(printed / second - 1) > 0.01


def test_a_6_2_the_masses_never_move_against_each_other():
    """The text lets their phases come pi apart; damping keeps them below 2.46 rad."""
    first, second = TWO.steady(np.linspace(0.0, 1e4, 1_000_001))
    apart = np.abs(np.angle(first / second))
    assert apart.max() == pytest.approx(2.4512, abs=1e-3)
    assert apart[-1] == pytest.approx(math.pi / 2, abs=0.01)  # only the damper between is left


def test_v_formulas_of_vibrations_that_are_right():
    o, t = OSCILLATOR, np.linspace(0.0, 3.0, 40)
    a, beta = XI * WN, WN * math.sqrt(1 - XI**2)
    # 6.72 to 6.75
    y = np.exp(-a * t) * (np.cos(beta * t) + (0.4 + a) / beta * np.sin(beta * t))
    np.testing.assert_allclose(o.free(t, 1.0, 0.4).displacement, y, atol=1e-14)
    # 6.67 to 6.71
    over, root = Oscillator.of_ratio(WN, 1.2), math.sqrt(1.2**2 - 1)
    l1, l2 = (-1.2 + root) * WN, (-1.2 - root) * WN
    c1, c2 = -(l2 - 0.4) / (2 * root * WN), (l1 - 0.4) / (2 * root * WN)
    y = c1 * np.exp(l1 * t) + c2 * np.exp(l2 * t)
    np.testing.assert_allclose(over.free(t, 1.0, 0.4).displacement, y, atol=1e-14)
    # 6.77 to 6.80
    y = np.exp(-WN * t) * (1.0 + (0.4 + WN) * t)
    np.testing.assert_allclose(Oscillator(WN, WN).free(t, 1.0, 0.4).displacement, y, atol=1e-14)
    # 6.40, 6.41, 6.81, 6.86, 6.87
    w, p0 = 5.0, P0 / M
    D = p0 / math.hypot(WN**2 - w**2, 2 * a * w)
    d1, d2 = -2 * D**2 * a * w / p0, D**2 * (WN**2 - w**2) / p0
    a1, a2 = -d1, -d1 * a / beta - d2 * w / beta
    y = np.exp(-a * t) * (a1 * np.cos(beta * t) + a2 * np.sin(beta * t))
    y += d1 * np.cos(w * t) + d2 * np.sin(w * t)
    np.testing.assert_allclose(o.forced(t, -1j * P0, w).displacement, y, atol=1e-14)
    # 6.153, 6.157, 6.158, 6.181 to 6.183
    equal, root5 = TwoMasses(1.0, 1.0, 10.0, 10.0), math.sqrt(5)
    np.testing.assert_allclose(
        equal.natural_frequencies**2, [5 * (3 - root5), 5 * (3 + root5)], rtol=1e-14
    )
    np.testing.assert_allclose(equal.mode_ratios, [(1 + root5) / 2, (1 - root5) / 2], rtol=1e-14)
    # 6.187, 6.188
    M_, C, K = (getattr(TWO.system, name) for name in ('mass', 'damping', 'stiffness'))
    for s in (1.0, -2.0 + 3.0j):
        assert np.polyval(TWO.characteristic_polynomial, s) == pytest.approx(
            np.linalg.det(M_ * s**2 + C * s + K), rel=1e-12
        )
    # 6.246, 6.247, and 5.025 e of figure 6.32
    rotor = Rotor(M, 1.0, (M * WN**2,) * 2, (2 * M * WN * 0.1,) * 2)
    radius = np.abs(rotor.whirl(np.linspace(0.5, 2.0, 1_000_001) * WN).x)
    assert np.linspace(0.5, 2.0, 1_000_001)[radius.argmax()] * WN == pytest.approx(
        rotor.critical_speeds[0], rel=1e-5
    )
    assert radius.max() == pytest.approx(peak_radius(0.1), rel=1e-10)
    assert peak_radius(0.1) == pytest.approx(5.025, abs=5e-4)
