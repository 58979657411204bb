"""Links as entities, scenes as worlds, nodes with a lifecycle, and wrenches of joints."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
import yaml
from operating import CONTROL, operate
from running import TIMEOUT, environment, run_json, script, start

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.scene.files import find_scene

pytestmark = pytest.mark.network

SCENE = 'four_bar_clearance'

WORLDS = (
    CONTROL
    + """
import math, sys
def numbers(s):
    p, w, a = s.pose, s.twist, s.acceleration
    return [s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec, p.position.x, p.position.y,
            p.orientation.z, p.orientation.w, w.linear.x, w.linear.y, w.angular.z,
            a.linear.x, a.linear.y, a.angular.z]
def links(**filters):
    answer = call('GetEntities', 'get_entities',
                  filters=message_class(f'{PACKAGE}/msg/EntityFilters')(**filters))
    return [answer.result.result, list(answer.entities)]
category = message_class(f'{PACKAGE}/msg/EntityCategory')
tags = message_class(f'{PACKAGE}/msg/TagsFilter')
found['links'] = [links(), links(filter='^c'), links(filter='['), links(tags=tags(tags=['a'])),
                  links(categories=[category(category=5)]),
                  links(categories=[category(category=5), category(category=4)])]
step(49)  # the first was one, too
found['states'] = {}
for link in found['links'][0][1]:
    answer = call('GetEntityState', 'get_entity_state', entity=link)
    assert answer.result.result == 1, answer.result.error_message
    assert answer.state.header.frame_id == 'world'
    found['states'][link] = numbers(answer.state)
all_ = call('GetEntitiesStates', 'get_entities_states')
found['all'] = dict(zip(all_.entities, map(numbers, all_.states)))
found['info'] = [int(call('GetEntityInfo', 'get_entity_info', entity=e).result.result)
                 for e in ('rocker', 'roker')]
unknown = call('GetEntityState', 'get_entity_state', entity='roker').result
found['unknown'] = [int(unknown.result), unknown.error_message]
found['worlds'] = [w.name for w in call('GetAvailableWorlds', 'get_available_worlds').worlds]
def load(uri, text=''):
    fields = {'uri': uri, 'resource_string': text}
    request = service_class(f'{PACKAGE}/srv/LoadWorld').Request()
    if hasattr(request, 'world_resource'):  # since release 2
        fields = {'world_resource': message_class(f'{PACKAGE}/msg/Resource')(**fields)}
    answer = call('LoadWorld', 'load_world', **fields)
    return [int(answer.result.result), answer.result.error_message, answer.world.name]
found['refused'] = [load('geneva'), load('fuor_bar_clearance'), load('', 'links: {}'), load('')]
def world():
    world = call('GetCurrentWorld', 'get_current_world').world
    return [world.name, world.world_resource.uri]
found['before'] = world()
found['loaded'], found['state'], found['after'] = load(sys.argv[1]), state(), world()
def place(link, angle, x=0.0, y=0.0, **fields):
    state = message_class(f'{PACKAGE}/msg/EntityState')()
    state.pose.position.x, state.pose.position.y = x, y
    state.pose.orientation.z, state.pose.orientation.w = math.sin(angle / 2), math.cos(angle / 2)
    state.twist.angular.z = 1000.0  # none that the drive has: to be ignored
    for name, value in fields.items():
        setattr(state.header, name, value)
    request = service_class(f'{PACKAGE}/srv/SetEntityState').Request()
    flags = {'set_pose': True} if hasattr(request, 'set_pose') else {}
    if not flags:
        state.twist.angular.z = 300 * math.tau / 60
    result = call('SetEntityState', 'set_entity_state', entity=link, state=state, **flags).result
    return [int(result.result), result.error_message]
found['placed'] = [place('crank', 0.25), place('roker', 0.0), place('crank', 0.0, x=0.1),
                   place('crank', 0.0, frame_id='map'), place('rocker', 0.0, x=0.387)]
