"""Files of a bag: MCAP or SQLite, one or several, compressed or not, each a source of messages.

An MCAP file that was cut has no index, and its last record may be a piece. Every record says its
length beforehand, so what is complete can be told from what is not without reading it.
Source: MCAP file format specification, version 0 (mcap.dev/spec).
"""

from __future__ import annotations

import shlex
import sqlite3
import struct
from collections import Counter
from collections.abc import Callable, Container, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO
from urllib.parse import quote as quoted_address

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError, UnsupportedCompressionError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Header, Metadata, Schema
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream
from zstandard import ZstdDecompressor, ZstdError

from mechanism_sim import documents
from mechanism_sim.errors import InputError, nearest_file, quoted
from mechanism_sim.packages import reason
from mechanism_sim.recording.runs import BAG_ENDINGS

MAGIC = b'\x89MCAP0\r\n'
RECORD = struct.Struct('<BQ')  # opcode, length of what follows
MESSAGE = struct.Struct('<HIQQ')  # channel, sequence, log time, publish time


LARGEST_CHUNK = 1 << 28
"""Bytes of a chunk in memory; writers make chunks of some megabytes."""

_DAMAGE = (
    CRCValidationError, McapError, ZstdError, RuntimeError, struct.error, ValueError,
    OverflowError, MemoryError,
)  # fmt: skip
"""Errors that reading a damaged file raises, in mcap, zstandard and Python."""
_LISTING = 'metadata.yaml'  # lists the files of a bag, and their order

Payload = tuple[int, bytes, int]
"""Channel, message, log time [ns]."""


class DamagedBagError(InputError):
    """A part of the file is there but wrong."""


@contextmanager
def sound(path: Path, what: str) -> Iterator[None]:
    """Turn errors of a damaged file into one sentence.

    Raises
    ------
    DamagedBagError
        Text that is no UTF-8, lengths and sizes that cannot be, checksums.
    """
    try:
        yield
    except InputError:
        raise
    except UnsupportedCompressionError as error:
        raise InputError(f'{path}: {error}.') from error
    except _DAMAGE as error:
        why = quoted(error)
        if isinstance(error, UnicodeDecodeError):
            why = 'text that is not UTF-8'
        elif isinstance(error, CRCValidationError):
            why = 'its checksum is not that of its content'
        raise DamagedBagError(f'{path}: {what} is damaged ({why}).') from error


@dataclass
class FileLayout:
    """Contents of a file and where its readable part ends.

    `chunks` are the offsets of all chunks by the index, where there is one; `chunk_channels` maps
    those of which it says so to the channels in them;
    `rest` is what can be read of a chunk that was cut: whole records, decompressed.
    """

    complete: bool = False
    readable: int = len(MAGIC)
    library: str = ''
    profile: str = ''
    start: int = 0
    end: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    compression: set[str] = field(default_factory=set)
    chunk_channels: dict[int, frozenset[int]] = field(default_factory=dict)
    chunks: frozenset[int] = frozenset()
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    rest: bytes = b''


def _absent(path: Path) -> InputError:
    return InputError(f'{path} does not exist{nearest_file(path, BAG_ENDINGS)}')


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """An MCAP file, open for reading; InputError if there is none, or it cannot be read."""
    try:
        stream = path.open('rb')
    except FileNotFoundError:
        raise _absent(path) from None
    except OSError as error:
        raise InputError(f'{path} cannot be read: {error.strerror or error}.') from error
    with stream:
        try:
            head = stream.read(len(MAGIC))
        except OSError as error:
            raise InputError(f'{path} cannot be read: {error.strerror or error}.') from error
        if not MAGIC.startswith(head):  # its writer may have got no further
            raise InputError(f'{path} is not an MCAP file.')
        yield stream


def blocks(
    path: Path, stream: BinaryIO, layout: FileLayout, wanted: Container[int] | None = None
) -> Iterator[bytes]:
    """Yield the readable part of a file as runs of records, chunk by chunk, decompressed.

    Parameters
    ----------
    path : the file, for messages
    stream : the file, open for reading
    layout : says where to stop and what can be skipped
    wanted : requested channels; chunks known to hold none of them are skipped

    Raises
    ------
    DamagedBagError
        A chunk does not agree with its checksum, or cannot be read.
    """
    for opcode, offset, length in _records(stream, layout.readable):
        if opcode == Opcode.CHUNK:
            inside = layout.chunk_channels.get(offset)
            if wanted is not None and inside is not None and not any(c in wanted for c in inside):
                continue
            stream.seek(offset + RECORD.size)
            yield decompress(path, offset, stream.read(length))[1]
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}:
            stream.seek(offset)
            yield stream.read(RECORD.size + length)
    if layout.rest:
        yield layout.rest


