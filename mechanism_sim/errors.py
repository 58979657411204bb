"""Errors as users meet them: one sentence, and the exit code it deserves."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

_LONG_WORD = re.compile(r'(\S{100})\S{300,}(\S{50})')


def _printable(text: str) -> str:
    """A sentence for any terminal: long words cut in the middle, half characters escaped.

    Names and values that somebody gave are quoted in it, whatever they are.
    """
    whole = text.encode('utf-8', 'backslashreplace').decode()
    return _LONG_WORD.sub(r'\1...\2', whole)


class InputError(ValueError):
    """Something the user gave cannot be used; the command line ends with code 2."""

    def __init__(self, text: str) -> None:
        super().__init__(_printable(text))


class RunError(RuntimeError):
    """A run failed although its input was good; the command line ends with code 1."""

    def __init__(self, text: str) -> None:
        super().__init__(_printable(text))


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


def a_or_an(noun: str) -> str:
    """A noun with its article, by its first letter."""
    return f'{"an" if noun[0] in "aeiou" else "a"} {noun}'


_ALIKE = 0.75
"""Likeness of words that are one with a slip: of 'half_harmonic', 'simple_harmonic' has 0.71."""


def nearest(
    word: str, known: Iterable[str], likeness: float = 0.5, *, deeper: Sequence[str] = ()
) -> str:
    """``; did you mean 'X'?`` for the nearest of the known words, or nothing.

    Parameters
    ----------
    likeness : 0 to 1, of words that begin alike or have the same letters; others need `_ALIKE`
    deeper : further paths that end with the word itself
    """
    import difflib  # noqa: PLC0415 - few runs are refused

    short, known = word[:100], [*known]
    close = [x for x in known if x != short and x.lower() == short.lower()]
    close += [
        x
        for x in difflib.get_close_matches(short, known, 10, likeness)
        if x.startswith(short[: max(2, len(short) // 2)])
        or sorted(x) == sorted(short)
        or difflib.get_close_matches(short, [x], 1, _ALIKE)
    ]
    said = ' or '.join(f"'{x}'" for x in [*close[:1], *deeper])
    return f'; did you mean {said}?' if said else ''


def nearest_file(path: Path, endings: Sequence[str], alike: bool = True) -> str:
    """Clause on a file of these endings with the same name but its ending, or one `alike`."""
    try:
        beside = (x for x in path.parent.iterdir() if x.name.endswith(tuple(endings)))
        others = sorted(x.name for x in beside if x.is_file())
    except (OSError, ValueError):
        return ''
    for name in others:
        if Path(name).stem == path.stem:
            return f"; did you mean '{path.with_name(name)}'?"
    return nearest(path.name, others, 0.8) if alike else ''


def other_word(word: str, words: Mapping[str, str]) -> str:
    """``; here that is X`` for a term of other books and programs, or nothing.

    Parameters
    ----------
    words : what is said here, by such words; however they are joined: 3-4-5, 345
    """
    said = {_bare(other): own for other, own in words.items()}
    return f'; here that is {said[_bare(word)]}' if _bare(word) in said else ''


def _bare(word: str) -> str:
    return re.sub(r'\W|_', '', word).lower()


def check_known(name: str | None, known: Collection[str], wrong: str, those: str) -> None:
    """Refuse a name that is none of the known: ``WRONG; did you mean 'X'?; THOSE A, B``."""
    if name not in known:
        found = ', '.join(known) or 'none'
        raise InputError(f'{wrong}{nearest(str(name), known)}; {those} {found}')
