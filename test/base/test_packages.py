"""Packages of Python that fail when imported or used: the run goes on, or one sentence."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from running import TIMEOUT

from mechanism_sim import packages
from mechanism_sim.errors import InputError

EAGER = """
import sys
from mechanism_sim.numerics import kernels
kernels.LOADING = kernels.COMPILING = 0.0
from mechanism_sim.cli import main
main(sys.argv[1:])
"""
"""A run whose first impact asks for LLVM."""

BROKEN = {
    'attribute': "raise AttributeError('no such processor')",
    'system': "raise SystemError('initialisation failed')",
    'file': "raise OSError(28, 'No space left on device')",
    'version': "raise ImportError('llvmlite needs Python 3.10 or less')",
    'hollow': '',
    'compiles-nothing': (
        'import sys, types\n'
        'binding = sys.modules["llvmlite.binding"] = types.ModuleType("binding")\n'
        'def fail(): raise RuntimeError("LLVM ERROR:\\nno such target")\n'
        'binding.initialize_native_target = fail\n'
    ),
}


def ran(folder, *args, code=EAGER):
    """A program that finds the packages of a folder first."""
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get('PYTHONPATH')])])
    return subprocess.run(
        [sys.executable, '-c', code, *args], env={**os.environ, 'PYTHONPATH': path},
        capture_output=True, text=True, timeout=TIMEOUT, check=False,
    )  # fmt: skip


def fake(folder, module, text):
    (folder / module).mkdir()
    (folder / module / '__init__.py').write_text(text)


@pytest.fixture(scope='module')
def usual(tmp_path_factory):
    done = ran(tmp_path_factory.mktemp('empty'), *RUN, code=EAGER.replace('0.0', '1e9'))
    assert done.stderr == ''
    return json.loads(done.stdout)


RUN = 'solve', 'toggle_press', '--duration', '0.26', '--json'
EXACT = 'final', 'impacts', 'modes', 'energy', 'steps'


@pytest.mark.slow
@pytest.mark.parametrize('case', BROKEN)
def test_a_kernel_that_cannot_be_compiled_is_run_as_it_is(case, usual, tmp_path):
    """Whatever LLVM raises, the result is that of the run without it, and one line says so."""
    fake(tmp_path, 'llvmlite', BROKEN[case])
    done = ran(tmp_path, *RUN)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {k: found[k] for k in EXACT} == {k: usual[k] for k in EXACT}
    (line,) = done.stderr.splitlines()
    assert line.startswith("mechanism-sim: the Python package 'llvmlite' cannot be used (")
    assert line.endswith('the same results, but slower with many contacts or filtered sensors')


@pytest.mark.parametrize(
    ('module', 'args'),
    [
        ('matplotlib', ('plot', 'four_bar_nominal', 'position.rocker', '-o', 'out.png')),
        ('sympy', ('check', 'four_bar_nominal', '--equations')),
        pytest.param(
            'pyarrow', ('cycle', 'four_bar_nominal', '-o', 'out.parquet'), marks=pytest.mark.slow
        ),
        pytest.param(
            'openpyxl', ('cycle', 'four_bar_nominal', '-o', 'out.xlsx'), marks=pytest.mark.slow
        ),
        pytest.param(
            'plotly', ('report', 'four_bar_nominal', '-o', 'out.html'), marks=pytest.mark.slow
        ),
    ],
)
def test_a_package_that_fails_is_named_in_a_sentence(module, args, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fake(tmp_path, module, "raise AttributeError('something else is too old')")
    done = ran(tmp_path, *args, code='from mechanism_sim.__main__ import main; main()')
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert f"the Python package '{module}' is installed, but cannot be used (" in line
    assert 'AttributeError: something else is too old' in line


def test_what_is_not_installed_is_not_said_to_be_broken(monkeypatch):
    monkeypatch.setitem(sys.modules, 'ezdxf', None)
    said = r"drawings need the Python package 'ezdxf': .* 'mechanism_sim\[dxf\]'"
    with pytest.raises(InputError, match=said):
        packages.needed('ezdxf', 'drawings')
    assert packages.spared('ezdxf', 'the drawing is not updated') is None


def test_an_error_that_is_no_packages_stays_what_it_is():
    with pytest.raises(ValueError, match='property name') as error:
        json.loads('{')
    assert packages.refusal(error.value) is None