found['overrides'] = call('GetParameters', 'crank_drive/get_parameters', names=['overrides'])
found['overrides'] = found['overrides'].values[0].string_value
found['steps'] = step(100)
found['late'] = place('crank', 0.0)
found['quit'] = go(3)
print(json.dumps(found))
shutdown()
"""
)


@pytest.mark.usefixtures('backend')
def test_links_are_entities_and_scenes_are_worlds(tmp_path):
    other = tmp_path / 'other.yaml'
    content = yaml.safe_load(find_scene(SCENE).read_text())
    content['drive']['speed'] = '300 rpm'
    other.write_text(yaml.safe_dump(content, sort_keys=False))
    found, bag = operate(tmp_path, WORLDS, SCENE, '--duration', '0.1', given=[str(other)])
    links = ['crank', 'coupler', 'rocker']
    assert found['links'] == [
        [1, links], [1, ['crank', 'coupler']], [4, []], [0, []], [1, []], [1, links],
    ]  # fmt: skip
    assert found['states'] == found['all']
    assert found['info'] == [1, 2]
    assert found['unknown'][0] == 2
    assert 'known are crank, coupler, rocker' in found['unknown'][1]
    # By the places of the motion that `simulate` finds, and by differences of these.
    machine = ms.load_scene(SCENE)
    solution, h = ms.simulate(machine, duration=0.1), 1e-5
    sampled = solution.sample(0.05 + h * np.array([-1.0, 0.0, 1.0]))
    q = np.array([sampled[f'position.{c}'] for c in machine.mechanism.coordinates])
    for link, (t, x, y, z, w, *rates) in found['states'].items():
        turn = machine.mechanism.angle_all(link, q)
        motion = np.vstack([machine.mechanism.locate_all(link, q), turn])
        assert (t, x, y) == pytest.approx((0.05, *motion[:2, 1]), abs=1e-12)
        assert (z, w) == pytest.approx((np.sin(turn[1] / 2), np.cos(turn[1] / 2)), abs=1e-12)
        assert rates[:3] == pytest.approx((motion[:, 2] - motion[:, 0]) / (2 * h), abs=1e-5)
        second = (motion[:, 2] - 2 * motion[:, 1] + motion[:, 0]) / h**2
        assert rates[3:] == pytest.approx(second, rel=1e-3, abs=1e-2)
    assert found['worlds'] == list(ms.scene_names())
    elements, parse, text, nothing = found['refused']
    assert (elements[0], parse[0], text[0], nothing[0]) == (106, 103, 101, 102)
    assert 'cannot change from one run to the next' in elements[1]
    assert "did you mean 'four_bar_clearance'?" in parse[1]
    assert found['before'] == [SCENE, SCENE]
    assert found['loaded'] == [1, '', 'other']
    assert found['after'] == ['other', str(other)]
    assert (found['state'], found['steps'], found['quit']) == (0, [1, ''], [1, ''])
    # A link is put elsewhere at the start of a run, and the machine with it.
    placed, *others = found['placed']
    assert placed == [1, '']
    assert [code for code, _ in others] == [2, 101, 101, 101]
    for (_, said), words in zip(
        others, ('known are', 'do not let crank', 'taken in', 'radial clearance'), strict=True
    ):
        assert words in said
    assert found['late'][0] == 3
    assert found['overrides'].startswith('initial.position.crank=0.25 rad')
    third = analyze(bag.with_name('run-3.mcap'))
    given = [x for line in found['overrides'].splitlines() for x in ('--set', line)]
    alone = run_json('solve', str(other), '--duration', '0.1', *given)
    assert third.digest == alone['digest']


MANAGER = """
import json
from mechanism_sim.messages import message_class, service_class
from mechanism_sim.nodes.middleware import Node, init, leave, spin_once, spin_until_future_complete

init()
node, heard = Node('manager'), []
Event = message_class('lifecycle_msgs/msg/TransitionEvent')
node.create_subscription(Event, '/linkage/transition_event',
    lambda m: heard.append([m.transition.label, m.start_state.label, m.goal_state.label]), 10)

def call(short, name, **fields):
    kind = service_class(f'lifecycle_msgs/srv/{short}')
    client = node.create_client(kind, f'/linkage/{name}')
    assert client.wait_for_service(300)
    future = client.call_async(kind.Request(**fields))
    spin_until_future_complete(node, future, timeout_sec=300)
    node.destroy_client(client)
    return future.result()

def go(label):
    transition = message_class('lifecycle_msgs/msg/Transition')(label=label)
    done = call('ChangeState', 'change_state', transition=transition).success
    return [done, call('GetState', 'get_state').current_state.label]

found = {'begin': call('GetState', 'get_state').current_state.label}
found['possible'] = [t.transition.label for t in call(
    'GetAvailableTransitions', 'get_available_transitions').available_transitions]
found['graph'] = len(call(
    'GetAvailableTransitions', 'get_transition_graph').available_transitions)
found['states'] = [s.label for s in call('GetAvailableStates', 'get_available_states')
                   .available_states]
found['went'] = [go(label) for label in (
    'activate', 'configure', 'cleanup', 'configure', 'activate', 'deactivate', 'cleanup',
    'activate')]
# The events come on another way than the answers.
while len(heard) < 6:
    spin_once(node, timeout_sec=0.1)
