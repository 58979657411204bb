"""The textbook's simple mechanisms as scenes: what the book says of them, by closed forms.

[V] is Vinogradov's book. Crank, coupler or rod, and rocker or slider are links 2, 3 and 4.
"""

from __future__ import annotations

import sys
from functools import cache

import numpy as np
import pytest
from four_bars import reference
from running import ROOT
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.special import ellipk

import mechanism_sim as ms
from mechanism_sim.errors import InputError

sys.path.insert(0, str(ROOT / 'docs' / 'site'))

import mechanisms as gallery

NAMES = [
    name
    for title, names in gallery.SECTIONS.items()
    for name in names
    if title != 'Compound mechanisms'
    and name not in ('four_bar_clearance', 'four_bar_crossed')  # impacts; no masses
]
TURNING = {
    'slider_crank': 'crank',
    'slider_crank_offset': 'crank',
    'rotary_engine': 'cylinder',
    'quick_return': 'crank',
    'oscillating_cylinder': 'crank',
    'four_bar_crank_rocker': 'crank',
    'four_bar_double_crank': 'crank',
    'four_bar_double_rocker': 'coupler',
    'four_bar_coupler_curve': 'crank',
    'five_bar': 'crank',
    'scotch_yoke': 'crank',
    'scotch_yoke_offset': 'crank',
}

cos, sin, pi = np.cos, np.sin, np.pi
G = 9.81


@cache
def run(name):
    """A scene's machine and its run."""
    machine = ms.load_scene(name)
    return machine, ms.simulate(machine)


def motion(name, *links, count=400):
    """Times, and position, velocity and acceleration of each link."""
    solution = run(name)[1]
    t = np.linspace(0.0, solution.duration, count)
    seen = solution.sample(t)
    kinds = ('position', 'velocity', 'acceleration')
    return t, *([seen[f'{kind}.{link}'] for kind in kinds] for link in links)


def dead_points(name, coordinate):
    """Times at which a coordinate turns back."""
    solution = run(name)[1]

    def rate(t):
        return float(solution.sample(t, f'velocity.{coordinate}')[f'velocity.{coordinate}'][0])

    t = np.linspace(0.0, solution.duration, 200) * (1.0 - 1e-9)
    v = solution.sample(t, f'velocity.{coordinate}')[f'velocity.{coordinate}']
    turned = np.flatnonzero(v[1:] * v[:-1] < 0.0)
    return np.array([brentq(rate, t[k], t[k + 1], xtol=1e-15) for k in turned])


def time_ratio(name, coordinate):
    """Time of the slow stroke over that of the quick one, in a cycle with two dead points."""
    first, second = dead_points(name, coordinate)
    strokes = second - first, run(name)[1].duration - (second - first)
    return max(strokes) / min(strokes)


# --- all of them --------------------------------------------------------------------------------


def test_the_gallery_has_a_row_of_every_scene_tested_here():
    assert {*NAMES} >= {*TURNING}


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', NAMES)
def test_the_gallery_is_right_and_its_scenes_run(name):
    machine, solution = run(name)
    q = machine.assembly.q[:, None]
    rank = np.linalg.matrix_rank(machine.plan.kinematics([]).closure(q)[1][0])
    assert len(q) - rank - len(machine.plan.ideal.deformations) == gallery.FREEDOMS.get(name, 1)
    assert solution.max_closure_error < 1e-12
    energy, seen = solution.energy, solution.sample(np.linspace(0.0, solution.duration, 50))
    if machine.physics.has_forces:  # where masses are part of the scene
        kinds = 'kinetic', 'potential', 'drive_work'
        turned_over = max(np.ptp(seen[f'energy.{k}']) for k in kinds)
        allowed = max(1e-11, machine.scene.solver.rtol)  # a scene may ask for less than others do
        assert abs(energy.residual) < allowed * max(turned_over, 1e-3)
    if name in TURNING:
        turn = seen[f'position.{TURNING[name]}']
        assert abs(turn[-1] - turn[0]) == pytest.approx(2.0 * pi, rel=1e-12)


