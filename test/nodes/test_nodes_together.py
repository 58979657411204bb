"""Nodes of runs in this process: what slow tests show of processes, on small cases."""

from __future__ import annotations

import ast
import math
import os
import runpy
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bags import assert_states_follow_from_motion, fields_of, messages_of
from builders import digest_of
from middleware_network import PATIENCE, Network, joined, spin_until
from operating import FOREIGN, by_hand
from running import ROOT, start

import mechanism_sim as ms
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.errors import RunError
from mechanism_sim.export.urdf import to_urdf
from mechanism_sim.messages import (
    Clock,
    Float64,
    Impact,
    JointState,
    Log,
    Progress,
    TransformStamped,
    message_class,
    service_class,
)
from mechanism_sim.messages.part_states import KINDS
from mechanism_sim.nodes import (
    commands,
    control_relay,
    pace,
    partners,
    publications,
    spawning,
)
from mechanism_sim.nodes.classes import node_class
from mechanism_sim.nodes.middleware import Future, Node, Parameter, SingleThreadedExecutor
from mechanism_sim.nodes.process import report_end
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.run import NodePlan
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.recording.reader import read_bag
from ros_interfaces.stamps import nanoseconds
from zenoh_rclpy.arguments import parse_arguments

SCENE = 'four_bar_clearance'
PLAYING, PAUSED, QUITTING = 1, 2, 3
CONTROLLER = ROOT / 'docs' / 'speed_controller.py'
LOCKED = {'command_period': 0.005}
FATAL = 50  # of rcl_interfaces/Log

pytestmark = pytest.mark.usefixtures('network')


@pytest.fixture
def network() -> Iterator[Network]:
    """This process on a network of its own, without what earlier runs have left on theirs."""
    with joined() as network:
        yield network


def spin(nodes: list[Node], condition: Callable[[], bool]) -> None:
    """Run callbacks of nodes until a condition comes true."""
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    try:
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.1)
    finally:
        for node in nodes:
            executor.remove_node(node)


@contextmanager
def nodes_of(
    scene: str,
    duration: float,
    *names: str,
    record: Path | None = None,
    overrides: tuple[str, ...] = (),
    drive: dict[str, float | bool] | None = None,
    **options: float | bool,
) -> Iterator[dict[str, SimulationNode]]:
    """The nodes of a run by name, those it needs or these; taken down at the end."""
    plan = NodePlan(
        ms.load_scene(scene, overrides), scene, overrides, duration, str(record or ''), **options
    )
    chosen = [*names, *(['recorder'] if record else [])] if names else plan.nodes
    more = {'crank_drive': [Parameter(key, value=value) for key, value in (drive or {}).items()]}
    made: dict[str, SimulationNode] = {}
    try:
        for name in chosen:
            given = [p for p in plan.parameters(name) if p.name != 'partners']
            others = Parameter('partners', value=','.join(n for n in chosen if n != name))
            made[name] = node_class(name)([*given, others, *more.get(name, [])])
        yield made
    finally:
        for node in made.values():
            node.destroy_node()


def finish(nodes: dict[str, SimulationNode], *others: Node) -> None:
    """Run nodes until all are done."""
    spin([*nodes.values(), *others], lambda: all(n.done for n in nodes.values()))


def test_a_subscriber_that_is_slower_than_a_whole_run_loses_nothing():
    listener, got = Node('slow_listener'), []
    listener.create_subscription(Impact, 'impacts', lambda m: got.append(m.index), RESULTS)
    try:
        with nodes_of(SCENE, 0.1, overrides=('start=centred',)) as nodes:
            finish(nodes)
            sent = nodes['linkage'].counts['/impacts']
            assert not got
            spin_until(listener, lambda: len(got) >= sent)
        assert got == list(range(sent))
        assert sent > 10
    finally:
        listener.destroy_node()


@pytest.mark.slow
def test_what_nobody_hears_is_counted_but_not_made(monkeypatch, tmp_path):
    """A run counts the same messages with a recorder and without."""
    made, counts, write = [], [], publications.SampleTopic
    monkeypatch.setattr(publications, 'SampleTopic', lambda publisher, schedule, make, each: write(
        publisher, schedule, lambda view: made.append(publisher.topic_name) or make(view), each,
    ))  # fmt: skip
    for bag in (tmp_path / 'heard.mcap', None):
        with nodes_of(SCENE, 0.1, overrides=('start=centred',), record=bag) as nodes:
            finish(nodes)
            counts.append(nodes['linkage'].counts)
        assert bool(made) == bool(bag)
        made.clear()
    for topic in counts[0].keys() - {'/motion', '/progress'}:
        assert counts[0][topic] == counts[1][topic]
    assert counts[1]['/linkage_state'] > 5


