"""A node that lists, echoes, publishes, calls and replays, for the command line.

What ``ros2 topic``, ``ros2 param``, ``ros2 service``, ``ros2 action`` and ``ros2 bag play`` do,
through `mechanism_sim.middleware`, so that it works with ROS and without.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from mechanism_sim.errors import InputError, RunError, nearest
from mechanism_sim.messages import MessageError, action_class, message_class, service_class
from mechanism_sim.messages.plain import from_plain
from mechanism_sim.middleware import (
    ActionClient,
    DurabilityPolicy,
    HistoryPolicy,
    MiddlewareError,
    Node,
    Parameter,
    QoSProfile,
    ReliabilityPolicy,
    init,
    leave,
    spin_once,
    spin_until_future_complete,
)

if TYPE_CHECKING:
    from mechanism_sim.recording import Bag

PATIENCE = 10.0
"""[s] to wait for a topic, a node or a service."""
_LOOK = 0.05  # [s] between two looks at the graph
_QUIET = 0.4  # [s] in which nothing new appears: the graph is known
_BEAT = 0.1  # [s] between two looks for a signal

_PARAMETERS = 'rcl_interfaces/srv'
_ACTION_PARTS = '/_action/'


AGAIN = 'try again in a moment'
"""In the answer of a simulator whose nodes are not all there yet."""


def refusal(answer: Any) -> str:
    """Why a service did not do what it was asked for; empty if it did, or does not say."""
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

    Raises
    ------
    RunError
        If there is no network.
    """
    try:
        init(args=[])
        node = CommandNode(patience)
    except MiddlewareError as error:
        raise RunError(str(error)) from error
    try:
        yield node
    except MessageError as error:
        raise InputError(str(error).removesuffix('; define() adds one')) from error
    except MiddlewareError as error:
        if isinstance(error, InputError):  # as a name that is none
            raise
        raise RunError(str(error)) from error
    finally:
        leave([node.node])


