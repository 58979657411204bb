"""
A machine in one process, in a namespace that is pushed, with a file of parameters and a remap.

Simulated time, quality of service and names are what the includer says.
"""

import subprocess
import tempfile
import time
import unittest
from pathlib import Path

import launch_testing
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import PushRosNamespace, SetRemap
from launch_testing.actions import ReadyToTest
from launch_testing.asserts import assertExitCodes
from launch_testing.util import KeepAliveProc

PATIENCE = 120.0
PARAMETERS = """
/**:
  ros__parameters:
    use_sim_time: true
    qos_overrides./cell/joint_states.publisher.reliability: best_effort
"""


def generate_test_description():
    """Include the machine, which pauses at its end."""
    file = Path(get_package_share_directory('mechanism_sim'), 'launch', 'machine.launch.py')
    parameters = Path(tempfile.mkdtemp()) / 'parameters.yaml'
    parameters.write_text(PARAMETERS)
    given = {
        'duration': '0.5', 'hold': 'true', 'composed': 'true', 'params_file': str(parameters),
        'clock': 'true',
    }  # fmt: skip
    include = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(file)), launch_arguments=given.items()
    )
    cell = GroupAction([PushRosNamespace('cell'), SetRemap('impacts', 'hits'), include])
    return LaunchDescription([KeepAliveProc(), cell, ReadyToTest()])


class TestNames(unittest.TestCase):
    """While it is there."""

    def test_the_nodes_have_what_the_includer_says(self):
        """Ask the graph and the nodes."""
        until_said('node', 'list', '--no-daemon', wanted='/cell/linkage')
        topics = until_said('topic', 'list', '--no-daemon', wanted='/cell/hits').split()
        self.assertNotIn('/cell/impacts', topics)
        for node in ('crank_drive', 'linkage', 'sensors'):
            until_said('param', 'get', f'/cell/{node}', 'use_sim_time', wanted='True')
        until_said('topic', 'info', '/clock', '--no-daemon', wanted='Publisher count: 1')
        told = until_said(
            'topic', 'info', '-v', '/cell/joint_states', '--no-daemon', wanted='Node name: linkage'
        )
        self.assertIn('Reliability: BEST_EFFORT', told)


@launch_testing.post_shutdown_test()
class TestOutcome(unittest.TestCase):
    """After it was ended."""

    def test_all_ended_cleanly(self, proc_info):
        """Look at the exit codes: a launch ends what waits by a signal."""
        assertExitCodes(proc_info)


def until_said(*arguments, wanted):
    """Ask ``ros2`` until its answer holds what is wanted, and return the answer."""
    end = time.monotonic() + PATIENCE
    while True:
        done = subprocess.run(['ros2', *arguments], capture_output=True, text=True, check=False)
        if wanted in done.stdout or time.monotonic() > end:
            assert wanted in done.stdout, (arguments, done.stdout, done.stderr)
            return done.stdout