@pytest.mark.slow
def test_a_partner_that_leaves_is_named(monkeypatch):
    monkeypatch.setattr(partners, 'GONE_AFTER', 0.0)
    with nodes_of(SCENE, 1e5, 'crank_drive', 'linkage', realtime_factor=1.0) as nodes:
        spin([*nodes.values()], lambda: bool(nodes['linkage'].partners.reports))
        nodes.pop('crank_drive').destroy_node()
        said = "linkage: 'crank_drive' left before the run was finished"
        with pytest.raises(RunError, match=said):
            spin([nodes['linkage']], lambda: False)


@pytest.mark.slow
def test_parameters_that_list_texts_are_arrays_or_one_text(tmp_path):
    values = ['drive.speed=300 rpm', 'start=centred']
    more = {'scene': SCENE, 'duration': 0.02, 'overrides': values}
    names = ['crank_drive', 'linkage', 'recorder']
    made = {
        name: node_class(name)(
            [
                *(Parameter(key, value=value) for key, value in more.items()),
                Parameter('partners', value=[n for n in names if n != name]),
                *([Parameter('file', value=str(tmp_path / 'other.mcap'))] * (name == 'recorder')),
            ]
        )
        for name in names
    }
    try:
        assert made['linkage'].partners.names == ['crank_drive', 'recorder']
        for wrong in (3.0, [1, 2], True):
            (result,) = made['crank_drive'].set_parameters([Parameter('overrides', value=wrong)])
            assert result.reason == 'overrides must be an array of texts, or one text'
        unknown = Parameter('overrides', value=['drive.sped=3'])
        (result,) = made['crank_drive'].set_parameters([unknown])
        assert 'sped' in result.reason
        finish(made)
    finally:
        for node in made.values():
            node.destroy_node()
    found = analyze(tmp_path / 'other.mcap').digest
    assert found == digest_of(SCENE, tuple(values), 0.02)


@pytest.mark.slow
def test_an_error_that_ends_a_node_is_in_rosout(network):
    listener, heard = Node('listener'), []
    listener.create_subscription(Log, '/rosout', heard.append, 10)
    ended = network.start("""
        from mechanism_sim.nodes.middleware import Parameter
        from mechanism_sim.nodes.process import run_nodes
        from mechanism_sim.nodes.classes import node_class
        given = {'partners': 'crank_drive', 'partner_timeout': 1.0}
        parameters = [Parameter(name, value=value) for name, value in given.items()]
        print('code', run_nodes(lambda: [node_class('linkage')(parameters)]))
    """)
    try:
        spin_until(listener, lambda: any(log.level == FATAL for log in heard))
        assert ended.expect('code') == '1'
    finally:
        listener.destroy_node()
    (said,) = (log for log in heard if log.level == FATAL)
    assert said.name == 'linkage'
    assert said.msg.startswith("linkage: waited 1 s for 'crank_drive', which did not appear")
    assert sum('which did not appear' in line for line in ended.lines) == 1


def test_a_process_that_was_killed_is_named_and_what_is_kept(tmp_path, capsys):
    assert report_end('recorder', -9) == 1
    assert "'recorder' was killed by signal 9" in capsys.readouterr().err
    bag = tmp_path / 'run.mcap'
    for held, name, said in (
        (None, 'linkage', 'the run ends\n'),
        (b'', 'recorder', 'the run ends\n'),
        (b'x', 'recorder', f"ends; 'mechanism-sim bag recover {bag}' closes what it has recorded"),
        (b'x', 'linkage', f'the run ends; what is recorded is in {bag}\n'),
    ):
        if held is not None:
            bag.write_bytes(held)
        assert report_end(name, -9, bag) == 1
        assert said in capsys.readouterr().err


@pytest.mark.slow
def test_two_runs_on_one_network_are_kept_apart(tmp_path):
    """The second one ends, and the first one moves as if it had been alone."""
    bag = tmp_path / 'run.mcap'
    with nodes_of(SCENE, 0.05, record=bag, paused=True) as nodes:
        spin([*nodes.values()], lambda: all(n.ready for n in nodes.values()))
        with (
            nodes_of(SCENE, 0.05, 'crank_drive', 'linkage') as second,
            pytest.raises(RunError, match=r"another '\w+' is running in this domain"),
        ):
            spin([*second.values()], lambda: all(n.ready for n in second.values()))
        play(nodes)
    assert analyze(bag).digest == digest_of(SCENE, duration=0.05)


