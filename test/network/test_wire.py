"""Names, keys, tokens and attachments, against literal examples of rmw_zenoh's documents."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from running import TIMEOUT

import zenoh_rclpy
from mechanism_sim import nodes
from mechanism_sim.messages import type_hash
from mechanism_sim.nodes import middleware
from ros_interfaces import names
from ros_interfaces.names import InvalidNameError
from zenoh_rclpy import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
    surface,
    wire,
)

SESSION = 'aac3178e146ba6f1fc6e6a4085e77f21'
STRING = 'RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18'
ADD = 'RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a'


def test_data_keys():
    text = 'std_msgs/msg/String'
    assert wire.data_key(0, '/chatter', text, STRING) == (
        f'0/chatter/std_msgs::msg::dds_::String_/{STRING}'
    )
    assert wire.data_key(0, '/robot1/chatter', text, STRING) == (
        f'0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}'
    )
    assert wire.data_key(2, '/add_two_ints', 'example_interfaces/srv/AddTwoInts', ADD) == (
        f'2/add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/{ADD}'
    )


def test_tokens():
    node = wire.Token(SESSION, 0, 0, wire.NODE, '/', 'listener')
    assert wire.token_key(2, node) == f'@ros2_lv/2/{SESSION}/0/0/NN/%/%/listener'
    listener = wire.Token(
        SESSION, 0, 10, wire.SUBSCRIPTION, '/', 'listener', '/chatter', 'std_msgs/msg/String',
        STRING, QoSProfile(depth=10),
    )  # fmt: skip
    key = (
        f'@ros2_lv/2/{SESSION}/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/'
        f'{STRING}/::,10:,:,:,,'
    )
    assert wire.token_key(2, listener) == key
    assert wire.parse_token(key) == listener
    deep = listener._replace(namespace='/a/b', name='/a/b/c', kind=wire.PUBLISHER)
    key = wire.token_key(2, deep)
    assert '/MP/%/%a%b/listener/%a%b%c/' in key
    assert wire.parse_token(key) == deep
    assert deep.node_name == '/a/b/listener'
    # Later releases append fields.
    assert wire.parse_token(key + '/more') == deep


@pytest.mark.parametrize(
    'key',
    [
        '',
        '@ros2_lv/0',
        '@ros2_lv/0/zid/x/0/NN/%/%/node',
        '@ros2_lv/0/zid/0/0/XX/%/%/node/%t/a::msg::dds_::B_/h/::,:,:,:,,',
        '@ros2_lv/0/zid/0/0/MP/%/%/node',
        '@ros2_lv/0/zid/0/0/MP/%/%/node/%t/a::msg::dds_::B_/h/9::,:,:,:,,',
        'other/0/zid/0/0/NN/%/%/node',
        '@ros2_lv/0/zid/0/0/MP/%/%/node/%t/B/h/::,:,:,:,,',
        '@ros2_lv/0/zid/0/0/MP/%/%/node/%t/a::msg::dds_::B_/h/::,-1:,:,:,,',
        '@ros2_lv/0/zid/0/0/MP/%/%/node/t/a::msg::dds_::B_/h/::,:,:,:,,',
        '@ros2_lv/0/zid/0/0/MP/%/%/a b/%t/a::msg::dds_::B_/h/::,:,:,:,,',
        '@ros2_lv/0/zid/0/99999999999999999999/NN/%/%/node',
        '@ros2_lv/0/zid/0/0/NN/%/%/n' + 'o' * 2000 + 'de',
    ],
)
def test_what_is_no_token_is_none(key):
    assert wire.parse_token(key) is None


@pytest.mark.parametrize(
    ('profile', 'text'),
    [
        (QoSProfile(depth=10), '::,10:,:,:,,'),
        (QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL), ':1:,3:,:,:,,'),
        (QoSProfile(), '::,:,:,:,,'),
        (QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT), '2::,5:,:,:,,'),
        (QoSProfile(history=HistoryPolicy.KEEP_ALL), '::2,:,:,:,,'),
        (
            QoSProfile(
                depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL, lifespan=10_000_000_000
            ),
            ':1:,1000:,:10,0:,,',
        ),
    ],
)
def test_qos(profile, text):
    assert wire.qos_text(profile) == text
    assert wire.parse_qos(text) == profile


def test_attachments_and_gids():
    data = wire.pack_attachment(1, 1_700_000_000_000_000_000, bytes(range(16)))
    assert len(data) == 33
    assert int.from_bytes(data[:8], 'little') == 1
    assert int.from_bytes(data[8:16], 'little') == 1_700_000_000_000_000_000
    assert data[16:] == bytes((16, *range(16)))
    assert wire.parse_attachment(data) == (1, 1_700_000_000_000_000_000, bytes(range(16)))
    assert wire.parse_attachment(data[:-1]) is None
    assert wire.parse_attachment(data[:16] + b'\x0f' + data[17:]) is None
    # XXH3-128 of nothing, from xxHash's own tests: low half first, each least significant first.
    assert (
        wire.gid('').hex()
        == (
            0x6001C324468D497F.to_bytes(8, 'little') + 0x99AA06D3014798D8.to_bytes(8, 'little')
        ).hex()
    )


@pytest.mark.parametrize(
    ('name', 'namespace', 'full'),
    [
        ('chatter', '/', '/chatter'),
        ('chatter', '/robot', '/robot/chatter'),
        ('/chatter', '/robot', '/chatter'),
        ('~/state', '/robot', '/robot/node/state'),
        ('~', '/', '/node'),
        ('a/b', '/r/s', '/r/s/a/b'),
    ],
)
def test_names_resolve_as_in_ros(name, namespace, full):
    assert names.resolve(name, namespace, 'node') == full


@pytest.mark.parametrize('name', ['', '/', 'a//b', '1a', 'a b', 'ä', 'a/', '~x', 'a~'])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(InvalidNameError, match='is no topic or service name'):
        names.resolve(name, '/', 'node')


def test_namespaces():
    assert names.resolve_namespace('') == '/'
    assert names.resolve_namespace('a/b/') == '/a/b'
    with pytest.raises(InvalidNameError, match='namespace'):
        names.resolve_namespace('a b')


def test_the_hash_in_a_key_is_that_of_the_message():
    assert type_hash('std_msgs/msg/String') == STRING


def test_both_back_ends_offer_the_same_names():
    places = {
        'zenoh': surface.__file__,
        'rclpy': f'{Path(nodes.__file__).parent}/rclpy_backend.py',
    }
    offered = {}
    for backend, place in places.items():
        tree = ast.parse(Path(place).read_text())
        imported = {
            alias.asname or alias.name
            for statement in ast.walk(tree)
            if isinstance(statement, ast.ImportFrom)
            for alias in statement.names
        }
        made = ast.FunctionDef, ast.ClassDef
        imported |= {s.name for s in tree.body if isinstance(s, made)}
        (listed,) = (
            s.value
            for s in tree.body
            if isinstance(s, ast.Assign) and getattr(s.targets[0], 'id', '') == '__all__'
        )
        offered[backend] = set(ast.literal_eval(listed))
        assert offered[backend] <= imported
    assert offered['rclpy'] == offered['zenoh']
    assert set(middleware.__all__) == offered['zenoh'] | {'backend'}
    assert set(zenoh_rclpy.__all__) == offered['zenoh']


def test_every_module_can_be_the_first_that_is_imported():
    """``from zenoh_rclpy import config`` asks the package before there is such a module."""
    first = (
        'import importlib, sys\n'
        'for module in sys.argv[1:]:\n'
        '    for name in [*sys.modules]:\n'
        '        if name.startswith("zenoh_rclpy"): del sys.modules[name]\n'
        '    importlib.import_module(module)\n'
    )
    files = Path(zenoh_rclpy.__file__).parent.glob('*.py')
    modules = [f'zenoh_rclpy.{file.stem}' for file in files if not file.stem.startswith('__')]
    assert len(modules) > 20
    command = [sys.executable, '-c', first, *modules]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    assert (done.returncode, done.stderr) == (0, '')
