"""Scenes of compound mechanisms: what their sources state, by closed form or by other programs."""

from __future__ import annotations

import numpy as np
import pytest
from builders import without_work

import mechanism_sim as ms
from benchmarks.problems.andrews_squeezer import LINKS, relative_angles
from benchmarks.problems.andrews_squeezer import error as squeezer_error
from benchmarks.problems.andrews_squeezer import scipy as squeezer_by_scipy

SQUEEZER = (
    15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948,
    0.5244099658805304, 0.5347301163226948, 1.048080741042263,
)  # fmt: skip
"""Angles of Andrews' squeezer at 30 ms as the Test Set for IVP Solvers publishes them [rad]."""


def test_andrews_squeezer_ends_where_the_test_set_says():
    solution = ms.simulate(ms.load_scene('andrews_squeezer'), duration=0.03)
    seen = solution.sample([0.0, 0.03])
    start, end = relative_angles(np.array([seen[f'position.{link}'] for link in LINKS])).T
    given = (0.4552798191630704, 0.2226683901658859, 0.4873649795438426,
             -0.2226683901658859, 1.2305474445498212)  # fmt: skip
    assert start == pytest.approx([-0.06171389001427645, 0.0, *given], abs=1e-13)
    assert end == pytest.approx(SQUEEZER, abs=1e-8)  # theirs is 1.4e-9 off
    assert squeezer_error(end) < 1e-12
    assert abs(solution.energy.residual) < 1e-12


def test_andrews_squeezer_by_an_index_1_formulation():
    """The equations of the test set, which share nothing with the scene, give the same."""
    answer = squeezer_by_scipy('DOP853', 1e-12)()().answer
    assert squeezer_error(answer) < 1e-11
    assert answer == pytest.approx(SQUEEZER, abs=1e-8)


# --- the book's mechanisms --------------------------------------------------------------------


TURN = 2.0 * np.pi


def cycle(name, n=721, overrides=()):
    """A run of a scene as long as it says: machine, instants, what was sampled."""
    machine = ms.load_scene(name, overrides)
    solution = ms.simulate(machine)
    t = np.linspace(0.0, solution.duration, n)
    return machine, t, without_work(solution, t)


def place(machine, seen, link, point):
    """A point of a link in the world as complex numbers (N,) [m]."""
    found = np.zeros(len(seen['t']), complex)
    at = machine.plan.points[link][point]
    for (frame, slide), d in machine.mechanism.point(link, at).items():
        turned = 1.0 if frame == 'ground' else np.exp(1j * seen[f'position.{frame}'])
        found += (1.0 if slide is None else seen[f'position.{slide}']) * turned * complex(*d)
    return found


def meet(first, second, near, far, side):
    """Intersection of circles about two points: left (1) of the line between them, or right."""
    line = second - first
    r = np.abs(line)
    x = (near**2 + r**2 - far**2) / (2.0 * r)
    return first + line / r * (x + 1j * side * np.sqrt(near**2 - x**2))


def ends(t, x):
    """Instants of the extremes of something sampled evenly, by a parabola through three points."""
    i = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    before, here, after = x[i - 1], x[i], x[i + 1]
    return t[i] + 0.5 * (before - after) / (before - 2.0 * here + after) * (t[1] - t[0])