def whole_records(block: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, start, stop) of records, up to one that is cut: bodies, block[start:stop]."""
    start = RECORD.size
    while start <= len(block):
        opcode, length = RECORD.unpack_from(block, start - RECORD.size)
        if start + length > len(block):
            return
        yield opcode, start, start + length
        start += length + RECORD.size


def messages(block: bytes) -> Iterator[tuple[int, int, int, int]]:
    """Yield (channel, log time [ns], start, stop) of every message: it is block[start:stop]."""
    end = 0
    for opcode, body, end in whole_records(block):
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, _ = MESSAGE.unpack_from(block, body)
            yield channel, log_time, body + MESSAGE.size, end
    if end < len(block):
        raise ValueError('a record extends beyond its chunk')


def _records(stream: BinaryIO, limit: int) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, offset, length) of the records that end before `limit`, up to the footer."""
    offset = len(MAGIC)
    while offset + RECORD.size <= limit:
        stream.seek(offset)
        opcode, length = RECORD.unpack(stream.read(RECORD.size))
        # Opcode 0 is none: a file system that lost power may leave zeros behind.
        if opcode == 0 or offset + RECORD.size + length > limit:
            return
        yield opcode, offset, length
        if opcode == Opcode.FOOTER:
            return
        offset += RECORD.size + length


def rest_of(piece: bytes) -> bytes:
    """Return the whole records of a chunk of which only the first bytes are there."""
    with suppress(*_DAMAGE):
        opcode, length = RECORD.unpack_from(piece)
        # A chunk begins with two times, a size, a checksum, the compression, the records' length.
        (named,) = struct.unpack_from('<I', piece, RECORD.size + 28)
        start = RECORD.size + 32 + named
        compression, held = piece[start - named : start], piece[start + 8 :]
        if opcode != Opcode.CHUNK or len(piece) >= RECORD.size + length:
            return b''
        if compression == b'zstd':
            held = ZstdDecompressor().decompressobj().decompress(held)
        elif compression:
            return b''
        return held[: max((end for *_, end in whole_records(held)), default=0)]
    return b''


def decompress(path: Path, offset: int, body: bytes) -> tuple[Chunk, bytes]:
    """A chunk, and the records in it; DamagedBagError if its checksum is not theirs."""
    with sound(path, f'the chunk at byte {offset}'):
        chunk = Chunk.read(ReadDataStream(BytesIO(body)))
        if chunk.uncompressed_size > LARGEST_CHUNK:
            raise ValueError(f'it would take {chunk.uncompressed_size} bytes')
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
        block = stream.read(length)
    return chunk, block


def from_index(path: Path, stream: BinaryIO) -> FileLayout | None:
    """Return the layout by the summary of a file; None where none has all channels."""
    size = stream.seek(0, 2)
    stream.seek(max(0, size - len(MAGIC)))
    if size < 2 * len(MAGIC) or stream.read(len(MAGIC)) != MAGIC:
        return None
    stream.seek(0)
    with sound(path, 'its index'):
        reader = SeekingReader(stream)
        summary, header = reader.get_summary(), reader.get_header()
        metadata = {found.name: found.metadata for found in reader.iter_metadata()}
    if summary is None or summary.statistics is None or not summary.chunk_indexes:
        return None
    counts, known = summary.statistics.channel_message_counts, summary.channels
    needed = {c.schema_id for c in known.values()}
    if not (counts.keys() <= known.keys() and needed <= {0, *summary.schemas}):
        return None
    return FileLayout(
        complete=True,
        readable=size,
        library=header.library,
        profile=header.profile,
        start=summary.statistics.message_start_time,
        end=summary.statistics.message_end_time,
        schemas=summary.schemas,
        channels=known,
        counts=Counter(counts),
        compression={index.compression for index in summary.chunk_indexes},
        chunk_channels={
            index.chunk_start_offset: frozenset(index.message_index_offsets)
            for index in summary.chunk_indexes
            if index.message_index_offsets
        },
        chunks=frozenset(index.chunk_start_offset for index in summary.chunk_indexes),
        metadata=metadata,
    )


def _from_records(path: Path, stream: BinaryIO) -> FileLayout:
    """Return the layout by reading records as far as they are sound."""
    layout = FileLayout()
    times: list[int] = []
    size = stream.seek(0, 2)
    for opcode, offset, length in _records(stream, size):
        stream.seek(offset)
        block = stream.read(RECORD.size + length)
        try:
            with sound(path, f'the record at byte {offset}'):
                _note(path, layout, opcode, offset, block, times)
        except DamagedBagError:
            break  # readable up to here, and `complete` says that this is not all
        layout.readable = offset + RECORD.size + length
        layout.complete = opcode == Opcode.FOOTER and layout.readable + len(MAGIC) <= size
    if not layout.complete:
        stream.seek(layout.readable)
        rest = rest_of(stream.read(LARGEST_CHUNK))
        with suppress(DamagedBagError), sound(path, 'a chunk that was cut'):
            note_records(layout, rest, times)
            layout.rest = rest
    layout.start, layout.end = times or (0, 0)
    return layout


