"""Messages as plain data, as people write and read them on the command line."""

from __future__ import annotations

import math
import reprlib
from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from ros_interfaces.classes import message_class
from ros_interfaces.definitions import MessageError, field_descriptions, type_name
from ros_interfaces.origin import ros_installed

_LISTS = {Nodetype.ARRAY, Nodetype.SEQUENCE}


def fields_of(message: Any) -> tuple[str, ...]:
    """Names of the fields of a message, of either back end."""
    return _fields(message.__class__)


@lru_cache
def _fields(kind: Any) -> tuple[str, ...]:
    if hasattr(kind, 'get_fields_and_field_types'):
        return (*kind.get_fields_and_field_types(),)
    fields = kind.__dataclass_fields__.items()  # of rosbags constants and the type, too
    return tuple(name.rstrip('_') for name, x in fields if not str(x.type).startswith('ClassVar'))


def to_plain(message: Any, longest: int | None = None, finite: bool = False) -> Any:
    """A message as dictionaries, lists, texts and numbers.

    Parameters
    ----------
    longest : elements of an array that are kept; ``...`` stands for more
    finite : whether None stands for numbers that are not finite, as JSON has none
    """
    if hasattr(message, '__dataclass_fields__') or hasattr(message, 'get_fields_and_field_types'):
        return {
            name: to_plain(_get(message, name), longest, finite) for name in fields_of(message)
        }
    if isinstance(message, bytes):
        return to_plain(list(message), longest, finite)
    if isinstance(message, np.generic):
        message = message.item()
    if finite and isinstance(message, float) and not math.isfinite(message):
        return None
    if isinstance(message, str | bool | int | float):
        return message
    if longest is not None and len(message) > longest:
        return [*(to_plain(x, longest, finite) for x in message[:longest]), '...']
    return [to_plain(x, longest, finite) for x in message]


def field(message: Any, path: str) -> Any:
    """Value at a dotted path of a message, as ``state.state`` or ``position.0``.

    Raises
    ------
    MessageError
        If there is no such field; names those that are there.
    """
    place = message
    for part in path.split('.'):
        if part.isdigit() and hasattr(place, '__len__') and int(part) < len(place):
            place = place[int(part)]
            continue
        known = fields_of(place) if _is_message(place) else []
        if part not in known:
            has = f'; there are {", ".join(known)}' if known else ''
            raise MessageError(f"there is no field '{part}' in '{path}'{has}")
        place = _get(place, part)
    return place


def from_plain(kind: type[Any], values: Any) -> Any:
    """A message of a class from plain data; what is not given has its default.

    Raises
    ------
    MessageError
        If there is no such field, or a value does not fit it.
    """
    message, name = kind(), type_name(kind)
    if values is None:
        return message
    if not isinstance(values, dict):
        raise MessageError(f'{reprlib.repr(values)} is no message: write {{FIELD: VALUE, ...}}')
    described = dict(field_descriptions(name))
    for key, value in values.items():
        if key not in described:
            raise MessageError(
                f"{name} has no field '{key}'; it has {', '.join(described) or 'none'}"
            )
        try:
            found = _value(described[key], value)
            attribute = key if hasattr(message, key) else f'{key}_'
            setattr(message, attribute, found)
        except MessageError as error:
            raise MessageError(f'{key}: {error}') from error
        except (TypeError, ValueError, AssertionError, OverflowError) as error:
            raise MessageError(
                f'{key} = {reprlib.repr(value)} does not fit {name}: {error}'
            ) from error
    return message


def _value(description: Any, value: Any) -> Any:
    kind, inner = description
    if kind == Nodetype.NAME:
        return from_plain(message_class(inner), value)
    if kind in _LISTS:
        if not isinstance(value, list):
            raise MessageError(f'{reprlib.repr(value)} is no list')
        return [_value(inner[0], one) for one in value]
    base = inner[0]
    if base == 'string':
        return str(value)
    if value is None or isinstance(value, str | list | dict):
        raise MessageError(f'{reprlib.repr(value)} is no {base}')
    if base == 'bool':
        return bool(value)
    if base.startswith('float'):
        return float(value)
    if isinstance(value, float) and value != int(value):
        raise MessageError(f'{value} is no whole number')
    whole = int(value)
    limits = np.iinfo({'byte': 'uint8', 'char': 'uint8'}.get(base, base))
    if not limits.min <= whole <= limits.max:
        raise MessageError(f'{whole} is no {base}: from {limits.min} to {limits.max}')
    return bytes([whole]) if base == 'byte' and ros_installed() else whole


def _get(message: Any, name: str) -> Any:
    return getattr(message, name) if hasattr(message, name) else getattr(message, f'{name}_')


def _is_message(value: Any) -> bool:
    return hasattr(value, '__dataclass_fields__') or hasattr(value, 'get_fields_and_field_types')
