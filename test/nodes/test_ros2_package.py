"""The package as ROS 2 sees it: what colcon installs, launch files, bags of both recorders.

What needs ROS is skipped where it is missing; docs/ros2.md says how to run it.
"""

from __future__ import annotations

import ast
import json
import os
import re
import runpy
import shlex
import signal
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import yaml
from running import ROOT, TIMEOUT, environment, ros_found, run_json

import mechanism_sim as ms
from mechanism_sim import nodes
from mechanism_sim.analysis.summary import analyze
from mechanism_sim.messages import PUBLIC, own_messages, type_hash
from mechanism_sim.nodes.classes import NODE_CLASSES, NODE_NAMES
from mechanism_sim.nodes.run import NodePlan
from mechanism_sim.packages import EXTRAS, REQUIRED, distribution
from mechanism_sim.recording.reader import read_bag
from zenoh_rclpy.arguments import parse_arguments

NODES = Path(nodes.__file__).parent
needs_ros = pytest.mark.skipif(not ros_found(), reason='no ROS 2 here with this package built')
needs_rosbag = pytest.mark.skipif(
    not ros_found() or find_spec('ros2bag') is None, reason='no rosbag2 here'
)


def executables() -> list[str]:
    (listed,) = re.findall(r'set\(executables\s+([^)]*)\)', (ROOT / 'CMakeLists.txt').read_text())
    return listed.split()


def test_colcon_pip_and_the_command_line_know_the_same_nodes():
    assert sorted(executables()) == sorted([*NODE_CLASSES, 'mechanism-sim', 'zros'])
    tree = ast.parse((ROOT / 'setup.py').read_text())
    (listed,) = (
        ast.literal_eval(s.value)
        for s in tree.body
        if isinstance(s, ast.Assign) and getattr(s.targets[0], 'id', '') == 'NODES'
    )
    assert sorted(listed) == sorted(NODE_NAMES)


def test_the_manifest_says_what_pip_says_and_names_every_package_of_messages():
    manifest = ET.parse(ROOT / 'package.xml').getroot()
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text())['project']
    assert manifest.findtext('version') == project['version']
    assert manifest.findtext('export/build_type') == 'ament_cmake'
    named = {e.text for e in manifest if e.tag in ('depend', 'exec_depend')}
    assert {package.split('/')[0] for package in PUBLIC.values()} <= named
    own = set(re.findall(r'^(\w+)/\w+ ', '\n'.join(p.read_text() for p in MESSAGES), re.MULTILINE))
    built = {e.text for e in manifest if e.tag == 'depend'}
    assert own == built


def installed(page: str) -> list[str]:
    """Packages that a page of the documentation installs by pip, in its first such line."""
    line = re.search(r'^pip install ((?:.*\\\n)*.*)$', page, re.MULTILINE)
    assert line is not None
    return shlex.split(line[1].replace('\\\n', ' '))


def test_the_installation_states_the_versions_that_are_needed():
    """A distribution of ROS has older ones of most, which pip would be content with."""
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text())['project']
    extras = {one for some in project['optional-dependencies'].values() for one in some}
    given = installed((ROOT / 'docs' / 'ros2.md').read_text())
    assert {*project['dependencies']} <= {*given} <= {*project['dependencies'], *extras}


