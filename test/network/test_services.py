"""Services, parameters, timers, clocks and logs."""

import time

import pytest
from middleware_network import PATIENCE, Network, eventually, spin_until

import zenoh_rclpy
from mechanism_sim.messages import (
    Clock,
    FloatingPointRange,
    GetParameters,
    IntegerRange,
    ListParameters,
    Log,
    ParameterDescriptor,
    ParameterEvent,
    ParameterValue,
    SetParameters,
    SetParametersResult,
    Trigger,
    message_class,
    seconds,
)
from mechanism_sim.messages import (
    Parameter as ParameterMessage,
)
from zenoh_rclpy import (
    Duration,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    MiddlewareError,
    Node,
    Parameter,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
    SingleThreadedExecutor,
    Time,
    init,
    shutdown,
    spin_once,
    spin_until_future_complete,
)


@pytest.fixture
def joined(monkeypatch):
    """This process on a network of its own."""
    network = Network()
    for name, value in network.settings.items():
        monkeypatch.setenv(name, value)
    init()
    yield network
    shutdown()
    network.close()


def test_a_service_of_another_process_answers(joined):
    server = joined.start("""
        from mechanism_sim.messages import Trigger
        from zenoh_rclpy import *
        init()
        node = Node('server')
        calls = []
        def answer(request, response):
            calls.append(request)
            response.success = True
            response.message = f'call {len(calls)}'
            return response
        node.create_service(Trigger, 'count', answer)
        print('up')
        try:
            spin(node)
        except ExternalShutdownException:
            shutdown()
    """)
    node = Node('asker')
    client = node.create_client(Trigger, 'count')
    assert not node.create_client(Trigger, 'nobody').wait_for_service(timeout_sec=0.05)
    assert client.wait_for_service(timeout_sec=PATIENCE)
    assert client.call(Trigger.Request(), timeout_sec=PATIENCE).message == 'call 1'
    future = client.call_async(Trigger.Request())
    heard = []
    future.add_done_callback(lambda future: heard.append(future.result().message))
    spin_until_future_complete(node, future, timeout_sec=PATIENCE)
    assert future.done()
    assert heard == ['call 2']
    server.interrupt(15)
    server.finish()
    assert eventually(lambda: not client.service_is_ready())
    with pytest.raises(MiddlewareError, match='/count did not answer'):
        client.call(Trigger.Request(), timeout_sec=PATIENCE)


@pytest.mark.usefixtures('joined')
def test_a_service_of_the_same_process_answers_and_a_call_gives_up():
    node = Node('both')
    node.create_service(Trigger, '~/reset', lambda _, response: response)
    client = node.create_client(Trigger, '/both/reset')
    with pytest.raises(TimeoutError, match='/both/reset'):
        client.call(Trigger.Request(), timeout_sec=0.05)  # nobody spins
    future = client.call_async(Trigger.Request())
    spin_until_future_complete(node, future, timeout_sec=PATIENCE)
    assert future.result() == Trigger.Response()


def test_parameters_are_read_and_set_from_another_process(joined):
    owner = joined.start("""
        from mechanism_sim.messages import SetParametersResult
        from zenoh_rclpy import *
        init()
        node = Node('owner', parameter_overrides=[Parameter('speed', value=3.0)])
        node.declare_parameter('speed', 1.0)
        node.declare_parameter('names', ['a', 'b'])
        node.declare_parameter('solver.rtol', 1e-9)
        def consent(parameters):
            slow = all(p.name != 'speed' or p.value < 100.0 for p in parameters)
            return SetParametersResult(successful=slow, reason='' if slow else 'too fast')
        node.add_on_set_parameters_callback(consent)
        print('up')
        try:
            spin(node)
        except ExternalShutdownException:
            print('speed', node.get_parameter('speed').value)
            shutdown()
    """)
    node = Node('asker')
    events = []
    node.create_subscription(
        ParameterEvent, '/parameter_events',
        lambda event: events.extend((event.node, p.name) for p in event.changed_parameters), 10,
    )  # fmt: skip

    def ask(service, name, **fields):
        client = node.create_client(service, f'/owner/{name}')
        assert client.wait_for_service(PATIENCE)
        return client.call(service.Request(**fields), timeout_sec=PATIENCE)

    owner.expect('up')
    found = ask(ListParameters, 'list_parameters').result
    assert found.names == ['use_sim_time', 'speed', 'names', 'solver.rtol']
    assert found.prefixes == ['solver']
    assert ask(ListParameters, 'list_parameters', prefixes=['solver']).result.names == [
        'solver.rtol'
    ]
    speed, names = ask(GetParameters, 'get_parameters', names=['speed', 'names']).values
    assert (speed.double_value, names.string_array_value) == (3.0, ['a', 'b'])
    assert ask(GetParameters, 'get_parameters', names=['speed', 'none']).values == []

    def assign(name, **value):
        return ParameterMessage(name=name, value=ParameterValue(**value))

    results = ask(
        SetParameters, 'set_parameters',
        parameters=[
            assign('speed', type=3, double_value=500.0),
            assign('speed', type=2, integer_value=5),
            assign('none', type=2, integer_value=5),
            assign('speed', type=3, double_value=5.0),
        ],
    ).results  # fmt: skip
    assert [result.successful for result in results] == [False, False, False, True]
    assert results[0].reason == 'too fast'
    assert 'INTEGER, not DOUBLE' in results[1].reason
    assert "no parameter 'none'" in results[2].reason
    spin_until(node, lambda: ('/owner', 'speed') in events)
    owner.interrupt(15)
    assert owner.expect('speed') == '5.0'
    owner.finish()


