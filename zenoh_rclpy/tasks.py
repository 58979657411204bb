"""Coroutine callbacks: they wait for futures while the executor of their node goes on."""

from collections.abc import Callable, Coroutine
from functools import partial, wraps
from inspect import CORO_RUNNING, getcoroutinestate, iscoroutinefunction
from typing import Any

from zenoh_rclpy.callback_groups import CallbackGroup
from zenoh_rclpy.future import Future
from zenoh_rclpy.inbox import Inbox
from zenoh_rclpy.session import Context


class Task(Future):
    """A coroutine that runs from one ``await`` to the next; its result is the coroutine's."""

    def __init__(
        self,
        coroutine: Coroutine[Any, None, Any],
        resume: 'Callable[[Task], Any]',
        group: CallbackGroup,
    ) -> None:
        super().__init__()
        self._coroutine = coroutine
        self._resume = partial(resume, self)
        self._group = group

    def step(self) -> None:
        """Run to the next ``await`` of something that is not there yet, or to the end.

        Raises what the coroutine raises.
        """
        try:
            awaited = self._coroutine.send(None)
        except StopIteration as end:
            self._group.release()
            self.set_result(end.value)
        except BaseException as error:
            self._group.release()
            self.set_exception(error)
            raise
        else:
            self._group.occupy()
            if isinstance(awaited, Future):
                awaited.add_done_callback(lambda _: self._resume())
            else:  # something else to await: look again in a moment
                self._resume()

    def close(self) -> None:
        """Give it up where it stands, unless it is what runs now."""
        if getcoroutinestate(self._coroutine) != CORO_RUNNING:
            self._coroutine.close()


class Tasks:
    """The coroutines of a node that wait; what they wait for puts them into the queue here."""

    def __init__(self, context: Context) -> None:
        self.inbox = Inbox(context, self)
        self._waiting: set[Task] = set()

    def start(self, coroutine: Coroutine[Any, None, Any], group: CallbackGroup) -> Task:
        """Run a coroutine to its first ``await``; its group is occupied while it waits."""
        task = self._new(coroutine, group)
        self._step(task)
        return task

    def soon(self, coroutine: Coroutine[Any, None, Any]) -> Task:
        """Have the executor run a coroutine, when what is going on now is done."""
        task = self._new(coroutine, CallbackGroup())
        self.inbox.put(task)
        return task

    def plain(self, callback: Callable[..., Any], group: CallbackGroup) -> Callable[..., Any]:
        """The callback; of a coroutine function, a function that starts it."""
        if not iscoroutinefunction(callback):
            return callback

        @wraps(callback)
        def start(*arguments: Any) -> None:
            self.start(callback(*arguments), group)

        return start

    def execute(self) -> bool:
        """Let one coroutine go on; False if none can."""
        task: Task | None = self.inbox.take()
        if task is None:
            return False
        self._step(task)
        return True

    def destroy(self) -> None:
        """Give up what waits."""
        self.inbox.close()
        for task in list(self._waiting):
            task.close()
        self._waiting.clear()

    def _new(self, coroutine: Coroutine[Any, None, Any], group: CallbackGroup) -> Task:
        task = Task(coroutine, self.inbox.put, group)
        self._waiting.add(task)
        return task

    def _step(self, task: Task) -> None:
        try:
            task.step()
        finally:
            if task.done():
                self._waiting.discard(task)


async def await_or_execute(callback: Callable[..., Any], *arguments: Any) -> Any:
    """Result of a callback, whether it is a coroutine function or not."""
    if iscoroutinefunction(callback):
        return await callback(*arguments)
    return callback(*arguments)
