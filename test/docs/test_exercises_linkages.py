"""The exercises of mobility, kinematics and forces by a second route, not the program's own."""

import math
from collections import Counter

import numpy as np
import pytest
from absolute import Absolute
from blocks import new_scene
from builders import made
from running import ROOT

import mechanism_sim as ms
from mechanism_sim.linkages.mobility import kutzbach
from mechanism_sim.results.cycle import cycle

PAGE = (ROOT / 'docs/exercises.md').read_text('utf-8')


def swing(crank, rod, rocker, ground):
    """Angle [deg] of a rocker between the positions in which crank and coupler are in line."""
    ends = [
        math.acos((rocker**2 + ground**2 - x**2) / (2.0 * rocker * ground))
        for x in (rod + crank, rod - crank)
    ]
    return math.degrees(ends[0] - ends[1])


def differences(f, t, h=1e-4):
    """First and second derivative of a function by central differences of fourth order."""
    at = [f(t + k * h) for k in (-2, -1, 0, 1, 2)]
    first = (at[0] - 8.0 * at[1] + 8.0 * at[3] - at[4]) / (12.0 * h)
    second = (-at[0] + 16.0 * at[1] - 30.0 * at[2] + 16.0 * at[3] - at[4]) / (12.0 * h**2)
    return first, second


def rank(pins, links):
    """Rank of the constraints of links that pins (a, b) join, at places drawn at random."""
    rng = np.random.default_rng(1)
    rows = np.zeros((2 * len(pins), 3 * links))
    for k, (a, b) in enumerate(pins):
        for link, sign in ((a, 1.0), (b, -1.0)):
            x, y = rng.normal(size=2)
            rows[2 * k, 3 * link :][:3] = sign, 0.0, -sign * y
            rows[2 * k + 1, 3 * link :][:3] = 0.0, sign, sign * x
    return np.linalg.matrix_rank(rows)


def test_freedoms_of_links_that_hang_together():
    """Problems 1.3 to 1.5."""
    ring = [(0, 1), (1, 2), (2, 3), (3, 0)]
    assert 12 - rank(ring, 4) == kutzbach(5, 4) == 4
    assert 12 - rank(ring, 4) - 3 == kutzbach(4, 4) == 1
    assert 9 - rank([(0, 1), (0, 2)], 3) == kutzbach(4, 2) == 5
    assert 6 - rank([(0, 1)], 2) == kutzbach(3, 1) == 4


@pytest.mark.parametrize(
    ('name', 'links', 'kinds', 'framed', 'driven'),
    [
        ('adjustable_stroke_drive', 5, {'revolute': 4, 'slot': 1, 'prismatic': 1}, 3, ['crank']),
        ('locking_pliers', 4, {'revolute': 4}, 2, ['handle']),
        ('constant_velocity_slider', 6, {'revolute': 6, 'prismatic': 1}, 3, ['crank']),
        ('dump_truck', 6, {'revolute': 6, 'prismatic': 1}, 3, ['piston']),
    ],
)
def test_links_and_joints_are_those_of_the_figures(name, links, kinds, framed, driven):
    """Problems 1.6 to 1.9; the frame is a link."""
    machine = ms.load_scene(name)
    assert len(machine.plan.links) + 1 == links
    assert Counter(joint.kind for joint in machine.scene.joints.values()) == kinds
    on_frame = [joint for joint in machine.plan.joints if 'ground' in (joint.first, joint.second)]
    assert len(on_frame) == framed
    assert list(machine.plan.prescribed) == driven


@pytest.mark.parametrize('name', ['slider_crank', 'scotch_yoke_offset', 'material_handling'])
def test_equations_and_unknowns_of_forces(name):
    """Problems 3.10 to 3.12."""
    machine = ms.load_scene(name)
    assert 3 * len(machine.plan.links) == 9
    assert 2 * len(machine.mechanism.joints) + len(machine.plan.prescribed) == 9


