"""Nodes of parts: what they read, when they integrate and when they follow, and their bags."""

from __future__ import annotations

import subprocess
from importlib import import_module
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from running import command, environment, run, run_json

import mechanism_sim as ms
from mechanism_sim import cli
from mechanism_sim.analysis import analyze, render
from mechanism_sim.errors import InputError
from mechanism_sim.messages import float64_array
from mechanism_sim.messages.definitions import field_descriptions
from mechanism_sim.messages.segments import motion_of, pack
from mechanism_sim.nodes.parts import KINDS, integrator_of, kinds_of
from mechanism_sim.nodes.run import NODES, Plan
from mechanism_sim.recording import read_bag
from mechanism_sim.sensing.joint_view import JointView

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


@pytest.fixture(scope='module')
def mixed(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp('scenes') / 'mixed.yaml'
    path.write_text(MIXED, encoding='utf-8')
    return path


def states_of(bag, topic):
    """The states in a bag by a reader of other authors."""
    with Path(bag).open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [m for *_, m in reader.iter_decoded_messages(topics=[topic])]


def fields_of(message, kind):
    """The fields of a decoded state, as a reading has them."""
    names = [name for name, _ in field_descriptions(kind.message.__msgtype__)]
    return {name: getattr(message, name) for name in names if name not in ('header',)}


@pytest.mark.parametrize(
    ('scene', 'nodes'),
    [
        ('geneva', ['geneva']),
        ('linear_intermittent', ['geneva']),
        ('film_advance', ['linkage']),
        ('quick_return', ['linkage']),  # a pin in a slot is no part
        ('pendulum', ['linkage']),
        ('four_bar_clearance', ['linkage', 'accelerometer']),
        ('mixed', ['linkage', 'geneva']),
    ],
)
def test_the_scene_decides_who_integrates(mixed, scene, nodes):
    machine = ms.load_scene(str(mixed) if scene == 'mixed' else scene)
    plan = Plan(machine, scene, (), 1.0)
    assert plan.nodes == ['crank_drive', *nodes]
    assert integrator_of(machine) == nodes[0]


def test_names_of_nodes_agree_everywhere():
    assert list(NODES) == list(cli.NODE_NAMES)
    setup = (Path(__file__).parents[1] / 'setup.py').read_text(encoding='utf-8')
    assert str(cli.NODE_NAMES) in setup
    assert set(KINDS) < set(NODES)
    for name, node in NODES.items():
        module = import_module(f'mechanism_sim.nodes.{name}')
        assert node.__module__ == module.__name__
        assert callable(module.main)


@pytest.mark.parametrize('name', KINDS)
def test_every_reading_has_the_fields_of_its_message(name):
    kind = KINDS[name]
    wanted = [field for field, _ in field_descriptions(kind.message.__msgtype__)]
    for reader in kind.readers.values():
        assert ['header', 'time', 'joint', *get_type_hints(reader)['return']._fields] == wanted


def test_a_node_without_its_part_says_what_the_scene_needs():
    done = run('node', 'geneva', '--scene', 'film_advance')
    assert done.returncode == 2
    assert "film_advance has nothing for the node 'geneva'; it needs 'linkage'" in done.stderr


def reading(scene, overrides=(), count=499):
    machine = ms.load_scene(scene, overrides=overrides)
    solution = ms.simulate(machine)
    t = np.arange(count) / count * solution.duration
    (kind,) = kinds_of(machine).values()
    (joint,) = kind.joints(machine)
    k, dt = solution.motion.curve.find(t)
    o = machine.physics.observe(solution.motion, k, dt)
    view = JointView(machine.mechanism, joint, machine.physics, o, solution.motion.modes[k].T)
    return machine, view, kind.readers[type(joint)](joint, view)


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


def test_without_masses_forces_are_unknown():
    *_, r = reading('geneva', {'outputs.forces': False})
    assert np.isnan([r.force_x, r.force_y, r.driven_effort, r.driver_torque]).all()
    assert np.isfinite(r.driven_velocity).all()


def test_a_motion_message_carries_all_that_forces_need(mixed):
    machine = ms.load_scene(str(mixed))
    motion = ms.simulate(machine, duration=0.02).motion
    names = machine.physics.coordinates, machine.physics.clearances
    message = pack(motion, *names)
    again = motion_of(message)
    for name in ('modes', 'approach', 'torques'):
        assert np.array_equal(getattr(again, name), getattr(motion, name))
        assert getattr(motion, name).size
    message.torque_laws = float64_array([1.0])
    with pytest.raises(InputError, match='contradicts its own counts'):
        motion_of(message)


def test_a_geneva_node_integrates_in_a_process_of_its_own(tmp_path):
    """Its motion is that of `solve` bit by bit, and what it reads is what the engine says."""
    bag = tmp_path / 'run.mcap'
    outcome = run_json('run', 'geneva', '--processes', '--record', str(bag))
    assert outcome['sent']['/geneva_state'] == 50
    found = analyze(bag)
    assert found.digest == run_json('solve', 'geneva')['digest']
    assert found.ledger.finished == ('crank_drive', 'geneva')
    assert_states_follow_from_motion(bag, 'geneva', 'geneva')
    text = render(found)
    assert 'Geneva drives: among 50 instants' in text
    (part,) = found.parts['geneva_state']
    assert part.joint == 'crank_wheel'
    assert part.share['engaged'] == pytest.approx(0.26)
    speeds = [m.driven_velocity for m in states_of(bag, '/geneva_state')]
    (speed,) = (r for r in part.ranges if r.quantity == 'driven_velocity')
    assert (speed.lowest, speed.highest) == (min(speeds), max(speeds))


def assert_states_follow_from_motion(bag, scene, name):
    """States in a bag are those of its Motion messages, to the last bit."""
    machine, kind = ms.load_scene(scene), KINDS[name]
    rate = machine.scene.outputs.part_states
    expected, sampled = [], 0
    for _, message, _ in read_bag(bag).messages('/motion'):
        motion = motion_of(message)
        t = np.arange(sampled, int(motion.curve.end * rate) + 2) / rate
        t = t[t < motion.curve.end]
        sampled += len(t)
        expected += kind.states(machine, motion, t) if t.size else []
    got = [fields_of(m, kind) for m in states_of(bag, f'/{kind.topic}')]
    assert got == [{'time': t, 'joint': joint, **fields} for t, joint, fields in expected]
    assert len(got) == int(np.ceil(rate * motion.curve.end)) * len(kind.joints(machine))


def test_beside_a_linkage_the_node_follows(tmp_path, mixed):
    bag = tmp_path / 'run.mcap'
    outcome = run_json('run', str(mixed), '--processes', '--record', str(bag))
    assert outcome['code'] == 0
    found = analyze(bag)
    assert found.digest == run_json('solve', str(mixed))['digest']
    assert found.ledger.finished == ('crank_drive', 'geneva', 'linkage')
    assert not found.ledger.lost
    assert_states_follow_from_motion(bag, str(mixed), 'geneva')
    solution = ms.simulate(ms.load_scene(str(mixed)))
    states = states_of(bag, '/geneva_state')
    columns = solution.sample(np.array([m.time for m in states]))
    for field, column in (
        ('driven_velocity', 'velocity.wheel'),
        ('force_x', 'reaction.crank_wheel.x'),
    ):
        published = np.array([getattr(m, field) for m in states])
        assert np.abs(published - columns[column]).max() <= 1e-9 * np.abs(published).max()


def test_integrating_and_following_say_the_same(tmp_path):
    """The user starts a linkage beside the node of a scene that needs none."""
    alone, beside = tmp_path / 'alone.mcap', tmp_path / 'beside.mcap'
    run_json('run', 'geneva', '--record', str(alone))
    env, partners = environment(), 'crank_drive,linkage,geneva,recorder'
    nodes = [
        subprocess.Popen(
            command('node', name, '--scene', 'geneva', '--partners', partners, *options),
            env=env, stderr=subprocess.PIPE, text=True,
        )
        for name, *options in (
            ('linkage',), ('geneva',), ('recorder', '--file', str(beside)), ('crank_drive',)
        )
    ]  # fmt: skip
    for node in nodes:
        _, stderr = node.communicate(timeout=60)
        assert node.returncode == 0, stderr
    kind = KINDS['geneva']
    one, other = (
        [fields_of(m, kind) for m in states_of(bag, '/geneva_state')] for bag in (alone, beside)
    )
    assert one
    assert one == other


def test_states_come_at_their_rate(tmp_path):
    bag = tmp_path / 'run.mcap'
    run_json(
        'run', 'linear_intermittent', '--set', 'outputs.part_states=37 Hz', '--record', str(bag)
    )
    times = [m.time for m in states_of(bag, '/geneva_state')]
    assert times == [k / 37.0 for k in range(37)]
