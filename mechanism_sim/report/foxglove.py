"""A layout for Foxglove: the machine in a 3D panel, plots, events, diagnostics.

The keys are those that Foxglove exports, as in Lichtblick, which reads them too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mechanism_sim import strict_json
from mechanism_sim.analysis.preview import Preview
from mechanism_sim.export.ideal import frame_of
from mechanism_sim.planar.points import GROUND
from mechanism_sim.report.plot_paths import Plot, plots, resolve

_AXES = 0.2  # [m] length of the axes of a frame at scale 1


def to_foxglove(seen: Preview, namespace: str = '', prefix: str = '') -> str:
    """The text of a layout file, to be imported in Foxglove.

    Parameters
    ----------
    seen : of the machine
    namespace : of the nodes
    prefix : of the frames of links
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
    """Over the stamps of messages, which are the machine's time."""
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
