"""Writing bags: MCAP, profile `ros2`, that a kill cannot spoil.

Log time is simulated time, so that bags of one scene are comparable.
"""

from __future__ import annotations

import fcntl
import os
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from io import BufferedWriter
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import IO, Self

from mcap.well_known import Profile

from mechanism_sim.catalogue import installed_version
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.messages import MessageError, definition, type_hash
from mechanism_sim.recording.mcap_file import McapFile
from mechanism_sim.recording.rosbag2 import (
    METADATA_NAME,
    QosLike,
    TopicRecord,
    bag_metadata,
    plain_yaml,
    qos_profile,
)

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
was closed later.
"""

FLUSH_PERIOD = 0.25  # [s] of wall time: half of what a kill may cost


class BagWriter:
    """One MCAP file, written from any thread: chunked, zstd, indexed, with checksums.

    `write` closes the chunk under way and hands it to the operating system once `FLUSH_PERIOD`
    has passed, `flush` does so always: a killed process leaves a file readable up to there.
    Whoever may stop writing for a while calls `flush` from a timer.

    Args:
        path: File to write; its directory must exist.
        overwrite: Replace a file that is there already.

    Raises:
        InputError: The path exists already, or nothing can be written there.
        RunError: From any method: the disk is full or gone, or the bag is closed. What was
            flushed stays readable.

    """

    def __init__(self, path: Path | str, *, overwrite: bool = False) -> None:
        self.path = Path(path)
        self._stream: BufferedWriter | None = _create(self.path, overwrite=overwrite)
        self._lock = threading.RLock()
        self._topics: dict[str, TopicRecord] = {}
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._start, self._end = 2**63 - 1, 0
        self._flushed = time.monotonic()
        self._written: tuple[float, float] | None = None  # [s] when the first and last message was
        with self._guard_writes():
            self._mcap = McapFile(self._stream, Profile.ROS2, LIBRARY)
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

        Args:
            topic: Name, as `/four_bar/motion`.
            type_name: Message type, as `mechanism_sim/msg/Motion`.
            qos: How its publisher offers it.

        Raises:
            InputError: The topic is there with another type, or the type is unknown, or `qos`
                makes no sense.

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

        Args:
            topic: Name given to `add_topic` before.
            cdr: The message as on the wire, encapsulation header included.
            log_time_ns: Simulated time by which players order messages [ns], not negative.
            publish_time_ns: Time of publication [ns], `log_time_ns` by default.

        Returns:
            How many messages of this topic are written now.

        Raises:
            InputError: A topic that was not added, or a negative time.

        """
        if publish_time_ns is None:
            publish_time_ns = log_time_ns
        with self._lock:
            if self._stream is None:
                raise RunError(f'{self.path} is closed already.')
            channel = self._channels.get(topic)
            if channel is None:
                raise InputError(
                    f'{topic} is not a topic of {self.path} yet: add_topic comes first.'
                )
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
    def _guard_writes(self) -> Iterator[None]:
        with self._lock:
            if self._stream is None:
                raise RunError(f'{self.path} is closed already.')
            try:
                yield
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


def _create(path: Path, *, overwrite: bool) -> BufferedWriter:
    """Open `path` for writing; InputError if that is impossible."""
    try:
        # 'x' creates or fails in one step, so that nothing can slip in between a look and an open.
        stream = open(path, 'wb' if overwrite else 'xb', opener=_open_without_truncating)  # noqa: SIM115
        if lock(stream):
            if path.is_file():
                stream.truncate(0)
            return stream
        stream.close()
        reason = 'is still being recorded; choose another name or end its recorder first'
    except FileExistsError:
        reason = 'exists already; choose another name or allow overwriting'
    except FileNotFoundError:
        reason = f'cannot be created: there is no directory {path.parent}'
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
