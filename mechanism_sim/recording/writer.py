"""Writing bags: MCAP, profile `ros2`, that a kill cannot spoil.

Log time is simulated time, so that bags of one scene are comparable.

The records that come by the thousand, messages and their index, are packed here; all others are
those of the package ``mcap``, whose writer makes three objects for every message. Source: the
specification at mcap.dev, version 0. All platforms of this package are little-endian, as MCAP is.
"""

from __future__ import annotations

import fcntl
import os
import struct
import threading
import time
import zlib
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from io import BufferedWriter
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import IO, Any, Self

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import MCAP0_MAGIC

from mechanism_sim.catalogue import installed_version
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.messages import MessageError, definition, type_hash
from mechanism_sim.recording.rosbag2 import (
    METADATA_NAME,
    QosLike,
    TopicRecord,
    bag_metadata,
    plain_yaml,
    qos_profile,
)

_CHUNK_SIZE = 1 << 20  # [bytes] before compression
_LEVEL = -3  # of zstd; 1 takes twice the time and makes bags of motion 1 % smaller, 3 five times
_MESSAGE = struct.Struct('<BQHIQQ')
_BEFORE_DATA = _MESSAGE.size - 9  # bytes that count as the record's
_INDEX = struct.Struct('<BQHI')
_FOOTER = struct.Struct('<BQQQ')
VERSION = 6
"""Of what bags hold: topics, their types, their times. A reader refuses a later one.

2: samples of every kind of sensor are SensorBlock; of accelerometers it was AccelerometerBlock.
3: Motion says which loads that step act (``load_switches``).
4: CamState says where cam and follower touch; ``bearing_loads``.
5: JointReactions has what bearings that tilt carry out of the plane.
6: CamState says how fast a roller spins; ``/clock``.
"""

LIBRARY = 'mechanism_sim'
RECORDING = 'mechanism_sim'
"""Name of the metadata about the recording.

``version``: `VERSION`, missing in bags before the first; ``package``: version of the package;
``wall_time`` [s] of a bag that was closed: from the first message to the last; ``recovered``: it
was closed later; ``damaged``: without parts that were damaged.
"""

FLUSH_PERIOD = 0.25  # [s] of wall time: half of what a kill may cost


