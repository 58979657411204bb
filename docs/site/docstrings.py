"""Docstrings of this house for numpydoc: after the colon stands what it is, not its type."""

from __future__ import annotations

import re
from typing import Any

SECTIONS = {'Parameters', 'Attributes'}
ENTRY = re.compile(r'^([*\w][\w*, .]*) : (.+)$')


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx; before napoleon, which reads the sections."""
    app.connect('autodoc-process-docstring', _process, priority=400)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _process(_app: Any, _what: str, _name: str, _it: Any, _options: Any, lines: list[str]) -> None:
    section, found = '', []
    for k, line in enumerate(lines):
        if k + 1 < len(lines) and set(lines[k + 1]) == {'-'}:
            section = line
        entry = ENTRY.match(line) if section in SECTIONS else None
        found += [entry[1], f'    {entry[2]}'] if entry else [line]
    lines[:] = found
