"""Messages of a bag as objects: ROS 2 by its definitions, JSON, protobuf."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from functools import partial
from typing import Any

from mcap.records import Channel, Schema
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from zstandard import ZstdDecompressor, ZstdError

from mechanism_sim.messages import MessageError, deserialize, type_hash
from mechanism_sim.packages import reason
from mechanism_sim.recording import protobuf
from mechanism_sim.recording.scan import LARGEST_CHUNK

_ZSTD = b'\x28\xb5\x2f\xfd'  # no CDR begins so

_WRONG = (
    SerdeError, TypesysError, ZstdError, ValueError, KeyError, TypeError, IndexError,
    RecursionError, struct.error,
)  # fmt: skip
"""Errors that messages and definitions raise that are not what they are said to be."""


def decoder(channel: Channel, schema: Schema | None) -> Callable[[bytes], Any]:
    """The function that makes an object of a message of a channel.

    ROS messages that are known here are those of this package; others have the fields that the
    definition in the bag says; what is JSON or protobuf is a dictionary. Both the function and
    this one raise MessageError.
    """
    read = _reader(channel, schema)

    def checked(data: bytes) -> Any:
        try:
            return read(data)
        except MessageError:
            raise
        except _WRONG as error:
            name = schema.name if schema else channel.message_encoding
            raise MessageError(
                f'a message does not match {name} says ({reason(error)})'
            ) from error

    return checked


def _reader(channel: Channel, schema: Schema | None) -> Callable[[bytes], Any]:
    if channel.message_encoding == 'json':
        return _json
    try:
        if channel.message_encoding == 'protobuf' and schema is not None:
            return protobuf.decoder(schema.data, schema.name)
    except _WRONG as error:
        raise MessageError(f'its schema cannot be read ({reason(error)})') from error
    if channel.message_encoding != 'cdr' or schema is None:
        raise MessageError(
            f'{channel.message_encoding!r} is not an encoding that is read here: cdr of ROS 2, '
            'json, protobuf'
        )
    try:
        known = type_hash(schema.name)
    except MessageError:
        if not schema.data:
            raise
        return _defined(schema)
    recorded = channel.metadata.get('topic_type_hash', '')
    if recorded.startswith('RIHS') and recorded != known:
        raise MessageError(f'{schema.name} was another type when this was recorded')
    return partial(_ros, schema.name)


def _ros(name: str, data: bytes) -> Any:
    return deserialize(_plain(data), name)


def _defined(schema: Schema) -> Callable[[bytes], Any]:
    """Of a type of ROS that is not known here, by the definition in the bag."""
    text = schema.data.decode()
    try:
        types = (
            get_types_from_idl(text)
            if schema.encoding == 'ros2idl'
            else get_types_from_msg(text, schema.name)
        )
        store = get_typestore(Stores.ROS2_JAZZY)
        store.register({name: x for name, x in types.items() if name not in store.fielddefs})
    except Exception as error:
        raise MessageError(
            f'the definition of {schema.name} cannot be read ({reason(error)})'
        ) from error
    return lambda data: store.deserialize_cdr(_plain(data), schema.name)


def _json(data: bytes) -> dict[str, Any]:
    found = json.loads(data)
    if not isinstance(found, dict):
        raise MessageError('a message is not a JSON object')
    return found


def _plain(cdr: bytes) -> bytes:
    """CDR, of which `ros2 bag` may have compressed every message by itself."""
    if not cdr.startswith(_ZSTD):
        return cdr
    with ZstdDecompressor().stream_reader(cdr) as stream:
        found: bytes = stream.read(LARGEST_CHUNK + 1)
    if len(found) > LARGEST_CHUNK:
        raise MessageError(f'a message has more than {LARGEST_CHUNK} bytes')
    return found
