"""Invalid messages from foreign processes, and their treatment."""

from __future__ import annotations

import shutil
import struct
import subprocess
import time
from pathlib import Path

import pytest
from middleware_network import PATIENCE, Network, eventually, spin_until
from running import command, environment

import mechanism_sim
from mechanism_sim import process_exit
from mechanism_sim.messages import (
    DriveLaw,
    Impact,
    JointState,
    Motion,
    ParameterValue,
    Progress,
    SensorBlock,
    SetParameters,
    String,
    TFMessage,
    TransformStamped,
    Trigger,
    objection,
    serialize,
    stamp,
)
from mechanism_sim.messages import Parameter as ParameterMessage
from mechanism_sim.nodes.middleware import MiddlewareError, Node, spin_once
from mechanism_sim.nodes.qos import LATCHED, RESULTS
from ros_interfaces import checks
from ros_interfaces.refusals import Refusals
from zenoh_rclpy import inbox as inboxes

STRANGER = """
import sys, time, zenoh
from zenoh_rclpy.config import session_config
session = zenoh.open(session_config())
kept = []
def seen(entity):
    kept.append(entity)
    while not entity.matching_status.matching:
        time.sleep(0.001)
    return entity
publishers = {}
for line in sys.stdin:
    what, key, data, attachment = eval(line)
    if what == 'put':
        if key not in publishers:
            block = zenoh.CongestionControl.BLOCK
            publishers[key] = session.declare_publisher(key, congestion_control=block)
        seen(publishers[key]).put(data, attachment=attachment)
    elif what == 'token':
        kept.append(session.liveliness().declare_token(key))
    else:
        found = []
        while not found:
            found = list(session.get(key, payload=data, attachment=attachment, timeout=30.0))
        print('answer', [x.err.payload.to_bytes() if x.err else None for x in found])
"""
GOOD = struct.pack('<qqB16s', 1, 0, 16, b'a stranger here!')


@pytest.fixture(scope='module')
def stranger(network: Network):
    """A process that puts, asks and announces what it is told."""
    process = network.start(STRANGER)

    def tell(what, key, data=b'', attachment=GOOD):
        process.tell(repr((what, key, data, attachment)))
        return eval(process.expect('answer')) if what == 'ask' else None

    return tell


@pytest.fixture
def quick(node: Node):
    """A node whose warnings about what was dropped are counted anew."""
    node.context.refusals._warned.clear()
    return node


def key(node: Node, name: str, kind: str) -> str:
    return node.context.key(name, kind)


NAN = Impact(time=float('nan'))
JUNK = [
    (b'seven b', GOOD, '7 bytes do not begin as CDR'),
    (b'\0\0\0\0' + serialize(Impact())[4:], GOOD, 'little-endian'),
    (serialize(Impact())[:-8], GOOD, 'bytes are no mechanism_sim/msg/Impact'),
    (serialize(Impact()) + bytes(8), GOOD, 'size mismatch'),
    (serialize(Impact(joint='é')).replace('é'.encode(), b'\xff\xfe'), GOOD, 'utf-8'),
    (serialize(NAN), GOOD, 'time holds a number outside the range of machines'),
    (serialize(Impact()), None, 'an attachment of 33 bytes'),
    (serialize(Impact()), GOOD[:-1], 'an attachment of 33 bytes'),
]


@pytest.mark.parametrize(('data', 'attachment', 'said'), JUNK)
def test_what_is_no_message_is_dropped_with_one_warning(
    quick, stranger, capfd, data, attachment, said
):
    heard = []
    quick.create_subscription(Impact, 'impacts', lambda m: heard.append(m.joint), RESULTS)
    where, last = key(quick, '/impacts', 'mechanism_sim/msg/Impact'), 'last of ' + said
    for _ in range(20):
        stranger('put', where, data, attachment)
    stranger('put', where, serialize(Impact(joint=last)))
    spin_until(quick, lambda: bool(heard))
    for _ in range(5):
        spin_once(quick, timeout_sec=0.0)
    lines = [line for line in capfd.readouterr().err.splitlines() if 'dropped' in line]
    assert heard == [last]
    assert len(lines) == 1
    assert '[node]: dropped what came on /impacts: ' in lines[0]
    assert said in lines[0]


def test_a_warning_comes_once_in_ten_seconds_and_counts_what_came_meanwhile(monkeypatch):
    now, said = [0.0], []
    monkeypatch.setattr(time, 'monotonic', lambda: now[0])
    refusals = Refusals()
    for second in range(25):
        now[0] = float(second)
        refusals.count('/a', 'message', 'why', said.append)
        refusals.count('/b', 'message', 'why', lambda _: None)
    more = '; before it 9 more, for a like reason'
    assert said == [f'dropped what came on /a: why{x}' for x in ('', more, more)]


def test_numbers_that_are_nobodys_business_pass(quick, stranger):
    heard = []
    quick.create_subscription(JointState, 'joints', lambda m: heard.append(m.effort[0]), RESULTS)
    message = JointState(effort=[float('inf')])
    stranger('put', key(quick, '/joints', 'sensor_msgs/msg/JointState'), serialize(message))
    spin_until(quick, lambda: heard == [float('inf')])


