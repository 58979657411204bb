"""Bags: read back by readers that are not ours, killed, cut, damaged, refused."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import threading
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2 import Reader
from running import run, run_json
from zstandard import ZstdError

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.messages import (
    definition,
    message_class,
    own_messages,
    serialize,
    type_hash,
)
from mechanism_sim.nodes.qos import profile_of
from mechanism_sim.recording.inventory import info, recover, render_info
from mechanism_sim.recording.reader import read_bag
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter

RESULT = Qos(history='keep_all', depth=0)
LATCHED = Qos(durability='transient_local', depth=1)
STRING = 'std_msgs/msg/String'


def header(nanoseconds, frame='ground'):
    sec, nanosec = divmod(nanoseconds, 10**9)
    stamp = message_class('builtin_interfaces/msg/Time')(sec=sec, nanosec=nanosec)
    return message_class('std_msgs/msg/Header')(stamp=stamp, frame_id=frame)


def text(data):
    return serialize(message_class(STRING)(data=data))


def one_of_each(k):
    """Messages of every shape a field can have, number k of each: (topic, type, message)."""
    floats = np.linspace(-1.0, 1.0, 3 + k % 4)
    stamp = 10**9 * k + 7
    make = {
        '/scene': (STRING, {'data': f'four_bar_clearance ü {k}'}),
        '/clock': ('rosgraph_msgs/msg/Clock', {'clock': header(stamp).stamp}),
        '/joint_states': (
            'sensor_msgs/msg/JointState',
            {
                'header': header(stamp),
                'name': ['crank', 'rocker'],
                'position': floats[:2],
                'velocity': 2 * floats[:2],
                'effort': np.zeros(2),
            },
        ),
        '/motion': (
            'mechanism_sim/msg/Motion',
            {
                'header': header(stamp),
                'coordinates': ['crank'],
                'segments': 2,
                'degree': 1,
                'start': np.array([0.0, 1.0]) + k,
                'start_low': np.array([0.0, 1e-18]),
                'duration': np.ones(2),
                'turns': np.array([k, -k], dtype=np.int64),
                'coefficients': np.array([0.1, 0.2, 0.3, np.nextafter(0.4, 1)]),
                'joints': ['coupler_rocker'],
                'modes': np.array([1, 2], dtype=np.uint8),
            },
        ),
        '/impacts': (
            'mechanism_sim/msg/Impact',
            {
                'header': header(stamp, frame=''),
                'time': k + 1e-13,
                'index': 2**63 + k,
                'joint': 'coupler_rocker',
                'normal_angle': 0.5,
                'approach_speed': 0.1,
                'rebound_speed': 0.05,
                'normal_impulse': 1e-3,
                'tangential_impulse': -0.0,
                'energy_loss': 1e-300,
                'drive_impulse': -1.0,
                'ends_chatter': bool(k % 2),
            },
        ),
        '/progress': (
            'mechanism_sim/msg/Progress',
            {
                'header': header(stamp),
                'node': 'linkage',
                'time': float(k),
                'finished': k == 2,
                'topics': [] if k == 0 else ['/motion', '/impacts'],
                'counts': np.array([] if k == 0 else [k, 2**64 - 1], dtype=np.uint64),
            },
        ),
    }
    return [(topic, name, message_class(name)(**fields)) for topic, (name, fields) in make.items()]


def plain(value):
    """Whatever a reader makes of a message, as dictionaries, lists and numbers."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple, bytes)):
        return [plain(item) for item in value]
    slots = getattr(value, '__slots__', None) or getattr(value, '__dict__', None)
    if slots is None:
        return value
    names = [name.lstrip('_') for name in slots]
    return {
        name: plain(getattr(value, name))
        for name in names
        if name and name not in {'type', 'full_text', 'msgtype__'} and name.islower()
    }


@pytest.fixture
def bag(tmp_path):
    """A bag with three of each message, and what is in it: (path, [(topic, time, message)])."""
    path, sent = tmp_path / 'run.mcap', []
    with BagWriter(path) as writer:
        for k in range(3):
            for topic, name, message in one_of_each(k):
                writer.add_topic(topic, name, LATCHED if topic == '/scene' else RESULT)
                writer.write(topic, serialize(message), 10**9 * k)
                sent.append((topic, 10**9 * k, plain(message)))
            writer.flush()
    return path, sent


def test_foxglove_decoder_reads_every_message_equal(bag):
    path, sent = bag
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        got = [
            (found.channel.topic, found.message.log_time, plain(found.decoded_message))
            for found in reader.iter_decoded_messages(log_time_order=False)
        ]
    assert got == sent


