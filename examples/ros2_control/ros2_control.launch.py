"""Controllers of ros2_control move a loose four-bar, in lock step.

``ros2 launch .../ros2_control.launch.py controller:=rocker clearance:='0.5 mm' record:=run.mcap``
"""

import json
from pathlib import Path

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch_ros.actions import Node

HERE = Path(__file__).parent
PERIOD = 0.002  # [s] of the commands


def trajectory(joint, start, way):
    """Write a message that lets a joint go there and back, twice."""
    points = [
        {
            'positions': [start + (way if k % 2 == 0 else 0.0)],
            'velocities': [0.0],
            'accelerations': [0.0],
            'time_from_start': {'sec': (k + 1) // 2, 'nanosec': 500_000_000 * ((k + 1) % 2)},
        }
        for k in range(4)
    ]
    message = json.dumps({'joint_names': [joint], 'points': points})
    kind = 'trajectory_msgs/msg/JointTrajectory'
    return [f'/{joint}_trajectory/joint_trajectory', kind, message]


#: by the argument: controllers, and what is published once to begin
CONTROLLERS = {
    'crank': (['crank_trajectory'], trajectory('crank', -1.57079633, -1.0)),
    'rocker': (['rocker_pid', 'rocker_trajectory'], trajectory('rocker', 2.42428574, -0.2)),
    'effort': (
        ['crank_effort'],
        ['/crank_effort/commands', 'std_msgs/msg/Float64MultiArray', '{data: [0.1]}'],
    ),
}


def generate_launch_description():
    """Describe the launch."""
    return LaunchDescription(
        [
            DeclareLaunchArgument('controller', default_value='rocker', choices=[*CONTROLLERS]),
            DeclareLaunchArgument('clearance', default_value='0.1 mm', description='0: none'),
            DeclareLaunchArgument('record', default_value='', description='MCAP file'),
            OpaqueFunction(function=_all),
        ]
    )


def _all(context):
    given = context.launch_configurations
    names, told = CONTROLLERS[given['controller']]
    scene, clearance = str(HERE / 'four_bar.yaml'), given['clearance']
    joint = 'joints.coupler_rocker.clearance'
    override = f'{joint}=null' if clearance == '0' else f'{joint}.radial={clearance}'
    recorded = ['--record', given['record'], '--overwrite'] if given['record'] else []
    machine = Node(
        package='mechanism_sim', executable='mechanism-sim', output='screen',
        arguments=['run', scene, '--set', override, *recorded],
        parameters=[{'command_period': PERIOD}],
        on_exit=Shutdown(reason='the run has ended'),
    )  # fmt: skip
    relay = Node(
        package='mechanism_sim', executable='control_relay', output='screen',
        parameters=[{'scene': scene, 'overrides': override, 'command_period': PERIOD}],
    )  # fmt: skip
    manager = Node(
        package='controller_manager', executable='ros2_control_node', output='screen',
        parameters=[str(HERE / 'controllers.yaml')],
        remappings=[
            ('/clock', '/hardware/clock'), ('robot_description', 'hardware/robot_description'),
        ],
    )  # fmt: skip
    spawner = Node(
        package='controller_manager', executable='spawner', output='screen',
        arguments=[
            *names, '--activate-as-group', '--switch-timeout', '60',
            '--param-file', str(HERE / 'controllers.yaml'),
        ],
    )  # fmt: skip
    begin = ExecuteProcess(cmd=['ros2', 'topic', 'pub', '--once', *told], output='screen')

    def loaded(event, _):
        return [Shutdown(reason='no controllers')] if event.returncode else [begin]

    return [
        machine,
        relay,
        manager,
        spawner,
        RegisterEventHandler(OnProcessExit(target_action=spawner, on_exit=loaded)),
    ]