def test_loader_as_the_book_solves_it():
    """Equations 2.39 to 2.44 and 2.105 to 2.110, 2.107 and 2.108 without their misprints."""
    _, t, seen = cycle('loader')
    r3 = r8 = 0.76 + t
    u = {k: np.exp(1j * seen[f'position.{x}']) for k, x in (
        (2, 'arm'), (9, 'bellcrank'), (13, 'bucket_link'), (14, 'bucket'), (8, 'bucket_cylinder'),
        (3, 'lift_cylinder'))}  # fmt: skip
    u[3] = -u[3]  # the book's vector runs from the arm to the frame

    def fourth_case(b, ri, rj, sign):
        size, along = np.abs(b), b / np.abs(b)
        A = (size**2 - ri**2 + rj**2) / (2.0 * size * rj)
        B, C = (size - rj * A) / ri, sign * rj / ri * np.sqrt(1.0 - A**2)
        ui = along * (B - 1j * C)
        return ui, (b - ri * ui) / rj

    for (i, j), (ui, uj) in {
        (2, 3): fourth_case(np.full(len(t), -0.6j), 1.0, r3, -1),
        (8, 9): fourth_case(1.6 * u[2] - 0.14, r8, 0.8, -1),
        (13, 14): fourth_case(1.2 * u[2] - 0.4 * u[9], 1.1, 0.8, -1),
    }.items():
        assert u[i] == pytest.approx(ui, abs=1e-12)
        assert u[j] == pytest.approx(uj, abs=1e-12)

    def s(i, j):  # sin(theta_i - theta_j)
        return (u[i] * u[j].conj()).imag

    w2 = -1.0 / s(3, 2)
    c89 = (u[8] * u[9].conj()).real
    w8 = -(c89 + 1.6 * w2 * s(2, 9)) / (r8 * s(9, 8))
    w9 = -(1.0 + 1.6 * w2 * s(2, 8)) / (0.8 * s(8, 9))
    w13 = (0.4 * w9 * s(9, 14) - 1.2 * w2 * s(2, 14)) / (1.1 * s(14, 13))
    w14 = (0.4 * w9 * s(9, 13) - 1.2 * w2 * s(2, 13)) / (0.8 * s(13, 14))
    rates = {
        'arm': w2, 'bucket_cylinder': w8, 'bellcrank': w9, 'bucket_link': w13, 'bucket': w14,
    }  # fmt: skip
    for link, w in rates.items():
        assert seen[f'velocity.{link}'] == pytest.approx(w, rel=1e-9)


