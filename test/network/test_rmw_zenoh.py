"""Zenoh nodes of this package and nodes of rclpy on the real ``rmw_zenoh_cpp``, in one graph.

The same program runs on either back end, so each test lets the two back ends change places. The
session of the tests themselves opens the router. Skipped where ``rmw_zenoh_cpp`` is not installed.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from importlib.util import find_spec

import pytest
import zenoh
from middleware_network import PATIENCE, Process, eventually, free_port

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.messages import type_hash
from ros_interfaces.origin import VARIABLE
from zenoh_rclpy import config


def reason_to_skip() -> str:
    if find_spec('rclpy') is None:
        return 'rclpy is not installed'
    if find_spec('mechanism_sim.msg') is None:
        return 'the messages of this package are not built for ROS'
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    paths = (f'{p}/share/ament_index/resource_index/packages/rmw_zenoh_cpp' for p in prefixes)
    return '' if any(map(os.path.exists, paths)) else 'rmw_zenoh_cpp is not installed'


pytestmark = [
    pytest.mark.network,
    pytest.mark.skipif(bool(reason_to_skip()), reason=reason_to_skip()),
]


class Graph:
    """A router of its own, and processes around it on either back end."""

    def __init__(self) -> None:
        port = free_port()
        self.endpoint = f'tcp/127.0.0.1:{port}'
        self.domain = str(port % 200)
        self.processes: list[Process] = []

    def environment(self, backend: str) -> dict[str, str]:
        """Environment that makes a process a peer of this graph on ``zenoh`` or on ``rclpy``."""
        kept = {n: v for n, v in os.environ.items() if not n.startswith(('ZENOH_', VARIABLE))}
        own = {VARIABLE: 'zenoh', 'MECHANISM_SIM_ROUTER': self.endpoint}
        if backend == 'rclpy':
            links = f'connect/endpoints=["{self.endpoint}"];listen/endpoints=["tcp/127.0.0.1:0"]'
            own = {'RMW_IMPLEMENTATION': 'rmw_zenoh_cpp', 'ZENOH_CONFIG_OVERRIDE': links}
        return kept | own | {'ROS_DOMAIN_ID': self.domain, 'PYTHONUNBUFFERED': '1'}

    def start(self, script: str, backend: str, *arguments: object) -> Process:
        """A program on a back end."""
        self.processes.append(Process(script, self.environment(backend), *arguments))
        return self.processes[-1]

    def ros2(self, *arguments: str) -> str:
        """Output of a command of ROS."""
        done = subprocess.run(
            ['ros2', *arguments], env=self.environment('rclpy'), timeout=PATIENCE,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip
        return done.stdout


@pytest.fixture(scope='module')
def graph():
    made = Graph()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('MECHANISM_SIM_ROUTER', made.endpoint)
        router = zenoh.open(config.router_config())
    yield made
    for process in made.processes:
        process.kill()
    router.close()


SERVER = """
from mechanism_sim.messages import (
    Float64, FloatingPointRange, ParameterDescriptor, SetParametersResult, SimulateSteps, String,
    Trigger,
)
from mechanism_sim.nodes.middleware import *
from mechanism_sim.nodes.qos import RESULTS

init()
node = Node('server', namespace='/machine')
gate = Future()

def judge(parameters):
    bad = [p.value for p in parameters if p.name == 'mode' and p.value not in ('slow', 'fast')]
    return SetParametersResult(successful=not bad, reason=f'no mode: {bad[0]}' if bad else '')

limits = FloatingPointRange(from_value=0.0, to_value=10.0)
described = ParameterDescriptor(description='of the crank', floating_point_range=[limits])
node.declare_parameter('speed', 1.5, described)
node.declare_parameter('mode', 'slow')
node.add_on_set_parameters_callback(judge)

latched = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=3, reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
notes = node.create_publisher(String, 'notes', latched)
for number in range(5):
    notes.publish(String(data=str(number)))
doubled = node.create_publisher(Float64, 'doubled', RESULTS)
node.create_subscription(
    Float64, 'commands', lambda m: doubled.publish(Float64(data=2 * m.data)), RESULTS
)

def switch(request, response):
    response.success, response.message = True, 'switched'
    return response

async def execute(handle):
    steps = handle.request.steps
    handle.publish_feedback(SimulateSteps.Feedback(completed_steps=steps))
    if steps < 100:
        handle.succeed()
    else:
        await gate
        handle.canceled()
    result = SimulateSteps.Result()
    result.result.error_message = f'{steps} steps'
    return result

def cancel(handle):
    gate.set_result(None)
    return CancelResponse.ACCEPT

