"""Layouts for Foxglove, whose keys Lichtblick reads too, and RViz: the machine, plots."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import yaml

from mechanism_sim import strict_json
from mechanism_sim.analysis.preview import Preview
from mechanism_sim.errors import InputError
from mechanism_sim.export.ideal import frame_of
from mechanism_sim.messages.part_states import kinds_of
from mechanism_sim.messages.topics import topics_of
from mechanism_sim.planar.points import GROUND
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.scene import Machine
from ros_interfaces.names import InvalidNameError, resolve_namespace

_AXES = 0.2  # [m] length of the axes of a frame at scale 1
_WINDOW = 1200, 846
_VIEW = 800.0, 650.0  # size of the window, and about that of the picture in it [pixels]


@dataclass(frozen=True)
class Plot:
    """A plot over time."""

    group: str  #: subject
    title: str  #: the quantity with its unit
    #: ``TOPIC.FIELD`` by the label of each line, in the syntax of Foxglove's message paths
    paths: dict[str, str] = field(default_factory=dict)
    #: lines; dots for events; or the values of an array in the latest message
    style: Literal['line', 'dots', 'array'] = 'line'


def resolve(namespace: str, topic: str) -> str:
    """The full name of a topic, or path into it, in a namespace, which may be empty."""
    try:
        home = resolve_namespace(namespace).rstrip('/')
    except InvalidNameError as error:
        raise InputError(str(error)) from error
    return topic if topic.startswith('/') else f'{home}/{topic}'


def plots(machine: Machine, namespace: str = '') -> list[Plot]:
    """The plots of a machine that have at least one line."""
    made = (*_motion(machine), *_forces(machine), *_contacts(machine), *_parts(machine))
    return [
        replace(p, paths={label: resolve(namespace, x) for label, x in p.paths.items()})
        for p in (*made, *_sensors(machine))
        if p.paths
    ]


def _numbered(
    names: tuple[str, ...], path: str, only: tuple[str, ...] | None = None
) -> dict[str, str]:
    """One line for each name, or `only` for these, from an array in the order of the names."""
    return {n: f'{path}[{i}]' for i, n in enumerate(names) if only is None or n in only}


def _motion(machine: Machine) -> Iterator[Plot]:
    physics = machine.physics
    straight = physics.displacements
    turning = tuple(c for c in physics.coordinates if c not in straight)
    for title, array, only in (
        ('Angles [rad]', 'position', turning),
        ('Angular velocities [rad/s]', 'velocity', turning),
        ('Displacements [m]', 'position', straight),
        ('Velocities [m/s]', 'velocity', straight),
    ):
        lines = _numbered(physics.coordinates, f'joint_states.{array}', only)
        yield Plot('Motion', title, lines)


def _forces(machine: Machine) -> Iterator[Plot]:
    physics = machine.physics
    if not (physics.has_forces and machine.scene.outputs.forces):
        return
    for axis in 'xy':
        lines = _numbered(physics.joints, f'joint_reactions.force_{axis}')
        yield Plot('Forces', f'Joint reactions, {axis} [N]', lines)
    for axis in 'xy':
        lines = _numbered(physics.joints, f'joint_reactions.moment_{axis}')
        tilting = {joint: lines[joint] for joint in physics.tilting}
        yield Plot('Forces', f'Bearing moments, {axis} [N m]', tilting)
    if physics.driven:
        main = machine.plan.main
        straight = main in physics.displacements
        title = 'Drive force [N]' if straight else 'Drive torque [N m]'
        yield Plot('Forces', title, {main: 'joint_reactions.drive_torque'})
    energies = 'kinetic_energy', 'potential_energy', 'drive_work', 'dissipated'
    lines = {e.replace('_', ' '): f'linkage_state.{e}' for e in energies}
    yield Plot('Forces', 'Energies [J]', lines)


def _contacts(machine: Machine) -> Iterator[Plot]:
    gaps = machine.physics.clearances
    yield Plot('Contacts', 'Gaps [m]', _numbered(gaps, 'linkage_state.gaps'))
    forces = _numbered(gaps, 'linkage_state.normal_forces')
    yield Plot('Contacts', 'Normal forces [N]', forces)
    impulses = {gap: _of('impacts', gap, 'normal_impulse') for gap in gaps}
    yield Plot('Contacts', 'Impacts, normal impulse [N s]', impulses, 'dots')


def _parts(machine: Machine) -> Iterator[Plot]:
    known = catalogue(machine)
    for node, kind in kinds_of(machine).items():
        for joint in kind.joints(machine):
            group = node.replace('_', ' ').capitalize()
            for title, fields in joint.charts.items():
                own = {f: q for f in fields if (q := known.get(f'{f}.{joint.name}'))}
                lines = {q.title: _of(kind.topic, joint.name, f) for f, q in own.items()}
                units = ' or '.join({q.unit: None for q in own.values()})
                yield Plot(group, f'{joint.name}: {title} [{units}]', lines)
    for name in machine.scene.oscillators:
        lines = {x: _of('oscillator_state', name, x, 'oscillator') for x in 'xy'}
        yield Plot('Oscillators', f'{name}: displacement [m]', lines)


def _of(topic: str, name: str, value: str, key: str = 'joint') -> str:
    """A field of the messages about one joint."""
    return f'{topic}{{{key}=="{name}"}}.{value}'


def _sensors(machine: Machine) -> Iterator[Plot]:
    for name, sensor in machine.scene.sensors.items():
        title = f'{name}: {sensor.measures} [{sensor.unit}], latest samples'
        yield Plot('Sensors', title, {name: f'{sensor.kind}/{name}.samples[:]'}, 'array')
        if sensor.imu:
            axes = {x: f'imu/{name}.linear_acceleration.{x}' for x in 'xy'}
            yield Plot('Sensors', f'{name} as inertial unit [m/s^2]', axes)


def to_rviz(seen: Preview, namespace: str = '', prefix: str = '') -> str:
    """The text of a file for ``rviz2 -d FILE``.

    Parameters
    ----------
    seen : preview of the machine
    namespace : namespace of the nodes
    prefix : prefix of the frames of links
    """
    width, height = (seen.high - seen.low).tolist()
    x, y = seen.centre.tolist()
    world = frame_of(GROUND, prefix)
    tools = 'Interact', 'MoveCamera', 'Select', 'FocusCamera', 'Measure'
    manager = {
        'Class': '',
        'Displays': _displays(seen, namespace, prefix),
        'Enabled': True,
        'Global Options': {
            'Background Color': '255; 255; 255', 'Fixed Frame': world, 'Frame Rate': 30,
        },
        'Name': 'root',
        'Tools': [{'Class': f'rviz_default_plugins/{tool}'} for tool in tools],
        'Value': True,
        'Views': {
            'Current': {
                'Class': 'rviz_default_plugins/TopDownOrtho', 'Name': 'Current View',
                'Target Frame': '<Fixed Frame>', 'Value': 'TopDownOrtho (rviz_default_plugins)',
                'Scale': min(_VIEW[0] / width, _VIEW[1] / height), 'Angle': 0.0, 'X': x, 'Y': y,
                'Near Clip Distance': 0.01, 'Invert Z Axis': False,
            },
            'Saved': None,
        },
    }  # fmt: skip
    panels = [
        {'Class': 'rviz_common/Displays', 'Name': 'Displays', 'Help Height': 78},
        {'Class': 'rviz_common/Views', 'Name': 'Views'},
        {'Class': 'rviz_common/Time', 'Name': 'Time', 'SyncMode': 0, 'SyncSource': ''},
    ]
    window = {'Width': _WINDOW[0], 'Height': _WINDOW[1], 'X': 60, 'Y': 60}
    config = {
        'Panels': panels, 'Visualization Manager': manager, 'Window Geometry': window,
    }  # fmt: skip
    return yaml.safe_dump(config, sort_keys=False)


def _displays(seen: Preview, namespace: str, prefix: str) -> list[dict[str, Any]]:
    delivery = {t.name: t.delivery for t in topics_of(seen.machine, display=True)}

    def topic(name: str) -> dict[str, Any]:
        latched = delivery[name] == 'latched'
        return {
            'Value': resolve(namespace, name),
            'Depth': 1 if latched else 100,
            'History Policy': 'Keep Last',
            'Reliability Policy': 'Reliable',
            'Durability Policy': 'Transient Local' if latched else 'Volatile',
        }

    links = [frame_of(body.name, prefix) for body in seen.machine.mechanism.bodies]
    frames: dict[str, Any] = {name: {'Value': True} for name in (frame_of(GROUND, prefix), *links)}
    return [
        {
            'Class': 'rviz_default_plugins/TF', 'Name': 'Frames of the links', 'Enabled': True,
            'Value': True, 'Show Names': False, 'Show Arrows': False, 'Show Axes': True,
            'Marker Scale': 6.0 * seen.skeleton.symbol, 'Frame Timeout': 15,
            'Frames': {'All Enabled': False, **frames},
        },
        {
            'Class': 'rviz_default_plugins/MarkerArray', 'Name': 'Machine', 'Enabled': True,
            'Value': True, 'Namespaces': {}, 'Topic': topic('markers'),
        },
        {
            'Class': 'rviz_default_plugins/MarkerArray', 'Name': 'Forces and clearances',
            'Enabled': True, 'Value': True, 'Namespaces': {}, 'Topic': topic('force_markers'),
        },
        # off: the markers show more, and frames between links are not on /tf
        {
            'Class': 'rviz_default_plugins/RobotModel', 'Name': 'URDF', 'Enabled': False,
            'Value': False, 'Alpha': 1, 'Description Source': 'Topic', 'Description File': '',
            'Description Topic': topic('robot_description'), 'TF Prefix': '',
            'Visual Enabled': True, 'Collision Enabled': False, 'Update Interval': 0,
        },
    ]  # fmt: skip


def to_foxglove(seen: Preview, namespace: str = '', prefix: str = '') -> str:
    """The text of a layout file, to be imported in Foxglove.

    Parameters
    ----------
    seen : preview of the machine
    namespace : namespace of the nodes
    prefix : prefix of the frames of links
    """
    machine = seen.machine
    panels: dict[str, Any] = {'3D!machine': _scene(seen, namespace, prefix)}
    groups: dict[str, list[str]] = {}
    for k, plot in enumerate(plots(machine, namespace)):
        panels[f'Plot!{k}'] = _plot(plot)
        groups.setdefault(plot.group, []).append(f'Plot!{k}')
    run = groups.setdefault('Run', [])
    run.append('DiagnosticSummary!run')  # while it runs: they go by the clock, and in no bag
    panels[run[-1]] = {
        'minLevel': 0, 'pinnedIds': [], 'hardwareIdFilter': '', 'sortByLevel': True,
        'topicToRender': '/diagnostics',
    }  # fmt: skip
    for topic in ('mode_changes',) if machine.physics.clearances else ('joint_states',):
        run.append(f'RawMessages!{topic}')
        panels[run[-1]] = {
            'topicPath': resolve(namespace, topic), 'diffEnabled': False, 'diffMethod': 'custom',
            'diffTopicPath': '', 'showFullMessageForDiff': False,
        }  # fmt: skip
    tabs = [{'title': title, 'layout': _stack(ids)} for title, ids in groups.items()]
    panels['Tab!plots'] = {'activeTabIdx': 0, 'tabs': tabs}
    layout = {
        'configById': panels,
        'globalVariables': {},
        'userNodes': {},
        'playbackConfig': {'speed': 1.0},
        'layout': {
            'direction': 'row', 'first': '3D!machine', 'second': 'Tab!plots',
            'splitPercentage': 50,
        },
    }  # fmt: skip
    return strict_json.dumps(layout, indent=2) + '\n'


def _scene(seen: Preview, namespace: str, prefix: str) -> dict[str, Any]:
    """The machine from above, in parallel projection, x to the right and y upwards."""
    width, height = (seen.high - seen.low).tolist()
    visible = 1.2 * max(width, height)
    x, y = seen.centre.tolist()
    links = [body.name for body in seen.machine.mechanism.bodies]
    world = frame_of(GROUND, prefix)
    grid = 10.0 ** np.floor(np.log10(visible))
    return {
        'cameraState': {
            'perspective': False, 'distance': visible, 'phi': 0, 'thetaOffset': 0, 'fovy': 45,
            'targetOffset': [x, y, 0.0], 'target': [0, 0, 0], 'targetOrientation': [0, 0, 0, 1],
            'near': 1e-3 * visible, 'far': 20.0 * visible,
        },
        'followTf': world,
        'followMode': 'follow-none',
        'scene': {
            'transforms': {
                'showLabel': False, 'lineWidth': 0, 'labelSize': 2.0 * seen.skeleton.symbol,
                'axisScale': 3.0 * seen.skeleton.symbol / _AXES,
            },
        },
        'transforms': {f'frame:{frame_of(link, prefix)}': {'visible': True} for link in links},
        'topics': {
            resolve(namespace, topic): {'visible': True} for topic in ('markers', 'force_markers')
        },
        'layers': {
            'grid': {
                'layerId': 'foxglove.Grid', 'instanceId': 'grid', 'label': f'Grid of {grid:g} m',
                'visible': True, 'frameLocked': True, 'frameId': world, 'size': 10.0 * grid,
                'divisions': 10, 'lineWidth': 1, 'color': '#80808060', 'position': [0, 0, 0],
                'rotation': [0, 0, 0], 'order': 1,
            },
            # off: the markers show more, and true to scale
            'robot': {
                'layerId': 'foxglove.Urdf', 'instanceId': 'robot', 'label': 'URDF',
                'visible': False, 'frameLocked': True, 'sourceType': 'topic', 'url': '',
                'filePath': '', 'parameter': '', 'framePrefix': '', 'displayMode': 'auto',
                'topic': resolve(namespace, 'robot_description'), 'order': 2,
            },
        },
    }  # fmt: skip


def _plot(plot: Plot) -> dict[str, Any]:
    """Plot over the stamps of messages, which are the machine's time."""
    paths = [
        {
            'value': path, 'enabled': True, 'label': label, 'timestampMethod': 'headerStamp',
            'showLine': plot.style != 'dots',
        }
        for label, path in plot.paths.items()
    ]  # fmt: skip
    over_time = plot.style != 'array'
    title = f'{plot.title}, over time [s]' if over_time else plot.title
    return {
        'title': title, 'foxglovePanelTitle': title, 'paths': paths,
        'xAxisVal': 'timestamp' if over_time else 'index', 'isSynced': over_time,
        'showXAxisLabels': True, 'showYAxisLabels': True, 'showLegend': True,
        'legendDisplay': 'floating', 'showPlotValuesInLegend': False, 'sidebarDimension': 240,
    }  # fmt: skip


def _stack(panels: list[str]) -> Any:
    """Panels of equal height on top of each other, as a tree of splits."""
    if len(panels) == 1:
        return panels[0]
    return {
        'direction': 'column', 'first': panels[0], 'second': _stack(panels[1:]),
        'splitPercentage': 100.0 / len(panels),
    }  # fmt: skip
