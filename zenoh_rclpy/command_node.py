"""A node that lists, echoes, publishes and calls, for the command ``zros``.

What ``ros2`` does for nodes, topics, parameters, services and actions, with ROS and without:
on rclpy where it is installed, on this package elsewhere.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, NamedTuple

from ros_interfaces.classes import action_class, message_class, service_class
from ros_interfaces.origin import ros_installed
from ros_interfaces.plain import from_plain
from zenoh_rclpy.errors import MiddlewareError

if TYPE_CHECKING or not ros_installed():
    from zenoh_rclpy.surface import (
        ActionClient,
        DurabilityPolicy,
        Duration,
        HistoryPolicy,
        Node,
        Parameter,
        QoSProfile,
        ReliabilityPolicy,
        init,
        spin_once,
        spin_until_future_complete,
        try_shutdown,
    )
else:
    from rclpy import init, spin_once, spin_until_future_complete, try_shutdown
    from rclpy.action import ActionClient
    from rclpy.duration import Duration
    from rclpy.node import Node
    from rclpy.parameter import Parameter
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

PATIENCE = 10.0
"""[s] to wait for a topic, a node or a service."""
_LOOK = 0.05  # [s] between two looks at the graph
_QUIET = 0.4  # [s] in which nothing new appears: the graph is known
_BEAT = 0.1  # [s] between two looks for a signal
_LONGEST = 1e9  # [s] of a sleep
_LAST = 60.0  # [s] that subscriptions get to take in what was published

_NAME = 'zros_'  # of nodes of commands, before a number
_PARAMETERS = 'rcl_interfaces/srv'
_ACTION_PARTS = '/_action/'

AGAIN = 'try again in a moment'
"""A service that answers so is asked again, while there is patience."""


class UsageError(ValueError):
    """Something that a command was given cannot be used."""


def missing(
    sentence: str, name: str, known: Iterable[str], kind: type[Exception] = UsageError
) -> Exception:
    """Error of an unknown name; it names the nearest of those that are there."""
    (close,) = get_close_matches(name, list(known), 1, 0.5) or ('',)
    return kind(f"{sentence}; did you mean '{close}'?" if close else sentence)


def absolute(name: str) -> str:
    """A name in full, from the root."""
    return f'/{name.removeprefix("/")}'


def _check_type(topic: str, kind: str, ends: list[Any]) -> None:
    """Raise UsageError if there are other ends of a topic, and none of a type."""
    types = sorted({info.topic_type for info in ends})
    if types and kind not in types:
        raise UsageError(f'{topic} is of the type {", ".join(types)}, not {kind}')


def _pause(node: Node, seconds: float) -> None:
    """Wait so long, or until a signal, after which a plain sleep would go on."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        spin_once(node, timeout_sec=left)


def refusal(answer: Any) -> str:
    """Reason why a service refused a request; empty if it did not, or gives none."""
    result = getattr(answer, 'result', None)
    if result is not None and hasattr(result, 'error_message'):
        return str(result.error_message) or ('' if result.result == 1 else 'it failed')
    if getattr(answer, 'success', True) is False:
        return str(getattr(answer, 'message', '')) or 'it failed'
    return ''


class Endpoints(NamedTuple):
    """A topic: its types, and who publishes and subscribes."""

    name: str
    types: list[str]
    publishers: list[Any]
    subscriptions: list[Any]


@contextmanager
def command_node(patience: float = PATIENCE) -> Iterator[CommandNode]:
    """A node for the duration of a command.

    Raises MiddlewareError if there is no network, or if others do not take in what is published.
    """
    init(args=[])
    made: list[CommandNode] = []
    try:
        made.append(CommandNode(patience))
        yield made[0]
    finally:
        for command in made:
            command.node.destroy_node()
        try_shutdown()


