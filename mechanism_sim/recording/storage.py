"""Files of a bag: MCAP or SQLite, one or several, compressed or not, each a source of messages."""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Callable, Container, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

from mcap.records import Channel, Schema
from zstandard import ZstdDecompressor, ZstdError

from mechanism_sim import documents
from mechanism_sim.errors import InputError
from mechanism_sim.packages import reason
from mechanism_sim.recording.runs import BAG_ENDINGS
from mechanism_sim.recording.scan import (
    DamagedBagError,
    FileLayout,
    blocks,
    messages,
    sound,
    survey,
)

_LISTING = 'metadata.yaml'  # by which ros2 bag says which files belong together, and their order

Payload = tuple[int, bytes, int]
"""Channel, message, log time [ns]."""


@dataclass(frozen=True)
class BagFile:
    """A file of a bag.

    Attributes
    ----------
    path : of what is read; of a compressed file another one, which is kept by `holder`
    """

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
        with self.path.open('rb') as stream:
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
    """The one MCAP file that is meant: `path` itself, or that in a folder; else InputError."""
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
        return []  # damaged, or not written yet: the files say enough
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
            raise InputError(f'{path} does not exist.') from None
        except ZstdError as error:
            raise DamagedBagError(f'{path} is damaged ({reason(error)}).') from error
        path = target
    layout = _survey_rows(path) if path.suffix == '.db3' else survey(path)
    return BagFile(path, layout, holder)


@contextmanager
def _database(path: Path) -> Iterator[sqlite3.Connection]:
    """An SQLite bag, open for reading; errors of it as one sentence."""
    if not path.is_file():
        raise InputError(f'{path} does not exist.')
    try:
        with closing(sqlite3.connect(f'file:{quote(str(path))}?mode=ro', uri=True)) as base:
            yield base
    except (sqlite3.Error, AttributeError, TypeError, ValueError) as error:  # also wrong rows
        raise DamagedBagError(
            f'{path} is not an SQLite bag, or damaged ({reason(error)}).'
        ) from error


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
