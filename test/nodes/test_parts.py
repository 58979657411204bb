"""Nodes of parts: what they read, when they integrate and when they follow, and their bags."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from bags import assert_states_follow_from_motion, fields_of, messages_of
from builders import digest_of, without_work
from running import ROOT, TIMEOUT, environment, run, run_json, start

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.reading import CamMode
from mechanism_sim.joints.mesh.reading import MeshMode
from mechanism_sim.messages import float64_array
from mechanism_sim.messages.part_states import KINDS, integrator_of, kinds_of
from mechanism_sim.messages.segments import motion_of, pack
from mechanism_sim.nodes.classes import NODE_CLASSES, NODE_NAMES, node_class
from mechanism_sim.nodes.run import NodePlan
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.report.bag import render
from mechanism_sim.sensing.joint_view import JointView
from ros_interfaces.definitions import field_descriptions

MIXED = """
title: A motor that turns a Geneva wheel and a loose four-bar by one crank
mechanism: linkage
links:
  ground: {points: {wheel: [70.710678118654752 mm, 0 mm], rocker: [-100 mm, 0 mm]}}
  crank: {length: 50 mm, points: {coupler: [20 mm, 0 mm]}, mass: 0.6 kg, inertia: 600 kg mm^2}
  wheel: {length: 50 mm, mass: 0.9 kg, inertia: 900 kg mm^2}
  coupler: {length: 120 mm, mass: 0.3 kg, inertia: 360 kg mm^2, cog: 60 mm}
  rocker: {length: 70 mm, mass: 0.2 kg, inertia: 120 kg mm^2, cog: 35 mm}
joints:
  ground_crank: {revolute: [ground, crank]}
  ground_wheel: {revolute: [ground.wheel, wheel]}
  crank_wheel: {geneva: [crank.end, wheel], slots: 4}
  crank_coupler: {revolute: [crank.coupler, coupler]}
  coupler_rocker:
    revolute: [coupler.end, rocker.end]
    clearance: {radial: 0.1 mm, restitution: 0.5, contact: {law: flores, stiffness: 1.0e+8}}
  rocker_ground: {revolute: [rocker, ground.rocker]}
drive:
  speed: 120 rpm
  start_angle: 180 deg
  motor: {stall_torque: 8 N m, no_load_speed: 150 rpm}
guess: {wheel: 135 deg, rocker: 100 deg}
duration: 0.3
"""

SWING = """
title: A roller on a swinging arm in a groove, with play
mechanism: linkage
links:
  ground: {points: {pivot: [60 mm, 0 mm]}}
  camshaft: {mass: 0.5 kg, inertia: 60 kg mm^2}
  arm: {length: 50 mm, mass: 0.15 kg, inertia: 40 kg mm^2, cog: 25 mm}
joints:
  bearing: {revolute: [ground, camshaft]}
  pivot: {revolute: [ground.pivot, arm]}
  contact:
    cam: [camshaft, arm.end]
    follower: roller
    side: left
    roller: 6 mm
    base_radius: 22 mm
    law:
      segments:
        - {from: 0 deg, to: 120 deg, rise: 15 deg, curve: cycloidal}
        - {from: 120 deg, to: 240 deg, rise: -15 deg, curve: cycloidal}
    groove: {clearance: 0.1 mm, restitution: 0.3}
