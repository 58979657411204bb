"""Functions on arrays that are compiled where it pays.

They are Python of the part that `kernel_code` knows: numba knows far more, but takes twenty times
as long, for it optimises what is called anew in every caller. As they are, kernels cost nothing to
load; LLVM takes some tenths of a second, so it is only asked when a run has called for them often.
Both ways give the same bits: there is nothing in them that a compiler may reorder. So whatever
fails of LLVM, while it is imported, compiles or reads what is kept, a run goes on by the functions
as they are.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, partial, update_wrapper
from pathlib import Path
from time import perf_counter
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar, cast

from mechanism_sim import packages, tolerances
from mechanism_sim.numerics import code_cache

if TYPE_CHECKING:
    from mechanism_sim.numerics.machine_code import Foreign

F = TypeVar('F', bound=Callable[..., Any])

_KERNELS: list[Kernel] = []
_spent = 0.0  # [s] by kernels as they are

LOADING, COMPILING = 0.1, 1.0
"""[s] What it takes to import LLVM and load the code of an event; a part of what it takes to make
it, for that is done once on a machine."""
ALONE = 0.05
"""[s] What it takes to load, or twice to make, the code of one kernel that calls no others."""

_INSTEAD = (
    'the run continues without it, with the same results, but slower with many contacts or '
    'filtered sensors'
)


class Kernel:
    """A function that can be compiled, with the kernels that it calls.

    Parameters
    ----------
    is_entry : True if Python calls it compiled, too; others return views of their arguments, or
        do too little
    """

    def __init__(self, function: FunctionType, is_entry: bool) -> None:
        update_wrapper(self, function)
        self.function, self.is_entry = function, is_entry
        self.run: Callable[..., Any] = function
        self.codes: dict[Any, Any] = {}
        self.spent = 0.0  # [s] as it is, if it is compiled by itself
        _KERNELS.append(self)

    def __call__(self, *args: Any) -> Any:
        """Call it, compiled or as it is."""
        return self.run(*args)

    @property
    def is_compiled(self) -> bool:
        """True if it runs as machine code by now."""
        return self.run is not self.function

    @property
    def calls_others(self) -> bool:
        """True if there are kernels in its code, as in that of events."""
        known, names = self.function.__globals__, self.function.__code__.co_names
        return any(isinstance(known.get(name), Kernel) for name in names)

    def bind(self, *args: Any) -> Callable[[], Any]:
        """A call with some arrays, which stay where they are, as `run` is now."""
        if self.is_compiled:
            try:
                return self._bound(args)
            except Exception as error:
                _leave_compiled(error)
        return partial(self.function, *args)

    def compile(self) -> None:
        """Let Python call its code from now on, which is made for what it is called with."""
        if self.is_entry:
            self.run = lambda *args: self.bind(*args)()

    def charge(self, seconds: float) -> None:
        """Add its cost as Python code; once that of its machine code is reached, it is compiled.

        That of events takes twenty times as long.
        """
        self.spent += seconds
        if self.spent >= ALONE and not self.is_compiled:
            compile_kernels([self])

    def _bound(self, args: tuple[Any, ...]) -> Callable[[], Any]:
        from mechanism_sim.numerics import machine_code  # noqa: PLC0415 - few runs need it

        types = machine_code.types_of(args)
        if types not in self.codes:
            folder = _folder() if _is_kept() else None
            self.codes[types] = machine_code.code_of(self.function, types, _function_of, folder)
        bound: Callable[[], Any] = self.codes[types].bind(*args)
        return bound


class BoundCall:
    """Calls of an entry with some arrays, which stay where they are, as it is or compiled.

    Parameters
    ----------
    known : arguments of the calls
    """

    def __init__(self, kernel: Kernel, *known: Any) -> None:
        self._kernel, self._known = kernel, known
        self._way: object = None
        self._call: Callable[[], int]

    def __call__(self) -> int:
        """Call it; as it is, that counts for what LLVM costs."""
        kernel = self._kernel
        if self._way is not kernel.run:
            self._way, self._call = kernel.run, kernel.bind(*self._known)
        if kernel.is_compiled:
            return self._call()
        began = perf_counter()
        found = self._call()
        charge(perf_counter() - began)
        return found


def _function_of(known: Any) -> FunctionType | None:
    return known.function if isinstance(known, Kernel) else None


def kernel(function: F) -> F:
    """Mark a function as one that can be compiled."""
    return cast(F, Kernel(cast(FunctionType, function), is_entry=False))


def entry(function: Callable[..., Any]) -> Kernel:
    """Mark a function as one that Python calls compiled."""
    return Kernel(cast(FunctionType, function), is_entry=True)


def charge(seconds: float) -> None:
    """Add the cost of kernels as Python code; once that of LLVM is reached, all are compiled."""
    global _spent  # noqa: PLW0603 - of this process
    _spent += seconds
    if _spent >= _price():
        compile_kernels()
        _spent = -math.inf


@cache
def _price() -> float:
    folder = _folder()
    kept = {file.name.partition('-')[0] for file in folder.glob('*.o')} if folder else set()
    made = any(k.calls_others and k.function.__name__ in kept for k in _KERNELS)
    return LOADING if made else COMPILING


@cache
def _folder() -> Path | None:
    """Folder of the kernels' code, named by a hash of all sources and of constants in it."""
    parent = code_cache.folder()
    if parent is None:
        return None
    own = (Path(__file__).with_name(f'{name}.py') for name in ('kernel_code', 'machine_code'))
    sources = (Path(k.function.__code__.co_filename) for k in _KERNELS)
    files = sorted({Path(tolerances.__file__), *own, *sources})
    source = hashlib.sha256(b''.join(file.read_bytes() for file in files)).hexdigest()
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


def compile_kernels(some: Sequence[Kernel] = _KERNELS) -> None:
    """Let kernels run as machine code from now on, if LLVM is there and can."""
    if packages.spared('llvmlite', _INSTEAD):
        for k in some:
            k.compile()
    else:
        _give_up()


def _leave_compiled(error: Exception) -> None:
    """Let all kernels run as they are, for this process: LLVM failed."""
    packages.without('llvmlite', error, _INSTEAD)
    _give_up()


def _give_up() -> None:
    for k in _KERNELS:
        k.run, k.spent = k.function, -math.inf


def foreign_code(code: bytes | tuple[bytes, ...], *names: str) -> Foreign | None:
    """Functions that heyoka compiled, for kernels to call; None where they cannot be had."""
    try:
        from mechanism_sim.numerics.machine_code import foreign  # noqa: PLC0415 - few runs need it

        return foreign(code, 'libheyoka', *names)
    except Exception as error:
        _leave_compiled(error)
        return None
