"""Loggers of nodes: one line each on standard error, as ROS writes it, and on ``/rosout``."""

import sys
import time
from collections.abc import Callable
from enum import IntEnum
from types import CodeType
from typing import Any

from ros_interfaces.classes import message_class
from zenoh_rclpy.clock import Time


class LoggingSeverity(IntEnum):
    """Severity of a log message."""

    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


class Logger:
    """Logger of a node; ``publish`` takes the message for ``/rosout``.

    Not ``written``: nothing goes to standard error.
    """

    def __init__(
        self, name: str, publish: Callable[[Any], Any] | None = None, written: bool = True
    ) -> None:
        self.name = name
        self._publish = publish
        self._written = written
        self._level = LoggingSeverity.INFO
        self._printed: dict[tuple[CodeType, int], float] = {}

    def get_child(self, name: str) -> 'Logger':
        """Logger of a part of the node, with the level of the whole."""
        child = Logger(f'{self.name}.{name}', self._publish, self._written)
        child.set_level(self._level)
        return child

    def set_level(self, level: LoggingSeverity) -> None:
        """Log nothing below this level."""
        self._level = LoggingSeverity(level)

    def get_effective_level(self) -> LoggingSeverity:
        """The level below which nothing is said."""
        return self._level

    def is_enabled_for(self, severity: LoggingSeverity) -> bool:
        """True if messages of this severity are logged."""
        return severity >= self._level

    def log(self, message: str, severity: LoggingSeverity, **how: Any) -> bool:
        """Log; ``once``, or every ``throttle_duration_sec``, for each line that calls this."""
        return self._log(LoggingSeverity(severity), message, **how)

    def debug(self, message: str, **how: Any) -> bool:
        """Log for debugging."""
        return self._log(LoggingSeverity.DEBUG, message, **how)

    def info(self, message: str, **how: Any) -> bool:
        """Log a message of severity INFO."""
        return self._log(LoggingSeverity.INFO, message, **how)

    def warning(self, message: str, **how: Any) -> bool:
        """Log a message of severity WARN."""
        return self._log(LoggingSeverity.WARN, message, **how)

    warn = warning

    def error(self, message: str, **how: Any) -> bool:
        """Log a message of severity ERROR."""
        return self._log(LoggingSeverity.ERROR, message, **how)

    def fatal(self, message: str, **how: Any) -> bool:
        """Log what ends the node; not ``written``: on ``/rosout`` alone, see `log_end`."""
        return self._log(LoggingSeverity.FATAL, message, **how)

    def _log(
        self,
        level: LoggingSeverity,
        message: str,
        *,
        once: bool = False,
        throttle_duration_sec: float = 0.0,
        written: bool = True,
    ) -> bool:
        if level < self._level:
            return False
        now = time.time_ns()
        caller = sys._getframe(2)
        place = caller.f_code, caller.f_lineno
        last = self._printed.get(place)
        if last is not None and (once or now - last < throttle_duration_sec * 1e9):
            return False
        if once or throttle_duration_sec:
            self._printed[place] = now
        seconds, nanoseconds = divmod(now, 1_000_000_000)
        line = f'[{level.name}] [{seconds}.{nanoseconds:09d}] [{self.name}]: {message}'
        if self._written and written:
            print(line, file=sys.stderr, flush=True)
        if self._publish is not None:
            log = message_class('rcl_interfaces/msg/Log')
            stamp = Time(nanoseconds=now).to_msg()
            self._publish(log(stamp=stamp, level=int(level), name=self.name, msg=message))
        return True