gravity: [0, -9.81 m/s^2]
drive: {coordinate: camshaft, speed: 600 rpm, start_angle: 10 deg}
guess: {arm: 150 deg}
"""


def written(folder, name, text) -> Path:
    path = folder / f'{name}.yaml'
    path.write_text(text, encoding='utf-8')
    return path


@pytest.fixture(scope='module')
def mixed(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp('scenes'), 'mixed', MIXED)


@pytest.mark.parametrize(
    ('scene', 'nodes'),
    [
        ('geneva', ['geneva']),
        ('linear_intermittent', ['geneva']),
        ('film_advance', ['linkage']),
        ('quick_return', ['linkage']),  # a pin in a slot is no part
        ('pendulum', ['linkage']),
        ('four_bar_clearance', ['linkage', 'sensors']),
        ('valve_train', ['cam']),
        ('gear_pair', ['gear_train']),
        ('gear_four_bar', ['linkage', 'gear_train']),
        ('whole_machine', ['linkage', 'cam', 'gear_train', 'sensors']),
        ('mixed', ['linkage', 'geneva']),
    ],
)
def test_the_scene_decides_who_integrates(mixed, scene, nodes):
    machine = ms.load_scene(str(mixed) if scene == 'mixed' else scene)
    plan = NodePlan(machine, scene, (), 1.0)
    assert plan.nodes == ['crank_drive', *nodes]
    assert integrator_of(machine) == nodes[0]


def test_names_of_nodes_agree_everywhere():
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    listed = setup.partition('NODES = ')[2].partition(')')[0] + ')'
    assert ast.literal_eval(listed) == NODE_NAMES
    assert set(KINDS) < set(NODE_NAMES)
    for name in NODE_CLASSES:
        assert node_class(name).__init__.__defaults__[0] == ()  # parameters, and none are needed


def pairs_of(base):
    """All kinds of higher pairs."""
    return [x for pair in base.__subclasses__() for x in (pair, *pairs_of(pair))]


@pytest.mark.parametrize('name', KINDS)
def test_every_reading_has_the_fields_of_its_message(name):
    kind = KINDS[name]
    wanted = [field for field, _ in field_descriptions(kind.message.__msgtype__)]
    found = [pair for pair in pairs_of(HigherPair) if pair.node == name]
    assert found
    for pair in found:
        fields = get_type_hints(pair.reading)['return']._fields
        assert ['header', 'time', 'joint', *fields] == wanted


@pytest.mark.network
def test_a_node_without_its_part_says_what_the_scene_needs():
    done = run('node', 'geneva', '--scene', 'film_advance', refused=True)
    assert done.returncode == 2
    assert "film_advance has nothing for the node 'geneva'; it needs 'linkage'" in done.stderr


def readings(scene, overrides=(), duration=None, count=499):
    """Views of the joints of the one kind that a scene has, and what is read there."""
    machine = ms.load_scene(scene, overrides=overrides)
    solution = ms.simulate(machine, duration=duration)
    t = np.arange(count) / count * solution.duration
    (kind,) = kinds_of(machine).values()
    k, dt = solution.motion.curve.find(t)
    o = machine.physics.observe(solution.motion, k, dt)
    for joint in kind.joints(machine):
        view = JointView(machine.mechanism, joint, machine.physics, o, solution.motion.modes[k].T)
        yield machine, view, joint.reading(view)


def reading(*args, **options):
    """Reading of the one joint."""
    (found,) = readings(*args, **options)
    return found


LOOSE = {'radial': '0.1 mm', 'restitution': 0.3}


@pytest.mark.parametrize(
    ('scene', 'share', 'overrides'),
    [  # share of a turn: 1/2 - 1/slots, and half
        ('geneva', 0.25, {}),
        ('linear_intermittent', 0.5, {}),
        ('geneva', 0.25, {'joints.crank_wheel.clearance': LOOSE}),
        ('linear_intermittent', 0.5, {'joints.crank_rack.clearance': LOOSE}),
    ],
)
def test_forces_of_intermittent_drives_balance(scene, share, overrides):
    machine, view, r = reading(scene, overrides)
    assert r.engaged.mean() == pytest.approx(share, abs=0.003)
    if not overrides:
        assert np.abs(r.driven_velocity[~r.engaged]).max() < 1e-12
    # pin and slot neither take nor give power between impacts
    given, taken = r.driver_torque * r.driver_speed, r.driven_effort * r.driven_velocity
    assert np.abs(given).max() > 0.1
    assert np.abs(given + taken).max() < 1e-13 * np.abs(given).max()
    # Euler's law of the crank about its centre, which is at the origin
    crank, o = machine.mechanism.body('crank'), view.observed
    (x, y), (gx, gy) = view.place('crank', crank.cog), machine.mechanism.gravity
    inertia = crank.inertia + crank.mass * (x**2 + y**2)
    weight = crank.mass * (x * gy - y * gx)
    needed = inertia * r.driver_acceleration - weight - r.driver_torque
    assert np.abs(o.drive_torque[0] - needed).max() < 1e-13 * np.abs(needed).max()


@pytest.mark.parametrize('speed', ['3600 rpm', '-1000 rpm'])
def test_forces_of_a_cam_balance(speed):
    """A flat follower that flies at the higher speed and is always held at the lower one."""
    _, view, r = reading('valve_train', {'drive.speed': speed})
    assert_a_cam_is_read_rightly(view, r)
    assert set(r.mode) == ({CamMode.CONTACT, CamMode.LIFTED} if speed[0] == '3' else {1})
    (fx, fy), (vx, vy) = view.force, view.path('valve', view.joint.on_second)[1]
    taken = fx * vx + fy * vy
    assert np.abs(r.cam_torque * r.cam_speed + taken).max() < 1e-12 * np.abs(taken).max()


@pytest.mark.parametrize(
    ('clearance', 'sense', 'modes'),
    [
        ('0.1 mm', 'clockwise', {CamMode.CONTACT, CamMode.LIFTED, CamMode.OUTER}),
        ('0 mm', 'counterclockwise', {CamMode.GUIDED}),
    ],
)
def test_forces_of_a_groove_balance(tmp_path, clearance, sense, modes):
    """A roller that rattles, and without play pushes and pulls: by its arm's torque."""
    joint = {'groove.clearance': clearance, 'sense': sense}
    overrides = {f'joints.contact.{key}': value for key, value in joint.items()}
    _, view, r = reading(str(written(tmp_path, 'swing', SWING)), overrides)
    assert_a_cam_is_read_rightly(view, r, 0.0 if CamMode.GUIDED in modes else 0.05e-3)
    assert set(r.mode) == modes
    arm = view.path('arm', view.joint.on_second)[0] - view.path('arm', (0.0, 0.0))[0]
    taken = (arm[0] * view.force[1] - arm[1] * view.force[0]) * view.turning('arm').velocity
    assert np.abs(r.cam_torque * r.cam_speed + taken).max() < 1e-12 * np.abs(taken).max()


