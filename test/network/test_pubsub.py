"""Publishers, subscriptions and graph, across processes and inside one."""

import signal
import subprocess
import sys
import threading
import time

import pytest
import zenoh
from middleware_network import PATIENCE, Network, Process, eventually, spin_until
from running import ROOT, TIMEOUT

import zenoh_rclpy
from mechanism_sim.messages import (
    Float64,
    Impact,
    JointState,
    serialize,
    type_hash,
    type_name,
)
from mechanism_sim.nodes.middleware import (
    DurabilityPolicy,
    ExternalShutdownException,
    HistoryPolicy,
    MiddlewareError,
    Node,
    QoSProfile,
    SingleThreadedExecutor,
    init,
    ok,
    shutdown,
    spin_once,
)
from zenoh_rclpy import executors, session, wire
from zenoh_rclpy.config import router_config, session_config
from zenoh_rclpy.inbox import LIMIT
from zenoh_rclpy.subscription import Subscription

KEEP_ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL)
LATCHED = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)

COLLECT = """
    import sys, time
    from mechanism_sim.messages import Impact
    from mechanism_sim.nodes.middleware import *
    count, delay = int(sys.argv[1]), float(sys.argv[2])
    init()
    node = Node('collector')
    got = []
    def collect(message):
        got.append(message.index)
        if delay:
            time.sleep(delay)
    keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL)
    node.create_subscription(Impact, 'impacts', collect, keep_all)
    node.create_subscription(Impact, 'last', lambda _: None, keep_all)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while len(got) < count:
        executor.spin_once(0.1)
    print('got', len(got), got == list(range(count)))
    shutdown()
"""


@pytest.fixture
def network():
    network = Network()
    yield network
    network.close()


@pytest.fixture
def either(backend):
    """For processes only, of one middleware or the other."""
    network = Network(backend)
    yield network
    network.close()


@pytest.fixture
def joined(network, monkeypatch):
    """This process on a network of its own."""
    for name, value in network.settings.items():
        monkeypatch.setenv(name, value)
    init()
    yield network
    shutdown()


@pytest.mark.slow
def test_twenty_thousand_messages_reach_a_slow_subscriber_in_order(joined):
    collector = joined.start(COLLECT, 20_000, 50e-6)
    node = Node('source')
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
    assert eventually(lambda: node.count_subscribers('last') == 1)
    message = Impact(joint='coupler_rocker')
    for index in range(20_000):
        message.index = index
        publisher.publish(message)
    node.destroy_node()
    shutdown()
    init()  # for the fixture
    assert collector.expect('got') == '20000 True'
    collector.finish()


@pytest.mark.slow
def test_who_has_not_read_all_is_named_at_the_end(joined, monkeypatch, caplog):
    """The program would stand still without a word."""
    monkeypatch.setattr(session, 'ASK_AGAIN', 0.2)
    collector = joined.start(COLLECT, 3000, 300e-6)
    quick = Node('quick')  # of this process, which is not waited for
    publisher = quick.create_publisher(Impact, 'impacts', KEEP_ALL)
    assert eventually(lambda: quick.count_subscribers('last') == 1)
    publisher.publish_all([Impact(index=index) for index in range(3000)])
    assert publisher.wait_for_all_acked()
    quick.destroy_node()
    assert collector.expect('got') == '3000 True'
    collector.finish()
    (said,) = [record.getMessage() for record in caplog.records]
    assert said == 'waiting for /collector to read all that was published'


@pytest.mark.slow
def test_a_program_on_plain_zenoh_that_answers_is_waited_for(joined):
    """By the question that topics.md gives; without it nobody would know of the program."""
    node, asked = Node('here'), []
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)

    def answer(query):
        asked.append(str(query.key_expr))
        time.sleep(0.3)
        query.reply(query.key_expr, b'')
        query.drop()

    with zenoh.open(session_config()) as plain:
        assert eventually(plain.info.routers_zid)
        domain = joined.settings['ROS_DOMAIN_ID']
        plain.declare_queryable(f'@mechanism_sim/{domain}/{plain.zid()}', answer)
        assert eventually(lambda: publisher.wait_for_all_acked() and asked)
        before = time.monotonic()
        assert publisher.wait_for_all_acked()
        assert time.monotonic() - before >= 0.3
    node.destroy_node()


