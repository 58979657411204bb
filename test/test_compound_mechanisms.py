"""Scenes of compound mechanisms: what their sources state, by closed form or by other programs."""

from __future__ import annotations

import numpy as np
import pytest

import mechanism_sim as ms
from mechanism_sim.bench.problems.andrews_squeezer import LINKS, relative_angles
from mechanism_sim.bench.problems.andrews_squeezer import error as squeezer_error
from mechanism_sim.bench.problems.andrews_squeezer import scipy as squeezer_by_scipy
from mechanism_sim.planar.mechanism import PinInSlot, Prismatic, Revolute

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
    answer = squeezer_by_scipy('DOP853')(1e-12)()().answer
    assert squeezer_error(answer) < 1e-11
    assert answer == pytest.approx(SQUEEZER, abs=1e-8)


# --- the book's mechanisms --------------------------------------------------------------------

TURN = 2.0 * np.pi
DURATIONS = {
    'loader': 0.7, 'dump_truck': 12.0, 'punch': 0.5, 'locking_pliers': 0.6,
    'straight_line_drive': 2.0,
}  # fmt: skip
SCENES = (
    *DURATIONS, 'windshield_wiper', 'double_toggle_punch', 'variable_stroke_drive',
    'adjustable_stroke_drive', 'constant_velocity_slider', 'quick_return_shaper', 'film_advance',
    'material_handling', 'double_rocker_tracing', 'ten_links',
)  # fmt: skip


def cycle(name, n=721, overrides=()):
    """A scene over a turn of its crank, or its duration: machine, instants, what was sampled."""
    machine = ms.load_scene(name, overrides)
    length = {'duration': DURATIONS[name]} if name in DURATIONS else {'revolutions': 1}
    solution = ms.simulate(machine, **length)
    t = np.linspace(0.0, solution.duration, n)
    return machine, t, solution.sample(t), solution


def place(machine, seen, link, at=(0.0, 0.0)):
    """A point of a link in the world as complex numbers (N,) [m]."""
    found = np.zeros(len(next(iter(seen.values()))), complex)
    for (frame, slide), d in machine.mechanism.point(link, at).items():
        turned = 1.0 if frame == 'ground' else np.exp(1j * seen[f'position.{frame}'])
        found += (1.0 if slide is None else seen[f'position.{slide}']) * turned * complex(*d)
    return found


def meet(first, second, near, far, side):
    """Where circles about two points meet: on the left of the way between them (1), or right."""
    line = second - first
    r = np.abs(line)
    x = (near**2 + r**2 - far**2) / (2.0 * r)
    return first + line / r * (x + 1j * side * np.sqrt(near**2 - x**2))


def ends(t, x):
    """Instants of the extremes of something sampled evenly, by a parabola through three points."""
    i = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    before, here, after = x[i - 1], x[i], x[i + 1]
    return t[i] + 0.5 * (before - after) / (before - 2.0 * here + after) * (t[1] - t[0])


@pytest.mark.parametrize('name', SCENES)
def test_loops_stay_closed_and_energy_balances(name):
    machine, _, seen, solution = cycle(name)
    mechanism = machine.mechanism
    for joint in mechanism.joints:
        gap = place(machine, seen, joint.first, joint.on_first)
        gap -= place(machine, seen, joint.second, joint.on_second)
        if not isinstance(joint, Revolute):  # free along its axis
            link = joint.first if isinstance(joint, Prismatic) else joint.second
            frame, angle = mechanism.frame(link)
            turned = 0.0 if frame == 'ground' else seen[f'position.{frame}']
            gap = (gap * np.exp(-1j * (turned + angle + joint.axis))).imag
        assert np.abs(gap).max() < 1e-12, joint.name
    energy = solution.energy
    scale = np.abs([energy.initial, energy.final, energy.drive_work, energy.dissipated]).max()
    assert abs(energy.residual) < 1e-9 * scale


