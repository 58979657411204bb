"""Record of the threads that wait for other processes, and a word on those that wait long."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Lock, Thread, get_ident

_LOGGER = logging.getLogger('zenoh_rclpy')
STUCK = 0.1  # [s] after which a call counts as waiting for others

LONG = 2.0
"""[s] after which a topic on which a call waits is named, and who does not read it."""

_AGAIN = 30.0  # [s] after which it is named again
_LOOK = 0.25  # [s] between looks


class Waits:
    """``with waits:`` around every call that may wait for another process.

    Parameters
    ----------
    readers : function that returns the names of nodes in other processes that read a topic
    """

    def __init__(self, readers: Callable[[str], list[str]]) -> None:
        self._readers = readers
        self._since: dict[int, float] = {}
        self._topics: dict[int, str] = {}
        self._ended, self._lock = Event(), Lock()
        self._watch: Thread | None = None
        self._said = -_AGAIN

    def __enter__(self) -> None:
        self._since[get_ident()] = time.monotonic()

    def __exit__(self, *_: object) -> None:
        self._since.pop(get_ident(), None)

    @contextmanager
    def on(self, topic: str) -> Iterator[None]:
        """Watch a write to a topic, which is named if it takes long."""
        if self._watch is None:
            self._begin()
        ident = get_ident()
        self._topics[ident] = topic
        self._since[ident] = time.monotonic()
        try:
            yield
        finally:
            self._since.pop(ident, None)
            self._topics.pop(ident, None)

    def here(self) -> bool:
        """True if it is this thread that calls: what it does now happens inside that call."""
        return get_ident() in self._since

    def long(self) -> bool:
        """True if some thread has been waiting for a while."""
        now = time.monotonic()
        return any(now - since > STUCK for since in list(self._since.values()))

    def say_unread(self, who: str) -> None:
        """Name those who have not read all that was published, as `_look` names a topic."""
        now = time.monotonic()
        if now - self._said >= _AGAIN:
            self._said = now
            _LOGGER.warning(f'waiting for {who} to read all that was published')

    def close(self) -> None:
        """Name nothing any more."""
        self._ended.set()

    def _begin(self) -> None:
        with self._lock:
            if self._watch is None:
                self._watch = Thread(target=self._look, daemon=True, name='waits')
                self._watch.start()

    def _look(self) -> None:
        """Name topics on which somebody waits long: once, and again after a while."""
        named: dict[str, float] = {}
        while not self._ended.wait(_LOOK):
            now, topics = time.monotonic(), dict(self._topics)
            for ident, since in list(self._since.items()):
                topic, waited = topics.get(ident, ''), now - since
                if topic and waited > LONG and now - named.get(topic, -_AGAIN) >= _AGAIN:
                    named[topic] = now
                    who = ', '.join(self._readers(topic)) or 'a subscriber that is gone'
                    _LOGGER.warning(
                        f"topic '{topic}' has waited {waited:.0f} s for a subscriber that does "
                        f'not read: {who}; the run goes on when it reads, or ends'
                    )
