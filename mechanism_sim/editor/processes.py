"""CPU time and memory of processes, where the system tells them."""

from __future__ import annotations

import os
import signal
import warnings
from pathlib import Path
from typing import Final

from mechanism_sim import ending

LARGEST: Final = 400.0
"""[MiB] of a process that draws or runs; one that has grown beyond gives way to a new one.

What is compiled for a machine stays in memory, some 5 MiB for each: whoever opens fifty others is
beyond.
"""


def work_unseen() -> None:
    """Prepare this process to draw or run what may be half a machine, for a page that shows it.

    An interrupt is for the one who edits, and so is standard error: numbers without a value, which
    half a machine has, are no matter for it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter('ignore', RuntimeWarning)
    ending.follow(os.getppid())


def cpu_time(pid: int | None) -> float | None:
    """CPU time of a process [s]."""
    try:
        fields = Path(f'/proc/{pid}/stat').read_text('utf-8').rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
    except (OSError, IndexError, ValueError):
        return None


def resident(pid: int | None) -> float:
    """Memory that a process holds [MiB]; 0 if that is not known."""
    try:
        pages = int(Path(f'/proc/{pid}/statm').read_text('utf-8').split()[1])
        return pages * os.sysconf('SC_PAGESIZE') / 2**20
    except (OSError, IndexError, ValueError):
        return 0.0
