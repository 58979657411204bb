"""The names of `zenoh_rclpy.surface`, from rclpy.

In addition, a `Node` drops malformed messages.

Differences from rclpy:

- ``init`` does not replace signal handlers of the program.
- A response of ``call`` needs an executor that spins the node in another thread.
- ``qos_overriding_options`` change the profile that is given with them: give each endpoint a copy.
- The future of a service that disappears is never done.
"""

import inspect
import os
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, suppress
from functools import partial
from typing import Any

import rclpy
import rclpy.node
from ament_index_python.packages import get_package_share_directory
from rclpy import (
    ok,
    shutdown,
    spin,
    spin_once,
    spin_until_future_complete,
    try_shutdown,
)
from rclpy._rclpy_pybind11 import InvalidHandle, RCLError
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
    ROSInterruptException,
)
from rclpy.executors import ExternalShutdownException
from rclpy.logging import LoggingSeverity
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
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.time import Time
from rclpy.timer import Rate, Timer
from rclpy.utilities import remove_ros_args

from mechanism_sim import process_exit
from mechanism_sim.messages import MessageError, objection
from mechanism_sim.nodes.blocked_writes import BlockedWrites
from ros_interfaces.refusals import Refusals, check_message
from ros_interfaces.similarity import SimilarMessages

try:
    from mechanism_sim.nodes.rclpy_executor import SingleThreadedExecutor
except ImportError:  # another version of rclpy
    from rclpy.executors import SingleThreadedExecutor  # type: ignore[no-redef]

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


_USUAL: dict[signal.Signals, tuple[Any, SignalHandlerOptions]] = {
    signal.SIGINT: (signal.default_int_handler, SignalHandlerOptions.SIGINT),
    signal.SIGTERM: (signal.SIG_DFL, SignalHandlerOptions.SIGTERM),
}


ROUND, TURN = 64, 0.02
"""Messages that a subscription hands over at most in its turn, and [s] after which it takes no
more: for each turn the executor of rclpy makes a set of all entities anew, which costs more than
most callbacks; where callbacks take long, services must not wait for all of them."""

_LEASES = {
    'CYCLONEDDS_URI': 'file://{}/cyclonedds.xml',
    'FASTRTPS_DEFAULT_PROFILES_FILE': '{}/fastdds.xml',
}
"""Files by environment variable that let DDS wait for subscribers that do not answer."""

PATIENCE, RETRY = 60.0, 0.005
"""[s] that a publisher with a full queue waits for slow subscribers, and between two tries."""


_writes: BlockedWrites | None = None  # between `init` and `leave`, in programs of this package


class MiddlewareError(RuntimeError):
    """Error of the network, a name or a call; the text has the remedy."""


