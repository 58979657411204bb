import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from docs.messages import READINGS, fields
from docs.messages import text as written
from mechanism_sim import messages
from mechanism_sim.messages import (
    DiagnosticStatus,
    Impact,
    JointState,
    LinkageState,
    MessageError,
    ModeChange,
    Motion,
    Quaternion,
    Result,
    SimulateSteps,
    StepSimulation,
    TFMessage,
    Trigger,
    define,
    define_action,
    define_service,
    definition,
    deserialize,
    float64_array,
    message_class,
    message_folder,
    own_messages,
    seconds,
    serialize,
    service_type_hash,
    stamp,
    type_hash,
    type_name,
)
from mechanism_sim.recording.writer import VERSION
from ros_interfaces import checks, classes, definitions

# Published by others: rosidl's JSON files as quoted in public repositories that talk to
# rmw_zenoh_cpp (message hashes), and their tables of the hashes of Jazzy's services.
PUBLIC_HASHES = {
    'std_msgs/msg/String': 'df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18',
    'rosgraph_msgs/msg/Clock': '692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564',
    'geometry_msgs/msg/Twist': '9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a',
    'geometry_msgs/msg/PoseStamped': (
        '10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8'
    ),
    'sensor_msgs/msg/Range': 'b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a',
    'rcl_interfaces/msg/Log': 'e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac',
    'rcl_interfaces/msg/ParameterEvent': (
        '043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204'
    ),
    'example_interfaces/srv/AddTwoInts': (
        'e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a'
    ),
    'std_srvs/srv/Trigger': 'eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f',
    'rcl_interfaces/srv/GetParameters': (
        'bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc'
    ),
    'rcl_interfaces/srv/GetParameterTypes': (
        'da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca'
    ),
    'rcl_interfaces/srv/SetParameters': (
        '56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0'
    ),
    'rcl_interfaces/srv/SetParametersAtomically': (
        '0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd'
    ),
    'rcl_interfaces/srv/ListParameters': (
        '3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d'
    ),
    'rcl_interfaces/srv/DescribeParameters': (
        '845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff'
    ),
}


# Made by rosidl_generator_type_description of ROS 2 Jazzy: of simulation_interfaces 2.1.0, and as
# installed with action_msgs and tf2_msgs.
ROSIDL_HASHES = {
    'simulation_interfaces/action/SimulateSteps': (
        'f0837c898e1219cd73bf4c041feab41e8c533e8e1057e982744dba7b093467eb'
    ),
    'simulation_interfaces/action/SimulateSteps_SendGoal': (
        '504407b9ff5617a737df8222cf581452b4f2e699e11e940d8d36590c5fb07d01'
    ),
    'simulation_interfaces/action/SimulateSteps_GetResult': (
        'a1dae0516ab5c70d6d797e1bcd55c9448dfbb1966643f1ebd3e3f153d8169ae0'
    ),
    'simulation_interfaces/action/SimulateSteps_FeedbackMessage': (
        'a30dee7ee7380769e616406ec5067b238aa2b27e1dbd7a5957fba1d908d7754d'
    ),
    'simulation_interfaces/srv/GetSimulatorFeatures': (
        'abb9439c8cf196722a469fb6c68b44b484f198c2a1356ac38849a29c2a20a794'
    ),
    'simulation_interfaces/srv/GetSimulationState': (
        '3362dcebee4b1afebbf9c4beee5c79c1455385aded62092a892d61fde8644f30'
    ),
    'simulation_interfaces/srv/SetSimulationState': (
        'a868b916dce49974f637ba252141258c4b07b0c06858b88af560e3eb6bfbcb30'
    ),
    'simulation_interfaces/srv/StepSimulation': (
        '913fe0653690ce6bf8f09f316e6a626747012e9fca31e26719910d417aa8565c'
    ),
    'simulation_interfaces/srv/ResetSimulation': (
        '4ce285d7ff9b8ac70dcc95161f32bf54c05a6f4b13427990e41ab40c36c39646'
    ),
    'action_msgs/srv/CancelGoal': (
        '573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a'
    ),
    'action_msgs/msg/GoalStatusArray': (
        '6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e'
    ),
    'tf2_msgs/action/LookupTransform': (
        '0b8adf6bc0b5958879e3265b41a457e03558fe523890a81252c70eba97a82c5d'
    ),
    'tf2_msgs/action/LookupTransform_SendGoal': (
        '4646ff5706c86b04d0a1098d329951a9731a7517e16702905de6073cc72c8530'
    ),
    'tf2_msgs/action/LookupTransform_GetResult': (
        '3cd1715751899e3167b5aec3e4ac194f7da9e8493a77285f9f6a4c914f5e8b24'
    ),
    'tf2_msgs/action/LookupTransform_FeedbackMessage': (
        '10cb89922dcb103e95c185d43e8a5efa3d38db996f733151a2f3e2ac133f4839'
    ),
}

