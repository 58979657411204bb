"""Names of rclpy that there are here, and `leave`, `log_end`, `publish_all`, which it lacks."""

from zenoh_rclpy.action_client import ActionClient, ClientGoalHandle
from zenoh_rclpy.actions import (
    ActionServer,
    CancelResponse,
    GoalResponse,
    ServerGoalHandle,
)
from zenoh_rclpy.arguments import remove_ros_args
from zenoh_rclpy.callback_groups import (
    MutuallyExclusiveCallbackGroup,
    ReentrantCallbackGroup,
)
from zenoh_rclpy.clock import Clock, ClockType, Duration, Time
from zenoh_rclpy.context import init, leave, log_end, ok, shutdown, try_shutdown
from zenoh_rclpy.errors import (
    ExternalShutdownException,
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    InvalidQosOverridesError,
    MiddlewareError,
    ParameterAlreadyDeclaredException,
    ParameterException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
    ROSInterruptException,
)
from zenoh_rclpy.executors import (
    SingleThreadedExecutor,
    spin,
    spin_once,
    spin_until_future_complete,
)
from zenoh_rclpy.future import Future
from zenoh_rclpy.logger import LoggingSeverity
from zenoh_rclpy.node import Node
from zenoh_rclpy.parameter import Parameter
from zenoh_rclpy.publisher import Publisher, publish_all
from zenoh_rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from zenoh_rclpy.qos_overrides import QoSOverridingOptions, QoSPolicyKind
from zenoh_rclpy.services import Client, Service
from zenoh_rclpy.subscription import Subscription
from zenoh_rclpy.timer import Rate, Timer

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
    'MiddlewareError',
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
    'ROSInterruptException',
    'Rate',
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
    'log_end',
    'ok',
    'publish_all',
    'qos_profile_sensor_data',
    'remove_ros_args',
    'shutdown',
    'spin',
    'spin_once',
    'spin_until_future_complete',
    'try_shutdown',
]
