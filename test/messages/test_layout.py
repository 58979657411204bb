"""Serialised messages from arrays: bit for bit those that are serialised one by one."""

import numpy as np
import pytest

from mechanism_sim.engine.events import Impact, Mode, ModeChange
from mechanism_sim.messages import (
    CamState,
    CheckedBytes,
    Imu,
    JointState,
    LinkageState,
    SensorBlock,
    TFMessage,
    TransformStamped,
    deserialize,
    events,
    message_class,
    own_messages,
    serialize,
    stamp,
)
from mechanism_sim.messages.own import OWN
from ros_interfaces.layout import Layout

TIMES = np.array([0.0, 0.1, 0.9999999996, 1.9999999994, 123456.000000001, 2.0**30 + 0.5])


def joint_state(n, value):
    values = np.full(n, value)
    return JointState(name=[f'link {i}' for i in range(n)], position=values, velocity=-values)


def linkage_state(n, value):
    return LinkageState(
        time=value, coordinates=['a', 'bcd'], position=[value, 1.0], joints=['x'] * n,
        modes=[3] * n, gaps=[value] * n, drive_torque=value,
    )  # fmt: skip


def transforms(n, value):
    frames = [TransformStamped(child_frame_id='x' * i) for i in range(n)]
    for frame in frames:
        frame.transform.translation.x = value
    return TFMessage(transforms=frames)


def columns_of(message, prefix=''):
    """Every number of a message by its path, found without a layout."""
    found = {}
    for name in message.__dataclass_fields__:
        value, path = getattr(message, name), f'{prefix}{name}'
        many = value if isinstance(value, list) else [value]
        for i, each in enumerate(many):
            here = f'{path}[{i}]' if isinstance(value, list) else path
            if hasattr(each, '__dataclass_fields__'):
                found |= columns_of(each, f'{here}.')
            elif not isinstance(each, str):
                found[here] = each
    return found


@pytest.mark.parametrize('make', [joint_state, linkage_state, transforms])
@pytest.mark.parametrize('n', [0, 1, 2, 5])
def test_what_is_written_reads_as_what_was_meant(make, n):
    if make is transforms and not n:
        n = 3
    layout, wanted = Layout(make(n, 0.0)), []
    for i, t in enumerate(TIMES):
        message = make(n, 0.25 * i)
        for each in getattr(message, 'transforms', [message]):
            each.header.stamp = stamp(t)
        if hasattr(message, 'time'):
            message.time = t
        wanted.append(message)
    rows = [columns_of(message) for message in wanted]
    columns = {
        name: np.array([row[name] for row in rows])
        for name in rows[0]
        if 'stamp' not in name and name != 'time'
    }
    written = layout.write(TIMES, columns)
    assert all(type(data) is CheckedBytes for data in written)
    for data, message in zip(written, wanted, strict=True):
        assert deserialize(data, type(message)) == message
        assert data == serialize(message)


@pytest.mark.parametrize('name', own_messages())
def test_every_message_has_a_layout(name):
    """Numbers, written into zeros, come back: all places are found, behind texts of any length."""
    rng = np.random.default_rng(0)
    for length in range(9):
        kind = message_class(f'{OWN}/msg/{name}')
        message = kind(**{
            field: 'x' * length if value == '' else value
            for field, value in ((f, getattr(kind(), f)) for f in kind.__dataclass_fields__)
            if isinstance(value, str)
        })  # fmt: skip
        message.header.frame_id = 'y' * length
        for field in kind.__dataclass_fields__:
            if isinstance(getattr(message, field), np.ndarray):
                setattr(message, field, np.zeros(length, getattr(message, field).dtype))
        numbers = {n: v for n, v in columns_of(message).items() if 'stamp' not in n}
        columns = {
            n: rng.integers(0, 2, (1, *np.shape(v))).astype(np.asarray(v).dtype)
            for n, v in numbers.items()
        }
        if 'time' in columns:
            columns.pop('time')
        (data,) = Layout(message).write(np.array([7.5]), columns)
        read = columns_of(deserialize(data, kind))
        assert all(np.array_equal(read[n], v[0]) for n, v in columns.items())
        assert read.get('time', 7.5) == 7.5
        assert read['header.stamp.nanosec'] == 500_000_000


def test_numbers_that_no_machine_has_are_left_to_be_judged_one_by_one():
    layout, t = Layout(SensorBlock(samples=np.zeros(3))), np.zeros(2)
    good = np.ones((2, 3))
    for bad in (np.nan, np.inf, -np.inf, 1e61):
        some = good.copy()
        some[1, 1] = bad
        assert not any(isinstance(d, CheckedBytes) for d in layout.write(t, {'samples': some}))
    assert all(isinstance(d, CheckedBytes) for d in layout.write(t, {'samples': good}))
    unknown = Layout(CamState()).write(t, {'cam_torque': np.full(2, np.nan)})
    assert all(isinstance(d, CheckedBytes) for d in unknown)


def test_a_field_that_there_is_not_is_an_error():
    with pytest.raises((KeyError, ValueError)):
        Layout(Imu()).write(np.zeros(1), {'angular_velocity.w': np.zeros(1)})


def test_events_in_bulk_are_those_one_by_one():
    rng, writer = np.random.default_rng(1), events.EventWriter('world')
    for n in (0, 1, 7):
        joints = rng.choice(['coupler_rocker', 'a', 'crank_coupler'], n)
        impacts = [
            Impact(t, str(j), *x[:8], bool(i % 2), *x[8:11])
            for i, (t, j, x) in enumerate(
                zip(np.sort(rng.random(n)), joints, rng.random((n, 11)), strict=True)
            )
        ]
        wanted = [serialize(events.impact(x, 5 + i, 'world')) for i, x in enumerate(impacts)]
        assert writer.impacts(impacts, 5) == wanted
        changes = [ModeChange(x.t, x.joint, Mode.FOLLOWING, Mode.UNKNOWN) for x in impacts]
        assert writer.mode_changes(changes) == [serialize(events.mode_change(x)) for x in changes]
