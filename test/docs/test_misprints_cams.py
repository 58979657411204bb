"""Misprints of [V] chapter 4 and appendix A.5, as in `test_misprints.py`; what is right there."""

from __future__ import annotations

import numpy as np
import pytest
from textbook import normalised

from mechanism_sim.joints.cam.curves import CYCLOIDAL, FOUR_SPLINE, HALF_HARMONIC, HARMONIC
from mechanism_sim.joints.cam.followers import Oscillating, Translating
from mechanism_sim.joints.cam.laws import Diagram, Eccentric, Segment, check_smoothness
from mechanism_sim.joints.cam.profiles import Cam, greatest

pi, cos, sin = np.pi, np.cos, np.sin
A, B, C = pi / 2, 5 * pi / 4, 7 * pi / 4  # figure 4.13


def diagram(curve, lift=1.0):
    return Diagram([Segment(0, A, lift, curve), Segment(B, C, -lift, curve)])


def close(a, b, rel=1e-12):
    return np.asarray(a) == pytest.approx(np.asarray(b), rel=rel, abs=1e-12)


# --- The circular cam: 4.2 ----------------------------------------------------------------------


def test_v_4_4_direction_of_the_radius():
    R, d = 4.0, 1.0
    for gamma in (0.3, 2.0, 3.5, 5.0):
        D = d * sin(gamma) + np.sqrt(R**2 - (d * cos(gamma)) ** 2)
        star = 3 * pi / 2 + np.arcsin(abs(d * cos(gamma) / R))
        # the sine of theta is above zero (4.6): second and third row of 4.3
        printed = pi - star if cos(gamma) > 0 else pi + star
        right = pi / 2 + np.arcsin(d * cos(gamma) / R)

        def gap(theta, gamma=gamma, D=D):
            return abs(d * np.exp(1j * gamma) + R * np.exp(1j * theta) - 1j * D)

        assert gap(right) < 1e-12
        assert gap(printed) > 0.1


def test_v_4_2_base_radius_of_the_circular_cam():
    R, d, gamma = 4.0, 1.0, np.linspace(0, 2 * pi, 9)
    u = Eccentric(R, d)(gamma)
    D = d * sin(gamma) + np.sqrt(R**2 - (d * cos(gamma)) ** 2)
    assert close(D, (R - d) + u)  # 4.66 with the least D for base radius
    assert np.ptp(D - (R - d)) > 1  # as printed it is no constant


# --- Laws: 4.4 ----------------------------------------------------------------------------------


def test_v_4_4_5_places_of_the_comparison():
    cycloid, spline = diagram(CYCLOIDAL), diagram(FOUR_SPLINE)
    assert [cycloid(A / 4), spline(A / 4)] == pytest.approx([0.0908451, 0.0625], abs=5e-8)
    assert [cycloid(pi / 4), spline(pi / 4)] == pytest.approx([0.5, 0.5])
    for law in (cycloid, spline):
        sides = [law(A / 2, 2, left=True), law(A / 2, 2)]
        assert sides[0] == pytest.approx(-sides[1], abs=1e-12)  # the inflection
        assert law(A / 4, 2) > 1


def test_v_4_63_acceleration_in_the_middle_of_the_four_spline():
    lift = 0.7
    law = diagram(FOUR_SPLINE, lift)
    h = 1e-3
    u = law(A / 2 + h * np.arange(-2, 1))
    difference = (u[0] - 2 * u[1] + u[2]) / h**2  # half a step before: linear in the angle
    before = difference * (A / 2) / (A / 2 - h)
    assert before * A**2 / (4 * lift) == pytest.approx(3, rel=1e-6)
    assert law(A / 2, 2, left=True) * A**2 / (4 * lift) == pytest.approx(3)


def test_v_4_4_5_velocities_are_normalised_unlike():
    spline, cycloid = diagram(FOUR_SPLINE), diagram(CYCLOIDAL)
    assert spline(A / 2, 1) * A / 2 == pytest.approx(1.5)  # 4.62
    assert cycloid(A / 2, 1) * A == pytest.approx(2)  # 4.22
    assert spline(A / 2, 1) > cycloid(A / 2, 1)  # not slower, but faster
    assert normalised(spline, A / 2, 1) == pytest.approx(3)
    assert normalised(spline, np.nextafter(A / 2, 0), 2) == pytest.approx(12)