@pytest.mark.slow
@pytest.mark.parametrize('more', [(), ('--processes',)])
def test_a_run_that_is_refused_touches_no_file(network, tmp_path, more):
    """Neither the bag that it would replace, nor one that is not there."""
    good, new = tmp_path / 'good.mcap', tmp_path / 'new.mcap'
    good.write_text('precious')
    with nodes_of(SCENE, 0.05, paused=True) as nodes:
        spin([*nodes.values()], lambda: all(n.ready for n in nodes.values()))
        for bag in (good, new):
            process = start(
                'run', 'geneva', '--duration', '0.1', '--record', str(bag), '--overwrite', *more,
                env={**os.environ, **network.settings},
            )  # fmt: skip
            spin([*nodes.values()], lambda process=process: process.poll() is not None)
            _, said = process.communicate()
            assert process.returncode == 1
            assert 'is running in this domain' in said
    assert good.read_text() == 'precious'
    assert list(tmp_path.iterdir()) == [good]


def play(nodes: dict[str, SimulationNode]) -> None:
    """Let a paused run go on to its end."""
    operator, kind = (
        Node('operator'),
        service_class('simulation_interfaces/srv/SetSimulationState'),
    )
    client = operator.create_client(kind, 'set_simulation_state')
    request = kind.Request()
    request.state.state = PLAYING
    try:
        spin([*nodes.values(), operator], client.service_is_ready)
        client.call_async(request)
        finish(nodes, operator)
    finally:
        operator.destroy_node()


@pytest.mark.slow
@pytest.mark.optimised  # as in the other process
def test_machines_in_two_namespaces_do_not_disturb_each_other(network, tmp_path):
    """One in another process runs to its end while one of no namespace waits in this."""
    bags = {'': tmp_path / 'plain.mcap', 'left/': tmp_path / 'left.mcap'}
    speeds = {'': 'drive.speed=320 rpm', 'left/': 'drive.speed=300 rpm'}
    with nodes_of(SCENE, 0.05, record=bags[''], paused=True, overrides=(speeds[''],)) as nodes:
        process = start(
            'run', SCENE, '--set', speeds['left/'], '--duration', '0.05',
            '--record', str(bags['left/']), '--namespace', 'left',
            env={**os.environ, **network.settings},
        )  # fmt: skip
        spin([*nodes.values()], lambda: process.poll() is not None)
        assert process.returncode == 0, process.communicate()
        process.communicate()
        play(nodes)
    links = ms.load_scene(SCENE).plan.links
    for prefix, bag in bags.items():
        assert analyze(bag).digest == digest_of(SCENE, (speeds[prefix],), 0.05)
        found = read_bag(bag)
        frames = [t for _, m, _ in found.messages('/tf') for t in m.transforms]
        assert {t.child_frame_id for t in frames} == {f'{prefix}{link}' for link in links}
        assert {t.header.frame_id for t in frames} == {f'{prefix}world'}
        (described,) = [m.data for _, m, _ in found.messages(f'/{prefix}robot_description')]
        assert described == to_urdf(ms.load_scene(SCENE, [speeds[prefix]]), prefix)
        (names,) = {tuple(m.name) for _, m, _ in found.messages(f'/{prefix}joint_states')}
        assert all(f'<joint name="{name}" type="continuous">' in described for name in names)
        own = {topic for topic in found.topics if topic not in ('/tf', '/clock', '/diagnostics')}
        assert all(topic.startswith(f'/{prefix}') for topic in own)


@pytest.mark.slow
def test_a_controller_outside_commands_each_sample_as_by_hand():
    """The program of the pages, with a node of its own."""
    controller, speed = runpy.run_path(str(CONTROLLER))['SpeedController'](), []
    controller.create_subscription(
        JointState, 'joint_states', lambda m: speed.append(m.velocity[0]), RESULTS
    )
    try:
        with nodes_of('four_bar_governed', 0.05, drive=LOCKED) as nodes:
            finish(nodes, controller)
            spin([controller], lambda: len(speed) == 10)
        assert np.abs(by_hand(10) - speed).max() < 1e-6
        assert max(speed) - min(speed) > 0.1
    finally:
        controller.destroy_node()