@pytest.mark.usefixtures('joined')
def test_parameters_keep_their_type_their_range_and_their_word():
    node = Node('owner', parameter_overrides=[Parameter('gain', value=2.0)])
    limits = ParameterDescriptor(
        floating_point_range=[FloatingPointRange(from_value=0.0, to_value=10.0)]
    )
    assert node.declare_parameter('gain', 1.0, limits).value == 2.0
    node.declare_parameter('fixed', 7, ParameterDescriptor(read_only=True))
    node.declare_parameter('any', None)
    refused = node.set_parameters(
        [Parameter('gain', value=11.0), Parameter('gain', value=1), Parameter('fixed', value=8)]
    )
    assert not any(result.successful for result in refused)
    assert 'outside [0.0, 10.0]' in refused[0].reason
    assert 'read-only' in refused[2].reason
    both = [Parameter('any', value='text'), Parameter('gain', value=-1.0)]
    assert not node.set_parameters_atomically(both).successful
    assert node.get_parameter('any').value is None
    assert node.set_parameters(both[:1])[0].successful
    assert node.get_parameter('any').value == 'text'
    assert not node.has_parameter('none')
    with pytest.raises(ParameterNotDeclaredException, match="no parameter 'none'"):
        node.get_parameter('none')
    with pytest.raises(ParameterAlreadyDeclaredException, match='gain'):
        node.declare_parameter('gain', 1.0)
    with pytest.raises(InvalidParameterValueException, match='outside'):
        node.declare_parameter('other', -1.0, limits)
    assert not node.has_parameter('other')
    node.add_on_set_parameters_callback(
        lambda _: SetParametersResult(successful=False, reason='no')
    )
    assert node.set_parameters([Parameter('gain', value=3.0)])[0].reason == 'no'


@pytest.mark.parametrize(
    'value',
    [True, 3, 0.5, 'text', [b'\x01'], [True, False], [1, 2], [0.5], ['a', 'b']],
)
def test_parameters_survive_the_trip(value):
    parameter = Parameter('name', value=value)
    again = Parameter.from_parameter_msg(parameter.to_parameter_msg())
    assert (again.name, again.type_, again.value) == ('name', parameter.type_, value)
    assert type(again.value) is type(value)


@pytest.mark.parametrize('value', [{}, [1, 'a'], object()])
def test_what_no_parameter_can_hold_is_refused(value):
    with pytest.raises(TypeError, match='cannot hold'):
        Parameter('name', value=value)


@pytest.mark.usefixtures('joined')
def test_timers_call_back_until_cancelled():
    node = Node('timed')
    calls = []
    began = time.monotonic()
    timer = node.create_timer(0.01, lambda: calls.append(time.monotonic()))
    spin_until(node, lambda: len(calls) == 5)
    assert calls[-1] - began >= 0.045
    timer.cancel()
    assert timer.is_canceled()
    spin_once(node, timeout_sec=0.05)
    assert len(calls) == 5
    timer.reset()
    assert timer.time_until_next_call() <= 10_000_000
    assert not timer.is_canceled()
    spin_until(node, lambda: len(calls) == 6)
    assert node.destroy_timer(timer)
    assert not node.destroy_timer(timer)


