"""Sound records of a file, wherever they are: behind damaged chunks, too, and in closed files.

A record says how long it is, and a chunk says so twice, so that what is damaged is passed over.
Where a length is damaged itself, the next chunk that agrees with its checksum is looked for.
"""

from __future__ import annotations

import mmap
import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata, Schema
from zstandard import ZstdDecompressor, ZstdError

from mechanism_sim.messages import MessageError, definition
from mechanism_sim.recording.storage import (
    LARGEST_CHUNK,
    MAGIC,
    RECORD,
    DamagedBagError,
    FileLayout,
    decompress,
    from_index,
    messages,
    note_records,
    rest_of,
    sound,
    whole_records,
)

_CHUNK = re.compile(
    rb'\x06(?=.{5}\0{3}.{28}(?:\0{4}|\x04\0{3}zstd|\x03\0{3}lz4))', re.DOTALL
)  # length, times, size, checksum, compression
_NAME_LENGTH = RECORD.size + 28
_LONGEST_NAME = 16  # bytes of the name of a compression
_STEP = 4096  # bytes that are decompressed at once of what is damaged
_PARSED: dict[int, Any] = {
    Opcode.HEADER: Header, Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata, Opcode.ATTACHMENT: Attachment,
}  # fmt: skip
_SIZES: dict[int, int] = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}
_PRIVATE = 0x80  # opcodes from here on are of programs, and no record of the format
_YEAR_2200 = 7_258_118_400 * 10**9  # [ns]; later times are damaged ones


class Loss(NamedTuple):
    """Bytes that are no sound record; `times` [ns] of messages in them, if a chunk has them."""

    offset: int
    size: int
    opcode: int
    times: tuple[int, int] | None


@dataclass
class Salvage:
    """Sound records of a file."""

    layout: FileLayout  #: common layout of all records
    closed: bool = False  #: True if the file is sound: no damaged chunk, and an index
    losses: list[Loss] = field(default_factory=list)  #: skipped bytes
    chunks: int = 0  #: number of skipped chunks
    tail: int = 0  #: bytes at the end without a whole record
    cut: bool = True  #: True if `tail` is an incomplete record or zeros, as after a kill
    #: starts and ends of records with messages
    places: list[tuple[int, int]] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)  #: readable attachments
    #: topics read from damaged chunks, since others have messages of them
    fished: list[str] = field(default_factory=list)

    def blocks(self, path: Path, stream: BinaryIO) -> Iterator[bytes]:
        """Yield the records with messages in runs, decompressed."""
        for start, stop in self.places:
            stream.seek(start)
            record = stream.read(stop - start)
            if record[0] == Opcode.CHUNK:
                yield decompress(path, start, record[RECORD.size :])[1]
            else:
                yield record
        if self.layout.rest:
            yield self.layout.rest

    @property
    def nameless(self) -> int:
        """Messages whose topic no sound record contains."""
        known = self.layout.channels
        return sum(count for number, count in self.layout.counts.items() if number not in known)


def salvage(path: Path, stream: BinaryIO) -> Salvage:
    """Find what is sound in an MCAP file that is open for reading."""
    index, indexed = None, True
    try:
        index = from_index(path, stream)
    except DamagedBagError:
        indexed = False
    size = stream.seek(0, 2)
    if not size:
        return Salvage(FileLayout())
    with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        walk = _RecordWalk(path, data)
        walk.go()
        if index:
            walk.compare(index)
        else:
            walk.fish()
        found = walk.found
    if index is None:
        own = all(loss.opcode >= _PRIVATE for loss in found.losses)
        found.closed = indexed and walk.footed and own and not walk.misled
    return found


