"""Bags of other programs: JSON, protobuf and SQLite, split and compressed, read as one run.

The bags of `inputs/bags` are those of the cases of others; their right values are in closed form.
`protobuf.mcap` was written by mcap-protobuf-support 0.6.0. The others are written here by rosbags
and by the package mcap, none by the writer of this package.
"""

from __future__ import annotations

import math
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import zstandard
from bags import write_bag
from builders import simulated
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import Writer as RosWriter
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from running import run, run_json

import mechanism_sim as ms
from mechanism_sim.errors import InputError
from mechanism_sim.messages import definition
from mechanism_sim.recording.inventory import info
from mechanism_sim.recording.reader import read_bag

BAGS = Path(__file__).parent / 'inputs/bags'
JSON, PROTOBUF = BAGS / 'json_schema.mcap', BAGS / 'protobuf.mcap'
SQLITE, SPLIT = BAGS / 'joint_states_db3', BAGS / 'split_mcap'
STORE = get_typestore(Stores.ROS2_JAZZY)
SPEED = '/msg/rx/need_ack.speed'


def plotted(tmp_path, bag, *what):
    """The columns that `plot` writes."""
    file = tmp_path / 'numbers.npz'
    done = run('plot', str(bag), *what, '-o', str(file))
    assert done.returncode == 0, done.stderr
    with np.load(file) as found:
        return dict(found)


def test_json_is_read_by_its_paths(tmp_path):
    """PlotJuggler issue 1216: 0 to 9.9 over 0.99 s."""
    found = plotted(tmp_path, JSON, SPEED)
    assert found['t'] == pytest.approx(np.arange(100) / 100.0, abs=1e-15)
    assert found[SPEED] == pytest.approx(np.arange(100) / 10.0, abs=1e-14)
    assert run('plot', str(JSON)).stdout.split() == [SPEED]
    (field,) = run_json('analyze', str(JSON))['fields']
    assert (field['quantity'], field['samples']) == (SPEED, 100)
    assert (field['lowest'], field['highest'], field['start'], field['end']) == (0, 9.9, 0, 0.99)
    opened = ms.open_run(JSON)
    assert opened.names() == [SPEED]
    assert opened.columns([SPEED], np.array([0.0, 0.505, 0.99]))[SPEED] == pytest.approx(
        [0.0, 5.05, 9.9], abs=1e-13
    )


def test_a_bag_in_sqlite_is_read(tmp_path):
    """rosbag2 issue 1406: 200 messages of two joints, 0.995 s."""
    for source in (SQLITE, SQLITE / 'js_db3.db3'):
        about = run_json('bag', 'info', str(source))
        assert about['duration'] == pytest.approx(0.995, abs=1e-12)
        assert {t['name']: t['count'] for t in about['topics']}['/joint_states'] == 200
        said = run('bag', 'info', str(source)).stdout
        assert 'yes, by its index\n' in said
        assert 'recover' not in said  # which refuses it
    found = plotted(tmp_path, SQLITE, '/joint_states.position')
    t = np.arange(200) / 200.0
    assert found['t'] == pytest.approx(t, abs=1e-9)
    assert found['/joint_states.position[crank]'] == pytest.approx(20.0 * t, abs=1e-9)
    fields = {f['quantity']: f for f in run_json('analyze', str(SQLITE))['fields']}
    assert fields['/joint_states.position[crank]']['highest'] == pytest.approx(19.9, abs=1e-12)
    # neither the message nor a scene in the bag says whether a joint turns
    assert fields['/joint_states.velocity[crank]']['unit'] == 'rad/s or m/s'
    assert ms.open_run(SQLITE).columns(['position.crank'], np.array([0.5]))[
        'position.crank'
    ] == pytest.approx([10.0], abs=1e-12)


def test_a_split_bag_is_one_run(tmp_path):
    """Both files, one after the other."""
    about = run_json('bag', 'info', str(SPLIT))
    assert about['messages'] == 808
    assert about['size'] == sum(file.stat().st_size for file in SPLIT.iterdir())
    found = [m for _, m, _ in read_bag(SPLIT).messages('/joint_states')]
    single = [m for _, m, _ in read_bag(SPLIT / 's_0.mcap').messages('/joint_states')]
    assert len(found) == 400
    assert found[:200] == single
    assert len(plotted(tmp_path, SPLIT, '/acc.data')['t']) == 400


