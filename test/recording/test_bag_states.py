"""Bags in every state: just ended, old, of a later version, empty, cut short, of one segment."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bags import messages_of
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, Writer
from running import run as command
from running import run_json

import mechanism_sim as ms
from mechanism_sim.analysis.record import read_record
from mechanism_sim.errors import InputError
from mechanism_sim.messages import message_class, serialize
from mechanism_sim.messages.events import describe
from mechanism_sim.messages.segments import motion_of, pack
from mechanism_sim.nodes import player
from mechanism_sim.nodes.player import playable
from mechanism_sim.recording.inventory import info
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
from mechanism_sim.studies.run_bag import RunBag
from ros_interfaces.stamps import nanoseconds

RUN = 'run', 'four_bar_clearance', '--duration', '0.20126832204367018'
SOFT = {'loads': {'rub': {'at': 'piston', 'force': ['sqrt(5.5 - t)', 0]}},
        'drive': {'speed': 60.0, 'torque': {}}}  # fmt: skip
READERS = {
    'bag info': [],
    'analyze': [],
    'report': ['-o', 'x.html'],
    'plot': ['velocity.crank', '-o', 'x.svg'],
    'animate': ['-o', 'x.gif', '--fps', '5'],
    'animate -o x.wav': [],
    'thesis experiment': [],
}


@pytest.fixture(scope='module')
def ended(tmp_path_factory):
    """A run whose last batch of 256 steps ends with it, and what `run` said of it."""
    path = tmp_path_factory.mktemp('ended') / 'd.mcap'
    return path, run_json(*RUN, '--record', str(path))


@pytest.mark.slow
@pytest.mark.network
def test_a_run_that_ends_with_a_batch_says_nothing_twice(ended):
    """Another author's reader finds no message without segments, and the motion whole."""
    path, _ = ended
    messages = messages_of(path, '/motion')
    assert messages
    assert all(m.segments for m in messages)
    ends = [m.start[-1] + m.duration[-1] for m in messages]
    np.testing.assert_allclose(ends[:-1], [m.start[0] for m in messages[1:]], rtol=1e-15)
    assert ends[-1] == pytest.approx(0.20126832204367018, rel=1e-15)
    assert messages[-1].known_until == pytest.approx(ends[-1], rel=1e-15)


@pytest.mark.slow
@pytest.mark.network
def test_run_info_and_report_say_the_same_of_time(ended, tmp_path):
    path, outcome = ended
    found = run_json('bag', 'info', str(path))
    assert found['wall_time'] == outcome['run_time'] > 0.0
    assert found['duration'] == pytest.approx(outcome['duration'], abs=1e-9)
    assert found['realtime_factor'] == pytest.approx(outcome['realtime_factor'], rel=1e-7)
    with path.open('rb') as file:
        (told,) = {m.metadata.get('wall_time') for m in make_reader(file).iter_metadata()
                   if m.name == 'mechanism_sim'} - {None}  # fmt: skip
    assert float(told) == found['wall_time'] <= outcome['wall_time']
    assert command('report', str(path), '-o', str(tmp_path / 'r.html')).returncode == 0
    page = (tmp_path / 'r.html').read_text(encoding='utf-8')
    (factor,) = re.findall(r'real-time factor</th><td>([^<]*)<', page)
    assert float(factor) == pytest.approx(found['realtime_factor'], rel=5e-3)
    text = command('bag', 'info', str(path)).stdout
    assert f'in {found["wall_time"]:.3g} s, {found["realtime_factor"]:.3g} x real time' in text


def written(path, machine, motions, scene=True):
    """A bag of motion messages as they are."""
    names = machine.physics.coordinates, machine.physics.clearances
    with BagWriter(path) as writer:
        for topic, kind in (('/scene', 'std_msgs/msg/String'),
                            ('/motion', 'mechanism_sim/msg/Motion')):  # fmt: skip
            writer.add_topic(topic, kind, Qos())
        if scene:
            text = message_class('std_msgs/msg/String')(data=describe(machine))
            writer.write('/scene', serialize(text), 0)
        for motion in motions:
            writer.write('/motion', serialize(pack(motion, *names, 0.0)), 0)
    return path


@pytest.fixture(scope='module')
def simulated():
    machine = ms.load_scene('four_bar_clearance')
    return machine, ms.simulate(machine, duration=0.1)


