"""Timers: callbacks every so often, executed by an executor."""

from collections.abc import Callable
from typing import Any

from mechanism_sim.middleware.callback_groups import CallbackGroup
from mechanism_sim.middleware.clock import SECOND, Clock


class Timer:
    """Calls back every ``period`` seconds of its node's clock; periods missed are left out."""

    def __init__(
        self, period: float, callback: Callable[[], Any], clock: Clock, group: CallbackGroup
    ) -> None:
        if period < 0:
            raise ValueError(f'The period of a timer is {period} s; it cannot be negative')
        self._period = round(period * SECOND)
        self._callback = callback
        self.callback_group = group
        self._clock = clock
        self._cancelled = False
        self._simulated = clock.simulated is not None
        self._next = clock.ticks() + self._period

    def cancel(self) -> None:
        """Do not call back until ``reset``."""
        self._cancelled = True

    def reset(self) -> None:
        """Start over: the next call is one period away."""
        self._cancelled = False
        self._next = self._clock.ticks() + self._period

    def is_canceled(self) -> bool:
        """Whether the timer stands still."""
        return self._cancelled

    def is_ready(self) -> bool:
        """Whether the next call is due."""
        return not self._cancelled and self.time_until_next_call() <= 0

    def time_until_next_call(self) -> int:
        """Nanoseconds of the node's clock to the next call; negative if it is late."""
        if self._simulated != (self._clock.simulated is not None):
            self._simulated = not self._simulated
            self._next = self._clock.ticks() + self._period
        return self._next - self._clock.ticks()

    def wall_wait(self) -> float | None:
        """Seconds that an executor may sleep; None if only ``/clock`` can make the timer due."""
        if self._cancelled or self._clock.simulated is not None:
            return None
        return max(0, self.time_until_next_call()) / SECOND

    def execute(self) -> None:
        """Call back, and take the next call that is still to come."""
        late = -self.time_until_next_call()
        self._next += self._period * (1 + late // self._period if self._period else 1)
        self._callback()
