"""A machine as nodes: ``ros2 launch mechanism_sim machine.launch.py scene:=four_bar_clearance``.

Starts the nodes the scene needs, each in a process of its own, and ends with them. A scene that is
not good, or a node that fails, ends it with a sentence and exit code 1.
"""

from __future__ import annotations

import atexit
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
    TimerAction,
)
from launch.event_handlers import OnProcessExit
from launch.events import matches_action
from launch.events.process import ShutdownProcess
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from mechanism_sim.ending import owned
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.nodes.run import Plan
from mechanism_sim.nodes.topics import topics_of
from mechanism_sim.scene import load_scene, span

ARGUMENTS = {
    'scene': ('four_bar_clearance', 'scene of the package, or path of a YAML file'),
    'overrides': ('', "PATH=VALUE, several separated by ';'"),
    'duration': ('', 'length of the run [s]'),
    'revolutions': ('', 'or in revolutions of the crank'),
    'realtime_factor': ('0', 'simulated seconds per second; 0: no limit'),
    'params_file': ('', 'YAML file with more parameters of the nodes'),
    'record': ('', 'MCAP file for our own recorder'),
    'ros_bag': ('', "folder for 'ros2 bag record -s mcap'"),
    'paused': ('false', 'begin paused, to be played or stepped by the services of crank_drive'),
    'hold': ('false', 'pause at the end instead of ending'),
    'display': ('false', 'markers for RViz and Foxglove, too'),
    'namespace': ('', 'of all nodes and topics'),
    'composed': ('false', 'all nodes in one process'),
}
DRAIN = 2.0
"""[s] that ``ros2 bag record`` gets after the last node has ended: what was published is in its
queues by then, and it has no way to say that it has written all of it."""