node.create_service(Trigger, 'switch', switch)
server = ActionServer(
    node, SimulateSteps, 'simulate_steps', execute, cancel_callback=cancel,
    goal_callback=lambda goal: GoalResponse.ACCEPT if goal.steps else GoalResponse.REJECT,
)
print('ready', flush=True)
try:
    while ok():
        spin_once(node, timeout_sec=0.1)
except ExternalShutdownException:
    pass
try_shutdown()
"""

CLIENT = """
import json, sys
from mechanism_sim.messages import (
    DescribeParameters, Float64, GetParameters, ListParameters, ParameterValue, SetParameters,
    SimulateSteps, String, Trigger, message_class,
)
from mechanism_sim.nodes.middleware import *
from mechanism_sim.nodes.qos import RESULTS

Setting = message_class('rcl_interfaces/msg/Parameter')
init()
node = Node('client', namespace='/elsewhere')
seen = {}

def get(future):
    spin_until_future_complete(node, future, timeout_sec=300.0)
    return future.result()

def ask(kind, name, **fields):
    client = node.create_client(kind, f'/machine/{name}')
    assert client.wait_for_service(timeout_sec=300.0), name
    return get(client.call_async(kind.Request(**fields)))

def put(name, kind, **value):
    given = Setting(name=name, value=ParameterValue(type=kind, **value))
    (result,) = ask(SetParameters, 'server/set_parameters', parameters=[given]).results
    return [result.successful, result.reason]

def spin_until(condition):
    for _ in range(2000):
        if condition():
            return
        spin_once(node, timeout_sec=0.01)

seen['service'] = ask(Trigger, 'switch').message
names = ask(ListParameters, 'server/list_parameters').result.names
seen['parameters'] = sorted({'speed', 'mode', 'use_sim_time'} & set(names))
(told,) = ask(DescribeParameters, 'server/describe_parameters', names=['speed']).descriptors
seen['described'] = [told.description, told.floating_point_range[0].to_value]
seen['set'] = put('speed', 3, double_value=2.5), put('mode', 4, string_value='fast')
seen['refused'] = put('mode', 4, string_value='wild'), put('speed', 3, double_value=11.0)[0]
values = ask(GetParameters, 'server/get_parameters', names=['speed', 'mode']).values
seen['values'] = [values[0].double_value, values[1].string_value]

latched = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=3, reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
seen['latched'], answers = [], []
def late(message):
    seen['latched'].append(message.data)
node.create_subscription(String, '/machine/notes', late, latched)
node.create_subscription(Float64, '/machine/doubled', lambda m: answers.append(m.data), RESULTS)
commands = node.create_publisher(Float64, '/machine/commands', RESULTS)
spin_until(lambda: commands.get_subscription_count() == 1)
spin_until(lambda: node.count_subscribers('/machine/doubled') == 1)
for number in range(500):
    commands.publish(Float64(data=float(number)))
spin_until(lambda: len(answers) >= 500 and len(seen['latched']) >= 3)
seen['answers'] = len(answers), answers == [2.0 * number for number in range(500)]

steps = ActionClient(node, SimulateSteps, '/machine/simulate_steps')
assert steps.wait_for_server(timeout_sec=300.0)
seen['feedback'] = []
def hear(message):
    seen['feedback'].append(message.feedback.completed_steps)
for number in (7, 100):
    handle = get(steps.send_goal_async(SimulateSteps.Goal(steps=number), hear))
    if number == 100:
        spin_until(lambda: len(seen['feedback']) == 2)
        seen['canceling'] = len(get(handle.cancel_goal_async()).goals_canceling)
    answer = get(handle.get_result_async())
    seen[f'goal {number}'] = answer.status, answer.result.result.error_message
seen['accepted'] = get(steps.send_goal_async(SimulateSteps.Goal(steps=0))).accepted

topics = dict(node.get_topic_names_and_types())
(notes,) = node.get_publishers_info_by_topic('/machine/notes')
seen['node'] = ('server', '/machine') in node.get_node_names_and_namespaces()
seen['types'] = topics['/machine/notes'], topics['/machine/simulate_steps/_action/feedback']
seen['publisher'] = [
    notes.node_name, notes.qos_profile.depth, notes.qos_profile.durability.name,
    notes.qos_profile.reliability.name,
]
seen['served'] = '/machine/switch' in dict(node.get_service_names_and_types())
print(json.dumps(seen), flush=True)
node.destroy_node()
shutdown()
"""

SEEN = {
    'service': 'switched',
    'parameters': ['mode', 'speed', 'use_sim_time'],
    'described': ['of the crank', 10.0],
    'set': [[True, ''], [True, '']],
    'refused': [[False, 'no mode: wild'], False],
    'values': [2.5, 'fast'],
    'latched': ['2', '3', '4'],
    'answers': [500, True],
    'feedback': [7, 100],
    'canceling': 1,
    'goal 7': [4, '7 steps'],
    'goal 100': [5, '100 steps'],
    'accepted': False,
    'node': True,
    'types': [
        ['std_msgs/msg/String'],
        ['simulation_interfaces/action/SimulateSteps_FeedbackMessage'],
    ],
    'publisher': ['server', 3, 'TRANSIENT_LOCAL', 'RELIABLE'],
    'served': True,
}


@pytest.mark.parametrize(('server', 'client'), [('zenoh', 'rclpy'), ('rclpy', 'zenoh')])
def test_one_serves_what_the_other_asks_for(graph, server, client):
    serving = graph.start(SERVER, server)
    serving.expect('ready')
    asking = graph.start(CLIENT, client)
    assert json.loads('{' + asking.expect('{')) == SEEN
    asking.finish()
    serving.interrupt(15)
    serving.finish()


COMMAND = 'from mechanism_sim.cli import main; main()'

LISTENER = """
from mechanism_sim.messages import Impact, JointState, Progress
from mechanism_sim.nodes.middleware import *
from mechanism_sim.nodes.qos import RESULTS