def test_loader_as_the_book_solves_it():
    """Equations 2.39 to 2.44 and 2.105 to 2.110, 2.107 and 2.108 without their misprints."""
    _, t, seen, _ = cycle('loader')
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
    _, _, seen, _ = cycle('dump_truck')
    bed = np.degrees(seen['position.bed'])
    assert bed[[0, -1]] == pytest.approx([0.0, 60.0], abs=1e-3)
    assert (np.diff(bed) > 0.0).all()
    assert seen['velocity.bed'][[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_wiper_blades_sweep_together_between_the_dead_positions():
    _, _, seen, _ = cycle('windshield_wiper', 7201)
    left, right = seen['position.left_rocker'], seen['position.right_rocker']
    assert left == pytest.approx(right, abs=1e-13)
    d = np.hypot(220.0, 58.0)
    at_pivot = [np.arccos((58.0**2 + d**2 - r**2) / (2 * 58.0 * d)) for r in (180.0, 260.0)]
    assert np.ptp(left) == pytest.approx(at_pivot[1] - at_pivot[0], abs=1e-6)


def test_punch_is_a_slider_crank_whose_force_grows_towards_the_dead_point():
    _, _, seen, _ = cycle('punch')
    th = seen['position.crank']
    down = -0.1 * np.sin(th) + np.sqrt(0.25**2 - (0.1 * np.cos(th)) ** 2)
    assert seen['position.punch'] == pytest.approx(down, abs=1e-15)
    slope = -0.1 * np.cos(th) + 0.01 * np.sin(th) * np.cos(th) / np.sqrt(
        0.25**2 - (0.1 * np.cos(th)) ** 2
    )
    assert seen['velocity.punch'] == pytest.approx(slope * seen['velocity.crank'], abs=1e-14)
    assert abs(slope[360]) < 0.15 * abs(slope).max()  # seven times the force for the same torque


def test_double_toggle_is_straight_when_the_crank_is_in_line():
    _, t, seen, _ = cycle('double_toggle_punch')
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
        _, _, seen, _ = cycle('variable_stroke_drive', overrides=given)
        knee = meet(crank, 1e-3 * pivot, 0.075, 0.06, -1)
        pin = meet(knee, 0.12, 0.06, 0.035, 1)
        assert np.exp(1j * seen['position.output_link']) == pytest.approx(
            (pin - 0.12) / 0.035, abs=1e-12
        )
        swings.append(np.degrees(np.ptp(seen['position.output_link'])))
    assert swings[0] > 25.0 > swings[1] > 5.0
    assert swings[2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('height', [120.0, 160.0, 200.0])
def test_adjustable_stroke_is_inverse_to_the_distance_of_the_pivot(height):
    given = {
        'links.ground.points.pivot': ['0 mm', f'{-height} mm'],
        'links.ground.points.guide': ['0 mm', f'{285.0 - height} mm'],
    }
    _, _, seen, _ = cycle('adjustable_stroke_drive', 7201, overrides=given)
    assert np.ptp(seen['position.slide']) == pytest.approx(2 * 0.3 * 40.0 / height, abs=1e-7)


def test_constant_velocity_over_half_a_turn():
    _, _, seen, _ = cycle('constant_velocity_slider')
    v = np.tile(seen['velocity.slider'][:-1], 2)
    half = np.lib.stride_tricks.sliding_window_view(v, 361)
    mean = half.mean(axis=1, keepdims=True)
    assert np.abs(half / mean - 1.0).max(axis=1).min() < 0.08
    second = seen['position.second_crank']
    assert second[-1] - second[0] == pytest.approx(TURN, abs=1e-12)
    assert np.ptp(seen['position.slider']) == pytest.approx(2 * 0.157, abs=1e-5)


def test_shaper_returns_in_half_the_time_of_cutting():
    """The lever turns back where the crank is at right angles to it, 2 acos(O2A/O1O2) apart."""
    _, t, seen, _ = cycle('quick_return_shaper', 3601, {'drive.start_angle': '30 deg'})
    a, b = ends(t, seen['position.ram'])
    times = sorted([b - a, t[-1] - (b - a)])
    back = 2.0 * np.arccos(150.0 / 300.0)
    assert times[1] / times[0] == pytest.approx((TURN - back) / back, abs=1e-5)
    assert times[1] / times[0] == pytest.approx(2.0, abs=1e-5)
    assert np.ptp(seen['position.ram']) == pytest.approx(2 * 0.6 * 150.0 / 300.0, abs=1e-6)


def test_film_is_pulled_straight_by_one_pitch_in_half_a_turn():
    machine, _, seen, _ = cycle('film_advance')
    claw = place(machine, seen, 'coupler', machine.plan.points['coupler']['end'])
    crank = seen['position.crank']
    pulls = (crank >= -np.pi - 1e-9) & (crank <= 1e-9)
    path = claw[pulls]
    assert path[0] - path[-1] == pytest.approx(7.62e-3j, abs=1e-15)
    assert np.ptp(path.real) < 2e-5
    assert (np.diff(path.imag) < 0.0).all()


def test_material_is_taken_and_left_parallel_to_the_belts():
    machine, _, seen, _ = cycle('material_handling', 7201)
    a, b = (machine.plan.points['coupler'][k] for k in ('A', 'end'))
    A, B, C = (place(machine, seen, 'coupler', p) for p in (a, b, (0.0, 0.0)))
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
    machine, _, seen, _ = cycle('double_rocker_tracing', 7201)
    limits = [np.degrees(np.arccos((49.0 + 100.0 - r**2) / 140.0)) for r in (6.0, 8.0)]
    arm = np.degrees(seen['position.left_arm'])
    assert [arm.min(), arm.max()] == pytest.approx(limits, abs=1e-5)
    assert np.ptp(arm) == pytest.approx(16.43, abs=5e-3)
    assert np.ptp(np.degrees(seen['position.right_arm'])) == pytest.approx(np.ptp(arm), abs=1e-5)
    tracer = place(machine, seen, 'connecting_link', (0.005, 0.005))
    assert np.ptp(tracer.real) < 0.06 * np.ptp(tracer.imag)  # a straight line, roughly


def test_pliers_of_problem_2_16_lock_where_handle_and_toggle_are_in_line():
    _, _, seen, _ = cycle('locking_pliers', 6001)
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
    machine, t, seen, _ = cycle('ten_links')
    pin = 0.015 * np.exp(1j * seen['position.crank'])
    pivot = -0.038 - 0.0078j
    upper = meet(pin, pivot, 0.05, 0.0415, -1)
    lower = meet(pin, pivot, 0.0619, 0.0393, 1)
    knee = meet(upper, pivot, 0.0558, 0.0401, -1)
    heel = meet(knee, lower, 0.0394, 0.0367, -1)
    toe = meet(heel, lower, 0.0657, 0.049, -1)
    seen_toe = place(machine, seen, 'foot', machine.plan.points['foot']['toe'])
    assert seen_toe == pytest.approx(toe, abs=2e-9)  # ternary links are written to 1 nm
    low = toe.imag < toe.imag.min() + 0.001
    speed = np.gradient(toe.real, t)[low]
    assert low.mean() == pytest.approx(0.54, abs=0.01)
    assert np.abs(speed / speed.mean() - 1.0).max() < 1.0 / 6.0


def test_straight_line_drive_is_straight():
    machine, _, seen, _ = cycle('straight_line_drive')
    P = place(machine, seen, 'link', machine.plan.points['link']['end'])
    assert np.abs(P.real).max() < 1e-15
    assert np.ptp(np.degrees(seen['position.arm'])) == pytest.approx(30.0, abs=1e-9)
    assert np.ptp(P.imag) == pytest.approx(0.8 * np.sin(np.pi / 12.0), abs=1e-12)
    assert np.ptp(seen['position.block']) == pytest.approx(
        0.4 * (1 - np.cos(np.pi / 12.0)), abs=1e-9
    )


# --- forces, by free bodies -------------------------------------------------------------------


def moved(machine, seen, link, at):
    """Place, velocity and acceleration of a point as complex numbers (N,)."""
    x = v = a = 0.0
    for (frame, slide), d in machine.mechanism.point(link, at).items():
        th, w, alpha = (
            0.0 if frame == 'ground' else seen[f'{what}.{frame}']
            for what in ('position', 'velocity', 'acceleration')
        )
        s, s1, s2 = (
            float(k == 0) if slide is None else seen[f'{what}.{slide}']
            for k, what in enumerate(('position', 'velocity', 'acceleration'))
        )
        arm = complex(*d) * np.exp(1j * th)
        x, v = x + s * arm, v + (s1 + 1j * w * s) * arm
        a = a + (s2 + 2j * w * s1 + (1j * alpha - w**2) * s) * arm
    return x, v, a


def turning(machine, seen, link, what='position'):
    """Angle of a link [rad], or its rate or acceleration."""
    frame, offset = machine.mechanism.frame(link)
    offset = offset if what == 'position' else 0.0
    return offset + (0.0 if frame == 'ground' else seen[f'{what}.{frame}'])


def applied(machine, seen, t):
    """Loads and springs: link, place, force as a complex number [N], moment [N m]."""

    def find(reference):
        link, _, point = reference.partition('.')
        return link, machine.plan.points[link][point or 'start']

    coordinates = {c: seen[f'position.{c}'] for c in machine.mechanism.coordinates}
    coordinates |= {f'{c}_rate': seen[f'velocity.{c}'] for c in machine.mechanism.coordinates}
    found = []
    for load in machine.scene.loads.values():
        link, at = find(load.at)
        x, v, _ = moved(machine, seen, link, at)
        known = {'t': t, 'x': x.real, 'y': x.imag, 'vx': v.real, 'vy': v.imag, **coordinates}
        fx, fy, torque = (
            eval(part, {}, known) if isinstance(part, str) else part
            for part in (*load.force, load.torque)
        )
        on = 1.0
        if load.during:
            width = (load.during.end - load.during.begin) % TURN
            on = (coordinates[load.during.coordinate] - load.during.begin) % TURN < width
        turned = np.exp(1j * turning(machine, seen, link)) if load.frame == 'link' else 1.0
        found.append((link, x, on * turned * (fx + 1j * fy), on * torque))
    for spring in machine.scene.springs.values():
        (a, at_a), (b, at_b) = map(find, spring.between)
        xa, xb = (moved(machine, seen, k, at)[0] for k, at in ((a, at_a), (b, at_b)))
        line = xb - xa
        pull = spring.stiffness.value * (1.0 - spring.free_length / np.abs(line)) * line
        found += [(a, xa, pull, 0.0), (b, xb, -pull, 0.0)]
    return found


def free_bodies(machine, seen, t):
    """Forces of all joints (N, j) as complex numbers, and efforts of all drives (N, d).

    Three equations a body, all joint forces and moments and the drives' efforts as unknowns.
    """
    mechanism, drives = machine.mechanism, list(machine.plan.laws)
    links = [body.name for body in mechanism.bodies]
    joints, n, size = mechanism.joints, len(t), 3 * len(links)
    slides = [j for j in joints if not isinstance(j, Revolute)]
    guides = [j for j in joints if isinstance(j, Prismatic)]
    efforts = [d for d in drives if d not in mechanism.displacements]
    unknowns = 2 * len(joints) + len(guides) + len(efforts)
    A, b = np.zeros((n, unknowns, unknowns)), np.zeros((n, unknowns))
    cogs = {}
    for i, body in enumerate(mechanism.bodies):
        x, _, a = moved(machine, seen, body.name, body.cog)
        cogs[body.name] = x
        force = body.mass * (a - complex(*mechanism.gravity))
        b[:, 3 * i], b[:, 3 * i + 1] = force.real, force.imag
        b[:, 3 * i + 2] = body.inertia * turning(machine, seen, body.name, 'acceleration')
    for link, x, force, torque in applied(machine, seen, t):
        if link in links:
            i, arm = links.index(link), x - cogs[link]
            b[:, 3 * i] -= force.real
            b[:, 3 * i + 1] -= force.imag
            b[:, 3 * i + 2] -= (arm.conj() * force).imag + torque
    for k, j in enumerate(joints):
        pin = isinstance(j, PinInSlot)
        x = moved(machine, seen, *((j.first, j.on_first) if pin else (j.second, j.on_second)))[0]
        for link, sign in ((j.first, -1.0), (j.second, 1.0)):
            if link in links:
                i, arm = links.index(link), x - cogs[link]
                A[:, 3 * i, 2 * k] = A[:, 3 * i + 1, 2 * k + 1] = sign
                A[:, 3 * i + 2, 2 * k], A[:, 3 * i + 2, 2 * k + 1] = (
                    -sign * arm.imag,
                    sign * arm.real,
                )
                if j in guides:
                    A[:, 3 * i + 2, 2 * len(joints) + guides.index(j)] = sign
    row = size
    for j in slides:
        if not (isinstance(j, Prismatic) and j.second in drives):  # free along its axis
            way = (
                turning(machine, seen, j.second if isinstance(j, PinInSlot) else j.first) + j.axis
            )
            k = joints.index(j)
            A[:, row, 2 * k], A[:, row, 2 * k + 1] = np.cos(way), np.sin(way)
            row += 1
    for k, d in enumerate(efforts):
        A[:, 3 * links.index(d) + 2, 2 * len(joints) + len(guides) + k] = 1.0
    assert row == unknowns
    found = np.linalg.solve(A, b[:, :, None])[:, :, 0]
    forces = found[:, 0 : 2 * len(joints) : 2] + 1j * found[:, 1 : 2 * len(joints) : 2]
    return forces, found[:, 2 * len(joints) + len(guides) :]


@pytest.mark.parametrize('name', SCENES)
def test_forces_are_those_of_free_bodies(name):
    machine, t, seen, _ = cycle(name, 40)
    t, seen = t[1:-1], {k: x[1:-1] for k, x in seen.items()}  # a load may begin with the turn
    forces, efforts = free_bodies(machine, seen, t)
    names = [j.name for j in machine.mechanism.joints]
    mine = np.array([seen[f'reaction.{j}.x'] + 1j * seen[f'reaction.{j}.y'] for j in names]).T
    assert np.abs(mine - forces).max() < 1e-9 * np.abs(forces).max()
    if efforts.shape[1]:
        assert np.abs(seen['drive_torque'] - efforts[:, 0]).max() < 1e-9 * np.abs(efforts).max()


@pytest.mark.parametrize('name', SCENES)
def test_velocities_and_accelerations_are_derivatives(name):
    """By differences of sixth order, away from corners of a drive's profile."""
    machine = ms.load_scene(name)
    length = {'duration': DURATIONS[name]} if name in DURATIONS else {'revolutions': 1}
    solution = ms.simulate(machine, **length)
    h = 1e-3 * solution.duration
    t = solution.duration * np.array([0.113, 0.317, 0.477, 0.629, 0.871])
    around = [solution.sample(t + k * h) for k in range(-3, 4)]
    for c in machine.mechanism.coordinates:
        for order, (low, high) in enumerate(
            (('position', 'velocity'), ('velocity', 'acceleration')), 1
        ):
            x = [seen[f'{low}.{c}'] for seen in around]
            slope = (45.0 * (x[4] - x[2]) - 9.0 * (x[5] - x[1]) + (x[6] - x[0])) / (60.0 * h)
            right = around[3][f'{high}.{c}']
            least = 1e-3 / solution.duration**order  # of links that do not turn
            scale = max(np.abs(right).max(), np.abs(x).max() / solution.duration, least)
            assert np.abs(slope - right).max() < 1e-7 * scale, (c, high)
