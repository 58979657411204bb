"""The recorder, beside a partner that is acted here."""

from __future__ import annotations

import pytest
from mcap.reader import make_reader
from middleware_network import eventually, joined

from mechanism_sim.errors import RunError
from mechanism_sim.export.urdf import to_urdf
from mechanism_sim.messages import (
    Clock,
    Header,
    JointState,
    Progress,
    String,
    TFMessage,
    TransformStamped,
    stamp,
    uint64_array,
)
from mechanism_sim.nodes import recorder as recording
from mechanism_sim.nodes.middleware import Node, Parameter, SingleThreadedExecutor
from mechanism_sim.nodes.qos import CLOCK, LATCHED, RESULTS
from mechanism_sim.nodes.recorder import Recorder
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.scene import load_scene
from zenoh_rclpy.arguments import parse_arguments

SCENE = 'four_bar_clearance'


def state_of(t, *names):
    """Joint states at a time, of the machine unless other joints are named."""
    joints = names or ('crank', 'coupler', 'rocker')
    return JointState(header=Header(stamp=stamp(t)), name=list(joints))


def frame_of(t, parent, child):
    """A frame at a time."""
    frame = TransformStamped(header=Header(stamp=stamp(t), frame_id=parent), child_frame_id=child)
    return TFMessage(transforms=[frame])


@pytest.fixture
def network():
    """A network for each test: what is latched is heard until its session ends."""
    with joined() as network:
        yield network


@pytest.mark.parametrize('before', [0, 40])
@pytest.mark.usefixtures('network')
def test_a_recorder_that_came_late_says_so(before, tmp_path, monkeypatch, capfd):
    """What is missing then was not lost on the way: a report before the first is missing, too."""
    monkeypatch.setattr(recording, 'LOSS_TIMEOUT', -1.0)
    bag = tmp_path / 'late.mcap'
    given = {'scene': SCENE, 'file': str(bag), 'partners': 'linkage'}
    partner, executor = Node('linkage'), SingleThreadedExecutor()
    partner.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
    publisher = partner.create_publisher(Progress, 'progress', RESULTS)
    recorder = Recorder([Parameter(key, value=value) for key, value in given.items()])
    for node in (partner, recorder):
        executor.add_node(node)

    def spin_until(condition):
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or condition())

    def report(number, **more):
        counts = uint64_array([5, before + number])
        names = ['/impacts', '/progress']
        publisher.publish(Progress(node='linkage', topics=names, counts=counts, **more))

    try:
        spin_until(lambda: recorder.ready)
        report(1, time=0.9)
        spin_until(lambda: recorder.partners.reports)
        report(2, time=1.0, finished=True)
        with pytest.raises(RunError, match='5 messages of /impacts were announced, not') as ended:
            spin_until(lambda: False)
    finally:
        for node in (recorder, partner):
            executor.remove_node(node)
            node.destroy_node()
    assert str(ended.value).endswith('; it came when the run had begun') == bool(before)
    assert ('begun already' in capfd.readouterr().err) == bool(before)
    assert read_bag(bag).topics['/progress'].count == 2


@pytest.mark.usefixtures('network')
def test_a_late_bag_begins_where_its_run_is_and_has_no_clock_of_another_machine(tmp_path):
    """A description is not of time 0 there, whether it has a stamp or not."""
    bag = tmp_path / 'late.mcap'
    wrenches = 'outputs.wrenches=10 Hz'
    given = {'scene': SCENE, 'overrides': [wrenches], 'file': str(bag), 'partners': 'linkage'}
    partner, executor, heard = Node('linkage'), SingleThreadedExecutor(), []
    other = Node('crank_drive', namespace='/other')
    partner.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
    for kind, topic in ((String, 'scene'), (TFMessage, '/tf_static')):
        partner.create_subscription(kind, topic, heard.append, LATCHED)
    reports = partner.create_publisher(Progress, 'progress', RESULTS)
    scene = partner.create_publisher(String, 'scene', LATCHED)
    frames = partner.create_publisher(TFMessage, '/tf_static', LATCHED)
    states = partner.create_publisher(JointState, 'joint_states', RESULTS)
    clock = other.create_publisher(Clock, '/clock', CLOCK)
    scene.publish(String(data='{}'))
    frames.publish(frame_of(0.0, 'world', 'joint/x'))
    recorder = Recorder([Parameter(key, value=value) for key, value in given.items()])
    for node in (partner, recorder):
        executor.add_node(node)

    def spin_until(condition):
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or condition())

    def recorded():
        counts = recorder.writer.counts
        return counts['/scene'], counts['/tf_static'], counts['/joint_states']

    try:
        spin_until(lambda: recorder.ready)
        clock.publish(Clock())
        spin_until(lambda: len(heard) == 2)
        states.publish(state_of(7.5))
        spin_until(lambda: recorded() == (1, 1, 1))
        reports.publish(Progress(node='linkage', time=8.0, header=Header(stamp=stamp(8.0))))
        spin_until(lambda: recorder.partners.reports)
        clock.publish(Clock())
        frames.publish(frame_of(0.0, 'world', 'joint/x'))
        spin_until(lambda: recorded() == (1, 2, 1))
    finally:
        for node in (recorder, partner):
            executor.remove_node(node)
        for node in (recorder, partner, other):
            node.destroy_node()
    found = read_bag(bag)
    assert (found.start, found.end) == (7_500_000_000, 8_000_000_000)
    assert not found.topics['/clock'].count
    assert [t for _, _, t in found.messages('/scene')] == [found.start]