@pytest.mark.slow
def test_a_publisher_that_ends_at_once_loses_nothing(either):
    collector = either.start(COLLECT, 3000, 300e-6)
    source = either.start("""
        import time
        from mechanism_sim.messages import Impact
        from mechanism_sim.nodes.middleware import *
        init()
        node = Node('source')
        publisher = node.create_publisher(
            Impact, 'impacts', QoSProfile(history=HistoryPolicy.KEEP_ALL)
        )
        while not node.count_subscribers('last'):
            time.sleep(0.001)
        for index in range(3000):
            publisher.publish(Impact(index=index, joint='x' * 1000))
        leave([node])
        print('done')
    """)
    source.expect('done')
    source.finish()
    assert collector.expect('got') == '3000 True'
    collector.finish()


@pytest.mark.slow
@pytest.mark.parametrize(
    ('router', 'starts'),
    [
        pytest.param('embedded', range(4), marks=pytest.mark.slow),
        pytest.param('third process', range(4), marks=pytest.mark.slow),
        ('third process', (0, 3)),
    ],
)
def test_who_sees_the_last_endpoint_reaches_every_earlier_one(joined, router, starts):
    if router == 'third process':
        shutdown()
        host = joined.start("""
            import zenoh
            from zenoh_rclpy import config
            router = zenoh.open(config.router_config())
            print('up')
            input()
        """)
        host.expect('up')
        init()
    for start in starts:
        node = Node('source')
        publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
        collector = joined.start(COLLECT, 100, 0)
        time.sleep(0.05 * start)
        assert eventually(lambda node=node: node.count_subscribers('last') == 1)
        for index in range(100):
            publisher.publish(Impact(index=index))
        assert collector.expect('got') == '100 True'
        collector.finish()
        assert eventually(lambda node=node: node.count_subscribers('last') == 0)
        node.destroy_node()


@pytest.mark.slow
def test_two_processes_that_flood_each_other_do_not_lock_up(either):
    script = """
        import sys, time
        from mechanism_sim.messages import Impact
        from mechanism_sim.nodes.middleware import *
        me, other = sys.argv[1:]
        init()
        node = Node(me)
        keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL)
        publisher = node.create_publisher(Impact, me, keep_all)
        got = []
        node.create_subscription(Impact, other, lambda m: got.append(m.index), keep_all)
        while not (publisher.get_subscription_count() and node.count_publishers(other)):
            time.sleep(0.001)
        for index in range(2000):  # far more than queues and sockets hold
            publisher.publish(Impact(index=index, joint='x' * 5000))
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while len(got) < 2000:
            executor.spin_once(1.0)
        print('got', got == list(range(2000)))
        leave([node])
    """
    pair = [either.start(script, *names) for names in (('a', 'b'), ('b', 'a'))]
    for process in pair:
        assert process.expect('got') == 'True'
        process.finish()


@pytest.mark.usefixtures('joined')
def test_a_node_may_publish_more_to_itself_than_its_queue_holds():
    node = Node('self')
    got = []
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
    node.create_subscription(Impact, 'impacts', lambda m: got.append(m.index), KEEP_ALL)
    for index in range(3 * LIMIT):
        publisher.publish(Impact(index=index))
    spin_until(node, lambda: len(got) == 3 * LIMIT)
    assert got == list(range(3 * LIMIT))


def test_a_late_subscriber_gets_what_lasts_and_nothing_else(joined):
    keeper = joined.start("""
        import time
        from mechanism_sim.messages import Impact
        from mechanism_sim.nodes.middleware import *
        init()
        node = Node('keeper')
        lasting = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publishers = [node.create_publisher(Impact, 'lasts', lasting)]
        publishers.append(node.create_publisher(Impact, 'passes', 10))
        for publisher in publishers:
            for index in range(5):
                publisher.publish(Impact(index=index))
        print('published')
        while input() == 'more':
            for publisher in publishers:
                while not publisher.get_subscription_count():
                    time.sleep(0.001)
                publisher.publish(Impact(index=5))
        shutdown()
    """)
    keeper.expect('published')
    node = Node('late')
    lasting, passing = [], []
    node.create_subscription(Impact, 'lasts', lambda m: lasting.append(m.index), LATCHED)
    node.create_subscription(Impact, 'passes', lambda m: passing.append(m.index), 10)
    spin_until(node, lambda: len(lasting) == 3)
    keeper.tell('more')
    spin_until(node, lambda: len(lasting) == 4 and passing)
    assert lasting == [2, 3, 4, 5]
    assert passing == [5]
    keeper.tell('end')
    keeper.finish()


