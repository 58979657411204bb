"""Docstrings for napoleon: the text after the colon of a parameter is not a type.

And what stands in backticks is code, in whatever word it is.
"""

from __future__ import annotations

import re
from typing import Any

SECTIONS = {'Parameters', 'Attributes'}
ENTRY = re.compile(r'^([*\w][\w*, .]*) : (.+)$')
CODE = re.compile(r'(?<![`:])`([^`]+)`(?!`)(?=(\w)?)')


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx; before napoleon, which reads the sections."""
    app.connect('autodoc-process-docstring', _process, priority=400)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}


def _process(_app: Any, what: str, _name: str, _it: Any, _options: Any, lines: list[str]) -> None:
    if what in ('attribute', 'data', 'property') and lines:
        lines[0] = lines[0].replace(': ', '; ')  # napoleon takes what stands before for a type
    section, found = '', []
    for k, line in enumerate(lines):
        if k + 1 < len(lines) and set(lines[k + 1]) == {'-'}:
            section = line
        entry = ENTRY.match(line) if section in SECTIONS else None
        found += [entry[1], f'    {entry[2]}'] if entry else [line]
    lines[:] = [CODE.sub(_code, line) for line in found]


def _code(match: re.Match[str]) -> str:
    return f'``{match[1]}``' + ('\\ ' if match[2] else '')  # code ends at the end of a word only
