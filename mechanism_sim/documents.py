"""Reading of YAML on input: plain data of bounded size with text as keys, or one sentence.

Files of scenes, sweeps and parts of them, overrides and what bags say of a scene are read here and
nowhere else. What JSON can say comes through, and nothing else that YAML knows: no tags, no dates
(they are the text that they are), no aliases that multiply, no keys that are lists.
Values are written in one line here, too.
"""

from __future__ import annotations

import errno
import math
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from mechanism_sim.errors import InputError, quoted

LARGEST = 1 << 18
"""Bytes of a document; a cam measured every tenth of a degree takes a third of it."""

MOST = 30_000
"""Values of a document, those that an alias repeats counted again."""

DEEPEST = 24
"""Levels of lists and keys in each other."""

_LONGEST_KEY, _LONGEST_TEXT, _LONGEST_DESCRIPTION = 100, 1000, 10_000
"""Characters."""

_TAG = 'tag:yaml.org,2002:'
_PLAIN = {f'{_TAG}{name}' for name in ('null', 'bool', 'int', 'float')}


class DocumentError(ValueError):
    """Error of a text that is no document: reason and place, but not the name of the text."""


def read(path: Path, kind: str) -> Any:
    """The content of a file of some `kind`, named so in messages."""
    try:
        data = bytes_of(path, LARGEST)
    except OSError as error:
        raise InputError(f"the {kind} file '{path}' cannot be read: {error.strerror}") from error
    try:
        return parse(data.decode('utf-8'))
    except UnicodeDecodeError as error:
        if len(data) <= LARGEST:
            raise InputError(
                f"the {kind} file '{path}' cannot be read: it is not text in UTF-8"
            ) from error
        raise InputError(f'{path.name}: {_too_large()}') from error
    except DocumentError as error:
        raise InputError(f'{path.name}:{error}') from error


def bytes_of(path: Path, largest: int) -> bytes:
    """Bytes of a file, or one more than the `largest` number of them.

    Raises
    ------
    OSError
        If it cannot be read, or is not a regular file: devices have no end, and pipes may have no
        beginning.
    """
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), 'rb') as file:
        mode = os.fstat(file.fileno()).st_mode
        if stat.S_ISDIR(mode):
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, 'it is not a regular file')
        return file.read(largest + 1)


def limited(path: Path, largest: int, where: str, advice: str) -> bytes:
    """Bytes of a file of at most the `largest` number of them; `where` names it in sentences."""
    try:
        data = bytes_of(path, largest)
    except OSError as error:
        raise InputError(f'{where} cannot be read: {error.strerror or error}') from error
    if len(data) > largest:
        raise InputError(f'{where} is larger than {largest} bytes: {advice}')
    return data


def parse(text: str) -> Any:
    """The data that a document means: None, bool, int, float, str, list, dict with text as keys.

    Raises
    ------
    DocumentError
    """
    if len(text) > LARGEST:
        raise DocumentError(f' {_too_large()}')
    try:
        data = _document(text)
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = f' line {mark.line + 1}' if mark else ''
        problem = getattr(error, 'problem', None) or 'it has characters that YAML does not allow'
        raise DocumentError(f'{line} is not valid YAML: {problem}') from error
    except (ValueError, OverflowError) as error:  # of PyYAML: escapes and numbers beyond Python's
        raise DocumentError(' is not valid YAML: an escape or a number is out of range') from error
    try:
        check(data)
    except DocumentError as error:
        raise DocumentError(f' {error}') from error
    return data


def flow(value: Any) -> str:
    """A value in one line, as it may stand behind a key; nothing for None."""
    if value is None:
        return ''
    text = yaml.safe_dump(
        value, default_flow_style=True, width=math.inf, sort_keys=False, allow_unicode=True
    )
    return str(text).removesuffix('...\n').strip()


def texts_of(
    value: Any, skipped: Iterable[str] = (), path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], str]]:
    """All texts among values but of some keys, with their paths."""
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            if key not in skipped:
                yield from texts_of(inner, skipped, (*path, key))
    elif isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            yield from texts_of(inner, skipped, (*path, str(i)))


def check(data: Any, where: tuple[str, ...] = ()) -> None:
    """Refuse data of kinds or sizes that later stages cannot handle."""
    place = quoted('.'.join(where)).strip('\'"') or 'the document'
    if len(where) > DEEPEST:
        raise DocumentError(f'{place}: nested more than {DEEPEST} levels deep')
    if isinstance(data, str):
        described = where[-1:] == ('description',)
        _check_text(data, place, _LONGEST_DESCRIPTION if described else _LONGEST_TEXT)
    elif isinstance(data, int) and abs(data) > 1.7e308:
        raise DocumentError(f'{place}: the number must be below 1.7e308')
    elif isinstance(data, Mapping):
        for key, value in data.items():
            if not isinstance(key, str):
                raise DocumentError(
                    f'{place}: the key {quoted(key)} is not possible: keys must be text; put it '
                    'in quotes'
                )
            if len(key) > _LONGEST_KEY:
                raise DocumentError(
                    f'{place}: the key {quoted(key)} is longer than {_LONGEST_KEY} characters'
                )
            _check_text(key, place, _LONGEST_KEY)
            check(value, (*where, key))
    elif isinstance(data, list | tuple):
        for i, value in enumerate(data):
            check(value, (*where, str(i)))