class BagWriter:
    """One MCAP file, written from any thread: chunked, zstd, indexed, with checksums.

    `write` closes the chunk under way and hands it to the operating system once `FLUSH_PERIOD`
    has passed, `flush` does so always: a killed process leaves a file readable up to there.
    A caller that may pause writing must call `flush` from a timer.

    Parameters
    ----------
    path : file to write; its directory must exist
    overwrite : replace a file that is there already
    wait : claim the path only: until `begin` what is there stays, and `close` adds no file

    Raises
    ------
    RunError
        From any method: the disk is full or gone, or the bag is closed. What was flushed stays
        readable.
    """

    def __init__(self, path: Path | str, *, overwrite: bool = False, wait: bool = False) -> None:
        self.path = Path(path)
        self._stream: BufferedWriter | None
        self._stream, self._new = _claim(self.path, overwrite=overwrite)
        self._begun = False
        self._lock = threading.RLock()
        self._topics: dict[str, TopicRecord] = {}
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._start, self._end = 2**63 - 1, 0
        self._flushed = time.monotonic()
        self._written: tuple[float, float] | None = None  # [s] when the first and last message was
        if not wait:
            self.begin()

    def begin(self) -> None:
        """Begin the bag, in place of what the file held."""
        with self._guard_writes() as stream:
            if self.path.is_file():
                stream.truncate(0)
            self._begun = True
            self._mcap = McapFile(stream, Profile.ROS2, LIBRARY)
            # Here already, and again at the end: without the version that it states, the quality
            # of service of a bag that was cut would be misread.
            self._add_metadata()
            self._mcap.flush()

    def count_from(self, first: float) -> None:
        """Set when the first message came, by ``time.monotonic`` [s]: it may be written later."""
        self._written = first, first

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        with self._lock:
            return dict(self._counts)

    def add_topic(self, topic: str, type_name: str, qos: QosLike) -> None:
        """Announce a topic; again with the same type changes nothing.

        Parameters
        ----------
        topic : name, as `/four_bar/motion`
        type_name : message type, as `mechanism_sim/msg/Motion`
        qos : how its publisher offers it
        """
        with self._guard_writes():
            if topic in self._topics:
                known = self._topics[topic].type
                if known != type_name:
                    raise InputError(f'{topic} is a topic of {known}, not of {type_name}.')
                return
            try:
                schema, fingerprint = definition(type_name).encode(), type_hash(type_name)
            except MessageError as error:
                raise InputError(f'{topic}: {error}.') from error
            record = TopicRecord(topic, type_name, fingerprint, qos_profile(qos), 0)
            if type_name not in self._schemas:
                self._schemas[type_name] = self._mcap.add_schema(type_name, schema)
            self._channels[topic] = self._mcap.add_channel(
                topic,
                self._schemas[type_name],
                {
                    'offered_qos_profiles': plain_yaml([record.qos]),
                    'topic_type_hash': record.type_hash,
                },
            )
            self._topics[topic], self._counts[topic] = record, 0

    def write(
        self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int | None = None
    ) -> int:
        """Append a message.

        Parameters
        ----------
        topic : name given to `add_topic` before
        cdr : the message as on the wire, encapsulation header included
        log_time_ns : simulated time by which players order messages [ns], not negative
        publish_time_ns : time of publication [ns], `log_time_ns` by default

        Returns
        -------
        How many messages of this topic are written now.
        """
        if publish_time_ns is None:
            publish_time_ns = log_time_ns
        with self._lock:
            if self._stream is None:
                raise RunError(f'{self.path} is closed already.')
            channel = self._channels.get(topic)
            if channel is None:
                raise InputError(f'{topic} is not a topic of {self.path}: add_topic comes first.')
            if log_time_ns < 0 or publish_time_ns < 0:
                raise InputError(f'{topic}: a bag cannot hold messages from before time zero.')
            count = self._counts[topic]
            try:
                self._mcap.add_message(
                    channel, count & 0xFFFFFFFF, log_time_ns, publish_time_ns, cdr
                )
            except OSError as error:
                raise self._abandon(error) from error
            self._counts[topic] = count + 1
            self._start = min(self._start, log_time_ns)
            self._end = max(self._end, log_time_ns)
            now = time.monotonic()
            self._written = self._written[0] if self._written else now, now
            if now - self._flushed > FLUSH_PERIOD:
                self.flush()
            return count + 1

    def flush(self) -> None:
        """Close the chunk under way and hand everything to the operating system."""
        with self._guard_writes():
            self._mcap.flush()
            self._flushed = time.monotonic()

    def close(self) -> None:
        """Write the index and close the file; a second call does nothing."""
        with self._lock:
            if self._stream is None:
                return
            with self._guard_writes():
                if not self._begun:
                    if self._new:
                        self.path.unlink(missing_ok=True)
                    self._stream.close()
                    self._stream = None
                    return
                took = self._written[1] - self._written[0] if self._written else 0.0
                self._add_metadata({'wall_time': f'{took:.6f}'})
                self._mcap.finish()
                self._stream.close()
            self._stream = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _add_metadata(self, more: Mapping[str, str] = MappingProxyType({})) -> None:
        topics = (replace(t, count=self._counts[t.name]) for t in self._topics.values())
        text = bag_metadata(self.path.name, self._start, self._end, topics)
        self._mcap.add_metadata(METADATA_NAME, {'serialized_metadata': text})
        own = {'version': str(VERSION), 'package': installed_version()}
        self._mcap.add_metadata(RECORDING, own | dict(more))

    @contextmanager
    def _guard_writes(self) -> Iterator[BufferedWriter]:
        with self._lock:
            if self._stream is None:
                raise RunError(f'{self.path} is closed already.')
            try:
                yield self._stream
            except OSError as error:
                raise self._abandon(error) from error

    def _abandon(self, error: OSError) -> RunError:
        """Close a file that cannot be written any further, and return the error."""
        if self._stream is not None:
            # Past the buffer, which would try to write its rest and fail the same way.
            self._stream.raw.close()
            self._stream = None
        return RunError(
            f'{self.path} cannot be written any further ({error.strerror or error}); '
            'what was flushed before stays readable.'
        )


def _claim(path: Path, *, overwrite: bool) -> tuple[BufferedWriter, bool]:
    """Open `path` for writing, and tell if it is new; InputError if that is impossible."""
    try:
        new = True
        try:
            # It creates or fails in one step: nothing can slip in between a look and an open.
            stream = open(path, 'xb')  # noqa: SIM115
        except FileExistsError:
            if not overwrite:
                raise
            new = False
            stream = open(path, 'wb', opener=_open_without_truncating)  # noqa: SIM115
        if lock(stream):
            return stream, new
        stream.close()
        reason = 'is still being recorded; choose another name or end its recorder first'
    except FileExistsError:
        reason = 'exists already; choose another name or allow overwriting'
    except FileNotFoundError:
        there = path.parent.is_dir()  # of the system's own folders no file can be made in some
        why = '' if there else f': there is no directory {path.parent}'
        reason = f'cannot be created{why}'
    except IsADirectoryError:
        reason = 'is a directory; name a file in it'
    except OSError as error:
        reason = f'cannot be written: {error.strerror or error}'
    raise InputError(f'{path} {reason}.')


