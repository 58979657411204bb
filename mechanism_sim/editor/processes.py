"""Processes of an editor: their names, and their priority below other processes."""

from __future__ import annotations

import os
import signal
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Final

from mechanism_sim import process_exit
from mechanism_sim.memory import resident

LARGEST: Final = 400.0
"""[MiB] of a process that draws or runs; one that has grown beyond gives way to a new one.

What is compiled for a machine stays in memory, some 5 MiB for each: whoever opens fifty others is
beyond.
"""

_CROWDED: Final = 250.0
"""[MiB] of such a process, beyond which what was compiled for machines before is forgotten.

A new one holds 120 to 160 MiB, with kernels of contacts 230; to compile and run the largest
machine of `config` takes 240 more, and 330 where its code is not on disk.
"""


def crowded() -> bool:
    """True if this process holds too much memory to take another large machine."""
    return resident() > _CROWDED


def work_unseen(name: str) -> None:
    """Prepare this process to draw or run a possibly incomplete machine for a page.

    `name` : name in lists of processes

    Interrupts are left to the main process. Warnings of undefined numbers, as from an
    incomplete machine, are not shown.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter('ignore', RuntimeWarning)
    with suppress(OSError):
        Path('/proc/self/comm').write_text(f'editor: {name}', 'utf-8')
    process_exit.follow(os.getppid())


def cpu_time(pid: int | None) -> float | None:
    """CPU time of a process [s]."""
    try:
        fields = Path(f'/proc/{pid}/stat').read_text('utf-8').rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
    except (OSError, IndexError, ValueError):
        return None
