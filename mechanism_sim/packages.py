"""Packages of Python that this one needs, some only for a command: what becomes of one that fails.

A package may be missing, and may fail in any way while it is imported: beside a version of another
that it does not know, on a processor without what it was built for, on a full disk. What is done
with llvmlite is done without it; where there is no other way, one sentence names the package.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import import_module
from types import ModuleType
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.terminal import print_notice

REQUIRED = (
    'argcomplete', 'heyoka', 'jinja2', 'llvmlite', 'mcap', 'numpy', 'pint', 'plotly', 'pydantic',
    'rich', 'rosbags', 'scipy', 'websockets', 'xxhash', 'yaml', 'zenoh', 'zstandard',
)  # fmt: skip
"""Modules by the names under which they are imported."""

EXTRAS = {
    'distributed': 'cluster', 'ezdxf': 'dxf', 'imageio_ffmpeg': 'video', 'matplotlib': 'plots',
    'nptdms': 'signals', 'openpyxl': 'tables', 'pyarrow': 'tables', 'pyuff': 'signals',
    'sympy': 'equations',
}  # fmt: skip
"""Modules of extras, which only some commands need."""

OTHERS = 'pandas', 'polars', 'rclpy'
"""Modules that a notebook may ask for, and that of ROS."""

_DISTRIBUTED_AS = {
    'distributed': 'dask[distributed]', 'imageio_ffmpeg': 'imageio-ffmpeg',
    'nptdms': 'npTDMS', 'yaml': 'PyYAML', 'zenoh': 'eclipse-zenoh',
}  # fmt: skip


def distribution(module: str) -> str:
    """Name by which pip knows the package of a module."""
    return _DISTRIBUTED_AS.get(module, module)


def needed(module: str, purpose: str = 'this') -> Any:
    """A module without which a purpose cannot be served."""
    try:
        return import_module(module)
    except Exception as error:
        raise _sentence(module, error, purpose) from error


def spared(module: str, instead: str) -> ModuleType | None:
    """A module that can be done without: None if it is missing, or cannot be imported.

    Parameters
    ----------
    instead : what is done without it, for the notice; of one that is not installed there is none
    """
    try:
        return import_module(module)
    except Exception as error:
        if not _is_missing(error, module):
            without(module, error, instead)
        return None


def without(module: str, error: Exception, instead: str) -> None:
    """Tell on standard error, in one line, why a package is not used, and what is done instead."""
    print_notice(f"the Python package '{module}' cannot be used ({reason(error)}): {instead}")


def refusal(error: BaseException) -> InputError | None:
    """The sentence for an error that comes from importing a package; None if it does not."""
    known = {*REQUIRED, *EXTRAS, *OTHERS}
    if isinstance(error, ModuleNotFoundError):
        module = _root(error.name or '')
        if module in known:
            return _sentence(module, error, 'this')
    for module in _imported(error):
        if module in known:
            return _sentence(module, error, 'this')
    return None


def reason(error: BaseException) -> str:
    """An error of somebody else's code in one line."""
    text = ' '.join(str(error).split())
    return f'{type(error).__name__}: {text[:200]}' if text else type(error).__name__


def _root(module: str) -> str:
    """The package that a module is part of."""
    return module.partition('.')[0]


def _is_missing(error: BaseException, module: str) -> bool:
    return isinstance(error, ModuleNotFoundError) and _root(error.name or '') == module


def _imported(error: BaseException) -> Iterator[str]:
    """The packages whose modules were being imported when an error was raised, outermost first."""
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_name == '<module>':
            yield _root(str(trace.tb_frame.f_globals.get('__name__', '')))
        trace = trace.tb_next


def _sentence(module: str, error: BaseException, purpose: str) -> InputError:
    install = distribution(module)
    if module in EXTRAS:
        install = f"'mechanism_sim[{EXTRAS[module]}]'"
    command = f'{sys.executable} -m pip install {install}'
    if _is_missing(error, module) and module in REQUIRED:
        return InputError(f"the Python package '{install}' is missing: {command}")
    if _is_missing(error, module):
        needs = 'need' if purpose.endswith('s') and purpose != 'this' else 'needs'
        return InputError(f"{purpose} {needs} the Python package '{module}': {command}")
    if module == 'rclpy':
        command = 'or go without ROS by MECHANISM_SIM_MIDDLEWARE=zenoh'
    return InputError(
        f"the Python package '{module}' is installed, but cannot be used ({reason(error)}): "
        f'reinstall it or install another version, {command}'
    )
