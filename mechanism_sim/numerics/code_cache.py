"""Compiled code on disk, for the next process: in a folder of our own, and not much of it.

heyoka verifies the whole of its cache whenever a process opens it, at 0.35 s of CPU time a GB, and
lets the folder that all its programs share grow to 20 GB.
"""

from __future__ import annotations

import os
from functools import cache

from heyoka import llvm_state

FOLDER = 'mechanism_sim'

LIMIT = 128 * 2**20
"""[B] Some dozens of scenes; verified in 40 ms. What was used last is kept."""


@cache
def bound_cache() -> None:
    """Take `FOLDER`, beside that of heyoka, and bound its size to `LIMIT`.

    Once in a process, before the first compilation. Whoever sets ``HEYOKA_CACHE_DIR`` has chosen
    folder and size already. Without a folder to write in, nothing is kept.
    """
    if os.environ.get('HEYOKA_CACHE_DIR'):
        return
    folder = llvm_state.get_diskcache_path().parent / FOLDER
    try:
        if not folder.is_absolute():
            raise RuntimeError('there is no home')
        llvm_state.set_diskcache_path(folder)
        if llvm_state.get_diskcache_limit() != LIMIT:
            llvm_state.set_diskcache_limit(LIMIT)
    except RuntimeError:
        llvm_state.set_diskcache_enabled(False)
