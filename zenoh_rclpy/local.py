"""Delivery from publishers to subscriptions of the same process, by a call.

A message is judged once, and decoded once for all who take messages: they share it, and do not
change it. Who takes bytes gets those that go out.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from ros_interfaces.checks import objection
from ros_interfaces.classes import CheckedBytes, deserialize
from ros_interfaces.definitions import MessageError
from ros_interfaces.refusals import check_message
from zenoh_rclpy.wire import Attachment


class Item(NamedTuple):
    """A good message; for those who take bytes it need not be decoded."""

    message: Any
    data: bytes
    attachment: Attachment


class Receiver(Protocol):
    """A subscription, for what is published here."""

    msg_type: type[Any]
    raw: bool

    def accept(self, items: Sequence[Item]) -> None:
        """Put good messages of one publisher into the queue."""

    def refuse(self, kind: str, reason: str) -> None:
        """Count what is not taken in."""


class Local:
    """The subscriptions of a process by the key of their topic."""

    def __init__(self) -> None:
        self._receivers: defaultdict[str, list[Receiver]] = defaultdict(list)

    def of(self, key: str) -> list[Receiver]:
        """Subscriptions of a key: a list that is kept up to date."""
        return self._receivers[key]


def deliver(
    to: list[Receiver], messages: Sequence[tuple[Any, bytes]], attachments: Sequence[Attachment]
) -> None:
    """Hand messages to subscriptions: what was published, and its bytes."""
    receivers = to.copy()  # others may come and go in other threads
    kind, raw, items = receivers[0].msg_type, all(r.raw for r in receivers), []
    for (message, data), attachment in zip(messages, attachments, strict=True):
        try:
            items.append(Item(_decode(message, data, kind, raw), data, attachment))
        except MessageError as error:
            for receiver in receivers:
                receiver.refuse('message', str(error))
    for receiver in receivers:
        receiver.accept(items)


def _decode(message: Any, data: bytes, kind: type[Any], raw: bool) -> Any:
    """The message for subscriptions that take no bytes; MessageError if it is malformed."""
    if isinstance(message, CheckedBytes):
        return None if raw else deserialize(data, kind)
    if isinstance(message, bytes) or not raw:
        return check_message(data, kind)
    if reason := objection(message):
        raise MessageError(reason)
    return None
