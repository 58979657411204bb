"""Arguments of ROS on a command line, and quality of service that they override."""

import pytest
from middleware_network import eventually

from mechanism_sim.messages import Clock, Log, SetParametersResult, Trigger
from mechanism_sim.nodes.process import main_of
from zenoh_rclpy import (
    HistoryPolicy,
    InvalidParameterTypeException,
    InvalidQosOverridesError,
    MiddlewareError,
    Node,
    Parameter,
    QoSOverridingOptions,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    remove_ros_args,
)
from zenoh_rclpy.arguments import Arguments, parse_arguments
from zenoh_rclpy.parameter_files import parse_value, read_parameters, write_parameters

DEFAULT = QoSOverridingOptions.with_default_policies()


@pytest.fixture
def make(network):  # noqa: ARG001
    """Makes nodes whose command line is a text."""
    nodes = []

    def make(line, name='talker', **how):
        nodes.append(Node(name, cli_args=['--ros-args', *line.split()], **how))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


def test_a_process_heeds_its_command_line(network, tmp_path):
    file = tmp_path / 'values.yaml'
    file.write_text("""
/**:
  ros__parameters: {gain: 0.5, solver: {rtol: 1e-9, steps: 010}}
/machine/talker:
  ros__parameters:
    gain: 1.5
    y: yes
other:
  ros__parameters: {gain: 7.0}
""")
    line = (
        '--other x --ros-args -r chatter:__node:=talker -r __ns:=/machine -r out:=/in -p speed:=3'
        f' --params-file {file} --log-level machine.talker:=debug -- --more'
    )
    process = network.start(
        """
        from zenoh_rclpy import *
        init()
        for name in ('chatter', 'listener'):
            node = Node(name)
            for parameter in ('gain', 'solver.rtol', 'solver.steps', 'y', 'speed'):
                node.declare_parameter(parameter, None)
            print('is', node.get_fully_qualified_name(), node.resolve_topic_name('out'),
                  *(node.get_parameter(p).value for p in
                    ('gain', 'solver.rtol', 'solver.steps', 'y', 'speed')))
            node.get_logger().debug('seen')
        shutdown()
        """,
        *line.split(),
    )
    assert process.expect('is') == '/machine/talker /in 1.5 1e-09 8 True 3'
    assert process.expect('is') == '/machine/listener /in 0.5 1e-09 8 None 3'
    process.finish()
    (seen,) = (line for line in process.lines if line.startswith('[DEBUG]'))
    assert seen.endswith('[machine.talker]: seen')


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('3', 3), ('-0x1F', -31), ('010', 8), ('09', 9.0), ('1e-9', 1e-9), ('1.', 1.0),
        ('.5', 0.5), ('-.inf', -float('inf')), ('inf', float('inf')),
        ('99999999999999999999', 1e20), ('true', True), ('Off', False), ('y', True),
        ('tRUE', 'tRUE'), ("'3'", '3'), ('"y"', 'y'), ('1:30', '1:30'),
        ('2020-01-01', '2020-01-01'), ('null', 'null'), ('1_000', '1_000'), ('!!str 5', '5'),
        ('[1, 2]', [1, 2]), ("['a', b]", ['a', 'b']), ('[1.0, 2e1]', [1.0, 20.0]),
        ('four_bar clearance', 'four_bar clearance'), ("''", ''),
    ],
)  # fmt: skip
def test_values_are_what_ros_takes_them_for(text, value):
    found = parse_value(text)
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    ('line', 'full', 'topic', 'service'),
    [
        ('', '/talker', '/talker/a', '/b'),
        ('-r __node:=x', '/x', '/x/a', '/b'),
        ('-r __name:=x -r __ns:=/n', '/n/x', '/n/x/a', '/n/b'),
        ('-r other:__node:=x -r other:b:=c', '/talker', '/talker/a', '/b'),
        ('-r ~/a:=c -r talker:b:=~/d', '/talker', '/c', '/talker/d'),
        ('-r /talker/a:=/c -r b:=c -r b:=d', '/talker', '/c', '/c'),
        ('-r __ns:=/n -r /b:=c -r rostopic://~/a:=c', '/n/talker', '/n/c', '/n/b'),
        ('--remap rosservice://~/a:=c --remap rosservice://b:=c', '/talker', '/talker/a', '/c'),
    ],
)
def test_names_are_remapped(make, line, full, topic, service):
    node = make(line)
    assert node.get_fully_qualified_name() == full
    assert node.create_publisher(Clock, '~/a', 10).topic_name == topic
    assert node.create_service(Trigger, 'b', print).srv_name == service
    assert node.create_client(Trigger, 'b').srv_name == service
    assert node.resolve_service_name('/b', only_expand=True) == '/b'


