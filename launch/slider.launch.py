"""
Move a machine in RViz by a slider: ``ros2 launch mechanism_sim slider.launch.py scene:=geneva``.

A panel (``joint_state_publisher_gui``) shows the driving joint with its limits; `loop_relay`
closes the loops and publishes the states of all joints and their frames. With ``gui:=false``
``driver_states`` come from a controller or an encoder.
"""

import os
from pathlib import Path

from ament_index_python.packages import get_packages_with_prefixes
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    'scene': ('four_bar_clearance', 'scene of the package, or path of a YAML file'),
    'overrides': ('', 'PATH=VALUE, one a line'),
    'gui': ('true', 'a panel with a slider for each driving joint'),
    'rviz': ('true', 'RViz with the machine'),
}
NEEDED = {'gui': 'joint_state_publisher_gui', 'rviz': 'rviz2'}


def _refuse(context):
    """Refuse to begin without a package that is wanted, before anything has started."""
    installed = get_packages_with_prefixes()
    for flag, package in NEEDED.items():
        wanted = context.launch_configurations[flag].strip().lower() in ('true', '1')
        if wanted and package not in installed:
            raise RuntimeError(f'{package} is not installed: install it, or give {flag}:=false')


def generate_launch_description():
    """Describe the launch."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=about)
        for name, (default, about) in ARGUMENTS.items()
    ]
    scene = {name: LaunchConfiguration(name) for name in ('scene', 'overrides')}
    layout = str(Path(__file__).with_name('slider.rviz'))
    relay = Node(
        package='mechanism_sim', executable='loop_relay', parameters=[scene], output='screen',
        on_exit=Shutdown(reason='loop_relay has ended'),
        # it ends with this process however that ends
        additional_env={'MECHANISM_SIM_PARENT': str(os.getpid())},
    )  # fmt: skip
    panel = Node(
        package='joint_state_publisher_gui', executable='joint_state_publisher_gui',
        remappings=[
            ('robot_description', 'driver_description'), ('joint_states', 'driver_states'),
        ],
        condition=IfCondition(LaunchConfiguration('gui')),
    )  # fmt: skip
    rviz = Node(
        package='rviz2', executable='rviz2', arguments=['-d', layout],
        condition=IfCondition(LaunchConfiguration('rviz')),
    )  # fmt: skip
    return LaunchDescription([*declared, OpaqueFunction(function=_refuse), relay, panel, rviz])