LOOKUP_TRANSFORM = """string target_frame
string source_frame
builtin_interfaces/Time source_time
builtin_interfaces/Duration timeout
builtin_interfaces/Time target_time
string fixed_frame
bool advanced
---
geometry_msgs/TransformStamped transform
tf2_msgs/TF2Error error
---
"""


@pytest.mark.parametrize('name', ROSIDL_HASHES)
def test_hashes_of_actions_are_those_of_rosidl(name):
    define_action('tf2_msgs/action/LookupTransform', LOOKUP_TRANSFORM)
    assert type_hash(name) == f'RIHS01_{ROSIDL_HASHES[name]}'


def test_actions_have_the_classes_that_ros_gives_them():
    assert type_name(SimulateSteps) == 'simulation_interfaces/action/SimulateSteps'
    assert SimulateSteps.Goal(steps=3).steps == 3
    impl = SimulateSteps.Impl
    assert type_name(impl.SendGoalService) == 'simulation_interfaces/action/SimulateSteps_SendGoal'
    feedback = SimulateSteps.Feedback(completed_steps=2, remaining_steps=1)
    message = impl.FeedbackMessage(feedback=feedback)
    message.goal_id.uuid = list(range(16))
    assert deserialize(serialize(message), impl.FeedbackMessage) == message
    assert len(serialize(message)) == 4 + 16 + 8 + 8
    status = impl.GetResultService.Response(status=4, result=SimulateSteps.Result())
    status.result.result.result = Result.RESULT_OK
    assert deserialize(serialize(status), impl.GetResultService.Response) == status
    assert StepSimulation.Request().steps == 1
    assert 'MSG: simulation_interfaces/action/SimulateSteps_Feedback\n' in definition(
        type_name(impl.FeedbackMessage)
    )


@pytest.mark.parametrize('name', PUBLIC_HASHES)
def test_hashes_are_those_of_ros(name):
    define_service('example_interfaces/srv/AddTwoInts', 'int64 a\nint64 b\n---\nint64 sum\n')
    assert type_hash(name) == f'RIHS01_{PUBLIC_HASHES[name]}'
    if '/srv/' in name:
        assert service_type_hash(name) == type_hash(name)


def test_a_message_is_made_by_keywords_with_the_defaults_and_constants_of_its_definition():
    impact = Impact(time=0.1, joint='a')
    assert (impact.time, impact.joint, impact.index, impact.ends_chatter) == (0.1, 'a', 0, False)
    assert impact.header.stamp.sec == 0
    assert ModeChange.FREE_FLIGHT == 1
    assert ModeChange.UNKNOWN == ModeChange().mode == 0
    assert Quaternion().w == 1.0
    assert DiagnosticStatus(level=DiagnosticStatus.WARN).level == DiagnosticStatus.WARN
    assert Impact() == Impact()
    assert Impact() != Impact(index=1)
    assert Motion(start=[1.0]) == Motion(start=np.array([1.0]))
    first, second = JointState(), JointState()
    first.name.append('a')
    first.header.frame_id = 'world'
    assert second.name == []
    assert second.header.frame_id == ''


