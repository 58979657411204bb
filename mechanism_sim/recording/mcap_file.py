"""MCAP files, written with little work for each message.

The records that come by the thousand, messages and their index, are packed here; all others are
those of the package ``mcap``, whose writer makes three objects for every message. Source: the
specification at mcap.dev, version 0. All platforms of this package are little-endian, as MCAP is.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import Counter
from collections.abc import Mapping
from typing import IO, Any

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
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC

CHUNK_SIZE = 1 << 20  # [bytes] before compression
_LEVEL = 1  # of zstd; the usual 3 takes twice the time and makes bags of motion 1 % smaller
_MESSAGE = struct.Struct('<BQHIQQ')
_BEFORE_DATA = _MESSAGE.size - 9  # bytes that count as the record's
_INDEX = struct.Struct('<BQHI')
_FOOTER = struct.Struct('<BQQQ')


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
        if self._size > CHUNK_SIZE:
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
        offsets = []
        for opcode, records in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
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

    def _statistics(self) -> Statistics:
        return Statistics(
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