@pytest.mark.usefixtures('network')
def test_descriptions_are_in_the_bag_of_their_run_also_of_a_recorder_that_came_late(tmp_path):
    """In the third run it had none in a bag without an end; in the second, one of nothing else.

    The description of the next run may come before anything that has its number.
    """
    given = {'scene': SCENE, 'file': str(tmp_path / 'late.mcap'), 'partners': 'linkage'}
    partner, executor, heard = Node('linkage'), SingleThreadedExecutor(), []
    partner.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
    partner.create_subscription(String, 'scene', heard.append, LATCHED)
    reports = partner.create_publisher(Progress, 'progress', RESULTS)
    scene = partner.create_publisher(String, 'scene', LATCHED)
    states = partner.create_publisher(JointState, 'joint_states', RESULTS)
    scene.publish(String(data='third'))
    recorder = Recorder([Parameter(key, value=value) for key, value in given.items()])
    for node in (partner, recorder):
        executor.add_node(node)

    def spin_until(condition):
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or condition())

    def counts(*topics):
        return tuple(recorder.writer.counts[f'/{topic}'] for topic in topics)

    def report(run, t):
        stamped = Header(stamp=stamp(t))
        reports.publish(Progress(node='linkage', run=run, time=t, header=stamped))

    try:
        spin_until(lambda: recorder.ready and heard)
        states.publish(state_of(7.5))
        spin_until(lambda: counts('scene', 'joint_states') == (1, 1))
        report(2, 8.0)
        spin_until(lambda: recorder.partners.time == 8.0)
        scene.publish(String(data='fourth'))
        spin_until(lambda: len(heard) == 2)
        report(2, 9.0)
        spin_until(lambda: recorder.partners.time == 9.0)
        report(3, 0.0)
        spin_until(lambda: recorder.run == 3 and counts('scene', 'progress') == (1, 1))
    finally:
        for node in (recorder, partner):
            executor.remove_node(node)
            node.destroy_node()
    found = {
        file.name: [message.data for _, message, _ in read_bag(file).messages('/scene')]
        for file in tmp_path.iterdir()
    }
    assert found == {'late.mcap': ['third'], 'late-4.mcap': ['fourth']}


@pytest.mark.parametrize('rules', ['', '-r /tf:=frames -r /clock:=time'])
@pytest.mark.usefixtures('network')
def test_a_bag_has_nothing_of_a_robot_beside_the_machine(rules, tmp_path, monkeypatch):
    """Its joints and frames share topics of ROS; their times count from 1970, or are negative."""
    bag = tmp_path / 'run.mcap'
    given = {'scene': SCENE, 'file': str(bag), 'partners': 'linkage'}
    partner, robot = Node('linkage'), Node('arm')
    arguments = parse_arguments(['--ros-args', *rules.split()])
    monkeypatch.setattr(partner.context, 'arguments', arguments)
    recorder = Recorder([Parameter(key, value=value) for key, value in given.items()])
    executor, heard = SingleThreadedExecutor(), []
    for node in (partner, recorder):
        executor.add_node(node)
    topics = {kind: recorder.resolve_topic_name(name) for kind, name in
              ((JointState, 'joint_states'), (TFMessage, '/tf'), (Clock, '/clock'))}  # fmt: skip
    mine, theirs = (
        {kind: node.create_publisher(kind, topic, RESULTS) for kind, topic in topics.items()}
        for node in (partner, robot)
    )
    partner.create_subscription(Progress, 'progress', heard.append, RESULTS)
    reports = partner.create_publisher(Progress, 'progress', RESULTS)
    later = 1.7e9

    def spin_until(condition):
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or condition())

    try:
        spin_until(lambda: recorder.ready)
        for names in (('elbow', 'wrist'), ('crank', 'coupler', 'rocker', 'elbow'), ('crank',)):
            theirs[JointState].publish(state_of(later, *names))
        for parent, child in (('world', 'base_link'), ('base_link', 'crank'), ('world', 'crank2')):
            theirs[TFMessage].publish(frame_of(later, parent, child))
        theirs[TFMessage].publish(TFMessage())
        theirs[Clock].publish(Clock(clock=stamp(later)))
        mine[JointState].publish(state_of(0.25))
        mine[TFMessage].publish(frame_of(0.5, 'world', 'crank'))
        reports.publish(Progress(node='linkage', time=1.0, header=Header(stamp=stamp(1.0))))
        spin_until(lambda: all(recorder.writer.counts[topics[k]] for k in (JointState, TFMessage)))
        spin_until(lambda: recorder.partners.reports)
    finally:
        for node in (recorder, partner):
            executor.remove_node(node)
        for node in (recorder, partner, robot):
            node.destroy_node()
    with bag.open('rb') as stream:
        messages = make_reader(stream).iter_messages([*topics.values(), '/progress'])
        found = [(channel.topic, message.log_time) for _, channel, message in messages]
    assert found == [
        (topics[JointState], 250_000_000),
        (topics[TFMessage], 500_000_000),
        ('/progress', 1_000_000_000),
    ]


