"""What can go wrong, as users meet it: one sentence, and the exit code it deserves."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable


class InputError(ValueError):
    """Something the user gave cannot be used; the command line ends with code 2."""


class RunError(RuntimeError):
    """A run failed although its input was good; the command line ends with code 1."""


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel = 2


def quoted(value: object) -> str:
    """What somebody gave, short enough for a sentence."""
    return _SHORT.repr(value)


def nearest(word: str, known: Iterable[str]) -> str:
    """``; did you mean 'X'?`` for the nearest of the known words, or nothing."""
    import difflib  # noqa: PLC0415 - few runs are refused

    close = difflib.get_close_matches(word[:100], list(known), 1, 0.5)
    return f"; did you mean '{close[0]}'?" if close else ''
