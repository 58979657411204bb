"""Nodes, publishers, subscriptions, timers, services and parameters: the part of rclpy we use.

Where ROS is installed these are rclpy's own; elsewhere the same surface on Zenoh, on the wire what
``rmw_zenoh_cpp`` speaks. ``MECHANISM_SIM_MIDDLEWARE=zenoh`` takes Zenoh in any case. Nodes import
from here and never know.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mechanism_sim.messages.origin import ros_installed
from mechanism_sim.middleware.errors import MiddlewareError

if TYPE_CHECKING:
    from mechanism_sim.middleware.zenoh_backend import (
        ActionClient,
        ActionServer,
        CancelResponse,
        Client,
        ClientGoalHandle,
        Clock,
        ClockType,
        DurabilityPolicy,
        Duration,
        ExternalShutdownException,
        Future,
        GoalResponse,
        HistoryPolicy,
        InvalidParameterException,
        InvalidParameterTypeException,
        InvalidParameterValueException,
        InvalidQosOverridesError,
        LoggingSeverity,
        MutuallyExclusiveCallbackGroup,
        Node,
        Parameter,
        ParameterAlreadyDeclaredException,
        ParameterException,
        ParameterImmutableException,
        ParameterNotDeclaredException,
        ParameterUninitializedException,
        Publisher,
        QoSOverridingOptions,
        QoSPolicyKind,
        QoSProfile,
        ReentrantCallbackGroup,
        ReliabilityPolicy,
        ServerGoalHandle,
        Service,
        SingleThreadedExecutor,
        Subscription,
        Time,
        Timer,
        init,
        leave,
        ok,
        publish_all,
        qos_profile_sensor_data,
        remove_ros_args,
        shutdown,
        spin,
        spin_once,
        spin_until_future_complete,
        try_shutdown,
    )

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
    'ReentrantCallbackGroup',
    'ReliabilityPolicy',
    'ServerGoalHandle',
    'Service',
    'SingleThreadedExecutor',
    'Subscription',
    'Time',
    'Timer',
    'backend',
    'init',
    'leave',
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


def backend() -> str:
    """'rclpy' or 'zenoh'."""
    return 'rclpy' if ros_installed() else 'zenoh'


def __getattr__(name: str) -> Any:
    """Names of the back end, which is loaded when the first of them is asked for."""
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'mechanism_sim.middleware.{backend()}_backend'), name)
