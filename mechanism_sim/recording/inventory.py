"""Contents of a bag at a glance; closing one whose recorder was killed, with an index."""

from __future__ import annotations

import os
import shlex
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from itertools import count as numbers_from
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

from mcap.writer import Writer

from mechanism_sim import documents, strict_json
from mechanism_sim.errors import InputError
from mechanism_sim.output import beside
from mechanism_sim.recording.reader import Bag, BagTopic, read_bag, topics_of
from mechanism_sim.recording.rosbag2 import METADATA_NAME, Qos, TopicRecord, bag_metadata
from mechanism_sim.recording.rosbag2 import qos_profile as profile_of
from mechanism_sim.recording.runs import realtime_factor
from mechanism_sim.recording.salvage import Salvage, salvage
from mechanism_sim.recording.storage import MESSAGE, file_of, messages, opened
from mechanism_sim.recording.writer import LIBRARY, RECORDING, lock
from mechanism_sim.units import counted, instant


@dataclass(frozen=True)
class BagInfo:
    """Contents of a bag.

    size: [bytes]; start, end: smallest and largest log time [s], simulated; duration: between
    them [s]; scene: name of the scene that made it, None where topic `scene` is missing; scenes:
    those of several machines by namespace; version: of its content, '0' where it has none;
    package: version of this package that wrote it; wall_time: how long the recording took [s],
    None where that is not known; recovered: `recover` has closed it; damaged: without parts that
    were damaged. Chunks are not read for it.
    """

    path: str
    size: int
    complete: bool
    library: str
    start: float
    end: float
    duration: float
    messages: int
    topics: tuple[BagTopic, ...]
    schemas: tuple[str, ...]
    compression: str
    scene: str | None
    version: str
    package: str
    wall_time: float | None
    recovered: bool = False
    damaged: bool = False
    scenes: Mapping[str, str | None] = field(default_factory=dict)

    @property
    def realtime_factor(self) -> float | None:
        """Real-time factor of the recording; None if it is unknown."""
        return realtime_factor(self.duration, self.wall_time)

    def to_json(self) -> dict[str, Any]:
        """Return the same as a plain dictionary; without `damaged` and `scenes` where not so."""
        found = asdict(self) | {'realtime_factor': self.realtime_factor}
        return {k: v for k, v in found.items() if v or k not in {'damaged', 'scenes'}}


def info(path: Path | str) -> BagInfo:
    """Return what is in the bag at `path`."""
    bag = read_bag(path)
    topics = tuple(bag.topics.values())
    homes = scene_homes(topics)
    several = homes if len(homes) > 1 else ()
    return BagInfo(
        path=str(bag.path),
        size=bag.size,
        complete=bag.complete,
        library=bag.library,
        start=bag.start / 1e9,
        end=bag.end / 1e9,
        duration=(bag.end - bag.start) / 1e9,
        messages=sum(topic.count for topic in topics),
        topics=topics,
        schemas=tuple(sorted({topic.type for topic in topics if topic.type})),
        compression=bag.compression,
        scene=scene_name(bag),
        version=bag.version,
        package=bag.package,
        wall_time=bag.wall_time,
        recovered=bag.recovered,
        damaged=bag.damaged,
        scenes={home or '/': scene_name(bag, home) for home in several},
    )


def scene_name(bag: Bag, namespace: str | None = None) -> str | None:
    """Return the name of the scene from the latched topic `scene` of a bag, None without one.

    The topic holds the name itself, or the scene as YAML or JSON with its `name`.
    """
    text = scene_text(bag, namespace)
    if text is None:
        return None
    try:
        content = documents.parse(text)
    except documents.DocumentError:
        content = None
    if isinstance(content, dict) and 'name' in content:
        return str(content['name'])
    return text.partition('\n')[0]


def displacements(bag: Bag, namespace: str | None = None) -> frozenset[str] | None:
    """Return the coordinates that are displacements, by the latched topic `scene`, if it says."""
    try:
        content = strict_json.loads(scene_text(bag, namespace) or '{}')
    except ValueError:
        return None  # a name, or YAML
    said = content.get('displacements') if isinstance(content, dict) else None
    return None if said is None else frozenset(said)


def scene_text(bag: Bag, namespace: str | None = None) -> str | None:
    """Return what the latched topic `scene` of a bag holds, None without one.

    Parameters
    ----------
    bag : the bag
    namespace : of the machine, as 'left' or '/left'; the outermost scene by default
    """
    homes = scene_homes(bag.topics.values())
    own = [home for home in homes if f'{home}/'.startswith(prefix_of(namespace))]
    for home in sorted(own, key=len):
        for _, message, _ in bag.messages(f'{home}/scene'):
            return str(message.data)
    return None


def scene_homes(topics: Iterable[BagTopic]) -> list[str]:
    """Return the namespaces with a scene, as '/left'; empty for the root."""
    strings = [t.name.rpartition('/') for t in topics if t.type == 'std_msgs/msg/String']
    return sorted(home for home, slash, last in strings if slash and last == 'scene')