def test_explicit_defaults_of_a_definition_hold():
    define(
        'test_messages/msg/Defaults',
        'float64 a 2.5  # unit\nstring text "a # b"\nint32[3] v [1, 2, 3]\nbool flag true\n'
        'string<=5 short hi\nuint8 K=3\nstring[] names\nfloat64[2] pair\n',
    )
    message = message_class('test_messages/msg/Defaults')()
    assert (message.a, message.text, message.flag, message.short) == (2.5, 'a # b', True, 'hi')
    assert message.v.tolist() == [1, 2, 3]
    assert message.v.dtype == np.int32
    assert message.pair.tolist() == [0.0, 0.0]
    assert (message.K, message.names) == (3, [])


def test_a_definition_that_threads_ask_for_is_whole(monkeypatch):
    """Its text was without defaults and remarks while another thread took it in."""
    name, text = 'test_messages/msg/Asked', 'float64 a 2.5  # unit\n'
    keep, found = definitions._keep, []
    asking = Thread(target=lambda: found.append((definition(name), definitions.defaults(name))))

    def keep_slowly(*given):
        keep(*given)
        asking.start()
        asking.join(0.2)

    monkeypatch.setattr(definitions, '_keep', keep_slowly)
    define(name, text)
    asking.join()
    assert found == [(text, {'a': 2.5})]


def test_a_char_is_a_uint8_in_any_definition():
    for short, kind in (('Char', 'char'), ('UInt8', 'uint8')):
        define(f'test_messages/msg/{short}', f'{kind} a\n{kind}[] b\n{kind}[<=3] c\n')
    fields = [definitions.field_descriptions(f'test_messages/msg/{x}') for x in ('Char', 'UInt8')]
    assert fields[0] == fields[1]


def test_a_misspelled_field_is_refused():
    with pytest.raises(TypeError, match='tiem'):
        Impact(tiem=1.0)
    with pytest.raises(AttributeError, match='tiem'):
        Impact().tiem = 1.0


def test_array_fields_take_what_can_be_an_array():
    for values in ([1, 2], (1.0, 2.0), np.array([1, 2]), np.array([[1.0], [2.0]]), range(1, 3)):
        message = JointState(position=values)
        assert message.position.tolist() == [1.0, 2.0]
        assert deserialize(serialize(message), JointState) == message
    kept = np.array([1.0, 2.0])
    assert np.shares_memory(JointState(position=kept).position, kept)
    strided = np.arange(6.0)[::2]
    assert deserialize(serialize(JointState(effort=strided)), JointState).effort.tolist() == [
        0,
        2,
        4,
    ]
    assert float64_array([1, 2]).tolist() == [1.0, 2.0]
    with pytest.raises(TypeError, match='uint8'):
        LinkageState(modes=[0.5])


def test_cdr_is_what_an_independent_reader_reads():
    message = Impact(time=0.25, index=7, joint='crank_coupler', energy_loss=1e-3)
    message.header.stamp = stamp(0.25)
    data = serialize(message)
    assert data[:4] == bytes((0, 1, 0, 0))
    readers = generate_dynamic(type_name(Impact), definition(type_name(Impact)))
    found = readers[type_name(Impact)](data)
    assert (found.time, found.index, found.joint) == (0.25, 7, 'crank_coupler')
    assert found.header.stamp.nanosec == 250_000_000
    assert deserialize(data, Impact) == deserialize(data, 'mechanism_sim/msg/Impact') == message


@pytest.mark.parametrize('name', READINGS)
def test_messages_of_parts_have_the_fields_of_their_readings(name):
    """As `python docs/messages.py` writes them."""
    text = (message_folder() / f'{name}.msg').read_text(encoding='utf-8')
    assert text == written(name), 'python docs/messages.py'
    assert not [comment for _, comment in fields(READINGS[name]) if '{' in comment]


TYPES = 6, '8bb3ee4dca8d'


def test_other_types_of_messages_have_another_version_of_bags():
    hashes = ' '.join(type_hash(f'mechanism_sim/msg/{name}') for name in own_messages())
    now = VERSION, hashlib.sha256(hashes.encode()).hexdigest()[:12]
    assert now == TYPES, 'raise VERSION in recording/writer.py, with a line, and enter both here'


