"""Frames on springs: the forces that shake them, their response, and instruments on them."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from bags import messages_of
from builders import digest_of
from running import run, run_json
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.errors import InputError
from mechanism_sim.nodes.oscillator import fields
from mechanism_sim.numerics.polynomials import gauss_nodes
from mechanism_sim.numerics.rational import Rational
from mechanism_sim.planar.points import GROUND
from mechanism_sim.report.bag import render
from mechanism_sim.scene.frame_forces import forces_on
from mechanism_sim.sensing.chain import Amplifier
from mechanism_sim.vibration.residues import receptance, through
from mechanism_sim.vibration.shaken_frame import Shaking

FRAME = {
    'mass': 20.0,
    'inertia': 0.5,
    'cog': [0.15, -0.05],
    'mounts': {
        'left': {'at': [0.0, -0.1], 'stiffness': [2e5, 4e5], 'damping': [50.0, 80.0]},
        'right': {'at': [0.387, -0.1], 'stiffness': [2e5, 3e5], 'damping': [50.0, 80.0]},
    },
}
LOOSE = {'radial': 2e-4, 'restitution': 0.5}


def on_frame(scene, overrides=(), **frame):
    """A scene with the frame, some of whose keys are others."""
    return ms.load_scene(
        scene, overrides={'oscillators': {'frame': {**FRAME, **frame}}, **dict(overrides)}
    )


def shaking_of(machine):
    """Excitation of its frame, for one listener."""
    return Shaking(machine.frame('frame'), forces_on(machine, 'frame'))


def grounded(machine):
    """The joints of the ground."""
    return [j.name for j in machine.mechanism.joints if GROUND in (j.first, j.second)]


# --- matrices -------------------------------------------------------------------------------


def random_system(rng, n):
    """Mass, damping (of no kind) and stiffness."""
    a, b, c = rng.normal(size=(3, n, n))
    return a @ a.T + n * np.eye(n), 3.0 * c @ c.T, 1e4 * (b @ b.T + np.eye(n))


def dynamic_stiffness(M, C, K, s):
    return s**2 * M + s * C + K


@pytest.mark.parametrize('seed', range(20))
def test_partial_fractions_sum_to_the_receptance(seed):
    rng = np.random.default_rng(seed)
    M, C, K = random_system(rng, rng.integers(1, 5))
    poles, residues = receptance(M, C, K)
    for s in 100.0 * rng.normal(size=(5, 2)) @ [1.0, 1j]:
        wanted = np.linalg.inv(dynamic_stiffness(M, C, K, s))
        found = (residues / (s - poles)).sum(axis=2)
        assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()


@pytest.mark.parametrize('ratio', [0.0, 0.02, 0.9999999, 1.0, 1.0000001, 3.0])
def test_equal_frequencies_and_critical_damping_are_no_exceptions(ratio):
    M, K = np.diag([2.0, 2.0, 3.0]), np.diag([800.0, 800.0, 1200.0])
    C = 2.0 * ratio * 20.0 * M
    poles, residues = receptance(M, C, K)
    for s in (3.0 + 40j, 1j, -2.0 + 5j):
        wanted = np.linalg.inv(dynamic_stiffness(M, C, K, s))
        found = (residues / (s - poles)).sum(axis=2)
        assert np.abs(found - wanted).max() < 2e-9 * np.abs(wanted).max()


def test_a_chain_behind_a_frame_has_the_product_of_both():
    """Also where a pole of the chain is one of the frame."""
    rng = np.random.default_rng(3)
    M, C, K = random_system(rng, 3)
    system, outputs = receptance(M, C, K), rng.normal(size=3)
    p = system.poles[np.argmax(system.poles.imag)]
    for chain in (
        Rational(),
        Amplifier(high_pass=2.0, low_pass=30.0).transfer(),
        Rational((), (p, p.conjugate()), abs(p) ** 2),
    ):
        modes = through(system, M, outputs, chain)
        for s in (1j, 2.0 + 50j, 300j):
            frame = s**2 * outputs @ np.linalg.inv(dynamic_stiffness(M, C, K, s))
            wanted = chain(s) * frame
            found = modes.direct[0] + (modes.residues[0] / (s - modes.poles)).sum(axis=1)
            assert np.abs(found - wanted).max() < 1e-9 * max(1.0, abs(chain(s)))


# --- forces ---------------------------------------------------------------------------------


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    'scene',
    [
        'four_bar_nominal',
        'geneva',
        'loader',
        'measured_cam',
        'quick_return_shaper',
        'slider_crank_engine',
        'slider_crank_piston_driven',
    ],
)
def test_the_force_is_that_of_bearings_drives_and_springs(scene):
    """The momentum of the links against the sum over what touches the ground."""
    machine = on_frame(scene)
    found = ms.cycle(machine)
    motion, shaking = found.solution.motion, shaking_of(machine)
    x, y, moment = shaking.read(motion, *motion.curve.find(found.t))
    about_origin = moment + 0.15 * y + 0.05 * x
    inner = ~np.isin(found.t, motion.curve.start)  # accelerations may jump there
    for name, row in (('force.x', x), ('force.y', y), ('moment', about_origin)):
        column = found[f'shaking_{name}']
        scale = np.abs([x, y]).max() + np.abs(about_origin).max()
        assert np.abs(row - column)[inner].max() < 1e-8 * scale, name


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('scene', 'overrides', 'duration'),
    [
        ('four_bar_clearance', {}, 0.4),
        (
            'four_bar_clearance',
            {'joints.rocker_ground.clearance': {**LOOSE, 'friction': 0.1, 'pin_radius': 0.008}},
            0.4,
        ),
        ('gear_rattle', {}, 0.1),
        ('geneva', {'joints.crank_wheel.clearance': LOOSE}, 0.3),
    ],
)
def test_impulses_of_all_joints_are_those_of_the_machine(scene, overrides, duration):
    """By momentum, and joint by joint; the difference of moments is what the drive supplies."""
    whole = on_frame(scene, overrides)
    single = on_frame(scene, overrides, joints=grounded(whole))
    solution = ms.simulate(whole, duration=duration)
    a, b = (shaking_of(m).impulses(solution.motion) for m in (whole, single))
    scale = np.abs(b).max()
    assert scale > 1e-4
    assert np.abs(a - b)[:, :2].max() < 1e-10 * scale
    start, times = solution.motion.curve.start, np.array([i.t for i in solution.impacts])
    drives = np.array([i.drive_impulse for i in solution.impacts])
    supplied = np.array([drives[times == t].sum() for t in start])
    assert np.abs(b[:, 2] - a[:, 2] - supplied).max() < 1e-6 * scale
    assert not a[~np.isin(start, times)].any()


def test_an_impact_of_teeth_parts_the_bearings_of_both_gears():
    """Each bearing takes the impulse of the teeth, along the line of action of its flank."""
    joints = {'joints': ['wheel_shaft']}
    machine = on_frame('gear_rattle', **joints)
    solution = ms.simulate(machine, duration=0.1)
    impulses = shaking_of(machine).impulses(solution.motion)
    start = solution.motion.curve.start
    for impact in solution.impacts:
        x, y, _ = impulses[np.searchsorted(start, impact.t)]
        assert np.hypot(x, y) == pytest.approx(impact.normal_impulse, rel=1e-9)
        assert abs(y) == pytest.approx(np.cos(np.radians(20.0)) * np.hypot(x, y), rel=1e-9)
        assert x > 0.0  # from the pinion to the wheel


# --- response -------------------------------------------------------------------------------


@pytest.mark.sample(1)
@pytest.mark.parametrize('joints', [None, ['ground_crank', 'rocker_ground']])
def test_the_response_is_that_of_an_integrator(joints):
    """DOP853 with the forces of the bearings, which come from another route."""
    machine = on_frame('four_bar_nominal', joints=joints)
    solution = ms.simulate(machine, duration=0.1)
    shaken = machine.oscillator('frame')
    frame, t = shaken.frame, np.linspace(0.0, 0.1, 50)
    found = shaken.take(solution.motion)(t)
    needed = 'reaction.ground_crank', 'reaction.rocker_ground', 'drive_torque'

    def rates(time, state):
        x = solution.sample(time, *needed)
        force = np.zeros(3)
        for joint, sign, place in (('ground_crank', -1, 0.0), ('rocker_ground', 1, 0.387)):
            fx, fy = (sign * x[f'reaction.{joint}.{axis}'][0] for axis in 'xy')
            arm = np.array([place, 0.0]) - frame.cog
            force += [fx, fy, arm[0] * fy - arm[1] * fx]
        if joints is None:
            force[2] -= x['drive_torque'][0]
        push = force - frame.C @ state[3:] - frame.K @ state[:3]
        return np.concatenate([state[3:], np.linalg.solve(frame.M, push)])

    start = np.concatenate([found.position[:, 0], np.zeros(3)])
    wanted = solve_ivp(rates, (0.0, 0.1), start, 'DOP853', t_eval=t, rtol=1e-11, atol=1e-14)
    for row, column in zip((*found.position, *found.velocity), wanted.y, strict=True):
        assert np.abs(row - column).max() < 1e-9 * np.abs(column).max()
    accelerations = np.array([rates(*x)[3:] for x in zip(t, wanted.y.T, strict=True)]).T
    error = np.abs(found.acceleration - accelerations).max(axis=1)
    assert (error < 2e-9 * np.abs(accelerations).max(axis=1)).all()


def test_an_impact_gives_the_frame_the_velocity_of_its_impulse():
    machine = ms.load_scene('four_bar_on_frame')
    solution = ms.simulate(machine, duration=0.3)
    moved = machine.oscillator('frame').take(solution.motion)
    impulses = shaking_of(machine).impulses(solution.motion)
    M = moved.frame.M
    start = solution.motion.curve.start
    hard = [i for i in solution.impacts if i.normal_impulse > 1e-4]
    assert len(hard) > 10
    for impact in hard:
        k = np.searchsorted(start, impact.t)
        before, after = moved([impact.t - 1e-9, impact.t + 1e-9]).velocity.T
        jump = M @ (after - before)
        # what acts within 2e-9 s beside it is below 1e-7 N s
        assert np.abs(jump - impulses[k]).max() < 1e-7


@pytest.mark.sample(1)
@pytest.mark.parametrize('scene', ['four_bar_on_frame', 'gear_housing'])
def test_momentum_and_energy_of_a_long_run(scene):
    """What machine and impacts give is what mounts take, and what is left."""
    machine = ms.load_scene(scene)
    (name,) = machine.scene.oscillators
    solution = ms.simulate(machine, duration=1.0 if scene == 'four_bar_on_frame' else 0.2)
    curve, shaken = solution.motion.curve, machine.oscillator(name)
    frame, moved = shaken.frame, shaken.take(solution.motion)
    shaking = Shaking(frame, forces_on(machine, name))
    impulses = shaking.impulses(solution.motion)
    # pieces cut so small that a quadrature of 10 points is exact for the fastest mode
    n = int(np.ceil(curve.duration.max() * 2.0 * np.pi * frame.frequencies[-1]))
    x, w = gauss_nodes(10)
    parts = (np.arange(n)[:, None] + x).ravel() / n
    t = (curve.start[:, None] + curve.duration[:, None] * parts).ravel()
    weight = (curve.duration[:, None] * np.tile(w / n, n)).ravel()
    s = moved(t)
    begin, end = moved(0.0), moved(curve.end)
    gained = frame.M @ (end.velocity - begin.velocity)[:, 0]
    given = (s.force - s.mount_force) @ weight + impulses.sum(axis=0)
    size = np.abs(s.force) @ weight + np.abs(impulses).sum(axis=0)
    assert np.abs(gained - given).max() < 1e-9 * size.max()
    after = moved(curve.start).velocity
    middle = after - 0.5 * np.linalg.solve(frame.M, impulses.T)
    work = ((s.force * s.velocity).sum(axis=0)) @ weight + (impulses.T * middle).sum()
    lost = np.einsum('in,ij,jn->n', s.velocity, frame.C, s.velocity) @ weight

    def energy(state):
        u, v = state.position[:, 0], state.velocity[:, 0]
        return 0.5 * (v @ frame.M @ v + u @ frame.K @ u)

    assert lost > 0.0
    assert work - lost == pytest.approx(energy(end) - energy(begin), abs=1e-9 * lost)


@pytest.mark.slow
def test_pieces_of_a_run_make_the_same_motion():
    """However a run is cut."""
    machine = ms.load_scene('four_bar_on_frame')
    solution = ms.simulate(machine, duration=0.3)
    t = np.arange(300) / 1000.0
    whole = machine.oscillator('frame').take(solution.motion)(t)
    shaken, found = machine.oscillator('frame'), []
    engine = machine.start()
    for end in np.linspace(0.01, 0.3, 30):
        engine.advance(float(end), final=True)
        motion, *_ = engine.drain()
        part = shaken.take(motion)
        inside = t[(t >= motion.curve.start[0]) & (t < motion.curve.end)]
        found.append(part(inside).position)
    position = np.concatenate(found, axis=1)
    assert position.shape == whole.position.shape
    assert np.abs(position - whole.position).max() < 1e-9 * np.abs(whole.position).max()


RIDING = {
    'title': 'Slider-crank on a frame that slides on a spring',
    'mechanism': 'linkage',
    'links': {
        'frame': {'mass': 1.0},
        'crank': {'length': 0.05, 'mass': 0.5, 'inertia': 4e-4, 'cog': 0.01},
        'rod': {'length': 0.2, 'mass': 0.3, 'inertia': 1e-3, 'cog': 0.08},
        'piston': {'mass': 0.4, 'inertia': 1e-4},
    },
    'drive': {'coordinate': 'crank', 'speed': 60.0},
    'guess': {'piston': 0.25},
}
JOINTS = {
    'main': {'revolute': ['{0}', 'crank.start']},
    'pin': {'revolute': ['crank.end', 'rod.start']},
    'wrist': {'revolute': ['rod.end', 'piston']},
    'bore': {'prismatic': ['{0}', 'piston'], 'axis': 0.0, 'angle': 0.0},
}


def slider_crank(carrier, **more):
    """A slider-crank whose bearings belong to the ground or to a frame."""
    links = {k: v for k, v in RIDING['links'].items() if carrier == 'frame' or k != 'frame'}
    joints = {
        name: {k: [p.format(carrier) for p in v] if isinstance(v, list) else v
               for k, v in joint.items()}
        for name, joint in JOINTS.items()
    }  # fmt: skip
    return {**RIDING, 'links': links, 'joints': joints, **more}


@pytest.mark.slow
def test_a_heavy_frame_moves_as_if_it_did_not_move_the_machine(tmp_path):
    """Against the machine with the frame as a link of it: the difference falls with its mass."""
    differences = []
    t = np.linspace(0.0, 0.2, 101)
    for mass in (50.0, 500.0, 5000.0):
        stiffness, damping = 1e4 * mass, 10.0 * mass
        mount = {'stiffness': [stiffness] * 2, 'damping': [damping] * 2}
        alone = tmp_path / f'alone_{mass:g}.yaml'
        alone.write_text(yaml.safe_dump(slider_crank(
            'ground',
            oscillators={'frame': {'mass': mass, 'mounts': {'all': mount}}},
        )), encoding='utf-8')  # fmt: skip
        machine = ms.load_scene(str(alone))
        moved = machine.oscillator('frame').take(ms.simulate(machine, duration=0.2).motion)
        x = moved(t).position[0]
        riding = slider_crank('frame')
        riding['links'] = {
            'ground': {'points': {'wall': [-1.0, 0.0]}},
            **riding['links'],
            'frame': {'mass': mass},
        }
        riding['joints'] = {
            'way': {'prismatic': ['ground', 'frame'], 'axis': 0.0, 'angle': 0.0},
            **riding['joints'],
        }
        riding['springs'] = {
            'mount': {
                'between': ['ground.wall', 'frame'],
                'stiffness': f'{stiffness} N/m',
                'damping': f'{damping} N s/m',
                'free_length': 1.0,
            }
        }
        riding['initial'] = {'position': {'frame': float(x[0])}}
        both = tmp_path / f'both_{mass:g}.yaml'
        both.write_text(yaml.safe_dump(riding), encoding='utf-8')
        solution = ms.simulate(ms.load_scene(str(both)), duration=0.2)
        coupled = solution.sample(t, 'position.frame')['position.frame']
        differences.append(np.abs(coupled - x).max() / np.abs(x).max())
    ratios = np.array(differences[:-1]) / differences[1:]
    assert differences[0] < 0.1
    assert ratios == pytest.approx(10.0, rel=0.1)


# --- scenes, instruments, nodes ---------------------------------------------------------------


@pytest.mark.parametrize(
    ('overrides', 'says'),
    [
        ({'mounts': {}}, 'mounts'),
        ({'mounts': {'a': FRAME['mounts']['left']}}, 'do not hold it in every direction'),
        ({'mass': -1.0}, 'mass'),
        ({'mass': 1e-14}, 'natural frequency'),
        ({'joints': ['rocker_grund']}, "did you mean 'rocker_ground'"),
        ({'joints': ['crank_coupler']}, 'not a joint of the ground'),
        ({'springs': {}}, "unknown key 'oscillators.frame.springs'"),
    ],
)
def test_wrong_frames_are_refused_with_a_sentence(overrides, says):
    with pytest.raises(InputError, match=says):
        on_frame('four_bar_nominal', **overrides)


@pytest.mark.parametrize(
    ('overrides', 'says'),
    [
        ({'oscillators': {'rocker': FRAME}}, 'has the name of a link'),
        ({'oscillators': {'my frame': FRAME}}, 'letters, digits and _'),
        ({'sensors.a': {'link': 'frme', 'at': 0.0}}, "did you mean 'frame'"),
        (
            {'links.rocker': {'length': 0.312}, 'links.coupler': {'length': 0.309},
             'links.crank': {'length': 0.064}},
            'masses of all links',
        ),
    ],
)  # fmt: skip
def test_wrong_scenes_with_frames_are_refused(overrides, says):
    with pytest.raises(InputError, match=says):
        on_frame('four_bar_nominal', overrides)


@pytest.mark.slow
def test_a_load_much_faster_than_the_machine_is_followed():
    """Pieces are as short as the load asks for: DOP853 under forces that are read densely."""
    load = {'at': 'rod.end', 'force': ['10*sin(40000*t)', 0.0]}
    machine = on_frame('slider_crank', {'loads.buzz': load})
    end = 0.004
    solution = ms.simulate(machine, duration=end)
    shaken = machine.oscillator('frame')
    frame, t = shaken.frame, np.linspace(0.0, end, 40)
    found = shaken.take(solution.motion)(t)
    dense = np.linspace(0.0, end, 8001)  # 300 in a period
    forces = shaking_of(machine).read(solution.motion, *solution.motion.curve.find(dense))
    push = CubicSpline(dense, forces, axis=1)

    def rates(time, state):
        force = push(time) - frame.C @ state[3:] - frame.K @ state[:3]
        return np.concatenate([state[3:], np.linalg.solve(frame.M, force)])

    start = np.concatenate([found.position[:, 0], np.zeros(3)])
    wanted = solve_ivp(
        rates, (0.0, end), start, 'DOP853', t_eval=t, rtol=1e-11, atol=1e-16, max_step=1e-5
    )
    for row, column in zip((*found.position, *found.velocity), wanted.y, strict=True):
        assert np.abs(row - column).max() < 1e-7 * np.abs(column).max()


@pytest.mark.network
def test_a_node_without_a_frame_says_so():
    done = run('node', 'oscillator', '--scene', 'pendulum', refused=True)
    assert done.returncode == 2
    assert "pendulum has nothing for the node 'oscillator'" in done.stderr


def test_an_unknown_frame_is_told():
    with pytest.raises(InputError, match="no oscillator 'frame'; oscillators: none"):
        ms.load_scene('four_bar_nominal').oscillator('frame')


def test_an_ideal_sensor_on_a_frame_reads_its_acceleration():
    at, gravity = [0.3, 0.1], {'gravity': [0.0, -9.81]}
    sensors = {
        'sensors.a': {'link': 'frame', 'at': at, 'axis': 'across', 'sample_rate': 1000.0},
        'sensors.b': {'link': 'frame', 'at': at, 'axis': 'along', 'sample_rate': 1000.0,
                      'gravity': True, 'transducer': {'transverse': 0.1}},
    }  # fmt: skip
    machine = on_frame('four_bar_clearance', {**sensors, **gravity})
    solution = ms.simulate(machine, duration=0.25)
    t = np.arange(250) / 1000.0
    moved = machine.oscillator('frame').take(solution.motion)(t)
    ax, ay = moved.acceleration[:2] + np.array([[-0.15], [0.15]]) * moved.acceleration[2]
    for name, wanted in (('a', ay), ('b', ax + 0.1 * (ay + 9.81))):
        channel = machine.channel(name)
        channel.take(solution.motion)
        samples = np.concatenate([block.samples for block in channel.blocks(final=True)])
        assert np.abs(samples[:250] - wanted).max() < 1e-9 * np.abs(wanted).max()


@pytest.mark.slow
def test_a_filter_behind_a_frame_hears_its_acceleration():
    """A filter in state space, driven by the frame's own acceleration."""
    sensor = {
        'link': 'frame', 'at': [0.15, -0.05], 'axis': 'across', 'sample_rate': 2000.0,
        'amplifier': {'low_pass': 60.0, 'low_pass_order': 2},
    }  # fmt: skip
    machine = on_frame('four_bar_nominal', {'sensors.a': sensor})
    solution = ms.simulate(machine, duration=0.05)
    moved, w = machine.oscillator('frame').take(solution.motion), 2.0 * np.pi * 60.0

    def rates(time, y):
        a = moved(time).acceleration[1, 0]
        return [y[1], w**2 * (a - y[0]) - np.sqrt(2.0) * w * y[1]]

    t = np.arange(100) / 2000.0
    wanted = solve_ivp(rates, (0.0, t[-1]), [0.0, 0.0], 'DOP853', t_eval=t, rtol=1e-9, atol=1e-12)
    channel = machine.channel('a')
    channel.take(solution.motion)
    samples = np.concatenate([block.samples for block in channel.blocks(final=True)])
    assert np.abs(samples[:100] - wanted.y[0]).max() < 1e-7 * np.abs(wanted.y[0]).max()


@pytest.mark.slow
@pytest.mark.network
def test_as_a_node_the_frame_moves_as_in_the_library(tmp_path):
    bag = tmp_path / 'run.mcap'
    run_json('run', 'gear_housing', '--duration', '0.05', '--record', str(bag))
    found = analyze(bag)
    assert found.digest == digest_of('gear_housing', (), 0.05)
    assert 'oscillator' in found.ledger.finished
    assert not found.ledger.lost
    states = messages_of(bag, '/oscillator_state')
    machine = ms.load_scene('gear_housing')
    solution = ms.simulate(machine, duration=0.05)
    t = np.array([m.time for m in states])
    assert len(t) == 250
    moved = machine.oscillator('housing').take(solution.motion)(t)
    for i, message in enumerate(states):
        assert message.oscillator == 'housing'
        for name, value in fields(moved, i).items():
            assert getattr(message, name) == pytest.approx(value, rel=1e-12, abs=1e-15)
    (part,) = found.parts['oscillator_state']
    assert part.joint == 'housing'
    assert 'oscillators, in SI units: ranges of 250 published instants' in render(found)
    assert {s.sensor for s in found.vibration} == {'bearing'}