def test_the_last_word_on_a_parameter(make):
    def gain(line, **how):
        node = make(line, **how)
        return node.declare_parameter('gain', 0.0).value

    assert gain('') == 0.0
    assert gain('-p gain:=1.0 -p gain:=2.0') == 2.0
    assert gain('-p talker:gain:=2.0 -p gain:=1.0') == 1.0
    assert gain('-p gain:=1.0 -p talker:gain:=2.0 -p gain:=3.0') == 2.0
    assert gain('-p other:gain:=2.0') == 0.0
    assert gain('-p /n/talker:gain:=2.0', namespace='n') == 2.0
    assert gain('-p gain:=1.0', parameter_overrides=[Parameter('gain', value=4.0)]) == 4.0
    with pytest.raises(InvalidParameterTypeException, match='gain=1 is INTEGER, not DOUBLE'):
        gain('-p gain:=1')


@pytest.mark.parametrize(
    ('pattern', 'node', 'meant'),
    [
        ('/**', '/a', True), ('/**', '/n/m/a', True), ('/*', '/a', True), ('/*', '/n/a', False),
        ('/n/*', '/n/a', True), ('/n/**', '/n/m/a', True), ('/**/a', '/n/m/a', True),
        ('/**/a', '/n/m/b', False), ('n/a', '/n/a', True), ('a', '/n/a', False),
    ],
)  # fmt: skip
def test_sections_of_a_file_are_for_the_nodes_they_name(pattern, node, meant):
    arguments = Arguments(parameters={pattern: {'gain': 1.0}})
    assert arguments.parameters_of(node) == ({'gain': 1.0} if meant else {})


def test_a_name_of_a_section_is_no_pattern_but_for_its_stars(tmp_path):
    """`left.arm` is not `leftXarm`, and a bracket ends no node."""
    file = tmp_path / 'values.yaml'
    file.write_text('left.arm: {ros__parameters: {x: 1}}\n"a(": {ros__parameters: {x: 2}}')
    found = parse_arguments(['--ros-args', '--params-file', str(file)])
    assert found.parameters_of('/leftXarm') == {}
    assert set(found.parameters) == {'left.arm', 'a('}


def test_an_alias_of_values_is_refused_as_in_ros(tmp_path):
    """A merge `<<: *all` had made a parameter `<<.lead`."""
    file = tmp_path / 'values.yaml'
    file.write_text(
        '/**:\n  ros__parameters: &all {lead: 0.1}\n'
        'linkage:\n  ros__parameters:\n    <<: *all\n    x: 1\n'
    )
    with pytest.raises(MiddlewareError, match=r'ROS has no aliases of values as \*all'):
        parse_arguments(['--ros-args', '--params-file', str(file)])


def test_logs_can_be_turned_off(make, capfd):
    quiet = make('--disable-stdout-logs --log-level error')
    mute = make('--disable-rosout-logs', 'mute')
    quiet.get_logger().error('unseen')
    mute.get_logger().info('seen')
    mute.get_logger().get_child('part').info('seen too')
    assert [line.split(']: ')[1] for line in capfd.readouterr().err.splitlines()] == [
        'seen', 'seen too',
    ]  # fmt: skip
    assert eventually(lambda: quiet.count_publishers('/rosout') == 1)
    assert mute.get_publishers_info_by_topic('/rosout')[0].topic_type == 'rcl_interfaces/msg/Log'
    assert Log.ERROR == 40


@pytest.mark.parametrize(
    ('line', 'text'),
    [
        ('-p gain', 'set by name:=value'),
        ('-p /*:gain:=1', 'set by name:=value'),
        ('-p gain:=', 'there is no value'),
        ('-p gain:=[1,2.0]', 'one type'),
        ('-p gain:={a:', 'no YAML'),
        ('-r a=b', 'reads old:=new'),
        ('-r', 'after -r a value is missing'),
        ('-r __ns:=/1a', "-r __ns:=/1a: '/1a' is no namespace"),
        ('-r __node:=a/b', "'a/b' is no node name"),
        ('-r drive:=1a', "'1a' is no topic or service name"),
        ('--log-level loud', "'loud' is none of debug, info"),
        ('--params-file nowhere.yaml', 'nowhere.yaml'),
        ('--whatever', "'--whatever' is none of -r, --remap, -p"),
    ],
)
def test_what_is_wrong_is_said(line, text, capsys):
    args = ['--ros-args', *line.split()]
    with pytest.raises(MiddlewareError, match=text) as error:
        parse_arguments(args)
    assert '\n' not in str(error.value)
    with pytest.raises(SystemExit) as end:
        main_of(Node, args)
    assert end.value.code == 2
    assert text in capsys.readouterr().err