@pytest.mark.parametrize(
    'name',
    ['adjustable_stroke_drive', 'locking_pliers', 'constant_velocity_slider',
     'double_toggle_punch', 'variable_stroke_drive', 'dump_truck'],
)  # fmt: skip
def test_mobility_by_the_rank_of_constraints_between_bodies(name):
    """Problems 1.10, 1.11; and 2.9 to 2.11, two loops."""
    machine = ms.load_scene(name)
    plan, mechanism = machine.plan, machine.plan.ideal
    bodies = Absolute(plan, mechanism, ())
    x = bodies.poses(machine.assembly.q).astype(complex)
    rows = [row for j in plan.joints for row in bodies.joint_rows(x, j)[0]]
    assert len(x) - np.linalg.matrix_rank(np.array(rows).real, tol=1e-9) == 1
    loops = len(plan.joints) - len(plan.bodies)
    assert loops == (1 if name == 'locking_pliers' else 2)


@pytest.mark.slow
def test_strokes_jaws_and_wipers():
    """Problems 1.6c, 1.7, 1.12, 2.16."""
    for d in (0.12, 0.09):
        pivot = {'links.ground.points.pivot': [0, -d]}
        found = cycle(ms.load_scene('adjustable_stroke_drive', pivot)).swings()['slide']
        assert found.size == pytest.approx(2.0 * 0.3 * 0.04 / d, rel=1e-9)
    for screw in (0.10, 0.098):
        machine = ms.load_scene('locking_pliers', {'links.ground.points.screw': [screw, 0]})
        ends = cycle(machine).extremes()['position.jaw']
        start = math.acos(((screw - 0.07) ** 2 + 0.02**2 - 0.03**2) / (2 * (screw - 0.07) * 0.02))
        in_line = math.acos((screw**2 + 0.02**2 - 0.10**2) / (2.0 * screw * 0.02))
        assert (ends.least.value, ends.greatest.value) == pytest.approx((start, in_line), rel=1e-9)
        if screw == 0.1:
            handle = math.asin(0.02 * math.sin(in_line) / 0.10)
            assert math.degrees(handle) == pytest.approx(11.478341)
    found = cycle(ms.load_scene('windshield_wiper')).swings()['left_rocker'].size
    expected = swing(0.04, 0.22, 0.058, math.hypot(0.22, 0.058))
    assert math.degrees(found) == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_inverted_slider_cranks():
    """Problems 2.1 and 2.2 by the law of cosines, 2.3 and 2.13 by the angle of the pin."""
    machine = new_scene(PAGE, 'cylinder_given')
    t = np.linspace(0.0, 0.5, 11)
    seen = ms.simulate(machine, duration=0.5).sample(t, 'position.piston', 'position.crank')
    D = 0.25 - seen['position.piston']
    assert pytest.approx(0.28 - 0.1 * t) == D
    sine = (0.04**2 + 0.25**2 - D**2) / (2.0 * 0.04 * 0.25)
    assert np.sin(seen['position.crank']) == pytest.approx(sine, abs=1e-12)
    pump = cycle(ms.load_scene('hand_pump'), duration=1.0)
    s, rocker = pump['position.plunger'], pump['position.rocker']
    far = np.hypot(0.12, s)
    between = np.arccos((0.2**2 + far**2 - 0.12**2) / (2.0 * 0.2 * far))
    assert np.abs(rocker - np.arctan2(s, -0.12)) == pytest.approx(between, abs=1e-9)
    found = cycle(ms.load_scene('quick_return'), points=['arm.end'])

    def tip(time):
        th = 2.0 * np.pi * time
        arm = np.arctan2(0.03 + 0.06 * np.sin(th), 0.06 * np.cos(th))
        return 0.11 * np.array([np.cos(arm), np.sin(arm)])

    first, second = differences(tip, found.t)
    for k, axis in enumerate('xy'):
        assert found[f'position.arm.end.{axis}'] == pytest.approx(tip(found.t)[k], abs=1e-12)
        assert found[f'velocity.arm.end.{axis}'] == pytest.approx(first[k], abs=1e-8)
        assert found[f'acceleration.arm.end.{axis}'] == pytest.approx(second[k], abs=1e-5)