# --- slider-crank and its inversions ------------------------------------------------------------


def test_slider_crank_agrees_with_the_table_of_the_appendix():
    printed = reference('appendix_a4')['slider_crank']['r1']['printed']
    t = np.linspace(0.0, 0.1, 21)
    seen = run('slider_crank')[1].sample(
        np.minimum(t, run('slider_crank')[1].duration), 'position.piston'
    )
    r1 = [float(str(x)) for x in printed]
    assert seen['position.piston'] / 0.05 == pytest.approx(np.array(r1), abs=5.1e-6)
    limit = np.degrees(np.arcsin(0.25))  # problem 2.8
    _, (rod, *_) = motion('slider_crank', 'rod', count=401)
    assert np.degrees([rod.min(), rod.max()]) == pytest.approx([-limit, limit], abs=1e-9)


def test_slider_crank_driven_by_the_crank_moves_as_printed():
    _, (t2, w2, _), (t3, w3, a3), (_, v1, a1) = motion('slider_crank', 'crank', 'rod', 'piston')
    r2, r3 = 0.05, 0.2
    assert -w2 * r2 * cos(t2) / (r3 * cos(t3)) == pytest.approx(w3, abs=1e-11)  # 2.93
    assert -r2 * w2 * sin(t2 - t3) / cos(t3) == pytest.approx(v1, abs=1e-12)  # 2.94
    swing = (r2 * w2**2 * sin(t2) + r3 * w3**2 * sin(t3)) / (r3 * cos(t3))  # 2.135
    assert swing == pytest.approx(a3, abs=1e-9)
    slide = (v1 * w3 * sin(t3) - r2 * w2 * (w2 - w3) * cos(t2 - t3)) / cos(t3)  # 2.136
    assert slide == pytest.approx(a1, abs=1e-9)


def test_slider_crank_forces_balance_every_link_by_itself():
    """Newton and Euler for rod, crank and piston in world components, link by link."""
    machine, solution = run('slider_crank')
    t = np.linspace(0.0, solution.duration, 50)
    o = solution.sample(t)
    (t2, w2, a2), (t3, w3, a3) = (
        [o[f'{k}.{c}'] for k in ('position', 'velocity', 'acceleration')] for c in ('crank', 'rod')
    )
    r2, r3, s2, s3 = 0.05, 0.2, 0.015, 0.07
    m2, m3, m4, j2, j3 = 0.8, 0.6, 0.5, 700e-6, 2800e-6
    u = lambda x: np.array([cos(x), sin(x)])  # noqa: E731
    v = lambda x: np.array([-sin(x), cos(x)])  # noqa: E731
    pull = lambda r, x, w, a: r * (a * v(x) - w**2 * u(x))  # noqa: E731
    cross = lambda a, b: a[0] * b[1] - a[1] * b[0]  # noqa: E731
    weight = np.array([[0.0], [-G]])
    F12, F23, F34, F14 = (
        np.array([o[f'reaction.{j}.{x}'] for x in 'xy'])
        for j in ('ground_crank', 'crank_rod', 'rod_piston', 'ground_piston')
    )
    pin = pull(r2, t2, w2, a2)
    assert F34 + F14 + m4 * weight == pytest.approx(
        m4 * np.array([o['acceleration.piston'], 0.0 * t]), abs=1e-9
    )
    assert F14[0] == pytest.approx(0.0, abs=1e-9)
    assert F23 - F34 + m3 * weight == pytest.approx(m3 * (pin + pull(s3, t3, w3, a3)), abs=1e-9)
    turn = cross(-s3 * u(t3), F23) - cross((r3 - s3) * u(t3), F34)
    assert turn == pytest.approx(j3 * a3, abs=1e-9)
    assert F12 - F23 + m2 * weight == pytest.approx(m2 * pull(s2, t2, w2, a2), abs=1e-9)
    turn = o['drive_torque'] + cross(-s2 * u(t2), F12) - cross((r2 - s2) * u(t2), F23)
    assert turn == pytest.approx(j2 * a2, abs=1e-9)
    assert machine.level.value == 'inverse dynamics'


