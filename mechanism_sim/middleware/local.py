"""From publishers to subscriptions of the same process: by a call, not over the network.

A message is judged once, and decoded once for all who take messages: they share it, and do not
change it. Who takes bytes gets those that go out.
"""

from collections import defaultdict
from typing import Any, Protocol

from mechanism_sim.messages import MessageError, Written, deserialize, objection
from mechanism_sim.middleware.refusals import judged
from mechanism_sim.middleware.wire import Attachment


class Receiver(Protocol):
    """A subscription, for what is published here."""

    msg_type: type[Any]
    raw: bool

    def accept(self, message: Any, data: bytes, attachment: Attachment) -> None:
        """Put a good message into the queue."""

    def refuse(self, kind: str, reason: str) -> None:
        """Count what is not taken in."""


class Local:
    """The subscriptions of a process by the key of their topic."""

    def __init__(self) -> None:
        self._receivers: defaultdict[str, list[Receiver]] = defaultdict(list)

    def of(self, key: str) -> list[Receiver]:
        """Those of a key: a list that is kept up to date."""
        return self._receivers[key]


def deliver(to: list[Receiver], message: Any, data: bytes, attachment: Attachment) -> None:
    """Hand a message to subscriptions: what was published, and its bytes."""
    receivers = to.copy()  # others may come and go in other threads
    kind = receivers[0].msg_type
    try:
        if isinstance(message, Written):
            if not all(receiver.raw for receiver in receivers):
                message = deserialize(data, kind)
        elif isinstance(message, bytes) or not all(receiver.raw for receiver in receivers):
            message = judged(data, kind)
        elif reason := objection(message):
            raise MessageError(reason)
    except MessageError as error:
        for receiver in receivers:
            receiver.refuse('message', str(error))
        return
    for receiver in receivers:
        receiver.accept(message, data, attachment)
