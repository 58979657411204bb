"""Stamps of messages to and from seconds."""

from typing import Any

from ros_interfaces.classes import message_class

NANOSECONDS = 1_000_000_000


def stamp(time: float) -> Any:
    """``builtin_interfaces/msg/Time`` of a time in seconds, rounded to nanoseconds."""
    whole = int(time // 1.0)
    nanoseconds = round((time - whole) * NANOSECONDS)
    carry, nanoseconds = divmod(nanoseconds, NANOSECONDS)
    return message_class('builtin_interfaces/msg/Time')(sec=whole + carry, nanosec=nanoseconds)


def stamp_at(nanoseconds: int) -> Any:
    """``builtin_interfaces/msg/Time`` of a time in nanoseconds."""
    sec, nanosec = divmod(nanoseconds, NANOSECONDS)
    return message_class('builtin_interfaces/msg/Time')(sec=sec, nanosec=nanosec)


def seconds(time: Any) -> float:
    """Seconds of a stamp: exact to the last digit a float64 has there."""
    return float(time.sec + time.nanosec / NANOSECONDS)


def nanoseconds(time: Any) -> int:
    """Nanoseconds of a stamp."""
    return int(time.sec) * NANOSECONDS + int(time.nanosec)
