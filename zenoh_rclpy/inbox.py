"""Queues between Zenoh's threads, which fill them, and an executor, which empties them.

Every subscription, service and client has one. A sample from another process that finds the queue
of a KEEP_ALL subscription full waits in Zenoh's thread: the link fills, and the publisher over
there waits too. Two exceptions keep this from ever locking up:

- samples published in this process never wait, for the thread that publishes may be the one that
  has to empty the queue;
- while this process itself waits for others (its publication is stuck behind a slow subscriber,
  or it awaits a reply), samples from others do not wait either: two processes that publish to
  each other cannot stop each other.

In these cases the queue grows beyond its limit. What comes from outside is judged before it could
push out anything else: see ``refusals``.
"""

import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from enum import Enum
from threading import Condition, Lock, RLock
from typing import Any, Protocol

from zenoh_rclpy.callback_groups import CallbackGroup
from zenoh_rclpy.session import Context

LIMIT = 1000  # samples that a KEEP_ALL subscription holds before its publishers wait, requests,
LIMIT_BYTES = 32_000_000  # or bytes
RECHECK = 0.05  # [s]


class Entity(Protocol):
    """Work for an executor."""

    def execute(self) -> bool:
        """Handle one item that waits; False if there is none."""


class Ready:
    """Entities that have work, in the order in which it came.

    CPython's `SimpleQueue` waits for ever if a time-out passes between its two looks at its lock,
    as on a busy machine any may. Signal handlers may put here, too.
    """

    def __init__(self) -> None:
        self._entities: deque[Entity | None] = deque()
        self._news = Lock()  # free while there may be some

    def __len__(self) -> int:
        return len(self._entities)

    def put(self, entity: Entity | None) -> None:
        """Add one, or None to make who waits look around."""
        self._entities.append(entity)
        if self._news.locked():  # else who comes to wait finds the entity
            with suppress(RuntimeError):  # another thread was faster
                self._news.release()

    def get(self, timeout: float | None = None) -> Entity | None:
        """Take the first, or wait for it at most so long [s], for ever if None; TimeoutError."""
        end = None if timeout is None else time.monotonic() + timeout
        while not self._entities:
            left = -1.0 if end is None else max(0.0, end - time.monotonic())
            if not self._news.acquire(timeout=left) and not self._entities:
                raise TimeoutError
        return self._entities.popleft()


class Overflow(Enum):
    """Policy for an item that finds the queue full."""

    WAIT = 'wait'
    DROP_OLDEST = 'drop oldest'
    REFUSE = 'refuse'
    GROW = 'grow'


class Inbox:
    """Items in order of arrival; each puts its owner once into the executor's ready queue."""

    def __init__(
        self,
        context: Context,
        owner: Entity,
        limit: int = LIMIT,
        overflow: Overflow = Overflow.GROW,
        group: CallbackGroup | None = None,
    ) -> None:
        self._context = context
        self._owner = owner
        self._limit = limit
        self._overflow = overflow
        self._group = group or CallbackGroup()
        self._items: deque[tuple[Any, int]] = deque()
        self._bytes = 0
        self._lock = RLock()
        self._changed = Condition(self._lock)
        self._ready: Ready | None = None
        self._waiting = 0
        self._open = True
        context.inboxes.add(self)

    def __len__(self) -> int:
        return len(self._items)

    @property
    def waits(self) -> bool:
        """True if what finds no room waits: nothing pushes out anything else."""
        return self._overflow is Overflow.WAIT

    def put(self, item: Any, size: int = 0) -> bool:
        """Add an item of a size in bytes; False if there is no room for it."""
        with self._lock:
            if self._overflow is Overflow.WAIT:
                self._make_room()
            elif self._overflow is Overflow.REFUSE and self._fills(1.0):
                return False
            if not self._open:
                return True
            self._items.append((item, size))
            self._bytes += size
            if self._overflow is Overflow.DROP_OLDEST and self._overflows():
                while self._overflows():
                    self._bytes -= self._items.popleft()[1]
            elif self._ready is not None:
                self._ready.put(self._owner)
            return True

    def put_all(self, items: Sequence[tuple[Any, int]]) -> int:
        """Add items with their sizes; how many there was room for."""
        if self._overflow is not Overflow.WAIT:
            return sum(self.put(item, size) for item, size in items)
        with self._lock:
            self._make_room()
            if self._open:
                self._items.extend(items)
                self._bytes += sum(size for _, size in items)
                if self._ready is not None:
                    for _ in items:
                        self._ready.put(self._owner)
        return len(items)

    def take(self) -> Any:
        """Next item, None if there is none or its group waits; called by the executor."""
        if not self._group.free:
            self._group.hold(self)
            return None
        with self._lock:
            if not self._items:
                return None
            item, size = self._items.popleft()
            self._bytes -= size
            if self._waiting and not self._fills(0.5):
                self._changed.notify_all()
            return item

    def attach(self, ready: Ready | None) -> None:
        """Report to a ready queue from now on, also the waiting items; None: to none."""
        with self._lock:
            self._ready = ready
            if ready is not None:
                for _ in self._items:
                    ready.put(self._owner)

    def report(self) -> None:
        """Put the owner into the ready queue once more."""
        with self._lock:
            if self._ready is not None:
                self._ready.put(self._owner)

    def close(self) -> None:
        """Take in nothing more and let go whoever waits."""
        with self._lock:
            self._open = False
            self._items.clear()
            self._changed.notify_all()
        self._context.inboxes.discard(self)

    def _make_room(self) -> None:
        """Wait for room, but not for what this process publishes: that is delivered inside."""
        if not self._fills(1.0) or self._context.waits.here():
            return
        # Half empty, so that both sides work in long strokes instead of waking each other up.
        self._waiting += 1
        while self._open and self._fills(0.5) and not self._context.waits.long():
            self._changed.wait(RECHECK)
        self._waiting -= 1

    def _overflows(self) -> bool:
        many = len(self._items) > self._limit
        return many or (len(self._items) > 1 and self._bytes > LIMIT_BYTES)

    def _fills(self, part: float) -> bool:
        return len(self._items) >= part * self._limit or self._bytes >= part * LIMIT_BYTES
