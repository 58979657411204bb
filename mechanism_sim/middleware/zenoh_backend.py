"""What this room offers, on Zenoh."""

from mechanism_sim.middleware.action_client import ActionClient, ClientGoalHandle
from mechanism_sim.middleware.actions import (
    ActionServer,
    CancelResponse,
    GoalResponse,
    ServerGoalHandle,
)
from mechanism_sim.middleware.arguments import remove_ros_args
from mechanism_sim.middleware.callback_groups import (
    MutuallyExclusiveCallbackGroup,
    ReentrantCallbackGroup,
)
from mechanism_sim.middleware.clock import Clock, ClockType, Duration, Time
from mechanism_sim.middleware.context import init, leave, ok, shutdown, try_shutdown
from mechanism_sim.middleware.errors import (
    ExternalShutdownException,
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    InvalidQosOverridesError,
    ParameterAlreadyDeclaredException,
    ParameterException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from mechanism_sim.middleware.executor import (
    SingleThreadedExecutor,
    spin,
    spin_once,
    spin_until_future_complete,
)
from mechanism_sim.middleware.future import Future
from mechanism_sim.middleware.logger import LoggingSeverity
from mechanism_sim.middleware.node import Node
from mechanism_sim.middleware.parameter import Parameter
from mechanism_sim.middleware.publisher import Publisher, publish_all
from mechanism_sim.middleware.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
)
from mechanism_sim.middleware.qos_overrides import QoSOverridingOptions, QoSPolicyKind
from mechanism_sim.middleware.services import Client, Service
from mechanism_sim.middleware.subscription import Subscription
from mechanism_sim.middleware.timer import Timer

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
    'publish_all',
    'qos_profile_sensor_data',
    'remove_ros_args',
    'shutdown',
    'spin',
    'spin_once',
    'spin_until_future_complete',
    'try_shutdown',
]