class Node(rclpy.node.Node):  # type: ignore[misc]
    """A node of rclpy.

    Its subscriptions validate messages, and pass on all that are queued. Its publishers wait if
    a queue is full: rmw returns an error then. After `PATIENCE` they raise MiddlewareError.
    """

    def __init__(self, *given: Any, **how: Any) -> None:
        try:
            super().__init__(*given, **how)
        except RCLError as error:  # such as an invalid configuration of the middleware
            raise MiddlewareError(f'no node can be made here: {error}') from error

    def create_publisher(self, *given: Any, **how: Any) -> Any:
        """Publisher whose `publish` waits while the queue of the middleware is full."""
        publisher = super().create_publisher(*given, **how)
        publish, topic = publisher.publish, publisher.topic_name
        write = partial(_writes.on, topic) if _writes else nullcontext

        def publish_when_possible(message: Any) -> None:
            end = time.monotonic() + PATIENCE
            while True:
                try:
                    with write():
                        publish(message)
                    return
                except RCLError as error:
                    if not ok(context=self.context):
                        return  # network left
                    if time.monotonic() > end:
                        raise MiddlewareError(
                            f'{topic}: a subscriber has read nothing for {PATIENCE:g} s, and the '
                            f'queue is full: {error}'
                        ) from error
                    self.get_logger().warning(
                        f'{topic}: the queue is full; waiting for a slow subscriber',
                        throttle_duration_sec=10.0,
                    )
                    time.sleep(RETRY)

        def publish_all(messages: Sequence[Any]) -> None:
            done, raw, plain = 0, publisher.handle.publish_raw, publisher.handle.publish
            try:
                with write(), publisher.handle:
                    for message in messages:
                        # the other would refuse bytes with a message that contains all of them
                        (raw if isinstance(message, bytes) else plain)(message)
                        done += 1
            except RCLError:  # full queue
                for message in messages[done:]:
                    publish_when_possible(message)

        publisher.publish, publisher.publish_all = publish_when_possible, publish_all
        kept = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        publisher.is_heard = lambda: kept or publisher.get_subscription_count() > 0
        return publisher

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], Any], *given: Any, **how: Any
    ) -> Any:
        """Subscription whose callback gets the message, or with ``raw`` its bytes."""
        refusals, raw = Refusals(), how.get('raw', False)
        known = SimilarMessages(msg_type)

        def good(message: Any) -> bool:
            try:
                if raw:
                    if message not in known:
                        known.add(check_message(message, msg_type), message)
                elif reason := objection(message):
                    raise MessageError(reason)
            except MessageError as error:
                warn = self.get_logger().warning
                refusals.count(subscription.topic_name, 'message', str(error), warn)
                return False
            return True

        async def take_one(message: Any) -> None:
            if good(message):
                await callback(message)

        def take_all(message: Any) -> None:
            end = time.monotonic() + TURN
            if good(message):
                callback(message)
            with suppress(InvalidHandle):  # the callback may have destroyed the subscription
                handle = subscription.handle
                for _ in range(ROUND):
                    if time.monotonic() > end:
                        return
                    with handle:
                        taken = handle.take_message(msg_type, raw)
                    if taken is None:
                        return
                    if good(taken[0]):
                        callback(taken[0])

        take = take_one if inspect.iscoroutinefunction(callback) else take_all
        subscription = super().create_subscription(msg_type, topic, take, *given, **how)
        return subscription


def init(args: list[str] | None = None, *, domain_id: int | None = None) -> None:
    """``rclpy.init``, with handlers for those signals that the program does not handle itself.

    DDS is configured to wait longer for stopped subscribers, unless set by its environment.

    Raises MiddlewareError if there is no network to join, or if ``init`` was called already.
    """
    global _writes  # noqa: PLW0603
    free = [
        option for number, (usual, option) in _USUAL.items() if signal.getsignal(number) is usual
    ]
    folder = f'{get_package_share_directory("mechanism_sim")}/launch/dds'
    for variable, file in _LEASES.items():
        os.environ.setdefault(variable, file.format(folder))
    options = free[0] if len(free) == 1 else SignalHandlerOptions.ALL if free else None
    try:
        rclpy.init(
            args=args,
            domain_id=domain_id,
            signal_handler_options=options or SignalHandlerOptions.NO,
        )
    except RuntimeError as error:
        raise MiddlewareError(str(error)) from error
    if process_exit.signals() >= 0 and _writes is None:
        _writes = BlockedWrites(process_exit.signals())


def publish_all(publisher: Any, messages: Sequence[Any]) -> None:
    """Publish messages in their order."""
    publisher.publish_all(messages)


def log_end(node: Any, reason: str) -> None:
    """Log the reason of a node's end: on ``/rosout``, in the log file, on standard error."""
    node.get_logger().fatal(reason)


def leave(nodes: Iterable[Any] = (), patience: float = 60.0) -> None:
    """Destroy nodes and leave the network, once others have received their messages.

    Raises MiddlewareError if they have not within `patience` [s].
    """
    global _writes  # noqa: PLW0603
    nodes = list(nodes)
    end = time.monotonic() + patience
    taken = [
        publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - time.monotonic())))
        for node in nodes
        for publisher in node.publishers
    ]
    for node in nodes:
        node.destroy_node()
    try_shutdown()
    if _writes:
        _writes.close()
        _writes = None
    if not all(taken):
        raise MiddlewareError(
            f'After {patience} s other processes had not received all that was published: part '
            'is lost'
        )
