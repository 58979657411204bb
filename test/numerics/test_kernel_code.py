"""Machine code of kernels does what Python does, bit by bit, or is refused."""

from __future__ import annotations

import _ctypes
import ctypes
import math
import shutil
import subprocess
import sys
from types import FunctionType
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
import pytest

from mechanism_sim.numerics import machine_code
from mechanism_sim.numerics.kernel_code import call_code
from mechanism_sim.numerics.kernels import _function_of, foreign_code, kernel
from mechanism_sim.tolerances import TOLERANCES


class Pair(NamedTuple):
    """Something with names."""

    x: Any
    count: int


def compiled(function, *args):
    """Result of the machine code of a function."""
    types = machine_code.types_of(args)
    assert isinstance(function, FunctionType)
    return machine_code.code_of(function, types, _function_of, None).bind(*args)()


def numbers(a, b, i, k):
    most, least = max(a, b, 0.5), min(a, i)
    square = (a - b) ** 2 + math.sqrt(abs(a)) - -b
    whole = i // k * 100 + i % k * 10 + (1 << 3)
    rest = a % b
    between = -3 < i <= 7 and not (a == b or i != k)
    chosen = a if i > k else k
    return most, least, square, whole, rest, between, chosen, float(i), int(a), bool(k), abs(i)


@pytest.mark.parametrize('i', [-7, 3, 7])
@pytest.mark.parametrize('k', [-3, 3])
@pytest.mark.parametrize(('a', 'b'), [(2.7, -1.3), (-0.1, 0.3), (1e-150, 1e150), (5.0, 2.5)])
def test_numbers(a, b, i, k):
    found, wanted = compiled(numbers, a, b, i, k), numbers(a, b, i, k)
    assert [float(x).hex() for x in found] == [float(x).hex() for x in wanted]
    assert [type(x) for x in found[5:]] == [bool, float, float, int, bool, int]


def loops(x):
    found, last = 0.0, -1
    for i in range(len(x) - 1, -1, -1):
        if x[i] < 0.0:
            continue
        if i == 1:
            break
        found += x[i]
        last = i
    for value in x:
        found = found * 0.5 + value
    for scale in (2.0, 3):
        found *= scale
    for weakest in TOLERANCES.complementarity.weakest:
        found += weakest
    return found, last, i


def test_loops():
    x = np.array([0.1, 0.7, -0.3, 0.2, 0.9])
    assert compiled(loops, x) == loops(x)


@kernel
def widened(rows, by):
    """Called by `arrays`; returns an array, whose memory outlives it."""
    wide = np.zeros((rows.shape[0], rows.shape[1] + by))
    for i in range(len(rows)):
        wide[i, : rows.shape[1]] = rows[i]
    return wide


def arrays(table, marks, places, pair):
    wide = widened(table, 1)
    wide[1:, :2] = 7.0
    wide[0] = wide[1]
    part = wide[:, :2].copy()
    part[0, 1], part[1, 0] = part[1, 0], part[0, 1] + 0.5
    both = np.concatenate((part[0], pair.x[1:]))
    order, ones = np.arange(3), np.ones(2, dtype=np.int64)
    order[ones[0]] += 5
    marks[:] = False
    marks[1] = places[0] == 4
    changed = (places != order).any()
    flat = both[: 2 * pair.count].reshape((2, pair.count))
    pair.x[0] -= places.max()
    return wide, part, both, order, changed, marks.any(), Pair(flat, len(both))


def flattened(result):
    return [*result[:-1], *result[-1]]


def test_arrays():
    def given():
        x = np.array([0.5, 1.5, 2.5, 3.5])
        table = np.arange(6.0).reshape(3, 2) / 7.0
        return table, np.ones(3, dtype=bool), np.array([4, 1, 2]), Pair(x, 2)

    one, other = given(), given()
    for x, y in zip(flattened(compiled(arrays, *one)), flattened(arrays(*other)), strict=True):
        np.testing.assert_array_equal(x, y)
        assert np.asarray(x).dtype == np.asarray(y).dtype
    np.testing.assert_array_equal(one[1], other[1])  # changed in place
    np.testing.assert_array_equal(one[3].x, other[3].x)


def short(x, i):
    return i < len(x) and x[i] > 0.0 or i == 9  # fmt: skip  # noqa: RUF021


def test_a_condition_ends_as_soon_as_it_is_known():
    x = np.array([1.0, -1.0])
    assert [compiled(short, x, i) for i in (0, 1, 2, 9)] == [True, False, False, True]


def another_kind():
    x = 0
    if x == 0:
        x = 0.5
    return x


def another_result(a):
    if a > 0.0:
        return 1.0
    return 1


def columns(table):
    return table[:, 0].copy()


def cube(a):
    return a**3


