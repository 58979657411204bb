"""Commands that list, echo, publish and call without ROS, beside a machine that runs.

Every block of docs/control.md is typed by `test_blocks.py`; here the same is done by the node of
these commands, in one process, against a run in another.
"""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
from array import array
from contextlib import nullcontext
from types import SimpleNamespace

import pytest
from middleware_network import eventually
from running import TIMEOUT, environment, run, start

from mechanism_sim.messages import MessageError, message_class, service_class
from mechanism_sim.nodes.player import player
from mechanism_sim.recording.reader import read_bag
from ros_interfaces.names import InvalidNameError
from ros_interfaces.plain import field, from_plain, to_plain
from zenoh_rclpy import command_node as commanding
from zenoh_rclpy.command_node import CommandNode, UsageError, command_node
from zenoh_rclpy.commands import _info, _param_dump, _print, _values, main
from zenoh_rclpy.errors import MiddlewareError
from zenoh_rclpy.node import Node
from zenoh_rclpy.parameter_files import read_parameters, write_parameters
from zenoh_rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

PACKAGE, FLOAT = 'simulation_interfaces', 'std_msgs/msg/Float64'


@pytest.fixture
def network(monkeypatch):
    """A router and a domain that nobody else uses."""
    env = environment()
    for name in ('MECHANISM_SIM_MIDDLEWARE', 'MECHANISM_SIM_ROUTER', 'ROS_DOMAIN_ID'):
        monkeypatch.setenv(name, env[name])
    return env


def test_who_asks_for_more_than_is_offered_is_told(capsys):
    """Over Zenoh all of it comes, and after a change to DDS nothing."""

    def end(name, **policies):
        return SimpleNamespace(
            node_name=name, node_namespace='/', qos_profile=QoSProfile(**policies)
        )

    weak, late = ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.TRANSIENT_LOCAL
    publishers = [end('camera', reliability=weak), end('map', durability=late)]
    hearers = [end('log'), end('late', durability=late), end('ear', reliability=weak)]
    found = SimpleNamespace(name='/x', types=[], publishers=publishers, subscriptions=hearers)
    node = SimpleNamespace(endpoints=lambda _: found)
    rest = 'than /camera offers: over DDS it hears nothing'
    expected = [
        f'/log asks for more reliability {rest}',
        f'/late asks for more reliability and durability {rest}',
    ]
    _info(node, SimpleNamespace(topic='/x', verbose=False, json=False))
    assert capsys.readouterr().out.splitlines()[3:] == [f'  {said}' for said in expected]
    _info(node, SimpleNamespace(topic='/x', verbose=False, json=True))
    assert json.loads(capsys.readouterr().out)['unfit'] == expected