def test_v_formulas_of_cams_that_are_right():
    """4.14 to 4.16, 4.18 to 4.20, 4.33, 4.34, 4.45, 4.48, 4.53 and 4.58."""
    L = 0.8
    x, y = np.linspace(0.01, A - 0.01, 20), np.linspace(B + 0.01, C - 0.01, 20)
    law, w, z = diagram(CYCLOIDAL, L), 2 * pi * x / A, 2 * pi * (y - C) / (B - C)
    assert close(law(x), L / (2 * pi) * (w - sin(w)))
    assert close(law(x, 1), L / A * (1 - cos(w)))
    assert close(law(x, 2), 2 * pi * L / A**2 * sin(w))
    assert close(law(y), L / (2 * pi) * (z - sin(z)))
    assert close(law(y, 1), L / (B - C) * (1 - cos(z)))
    assert close(law(y, 2), 2 * pi * L / (B - C) ** 2 * sin(z))
    law = diagram(HARMONIC, L)
    assert close(law(x), L / 2 * (1 - cos(w / 2)))
    assert close(law(y), L / 2 * (1 - cos(z / 2)))
    law, t, g = diagram(FOUR_SPLINE, L), x / A, (B - C) ** 3
    second = 4 * L * (t**3 - 3 * t**2 + 3 * t) - 3 * L
    assert close(law(x), np.where(t < 0.5, 4 * L * t**3, second))
    fourth = L + 4 * L / g * (y**3 - 3 * B * y**2 + 3 * B**2 * y - B**3)
    fifth = 4 * L / g * (y**3 - 3 * C * y**2 + 3 * C**2 * y - C**3)
    assert close(law(y), np.where(y < (B + C) / 2, fourth, fifth), rel=1e-10)


# --- Base circle and pressure angle: 4.5, 4.6 ---------------------------------------------------


def knife(curve, base_radius):
    return Cam(diagram(curve), Translating(), base_radius)


def test_v_4_68_rate_of_the_tangential_component():
    law, base, omega, t, h = diagram(CYCLOIDAL), 2.0, 7.0, 0.05, 1e-6

    def place(t):
        return (base + law(omega * t)) * np.exp(1j * omega * t)

    velocity = (place(t + h) - place(t - h)) / (2 * h)
    D, D1, unit = base + law(omega * t), omega * law(omega * t, 1), np.exp(1j * omega * t)
    assert velocity == pytest.approx(D1 * unit + D * omega * 1j * unit, rel=1e-8)
    assert abs(velocity - (D1 * unit + D * 1j * unit)) > 1


def test_v_4_5_all_of_4_68_is_the_velocity_of_sliding():
    """The knife stays on the profile, so what it moves seen from the cam is along the profile."""
    x = np.linspace(0.1, A - 0.1, 9)
    cam = knife(CYCLOIDAL, 2.0)
    touch, h = cam.at(x), 1e-5
    along = np.hypot(*(cam.at(x + h).profile - cam.at(x - h).profile)) / (2 * h)
    assert touch.sliding == pytest.approx(along, rel=1e-8)
    tangential = 2.0 + cam.law(x)
    assert (along > tangential + 1e-4).all()


def test_v_4_76_holds_but_for_full_turns():
    """4.72 to 4.74 give alpha between 0 and a turn; 4.76 then leaps in the last quarter."""
    cam = knife(CYCLOIDAL, 2.0)
    for theta in np.linspace(0.05, 2 * pi - 0.05, 40):
        D, D1 = 2.0 + cam.law(theta), cam.law(theta, 1)
        dy, dx = D1 * sin(theta) + D * cos(theta), D1 * cos(theta) - D * sin(theta)
        alpha = np.arctan2(dy, dx) % (2 * pi)
        printed = alpha - theta - pi / 2
        right = cam.at(theta).pressure_angle[0]
        assert right == pytest.approx(-np.arctan(D1 / D), abs=1e-12)
        assert np.exp(1j * printed) == pytest.approx(np.exp(1j * right), abs=1e-12)
        assert printed == pytest.approx(right - 2 * pi * (theta + right > 3 * pi / 2), abs=1e-12)


def test_v_4_6_the_pressure_angle_is_greatest_before_the_inflection():
    places, angles = {}, {}
    for name, curve in (('c', CYCLOIDAL), ('h', HARMONIC), ('s', FOUR_SPLINE)):
        cam = knife(curve, 10.0)
        places[name], angles[name] = greatest(
            cam.law, lambda x, cam=cam: abs(cam.at(x).pressure_angle) * (x < A)
        )
    assert places['s'] == pytest.approx(A / 2)
    assert places['c'] < A / 2 - 0.01
    assert places['h'] < A / 2 - 0.01
    # and the greatest values are not close to each other
    assert np.degrees(list(angles.values())) == pytest.approx([6.9, 5.4, 10.3], abs=0.1)


