"""Timers: callbacks every so often, executed by an executor."""

from collections.abc import Callable
from threading import Event
from typing import Any

from zenoh_rclpy import context as contexts
from zenoh_rclpy.callback_groups import CallbackGroup
from zenoh_rclpy.clock import SECOND, Clock
from zenoh_rclpy.errors import ROSInterruptException

_LOOK = 0.1  # [s] between two looks whether the process is to end


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
        self._last = self._next = 0
        self._simulated = clock.simulated is not None
        self.reset()

    @property
    def timer_period_ns(self) -> int:
        """The period [ns]."""
        return self._period

    def time_since_last_call(self) -> int:
        """Nanoseconds of the node's clock since the last call, or since the start."""
        return self._clock.ticks() - self._last

    def cancel(self) -> None:
        """Do not call back until ``reset``."""
        self._cancelled = True

    def reset(self) -> None:
        """Start over: the next call is one period away."""
        self._cancelled = False
        self._start_over()

    def is_canceled(self) -> bool:
        """True if the timer stands still."""
        return self._cancelled

    def is_ready(self) -> bool:
        """True if the next call is due."""
        return not self._cancelled and self.time_until_next_call() <= 0

    def time_until_next_call(self) -> int:
        """Nanoseconds of the node's clock to the next call; negative if it is late.

        A clock that is another now, or was set back to before the last call, starts it over.
        """
        now, simulated = self._clock.ticks(), self._clock.simulated is not None
        if simulated != self._simulated or now < self._last:
            self._simulated = simulated
            self._start_over()
        return self._next - now

    @property
    def is_simulated(self) -> bool:
        """True if only ``/clock`` can make the timer due."""
        return self._clock.simulated is not None

    def execute(self) -> None:
        """Call back, and take the next call that is still to come."""
        late = -self.time_until_next_call()
        self._last = self._clock.ticks()
        self._next += self._period * (1 + late // self._period if self._period else 1)
        self._callback()

    def _start_over(self) -> None:
        self._last = self._clock.ticks()
        self._next = self._last + self._period


class Rate:
    """Lets a thread go on so often; another thread has to spin the node, as with rclpy.

    Parameters
    ----------
    beat : event set by a timer of the node
    """

    def __init__(self, timer: Timer, beat: Event) -> None:
        self.timer, self._beat = timer, beat

    def sleep(self) -> None:
        """Wait for the next beat; one that has come since the last is not waited for.

        Raises
        ------
        ROSInterruptException
            If the rate is destroyed, or the process was asked to end.
        """
        # Nobody but a beat wakes it: a signal handler must not set what this thread waits for.
        while contexts.ok() and not self.timer.is_canceled():
            if self._beat.wait(_LOOK):
                self._beat.clear()
                return
        raise ROSInterruptException('There is no beat to wait for any more')
