"""Errors as users meet them: one sentence, and the exit code it deserves."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Collection, Iterable

_LONG_WORD = re.compile(r'(\S{100})\S{300,}(\S{50})')


def printable(text: str) -> str:
    """A sentence for any terminal: long words cut in the middle, half characters escaped.

    Names and values that somebody gave are quoted in it, whatever they are.
    """
    whole = text.encode('utf-8', 'backslashreplace').decode()
    return _LONG_WORD.sub(r'\1...\2', whole)


class InputError(ValueError):
    """Something the user gave cannot be used; the command line ends with code 2."""

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


class RunError(RuntimeError):
    """A run failed although its input was good; the command line ends with code 1."""

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


class RunWarning(UserWarning):
    """A run goes on, but something about it is worth a word."""


class _Short(reprlib.Repr):
    """Short, with the words of YAML."""

    def repr_bool(self, value: bool, _: int) -> str:
        return 'true' if value else 'false'

    def repr_NoneType(self, _value: None, _: int) -> str:
        return 'null'


_SHORT = _Short()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel = 2


def quoted(value: object) -> str:
    """A given value, short enough for a sentence."""
    return _SHORT.repr(value)


def nearest(word: str, known: Iterable[str], likeness: float = 0.5) -> str:
    """``; did you mean 'X'?`` for the nearest of the known words, or nothing."""
    import difflib  # noqa: PLC0415 - few runs are refused

    close = difflib.get_close_matches(word[:100], list(known), 1, likeness)
    return f"; did you mean '{close[0]}'?" if close else ''


def check_known(name: str | None, known: Collection[str], wrong: str, those: str) -> None:
    """Refuse a name that is none of the known: ``WRONG; did you mean 'X'?; THOSE A, B``."""
    if name not in known:
        found = ', '.join(known) or 'none'
        raise InputError(f'{wrong}{nearest(str(name), known)}; {those} {found}')