def test_protobuf_is_read_by_the_descriptors_of_the_bag(tmp_path):
    """Every type of number, nested, repeated, packed, in a map; values in closed form."""
    paths = {
        '/press.ram.position': lambda k: 0.1 * math.sin(0.06 * k),
        '/press.ram.current': lambda k: -0.5 * k,
        '/press.mode': lambda k: k % 3,
        '/press.count': lambda k: -k,
        '/press.offset': lambda k: -(2.0**40) * k,
        '/press.ticks': lambda k: float(2**60 + k),
        '/press.guard': lambda k: k % 2,
        '/press.signed': lambda k: -7 * k,
        '/press.loads[1]': lambda k: 0.5 * k,
        '/press.steps[0]': lambda k: -k,
        '/press.steps[2]': lambda k: 2 * k,
        '/press.axes[1].position': lambda k: 0.04 * k,
    }
    found = plotted(tmp_path, PROTOBUF, *paths)
    for name, value in paths.items():
        assert found[name] == pytest.approx([value(k) for k in range(50)], rel=1e-14, abs=1e-15)
    (_, first, _), *_ = read_bag(PROTOBUF).messages()
    assert first['temperatures'] == [{'key': 'oil', 'value': 40.0}]
    assert (first['note'], first['ram']['name']) == ('stroke 0', 'ram')
    listed = run('plot', str(PROTOBUF)).stdout.split()
    assert {'/press.ram.position', '/press.temperatures.value'} <= {*listed}


# --- storages, compression, parts ---------------------------------------------------------------


def stored(folder, plugin=StoragePlugin.SQLITE3, mode=CompressionMode.NONE):
    """A bag of std_msgs/Float64 by rosbags: the squares of 0 to 19, 10 a second."""
    bag = RosWriter(folder, version=9, storage_plugin=plugin)
    if mode != CompressionMode.NONE:
        bag.set_compression(mode, CompressionFormat.ZSTD)
    kind = 'std_msgs/msg/Float64'
    with bag:
        topic = bag.add_connection('/square', kind, typestore=STORE)
        for k in range(20):
            data = STORE.serialize_cdr(STORE.types[kind](data=float(k * k)), kind)
            bag.write(topic, k * 10**8, data)
    return folder


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('mode', list(CompressionMode))
def test_every_storage_and_compression_of_rosbag2(tmp_path, plugin, mode):
    if plugin is StoragePlugin.SQLITE3 and mode is CompressionMode.STORAGE:
        pytest.skip('SQLite compresses nothing itself')
    bag = read_bag(stored(tmp_path / 'bag', plugin, mode))
    found = [(message.data, t) for _, message, t in bag.messages('/square')]
    assert found == [(float(k * k), k * 10**8) for k in range(20)]
    assert bag.topics['/square'].count == 20
    assert not bag.unreadable()
    columns = ms.open_run(bag).columns(['/square.data'], np.array([0.3, 0.35]))
    assert columns['/square.data'] == pytest.approx([9.0, 12.5], abs=1e-12)


@pytest.mark.parametrize('compression', list(CompressionType))
def test_a_compressed_file_alone_is_read(tmp_path, compression):
    plain = tmp_path / 'plain.mcap'
    with plain.open('wb') as stream:
        writer = Writer(stream, compression=compression)
        writer.start()
        channel = writer.register_channel('/a.b/c-d', 'json', 0)
        for k in range(10):
            writer.add_message(channel, k * 10**9, b'{"x-y": [%d, {"z": 1}]}' % k, k * 10**9)
        writer.finish()
    packed = plain.with_name('packed.mcap.zstd')
    packed.write_bytes(zstandard.compress(plain.read_bytes()))
    for file in (plain, packed):
        assert info(file).messages == 10
        found = ms.open_run(file).columns(['/a.b/c-d.x-y[0]'], np.array([2.5]))
        assert found['/a.b/c-d.x-y[0]'] == pytest.approx([2.5])
    assert run('plot', str(packed), '--json').returncode == 0