class CommandNode:
    """The node of a command.

    Parameters
    ----------
    patience : [s] to wait for what is asked for
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self.node = Node(
            f'mechanism_sim_command_{os.getpid()}',
            enable_rosout=False,
            start_parameter_services=False,
        )
        self.patience = patience

    # the graph

    def settle(self) -> None:
        """Wait until nothing new appears."""
        began = last = time.monotonic()
        seen: Any = None
        while time.monotonic() - last < _QUIET and time.monotonic() - began < self.patience:
            now = self.node.get_topic_names_and_types(), self.node.get_node_names()
            if now != seen:
                seen, last = now, time.monotonic()
            time.sleep(_LOOK)

    def _wait(self, there: Callable[[], Any]) -> Any:
        end = time.monotonic() + self.patience
        while not (found := there()) and time.monotonic() < end:
            spin_once(self.node, timeout_sec=_LOOK)
        return found

    def topics(self) -> list[tuple[str, list[str]]]:
        """Topics with their types, without those that serve actions."""
        self.settle()
        known = self.node.get_topic_names_and_types()
        return [(name, types) for name, types in known if _ACTION_PARTS not in name]

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
        """Who publishes on and subscribes to a topic.

        Raises
        ------
        InputError
            If there is no such topic.
        """
        name, types = self._find(topic, self.node.get_topic_names_and_types, 'topic')
        return Endpoints(
            name,
            types,
            list(self.node.get_publishers_info_by_topic(name)),
            list(self.node.get_subscriptions_info_by_topic(name)),
        )

    def nodes(self) -> list[str]:
        """Full names of all nodes but those of commands."""
        self.settle()
        pairs = self.node.get_node_names_and_namespaces()
        names = {f'{space.rstrip("/")}/{name}' for name, space in pairs}
        return sorted(n for n in names if '/mechanism_sim_command_' not in n)

    def _find(self, name: str, look: Callable[[], Any], kind: str) -> tuple[str, list[str]]:
        full = name if name.startswith('/') else f'/{name}'
        found = self._wait(lambda: dict(look()).get(full))
        if not found:
            known = [n for n, _ in look() if _ACTION_PARTS not in n]
            what = '; is a machine running?' if not known else ''
            raise InputError(f"there is no {kind} '{full}'{nearest(full, known) or what}")
        return full, list(found)

    # topics

    def listen(
        self,
        topic: str,
        heard: Callable[[Any], bool],
        kind: str | None = None,
        end: float | None = None,
    ) -> None:
        """Hand on messages of a topic until `heard` gives true, or the time `end` has come [s].

        The profile is that of the publishers: reliable and latched if all of them are.
        """
        full, types = (topic, [kind]) if kind else self.endpoints(topic)[:2]
        given = self.node.get_publishers_info_by_topic(full)
        profiles = [info.qos_profile for info in given]
        reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
        latched = profiles and all(
            p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles
        )
        over = False

        def take(message: Any) -> None:
            nonlocal over
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
        finally:
            self.node.destroy_subscription(subscription)

    def rates(self, topic: str, over: Callable[[list[float]], bool]) -> list[float]:
        """When messages of a topic came [s], until `over` gives true of them.

        It is asked at every message, and now and then without any.
        """
        full, types, *_ = self.endpoints(topic)
        times: list[float] = []
        subscription = self.node.create_subscription(
            message_class(types[0]),
            full,
            lambda _: times.append(time.monotonic()),
            QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT),
            raw=True,
        )
        try:
            while not over(times):
                spin_once(self.node, timeout_sec=_BEAT)
        finally:
            self.node.destroy_subscription(subscription)
        return times

    def publish(
        self, topic: str, kind: str, values: Any, count: int, rate: float, told: Callable[[], None]
    ) -> None:
        """Publish a message so many times, once there is a subscription or patience ends."""
        full = topic if topic.startswith('/') else f'/{topic}'
        message = from_plain(message_class(kind), values)
        publisher = self.node.create_publisher(type(message), full, 10)
        self._wait(publisher.get_subscription_count)
        for k in range(count):
            publisher.publish(message)
            told()
            if k + 1 < count:
                time.sleep(1.0 / rate)

    # services and actions

    def call(self, service: str, kind: str | None, values: Any) -> Any:
        """The response of a service.

        Raises
        ------
        InputError, RunError
            If there is no such service, or no answer.
        """
        full = service if service.startswith('/') else f'/{service}'
        if kind is None:
            full, types = self._find(service, self.node.get_service_names_and_types, 'service')
            kind = types[0]
        made = service_class(kind)
        client = self.node.create_client(made, full)
        if not self._wait(client.service_is_ready):
            self._find(service, self.node.get_service_names_and_types, 'service')
            raise RunError(f'{full} is no service of the type {kind}')
        request, end = from_plain(made.Request, values), time.monotonic() + self.patience
        while True:
            answer = self._answer(client.call_async(request), full)
            if AGAIN not in refusal(answer) or time.monotonic() > end:
                return answer
            time.sleep(_BEAT)

    def send_goal(
        self, action: str, kind: str, values: Any, feedback: Callable[[Any], None] | None
    ) -> Any:
        """The result of an action.

        Raises
        ------
        InputError, RunError
            If there is no such action, or it refuses the goal.
        """
        full = action if action.startswith('/') else f'/{action}'
        made = action_class(kind)
        client = ActionClient(self.node, made, full)
        if not client.wait_for_server(self.patience):
            raise InputError(f"there is no action '{full}'{nearest(full, self.actions())}")
        listener = (lambda m: feedback(m.feedback)) if feedback else None
        goal = from_plain(made.Goal, values)
        handle = self._answer(client.send_goal_async(goal, listener), full)
        if not handle.accepted:
            raise RunError(f'{full} does not accept the goal')
        return self._answer(handle.get_result_async(), full)

    def _answer(self, future: Any, name: str) -> Any:
        while not future.done():
            spin_until_future_complete(self.node, future, timeout_sec=_BEAT)
        found = future.result()
        if found is None:
            raise RunError(f'{name} went away without an answer')
        return found

    # parameters

    def _parameters(self, node: str, short: str, **fields: Any) -> Any:
        full = node if node.startswith('/') else f'/{node}'
        words = ''.join('_' + c.lower() if c.isupper() else c for c in short).lstrip('_')
        try:
            return self.call(f'{full}/{words}', f'{_PARAMETERS}/{short}', fields or None)
        except InputError:
            known = self.nodes()
            raise InputError(
                f"there is no node '{full}'{nearest(full, known)}; nodes: "
                f'{", ".join(known) or "none, is a machine running?"}'
            ) from None

    def parameter_names(self, node: str) -> list[str]:
        """Names of the parameters of a node."""
        return sorted(self._parameters(node, 'ListParameters').result.names)

    def parameter(self, node: str, name: str) -> Any:
        """The value of a parameter.

        Raises
        ------
        InputError
            If there is none.
        """
        values = self._parameters(node, 'GetParameters', names=[name]).values
        if not values:
            known = self.parameter_names(node)
            raise InputError(f"{node} has no parameter '{name}'{nearest(name, known)}")
        message = message_class('rcl_interfaces/msg/Parameter')
        found = message(name=name, value=values[0])
        return Parameter.from_parameter_msg(found).value

    def describe(self, node: str, name: str) -> Any:
        """The descriptor of a parameter."""
        found = self._parameters(node, 'DescribeParameters', names=[name]).descriptors
        if not found:
            known = self.parameter_names(node)
            raise InputError(f"{node} has no parameter '{name}'{nearest(name, known)}")
        return found[0]

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter.

        Raises
        ------
        RunError
            If the node refuses it: its reason.
        """
        old = self.parameter(node, name)
        if isinstance(old, float) and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if isinstance(old, str) and not isinstance(value, str):
            value = str(value)
        full = node if node.startswith('/') else f'/{node}'
        kind = service_class(f'{_PARAMETERS}/SetParameters')
        client = self.node.create_client(kind, f'{full}/set_parameters')
        self._wait(client.service_is_ready)
        request = kind.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        (answer,) = self._answer(client.call_async(request), full).results
        if not answer.successful:
            raise RunError(f'{full} refuses {name}: {answer.reason}')

    # bags

    def play(
        self,
        bag: Bag,
        topics: Sequence[str] = (),
        rate: float = 1.0,
        start: float = 0.0,
        clock: float | None = None,
        told: Callable[[float, int], None] = lambda _t, _n: None,
    ) -> int:
        """Publish what a bag holds, as its nodes did; how many messages there were.

        Parameters
        ----------
        topics : those wanted, all without any
        rate : recorded seconds in a second; 0 as fast as possible
        start : [s] after the first message
        clock : Hz of messages on ``/clock`` with the time of the bag, if it has none
        """
        chosen = list(topics) or [name for name, t in bag.topics.items() if t.type]
        publishers = {}
        for name in chosen:
            if name in bag.topics:
                topic = bag.topics[name]
                publishers[name] = self.node.create_publisher(
                    message_class(topic.type), name, _profile(topic.qos)
                )
        ticks, tick = None, 0.0
        if clock and '/clock' not in publishers:
            ticks = self.node.create_publisher(
                message_class('rosgraph_msgs/msg/Clock'), '/clock', QoSProfile(depth=1)
            )
        self.settle()
        began, count, first = time.monotonic(), 0, bag.start / 1e9 + start
        for name, message, stamp in bag.messages(chosen):
            now = stamp / 1e9
            if now < first and publishers[name].qos_profile.durability != (
                DurabilityPolicy.TRANSIENT_LOCAL
            ):
                continue
            if rate and now > first:
                while (early := (now - first) / rate - (time.monotonic() - began)) > 0.0:
                    time.sleep(min(early, _BEAT))
            if ticks and now >= tick:
                ticks.publish(_clock(stamp))
                tick = now + 1.0 / (clock or 1.0)
            publishers[name].publish(message)
            count += 1
            told(now - bag.start / 1e9, count)
        return count


def _clock(stamp: int) -> Any:
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    return from_plain(
        message_class('rosgraph_msgs/msg/Clock'),
        {'clock': {'sec': seconds, 'nanosec': nanoseconds}},
    )


def _profile(qos: Any) -> QoSProfile:
    """The profile under which a topic was recorded."""
    if qos is None:
        return QoSProfile(depth=10)
    words = {word.lower() for word in (qos.reliability, qos.durability, qos.history)}
    return QoSProfile(
        depth=max(int(qos.depth), 1),
        history=HistoryPolicy.KEEP_ALL if 'keep_all' in words else HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.BEST_EFFORT
        if 'best_effort' in words
        else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if 'transient_local' in words
        else DurabilityPolicy.VOLATILE,
    )