def test_a_controller_that_the_graph_does_not_show_is_heard(monkeypatch):
    """As of plain Zenoh without a token. It repeats what it says until a state has come."""
    monkeypatch.setattr(commands, 'SETTLE', 1e9)
    controller, speed = runpy.run_path(str(CONTROLLER))['SpeedController'](), []
    speaks = controller.create_publisher(Float64, 'command/effort', RESULTS)
    controller.create_subscription(
        JointState, 'joint_states', lambda m: speed.append(m.velocity[0]), RESULTS
    )
    try:
        with nodes_of('four_bar_governed', 0.05, drive=LOCKED) as nodes:
            drive = nodes['crank_drive']
            seen, take_over, held = drive.get_publishers_info_by_topic, drive.take_over, []
            monkeypatch.setattr(
                drive,
                'get_publishers_info_by_topic',
                lambda topic: [] if topic == '/command/effort' else seen(topic),
            )
            monkeypatch.setattr(
                drive,
                'take_over',
                lambda laws: (held.append(laws[0].coefficients[0]), take_over(laws)),
            )
            every = [*nodes.values(), controller]
            spin(every, lambda: drive.ready and speaks.get_subscription_count())
            said = [3.0, 2.0, 0.0]  # the last is that of the scene
            for effort in said:
                speaks.publish(Float64(data=effort))
            spin(every, lambda: held == said)
            assert drive.announced == len(speed) == 0
            monkeypatch.setattr(commands, 'SETTLE', 0.0)
            finish(nodes, controller)
            spin([controller], lambda: len(speed) == 10)
        assert np.abs(by_hand(10) - speed).max() < 1e-6
    finally:
        controller.destroy_node()


