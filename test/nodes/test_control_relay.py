"""The relay to ros2_control without it: its description, and the files of the example."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import pytest
import yaml
from middleware_network import eventually
from running import ROOT, run

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.export.urdf import controlled_urdf
from mechanism_sim.messages import Float64, JointState
from mechanism_sim.nodes.control_relay import ControlRelay
from mechanism_sim.nodes.loop_relay import LoopRelay
from mechanism_sim.nodes.middleware import Node, Parameter, SingleThreadedExecutor
from mechanism_sim.nodes.qos import RESULTS
from zenoh_rclpy.arguments import parse_arguments

EXAMPLE = ROOT / 'examples' / 'ros2_control'


@pytest.fixture(scope='module')
def machine() -> ms.Machine:
    return ms.load_scene(EXAMPLE / 'four_bar.yaml')


def test_the_description_has_each_coordinate_and_commands_the_driven_one(machine):
    topics = {'states': '/a/states', 'commands': '/a/commands'}
    robot = ElementTree.fromstring(controlled_urdf(machine, 'machine', 'crank', 'effort', topics))
    joints = {joint.get('name') for joint in robot.findall('joint')}
    assert joints == {'crank', 'coupler', 'rocker'}
    (hardware,) = robot.findall('ros2_control/hardware')
    given = {param.get('name'): param.text for param in hardware.findall('param')}
    assert given['joint_states_topic'] == '/a/states'
    assert given['joint_commands_topic'] == '/a/commands'
    assert float(given['trigger_joint_command_threshold']) < 0.0, 'each step has a command'
    described = {joint.get('name'): joint for joint in robot.findall('ros2_control/joint')}
    assert set(described) == joints
    commanded = {
        name: [x.get('name') for x in joint.findall('command_interface')]
        for name, joint in described.items()
    }
    assert commanded == {'crank': ['effort'], 'coupler': [], 'rocker': []}


def test_the_controllers_of_the_example_fit_its_scene(machine):
    given = yaml.safe_load((EXAMPLE / 'controllers.yaml').read_text(encoding='utf-8'))
    parameters = {name: node['ros__parameters'] for name, node in given.items()}
    manager = parameters.pop('controller_manager')
    assert machine.scene.outputs.joint_states == manager['update_rate']
    launch = (EXAMPLE / 'ros2_control.launch.py').read_text(encoding='utf-8')
    assert f'PERIOD = {1.0 / manager["update_rate"]}' in launch
    kinds = {name for name, value in manager.items() if isinstance(value, dict)}
    assert kinds == set(parameters)
    for name, values in parameters.items():
        assert f"'{name}'" in launch or f"'{name.removesuffix('_trajectory')}'" in launch
        joints = values.get('joints') or values['reference_and_state_dof_names']
        assert set(joints) <= set(machine.physics.coordinates)


@pytest.mark.usefixtures('network')
def test_states_and_commands_of_a_robot_beside_the_machine_are_not_its_own(monkeypatch):
    """Its times would look like a reset, and its commands like those of the crank."""
    joints, given = ['crank', 'coupler', 'rocker'], Parameter('scene', value='four_bar_governed')
    relay, other = ControlRelay([given, Parameter('command_period', value=0.0)]), Node('other')
    shown, commanded, ignored = [], [], []
    other.create_subscription(JointState, 'hardware/joint_states', shown.append, RESULTS)
    other.create_subscription(Float64, 'command/effort', commanded.append, RESULTS)
    states = other.create_publisher(JointState, 'joint_states', RESULTS)
    commands = other.create_publisher(JointState, 'hardware/joint_commands', RESULTS)
    monkeypatch.setattr(relay, 'ignore', lambda topic, _: ignored.append(topic))
    executor = SingleThreadedExecutor()
    for node in (relay, other):
        executor.add_node(node)
    try:
        for names in (['elbow'], joints[::-1], [*joints, 'elbow'], []):
            states.publish(JointState(name=names))
        states.publish(JointState(name=joints))
        for names, efforts in (
            (['elbow'], [1.0]), (['elbow', 'wrist'], [1.0, 2.0]), (['crank'], [math.inf]),
            (['crank'], []), (['crank'], [3.0]), (['elbow', 'crank'], [1.0, 4.0]),
            (joints, [5.0]), ([], [6.0]),
        ):  # fmt: skip
            commands.publish(JointState(name=names, effort=efforts))
        assert eventually(
            lambda: executor.spin_once(timeout_sec=0.01) or (len(commanded) >= 4 and shown)
        )
    finally:
        for node in (relay, other):
            executor.remove_node(node)
            node.destroy_node()
    assert [state.name for state in shown] == [joints]
    assert [command.data for command in commanded] == [3.0, 4.0, 5.0, 6.0]
    assert ignored == ['joint_states'] * 4


@pytest.mark.usefixtures('network')
@pytest.mark.parametrize(
    ('node', 'rule'),
    [(ControlRelay, 'hardware/joint_states:=joint_states'),
     (LoopRelay, 'driver_states:=joint_states')],
)  # fmt: skip
def test_a_relay_that_would_answer_itself_without_end_is_refused(node, rule, monkeypatch):
    probe = Node('probe')
    monkeypatch.setattr(probe.context, 'arguments', parse_arguments(['--ros-args', '-r', rule]))
    probe.destroy_node()
    with pytest.raises(InputError, match='hears /joint_states and answers there, itself too'):
        node([Parameter('scene', value='four_bar_governed')])


@pytest.mark.network
def test_a_drive_that_takes_no_commands_is_refused():
    refused = run('node', 'control_relay', '--scene', 'four_bar_clearance', refused=True)
    assert refused.returncode == 2
    assert 'its drive takes no commands' in refused.stderr