def test_a_point_beside_the_rod_of_a_slider_crank():
    """Problems 2.5, 2.8, 2.15."""
    machine = ms.load_scene('slider_crank', {'links.rod.points': {'P': [0.1, 0.06]}})
    found = cycle(machine, points=['rod.P'])

    def place(time):
        th = 20.0 * np.pi * time
        rod = -np.arcsin(0.25 * np.sin(th))
        x = 0.05 * np.cos(th) + 0.1 * np.cos(rod) - 0.06 * np.sin(rod)
        return np.array([x, 0.05 * np.sin(th) + 0.1 * np.sin(rod) + 0.06 * np.cos(rod)])

    first, second = differences(place, found.t, 1e-5)
    for k, axis in enumerate('xy'):
        assert found[f'position.rod.P.{axis}'] == pytest.approx(place(found.t)[k], abs=1e-12)
        assert found[f'velocity.rod.P.{axis}'] == pytest.approx(first[k], abs=1e-8)
        assert found[f'acceleration.rod.P.{axis}'] == pytest.approx(second[k], abs=1e-3)
    assert found.extremes()['position.rod'].greatest.value == pytest.approx(math.asin(0.25))


@pytest.mark.slow
def test_angles_of_rocking_and_time_ratios():
    """Problems 2.7, 2.12, 2.17."""
    machine = ms.load_scene('four_bar_crank_rocker', {'links.crank.length': 0.0410038588582})
    lengths = [machine.scene.links[n].length for n in ('crank', 'coupler', 'rocker', 'ground')]
    assert swing(*lengths) == pytest.approx(40.0, abs=1e-8)
    assert cycle(machine).swings()['rocker'].size == pytest.approx(math.radians(40.0), rel=1e-9)
    ram = cycle(ms.load_scene('quick_return_shaper')).swings()['ram']
    a = math.asin(0.5)
    assert ram.time_ratio == pytest.approx((math.pi + 2.0 * a) / (math.pi - 2.0 * a), rel=1e-9)
    arm = cycle(ms.load_scene('double_rocker_tracing')).swings()['left_arm']
    assert math.degrees(arm.size) == pytest.approx(swing(1.0, 7.0, 7.0, 10.0), rel=1e-9)


@pytest.mark.slow
def test_wheels_and_racks_that_rest():
    """Problems 2.18 and 2.19; exercises 2.4 and 2.8."""
    r1 = 0.05 / math.sin(math.pi / 8.0)
    wheel = {
        'joints.crank_wheel.slots': 8,
        'links.ground.points.wheel_centre': [r1, 0],
        'guess': {'wheel': math.radians(202.5)},
    }
    machine = ms.load_scene('geneva', wheel)
    w = abs(machine.drive.start[1])
    fastest = -cycle(machine).extremes()['velocity.wheel'].least.value
    assert fastest == pytest.approx(w * 0.05 / (r1 - 0.05), rel=1e-9)
    assert f'{1e3 * r1:.3f}' in PAGE
    assert f'{1e3 * (r1 * math.cos(math.pi / 8.0) - (r1 - 0.05)):.2f} mm' in PAGE
    rack = cycle(ms.load_scene('linear_intermittent')).extremes()
    w = 2.0 * math.pi
    assert rack['velocity.rack'].greatest.value == pytest.approx(0.04 * w, rel=1e-9)
    assert rack['acceleration.rack'].greatest.value == pytest.approx(0.04 * w**2, rel=1e-9)
    ends = cycle(ms.load_scene('straight_line_drive'), points=['link.end']).extremes()
    y, block = ends['position.link.end.y'], ends['position.block']
    up = 4.0 * 0.2 * math.sin(math.radians(15.0))
    assert y.greatest.value - y.least.value == pytest.approx(up, rel=1e-9)
    along = 2.0 * 0.2 * (1.0 - math.cos(math.radians(15.0)))
    assert block.greatest.value - block.least.value == pytest.approx(along, rel=1e-9)
    found = cycle(ms.load_scene('adjustable_stroke_drive'))
    th = found['position.crank']
    lever = np.arctan2(0.12 + 0.04 * np.sin(th), 0.04 * np.cos(th))
    x, y = 0.3 * np.cos(lever), -0.12 + 0.3 * np.sin(lever)
    assert found['position.slide'] == pytest.approx(x + np.sqrt(0.2**2 - (0.165 - y) ** 2))


