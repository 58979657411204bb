"""Arguments of public functions: of the kinds that annotations name, or one sentence."""

from __future__ import annotations

import ast
import inspect
import os
from collections.abc import Callable, Iterable, Mapping
from functools import cache, wraps
from numbers import Real
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, ParamSpec, TypeVar

from mechanism_sim.errors import InputError, nearest, other_word, quoted
from mechanism_sim.output import path_of
from mechanism_sim.units import plain

_P = ParamSpec('_P')
_R = TypeVar('_R')


def listed(given: str | Iterable[str] | None, where: str) -> list[str]:
    """Names or other texts in a list, of which one stands for itself and None for none."""
    found = [given] if isinstance(given, str) else plain([] if given is None else given)
    if not isinstance(found, Iterable) or isinstance(found, bytes):
        raise InputError(f'{where} = {quoted(given)} is neither a text nor a list of texts')
    found = [*found]
    for text in found:
        if not isinstance(text, str):
            raise InputError(f'{where}: {quoted(text)} is not a text')
    return found


class _Kind(NamedTuple):
    words: str
    read: Callable[[Any], Any]
    """A value as one of this kind; None if it is none."""


def _whole(value: Any) -> int | None:
    value = plain(value)
    whole = isinstance(value, Real) and not isinstance(value, bool) and value % 1 == 0
    return int(value) if whole else None


def _flag(value: Any) -> bool | None:
    value = plain(value)
    return bool(value) if isinstance(value, int) and value in (0, 1) else None


def _path(value: Any) -> str | Path | None:
    if isinstance(value, str):  # a slash at the end may mean a folder
        return os.path.expanduser(value)
    return path_of(value) if isinstance(value, os.PathLike) else None


_KINDS = {
    'int': _Kind('a whole number', _whole),
    'bool': _Kind('True or False', _flag),
    'str': _Kind('a text', lambda value: value if isinstance(value, str) else None),
    'str | Path': _Kind('a path', _path),
    'function': _Kind('a function', lambda value: value if callable(value) else None),
}
_FUNCTIONS = 'Callable[', 'Show', 'Progress'
_ALIKE = (
    ('workers', 'n_jobs', 'jobs', 'processes', 'cores', 'threads'),
    ('revolutions', 'periods', 'turns'), ('samples', 'values'), ('count', 'exponents'),
    ('start', 'since', 'from', 'begin'), ('end', 'until', 'to', 'stop'), ('measures', 'measure'),
    ('speed', 'realtime_factor'), ('show', 'progress', 'callback'),
)  # fmt: skip
"""Options that are called otherwise in other functions, in commands, or in other libraries."""


@cache
def _kind(annotation: str) -> _Kind | None:
    """The kind of an argument; None of one that its function reads itself."""
    name = annotation.removesuffix(' | None')
    if name.startswith('Literal['):
        allowed = ast.literal_eval(name.removeprefix('Literal'))
        words = f'one of {", ".join(allowed)}'
        return _Kind(words, lambda x: x if isinstance(x, str) and x in allowed else None)
    return _KINDS.get('function' if name.startswith(_FUNCTIONS) else name)


def as_annotated(name: str, value: Any, annotation: str) -> Any:
    """An argument as its annotation says."""
    kind = _kind(annotation)
    if kind is None or (value is None and annotation.endswith(' | None')):
        return value
    found = kind.read(value)
    if found is None:
        raise InputError(f'{name} = {quoted(value)} is not {kind.words}')
    return found


def public(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorator of a public function, which gets arguments as their annotations say.

    These are whole numbers, True and False, texts, paths and functions, also by NumPy; all else
    it reads itself.
    """
    parameters = _parameters(function)
    annotations = {p.name: _annotation(p) for p in parameters}
    positional = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
    closed = all(p.kind is not p.VAR_KEYWORD for p in parameters)

    @wraps(function)
    def call(*args: _P.args, **options: _P.kwargs) -> _R:
        def read(name: str, value: Any) -> Any:
            where = f'{function.__name__}: {name}'
            return as_annotated(where, value, annotations.get(name, ''))

        _refuse_unknown(function, options if closed else (), annotations)
        given = [read(*each) for each in zip(positional, args, strict=False)]
        named = {name: read(name, value) for name, value in options.items()}
        return function(*given, *args[len(given) :], **named)  # type: ignore[arg-type]

    return call


def check_options(
    function: Callable[..., Any],
    given: Mapping[str, Any],
    *others: Callable[..., Any] | Mapping[str, str],
    words: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """Keywords of a public function as annotations say; one that nothing accepts is refused.

    Parameters
    ----------
    others : functions that they are handed on to, of which those with defaults count, or
        annotations by name
    words : see `other_word`
    """
    several = inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL
    known = {p.name: '' for p in _parameters(function) if p.kind not in several}
    for other in others:
        known |= (
            {p.name: _annotation(p) for p in _parameters(other) if p.default is not p.empty}
            if callable(other)
            else other
        )
    _refuse_unknown(function, given, known, words)
    where = f'{function.__name__}: '
    return {name: as_annotated(where + name, x, known[name]) for name, x in given.items()}


def _refuse_unknown(
    function: Callable[..., Any],
    given: Iterable[str],
    known: Iterable[str],
    words: Mapping[str, str] = MappingProxyType({}),
) -> None:
    others = {a: f"'{b}'" for group in _ALIKE for a in group for b in group if b in known}
    for name in given:
        if name not in known:
            hint = other_word(name, {**others, **words}) or nearest(name, known)
            raise InputError(
                f"{function.__name__} has no option '{name}'{hint}; it has {', '.join(known)}"
            )


def _annotation(parameter: inspect.Parameter) -> str:
    """An annotation as it is written, also in a named tuple."""
    return str(getattr(parameter.annotation, '__forward_arg__', parameter.annotation))


def _parameters(function: Callable[..., Any]) -> list[inspect.Parameter]:
    return [*inspect.signature(function).parameters.values()]