@pytest.mark.usefixtures('joined')
def test_a_late_subscriber_of_the_same_process_gets_what_lasts():
    node = Node('both')
    publisher = node.create_publisher(Impact, 'lasts', LATCHED)
    for index in range(5):
        publisher.publish(Impact(index=index))
    got = []
    node.create_subscription(Impact, 'lasts', lambda m: got.append(m.index), LATCHED)
    publisher.publish(Impact(index=5))
    spin_until(node, lambda: got[-1:] == [5])
    assert got == [3, 4, 5]


def test_a_publisher_knows_whether_anybody_hears_it(joined):
    """Here, in another process, on plain Zenoh; what is kept is for who comes later."""
    node = Node('speaker')
    publisher = node.create_publisher(Impact, 'impacts', 10)
    assert node.create_publisher(Impact, 'lasts', LATCHED).is_heard()
    assert not publisher.is_heard()
    heard = node.create_subscription(Impact, 'impacts', lambda _: None, 10)
    assert publisher.is_heard()
    node.destroy_subscription(heard)
    assert not publisher.is_heard()
    other = joined.start(COLLECT, 1, 0.0)
    assert eventually(publisher.is_heard)
    publisher.publish(Impact(index=0))
    other.finish()
    assert eventually(lambda: not publisher.is_heard())
    plain = zenoh.open(session_config())
    plain.declare_subscriber('*/impacts/**', lambda _: None)
    assert eventually(publisher.is_heard)
    plain.close()


@pytest.mark.usefixtures('joined')
def test_several_threads_may_publish_at_once():
    node = Node('threads')
    got = []
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
    node.create_subscription(Impact, 'impacts', lambda m: got.append((m.joint, m.index)), KEEP_ALL)

    def publish(name):
        for index in range(500):
            publisher.publish(Impact(index=index, joint=name))

    threads = [threading.Thread(target=publish, args=name) for name in 'abcd']
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    spin_until(node, lambda: len(got) == 2000)
    for name in 'abcd':
        assert [index for joint, index in got if joint == name] == list(range(500))


@pytest.mark.usefixtures('joined')
def test_keep_last_keeps_the_last():
    node = Node('short')
    got = []
    publisher = node.create_publisher(Impact, 'impacts', 10)
    node.create_subscription(Impact, 'impacts', lambda m: got.append(m.index), 3)
    for index in range(10):
        publisher.publish(Impact(index=index))
    spin_until(node, lambda: len(got) == 3)
    assert got == [7, 8, 9]


@pytest.mark.parametrize('history', [HistoryPolicy.KEEP_LAST, HistoryPolicy.KEEP_ALL])
def test_a_program_that_begins_to_count_anew_is_heard(joined, history):
    """One on plain Zenoh, with a gid that stays; what comes twice is that of one time."""
    node, got = Node('here'), []
    node.create_subscription(
        Float64, 'speed', lambda m: got.append(m.data), QoSProfile(depth=10, history=history)
    )
    kind = 'std_msgs::msg::dds_::Float64_'
    key = f'{joined.settings["ROS_DOMAIN_ID"]}/speed/{kind}/{type_hash(type_name(Float64))}'
    sent = ((1, 100, 1.0), (2, 110, 2.0), (2, 110, 2.0), (1, 100, 1.0), (1, 200, 3.0),
            (1, 210, 4.0), (2, 205, 5.0), (3, 300, 6.0))  # fmt: skip
    with zenoh.open(session_config()) as plain:
        assert eventually(plain.info.routers_zid)
        publisher = plain.declare_publisher(key)
        assert eventually(lambda: publisher.matching_status.matching)
        for number, time_, value in sent:
            about = wire.pack_attachment(number, time_, bytes(16))
            publisher.put(serialize(Float64(data=value)), attachment=about)
        spin_until(node, lambda: 6.0 in got)
    assert got == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    node.destroy_node()


@pytest.mark.usefixtures('joined')
def test_callbacks_get_bytes_or_information_if_they_ask():
    node = Node('curious')
    raw, informed = [], []
    publisher = node.create_publisher(JointState, 'joint_states', 10)
    node.create_subscription(JointState, 'joint_states', raw.append, 10, raw=True)
    node.create_subscription(
        JointState, 'joint_states', lambda message, info: informed.append((message, info)), 10
    )
    message = JointState(name=['crank'], position=[0.5])
    before = time.time_ns()
    publisher.publish(message)
    publisher.publish(serialize(message))
    spin_until(node, lambda: len(raw) == len(informed) == 2)
    assert raw == [serialize(message)] * 2
    for number, (found, info) in enumerate(informed, start=1):
        assert found == message
        assert info['publication_sequence_number'] == number
        assert before <= info['source_timestamp'] <= info['received_timestamp']


