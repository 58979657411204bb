"""Contents of a bag, at a glance."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mechanism_sim import documents, strict_json
from mechanism_sim.recording.reader import Bag, BagTopic, read_bag
from mechanism_sim.recording.runs import realtime_factor
from mechanism_sim.recording.writer import lock


@dataclass(frozen=True)
class BagInfo:
    """Contents of a bag.

    size: [bytes]; start, end: smallest and largest log time [s], simulated; duration: between
    them [s]; scene: name of the scene that made it, None where topic `scene` is missing;
    version: of its content, '0' where it has none; package: version of this package that
    wrote it; wall_time: how long the recording took [s], None where that is not known; recovered:
    `recover` has closed it.
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

    @property
    def realtime_factor(self) -> float | None:
        """Of the recording; None where that is not known."""
        return realtime_factor(self.duration, self.wall_time)

    def to_json(self) -> dict[str, Any]:
        """Return the same as a plain dictionary."""
        return asdict(self) | {'realtime_factor': self.realtime_factor}


def info(path: Path | str) -> BagInfo:
    """Return what is in the bag at `path`.

    Raises:
        InputError: No such file, not an MCAP, or its index is damaged.

    """
    bag = read_bag(path)
    topics = tuple(bag.topics.values())
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
    )


def scene_name(bag: Bag) -> str | None:
    """Return the name of the scene from the latched topic `scene` of a bag, None without one.

    The topic holds the name itself, or the scene as YAML or JSON with its `name`.
    """
    text = scene_text(bag)
    return None if text is None else _name_in(text)


def displacements(bag: Bag) -> frozenset[str]:
    """Return the coordinates that are displacements, by the latched topic `scene`."""
    try:
        content = strict_json.loads(scene_text(bag) or '{}')
    except ValueError:
        return frozenset()  # a name, or YAML
    return (
        frozenset(content.get('displacements', ())) if isinstance(content, dict) else frozenset()
    )


def scene_text(bag: Bag, namespace: str | None = None) -> str | None:
    """Return what the latched topic `scene` of a bag holds, None without one.

    Args:
        bag: The bag.
        namespace: Of the machine, as '/left'; the first scene in the bag by default.

    """
    prefix = f'{(namespace or "").rstrip("/")}/'
    for topic in bag.topics.values():
        own = topic.name.startswith(prefix) and topic.name.rpartition('/')[2] == 'scene'
        if own and topic.type == 'std_msgs/msg/String':
            for _, message, _ in bag.messages(topic.name):
                return str(message.data)
    return None


def render_info(bag: BagInfo) -> str:
    """Return the text that the command line shows."""
    # Others log by the wall clock.
    kind = 'simulated' if bag.library == 'mechanism_sim' else 'log time'
    head = {
        'bag': f'{bag.path} ({bag.size / 1e6:.3g} MB, {bag.compression})',
        'scene': bag.scene or 'not recorded',
        kind: f'{bag.duration:.6g} s, from {bag.start:.6g} s to {bag.end:.6g} s',
        'recorded': _pace(bag),
        'messages': f'{bag.messages} on {len(bag.topics)} topics',
        'complete': _state(bag),
        'written by': _author(bag),
    }
    lines = [f'{key + ":":<12}{value}' for key, value in head.items() if value]
    rows = [('topic', 'messages', 'type', 'delivery'), *map(_row, bag.topics)]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    lines.append('')
    for name, count, kind, delivery in rows:
        line = f'{name:<{widths[0]}}  {count:>{widths[1]}}  {kind:<{widths[2]}}  {delivery}'
        lines.append(line.rstrip())
    return '\n'.join(lines)


def _pace(bag: BagInfo) -> str:
    """How fast the run was recorded; empty where that is not known."""
    factor = bag.realtime_factor
    return '' if factor is None else f'in {bag.wall_time:.3g} s, {factor:.3g} x real time'


def _state(bag: BagInfo) -> str:
    """State of the file, and what to do if it is not whole."""
    if bag.complete:
        return 'yes, but its recorder was killed' if bag.recovered else 'yes'
    if Path(bag.path).is_dir():
        return 'NO: a file of it is cut short; what could be read is listed'
    with Path(bag.path).open('rb') as stream:
        if not lock(stream):
            return 'NO: it is still being recorded; what could be read is listed'
    return (
        'NO: cut short; what could be read is listed, and '
        f"'mechanism-sim bag recover {shlex.quote(bag.path)}' closes it"
    )


def _author(bag: BagInfo) -> str:
    """Program that wrote it, and its version."""
    if bag.version == '0':
        return bag.library or 'unknown'
    return f'{bag.library} {bag.package}'.rstrip() + f', bag version {bag.version}'


def _row(topic: BagTopic) -> tuple[str, str, str, str]:
    qos = topic.qos
    if qos is None:
        return topic.name, str(topic.count), topic.type, ''
    kept = 'keep_all' if qos.history == 'keep_all' else f'keep_last {qos.depth}'
    delivery = f'{qos.reliability}, {qos.durability}, {kept}'
    return topic.name, str(topic.count), topic.type, delivery


def _name_in(text: str) -> str:
    try:
        content = documents.parse(text)
    except documents.DocumentError:
        content = None
    if isinstance(content, dict) and 'name' in content:
        return str(content['name'])
    return text.partition('\n')[0]
