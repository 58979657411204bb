"""Functions on arrays that are compiled where it pays.

They are Python of the part that numba compiles. As they are, they cost nothing to load; numba
takes some tenths of a second, so it is only asked when a run has called for them often. Both ways
give the same bits: there is nothing in them that a compiler may reorder. So whatever fails of
numba, while it is imported, compiles or reads what is kept, a run goes on by the functions as they
are.
"""

from __future__ import annotations

import hashlib
import math
import pickle
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

from mechanism_sim import packages, tolerances
from mechanism_sim.numerics import code_cache

F = TypeVar('F', bound=Callable[..., Any])

_KERNELS: list[Kernel] = []
_spent = 0.0  # [s] by kernels as they are

LOADING, COMPILING = 0.4, 6.0
"""[s] What it takes to import numba and load the code of all kernels; a part of what it takes to
make it, for that is done once on a machine."""


_INSTEAD = 'the run continues without it, with the same results, but slower with many contacts'


class Kernel:
    """A function that can be compiled, and kernels that it calls with it."""

    def __init__(self, function: FunctionType) -> None:
        update_wrapper(self, function)
        self.function = self.run = function
        _KERNELS.append(self)

    def __call__(self, *args: Any) -> Any:
        """Call it, compiled or as it is."""
        try:
            return self.run(*args)
        except Exception as error:
            # numba compiles, or reads what is kept, in the first call with arguments of a kind;
            # machine code, which may have changed its arguments, has no frame of Python
            trace = error.__traceback__
            if self.run is self.function or trace is None or trace.tb_next is None:
                raise
            _leave_compiled(error)
        return self.function(*args)

    @cached_property
    def compiled(self) -> Any:
        """Its machine code, by numba."""
        f = self.function
        known = dict(f.__globals__)
        for name in f.__code__.co_names:
            if isinstance(known.get(name), Kernel):
                known[name] = known[name].compiled
        copy = FunctionType(f.__code__, known, f.__name__, f.__defaults__)
        copy.__qualname__, copy.__module__ = f.__qualname__, f.__module__
        made = import_module('numba').njit(cache=_is_kept(), error_model='numpy')(copy)
        return _sealed(made) if _is_kept() else made


def _sealed(made: Any) -> Any:
    """Let what numba keeps of a function carry its digest, and be made anew where that is wrong.

    What numba reads is machine code: damaged, it ends the process, or computes something else.
    """
    base = import_module('numba.core.caching').IndexDataCacheFile

    class Sealed(base):  # type: ignore[misc, valid-type]
        """Files whose first bytes are the digest of all others."""

        def _load_index(self) -> Any:
            try:
                version, stamp, overloads = pickle.loads(_opened(self._index_path))  # noqa: S301
            except Exception:  # there is none, or it is damaged, or of an earlier version of ours
                return {}
            return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

        def _save_index(self, overloads: Any) -> None:
            data = self._version, self._source_stamp, overloads
            self._keep(self._index_path, self._dump(data))

        def _load_data(self, name: str) -> Any:
            return pickle.loads(_opened(self._data_path(name)))  # noqa: S301 - nobody else's

        def _save_data(self, name: str, data: Any) -> None:
            self._keep(self._data_path(name), self._dump(data))

        def _keep(self, path: str, data: bytes) -> None:
            with suppress(OSError), self._open_for_write(path) as file:  # a disk may be full
                file.write(hashlib.sha256(data).digest() + data)

    kept = made._cache._cache_file
    made._cache._cache_file = Sealed(
        kept._cache_path, kept._index_name.removesuffix('.nbi'), kept._source_stamp
    )
    return made


def _opened(path: str) -> bytes:
    """Content of a file, behind its digest."""
    sealed = Path(path).read_bytes()
    size = hashlib.sha256().digest_size
    if hashlib.sha256(sealed[size:]).digest() != sealed[:size]:
        raise OSError(f'{path} is damaged')
    return sealed[size:]


def kernel(function: F) -> F:
    """Mark a function as one that can be compiled."""
    return cast(F, Kernel(cast(FunctionType, function)))


def charge(seconds: float) -> None:
    """Tell what kernels have cost so far as they are: once it is what numba costs, it is asked."""
    global _spent  # noqa: PLW0603 - of this process
    _spent += seconds
    if _spent >= _price():
        compile_kernels()
        _spent = -math.inf


@cache
def _price() -> float:
    folder = _folder()
    return LOADING if folder and any(folder.glob('*/*.nbi')) else COMPILING


@cache
def _folder() -> Path | None:
    """Where the code is kept: named by all sources, for numba does not see callees change.

    Nor constants of other modules, which it compiles in.
    """
    parent = code_cache.folder()
    if parent is None:
        return None
    files = sorted({tolerances.__file__, *(k.function.__code__.co_filename for k in _KERNELS)})
    source = hashlib.sha256(b''.join(Path(file).read_bytes() for file in files)).hexdigest()
    return parent / f'kernels-{source[:16]}'


@cache
def _is_kept() -> bool:
    """True if the code can be kept on disk."""
    folder = _folder()
    if folder is None:
        return False
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
    return code_cache.has_room(folder) and code_cache.belongs_to_nobody_else(folder)


def compile_kernels() -> None:
    """Let all kernels run as machine code from now on, if numba is there and can."""
    numba = packages.spared('numba', _INSTEAD)
    if numba is None:
        return
    try:
        config = numba.config
        before, config.CACHE_DIR = config.CACHE_DIR, str(_folder() or '')
        try:
            made = [k.compiled for k in _KERNELS]
        finally:
            config.CACHE_DIR = before
    except Exception as error:
        _leave_compiled(error)
        return
    for k, run in zip(_KERNELS, made, strict=True):
        k.run = run


def _leave_compiled(error: Exception) -> None:
    """Let all kernels run as they are, for this process: numba failed."""
    packages.without('numba', error, _INSTEAD)
    for k in _KERNELS:
        k.run = k.function