class _RecordWalk:
    """Goes through a file, record by record.

    Parameters
    ----------
    data : all of the file
    """

    def __init__(self, path: Path, data: mmap.mmap) -> None:
        self._path, self._data, self._size = path, data, len(data)
        self.found = Salvage(FileLayout(readable=len(MAGIC)))
        self._times: list[int] = []
        self._ended = False  # the data; an index follows
        self.footed = False  # True if the file is complete
        self.misled = False  # True if a chunk's length differs from that in its record

    def go(self) -> None:
        """Note all records."""
        layout, offset = self.found.layout, min(len(MAGIC), self._size)
        while offset < self._size and not self.footed:
            offset, before = self._step(offset), offset
            if offset == before:
                break
        layout.readable = offset
        if not self._ended:
            # what can be read of the record that was cut
            found, self.found.tail = self.found, self._size - offset
            piece = self._data[offset : offset + LARGEST_CHUNK]
            rest = rest_of(piece)
            with suppress(DamagedBagError), sound(self._path, 'a chunk that was cut'):
                note_records(found.layout, rest, self._times)
                found.layout.rest = rest
            if len(piece) >= RECORD.size and piece.strip(b'\0'):
                opcode, length = RECORD.unpack_from(piece)
                found.cut = 0 < opcode <= max(Opcode) and length <= LARGEST_CHUNK
        layout.start, layout.end = self._times or (0, 0)

    def compare(self, index: FileLayout) -> None:
        """Apply a sound index, and keep losses of messages only."""
        found, layout = self.found, self.found.layout
        layout.schemas |= index.schemas
        layout.channels |= index.channels
        lost, last = index.chunks - {start for start, _ in found.places}, max(index.chunks)
        found.losses = [
            loss
            for loss in found.losses
            if loss.offset <= last and (loss.opcode < _PRIVATE or loss.offset in lost)
        ]
        found.chunks = len(lost)
        found.closed = not (lost or found.losses or self.misled)

    def fish(self) -> None:
        """Read topics that are missing out of damaged chunks, where they are of known types."""
        found, layout = self.found, self.found.layout
        for loss in found.losses if found.nameless else ():
            inside = FileLayout()
            with suppress(DamagedBagError), sound(self._path, 'a chunk'):
                for record in _pieces(self._data[loss.offset : loss.offset + loss.size]):
                    note_records(inside, record, [])
            for number, channel in inside.channels.items():
                schema = inside.schemas.get(channel.schema_id)
                if (
                    number not in layout.channels
                    and layout.counts[number]
                    and schema
                    and _known(schema)
                ):
                    layout.schemas.setdefault(channel.schema_id, schema)
                    if layout.schemas[channel.schema_id] == schema:
                        layout.channels[number] = channel
                        found.fished.append(channel.topic)

    def _step(self, offset: int) -> int:
        """Note what begins at a byte; where the next begins, the same if nothing does."""
        opcode, length = 0, 0
        if offset + RECORD.size <= self._size:
            opcode, length = RECORD.unpack_from(self._data, offset)
        end = offset + RECORD.size + length
        whole = opcode != 0 and end <= self._size
        if opcode == Opcode.CHUNK and (found := self._chunk(offset)):
            behind, chunk, block = found
            self.misled |= behind != end
            layout = self.found.layout
            layout.compression.add(chunk.compression)
            note_records(layout, block, self._times)
            self.found.places.append((offset, behind))
            return behind
        if whole and opcode != Opcode.CHUNK and self._note(opcode, offset, end):
            return end
        if self._ended:
            return end if whole else offset  # start of the index, which is rebuilt
        following = self._search(offset + 1, end if whole else self._size)
        if following is None and not whole:
            return offset
        following = following or end
        times = self._span(offset) if opcode == Opcode.CHUNK else None
        self.found.chunks += opcode == Opcode.CHUNK
        self.found.losses.append(Loss(offset, following - offset, opcode, times))
        return following

    def _chunk(self, offset: int) -> tuple[int, Chunk, bytes] | None:
        """End, head and records of the chunk at a byte; None if there is no sound one.

        Its end is that of its content: the length of the record may be damaged.
        """
        data, at = self._data, offset + _NAME_LENGTH
        if at + 4 > self._size:
            return None
        (named,) = struct.unpack_from('<I', data, at)
        if named > _LONGEST_NAME or at + 12 + named > self._size:
            return None
        end = at + 12 + named + int(struct.unpack_from('<Q', data, at + 4 + named)[0])
        if end > self._size:
            return None
        with suppress(DamagedBagError), sound(self._path, 'a chunk'):
            chunk, block = decompress(self._path, offset, data[offset + RECORD.size : end])
            for _ in messages(block):
                pass
            return end, chunk, block
        return None

    def _note(self, opcode: int, offset: int, end: int) -> bool:
        """Enter a record that is no chunk; returns True if its content fits its opcode."""
        body = self._data[offset + RECORD.size : end]
        if opcode in _PARSED:
            layout, stream, record = self.found.layout, BytesIO(body), None
            with suppress(DamagedBagError), sound(self._path, f'the record at byte {offset}'):
                record = _PARSED[opcode].read(ReadDataStream(stream))
            if record is None or stream.tell() != len(body):
                return False
            if isinstance(record, Header):
                layout.library, layout.profile = record.library, record.profile
            elif isinstance(record, Schema):
                layout.schemas.setdefault(record.id, record)
            elif isinstance(record, Channel):
                layout.channels.setdefault(record.id, record)
            elif isinstance(record, Metadata):
                layout.metadata[record.name] = record.metadata
            else:
                self.found.attachments.append(record)
            return True
        if opcode == Opcode.MESSAGE:
            if len(body) < 22 or self._ended:
                return False
            note_records(self.found.layout, self._data[offset:end], self._times)
            self.found.places.append((offset, end))
        elif opcode == Opcode.MESSAGE_INDEX:
            return len(body) >= 6 and struct.unpack_from('<I', body, 2)[0] == len(body) - 6
        elif opcode in _SIZES:
            if len(body) != _SIZES[opcode] or (opcode == Opcode.FOOTER and not self._ended):
                return False
            self._ended = True
            self.footed = opcode == Opcode.FOOTER and self._data[end : end + 8] == MAGIC
        else:
            return False
        return True

    def _search(self, start: int, stop: int) -> int | None:
        """First byte from `start` on, before `stop`, at which a sound chunk begins."""
        while found := _CHUNK.search(self._data, start):
            if found.start() >= stop:
                return None
            if self._chunk(found.start()):
                return found.start()
            start = found.start() + 1
        return None

    def _span(self, offset: int) -> tuple[int, int] | None:
        """Times [ns] of the messages in the damaged chunk at a byte, where they can be."""
        if offset + RECORD.size + 16 > self._size:
            return None
        start, end = struct.unpack_from('<QQ', self._data, offset + RECORD.size)
        return (start, end) if start <= end < _YEAR_2200 else None


def _pieces(record: bytes) -> Iterator[bytes]:
    """Records of a zstd chunk, up to a failure of decompression."""
    start = _NAME_LENGTH + 4 + 4 + 8
    held, read = b'', ZstdDecompressor().decompressobj().decompress
    with suppress(ZstdError):
        for k in range(start, len(record), _STEP):
            held += read(record[k : k + _STEP])
    yield from (held[start - RECORD.size : stop] for _, start, stop in whole_records(held))


def _known(schema: Schema) -> bool:
    """True if a schema is as it is known here: then what stands beside it is sound, too."""
    with suppress(MessageError):
        same: bool = schema.data == definition(schema.name).encode()
        return same
    return False