@pytest.mark.usefixtures('joined')
def test_a_timer_that_is_always_due_starves_nobody():
    node = Node('busy')
    calls, got = [], []
    node.create_timer(0.0, lambda: calls.append(1))
    publisher = node.create_publisher(Clock, 'ticks', 100)
    node.create_subscription(Clock, 'ticks', got.append, 100)
    for _ in range(50):
        publisher.publish(Clock())
    for _ in range(100):
        spin_once(node)
    assert len(got) == len(calls) == 50


@pytest.mark.usefixtures('joined')
def test_simulated_time_follows_the_clock():
    source, node = Node('source'), Node('node')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    wall = node.get_clock().now()
    assert abs(wall.nanoseconds - time.time_ns()) < 10_000_000_000
    assert node.set_parameters([Parameter('use_sim_time', value=True)])[0].successful
    assert node.get_clock().now() == Time()
    calls = []
    node.create_timer(0.5, lambda: calls.append(node.get_clock().now().nanoseconds / 1e9))
    publisher = source.create_publisher(Clock, '/clock', 10)
    for tick in range(1, 26):
        publisher.publish(Clock(clock=Time(seconds=tick / 10).to_msg()))
        executor.spin_once(1.0)
        executor.spin_once(0.0)
    assert calls == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert seconds(node.get_clock().now().to_msg()) == 2.5
    node.set_parameters([Parameter('use_sim_time', value=False)])
    assert node.get_clock().now() > wall
    executor.shutdown()


def test_times_and_durations():
    assert Time(seconds=1.5) + Duration(seconds=0.25) == Time(nanoseconds=1_750_000_000)
    assert Time(seconds=2) - Time(seconds=1.5) == Duration(seconds=0.5)
    assert Time.from_msg(Time(seconds=3, nanoseconds=7).to_msg()).seconds_nanoseconds() == (3, 7)
    assert Time(seconds=1) < Time(seconds=2)
    assert Time(seconds=1.7e9, nanoseconds=1).nanoseconds == 1_700_000_000_000_000_001
    assert type(Time().to_msg()) is message_class('builtin_interfaces/msg/Time')


@pytest.mark.usefixtures('joined')
def test_logs_go_to_standard_error_and_to_rosout(capfd):
    node = Node('talker', namespace='ns')
    heard = []
    node.create_subscription(Log, '/rosout', lambda log: heard.append((log.name, log.msg)), 10)
    logger = node.get_logger()
    logger.debug('unheard')
    for number in range(3):
        logger.warning('careful', once=True)
        logger.info('again' + number * '!', throttle_duration_sec=100.0)
    spin_until(node, lambda: len(heard) == 2)
    assert heard == [('ns.talker', 'careful'), ('ns.talker', 'again')]
    lines = capfd.readouterr().err.splitlines()
    assert [line.split('] ')[0] for line in lines] == ['[WARN', '[INFO']
    assert lines[0].endswith('[ns.talker]: careful')


@pytest.mark.usefixtures('joined')
def test_timers_start_over_when_simulated_time_is_set_back():
    node = Node('node', parameter_overrides=[Parameter('use_sim_time', value=True)])
    source = Node('source')
    publisher = source.create_publisher(Clock, '/clock', 10)
    calls, wall = [], []
    timer = node.create_timer(0.5, lambda: calls.append(node.get_clock().now().nanoseconds / 1e9))
    node.create_timer(0.01, lambda: wall.append(1), clock=zenoh_rclpy.Clock())
    assert node.get_clock().ros_time_is_active

    def show(time):
        publisher.publish(Clock(clock=Time(seconds=time).to_msg()))
        spin_until(node, lambda: node.get_clock().now() == Time(seconds=time))
        for _ in range(3):
            spin_once(node, timeout_sec=0.0)

    for tick in (10.0, 10.2, 10.5, 0.0, 0.4, 0.6, 5.7, 5.9, 6.0):
        show(tick)
    # The four periods that a leap of the clock skips are left out.
    assert calls == [10.0, 10.5, 0.6, 5.7, 6.0]
    assert timer.time_since_last_call() == 0
    assert timer.time_until_next_call() == timer.timer_period_ns == 500_000_000
    spin_until(node, lambda: wall)