def test_junk_pushes_no_description_out_of_its_queue(quick, stranger):
    """A subscription of depth 1 has the last message, whatever came after it."""
    heard = []
    subscription = quick.create_subscription(
        String, 'scene', lambda m: heard.append(m.data), LATCHED
    )
    source = Node('source')
    source.create_publisher(String, 'scene', LATCHED).publish(String(data='the scene'))
    where = key(quick, '/scene', 'std_msgs/msg/String')
    for _ in range(50):
        stranger('put', where, b'junk')
    stranger('ask', f'@mechanism_sim/{quick.context.domain}/*')  # answered when all has come
    assert len(subscription.inbox) == 1
    spin_until(quick, lambda: bool(heard))
    assert heard == ['the scene']
    source.destroy_node()


@pytest.mark.parametrize(
    'token',
    [
        '{lv}/a/1/2/MP/%/%/node2/%impacts/x/{hash}/::,:,:,:,,',
        '{lv}/a/1/2/MP/%/%/node2/%impacts/{type}/{hash}/x:y:z',
        '{lv}/a/1/2/MP/%/%/node2/%impacts/{type}/{hash}/9:9:9,9:,:,:,,',
        '{lv}/a/1/99999999999999999999/MP/%/%/node2/%impacts/{type}/{hash}/::,:,:,:,,',
        '{lv}/a/1/2/MP/%/%/no de/%impacts/{type}/{hash}/::,:,:,:,,',
        '{lv}/a/1/2/MP',
        '{lv}/%%%%',
    ],
)
def test_what_is_no_token_is_nobody(quick, stranger, capfd, token):
    known = quick.context.graph.nodes()
    start, kind = f'@ros2_lv/{quick.context.domain}', 'mechanism_sim::msg::dds_::Impact_'
    token = token.format(
        lv=start, type=kind, hash=quick.context.hash_of('mechanism_sim/msg/Impact')
    )
    stranger('token', token)
    lines = []

    def warned() -> bool:
        lines.extend(x for x in capfd.readouterr().err.splitlines() if 'is no token' in x)
        return bool(lines)

    spin_until(quick, warned)
    assert start in lines[0]
    assert quick.get_publishers_info_by_topic('/impacts') == []
    assert quick.context.graph.nodes() == known


def test_a_bad_request_is_answered_by_an_error_and_the_service_goes_on(quick, stranger):
    quick.create_service(Trigger, 'go', lambda _, response: response)
    where = key(quick, '/go', 'std_srvs/srv/Trigger')
    for data, attachment, said in (
        (b'junk', GOOD, b'do not begin as CDR'),
        (b'\0\1\0\0' + bytes(2_000_000), GOOD, b'more than a request may have'),
        (b'\0\1\0\0' + bytes(40), GOOD, b'size mismatch'),
        (serialize(Trigger.Request()), b'x', b'an attachment of 33 bytes'),
    ):
        (error,) = stranger('ask', where, data, attachment)
        assert said in error
    client = quick.create_client(Trigger, 'go')
    assert client.wait_for_service(PATIENCE)
    future = client.call_async(Trigger.Request())
    spin_until(quick, future.done)
    assert future.result() == Trigger.Response()


def test_only_so_many_requests_wait(quick, stranger, monkeypatch):
    monkeypatch.setattr('zenoh_rclpy.services.LIMIT', 3)
    answered = []
    quick.create_service(Trigger, 'slow', lambda _, response: answered.append(1) or response)
    client = quick.create_client(Trigger, 'slow')
    assert client.wait_for_service(PATIENCE)
    futures = [client.call_async(Trigger.Request()) for _ in range(5)]
    (error,) = stranger('ask', key(quick, '/slow', 'std_srvs/srv/Trigger'), b'\0\1\0\0\0')
    assert error == b'3 requests wait already'
    spin_until(quick, lambda: all(f.done() for f in futures))
    assert len(answered) == 3
    assert sum(isinstance(f.exception(), MiddlewareError) for f in futures) == 2


def test_a_parameter_of_an_unknown_type_is_refused_with_a_reason(quick):
    client = quick.create_client(SetParameters, '/node/set_parameters')
    assert client.wait_for_service(PATIENCE)
    wrong = ParameterMessage(name='use_sim_time', value=ParameterValue(type=77))
    future = client.call_async(SetParameters.Request(parameters=[wrong]))
    spin_until(quick, future.done)
    (result,) = future.result().results
    assert not result.successful
    assert result.reason == 'use_sim_time: there is no type 77 of parameters'


