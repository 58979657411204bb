"""Machines that are added to a running simulation, go and begin anew with it, and are deleted."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from operating import CONTROL, operate
from running import run_json

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze

pytestmark = pytest.mark.network

SCENE, OTHER = 'four_bar_clearance', 'slider_crank_engine'

SPAWNER = (
    CONTROL
    + """
def entities():
    return list(call('GetEntities', 'get_entities').entities)
def spawn(uri, **fields):
    resource = {'uri': uri}
    request = service_class(f'{PACKAGE}/srv/SpawnEntity').Request()
    if hasattr(request, 'entity_resource'):  # since release 2
        resource = {'entity_resource': message_class(f'{PACKAGE}/msg/Resource')(uri=uri)}
    answer = call('SpawnEntity', 'spawn_entity', **resource, **fields)
    return [int(answer.result.result), answer.result.error_message, answer.entity_name]
def crank(namespace):
    state = call('GetEntityState', f'{namespace}/get_entity_state', entity='crank').state
    stamp = state.header.stamp
    return [stamp.sec + 1e-9 * stamp.nanosec, state.pose.orientation.z, state.header.frame_id]
"""
)
SPAWN = (
    SPAWNER
    + """
found['steps'] = step(49)
found['refused'] = [spawn('slidr_crank_engine'), spawn(''), spawn('SCENE2', name='crank'),
                    spawn('SCENE2', name='a b'), spawn('SCENE2', entity_namespace='2')]
found['spawned'] = spawn('SCENE2', entity_namespace='cell/one')
found['entities'] = entities()
found['info'] = call('GetEntityInfo', 'get_entity_info', entity=found['spawned'][2]).info
found['info'] = [int(found['info'].category.category), found['info'].description]
found['joined'] = crank('cell/one')
step(50)
found['stepped'] = crank('cell/one')
found['reset'] = call('ResetSimulation', 'reset_simulation', scope=3).result.result
step(30)
found['again'] = crank('cell/one')
def delete(name):
    return int(call('DeleteEntity', 'delete_entity', entity=name).result.result)
found['deleted'] = [delete(found['spawned'][2]), delete(found['spawned'][2])]
found['left'] = entities()
found['second'] = spawn('SCENE2', name='second')
found['cleared'] = [call('ResetSimulation', 'reset_simulation', scope=4).result.result, entities()]
found['third'] = spawn('SCENE2', name='third')
found['quit'] = go(3)
print(json.dumps(found))
shutdown()
"""
).replace('SCENE2', OTHER)


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_a_second_machine_is_spawned_and_has_the_time_of_the_first(tmp_path):
    found, bag = operate(tmp_path, SPAWN, SCENE, '--duration', '0.1')
    links = ['crank', 'coupler', 'rocker']
    assert [code for code, *_ in found['refused']] == [106, 104, 101, 102, 105]
    assert found['spawned'] == [1, '', OTHER]
    assert found['entities'] == [*links, OTHER]
    assert found['info'] == [1, f'machine {OTHER}, its nodes in /cell/one']
    # It moves as it does alone, whenever it came.
    machine = ms.load_scene(OTHER)
    solution = ms.simulate(machine, duration=0.1)
    for kind, t in (('joined', 0.05), ('stepped', 0.1), ('again', 0.03)):
        at, sine, frame = found[kind]
        assert (at, frame) == (pytest.approx(t, abs=1e-9), 'cell/one/world')
        angle = solution.sample(np.array([t]), 'position.crank')['position.crank'][0]
        # up to whole turns, of which half an angle keeps a sign
        assert abs(sine) == pytest.approx(abs(np.sin(angle / 2)), abs=1e-9)
    assert found['reset'] == 1
    assert found['deleted'] == [1, 2]
    assert found['left'] == links
    assert (found['second'][0], found['cleared']) == (1, [1, links])
    assert (found['third'], found['quit']) == ([1, '', 'third'], [1, ''])
    alone = run_json('solve', SCENE, '--duration', '0.1')
    assert analyze(bag).digest == alone['digest']


FAR = (
    SPAWNER
    + """
import math, sys
def places():
    found, times = [], []
    for name in ('get_entity_state', 'late/get_entity_state'):
        for link in ('crank', 'coupler', 'rocker'):
            state = call('GetEntityState', name, entity=link).state
            at, turn = state.pose.position, state.pose.orientation
            found.append([at.x, at.y, turn.z, turn.w])
            times.append(state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec)
    return times, found[:3], found[3:]
def place(angle):
    state = message_class(f'{PACKAGE}/msg/EntityState')()
    state.pose.orientation.z, state.pose.orientation.w = math.sin(angle / 2), math.cos(angle / 2)
    state.twist.angular.z = 200 * math.pi
    request = service_class(f'{PACKAGE}/srv/SetEntityState').Request()
    flags = {'set_pose': True} if hasattr(request, 'set_pose') else {}
    answer = call('SetEntityState', 'set_entity_state', entity='crank', state=state, **flags)
    return int(answer.result.result)
found['far'] = step(1999)
found['spawned'] = spawn(sys.argv[1], name='late')
found['joined'] = places()
found['on'] = step(1)
found['stepped'] = places()
found['reset'] = call('ResetSimulation', 'reset_simulation', scope=3).result.result
found['again'] = [place(1.25), step(1), places()]
found['quit'] = go(3)
print(json.dumps(found))
shutdown()
"""
)


@pytest.mark.slow
@pytest.mark.usefixtures('backend')
def test_a_machine_that_is_spawned_ten_thousand_turns_on(tmp_path):
    """Two of one scene are in the same places, to the bit, and where their drive has them."""
    file, rates = tmp_path / 'fast.yaml', ('joint_states', 'linkage_state', 'transforms')
    scene = {
        'title': 'Four-bar at 100 turns a second',
        'mechanism': 'four_bar',
        'links': {
            link: {'length': f'{length} mm'}
            for link, length in (('ground', 387), ('crank', 64), ('coupler', 309), ('rocker', 312))
        },
        'drive': {'speed': '6000 rpm', 'start_angle': '3600090 deg'},
        'outputs': dict.fromkeys(rates, '1 Hz'),
    }
    file.write_text(yaml.safe_dump(scene, sort_keys=False))
    found, _ = operate(tmp_path, FAR, str(file), '--duration', '2.1', given=[str(file)])
    assert (found['far'], found['on']) == ([1, ''], [1, ''])
    assert found['spawned'] == [1, '', 'late']
    for kind, t in (('joined', 2.0), ('stepped', 2.001)):
        times, first, late = found[kind]
        assert times == pytest.approx([t] * 6, abs=1e-9)
        assert first == late
        half = np.pi * (10_000.25 + 100.0 * t)
        assert np.abs(first[0][2:]) == pytest.approx(
            np.abs([np.sin(half), np.cos(half)]), abs=1e-9
        )
    # After that a start is set, of the first alone: the other begins as its scene says.
    assert found['reset'] == 1
    placed, stepped, (times, first, late) = found['again']
    assert (placed, stepped) == (1, [1, ''])
    assert times == pytest.approx([0.001] * 6, abs=1e-9)
    assert abs(first[0][2]) == pytest.approx(np.sin(0.625 + 0.1 * np.pi), abs=1e-9)
    assert abs(late[0][2]) == pytest.approx(np.sin(0.35 * np.pi), abs=1e-9)