def test_slider_crank_driven_by_the_piston_moves_as_printed():
    links = ('crank', 'rod', 'piston')
    _, (t2, w2, a2), (t3, w3, a3), (x, v1, a1) = motion('slider_crank_piston_driven', *links)
    r2, r3 = 0.1, 0.4
    t2, t3 = t2 - pi / 4.0, t3 - pi / 4.0
    assert t2 == pytest.approx(np.arccos((x**2 + r2**2 - r3**2) / (2.0 * r2 * x)), abs=1e-12)
    assert np.ptp(t2) < pi  # 2.3.5: less than half a circle
    assert v1 * cos(t3) / (r2 * sin(t3 - t2)) == pytest.approx(w2, abs=1e-12)  # 2.95
    assert v1 * cos(t2) / (r3 * sin(t2 - t3)) == pytest.approx(w3, abs=1e-12)  # 2.96
    top = -r2 * w2 * (w3 - w2) * cos(t3 - t2) + a1 * cos(t3) - v1 * w3 * sin(t3)  # 2.137
    assert top / (r2 * sin(t3 - t2)) == pytest.approx(a2, abs=1e-11)
    top = -r3 * w3 * (w2 - w3) * cos(t2 - t3) + a1 * cos(t2) - v1 * w2 * sin(t2)  # 2.138
    assert top / (r3 * sin(t2 - t3)) == pytest.approx(a3, abs=1e-11)


def test_a_driven_guide_bears_no_thrust():
    """What the actuator pushes along the line is the drive's force, not the guide's."""
    t, (_, _, a) = motion('slider_crank_piston_driven', 'piston')
    o = run('slider_crank_piston_driven')[1].sample(t)
    guide, rod = (
        np.array([o[f'reaction.{j}.{x}'] for x in 'xy']) for j in ('ground_piston', 'rod_piston')
    )
    way = np.sqrt(0.5) * np.ones(2)
    assert way @ guide == pytest.approx(0.0, abs=1e-9)
    thrust = np.outer(way, 4.0 * a) - rod + np.array([[0.0], [4.0 * G]])
    assert guide + np.outer(way, o['drive_torque']) == pytest.approx(thrust, abs=1e-9)


def test_offset_slider_crank_returns_quickly():
    r2, r3, e = 0.05, 0.16, 0.06
    far, near = np.arcsin(e / (r3 + r2)), np.arcsin(e / (r3 - r2))
    assert time_ratio('slider_crank_offset', 'slider') == pytest.approx(
        (pi + near - far) / (pi - near + far), rel=1e-10
    )
    at = dead_points('slider_crank_offset', 'slider')
    x = np.sort(run('slider_crank_offset')[1].sample(at, 'position.slider')['position.slider'])
    assert x == pytest.approx([np.sqrt((r3 + s * r2) ** 2 - e**2) for s in (-1.0, 1.0)], rel=1e-12)


