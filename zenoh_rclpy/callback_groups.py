"""Callback groups: what may run while a coroutine callback waits.

As in rclpy every node has a group that its callbacks are in unless they are given another: while
one of them waits, none of the others runs, those included that could end the waiting. A service
that answers later therefore wants a ``ReentrantCallbackGroup``.
"""

from typing import Protocol


class Waiter(Protocol):
    """An object that a group holds up."""

    def report(self) -> None:
        """Try again."""


class CallbackGroup:
    """Callbacks that have to do with each other; of its own it lets all of them run."""

    free = True  #: whether callbacks of the group may run

    def occupy(self) -> None:
        """A callback of the group waits."""

    def release(self) -> None:
        """The callback that waited is done."""

    def hold(self, held: Waiter) -> None:
        """Have this report again when the group is free."""


class ReentrantCallbackGroup(CallbackGroup):
    """Callbacks that run while others of them wait."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Callbacks none of which runs while another of them waits."""

    def __init__(self) -> None:
        self._held: list[Waiter] = []

    def occupy(self) -> None:
        """Prevent callbacks of the group from running."""
        self.free = False

    def release(self) -> None:
        """Let the others run, in the order in which they were held up."""
        self.free = True
        waiting, self._held = self._held, []
        for held in waiting:
            held.report()

    def hold(self, held: Waiter) -> None:
        """Have this report again when the group is free."""
        self._held.append(held)
