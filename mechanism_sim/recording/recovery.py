"""Closing a bag whose recorder was killed, so that readers that need an index open it too."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, BinaryIO

from mcap.writer import Writer

from mechanism_sim.errors import InputError
from mechanism_sim.output import beside
from mechanism_sim.recording.reader import topics_of
from mechanism_sim.recording.rosbag2 import METADATA_NAME, Qos, TopicRecord, bag_metadata
from mechanism_sim.recording.rosbag2 import qos_profile as profile_of
from mechanism_sim.recording.storage import (
    MESSAGE,
    FileLayout,
    attachments,
    blocks,
    file_of,
    messages,
    survey,
)
from mechanism_sim.recording.writer import LIBRARY, RECORDING, lock


@dataclass(frozen=True)
class RecoveredBag:
    """Outcome of a recovery: messages in the bag now, bytes that were lost.

    was_closed: nothing was to be done; end: largest log time [s]; cut: bytes at the end that were
    no whole record; rescued: messages in them that could be read all the same.
    """

    path: str
    was_closed: bool
    messages: int
    end: float
    cut: int
    rescued: int

    def to_json(self) -> dict[str, object]:
        """Return the same as a plain dictionary."""
        return asdict(self)


def recover(path: Path | str) -> RecoveredBag:
    """Close the bag at `path`: all that can be read of it stays, byte by byte, with an index.

    It is written beside the file and takes its name at last. A bag that is closed is left alone.

    Raises:
        InputError: No such file, not an MCAP, its index is damaged, or it is being recorded.
        RunError: The disk is full or gone.

    """
    file = file_of(path)
    survey(file)  # raises what is wrong with it
    with file.open('rb') as stream:
        if not lock(stream):
            raise InputError(f'{file} is still being recorded: end its recorder first.')
        layout = survey(file)
        cut = 0 if layout.complete else stream.seek(0, os.SEEK_END) - layout.readable
        rescued = sum(1 for _ in messages(layout.rest))
        if not layout.complete:
            with beside(file) as part, part.open('wb') as out:
                _rewrite(file, stream, layout, out)
                out.flush()
                os.fsync(out.fileno())
                os.fchmod(out.fileno(), os.fstat(stream.fileno()).st_mode & 0o777)
    count = layout.counts.total()
    return RecoveredBag(str(file), layout.complete, count, layout.end / 1e9, cut, rescued)


def render_recovery(found: RecoveredBag) -> str:
    """Return the text that the command line shows."""
    if found.was_closed:
        return f'{found.path} was closed properly: it is left as it is'
    lines = [f'{found.path} is closed: {found.messages} messages, up to {found.end:.6g} s']
    if found.cut:
        lines.append(
            f'its last {found.cut} bytes were cut off; {found.rescued} messages could be read of '
            'them'
        )
    lines.append('lost is what was not yet on disk: less than the last half second')
    return '\n'.join(lines)


def _rewrite(path: Path, stream: BinaryIO, layout: FileLayout, out: IO[bytes]) -> None:
    """Write what can be read of a file as a file that is complete."""
    writer: Any = Writer(out, enable_crcs=True, enable_data_crcs=True)
    writer.start(profile=layout.profile, library=layout.library)
    schemas = {0: 0} | {
        number: writer.register_schema(schema.name, schema.encoding, schema.data)
        for number, schema in layout.schemas.items()
    }
    channels = {
        number: writer.register_channel(
            channel.topic,
            channel.message_encoding,
            schemas.get(channel.schema_id, 0),
            channel.metadata,
        )
        for number, channel in layout.channels.items()
    }
    for block in blocks(path, stream, layout):
        for channel, log_time, start, stop in messages(block):
            if channel in channels:
                _, sequence, _, publish_time = MESSAGE.unpack_from(block, start - MESSAGE.size)
                data = block[start:stop]
                writer.add_message(channels[channel], log_time, data, publish_time, sequence)
    for a in attachments(stream, layout):
        writer.add_attachment(a.create_time, a.log_time, a.name, a.media_type, a.data)
    for name, entries in (layout.metadata | _own_metadata(path, layout)).items():
        writer.add_metadata(name, entries)
    writer.finish()


def _own_metadata(path: Path, layout: FileLayout) -> dict[str, dict[str, str]]:
    """Return what the recorder would have written at its end; nothing for files of others."""
    if layout.library != LIBRARY:
        return {}
    hashes = {c.topic: c.metadata.get('topic_type_hash', '') for c in layout.channels.values()}
    topics = (
        TopicRecord(t.name, t.type, hashes[t.name], profile_of(t.qos or Qos()), t.count)
        for t in topics_of([layout]).values()
    )
    text = bag_metadata(path.name, layout.start, layout.end, topics)
    return {
        METADATA_NAME: {'serialized_metadata': text},
        RECORDING: layout.metadata.get(RECORDING, {}) | {'recovered': 'yes'},
    }