def _open_without_truncating(path: str, flags: int) -> int:
    """Open a file as `open` does, but keep what is in it."""
    return os.open(path, flags & ~os.O_TRUNC, 0o666)


def lock(stream: IO[bytes]) -> bool:
    """Claim a bag for as long as `stream` is open; False if it is being recorded."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass  # a file system without locks
    return True


class McapFile:
    """One file of CDR messages: chunked, zstd, indexed, with checksums.

    Parameters
    ----------
    stream : new, to write to
    """

    def __init__(self, stream: IO[bytes], profile: str, library: str) -> None:
        self._stream, self._compressor = stream, zstandard.ZstdCompressor(_LEVEL)
        self._offset = self._crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        self._begin_chunk()
        self._write(MCAP0_MAGIC)
        self._write(_record(Header(profile, library)))

    def add_schema(self, name: str, text: bytes) -> int:
        """Register a schema; gives its number."""
        number = len(self._schemas) + 1
        schema = Schema(id=number, data=text, encoding=SchemaEncoding.ROS2, name=name)
        self._schemas.append(schema)
        self._append(_record(schema))
        return number

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        """Register a channel; gives its number."""
        number = len(self._channels) + 1
        channel = Channel(number, topic, MessageEncoding.CDR, metadata, schema)
        self._channels.append(channel)
        self._append(_record(channel))
        return number

    def add_message(
        self, channel: int, sequence: int, log_time: int, publish_time: int, data: bytes
    ) -> None:
        """Append a message; times are [ns]."""
        index = self._indexes.get(channel)
        if index is None:
            index = self._indexes[channel] = array('Q')
        index.append(log_time)
        index.append(self._size)
        length = len(data)
        self._parts += (
            _MESSAGE.pack(
                Opcode.MESSAGE, _BEFORE_DATA + length, channel, sequence, log_time, publish_time
            ),
            data,
        )
        self._size += _MESSAGE.size + length
        if self._size > _CHUNK_SIZE:
            self._end_chunk()

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Append metadata."""
        data = _record(Metadata(name=name, metadata=dict(entries)))
        self._metadata.append(MetadataIndex(offset=self._offset, length=len(data), name=name))
        self._write(data)

    def flush(self) -> None:
        """Close the chunk under way and hand everything to the operating system."""
        self._end_chunk()
        self._stream.flush()

    def finish(self) -> None:
        """Write the index; the stream stays open."""
        self._end_chunk()
        self._write(_record(DataEnd(self._crc)))
        start = self._offset
        groups: Any = RecordBuilder()  # without annotations
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            metadata_count=len(self._metadata),
            message_start_time=min((c.message_start_time for c in self._chunks), default=0),
            message_end_time=max((c.message_end_time for c in self._chunks), default=0),
            schema_count=len(self._schemas),
        )
        offsets = []
        for opcode, records in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, self._metadata),
        ):
            begin = groups.count
            for record in records:
                record.write(groups)
            offsets.append(SummaryOffset(opcode, start + begin, groups.count - begin))
        offset_start = start + groups.count
        for offset in offsets:
            offset.write(groups)
        summary = groups.end()
        footer = _FOOTER.pack(Opcode.FOOTER, 8 + 8 + 4, start, offset_start)
        crc = zlib.crc32(footer, zlib.crc32(summary))
        self._stream.write(summary + _record(Footer(start, offset_start, crc)) + MCAP0_MAGIC)

    def _begin_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._indexes: dict[int, array[int]] = {}  # times and offsets by channel, in turns

    def _append(self, data: bytes) -> None:
        self._parts.append(data)
        self._size += len(data)

    def _end_chunk(self) -> None:
        if not self._indexes:
            return
        plain = b''.join(self._parts)
        times = [time for flat in self._indexes.values() for time in flat[::2]]
        chunk = Chunk(
            compression='zstd',
            data=self._compressor.compress(plain),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(plain),
            uncompressed_size=len(plain),
        )
        begin, data = self._offset, _record(chunk)
        self._write(data)
        start, places = self._offset, {}
        for channel, flat in self._indexes.items():
            places[channel] = self._offset
            size = flat.itemsize * len(flat)
            self._write(
                _INDEX.pack(Opcode.MESSAGE_INDEX, 6 + size, channel, size) + flat.tobytes()
            )
            self._counts[channel] += len(flat) // 2
        self._chunks.append(
            ChunkIndex(
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                chunk_start_offset=begin,
                chunk_length=len(data),
                message_index_offsets=places,
                message_index_length=self._offset - start,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                uncompressed_size=len(plain),
            )
        )
        self._begin_chunk()

    def _write(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._stream.write(data)
        self._offset += len(data)


def _record(record: Any) -> bytes:
    """The bytes of a record."""
    builder: Any = RecordBuilder()  # without annotations
    record.write(builder)
    data: bytes = builder.end()
    return data
