"""Words for a terminal: in colours where somebody looks on, and plain everywhere else."""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.console import Console

_STYLES = {
    r'(?m)^[^\s:][^:\n]*?(?=:|  |$)': 'bold',  # headings: what a line at the margin is about
    r'(?<![\w.+^-])[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?(?![\w.]\w)': 'cyan',  # numbers
    r'(?m)(?<=^  )mechanism-sim .*$': 'green',  # commands to be copied
    r"(?<=')mechanism-sim [^']*": 'green',
}
"""Styles of results."""


def echo(text: str) -> None:
    """Print a result."""
    console = _colours(sys.stdout)
    if console is None:
        print(text)
        return
    from rich.text import Text  # noqa: PLC0415

    styled = Text(text)
    for pattern, style in _STYLES.items():
        styled.highlight_regex(re.compile(pattern), style)
    console.print(styled, soft_wrap=True)


def print_error(error: Exception, code: int) -> int:
    """Say on standard error what went wrong, and give back the exit code."""
    console = _colours(sys.stderr)
    if console is None:
        print_notice(str(error))
        return code
    from rich.text import Text  # noqa: PLC0415

    console.print(Text.assemble(('mechanism-sim:', 'bold red'), f' {error}'), soft_wrap=True)
    return code


def print_notice(text: str) -> None:
    """Say something on standard error in one line, behind the name of the program."""
    with suppress(OSError, ValueError):  # nobody may be there who reads it
        print(f'mechanism-sim: {text}', file=sys.stderr, flush=True)


def _colours(stream: TextIO) -> Console | None:
    """Writer of colours to a stream; none where nobody sees them, or wants them.

    ``NO_COLOR`` and ``FORCE_COLOR`` decide otherwise, see https://no-color.org and
    https://force-color.org.
    """
    if os.environ.get('NO_COLOR') or not (os.environ.get('FORCE_COLOR') or stream.isatty()):
        return None
    from rich.console import Console  # noqa: PLC0415

    return Console(file=stream, force_terminal=True, highlight=False)