UNKNOWN = {
    'slider_crank': ('piston', [-1, 0], 'world'),
    'four_bar_crank_rocker': ('rocker.end', [0, 1], 'link'),
    'five_bar': ('slider', [0, 1], 'link'),
    'scotch_yoke': ('yoke', [1, 0], 'world'),
}


@pytest.mark.parametrize('name', UNKNOWN)
def test_a_given_moment_and_the_resistance_do_what_energy_takes(name):
    """[V] 3.5.2 to 3.5.5: drive and resistance feed in what kinetic and potential energy gain."""
    at, way, frame = UNKNOWN[name]
    load = {'at': at, 'force': way, 'frame': frame, 'unknown': True}
    machine = ms.load_scene(name, {'drive.effort': 12.0, 'loads': {'resistance': load}})
    point = at if '.' in at else f'{at}.start'
    found = cycle(machine, points=[point])
    link, period = at.partition('.')[0], machine.drive.period
    for t in (0.13 * period, 0.31 * period, 0.77 * period):
        now = found.at(np.array([t]))
        v = np.array([now[f'velocity.{point}.{axis}'][0] for axis in 'xy'])
        angle = now[f'position.{link}'][0] if frame == 'link' else 0.0
        c, s = math.cos(angle), math.sin(angle)
        force = np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])
        force *= now['load.resistance'][0]
        h = 1e-4 * period
        around = found.at(t + h * np.arange(-2, 3))
        energy = around['energy.kinetic'] + around['energy.potential']
        rate = (energy[0] - 8.0 * energy[1] + 8.0 * energy[3] - energy[4]) / (12.0 * h)
        fed = 12.0 * now['velocity.crank'][0] + force @ v
        assert fed == pytest.approx(
            rate, abs=1e-7 * (abs(rate) + abs(12.0 * machine.drive.fastest))
        )


@pytest.mark.slow
def test_forces_of_links_without_mass():
    """Problems 3.1 to 3.5, 3.7, and [V] 3.25, 3.30 with the page's number."""
    light = new_scene(PAGE, 'light')

    def loaded(loads, **drive):
        content = light.scene.model_dump(exclude_none=True, by_alias=True)
        content['loads'] = loads
        content['links']['rod']['points'] = {'P': [0.05, 0.0]}
        content['drive'] |= drive
        return made(content, 'light')

    push = {'at': 'rod.P', 'force': [0.0, 20.0], 'frame': 'link'}
    found = cycle(loaded({'across': push}), local=True)
    for joint, arm in (('crank_rod', 0.15), ('rod_piston', 0.05)):
        across = found[f'reaction.{joint}.rod.across']
        assert across == pytest.approx(np.full(361, -20.0 * arm / 0.2))
    found = cycle(loaded({'m': {'at': 'rod', 'torque': 3.0}}), local=True)
    assert found['reaction.crank_rod.rod.across'] == pytest.approx(np.full(361, 3.0 / 0.2))
    assert found['reaction.rod_piston.rod.across'] == pytest.approx(np.full(361, -3.0 / 0.2))
    found = cycle(loaded({'w': {'at': 'piston', 'force': [-400.0, 0.0]}}), local=True)
    along = 400.0 / np.cos(found['position.rod'])
    assert found['reaction.crank_rod.rod.along'] == pytest.approx(along)
    unknown = {'r': {'at': 'piston', 'force': [-1, 0], 'unknown': True}}
    seen = ms.simulate(loaded(unknown, effort=12.0), duration=1.0 / 60.0).sample(
        1.0 / 60.0, 'load.r'
    )
    th2, th3 = math.pi / 3.0, -math.asin(0.25 * math.sin(math.pi / 3.0))
    P4 = 12.0 / (0.05 * math.sin(th3 - th2)) * math.cos(th3)
    assert seen['load.r'][0] == pytest.approx(P4, rel=1e-9)
    assert f'{P4:.3f}' in PAGE
    coupler = {'links.coupler.mass': 0, 'links.coupler.inertia': 0}
    found = cycle(ms.load_scene('punch', coupler), static=True, local=True)
    across, axial = (found[f'reaction.coupler_punch.punch.{x}'] for x in ('across', 'along'))
    slope = np.tan(found['position.coupler'])  # the punch points down
    loaded_only = np.abs(axial) > 1.0
    assert np.abs(across / axial)[loaded_only] == pytest.approx(np.abs(1.0 / slope)[loaded_only])


