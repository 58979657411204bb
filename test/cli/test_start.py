"""Cost of starting, which every command and node of a machine pays."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import heyoka as hy
import pytest

from mechanism_sim.numerics.compiled import function

FIRST_STEPS = """
import heyoka as hy
from heyoka import llvm_state
from mechanism_sim.numerics.code_cache import LIMIT
from mechanism_sim.numerics.compiled import function

x = hy.expression('x')
assert function([x * x], [x])([3.0])[0] == 9.0
if llvm_state.get_diskcache_enabled():
    print(llvm_state.get_diskcache_path(), llvm_state.get_diskcache_limit() == LIMIT)
else:
    print('nothing is kept')
"""

IMPORTS = """
import sys

heavy = {'llvmlite', 'matplotlib', 'pint', 'pyarrow', 'scipy.integrate', 'scipy.interpolate',
         'scipy.linalg', 'scipy.optimize', 'scipy.signal', 'scipy.spatial', 'scipy.special',
         'scipy.stats'}
import mechanism_sim.cli.entry
assert not {'heyoka', 'numpy', 'pydantic', 'yaml', *heavy} & set(sys.modules)
import mechanism_sim.analysis.summary, mechanism_sim.nodes.run, mechanism_sim.studies.statistics
print(*heavy & set(sys.modules))
"""

RUN = """
import sys
import mechanism_sim as ms
ms.simulate(ms.load_scene('four_bar_clearance'), revolutions=0.1)
assert not {'dask', 'pint', 'sympy'} & set(sys.modules)

import heyoka as hy, sympy
x, t = hy.expression('x'), hy.time
found = hy.to_sympy(hy.sin(x) * x**3.0 / 4.0 + hy.kepE(x, t))
x, t = sympy.Symbol('x', real=True), sympy.Function('heyoka_time')()
print(sympy.simplify(found - (sympy.sin(x) * x**3 / 4 + sympy.Function('heyoka_kepE')(x, t))))
"""


def test_nothing_heavy_is_imported_before_it_is_needed() -> None:
    done = subprocess.run(
        [sys.executable, '-c', IMPORTS], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, '\n', '')


@pytest.mark.slow
def test_a_run_imports_no_sympy_which_translates_all_the_same() -> None:
    done = subprocess.run([sys.executable, '-c', RUN], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, '0\n', '')


def test_expressions_too_large_to_be_compared_are_compiled_once() -> None:
    def chain(factor: float) -> hy.expression:
        found = hy.expression('x')
        for _ in range(60):  # as a tree it has more parts than can be counted
            found = hy.sin(found) - factor * found * found
        return found

    x = hy.expression('x')
    given = [[chain(0.3), x], [x, chain(0.3)], [chain(0.4), x], [chain(0.3), 0.0 * x, x]]
    functions = [function(terms, [x]) for terms in given]
    assert all(function(terms, [x]) is f for terms, f in zip(given, functions, strict=True))
    assert len({id(f) for f in functions}) == 4
    wanted = 0.7
    for _ in range(60):
        wanted = math.sin(wanted) - 0.3 * wanted * wanted
    assert functions[0]([0.7]) == pytest.approx([wanted, 0.7], rel=1e-12)
    assert functions[1]([0.7]) == pytest.approx([0.7, wanted], rel=1e-12)


def first_steps(**environment: str) -> str:
    """Output of a process that compiles something."""
    env = {k: v for k, v in os.environ.items() if k != 'HEYOKA_CACHE_DIR'} | environment
    done = subprocess.run(
        [sys.executable, '-c', FIRST_STEPS], env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout.strip()


def test_compiled_code_is_kept_in_a_small_folder_of_our_own(tmp_path: Path) -> None:
    assert first_steps(XDG_CACHE_HOME=str(tmp_path)) == f'{tmp_path / "mechanism_sim"} True'
    assert [path.name for path in tmp_path.iterdir()] == ['mechanism_sim']


@pytest.mark.slow
def test_a_folder_that_the_user_chose_is_taken_as_it_is(tmp_path: Path) -> None:
    assert first_steps(HEYOKA_CACHE_DIR=str(tmp_path)) == f'{tmp_path} False'


@pytest.mark.slow
def test_without_a_folder_to_write_in_nothing_is_kept(tmp_path: Path) -> None:
    (tmp_path / 'mechanism_sim').write_text('a file where the folder would be')
    assert first_steps(XDG_CACHE_HOME=str(tmp_path)) == 'nothing is kept'
