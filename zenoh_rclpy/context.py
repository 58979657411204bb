"""``init``, ``shutdown`` and ``ok``: the one context of a process."""

import atexit
import signal
import sys
from collections.abc import Iterable, Sequence
from threading import current_thread, main_thread
from types import FrameType
from typing import Any, Protocol
from weakref import WeakSet

from zenoh_rclpy.arguments import parse_arguments
from zenoh_rclpy.callbacks import interrupt
from zenoh_rclpy.errors import MiddlewareError
from zenoh_rclpy.session import FLUSH_PATIENCE, Context


class Sleeper(Protocol):
    """A waiter that is woken when ``ok`` changes."""

    def wake(self) -> None:
        """Look around; may be called from a signal handler."""


_context: Context | None = None
_signalled = False
_sleepers: WeakSet[Sleeper] = WeakSet()


def init(args: Sequence[str] | None = None, *, domain_id: int | None = None) -> None:
    """Join the network; nodes heed the arguments of ROS in ``args``, ``sys.argv`` if None.

    Until ``shutdown`` is done, SIGTERM makes ``spin`` raise ExternalShutdownException, so that
    what is published still gets out; a second SIGTERM ends the process at once.

    Raises MiddlewareError if there is no network to join, if an argument of ROS is wrong, or if
    ``init`` was called already.
    """
    global _context, _signalled  # noqa: PLW0603
    if _context is not None:
        raise MiddlewareError('init() was called twice without shutdown() between')
    _context = Context(domain_id, parse_arguments(sys.argv if args is None else args))
    _signalled = False
    for number, (usual, ours) in _HANDLERS.items():
        if current_thread() is main_thread() and signal.getsignal(number) is usual:
            signal.signal(number, ours)


def shutdown(timeout_sec: float = FLUSH_PATIENCE) -> None:
    """Leave the network, once others have what was published here; see ``Context.close``.

    Raises MiddlewareError if they have not after ``timeout_sec`` [s].
    """
    global _context
    ending, _context = _context, None
    if ending is None:
        raise MiddlewareError('shutdown() was called without init()')
    _wake()
    try:
        flushed = ending.close(timeout_sec)
    finally:
        for number, (usual, ours) in _HANDLERS.items():
            if current_thread() is main_thread() and signal.getsignal(number) is ours:
                signal.signal(number, usual)
    if not flushed:
        raise MiddlewareError(
            f'After {timeout_sec} s other processes had not received all that was published: '
            'part is lost'
        )


def try_shutdown() -> None:
    """``shutdown`` if there is something to shut down."""
    if _context is not None:
        shutdown()


def leave(nodes: Iterable[Any] = (), patience: float = FLUSH_PATIENCE) -> None:
    """Take nodes down and `shutdown`, if there is something to shut down; not part of rclpy.

    Raises MiddlewareError if others have not what was published after `patience` [s].
    """
    for node in nodes:
        node.destroy_node()
    if _context is not None:
        shutdown(patience)


def log_end(node: Any, reason: str) -> None:
    """Log why a node ends, which its program writes on standard error; not part of rclpy."""
    node.get_logger().fatal(reason, written=False)


def ok() -> bool:
    """True if the process is on the network and was not asked to end."""
    return _context is not None and not _signalled


def signalled() -> bool:
    """True if a signal asked the process to end."""
    return _signalled


def received() -> int:
    """Number of messages that other processes have sent."""
    return _context.received if _context is not None else 0


def default_context() -> Context:
    """The context of this process."""
    if _context is None:
        raise MiddlewareError('init() comes first')
    return _context


def add_sleeper(sleeper: Sleeper) -> None:
    """Have it woken when ``ok`` changes, as long as it lives."""
    _sleepers.add(sleeper)


def _wake() -> None:
    for sleeper in list(_sleepers):
        sleeper.wake()


def _end(number: int, _frame: FrameType | None) -> None:
    global _signalled  # noqa: PLW0603
    if _signalled:
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)
    _signalled = True
    _wake()


_HANDLERS: dict[signal.Signals, tuple[Any, Any]] = {
    signal.SIGINT: (signal.default_int_handler, interrupt),
    signal.SIGTERM: (signal.SIG_DFL, _end),
}
atexit.register(try_shutdown)