def _note(
    path: Path, layout: FileLayout, opcode: int, offset: int, block: bytes, times: list[int]
) -> None:
    """Note what a record holds, and the first and the last of the `times` so far."""
    if opcode == Opcode.CHUNK:
        chunk, block = decompress(path, offset, block[RECORD.size :])
        layout.compression.add(chunk.compression)
    if opcode in {Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}:
        note_records(layout, block, times)
    elif opcode == Opcode.HEADER:
        header = Header.read(ReadDataStream(BytesIO(block[RECORD.size :])))
        layout.library, layout.profile = header.library, header.profile
    elif opcode == Opcode.METADATA:
        found = Metadata.read(ReadDataStream(BytesIO(block[RECORD.size :])))
        layout.metadata[found.name] = found.metadata


def note_records(layout: FileLayout, block: bytes, times: list[int]) -> None:
    """Note what a run of records holds, and the first and the last of the `times` so far."""
    held = [(channel, log_time) for channel, log_time, _, _ in messages(block)]
    # schemas and channels that it introduces
    for opcode, start, stop in whole_records(block):
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(block[start:stop])))
            layout.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            introduced = Channel.read(ReadDataStream(BytesIO(block[start:stop])))
            layout.channels[introduced.id] = introduced
    if held:
        layout.counts.update(channel for channel, _ in held)
        ends = [log_time for _, log_time in held]
        times[:] = [min(times[:1] + ends), max(times[1:] + ends)]


@contextmanager
def _cure_named(path: Path, holder: Any) -> Iterator[None]:
    """Name the command that helps where a file is damaged; of a compressed one there is none."""
    try:
        yield
    except DamagedBagError as error:
        if holder:
            raise
        command = f'mechanism-sim bag recover {shlex.quote(str(path))}'
        said = str(error).removesuffix('.')
        raise DamagedBagError(f"{said}; '{command}' keeps all that is whole.") from error


@dataclass(frozen=True)
class BagFile:
    """A file of a bag."""

    #: path of the read file; for a compressed one that of a copy, which is kept by `holder`
    path: Path
    layout: FileLayout
    holder: Any = None

    def payloads(
        self, wanted: Container[int], progress: Callable[[float], None] | None = None
    ) -> Iterator[Payload]:
        """Messages of these channels in the order of the file; of SQLite in that of time."""
        if self.path.suffix == '.db3':
            yield from _rows(self.path, self.layout, wanted, progress)
            return
        with _cure_named(self.path, self.holder), self.path.open('rb') as stream:
            for block in blocks(self.path, stream, self.layout, wanted):
                if progress:
                    progress(stream.tell() / self.layout.readable)
                with sound(self.path, 'a chunk'):
                    held = list(messages(block))
                for channel, log_time, start, stop in held:
                    if channel in wanted:
                        yield channel, block[start:stop], log_time


def parts(path: Path) -> list[BagFile]:
    """The files of a bag in their order: that of their listing, else that of their first message.

    Parameters
    ----------
    path : a file, or a folder of files, as `ros2 bag record` makes it
    """
    if not path.is_dir():
        return [_part(path)]
    listed = _listed(path)
    found = [_part(file) for file in listed or _files(path)]
    if len(found) > 1 and any(part.layout.library == 'mechanism_sim' for part in found):
        names = ', '.join(part.path.name for part in found)
        raise InputError(f'{path} is a folder of several runs ({names}): name one of them.')
    return found if listed else sorted(found, key=lambda part: part.layout.start)


def file_of(path: Path | str) -> Path:
    """The MCAP file of a path: `path` itself, or the only one in a folder; else InputError."""
    path = Path(path)
    if path.is_dir():
        found = _files(path)
        if len(found) != 1:
            names = ', '.join(file.name for file in found)
            raise InputError(f'{path} is a folder of several files: name one of {names}.')
        (path,) = found
    if path.name.endswith(BAG_ENDINGS[1:]):
        raise InputError(f'{path} is not an MCAP file: ros2 bag itself closes such a bag')
    return path


def _files(folder: Path) -> list[Path]:
    """The files of bags in a folder."""
    found = sorted(file for file in folder.iterdir() if file.name.endswith(BAG_ENDINGS))
    if not found:
        raise InputError(
            f'{folder} is a folder without a bag: it has no file {" or ".join(BAG_ENDINGS)}.'
        )
    return found