@pytest.mark.parametrize('content', ['', '- 1', 'node: {gain: 1}', 'node: 3', 'a: ]'])
def test_a_file_that_holds_no_parameters_is_refused(tmp_path, content):
    file = tmp_path / 'values.yaml'
    file.write_text(content)
    with pytest.raises(MiddlewareError, match=r'values\.yaml: '):
        parse_arguments(['--ros-args', '--params-file', str(file)])


def test_what_is_not_for_ros_is_left():
    line = ['--scene', 'a', '--ros-args', '-p', 'x:=1', '--', '--duration', '3', '--ros-args']
    assert remove_ros_args(line) == ['--scene', 'a', '--duration', '3']
    assert parse_arguments(line).parameters == {'/**': {'x': 1}}


def test_quality_of_service_is_overridden_at_the_start(make):
    keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=1000)
    node = make(
        '-p qos_overrides./drive.publisher.depth:=7'
        ' -p qos_overrides./drive.publisher.history:=keep_last'
        ' -p qos_overrides./drive.subscription_slow.reliability:=best_effort'
    )
    publisher = node.create_publisher(Clock, 'drive', keep_all, qos_overriding_options=DEFAULT)
    assert publisher.qos_profile == QoSProfile(depth=7)
    assert keep_all.history == HistoryPolicy.KEEP_ALL
    (info,) = node.get_publishers_info_by_topic('drive')
    assert info.qos_profile == QoSProfile(depth=7)
    slow = QoSOverridingOptions.with_default_policies(entity_id='slow')
    subscription = node.create_subscription(
        Clock, 'drive', print, keep_all, qos_overriding_options=slow
    )
    assert subscription.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert subscription.qos_profile.history == HistoryPolicy.KEEP_ALL
    name = 'qos_overrides./drive.publisher.reliability'
    assert node.get_parameter(name).value == 'reliable'
    refused = node.set_parameters([Parameter(name, value='best_effort')])[0]
    assert not refused.successful
    again = node.create_publisher(Clock, 'drive', keep_all, qos_overriding_options=DEFAULT)
    assert again.qos_profile == publisher.qos_profile
    all_kinds = QoSOverridingOptions(QoSPolicyKind)
    lasting = node.create_publisher(Clock, 'lasting', keep_all, qos_overriding_options=all_kinds)
    assert lasting.qos_profile == keep_all


def test_quality_of_service_that_is_none_is_refused(make):
    node = make(
        '-p qos_overrides./a.publisher.history:=keep_some -p qos_overrides./b.publisher.depth:=-1'
        ' -p qos_overrides./c.publisher.depth:=deep'
    )

    def create(topic, options=DEFAULT):
        node.create_publisher(Clock, topic, 10, qos_overriding_options=options)

    with pytest.raises(InvalidQosOverridesError, match="history='keep_some' is none of keep_last"):
        create('a')
    with pytest.raises(InvalidQosOverridesError, match='depth=-1 is negative'):
        create('b')
    with pytest.raises(InvalidParameterTypeException, match='STRING, not INTEGER'):
        create('c')
    picky = QoSOverridingOptions.with_default_policies(
        callback=lambda qos: SetParametersResult(successful=qos.depth > 10, reason='too short')
    )
    with pytest.raises(InvalidQosOverridesError, match='publisher /d is refused: too short'):
        create('d', picky)
    assert not node.count_publishers('d')


def test_values_written_to_a_file_are_read_as_they_were(tmp_path):
    """Also texts that other readers of YAML take for texts, and rcl for numbers or truths."""
    texts = ['', 'y', 'off', '1e-9', '010', '1:30', '.inf', 'a: b', '[x', '#', ' x ', 'a\nb', 'ü']
    texts.append('a long one, ' * 20)
    values = {f'text{n}': text for n, text in enumerate(texts)} | {
        'joints.arm/left.restitution': 0.1, 'large': 1e300, 'whole': 3.0, 'count': 3, 'on': True,
        'names': texts, 'numbers': [0.5, 2.0], 'unlimited': float('inf'),
    }  # fmt: skip
    file = tmp_path / 'values.yaml'
    file.write_text(write_parameters('/machine/talker', values), encoding='utf-8')
    assert repr(dict(read_parameters(str(file)))) == repr({'/machine/talker': values})