def assert_a_cam_is_read_rightly(view, r, play=0.0):
    """Lift and force say the same as the modes of contact; rates are those of positions."""
    assert (r.contact_force[r.mode == CamMode.CONTACT] >= 0.0).all()
    assert (r.contact_force[r.mode == CamMode.LIFTED] == 0.0).all()
    assert (r.contact_force[r.mode == CamMode.OUTER] <= 0.0).all()
    touching = r.mode != CamMode.LIFTED
    assert np.abs(r.gap[touching]).max() < 1e-14
    assert (r.gap[~touching] > 0.0).all()
    off = (r.follower_position - r.lift)[touching]
    if play:
        # along the normal the roller is half the play off
        across = np.cos(r.pressure_angle[touching]) * 0.05 * off  # by the arm
        assert np.abs(np.abs(across) - play).max() < 1e-3 * play
        assert (np.sign(off) == np.where(r.mode == CamMode.OUTER, 1.0, -1.0)[touching]).all()
    else:
        assert np.abs(off).max() < 1e-14
    # the velocity is the rate of what the law is compared with
    moving = touching & (np.abs(r.follower_velocity) > 0.0)
    rate = view.joint.cam.law(r.cam_angle, 1) * r.cam_speed
    if not play:
        scale = np.abs(rate).max()
        assert np.abs(r.follower_velocity - rate)[moving].max() < 1e-12 * scale


RATTLING = {'joints.mesh.backlash': {'width': '0.1 mm', 'restitution': 0.4}}
HELICAL = {
    'gears.pinion.helix_angle': '20 deg',
    'gears.wheel.helix_angle': '-20 deg',
    'links.ground.points.wheel': ['63.9 mm', '0 mm'],
    'joints.mesh.backlash': {'restitution': 0.3},
}


