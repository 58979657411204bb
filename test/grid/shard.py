"""The process that runs cases: ``python -m test.grid.shard SEED MEMORY NAME...``.

It writes a line of JSON for each outcome, and ends when it holds more than so much memory [B].
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from dataclasses import asdict

from mechanism_sim import process_exit

MOST_CPU = 600
"""Of the processor [s], for a case that keeps Python from running, as compiling may."""


def main() -> None:
    """Run the cases one after the other."""
    process_exit.begin()
    from benchmarks.scaling import peak_memory  # noqa: PLC0415 - whoever began it may end meanwhile
    from test.grid.case import run_case  # noqa: PLC0415
    from test.grid.run import grid  # noqa: PLC0415

    seed, memory, *names = sys.argv[1:]
    for case in grid(int(seed), names):
        _limit_cpu()
        outcome = asdict(run_case(case))
        peak = peak_memory(os.getpid())
        print(json.dumps(outcome | {'peak_memory': peak}), flush=True)
        if peak > int(memory):
            return


def _limit_cpu() -> None:
    """Let the system end this process if it needs `MOST_CPU` more from now on."""
    until, (_, most) = int(time.process_time()) + MOST_CPU, resource.getrlimit(resource.RLIMIT_CPU)
    if most != resource.RLIM_INFINITY:
        until = min(until, most)
    resource.setrlimit(resource.RLIMIT_CPU, (until, most))


if __name__ == '__main__':
    main()
