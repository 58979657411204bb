"""Reading bags: any MCAP of ROS 2 messages, whole or cut short, in bounded memory."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mechanism_sim import documents
from mechanism_sim.errors import InputError
from mechanism_sim.messages import MessageError, deserialize, type_hash
from mechanism_sim.recording.rosbag2 import Qos
from mechanism_sim.recording.scan import (
    DamagedBagError,
    FileLayout,
    blocks,
    messages,
    sound,
    survey,
)
from mechanism_sim.recording.writer import RECORDING, VERSION
from ros_interfaces.checks import impossible_number

_IN_SQLITE = (
    '{} is a bag in SQLite (.db3), and only MCAP is read: "ros2 bag convert" makes an MCAP of it'
)

READABLE = frozenset(map(str, range(VERSION + 1)))
"""Versions of bags, 0 for bags without one: read as far as their types are known."""


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
        path: The file.
        complete: False if the file ends before its end: what is there is read.
        topics: What is known of each topic, by name.
        start: Smallest log time [ns].
        end: Largest log time [ns].
        compression: Of its chunks, as `zstd`.
        library: What wrote it.
        version: Of its content; '0' where it has none.
        package: Version of this package that wrote it; empty where it is missing.
        wall_time: How long that took [s], from the first message to the last; None of a bag that
            was cut short, or that others wrote.
        recovered: Whether it was cut short and `recover` has closed it.

    """

    def __init__(
        self, path: Path, layout: FileLayout, progress: Callable[[float], None] | None = None
    ) -> None:
        self.path = path
        self._progress = progress
        self.complete = layout.complete
        self.start, self.end = layout.start, layout.end
        self.compression = ', '.join(sorted(filter(None, layout.compression))) or 'none'
        self.library = layout.library
        recording = layout.metadata.get(RECORDING, {})
        self.version = recording.get('version', '0')
        self.package = recording.get('package', '')
        self.recovered = recording.get('recovered') == 'yes'
        taken = recording.get('wall_time') if layout.complete else None
        with sound(path, 'its metadata of the recording'):
            self.wall_time = None if taken is None else float(taken)
        self.topics = _topics(layout)
        self._layout = layout

    def contents(self) -> str:
        """Return which topics hold messages, for sentences that refuse them; at most three."""
        held = [topic for topic in self.topics.values() if topic.count]
        if not held:
            return 'it has no messages'
        encodings = {c.topic: c.message_encoding for c in self._layout.channels.values()}
        named = [f'{t.name} [{t.type or "no type"}, {encodings[t.name]}]' for t in held[:3]]
        more = f' and {len(held) - 3} more' if len(held) > 3 else ''
        return f'it has {", ".join(named)}{more}'

    def unreadable(self) -> list[str]:
        """Return the topics with messages whose type or encoding cannot be read here."""
        found = []
        for channel in self._layout.channels.values():
            try:
                self._checked_type(channel.id)
            except InputError:
                if self._layout.counts[channel.id]:
                    found.append(channel.topic)
        return sorted(set(found))

    def messages(
        self, topics: str | Iterable[str] | None = None
    ) -> Iterator[tuple[str, Any, int]]:
        """Return an iterator over (topic, message, log time [ns]) in the order of the file.

        Args:
            topics: Name or names of the topics wanted; all of them by default.

        Raises:
            InputError: No such topic; from the iterator: a type that is not known here, or was
                another when the bag was written.

        """
        return self._read_decoded(self._channels(topics))

    def raw(self, topics: str | Iterable[str] | None = None) -> Iterator[tuple[str, bytes, int]]:
        """Return an iterator like that of `messages`, over the messages as CDR."""
        return self._read_serialized(self._channels(topics))

    def _channels(self, topics: str | Iterable[str] | None) -> dict[int, str]:
        """Return the names of the topics wanted by channel."""
        names = {channel.id: channel.topic for channel in self._layout.channels.values()}
        if topics is None:
            return names
        wanted = {topics} if isinstance(topics, str) else set(topics)
        for name in sorted(wanted - self.topics.keys()):
            near = difflib.get_close_matches(name, self.topics, n=1, cutoff=0.5)
            hint = f'did you mean {near[0]}?' if near else f'it has {", ".join(self.topics)}.'
            raise InputError(f'{self.path} has no topic {name}; {hint}')
        return {channel: name for channel, name in names.items() if name in wanted}

    def _read_serialized(self, channels: dict[int, str]) -> Iterator[tuple[str, bytes, int]]:
        for channel, cdr, log_time in self._payloads(channels):
            yield channels[channel], cdr, log_time

    def _read_decoded(self, channels: dict[int, str]) -> Iterator[tuple[str, Any, int]]:
        types: dict[int, str] = {}
        for channel, cdr, log_time in self._payloads(channels):
            if channel not in types:
                types[channel] = self._checked_type(channel)
            try:
                message = deserialize(cdr, types[channel])
            except MessageError as error:
                raise InputError(f'{self.path}, topic {channels[channel]}: {error}.') from error
            if types[channel].startswith('mechanism_sim/msg/'):
                field = impossible_number(message)
                if field:
                    raise DamagedBagError(
                        f'{self.path}, topic {channels[channel]}: {field} of the message at '
                        f'{log_time / 1e9:.9g} s holds a number that no machine has.'
                    )
            yield channels[channel], message, log_time

    def _payloads(self, channels: dict[int, str]) -> Iterator[tuple[int, bytes, int]]:
        with self.path.open('rb') as stream:
            for block in blocks(self.path, stream, self._layout, channels):
                if self._progress:
                    self._progress(stream.tell() / self._layout.readable)
                with sound(self.path, 'a chunk'):
                    held = list(messages(block))
                for channel, log_time, start, stop in held:
                    if channel in channels:
                        yield channel, block[start:stop], log_time

    def _checked_type(self, channel_id: int) -> str:
        """Return the type of a channel, once sure that it means here what it meant then."""
        channel = self._layout.channels[channel_id]
        schema = self._layout.schemas.get(channel.schema_id)
        where = f'{self.path}, topic {channel.topic}'
        if channel.message_encoding != 'cdr' or schema is None:
            raise InputError(f'{where}: {channel.message_encoding!r} is not an encoding of ROS 2.')
        if schema.name.startswith('mechanism_sim/') and self.version not in READABLE:
            raise InputError(
                f'{self.path} is a bag of version {self.version}; this version of mechanism_sim '
                f'reads those up to {VERSION}; {self.writer} reads it.'
            )
        recorded = channel.metadata.get('topic_type_hash', '')
        try:
            known = type_hash(schema.name)
        except MessageError as error:
            raise InputError(f'{where}: {error}.') from error
        if recorded.startswith('RIHS') and recorded != known:
            raise InputError(
                f'{where}: {schema.name} was another type when this was recorded; '
                f'{self.writer} reads it.'
            )
        return schema.name

    @property
    def writer(self) -> str:
        """Which version of the package reads the bag for sure."""
        return f'mechanism_sim {self.package}' if self.package else 'the version that wrote it'


