"""Publishers."""

import time
from collections.abc import Sequence
from itertools import count, islice
from threading import Lock
from typing import Any

import zenoh
from zenoh import ext

from ros_interfaces.classes import serialize
from ros_interfaces.definitions import type_name
from zenoh_rclpy import wire
from zenoh_rclpy.clock import SECOND, Duration
from zenoh_rclpy.errors import MiddlewareError
from zenoh_rclpy.local import deliver
from zenoh_rclpy.node_graph import NodeGraph
from zenoh_rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

HEARTBEAT = 0.5  # [s]
_FOREVER = 3e7  # [s]


class Publisher:
    """Publishes messages of one type on one topic.

    RELIABLE + KEEP_ALL: ``publish`` waits for slow subscribers, nothing is lost. Otherwise
    samples that a link cannot take at once are dropped.
    """

    def __init__(self, node: NodeGraph, kind: type[Any], topic: str, qos: QoSProfile) -> None:
        context = node.context
        self.msg_type = kind
        self.topic_name = topic
        self.topic = topic
        self.qos_profile = qos
        self._context = context
        self._type = type_name(kind)
        self._sequence = count(1)
        self._one_at_a_time = Lock()
        token = node.token(wire.PUBLISHER, topic, self._type, qos)
        self._gid = wire.gid(wire.token_key(context.domain, token))
        key = context.key(topic, self._type)
        self._here = None if _goes_by_network(qos) else context.local.of(key)
        self._publisher = _declare(context.session, key, qos)
        self._token = context.announce(token)

    def publish(self, message: Any) -> None:
        """Publish a message, or the bytes of one that is serialised already."""
        self.publish_all([message])

    def publish_all(self, messages: Sequence[Any]) -> None:
        """Publish several messages in their order, with less work for each."""
        out = [(m, m if isinstance(m, bytes) else serialize(m)) for m in messages]
        try:
            # Sequence numbers have to go out in their order, whichever threads publish.
            with self._context.waits.on(self.topic_name), self._one_at_a_time:
                now, gid = time.time_ns(), self._gid
                numbers = list(islice(self._sequence, len(out)))
                # First here: who copies what goes out comes too late.
                if self._here:
                    attachments = [wire.Attachment(number, now, gid) for number in numbers]
                    deliver(self._here, out, attachments)
                for number, (_, data) in zip(numbers, out, strict=True):
                    attachment = wire.pack_attachment(number, now, gid)
                    self._publisher.put(data, attachment=attachment)
        except zenoh.ZError as error:
            raise MiddlewareError(f'{self.topic_name}: not published: {error}') from error

    def get_subscription_count(self) -> int:
        """Number of subscriptions to this topic with this type."""
        return self._context.graph.count(wire.SUBSCRIPTION, self.topic_name, self._type)

    def is_heard(self) -> bool:
        """True if a message reaches anybody, programs on plain Zenoh included, or is kept."""
        publisher = self._publisher
        if self._here or not isinstance(publisher, zenoh.Publisher):
            return True
        status: Any = publisher.matching_status  # no bool, as zenoh's types say
        return bool(status.matching)

    def wait_for_all_acked(self, timeout: Duration | None = None) -> bool:
        """Wait until other processes have what was published; False if the time is over first.

        All that this process has published, for ever without a time.
        """
        seconds = _FOREVER if timeout is None else timeout.nanoseconds / SECOND
        with self._context.waits:
            return self._context.flush(seconds)

    def destroy(self) -> None:
        """Take the publisher off the network."""
        self._context.retract(self._token)
        if isinstance(self._publisher, zenoh.Publisher):
            self._context.undeclare(self._publisher)
        else:
            self._context.drop_at_the_end(self._publisher)


def publish_all(publisher: Publisher, messages: Sequence[Any]) -> None:
    """Publish messages in their order."""
    publisher.publish_all(messages)


def _goes_by_network(qos: QoSProfile) -> bool:
    """True if subscriptions of this process, too, are served by Zenoh, which keeps the last."""
    return qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def _declare(
    session: zenoh.Session, key: str, qos: QoSProfile
) -> zenoh.Publisher | ext.AdvancedPublisher:
    congestion = zenoh.CongestionControl.BLOCK if qos.blocks else zenoh.CongestionControl.DROP
    if not _goes_by_network(qos):
        return session.declare_publisher(
            key, congestion_control=congestion, allowed_destination=zenoh.Locality.REMOTE
        )
    beat = None
    if qos.reliability == ReliabilityPolicy.RELIABLE:
        beat = ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT)
    return ext.declare_advanced_publisher(
        session,
        key,
        congestion_control=congestion,
        cache=ext.CacheConfig(
            qos.depth, replies_config=ext.RepliesConfig(congestion_control=congestion)
        ),
        sample_miss_detection=beat,
        publisher_detection=True,
    )