def test_rosbags_reads_every_message_equal(bag):
    path, sent = bag
    with AnyReader([path]) as reader:
        got = [
            (connection.topic, log_time, plain(reader.deserialize(data, connection.msgtype)))
            for connection, log_time, data in reader.messages()
        ]
        counts = {topic: found.msgcount for topic, found in reader.topics.items()}
    # rosbags orders by time alone
    assert sorted(got, key=lambda item: item[:2]) == sorted(sent, key=lambda item: item[:2])
    assert counts == dict.fromkeys({topic for topic, _, _ in sent}, 3)


@pytest.mark.parametrize('name', own_messages())
def test_others_understand_each_of_our_types(tmp_path, name):
    kind = f'mechanism_sim/msg/{name}'
    with BagWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic('/a', kind, RESULT)
        writer.write('/a', serialize(message_class(kind)()), 0)
    expected = plain(message_class(kind)())
    with writer.path.open('rb') as stream:
        [found] = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
    with AnyReader([writer.path]) as reader:
        [(connection, _, data)] = reader.messages()
        other = reader.deserialize(data, connection.msgtype)
    assert plain(found.decoded_message) == plain(other) == expected


def test_our_reader_reads_every_message_equal(bag):
    path, sent = bag
    found = read_bag(path)
    assert [(topic, at, plain(message)) for topic, message, at in found.messages()] == sent
    impacts = [plain(message) for _, message, _ in found.messages('/impacts')]
    assert impacts == [message for topic, _, message in sent if topic == '/impacts']
    assert found.complete
    assert (found.start, found.end) == (0, 2 * 10**9)
    assert found.topics['/motion'].type == 'mechanism_sim/msg/Motion'
    assert {topic.count for topic in found.topics.values()} == {3}


def test_quality_of_service_is_read_as_offered(bag):
    path, _ = bag
    with Reader(path) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    [scene], [impacts] = offered['/scene'], offered['/impacts']
    assert scene.durability == QosDurability.TRANSIENT_LOCAL
    assert (scene.history, scene.depth) == (QosHistory.KEEP_LAST, 1)
    assert impacts.durability == QosDurability.VOLATILE
    assert impacts.history == QosHistory.KEEP_ALL
    assert impacts.reliability == QosReliability.RELIABLE
    assert read_bag(path).topics['/scene'].qos == LATCHED


def test_the_file_is_what_rosbag2_expects(bag):
    path, sent = bag
    with path.open('rb') as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        documents = [
            yaml.safe_load(record.metadata['serialized_metadata'])
            for record in reader.iter_metadata()
            if record.name == 'rosbag2'
        ]
    assert [document['version'] for document in documents] == [9, 9]
    last = documents[-1]
    assert last['message_count'] == len(sent)
    assert last['duration'] == {'nanoseconds': 2 * 10**9}
    assert last['relative_file_paths'] == [last['files'][0]['path']] == ['run.mcap']
    topics = {t['topic_metadata']['name']: t for t in last['topics_with_message_count']}
    for channel in summary.channels.values():
        listed = topics[channel.topic]['topic_metadata']
        profiles = yaml.safe_load(channel.metadata['offered_qos_profiles'])
        assert profiles == listed['offered_qos_profiles']
        assert channel.metadata['topic_type_hash'] == listed['type_description_hash']
        assert channel.metadata['topic_type_hash'] == type_hash(listed['type'])
        assert summary.schemas[channel.schema_id].name == listed['type']
        assert summary.schemas[channel.schema_id].encoding == 'ros2msg'
        assert channel.message_encoding == 'cdr'
    assert summary.statistics.message_count == len(sent)
    assert {index.compression for index in summary.chunk_indexes} == {'zstd'}
    assert all(index.message_index_offsets for index in summary.chunk_indexes)


def test_every_checksum_holds(bag):
    path, sent = bag
    with path.open('rb') as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    with path.open('rb') as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if type(r) is Chunk]
    assert sum(isinstance(record, Message) for record in records) == len(sent)
    assert all(chunk.uncompressed_crc for chunk in chunks)
    assert next(r for r in records if isinstance(r, DataEnd)).data_section_crc


CHILD = """
import sys, time
from mechanism_sim.messages import message_class, serialize
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.writer import BagWriter
writer = BagWriter(sys.argv[1])
writer.add_topic('/tick', 'std_msgs/msg/String', Qos())
while True:
    now = time.monotonic_ns()
    writer.write('/tick', serialize(message_class('std_msgs/msg/String')(data=str(now))), now)
    print(now, flush=True)
    time.sleep(0.002)
"""