def test_rotary_engine_moves_as_printed_for_the_cylinder():
    r2, r3 = 0.06, 0.23
    t, (t1, w1, _), (t3, w3, a3) = motion('rotary_engine', 'cylinder', 'rod', count=2001)
    bx, by = -r3 * cos(t3), -r2 - r3 * sin(t3)  # 2.56 with theta_2 = pi/2
    r1, th1 = np.hypot(bx, by), np.arctan2(by, bx)
    assert sin(th1 - t1 - pi) == pytest.approx(0.0, abs=1e-14)
    assert np.ptp(r1) == pytest.approx(2.0 * r2, rel=1e-5)  # the stroke
    assert -r3 / r1 * w3 * cos(t3 - th1) == pytest.approx(w1, rel=1e-12)  # 2.97
    slide = r3 * w3 * sin(t3 - th1)  # 2.98
    assert slide == pytest.approx(CubicSpline(t, r1)(t, 1), abs=1e-5)
    top = -slide * w1 + r3 * w3 * (w3 - w1) * sin(t3 - th1) - r3 * a3 * cos(t3 - th1)  # 2.139
    assert top / r1 == pytest.approx(0.0, abs=1e-8)
    push = r3 * a3 * sin(t3 - th1) + r3 * w3 * (w3 - w1) * cos(t3 - th1)  # 2.140
    assert push == pytest.approx(CubicSpline(t, slide)(t, 1), abs=1e-2)


@pytest.mark.slow
def test_a_driven_link_keeps_its_angle_where_its_bearing_is_loose():
    """With its bearing cut, the guide on the piston could carry the cylinder, without an angle."""
    loose = {'joints.ground_cylinder.clearance': {'radial': '0.1 mm', 'restitution': 0.5}}
    machine = ms.load_scene('rotary_engine', loose)
    solution = ms.simulate(machine, duration=0.0125)
    t = np.linspace(0.0, solution.duration, 200)
    seen, ideal = solution.sample(t), run('rotary_engine')[1].sample(t)
    assert not solution.impacts
    assert seen['position.cylinder'] == pytest.approx(40.0 * pi * t, abs=1e-13)
    assert seen['position.piston'] == pytest.approx(seen['position.cylinder'], abs=1e-12)
    assert seen['position.rod'] == pytest.approx(ideal['position.rod'], abs=2.5e-4 / 0.23)
    force = np.hypot(*(ideal[f'reaction.ground_cylinder.{x}'] for x in 'xy'))
    assert seen['normal_force.ground_cylinder'] == pytest.approx(force, rel=0.01)


def test_quick_return_has_its_time_ratio_and_stroke():
    half = np.arccos(0.03 / 0.06)  # problem 2.12: O1O2 over O2A
    assert time_ratio('quick_return', 'ram') == pytest.approx((pi - half) / half, rel=1e-10)
    x = run('quick_return')[1].sample(dead_points('quick_return', 'ram'), 'position.ram')[
        'position.ram'
    ]
    assert np.ptp(x) == pytest.approx(2.0 * 0.05, rel=1e-12)


def test_oscillating_cylinder_swings_by_crank_over_distance():
    at = dead_points('oscillating_cylinder', 'cylinder')
    swing = (
        run('oscillating_cylinder')[1].sample(at, 'position.cylinder')['position.cylinder']
        - pi / 2.0
    )
    limit = np.arcsin(0.04 / 0.25)
    assert np.sort(swing) == pytest.approx([-limit, limit], rel=1e-12)
    ratio = (pi + 2.0 * limit) / (pi - 2.0 * limit)
    assert time_ratio('oscillating_cylinder', 'cylinder') == pytest.approx(ratio, rel=1e-10)


def test_hand_pump_lifts_by_closed_form():
    _, (turn, *_), (lift, *_) = motion('hand_pump', 'handle', 'plunger', count=321)
    a, r = 0.12, 0.2
    assert lift == pytest.approx(
        np.sqrt(r**2 - (a - a * cos(turn)) ** 2) - a * sin(turn), abs=1e-14
    )
    assert np.ptp(lift) == pytest.approx(2.0 * a * sin(pi / 6.0), rel=1e-12)


# --- four-bars ----------------------------------------------------------------------------------


def between(a, b, opposite):
    """Angle between two sides of a triangle."""
    return np.arccos((a**2 + b**2 - opposite**2) / (2.0 * a * b))