def test_v_4_6_the_base_circle_matters_to_oscillating_followers_too():
    law = diagram(CYCLOIDAL, 0.25)
    small, large = (
        Cam(law, Oscillating(0.12, 0.1, roller=0.012), r).largest_pressure_angle
        for r in (0.03, 0.045)
    )
    assert small > 1.2 * large


# --- A.5 ----------------------------------------------------------------------------------------

BASE, LIFT, ROLLER, OFFSET, OMEGA = 2.0, 0.4, 0.2, 0.4, 10.0
ONE, TWO, THREE = pi / 3, 2 * pi / 3, 3 * pi / 2
LAW = Diagram([Segment(0, ONE, LIFT, HALF_HARMONIC), Segment(TWO, THREE, -LIFT, HALF_HARMONIC)])
FRAMES = np.arange(20) * 2 * pi / 20


def test_a_5_tables_are_right():
    """Out[38], Out[39], Out[41] and Out[49]."""
    initial = np.arccos(OFFSET / (BASE + LIFT))
    assert initial == pytest.approx(1.40335, abs=5e-6)
    angles = initial + FRAMES
    assert angles[[1, 10, 19]] == pytest.approx([1.71751, 4.54494, 7.37237], abs=5e-6)
    radial = [0.4, 0.4, 0.4, 0.339885, 0.266849, 0.198529, 0.137347, 0.0854693, 0.044734]
    radial += [0.0165842, 0.0020171, 0, 0, 0, 0, 0, 0.00964685, 0.0918343, 0.241198, 0.4]
    assert LAW(angles) == pytest.approx(radial, abs=6e-7)
    oscillating = [0, 0.0435974, 0.164886, 0.337426, 0.4, 0.4, 0.4, 0.374884, 0.300524, 0.229688]
    oscillating += [0.164886, 0.108413, 0.0622688, 0.0280894, 0.0070851, 0, 0, 0, 0, 0]
    assert LAW(FRAMES) == pytest.approx(oscillating, abs=6e-7)


def test_a_5_in_2_factor_of_the_return():
    x = np.linspace(TWO, THREE, 11)[1:-1]
    right = LIFT * (1 - cos(pi * (THREE - x) / (2 * (THREE - TWO))))
    printed = LIFT * (1 - cos(pi * (THREE - x) / (THREE - TWO)))
    assert close(LAW(x), right)
    assert LIFT * (1 - cos(pi)) == pytest.approx(2 * LIFT)  # as printed at TWO: no lift but two
    assert (printed > right + 0.01).all()
    # Out[23], the acceleration in time
    assert close(OMEGA**2 * LAW(x, 2), 14.4 * cos(0.6 * (1.5 * pi - x)))


def test_a_5_out_17_frequency():
    x = np.linspace(TWO, THREE, 11)[1:-1]
    assert close(OMEGA * LAW(x, 1), -2.4 * sin(0.6 * (1.5 * pi - x)))
    assert abs(OMEGA * LAW(x, 1) + 2.4 * sin(3 * (1.5 * pi - x))).max() > 1


def test_a_5_in_1_the_velocity_jumps():
    """A quarter of a cosine is at its fastest where the dwell begins; 4.33 takes half of one."""
    jumps = [j for j in check_smoothness(LAW) if j.order == 1]
    assert [j.angle for j in jumps] == pytest.approx([ONE, TWO])
    assert OMEGA * jumps[0].before == pytest.approx(6)  # Out[16] at its end
    assert not check_smoothness(diagram(HARMONIC), 1)


def distance_to_the_profile(centre):
    x = np.linspace(0, 2 * pi, 200_001)
    return abs((BASE + LAW(x)) * np.exp(1j * x) - centre).min()


def test_a_5_in_43_the_offset_roller_does_not_touch_the_cam():
    """Its centre is put a roller's radius above the height of a radial knife."""
    dwell = distance_to_the_profile(OFFSET + 1j * (BASE + ROLLER + LIFT))
    assert dwell > ROLLER + 0.03
    height = np.sqrt((BASE + LIFT + ROLLER) ** 2 - OFFSET**2)
    initial = np.angle(OFFSET + 1j * height)
    assert ONE < initial < TWO
    assert distance_to_the_profile(OFFSET + 1j * height) == pytest.approx(ROLLER, abs=1e-8)


def test_a_5_in_52_rollers_are_put_along_the_radius():
    """Not across the profile: the roller cuts into the cam. And Out[52] turns all to the axis."""
    angle = FRAMES[2]
    centre = (BASE + LAW(angle) + ROLLER) * np.exp(1j * angle)
    assert distance_to_the_profile(centre) < ROLLER - 0.003
    printed = np.array([2.36489, 0])
    assert abs(centre) == pytest.approx(printed[0], abs=5e-6)
    assert abs(centre.imag - printed[1]) > 1