def streamed(path):
    """Log times that mcap's own streaming reader gets out of a file that may be cut."""
    times = []
    with path.open('rb') as stream:
        try:
            records = StreamReader(stream, validate_crcs=True).records
            times.extend(r.log_time for r in records if isinstance(r, Message))
        except (McapError, ZstdError, struct.error):
            return times
    raise AssertionError('the file is whole')


def whole(path):
    """(topic, message, log time) as mcap's own reader gets them out of a file that is closed."""
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = [(c.topic, m.data, m.log_time)
                 for _, c, m in reader.iter_messages(log_time_order=False)]  # fmt: skip
        assert reader.get_summary().statistics.message_count == len(found)
    return found


@pytest.mark.slow
def test_a_killed_writer_loses_less_than_half_a_second(tmp_path):
    path = tmp_path / 'killed.mcap'
    command = [sys.executable, '-c', CHILD, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        written = [int(child.stdout.readline())]
        while written[-1] - written[0] < 1.3e9:
            written.append(int(child.stdout.readline()))
        assert 'NO: it is still being recorded' in render_info(info(path))
        with pytest.raises(InputError, match='still being recorded'):
            recover(path)
        with pytest.raises(InputError, match='still being recorded'):
            BagWriter(path, overwrite=True)
        child.send_signal(signal.SIGKILL)
        written += [int(line) for line in child.stdout.read().split('\n') if line]
    assert child.returncode == -signal.SIGKILL

    found = read_bag(path)
    assert not found.complete
    ours = [log_time for _, _, log_time in found.messages()]
    assert ours == streamed(path) == written[: len(ours)]
    assert found.topics['/tick'].count == len(ours)
    assert written[-1] - ours[-1] < 0.5e9
    with path.open('rb') as stream:
        first = next(r for r in StreamReader(stream).records if isinstance(r, Metadata))
    assert yaml.safe_load(first.metadata['serialized_metadata'])['version'] == 9

    raw, topics = list(found.raw()), found.topics
    assert f"'mechanism-sim bag recover {path}' closes it" in render_info(info(path))
    assert recover(path).messages == len(ours)
    assert whole(path) == list(read_bag(path).raw()) == raw
    assert (read_bag(path).complete, read_bag(path).topics) == (True, topics)
    assert 'yes, but its recorder was killed' in render_info(info(path))
    with AnyReader([path]) as reader:
        assert [(c.topic, bytes(data), t) for c, t, data in reader.messages()] == raw
    closed = path.stat()
    assert recover(path).was_closed
    assert path.stat() == closed


@pytest.mark.slow
def test_of_a_bag_cut_anywhere_recovery_keeps_what_can_be_read(bag, tmp_path):
    """The pieces of a chunk, too: random bytes are not compressed, blocks have 128 kB."""
    path, dice = tmp_path / 'cut.mcap', np.random.default_rng(0)
    with BagWriter(tmp_path / 'large.mcap') as writer:
        writer.add_topic('/a', STRING, RESULT)
        for k in range(60):
            writer.write('/a', dice.bytes(10_000), k)
    for source in (bag[0], writer.path):
        sent, most = list(read_bag(source).raw()), source.stat().st_size
        counts = []
        for cut in [*range(8), *np.linspace(8, most - 1, 20).astype(int).tolist()]:
            path.write_bytes(source.read_bytes()[:cut])
            before = list(read_bag(path).raw())
            told = recover(path)
            assert whole(path) == before == sent[: len(before)]
            assert (told.messages, told.was_closed) == (len(before), False)
            counts.append(len(before))
        assert counts == sorted(counts)
        assert counts[-1] == len(sent)
    assert len(set(counts)) > 4  # of one chunk


def test_recovery_keeps_what_others_put_into_a_bag(tmp_path):
    path = tmp_path / 'theirs.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start('ros1', 'theirs')
        writer.add_metadata('about', {'a': 'b'})
        writer.add_attachment(1, 2, 'x.txt', 'text/plain', b'x')
        channel = writer.register_channel(
            '/a', 'json', writer.register_schema('A', 'jsonschema', b'{}')
        )
        writer.add_message(channel, 5, b'{}', 6, 7)
        writer.finish()
    path.write_bytes(path.read_bytes()[:-20])
    path.chmod(0o640)
    recover(path)
    assert path.stat().st_mode & 0o777 == 0o640
    with path.open('rb') as stream:
        reader = make_reader(stream)
        (attachment,), (about,) = reader.iter_attachments(), reader.iter_metadata()
        ((schema, _, message),) = reader.iter_messages()
        head = reader.get_header()
    assert (head.profile, head.library) == ('ros1', 'theirs')
    assert (attachment.data, about.metadata, schema.name) == (b'x', {'a': 'b'}, 'A')
    assert (message.log_time, message.publish_time, message.sequence) == (5, 6, 7)


@pytest.mark.parametrize(
    ('time', 'shown'), [(10**9, '1 s'), (1_796_066_498_842_000_000, '1796066498.842 s')]
)
def test_the_command_says_what_it_did(time, shown, tmp_path):
    path = tmp_path / 'a.mcap'
    with BagWriter(path) as writer:
        writer.add_topic('/a', STRING, RESULT)
        writer.write('/a', text('a'), time)
    path.write_bytes(path.read_bytes()[:-1])
    said = run('bag', 'recover', str(path)).stdout
    assert f'{path} is closed: 1 message, up to {shown}\n' in said
    assert 'it is left as it is' in run('bag', 'recover', str(path)).stdout
    assert run_json('bag', 'recover', str(path))['was_closed']
    missing = run('bag', 'recover', 'missing.mcap')
    assert (missing.returncode, missing.stderr.count('\n')) == (2, 1)


def test_flush_makes_everything_readable_at_once(tmp_path):
    path = tmp_path / 'open.mcap'
    writer = BagWriter(path)
    assert not read_bag(path).complete
    writer.add_topic('/a', STRING, RESULT)
    for k in range(5):
        writer.write('/a', text(str(k)), k)
        writer.flush()
        assert [m.data for _, m, _ in read_bag(path).messages()] == [str(i) for i in range(k + 1)]
        assert streamed(path) == list(range(k + 1))
    writer.close()
    assert read_bag(path).complete


def test_write_flushes_by_itself(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr('mechanism_sim.recording.writer.time.monotonic', lambda: now[0])
    with BagWriter(tmp_path / 'slow.mcap') as writer:
        writer.add_topic('/a', STRING, RESULT)
        seen = []
        for k in range(10):
            now[0] = 0.2 * k
            writer.write('/a', text(str(k)), k)
            seen.append(sum(1 for _ in read_bag(writer.path).raw()))
    # after 0.4, 0.8, 1.2 and 1.6 s: never does a quarter of a second's worth wait for longer
    assert seen == [0, 0, 3, 3, 5, 5, 7, 7, 9, 9]


@pytest.mark.parametrize('step', [389, pytest.param(97, marks=pytest.mark.slow)])
def test_a_cut_file_gives_a_prefix_wherever_it_is_cut(bag, tmp_path, step):
    path, sent = bag
    whole, cut = path.read_bytes(), tmp_path / 'cut.mcap'
    longest = 0
    for size in [*range(8, len(whole), step), len(whole) - 1]:
        cut.write_bytes(whole[:size])
        found = read_bag(cut)
        got = [(topic, at, plain(message)) for topic, message, at in found.messages()]
        assert not found.complete
        assert got == sent[: len(got)]
        assert len(got) >= longest
        assert sum(topic.count for topic in found.topics.values()) == len(got)
        longest = len(got)
    assert longest == len(sent)


def second_chunk(path):
    with path.open('rb') as stream:
        return make_reader(stream).get_summary().chunk_indexes[1]


def test_nothing_is_trusted_after_zeros_that_a_power_cut_left(bag, tmp_path):
    path, sent = bag
    whole, cut = path.read_bytes(), tmp_path / 'cut.mcap'
    at = second_chunk(path).chunk_start_offset
    cut.write_bytes(whole[:at] + bytes(18) + whole[at:-100])
    found = read_bag(cut)
    assert not found.complete
    assert len(list(found.messages())) == len(sent) // 3


@pytest.mark.parametrize('where', ['checksum', 'data'])
def test_a_damaged_chunk_is_named(bag, tmp_path, where):
    path, _ = bag
    data, second = bytearray(path.read_bytes()), second_chunk(path)
    offset = second.chunk_start_offset
    data[offset + (9 + 24 if where == 'checksum' else second.chunk_length - 5)] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(InputError, match=f'chunk at byte {offset} is damaged'):
        list(read_bag(path).messages())
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(data[:-100])
    assert {topic.count for topic in read_bag(cut).topics.values()} == {1}


def test_start_and_end_do_not_depend_on_the_order_of_writing(tmp_path):
    with BagWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic('/a', STRING, RESULT)
        for log_time in (5, 2, 9, 4):
            writer.write('/a', text(''), log_time)
            if log_time == 2:
                writer.flush()
        writer.flush()
        cut = read_bag(writer.path)
    whole = read_bag(writer.path)
    assert (whole.start, whole.end) == (cut.start, cut.end) == (2, 9)
    assert [log_time for _, _, log_time in whole.raw()] == [5, 2, 9, 4]


@pytest.mark.parametrize(
    'options',
    [
        {'compression': CompressionType.LZ4},
        {'compression': CompressionType.NONE},
        {'use_chunking': False},
        {'index_types': IndexType.NONE, 'use_statistics': False},
        {'use_statistics': False, 'repeat_channels': False, 'repeat_schemas': False},
    ],
)
def test_files_of_others_are_read(tmp_path, options):
    path = tmp_path / 'foreign.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream, **options)
        writer.start(profile='ros2')
        schema = writer.register_schema(STRING, 'ros2msg', definition(STRING).encode())
        old = {
            'offered_qos_profiles': '- history: 3\n  depth: 0\n  reliability: 1\n  durability: 2'
        }
        first, second = (writer.register_channel('/a', 'cdr', schema, old) for _ in range(2))
        for k in range(4):
            writer.add_message((first, second)[k % 2], k, text(str(k)), k)
        writer.finish()
    found = read_bag(path)
    assert found.complete
    assert found.topics['/a'].count == 4
    assert found.topics['/a'].qos is None
    assert [message.data for _, message, _ in found.messages('/a')] == ['0', '1', '2', '3']
    assert (found.start, found.end) == (0, 3)


@pytest.mark.parametrize(
    ('encoding', 'name', 'reason'),
    [('cbor', STRING, 'is not an encoding that is read'), ('cdr', 'other/msg/X', 'is unknown')],
)
def test_what_is_not_known_here_is_listed_but_not_decoded(tmp_path, encoding, name, reason):
    path = tmp_path / 'foreign.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name, 'ros2msg', b'')
        writer.add_message(writer.register_channel('/a', encoding, schema), 0, b'{}', 0)
        writer.finish()
    assert info(path).topics[0].type == name
    with pytest.raises(InputError, match=reason):
        list(read_bag(path).messages())


@pytest.mark.parametrize('encoding', ['cdr', 'protobuf'])
def test_messages_without_a_schema_are_said_to_have_none(tmp_path, encoding):
    path = tmp_path / 'foreign.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_message(writer.register_channel('/a', encoding, 0), 0, b'{}', 0)
        writer.finish()
    with pytest.raises(InputError, match=r'topic /a: it has no schema, which says the type'):
        list(read_bag(path).messages())


@pytest.mark.parametrize('wrong', [{'depth': 'many'}, {'depth': None}, {'reliability': ['a']},
                                   {'durability': 2}])  # fmt: skip
def test_a_profile_that_is_none_is_unknown_and_the_bag_is_played(tmp_path, wrong):
    path, usual = tmp_path / 'foreign.mcap', profile_of(None)
    profile = {'history': 'keep_last', 'depth': 3, 'reliability': 'reliable',
               'durability': 'volatile'}  # fmt: skip
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(STRING, 'ros2msg', definition(STRING).encode())
        for topic, policies in (('/good', profile), ('/wrong', profile | wrong)):
            told = {'offered_qos_profiles': yaml.safe_dump([policies])}
            writer.add_message(
                writer.register_channel(topic, 'cdr', schema, told), 0, text('x'), 0
            )
        writer.finish()
    found = {name: profile_of(topic.qos).depth for name, topic in read_bag(path).topics.items()}
    assert found == {'/good': 3, '/wrong': usual.depth}
    assert '/wrong' in render_info(info(path))


def test_an_existing_file_is_kept_unless_told(tmp_path):
    path = tmp_path / 'kept.mcap'
    path.write_text('precious')
    with pytest.raises(InputError, match=r'kept\.mcap exists already; choose another name'):
        BagWriter(path)
    assert path.read_text() == 'precious'
    BagWriter(path, overwrite=True).close()
    assert read_bag(path).complete
    assert read_bag(path).topics == {}


@pytest.mark.parametrize('content', [None, 'precious'])
def test_a_writer_that_waits_claims_its_file_and_leaves_it(tmp_path, content):
    path = tmp_path / 'claimed.mcap'
    if content:
        path.write_text(content)
    waiting = BagWriter(path, overwrite=True, wait=True)
    with pytest.raises(InputError, match='is still being recorded'):
        BagWriter(path, overwrite=True)
    waiting.close()
    assert (path.read_text() if path.exists() else None) == content
    with BagWriter(path, overwrite=True, wait=True) as begun:
        begun.begin()
    assert read_bag(path).complete


def test_paths_that_cannot_be_written_or_read(tmp_path):
    (tmp_path / 'text').write_text('not a bag')
    with pytest.raises(InputError, match='there is no directory'):
        BagWriter(tmp_path / 'nowhere' / 'a.mcap')
    with pytest.raises(InputError, match=r'a\.mcap cannot be (created|written: [A-Z].*)\.$'):
        BagWriter('/proc/a.mcap')  # there are folders in which no file can be made
    with pytest.raises(InputError, match='is a directory'):
        BagWriter(tmp_path, overwrite=True)
    with pytest.raises(InputError, match='cannot be written: Not a directory'):
        BagWriter(tmp_path / 'text' / 'a.mcap')
    with pytest.raises(InputError, match='does not exist'):
        read_bag(tmp_path / 'a.mcap')
    with pytest.raises(InputError, match='is not an MCAP file'):
        read_bag(tmp_path / 'text')
    with pytest.raises(InputError, match='is a folder without a bag'):
        read_bag(tmp_path)


def test_unknown_names_are_answered_with_the_nearest(bag):
    path, _ = bag
    with pytest.raises(InputError, match=r'no topic /impact; did you mean /impacts\?'):
        read_bag(path).messages('/impact')
    with pytest.raises(InputError, match='it has /clock, /impacts'):
        read_bag(path).messages(['/clock', 'qqq'])


def test_misuse_of_the_writer_is_refused(tmp_path):
    with BagWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic('/a', STRING, RESULT)
        writer.add_topic('/a', STRING, LATCHED)
        with pytest.raises(InputError, match='is a topic of std_msgs/msg/String'):
            writer.add_topic('/a', 'mechanism_sim/msg/Impact', RESULT)
        with pytest.raises(InputError, match="reliability 'certain' is none of reliable"):
            writer.add_topic('/b', STRING, Qos(reliability='certain'))
        with pytest.raises(InputError, match='add_topic comes first'):
            writer.write('/b', text(''), 0)
        with pytest.raises(InputError, match='before time zero'):
            writer.write('/a', text(''), -1)
        assert writer.counts == {'/a': 0}
    writer.close()
    for action in (writer.flush, lambda: writer.write('/a', text(''), 0)):
        with pytest.raises(RunError, match='is closed already'):
            action()


def test_an_exception_still_leaves_a_whole_file(tmp_path):
    path = tmp_path / 'a.mcap'

    def interrupted():
        with BagWriter(path) as writer:
            writer.add_topic('/a', STRING, RESULT)
            writer.write('/a', text('kept'), 5)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [m.data for _, m, _ in read_bag(path).messages()] == ['kept']
    assert read_bag(path).complete


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_disk_is_said_once():
    with pytest.raises(RunError, match=r'cannot be written any further \(No space left'):
        BagWriter('/dev/full', overwrite=True)


def test_a_disk_that_fills_up_ends_the_recording(tmp_path):
    path = tmp_path / 'a.mcap'
    with BagWriter(path) as writer:
        writer.add_topic('/a', STRING, RESULT)
        writer.write('/a', text('kept'), 1)
        writer.flush()
        with Path('/dev/full').open('wb') as full:
            os.dup2(full.fileno(), writer._stream.fileno())
        writer.write('/a', text('lost'), 2)
        with pytest.raises(RunError, match='what was flushed before stays readable'):
            writer.flush()
        with pytest.raises(RunError, match='is closed already'):
            writer.write('/a', text('late'), 3)
    assert [m.data for _, m, _ in read_bag(path).messages()] == ['kept']


def test_a_type_that_has_changed_since_is_refused(tmp_path, monkeypatch):
    path = tmp_path / 'old.mcap'
    monkeypatch.setattr('mechanism_sim.recording.writer.type_hash', lambda _: 'RIHS01_' + '0' * 64)
    with BagWriter(path) as writer:
        writer.add_topic('/a', STRING, RESULT)
        writer.write('/a', text('?'), 0)
    with pytest.raises(InputError, match='String was another type when this was recorded'):
        list(read_bag(path).messages())
    assert len(list(read_bag(path).raw())) == 1


def test_threads_may_write_together(tmp_path):
    with BagWriter(tmp_path / 'a.mcap') as writer:

        def work(topic):
            writer.add_topic(topic, STRING, RESULT)
            for k in range(500):
                writer.write(topic, text(str(k)), k)
                if k % 50 == 0:
                    writer.flush()

        threads = [threading.Thread(target=work, args=(f'/t{i}',)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert writer.counts == {f'/t{i}': 500 for i in range(4)}
    for topic in read_bag(writer.path).topics:
        data = [message.data for _, message, _ in read_bag(writer.path).messages(topic)]
        assert data == [str(k) for k in range(500)]


def test_reading_needs_a_few_chunks_of_memory_only(tmp_path):
    path, payload = tmp_path / 'large.mcap', text('x' * 20_000)
    with BagWriter(path) as writer:
        writer.add_topic('/a', STRING, RESULT)
        for k in range(2000):
            writer.write('/a', payload, k)
    tracemalloc.start()
    found = read_bag(path)
    assert sum(len(data) for _, data, _ in found.raw()) == 2000 * len(payload)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8e6  # of 40 MB


def test_writing_costs_little_more_than_the_library_below_it(tmp_path):
    """Some 9 us a message on quiet machines: beside the bare writer, whatever the machine does."""
    payload, count, ours, bare = bytes(200), 4_000, [], []
    with BagWriter(tmp_path / 'ours.mcap') as writer, (tmp_path / 'bare.mcap').open('wb') as file:
        writer.add_topic('/a', STRING, RESULT)
        below = Writer(file, chunk_size=1 << 20)
        below.start()
        schema = below.register_schema(STRING, 'ros2msg', b'string data')
        channel = below.register_channel('/a', 'cdr', schema)
        for _ in range(7):
            start = time.thread_time()
            for k in range(count):
                writer.write('/a', payload, k)
            writer.flush()
            middle = time.thread_time()
            for k in range(count):
                below.add_message(channel, k, payload, k)
            ours.append(middle - start)
            bare.append(time.thread_time() - middle)
        below.finish()
    assert min(ours) < 2.5 * min(bare)


def test_a_bag_says_how_long_its_recording_took(tmp_path):
    began = time.monotonic()
    with BagWriter(tmp_path / 'slow.mcap') as writer:
        writer.add_topic('/tick', STRING, Qos())
        time.sleep(0.1)  # nothing is written yet
        for t in (0, 2_000_000_000):
            writer.write('/tick', serialize(message_class(STRING)(data='x')), t)
            time.sleep(0.05)
    whole = info(writer.path)
    assert 0.05 <= whole.wall_time <= time.monotonic() - began - 0.15
    assert f'{2.0 / whole.wall_time:.3g} x real time' in render_info(whole)
    with writer.path.open('rb') as file:
        found = {m.name: m.metadata for m in make_reader(file).iter_metadata()}
    assert float(found['mechanism_sim']['wall_time']) == whole.wall_time
    writer.path.write_bytes(writer.path.read_bytes()[:-1])
    assert info(writer.path).wall_time is None


def test_info_says_what_is_there(bag, tmp_path):
    path, sent = bag
    whole = info(path)
    assert (whole.complete, whole.messages, whole.duration) == (True, len(sent), 2.0)
    assert whole.scene == 'four_bar_clearance ü 0'
    assert whole.compression == 'zstd'
    assert 'mechanism_sim/msg/Impact' in whole.schemas
    assert whole.to_json()['topics'][0]['name'] == '/clock'
    lines = render_info(whole).splitlines()
    assert any(line.split()[:2] == ['/impacts', '3'] for line in lines)

    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(path.read_bytes()[:-1])
    part = info(cut)
    assert (part.complete, part.messages) == (False, len(sent))
    assert 'cut short' in render_info(part)


@pytest.mark.parametrize(
    ('content', 'name'),
    [
        ('geneva', 'geneva'),
        ('name: four_bar\nlinks: {}', 'four_bar'),
        ('{"name": "cam"}', 'cam'),
        ('a: [\nb', 'a: ['),
    ],
)
def test_info_finds_the_name_of_the_scene(tmp_path, content, name):
    with BagWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic('/ns/scene', STRING, LATCHED)
        writer.write('/ns/scene', text(content), 0)
    assert info(writer.path).scene == name


# --- damage -------------------------------------------------------------------------------------


@pytest.fixture
def long_bag(tmp_path):
    """A bag of twenty chunks: ten messages on two topics in each."""
    path, dice = tmp_path / 'long.mcap', np.random.default_rng(1)
    with BagWriter(path) as writer:
        for topic in ('/a', '/b'):
            writer.add_topic(topic, STRING, RESULT)
        for k in range(200):
            word = text(dice.bytes(40).hex())
            writer.write('/ab'[0] + 'ab'[k % 2], word, k * 10**8)
            if k % 10 == 9:
                writer.flush()
    return path


def chunks(path):
    with path.open('rb') as stream:
        found = make_reader(stream).get_summary().chunk_indexes
    return sorted((c.chunk_start_offset, c.chunk_length) for c in found)


def flipped(data, *places):
    data = bytearray(data)
    for place in places:
        data[place] ^= 0xFF
    return bytes(data)


@pytest.mark.parametrize('closed', [False, True])
@pytest.mark.parametrize('where', ['content', 'checksum', 'compression'])
def test_recovery_leaves_out_the_damaged_chunk_and_no_other(long_bag, closed, where):
    sent, (begin, length) = list(read_bag(long_bag).raw()), chunks(long_bag)[3]
    place = {'content': length - 5, 'checksum': 9 + 24, 'compression': 9 + 32}[where]
    whole_file = long_bag.read_bytes()
    damaged = flipped(whole_file if closed else whole_file[:-100], begin + place)
    long_bag.write_bytes(damaged)
    told = recover(long_bag)
    kept = sent[:30] + sent[40:]
    assert whole(long_bag) == list(read_bag(long_bag).raw()) == kept
    assert (told.was_closed, told.messages) == (False, 190)
    assert (told.dropped_chunks, told.dropped_bytes) == (1, length)
    assert (told.dropped_start, told.dropped_end) == (3.0, 3.9)
    original = Path(f'{long_bag}.damaged')
    assert told.kept == str(original)
    assert original.read_bytes() == damaged
    assert 'yes, without what was damaged' in render_info(info(long_bag))
    assert recover(long_bag).was_closed
    long_bag.write_bytes(damaged)
    said = run('bag', 'recover', str(long_bag))
    assert f'1 chunk, {length} bytes, of 3 s to 3.9 s' in said.stdout
    assert f'the file as it was is {original}-2' in said.stdout
    assert 'lost is what the file does not hold' not in said.stdout


@pytest.mark.parametrize('closed', [False, True])
@pytest.mark.parametrize('of', ['chunk', 'index'])
@pytest.mark.parametrize('byte', range(9))
def test_recovery_finds_what_is_behind_a_damaged_length(long_bag, closed, of, byte):
    """Or opcode; of a chunk, and of the index of its messages behind it."""
    sent, (begin, length) = list(read_bag(long_bag).raw()), chunks(long_bag)[3]
    data = long_bag.read_bytes() if closed else long_bag.read_bytes()[:-100]
    long_bag.write_bytes(flipped(data, begin + byte + (length if of == 'index' else 0)))
    told = recover(long_bag)
    lost = of == 'chunk' and byte == 0  # it may be any record; its length is said twice
    assert whole(long_bag) == (sent[:30] + sent[40:] if lost else sent)
    foreign = byte == 0 and closed  # a record of another program, by its opcode
    assert bool(told.kept) == (lost or (of == 'index' and not foreign))
    assert recover(long_bag).was_closed


@pytest.mark.slow
def test_whatever_byte_is_damaged_all_other_chunks_are_kept(long_bag):
    """Also of an index: it is made anew."""
    sent, data, dice = list(read_bag(long_bag).raw()), long_bag.read_bytes(), dice_of(2)
    for place in dice.integers(8, len(data), 150):
        long_bag.write_bytes(flipped(data, place))
        if place < 100 and long_bag.read_bytes()[:8] != data[:8]:
            continue
        told = recover(long_bag)
        found = list(read_bag(long_bag).raw())
        assert len(found) in {190, 200}, place
        assert [x for x in sent if x in set(found)] == found
        assert told.messages == len(found)


def dice_of(seed):
    return np.random.default_rng(seed)


def test_topics_named_in_a_damaged_first_chunk_are_read_out_of_it_or_missed(long_bag):
    sent, (begin, length) = list(read_bag(long_bag).raw()), chunks(long_bag)[0]
    cut = long_bag.read_bytes()[: chunks(long_bag)[-1][0]]
    long_bag.write_bytes(flipped(cut, begin + 9 + 24))  # the checksum
    told = recover(long_bag)
    assert whole(long_bag) == sent[10:190]
    assert set(told.from_damaged) == {'/a', '/b'}
    long_bag.write_bytes(cut[: begin + 60] + bytes(length - 60) + cut[begin + length :])
    told = recover(long_bag)
    assert (told.messages, told.nameless) == (0, 180)
    assert told.kept
    assert 'left out, since their topics' in run('bag', 'recover', told.kept).stdout


def test_a_kill_leaves_nothing_to_be_kept(long_bag):
    data = long_bag.read_bytes()
    for tail in (data[: chunks(long_bag)[7][0] + 50], data[: chunks(long_bag)[7][0]] + bytes(99)):
        long_bag.write_bytes(tail)
        told = recover(long_bag)
        assert (told.kept, told.dropped_bytes) == (None, 0)
        assert told.messages >= 70


def test_commands_name_the_cure(tmp_path):
    path = tmp_path / 'a.mcap'
    with BagWriter(path) as writer:
        writer.add_topic('/scene', STRING, RESULT)
        writer.write('/scene', text('name: x'), 10**9)
    assert "'bag recover' checks what stands before it" in run('bag', 'info', str(path)).stdout
    begin, length = chunks(path)[0]
    path.write_bytes(flipped(path.read_bytes(), begin + length - 5))
    for words in (['analyze'], ['report', '-o', f'{path}.html']):
        done = run(words[0], str(path), *words[1:])
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
        assert f"'mechanism-sim bag recover {path}' keeps all that is whole" in done.stderr
