"""
A machine as nodes: ``ros2 launch mechanism_sim machine.launch.py scene:=four_bar_clearance``.

Starts the nodes that the scene needs, each in a process of its own, and ends with them. It needs
`launch` and `launch_ros` only: what is to be run comes from the package's own interpreter. To be
included: all names are relative to the namespace that is pushed, and `on_failure` says what the
failure of a node does to the rest of the launch. Each failure is an event, see `MachineFailed`.
"""

import atexit
import json
import os
import subprocess
import tempfile
from pathlib import Path

from launch import Event, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
    TimerAction,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown, matches_action
from launch.events.process import ShutdownProcess
from launch.logging import get_logger
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import ExecutableInPackage
from launch_ros.utilities import make_namespace_absolute, prefix_namespace

ARGUMENTS = {
    'scene': ('four_bar_clearance', 'scene of the package, or path of a YAML file'),
    'overrides': ('', "PATH=VALUE, several separated by ';'"),
    'duration': ('', 'length of the run [s]'),
    'revolutions': ('', 'or in revolutions of the crank'),
    'realtime_factor': ('0', 'simulated seconds per second; 0: no limit'),
    'params_file': ('', 'YAML file with more parameters of the nodes, which has the last word'),
    'record': ('', 'MCAP file for our own recorder'),
    'ros_bag': ('', "folder for 'ros2 bag record -s mcap'"),
    'namespace': ('', 'of all nodes and topics, within the namespace that is pushed'),
    'clock': ('', 'true or false: the time on /clock; if not given, unless in a namespace'),
}
FLAGS = {
    'paused': 'begin paused, to be played or stepped by the services of crank_drive',
    'hold': 'pause at the end instead of ending',
    'display': 'markers for RViz and Foxglove, too',
    'composed': 'all nodes in one process',
}
DRAIN = 2.0
"""[s] that ``ros2 bag record`` gets after the last node has ended: what was published is in its
queues by then, and it has no way to say that it has written all of it."""
OWNED = {'MECHANISM_SIM_PARENT': str(os.getpid())}
"""In the environment of the nodes, which then end with this process however that ends."""


class MachineFailed(Event):
    """
    A process of a machine failed: the machine ends, once for each machine.

    Matched by its name, ``EventHandler(matcher=lambda e: e.name == 'mechanism_sim.MachineFailed',
    entities=[...])``, as every inclusion of this file makes a class of its own; entities find it
    as ``context.locals.event``.

    Attributes
    ----------
    namespace : of the machine, absolute
    process : what failed, such as ``linkage``; empty if nothing could be started
    returncode : its exit code, negative for a signal
    reason : one sentence

    """

    name = 'mechanism_sim.MachineFailed'

    def __init__(self, namespace, process, returncode, reason):
        self.namespace, self.process = namespace, process
        self.returncode, self.reason = returncode, reason


