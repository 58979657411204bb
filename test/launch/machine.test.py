"""
A launched machine with a subscriber that is stopped for long: all of it arrives, to the bit.

The middleware, and how much it may keep for a subscriber, come from the environment:
CMakeLists.txt runs this for each that is there.
"""

import json
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import launch_testing
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from launch import LaunchDescription
from launch.actions import ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_testing.actions import ReadyToTest
from launch_testing.asserts import assertExitCodes
from launch_testing.util import KeepAliveProc

REVOLUTIONS, STOPPED, PATIENCE = '300', 20.0, 300.0
FOLDER = Path(tempfile.mkdtemp())
BAG = FOLDER / 'run.mcap'


def generate_test_description():
    """Build the machine and its listener, for which the integrator waits."""
    parameters = FOLDER / 'parameters.yaml'
    parameters.write_text('/linkage:\n  ros__parameters:\n    listeners: slow_listener\n')
    file = Path(get_package_share_directory('mechanism_sim'), 'launch', 'machine.launch.py')
    given = {
        'revolutions': REVOLUTIONS, 'record': str(BAG), 'params_file': str(parameters),
    }  # fmt: skip
    machine = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(file)), launch_arguments=given.items()
    )
    script = Path(__file__).with_name('slow_listener.py')
    listener = ExecuteProcess(cmd=[sys.executable, '-u', str(script)], output='screen')
    alive = KeepAliveProc()  # the tests may take longer than the machine
    return LaunchDescription([alive, listener, machine, ReadyToTest()]), {'listener': listener}


class TestDelivery(unittest.TestCase):
    """While it runs."""

    def test_nothing_is_lost_while_a_subscriber_is_stopped(self, proc_output, listener):
        """Stop the listener in the middle of the run, and compare what it has heard at last."""
        proc_output.assertWaitFor('UNDER WAY', process=listener, stream='stdout', timeout=PATIENCE)
        pid = listener.process_details['pid']
        signal_to(pid, signal.SIGSTOP)
        time.sleep(STOPPED)
        signal_to(pid, signal.SIGCONT)
        proc_output.assertWaitFor('COUNTS', process=listener, stream='stdout', timeout=PATIENCE)
        text = ''.join(line.text.decode() for line in proc_output[listener])
        counts = json.loads(text.partition('COUNTS ')[2].splitlines()[0])
        self.assertEqual(counts['heard'], counts['announced'])
        self.assertGreater(counts['heard']['/impacts'], 1000)

    def test_the_machine_ends_by_itself(self, proc_info, listener):
        """Wait for its nodes, and for who listens to them."""
        for process in ('crank_drive', 'linkage', 'sensors', 'recorder', listener):
            proc_info.assertWaitForShutdown(process=process, timeout=PATIENCE)


@launch_testing.post_shutdown_test()
class TestOutcome(unittest.TestCase):
    """After it has ended."""

    def test_all_ended_cleanly(self, proc_info):
        """Look at the exit codes."""
        assertExitCodes(proc_info)

    def test_the_bag_has_the_motion_of_solve(self):
        """Compare the digests of the two motions."""
        found = ask('analyze', str(BAG))
        solved = ask('solve', 'four_bar_clearance', '--revolutions', REVOLUTIONS, '--no-events')
        self.assertEqual(found['digest'], solved['digest'])


def signal_to(pid, number):
    """Send a signal to a process."""
    subprocess.run(['kill', f'-{int(number)}', str(pid)], check=True)


def ask(*arguments):
    """Ask the command line of the package, on its own interpreter."""
    program = Path(get_package_prefix('mechanism_sim'), 'lib', 'mechanism_sim', 'mechanism-sim')
    done = subprocess.run(
        [str(program), *arguments, '--json'], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)
