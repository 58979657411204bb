"""Packages of Python that this one needs, some only for a command or a node."""

from __future__ import annotations

import sys

from mechanism_sim.errors import InputError

REQUIRED = (
    'argcomplete', 'heyoka', 'jinja2', 'mcap', 'numba', 'numpy', 'pint', 'plotly', 'pydantic',
    'rich', 'rosbags', 'scipy', 'websockets', 'xxhash', 'yaml', 'zenoh', 'zstandard',
)  # fmt: skip
"""Modules by the names under which they are imported."""

EXTRAS = {'matplotlib': 'plots', 'openpyxl': 'tables', 'pyarrow': 'tables'}
"""Modules of extras, which only some commands need."""

_DISTRIBUTED_AS = {'yaml': 'PyYAML', 'zenoh': 'eclipse-zenoh'}


def distribution(module: str) -> str:
    """Name by which pip knows the package of a module."""
    return _DISTRIBUTED_AS.get(module, module)


def missing(error: ModuleNotFoundError) -> InputError | None:
    """Which package is missing and how to get it; None if `error` is about none of them."""
    module = (error.name or '').partition('.')[0]
    if module in EXTRAS:
        extra = f"'mechanism_sim[{EXTRAS[module]}]'"
        return InputError(
            f"this needs the Python package '{module}': {sys.executable} -m pip install {extra}"
        )
    if module not in REQUIRED:
        return None
    name = distribution(module)
    return InputError(
        f"the Python package '{name}' is missing: {sys.executable} -m pip install {name}"
    )