def test_a_paused_run_is_inspected_stepped_set_and_ended(network, tmp_path, capsys):
    bag = tmp_path / 'run.mcap'
    running = start(
        'run', 'four_bar_clearance', '--paused', '--hold', '--duration', '1', '--record', str(bag),
        env=network,
    )  # fmt: skip
    try:
        with command_node(60.0) as node:
            kind = f'{PACKAGE}/srv/StepSimulation'
            assert node.call('step_simulation', kind, {'steps': 20}).result.result == 1
            topics = dict(node.topics())
            assert topics['/impacts'] == ['mechanism_sim/msg/Impact']
            assert not any('_action' in name for name in topics)
            assert {'/crank_drive', '/linkage', '/recorder'} <= set(node.nodes())
            _info(node, SimpleNamespace(topic='/scene', verbose=True, json=True))
            (by,) = json.loads(capsys.readouterr().out)['publishers']
            assert by == '/linkage (reliable, transient_local, keep_last 1)'
            assert node.actions() == ['/simulate_steps']
            assert '/step_simulation' in dict(node.services())
            drive = node.endpoints('drive')
            assert [i.node_name for i in drive.publishers] == ['crank_drive']
            assert 'linkage' in {i.node_name for i in drive.subscriptions}
            linkage = {kind: dict(known) for kind, known in node.of_node('linkage').items()}
            assert linkage['publishers']['/motion'] == ['mechanism_sim/msg/Motion']
            assert [*linkage['subscriptions']] == ['/drive', '/progress']
            assert '/linkage/get_parameters' in linkage['services']
            assert '/step_simulation' not in linkage['services']
            clients = dict(node.of_node('crank_drive')['clients'])
            assert '/linkage/set_parameters_atomically' in clients

            assert 'step_size' in node.parameter_names('/crank_drive')
            assert node.parameter('crank_drive', 'step_size') == 0.001
            node.set_parameter('crank_drive', 'realtime_factor', 2)  # a whole number is good
            assert node.parameter('crank_drive', 'realtime_factor') == 2.0
            assert node.describe('crank_drive', 'realtime_factor').floating_point_range
            names = node.parameter_names('crank_drive')
            values = node.parameters('crank_drive', names)
            assert (values['realtime_factor'], values['hold']) == (2.0, True)
            file = tmp_path / 'drive.yaml'
            file.write_text(write_parameters('/crank_drive', values))
            assert dict(read_parameters(str(file))) == {'/crank_drive': values}
            with pytest.raises(MiddlewareError, match=r'outside \[0.0, 1.0\]'):
                node.set_parameter('linkage', 'joints.coupler_rocker.clearance.restitution', 3.0)
            with pytest.raises(UsageError, match="did you mean 'step_size'"):
                node.parameter('crank_drive', 'step_siz')

            meanwhile: list[int] = []
            done = node.send_goal(
                'simulate_steps', f'{PACKAGE}/action/SimulateSteps', {'steps': 3},
                lambda m: meanwhile.append(int(m.completed_steps)),
            )  # fmt: skip
            assert (done.status, meanwhile) == (4, [1, 2, 3])

            seen: list[float] = []
            node.listen('/scene', lambda m: bool(seen.append(m.data)) or True)  # latched
            assert 'coupler_rocker' in seen[0]
            again: list[float] = []
            assert node.call('set_simulation_state', None, {'state': {'state': 1}}).result.result
            node.listen('/joint_states', lambda m: len(again.append(m.position[0]) or again) == 3)
            assert again == sorted(again)
            assert again[0] > 23e-3 * 300 * math.pi / 30
            node.allow(0.5)
            with pytest.raises(UsageError, match="did you mean '/joint_states'"):
                node.endpoints('joint_stats')
            for ask in (node.parameter_names, node.of_node):
                node.allow(0.5)
                with pytest.raises(UsageError, match="did you mean '/crank_drive'"):
                    ask('/crank_driv')
            with pytest.raises(MessageError, match="no field 'stat'; it has state"):
                node.call('set_simulation_state', None, {'state': {'stat': 1}})
            said = '^/impacts is of the type mechanism_sim/msg/Impact, not std_msgs/msg/Float64$'
            with pytest.raises(UsageError, match=said):
                node.listen('/impacts', lambda _: True, FLOAT)
            with pytest.raises(UsageError, match=said):
                node.publish('/impacts', FLOAT, None, 1, 1.0, lambda: None)
            with pytest.raises(InvalidNameError):
                node.publish('bad name', FLOAT, None, 1, 1.0, lambda: None)
            node.call('set_simulation_state', None, {'state': {'state': 3}})
        assert running.wait(TIMEOUT) == 0
        assert read_bag(bag).complete
    finally:
        running.kill()
        running.communicate()


