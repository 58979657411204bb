"""Joining and leaving the network, and what a process that knows only Zenoh sees of it."""

import signal
import socket
import threading

import pytest
from middleware_network import PATIENCE, Network, eventually

from mechanism_sim.messages import Impact, JointState
from mechanism_sim.nodes import middleware
from zenoh_rclpy import (
    HistoryPolicy,
    MiddlewareError,
    Node,
    QoSProfile,
    init,
    ok,
    session,
    shutdown,
    spin_once,
    try_shutdown,
)

KEEP_ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL)

TALK = r"""
    import sys, time
    from mechanism_sim.messages import Impact
    from zenoh_rclpy import *
    init()
    node = Node(sys.argv[1])
    keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL)
    publisher = node.create_publisher(Impact, 'impacts', keep_all)
    heard = {}
    def hear(message):
        heard[message.joint] = heard.get(message.joint, 0) + 1
    node.create_subscription(Impact, 'impacts', hear, keep_all)
    count = 0
    def talk():
        global count
        count += 1
        publisher.publish(Impact(index=count, joint=sys.argv[1]))
        print('heard', *sorted(heard))
    node.create_timer(0.02, talk)
    print('up')
    try:
        spin(node)
    except (KeyboardInterrupt, ExternalShutdownException) as reason:
        print('\nend', type(reason).__name__)  # it may have interrupted a print
    node.destroy_node()
    shutdown()
"""


@pytest.fixture
def network(monkeypatch):
    network = Network()
    for name, value in network.settings.items():
        monkeypatch.setenv(name, value)
    yield network
    try_shutdown()
    network.close()


def hears(process, *names):
    return eventually(lambda: set(process.expect('heard').split()) >= set(names))


def test_without_ros_the_back_end_is_zenoh(network):
    assert network
    assert middleware.backend() == 'zenoh'


@pytest.mark.sample(1)
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_processes_that_talk_to_each_other(network, number):
    talkers = [network.start(TALK, name) for name in 'abc']
    for talker in talkers:
        assert hears(talker, 'a', 'b', 'c')
    for talker in talkers:
        talker.interrupt(number)
    expected = 'KeyboardInterrupt' if number == signal.SIGINT else 'ExternalShutdownException'
    for talker in talkers:
        assert talker.expect('end') == expected
        talker.finish()


def test_a_process_that_never_says_goodbye_is_tidied_up(network):
    lazy = network.start("""
        from mechanism_sim.messages import Impact
        from zenoh_rclpy import *
        init()
        node = Node('lazy')
        publisher = node.create_publisher(
            Impact, 'impacts', QoSProfile(history=HistoryPolicy.KEEP_ALL)
        )
        while not publisher.get_subscription_count():
            pass
        publisher.publish(Impact(index=5))
    """)
    init()
    node = Node('keen')
    got = []
    node.create_subscription(Impact, 'impacts', got.append, KEEP_ALL)
    spin_once(node, timeout_sec=PATIENCE)
    lazy.finish()
    assert got[0].index == 5
    assert eventually(lambda: node.get_node_names() == ['keen'])


@pytest.mark.slow
def test_the_others_go_on_when_the_process_with_the_router_ends(network):
    host = network.start(TALK, 'host')
    host.expect('up')
    others = [network.start(TALK, name) for name in 'ab']
    for other in others:
        assert hears(other, 'host', 'a', 'b')
    host.interrupt()
    host.finish()
    # one of them opens a router, which clients need that are no peers
    assert eventually(lambda: session._is_router(session.config.router_endpoint()))
    late = network.start(TALK, 'late')
    assert hears(late, 'a', 'b', 'late')
    for other in others:
        assert hears(other, 'late')
    assert hears(others[0], 'b')


@pytest.mark.slow
def test_many_processes_start_at_once(network):
    names = 'abcde'
    talkers = [network.start(TALK, name) for name in names]
    for talker in talkers:
        assert hears(talker, *names)


def test_a_port_of_somebody_else_is_an_error_in_one_sentence(network, monkeypatch):
    monkeypatch.setattr(session, 'ROUTER_PATIENCE', 0.5)
    asked, probe = [], session.config.probe_config

    def remembered(timeout):
        asked.append(probe(timeout))
        return asked[-1]

    monkeypatch.setattr(session.config, 'probe_config', remembered)
    with socket.create_server(('127.0.0.1', network.port)) as foreign:
        threading.Thread(target=foreign.accept, daemon=True).start()
        with pytest.raises(MiddlewareError, match='not a Zenoh router: stop it, or set') as error:
            init()
        assert str(network.port) in str(error.value)
        assert len(str(error.value).splitlines()) == 1
        assert not ok()
    # it is asked once, and gets so long [ms] to answer
    assert [c.get_json('transport/unicast/open_timeout') for c in asked] == ['500']


@pytest.mark.parametrize(
    ('variable', 'value', 'message', 'bad_input'),
    [
        ('MECHANISM_SIM_ROUTER', 'localhost', 'no endpoint of the form', True),
        ('MECHANISM_SIM_ROUTER', 'tcp/192.0.2.1:1', 'No router answers at', False),
        ('ROS_DOMAIN_ID', 'seven', 'not a whole number', True),
        ('ROS_DOMAIN_ID', '-1', 'a domain is a number from 0 on', True),
        ('ZENOH_SESSION_CONFIG_URI', '/no/such/file', 'not readable', True),
        ('ZENOH_CONFIG_OVERRIDE', 'no/such/key=1', 'no/such/key=1', True),
    ],
)
def test_what_the_environment_gets_wrong_is_said(
    network, monkeypatch, variable, value, message, bad_input
):
    """Bad input is a ValueError, too: commands end with 2."""
    assert network
    monkeypatch.setenv(variable, value)
    with pytest.raises(MiddlewareError, match=message) as raised:
        init()
    assert isinstance(raised.value, ValueError) == bad_input