def generate_launch_description():
    """Describe the launch."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=about)
        for name, (default, about) in ARGUMENTS.items()
    ]
    declared += [
        DeclareLaunchArgument(
            name, default_value='false', choices=['true', 'false'], description=about
        )
        for name, about in FLAGS.items()
    ]
    declared.append(
        DeclareLaunchArgument(
            'on_failure',
            default_value='shutdown',
            choices=['shutdown', 'ignore'],
            description='what happens to the rest of the launch if the machine fails',
        )
    )
    return LaunchDescription([*declared, OpaqueFunction(function=_machine)])


def _machine(context):
    """Make the processes of a machine, and what happens when they end."""
    given = {name: context.launch_configurations[name].strip() for name in (*ARGUMENTS, *FLAGS)}
    relative = given['namespace'].strip('/') or None
    pushed = context.launch_configurations.get('ros_namespace')
    namespace = make_namespace_absolute(prefix_namespace(pushed, relative)) or '/'
    machine = _Machine(namespace, context.launch_configurations['on_failure'] == 'shutdown')
    bag = f'bag{namespace}'.rstrip('/').replace('/', '_') if given['ros_bag'] else ''
    try:
        program = ExecutableInPackage('mechanism-sim', 'mechanism_sim').perform(context)
        options = _options(given, bag)
        _refuse(given)
        plan = _plan(program, options)
    except ValueError as error:
        return machine.fail(context, '', 2, str(error))
    more = [given['params_file']] if given['params_file'] else []
    shared = {
        'package': 'mechanism_sim', 'namespace': relative, 'output': 'screen',
        'additional_env': OWNED,
    }  # fmt: skip
    if given['composed'] == 'true':
        arguments = ['run', *options]
        if given['clock']:
            more = [{'publish_clock': given['clock'] == 'true'}, *more]
        machine.nodes['run'] = Node(
            executable='mechanism-sim', arguments=arguments, parameters=more, **shared
        )
    else:
        for name, values in plan['nodes'].items():
            if name == 'crank_drive' and given['clock']:
                values['publish_clock'] = given['clock'] == 'true'
            typed = {
                k: ParameterValue(v, value_type=list[str] if isinstance(v, list) else type(v))
                for k, v in values.items()
            }
            # The last file has the last word, and ours is for all nodes (/**), as theirs may be.
            machine.nodes[name] = Node(executable=name, parameters=[typed, *more], **shared)
    if bag:
        machine.recording = _recording(plan, namespace, given['ros_bag'], bag)
    return machine.entities()


def _options(given, bag):
    """Write options of ``mechanism-sim run``."""
    options = [given['scene'], '--realtime-factor', given['realtime_factor']]
    for text in filter(None, map(str.strip, given['overrides'].split(';'))):
        options += ['--set', text]
    for name in ('duration', 'revolutions', 'record'):
        options += [f'--{name}', given[name]] if given[name] else []
    options += [f'--{name}' for name in ('paused', 'hold', 'display') if given[name] == 'true']
    return [*options, '--listeners', bag] if bag else options


def _plan(program, options):
    """
    Ask for the nodes with their parameters, and the topics with their quality of service.

    Raises ValueError with one sentence if the machine cannot be run.
    """
    asked = subprocess.run(  # noqa: S603
        [program, 'run', *options, '--plan'],
        env={**os.environ, **OWNED}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if asked.returncode:
        said = [line for line in asked.stderr.splitlines() if line.strip()]
        raise ValueError(
            said[-1].removeprefix('mechanism-sim: ')
            if said
            else f'{program} ended with {asked.returncode}'
        )
    return json.loads(asked.stdout)


def _refuse(given):
    """Raise ValueError for a file that is missing, a folder that is there, a word that is none."""
    if given['clock'] not in ('', 'true', 'false'):
        raise ValueError(f'clock:={given["clock"]}: true or false, or nothing')
    if given['params_file'] and not Path(given['params_file']).is_file():
        raise ValueError(f'params_file:={given["params_file"]}: there is no such file')
    if given['ros_bag'] and Path(given['ros_bag']).exists():
        raise ValueError(f'ros_bag:={given["ros_bag"]}: it exists already; choose another name')


def _recording(plan, namespace, folder, name):
    """Start ``ros2 bag record`` of all topics, without its habit of keeping the last ten."""
    space = namespace.rstrip('/')
    profiles = {
        topic if topic.startswith('/') else f'{space}/{topic}': profile
        for topic, profile in plan['topics'].items()
    }
    handle, file = tempfile.mkstemp(prefix='qos_', suffix='.yaml')
    atexit.register(Path(file).unlink, missing_ok=True)
    with os.fdopen(handle, 'w', encoding='utf-8') as stream:
        json.dump(profiles, stream)  # JSON is YAML
    return ExecuteProcess(
        cmd=[
            'ros2', 'bag', 'record', '-s', 'mcap', '-o', folder, '--node-name', name,
            '--qos-profile-overrides-path', file, '--max-cache-size', '0',
            '--disable-keyboard-controls', '--topics', *profiles,
        ],
        output='screen',
    )  # fmt: skip


class _Machine:
    """
    The processes of one machine, which end together.

    Attributes
    ----------
    nodes : actions by the names of the nodes, or of the one process that has all
    recording : the action of ``ros2 bag record``, if there is one

    """

    def __init__(self, namespace, fatal):
        self.namespace, self.fatal = namespace, fatal
        self.nodes, self.recording = {}, None
        self._failed, self._running = False, set()

    def entities(self):
        """List all processes, and what happens when each ends."""
        self._running = set(self.nodes)
        entities = [
            RegisterEventHandler(OnProcessExit(target_action=node, on_exit=self._reaction(name)))
            for name, node in self.nodes.items()
        ]
        if self.recording:
            handler = OnProcessExit(target_action=self.recording, on_exit=self._recorded)
            entities += [RegisterEventHandler(handler), self.recording]
        return [*entities, *self.nodes.values()]

    def fail(self, context, process, returncode, reason):
        """Tell of a failure, and end what is left."""
        if self._failed:
            return []
        self._failed = True
        event = MachineFailed(self.namespace, process, returncode, reason)
        left = [self.nodes[name] for name in sorted(self._running)]
        left += [self.recording] if self.recording else []
        actions = [EmitEvent(event=event), *map(_stop, left)]
        get_logger('mechanism_sim').error(reason)
        if not self.fatal:
            return actions
        # Gives `ros2 launch` its exit code, which an event cannot.
        context.asyncio_loop.call_exception_handler({'message': f'{self.namespace}: launch ends'})
        return [*actions, EmitEvent(event=Shutdown(reason=reason))]

    def _reaction(self, name):
        return lambda event, context: self._ended(name, event.returncode, context)

    def _ended(self, name, returncode, context):
        self._running.discard(name)
        if context.is_shutdown:
            return []
        if returncode:
            how = (
                f'was killed by signal {-returncode}'
                if returncode < 0
                else f'ended with exit code {returncode}'
            )
            reason = f"'{name}' of the machine in {self.namespace} {how}; its run is over"
            return self.fail(context, name, returncode, reason)
        if self._running or self._failed:
            return []
        done = LogInfo(msg=f'the machine in {self.namespace} has ended its run')
        if self.recording:
            return [done, TimerAction(period=DRAIN, actions=[_stop(self.recording)])]
        return [done]

    def _recorded(self, event, context):
        if self._running and not context.is_shutdown:
            reason = "'ros2 bag record' ended before the run did"
            return self.fail(context, 'ros2 bag record', event.returncode, reason)
        return []


def _stop(action):
    return EmitEvent(event=ShutdownProcess(process_matcher=matches_action(action)))
