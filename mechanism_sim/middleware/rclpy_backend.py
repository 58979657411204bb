"""What this room offers, from rclpy: the same names, and `leave`.

What to know:

- ``shutdown`` does not wait for subscribers in other processes; what ``rmw`` promises, holds.
- A response of ``call`` needs an executor that spins the node in another thread.
- ``qos_overriding_options`` change the profile that is given with them: give each endpoint a copy.
- The future of a service that goes away is never done.
"""

from rclpy import (
    init,
    ok,
    shutdown,
    spin,
    spin_once,
    spin_until_future_complete,
    try_shutdown,
)
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.time import Time
from rclpy.timer import Timer
from rclpy.utilities import remove_ros_args

__all__ = [
    'ActionClient',
    'ActionServer',
    'CancelResponse',
    'Client',
    'ClientGoalHandle',
    'Clock',
    'ClockType',
    'DurabilityPolicy',
    'Duration',
    'ExternalShutdownException',
    'Future',
    'GoalResponse',
    'HistoryPolicy',
    'InvalidParameterException',
    'InvalidParameterTypeException',
    'InvalidParameterValueException',
    'InvalidQosOverridesError',
    'LoggingSeverity',
    'MutuallyExclusiveCallbackGroup',
    'Node',
    'Parameter',
    'ParameterAlreadyDeclaredException',
    'ParameterException',
    'ParameterImmutableException',
    'ParameterNotDeclaredException',
    'ParameterUninitializedException',
    'Publisher',
    'QoSOverridingOptions',
    'QoSPolicyKind',
    'QoSProfile',
    'ReentrantCallbackGroup',
    'ReliabilityPolicy',
    'ServerGoalHandle',
    'Service',
    'SingleThreadedExecutor',
    'Subscription',
    'Time',
    'Timer',
    'init',
    'leave',
    'ok',
    'qos_profile_sensor_data',
    'remove_ros_args',
    'shutdown',
    'spin',
    'spin_once',
    'spin_until_future_complete',
    'try_shutdown',
]


def leave(patience: float = 0.0) -> None:
    """Shut down, if there is something to shut down; there is nothing here to be patient with."""
    del patience
    try_shutdown()
