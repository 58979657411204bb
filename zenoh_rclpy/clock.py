"""Time, duration and clock under the names of rclpy: whole nanoseconds inside."""

import time
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, overload

from ros_interfaces.classes import message_class

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

    def to_msg(self) -> Any:
        """``builtin_interfaces/msg/Duration``."""
        seconds, nanoseconds = divmod(self.nanoseconds, SECOND)
        return message_class('builtin_interfaces/msg/Duration')(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, message: Any) -> 'Duration':
        """Duration of a ``builtin_interfaces/msg/Duration``."""
        return cls(nanoseconds=message.sec * SECOND + message.nanosec)


@dataclass(frozen=True, order=True, init=False)
class Time:
    """A point in time: since 1970, or in simulated time since the start of the run."""

    nanoseconds: int

    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        object.__setattr__(self, 'nanoseconds', _nanoseconds(seconds, nanoseconds))

    def __add__(self, span: Duration) -> 'Time':
        return Time(nanoseconds=self.nanoseconds + span.nanoseconds)

    __radd__ = __add__

    @overload
    def __sub__(self, other: 'Time') -> Duration: ...
    @overload
    def __sub__(self, other: Duration) -> 'Time': ...
    def __sub__(self, other: 'Time | Duration') -> 'Duration | Time':
        kind = Duration if isinstance(other, Time) else Time
        return kind(nanoseconds=self.nanoseconds - other.nanoseconds)

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


class ClockType(IntEnum):
    """Kind of time that a clock shows; the numbers are those of rclpy."""

    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


class Clock:
    """Clock of a node (ROS_TIME): the system's, or the last time received on ``/clock``.

    The others are for timers of the wall, whatever the node takes for time.
    """

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self.clock_type = clock_type
        self.simulated: Time | None = None

    @property
    def ros_time_is_active(self) -> bool:
        """True if the time is simulated."""
        return self.simulated is not None

    def now(self) -> Time:
        """Time now; in simulated time zero until the first ``/clock``."""
        if self.clock_type == ClockType.STEADY_TIME:
            return Time(nanoseconds=time.monotonic_ns())
        return self.simulated or Time(nanoseconds=time.time_ns())

    def ticks(self) -> int:
        """Nanoseconds for timers: simulated time, or the system's that nobody sets back."""
        return time.monotonic_ns() if self.simulated is None else self.simulated.nanoseconds