@pytest.mark.parametrize(
    ('name', 'turning', 'lengths'),
    [
        ('four_bar_crank_rocker', {'crank'}, (0.2, 0.05, 0.17, 0.12)),
        ('four_bar_double_crank', {'crank', 'coupler', 'rocker'}, (0.05, 0.12, 0.11, 0.15)),
        ('four_bar_double_rocker', {'coupler'}, (0.1, 0.07, 0.04, 0.08)),
        ('four_bar_triple_rocker', set(), (0.2, 0.05, 0.35, 0.15)),
        ('four_bar_coupler_curve', {'crank'}, (0.2, 0.05, 0.3, 0.25)),
    ],
)
def test_grashofs_law_says_which_links_turn(name, turning, lengths):
    """[V] 1.7: the shortest and its neighbours are in full turns relative to each other."""
    machine, solution = run(name)
    seen = solution.sample(np.linspace(0.0, solution.duration, 400))
    turned = {c for c in machine.physics.coordinates
              if np.ptp(seen[f'position.{c}']) > 2.0 * pi - 1e-6}  # fmt: skip
    assert turned == turning
    s, p, q, l = sorted(lengths)  # noqa: E741 - the book's letters
    assert (s + l <= p + q) == bool(turning)  # 1.2


def test_crank_rocker_swings_between_its_dead_points():
    g, r, c, b = 0.2, 0.05, 0.17, 0.12
    at = dead_points('four_bar_crank_rocker', 'rocker')
    rocker = np.sort(
        run('four_bar_crank_rocker')[1].sample(at, 'position.rocker')['position.rocker']
    )
    assert rocker == pytest.approx(
        [pi - between(g, b, c + r), pi - between(g, b, c - r)], rel=1e-12
    )


def test_double_crank_evens_out_over_a_turn():
    _, (_, w2, _), (turn, w4, _) = motion('four_bar_double_crank', 'crank', 'rocker')
    assert turn[-1] - turn[0] == pytest.approx(2.0 * pi, rel=1e-12)
    assert w4.min() < 0.75 * w2[0] < 1.25 * w2[0] < w4.max()


def test_double_rocker_rocks_where_coupler_and_other_arm_align():
    g, a, c, b = 0.1, 0.07, 0.04, 0.08
    solution = run('four_bar_double_rocker')[1]
    left = solution.sample(
        dead_points('four_bar_double_rocker', 'left_rocker'), 'position.left_rocker'
    )
    right = solution.sample(
        dead_points('four_bar_double_rocker', 'right_rocker'), 'position.right_rocker'
    )
    assert np.sort(left['position.left_rocker']) == pytest.approx(
        [between(g, a, b - c), between(g, a, b + c)], rel=1e-12
    )
    assert np.sort(right['position.right_rocker']) == pytest.approx(
        [pi - between(g, b, a + c), pi - between(g, b, a - c)], rel=1e-12
    )


def test_triple_rocker_cannot_pass_its_limits():
    limit = np.degrees(np.arccos((4.0**2 + 1.0 - (7.0 - 3.0) ** 2) / (2.0 * 4.0)))
    assert limit == pytest.approx(82.8, abs=0.05)  # within 90 deg of Figure 2.11
    key, brief = 'drive.start_angle', {'duration': '1 ms'}
    for inside in (limit + 0.1, 360.0 - limit - 0.1):
        ms.load_scene('four_bar_triple_rocker', brief | {key: f'{inside} deg'})
    for outside in (limit - 0.1, 360.0 - limit + 0.1):
        with pytest.raises(InputError, match='cannot be assembled with crank at'):
            ms.load_scene('four_bar_triple_rocker', brief | {key: f'{outside} deg'})


