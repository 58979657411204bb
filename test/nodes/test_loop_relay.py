"""The relay that closes loops: states of all joints of a machine from those that drive it."""

from __future__ import annotations

import json
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from builders import made
from middleware_network import eventually
from running import TIMEOUT, environment, script, start

import mechanism_sim as ms
from mechanism_sim.errors import RunError
from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.tracking import Tracker
from mechanism_sim.messages import JointState
from mechanism_sim.nodes.loop_relay import LoopRelay
from mechanism_sim.nodes.middleware import Node, SingleThreadedExecutor
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.scene.load import without_clearance

ROCKER = """
title: A double rocker
mechanism: four_bar
links:
  ground: {length: 90 mm}
  crank: {length: 60 mm}
  coupler: {length: 40 mm}
  rocker: {length: 70 mm}
drive: {speed: 0 rpm, start_angle: 40 deg}
duration: 1 s
"""

PANEL = """
import json, sys
from mechanism_sim.messages import message_class
from mechanism_sim.nodes.middleware import Node, init, shutdown, spin_once
from mechanism_sim.nodes.qos import LATCHED, RESULTS

init()
node = Node('panel')
JointState, String, TF = (message_class(x) for x in (
    'sensor_msgs/msg/JointState', 'std_msgs/msg/String', 'tf2_msgs/msg/TFMessage'))
drivers, places = sys.argv[1], json.loads(sys.argv[2])
answers, frames, texts = [], [], {}
node.create_subscription(JointState, 'joint_states', lambda m: answers.append(
    [m.header.stamp.sec, m.header.stamp.nanosec, dict(zip(m.name, m.position)),
     dict(zip(m.name, m.velocity))]), RESULTS)
node.create_subscription(TF, '/tf', lambda m: frames.append(
    [m.transforms[0].header.stamp.nanosec, [t.child_frame_id for t in m.transforms]]), RESULTS)
for topic in ('robot_description', 'driver_description'):
    node.create_subscription(String, topic, lambda m, t=topic: texts.update({t: m.data}), LATCHED)
told = node.create_publisher(JointState, 'driver_states', RESULTS)
while not told.get_subscription_count() or len(texts) < 2:
    spin_once(node, timeout_sec=0.05)
for k, place in enumerate(places):
    message = JointState(name=['panel', drivers], position=[0.0, place], velocity=[0.0, 2.0])
    message.header.stamp.sec, message.header.stamp.nanosec = 1_700_000_000, 1 + k
    told.publish(message)
while len(answers) < len(places) or len(frames) < len(places):
    spin_once(node, timeout_sec=0.05)
print(json.dumps({'answers': answers, 'frames': frames, 'texts': texts}))
shutdown()
"""


