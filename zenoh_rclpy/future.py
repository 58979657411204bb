"""Futures: results that are still to come."""

from collections.abc import Callable, Generator
from threading import Event, Lock
from typing import Any


class Future:
    """A result that comes later; callbacks run in the thread that sets it.

    A coroutine callback may ``await`` it: the executor goes on meanwhile.
    """

    def __init__(self) -> None:
        self._done = Event()
        self._cancelled = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Future], Any]] = []
        self._lock = Lock()

    def __await__(self) -> 'Generator[Future, None, Any]':
        while not self.done():
            yield self
        return self.result()

    def done(self) -> bool:
        """True if there is a result or an exception."""
        return self._done.is_set()

    def result(self) -> Any:
        """The result, None if there is none yet; raises the exception if there is one."""
        if self._exception is not None:
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        """The exception, if there is one."""
        return self._exception

    def set_result(self, result: Any) -> None:
        """Fulfil it."""
        self._result = result
        self._finish()

    def set_exception(self, exception: BaseException) -> None:
        """End it without a result."""
        self._exception = exception
        self._finish()

    def cancel(self) -> None:
        """Mark the result as unwanted; the work on it may check this."""
        if not self.done():
            self._cancelled = True
            self._run_callbacks()

    def cancelled(self) -> bool:
        """True if it was cancelled, and no result came all the same."""
        return self._cancelled

    def add_done_callback(self, callback: 'Callable[[Future], Any]') -> None:
        """Call back with this future when it is done, at once if it is."""
        with self._lock:
            if not self.done():
                self._callbacks.append(callback)
                return
        callback(self)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is done; False if ``timeout`` [s] passes first."""
        return self._done.wait(timeout)

    def _finish(self) -> None:
        self._cancelled = False
        with self._lock:
            self._done.set()
        self._run_callbacks()

    def _run_callbacks(self) -> None:
        with self._lock:
            callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)