def test_a_listing_says_the_order_of_files(tmp_path):
    """Of ros2 bag; without one the first message does."""
    for name, start in (('b_0', 1), ('a_1', 0)):
        made = stored(tmp_path / name, StoragePlugin.MCAP)
        (tmp_path / 'bag').mkdir(exist_ok=True)
        shutil.copy(made / f'{name}.mcap', tmp_path / 'bag')
        if start:
            with (tmp_path / 'bag' / 'c_2.mcap').open('wb') as stream:
                writer = Writer(stream)
                writer.start()
                channel = writer.register_channel('/later', 'json', 0)
                writer.add_message(channel, 5 * 10**9, b'{"x": 1}', 5 * 10**9)
                writer.finish()
    bag = tmp_path / 'bag'
    assert [name for name, _, _ in read_bag(bag).raw()] == 40 * ['/square'] + ['/later']
    listing = 'rosbag2_bagfile_information: {relative_file_paths: [c_2.mcap, %s]}'
    (bag / 'metadata.yaml').write_text(listing % 'bag/b_0.mcap')  # with the folder, as before Foxy
    assert [name for name, _, _ in read_bag(bag).raw()] == ['/later'] + 20 * ['/square']
    (bag / 'metadata.yaml').write_text(listing % 'b_9.mcap')
    with pytest.raises(InputError, match=r'metadata\.yaml names b_9\.mcap, which is not there'):
        read_bag(bag)


