"""Machine code of kernels: made by LLVM, kept on disk, called with arrays of NumPy."""

from __future__ import annotations

import ctypes
import hashlib
import math
import pickle
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, lru_cache, partial
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics import kernel_code

_KINDS = {'f': np.dtype(np.float64), 'i': np.dtype(np.int64), 'b': np.dtype(np.bool_)}
_PYTHON = {'f': float, 'i': int, 'b': bool}
_ENTER = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)  # nobody else may run meanwhile
_held: list[Any] = []  # the code


class Code(NamedTuple):
    """Machine code of a function for arguments of some types."""

    enter: Callable[[int, int], None]
    release: Callable[[], None]
    result: Any  #: type of the result

    def bind(self, *args: Any) -> Callable[[], Any]:
        """A call of it with some arrays, which stay where they are, and numbers."""
        leaves: list[int] = []
        _add_leaves(leaves, args)
        words = np.array(leaves, dtype=np.int64)
        found = np.zeros(1 + len(kernel_code.kinds(self.result)), dtype=np.int64)
        enter = partial(self.enter, words.ctypes.data, found.ctypes.data)
        if self.result == 'i':
            return partial(_entered, enter, cast(Any, found).data, (args, words))
        return partial(_answered, enter, self, found, (args, words))


def _entered(enter: Callable[[], None], found: memoryview, _: object) -> int:
    """Returned number of a call; the memory of its arguments is kept alive."""
    enter()
    number: int = found[0]
    return number


def _answered(enter: Callable[[], None], code: Code, found: NDArray[np.int64], _: object) -> Any:
    enter()
    result = _result(code.result, iter(found))
    code.release()
    return result


def types_of(args: tuple[Any, ...]) -> tuple[Any, ...]:
    """Types of arguments, see `kernel_code.type_of`."""
    return tuple(map(_type_of, args))


def _type_of(x: Any) -> Any:
    if isinstance(x, np.ndarray):
        if not (x.flags.c_contiguous and _KINDS[x.dtype.kind] == x.dtype):
            raise TypeError('arrays of kernels are contiguous, of numbers of 8 bytes or booleans')
        return x.dtype.kind, x.ndim
    if isinstance(x, tuple):
        return (type(x) if hasattr(x, '_fields') else None), types_of(x)
    return 'b' if isinstance(x, bool | np.bool_) else 'f' if isinstance(x, float) else 'i'


def _add_leaves(words: list[int], args: tuple[Any, ...]) -> None:
    """Add the words by which arguments are passed."""
    for x in args:
        if isinstance(x, np.ndarray):
            words.append(_address(x))
            words += x.shape
            words += x.shape[1:]  # the distance of rows
        elif isinstance(x, tuple):
            _add_leaves(words, x)
        else:
            words.append(int(np.float64(x).view(np.int64)) if isinstance(x, float) else int(x))


def _address(x: NDArray[Any]) -> int:
    try:  # seven times as fast
        return ctypes.addressof(ctypes.c_char.from_buffer(cast(Any, x)))
    except (TypeError, ValueError):  # it is only to be read, or empty
        return int(x.ctypes.data)


def _result(known: Any, words: Iterator[np.int64]) -> Any:
    """A result of some type; arrays are copied."""
    if known is None:
        return None
    if isinstance(known, str):
        word = next(words)
        return _PYTHON[known](word.view(np.float64) if known == 'f' else word)
    first, second = known
    if not isinstance(first, str):
        items = [_result(item, words) for item in second]
        return first(*items) if first else tuple(items)
    at = int(next(words))
    shape = [int(next(words)) for _ in range(second)]
    if second > 1 and int(next(words)) != shape[1]:
        raise TypeError('arrays that kernels return are contiguous')
    kind = _KINDS[first]
    content = ctypes.string_at(at, math.prod(shape) * kind.itemsize)
    return np.frombuffer(content, kind).reshape(shape).copy()