def _check_text(text: str, place: str, longest: int) -> None:
    if len(text) > longest:
        raise DocumentError(f'{place}: the text is longer than {longest} characters')
    for letter in text:
        if not letter.isprintable() and not letter.isspace():
            raise DocumentError(
                f'{place}: the text holds the character U+{ord(letter):04X}, which is not allowed'
            )


def _too_large() -> str:
    return f'is larger than {LARGEST} bytes'


_UNLIKE = re.compile('[\t\x85\u2028\u2029\ufeff]|[|>][-+0-9]*#')
"""Characters with which libyaml takes what PyYAML refuses."""


def _document(text: str) -> Any:
    """The data of a text by libyaml, ten times as fast; what it refuses is left to PyYAML."""
    fast = getattr(yaml, 'CSafeLoader', None)
    if fast and not _UNLIKE.search(text):
        try:
            return _Reader(fast(text)).document()
        except (yaml.YAMLError, ValueError, OverflowError):
            pass
    return _Reader(yaml.SafeLoader(text)).document()


class _Reader:
    """Makes data of what PyYAML finds, value by value, so that limits hold before they hurt."""

    def __init__(self, loader: Any) -> None:  # PyYAML's methods have no types
        self._loader = loader
        self._known: dict[str, tuple[Any, int]] = {}
        self._count = 0

    def document(self) -> Any:
        """The one document of a text, None if it is empty."""
        events = self._loader
        events.get_event()  # of the stream
        if events.check_event(yaml.StreamEndEvent):
            return None
        events.get_event()
        data = self._value(0)
        events.get_event()
        if not events.check_event(yaml.StreamEndEvent):
            raise _problem('there is more than one document', events.peek_event())
        return data

    def _value(self, depth: int) -> Any:
        event = self._loader.get_event()
        self._counted(1, event)
        if depth > DEEPEST:
            raise _problem(f'nested more than {DEEPEST} levels deep', event)
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._known:
                raise _problem(f"the alias '*{quoted(event.anchor)[1:-1]}' is not known", event)
            data, size = self._known[event.anchor]
            self._counted(size, event)
            return data
        before = self._count
        if isinstance(event, yaml.ScalarEvent):
            data = self._scalar(event)
        elif event.tag:
            raise _problem(f'tags such as {quoted(event.tag)} are not read', event)
        elif isinstance(event, yaml.SequenceStartEvent):
            data = []
            while not self._loader.check_event(yaml.SequenceEndEvent):
                data.append(self._value(depth + 1))
            self._loader.get_event()
        else:
            data = self._mapping(depth)
        if event.anchor:
            self._known[event.anchor] = data, self._count - before
        return data

    def _mapping(self, depth: int) -> dict[str, Any]:
        own: dict[str, Any] = {}
        merged: list[Any] = []
        while not self._loader.check_event(yaml.MappingEndEvent):
            event = self._loader.peek_event()
            if not isinstance(event, yaml.ScalarEvent):
                raise _problem('keys must be text', event)
            plain = event.implicit[0]
            key = self._value(depth + 1)
            if key == '<<' and plain:
                found = self._value(depth + 1)
                merged += found if isinstance(found, list) else [found]
                if not all(isinstance(part, dict) for part in merged):
                    raise _problem("'<<' merges lists of keys with values only", event)
                continue
            if not isinstance(key, str):
                raise _problem(
                    f'the key {quoted(event.value)} must be text; put it in quotes', event
                )
            if key in own:
                raise _problem(f'the key {quoted(key)} is written twice', event)
            own[key] = self._value(depth + 1)
        self._loader.get_event()
        for part in merged:
            own = part | own
        return own

    def _scalar(self, event: yaml.ScalarEvent) -> Any:
        tag = event.tag or self._loader.resolve(yaml.ScalarNode, event.value, event.implicit)
        if event.tag and event.tag not in (*_PLAIN, f'{_TAG}str', '!'):
            raise _problem(f'tags such as {quoted(event.tag)} are not read', event)
        if tag not in _PLAIN:
            return event.value
        try:
            value = self._loader.construct_object(yaml.ScalarNode(tag, event.value), deep=True)
        except (ValueError, KeyError, IndexError) as error:
            raise _problem(f'{quoted(event.value)} cannot be read', event) from error
        if isinstance(value, int) and abs(value) > 1.7e308:
            raise _problem('the number must be below 1.7e308', event)
        if isinstance(value, float) and math.isinf(value) and 'inf' not in event.value.lower():
            raise _problem('the number must be below 1.7e308', event)
        return value

    def _counted(self, more: int, event: yaml.Event) -> None:
        self._count += more
        if self._count > MOST:
            raise _problem(f'more than {MOST} values', event)


def _problem(text: str, event: yaml.Event) -> yaml.MarkedYAMLError:
    mark: Any = event.start_mark
    return yaml.MarkedYAMLError(problem=text, problem_mark=mark)
