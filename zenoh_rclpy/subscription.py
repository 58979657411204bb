"""Subscriptions."""

import time
from collections.abc import Callable, Sequence
from inspect import signature
from threading import Lock
from typing import Any

import zenoh
from zenoh import ext
from zenoh.handlers import Callback

from ros_interfaces.definitions import MessageError, type_name
from ros_interfaces.refusals import check_message
from ros_interfaces.similarity import SimilarMessages
from zenoh_rclpy import wire
from zenoh_rclpy.callback_groups import CallbackGroup
from zenoh_rclpy.callbacks import direct
from zenoh_rclpy.inbox import LIMIT, Inbox, Overflow
from zenoh_rclpy.local import Item
from zenoh_rclpy.node_graph import NodeGraph
from zenoh_rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

PUBLISHERS = 1000  # whose last sequence numbers a subscription remembers


class Subscription:
    """Hands the messages of one topic to a callback, in the order in which they arrive.

    The callback takes the message, or the message and a dictionary about it as in rclpy; with
    ``raw`` it gets the serialised bytes. What comes twice from one publisher is handed on once,
    and what is no message is dropped with a warning.
    """

    def __init__(
        self,
        node: NodeGraph,
        kind: type[Any],
        topic: str,
        callback: Callable[..., Any],
        qos: QoSProfile,
        raw: bool,
        group: CallbackGroup,
    ) -> None:
        context = node.context
        self.msg_type = kind
        self.topic_name = topic
        self.topic = topic
        self.qos_profile = qos
        self.raw = raw
        self._context = context
        self._callback = node.tasks.plain(callback, group)
        self._with_info = _takes_info(callback)
        self._warn = node.warnings.put
        self._known = SimilarMessages(kind)
        # An advanced subscriber sees to this itself, and may bring in what came before.
        self._once = qos.durability == DurabilityPolicy.VOLATILE
        self._latest: dict[bytes, tuple[int, int]] = {}  # number and time [ns] by publisher
        self._one_at_a_time = Lock()
        self._received = 0
        self.callback_group = group
        self.inbox = Inbox(context, self, *_queue(qos), group)
        name = type_name(kind)
        key = context.key(topic, name)
        self._subscriber = _declare(context.session, key, direct(self._receive), qos)
        self._here = context.local.of(key)
        self._here.append(self)
        self._token = context.announce(node.token(wire.SUBSCRIPTION, topic, name, qos))

    def execute(self) -> bool:
        """Hand one sample to the callback; False if none waits."""
        item = self.inbox.take()
        if item is None:
            return False
        message, data, attachment, received = item
        if not isinstance(attachment, wire.Attachment):
            judged = self._judge(data, attachment)
            if judged is None:
                return True  # no callback, but work: who spins looks at the time
            message, data, attachment = judged
        if self.raw:
            message = data
        if not self._with_info:
            self._callback(message)
            return True
        self._received += 1
        info = {
            'source_timestamp': attachment.time,
            'received_timestamp': received,
            'publication_sequence_number': attachment.sequence,
            'reception_sequence_number': self._received,
        }
        self._callback(message, info)
        return True

    def get_publisher_count(self) -> int:
        """Number of publishers on this topic with this type."""
        name = type_name(self.msg_type)
        return self._context.graph.count(wire.PUBLISHER, self.topic_name, name)

    def destroy(self) -> None:
        """Take the subscription off the network; what waits in its queue is dropped."""
        self._context.retract(self._token)
        self._here.remove(self)
        self.inbox.close()
        self._context.undeclare(self._subscriber)

    def _receive(self, sample: zenoh.Sample) -> None:
        """Take in a sample, in Zenoh's thread.

        Where it can push out nothing else, it is judged when its turn comes, in the executor's
        thread: two threads that take turns at every message cost more than the messages.
        """
        self._context.received += 1
        extra = sample.attachment if sample.kind == zenoh.SampleKind.PUT else None
        if extra is None or len(extra) != wire.ATTACHED:
            self._refuse_attachment()
            return
        data, about = sample.payload.to_bytes(), extra.to_bytes()
        if self.inbox.waits:
            self.inbox.put((None, data, about, time.time_ns()), len(data))
        elif (item := self._judge(data, about)) is not None:
            self.accept([item])

    def _refuse_attachment(self) -> None:
        self.refuse('attachment', f'a sample of ROS has an attachment of {wire.ATTACHED} bytes')

    def _judge(self, data: bytes, about: bytes) -> Item | None:
        """The message of a sample; None if it is none of ROS, or has come before."""
        attachment = wire.parse_attachment(about)
        if attachment is None:
            self._refuse_attachment()
            return None
        if self._once and not _is_later(attachment, self._latest.get(attachment.gid)):
            return None
        message = None
        if not self.raw or data not in self._known:
            try:
                message = check_message(data, self.msg_type)
            except MessageError as error:
                self.refuse('message', str(error))
                return None
            if self.raw:
                self._known.add(message, data)
        if self._once and not self._is_news(attachment):
            return None
        return Item(message, data, attachment)

    def accept(self, items: Sequence[Item]) -> None:
        """Put good messages of one publisher into the queue."""
        now = time.time_ns()
        queued = [((*item, now), len(item.data)) for item in items]
        for _ in range(len(queued) - self.inbox.put_all(queued)):
            self.refuse('queue', 'its queue is full')

    def _is_news(self, about: wire.Attachment) -> bool:
        """True, and noted, if the publisher has not sent it before."""
        with self._one_at_a_time:
            last = self._latest.pop(about.gid, None)
            later = _is_later(about, last)
            self._latest[about.gid] = (about.sequence, about.time) if later or not last else last
            if len(self._latest) > PUBLISHERS:
                del self._latest[next(iter(self._latest))]
        return later

    def refuse(self, kind: str, reason: str) -> None:
        """Count what is not taken in, and warn of it now and then."""
        self._context.refuse(self.topic_name, kind, reason, self._warn)


def _is_later(about: wire.Attachment, last: tuple[int, int] | None) -> bool:
    """True of a sample of a larger number than the last, or of a later time.

    A program that was started again, or does not count, may send a smaller number; what comes
    twice has the time that it had.
    """
    return last is None or about.sequence > last[0] or about.time > last[1]


def _takes_info(callback: Callable[..., Any]) -> bool:
    """True if a callback takes the message and a dictionary about it, as rclpy decides it."""
    parameters = signature(callback)
    try:
        parameters.bind(object())
    except TypeError:
        parameters.bind(object(), object())
        return True
    return False


def _queue(qos: QoSProfile) -> tuple[int, Overflow]:
    if qos.history == HistoryPolicy.KEEP_LAST:
        return qos.depth, Overflow.DROP_OLDEST
    # An advanced subscriber calls back under a lock of its own; what waits there could hold up a
    # publisher of this process.
    if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return 100 * LIMIT, Overflow.REFUSE
    reliable = qos.reliability == ReliabilityPolicy.RELIABLE
    return LIMIT, Overflow.WAIT if reliable else Overflow.DROP_OLDEST


def _declare(
    session: zenoh.Session, key: str, receive: 'Callback[zenoh.Sample]', qos: QoSProfile
) -> zenoh.Subscriber[None] | ext.AdvancedSubscriber[None]:
    if qos.durability != DurabilityPolicy.TRANSIENT_LOCAL:
        return session.declare_subscriber(key, receive)
    recovery = None
    if qos.reliability == ReliabilityPolicy.RELIABLE:
        recovery = ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    return ext.declare_advanced_subscriber(
        session,
        key,
        receive,
        history=ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth),
        recovery=recovery,
    )