@pytest.mark.usefixtures('joined')
def test_ranges_have_steps_and_reasons():
    node = Node('owner')
    gain = ParameterDescriptor(
        floating_point_range=[FloatingPointRange(from_value=10.0, to_value=0.0, step=0.1)],
        additional_constraints='tenths only',
    )
    count = ParameterDescriptor(integer_range=[IntegerRange(from_value=1, to_value=10, step=4)])
    node.declare_parameter('gain', 0.3, gain)
    node.declare_parameter('count', 5, count)

    def reason(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0].reason

    assert [reason('gain', value) for value in (0.7, 10.0, 0.0, 10.000001)] == [''] * 4
    assert reason('gain', 0.75) == 'gain=0.75 is no step of 0.1 from 0.0 on; tenths only'
    assert reason('gain', 10.1) == 'gain=10.1 is outside [0.0, 10.0]; tenths only'
    assert 'outside' in reason('gain', float('nan'))
    assert [reason('count', value) for value in (1, 9, 10)] == [''] * 3
    assert reason('count', 8) == 'count=8 is no step of 4 from 1 on'


@pytest.mark.usefixtures('joined')
def test_parameters_as_rclpy_has_them():
    node = Node('owner', parameter_overrides=[Parameter('a.size', value=3)])
    told, heard = [], []
    node.create_subscription(ParameterEvent, '/parameter_events', heard.append, 100)
    node.add_post_set_parameters_callback(lambda changed: told.append([p.name for p in changed]))
    declared = node.declare_parameters(
        'a', [('size', 1), ('kind', Parameter.Type.STRING), ('any',)]
    )
    assert [p.value for p in declared] == [3, None, None]
    assert told == [['a.size'], ['a.kind'], ['a.any']]
    assert node.declare_parameter('b', 1, None, ignore_override=True).value == 1
    with pytest.raises(ParameterUninitializedException, match=r'a\.kind was given no value'):
        node.get_parameter('a.kind')
    assert node.get_parameter_or('a.kind', Parameter('x', value=7)).value == 7
    assert node.get_parameter_or('none').value is None
    assert list(node.get_parameters_by_prefix('a')) == ['size', 'kind', 'any']
    assert node.get_parameter_types(['a.size', 'a.kind']) == [2, 0]
    assert node.describe_parameter('a.kind').type == Parameter.Type.STRING
    assert node.list_parameters(['a'], 1).names == ['a.size', 'a.kind', 'a.any']
    assert node.list_parameters([], 1).names == ['use_sim_time', 'b']
    with pytest.raises(ParameterNotDeclaredException, match="no parameter 'none'"):
        node.set_parameters([Parameter('b', value=2), Parameter('none', value=2)])
    assert node.get_parameter('b').value == 2
    with pytest.raises(InvalidParameterTypeException, match='INTEGER, not DOUBLE'):
        Node('two', parameter_overrides=[Parameter('x', value=1)]).declare_parameter('x', 1.0)
    with pytest.raises(ValueError, match='neither a type nor a default'):
        node.declare_parameter('c', None, ParameterDescriptor())
    both = [Parameter('a.kind', value='s'), Parameter('a.any', value=1)]
    assert node.set_parameters_atomically(both).successful
    assert not node.set_parameters([Parameter('a.kind')])[0].successful
    assert node.set_parameters([Parameter('a.any')])[0].successful  # unset: gone
    assert not node.has_parameter('a.any')
    spin_until(node, lambda: heard and heard[-1].deleted_parameters)
    events = [
        [[p.name for p in names] for names in (e.new_parameters, e.changed_parameters)]
        for e in heard
        if e.node == '/owner'
    ]
    assert events[-3:] == [[[], ['b']], [['a.kind', 'a.any'], []], [[], []]]

    def halve(parameters):
        return [Parameter(p.name, value=p.value // 2) for p in parameters]

    node.add_pre_set_parameters_callback(halve)
    assert node.set_parameters([Parameter('b', value=8)])[0].successful
    assert node.get_parameter('b').value == 4
    node.remove_pre_set_parameters_callback(halve)
    node.add_pre_set_parameters_callback(lambda _: [])
    assert 'No parameter is left' in node.set_parameters([Parameter('b', value=8)])[0].reason
    node.undeclare_parameter('b')
    assert not node.has_parameter('b')
    node.declare_parameter('fixed', 1, ParameterDescriptor(read_only=True))
    with pytest.raises(ParameterImmutableException, match='fixed is read-only'):
        node.undeclare_parameter('fixed')
