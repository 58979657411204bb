"""Paths into messages, in the syntax of Foxglove: ``impacts{joint=="coupler_rocker"}.time``."""

from __future__ import annotations

import math
import operator
import re
from array import array
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim.errors import InputError, nearest
from mechanism_sim.messages import type_name
from ros_interfaces.plain import fields_of

_TOPIC = re.compile(r'/?\w+(?:/\w+)*')
_STEP = re.compile(
    r'\.(?P<field>\w[\w-]*)'
    r'|\[(?P<first>-?\d*)(?P<colon>:)?(?P<last>-?\d*)\]'
    r'|\[(?P<name>[A-Za-z_][\w.]*)\]'
    r'|\{(?P<key>\w+(?:\.\w+)*)(?P<sign>==|!=|<=|>=|<|>)(?P<value>"[^"]*"|\'[^\']*\'|[^}]*)\}'
)
_SIGNS: dict[str, Callable[[Any, Any], Any]] = {
    '==': operator.eq, '!=': operator.ne, '<': operator.lt, '<=': operator.le,
    '>': operator.gt, '>=': operator.ge,
}  # fmt: skip
_ARRAYS = list, tuple, np.ndarray, array  # the last is ROS's
PADDING = 'header', 'structure_needs_at_least_one_member'
"""Fields that say nothing: of all messages with a stamp, of empty messages."""

_NUMBERS = bool, int, float, np.number, np.bool_


class MissingFieldError(InputError):
    """A message that may leave out fields has not this one."""


class Value(NamedTuple):
    """A number in a message, and which of several it is: the names and numbers on its way."""

    value: float
    which: tuple[str, ...]


@dataclass(frozen=True)
class Field:
    """A step to a field."""

    name: str


@dataclass(frozen=True)
class Items:
    """A step to items of an array: one by its number or name, or from one to another."""

    first: int | None
    last: int | None
    name: str = ''


@dataclass(frozen=True)
class Filter:
    """A step that only messages pass whose field has such a value."""

    keys: tuple[str, ...]
    sign: str
    value: Any

    def __str__(self) -> str:
        shown = f'"{self.value}"' if isinstance(self.value, str) else f'{self.value}'
        return f'{".".join(self.keys)}{self.sign}{shown}'


