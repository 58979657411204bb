"""Messages accepted by likeness to a good message are good when decoded, too."""

import numpy as np
import pytest

from mechanism_sim.messages import (
    Impact,
    Imu,
    JointReactions,
    JointState,
    LinkageState,
    MessageError,
    ModeChange,
    Motion,
    SensorBlock,
    String,
    TFMessage,
    TransformStamped,
    serialize,
)
from ros_interfaces.refusals import check_message
from ros_interfaces.similarity import SimilarMessages

MESSAGES = [
    JointState(name=['crank', 'rocker'], position=np.ones(2), velocity=np.ones(2)),
    LinkageState(coordinates=['a'], joints=['x', 'yz'], modes=[2, 3], position=[0.5], gaps=[0, 1]),
    SensorBlock(sensor='s', link='rocker', samples=np.arange(256.0)),
    Impact(joint='coupler_rocker', normal_impulse=0.1, index=7),
    TFMessage(transforms=[TransformStamped(child_frame_id='a'), TransformStamped()]),
    Imu(),
    String(data='{}'),
]
BAD = np.array([np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0]).view('u8')


def is_good(data, kind):
    try:
        check_message(data, kind)
    except MessageError:
        return False
    return True


@pytest.mark.parametrize('message', MESSAGES, ids=lambda m: type(m).__name__)
def test_bytes_that_are_changed_anywhere(message):
    kind, data = type(message), serialize(message)
    known = SimilarMessages(kind)
    assert data not in known
    known.add(check_message(data, kind), data)
    assert data in known
    taken = refused = 0
    for at in range(len(data)):
        changed = [data[:at] + bytes([data[at] ^ bit]) + data[at + 1 :] for bit in (1, 128, 255)]
        if not at % 4:
            changed += [(data[:at] + bad.tobytes() + data[at + 8 :])[: len(data)] for bad in BAD]
        for other in [*changed, data[:at], data + bytes(at)]:
            good, alike = is_good(other, kind), other in known
            assert good or not alike, (at, other[at])
            taken += alike
            refused += not good
    assert refused
    if kind is not String:
        assert taken > len(data) / 4


def test_what_contradicts_itself_is_decoded_every_time():
    data = serialize(Motion(coordinates=['a'], known_until=1.0))
    known = SimilarMessages(Motion)
    known.add(check_message(data, Motion), data)
    assert data not in known


def test_bytes_that_dds_has_filled_up_to_a_multiple_of_four():
    data = serialize(ModeChange(joint='a', mode=2, previous_mode=1)) + bytes(2)
    known = SimilarMessages(ModeChange)
    known.add(check_message(data, ModeChange), data)
    other = serialize(ModeChange(joint='b', mode=1, previous_mode=2, time=3.0)) + bytes(2)
    assert other.replace(b'b', b'a') in known
    assert other not in known
    assert data[:-2] not in known


def test_what_may_be_unknown_is_decoded_where_it_is():
    known, (good, some) = SimilarMessages(JointReactions), (
        serialize(JointReactions(joints=['a'], force_x=[x], force_y=[1.0], moment=[0.0]))
        for x in (2.0, np.nan)
    )  # fmt: skip
    known.add(check_message(good, JointReactions), good)
    assert good in known
    assert some not in known
    assert is_good(some, JointReactions)


def test_few_are_remembered():
    known = SimilarMessages(String)
    for n in range(100):
        text = String(data='x' * n)
        known.add(text, serialize(text))
    assert sum(serialize(String(data='x' * n)) in known for n in range(100)) <= 64