def read_bag(path: Path | str, progress: Callable[[float], None] | None = None) -> Bag:
    """Open a bag for reading: a file, or a folder that `ros2 bag record -s mcap` made.

    Args:
        path: Of the file or folder.
        progress: Called with the part of the file that is read, whenever messages are.

    Raises:
        InputError: No such file, not an MCAP, or its index is damaged; a folder with other than
            one file.

    """
    file = file_of(path)
    return Bag(file, survey(file), progress)


def file_of(path: Path | str) -> Path:
    """Return the file that is meant: `path` itself, or the one in a folder; else InputError."""
    path = Path(path)
    if path.suffix == '.db3':
        raise InputError(_IN_SQLITE.format(path))
    if not path.is_dir():
        return path
    found = sorted(path.glob('*.mcap'))
    if not found and any(path.glob('*.db3')):
        raise InputError(_IN_SQLITE.format(path))
    if len(found) != 1:
        names = ', '.join(file.name for file in found) or 'none'
        raise InputError(f'{path} is a folder, which has to hold one MCAP file: {names}.')
    return found[0]


def _topics(layout: FileLayout) -> dict[str, BagTopic]:
    """Return the topics by name; several channels of one topic (publishers) count as one."""
    topics: dict[str, BagTopic] = {}
    for channel in sorted(layout.channels.values(), key=lambda channel: channel.topic):
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
    """Return the first of the profiles; None where policies are numbers, as before Iron."""
    try:
        first = (documents.parse(profiles) or [{}])[0]
        words = {name: first[name] for name in ('reliability', 'durability', 'history', 'depth')}
    except (documents.DocumentError, KeyError, TypeError):
        return None
    return Qos(**words) if isinstance(words['history'], str) else None