@pytest.mark.parametrize('name', own_messages())
def test_every_own_message_survives_the_trip_and_its_schema_is_complete(name):
    full = f'mechanism_sim/msg/{name}'
    cls = message_class(full)
    assert type_name(cls) == full
    assert getattr(messages, name) is cls
    assert deserialize(serialize(cls()), cls) == cls()
    text = definition(full)
    assert text.startswith((message_folder() / f'{name}.msg').read_text())
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, full))
    assert store.hash_rihs01(full) == type_hash(full)


def test_nested_definitions_come_once_each_under_their_ruler():
    text = definition('tf2_msgs/msg/TFMessage')
    headers = [line for line in text.splitlines() if line.startswith('MSG: ')]
    assert len(headers) == len(set(headers)) == 6
    assert text.count('=' * 80 + '\nMSG: geometry_msgs/Quaternion\n') == 1
    assert TFMessage().transforms == []


def test_services_have_requests_and_responses():
    assert type_name(Trigger) == 'std_srvs/srv/Trigger'
    response = Trigger.Response(success=True, message='done')
    assert deserialize(serialize(response), Trigger.Response) == response
    assert serialize(Trigger.Request()) == bytes((0, 1, 0, 0, 0))


def test_what_is_no_message_is_named():
    with pytest.raises(MessageError, match='no_such'):
        message_class('no_such/msg/Thing')
    with pytest.raises(MessageError, match=r'Impact.*time is str'):
        serialize(Impact(time='soon'))
    with pytest.raises(MessageError, match='3 bytes'):
        deserialize(b'abc', Impact)
    with pytest.raises(MessageError, match='Impact'):
        deserialize(serialize(Impact())[:-8], Impact)
    with pytest.raises(AttributeError, match='Impakt'):
        messages.Impakt  # noqa: B018
    with pytest.raises(MessageError, match='int'):
        type_name(int)


def test_what_ros_would_refuse_is_found(monkeypatch):
    message = Impact(time=1, index=-1, joint=3)
    message.header = None
    found = list(checks.refusals(message))
    assert [text.split()[0] for text in found] == ['header', 'time', 'index', 'joint']
    assert not list(checks.refusals(Impact(time=1.0)))
    assert not list(checks.refusals(JointState(name=['a'], position=[1])))
    monkeypatch.setattr(classes, '_CHECK_FIELDS', True)
    with pytest.raises(MessageError, match='time is int 1, not float'):
        serialize(Impact(time=1))


@pytest.mark.parametrize('time', [0.0, 0.1, 1.9999999999, 123456.789, 1e9])
def test_stamps_round_to_nanoseconds(time):
    assert abs(seconds(stamp(time)) - time) <= 0.5e-9 + 1e-16 * time
    assert 0 <= stamp(time).nanosec < 1_000_000_000


def test_definitions_are_found_where_pip_puts_them(tmp_path):
    site = tmp_path / 'lib' / 'python3' / 'site-packages'
    package = site / 'mechanism_sim'
    package.mkdir(parents=True)
    (package / '__init__.py').touch()
    shutil.copytree(Path(messages.__file__).parent, package / 'messages')
    shutil.copytree(Path(checks.__file__).parent, site / 'ros_interfaces')
    shared = tmp_path / 'share' / 'mechanism_sim' / 'msg'
    shared.mkdir(parents=True)
    (shared / 'Only.msg').write_text('float64 time\n')
    script = 'from mechanism_sim.messages import own_messages, message_folder as f; '
    script += 'print(own_messages(), f())'
    environment = {**os.environ, 'PYTHONPATH': str(site)}
    done = subprocess.run(
        [sys.executable, '-c', script],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["('Only',)", str(shared)]


@pytest.mark.parametrize('fault', ['RuntimeError("built for NumPy 1")', 'OSError("libfoo.so")'])
def test_a_package_of_messages_that_fails_in_any_way_is_not_installed(
    monkeypatch, tmp_path, fault
):
    """Services of an optional package are then missing, and the run goes on."""
    (tmp_path / 'broken_msgs').mkdir()
    (tmp_path / 'broken_msgs' / 'msg.py').write_text(f'raise {fault}')
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MessageError, match=r"'broken_msgs/msg/Any' is not installed"):
        classes._ros_class('broken_msgs/msg/Any')