@pytest.mark.parametrize(
    ('scene', 'overrides'),
    [
        ('gear_pair', {}),
        ('gear_pair', RATTLING),
        ('gear_pair', HELICAL),
        ('gear_rattle', {}),
        ('rack_and_pinion', {}),
        ('planetary', {}),
    ],
)
def test_forces_of_gears_balance(scene, overrides):
    """By their power against the carrier, by levers, and by the sides of the play they are on."""
    for machine, view, r in readings(scene, overrides, duration=0.1):
        joint = view.joint
        carrier = view.turning(joint.carrier).velocity
        on_carrier = -(r.first_torque + (0.0 if joint.guide else r.second_torque))
        given = r.first_torque * r.first_velocity
        power = given + r.second_torque * r.second_velocity + on_carrier * carrier
        assert np.abs(given).max() > 0.0
        assert np.abs(power).max() < 1e-12 * np.abs(given).max()
        lever = abs(joint.reach)
        by_lever = np.abs(r.tangential_force) * lever
        assert np.abs(np.abs(r.first_torque) - by_lever).max() < 1e-12 * by_lever.max()
        assert (r.radial_force >= 0.0).all()
        total = np.linalg.norm([r.tangential_force, r.radial_force, r.axial_force], axis=0)
        assert np.array_equal(total, r.tooth_force)
        tan = 0.0
        if overrides is HELICAL:  # the lead is one: the helix is steeper on larger circles
            tan = np.tan(np.radians(20.0)) * lever / joint.wheels[0].gear.pitch_radius
        assert np.allclose(r.axial_force, tan * np.abs(r.tangential_force), rtol=1e-14, atol=0.0)
        wheel = r.first_velocity - carrier
        assert np.allclose(r.mesh_frequency, np.abs(joint.waves[0] * wheel) / (2.0 * np.pi))
        loose = bool(view.physics.clearances)
        assert (MeshMode.MESHED in r.mode) != loose
        play = machine.plan.clearances[joint.name].radial if loose else 0.0
        side = {MeshMode.LEFT: play, MeshMode.RIGHT: -play}
        for mode, error in zip(r.mode.tolist(), r.transmission_error, strict=True):
            if mode == MeshMode.FREE:
                assert abs(error) < play
            else:
                assert error == pytest.approx(side.get(mode, 0.0), abs=1e-14)
        assert (r.tooth_force[r.mode == MeshMode.FREE] == 0.0).all()


def test_elastic_teeth_say_which_flank_they_press():
    _, view, r = reading('mesh_stiffness', duration=0.02)
    play, error = view.joint.play, sum(e.amplitude for e in view.joint.errors)
    assert set(r.mode) >= {MeshMode.LEFT, MeshMode.FREE}
    ahead = r.transmission_error
    assert (r.mode[ahead > play + error] == MeshMode.LEFT).all()
    assert (r.mode[np.abs(ahead) < play - error] == MeshMode.FREE).all()
    assert np.array_equal(r.tooth_force == 0.0, r.mode == MeshMode.FREE)


def test_a_transmission_passes_on_torque_only(tmp_path):
    text = """
title: A belt that turns the other way round
mechanism: linkage
links:
  ground: {points: {second: [100 mm, 0 mm]}}
  first: {mass: 0.5 kg, inertia: 100 kg mm^2}
  second: {mass: 1 kg, inertia: 1000 kg mm^2}
joints:
  one: {revolute: [ground, first]}
  two: {revolute: [ground.second, second]}
  belt: {transmission: [first, second], ratio: -2/3}
drive: {coordinate: first, speed: 60 rpm}
loads:
  brake: {at: second, torque: "-0.1*second_rate"}
"""
    *_, r = reading(str(written(tmp_path, 'belt', text)))
    speed = 2.0 * np.pi
    assert np.allclose(r.second_velocity, -2.0 / 3.0 * speed, rtol=1e-14)
    assert np.allclose(r.second_torque, -0.1 * 2.0 / 3.0 * speed, rtol=1e-12)
    assert np.allclose(r.first_torque, -0.1 * (2.0 / 3.0) ** 2 * speed, rtol=1e-12)
    assert np.isnan([r.tooth_force, r.transmission_error, r.mesh_frequency]).all()


def test_without_masses_forces_are_unknown():
    *_, r = reading('geneva', {'outputs.forces': False})
    assert np.isnan([r.force_x, r.force_y, r.driven_effort, r.driver_torque]).all()
    assert np.isfinite(r.driven_velocity).all()


SOFT = {
    'drive': {'speed': '350 rpm', 'torque': {'constant': '0.1 N m'}},
    'joints.coupler_rocker.clearance.contact': {'law': 'flores', 'stiffness': 1.0e8},
}