@pytest.mark.slow
def test_a_service_gets_its_turn_amid_messages_that_never_end(either):
    """By how many messages come between, not by time: on a busy machine all takes longer."""
    process = either.start("""
        import time
        from mechanism_sim.messages import Impact, Trigger
        from mechanism_sim.nodes.middleware import *
        init()
        node, handled = Node('busy'), []
        publisher = node.create_publisher(
            Impact, 'again', QoSProfile(history=HistoryPolicy.KEEP_ALL)
        )
        def again(message):
            handled.append(message.index)
            time.sleep(0.002)
            publisher.publish(message)
        keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL)
        node.create_subscription(Impact, 'again', again, keep_all)
        node.create_timer(1e-6, lambda: None)
        node.create_service(Trigger, 'ask', lambda request, response: response)
        client = node.create_client(Trigger, 'ask')
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not client.service_is_ready():
            executor.spin_once(0.1)
        for index in range(20):
            publisher.publish(Impact(index=index))
        while len(handled) < 100:
            executor.spin_once(0.1)
        answer = client.call_async(Trigger.Request())
        while not answer.done() and len(handled) < 4000:
            executor.spin_once(0.1)
        print('answered', answer.done(), len(handled) - 100)
        shutdown()
    """)
    done, between = process.expect('answered').split()
    process.finish()
    assert done == 'True'
    assert int(between) < 200


@pytest.mark.usefixtures('joined')
def test_nodes_in_one_executor_run_in_the_order_of_arrival():
    order = []
    source = Node('source')
    sinks = [Node(name) for name in ('first', 'second')]
    publishers = {name: source.create_publisher(Impact, name, KEEP_ALL) for name in 'ab'}
    executor = SingleThreadedExecutor()
    for sink, topic in zip(sinks, 'ab', strict=True):
        sink.create_subscription(
            Impact, topic, lambda m, topic=topic: order.append((topic, m.index)), KEEP_ALL
        )
    executor.add_node(sinks[0])  # and the other when samples wait already
    sent = [(topic, index) for index in range(20) for topic in ('ab' if index % 2 else 'ba')]
    for topic, index in sent[:20]:
        publishers[topic].publish(Impact(index=index))
    executor.add_node(sinks[1])
    for topic, index in sent[20:]:
        publishers[topic].publish(Impact(index=index))
    while len(order) < 40:
        executor.spin_once(1.0)
    assert sorted(order) == sorted(sent)
    assert order[20:] == sent[20:] or order[-20:] == sent[20:]
    executor.shutdown()


@pytest.mark.usefixtures('joined')
def test_a_callback_may_end_the_process():
    node = Node('last')
    node.create_timer(0.0, shutdown)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()
    assert not ok()
    with pytest.raises(ExternalShutdownException):
        executor.spin_once(0.0)
    init()  # for the fixture


@pytest.mark.usefixtures('joined')
def test_an_executor_in_a_thread_ends_when_told():
    node = Node('threaded')
    got = []
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
    node.create_subscription(Impact, 'impacts', got.append, KEEP_ALL)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    publisher.publish(Impact())
    assert eventually(lambda: len(got) == 1)
    executor.shutdown()
    thread.join(10.0)
    assert not thread.is_alive()


@pytest.mark.usefixtures('joined')
def test_a_thread_sleeps_from_beat_to_beat_while_another_spins():
    """As in tutorials, whose imports are those of the modules of rclpy."""
    node, beats = zenoh_rclpy.Node('threaded'), []
    rate = node.create_rate(100.0)
    beat = rate.timer.execute
    rate.timer.execute = lambda: (beats.append(1), beat())
    executor = executors.SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        for k in range(5):
            rate.sleep()
            assert len(beats) > k
    finally:
        executor.shutdown()
        thread.join(10.0)
    assert node.destroy_rate(rate)
    with pytest.raises(zenoh_rclpy.ROSInterruptException):
        rate.sleep()
    with pytest.raises(ValueError, match='must be positive'):
        node.create_rate(0.0)
    rate, ends = node.create_rate(1e-3), []
    thread = threading.Thread(target=lambda: ends.append(executors.spin(node)))
    thread.start()
    assert eventually(lambda: node.executor is not None)
    shutdown()
    thread.join(10.0)
    assert ends == [None]
    with pytest.raises(zenoh_rclpy.ROSInterruptException):
        rate.sleep()
    with pytest.raises(executors.ExternalShutdownException):
        executors.spin_once(node)
    init()  # for the fixture