@pytest.mark.slow
def test_old_bags_may_hold_messages_without_segments(simulated, tmp_path):
    """Before, between and after those with some; what was refused is read."""
    machine, solution = simulated
    none = machine.start().drain()[0]
    assert not len(none)
    halves = [solution.motion.between(a, b) for a, b in ((0.0, 0.05), (0.05, 0.1))]
    path = written(tmp_path / 'old.mcap', machine, [none, halves[0], none, halves[1], none])
    assert motion_of(pack(none, machine.physics.coordinates, ('coupler_rocker',), 0.0)) is not None
    record = read_record(path)
    t = np.linspace(0.0, 0.1, 50)
    sampled = solution.sample(t)
    for name, row in record.piece.sample(t).items():
        if name.startswith(('position', 'velocity', 'normal')):
            expected = sampled[name]
            np.testing.assert_allclose(row, expected, rtol=1e-9, atol=1e-9 * abs(expected).max())
    for kind in ('report', 'plot', 'animate'):
        done = command(kind, str(path), *_within(tmp_path, READERS[kind]))
        assert done.returncode == 0, done.stderr


def _within(folder, arguments):
    return [str(folder / x) if x.startswith('x.') else x for x in arguments]


# --- versions -----------------------------------------------------------------------------------


def test_a_bag_of_a_later_version_names_what_reads_it(simulated, tmp_path, monkeypatch):
    machine, solution = simulated
    monkeypatch.setattr('mechanism_sim.recording.writer.VERSION', 7)
    monkeypatch.setattr('mechanism_sim.recording.writer.installed_version', lambda: '4.2.0')
    path = written(tmp_path / 'later.mcap', machine, [solution.motion])
    done = command('report', str(path), '-o', str(tmp_path / 'x.html'))
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert 'is a bag of version 7' in done.stderr
    assert 'mechanism_sim 4.2.0 reads it' in done.stderr
    said = info(path)  # what is in it is listed all the same
    assert (said.version, said.package, said.messages) == ('7', '4.2.0', 2)
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(path.read_bytes()[:-1])
    assert info(cut).version == '7'


def test_a_bag_that_does_not_say_its_version_is_read(simulated, tmp_path, monkeypatch):
    machine, solution = simulated
    monkeypatch.setattr('mechanism_sim.recording.writer.RECORDING', 'another')
    path = written(tmp_path / 'first.mcap', machine, [solution.motion])
    assert read_bag(path).version == '0'
    assert read_record(path).digest() == read_record(path).digest()


def test_a_type_that_was_another_names_what_reads_it(simulated, tmp_path, monkeypatch):
    machine, solution = simulated
    monkeypatch.setattr('mechanism_sim.recording.writer.installed_version', lambda: '0.0.9')
    monkeypatch.setattr('mechanism_sim.recording.writer.type_hash', lambda _: 'RIHS01_' + '0' * 64)
    path = written(tmp_path / 'older.mcap', machine, [solution.motion])
    with pytest.raises(InputError, match=r'another type when this.*mechanism_sim 0\.0\.9 reads'):
        list(read_bag(path).messages('/motion'))


def test_reactions_of_before_bearing_moments_name_what_reads_them(tmp_path):
    """A bag of version 4, whose joint_reactions say nothing of what is out of the plane."""
    path = tmp_path / 'fourth.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata('mechanism_sim', {'version': '4', 'package': '0.0.9'})
        name, then = 'mechanism_sim/msg/JointReactions', '2c08d1f6a362d61e5b3843be3750f6c7'
        schema = writer.register_schema(name, 'ros2msg', b'float64[] force_x')
        kind = {'topic_type_hash': f'RIHS01_{then}2e136bf0301eae574f78e8083d50ceda'}
        channel = writer.register_channel('/joint_reactions', 'cdr', schema, kind)
        writer.add_message(channel, 0, bytes(8), 0)
        writer.finish()
    assert info(path).version == '4'
    done = command('analyze', str(path))
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert 'JointReactions was another type when this was recorded' in done.stderr
    assert 'mechanism_sim 0.0.9 reads it' in done.stderr


def test_signals_of_before_one_block_for_all_sensors_name_what_reads_them(tmp_path):
    """A bag of version 1, as another author's writer makes it."""
    path = tmp_path / 'first.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata('mechanism_sim', {'version': '1', 'package': '0.0.9'})
        name = 'mechanism_sim/msg/AccelerometerBlock'
        schema = writer.register_schema(name, 'ros2msg', b'float64[] acceleration')
        channel = writer.register_channel('/accelerometer/rocker', 'cdr', schema)
        writer.add_message(channel, 0, bytes(8), 0)
        writer.finish()
    assert info(path).version == '1'
    with pytest.raises(InputError, match=r'bags before version 2 .*mechanism_sim 0\.0\.9 reads'):
        read_record(path)
    done = command('analyze', str(path))
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)