init()
node = Node('listener')
states, impacts, balance = [], [], {}

def report(message):
    if message.node == 'linkage' and message.finished:
        balance.update(zip(message.topics, map(int, message.counts)))

node.create_subscription(JointState, 'joint_states', states.append, RESULTS)
node.create_subscription(Impact, 'impacts', lambda m: impacts.append(m.index), RESULTS)
node.create_subscription(Progress, 'progress', report, RESULTS)
print('listening', flush=True)
while len(impacts) != balance.get('/impacts') or len(states) != balance.get('/joint_states'):
    spin_once(node, timeout_sec=0.1)
print('heard', len(impacts), len(states), impacts == list(range(len(impacts))), flush=True)
node.destroy_node()
shutdown()
"""

SCENE = 'four_bar_clearance'
DURATION = '0.5'


@pytest.fixture(scope='module')
def solved() -> ms.Solution:
    return ms.simulate(ms.load_scene(SCENE), duration=float(DURATION))


@pytest.mark.parametrize('on_rclpy', [('crank_drive', 'recorder'), ('linkage',)])
def test_a_run_with_nodes_on_either_back_end_is_the_same_to_the_bit(
    graph, tmp_path, solved, on_rclpy
):
    listener = graph.start(LISTENER, 'rclpy')
    listener.expect('listening')
    bag = tmp_path / 'run.mcap'
    names = ('crank_drive', 'linkage', 'recorder')
    nodes = []
    for name in names:
        arguments = ['node', name, '--scene', SCENE, '--duration', DURATION]
        arguments += ['--partners', ','.join(names), '--partner-timeout', '60']
        arguments += ['--file', str(bag)] if name == 'recorder' else []
        backend = 'rclpy' if name in on_rclpy else 'zenoh'
        nodes.append(graph.start(COMMAND, backend, *arguments))
    for node in nodes:
        node.finish()
    assert analyze(bag).digest == solved.digest()
    heard = listener.expect('heard').split()
    assert heard == [str(len(solved.impacts)), str(int(float(DURATION) * 100)), 'True']
    listener.finish()


@pytest.mark.skipif(shutil.which('ros2') is None, reason='the command ros2 is not installed')
def test_the_commands_of_ros_know_and_control_a_run(graph):
    run = graph.start(COMMAND, 'zenoh', 'run', SCENE, '--duration', DURATION, '--paused')
    standard, look = 'simulation_interfaces', ('--no-daemon', '--spin-time', '2')

    # Until the nodes have found each other the answer is: ask again.
    action = ('simulate_steps', f'{standard}/action/SimulateSteps', '{steps: 2}', '--feedback')
    assert eventually(lambda: 'SUCCEEDED' in graph.ros2('action', 'send_goal', *action))
    said = graph.ros2('topic', 'info', '--verbose', *look, '/joint_states')
    assert 'Node name: linkage' in said
    assert f'Topic type hash: {type_hash("sensor_msgs/msg/JointState")}' in said
    assert 'History (Depth): KEEP_ALL' in said
    said = graph.ros2('node', 'info', *look, '/linkage')
    assert '/impacts: mechanism_sim/msg/Impact' in said
    assert '/linkage/set_parameters: rcl_interfaces/srv/SetParameters' in said
    assert 'four_bar' in graph.ros2(
        'topic', 'echo', '--once', '--qos-durability', 'transient_local', '/scene',
        'std_msgs/msg/String',
    )  # fmt: skip
    said = graph.ros2('param', 'set', *look, '/crank_drive', 'realtime_factor', '" -1.0"')
    assert 'Setting parameter failed: ' in said

    play = (f'{standard}/srv/SetSimulationState', '{state: {state: 1}}')
    assert 'result=1' in graph.ros2('service', 'call', 'set_simulation_state', *play)
    run.finish()