def modules_of(path: Path) -> set[str]:
    """The modules that a file imports, and those of the helpers of tests among them."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition('.')[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.partition('.')[0])
    return names


def test_what_tests_of_colcon_import_is_installed_by_the_documentation():
    suites = re.findall(r'foreach\(suite ([^)]*)\)', (ROOT / 'CMakeLists.txt').read_text())
    room, page = ROOT / 'test', (ROOT / 'docs' / 'ros2.md').read_text().partition('## Tests')[2]
    found, known = {'conftest'}, set(sys.stdlib_module_names)
    for suite in suites[0].split():
        folder, _, name = suite.partition('/')
        found |= modules_of(room / folder / f'test_{name}.py')
    helpers: set[str] = set()
    while new := {name for name in found - helpers if (room / f'{name}.py').is_file()}:
        helpers |= new
        found = found.union(*(modules_of(room / f'{name}.py') for name in new))
    ours = {
        'mechanism_sim',
        'ros_interfaces',
        'zenoh_rclpy',
        *(p.stem for p in room.rglob('*.py')),
    }
    only_within = {'axe_playwright_python', 'playwright', 'rclpy'}
    foreign = found - known - helpers - ours - only_within - {*REQUIRED}
    assert 'mcap_ros2' in foreign
    assert {name.replace('mcap_ros2', 'mcap-ros2-support') for name in foreign} <= {
        *installed(page)
    }


def test_the_changelog_of_ros_is_that_of_the_releases():
    to_rst = runpy.run_path(str(ROOT / 'docs' / 'changelog.py'))['to_rst']
    released = (ROOT / 'CHANGELOG.rst').read_text()
    assert released == to_rst((ROOT / 'CHANGELOG.md').read_text()), 'python docs/changelog.py'
    first = re.search(r'^(\d\S*) \(', released, re.MULTILINE)
    version = ET.parse(ROOT / 'package.xml').getroot().findtext('version')
    assert first is not None
    assert first[1] == version


def test_tools_of_ros_read_the_changelog():
    catkin = pytest.importorskip('catkin_pkg.changelog', reason='no catkin_pkg here')
    changelog = catkin.get_changelog_from_path(str(ROOT / 'CHANGELOG.rst'))
    (_, _, (changes, *_)), *_ = changelog.foreach_version()
    assert len(changes.bullets) > 5


BLOCKING = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in sys.argv[1].split(','):
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)

sys.meta_path.insert(0, Blocked())
from mechanism_sim.cli import main
main(sys.argv[2:])
"""


def test_packages_that_may_be_missing_are_those_of_pip():
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text())['project']
    names = {re.split('[><=]', requirement)[0] for requirement in project['dependencies']}
    assert {distribution(module) for module in REQUIRED} == names
    extras = project['optional-dependencies']
    for module, extra in EXTRAS.items():
        assert any(re.split('[><=]', one)[0] == distribution(module) for one in extras[extra])


class _Described(SimpleNamespace):
    """Stands for what `launch` and `launch_ros` make, and keeps what it was made with."""

    def __init__(self, *given: object, **how: object) -> None:
        super().__init__(given=given, **how)


def described(monkeypatch, program: Path, **given: str) -> dict[str, SimpleNamespace]:
    """The nodes of the launch file by name, with a `launch` that describes and starts nothing."""
    for name in (
        'launch', 'launch.actions', 'launch.event_handlers', 'launch.events',
        'launch.events.process', 'launch.logging', 'launch_ros', 'launch_ros.actions',
        'launch_ros.parameter_descriptions', 'launch_ros.substitutions', 'launch_ros.utilities',
    ):  # fmt: skip
        module = ModuleType(name)
        monkeypatch.setattr(module, '__getattr__', lambda _: _Described, raising=False)
        monkeypatch.setitem(sys.modules, name, module)
    names = sys.modules['launch_ros.utilities']
    monkeypatch.setattr(names, 'prefix_namespace', lambda *_: '/', raising=False)
    monkeypatch.setattr(names, 'make_namespace_absolute', lambda name: name, raising=False)
    executable = SimpleNamespace(perform=lambda _: str(program))
    substitutions = sys.modules['launch_ros.substitutions']
    monkeypatch.setattr(substitutions, 'ExecutableInPackage', lambda *_: executable, raising=False)
    monkeypatch.setattr(
        sys.modules['launch_ros.parameter_descriptions'], 'ParameterValue',
        lambda value, value_type: value_type(value), raising=False,
    )  # fmt: skip
    file = runpy.run_path(str(ROOT / 'launch' / 'machine.launch.py'))
    defaults = {name: default for name, (default, _) in file['ARGUMENTS'].items()}
    flags = dict.fromkeys(file['FLAGS'], 'false')
    values = defaults | flags | {'on_failure': 'shutdown'} | given
    entities = file['_machine'](SimpleNamespace(launch_configurations=values))
    return {e.executable: e for e in entities if hasattr(e, 'executable')}