def prefix_of(namespace: str | None) -> str:
    """Return what the names of topics in a namespace begin with, as '/left/'."""
    home = (namespace or '').strip('/')
    return f'/{home}/' if home else '/'


def render_info(bag: BagInfo) -> str:
    """Return the text that the command line shows."""
    # Others log by the wall clock.
    kind = 'simulated' if bag.library == 'mechanism_sim' else 'log time'
    factor = bag.realtime_factor
    pace = '' if factor is None else f'in {bag.wall_time:.3g} s, {factor:.3g} x real time'
    # program that wrote it, and its version
    if bag.version == '0':
        author = bag.library or 'unknown'
    else:
        author = f'{bag.library} {bag.package}'.rstrip() + f', bag version {bag.version}'
    scenes = ', '.join(f'{name} in {home}' for home, name in bag.scenes.items())
    head = {
        'bag': f'{bag.path} ({bag.size / 1e6:.3g} MB, {bag.compression})',
        'scene': scenes or bag.scene or 'not recorded',
        kind: f'{bag.duration:.6g} s, from {instant(bag.start, 6)} s to {instant(bag.end, 6)} s',
        'recorded': pace,
        'messages': f'{bag.messages} on {len(bag.topics)} topics{_uncounted(bag)}',
        'complete': _state(bag),
        'written by': author,
    }
    lines = [f'{key + ":":<12}{value}' for key, value in head.items() if value]
    rows = [('topic', 'messages', 'type', 'delivery'), *map(_row, bag.topics)]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    lines.append('')
    for name, count, kind, delivery in rows:
        line = f'{name:<{widths[0]}}  {count:>{widths[1]}}  {kind:<{widths[2]}}  {delivery}'
        lines.append(line.rstrip())
    return '\n'.join(lines)


def _uncounted(bag: BagInfo) -> str:
    """Topics that nodes do not count, and so neither `run` nor `analyze`: some may be lost."""
    ours, named = bag.library == 'mechanism_sim', {t.name: t.count for t in bag.topics}
    if not (ours and (clock := named.get('/clock'))):
        return ''
    return f'; run and analyze count {bag.messages - clock}: those of /clock may get lost'


def is_being_recorded(path: Path | str) -> bool:
    """True if a recorder of this package has the file open."""
    if not Path(path).is_file():
        return False
    with Path(path).open('rb') as stream:
        return not lock(stream)


def _state(bag: BagInfo) -> str:
    """State of the file, and what to do if it is not whole."""
    if bag.complete:
        if bag.damaged:
            return "yes, without what was damaged when 'bag recover' closed it"
        if bag.recovered:
            return 'yes, but its recorder was killed'
        path = Path(bag.path)
        if path.is_dir():
            return 'yes, by the indexes of its files'
        checked = "; 'bag recover' checks what stands before it" if path.suffix == '.mcap' else ''
        return f'yes, by its index{checked}'
    if Path(bag.path).is_dir():
        return 'NO: a file of it is cut short; what could be read is listed'
    if is_being_recorded(bag.path):
        return 'NO: it is still being recorded; what could be read is listed'
    return (
        'NO: cut short; what could be read is listed, and '
        f"'mechanism-sim bag recover {shlex.quote(bag.path)}' closes it"
    )


def _row(topic: BagTopic) -> tuple[str, str, str, str]:
    qos = topic.qos
    if qos is None:
        return topic.name, str(topic.count), topic.type, ''
    kept = 'keep_all' if qos.history == 'keep_all' else f'keep_last {qos.depth}'
    delivery = f'{qos.reliability}, {qos.durability}, {kept}'
    return topic.name, str(topic.count), topic.type, delivery


@dataclass(frozen=True)
class RecoveredBag:
    """Outcome of a recovery: messages in the bag now, bytes that were lost.

    was_closed: nothing was to be done; end: largest log time [s]; cut: bytes at the end that were
    no whole record; rescued: messages in them that could be read all the same; dropped_chunks,
    dropped_bytes: what was damaged and left out; dropped_start, dropped_end: first and last time
    of it [s], None where that is not known; nameless: messages left out since what was damaged
    said what they are; from_damaged: topics whose names stood in what was damaged; kept: the file
    as it was, None where nothing of it was left out.
    """

    path: str
    was_closed: bool
    messages: int
    end: float
    cut: int
    rescued: int
    dropped_chunks: int = 0
    dropped_bytes: int = 0
    dropped_start: float | None = None
    dropped_end: float | None = None
    nameless: int = 0
    from_damaged: tuple[str, ...] = ()
    kept: str | None = None

    def to_json(self) -> dict[str, object]:
        """Return the same as a plain dictionary."""
        return asdict(self)


