"""Memory of processes, where the system tells it and takes it back."""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from pathlib import Path


def resident(pid: int | None = None) -> float:
    """Memory that a process, or this one, holds [MiB]; 0 if that is not known."""
    try:
        pages = int(Path(f'/proc/{pid or "self"}/statm').read_text('utf-8').split()[1])
        return pages * os.sysconf('SC_PAGESIZE') / 2**20
    except (OSError, IndexError, ValueError):
        return 0.0


def give_back() -> None:
    """Return what is free to the system, in milliseconds.

    Of what compiling a large machine took for a while, the C library keeps some 70 MiB.
    """
    with suppress(AttributeError, OSError):  # it is not that of GNU
        ctypes.CDLL(None).malloc_trim(0)