class Commander(Node):
    """Answers so many states."""

    def __init__(self, name: str, count: int) -> None:
        super().__init__(name)
        self.left, self.seen = count, []
        self.create_subscription(JointState, 'joint_states', self.answer, RESULTS)
        self.command = self.create_publisher(Float64, 'command/effort', RESULTS)

    def answer(self, state: JointState) -> None:
        self.seen.append(nanoseconds(state.header.stamp) // 1_000_000)
        if self.left:
            self.left -= 1
            self.command.publish(Float64(data=0.1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ('period', 'answers', 'unanswered'), [(5, 3, [15]), (50, 2, [100, 150])]
)  # of the latter the third period ends at 0.15000000000000002 s: the state at 0.15 s is before
def test_a_run_says_that_it_waits_for_a_controller_and_goes_on_with_another(
    period, answers, unanswered, monkeypatch, capsys
):
    monkeypatch.setattr(partners, 'SAY_AFTER', -1e9)
    monkeypatch.setattr(partners, 'SAY_AGAIN', 0.0)
    monkeypatch.setattr(commands, 'PATIENCE', 0.0)
    told, there, kind = [], [], 'std_msgs/msg/Float'

    def says(said: str) -> Callable[[], bool]:
        def heard() -> bool:
            told.extend(capsys.readouterr().err.splitlines())
            return any(line.endswith(f'[crank_drive]: waiting for {said}') for line in told)

        return heard

    with nodes_of(
        'four_bar_governed', 0.01 * period, drive={'command_period': 1e-3 * period},
        overrides=(f'outputs.joint_states={1000 // period} Hz',),
    ) as nodes:  # fmt: skip
        run = [*nodes.values()]
        try:
            spin(run, says('a publisher of /command/effort'))
            there.append(Node('other'))
            there[0].create_publisher(message_class(f'{kind}32'), 'command/effort', RESULTS)
            spin(run, says(f'a publisher of /command/effort of the type {kind}64, not {kind}32'))
            there.pop().destroy_node()
            there.append(Commander('first', answers))
            held = f'a command on /command/effort since t = {1e-3 * period * (answers + 1):g} s'
            spin([*run, *there], says(held))
            first = there.pop()
            first.destroy_node()
            spin(run, says(f'{held}, which nobody in the graph publishes'))
            there.append(Commander('second', 10))  # is shown what the first has not answered
            finish(nodes, *there)
            spin(there, lambda: len(there[0].seen) >= 10 - answers)
        finally:
            for node in there:
                node.destroy_node()
    assert first.seen == [*range(0, unanswered[-1] + 1, period)]
    assert there[0].seen == [*range(unanswered[0], 10 * period, period)]


def test_a_run_is_paused_before_its_controller_is_there():
    """Nothing is announced yet: all nodes are at the time 0 at which it pauses."""
    asker, kind = Node('asker'), service_class('simulation_interfaces/srv/SetSimulationState')
    client, request = asker.create_client(kind, 'set_simulation_state'), kind.Request()
    request.state.state = PAUSED
    asked = service_class('simulation_interfaces/srv/GetSimulationState')
    state = asker.create_client(asked, 'get_simulation_state')
    try:
        with nodes_of('four_bar_governed', 0.05, drive=LOCKED) as nodes:
            every, drive = [*nodes.values(), asker], nodes['crank_drive']
            spin(every, lambda: client.service_is_ready() and state.service_is_ready())
            answer = client.call_async(request)
            spin(every, lambda: not drive.playing)
            for _ in range(100):  # who is not answered before these never is
                spin(every, state.call_async(asked.Request()).done)
            assert answer.done()
            assert answer.result().result.result == 1
            assert (drive.playing, drive.announced) == (False, 0.0)
    finally:
        asker.destroy_node()


@pytest.mark.parametrize('service', ['reset_simulation', 'load_world'])
def test_of_two_resets_at_once_one_is_refused_also_while_machines_are_deleted(
    service, monkeypatch
):
    kind = service_class(f'simulation_interfaces/srv/{service.title().replace("_", "")}')
    asker = Node('asker')
    client, request = asker.create_client(kind, service), kind.Request()
    if service == 'load_world':
        getattr(request, 'world_resource', request).uri = SCENE
    try:
        with nodes_of(SCENE, 0.05, paused=True, hold=True) as nodes:
            every, drive = [*nodes.values(), asker], nodes['crank_drive']
            spin(every, lambda: drive.ready and client.service_is_ready())
            deleted: Future = Future()

            async def clear() -> None:
                await deleted

            monkeypatch.setattr(drive.spawning, 'clear', clear)
            answers = [client.call_async(request) for _ in range(2)]
            spin(every, lambda: any(answer.done() for answer in answers))
            deleted.set_result(None)
            spin(every, lambda: all(answer.done() for answer in answers))
            assert drive.run == 1
    finally:
        asker.destroy_node()
    told = sorted(answer.result().result.error_message for answer in answers)
    assert told[0] == ''
    assert 'under way: wait for the end' in told[1]


def test_a_machine_that_starts_while_the_first_is_reset_is_in_the_run_that_is_waited_for(
    monkeypatch,
):
    """Its process hears of the leader when that is in its next run; both stood still for ever."""
    said: list[str] = []
    monkeypatch.setattr(spawning.process_exit, 'start', lambda words, **_: said.extend(words))
    with nodes_of(SCENE, 0.05, paused=True, hold=True) as nodes:
        drive = nodes['crank_drive']
        drive.begin_run(3)
        drive.spawning._start('late', 'geneva', '/late', 'geneva', TransformStamped())
        drive.begin_run(4)
        drive.spawning.begin_run()
        given = parse_arguments(said[said.index('--ros-args') :]).parameters_of('/crank_drive')
        own = Node('late', parameter_overrides=[Parameter(k, value=x) for k, x in given.items()])
        own.declare = lambda name, default, *_, **__: own.declare_parameter(name, default).value
        try:
            leader = spawning.LeadingDrive(own)
            own.on_leader = _nothing
            with pytest.raises(StopIteration):
                leader._take(Progress(node='crank_drive', run=4)).send(None)
            assert leader.run == drive.spawning.machines['late'].run == 1
        finally:
            drive.spawning.machines.clear()
            own.destroy_node()


async def _nothing() -> None:
    """A drive that need not follow."""


@pytest.mark.slow
def test_a_controller_that_commands_what_is_no_number_is_not_heeded(capsys):
    """The run waits for a command, and the controller that gives one gets its digits."""
    controller, speed = runpy.run_path(str(CONTROLLER))['SpeedController'](), []
    controller.create_subscription(
        JointState, 'joint_states', lambda m: speed.append(m.velocity[0]), RESULTS
    )
    speaks = controller.create_publisher(Float64, 'command/effort', RESULTS)
    wrong = [math.nan, math.inf, -1e13]
    try:
        with nodes_of('four_bar_governed', 0.05, drive=LOCKED) as nodes:
            drive = nodes['crank_drive']
            spin([*nodes.values(), controller], lambda: drive.ready)
            for effort in wrong:
                speaks.publish(Float64(data=effort))
            finish(nodes, controller)
            spin([controller], lambda: len(speed) == 10)
    finally:
        controller.destroy_node()
    assert np.abs(by_hand(10) - speed).max() < 1e-6
    (told,) = [x for x in capsys.readouterr().err.splitlines() if 'is no effort' in x]
    assert 'ignored a message on /command/effort: nan is no effort from -1e+12 to 1e+12' in told


def test_only_a_controller_that_has_not_seen_the_last_state_is_a_newcomer():
    """One that is slow with its command would command twice."""
    drive, hears, speaks = SimpleNamespace(run=0, announced=0.0), [], []
    drive.get_publishers_info_by_topic = lambda _: list(speaks)
    drive.get_subscriptions_info_by_topic = lambda _: list(hears)

    def comes(name: str, number: int, to: list[object]) -> None:
        info = {'node_namespace': '/', 'node_name': name, 'endpoint_gid': [number]}
        to.append(SimpleNamespace(**info))

    comes('slow', 1, speaks)
    comes('slow', 2, hears)
    found = commands.Newcomers(drive, 'command/effort')
    found.show()
    comes('echo', 3, hears)
    assert [found.look() for _ in range(3)] == [False] * 3
    comes('second', 4, speaks)
    assert [found.look() for _ in range(3)] == [False, True, True]  # first it may join
    comes('second', 5, hears)
    assert [found.look() for _ in range(2)] == [False, True]
    found.show()
    assert not found.look()
    drive.announced = 0.5
    speaks[-1:] = hears[-1:] = []
    comes('second', 6, speaks)  # the same again, which may have come after the last state
    assert [found.look() for _ in range(2)] == [False, True]
    drive.announced = 1.0
    assert [found.look() for _ in range(2)] == [False] * 2


@pytest.mark.parametrize(
    ('rate', 'said'),
    [('100', '0.01 s, but one command is for 0.005 s'), ('200', ''),
     ('400', '0.0025 s, but one command is for 0.005 s')],
)  # fmt: skip
def test_a_rate_of_joint_states_that_is_not_that_of_commands_is_said(rate, said, capsys):
    with nodes_of(
        'four_bar_governed', 0.05, drive=LOCKED, overrides=(f'outputs.joint_states={rate} Hz',)
    ) as nodes:
        spin([*nodes.values()], lambda: all(n.ready for n in nodes.values()))
    told = capsys.readouterr().err
    assert ('joint_states come every' in told) == bool(said)
    assert said in told
    assert ("as by --set 'outputs.joint_states=200 Hz'" in told) == bool(said)


@pytest.mark.slow
def test_who_waits_for_a_command_on_a_state_that_does_not_come_says_why(monkeypatch, capsys):
    monkeypatch.setattr(partners, 'SAY_AFTER', -1e9)
    controller, told = runpy.run_path(str(CONTROLLER))['SpeedController'](), []
    rare = ('outputs.joint_states=100 Hz',)

    def says() -> bool:
        told.extend(capsys.readouterr().err.splitlines())
        held = 'waiting for a command on /command/effort since t = 0.01 s; joint_states come every'
        return any(held in line for line in told)

    try:
        with nodes_of('four_bar_governed', 0.05, drive=LOCKED, overrides=rare) as nodes:
            spin([*nodes.values(), controller], says)
    finally:
        controller.destroy_node()


@pytest.mark.slow
def test_commands_that_come_faster_than_periods_are_said_once(capsys):
    controller = Commander('hasty', 0)
    try:
        with nodes_of('four_bar_governed', 0.05, drive=LOCKED, paused=True) as nodes:
            drive, every = nodes['crank_drive'], [*nodes.values(), controller]
            spin(every, lambda: drive.ready and drive._commands.horizon > 0.0)
            for _ in range(4):
                controller.command.publish(Float64(data=0.1))
            spin(every, lambda: len(drive._commands._early) == 4)
    finally:
        controller.destroy_node()
    told = [x for x in capsys.readouterr().err.splitlines() if 'wait for their periods' in x]
    assert len(told) == 1
    assert '2 commands on /command/effort wait for their periods of 0.005 s' in told[0]


class Component(Node):
    """A hardware component of ros2_control with its manager, and the speed controller's law.

    First no controller commands it, then one that commands nothing.
    """

    def __init__(self) -> None:
        super().__init__('machine')
        self.ticks, self.speeds, self.integral = [], [], 0.0
        self.create_subscription(JointState, 'hardware/joint_states', self.take, RESULTS)
        self.create_subscription(Clock, 'hardware/clock', self.update, RESULTS)
        self.command = self.create_publisher(JointState, 'hardware/joint_commands', RESULTS)

    def take(self, state):
        self.state = state

    def update(self, clock):
        self.ticks.append(nanoseconds(clock.clock))
        effort = math.nan if len(self.ticks) < 4 else 0.0
        if len(self.ticks) > 6:
            self.speeds.append(self.state.velocity[0])
            error = 36.65 - self.speeds[-1]
            step = 10.0 * error * 0.005 if len(self.speeds) > 1 else 0.0
            asked = error + self.integral + step
            effort = min(max(asked, -20.0), 20.0)
            self.integral += step if effort == asked else 0.0
        self.command.publish(JointState(name=self.state.name, effort=[effort]))


@pytest.mark.slow
def test_a_controller_manager_commands_each_sample_as_by_hand(monkeypatch):
    """Its time goes on by one period for each sample, from its first command that moves."""
    monkeypatch.setattr(control_relay, 'PATIENCE', 0.1)
    relay = control_relay.ControlRelay([Parameter('scene', value='four_bar_governed')])
    component = Component()
    try:
        with nodes_of('four_bar_governed', 0.05, drive=LOCKED) as nodes:
            finish(nodes, relay, component)
        np.testing.assert_allclose(component.speeds[:10], by_hand(10), rtol=0.0, atol=1e-6)
        assert set(np.diff(component.ticks)) == {5_000_000}
    finally:
        relay.destroy_node()
        component.destroy_node()


@pytest.mark.slow
def test_a_program_with_nothing_but_zenoh_sees_the_graph_and_decodes_joint_states(network):
    text = FOREIGN % (network.settings['MECHANISM_SIM_ROUTER'], network.settings['ROS_DOMAIN_ID'])
    with nodes_of(SCENE, 1e5, realtime_factor=1.0) as nodes:
        program = network.start(text)
        spin([*nodes.values()], lambda: program.process.poll() is not None)
    kinds, names, joints = ast.literal_eval('(' + program.expect('('))
    assert {'NN', 'MP', 'MS', 'SS'} <= set(kinds)
    assert {'crank_drive', 'linkage', 'sensors'} <= set(names)
    for t, words, position in joints:
        assert words == ['crank', 'coupler', 'rocker']
        assert abs(position[0] - 36.6519 * t) < 1e-7


@pytest.mark.slow
def test_the_nominal_mechanism_runs_as_nodes_too(tmp_path):
    bag = tmp_path / 'run.mcap'
    with nodes_of('four_bar_nominal', 0.05, record=bag) as nodes:
        finish(nodes)
    assert analyze(bag).digest == digest_of('four_bar_nominal', duration=0.05)


@pytest.mark.sample(1)
@pytest.mark.parametrize('end', [np.nextafter(0.25, 0.0), 0.25, np.nextafter(0.25, 1.0)])
def test_nodes_whose_run_ends_at_a_boundary_of_pieces_move_as_solve_does(end, tmp_path):
    bag = tmp_path / 'run.mcap'
    with nodes_of('geneva', float(end), 'crank_drive', 'geneva', record=bag) as nodes:
        finish(nodes)
    assert analyze(bag).digest == digest_of('geneva', duration=float(end))


def test_who_follows_ends_though_the_end_of_the_last_piece_rounds_otherwise():
    end = 0.043750000000000004
    assert ms.simulate(ms.load_scene('gear_box'), duration=end).duration < end
    with nodes_of('gear_box', end, 'crank_drive', 'linkage', 'gear_train') as nodes:
        finish(nodes)


@pytest.mark.slow
def test_a_node_of_parts_integrates_and_follows_alike(tmp_path):
    """Alone, and beside a linkage that its scene does not need."""
    bags = {('crank_drive', 'geneva'): tmp_path / 'alone.mcap',
            ('crank_drive', 'linkage', 'geneva'): tmp_path / 'beside.mcap'}  # fmt: skip
    told = []
    for names, bag in bags.items():
        with nodes_of('geneva', 0.3, *names, record=bag) as nodes:
            finish(nodes)
        found = analyze(bag)
        assert found.digest == digest_of('geneva', duration=0.3)
        assert found.ledger.finished == tuple(sorted(names))
        assert not found.ledger.lost
        assert_states_follow_from_motion(bag, 'geneva', 'geneva')
        told.append([fields_of(m, KINDS['geneva']) for m in messages_of(bag, '/geneva_state')])
    assert len(told[0]) > 20
    assert told[0] == told[1]


@pytest.mark.slow
def test_blocks_are_those_of_the_channel_and_an_inertial_unit_knows_its_attitude(tmp_path):
    bag, imu = tmp_path / 'run.mcap', ('sensors.rocker.imu=true',)
    with nodes_of('four_bar_measured', 0.2, record=bag, overrides=imu) as nodes:
        finish(nodes)
    machine, found = ms.load_scene('four_bar_measured'), read_bag(bag)
    solution = ms.simulate(machine, duration=0.2)
    for name, sensor in machine.scene.sensors.items():
        channel = machine.channel(name)
        channel.take(solution.motion)
        messages = [m for _, m, _ in found.messages(f'/accelerometer/{name}')]
        blocks = channel.blocks(final=True)
        assert len(messages) == len(blocks) > 0
        for message, block in zip(messages, blocks, strict=True):
            assert (message.quantity, message.unit) == (sensor.measures, sensor.unit)
            assert np.array_equal(message.samples, block.samples)
            assert (message.time, message.overloads) == (block.time, block.overloads)
    messages = [m for _, m, _ in found.messages('/imu/rocker')]
    blocks = [m for _, m, _ in found.messages('/accelerometer/rocker')]
    across = np.concatenate([m.samples for m in blocks])
    assert np.array_equal([m.linear_acceleration.y for m in messages], across)
    t = np.concatenate([b.time + np.arange(len(b.samples)) / b.sample_rate for b in blocks])
    seen = solution.sample(t, 'velocity.rocker', 'position.rocker')
    turned = np.array([(m.orientation.w + 1j * m.orientation.z) ** 2 for m in messages])
    assert np.abs(turned - np.exp(1j * seen['position.rocker'])).max() < 1e-12
    rate = np.array([m.angular_velocity.z for m in messages])
    assert np.abs(rate - seen['velocity.rocker']).max() < 1e-9


class _Watch:
    """A clock of wall time that goes when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.mark.slow
def test_a_stall_is_not_followed_by_a_rush(monkeypatch):
    """A partner that stands still for 5 s of wall time delays the run by so long."""
    watch, most = _Watch(), 2.0 * pace.AHEAD + 0.01
    monkeypatch.setattr(pace, 'time', watch)
    with nodes_of(SCENE, 1e5, 'crank_drive', 'linkage', realtime_factor=1.0) as nodes:
        drive, linkage = nodes['crank_drive'], nodes['linkage']

        def go(wall: float) -> None:
            for _ in range(round(wall / 0.05)):
                watch.now += 0.05
                before = drive.announced
                spin([drive, linkage], lambda b=before: not linkage.active or drive.announced > b)

        spin([drive, linkage], lambda: linkage.ready and drive.announced > 0.0)
        go(1.0)
        assert 1.0 - 0.01 < drive.announced < 1.0 + most
        linkage.deactivate()
        stood = drive.announced
        for _ in range(100):
            watch.now += 0.05
            ticks = iter(range(3))
            spin([drive, linkage], lambda t=ticks: next(t, None) is None)
        assert drive.announced < stood + most
        linkage.activate()
        go(1.0)
        assert drive.announced < stood + 1.0 + most


def clocks_of(bag: Path) -> list[float]:
    return [m.clock.sec + 1e-9 * m.clock.nanosec for _, m, _ in read_bag(bag).messages('/clock')]


def test_the_clock_reaches_the_end_of_each_run_in_its_bag(tmp_path):
    """However short the run is: the law of these is announced to the end at once."""
    bags = tmp_path / 'run.mcap', tmp_path / 'run-2.mcap'
    operator = Node('operator')
    with nodes_of(SCENE, 0.2, record=bags[0], hold=True) as nodes:
        drive, everybody = nodes['crank_drive'], [*nodes.values(), operator]

        def arrived() -> bool:
            return drive.time >= 0.2

        def ask(short: str, name: str, **state: int) -> None:
            kind = service_class(f'simulation_interfaces/srv/{short}')
            request = kind.Request()
            if state:
                request.state.state = state['state']
            client = operator.create_client(kind, name)
            spin(everybody, client.service_is_ready)
            answer = client.call_async(request)
            spin(everybody, answer.done)
            assert answer.result().result.result == 1

        spin(everybody, arrived)
        ask('ResetSimulation', 'reset_simulation')
        ask('SetSimulationState', 'set_simulation_state', state=PLAYING)
        spin(everybody, arrived)
        ask('SetSimulationState', 'set_simulation_state', state=QUITTING)
        finish(nodes, operator)
    operator.destroy_node()
    for bag in bags:
        times = clocks_of(bag)
        assert times == sorted(times)
        assert (times[0], times[-1]) == (0.0, 0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('scene', 'duration'),
    [
        ('geneva', 0.23),
        pytest.param('linear_intermittent', 0.29, marks=pytest.mark.slow),
        pytest.param('quick_return', 0.57, marks=pytest.mark.slow),
        pytest.param('offset_roller_cam', 0.27, marks=pytest.mark.slow),
        pytest.param('measured_cam', 0.1, marks=pytest.mark.slow),
    ],
)
def test_closed_forms_are_published_alike_however_short_the_law_is_known(
    tmp_path, scene, duration
):
    """Samples come from previews, which may have several pieces, where credit ends within one."""
    told = []
    for lead in (3.0, 0.01):
        bag = tmp_path / f'{lead}.mcap'
        with nodes_of(scene, duration, record=bag, drive={'lead': lead}) as nodes:
            finish(nodes)
        told.append([np.array(m.position) for m in messages_of(bag, '/joint_states')])
        assert analyze(bag).digest == digest_of(scene, duration=duration)
    np.testing.assert_allclose(*told, rtol=0.0, atol=1e-12)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('names', 'said'),
    [
        ('crank_drive', 'waiting for crank_drive'),
        ('', 'waiting for a publisher of /drive'),
    ],
)
def test_a_node_that_waits_says_for_whom(monkeypatch, capsys, names, said):
    monkeypatch.setattr(partners, 'SAY_AFTER', -1e9)
    linkage = node_class('linkage')([Parameter('partners', value=names)])
    lines: list[str] = []

    def told() -> bool:
        lines.extend(capsys.readouterr().err.splitlines())
        return any(said in line for line in lines)

    try:
        spin([linkage], told)
        assert len([line for line in lines if 'waiting' in line]) == 1
    finally:
        linkage.destroy_node()
