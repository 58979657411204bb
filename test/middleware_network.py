"""Processes on a network of their own: a free router port, a domain, and scripts that join it."""

import os
import queue
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from running import FOLLOW, TIMEOUT, free_port

from mechanism_sim.nodes import middleware

PATIENCE = TIMEOUT / 2.0  # [s] that a test may wait twice


def eventually(condition: Callable[[], bool]) -> bool:
    """True if a condition comes true in time."""
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.002)
    return True


def spin_until(node: 'middleware.Node', condition: Callable[[], bool]) -> None:
    """Run a node's callbacks until a condition comes true."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        middleware.spin_once(node, timeout_sec=0.1)


class Process:
    """A Python script in a process of its own; what it prints is read line by line."""

    def __init__(self, script: str, environment: dict[str, str], *arguments: object) -> None:
        self.process = subprocess.Popen(
            [sys.executable, '-c', FOLLOW + textwrap.dedent(script), *map(str, arguments)],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.lines: list[str] = []
        self._queue: queue.Queue[str | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def expect(self, start: str) -> str:
        """The next line that starts with this, without it."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                line = self._queue.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f'No {start!r} in time; so far: {self.lines[-20:]}') from None
            if line is None:
                code = self.process.wait(PATIENCE)
                raise AssertionError(f'No {start!r}, ended with {code}: {self.lines[-20:]}')
            if line.startswith(start):
                return line.removeprefix(start).strip()

    def tell(self, line: str = '') -> None:
        """Write a line to its standard input."""
        assert self.process.stdin is not None
        self.process.stdin.write(line + '\n')
        self.process.stdin.flush()

    def interrupt(self, number: int = signal.SIGINT) -> None:
        """Send a signal."""
        self.process.send_signal(number)

    def finish(self) -> None:
        """Wait for its end, which has to be a good one."""
        code = self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        assert code == 0, f'ended with {code}: {self.lines[-20:]}'

    def kill(self) -> None:
        """End it if it has not ended."""
        self.process.kill()
        self.process.wait()
        self._reader.join()
        for stream in (self.process.stdin, self.process.stdout):
            assert stream is not None
            stream.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip())
            self._queue.put(line)
        self._queue.put(None)


class Network:
    """A router port and a domain that no other test has."""

    def __init__(self, middleware: str = 'zenoh') -> None:
        self.port = free_port()
        self.settings = {
            'MECHANISM_SIM_ROUTER': f'tcp/127.0.0.1:{self.port}',
            'MECHANISM_SIM_MIDDLEWARE': middleware,
            'ROS_DOMAIN_ID': str(self.port % 200),
            'PYTHONUNBUFFERED': '1',
        }
        self._processes: list[Process] = []

    def start(self, script: str, *arguments: object) -> Process:
        """A process on this network."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith('ZENOH_')}
        process = Process(script, kept | self.settings, *arguments)
        self._processes.append(process)
        return process

    def close(self) -> None:
        """End what was started."""
        for process in self._processes:
            process.kill()


@contextmanager
def joined() -> Iterator[Network]:
    """This process on a network of its own."""
    network = Network()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in network.settings.items():
            patch.setenv(name, value)
        middleware.init()
        yield network
        middleware.shutdown()
        network.close()