def test_the_graph_shows_who_is_there(joined):
    other = joined.start("""
        from mechanism_sim.messages import Impact, Trigger
        from mechanism_sim.nodes.middleware import *
        init()
        node = Node('other', namespace='ns')
        publisher = node.create_publisher(Impact, 'impacts', 7)
        node.create_subscription(Impact, '~/private', print, 10)
        node.create_service(Trigger, 'reset', lambda _, response: response)
        input()
        node.destroy_publisher(publisher)
        input()
        shutdown()
    """)
    node = Node('seer')
    assert eventually(
        lambda: ('/ns/reset', ['std_srvs/srv/Trigger']) in node.get_service_names_and_types()
    )
    assert ('other', '/ns') in node.get_node_names_and_namespaces()
    assert set(node.get_node_names()) == {'other', 'seer'}
    (info,) = node.get_publishers_info_by_topic('/ns/impacts')
    assert (info.node_name, info.node_namespace) == ('other', '/ns')
    assert info.topic_type == 'mechanism_sim/msg/Impact'
    assert info.qos_profile.depth == 7
    assert len(info.endpoint_gid) == 16
    assert node.count_subscribers('/ns/other/private') == 1
    assert ('/ns/impacts', ['mechanism_sim/msg/Impact']) in node.get_topic_names_and_types()
    other.tell()
    assert eventually(lambda: node.count_publishers('/ns/impacts') == 0)
    other.tell()
    assert eventually(lambda: node.get_node_names() == ['seer'])
    other.finish()


@pytest.mark.usefixtures('joined')
def test_what_is_destroyed_is_gone():
    node = Node('fleeting')
    got = []
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
    subscription = node.create_subscription(Impact, 'impacts', got.append, KEEP_ALL)
    assert publisher.get_subscription_count() == 1
    assert node.destroy_subscription(subscription)
    assert not node.destroy_subscription(subscription)
    publisher.publish(Impact())
    spin_once(node, timeout_sec=0.05)
    assert got == []
    assert publisher.get_subscription_count() == 0
    node.destroy_node()
    with pytest.raises(MiddlewareError, match='/impacts: not published'):
        publisher.publish(Impact())


@pytest.mark.slow
def test_a_process_that_does_not_answer_is_dropped_after_the_lease_it_announced(joined):
    joined.settings['ZENOH_CONFIG_OVERRIDE'] = 'transport/link/tx/lease=500'
    stopped = joined.start(COLLECT, 1, 0.0)
    node = Node('source')
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
    assert eventually(lambda: publisher.get_subscription_count() == 1)
    stopped.interrupt(signal.SIGSTOP)
    assert eventually(lambda: publisher.get_subscription_count() == 0)


def test_the_lease_is_the_documented_one():
    lease = int(session_config().get_json('transport/link/tx/lease')) // 1000
    page = (ROOT / 'docs' / 'ros2.md').read_text()
    assert f'| Zenoh (no ROS) | at the publisher, which waits | {lease} s;' in page
    assert int(router_config().get_json('transport/link/tx/lease')) // 1000 == lease


@pytest.mark.slow
def test_a_subscriber_that_is_killed_does_not_hold_up_its_publisher(joined):
    stalled: Process = joined.start("""
        import time
        from mechanism_sim.messages import Impact
        from mechanism_sim.nodes.middleware import *
        init()
        node = Node('stalled')
        keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL)
        node.create_subscription(Impact, 'impacts', lambda _: time.sleep(60), keep_all)
        spin(node)
    """)
    node = Node('source')
    publisher = node.create_publisher(Impact, 'impacts', KEEP_ALL)
    assert eventually(lambda: publisher.get_subscription_count() == 1)
    done = threading.Event()

    def flood():
        for index in range(8000):
            publisher.publish(Impact(index=index, joint='x' * 2000))
        done.set()

    threading.Thread(target=flood, daemon=True).start()
    assert not done.wait(1.0)  # were it not held up, it would be done by then
    stalled.kill()
    assert done.wait(PATIENCE)