def generate_launch_description() -> LaunchDescription:
    """What ``ros2 launch`` asks for."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=about)
        for name, (default, about) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_machine)])


def _machine(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """The nodes of a machine, and who records them."""
    given = {name: context.launch_configurations[name] for name in ARGUMENTS}
    namespace = given['namespace'].strip('/')
    bag = f'bag_{namespace}'.strip('_').replace('/', '_') if given['ros_bag'] else ''
    plan = _plan(given, bag)
    if _truth('composed', given):
        nodes = {'run': _run(plan, namespace, given['params_file'])}
    else:
        nodes = {name: _node(plan, name, namespace, given['params_file']) for name in plan.nodes}
    recording = _recording(plan, namespace, given['ros_bag'], bag) if bag else None
    return [
        *([recording] if recording else []),
        *nodes.values(),
        *(
            RegisterEventHandler(OnProcessExit(target_action=node, on_exit=react))
            for node, react in _reactions(nodes, recording)
        ),
    ]


def _plan(given: dict[str, str], bag: str) -> Plan:
    overrides = [text.strip() for text in given['overrides'].split(';') if text.strip()]
    machine = load_scene(given['scene'], overrides)
    lengths = [_number(name, given) for name in ('revolutions', 'duration')]
    if given['params_file'] and not Path(given['params_file']).is_file():
        raise InputError(f'params_file:={given["params_file"]}: there is no such file')
    for name in ('record', 'ros_bag'):
        if given[name] and Path(given[name]).exists():
            raise InputError(f'{name}:={given[name]}: it exists already; choose another name')
    return Plan(
        machine,
        given['scene'],
        overrides,
        span(machine, *lengths),
        record=given['record'] or None,
        realtime_factor=_number('realtime_factor', given) or 0.0,
        paused=_truth('paused', given),
        hold=_truth('hold', given),
        display=_truth('display', given),
        listeners=(bag,) if bag else (),
    )


def _node(plan: Plan, name: str, namespace: str, more: str) -> Node:
    """A node in a process of its own."""
    values = {
        key: ParameterValue(value, value_type=type(value))
        for key, value in plan.options(name).items()
    }
    return Node(
        package='mechanism_sim', executable=name, namespace=f'/{namespace}',
        parameters=[more, values] if more else [values], output='screen',
        additional_env=owned({}),
    )  # fmt: skip


def _run(plan: Plan, namespace: str, more: str) -> Node:
    """All nodes in one process."""
    flags = {'--paused': plan.paused, '--hold': plan.hold, '--display': plan.display}
    arguments = [
        'run', plan.scene, '--duration', repr(plan.duration), '--realtime-factor',
        repr(plan.realtime_factor), *(flag for flag, chosen in flags.items() if chosen),
        *(part for text in plan.overrides for part in ('--set', text)),
    ]  # fmt: skip
    arguments += ['--record', plan.record] if plan.record else []
    arguments += ['--listeners', ','.join(plan.listeners)] if plan.listeners else []
    return Node(
        package='mechanism_sim', executable='mechanism-sim', namespace=f'/{namespace}',
        arguments=arguments, parameters=[more] if more else None, output='screen',
        additional_env=owned({}),
    )  # fmt: skip


def _recording(plan: Plan, namespace: str, folder: str, name: str) -> ExecuteProcess:
    """``ros2 bag record`` of all topics of a run, without its habit of keeping the last ten."""
    space = f'/{namespace}' if namespace else ''
    profiles = {}
    for topic in topics_of(plan.machine, plan.display):
        full = topic.name if topic.name.startswith('/') else f'{space}/{topic.name}'
        profiles[full] = {
            'history': topic.qos.history.name.lower(),
            'depth': topic.qos.depth,
            'reliability': topic.qos.reliability.name.lower(),
            'durability': topic.qos.durability.name.lower(),
        }
    profiles[f'{space}/progress'] = profiles[f'{space}/motion']
    handle, file = tempfile.mkstemp(prefix='qos_', suffix='.yaml')
    atexit.register(Path(file).unlink, missing_ok=True)
    with os.fdopen(handle, 'w', encoding='utf-8') as stream:
        yaml.safe_dump(profiles, stream)
    return ExecuteProcess(
        cmd=[
            'ros2', 'bag', 'record', '-s', 'mcap', '-o', folder, '--node-name', name,
            '--qos-profile-overrides-path', file, '--max-cache-size', '0',
            '--disable-keyboard-controls', '--topics', *profiles,
        ],
        output='screen',
    )  # fmt: skip


def _reactions(
    nodes: dict[str, Node], recording: ExecuteProcess | None
) -> list[tuple[ExecuteProcess, Callable[[Any, LaunchContext], Any]]]:
    """What happens when a process ends."""
    running = set(nodes)

    def ended(name: str, event: Any, context: LaunchContext) -> Any:
        running.discard(name)
        if context.is_shutdown:
            return None
        if event.returncode:
            raise RunError(f"'{name}' ended with exit code {event.returncode}; the run is over")
        if running or recording is None:
            return None
        stop = EmitEvent(event=ShutdownProcess(process_matcher=matches_action(recording)))
        return TimerAction(period=DRAIN, actions=[stop])

    def broken(_event: Any, context: LaunchContext) -> None:
        if running and not context.is_shutdown:
            raise RunError("'ros2 bag record' ended before the run did")

    def when(name: str) -> Callable[[Any, LaunchContext], Any]:
        return lambda event, context: ended(name, event, context)

    found: list[tuple[ExecuteProcess, Callable[[Any, LaunchContext], Any]]] = [
        (node, when(name)) for name, node in nodes.items()
    ]
    return [*found, (recording, broken)] if recording else found


def _number(name: str, given: dict[str, str]) -> float | None:
    try:
        return float(given[name]) if given[name] else None
    except ValueError:
        raise InputError(f'{name}:={given[name]} is not a number') from None


def _truth(name: str, given: dict[str, str]) -> bool:
    text = given[name].lower()
    if text not in ('true', 'false'):
        raise InputError(f'{name}:={given[name]} is neither true nor false')
    return text == 'true'
