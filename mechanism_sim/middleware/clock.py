"""Time, duration and clock under the names of rclpy: whole nanoseconds inside."""

import time
from dataclasses import dataclass
from typing import Any

from mechanism_sim.messages import message_class

SECOND = 1_000_000_000


def _nanoseconds(seconds: float, nanoseconds: int) -> int:
    whole = int(seconds)
    return whole * SECOND + round((seconds - whole) * SECOND) + nanoseconds


@dataclass(frozen=True, order=True, init=False)
class Duration:
    """A span of time."""

    nanoseconds: int

    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        object.__setattr__(self, 'nanoseconds', _nanoseconds(seconds, nanoseconds))


@dataclass(frozen=True, order=True, init=False)
class Time:
    """A point in time: since 1970, or in simulated time since the start of the run."""

    nanoseconds: int

    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        object.__setattr__(self, 'nanoseconds', _nanoseconds(seconds, nanoseconds))

    def __add__(self, span: Duration) -> 'Time':
        return Time(nanoseconds=self.nanoseconds + span.nanoseconds)

    def __sub__(self, other: 'Time') -> Duration:
        return Duration(nanoseconds=self.nanoseconds - other.nanoseconds)

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Whole seconds and the nanoseconds beyond."""
        return divmod(self.nanoseconds, SECOND)

    def to_msg(self) -> Any:
        """``builtin_interfaces/msg/Time``."""
        seconds, nanoseconds = self.seconds_nanoseconds()
        return message_class('builtin_interfaces/msg/Time')(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, message: Any) -> 'Time':
        """Time of a ``builtin_interfaces/msg/Time``."""
        return cls(nanoseconds=message.sec * SECOND + message.nanosec)


class Clock:
    """Clock of a node: the system's, or the last time heard on ``/clock``."""

    def __init__(self) -> None:
        self.simulated: Time | None = None

    def now(self) -> Time:
        """Time now; in simulated time zero until the first ``/clock``."""
        return self.simulated or Time(nanoseconds=time.time_ns())

    def ticks(self) -> int:
        """Nanoseconds for timers: simulated time, or the system's that nobody sets back."""
        return time.monotonic_ns() if self.simulated is None else self.simulated.nanoseconds