def code_of(
    function: Any, types: tuple[Any, ...], function_of: Callable[[Any], Any], folder: Path | None
) -> Code:
    """Code of a function, made if a folder has none.

    Parameters
    ----------
    function_of : function that returns that of a kernel, None for other objects
    folder : folder of the code of one state of all sources
    """
    host = (repr(types), _llvm().get_default_triple(), *_host())
    name = hashlib.sha256(repr(host).encode()).hexdigest()[:16]
    file = folder / f'{function.__name__}-{name}.o' if folder else None
    with suppress(Exception):  # there is none, or it is damaged
        return _loaded(_opened(file)) if file else _loaded(b'')
    text, result = kernel_code.Module(function_of).entry(function, types)
    content = pickle.dumps((result, _object(text)))
    if file:
        with suppress(OSError):  # a disk may be full
            file.write_bytes(hashlib.sha256(content).digest() + content)
    return _loaded(content)


def _opened(file: Path) -> bytes:
    """Content of a file behind its digest: damaged code ends the process, or is wrong."""
    sealed = file.read_bytes()
    size = hashlib.sha256().digest_size
    if hashlib.sha256(sealed[size:]).digest() != sealed[:size]:
        raise OSError(f'{file} is damaged')
    return sealed[size:]


@cache
def _llvm() -> Any:
    llvm = import_module('llvmlite.binding')
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def _processor() -> Any:
    """The processor as LLVM knows it."""
    target = _llvm().Target.from_default_triple()
    name, features = _host()[1:]
    return target.create_target_machine(cpu=name, features=features, opt=2, jit=True)


@cache
def _host() -> tuple[str, str, str]:
    """Version of LLVM, name and features of the processor: code is for these only."""
    llvm = import_module('llvmlite.binding')
    features = llvm.get_host_cpu_features().flatten()
    return import_module('llvmlite').__version__, llvm.get_host_cpu_name(), features


class Foreign(NamedTuple):
    """Machine code from an object file of another compiler."""

    addresses: tuple[int, ...]  #: addresses of its functions
    linked: Any  #: object that keeps the code in memory


@lru_cache(maxsize=64)
def foreign(code: bytes | tuple[bytes, ...], library: str, *names: str) -> Foreign | None:
    """Functions of object files by their names; None where something is not found.

    Parameters
    ----------
    code : an object file, or several that call each other
    library : part of the name of a loaded library with further symbols
    """
    with suppress(OSError, StopIteration, RuntimeError):
        with open('/proc/self/maps', encoding='utf-8') as maps:  # the sixth field is a path
            path = next(x.split(maxsplit=5)[5].strip() for x in maps if library in x)
        _llvm().load_library_permanently(path)
        linked = _linked(code, *names)
        return Foreign(tuple(linked[name] for name in names), linked)
    return None


def _object(text: str) -> bytes:
    """Machine code of a module."""
    llvm, machine = _llvm(), _processor()
    module = llvm.parse_assembly(text)
    module.verify()
    tuning = llvm.create_pipeline_tuning_options(speed_level=2)
    # sums may not be reordered: there is nothing to gain
    tuning.loop_vectorization = tuning.slp_vectorization = tuning.loop_unrolling = False
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    code: bytes = machine.emit_object(module)
    return code


def _loaded(content: bytes) -> Code:
    """Code from its stored content: the type of the result and an object file."""
    result, code = pickle.loads(content)  # noqa: S301 - from a folder that is nobody else's
    linked = _linked(code, 'enter', 'release')
    _held.append(linked)
    release = ctypes.PYFUNCTYPE(None)(linked['release'])
    return Code(_ENTER(linked['enter']), release, result)


@cache
def _linker() -> Any:
    """JITLink: it puts code and constants side by side, and raises what goes wrong.

    RuntimeDyld maps each by itself. Where the address space has no room near by, their distance is
    beyond 32 bits, and it ends the process.
    """
    return _llvm().create_lljit_compiler(use_jit_link=True, suppress_errors=True)


_names = count()


def _linked(code: bytes | tuple[bytes, ...], *names: str) -> Any:
    """Addresses of functions of object files by their names; they live as long as it does."""
    builder = _llvm().JITLibraryBuilder().add_current_process()
    for file in (code,) if isinstance(code, bytes) else code:
        builder.add_object_img(file)
    for name in names:
        builder.export_symbol(name)
    return builder.link(_linker(), f'code{next(_names)}')
