"""Speed and bag of runs, without a library of bags."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path

BAG_ENDINGS = '.mcap', '.db3', '.mcap.zstd', '.db3.zstd'
"""Endings of the files of bags."""

MCAP = b'\x89MCAP'
"""First bytes of an MCAP file."""


def realtime_factor(simulated: float, wall_time: float | None) -> float | None:
    """Simulated seconds per second.

    Parameters
    ----------
    simulated : simulated duration [s]
    wall_time : wall time [s] from the first message to the last; None if unknown
    """
    return simulated / wall_time if wall_time else None


def next_bag(first: Path, number: int, taken: Callable[[Path], bool]) -> Path:
    """The bag of run `number` = 1, 2, ... after the first: ``run-2.mcap`` after ``run.mcap``.

    Names that are taken by other files are passed over.
    """
    names = (first.with_name(f'{first.stem}-{n}{first.suffix}') for n in count(number + 1))
    return next(name for name in names if not taken(name))
