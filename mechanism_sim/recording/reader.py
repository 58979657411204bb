"""Reading bags of any storage, whole or cut short, in bounded memory: ROS 2, JSON, protobuf."""

from __future__ import annotations

import difflib
import json
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from zstandard import ZstdDecompressor, ZstdError

from mechanism_sim import documents
from mechanism_sim.errors import InputError
from mechanism_sim.messages import MessageError, deserialize, type_hash
from mechanism_sim.output import path_of
from mechanism_sim.packages import reason
from mechanism_sim.recording import protobuf
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.storage import (
    LARGEST_CHUNK,
    BagFile,
    DamagedBagError,
    FileLayout,
    parts,
    sound,
)
from mechanism_sim.recording.writer import RECORDING, VERSION
from ros_interfaces.checks import impossible_number

_ZSTD = b'\x28\xb5\x2f\xfd'  # no CDR begins so
_BETWEEN = re.compile(r'^(?:={80}\r?\nIDL: .*|#.*)$', re.MULTILINE)
"""Lines of a definition in IDL that are none: before each of its files, and what they include.

Source: rosbag2, docs/message_definition_encoding.md.
"""

_WRONG = (
    SerdeError, TypesysError, ZstdError, ValueError, KeyError, TypeError, IndexError,
    RecursionError, struct.error,
)  # fmt: skip
"""Errors that messages and definitions raise that are not what they are said to be."""
_READABLE = frozenset(map(str, range(VERSION + 1)))
"""Versions of bags, 0 for bags without one: read as far as their types are known."""
_LATEST = 2**63 - 1  # [ns] of times in order; a damaged one may be later


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag: `qos` is that of its first publisher, None where the bag has none."""

    name: str
    type: str
    count: int
    qos: Qos | None


class Bag:
    """A bag on disk; made by `read_bag`.

    No file stays open between calls, and every iteration starts at the beginning.

    Attributes:
        path: The file, or the folder of several.
        complete: False if a file ends before its end: what is there is read.
        topics: What is known of each topic, by name.
        start: Smallest log time [ns]; 0 without a message.
        end: Largest log time [ns]; 0 without a message.
        compression: Of its chunks, as `zstd`.
        size: Of its files [bytes].
        library: What wrote it.
        version: Of its content; '0' where it has none.
        package: Version of this package that wrote it; empty where it is missing.
        wall_time: How long that took [s], from the first message to the last; None of a bag that
            was cut short, or that others wrote.
        recovered: Whether it was cut short or damaged and `recover` has closed it.
        damaged: Whether it has left something out then.

    """

    def __init__(
        self,
        path: Path,
        files: Sequence[BagFile],
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self.path, self._parts = path, files
        self._progress = progress
        layouts = [part.layout for part in files]
        first, held = layouts[0], [x for x in layouts if any(x.counts.values())]
        self.complete = all(layout.complete for layout in layouts)
        self.start = min((x.start for x in held), default=0)
        self.end = max((x.end for x in held), default=0)
        used = {name for layout in layouts for name in layout.compression if name}
        self.compression = ', '.join(sorted(used)) or 'none'
        self.size = sum(part.path.stat().st_size for part in files)
        self.library = first.library
        recording = first.metadata.get(RECORDING, {})
        self.version = recording.get('version', '0')
        self.package = recording.get('package', '')
        self.recovered = recording.get('recovered') == 'yes'
        self.damaged = recording.get('damaged') == 'yes'
        taken = recording.get('wall_time') if self.complete else None
        with sound(path, 'its metadata of the recording'):
            self.wall_time = None if taken is None else float(taken)
        self.topics = topics_of(layouts)

    def contents(self) -> str:
        """Return which topics hold messages, for sentences that refuse them; at most three."""
        held = [topic for topic in self.topics.values() if topic.count]
        if not held:
            return 'it has no messages'
        named = [f'{t.name} [{t.type or "no type"}, {self.encoding(t.name)}]' for t in held[:3]]
        more = f' and {len(held) - 3} more' if len(held) > 3 else ''
        return f'it has {", ".join(named)}{more}'

    def encoding(self, topic: str) -> str:
        """Return the encoding of a topic, which is `cdr` in ROS 2."""
        return next(c.message_encoding for _, c in self._channels(topic))

    def unreadable(self) -> list[str]:
        """Return the topics with messages whose type or encoding cannot be read here."""
        found = set()
        for part, channel in self._channels(None):
            try:
                self._decoder(part, channel)
            except InputError:
                if part.layout.counts[channel.id]:
                    found.add(channel.topic)
        return sorted(found)

    def messages(
        self, topics: str | Iterable[str] | None = None
    ) -> Iterator[tuple[str, Any, int]]:
        """Return an iterator over (topic, message, log time [ns]) in the order of the files.

        A message of ROS is an object with its fields; of JSON and protobuf a dictionary.

        Parameters
        ----------
        topics : name or names of the requested topics; all of them by default
        """
        return self._read_decoded(self._channels(topics))

    def in_order_of_time(
        self, topics: str | Iterable[str] | None = None
    ) -> Iterator[tuple[str, Any, int]]:
        """Return an iterator like that of `messages`, by log time; at one time as in the files.

        Nodes record ahead, topic by topic: a motion of seconds, then its joint states, its
        frames. All times are read first, so that only messages wait in memory which are followed
        by earlier ones.
        """
        times = np.fromiter((min(t, _LATEST) for *_, t in self.raw(topics)), np.int64)
        earliest = np.minimum.accumulate(times[::-1])[::-1].tolist()  # of each and those after it
        waiting: list[tuple[int, int, str, Any]] = []
        for k, (name, message, t) in enumerate(self.messages(topics)):
            heappush(waiting, (t, k, name, message))
            while waiting and (k + 1 == len(earliest) or waiting[0][0] <= earliest[k + 1]):
                due, _, *found = heappop(waiting)
                yield found[0], found[1], due

    def raw(self, topics: str | Iterable[str] | None = None) -> Iterator[tuple[str, bytes, int]]:
        """Return an iterator like that of `messages`, over the messages as they are recorded."""
        return ((channel.topic, data, t) for _, channel, data, t in
                self._payloads(self._channels(topics)))  # fmt: skip

    def _channels(self, topics: str | Iterable[str] | None) -> list[tuple[BagFile, Channel]]:
        """Return the channels of the requested topics, file by file."""
        channels = [(part, c) for part in self._parts for c in part.layout.channels.values()]
        if topics is None:
            return channels
        wanted = {topics} if isinstance(topics, str) else set(topics)
        for name in sorted(wanted - self.topics.keys()):
            near = difflib.get_close_matches(name, self.topics, n=1, cutoff=0.5)
            hint = f'did you mean {near[0]}?' if near else f'it has {", ".join(self.topics)}.'
            raise InputError(f'{self.path} has no topic {name}; {hint}')
        return [(part, channel) for part, channel in channels if channel.topic in wanted]

    def _payloads(
        self, channels: list[tuple[BagFile, Channel]]
    ) -> Iterator[tuple[BagFile, Channel, bytes, int]]:
        for k, part in enumerate(self._parts):
            wanted = {channel.id: channel for own, channel in channels if own is part}
            told = self._progress and partial(self._tell, k)
            for number, data, log_time in part.payloads(wanted, told) if wanted else ():
                yield part, wanted[number], data, log_time

    def _tell(self, k: int, share: float) -> None:
        """Report how much of all files is read, of which this is file `k`."""
        assert self._progress is not None  # noqa: S101 - it is asked for then only
        self._progress((k + share) / len(self._parts))

    def _read_decoded(
        self, channels: list[tuple[BagFile, Channel]]
    ) -> Iterator[tuple[str, Any, int]]:
        decoders: dict[int, tuple[Callable[[bytes], Any], bool]] = {}
        for part, channel, data, log_time in self._payloads(channels):
            if id(channel) not in decoders:
                own = self.topics[channel.topic].type.startswith('mechanism_sim/msg/')
                decoders[id(channel)] = self._decoder(part, channel), own
            decode, own = decoders[id(channel)]
            try:
                message = decode(data)
            except MessageError as error:
                raise InputError(f'{self.path}, topic {channel.topic}: {error}.') from error
            if own and (field := impossible_number(message)):
                raise DamagedBagError(
                    f'{self.path}, topic {channel.topic}: {field} of the message at '
                    f'{log_time / 1e9:.9g} s holds a number outside the range of machines.'
                )
            yield channel.topic, message, log_time

    def _decoder(self, part: BagFile, channel: Channel) -> Callable[[bytes], Any]:
        """Return what decodes a channel, once sure that it means here what it meant then."""
        schema = part.layout.schemas.get(channel.schema_id)
        own = schema is not None and schema.name.startswith('mechanism_sim/')
        if own and self.version not in _READABLE:
            raise InputError(
                f'{self.path} is a bag of version {self.version}; this version of mechanism_sim '
                f'reads those up to {VERSION}; {self.writer} reads it.'
            )
        try:
            return decoder(channel, schema)
        except MessageError as error:
            hint = f'; {self.writer} reads it' if 'another type' in str(error) else ''
            raise InputError(f'{self.path}, topic {channel.topic}: {error}{hint}.') from error

    @property
    def writer(self) -> str:
        """Name of the version of the package that reads the bag for sure."""
        return f'mechanism_sim {self.package}' if self.package else 'the version that wrote it'


def read_bag(path: Path | str, progress: Callable[[float], None] | None = None) -> Bag:
    """Open a bag for reading: a file, or a folder of files that follow each other.

    Parameters
    ----------
    path : of the file (.mcap or .db3, also compressed as .zstd) or folder
    progress : called with the part of the bag that is read, whenever messages are
    """
    path = path_of(path)
    found = parts(path)
    return Bag(found[0].path if len(found) == 1 and not found[0].holder else path, found, progress)


def topics_of(layouts: Iterable[FileLayout]) -> dict[str, BagTopic]:
    """Return the topics by name; several channels of one topic (publishers) count as one."""
    channels = [(layout, c) for layout in layouts for c in layout.channels.values()]
    topics: dict[str, BagTopic] = {}
    for layout, channel in sorted(channels, key=lambda pair: pair[1].topic):
        schema = layout.schemas.get(channel.schema_id)
        known = topics.get(channel.topic)
        topics[channel.topic] = BagTopic(
            name=channel.topic,
            type=schema.name if schema else '',
            count=layout.counts[channel.id] + (known.count if known else 0),
            qos=known.qos if known else _qos(channel.metadata.get('offered_qos_profiles', '')),
        )
    return topics


def _qos(profiles: str) -> Qos | None:
    """Return the first of the profiles; None if it is none, as before Iron with its numbers."""
    try:
        first = (documents.parse(profiles) or [{}])[0]
        words = {name: first[name] for name in ('reliability', 'durability', 'history', 'depth')}
    except (documents.DocumentError, KeyError, TypeError):
        return None
    fits = map(isinstance, words.values(), (str, str, str, int))
    return Qos(**words) if all(fits) else None


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
            raise MessageError(f'a message does not match {name} ({reason(error)})') from error

    return checked


def _reader(channel: Channel, schema: Schema | None) -> Callable[[bytes], Any]:
    if channel.message_encoding == 'json':
        return _json
    try:
        if channel.message_encoding == 'protobuf' and schema is not None:
            return protobuf.decoder(schema.data, schema.name)
    except _WRONG as error:
        raise MessageError(f'its schema cannot be read ({reason(error)})') from error
    if channel.message_encoding in {'cdr', 'protobuf'} and schema is None:
        raise MessageError('it has no schema, which says the type of its messages')
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
    return lambda data: deserialize(_plain(data), schema.name)


def _defined(schema: Schema) -> Callable[[bytes], Any]:
    """Decoder of an unknown type of ROS, by the definition in the bag."""
    text = schema.data.decode()
    try:
        types = (
            get_types_from_idl(_BETWEEN.sub('', text))
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
