"""The relay to ros2_control without it: its description, and the files of the example."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
import yaml
from running import ROOT, run

import mechanism_sim as ms
from mechanism_sim.export.urdf import controlled_urdf

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


@pytest.mark.network
def test_a_drive_that_takes_no_commands_is_refused():
    refused = run('node', 'control_relay', '--scene', 'four_bar_clearance', refused=True)
    assert refused.returncode == 2
    assert 'its drive takes no commands' in refused.stderr