@pytest.mark.slow
def test_a_wait_ends_when_its_time_is_over_between_two_looks():
    """In a process of its own: CPython 3.11's `SimpleQueue` would wait for ever."""
    waits = (
        'from zenoh_rclpy.inbox import Ready\n'
        'ready, ended = Ready(), 0\n'
        'for k in range(20_000):\n'
        '    ready.put(None)\n'
        '    ready.get()\n'
        '    try:\n'
        '        ready.get(timeout=(k % 40) * 1e-6)\n'
        '    except TimeoutError:\n'
        '        ended += 1\n'
        'print(ended)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', waits], capture_output=True, text=True, timeout=TIMEOUT, check=True
    )
    assert done.stdout == '20000\n'


def test_messages_and_bytes_are_published_together_and_never_written_out(either):
    """A motion of a megabyte as text, if only to be refused, takes longer than all else."""
    collector = either.start(COLLECT, 4, 0)
    source = either.start("""
        import time
        from mechanism_sim.messages import Impact, serialize
        from mechanism_sim.nodes.middleware import *
        def written(self):
            raise AssertionError('a message was written out')
        Impact.__repr__ = Impact.__str__ = written
        init()
        node = Node('source')
        publisher = node.create_publisher(
            Impact, 'impacts', QoSProfile(history=HistoryPolicy.KEEP_ALL)
        )
        while not node.count_subscribers('last'):
            time.sleep(0.001)
        first, *rest = (Impact(index=index) for index in range(4))
        publish_all(publisher, [first, serialize(rest[0]), *rest[1:]])
        leave([node])
        print('done')
    """)
    source.expect('done')
    source.finish()
    assert collector.expect('got') == '4 True'
    collector.finish()


SEND = """
    import sys, time
    from mechanism_sim.messages import Impact, serialize
    from mechanism_sim.nodes.middleware import *
    init()
    node = Node('source')
    publisher = node.create_publisher(
        Impact, 'impacts', QoSProfile(history=HistoryPolicy.KEEP_ALL)
    )
    while not publisher.get_subscription_count():
        time.sleep(0.001)
    good, bad = map(int, sys.argv[1:])
    for _ in range(bad):
        publisher.publish(b'no message')
    for index in range(good):
        publisher.publish(Impact(index=index))
    leave([node])
"""


def test_threads_of_the_network_keep_their_state_between_messages(joined, monkeypatch):
    """What Python makes anew for a thread with every call costs as much as a message."""
    made, states = set(), threading.local()
    take = Subscription._receive

    def receive(self, sample):
        if not hasattr(states, 'own'):
            states.own = object()
            made.add(states.own)  # kept, so that none takes the place of another
        take(self, sample)

    monkeypatch.setattr(Subscription, '_receive', receive)
    node, got = Node('here'), []
    node.create_subscription(Impact, 'impacts', lambda m: got.append(m.index), KEEP_ALL)
    source = joined.start(SEND, 300, 3)
    spin_until(node, lambda: len(got) == 300)
    assert got == list(range(300))
    assert 1 <= len(made) < 30
    source.finish()
    node.destroy_node()


def test_a_publisher_that_waits_goes_on_past_what_is_no_message(joined, capfd):
    """Bytes that are no message wait with the others, and are dropped when their turn comes."""
    node, got = Node('here'), []
    node.create_subscription(Impact, 'impacts', lambda m: got.append(m.index), KEEP_ALL)
    source = joined.start(SEND, 300, 3)
    source.finish()
    assert not got
    said = ['']
    spin_until(node, lambda: len(got) == 300)
    spin_until(node, lambda: 'dropped what came on /impacts' in _add(said, capfd.readouterr().err))
    assert got == list(range(300))
    node.destroy_node()


def test_who_spins_gets_its_turn_amid_what_is_no_message(joined):
    node = Node('here')
    subscription = node.create_subscription(Impact, 'impacts', lambda _: None, KEEP_ALL)
    source = joined.start(SEND, 0, 200)
    source.finish()
    assert eventually(lambda: len(subscription.inbox) == 200)
    for _ in range(3):
        spin_once(node, timeout_sec=0.0)
    assert len(subscription.inbox) > 150
    node.destroy_subscription(subscription)
    assert not len(subscription.inbox)
    node.destroy_node()


def _add(texts, more):
    texts[0] += more
    return texts[0]