def test_the_environment_may_choose_the_network(network, monkeypatch):
    assert network
    monkeypatch.setenv('ZENOH_CONFIG_OVERRIDE', 'connect/endpoints=[];listen/endpoints=[]')
    init()
    assert not session_of(Node('alone')).info.routers_zid()
    shutdown()
    monkeypatch.delenv('ZENOH_CONFIG_OVERRIDE')
    monkeypatch.setenv('ROS_DISTRO', 'humble')
    init()
    node = Node('old')
    assert node.context.key('/t', 'std_msgs/msg/String').endswith('/TypeHashNotSupported')


def session_of(node):
    return node.context.session


def test_init_and_shutdown_come_in_pairs(network):
    assert network
    with pytest.raises(MiddlewareError, match='comes first'):
        Node('early')
    with pytest.raises(MiddlewareError, match='without init'):
        shutdown()
    init()
    assert ok()
    with pytest.raises(MiddlewareError, match='twice'):
        init()
    shutdown()
    assert not ok()
    for _ in range(3):
        init()
        shutdown()


FOREIGN = """
    import json, struct, sys
    import numpy as np
    import zenoh
    from rosbags.typesys import Stores, get_typestore
    port, domain = sys.argv[1:]
    config = zenoh.Config()
    for key, value in {
        'mode': 'peer', 'connect/endpoints': [f'tcp/127.0.0.1:{port}'],
        'listen/endpoints': ['tcp/127.0.0.1:0'], 'scouting/multicast/enabled': False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    store = get_typestore(Stores.ROS2_JAZZY)
    hashed = store.hash_rihs01('sensor_msgs/msg/JointState')
    key = f'{domain}/joint_states/sensor_msgs::msg::dds_::JointState_/{hashed}'
    samples = session.declare_subscriber(key)
    tokens = session.liveliness().declare_subscriber(f'@ros2_lv/{domain}/**', history=True)
    sample = samples.recv()
    sequence, stamp, length = struct.unpack('<qqB', sample.attachment.to_bytes()[:17])
    message = store.deserialize_cdr(sample.payload.to_bytes(), 'sensor_msgs/msg/JointState')
    print('sample', len(sample.attachment.to_bytes()), sequence, length, message.name,
          message.position.tolist(), message.header.frame_id)
    gid = sample.attachment.to_bytes()[17:].hex()
    print('gid', gid)
    found = set()
    wanted = ('/NN/%/%lab/ours', '/MP/%/%lab/ours/%joint_states/', '%get_parameters/')
    while not all(any(part in token for token in found) for part in wanted):
        token = tokens.recv()
        found.add(str(token.key_expr))
    for token in sorted(found):
        print('token', token)
    none = np.array([])
    answer = type(message)(message.header, ['foreign'], np.array([2.5]), none, none)
    payload = bytes(store.serialize_cdr(answer, 'sensor_msgs/msg/JointState'))
    session.put(key, payload)  # without an attachment: to be ignored
    session.put(key, payload, attachment=struct.pack('<qqB16s', 1, 42, 16, bytes(16)))
    print('put')
    input()
    session.close()
"""


def test_a_process_that_knows_only_zenoh_takes_part(network):
    init()
    node = Node('ours', namespace='lab')
    got = []
    publisher = node.create_publisher(JointState, '/joint_states', KEEP_ALL)
    node.create_subscription(
        JointState, '/joint_states', lambda message, info: got.append((message, info)), 10
    )
    domain = network.settings['ROS_DOMAIN_ID']
    foreign = network.start(FOREIGN, network.port, domain)
    done = threading.Event()

    def publish():
        while not done.wait(0.02):
            publisher.publish(JointState(name=['crank', 'rocker'], position=[0.25, 0.5]))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        length, sequence, sixteen, *rest = foreign.expect('sample').split()
    finally:
        done.set()
        thread.join()
    assert (length, sixteen) == ('33', '16')
    assert int(sequence) >= 1
    assert ' '.join(rest) == "['crank', 'rocker'] [0.25, 0.5]"
    (info,) = node.get_publishers_info_by_topic('/joint_states')
    assert foreign.expect('gid') == bytes(info.endpoint_gid).hex()
    foreign.expect('put')
    tokens = [line.split()[1] for line in foreign.lines if line.startswith('token')]
    zid = node.context.zid
    assert f'@ros2_lv/{domain}/{zid}/0/0/NN/%/%lab/ours' in tokens
    (ours,) = [token for token in tokens if '/MP/' in token and '%joint_states/' in token]
    assert ours.startswith(f'@ros2_lv/{domain}/{zid}/0/')
    assert ours.endswith('/::2,:,:,:,,')
    assert '/MP/%/%lab/ours/%joint_states/sensor_msgs::msg::dds_::JointState_/RIHS01_a13ee' in ours
    assert any('/SS/%/%lab/ours/%lab%ours%get_parameters/' in token for token in tokens)

    def heard():
        spin_once(node, timeout_sec=0.1)
        return any(message.name == ['foreign'] for message, _ in got)

    assert eventually(heard)
    (info,) = [info for message, info in got if message.name == ['foreign']]
    assert (info['publication_sequence_number'], info['source_timestamp']) == (1, 42)
    foreign.tell()
    foreign.finish()