@pytest.mark.parametrize(
    'scene', ['four_bar_clearance', pytest.param('mixed', marks=pytest.mark.slow)]
)
def test_a_motion_message_carries_all_that_forces_need(mixed, scene):
    machine = ms.load_scene(str(mixed)) if scene == 'mixed' else ms.load_scene(scene, SOFT)
    motion = ms.simulate(machine, duration=0.02).motion
    names = machine.physics.coordinates, machine.physics.clearances
    message = pack(motion, *names, motion.curve.end)
    again = motion_of(message)
    for name in ('modes', 'approach', 'torques'):
        assert np.array_equal(getattr(again, name), getattr(motion, name))
        assert getattr(motion, name).size
    message.torque_laws = float64_array([1.0])
    with pytest.raises(InputError, match='contradicts its own counts'):
        motion_of(message)


@pytest.fixture(scope='module')
def alone(tmp_path_factory) -> Path:
    """A Geneva wheel, integrated by its own node in a process of its own."""
    bag = tmp_path_factory.mktemp('bags') / 'alone.mcap'
    outcome = run_json('run', 'geneva', '--processes', '--record', str(bag))
    assert outcome['sent']['/geneva_state'] == 50
    return bag


@pytest.mark.network
@pytest.mark.slow
def test_a_geneva_node_integrates_in_a_process_of_its_own(alone):
    """Its motion is that of `solve` bit by bit, and what it reads is what the engine says."""
    bag = alone
    found = analyze(bag)
    assert found.digest == digest_of('geneva')
    assert found.ledger.finished == ('crank_drive', 'geneva')
    assert_states_follow_from_motion(bag, 'geneva', 'geneva')
    text = render(found)
    assert 'Geneva drives, in SI units' in text
    (part,) = found.parts['geneva_state']
    assert part.joint == 'crank_wheel'
    assert part.share['engaged'] == pytest.approx(0.26)
    speeds = [m.driven_velocity for m in messages_of(bag, '/geneva_state')]
    (speed,) = (r for r in part.ranges if r.quantity == 'driven_velocity')
    assert speed.lowest <= min(speeds)
    assert max(speeds) == 0.0
    assert speed.highest == pytest.approx(0.0, abs=1e-12)  # the motion's own, up to rounding


@pytest.mark.network
@pytest.mark.slow
def test_beside_a_linkage_the_node_follows(tmp_path, mixed):
    bag = tmp_path / 'run.mcap'
    outcome = run_json('run', str(mixed), '--record', str(bag))
    assert outcome['code'] == 0
    found = analyze(bag)
    assert found.digest == digest_of(str(mixed))
    assert found.ledger.finished == ('crank_drive', 'geneva', 'linkage')
    assert not found.ledger.lost
    assert_states_follow_from_motion(bag, str(mixed), 'geneva')
    solution = ms.simulate(ms.load_scene(str(mixed)))
    states = messages_of(bag, '/geneva_state')
    columns = without_work(solution, np.array([m.time for m in states]))
    for field, column in (
        ('driven_velocity', 'velocity.wheel'),
        ('force_x', 'reaction.crank_wheel.x'),
    ):
        published = np.array([getattr(m, field) for m in states])
        assert np.abs(published - columns[column]).max() <= 1e-9 * np.abs(published).max()


@pytest.mark.network
@pytest.mark.slow
def test_integrating_and_following_say_the_same(tmp_path, alone):
    """The user starts a linkage beside the node of a scene that needs none."""
    beside = tmp_path / 'beside.mcap'
    env, partners = environment(), 'crank_drive,linkage,geneva,recorder'
    nodes = [
        start('node', name, '--scene', 'geneva', '--partners', partners, *options, env=env)
        for name, *options in (
            ('linkage',), ('geneva',), ('recorder', '--file', str(beside)), ('crank_drive',)
        )
    ]  # fmt: skip
    for node in nodes:
        _, stderr = node.communicate(timeout=TIMEOUT)
        assert node.returncode == 0, stderr
    kind = KINDS['geneva']
    one, other = (
        [fields_of(m, kind) for m in messages_of(bag, '/geneva_state')] for bag in (alone, beside)
    )
    assert one
    assert one == other