@pytest.mark.slow
def test_moments_of_the_exercises_by_virtual_power():
    """Exercises 3.1 to 3.7: drives supply what loads, weights and inertia take."""
    film = cycle(new_scene(PAGE, 'film'), points=['coupler.end'])
    load = film.machine.scene.loads['film']
    v = [film[f'velocity.coupler.end.{axis}'] for axis in 'xy']
    power = load.force[0] * v[0] + load.force[1] * v[1]
    drive = film['drive_torque'] * film['velocity.crank']
    acting = np.abs(drive) > 1e-12
    assert acting.any()
    assert not acting.all()
    assert drive[acting] == pytest.approx(-power[acting], rel=1e-9, abs=1e-12)
    carrier = cycle(new_scene(PAGE, 'carrier'), points=['coupler.A'])
    v, a = ([carrier[f'{kind}.coupler.A.{axis}'] for axis in 'xy']
            for kind in ('velocity', 'acceleration'))  # fmt: skip
    taken = 5.0 * (a[0] * v[0] + (a[1] + 9.81) * v[1])
    drive = carrier['drive_torque'] * carrier['velocity.crank']
    assert drive == pytest.approx(taken, abs=1e-9)
    rocker = cycle(new_scene(PAGE, 'rocker'), points=['connecting_link.tracer'])
    vx, w = rocker['velocity.connecting_link.tracer.x'], rocker['velocity.left_arm']
    known = np.isfinite(rocker['load.moment']) & (np.abs(vx) > 1e-9)
    expected = np.where(vx > 0.0, 10.0 * vx / w, 0.0)
    assert rocker['load.moment'][known] == pytest.approx(expected[known], rel=1e-7, abs=1e-9)
    puncher = cycle(new_scene(PAGE, 'puncher'))
    v = puncher['velocity.punch']
    drive = puncher['drive_torque'] * puncher['velocity.crank']
    held = np.abs(drive) > 1e-9
    assert np.abs(drive[held]) == pytest.approx(10000.0 * np.abs(v[held]), rel=1e-9)
    assert len({*np.sign(v[held]).tolist()}) == 1
    for name, c, way, part, size in (
        ('variable_stroke_drive', 'output_link', 'backward', 'torque', 5.0),
        ('adjustable_stroke_drive', 'slide', 'forward', 'force', -100.0),
    ):
        load = {'at': c, part: [size, 0.0] if part == 'force' else size}
        load = load | {'during': {'coordinate': c, 'moving': way}}
        found = cycle(ms.load_scene(name, {'gravity': [0, 0], 'loads': {'l': load}}), static=True)
        v = found[f'velocity.{c}']
        drive = found['drive_torque'] * found['velocity.crank']
        on = (v > 0.0) == (way == 'forward')
        clear = np.abs(v) > 1e-6
        assert drive[on & clear] == pytest.approx(-size * v[on & clear], rel=1e-9)
        assert drive[~on & clear] == pytest.approx(0.0, abs=1e-9)


def test_what_lifts_the_bed():
    """Exercise 3.4: the force times the speed is the rate of potential energy."""
    machine = ms.load_scene('dump_truck')
    found = cycle(machine, static=True, duration=8.78445, samples=8)
    h = 1e-4
    for t in found.t[1:-1]:
        around = found.at(t + h * np.arange(-2, 3))
        V = around['energy.potential']
        rate = (V[0] - 8.0 * V[1] + 8.0 * V[3] - V[4]) / (12.0 * h)
        drive = around['drive_torque'][2] * around['velocity.piston'][2]
        assert drive == pytest.approx(rate, rel=1e-7)
    assert math.degrees(found['position.bed'][-1]) == pytest.approx(45.0, abs=1e-4)
