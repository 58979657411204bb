"""Callbacks that Zenoh calls directly, and what an interrupt from the keyboard does to them.

What is published in the main thread for a subscription of the same process is delivered inside
that call, by a callback in the main thread. A KeyboardInterrupt raised there would end in Zenoh,
which logs it and goes on: the process would not end, and a sample would be lost. So an interrupt
that hits a callback is sent again a moment later.

A thread of Zenoh gets a state of its own in Python's interpreter with every callback, and loses it
behind it: that is memory mapped and unmapped, and costs as much as all else that a small message
costs. Whoever holds one keeps it.
"""

import ctypes
import os
import signal
from collections.abc import Callable
from threading import Timer, local
from types import CodeType, FrameType
from typing import Any

from zenoh.handlers import Callback

RETRY = 0.002  # [s]
_codes: set[CodeType] = set()
_here = local()


def direct(call: Callable[[Any], Any], drop: Callable[[], Any] | None = None) -> 'Callback[Any]':
    """Callback that runs in the thread that has the data; ``drop`` runs when none will follow."""

    def take(data: Any) -> None:
        if not hasattr(_here, 'kept'):
            # Counted once more than it is given back: there are as many states as threads.
            ctypes.pythonapi.PyGILState_Ensure()
            _here.kept = True
        call(data)

    for function in (take, call, drop):
        if function is not None:
            _codes.add(getattr(function, '__func__', function).__code__)
    return Callback(take, drop, indirect=False)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handler of SIGINT: KeyboardInterrupt, but not inside a callback."""
    while frame is not None:
        if frame.f_code in _codes:
            Timer(RETRY, os.kill, [os.getpid(), number]).start()
            return
        frame = frame.f_back
    signal.default_int_handler(number, frame)
