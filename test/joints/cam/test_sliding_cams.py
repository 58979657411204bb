"""Cams that slide: drawn profiles, forces, laws there and back, bounces, ends of strokes."""

import math

import numpy as np
import pytest
from absolute import differences
from builders import cam_pair, made, placed
from event_solution import Machine, Wall, apart, solve

import mechanism_sim as ms
from mechanism_sim.engine.events import Mode
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.joints.cam.reading import read_cam
from mechanism_sim.planar.configuration import Constraints, poses
from mechanism_sim.planar.points import rotate
from mechanism_sim.sensing.joint_view import JointView

KINDS = ('knife', 'roller', 'swinging roller', 'swinging face')
HILL = {
    'segments': [
        {'from': '0 mm', 'to': '20 mm', 'rise': '0 mm'},
        {'from': '20 mm', 'to': '70 mm', 'rise': '9 mm', 'curve': 'modified_sine'},
        {'from': '80 mm', 'to': '140 mm', 'rise': '-6 mm', 'curve': 'polynomial_4567'},
        {'from': '140 mm', 'to': '160 mm', 'rise': '0 mm'},
    ]
}


def content(kind, seed):
    """A machine of one kind, everything else at random: places, directions, sides."""
    rng = np.random.default_rng(seed)
    axis, cam_turn = rng.uniform(-3, 3, 2)
    left = bool(rng.integers(2))
    up = axis + (0.5 if left else -0.5) * math.pi
    way, hub, tip, own = (rng.uniform(-0.05, 0.05, 2) for _ in range(4))
    swings, law, joint = kind.startswith('swinging'), HILL, {}
    along, height = rng.uniform(-0.1, 0.1), 0.0
    if kind in ('roller', 'swinging roller'):
        joint['roller'] = '9 mm'
    if swings:
        height, size = (0.07, 0.1) if kind == 'swinging roller' else (0.2, 0.1)
        tip = own + size * np.array(rotate((1.0, 0.0), rng.uniform(-3, 3)))
        joint['side'] = side = ('left', 'right')[int(rng.integers(2))]
        angles = {'9 mm': '11 deg', '-6 mm': '-7 deg'}
        law = {'segments': [s | {'rise': angles.get(s['rise'], 0.0)} for s in HILL['segments']]}
        guide = {'revolute': ['ground.pivot', 'follower.own']}
    else:
        guide = {
            'prismatic': ['ground.pivot', 'follower.own'],
            'axis': up,
            'angle': rng.uniform(-3, 3),
        }
    base, pace = 0.03, 0.42
    if kind == 'swinging face':  # it must turn one way all along
        base, x, pace = 0.06, np.linspace(0.0, 0.1, 8), 0.24
        bend = 20 if (side == 'left') != left else -20
        law = {'points': np.column_stack([x, 7 * x + bend * x**2]).tolist()}
        joint['face'] = '-20 mm' if bend > 0 else 0.0
    pivot = (
        way
        + along * np.array(rotate((1.0, 0.0), axis))
        + height * np.array(rotate((1.0, 0.0), up))
    )
    return {
        'title': kind,
        'mechanism': 'linkage',
        'links': {
            'ground': {'points': {'way': way.tolist(), 'pivot': pivot.tolist()}},
            'cam': {'points': {'hub': hub.tolist()}, 'mass': 0.5, 'cog': [0.01, -0.004]},
            'follower': {
                'points': {'tip': tip.tolist(), 'own': own.tolist()}, 'mass': 0.2,
                'inertia': 1e-4, 'cog': [0.02, 0.01],
            },
        },
        'joints': {
            'way': {'prismatic': ['ground.way', 'cam.hub'], 'axis': axis, 'angle': cam_turn},
            'guide': guide,
            'contact': {
                'cam': ['cam.hub', 'follower.tip'],
                'follower': {'knife': 'knife', 'swinging face': 'flat'}.get(kind, 'roller'),
                'base_radius': base,
                'law': law,
                **joint,
            },
        },
        'gravity': [1.0, -9.0],
        'drive': {
            'coordinate': 'cam', 'start_position': '12 mm',
            'profile': {'points': [[0, pace], [0.3, pace], [0.35, -pace], [0.65, -pace]]},
        },
        'duration': 0.65,
    }  # fmt: skip


