"""Cases of the grid in processes of bounded memory.

Expressions that a process has met and code that it has compiled stay in its memory, some 2 MB a
case: one process for the whole grid grew to 3.8 GB. So cases are run in shards: a process takes
neighbouring ones, which share what is compiled, until it has run them or holds too much. One that
dies costs the case that it was at; the next one goes on behind it.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector

from mechanism_sim import process_exit
from test.grid.case import GridCase, Outcome

SIZE = 60
"""Cases of one process at most."""

MEMORY = 3 * 2**28
"""Memory [B] beyond which a process begins no further case; one more process goes on."""

_ROOT = str(Path(__file__).parents[2])


class Shards:
    """Runs of cases in shards.

    Attributes
    ----------
    ended : processes so far
    peak_memory : [B] the most that one of them held
    """

    def __init__(
        self, cases: Sequence[GridCase], workers: int = 1, size: int = SIZE, memory: int = MEMORY
    ) -> None:
        self.ended, self.peak_memory = 0, 0
        self._workers, self._memory = workers, memory
        size = min(size, math.ceil(len(cases) / workers))  # so that all have some
        self._waiting = deque([*cases[i : i + size]] for i in range(0, len(cases), size))
        self._running: list[_Shard] = []

    def outcomes(self) -> Iterator[Outcome]:
        """Outcomes as they come; closing the iterator ends all processes."""
        with DefaultSelector() as selector:
            try:
                while self._waiting or self._running:
                    while self._waiting and len(self._running) < self._workers:
                        shard = _Shard.begin(self._waiting.popleft(), self._memory)
                        self._running.append(shard)
                        selector.register(shard.pipe, EVENT_READ, shard)
                    for key, _ in selector.select():
                        shard = key.data
                        outcomes, goes_on = shard.read()
                        self.peak_memory = max(self.peak_memory, shard.peak_memory)
                        if not goes_on:
                            selector.unregister(shard.pipe)
                            outcomes += self._end(shard)
                        yield from outcomes
            finally:
                for shard in self._running:
                    shard.process.kill()
                    shard.process.wait()

    def _end(self, shard: _Shard) -> list[Outcome]:
        """Take note of a process that ended; the outcome of a case that it died of."""
        self._running.remove(shard)
        self.ended += 1
        code = shard.process.wait()
        died = [shard.left.pop(0)] if code and shard.left else []
        if shard.left:
            self._waiting.appendleft(shard.left)
        how = f'by {signal.Signals(-code).name}' if code < 0 else f'with exit code {code}'
        return [
            Outcome(case.name, case.family.name, False, 'died', f'its process ended {how}')
            for case in died
        ]


@dataclass
class _Shard:
    """A process and the cases that it has not run yet, the present one first."""

    process: subprocess.Popen[bytes]
    pipe: int
    left: list[GridCase]
    unread: bytes = b''
    peak_memory: int = 0

    @classmethod
    def begin(cls, cases: list[GridCase], memory: int) -> _Shard:
        """Start a process; it ends with this one."""
        words = (str(cases[0].seed), str(memory), *(case.name for case in cases))
        path = os.pathsep.join(filter(None, (_ROOT, os.environ.get('PYTHONPATH'))))
        process = process_exit.start(
            [sys.executable, '-m', 'test.grid.shard', *words], stdout=subprocess.PIPE,
            env={'OPENBLAS_NUM_THREADS': '1', **os.environ, 'PYTHONPATH': path},
        )  # fmt: skip
        assert process.stdout is not None
        return cls(process, process.stdout.fileno(), cases)

    def read(self) -> tuple[list[Outcome], bool]:
        """Outcomes that it has written, and whether more may come."""
        read = os.read(self.pipe, 2**16)
        *lines, self.unread = (self.unread + read).split(b'\n')
        outcomes = []
        for line in lines:
            found = json.loads(line)
            self.peak_memory = found.pop('peak_memory')
            outcomes.append(Outcome(**found))
            self.left.pop(0)
        return outcomes, bool(read)