class CommandNode:
    """The node of a command.

    Parameters
    ----------
    patience : total waiting time from now [s]

    Attributes
    ----------
    bounded : whether `patience` also limits the wait for answers, which may take long
    """

    bounded = False

    def __init__(self, patience: float = PATIENCE) -> None:
        self.node = Node(
            f'{_NAME}{os.getpid()}',
            enable_rosout=False,
            start_parameter_services=False,
        )
        self.allow(patience)

    def allow(self, patience: float) -> None:
        """Wait from now on at most so long [s] for all that is asked for."""
        self._patience, self._end = patience, time.monotonic() + patience

    # the graph

    def settle(self) -> None:
        """Wait until nothing new appears."""
        last = time.monotonic()
        seen: Any = None
        while time.monotonic() < min(last + _QUIET, self._end):
            now = self.node.get_topic_names_and_types(), self.node.get_node_names()
            if now != seen:
                seen, last = now, time.monotonic()
            time.sleep(_LOOK)

    def _wait(self, there: Callable[[], Any]) -> Any:
        while not (found := there()) and time.monotonic() < self._end:
            spin_once(self.node, timeout_sec=_LOOK)
        return found

    def topics(self) -> list[tuple[str, list[str]]]:
        """Topics with their types, without hidden ones, as of actions."""
        self.settle()
        known = self.node.get_topic_names_and_types()
        return [(name, types) for name, types in known if '/_' not in name]

    def services(self) -> list[tuple[str, list[str]]]:
        """Services with their types, without those that serve actions."""
        self.settle()
        known = self.node.get_service_names_and_types()
        return [(name, types) for name, types in known if _ACTION_PARTS not in name]

    def actions(self) -> list[str]:
        """Names of actions."""
        self.settle()
        known = self.node.get_service_names_and_types()
        return sorted({n.partition(_ACTION_PARTS)[0] for n, _ in known if _ACTION_PARTS in n})

    def endpoints(self, topic: str) -> Endpoints:
        """Publishers and subscriptions of a topic.

        Raises
        ------
        UsageError
            If there is no such topic.
        """
        name, types = self._find(topic, self.node.get_topic_names_and_types, 'topic')
        return Endpoints(
            name,
            types,
            list(self.node.get_publishers_info_by_topic(name)),
            list(self.node.get_subscriptions_info_by_topic(name)),
        )

    def nodes(self, service: str = '') -> list[str]:
        """Full names of all nodes but those of commands.

        Parameters
        ----------
        service : only nodes with this one below their name: not all have those of parameters
        """
        served = {name for name, _ in self.services()}
        pairs = self.node.get_node_names_and_namespaces()
        names = {f'{space.rstrip("/")}/{name}' for name, space in pairs}
        return sorted(
            n
            for n in names
            if f'/{_NAME}' not in n and (not service or f'{n}/{service}' in served)
        )

    def of_node(self, node: str) -> dict[str, list[tuple[str, list[str]]]]:
        """Topics and services of a node with their types, by kind; without those of actions.

        Raises
        ------
        UsageError
            If there is no such node.
        """
        full = absolute(node)
        if not self._wait(lambda: full in self.nodes()):
            raise self._no_node(full)
        space, _, name = full.rpartition('/')
        look = self.node
        kinds = {
            'publishers': look.get_publisher_names_and_types_by_node,
            'subscriptions': look.get_subscriber_names_and_types_by_node,
            'services': look.get_service_names_and_types_by_node,
            'clients': look.get_client_names_and_types_by_node,
        }
        return {
            kind: [(n, types) for n, types in find(name, space or '/') if '/_' not in n]
            for kind, find in kinds.items()
        }

    def _no_node(self, full: str) -> Exception:
        known = self.nodes()
        if full in known:
            return UsageError(f'{full} has no services for its parameters')
        return missing(
            f"there is no node '{full}'; nodes: {', '.join(known) or 'none'}", full, known
        )

    def _find(self, name: str, look: Callable[[], Any], kind: str) -> tuple[str, list[str]]:
        full = absolute(name)
        found = self._wait(lambda: dict(look()).get(full))
        if not found:
            known = [n for n, _ in look() if _ACTION_PARTS not in n]
            raise missing(f"there is no {kind} '{full}'", full, known)
        return full, list(found)

    # topics

    def listen(
        self,
        topic: str,
        heard: Callable[[Any], bool],
        kind: str | None = None,
        end: float | None = None,
        wanted: int = 0,
    ) -> None:
        """Hand on messages of a topic until `heard` gives true, or the time `end` has come [s].

        The profile is that of the publishers: reliable and latched if all of them are. So many
        as are `wanted` must come while there is patience; for others there is no limit.

        Raises
        ------
        UsageError, MiddlewareError
            If there is no such topic, or fewer messages come.
        """
        full, types = (topic, [kind]) if kind else self.endpoints(topic)[:2]
        given = self.node.get_publishers_info_by_topic(full)
        profiles = [info.qos_profile for info in given]
        reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
        latched = profiles and all(
            p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles
        )
        over, count = False, 0

        def take(message: Any) -> None:
            nonlocal over, count
            count += 1
            over = over or heard(message)

        subscription = self.node.create_subscription(
            message_class(str(types[0])),
            full,
            take,
            QoSProfile(
                depth=1000,
                history=HistoryPolicy.KEEP_LAST,
                reliability=ReliabilityPolicy.RELIABLE
                if reliable
                else ReliabilityPolicy.BEST_EFFORT,
                durability=DurabilityPolicy.TRANSIENT_LOCAL
                if latched
                else DurabilityPolicy.VOLATILE,
            ),
        )
        try:
            while not over and (end is None or time.monotonic() < end):
                spin_once(self.node, timeout_sec=_BEAT)
                if kind and not count:
                    _check_type(full, kind, self.node.get_publishers_info_by_topic(full))
                self._check_patience(full, count, wanted)
        finally:
            self.node.destroy_subscription(subscription)

    def _check_patience(self, topic: str, count: int, wanted: int) -> None:
        """Raise MiddlewareError if fewer messages than are wanted have come in time."""
        if count >= wanted or time.monotonic() < self._end:
            return
        said = f'{count} of {wanted} messages' if count else 'no message'
        said += f' came on {topic} in {self._patience:g} s'
        if self.node.count_publishers(topic):
            raise MiddlewareError(said)
        known = [n for n, _ in self.topics() if self.node.count_publishers(n)]
        raise missing(f'{said}: nobody publishes there', topic, known, MiddlewareError)

    def arrivals(
        self,
        topic: str,
        arrivals: list[tuple[float, int]],
        over: Callable[[], bool],
        wanted: int = 0,
    ) -> None:
        """Add times [s] and sizes [bytes] of messages of a topic, until `over` gives true.

        It is asked at every message, and now and then without any. Those that are `wanted` are
        waited for as by `listen`.
        """
        full, types, *_ = self.endpoints(topic)
        subscription = self.node.create_subscription(
            message_class(types[0]),
            full,
            lambda data: arrivals.append((time.monotonic(), len(data))),
            QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT),
            raw=True,
        )
        try:
            while not over():
                spin_once(self.node, timeout_sec=_BEAT)
                self._check_patience(full, len(arrivals), wanted)
        finally:
            self.node.destroy_subscription(subscription)

    def publish(
        self,
        topic: str,
        kind: str,
        values: Any,
        count: int | None,
        rate: float,
        told: Callable[[], None],
    ) -> None:
        """Publish a message so many times once there is a subscription; or without end, at once.

        Raises
        ------
        MiddlewareError
            If nobody subscribes, or does not take in all.
        """
        full = absolute(topic)
        message = from_plain(message_class(kind), values)
        publisher = self.node.create_publisher(type(message), full, 10)
        if count and not self._wait(publisher.get_subscription_count):
            known = [n for n, _ in self.topics() if self.node.count_subscribers(n)]
            _check_type(full, kind, self.node.get_subscriptions_info_by_topic(full))
            raise missing(f'nobody subscribes to {full}', full, known, MiddlewareError)
        due = time.monotonic()
        for k in range(count or sys.maxsize):
            if k:
                # what publishing takes is no part of the period; nothing that is late is made up
                due = max(due + 1.0 / rate, now := time.monotonic())
                _pause(self.node, min(due - now, _LONGEST))
            publisher.publish(message)
            told()
        if not publisher.wait_for_all_acked(Duration(seconds=_LAST)):
            raise MiddlewareError(f'{full}: a subscription has not taken in all in {_LAST:g} s')

    # services and actions

    def call(self, service: str, kind: str | None, values: Any) -> Any:
        """The response of a service.

        Raises
        ------
        UsageError, MiddlewareError
            If there is no such service, or no answer.
        """
        full = absolute(service)
        if kind is None:
            full, types = self._find(service, self.node.get_service_names_and_types, 'service')
            kind = types[0]
        made = service_class(kind)
        client = self.node.create_client(made, full)
        if not self._wait(client.service_is_ready):
            self._find(service, self.node.get_service_names_and_types, 'service')
            raise MiddlewareError(f'{full} is no service of the type {kind}')
        request = from_plain(made.Request, values)
        while True:
            answer = self._answer(client.call_async(request), full)
            if AGAIN not in refusal(answer) or time.monotonic() > self._end:
                return answer
            time.sleep(_BEAT)

    def send_goal(
        self, action: str, kind: str, values: Any, feedback: Callable[[Any], None] | None
    ) -> Any:
        """The result of an action.

        Raises
        ------
        UsageError, MiddlewareError
            If there is no such action, or it refuses the goal.
        """
        full = absolute(action)
        made = action_class(kind)
        client = ActionClient(self.node, made, full)
        if not client.wait_for_server(max(self._end - time.monotonic(), 0.0)):
            raise missing(f"there is no action '{full}'", full, self.actions())
        listener = (lambda m: feedback(m.feedback)) if feedback else None
        goal = from_plain(made.Goal, values)
        handle = self._answer(client.send_goal_async(goal, listener), full)
        if not handle.accepted:
            raise MiddlewareError(f'{full} does not accept the goal')
        try:
            return self._answer(handle.get_result_async(), full)
        except BaseException:  # of a signal, too: nobody hears what would come of the goal
            with suppress(RuntimeError):  # rclpy has left the network at a signal
                cancelled = handle.cancel_goal_async()
                spin_until_future_complete(self.node, cancelled, timeout_sec=_QUIET)
            raise

    def _answer(self, future: Any, name: str) -> Any:
        while not future.done():
            spin_until_future_complete(self.node, future, timeout_sec=_BEAT)
            if self.bounded and time.monotonic() > self._end and not future.done():
                raise MiddlewareError(f'{name} has not answered in {self._patience:g} s')
        found = future.result()
        if found is None:
            raise MiddlewareError(f'{name} went away without an answer')
        return found

    # parameters

    def _parameters(self, node: str, short: str, **fields: Any) -> Any:
        full = absolute(node)
        words = ''.join('_' + c.lower() if c.isupper() else c for c in short).lstrip('_')
        try:
            return self.call(f'{full}/{words}', f'{_PARAMETERS}/{short}', fields or None)
        except UsageError:
            raise self._no_node(full) from None

    def parameter_names(self, node: str) -> list[str]:
        """Names of the parameters of a node."""
        return sorted(self._parameters(node, 'ListParameters').result.names)

    def parameter(self, node: str, name: str) -> Any:
        """The value of a parameter.

        Raises
        ------
        UsageError
            If there is none.
        """
        values = self.parameters(node, [name])
        if not values:
            known = self.parameter_names(node)
            raise missing(f"{node} has no parameter '{name}'", name, known)
        return values[name]

    def parameters(self, node: str, names: list[str]) -> dict[str, Any]:
        """Values of parameters by name; none if one of them is not there."""
        values = self._parameters(node, 'GetParameters', names=names).values
        message = message_class('rcl_interfaces/msg/Parameter')
        return {
            name: Parameter.from_parameter_msg(message(name=name, value=value)).value
            for name, value in zip(names, values, strict=False)
        }

    def describe(self, node: str, name: str) -> Any:
        """The descriptor of a parameter."""
        found = self._parameters(node, 'DescribeParameters', names=[name]).descriptors
        if not found:
            known = self.parameter_names(node)
            raise missing(f"{node} has no parameter '{name}'", name, known)
        return found[0]

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter.

        Raises
        ------
        MiddlewareError
            If the node refuses it: its reason.
        """
        old = self.parameter(node, name)
        if isinstance(old, float) and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if isinstance(old, str) and not isinstance(value, str):
            value = str(value)
        full = absolute(node)
        kind = service_class(f'{_PARAMETERS}/SetParameters')
        client = self.node.create_client(kind, f'{full}/set_parameters')
        self._wait(client.service_is_ready)
        request = kind.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        (answer,) = self._answer(client.call_async(request), full).results
        if not answer.successful:
            raise MiddlewareError(f'{full} refuses {name}: {answer.reason}')