@pytest.mark.slow
@pytest.mark.network
@pytest.mark.usefixtures('backend')
def test_every_state_of_the_driver_is_answered_by_all_joints(tmp_path):
    env, places = environment(), np.linspace(-1.0, 14.0, 301)
    relay = start('node', 'loop_relay', '--scene', 'four_bar_clearance', env=env)
    try:
        panel = subprocess.run(
            [
                sys.executable, str(script(tmp_path / 'panel.py', PANEL)),
                'crank', json.dumps(places.tolist()),
            ],
            env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
        assert panel.returncode == 0, panel.stderr
    finally:
        relay.kill()
        relay.communicate()
    found = json.loads(panel.stdout)
    linkage = ms.load_scene('four_bar_clearance').nominal.linkage
    q = np.array([[a[2][c] for c in ('crank', 'coupler', 'rocker')] for a in found['answers']]).T
    np.testing.assert_array_equal(q[0], places)
    off = np.array(linkage.positions(places)) - q[1:]
    assert np.abs(np.exp(1j * off) - 1.0).max() < 1e-12
    assert np.abs(np.diff(q)).max() < 0.5, 'angles go on, beyond turns'
    rates = np.array([[a[3][c] for c in ('crank', 'coupler', 'rocker')] for a in found['answers']])
    _, v, _ = linkage.motion(places, np.full(301, 2.0), np.zeros(301))
    np.testing.assert_allclose(rates.T, v, atol=1e-12)
    assert [a[:2] for a in found['answers']] == [[1_700_000_000, 1 + k] for k in range(301)]
    assert found['frames'][-1] == [301, ['crank', 'coupler', 'rocker']]
    joints = {j.get('name') for j in ElementTree.fromstring(found['texts']['robot_description'])}
    assert {'crank', 'coupler', 'rocker'} <= joints
    drivers = ElementTree.fromstring(found['texts']['driver_description']).findall('joint')
    assert [(j.get('name'), j.get('type')) for j in drivers] == [('crank', 'continuous')]


def tracker(machine: ms.Machine) -> Tracker:
    ideal = without_clearance(machine)
    kinematics = ideal.plan.kinematics([*ideal.plan.laws])
    return Tracker(kinematics, ideal.assembly.q, ideal.assembly.slope)


def test_a_jump_of_the_driver_does_not_change_the_assembly():
    machine = ms.load_scene('four_bar_clearance')
    near, far = tracker(machine), tracker(machine)
    for place in np.linspace(0.0, 40.0, 2001):
        slow = near.to([place])
    np.testing.assert_allclose(far.to([40.0]), slow, rtol=0.0, atol=1e-12)


def test_a_driver_beyond_its_range_leaves_the_states_where_they_are():
    found = tracker(made(ROCKER))
    linkage = FourBar(0.09, 0.06, 0.04, 0.07)
    before = found.to([0.5])
    with pytest.raises(RunError, match=r'cannot follow its drive|singular position'):
        found.to([3.0])
    np.testing.assert_array_equal(found.q, before)
    after = found.to([0.9])
    angle = np.array(linkage.positions(np.array([0.9])))[:, 0]
    assert np.abs(np.exp(1j * (after[1:] - angle)) - 1.0).max() < 1e-12


def test_two_drivers_come_back_from_the_edge_of_their_workspace():
    found = tracker(ms.load_scene('loader'))
    first = found.q.copy()
    with pytest.raises(RunError):
        found.to(first[[found.q.tolist().index(x) for x in found.driven]] + 1.0)
    np.testing.assert_allclose(found.to(found.driven), first, atol=1e-12)


@pytest.mark.sample(3)
@pytest.mark.parametrize('scene', ['four_bar_clearance', 'gear_box', 'slider_crank'])
@pytest.mark.parametrize('fraction', [0.3, -2.0])
def test_a_place_ten_thousand_turns_away_is_that_of_its_fraction(scene, fraction, monkeypatch):
    """An encoder counts turns: whole ones after which the machine repeats are not followed."""
    near, far = tracker(ms.load_scene(scene)), tracker(ms.load_scene(scene))
    steps, follow = [], far._motion.follow
    monkeypatch.setattr(far._motion, 'follow', lambda *x: steps.append(0) or follow(*x))
    start = float(far.driven[0])
    found = far.to([start + 20_000.0 * np.pi + fraction])
    expected = near.to([start + fraction])
    assert far.driven[0] == start + 20_000.0 * np.pi + fraction
    sliding = np.isin(np.arange(len(found)), far._motion.sliding)
    np.testing.assert_allclose(found[sliding], expected[sliding], rtol=0.0, atol=1e-11)
    off = np.exp(1j * found[~sliding]) - np.exp(1j * expected[~sliding])
    assert np.abs(off).max() < 1e-10  # of 62,832 rad as they are told: 7e-12, by ratios more
    assert len(steps) < 64 * 64


def test_a_driver_that_returns_by_ten_thousand_turns_comes_back():
    found = tracker(ms.load_scene('four_bar_clearance'))
    first = found.to([0.7]).copy()
    found.to([0.7 + 20_000.0 * np.pi])
    np.testing.assert_allclose(found.to([0.7]), first, atol=1e-10)


FIVE = {
    'links': {
        'ground': {'points': {'r': [0.3, 0.0]}},
        'a': {'length': 0.05}, 'b': {'length': 0.3}, 'c': {'length': 0.3}, 'd': {'length': 0.06},
    },
    'joints': {
        'l': {'revolute': ['ground', 'a']}, 'm': {'revolute': ['a.end', 'b']},
        't': {'revolute': ['b.end', 'c.end']}, 'n': {'revolute': ['c', 'd.end']},
        'r': {'revolute': ['d', 'ground.r']},
    },
    'guess': {'b': '60 deg', 'c': '120 deg', 'd': '10 deg'},
    'drives': {'a': {'speed': 1.0}, 'd': {'speed': 2.0, 'start_angle': '10 deg'}},
}  # fmt: skip


def test_two_drivers_turn_ten_thousand_times():
    near, far = tracker(made(FIVE)), tracker(made(FIVE))
    expected = near.to(np.add(near.driven, [0.4, -0.9]))
    found = far.to(np.add(far.driven, [20_000.0 * np.pi + 0.4, -60_000.0 * np.pi - 0.9]))
    assert np.abs(np.exp(1j * found) - np.exp(1j * expected)).max() < 1e-10


def test_drivers_that_cannot_turn_leave_the_states_where_they_are():
    found = tracker(ms.load_scene('loader'))
    first = found.q.copy()
    with pytest.raises(RunError):
        found.to(found.driven + 40.0)
    np.testing.assert_array_equal(found.q, first)


@pytest.mark.parametrize(
    ('velocity', 'answered'), [([2.0], 3), ([float('nan')], 0), ([float('-inf')], 0), ([], 0)]
)
@pytest.mark.usefixtures('network')
def test_rates_that_are_no_numbers_are_no_rates(velocity, answered):
    relay, panel, answers = LoopRelay(), Node('panel'), []
    panel.create_subscription(JointState, 'joint_states', answers.append, RESULTS)
    told = panel.create_publisher(JointState, 'driver_states', RESULTS)
    executor = SingleThreadedExecutor()
    for node in (relay, panel):
        executor.add_node(node)
    try:
        told.publish(JointState(name=['crank'], position=[0.3], velocity=velocity))
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or answers)
    finally:
        for node in (relay, panel):
            executor.remove_node(node)
            node.destroy_node()
    (answer,) = answers
    assert (len(answer.position), len(answer.velocity)) == (3, answered)