def test_tracing_points_lie_between_circle_and_arc():
    """[V] 2.69, with the angle of the coupler from the intersection of two circles."""
    machine, _ = run('four_bar_coupler_curve')
    _, (t2, *_), (t3, *_), (t4, *_) = motion(
        'four_bar_coupler_curve', 'crank', 'coupler', 'rocker'
    )
    pin = 0.05 * np.exp(1j * t2)
    rest = 0.2 - pin
    angle = np.angle(rest) + between(0.3, abs(rest), 0.25)
    for point, height in (('near', 0.05), ('middle', 0.1), ('far', 0.15)):
        at = machine.plan.points['coupler'][point]
        x, y = np.transpose([
            machine.mechanism.locate('coupler', {'crank': a, 'coupler': b, 'rocker': c}, at)
            for a, b, c in zip(t2, t3, t4, strict=True)
        ])  # fmt: skip
        expected = pin + np.hypot(0.15, height) * np.exp(1j * (angle + np.arctan2(height, 0.15)))
        assert x + 1j * y == pytest.approx(expected, abs=1e-14)


# --- sliders on turning guides, yokes -----------------------------------------------------------


def test_five_bar_moves_as_printed():
    """[V] 2.61: r4 and theta_3 from the vector b, first case, since r3 = r5 cancel."""
    r2 = 0.05
    t, (t2, w2, _), (t3, w3, a3) = motion('five_bar', 'crank', 'guide', count=2001)
    b = 5.0 * r2 - r2 * np.exp(1j * t2)
    r4 = abs(b)
    assert t3 == pytest.approx(np.angle(b) + pi / 2.0, abs=1e-14)
    assert w2 * r2 * sin(t2 - t3) / r4 == pytest.approx(w3, abs=1e-13)  # 2.101
    slide = r2 * w2 * cos(t3 - t2)  # 2.102
    assert slide == pytest.approx(CubicSpline(t, r4)(t, 1), abs=1e-8)
    top = -w3 * slide + r2 * w2 * (w2 - w3) * cos(t2 - t3)  # 2.143
    assert top / r4 == pytest.approx(a3, abs=1e-12)
    push = -r2 * w2 * (w3 - w2) * sin(t3 - t2)  # 2.144
    assert push == pytest.approx(CubicSpline(t, slide)(t, 1), abs=1e-6)


def test_scotch_yokes_are_harmonic_and_pushed_by_mass_times_acceleration():
    r, w = 0.05, 10.0 * pi
    t, (x, v, a) = motion('scotch_yoke', 'yoke')
    assert x == pytest.approx(r * cos(w * t), abs=1e-14)
    assert v == pytest.approx(-r * w * sin(w * t), abs=1e-12)
    assert a == pytest.approx(-r * w**2 * cos(w * t), abs=1e-10)
    o = run('scotch_yoke')[1].sample(t, 'reaction.crank_yoke.x', 'reaction.crank_yoke.y')
    assert o['reaction.crank_yoke.x'] == pytest.approx(-1.5 * r * w**2 * cos(w * t), abs=1e-9)
    assert o['reaction.crank_yoke.y'] == pytest.approx(0.0, abs=1e-9)
    o = run('scotch_yoke_offset')[1].sample(t, 'reaction.yoke_block.y')
    assert o['reaction.yoke_block.y'] == pytest.approx(
        -2.0 * (G - r * w**2 * sin(w * t)), abs=1e-9
    )


def test_an_offset_yoke_moves_as_a_plain_one():
    """[V] 2.65, third case: r4 = r2 sin(theta_2), whatever the offset."""
    _, (t2, *_), (r4, *_), (turn, *_) = motion('scotch_yoke_offset', 'crank', 'yoke', 'block')
    assert r4 == pytest.approx(0.05 * sin(t2), abs=1e-15)
    assert turn == pytest.approx(0.0, abs=1e-15)


# --- direct dynamics ----------------------------------------------------------------------------


def test_pendulum_comes_back_after_its_elliptic_period():
    m, d, j = 1.2, 0.5, 0.1
    period = 4.0 * np.sqrt((j + m * d**2) / (m * G * d)) * ellipk(sin(pi / 6.0) ** 2)
    _, solution = run('pendulum')
    at = dead_points('pendulum', 'bar')
    assert at == pytest.approx(0.5 * period * np.arange(1, len(at) + 1), rel=1e-11)
    turned = solution.sample(at, 'position.bar')['position.bar']
    assert turned[1::2] == pytest.approx(-pi / 6.0, abs=1e-11)
    assert turned[::2] == pytest.approx(-5.0 * pi / 6.0, abs=1e-11)