def test_a_run_of_ours_is_the_same_from_every_storage(tmp_path):
    """Rewritten by rosbags to SQLite, and split there: the digest, forces, all."""
    record = simulated('four_bar_clearance', duration=0.05)
    own = read_bag(write_bag(tmp_path / 'run.mcap', record))
    texts = {t.type: definition(t.type) for t in own.topics.values()}
    for name, text in texts.items():
        if name not in STORE.fielddefs:
            added = get_types_from_msg(text, name)
            STORE.register({k: v for k, v in added.items() if k not in STORE.fielddefs})
    messages = list(own.raw())
    folder = tmp_path / 'split'
    folder.mkdir()
    for k, part in enumerate((messages[: len(messages) // 2], messages[len(messages) // 2 :])):
        with RosWriter(tmp_path / f's{k}', version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
            topics = {
                name: bag.add_connection(name, t.type, typestore=STORE)
                for name, t in own.topics.items()
            }
            for name, data, t in part:
                bag.write(topics[name], t, data)
        shutil.copy(tmp_path / f's{k}' / f's{k}.db3', folder)
    (folder / 'metadata.yaml').write_text(
        'rosbag2_bagfile_information: {relative_file_paths: [s0.db3, s1.db3]}'
    )
    found = ms.open_run(folder)
    assert found.digest() == record.digest()
    t = np.linspace(0.0, 0.05, 9)
    for name in ('reaction.coupler_rocker.size', 'position.rocker'):
        assert np.array_equal(found.columns([name], t)[name], record.piece.sample(t, name)[name])


# --- types that are not known here --------------------------------------------------------------

GAUGE = 'gauge_msgs/msg/Reading'
MSG = 'std_msgs/Header header\nfloat32[2] strain\nint16 count\nstring[] names\nfloat64[] values\n'
IDL = """
module gauge_msgs { module msg {
  struct Reading {
    double strain;
    int32 count;
  };
}; };
"""


@pytest.mark.parametrize('kind', ['ros2msg', 'ros2idl'])
def test_a_type_of_ros_that_is_not_known_is_read_by_its_definition(tmp_path, kind):
    path, store = tmp_path / 'gauge.mcap', get_typestore(Stores.ROS2_JAZZY)
    if kind == 'ros2msg':
        text = f'{MSG}{"=" * 80}\nMSG: std_msgs/Header\n{definition("std_msgs/msg/Header")}'
        store.register({GAUGE: get_types_from_msg(MSG, GAUGE)[GAUGE]})
    else:
        text = IDL
        store.register(get_types_from_idl(IDL))
    reading, header = store.types[GAUGE], store.types['std_msgs/msg/Header']
    stamp = store.types['builtin_interfaces/msg/Time']
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start(profile='ros2')
        schema = writer.register_schema(GAUGE, kind, text.encode())
        channel = writer.register_channel('/gauge', 'cdr', schema)
        for k in range(11):
            more = {
                'header': header(stamp=stamp(sec=k, nanosec=500_000_000), frame_id='g'),
                'strain': np.array([k, 2 * k], np.float32),
                'names': ['a', 'b'],
                'values': np.array([0.1 * k, 0.2 * k]),
            }
            plain = {'strain': float(k)}
            message = reading(count=-k, **(more if kind == 'ros2msg' else plain))
            writer.add_message(channel, k * 10**9, bytes(store.serialize_cdr(message, GAUGE)), 0)
        writer.finish()
    found = plotted(tmp_path, path, '/gauge.count', '/gauge.strain')
    assert found['/gauge.count'].tolist() == [-k for k in range(11)]
    if kind == 'ros2idl':
        assert found['/gauge.strain'].tolist() == list(range(11))
        return
    assert found['t'] == pytest.approx(0.5 + np.arange(11))  # of the stamps, not the log
    assert found['/gauge.strain[1]'].tolist() == [2 * k for k in range(11)]
    opened = ms.open_run(path)
    assert '/gauge.values' in opened.names()
    columns = opened.columns(['/gauge.values[b]'], np.array([5.5]))
    assert columns['/gauge.values[b]'] == pytest.approx([1.0])


def test_definitions_in_idl_are_read_as_rosbag2_stores_them(tmp_path):
    """Each file after its delimiter, in any order, with what it includes; two share a typedef."""
    header = '// generated from rosidl_adapter/resource/msg.idl.em\n\n#include "{}"\n'
    pair = 'typedef double double__2[2];'
    files = {
        'gauge_msgs/msg/Part': f'module gauge_msgs {{ module msg {{ {pair}\n'
        'struct Part { double__2 strain; }; }; };\n',
        'gauge_msgs/msg/Rig': header.format('gauge_msgs/msg/Part.idl')
        + f'module gauge_msgs {{ module msg {{ {pair}\n@verbatim (language="comment", text="r")\n'
        'struct Rig { sequence<gauge_msgs::msg::Part> parts; double__2 at; }; }; };\n',
    }
    text = ''.join(f'{"=" * 80}\nIDL: {name}\n{file}' for name, file in files.items())
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('float64[2] strain', 'gauge_msgs/msg/Part'))
    store.register(get_types_from_msg('Part[] parts\nfloat64[2] at', 'gauge_msgs/msg/Rig'))
    part, rig = (store.types[name] for name in files)
    sent = rig(
        parts=[part(strain=np.array([k, 0.5])) for k in (1.0, 2.0)], at=np.array([3.0, 4.0])
    )
    data = bytes(store.serialize_cdr(sent, 'gauge_msgs/msg/Rig'))
    path = mcap_of(
        tmp_path / 'idl.mcap', 'cdr', 'ros2idl', text.encode(), data, 'gauge_msgs/msg/Rig'
    )
    ((_, found, _),) = read_bag(path).messages()
    assert [p.strain.tolist() for p in found.parts] == [[1.0, 0.5], [2.0, 0.5]]
    assert found.at.tolist() == [3.0, 4.0]


def test_json_may_leave_out_fields(tmp_path):
    path = tmp_path / 'some.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel('/s', 'json', 0)
        for k in range(6):
            text = b'{"a": %d}' % k if k % 2 else b'{"b": {"c": %d}}' % k
            writer.add_message(channel, k, text, k)
        writer.finish()
    found = plotted(tmp_path, path, '/s.a', '/s.b.c')
    assert np.nansum(found['/s.a']) == 9.0
    assert np.nansum(found['/s.b.c']) == 6.0


# --- nothing there, and what is wrong -----------------------------------------------------------


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ((JSON, '/msg/rx/need_ack.sped'), "has no field 'sped'; did you mean 'speed'?"),
        ((JSON, 'speed'), f"has no scene with a quantity 'speed'; it has {SPEED}"),
        ((JSON, SPEED, '--from', '2'), 'they go from 0 s to 0.99 s'),
        ((JSON, SPEED, '--to', '-1'), f'there are no values of {SPEED} between these times'),
        ((JSON, '/msg/rx/need_ack{speed>100}.speed'), 'has no value with speed>100.0'),
        ((PROTOBUF, '/press.note'), 'is text, not a number'),
        ((PROTOBUF, '/press.ram'), 'is a message: choose one of name, position, current'),
        ((PROTOBUF, '/press.loads[5]'), 'the array has 2 items, numbered from 0'),
        ((SQLITE, '/joint_states.position[slide]'), "there is no 'slide'"),
        ((SQLITE / 'nothing.db3', 'x'), 'nothing.db3 does not exist'),
        ((SQLITE / 'nothing.mcap.zstd', 'x'), 'nothing.mcap.zstd does not exist'),
    ],
)  # fmt: skip
def test_an_empty_selection_is_said_in_one_sentence(tmp_path, arguments, words):
    bag, what, *more = map(str, arguments)
    done = run('plot', bag, what, *more, '-o', str(tmp_path / 'x.svg'))
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert words in done.stderr
    assert not any(tmp_path.iterdir())


def mcap_of(path, encoding, kind, text, data, name='a.B'):
    """A bag of one message."""
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name, kind, text)
        writer.add_message(writer.register_channel('/b', encoding, schema), 0, data, 0)
        writer.finish()
    return path