def test_a_reply_that_is_none_does_not_count(quick, network):
    """A rival serves the same name, and answers with junk before the service does."""
    where = key(quick, '/shared', 'std_srvs/srv/Trigger')
    _, name, kind, known_hash = where.split('/')
    start = f'@ros2_lv/{quick.context.domain}/a/1/2/SS/%/%/rival'
    token = f'{start}/%{name}/{kind}/{known_hash}/::,:,:,:,,'
    rival = network.start(f"""
        import zenoh
        from zenoh_rclpy.config import session_config
        session = zenoh.open(session_config())
        def answer(query):
            with query:
                query.reply({where!r}, b'junk')
            print('answered')
        session.declare_queryable({where!r}, answer, complete=True)
        token = session.liveliness().declare_token({token!r})  # who sees this reaches that
        print('up')
        input()
    """)
    rival.expect('up')
    assert eventually(lambda: quick.context.graph.count('SS', '/shared') == 1)
    quick.create_service(Trigger, 'shared', lambda _, r: setattr(r, 'message', 'yes') or r)
    client = quick.create_client(Trigger, 'shared')
    assert client.wait_for_service(PATIENCE)
    future = client.call_async(Trigger.Request())
    rival.expect('answered')
    spin_until(quick, future.done)
    assert future.result().message == 'yes'


def test_queues_are_bounded_in_bytes_and_memories_in_publishers(quick, stranger, monkeypatch):
    monkeypatch.setattr(inboxes, 'LIMIT_BYTES', 10_000)
    monkeypatch.setattr('zenoh_rclpy.subscription.PUBLISHERS', 5)
    heard = []
    subscription = quick.create_subscription(String, 'texts', lambda m: heard.append(m.data), 100)
    where = key(quick, '/texts', 'std_msgs/msg/String')
    for n in range(20):
        gid = struct.pack('<qqB16s', 1, 0, 16, bytes([n]) * 16)
        stranger('put', where, serialize(String(data=f'{n:4}' + 'x' * 2996)), gid)
    stranger('ask', f'@mechanism_sim/{quick.context.domain}/*')  # answered when all has come
    assert 0 < len(subscription.inbox) <= 3
    spin_until(quick, lambda: bool(heard) and heard[-1].startswith('  19'))
    assert len(subscription._latest) == 5


@pytest.mark.parametrize(
    ('message', 'said'),
    [
        (Progress(topics=['a']), '1 topics, but 0 counts'),
        (Progress(time=-1.0), 'not a time of a run'),
        (Progress(time=1e40), 'not a time of a run'),
        (Motion(segments=2), '0 values of start, not 2'),
        (Motion(segments=2**31, degree=2**31), 'values of start'),
        (Motion(coordinates=['a'], segments=1, start=[0], start_low=[0], duration=[-1],
                turns=[0], coefficients=[0]), 'do not follow each other'),
        (Motion(torque_laws=[1.0]), 'torque_laws'),
        (Motion(modes=[1]), '1 values of modes'),
        (Motion(known_until=float('inf')), 'known_until holds a number'),
        (DriveLaw(), 'no kind 0 of laws'),
        (DriveLaw(kind=2, coefficients=[1.0]), 'has not 1 coefficients'),
        (DriveLaw(kind=1), 'has not 0 coefficients'),
        (SensorBlock(samples=[0.0] * 200 + [float('nan')]),
         'samples holds'),
    ],
)  # fmt: skip
def test_messages_that_contradict_themselves_are_refused(message, said):
    assert said in (objection(message) or '')


def test_stamps_are_looked_at_however_deep_they_are():
    frame = TransformStamped()
    assert objection(TFMessage(transforms=[frame])) is None
    frame.header.stamp = stamp(-0.5)
    assert 'are no time' in (objection(TFMessage(transforms=[TransformStamped(), frame])) or '')
    late = Impact()
    late.header.stamp.nanosec = 10**9
    assert 'are no time' in (objection(late) or '')


@pytest.mark.parametrize('value', [1e59, -1e59, 0.0])
def test_numbers_of_a_machine_may_be_large(value):
    assert checks.impossible_number(Impact(time=value)) is None
    assert checks.impossible_number(Impact(time=100.0 * value)) == ('time' if value else None)


@pytest.mark.slow
@pytest.mark.network
def test_a_partner_of_another_version_ends_the_run_in_a_sentence(tmp_path):
    """Two installations, one of them with another Motion."""
    other = tmp_path / 'other'
    source = Path(mechanism_sim.__file__).parent
    for name in (source.name, 'ros_interfaces', 'zenoh_rclpy', 'msg'):
        shutil.copytree(source.parent / name, other / name)
    with (other / 'msg' / 'Motion.msg').open('a') as definition:
        definition.write('float64 novelty\n')
    nodes = 'linkage', 'sensors'
    scene = source.parent / 'config' / 'four_bar_clearance.yaml'
    env = environment()
    processes = [
        subprocess.Popen(
            command('node', node, '--scene', str(scene), '--partners', ','.join(nodes)),
            env=process_exit.owned(env | {'PYTHONPATH': path}),
            cwd=path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for node, path in zip(nodes, (str(source.parent), str(other)), strict=True)
    ]
    try:
        ends = [process.communicate(timeout=2 * PATIENCE) for process in processes]
    finally:
        for process in processes:
            process.kill()
    assert [process.returncode for process in processes] == [1, 1], ends
    # Who looks first says so; the other may see it leave.
    assert any('is of another version: it has another type' in said for _, said in ends)
    for _, said in ends:
        assert 'Traceback' not in said