@dataclass(frozen=True)
class MessagePath:
    """Where numbers are in the messages of a topic.

    Attributes
    ----------
    text : as it was written
    """

    text: str
    topic: str
    steps: tuple[Field | Items | Filter, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        """The fields on the way."""
        return tuple(step.name for step in self.steps if isinstance(step, Field))

    def values(self, message: Any) -> list[Value]:
        """The numbers of a message; none if it does not pass a filter."""
        return list(self._walk(message, self.steps, (), ()))

    def _walk(
        self, at: Any, steps: tuple[Field | Items | Filter, ...], names: Any, which: Any
    ) -> Iterator[Value]:
        """The numbers at the end of the steps; `names` are those of the items of an array."""
        if isinstance(at, _ARRAYS) and not (steps and isinstance(steps[0], Items)):
            steps = (Items(None, None), *steps)
        if not steps:
            yield Value(self._number(at), which)
            return
        step, rest = steps[0], steps[1:]
        if isinstance(step, Filter):
            if self._passes(step, at):
                yield from self._walk(at, rest, names, which)
        elif isinstance(step, Field):
            value = self.field(at, step.name)
            yield from self._walk(value, rest, _names(at, step.name, value), which)
        else:
            for i in self._chosen(at, step, names):
                yield from self._walk(at[i], rest, (), (*which, names[i] if names else str(i)))

    def _chosen(self, at: Any, step: Items, names: Any) -> range:
        if not isinstance(at, _ARRAYS):
            raise InputError(f"'{self.text}': what is before [ is not an array")
        n = len(at)
        if step.name:
            if step.name not in names:
                known = f'; there are: {", ".join(names)}' if names else ''
                raise InputError(
                    f"'{self.text}': there is no '{step.name}'{nearest(step.name, names)}{known}"
                )
            i = names.index(step.name)
            return range(i, i + 1)
        first, last = (
            None if x is None else x + n if x < 0 else x for x in (step.first, step.last)
        )
        if first is not None and first == last and not 0 <= first < n:
            raise InputError(f"'{self.text}': the array has {n} items, numbered from 0")
        return range(max(0, first or 0), min(n, n if last is None else last + 1))

    def field(self, message: Any, name: str) -> Any:
        """A field of a message."""
        known = field_names(message)
        if known is None:
            raise InputError(f"'{self.text}': there is no '{name}' in a number")
        if name not in known:
            error = MissingFieldError if isinstance(message, dict) else InputError
            raise error(
                f"'{self.text}': {_kind(message)} has no field '{name}'"
                f'{nearest(name, known)}; there are: {", ".join(known)}'
            )
        return field_value(message, name)

    def _passes(self, step: Filter, message: Any) -> bool:
        value = message
        for key in step.keys:
            value = self.field(value, key)
        if isinstance(value, str) is not isinstance(step.value, str):
            return step.sign == '!='
        return bool(_SIGNS[step.sign](value, step.value))

    def _number(self, value: Any) -> float:
        if isinstance(value, _NUMBERS):
            return float(value)
        if isinstance(value, str):
            raise InputError(f"'{self.text}' is text, not a number")
        known = field_names(value)
        if known is None:
            raise InputError(f"'{self.text}' is not a number")
        raise InputError(f"'{self.text}' is a message: choose one of {', '.join(known)}")


def field_names(message: Any) -> list[str] | None:
    """Fields of a message, or of a dictionary that stands for one; None of anything else."""
    if isinstance(message, dict):
        return [str(name) for name in message]
    if hasattr(message, '__msgtype__') or hasattr(message, 'get_fields_and_field_types'):
        return fields_of(message)
    return None


def field_value(message: Any, name: str) -> Any:
    """A field that `field_names` has."""
    if isinstance(message, dict):
        return message[name]
    return getattr(message, name if hasattr(message, name) else f'{name}_')


def numeric_paths(message: Any, longest: float = math.inf) -> Iterator[tuple[str, ...]]:
    """The fields of a message that hold numbers, without its header; of an array those of one.

    Parameters
    ----------
    longest : arrays of more items are left out
    """

    def walk(at: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        for name in field_names(at) or ():
            if name in PADDING:
                continue
            here, value = (*path, name), field_value(at, name)
            if isinstance(value, _ARRAYS):
                value = value[0] if 0 < len(value) <= longest else None
            if field_names(value) is not None:
                yield from walk(value, here)
            elif isinstance(value, _NUMBERS):
                yield here

    return walk(message, ())


def _kind(message: Any) -> str:
    return 'the message' if isinstance(message, dict) else type_name(type(message))


def _names(message: Any, name: str, value: Any) -> list[str]:
    """Names of the items of an array: the last array of texts before it, if it is as long."""
    if not isinstance(value, _ARRAYS):
        return []
    texts: list[str] = []
    for field in field_names(message) or ():
        if field == name:
            break
        found = field_value(message, field)
        if isinstance(found, list) and found and all(isinstance(x, str) for x in found):
            texts = found
    return texts if len(texts) == len(value) else []


def parse(text: str, topics: Collection[str] = ()) -> MessagePath | None:
    """A path ``TOPIC.FIELD`` with indices ``[0]``, ``[1:3]``, ``[NAME]`` and ``{key==value}``.

    As in Foxglove both ends of a slice belong to it; an item may also be named as in the array of
    names before it. None if the text is no such path.

    Parameters
    ----------
    topics : names that are known; those of others than ROS may have any characters
    """
    longest = max((x for x in topics if text.startswith(f'{x}.')), key=len, default='')
    if not longest and (found := _TOPIC.match(text)):
        longest = found.group()
    if not longest:
        return None
    steps: list[Field | Items | Filter] = []
    place = len(longest)
    while place < len(text):
        step = _STEP.match(text, place)
        if step is None:
            return None
        place = step.end()
        if step['field'] is not None:
            steps.append(Field(step['field']))
        elif step['key'] is not None:
            steps.append(
                Filter(tuple(step['key'].split('.')), step['sign'], _value(step['value']))
            )
        elif step['name'] is not None:
            steps.append(Items(None, None, step['name']))
        else:
            first, last = (
                int(x) if x not in ('', '-') else None for x in step.group('first', 'last')
            )
            steps.append(Items(first, last if step['colon'] else first))
    return MessagePath(text, longest, tuple(steps))


def _value(text: str) -> Any:
    """A number, a truth value, or text, whose quotes the shell may have taken."""
    if text[:1] in ('"', "'"):
        return text[1:-1]
    if text in ('true', 'false'):
        return text == 'true'
    try:
        return float(text)
    except ValueError:
        return text
