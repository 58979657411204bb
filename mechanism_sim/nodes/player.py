"""A node that replays a bag: it publishes its messages like the nodes of the run."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.messages import Clock, MessageError, message_class
from mechanism_sim.nodes.middleware import (
    DurabilityPolicy,
    MiddlewareError,
    Node,
    Publisher,
    QoSProfile,
    init,
    leave,
)
from mechanism_sim.nodes.partners import SETTLE
from mechanism_sim.nodes.qos import profile_of
from mechanism_sim.recording.reader import Bag
from mechanism_sim.terminal import print_notice
from ros_interfaces.names import InvalidNameError
from ros_interfaces.stamps import NANOSECONDS, stamp_at

_LOOK = 0.05  # [s] polling interval of subscriptions
_QUIET = 0.4  # [s] without a new one, after which all are known
_BEAT = 0.1  # [s] polling interval of signals


@contextmanager
def player(patience: float = 10.0) -> Iterator[BagPlayer]:
    """A player for the duration of a command.

    Parameters
    ----------
    patience : time for discovery of subscriptions before the start [s]

    Raises
    ------
    InputError
        If a message or topic to be played is invalid.
    RunError
        If there is no network.
    """
    nodes: list[Node] = []
    try:
        init(args=[])
        nodes.append(Node(f'mechanism_sim_player_{os.getpid()}', enable_rosout=False,
                          start_parameter_services=False))  # fmt: skip
        yield BagPlayer(nodes[0], patience)
    except (MessageError, InvalidNameError) as error:
        raise InputError(str(error)) from error
    except MiddlewareError as error:
        raise (InputError if isinstance(error, ValueError) else RunError)(str(error)) from error
    finally:
        leave(nodes)


def playable(bag: Bag, topics: Sequence[str] = ()) -> list[str]:
    """The topics to be played; others of the bag are listed on standard error.

    Parameters
    ----------
    topics : requested topics; default: all

    Raises
    ------
    InputError
        If a requested one cannot be published, or none of all.
    """
    wanted = list(topics) or list(bag.topics)
    hindered = {name: why for name in wanted if (why := _hindrance(bag, name))}
    chosen = [name for name in wanted if name not in hindered]
    if lost := [why for name, why in hindered.items() if topics or bag.topics[name].count]:
        pronoun = 'it' if len(lost) == 1 else 'they'
        said = f'{bag.path}: {", ".join(lost)}: {pronoun} cannot be published'
        if topics or not any(bag.topics[name].count for name in chosen):
            raise InputError(said)
        print_notice(said)
    return chosen


def _hindrance(bag: Bag, name: str) -> str:
    """Reason why a topic cannot be published; empty if it can, or is not in the bag."""
    topic = bag.topics.get(name)
    if topic is None:
        return ''
    encoding = bag.encoding(name)
    if encoding != 'cdr':
        spoken = 'JSON' if encoding == 'json' else encoding or 'nothing known'
        return f'{name} is {spoken} without a ROS 2 type'
    try:
        message_class(topic.type)
    except MessageError:
        return f'{name} is {topic.type or "of no type"}, which is not known here'
    return ''


class BagPlayer:
    """Publisher of the messages of bags."""

    def __init__(self, node: Node, patience: float) -> None:
        self._node, self._patience = node, patience
        self._joined = time.monotonic()  # [s]

    def play(
        self,
        bag: Bag,
        topics: Sequence[str],
        rate: float = 1.0,
        start: float = 0.0,
        clock: float | None = None,
        told: Callable[[float, int], None] = lambda _t, _n: None,
    ) -> int:
        """Publish the messages of a bag like its nodes; returns their number.

        Parameters
        ----------
        topics : requested topics, see `playable`
        rate : recorded seconds per second; 0 for as fast as possible
        start : start after the first message [s]
        clock : rate of messages on ``/clock`` with the time of the bag [Hz], if it has none

        Raises
        ------
        InputError
            If others publish on these topics: subscribers would take both for one run.
        """
        self._refuse_others([t for t in topics if t in bag.topics] + ['/clock'] * bool(clock))
        publishers = {
            name: self._node.create_publisher(
                message_class(bag.topics[name].type), name, profile_of(bag.topics[name].qos)
            )
            for name in topics
            if name in bag.topics
        }
        ticks = _Ticks(self._node, clock) if clock and '/clock' not in publishers else None
        _wait_for_subscriptions(list(publishers.values()), self._patience)
        began, count, first = time.monotonic(), 0, bag.start / 1e9 + start
        for name, message, stamp in bag.in_order_of_time(topics):
            now = stamp / 1e9
            if now < first and publishers[name].qos_profile.durability != (
                DurabilityPolicy.TRANSIENT_LOCAL
            ):
                continue
            if rate and now > first:
                while (there := first + (time.monotonic() - began) * rate) < now:
                    due = min(now, ticks.show(round(there * NANOSECONDS))) if ticks else now
                    time.sleep(min(max(due - there, 0.0) / rate, _BEAT))
            if ticks:
                ticks.show(max(stamp, round(first * NANOSECONDS)))
            publishers[name].publish(message)
            count += 1
            told(now - bag.start / 1e9, count)
        return count

    def _refuse_others(self, topics: Sequence[str]) -> None:
        """InputError if there are publishers of topics to be played."""
        time.sleep(max(0.0, self._joined + SETTLE - time.monotonic()))
        speakers = {t: self._node.get_publishers_info_by_topic(t) for t in topics}
        if taken := [topic for topic, found in speakers.items() if found]:
            names = ', '.join(sorted({i.node_name for t in taken for i in speakers[t]}))
            more = f' and {len(taken) - 3} more' if len(taken) > 3 else ''
            raise InputError(
                f'{", ".join(taken[:3])}{more} cannot be played: a run in this domain '
                f'publishes there already ({names}): end it, play the bag in a domain of its own '
                '(ROS_DOMAIN_ID=1), begin the run in a namespace (--namespace left), or play '
                'other topics only (--topics)'
            )


class _Ticks:
    """Publisher of the time of a bag on ``/clock``, `rate` times a recorded second."""

    def __init__(self, node: Node, rate: float) -> None:
        self._publisher = node.create_publisher(Clock, '/clock', QoSProfile(depth=1))
        self._period, self._due = NANOSECONDS / rate, 0.0  # [ns]

    def show(self, now: int) -> float:
        """Publish a time [ns] if it is due; returns when the next is [s]."""
        if now >= self._due:
            self._publisher.publish(Clock(clock=stamp_at(now)))
            self._due = now + self._period
        return self._due / NANOSECONDS


def _wait_for_subscriptions(publishers: Sequence[Publisher], patience: float) -> None:
    """Wait until no more subscriptions to topics to be played are found."""
    began = last = time.monotonic()
    seen: list[int] = []
    while time.monotonic() - last < _QUIET and time.monotonic() - began < patience:
        now = [publisher.get_subscription_count() for publisher in publishers]
        if now != seen:
            seen, last = now, time.monotonic()
        time.sleep(_LOOK)