@pytest.mark.slow
def test_a_bag_is_replayed_as_its_nodes_published_it(network, tmp_path):
    bag = tmp_path / 'run.mcap'
    done = run(
        'run', 'four_bar_clearance', '--revolutions', '3', '--record', str(bag), env=network
    )
    assert done.returncode == 0, done.stderr
    recorded = [m for _, m, _ in read_bag(bag).messages('/impacts')]
    assert len(recorded) > 20
    words = ['topic', 'echo', '/impacts', 'mechanism_sim/msg/Impact', '--json', '--count']
    listener = subprocess.Popen(
        [sys.executable, '-m', 'zenoh_rclpy', *words, str(len(recorded))],
        env=network, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        with player() as node:
            find = node._node.get_subscriptions_info_by_topic
            assert eventually(lambda: bool(find('/impacts')))
            count = node.play(read_bag(bag), ['/impacts', '/scene'], rate=0.0)
            assert count == len(recorded) + 1
            texts, errors = listener.communicate(timeout=TIMEOUT)
    finally:
        listener.kill()
    heard = [json.loads(line) for line in texts.splitlines()]
    assert errors == ''
    assert [m['normal_impulse'] for m in heard] == [m.normal_impulse for m in recorded]


@pytest.mark.slow
def test_a_bag_is_not_played_into_a_run(network, tmp_path):
    bag = tmp_path / 'run.mcap'
    done = run('run', 'four_bar_clearance', '--duration', '0.1', '--record', str(bag), env=network)
    assert done.returncode == 0, done.stderr
    running = start(
        'run', 'four_bar_clearance', '--paused', '--hold', '--duration', '0.1', env=network
    )
    try:
        with command_node(60.0) as node:
            for topic in ('progress', 'motion'):
                assert eventually(lambda topic=topic: bool(node.endpoints(topic).publishers))
        done = run('bag', 'play', str(bag), '--rate', '0', refused=True)
        assert (done.returncode, done.stderr.count('\n')) == (2, 1), done.stderr
        assert 'cannot be played: ' in done.stderr
        assert 'ROS_DOMAIN_ID=1' in done.stderr
        done = run('bag', 'play', str(bag), '--rate', '0', '--topics', '/progress', refused=True)
        assert (done.returncode, '/progress cannot be played' in done.stderr) == (2, True)
    finally:
        running.kill()
        running.communicate()


def test_messages_are_written_and_read_as_plain_data():
    kind = message_class('sensor_msgs/msg/JointState')
    given = {'header': {'stamp': {'sec': 3}}, 'name': ['a'], 'position': [1, 2.5]}
    message = from_plain(kind, given)
    assert message.header.stamp.sec == 3
    plain = to_plain(message)
    assert plain['position'] == [1.0, 2.5]
    assert all(type(x) is float for x in plain['position'])
    assert plain['velocity'] == []
    assert field(message, 'position.1') == 2.5
    assert to_plain(message, 1)['position'] == [1.0, '...']
    again = from_plain(kind, plain)
    assert to_plain(again) == plain
    request = service_class('rcl_interfaces/srv/SetParameters').Request
    one = {'parameters': [{'name': 'x', 'value': {'type': 3, 'double_value': 2}}]}
    assert from_plain(request, one).parameters[0].value.double_value == 2.0


@pytest.mark.parametrize(
    ('values', 'said'),
    [
        ({'positon': [1]}, "has no field 'positon'; it has header, name, position"),
        ({'position': 3}, 'is no list'),
        ({'position': ['a']}, 'is no float64'),
        ({'header': 3}, 'is no message'),
        ({'header': {'stamp': {'sec': 2.5}}}, 'no whole number'),
        ({'header': {'stamp': {'nanosec': -1}}}, 'from 0 to'),
        ([1], 'is no message'),
    ],
)
def test_values_that_do_not_fit_are_refused(values, said):
    with pytest.raises(MessageError, match=said):
        from_plain(message_class('sensor_msgs/msg/JointState'), values)


@pytest.mark.parametrize(
    ('args', 'said'),
    [
        (('topic', 'lst'), "'lst' (choose from"),
        (('topic', 'echo'), 'topic echo: the following arguments are required: TOPIC'),
        (('topic', 'echo', '/x', '--count', '0'), '--count'),
        (('topic', 'hz', '/x', '--window', '1'), "--window: '1' is not a number from 2 on"),
        (('topic', 'echo', '/x', '--count', '3', '--once'), '--once: not allowed with'),
        (('topic', 'list', '--count', '3'), 'unrecognized arguments: --count 3'),
        (('topic', 'echo', '/a', '--rate', '3'), 'unrecognized arguments: --rate 3'),
        (('topic', 'pub', '/a', 'std_msgs/msg/String', '--once', '--count', '2'), '--count'),
        (('service', 'call', '/x', '--types'), 'unrecognized arguments: --types'),
        (('action', 'list', '-f'), 'unrecognized arguments: -f'),
        (('param', 'set', 'a', 'b'), 'required: VALUE'),
        (('service', 'call', 'a', '--timeout', '0'), "--timeout: '0' is no positive number"),
        (('service', 'call', 'a', '{steps: ', '--json'), "'{steps: ': no YAML"),
        (('topic', 'pub', '/a', 'std_msgs/Float64'), "did you mean 'std_msgs/msg/Float64'?"),
        (('topic', 'echo', '/a', 'arm/msg/Angle'), "the type 'arm/msg/Angle' is unknown; def"),
        (('topic', 'pub', '/a', 'Float'), 'types are written as std_msgs/msg/String'),
        ((), 'required: GROUP'),
    ],
)
@pytest.mark.usefixtures('network')
def test_command_lines_that_make_no_sense_are_refused(args, said, capsys):
    assert main(list(args)) == 2
    out, err = capsys.readouterr()
    assert err.startswith('zros: ')
    assert said in err
    assert len(err.splitlines()) == 1
    assert ('"code": 2' in out) == ('--json' in args)


def test_what_is_not_there_is_said_in_one_sentence(network):
    words = ['topic', 'echo', '/impacts', '--timeout', '0.2', '--json']
    done = subprocess.run(
        [sys.executable, '-m', 'zenoh_rclpy', *words], env=network, capture_output=True, text=True,
        timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == "zros: there is no topic '/impacts'\n"
    assert json.loads(done.stdout) == {'error': "there is no topic '/impacts'", 'code': 2}


@pytest.mark.parametrize('more', [[], ['--json']])
@pytest.mark.usefixtures('network')
def test_what_nobody_hears_is_not_published(more, capsys):
    words = ['topic', 'pub', '--once', '/x', FLOAT, '--timeout', '0.2', *more]
    assert main(words) == 1
    out, err = capsys.readouterr()
    assert err == 'zros: nobody subscribes to /x\n'
    assert bool(out) == bool(more)


@pytest.mark.parametrize('more', [[], ['--once'], ['--count', '3']])
@pytest.mark.usefixtures('network')
def test_messages_of_nobody_are_waited_for_as_long_as_is_said(more, capsys):
    assert main(['topic', 'echo', '/x', FLOAT, '--timeout', '0.2', *more]) == 1
    said = 'zros: no message came on /x in 0.2 s: nobody publishes there\n'
    assert capsys.readouterr() == ('', said)


@pytest.mark.parametrize('words', [['echo', '/x'], ['echo', '/x', '--once'], ['hz', '/x']])
def test_messages_have_an_end_only_if_one_is_given(words, monkeypatch):
    """As in ``ros2``: who listens to a machine that stands still may sit and wait."""
    asked = []

    def hear(*given):
        asked.append(given[-1])
        raise KeyboardInterrupt

    node = nullcontext(SimpleNamespace(listen=hear, arrivals=hear))
    monkeypatch.setattr('zenoh_rclpy.command_node.command_node', lambda _: node)
    for more in ([], ['--timeout', '3']):
        assert main(['topic', *words, *more]) == 130
    assert asked == [0, 2 if words[0] == 'hz' else 1]


@pytest.mark.parametrize(
    ('more', 'said'), [([], 'published on /x\n'), (['--json'], '{"published": "/x"}\n')]
)
def test_what_is_published_is_said(more, said, monkeypatch, capsys):
    node = nullcontext(SimpleNamespace(publish=lambda *given: given[-1]()))
    monkeypatch.setattr('zenoh_rclpy.command_node.command_node', lambda _: node)
    assert main(['topic', 'pub', '--once', '/x', FLOAT, *more]) == 0
    assert capsys.readouterr() == (said, '')


def test_umlauts_are_written_out_where_there_are_none(network):
    """In YAML, which has them as they are."""
    code = (
        'import zenoh_rclpy.commands as commands, zenoh_rclpy.__main__ as program;'
        'commands._run = lambda given: (print("\xfc"), (0, ""))[1]; program.main()'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], env=network | {'PYTHONIOENCODING': 'ascii'},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, '\\xfc\n', '')


@pytest.mark.parametrize(
    'ask',
    [
        lambda node: node.set_parameter('/m1/linkage', 'joints.x', 0.3),
        lambda node: node.call('/nothing', None, {}),
        lambda node: node.call('/nothing', 'std_srvs/srv/Trigger', {}),
        lambda node: node.send_goal('/nothing', f'{PACKAGE}/action/SimulateSteps', {}, None),
        lambda node: node.endpoints('/nothing'),
        lambda node: node.publish('/comand', FLOAT, None, 1, 1.0, lambda: None),
        lambda node: node.listen('/comand', lambda _: True, FLOAT, wanted=1),
        lambda node: node.arrivals('/comand', [], lambda: False, wanted=2),
        lambda node: node.of_node('/nothing'),
    ],
)
def test_a_command_waits_in_all_as_long_as_it_may(ask, monkeypatch):
    """For what is not there, whatever it looks for one after the other."""
    clock = SimpleNamespace(now=0.0, monotonic=lambda: clock.now)

    def wait(seconds):
        clock.now += seconds
        return False

    clock.sleep = wait
    nothing = SimpleNamespace(
        get_topic_names_and_types=lambda: [('/comand', [FLOAT]), ('/command', [FLOAT])],
        get_service_names_and_types=list, get_node_names=list,
        get_node_names_and_namespaces=list,
        create_client=lambda *_: SimpleNamespace(service_is_ready=lambda: False),
        create_publisher=lambda *_: SimpleNamespace(get_subscription_count=lambda: 0),
        count_subscribers=lambda name: name == '/command',
        count_publishers=lambda name: name == '/command',
        get_publishers_info_by_topic=lambda _: [], get_subscriptions_info_by_topic=lambda _: [],
        create_subscription=lambda *_, **__: None, destroy_subscription=lambda _: None,
    )  # fmt: skip
    monkeypatch.setattr(commanding, 'time', clock)
    monkeypatch.setattr(commanding, 'Node', lambda *_, **__: nothing)
    monkeypatch.setattr(commanding, 'spin_once', lambda _, timeout_sec: wait(timeout_sec))
    monkeypatch.setattr(
        commanding, 'ActionClient', lambda *_: SimpleNamespace(wait_for_server=wait)
    )
    said = "there is no|^(nobody subscribes|no message came) .*; did you mean '/command'"
    with pytest.raises((UsageError, MiddlewareError), match=said):
        ask(CommandNode(10.0))
    assert 10.0 <= clock.now < 10.1


def test_an_answer_that_does_not_come_ends_a_command_that_has_a_timeout(monkeypatch):
    clock = SimpleNamespace(now=0.0, monotonic=lambda: clock.now)
    monkeypatch.setattr(commanding, 'time', clock)
    monkeypatch.setattr(commanding, 'Node', lambda *_, **__: None)

    def spin(*_, **__):
        clock.now += 4.0

    monkeypatch.setattr(commanding, 'spin_until_future_complete', spin)
    late = SimpleNamespace(done=lambda: clock.now > 30.0, result=lambda: 'late')
    assert CommandNode(10.0)._answer(late, '/x') == 'late'
    clock.now = 0.0
    node = CommandNode(10.0)
    node.bounded = True
    with pytest.raises(MiddlewareError, match='/x has not answered in 10 s'):
        node._answer(late, '/x')
    assert clock.now == 12.0


def test_messages_that_come_in_part_are_counted(monkeypatch):
    clock = SimpleNamespace(now=0.0, monotonic=lambda: clock.now)
    there = SimpleNamespace(
        get_publishers_info_by_topic=lambda _: [], count_publishers=lambda _: 1,
        create_subscription=lambda *given: setattr(there, 'take', given[2]),
        destroy_subscription=lambda _: None,
    )  # fmt: skip

    def spin_once(node, **_):
        clock.now += 4.0
        if clock.now < 5.0:
            node.take('message')

    monkeypatch.setattr(commanding, 'time', clock)
    monkeypatch.setattr(commanding, 'Node', lambda *_, **__: there)
    monkeypatch.setattr(commanding, 'spin_once', spin_once)
    with pytest.raises(MiddlewareError, match=r'^1 of 3 messages came on /x in 10 s$'):
        CommandNode(10.0).listen('/x', lambda _: False, FLOAT, wanted=3)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ('verb', 'end', 'said'),
    [('echo', 'subscriptions', ''), ('pub', 'publishers', 'published on /nothing\n')],
)
def test_a_signal_ends_a_command_in_one_sentence(network, number, verb, end, said):
    words = [
        'topic',
        verb,
        '/nothing',
        'std_msgs/msg/String',
        *(['--rate', '0.01'] if said else []),
    ]
    with command_node(60.0) as node:
        listener = subprocess.Popen(
            [sys.executable, '-m', 'zenoh_rclpy', *words], env=network,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            find = getattr(node.node, f'get_{end}_info_by_topic')
            assert eventually(lambda: bool(find('/nothing')))
            assert not said or listener.stdout.readline() == said
            listener.send_signal(number)
            assert listener.communicate(timeout=TIMEOUT) == ('', 'zros: interrupted\n')
        finally:
            listener.kill()
            listener.communicate()
    assert listener.returncode == 130


@pytest.mark.parametrize(('window', 'last'), [('10000', 26), ('5', 5)])
@pytest.mark.parametrize('more', [[], ['--json']])
@pytest.mark.parametrize(
    ('verb', 'rate', 'said'),
    [('hz', 10.0, '10.000 messages a second'), ('bw', 120.0, '120 bytes a second')],
)
def test_a_rate_is_printed_each_second_and_kept_at_a_signal(
    verb, rate, said, window, last, more, monkeypatch, capsys
):
    clock = SimpleNamespace(now=0.0, monotonic=lambda: clock.now)

    def come(_topic, arrivals, over, _wanted):
        for k in range(26):  # ten a second
            clock.now = 0.1 * k + 0.05
            arrivals.append((clock.now, 12))
            assert not over()
        raise KeyboardInterrupt

    node = nullcontext(SimpleNamespace(arrivals=come))
    monkeypatch.setattr('zenoh_rclpy.commands.time', clock)
    monkeypatch.setattr('zenoh_rclpy.command_node.command_node', lambda _: node)
    assert main(['topic', verb, '/x', '--window', window, *more]) == 130
    out, err = capsys.readouterr()
    assert err == 'zros: interrupted\n'
    if more:
        figures = json.loads(out)
        assert (figures['rate'], figures['messages']) == (pytest.approx(rate), last)
        return
    lines = out.splitlines()
    assert len(lines) == 3  # after one second and two, and at the end
    assert all(line.startswith(said) for line in lines)
    assert lines[-1].endswith(f'of {last} messages')


FULL = 'the output cannot be written: No space left on device'


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('words', 'code', 'said'),
    [
        ('service list --json', 1, FULL),
        ('--help', 1, FULL),
        ('topic info /x --timeout 0.1 --json', 2, "there is no topic '/x'"),
    ],
)
def test_an_output_that_is_full_is_said(network, words, code, said):
    with open('/dev/full', 'w') as full:
        done = subprocess.run(
            [sys.executable, '-m', 'zenoh_rclpy', *words.split()],
            env=network | {'PYTHONUNBUFFERED': ''}, stdout=full,
            stderr=subprocess.PIPE, text=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (code, f'zros: {said}\n')


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ('--rate -1', '--rate -1: from 0 to 1e+09'),
        ('--rate nan', '--rate nan: from 0 to 1e+09'),
        ('--delay -1', '--delay -1: from 0 to 1e+09'),
        ('--delay 1e10', '--delay 1e+10: from 0 to 1e+09'),
        ('--delay inf', "bag play: --delay: 'inf' is not a number with a unit"),
        ('--delay 1e300', "bag play: --delay: '1e300' is out of bounds"),
    ],
)
def test_a_bag_is_played_neither_backwards_nor_never(words, said):
    done = run('bag', 'play', 'x.mcap', *words.split(), refused=True)
    assert done.returncode == 2
    assert done.stderr.startswith(f'mechanism-sim: {said}')


