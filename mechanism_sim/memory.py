"""Memory of processes, on systems that report it and take it back."""

from __future__ import annotations

import ctypes
import os
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Generic, TypeVar
from weakref import ref

T = TypeVar('T')


class Reused(Generic[T]):
    """Things that cost much to make: when the owner of one is gone, the next may have it.

    Nothing is called as an owner goes: Python swallows what a signal raises in a finaliser or a
    callback of a weak reference, and a Ctrl-C would be lost there. An owner is looked for when
    the next asks.

    Parameters
    ----------
    most : largest number of equal objects kept; further ones go with their owners
    """

    def __init__(self, most: Callable[[T], int]) -> None:
        self._most = most
        self._lent: deque[tuple[ref[object], T]] = deque()

    def take(self, owner: object, fits: Callable[[T], bool] = lambda _: True) -> T | None:
        """A thing whose owner is gone, the last lent first, or None; others that do not fit go."""
        for _ in range(len(self._lent)):
            try:
                entry = self._lent.pop()  # while it is out, no other thread can take it
            except IndexError:
                break
            last, thing = entry
            if last() is not None:
                self._lent.appendleft(entry)
            elif fits(thing):
                self._lent.append((ref(owner), thing))
                return thing
        return None

    def lend(self, thing: T, owner: object) -> T:
        """Lend a thing that was made for an owner; the thing."""
        if len(self._lent) < self._most(thing):
            self._lent.append((ref(owner), thing))
        return thing


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