def slider_crank_by_angle(r2, r3, th):
    """Piston, rod angle and their slopes by the crank angle, along the slider's line."""
    th3 = np.arcsin(-r2 / r3 * sin(th))
    slope = -r2 * cos(th) / (r3 * cos(th3))
    return r2 * cos(th) + r3 * cos(th3), th3, -r2 * sin(th) - r3 * sin(th3) * slope, slope


def test_catapult_has_the_speed_that_its_energy_allows():
    _, (th, w, _) = motion('catapult', 'arm')
    r2, r3 = 0.12, 0.3
    x, th3, dx, dth3 = slider_crank_by_angle(r2, r3, th)
    arm = 0.03 + 0.8 * 0.28**2 + 0.1 * 0.6**2
    cog = -r2 * sin(th) - 0.15 * sin(th3) * dth3, r2 * cos(th) + 0.15 * cos(th3) * dth3
    rod = 0.4 * (cog[0] ** 2 + cog[1] ** 2) + 0.003 * dth3**2
    stored = 1250.0 * (0.9 - x - 0.35) ** 2
    stored += G * ((0.8 * 0.28 + 0.1 * 0.6) * sin(th) + 0.4 * (r2 * sin(th) + 0.15 * sin(th3)))
    kinetic = 0.5 * w**2 * (arm + rod + 0.5 * dx**2)
    assert kinetic == pytest.approx(stored[0] - stored, abs=1e-11 * stored[0])
    assert 0.6 * abs(w[-1]) == pytest.approx(21.4, abs=0.1)


@pytest.mark.slow
def test_engine_turns_as_one_equation_of_its_crank_says():
    """The slider-crank as one degree of freedom, d/dt of its energy, by SciPy."""
    r2, r3, h = 0.025, 0.1, 1e-5

    def inertia(th):
        s = th - pi / 2.0  # from the line of the slider, which stands upright
        _, th3, dx, dth3 = slider_crank_by_angle(r2, r3, s)
        cog = -r2 * sin(s) - 0.03 * sin(th3) * dth3, r2 * cos(s) + 0.03 * cos(th3) * dth3
        rod = 0.15 * (cog[0] ** 2 + cog[1] ** 2) + 230e-6 * dth3**2
        return 0.01 + 250e-6 + 0.6 * 0.005**2 + rod + 0.2 * dx**2

    def slope(f, th):
        return (8.0 * (f(th + h) - f(th - h)) - f(th + 2.0 * h) + f(th - 2.0 * h)) / (12.0 * h)

    def potential(th):
        x, th3, *_ = slider_crank_by_angle(r2, r3, th - pi / 2.0)
        height = r2 * sin(th) + 0.03 * cos(th3)
        return G * (0.2 * x + 0.15 * height - 0.6 * 0.005 * sin(th))

    def rates(_, y):
        th, w = y
        dx = slider_crank_by_angle(r2, r3, th - pi / 2.0)[2]
        force = -5000.0 * np.exp(6.0 * (sin(th - 0.3) - 1.0)) * dx - 0.02 * w
        force -= 0.5 * slope(inertia, th) * w**2 + slope(potential, th)
        return [w, force / inertia(th)]

    end = 0.1
    y = solve_ivp(rates, (0.0, end), [pi / 2.0, 100.0 * pi], 'DOP853', rtol=1e-11, atol=1e-11).y
    seen = run('slider_crank_engine')[1].sample(end, 'position.crank', 'velocity.crank')
    assert seen['position.crank'][0] == pytest.approx(y[0, -1], abs=1e-7)
    assert seen['velocity.crank'][0] == pytest.approx(y[1, -1], rel=1e-8)