@pytest.mark.parametrize(
    ('rate', 'times'), [(10.0, [0.0, 0.1, 0.2, 0.7, 0.8]), (1e-320, [0.0, 1e9, 2e9, 3e9, 4e9])]
)
def test_messages_come_at_the_rate_asked_for_whatever_publishing_takes(rate, times, monkeypatch):
    """It takes 30 ms here, and once half a second: what is late then is not made up."""
    clock, sent = SimpleNamespace(now=0.0, monotonic=lambda: clock.now), []

    def spin_once(_, timeout_sec):
        clock.now += timeout_sec

    def publish(_):
        sent.append(clock.now)
        clock.now += 0.5 if len(sent) == 3 else 0.03

    publisher = SimpleNamespace(
        publish=publish, get_subscription_count=lambda: 1, wait_for_all_acked=lambda _: True
    )
    node = SimpleNamespace(create_publisher=lambda *_: publisher)
    monkeypatch.setattr('zenoh_rclpy.command_node.Node', lambda *_, **__: node)
    monkeypatch.setattr('zenoh_rclpy.command_node.time', clock)
    monkeypatch.setattr('zenoh_rclpy.command_node.spin_once', spin_once)
    CommandNode().publish('/x', FLOAT, None, len(times), rate, lambda: None)
    assert sent == pytest.approx(times, abs=0.6 if rate < 1.0 else 1e-9)


