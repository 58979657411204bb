"""Two machines side by side, ``/left`` and ``/right``, that know nothing of each other."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

MACHINES = {'left': 'four_bar_clearance', 'right': 'slider_crank_engine'}
SHARED = {
    'duration': ('1', 'length of the runs [s]'),
    'realtime_factor': ('0', 'simulated seconds per second; 0: no limit'),
    'display': ('false', 'markers for RViz and Foxglove, too'),
    'on_failure': ('shutdown', 'of one machine: shutdown of both, or ignore'),
}


def generate_launch_description():
    """Describe the launch."""
    entities = []
    for name, (default, about) in SHARED.items():
        entities.append(DeclareLaunchArgument(name, default_value=default, description=about))
    for side, scene in MACHINES.items():
        entities += [
            DeclareLaunchArgument(side, default_value=scene, description=f'scene of /{side}'),
            DeclareLaunchArgument(
                f'record_{side}', default_value='', description=f'MCAP file for /{side}'
            ),
            GroupAction([_machine(side)], scoped=True),
        ]
    return LaunchDescription(entities)


def _machine(side):
    file = Path(__file__).with_name('machine.launch.py')
    arguments = {name: LaunchConfiguration(name) for name in SHARED}
    arguments |= {
        'namespace': side,
        'scene': LaunchConfiguration(side),
        'record': LaunchConfiguration(f'record_{side}'),
    }
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(file)), launch_arguments=arguments.items()
    )