def recover(path: Path | str) -> RecoveredBag:
    """Close the bag at `path`: all that is sound in it stays, byte by byte, with an index.

    It is written beside the file and takes its name at last. Chunks that are damaged are left out,
    also of a bag that was closed; then the file as it was is kept under another name. A bag that
    is closed and sound is left alone.

    Raises
    ------
    RunError
        The disk is full or missing.
    """
    file = file_of(path)
    with opened(file) as stream:
        if not lock(stream):
            raise InputError(f'{file} is still being recorded: end its recorder first.')
        found = salvage(file, stream)
        layout, losses = found.layout, found.losses
        kept = None
        if not found.closed:
            if losses or found.nameless or not found.cut:
                kept = _keep(file)
            with beside(file) as part, part.open('wb') as out:
                _rewrite(file, stream, found, out)
                out.flush()
                os.fsync(out.fileno())
                os.fchmod(out.fileno(), os.fstat(stream.fileno()).st_mode & 0o777)
    spans = [loss.times for loss in losses if loss.times]
    return RecoveredBag(
        path=str(file),
        was_closed=found.closed,
        messages=layout.counts.total() - found.nameless,
        end=layout.end / 1e9,
        cut=0 if found.closed else found.tail,
        rescued=sum(1 for _ in messages(layout.rest)),
        dropped_chunks=found.chunks,
        dropped_bytes=sum(loss.size for loss in losses),
        dropped_start=min(start for start, _ in spans) / 1e9 if spans else None,
        dropped_end=max(end for _, end in spans) / 1e9 if spans else None,
        nameless=found.nameless,
        from_damaged=tuple(found.fished),
        kept=str(kept) if kept else None,
    )


def render_recovery(found: RecoveredBag) -> str:
    """Return the text that the command line shows."""
    if found.was_closed:
        return (
            f'{found.path} has been closed, with its index, and all its chunks are sound: it is '
            'left as it is'
        )
    held = counted(found.messages, 'message')
    lines = [f'{found.path} is closed: {held}, up to {instant(found.end, 6)} s']
    if found.dropped_bytes:
        chunks = f'{counted(found.dropped_chunks, "chunk")}, ' if found.dropped_chunks else ''
        span = ''
        if found.dropped_start is not None and found.dropped_end is not None:
            span = f', of {instant(found.dropped_start)} s to {instant(found.dropped_end)} s'
        lines.append(f'damaged and left out: {chunks}{found.dropped_bytes} bytes{span}')
    if found.nameless:
        lines.append(
            f'left out, since their topics were described in what was damaged: '
            f'{counted(found.nameless, "message")}'
        )
    if found.from_damaged:
        names = ', '.join(found.from_damaged)
        lines.append(f'read out of what was damaged: the names of the topics {names}')
    if found.cut:
        lines.append(
            f'its last {found.cut} bytes had no index; {found.rescued} messages could be read of '
            'them'
        )
    if found.kept:
        lines.append(f'the file as it was is {found.kept}')
    elif found.cut:
        lines.append(
            'lost is what the file does not hold: where a recorder was killed, less than its last '
            'half second'
        )
    return '\n'.join(lines)


def _keep(file: Path) -> Path:
    """Copy a file beside itself, under a name that is not that of a bag."""
    names = (f'{file.name}.damaged' + (f'-{k}' if k > 1 else '') for k in numbers_from(1))
    kept = next(there for name in names if not (there := file.with_name(name)).exists())
    with beside(kept) as part:
        shutil.copyfile(file, part)
        shutil.copystat(file, part)
    return kept


def _rewrite(path: Path, stream: BinaryIO, found: Salvage, out: IO[bytes]) -> None:
    """Write what is sound in a file as a file that is complete."""
    layout, writer = (
        found.layout,
        cast('Any', Writer(out, enable_crcs=True, enable_data_crcs=True)),
    )
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
    for block in found.blocks(path, stream):
        for channel, log_time, start, stop in messages(block):
            if channel in channels:
                _, sequence, _, publish_time = MESSAGE.unpack_from(block, start - MESSAGE.size)
                data = block[start:stop]
                writer.add_message(channels[channel], log_time, data, publish_time, sequence)
    for a in found.attachments:
        writer.add_attachment(a.create_time, a.log_time, a.name, a.media_type, a.data)
    for name, entries in (layout.metadata | _own_metadata(path, found)).items():
        writer.add_metadata(name, entries)
    writer.finish()


def _own_metadata(path: Path, found: Salvage) -> dict[str, dict[str, str]]:
    """Return what the recorder would have written at its end; nothing for files of others."""
    layout = found.layout
    if layout.library != LIBRARY:
        return {}
    hashes = {c.topic: c.metadata.get('topic_type_hash', '') for c in layout.channels.values()}
    topics = (
        TopicRecord(t.name, t.type, hashes[t.name], profile_of(t.qos or Qos()), t.count)
        for t in topics_of([layout]).values()
    )
    damaged = {'damaged': 'yes'} if found.losses or found.nameless else {}
    text = bag_metadata(path.name, layout.start, layout.end, topics)
    return {
        METADATA_NAME: {'serialized_metadata': text},
        RECORDING: layout.metadata.get(RECORDING, {}) | {'recovered': 'yes'} | damaged,
    }