def scene(kind, seed, **more):
    said = content(kind, seed)
    said['joints']['contact'] |= more
    return made(said, kind)


def pressed(kind, seed, force, **more):
    """Machine with a load that presses the follower on its cam, instead of gravity."""
    said = content(kind, seed) | {'gravity': [0.0, 0.0]}
    push = rotate((-force, 0.0), cam_pair(scene(kind, seed)).direction)
    said['loads'] = {'press': {'at': 'follower.tip', 'force': list(push)}}
    said['joints']['contact'] |= more
    return made(said, kind)


@pytest.mark.sample(2)
@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('kind', KINDS)
def test_the_drawn_profile_touches_the_follower(kind, seed):
    machine = scene(kind, seed)
    pair, names = cam_pair(machine), machine.plan.ideal.coordinates
    law, said = pair.cam.law, machine.scene.joints
    drawn = pair.profile(pair.cam.at(np.linspace(*law.breaks[[0, -1]], 40_001)).profile)
    solution = ms.simulate(machine)
    t = np.random.default_rng(seed).uniform(0.0, solution.duration, 20)
    for column in solution.view(t).observed.position.T:
        q = dict(zip(names, column.tolist(), strict=True))
        fine = np.clip(q['cam'] + np.linspace(-1e-5, 1e-5, 201), *law.breaks[[0, -1]])
        near = pair.profile(pair.cam.at(fine).profile)
        seen = placed(machine, 'cam', q, np.hstack([drawn, near]))
        tip, own = (
            placed(machine, 'follower', q, np.array([machine.plan.points['follower'][p]]).T)
            for p in ('tip', 'own')
        )
        if kind == 'swinging face':
            x, y = (tip - own)[:, 0] / math.dist(tip[:, 0], own[:, 0])
            # an arm on the right of the line to its pivot turns its right side to the cam
            normal = np.array([-y, x]) * (1 if said['contact'].side == 'right' else -1)
            heights = normal @ seen
            face = normal @ tip[:, 0] + pair.cam.follower.face_offset
            gap = face - heights.max()
        else:
            gap = np.hypot(*(seen - tip)).min() - pair.cam.follower.roller
        assert gap == pytest.approx(0.0, abs=1e-7 if kind == 'knife' else 1e-9)


@pytest.mark.sample(2)
@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('kind', KINDS)
def test_forces_are_those_of_newton_and_euler_at_the_drawn_profile(kind, seed):
    machine = scene(kind, seed)
    solution = ms.simulate(machine)
    t = np.linspace(0.03, 0.97, 17) * solution.duration
    assert differences(machine, solution, t)[0].max() < 1e-8


@pytest.mark.parametrize('kind', KINDS)
def test_row_of_the_poses_is_the_derivative_of_what_it_leaves(kind):
    ideal = (machine := scene(kind, 5)).plan.ideal
    q = dict(zip(ideal.coordinates, machine.assembly.q.tolist(), strict=True))
    at, h = poses(ideal, q), 1e-6
    constraints = Constraints.of(ideal)
    residual, J = constraints.linearise(at)
    assert np.abs(residual).max() < 1e-12
    for k, shift in enumerate(np.eye(at.size)):
        ahead, behind = (
            constraints.linearise(at + s * h * shift.reshape(at.shape))[0] for s in (1, -1)
        )
        assert (ahead - behind) / (2 * h) == pytest.approx(J[:, k], abs=1e-7)