@pytest.mark.parametrize('prefix', ['', 'left/', 'a&b/'])
@pytest.mark.usefixtures('network')
def test_a_description_in_a_bag_is_that_of_its_machine(prefix, tmp_path):
    """One of a robot, heard first, was there in its place, and ours in the bag of the next run."""
    bag, arm = tmp_path / 'run.mcap', '<robot name="arm"><link name="world"/></robot>'
    own = to_urdf(load_scene(SCENE), prefix)
    given = {'scene': SCENE, 'file': str(bag), 'partners': 'linkage', 'frame_prefix': prefix}
    partner, robot, executor, heard = Node('linkage'), Node('arm'), SingleThreadedExecutor(), []
    partner.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
    partner.create_subscription(String, 'robot_description', heard.append, LATCHED)
    reports = partner.create_publisher(Progress, 'progress', RESULTS)
    mine, theirs = (
        node.create_publisher(String, 'robot_description', LATCHED) for node in (partner, robot)
    )
    theirs.publish(String(data=arm))
    recorder = Recorder([Parameter(key, value=value) for key, value in given.items()])
    for node in (partner, recorder):
        executor.add_node(node)

    def spin_until(condition):
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or condition())

    try:
        spin_until(lambda: recorder.ready and heard)
        for publisher, text in ((mine, own), (theirs, arm)):  # the last may hide the one before
            publisher.publish(String(data=text))
        spin_until(lambda: [m.data for m in heard[1:]][-1:] == [arm])
        reports.publish(Progress(node='linkage', time=1.0, header=Header(stamp=stamp(1.0))))
        spin_until(lambda: recorder.partners.reports)
        spin_until(lambda: recorder.writer.counts['/robot_description'])
    finally:
        for node in (recorder, partner):
            executor.remove_node(node)
        for node in (recorder, partner, robot):
            node.destroy_node()
    assert [m.data for _, m, _ in read_bag(bag).messages('/robot_description')] == [own]


@pytest.mark.parametrize('remapped', [False, True])
@pytest.mark.usefixtures('network')
def test_a_clock_in_a_bag_is_that_of_its_machine_alone(remapped, tmp_path, monkeypatch, capfd):
    """Of two, a bag had both in turn, and its time went back; it does not wait for an end then."""
    bag = tmp_path / 'run.mcap'
    given = {'scene': SCENE, 'file': str(bag), 'partners': 'crank_drive'}
    drive, left, executor = (
        Node('crank_drive'),
        Node('crank_drive', namespace='/left'),
        SingleThreadedExecutor(),
    )
    rules = ['--ros-args', '-r', '/clock:=time'] * remapped
    monkeypatch.setattr(drive.context, 'arguments', parse_arguments(rules))
    drive.create_subscription(Progress, 'progress', lambda _: None, RESULTS)
    recorder = Recorder([Parameter(key, value=value) for key, value in given.items()])
    topic = recorder.resolve_topic_name('/clock')
    mine, theirs = (node.create_publisher(Clock, topic, CLOCK) for node in (drive, left))
    reports = drive.create_publisher(Progress, 'progress', RESULTS)
    for node in (drive, recorder):
        executor.add_node(node)

    def spin_until(condition):
        assert eventually(lambda: executor.spin_once(timeout_sec=0.01) or condition())

    def report(t, **more):
        header = Header(stamp=stamp(t))
        reports.publish(Progress(node='crank_drive', time=t, header=header, **more))
        spin_until(lambda: recorder.partners.time == t)

    try:
        spin_until(lambda: recorder.ready)
        report(1.0)
        for t, publisher in ((0.5, mine), (0.9, theirs), (0.6, mine)):
            publisher.publish(Clock(clock=stamp(t)))
        report(1.5)
        report(2.0, finished=True)
        spin_until(lambda: recorder.done)
    finally:
        for node in (recorder, drive):
            executor.remove_node(node)
        for node in (recorder, drive, left):
            node.destroy_node()
    assert not read_bag(bag).topics[topic].count
    said = f'/left/crank_drive publishes {topic}, too: meanwhile it is not recorded'
    assert capfd.readouterr().err.count(said) == 1
