"""A configuration for RViz: the machine from above, in parallel projection."""

from __future__ import annotations

from typing import Any

import yaml

from mechanism_sim.analysis.preview import Preview
from mechanism_sim.export.ideal import frame_of
from mechanism_sim.messages.topics import topics_of
from mechanism_sim.planar.points import GROUND
from mechanism_sim.report.plot_paths import resolve

_WINDOW = 1200, 846
_VIEW = 800.0, 650.0
"""Size of the window, and about that of the picture in it [pixels]."""


def to_rviz(seen: Preview, namespace: str = '', prefix: str = '') -> str:
    """The text of a file for ``rviz2 -d FILE``.

    Parameters
    ----------
    seen : of the machine
    namespace : of the nodes
    prefix : of the frames of links
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