@pytest.mark.sample(1)
@pytest.mark.parametrize('kind', ['knife', 'roller', 'swinging roller'])
@pytest.mark.parametrize('lift_off', [None, {'restitution': 0.2}], ids=['ideal', 'open'])
def test_a_follower_keeps_to_its_law_there_and_back(kind, lift_off):
    machine = pressed(kind, 3, 60.0, lift_off=lift_off)
    solution = ms.simulate(machine)
    assert not [m for m in solution.modes if m.mode == Mode.FREE_FLIGHT]
    o, pair = solution.view(np.linspace(0.0, 0.65, 1301)).observed, cam_pair(machine)
    (x, y), (w, v), (alpha, a) = o.position, o.velocity, o.acceleration
    assert x.max() > 0.141  # past six edges of the table, and back
    u, u1, u2 = (pair.cam.law(x, k) for k in range(3))
    if pair.distance.swings:
        turn = machine.plan.ideal.frame('follower')[1]
        y = pair.swing * (y + turn + pair.arm_angle - pair.direction - math.pi)
        y, v, a = np.mod(y, 2.0 * math.pi), pair.swing * v, pair.swing * a
        off = y - pair.distance.lowest - u
        assert np.abs(off - 2 * math.pi * np.round(off / (2 * math.pi))).max() < 1e-14
    else:
        assert np.abs(y - y[0] - (u - u[0])).max() < 1e-15
    assert np.abs(v - u1 * w).max() < 1e-12
    away = np.abs(a - u1 * alpha - u2 * w**2)
    # at a break the acceleration is that of one of both sides
    assert np.sort(away)[: -len(x) // 50].max() < 1e-9
    assert abs(solution.energy.residual) < 1e-14 * solution.energy.exchanged


# bounces


HUMP, STROKE, MASSES, SPRING = 0.02, 0.2, (0.8, 0.3), 740.0


def hump(x, order=0):
    """``16 h (x/L)^2 (1 - x/L)^2``: six points of it are enough for a spline of degree 5."""
    p = (
        16.0
        * HUMP
        * np.polynomial.Polynomial([0, 0, 1, -2, 1])(np.polynomial.Polynomial([0, 1 / STROKE]))
    )
    return (p.deriv(order) if order else p)(x)


def thrown(restitution, **more):
    """A wedge thrown under a sprung knife edge."""
    x = np.linspace(0.0, STROKE, 6)
    said = {
        'title': 'Thrown wedge',
        'links': {
            'ground': {'points': {'seat': [0.0, 0.2]}},
            'wedge': {'mass': MASSES[0]},
            'lifter': {'mass': MASSES[1]},
        },
        'joints': {
            'way': {'prismatic': ['ground', 'wedge']},
            'guide': {'prismatic': ['ground', 'lifter'], 'axis': '90 deg'},
            'contact': {
                'cam': ['wedge', 'lifter'],
                'follower': 'knife',
                'base_radius': '10 mm',
                'law': {'points': np.column_stack([x, hump(x)]).tolist()},
                'lift_off': {'restitution': restitution},
            },
        },
        'gravity': [0.0, -9.81],
        'drive': {'coordinate': 'wedge', 'force': {}, 'speed': 3.5, 'start_position': '5 mm'},
        'springs': {
            'spring': {'between': ['ground.seat', 'lifter'], 'stiffness': '740 N/m',
                       'free_length': 0.2},
        },
        'duration': 0.052,
        **more,
    }  # fmt: skip
    return made(said, 'thrown')


@pytest.mark.sample(1)
@pytest.mark.parametrize('restitution', [0.4, 0.8])
def test_a_thrown_wedge_bounces_as_the_second_route(restitution):
    """The gap there is a height: impulses differ by the cosine of the slope."""
    machine = thrown(restitution)
    solution = ms.simulate(machine)

    def fall(_t, q, _v):
        lifted = -9.81 - SPRING / MASSES[1] * (0.01 + q[1])
        return np.array([0.0 * q[0], lifted])

    wall = Wall(
        'wedge',
        lambda q: q[1] - hump(q[0]),
        lambda q: np.array([-hump(q[0], 1), 1.0 + 0.0 * q[1]]),
        lambda q, v: -hump(q[0], 2) * v[0] ** 2,
    )
    second = Machine(MASSES, fall, (wall,), restitution, 2e-3)
    x = 5e-3
    motion = solve(second, (x, hump(x)), (3.5, 3.5 * hump(x, 1)), 0.052, wall)
    hard = [i for i in motion.impacts if i.impulse > 1e-4]
    assert len(hard) > 1
    at = solution.view(np.array([i.t for i in solution.impacts])).observed.position[0]
    slope = np.hypot(1.0, hump(at, 1))
    scaled = [
        i._replace(normal_impulse=i.normal_impulse / s)
        for i, s in zip(solution.impacts, slope, strict=True)
    ]
    times, impulses = apart(motion, scaled, {'wedge': 'contact'}, 1e-4)
    assert times < 1e-10
    assert impulses < 1e-8
    assert solution.max_penetration < 1e-15
    assert abs(solution.energy.residual) < 1e-13
    gap = solution.view(np.linspace(0, 0.052, 500)).observed.gap
    assert gap.max() > 4e-4


@pytest.mark.slow
def test_energy_closes_where_a_slider_crank_moves_the_cam():
    solution = ms.simulate(ms.load_scene('sliding_cam'), revolutions=4)
    hard = [i for i in solution.impacts if i.approach_speed > 0.01]
    assert len(hard) > 8
    assert solution.energy.dissipated > 0.01
    assert abs(solution.energy.residual) < 1e-14 * solution.energy.exchanged
    assert solution.max_penetration < 1e-13


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize('kind', ['roller', 'swinging roller'])
def test_a_roller_rattles_between_the_drawn_walls_of_a_groove(kind):
    clearance = 2e-4
    groove = {'clearance': clearance, 'restitution': 0.5}
    machine = pressed(kind, 2, 0.3 if kind == 'roller' else 0.02, groove=groove)
    pair, solution = cam_pair(machine), ms.simulate(machine)
    assert {i.joint for i in solution.impacts} == {'contact_left', 'contact_right'}
    assert abs(solution.energy.residual) < 1e-14 * solution.energy.exchanged
    t = np.random.default_rng(1).uniform(0.0, solution.duration, 30)
    o = solution.view(t).observed
    places = np.linspace(*pair.cam.law.breaks[[0, -1]], 200_001)
    walls = [pair.profile(wall) for wall in pair.cam.groove(places, clearance)]
    names = machine.mechanism.coordinates
    for k, column in enumerate(o.position.T):
        q = dict(zip(names, column.tolist(), strict=True))
        tip = placed(machine, 'follower', q, np.array([pair.on_second]).T)
        far = [np.hypot(*(placed(machine, 'cam', q, w) - tip)).min() for w in walls]
        gaps = dict(zip(machine.physics.clearances, o.gap[:, k], strict=True))
        # to the second order in the play
        roller = pair.cam.follower.roller
        assert far[0] - roller == pytest.approx(gaps['contact_right'], abs=1e-9)
        assert far[1] - roller == pytest.approx(gaps['contact_left'], abs=1e-9)


# what is read, and what is refused


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', KINDS)
def test_readings_balance(kind):
    machine = scene(kind, 6)
    solution = ms.simulate(machine)
    t = np.linspace(0.0, 0.65, 200)[:-1]
    k, dt = solution.motion.curve.find(t)
    o, pair = machine.physics.observe(solution.motion, k, dt), cam_pair(machine)
    view = JointView(machine.mechanism, pair, machine.physics, o, solution.motion.modes[k].T)
    r = read_cam(pair, view)
    assert r.cam_angle == pytest.approx(o.position[0], abs=1e-15)
    assert r.follower_position == pytest.approx(r.lift, abs=1e-14)
    # an ideal contact neither takes nor gives power
    fx, fy = view.force
    if pair.distance.swings:
        (px, py), pivot = view.place('follower', pair.on_second), machine.plan.points['ground']
        x, y = pivot['pivot']
        effort = pair.swing * (view.moment + (px - x) * fy - (py - y) * fx)
    else:
        x, y = rotate((1.0, 0.0), pair.direction)
        effort = fx * x + fy * y
    power = effort * r.follower_velocity
    assert np.abs(power).max() > 1e-3
    assert np.abs(power + r.cam_torque * r.cam_speed).max() < 1e-12
    along = r.contact_force * np.cos(r.pressure_angle)
    if not pair.distance.swings:
        assert along == pytest.approx(effort, abs=1e-12)


@pytest.mark.parametrize(
    ('overrides', 'words'),
    [
        pytest.param(
            {'links.crank.length': '60 mm'},
            'is beyond its law, which is defined from 0.095 to 0.205 m only, at ',
            marks=pytest.mark.slow,  # it is followed to where it stops
        ),
        ({'links.rod.length': '180 mm'}, 'at the start contact is beyond its law, which'),
        ({'joints.contact.phase': '3 deg'}, 'phase has no meaning for a cam that slides'),
        ({'joints.contact.sense': 'clockwise'}, 'sense has no meaning for a cam that slides'),
        ({'joints.guide.axis': '80 deg'}, 'must be 90 or -90 deg, not 80 deg'),
        ({'joints.contact.roller': '40 mm'}, 'take a smaller roller'),
        ({'joints.contact.law': {'eccentric': '3 mm'}}, 'for cams that turn'),
        (
            {'joints.contact.law': {'segments': [{'from': '0 deg', 'to': '9 deg', 'rise': 0}]}},
            'is given in rad, but it is a displacement, in m',
        ),
        (
            {'joints.contact.law': {'segments': [{'from': 0.2, 'to': 0.1, 'rise': 0}]}},
            'the segment from 200 to 100 mm has no positive length',
        ),
        (
            {'joints.contact.follower': 'flat', 'joints.contact.roller': 0},
            'take a knife edge or a roller',
        ),
    ],
)
def test_what_cannot_be_is_refused_by_name(overrides, words):
    with pytest.raises(InputError) as caught:
        ms.load_scene('sliding_cam', overrides)
    assert words in str(caught.value)
    assert str(caught.value).startswith('sliding_cam')


def test_metres_for_a_cam_that_turns_are_refused():
    law = {'segments': [{'from': '0 mm', 'to': '9 mm', 'rise': 0}]}
    with pytest.raises(InputError, match='is given in m, but it is an angle, in rad'):
        ms.load_scene('valve_train', {'joints.contact.law': law})


@pytest.mark.slow
def test_a_run_that_leaves_the_stroke_ends_with_a_sentence():
    words = (
        r'contact is beyond its law, which is defined from 0 to 0\.2 m only, at 0\.2 m \(t = 0\.05'
    )
    with pytest.raises(RunError, match=words):
        ms.simulate(thrown(0.4), duration=0.3)
    steady = {'coordinate': 'wedge', 'speed': 3.5, 'start_position': '5 mm'}
    with pytest.raises(InputError, match=r'defined from 0 to 0\.2 m only, at 0\.2 m'):
        thrown(0.4, drive=steady, duration=0.3)
    machine = thrown(0.4, drive=steady)
    with pytest.raises(RunError, match=r'only, at 0\.2 m \(t = 0\.05571428'):
        ms.simulate(machine, duration=0.3)


@pytest.mark.sample(1)
@pytest.mark.parametrize('restitution', [None, 0.3])
def test_a_stroke_may_end_exactly_where_its_law_does(restitution):
    """The crank goes through both dead points, by rounding on either side of the ends."""
    law = [
        {'from': '100 mm', 'to': '160 mm', 'rise': '20 mm'},
        {'from': '160 mm', 'to': '180 mm', 'rise': 0},
    ]
    off = None if restitution is None else {'restitution': restitution}
    machine = ms.load_scene(
        'sliding_cam', {'joints.contact.law.segments': law, 'joints.contact.lift_off': off}
    )
    solution = ms.simulate(machine, revolutions=5)
    assert solution.duration == pytest.approx(0.5)
    assert abs(solution.energy.residual) < 1e-14 * solution.energy.exchanged
