"""Protobuf messages by the descriptors that a bag holds, as dictionaries.

A schema of MCAP is a serialised FileDescriptorSet, itself a protobuf message, so that both are
read by the same few lines: https://protobuf.dev/programming-guides/encoding/. Fields that are not
on the wire have their default; messages that are not are left out.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

_DEEPEST = 64  # messages within messages
_STRUCTS = {1: '<d', 2: '<f', 6: '<Q', 7: '<I', 15: '<i', 16: '<q'}  # by type in descriptor.proto
_SIGNED, _ZIGZAG = (3, 5, 14), (17, 18)  # int64, int32 and enum; sint32 and sint64
_BOOL, _TEXT, _MESSAGE, _BYTES = 8, 9, 11, 12
_ZERO: dict[int, Any] = {_BOOL: False, _TEXT: '', _BYTES: b''}
_SIZES = {1: '<Q', 5: '<I'}  # by wire type
_REPEATED = 3

_Wire = Iterator[tuple[int, int, Any]]


class _Field(NamedTuple):
    """A field of a message: its type, and the name of that if it is a message."""

    name: str
    type: int
    repeated: bool
    message: str


def decoder(descriptors: bytes, name: str) -> Callable[[bytes], dict[str, Any]]:
    """The function that makes a dictionary of a message ``package.Name`` on the wire.

    It raises ValueError or struct.error where the bytes are no such message, this function too
    where the descriptors have none.
    """
    types = dict(_types(descriptors))
    if name not in types:
        raise ValueError(f'its schema does not describe {name}')

    def read(kind: str, data: bytes, depth: int) -> dict[str, Any]:
        if depth > _DEEPEST:
            raise ValueError(f'messages nested more than {_DEEPEST} deep')
        fields = types.get(kind, {})
        found: dict[str, Any] = {
            f.name: [] if f.repeated else _ZERO.get(f.type, 0)
            for f in fields.values()
            if f.repeated or f.type != _MESSAGE
        }
        for number, wire, raw in _wire(data):
            if (f := fields.get(number)) is None:
                continue
            if f.type == _MESSAGE:
                values = [read(f.message, raw, depth + 1)]
            elif wire == 2 and f.type not in (_TEXT, _BYTES):  # packed numbers
                values = [_number(f.type, x) for x in _unpacked(f.type, raw)]
            else:
                values = [_number(f.type, raw)]
            if f.repeated:
                found[f.name] += values
            elif values:
                found[f.name] = values[-1]
        return found

    return lambda data: read(name, data, 0)


def _types(descriptors: bytes) -> Iterator[tuple[str, dict[int, _Field]]]:
    """The message types of a FileDescriptorSet by their full names."""

    def within(package: str, message: bytes) -> Iterator[tuple[str, dict[int, _Field]]]:
        parts = list(_wire(message))
        name = '.'.join(filter(None, (package, _first(parts, 1, b'').decode())))
        fields = {}
        for part in (list(_wire(raw)) for number, _, raw in parts if number == 2):
            fields[_first(part, 3, 0)] = _Field(
                _first(part, 1, b'').decode(), _first(part, 5, 0),
                _first(part, 4, 0) == _REPEATED, _first(part, 6, b'').decode().lstrip('.'),
            )  # fmt: skip
        yield name, fields
        for number, _, raw in parts:
            if number == 3:
                yield from within(name, raw)

    for number, _, file in _wire(descriptors):
        parts = list(_wire(file)) if number == 1 else []
        for part, _, raw in parts:
            if part == 4:
                yield from within(_first(parts, 2, b'').decode(), raw)


def _first(parts: list[tuple[int, int, Any]], number: int, default: Any) -> Any:
    return next((raw for found, _, raw in parts if found == number), default)


def _wire(data: bytes) -> _Wire:
    """Fields on the wire: number, wire type, and the bytes or the varint that is there."""
    place = 0
    while place < len(data):
        key, place = _varint(data, place)
        number, wire = key >> 3, key & 7
        if wire == 0:
            raw, place = _varint(data, place)
            yield number, wire, raw
            continue
        if wire == 2:
            size, place = _varint(data, place)
        elif wire in _SIZES:
            size = struct.calcsize(_SIZES[wire])
        else:
            raise ValueError(f'wire type {wire}')
        if place + size > len(data):
            raise ValueError('a field extends beyond its message')
        yield number, wire, data[place : place + size]
        place += size


def _varint(data: bytes, place: int) -> tuple[int, int]:
    found = 0
    for k in range(10):
        if place + k >= len(data):
            break
        found |= (data[place + k] & 0x7F) << 7 * k
        if data[place + k] < 0x80:
            return found, place + k + 1
    raise ValueError('a number is incomplete')


def _unpacked(kind: int, raw: bytes) -> Iterator[Any]:
    """Numbers of a packed field."""
    if kind in _STRUCTS:
        size = struct.calcsize(_STRUCTS[kind])
        yield from (raw[k : k + size] for k in range(0, len(raw), size))
        return
    place = 0
    while place < len(raw):
        value, place = _varint(raw, place)
        yield value


def _number(kind: int, raw: Any) -> Any:
    """A number, a text or bytes from what is on the wire."""
    if kind in _STRUCTS:
        return struct.unpack(_STRUCTS[kind], raw)[0]
    if kind == _TEXT:
        return raw.decode()
    if kind == _BOOL:
        return bool(raw)
    if kind in _ZIGZAG:
        return (raw >> 1) ^ -(raw & 1)
    if kind in _SIGNED and raw >= 1 << 63:
        return raw - (1 << 64)
    return raw