@pytest.mark.slow
@pytest.mark.network
@pytest.mark.parametrize(
    ('scene', 'name', 'duration'),
    [
        pytest.param('valve_train', 'cam', 0.03, marks=pytest.mark.slow),
        ('gear_rattle', 'gear_train', 0.1),
    ],
)
def test_a_node_of_parts_integrates(tmp_path, scene, name, duration):
    """At a rate of its own, and with the motion of `solve`."""
    bag = tmp_path / 'run.mcap'
    args = [scene, '--set', 'outputs.part_states=370 Hz', '--duration', str(duration)]
    run_json('run', *args, '--record', str(bag))
    found = analyze(bag)
    assert found.digest == digest_of(scene, duration=duration)
    assert set(found.ledger.finished) == {'crank_drive', name}
    assert_states_follow_from_motion(bag, scene, name, 370.0)
    assert found.parts.keys() == {KINDS[name].topic}


@pytest.mark.network
@pytest.mark.slow
def test_bearings_of_shafts_have_a_topic(tmp_path):
    """Both bearings together carry the reaction of the plane, and one of them the axial force."""
    bag = tmp_path / 'run.mcap'
    run_json('run', 'helical_shafts', '--duration', '0.05', '--record', str(bag))
    loads = messages_of(bag, '/bearing_loads')
    reactions = {round(m.time, 9): m for m in messages_of(bag, '/joint_reactions')}
    gears = {round(m.time, 9): m for m in messages_of(bag, '/gear_state')}
    assert len(loads) == 2 * len(reactions) > 0
    for m in loads:
        k = reactions[round(m.time, 9)].joints.index(m.joint)
        for axis in 'xy':
            (expected,) = getattr(reactions[round(m.time, 9)], f'force_{axis}')[k : k + 1]
            assert sum(getattr(m, f'force_{axis}')) == pytest.approx(expected, abs=1e-9)
        locating = 'left' if m.joint == 'pinion_shaft' else 'right'
        along = dict(zip(m.bearings, m.axial_force, strict=True))
        assert abs(along.pop(locating)) == pytest.approx(
            abs(gears[round(m.time, 9)].axial_force), rel=1e-12
        )
        assert [*along.values()] == [0.0]


def test_a_cam_state_says_where_the_follower_touches():
    """A flat face touches at its own height, beside the axis by its geometry: the slope ds/da."""
    machine = ms.load_scene('valve_train', {'drive.speed': '600 rpm'})
    solution = ms.simulate(machine, duration=0.1)
    samples = solution.view(np.linspace(0.0, 0.099, 60))
    joint = machine.mechanism.joint('contact')
    view = JointView(machine.mechanism, joint, machine.physics, samples.observed, samples.modes)
    seen = joint.reading(view)
    assert seen.contact_y == pytest.approx(18e-3 + seen.lift, abs=1e-12)
    # the point under the face has the face's velocity across it: w x = s', so x = s'/w
    slope = machine.mechanism.joint('contact').cam.law(seen.cam_angle, 1)
    assert np.abs(seen.contact_x) == pytest.approx(np.abs(slope), abs=1e-12)
    # the face slides over the cam as fast as the cam's point moves along it
    height = 18e-3 + seen.lift
    assert np.abs(seen.sliding_speed) == pytest.approx(height * seen.cam_speed, rel=1e-12)


@pytest.mark.network
@pytest.mark.slow
def test_a_whole_machine_runs_as_six_nodes(tmp_path):
    """Motor, gears, cam and loose four-bar: everyone's forces are in one bag."""
    bag = tmp_path / 'run.mcap'
    run_json('run', 'whole_machine', '--duration', '0.1', '--processes', '--record', str(bag))
    found = analyze(bag)
    assert found.digest == digest_of('whole_machine', (), 0.1)
    nodes = ('cam', 'crank_drive', 'gear_train', 'linkage', 'sensors')
    assert found.ledger.finished == nodes
    assert not found.ledger.lost
    for name in ('cam', 'gear_train'):
        assert_states_follow_from_motion(bag, 'whole_machine', name)
    assert {s.sensor for s in found.vibration} == {'rocker', 'slide'}
    assert {p.name for p in found.loads.joints} >= {'mesh', 'cam', 'coupler_rocker', 'guide'}
    gears, cams = (messages_of(bag, f'/{KINDS[n].topic}') for n in ('gear_train', 'cam'))
    assert max(m.tooth_force for m in gears) > 1.0
    assert max(m.contact_force for m in cams) > 1.0