found['heard'] = heard
leave([node])
print(json.dumps(found))
"""


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_a_managed_node_begins_when_it_is_activated_and_waits_when_it_is_not(tmp_path):
    env, bag = environment(), tmp_path / 'run.mcap'
    names = 'crank_drive', 'linkage', 'recorder'
    length = '--duration', '0.2'
    more = {
        'crank_drive': ['--realtime-factor', '0.02'],
        'linkage': ['--ros-args', '-p', 'lifecycle:=true'],
        'recorder': ['--file', str(bag)],
    }
    nodes = [
        start(
            'node', name, '--scene', SCENE, *length, '--partner-timeout', '300', '--partners',
            ','.join(n for n in names if n != name), *more[name], env=env,
        )
        for name in names
    ]  # fmt: skip
    try:
        manager = subprocess.run(
            [sys.executable, str(script(tmp_path / 'manage.py', MANAGER))],
            env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
        assert manager.returncode == 0, manager.stderr
        said = [node.communicate(timeout=TIMEOUT) for node in nodes]
        assert [node.returncode for node in nodes] == [0, 0, 0], said
    finally:
        for node in nodes:
            node.kill()
            node.communicate()
    found = json.loads(manager.stdout.splitlines()[-1])
    assert found['begin'] == 'unconfigured'
    assert found['possible'] == ['configure', 'shutdown']
    assert found['graph'] == 7
    assert found['states'] == ['unknown', 'unconfigured', 'inactive', 'active', 'finalized']
    assert found['went'] == [
        [False, 'unconfigured'], [True, 'inactive'], [True, 'unconfigured'], [True, 'inactive'],
        [True, 'active'], [True, 'inactive'], [False, 'inactive'], [True, 'active'],
    ]  # fmt: skip
    assert found['heard'][0] == ['configure', 'unconfigured', 'inactive']
    assert found['heard'][-1] == ['activate', 'inactive', 'active']
    alone = run_json('solve', SCENE, *length)
    assert analyze(bag).digest == alone['digest']


@pytest.mark.slow
def test_wrenches_of_joints_are_their_reactions_in_frames_of_their_own(tmp_path):
    bag, rates = tmp_path / 'run.mcap', ('outputs.wrenches=100 Hz', 'outputs.transforms=100 Hz')
    sets = [part for text in rates for part in ('--set', text)]
    run_json('run', SCENE, '--duration', '0.25', '--record', str(bag), *sets)
    recorded = read_bag(bag)
    reactions = {m.time: m for _, m, _ in recorded.messages('/joint_reactions')}
    frames = {
        round(m.transforms[0].header.stamp.nanosec * 1e-9, 9): {
            t.child_frame_id: t for t in m.transforms
        }
        for _, m, _ in recorded.messages('/tf')
    }
    mechanism = ms.load_scene(SCENE).mechanism
    # Frames that never move are said once, for whoever comes late, and on no other topic.
    assert recorded.topics['/tf_static'].qos.durability == 'transient_local'
    ((_, message, _),) = recorded.messages('/tf_static')
    fixed = {t.child_frame_id: t for t in message.transforms}
    assert all(set(known) == {body.name for body in mechanism.bodies} for known in frames.values())
    for n, name in enumerate(next(iter(reactions.values())).joints):
        heard = [m for _, m, _ in recorded.messages(f'/wrench/{name}')]
        assert len(heard) == len(reactions)
        joint = mechanism.joint(name)
        for message, (t, reaction) in zip(heard, reactions.items(), strict=True):
            assert message.header.frame_id == f'joint/{name}'
            known = frames[round(t, 9)]
            place = fixed[f'joint/{name}']
            parent = 'world' if joint.second == 'ground' else joint.second
            assert place.header.frame_id == parent
            at = place.transform.translation
            assert (at.x, at.y) == pytest.approx(joint.on_second, abs=1e-15)
            turn = 0.0
            if parent != 'world':
                rotation = known[parent].transform.rotation
                turn = 2.0 * np.arctan2(rotation.z, rotation.w)
            force = message.wrench.force
            there = (force.x + 1j * force.y) * np.exp(1j * turn)
            wanted = reaction.force_x[n] + 1j * reaction.force_y[n]
            assert there == pytest.approx(wanted, rel=1e-12, abs=1e-12)
            assert message.wrench.torque.z == reaction.moment[n]
    for topic in ('/impacts', '/linkage_state', '/joint_reactions'):
        assert {m.header.frame_id for _, m, _ in recorded.messages(topic)} == {'world'}


@pytest.mark.slow
def test_a_machine_whose_forces_are_not_computed_is_published_all_the_same(tmp_path):
    bag, more = tmp_path / 'run.mcap', ('--duration', '0.1', '--set', 'outputs.forces=false')
    run_json('run', 'geneva', '--record', str(bag), *more)
    assert analyze(bag).digest == run_json('solve', 'geneva', *more)['digest']
    states = [m for _, m, _ in read_bag(bag).messages('/linkage_state')]
    assert len(states) == 10
    assert {m.drive_torque for m in states} == {0.0}
