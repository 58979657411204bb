"""Compiled code on disk, for the next process: in a folder of our own, and not much of it.

heyoka verifies the whole of its cache whenever a process opens it, at 0.35 s of CPU time a GB, and
lets the folder that all its programs share grow to 20 GB.

Code is only read from where nobody else can write; what is damaged is made anew, and where nothing
can be kept, nothing is.
"""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TypeVar

from heyoka import get_nthreads, llvm_state, set_nthreads

from mechanism_sim.terminal import print_notice

T = TypeVar('T')

FOLDER = 'mechanism_sim'

LIMIT = 128 * 2**20
"""Size limit [B]: some dozens of scenes, verified in 40 ms; the last used are kept."""

_THREADS = get_nthreads()
# heyoka evaluates large blocks in several threads: one that is woken for some microseconds of work
# then spins for a millisecond, a quarter of the CPU time of a call of `simulate`
set_nthreads(1)

_ROOM = 32 * 2**20  # [B] that a disk must have, or nothing new is kept
_ROOT = 0


@cache
def folder() -> Path | None:
    """Folder for compiled code of heyoka and kernels; None if none can be kept safely.

    ``HEYOKA_CACHE_DIR``, or `FOLDER` beside heyoka's own. A folder of ours that others may write
    to is emptied and closed to them: what is in it may be theirs.
    """
    chosen = os.environ.get('HEYOKA_CACHE_DIR')
    try:
        found = Path(chosen) if chosen else llvm_state.get_diskcache_path().parent / FOLDER
        if not found.is_absolute():  # there is no home
            return None
        found.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = found.resolve()
        known = found.stat()
        open_ = known.st_uid == os.geteuid() and _is_shared(known)
        if not chosen and found.name == FOLDER and open_:
            _remove_data_base(found)
            for kernels in found.glob('kernels-*'):
                shutil.rmtree(kernels, ignore_errors=True)
            found.chmod(0o700)
        if belongs_to_nobody_else(found):
            return found
    except (OSError, RuntimeError):
        return None
    print_notice(
        f"compiled code is not cached: others own '{found}' or a folder above it, or may write "
        'to it; choose a folder of your own by XDG_CACHE_HOME'
    )
    return None


def belongs_to_nobody_else(path: Path) -> bool:
    """True if only this user and the system can change what a folder holds, or put another there.

    Above it, folders in which all may write must be sticky, as /tmp is: there nobody can rename
    what is not his.
    """
    with suppress(OSError):
        known = [path.stat(), *(above.stat() for above in path.parents)]
        own = os.geteuid()
        return known[0].st_uid == own and all(
            found.st_uid in (own, _ROOT)
            and (not _is_shared(found) or (i > 0 and bool(found.st_mode & stat.S_ISVTX)))
            for i, found in enumerate(known)
        )
    return False


def _is_shared(found: os.stat_result) -> bool:
    """True if others may write; a group without other members does not count."""
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not _is_private(found.st_gid)


@cache
def _is_private(group: int) -> bool:
    """True if a group is that of this user alone, as most systems make one for each."""
    import grp  # noqa: PLC0415
    import pwd  # noqa: PLC0415

    try:
        name = pwd.getpwuid(os.geteuid()).pw_name
        found = grp.getgrgid(group)
    except KeyError:
        return False
    return found.gr_name == name and set(found.gr_mem) <= {name}


def has_room(path: Path) -> bool:
    """True if something new can be kept in a folder."""
    with suppress(OSError):
        return os.access(path, os.W_OK) and shutil.disk_usage(path).free > _ROOM
    return False


@cache
def bound_cache() -> None:
    """Let heyoka keep its code in `folder`, and bound the size to `LIMIT`.

    Once in a process, before the first compilation. Whoever sets ``HEYOKA_CACHE_DIR`` has chosen
    the size already. A cache that cannot be read is begun anew.

    What heyoka would keep in memory beside it, some 13 MiB of a large machine, `compiled.function`
    and `compiled.integrator` keep in fewer.
    """
    llvm_state.set_memcache_limit(0)
    found = folder()
    if found is None:
        llvm_state.set_diskcache_enabled(False)
        return
    for again in (False, True):
        try:
            llvm_state.set_diskcache_path(found)
            # which opens it, and verifies it
            before = llvm_state.get_diskcache_limit()
            if before != LIMIT and not os.environ.get('HEYOKA_CACHE_DIR'):
                llvm_state.set_diskcache_limit(LIMIT)
        except Exception:
            if not again and has_room(found):
                _remove_data_base(found)
                continue
            llvm_state.set_diskcache_enabled(False)
        return


def compiled(make: Callable[[], T]) -> T:
    """Compile with heyoka; without its cache, which is then begun anew, if that fails.

    heyoka checks the structure of its data base, and LLVM that of the code in it, when it is read.
    """
    bound_cache()
    set_nthreads(_THREADS)  # parts of one function side by side
    try:
        return make()
    except (RuntimeError, ValueError):
        found = folder()
        if found is None or not llvm_state.get_diskcache_enabled():
            raise
        llvm_state.set_diskcache_enabled(False)
        made = make()  # if it is no fault of the cache, that fails, too
        _remove_data_base(found)
        return made
    finally:
        set_nthreads(1)


def _remove_data_base(path: Path) -> None:
    for file in path.glob('cache.db*'):
        with suppress(OSError):
            file.unlink()
