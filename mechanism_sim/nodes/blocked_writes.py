"""Warning and end of blocking writes, from another process, since rclpy stops all threads.

DDS blocks in a write until a killed reliable subscriber is recognised as gone: for as
long as its lease, 60 s. rclpy holds Python's lock meanwhile, so that this process can neither warn
nor handle a signal. A small second process can: shared memory shows it each write, and
signals are bytes in a pipe that remain unread.
"""

from __future__ import annotations

import mmap
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import Popen

LONG, AGAIN = 2.0, 30.0
"""[s] after which a write is named, and after which it is named again."""

_STATE = struct.Struct('<Q255p')  # number of writes begun and ended, topic
_SIZE = 512
_WATCH = f"""
import array, fcntl, os, select, signal, struct, sys, termios, time
memory, reader, parent = map(int, sys.argv[1:4])
long = float(sys.argv[4])
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGTERM, signal.SIG_IGN)
since, last, named, signalled = 0.0, -1, 0.0, 0.0
while os.getppid() == parent:
    select.select([], [], [], 0.25)
    now = time.monotonic()
    number, topic = struct.unpack('{_STATE.format}', os.pread(memory, {_STATE.size}, 0))
    if number != last:
        last, since, named = number, now, 0.0
    waiting = array.array('i', [0])
    fcntl.ioctl(reader, termios.FIONREAD, waiting)
    signalled = (signalled or now) if waiting[0] else 0.0
    if number % 2 and now - since > long and now - (named or -1e9) > {AGAIN}:
        named = now
        print(f"mechanism-sim: topic '{{topic.decode()}}' has waited {{now - since:.0f}} s for a "
              'subscriber that does not read; the run continues when it reads, or has left',
              file=sys.stderr, flush=True)
    if signalled and now - signalled > long:
        print('mechanism-sim: interrupted in a write that blocks', file=sys.stderr, flush=True)
        os.kill(parent, signal.SIGKILL)
        break
"""


class BlockedWrites:
    """Process that monitors the writes of this one.

    Parameters
    ----------
    signals : end of a pipe with a byte for each signal, read by another thread
    long : [s] after which a write is named, and one that does not end is ended by a signal
    """

    def __init__(self, signals: int, long: float = LONG) -> None:
        memory = os.memfd_create('writes')
        os.ftruncate(memory, _SIZE)
        self._state, self._number = mmap.mmap(memory, _SIZE), 0
        given = map(str, (memory, signals, os.getpid(), long))
        command = [sys.executable, '-S', '-E', '-c', _WATCH, *given]
        self._process = Popen(command, pass_fds=[memory, signals])  # noqa: S603
        os.close(memory)

    @contextmanager
    def on(self, topic: str) -> Iterator[None]:
        """Context of a write on a topic."""
        self._number += 1
        _STATE.pack_into(self._state, 0, self._number, topic.encode())
        try:
            yield
        finally:
            self._number += 1
            _STATE.pack_into(self._state, 0, self._number, topic.encode())

    def close(self) -> None:
        """End the monitoring process."""
        self._process.kill()
        self._process.wait()