DESCRIPTOR = b'\n\x13\x12\x01a"\x0e\n\x01B\x12\x09\n\x01x\x18\x01 \x01(\x01'
"""Of ``package a; message B { double x = 1; }``."""


@pytest.mark.parametrize(
    ('encoding', 'kind', 'text', 'data', 'words'),
    [
        ('json', 'jsonschema', b'', b'{"speed": ', 'a message does not match a.B'),
        ('json', 'jsonschema', b'', b'[1, 2]', 'a message is not a JSON object'),
        ('json', 'jsonschema', b'', b'[' * 10**5, 'a message does not match a.B'),
        ('protobuf', 'protobuf', b'\xff', b'', 'its schema cannot be read'),
        ('protobuf', 'protobuf', b'', b'', 'its schema does not describe a.B'),
        ('protobuf', 'protobuf', DESCRIPTOR, b'\x09\x00', 'extends beyond its message'),
        ('protobuf', 'protobuf', DESCRIPTOR, b'\x0f', 'wire type 7'),
        ('protobuf', 'protobuf', DESCRIPTOR, b'\x80' * 20, 'a number is incomplete'),
        ('cdr', 'ros2msg', b'float64[ x', bytes(12), 'the definition of a.B cannot be read'),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_message_is_said(tmp_path, encoding, kind, text, data, words):
    path = mcap_of(tmp_path / 'bad.mcap', encoding, kind, text, data)
    with pytest.raises(InputError, match=r'bad\.mcap, topic /b: ') as raised:
        list(read_bag(path).messages())
    assert words in str(raised.value)


def test_the_descriptor_of_these_mistakes_is_right(tmp_path):
    data = b'\x09\x00\x00\x00\x00\x00\x00\xf8\x3f'
    path = mcap_of(tmp_path / 'good.mcap', 'protobuf', 'protobuf', DESCRIPTOR, data)
    assert [m for _, m, _ in read_bag(path).messages()] == [{'x': 1.5}]


def test_a_database_without_messages_is_no_bag(tmp_path):
    path = tmp_path / 'other.db3'
    with sqlite3.connect(path) as base:
        base.execute('CREATE TABLE people(name TEXT)')
    with pytest.raises(InputError, match='is not SQLite, or damaged'):
        read_bag(path)


def test_a_database_whose_topic_has_no_name_is_damaged(tmp_path):
    folder = stored(tmp_path / 'bag')
    with sqlite3.connect(folder / 'bag.db3') as base:
        base.execute("INSERT INTO topics SELECT 7, X'00', type, 'cdr', '', '' FROM topics")
    with pytest.raises(InputError, match=r'or damaged .*a topic has no name'):
        read_bag(folder)


def test_a_folder_of_several_runs_names_them(tmp_path):
    record = simulated('four_bar_nominal', duration=0.01)
    for name in ('one', 'two'):
        write_bag(tmp_path / f'{name}.mcap', record)
    done = run('bag', 'info', str(tmp_path))
    assert done.returncode == 2
    assert 'is a folder of several runs (one.mcap, two.mcap): name one of them' in done.stderr
