"""Futures: replies that are still to come."""

from collections.abc import Callable
from threading import Event
from typing import Any


class Future:
    """A result that comes later; callbacks run in the thread that sets it."""

    def __init__(self) -> None:
        self._done = Event()
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Future], Any]] = []

    def done(self) -> bool:
        """Whether there is a result or an exception."""
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

    def add_done_callback(self, callback: 'Callable[[Future], Any]') -> None:
        """Call back with this future when it is done, at once if it is."""
        if self.done():
            callback(self)
        else:
            self._callbacks.append(callback)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is done; False if ``timeout`` [s] passes first."""
        return self._done.wait(timeout)

    def _finish(self) -> None:
        self._done.set()
        for callback in self._callbacks:
            callback(self)