def test_messages_of_a_package_are_found_without_importing_it():
    """And without reading the others, of which a command needs few."""
    code = (
        'import sys; from ros_interfaces.classes import message_class; '
        'import zenoh_rclpy.command_node; from ros_interfaces.definitions import typestore; '
        'print(message_class("mechanism_sim/msg/Impact")(joint="a").joint, '
        '"mechanism_sim" in sys.modules, "mechanism_sim/msg/Motion" in typestore().fielddefs)'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ['a', 'False', 'False']


def test_the_nearest_type_is_named_though_nobody_has_asked_for_it():
    types = (
        'mechanism_sim/msg/Motion', 'std_srvs/srv/Trigger',
        'simulation_interfaces/msg/SimulationState', 'simulation_interfaces/action/SimulateSteps',
    )  # fmt: skip
    code = (
        'import sys; from ros_interfaces.definitions import field_descriptions\n'
        'for name in sys.argv[1:]:\n'
        '    try: field_descriptions(name[:-1])\n'
        '    except ValueError as error: print(error)\n'
    )
    done = subprocess.run([sys.executable, '-c', code, *types], capture_output=True, text=True,
                          check=True)  # fmt: skip
    assert done.stdout.splitlines() == [
        f"the type '{name[:-1]}' is unknown; did you mean '{name}'?" for name in types
    ]


def test_a_dump_of_parameters_is_read_as_a_file_of_them(tmp_path, capsys):
    """Of what a file has no words for it has none: bytes were lists of lists, and refused."""
    values = {
        'text': '010',
        'size': 2.0,
        'sizes': [1.0, 2.0],
        'words': ['yes', '1:30'],
        'on': True,
    }
    more = {'bytes': [b'\x01', b'\x02'], 'nothing': None, 'empty': [], 'none': array('d')}
    node = SimpleNamespace(
        parameter_names=lambda _: [*values, *more], parameters=lambda *_: values | more
    )
    _param_dump(node, SimpleNamespace(node='ns/arm', json=False))
    file = tmp_path / 'arm.yaml'
    file.write_text(capsys.readouterr().out)
    assert dict(read_parameters(str(file))) == {'/ns/arm': values}


@pytest.mark.slow
@pytest.mark.usefixtures('network')
def test_nodes_without_services_for_parameters_do_not_end_a_list_of_all():
    """As those of listeners to frames, which RViz and many drivers have beside their own."""
    with command_node(5.0) as node:
        there = [Node(name, start_parameter_services=way) for name, way in
                 (('listener_impl', False), ('rviz', True))]  # fmt: skip
        assert node.nodes('list_parameters') == ['/rviz']
        assert node.nodes() == ['/listener_impl', '/rviz']
        node.allow(0.1)
        with pytest.raises(UsageError, match='/listener_impl has no services for its parameters'):
            node.parameter_names('listener_impl')
        for made in there:
            made.destroy_node()


@pytest.mark.sample(5)
@pytest.mark.parametrize(
    ('value', 'said'),
    [
        ('[1, a]', "'[1, a]': a list holds values of one type"),
        ('{a: 1}', "'{a: 1}': a parameter holds a value or a list"),
        ('[[1]]', "'[[1]]': a list holds values of one type"),
        ('&a [*a]', 'ROS has no aliases of values as *a'),
        ('{? [1, 2] : 3}', 'a name is a text'),
        ('[' * 3000, 'nested too deep'),
    ],
)
@pytest.mark.usefixtures('network')
def test_what_no_parameter_can_hold_is_said_before_any_node_is_looked_for(value, said, capsys):
    assert main(['param', 'set', '/nobody', 'x', value]) == 2
    assert said in capsys.readouterr().err


def test_values_are_yaml():
    assert _values('{steps: 3}') == {'steps': 3}
    assert _values('0.5') == 0.5
    assert _values('[{a: 1e-3}, [b, 2]]') == [{'a': 1e-3}, ['b', 2]]
    assert _values(None) is None
    with pytest.raises(ValueError, match='no YAML'):
        _values('{steps: ')


def test_json_has_no_numbers_that_are_none():
    message = message_class(FLOAT)(data=math.nan)
    assert to_plain(message, finite=True) == {'data': None}
    assert math.isnan(to_plain(message)['data'])


def test_text_is_echoed_as_it_is(capsys):
    """As a description of a robot, which other programs read."""
    _print(SimpleNamespace(json=False), '<robot>\n  <link/>\n</robot>', '---')
    assert capsys.readouterr().out == '<robot>\n  <link/>\n</robot>\n---\n'