def _listed(folder: Path) -> list[Path]:
    """The files that the listing of ros2 bag names; none without one."""
    listing = folder / _LISTING
    if not listing.exists():
        return []
    try:
        names = documents.parse(listing.read_text())['rosbag2_bagfile_information'][
            'relative_file_paths'
        ]
        files = [folder / Path(str(name)).name for name in names]  # once with their folder
    except (documents.DocumentError, OSError, UnicodeDecodeError, KeyError, TypeError):
        return []  # damaged, or not written yet: the files suffice
    for file in files:
        if not file.exists():
            raise InputError(f'{folder}: {_LISTING} names {file.name}, which is not there.')
    return files


def _part(path: Path) -> BagFile:
    holder = None
    if path.suffix == '.zstd':
        holder = TemporaryDirectory(prefix='mechanism_sim_')
        target = Path(holder.name) / path.stem
        try:
            with path.open('rb') as packed, target.open('wb') as plain:
                ZstdDecompressor().copy_stream(packed, plain)
        except FileNotFoundError:
            raise _absent(path) from None
        except ZstdError as error:
            raise DamagedBagError(f'{path} is damaged ({reason(error)}).') from error
        path = target
    if path.suffix == '.db3':
        return BagFile(path, _survey_rows(path), holder)
    with _cure_named(path, holder), opened(path) as stream:
        layout = from_index(path, stream) or _from_records(path, stream)
        return BagFile(path, layout, holder)


@contextmanager
def _database(path: Path) -> Iterator[sqlite3.Connection]:
    """An SQLite bag, open for reading; errors of it as one sentence."""
    if not path.is_file():
        raise _absent(path)
    try:
        with closing(
            sqlite3.connect(f'file:{quoted_address(str(path))}?mode=ro', uri=True)
        ) as base:
            yield base
    except (sqlite3.Error, AttributeError, TypeError, ValueError) as error:  # also wrong rows
        raise DamagedBagError(f'{path} is not SQLite, or damaged ({reason(error)}).') from error


def _survey_rows(path: Path) -> FileLayout:
    """Topics, their types and numbers of messages, as far as this version of rosbag2 kept them."""
    with _database(path) as base:
        layout = FileLayout(complete=True, library='rosbag2')
        for name, encoding, text in _select(
            base, 'message_definitions', 'topic_type', 'encoding', 'encoded_message_definition'
        ):
            number = len(layout.schemas) + 1
            layout.schemas[number] = Schema(number, text.encode(), encoding, name)
        known = {schema.name: number for number, schema in layout.schemas.items()}
        for number, topic, kind, form, qos, digest in _select(
            base, 'topics', 'id', 'name', 'type', 'serialization_format', 'offered_qos_profiles',
            'type_description_hash',
        ):  # fmt: skip
            if not (isinstance(topic, str) and isinstance(kind, str)):
                raise ValueError('a topic has no name or no type')
            if kind not in known:
                known[kind] = len(layout.schemas) + 1
                layout.schemas[known[kind]] = Schema(known[kind], b'', '', kind)
            about = {'offered_qos_profiles': qos, 'topic_type_hash': digest}
            layout.channels[number] = Channel(number, topic, form, about, known[kind])
        counts = 'SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages'
        rows = base.execute(f'{counts} GROUP BY topic_id').fetchall()
        layout.counts = Counter({number: count for number, count, *_ in rows})
        layout.start = min((first for *_, first, _ in rows), default=0)
        layout.end = max((last for *_, last in rows), default=0)
    return layout


def _select(base: sqlite3.Connection, table: str, *columns: str) -> Iterator[tuple[Any, ...]]:
    """Rows of a table; empty texts for columns that an older version of it has not."""
    there = {row[1] for row in base.execute(f'PRAGMA table_info({table})')}
    if there:
        names = ', '.join(name if name in there else "''" for name in columns)
        yield from base.execute(f'SELECT {names} FROM {table}')  # noqa: S608 - names of ours


def _rows(
    path: Path,
    layout: FileLayout,
    wanted: Container[int],
    progress: Callable[[float], None] | None,
) -> Iterator[Payload]:
    with _database(path) as base:
        lasts = max(1, layout.end - layout.start)
        ids = ', '.join(str(int(number)) for number in layout.channels if number in wanted)
        query = f'SELECT topic_id, data, timestamp FROM messages WHERE topic_id IN ({ids})'  # noqa: S608
        for channel, data, log_time in base.execute(f'{query} ORDER BY timestamp, id'):
            if progress:
                progress((log_time - layout.start) / lasts)
            yield channel, bytes(data), log_time