@pytest.mark.parametrize(('function', 'args'), [
    (another_kind, ()), (another_result, (1.0,)), (columns, (np.eye(2),)), (cube, (2.0,)),
])  # fmt: skip
def test_what_is_not_known_is_refused(function, args):
    with pytest.raises(TypeError):
        compiled(function, *args)


def test_arrays_of_other_kinds_are_refused():
    for x in (np.eye(2).T[:1].T, np.zeros(2, dtype=np.int32), np.zeros(2, dtype=np.float32)):
        with pytest.raises(TypeError):
            machine_code.types_of((x,))


def called(address, out, given):
    call_code(address, out, given, given, given)
    return out[0] + out[1]


def test_code_of_heyoka_is_called_by_its_address():
    x, y = hy.make_vars('x', 'y')
    function = hy.cfunc([hy.sin(x) * y, hy.atan2(x, y)], vars=[x, y])
    code, given = function.llvm_states[0].object_code, np.array([0.3, -0.7])
    found = foreign_code(code, 'cfunc')
    assert found is not None
    wanted = function(given)
    for call in (called, lambda *args: compiled(called, *args)):
        out = np.zeros(2)
        assert call(found.addresses[0], out, given) == wanted.sum()
        np.testing.assert_array_equal(out, wanted)


def test_code_that_cannot_be_called_is_not():
    """Where a symbol is missing, or it is no code for this machine."""
    head, f = 'declare void @nobody_has_this()\n', 'define void @f() {{\n {}\n ret void\n}}'
    code = machine_code._object(head + f.format('call void @nobody_has_this()'))
    assert machine_code.foreign(code, 'libheyoka', 'f') is None
    whole = machine_code._object(f.format(''))
    assert machine_code.foreign(whole, 'libheyoka', 'f') is not None
    assert machine_code.foreign(whole, 'no library has this name', 'f') is None
    assert machine_code.foreign(b'MZ' + whole[2:], 'libheyoka', 'f') is None


FAR_APART = """
import ctypes
import heyoka as hy
from mechanism_sim.numerics.kernels import foreign_code
x = hy.make_vars('x')
first, second = (
    hy.cfunc([hy.sin(k * x)], vars=[x]).llvm_states[0].object_code for k in (1.25, 1.5)
)
assert foreign_code(first, 'cfunc')
libc, size_t = ctypes.CDLL(None), ctypes.c_size_t
libc.mmap.restype = size_t
libc.mmap.argtypes = [size_t, size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]
libc.munmap.argtypes = [size_t, size_t]
GIB, ANONYMOUS = 1 << 30, 0x4022  # private, and nothing is set aside for it
FAILED = size_t(-1).value
every = libc.mmap(0, 40 * GIB, 0, ANONYMOUS, -1, 0)
assert every != FAILED, 'no address space of 40 GiB'
for k in (26, 22, 18, 15, 12):  # what is free above goes first
    while FAILED > (at := libc.mmap(0, 1 << k, 0, ANONYMOUS, -1, 0)) > every:
        pass
    libc.munmap(at, 1 << k)
for k in range(1, 13):
    libc.munmap(every + (40 - 3 * k) * GIB, 4096)
print(bool(foreign_code(second, 'cfunc')))
"""


@pytest.mark.skipif(sys.platform != 'linux', reason='numbers of Linux')
def test_code_and_its_constants_are_side_by_side():
    """Where the only rooms are gigabytes from each other, as may be in a large process."""
    done = subprocess.run(
        [sys.executable, '-c', FAR_APART], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.returncode) == ('True\n', 0), done.stderr


LET_GO = """
import gc
from mechanism_sim.numerics import machine_code
gc.freeze()  # what was imported is not looked through again
body = 'define i64 @f() {{\\n %x = add i64 {}, 1\\n ret i64 %x\\n}}'
for k in range(200):
    code = machine_code._object(body.format(k))
    assert machine_code.foreign(code, 'libc', 'f') is not None
    machine_code.foreign.cache_clear()
    gc.collect()
print('still here')
"""


@pytest.mark.slow
def test_code_that_is_let_go_takes_nothing_with_it():
    """In a process of its own, which would end where LLVM frees what another has."""
    done = subprocess.run(
        [sys.executable, '-c', LET_GO], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, 'still here\n'), done.stderr


def test_a_library_may_lie_in_a_folder_with_blanks_in_its_name(tmp_path):
    folder = tmp_path / 'a folder of Möbius'
    folder.mkdir()
    copy = folder / 'libcopied.so'
    shutil.copy(_ctypes.__file__, copy)
    held = ctypes.CDLL(str(copy))
    code = machine_code._object('define void @f() {\n ret void\n}')
    assert machine_code.foreign(code, 'libcopied', 'f') is not None
    assert held is not None