# --- every command that reads bags --------------------------------------------------------------


def within_first_chunk(data: bytes) -> int:
    """Offset just within the first chunk, of which nothing can be read."""
    offset = len(MCAP0_MAGIC)
    while data[offset] != Opcode.CHUNK:
        offset += 9 + int.from_bytes(data[offset + 1 : offset + 9], 'little')
    return offset + 200


@pytest.fixture(scope='module')
def states(ended, simulated, tmp_path_factory):
    """Bags by state."""
    folder, (machine, solution) = tmp_path_factory.mktemp('states'), simulated
    whole = ended[0].read_bytes()
    found = {name: folder / f'{name}.mcap' for name in ('empty', 'early', 'late', 'one', 'failed')}
    BagWriter(found['empty']).close()
    found['early'].write_bytes(whole[: within_first_chunk(whole)])
    found['late'].write_bytes(whole[: 9 * len(whole) // 10])
    with RunBag(found['one'], machine, 0.1) as bag:
        first = solution.motion.between(0.0, float(solution.motion.curve.start[1]))
        bag.add(replace(solution, motion=first, impacts=[], modes=[]))
    sets = [x for key, value in SOFT.items() for x in ('--set', f'{key}={value}')]
    run = 'run', 'slider_crank', *sets, '--duration', '6', '--record', str(found['failed'])
    done = command(*run)
    said = "the formula 'sqrt(5.5 - t)' has no value"
    assert (done.returncode, done.stderr.count(said)) == (1, 1)
    return found


NOTHING = 'holds no message'
EXPECTED = {
    'empty': dict.fromkeys(READERS, NOTHING) | {'bag info': ''},
    'early': dict.fromkeys(READERS, NOTHING) | {'bag info': ''},
    'late': dict.fromkeys(READERS, '')
    | {'thesis experiment': 'no sensor reads accelerations across the coupler'},
    'one': dict.fromkeys(READERS, '')
    | {'animate -o x.wav': 'there is no sound', 'thesis experiment': 'whole turns of crank'},
    'failed': dict.fromkeys(READERS, '')
    | {
        'animate -o x.wav': 'there is no sound',
        'thesis experiment': 'the experiment is that of a four_bar',
    },
}


@pytest.mark.network
@pytest.mark.sample(5)
@pytest.mark.parametrize('reader', READERS)
@pytest.mark.parametrize('state', EXPECTED)
def test_every_command_reads_it_or_says_why_not(states, state, reader, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where sounds are written
    path, expected = states[state], EXPECTED[state][reader]
    if reader == 'thesis experiment':
        (tmp_path / path.name).write_bytes(path.read_bytes())
    source = str(tmp_path if reader == 'thesis experiment' else path)
    done = command(*reader.split(), source, *_within(tmp_path, READERS[reader]))
    assert done.returncode == (2 if expected else 0), done.stderr
    told = done.stderr.splitlines()
    if expected:
        assert expected in told[-1]
        assert path.name in told[-1] or reader == 'animate -o x.wav'
    elif state == 'late' and reader not in {'bag info', 'analyze'}:
        assert 'was cut short' in told[0]


@pytest.mark.network
def test_what_was_said_before_a_failure_is_in_the_bag(states):
    """The scene, and the motion up to the batch that could not be trusted."""
    record = read_record(states['failed'])
    assert record.machine.name == 'slider_crank'
    assert record.end > 0.0
    assert len(messages_of(states['failed'], '/scene')) == 1


@pytest.mark.slow
@pytest.mark.network
def test_what_is_left_of_a_signal_is_fitted_and_none_is_refused(states):
    fit = '--fit', 'radial', '--rounds', '16', '--workers', '1', '--json'
    left = command('analyze', str(states['late']), *fit)
    assert left.returncode == 0, left.stderr
    assert json.loads(left.stdout)['parameters']['radial']['value'] == pytest.approx(
        2.54e-4, rel=1e-6
    )
    none = command('analyze', str(states['empty']), *fit)
    assert (none.returncode, none.stderr.count('\n')) == (2, 1)
    assert f'{states["empty"]} holds no signal' in none.stderr


# --- bags of others -----------------------------------------------------------------------------


def in_flatbuffers(path, also=()):
    """A bag of ROS-like topics whose messages are in an encoding that is not read here.

    Parameters
    ----------
    also : topics of ``std_msgs/msg/Float64`` beside it
    """
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema('need_ack', 'flatbuffer', b'')
        channel = writer.register_channel('/msg/rx/need_ack', 'flatbuffer', schema)
        for k in range(3):
            writer.add_message(channel, k * 10**7, b'\0\0', k * 10**7)
        for topic in also:
            schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data')
            channel = writer.register_channel(topic, 'cdr', schema)
            writer.add_message(channel, 0, b'\0\1\0\0' + bytes(8), 0)
        writer.finish()
    return path


@pytest.mark.network
@pytest.mark.parametrize('options', [(), ('--json',)])
def test_a_bag_without_anything_that_can_be_plotted_is_named(states, tmp_path, options):
    path = in_flatbuffers(tmp_path / 'other.mcap')
    for bag, why in ((path, '/msg/rx/need_ack [need_ack, flatbuffer]'),
                     (states['empty'], 'it has no messages')):  # fmt: skip
        done = command('plot', str(bag), *options)
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
        assert f'{bag} holds nothing that can be plotted: ' in done.stderr
        assert why in done.stderr


def test_topics_that_cannot_be_read_are_said_beside_those_that_can(tmp_path):
    done = command('plot', str(in_flatbuffers(tmp_path / 'both.mcap', ['/speed'])))
    assert (done.returncode, done.stdout.split()) == (0, ['/speed.data'])
    assert 'topics that cannot be read are left out: /msg/rx/need_ack' in done.stderr


@pytest.mark.parametrize('reader', [*READERS, 'bag recover', 'bag play'])
def test_damaged_bags_in_other_forms_are_refused_as_bags(reader, tmp_path):
    """SQLite, alone and in its folder; what is refused is not taken for a scene."""
    file = tmp_path / 'bag' / 'bag_0.db3'
    file.parent.mkdir()
    file.write_bytes(b'SQLite format 3\0' + bytes(100))
    (file.parent / 'metadata.yaml').write_text('rosbag2_bagfile_information: {version: 4}')
    for source in (file, file.parent):
        options = _within(tmp_path, READERS.get(reader, []))
        done = command(*reader.split(), str(source), *options, refused=True)
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
        words = {'thesis experiment': '', 'bag recover': 'is not an MCAP file: ros2 bag itself'}
        assert words.get(reader, 'is not SQLite, or damaged') in done.stderr


@pytest.mark.network
def test_a_bag_without_messages_is_not_played(states):
    done = command('bag', 'play', str(states['empty']), refused=True)
    assert done.returncode == 2
    assert 'holds nothing that can be played: it has no messages' in done.stderr


@pytest.mark.network
@pytest.mark.parametrize('start', ['100', '-1'])
def test_a_bag_is_not_played_from_where_it_is_not(ended, start):
    done = command('bag', 'play', str(ended[0]), f'--from={start}', refused=True)
    assert done.returncode == 2
    assert f'--from {start}: {ended[0]} has messages from 0 to 0.20' in done.stderr


THING = 'is JSON without a ROS 2 type'


@pytest.fixture
def others(tmp_path):
    """A bag of another program, with a topic of ROS or without."""

    def write(types):
        path = tmp_path / 'others.mcap'
        with path.open('wb') as file:
            writer = Writer(file)
            writer.start()
            for name, (encoding, kind) in types.items():
                schema = writer.register_schema(kind, 'ros2msg', b'string data')
                channel = writer.register_channel(name, encoding, schema)
                data = (
                    serialize(message_class('std_msgs/msg/String')(data='x'))
                    if encoding == 'cdr'
                    else b'{"x": 1}'
                )
                writer.add_message(channel, log_time=0, publish_time=0, data=data)
            writer.finish()
        return path

    return write


@pytest.mark.parametrize(
    ('topics', 'asked', 'said'),
    [
        ({'/a': ('json', 'A')}, (), f'/a {THING}: it cannot be published'),
        ({'/a': ('json', 'A'), '/b': ('json', 'A')}, (),
         f'/a {THING}, /b {THING}: they cannot be published'),
        ({'/a': ('json', 'A'), '/s': ('cdr', 'std_msgs/msg/String')}, ('--topics', '/s', '/a'),
         f'/a {THING}: it cannot be published'),
        ({'/x': ('cdr', 'other/msg/X')}, (),
         '/x is other/msg/X, which is not known here: it cannot be published'),
    ],
)  # fmt: skip
def test_a_bag_of_which_nothing_can_be_published_is_refused(others, topics, asked, said):
    bag = others(topics)
    done = command('bag', 'play', str(bag), *asked, refused=True)
    assert (done.returncode, done.stderr) == (2, f'mechanism-sim: {bag}: {said}\n')


def test_topics_that_cannot_be_published_are_named_and_the_others_played(others, capsys):
    bag = others({'/a': ('json', 'A'), '/s': ('cdr', 'std_msgs/msg/String')})
    assert playable(read_bag(bag)) == playable(read_bag(bag), ['/s']) == ['/s']
    said = f'mechanism-sim: {bag}: /a {THING}: it cannot be published\n'
    assert capsys.readouterr().err == said  # of the first; who asks for a topic misses no other


class _Stage:
    """A node whose publishers note what is published when, by a clock that sleeping sets."""

    def __init__(self, monkeypatch):
        self.now, self.seen = 0.0, []
        clock = SimpleNamespace(monotonic=lambda: self.now, sleep=self._sleep)
        monkeypatch.setattr(player, 'time', clock)

    def _sleep(self, seconds):
        self.now += max(seconds, 1e-9)

    def get_publishers_info_by_topic(self, _topic):
        return []

    def create_publisher(self, _kind, topic, qos):
        def publish(message):
            what = nanoseconds(message.clock) if topic == '/clock' else message.data
            self.seen.append((self.now - self.began, topic, what))

        return SimpleNamespace(publish=publish, qos_profile=qos, get_subscription_count=self._look)

    def _look(self):
        self.began = self.now + 0.05  # the last look is before the first message
        return 1


@pytest.mark.parametrize('rate', [1.0, 0.25, 0.0])
def test_messages_are_played_when_they_are_due_not_as_they_lie_in_the_file(
    rate, tmp_path, monkeypatch
):
    """Nodes record ahead and topic by topic: what is announced for the end of a batch is first."""
    path, text = tmp_path / 'ahead.mcap', message_class('std_msgs/msg/String')
    log = [('/end', 30), ('/a', 0), ('/a', 10), ('/a', 20), ('/b', 5), ('/b', 10), ('/b', 25),
           ('/end', 60), ('/a', 40), ('/a', 50), ('/b', 35), ('/b', 50)]  # fmt: skip
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        channels = {x: writer.register_channel(x, 'cdr', schema) for x in ('/end', '/a', '/b')}
        for k, (topic, at) in enumerate(log):
            data = serialize(text(data=str(k)))
            writer.add_message(channels[topic], at * 10**8, data, at * 10**8)
        writer.finish()
    stage, bag = _Stage(monkeypatch), read_bag(path)
    assert player.BagPlayer(stage, 10.0).play(bag, [*bag.topics], rate) == len(log)
    due = sorted((at, k) for k, (_, at) in enumerate(log))
    speed = 0.1 / rate if rate else 0.0
    assert stage.seen == [
        (pytest.approx(at * speed, abs=1e-6), log[k][0], str(k)) for at, k in due
    ]
    assert [t for _, _, t in bag.messages()] == [at * 10**8 for _, at in log]


@pytest.mark.parametrize('rate', [1.0, 4.0])
def test_the_clock_of_a_player_goes_on_between_messages(rate, tmp_path, monkeypatch):
    """It came with messages only: who waits for simulated time heard nothing for seconds."""
    path, text = tmp_path / 'rare.mcap', message_class('std_msgs/msg/String')
    start = 1_700_000_000
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        channel = writer.register_channel('/a', 'cdr', schema)
        for k in (0, 3, 5):
            at = (start + k) * 10**9
            writer.add_message(channel, at, serialize(text(data=str(k))), at)
        writer.finish()
    stage, bag = _Stage(monkeypatch), read_bag(path)
    assert player.BagPlayer(stage, 10.0).play(bag, ['/a'], rate, clock=10.0) == 3
    said = [(k, (ns - start * 10**9) / 1e9) for k, topic, ns in stage.seen if topic == '/clock']
    assert [wall * rate for wall, _ in said] == pytest.approx([t for _, t in said], abs=1e-5)
    steps = np.diff([t for _, t in said])
    assert (steps > 0.0).all()
    assert steps.max() < 0.1 + 1e-5
    assert said[-1][1] > 4.9
    messages = [(wall * rate, x) for wall, topic, x in stage.seen if topic == '/a']
    assert messages == [(pytest.approx(k, abs=1e-5), str(k)) for k in (0, 3, 5)]