def test_dump_truck_tips_its_bed_by_sixty_degrees():
    _, _, seen = cycle('dump_truck')
    bed = np.degrees(seen['position.bed'])
    assert bed[[0, -1]] == pytest.approx([0.0, 60.0], abs=1e-3)
    assert (np.diff(bed) > 0.0).all()
    assert seen['velocity.bed'][[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_wiper_blades_sweep_together_between_the_dead_positions():
    _, _, seen = cycle('windshield_wiper', 7201)
    left, right = seen['position.left_rocker'], seen['position.right_rocker']
    assert left == pytest.approx(right, abs=1e-13)
    d = np.hypot(220.0, 58.0)
    at_pivot = [np.arccos((58.0**2 + d**2 - r**2) / (2 * 58.0 * d)) for r in (180.0, 260.0)]
    assert np.ptp(left) == pytest.approx(at_pivot[1] - at_pivot[0], abs=1e-6)


def test_punch_is_a_slider_crank_whose_force_grows_towards_the_dead_point():
    _, _, seen = cycle('punch')
    th = seen['position.crank']
    down = -0.1 * np.sin(th) + np.sqrt(0.25**2 - (0.1 * np.cos(th)) ** 2)
    assert seen['position.punch'] == pytest.approx(down, abs=1e-15)
    slope = -0.1 * np.cos(th) + 0.01 * np.sin(th) * np.cos(th) / np.sqrt(
        0.25**2 - (0.1 * np.cos(th)) ** 2
    )
    assert seen['velocity.punch'] == pytest.approx(slope * seen['velocity.crank'], abs=1e-14)
    assert abs(slope[360]) < 0.15 * abs(slope).max()  # seven times the force for the same torque


def test_double_toggle_is_straight_when_the_crank_is_in_line():
    _, t, seen = cycle('double_toggle_punch')
    th = seen['position.crank']
    knee = meet(0.04 * np.exp(1j * th), -0.4 + 0.25j, 0.355, 0.25, 1)
    slide = -(knee.imag - np.sqrt(0.25**2 - (knee.real + 0.4) ** 2))
    assert seen['position.punch'] == pytest.approx(slide, abs=1e-14)
    lowest = t[np.argmax(seen['position.punch'])]
    assert th[np.argmax(seen['position.punch'])] == pytest.approx(-np.pi, abs=0.02)
    speed = np.abs(seen['velocity.punch'])
    assert speed[np.abs(t - lowest) < 0.05].max() < 0.1 * speed.max()


def test_variable_stroke_follows_the_pivot_down_to_zero():
    crank = 0.01 * np.exp(1j * np.linspace(0.0, TURN, 721))
    swings = []
    for pivot in (58 + 34j, 85 + 34j, 99 + 28j):
        given = {'links.ground.points.pivot': [f'{pivot.real} mm', f'{pivot.imag} mm']}
        _, _, seen = cycle('variable_stroke_drive', overrides=given)
        knee = meet(crank, 1e-3 * pivot, 0.075, 0.06, -1)
        pin = meet(knee, 0.12, 0.06, 0.035, 1)
        assert np.exp(1j * seen['position.output_link']) == pytest.approx(
            (pin - 0.12) / 0.035, abs=1e-12
        )
        swings.append(np.degrees(np.ptp(seen['position.output_link'])))
    assert swings[0] > 25.0 > swings[1] > 5.0
    assert swings[2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.sample(1)
@pytest.mark.parametrize('height', [120.0, 160.0, 200.0])
def test_adjustable_stroke_is_inverse_to_the_distance_of_the_pivot(height):
    given = {
        'links.ground.points.pivot': ['0 mm', f'{-height} mm'],
        'links.ground.points.guide': ['0 mm', f'{285.0 - height} mm'],
    }
    _, _, seen = cycle('adjustable_stroke_drive', 7201, overrides=given)
    assert np.ptp(seen['position.slide']) == pytest.approx(2 * 0.3 * 40.0 / height, abs=1e-7)


def test_constant_velocity_over_half_a_turn():
    _, _, seen = cycle('constant_velocity_slider')
    v = np.tile(seen['velocity.slider'][:-1], 2)
    half = np.lib.stride_tricks.sliding_window_view(v, 361)
    mean = half.mean(axis=1, keepdims=True)
    assert np.abs(half / mean - 1.0).max(axis=1).min() < 0.08
    second = seen['position.second_crank']
    assert second[-1] - second[0] == pytest.approx(TURN, abs=1e-12)
    assert np.ptp(seen['position.slider']) == pytest.approx(2 * 0.157, abs=1e-5)


def test_shaper_returns_in_half_the_time_of_cutting():
    """The lever turns back where the crank is at right angles to it, 2 acos(O2A/O1O2) apart."""
    _, t, seen = cycle('quick_return_shaper', 3601, {'drive.start_angle': '30 deg'})
    a, b = ends(t, seen['position.ram'])
    times = sorted([b - a, t[-1] - (b - a)])
    back = 2.0 * np.arccos(150.0 / 300.0)
    assert times[1] / times[0] == pytest.approx((TURN - back) / back, abs=1e-5)
    assert times[1] / times[0] == pytest.approx(2.0, abs=1e-5)
    assert np.ptp(seen['position.ram']) == pytest.approx(2 * 0.6 * 150.0 / 300.0, abs=1e-6)


def test_film_is_pulled_straight_by_one_pitch_in_half_a_turn():
    machine, _, seen = cycle('film_advance')
    claw = place(machine, seen, 'coupler', 'end')
    crank = seen['position.crank']
    pulls = (crank >= -np.pi - 1e-9) & (crank <= 1e-9)
    path = claw[pulls]
    assert path[0] - path[-1] == pytest.approx(7.62e-3j, abs=1e-15)
    assert np.ptp(path.real) < 2e-5
    assert (np.diff(path.imag) < 0.0).all()


def test_material_is_taken_and_left_parallel_to_the_belts():
    machine, _, seen = cycle('material_handling', 7201)
    A, B, C = (place(machine, seen, 'coupler', point) for point in ('A', 'end', 'start'))
    level, inclined = (np.degrees(np.angle(x)) for x in (A - B, A - C))
    low, high = np.argmax(seen['position.rocker']), np.argmin(seen['position.rocker'])
    assert level[low] == pytest.approx(0.0, abs=0.02)
    assert inclined[high] == pytest.approx(150.0, abs=0.02)
    for i, in_line in ((low, -1.0), (high, 1.0)):
        turned = np.exp(1j * (seen['position.coupler'][i] - seen['position.crank'][i]))
        assert turned.real == pytest.approx(in_line, abs=1e-6)
        assert seen['velocity.rocker'][i] == pytest.approx(0.0, abs=2e-3)


def test_double_rocker_of_problem_2_17():
    """Arms of 7 cm, 10 cm apart: their limits are triangles with 7 + 1 and 7 - 1."""
    machine, _, seen = cycle('double_rocker_tracing', 7201)
    limits = [np.degrees(np.arccos((49.0 + 100.0 - r**2) / 140.0)) for r in (6.0, 8.0)]
    arm = np.degrees(seen['position.left_arm'])
    assert [arm.min(), arm.max()] == pytest.approx(limits, abs=1e-5)
    assert np.ptp(arm) == pytest.approx(16.43, abs=5e-3)
    assert np.ptp(np.degrees(seen['position.right_arm'])) == pytest.approx(np.ptp(arm), abs=1e-5)
    tracer = place(machine, seen, 'connecting_link', 'tracer')
    assert np.ptp(tracer.real) < 0.06 * np.ptp(tracer.imag)  # a straight line, roughly


def test_pliers_of_problem_2_16_lock_where_handle_and_toggle_are_in_line():
    _, _, seen = cycle('locking_pliers', 6001)
    handle, jaw = np.degrees(seen['position.handle']), seen['position.jaw']
    turned = np.degrees(2.0 * np.arcsin(0.1))  # isosceles: 10, 7 + 3 and 2
    assert turned == pytest.approx(11.48, abs=5e-3)
    assert handle[np.argmax(jaw)] == pytest.approx(-turned, abs=0.01)
    torque = seen['drive_torque']
    locks = np.flatnonzero(np.diff(np.sign(torque)))
    assert handle[locks] == pytest.approx([-turned], abs=0.05)
    toggle = seen['position.toggle'][np.argmax(jaw)]
    assert np.degrees(toggle) == pytest.approx(180.0 - turned, abs=0.05)


def test_foot_of_ten_links_walks_as_circles_say():
    machine, t, seen = cycle('ten_links')
    pin = 0.015 * np.exp(1j * seen['position.crank'])
    pivot = -0.038 - 0.0078j
    upper = meet(pin, pivot, 0.05, 0.0415, -1)
    lower = meet(pin, pivot, 0.0619, 0.0393, 1)
    knee = meet(upper, pivot, 0.0558, 0.0401, -1)
    heel = meet(knee, lower, 0.0394, 0.0367, -1)
    toe = meet(heel, lower, 0.0657, 0.049, -1)
    seen_toe = place(machine, seen, 'foot', 'toe')
    assert seen_toe == pytest.approx(toe, abs=2e-9)  # ternary links are written to 1 nm
    low = toe.imag < toe.imag.min() + 0.001
    speed = np.gradient(toe.real, t)[low]
    assert low.mean() == pytest.approx(0.54, abs=0.01)
    assert np.abs(speed / speed.mean() - 1.0).max() < 1.0 / 6.0


def test_straight_line_drive_is_straight():
    machine, _, seen = cycle('straight_line_drive')
    P = place(machine, seen, 'link', 'end')
    assert np.abs(P.real).max() < 1e-15
    assert np.ptp(np.degrees(seen['position.arm'])) == pytest.approx(30.0, abs=1e-9)
    assert np.ptp(P.imag) == pytest.approx(0.8 * np.sin(np.pi / 12.0), abs=1e-12)
    assert np.ptp(seen['position.block']) == pytest.approx(
        0.4 * (1 - np.cos(np.pi / 12.0)), abs=1e-9
    )