@pytest.mark.slow
def test_a_file_of_parameters_for_all_nodes_has_the_last_word(monkeypatch, tmp_path):
    """`launch_ros` writes dictionaries to files for `/**`, and the last file counts."""
    program, given = tmp_path / 'mechanism-sim', tmp_path / 'given.yaml'
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m mechanism_sim "$@"\n')
    program.chmod(0o755)
    told = {'realtime_factor': 0.5, 'partner_timeout': 7.0, 'hold': True}
    given.write_text(yaml.safe_dump({'/**': {'ros__parameters': told}}))
    nodes = described(monkeypatch, program, params_file=str(given), duration='1')
    assert {'crank_drive', 'linkage'} <= nodes.keys()
    for name, node in nodes.items():
        args = ['--ros-args']
        for k, parameters in enumerate(node.parameters):
            path = tmp_path / f'{name}{k}.yaml'
            if isinstance(parameters, dict):
                path.write_text(yaml.safe_dump({'/**': {'ros__parameters': parameters}}))
            args += ['--params-file', parameters if isinstance(parameters, str) else str(path)]
        found = parse_arguments(args).parameters_of(f'/{name}')
        assert found | told == found
        assert found['duration'] == 1.0
    (all_in_one,) = described(
        monkeypatch, program, params_file=str(given), duration='1', composed='true'
    ).values()
    assert all_in_one.parameters == [str(given)]
    # What is no wish of the launch is not set by the command, which would have the last word.
    options = NodePlan(ms.load_scene('four_bar_clearance'), '', (), 1.0).options('crank_drive')
    assert not told.keys() - {'partner_timeout'} & options.keys()


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('package', 'node', 'code', 'said'),
    [
        ('heyoka', 'linkage', 2, "'heyoka' is missing: "),
        ('numpy', 'sensors', 2, "'numpy' is missing: "),
        ('mcap', 'recorder', 2, "'mcap' is missing: "),
        ('mcap', 'crank_drive', 1, "waited 0.1 s for 'nobody'"),
        ('pyarrow', 'recorder', 2, 'give the bag to write'),
    ],
)
def test_a_node_says_what_it_lacks_and_needs_no_more(package, node, code, said):
    options = '--scene', 'four_bar_nominal', '--partners', 'nobody', '--partner-timeout', '0.1'
    done = subprocess.run(
        [sys.executable, '-c', BLOCKING, package, 'node', node, *options],
        env=environment(), capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    (sentence,) = done.stderr.splitlines()
    assert said in sentence
    if 'missing' in said:
        assert sentence.endswith(f'{sys.executable} -m pip install {package}')


@pytest.mark.slow
def test_a_run_and_its_page_need_no_extra(tmp_path):
    args = 'report', 'four_bar_clearance', '--duration', '0.1', '-o', str(tmp_path / 'page.html')
    done = subprocess.run(
        [sys.executable, '-c', BLOCKING, ','.join(EXTRAS), *args],
        env=environment(), capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / 'page.html').stat().st_size > 100_000


MESSAGES = sorted((ROOT / 'msg').glob('*.msg'))


# --- with ROS ---------------------------------------------------------------------------------


MORTAL = 'setpriv', '--pdeathsig', 'KILL'
"""Before a command that is to end with the process of the tests, however that ends."""


def ros2(env: dict[str, str], *args: str, timeout: float = TIMEOUT) -> tuple[int, str]:
    """Exit code and output of a command ``ros2``."""
    done = subprocess.run(
        ['ros2', *args], env=env, capture_output=True, text=True, timeout=timeout, check=False
    )
    return done.returncode, done.stdout + done.stderr


def share() -> Path:
    """Folder into which colcon put the data files."""
    prefixes = os.environ['AMENT_PREFIX_PATH'].split(os.pathsep)
    folders = [Path(prefix, 'share', 'mechanism_sim') for prefix in prefixes]
    return next(folder for folder in folders if folder.is_dir())


@needs_ros
def test_type_hashes_are_those_of_rosidl():
    for name in own_messages():
        full = f'mechanism_sim/msg/{name}'
        described = json.loads((share() / 'msg' / f'{name}.json').read_text())
        hashes = {h['type_name']: h['hash_string'] for h in described['type_hashes']}
        assert type_hash(full) == hashes[full]


@needs_ros
def test_everything_is_installed(ros):
    assert (share() / 'config' / 'four_bar_clearance.yaml').is_file()
    assert (share() / 'launch' / 'machine.launch.py').is_file()
    _, listed = ros2(ros, 'pkg', 'executables', 'mechanism_sim')
    assert sorted(line.split()[1] for line in listed.splitlines()) == sorted(executables())
    _, shown = ros2(ros, 'interface', 'show', 'mechanism_sim/msg/Impact')
    assert 'float64 normal_impulse         # [N s]' in shown
    code, text = ros2(ros, 'run', 'mechanism_sim', 'mechanism-sim', 'scenes')
    assert code == 0
    assert 'four_bar_clearance' in text


@needs_ros
def test_no_node_takes_an_attribute_that_rclpy_uses():
    spec = find_spec('rclpy.node')
    assert spec is not None
    taken = set(re.findall(r'self\.(_[a-z]\w*)\b', Path(str(spec.origin)).read_text()))
    kinds = {
        kind.name: kind
        for file in NODES.glob('*.py')
        for kind in ast.walk(ast.parse(file.read_text()))
        if isinstance(kind, ast.ClassDef)
    }

    def is_node(name: str) -> bool:
        bases = kinds[name].bases if name in kinds else []
        return name == 'Node' or any(is_node(getattr(base, 'id', '')) for base in bases)

    own = {
        name: {
            node.attr
            for node in ast.walk(kind)
            if isinstance(node, ast.Attribute)
            and isinstance(node.ctx, ast.Store)
            and getattr(node.value, 'id', '') == 'self'
        }
        | {f.name for f in kind.body if isinstance(f, ast.FunctionDef)}
        for name, kind in kinds.items()
        if is_node(name)
    }
    assert {
        'CrankDrive',
        'LinkageNode',
        'Sensors',
        'SimulationNode',
        'DescribedNode',
    } <= own.keys()
    assert not {kind: names & taken for kind, names in own.items() if names & taken}


@needs_rosbag
def test_a_launched_machine_is_recorded_alike_by_both_recorders(ros, tmp_path):
    """Every message of every topic, byte for byte, and the motion that `solve` finds."""
    own, theirs = tmp_path / 'own.mcap', tmp_path / 'theirs'
    code, text = ros2(
        ros, 'launch', 'mechanism_sim', 'machine.launch.py', 'scene:=four_bar_clearance',
        'revolutions:=3', f'record:={own}', f'ros_bag:={theirs}',
    )  # fmt: skip
    assert code == 0, text
    first, second = read_bag(own), read_bag(theirs)
    assert first.topics.keys() == second.topics.keys()
    for topic in first.topics.keys() - {'/clock', '/progress'}:
        assert list(_bytes(first, topic)) == list(_bytes(second, topic)), topic
    # Our recorder does not hear itself.
    reports = [m for _, m, _ in second.messages('/progress') if m.node != 'recorder']
    assert reports == [m for _, m, _ in first.messages('/progress')]
    solved = run_json('solve', 'four_bar_clearance', '--revolutions', '3')
    assert analyze(theirs).digest == analyze(own).digest == solved['digest']


def _bytes(bag, topic):
    return (data for _, data, _ in bag.raw(topic))


@needs_ros
def test_two_machines_side_by_side_do_not_disturb_each_other(ros, tmp_path):
    bags = {side: tmp_path / f'{side}.mcap' for side in ('left', 'right')}
    code, text = ros2(
        ros, 'launch', 'mechanism_sim', 'two_machines.launch.py', 'duration:=0.2',
        'left:=four_bar_clearance', 'right:=geneva',
        *(f'record_{side}:={bag}' for side, bag in bags.items()),
    )  # fmt: skip
    assert code == 0, text
    for side, scene in (('left', 'four_bar_clearance'), ('right', 'geneva')):
        solved = run_json('solve', scene, '--duration', '0.2')
        assert analyze(bags[side]).digest == solved['digest']
        frames = [t for _, m, _ in read_bag(bags[side]).messages('/tf') for t in m.transforms]
        assert {t.child_frame_id.split('/')[0] for t in frames} == {side}


@needs_ros
@pytest.mark.parametrize(
    ('argument', 'said'),
    [
        ('scene:=four_bar_clearence', "did you mean 'four_bar_clearance'"),
        ('duration:=long', "--duration: 'long' is not a number"),
        ('params_file:=none.yaml', 'params_file:=none.yaml: there is no such file'),
    ],
)
def test_a_bad_launch_ends_with_one_sentence(ros, argument, said):
    code, text = ros2(ros, 'launch', 'mechanism_sim', 'machine.launch.py', argument)
    assert code == 1
    (line,) = [line for line in text.splitlines() if 'ERROR' in line]
    assert said in line
    assert 'Traceback' not in text


CELLS = """
import json
from launch import LaunchDescription
from launch.actions import (
    ExecuteProcess, GroupAction, IncludeLaunchDescription, OpaqueFunction, RegisterEventHandler)
from launch.event_handler import EventHandler
from launch.launch_description_sources import AnyLaunchDescriptionSource
from launch_ros.actions import PushRosNamespace

def cell(name, more):
    include = IncludeLaunchDescription(
        AnyLaunchDescriptionSource({file!r}),
        launch_arguments={{'scene': 'four_bar_clearance', 'realtime_factor': '1',
                           'on_failure': {reaction!r}, **more}}.items())
    return GroupAction([PushRosNamespace(name), include])

def failed(context):
    event = context.locals.event
    print('EVENT', json.dumps([event.namespace, event.process, event.returncode]), flush=True)

def generate_launch_description():
    return LaunchDescription([
        RegisterEventHandler(EventHandler(
            matcher=lambda event: event.name == 'mechanism_sim.MachineFailed',
            entities=[OpaqueFunction(function=failed)])),
        ExecuteProcess(cmd=['ros2', 'topic', 'echo', '/cell2/motion', '--field', 'known_until',
                            '--qos-reliability', 'reliable', '--qos-history', 'keep_all'],
                       output='screen'),
        cell('cell1', {{'duration': '3600'}}),
        cell('cell2', {{'duration': {length!r}, 'namespace': 'press'}}),
    ])
"""


@needs_ros
@pytest.mark.parametrize('reaction', ['ignore', 'shutdown'])
def test_a_machine_that_is_included_fails_alone_or_ends_the_launch(ros, tmp_path, reaction):
    """Two in namespaces that are pushed, beside a foreign node; a node of one is killed."""
    length = '20' if reaction == 'ignore' else '3600'
    file = tmp_path / 'cells.launch.py'
    machine = str(share() / 'launch' / 'machine.launch.py')
    file.write_text(CELLS.format(file=machine, reaction=reaction, length=length))
    launch = subprocess.Popen(
        [*MORTAL, 'ros2', 'launch', str(file)], env={**ros, 'PYTHONUNBUFFERED': '1'},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip
    said: list[str] = []
    assert launch.stdout is not None
    try:
        wanted = {'/cell1/linkage', '/cell1/sensors', '/cell2/press/crank_drive'}
        while not wanted <= set(ros2(ros, 'node', 'list', '--no-daemon')[1].split()):
            assert launch.poll() is None, said
        # the oldest: what a node starts has its command line for a moment
        command = r'lib/mechanism_sim/linkage .*__ns:=/cell1( |$)'
        pid = int(subprocess.check_output(['pgrep', '-o', '-f', command], text=True))
        os.kill(pid, signal.SIGKILL)
        while not any('EVENT' in line for line in said):
            said.append(launch.stdout.readline())
            assert said[-1], said
        if reaction == 'ignore':  # the other machine comes to its end, the foreign node stays
            while not any('the machine in /cell2/press has ended' in line for line in said):
                said.append(launch.stdout.readline())
                assert said[-1], said
            assert launch.poll() is None
            os.killpg(launch.pid, signal.SIGINT)
        said += launch.communicate(timeout=TIMEOUT)[0].splitlines()
    finally:
        with suppress(ProcessLookupError):
            os.killpg(launch.pid, signal.SIGKILL)
        launch.communicate()
    (event,) = [line for line in said if 'EVENT' in line]
    assert json.loads(event.partition('EVENT ')[2]) == ['/cell1', 'linkage', -9]
    text = '\n'.join(said)
    assert "'linkage' of the machine in /cell1 was killed by signal 9" in text
    assert 'Traceback' not in text
    # What `ros2 launch` ends with at a signal depends on when it comes.
    assert launch.returncode in ((0, -2) if reaction == 'ignore' else (1,))
    died = re.findall(r'\[ERROR\] \[(\w+)-\d+\]: process has died', text)
    assert [name for name in died if name != 'ros2'] == ['linkage']


@needs_ros
def test_nodes_that_are_launched_end_cleanly_at_a_signal(ros):
    launch = subprocess.Popen(
        [*MORTAL, 'ros2', 'launch', 'mechanism_sim', 'machine.launch.py', 'duration:=3600',
         'realtime_factor:=1'],
        env={**ros, 'PYTHONUNBUFFERED': '1'}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, start_new_session=True,
    )  # fmt: skip
    try:
        while '/sensors' not in ros2(ros, 'node', 'list', '--no-daemon')[1].split():
            assert launch.poll() is None
        os.killpg(launch.pid, signal.SIGINT)
        text, _ = launch.communicate(timeout=TIMEOUT)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(launch.pid, signal.SIGKILL)
        launch.communicate()
    assert text.count('process has finished cleanly') == 3
    assert 'has died' not in text


@needs_rosbag
def test_a_bag_of_ours_is_played_by_ros(ros, tmp_path):
    bag = tmp_path / 'run.mcap'
    outcome = run_json('run', 'four_bar_clearance', '--record', str(bag), env=ros)
    assert outcome['middleware'] == 'rclpy'
    listener = subprocess.Popen(
        [*MORTAL, 'ros2', 'topic', 'echo', '/impacts', 'mechanism_sim/msg/Impact', '--field',
         'index', '--qos-reliability', 'reliable', '--qos-history', 'keep_all'],
        env={**ros, 'PYTHONUNBUFFERED': '1'}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        played = 'bag', 'play', str(bag), '--delay', '4', '--disable-keyboard-controls'
        code, text = ros2(ros, *played)
        assert code == 0, text
        listener.send_signal(signal.SIGINT)
        heard, _ = listener.communicate(timeout=TIMEOUT)
    finally:
        listener.kill()
    indices = [int(line) for line in heard.splitlines() if line.isdecimal()]
    assert indices == list(range(outcome['impacts']))
