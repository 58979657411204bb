"""Whatever strangers send, nodes drop it and the run is what it would have been.

A sample runs in the suite; ``python test/fuzz/strangers.py --messages 1000000`` takes hours.
"""

import os
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strangers import damaged, digest_of, disturb, is_message

from mechanism_sim.analysis.summary import analyze
from mechanism_sim.messages import MessageError, message_class, own_messages, serialize
from ros_interfaces.refusals import check_message
from zenoh_rclpy.wire import parse_token

EXAMPLES = int(os.environ.get('FUZZ_EXAMPLES', '200'))
SAMPLE = settings(max_examples=EXAMPLES, deadline=None, derandomize=EXAMPLES < 1000, database=None)
KINDS = (
    *(f'mechanism_sim/msg/{name}' for name in own_messages()),
    'sensor_msgs/msg/JointState',
    'tf2_msgs/msg/TFMessage',
    'visualization_msgs/msg/MarkerArray',
    'rcl_interfaces/srv/SetParameters_Request',
    'simulation_interfaces/action/SimulateSteps_SendGoal_Request',
)


@pytest.mark.slow
def test_a_run_does_not_notice_strangers(tmp_path):
    run, stranger, code = disturb(tmp_path, 3000, 1, 0.5, '--realtime-factor', '0.1')
    said = run.stderr()
    assert code == 0, said
    assert analyze(run.bag).digest == digest_of(0.5)
    assert 'Traceback' not in said
    assert 'panic' not in said
    assert 'dropped what came on /progress' in said
    assert run.memory < 500.0
    assert min(stranger.sent[what] for what in ('messages', 'requests', 'tokens')) > 50


@given(seed=st.integers(0, 1 << 40), kind=st.sampled_from(KINDS))
@SAMPLE
def test_bytes_are_a_good_message_or_refused_in_a_sentence(seed, kind):
    dice = random.Random(seed)
    data = damaged(dice, serialize(message_class(kind)()))
    try:
        check_message(data, message_class(kind))
        refused = ''
    except MessageError as error:
        refused = str(error)
    assert is_message(data, kind) or 0 < len(refused) < 500


@pytest.mark.parametrize('kind', KINDS)
def test_a_message_that_says_nothing_is_good(kind):
    message = message_class(kind)()
    if kind.endswith('DriveLaw'):  # whose kind and coefficients must be something
        message.kind, message.coefficients = message.TORQUE, [0.0, 0.0, 0.0]
    assert check_message(serialize(message), message_class(kind)) == message


@given(text=st.text('09:,%/x-~ \u0663', max_size=40))
@SAMPLE
def test_tokens_are_tokens_or_nothing(text):
    for start in ('@ros2_lv/0/', '@ros2_lv/0/a/1/2/MP/%/%/node/%t/a::msg::dds_::B_/h/'):
        token = parse_token(start + text)
        assert token is None or token.entity_id == 2
