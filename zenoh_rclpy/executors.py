"""The executor: runs the callbacks of several nodes in one thread, in the order of arrival.

Timers that are due go first, but in turns with the rest. What arrives while nobody spins waits
in the queues.
"""

import time
from typing import Any

from zenoh_rclpy import context as contexts
from zenoh_rclpy.clock import SECOND
from zenoh_rclpy.errors import ExternalShutdownException
from zenoh_rclpy.future import Future
from zenoh_rclpy.inbox import Ready
from zenoh_rclpy.node import Node
from zenoh_rclpy.timer import Timer

__all__ = [  # as of the module of rclpy, and the functions of its package
    'ExternalShutdownException',
    'SingleThreadedExecutor',
    'spin',
    'spin_once',
    'spin_until_future_complete',
]

LOOK_AT_TIMERS = 1e-3  # [s] how often, while messages are waiting
BUSY = 16  # messages of others between two such looks: then the next are let come together


class SingleThreadedExecutor:
    """Runs the callbacks of its nodes in the thread that calls ``spin`` or ``spin_once``."""

    def __init__(self) -> None:
        self._nodes: list[Node] = []
        self._ready: Ready = Ready()
        self._is_shutdown = False
        self._ran_timer = False
        self._next_look = 0.0
        self._received = 0  # messages of others until the last look
        contexts.add_sleeper(self)

    def add_node(self, node: Node) -> bool:
        """Take on a node; False if it is here already. Another executor lets it go."""
        if node in self._nodes:
            return False
        if node.executor is not None:
            node.executor.remove_node(node)
        self._nodes.append(node)
        node.executor = self
        node.attach(self._ready)
        self.wake()
        return True

    def remove_node(self, node: Node) -> None:
        """Let a node go; what waits for it stays in its queues."""
        if node in self._nodes:
            self._nodes.remove(node)
            node.executor = None
            node.attach(None)
            # A new ready queue, without the entries of the node in the old one.
            old, self._ready = self._ready, Ready()
            for other in self._nodes:
                other.attach(self._ready)
            old.put(None)

    def get_nodes(self) -> list[Node]:
        """The nodes this executor runs."""
        return list(self._nodes)

    def wake(self) -> None:
        """Make a waiting ``spin_once`` look around; may be called from a signal handler."""
        self._ready.put(None)

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Let all nodes go; ``spin`` ends."""
        self._is_shutdown = True
        for node in self.get_nodes():
            self.remove_node(node)
        self.wake()
        return True

    def spin(self) -> None:
        """Run callbacks until ``shutdown``, of this or of the process.

        Raises ExternalShutdownException if that came from outside, by a signal.
        """
        while contexts.ok() and not self._is_shutdown:
            try:
                self.spin_once()
            except ExternalShutdownException:
                if contexts.ok():
                    raise
        if contexts.signalled():
            raise ExternalShutdownException('A signal asked the process to end')

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback; wait for one for at most ``timeout_sec`` [s], for ever if None.

        Raises ExternalShutdownException if the process is to end.
        """
        end = None if timeout_sec is None or timeout_sec < 0 else time.monotonic() + timeout_sec
        while not self._is_shutdown:
            if not contexts.ok():
                raise ExternalShutdownException('The process is not, or no longer, on the network')
            if self._ready and time.monotonic() < self._next_look:
                if self._execute(self._ready.get()):
                    return
                continue
            received = contexts.received()
            if received - self._received >= BUSY and not self._ready:
                # Threads that wake each other up for every message cost more than the messages.
                time.sleep(LOOK_AT_TIMERS)
            self._received = received
            self._next_look = time.monotonic() + LOOK_AT_TIMERS
            left = {
                timer: timer.time_until_next_call()
                for node in self._nodes
                for timer in node.timers
                if timer.callback_group.free and not timer.is_canceled()
            }
            first = min(left, key=left.__getitem__, default=None)
            # After a timer it is the others' turn: one that is always due must not starve them.
            if first and left[first] <= 0 and not (self._ran_timer and self._ready):
                self._ran_timer = True
                first.execute()
                return
            self._ran_timer = False
            try:
                entity = self._ready.get(timeout=_wait(left, end))
            except TimeoutError:
                if end is not None and time.monotonic() >= end:
                    return
                continue
            if self._execute(entity):
                return

    @staticmethod
    def _execute(entity: Any) -> bool:
        """Hand on one item of an entity; False if there is nothing to do."""
        return entity is not None and bool(entity.execute())

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until a future is done or ``timeout_sec`` [s] have passed."""
        end = None if timeout_sec is None else time.monotonic() + timeout_sec
        future.add_done_callback(lambda _: self.wake())
        while contexts.ok() and not future.done():
            left = None if end is None else end - time.monotonic()
            if left is not None and left <= 0:
                return
            self.spin_once(0.05 if left is None else min(left, 0.05))


def _wait(left: dict[Timer, int], end: float | None) -> float | None:
    """Time to sleep [s], with numbers of nanoseconds left to timers; None: for ever."""
    waits = [max(0, ns) / SECOND for timer, ns in left.items() if not timer.is_simulated]
    if end is not None:
        waits.append(max(0.0, end - time.monotonic()))
    return min(waits, default=None)


_executor: SingleThreadedExecutor | None = None


def get_global_executor() -> SingleThreadedExecutor:
    """The executor behind ``spin``."""
    global _executor  # noqa: PLW0603
    if _executor is None or _executor._is_shutdown:
        _executor = SingleThreadedExecutor()
    return _executor


def _alone(node: Node) -> SingleThreadedExecutor:
    """The global executor with this node only; it stays there until another is spun."""
    executor = get_global_executor()
    for other in executor.get_nodes():
        if other is not node:
            executor.remove_node(other)
    executor.add_node(node)
    return executor


def spin(node: Node) -> None:
    """Run the callbacks of a node until ``shutdown``."""
    _alone(node).spin()


def spin_once(node: Node, *, timeout_sec: float | None = None) -> None:
    """Run one callback of a node."""
    _alone(node).spin_once(timeout_sec)


def spin_until_future_complete(
    node: Node, future: Future, *, timeout_sec: float | None = None
) -> None:
    """Run the callbacks of a node until a future is done or ``timeout_sec`` [s] have passed."""
    _alone(node).spin_until_future_complete(future, timeout_sec)
