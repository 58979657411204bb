"""Messages that are dropped because they are malformed or implausible, and the warnings of it.

Whoever is on the network may send anything on any topic. It is judged before it enters a queue
where it could push out something else; where it waits for room, when its turn comes.
"""

import time
from collections.abc import Callable
from threading import Lock
from typing import Any

from ros_interfaces.checks import objection
from ros_interfaces.classes import deserialize
from ros_interfaces.definitions import MessageError

PERIOD = 10.0  # [s] between two warnings about the same
LITTLE_ENDIAN = b'\x00\x01'  # CDR; who reads serialised messages relies on it
LARGEST = 64_000_000  # bytes of a message

Warn = Callable[[str], Any]


class Refusals:
    """Counts what is dropped; one warning per topic and kind of reason in `PERIOD`."""

    def __init__(self) -> None:
        self._warned: dict[tuple[str, str], tuple[float, int]] = {}
        self._lock = Lock()

    def count(self, topic: str, kind: str, reason: str, warn: Warn) -> None:
        """Count one that is dropped; call ``warn`` if it is time for a warning."""
        now = time.monotonic()
        with self._lock:
            last, more = self._warned.get((topic, kind), (-PERIOD, 0))
            if now - last < PERIOD:
                self._warned[topic, kind] = last, more + 1
                return
            self._warned[topic, kind] = now, 0
        before = f'; before it {more} more, for a like reason' if more else ''
        warn(f'dropped what came on {topic}: {reason}{before}')


def check_message(data: bytes, kind: type[Any]) -> Any:
    """Decode a message; MessageError if it is malformed or implausible."""
    if len(data) > LARGEST:
        raise MessageError(f'{len(data)} bytes are more than a message may have')
    if data[:2] != LITTLE_ENDIAN:
        raise MessageError(f'{len(data)} bytes do not begin as CDR in little-endian order')
    message = deserialize(data, kind)
    if reason := objection(message):
        raise MessageError(reason)
    return message
