"""Nodes behave the same on rclpy and on Zenoh: the same script, the same outcome."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from middleware_network import Network
from running import TIMEOUT

pytestmark = pytest.mark.network

SCRIPT = Path(__file__).parent / 'parity.py'
OUTCOME = {
    'services_answer_later': ['now', False, 'answer 0', 'answer 1'],
    'a_callback_that_waits_holds_up_its_group': [['begin'], ['begin', 'end', 'b']],
    'actions_run_side_by_side': {
        'accepted': [True, True, True, True, False],
        'feedback': [1, 2, 3, 4],
        'cancelled': [0, 1, True],
        'states': [[1, False, True], [2, True, True], [3, False, True], [4, False, True]],
        'results': [[4, '1'], [5, '2'], [6, '3'], [6, '']],
        'terminated': [3, 0],
        'wrong goal': 'TypeError',
    },
    'quality_of_service_is_overridden': [
        7, 'KEEP_LAST', 'RELIABLE', 'reliable', False,
        'depth for publisher `/drive` with id `None`', 'RuntimeError',
        'InvalidParameterTypeException',
    ],
    'command_lines_are_heeded': [
        ['/n/x', '/n/c', '/n/x/a', '/n/b', None, None, None],
        ['/named', '/a', '/named/a', '/d', None, None, None],
        ['/named', '/a', '/f', '/named/g', None, None, None],
        ['/named', '/a', '/named/a', '/b', 1e-3, '1:30', [16, 8]],
        ['a', 'b'],
        ['c'],
    ],
    'parameters_are_declared_and_set': {
        'declared': [3, None],
        'unset': 'ParameterUninitializedException',
        'or': 7,
        'real': [True, False, True, True, False, False, False, False],
        'whole': [True, False, False, True, False],
        'any': [True, True],
        'fixed': [False],
        'both': False,
        'first of both': True,
        'no value': [False],
        'names': ['a.size', 'a.kind'],
        'prefixes': ['a'],
        'has': [False, True],
        'errors': [
            'ParameterNotDeclaredException', 'ParameterNotDeclaredException',
            'ParameterAlreadyDeclaredException', 'InvalidParameterValueException', 'ValueError',
            'InvalidParameterException', 'ParameterImmutableException',
            'ParameterNotDeclaredException', 'InvalidParameterTypeException',
        ],
        'told': [['a.size'], ['a.kind'], ['real'], ['whole'], ['any'], ['fixed']],
        'events': [
            [['a.size'], [], []], [['a.kind'], [], []], [[], [], ['any']], [['a.kind'], [], []],
        ],
    },
    'timers_follow_simulated_time': [[10.0, 10.5, 0.6, 5.7, 6.0], True],
}  # fmt: skip


@pytest.fixture(scope='module', params=['zenoh', 'rclpy'])
def outcome(request):
    """Output of the script on a back end."""
    if request.param == 'rclpy' and find_spec('rclpy') is None:
        pytest.skip('rclpy is not installed')
    network = Network()
    settings = os.environ | network.settings | {'MECHANISM_SIM_MIDDLEWARE': request.param}
    run = subprocess.run(
        [sys.executable, SCRIPT, request.param],
        env=settings, capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    network.close()
    lines = [line for line in run.stdout.splitlines() if line.startswith('OUTCOME ')]
    assert lines, run.stderr
    found = json.loads(lines[0].removeprefix('OUTCOME '))
    assert found['backend'] == request.param
    return found


@pytest.mark.parametrize('scenario', OUTCOME)
def test_nodes_behave_the_same_on_every_back_end(outcome, scenario):
    assert outcome[scenario] == OUTCOME[scenario]
