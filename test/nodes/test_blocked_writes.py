"""Writes that block with Python's lock held, as those of rclpy do."""

from __future__ import annotations

import re
import signal
import subprocess
import sys

from running import TIMEOUT, environment, script

BLOCKED = """
import ctypes
from mechanism_sim import process_exit
process_exit.begin()
from mechanism_sim.nodes.blocked_writes import BlockedWrites
writes = BlockedWrites(process_exit.signals(), 0.6)
for _ in range(1000):
    with writes.on('/impacts'):
        pass
with writes.on('/motion'):
    mutex = ctypes.create_string_buffer(64)
    lock = ctypes.PyDLL(None).pthread_mutex_lock  # holds Python's lock, heeds no signal
    lock(mutex)
    lock(mutex)
"""


def test_a_write_that_blocks_is_named_and_a_signal_ends_it(tmp_path):
    command = [sys.executable, str(script(tmp_path / 'blocked.py', BLOCKED))]
    program = subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE, text=True)
    try:
        assert program.stderr
        line = program.stderr.readline()
        assert re.match(r"mechanism-sim: topic '/motion' has waited \d+ s for a sub", line)
        program.send_signal(signal.SIGINT)
        assert program.wait(TIMEOUT) == -signal.SIGKILL
        assert program.stderr.read() == 'mechanism-sim: interrupted in a write that blocks\n'
    finally:
        program.kill()
        program.communicate()
