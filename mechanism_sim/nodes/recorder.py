"""The recorder, which writes all messages of a run to an MCAP file."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.export.ideal import WORLD
from mechanism_sim.messages import Progress, serialize, type_name
from mechanism_sim.messages.topics import topics_of
from mechanism_sim.nodes.described_node import Diagnosis
from mechanism_sim.nodes.middleware import Parameter, QoSProfile, Timer
from mechanism_sim.nodes.partners import SAY_AGAIN
from mechanism_sim.nodes.qos import HEARD, PROFILES, RESULTS, policies
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.recording.runs import next_bag
from mechanism_sim.recording.writer import FLUSH_PERIOD, BagWriter
from ros_interfaces.names import full_node_name
from ros_interfaces.stamps import NANOSECONDS, nanoseconds

_STAMP = struct.Struct('<iI')
_NO_STAMP = 'std_msgs/msg/String'
_IN_ARRAY = 'tf2_msgs/msg/TFMessage', 'visualization_msgs/msg/MarkerArray'
_FRAME, _FRAME_IN_ARRAY = 12, 16  # offsets of the frame's name in a header, alone and in an array
LOSS_TIMEOUT = 10.0  # [s] to wait for announced messages


class Recorder(SimulationNode):
    """Node that records a run until all partners have finished and all messages are received.

    A reset ends the bag: the next run goes to a bag of its own, ``run-2.mcap`` after ``run.mcap``.
    The first bag is that of the run that is heard first: a recorder that comes late may have
    missed others.
    The time it reports is that up to which all announced messages are in the bag, which ends with
    the end of ``/clock`` if the drive has a clock. Parameters of the
    node, besides those of every node: ``file``, the bag to write; ``overwrite``.
    """

    keeps = True

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('recorder', parameters)
        self.declare('file', '', 'The bag to write', read_only=True)
        self.declare('overwrite', False, 'Replace bags that exist', read_only=True)
        if not self.value('file'):
            raise InputError('recorder: give the bag to write, for example --file run.mcap')
        self.machine  # noqa: B018 - a bad scene is refused before a file is made
        # Until all are present the run may be refused, and messages may be another run's.
        self.writer = BagWriter(self.value('file'), overwrite=self.value('overwrite'), wait=True)
        # [ns] time of the first message, of the last and of the last clock
        self._begin, self._now, self._clock_time = 0, -1, -1
        self._heard_run = False  # until then the number of the run is not known
        self._undated: list[tuple[str, bytes]] = []  # descriptions before the first time
        self._reports: dict[str, Any] = {}  # reports by node with pending messages
        self._complete: dict[str, float] = {}  # [s] by node, to which the bag is complete
        self._due: dict[str, int] = {}  # counts by topic for the next review
        self._loss_deadline: float | None = None
        self._loss_timer: Timer | None = None
        self._ended, self._late = False, ''
        self._topics: dict[str, tuple[Any, QoSProfile]] = {}
        self._ahead: list[tuple[str, bytes, int]] = []  # messages of the next run, with times
        for topic, kind, delivery in topics_of(self.machine, 'display' in self.partners.names):
            deep = HEARD.get(delivery, PROFILES[delivery])
            name = self.resolve_topic_name(topic)
            self._topics[name] = kind, PROFILES[delivery]
            callback = self._make_callback(name, type_name(kind), delivery == 'latched')
            self.create_subscription(kind, topic, self.once_ready(callback), deep, raw=True)
        self._topics[self.resolve_topic_name('progress')] = Progress, RESULTS
        self.create_timer(FLUSH_PERIOD, self._flush)
        self.join()

    def begin_run(self, number: int) -> None:
        """Start a new bag."""
        super().begin_run(number)
        self._end_bag()
        overwrite = self.value('overwrite')
        path = next_bag(
            Path(self.value('file')), number, lambda name: not overwrite and name.exists()
        )
        self.writer = BagWriter(path, overwrite=overwrite, wait=True)
        self.on_ready()
        self._begin, self._now, self._clock_time = 0, 0, -1
        for topic, data, t in self._ahead:
            self.writer.write(topic, data, t)
        self._ahead.clear()
        self._reports.clear()
        self._complete.clear()
        self._due.clear()
        self._ended, self._late, self._loss_deadline = False, '', None
        if self._loss_timer:
            self.destroy_timer(self._loss_timer)
            self._loss_timer = None

    def _hear_run(self, number: int) -> None:
        """Begin a bag with the next run; the first that is heard has one already."""
        if not self._heard_run:
            self._heard_run = True
            super().begin_run(number)
        elif number == self.run + 1:
            self.begin_run(number)

    def on_ready(self) -> None:
        """Begin the bag; the duration counts from the first message, even an early one."""
        self.writer.begin()
        for topic, (kind, qos) in self._topics.items():
            self.writer.add_topic(topic, type_name(kind), policies(qos))
        if self.first_heard is not None:
            self.writer.count_from(self.first_heard)

    def _flush(self) -> None:
        if self.ready:
            self.writer.flush()

    def _make_callback(self, topic: str, kind: str, latched: bool) -> Callable[[bytes], None]:
        """Callback that writes a serialised message at its simulated time.

        What is latched was published at the start: it comes no earlier than the bag begins.
        """
        offset = 8 if kind in _IN_ARRAY else 4
        tells = {self.resolve_topic_name(name) for name in ('drive', 'motion')}
        own, is_clock = self._make_filter(topic), topic == self.resolve_topic_name('/clock')

        def write(data: bytes) -> None:
            if own and not own(data):
                return
            now = self._now
            if kind != _NO_STAMP and len(data) >= offset + _STAMP.size:
                whole, part = _STAMP.unpack_from(data, offset)
                now = whole * NANOSECONDS + part
                if is_clock:
                    # Of the previous run, recognised by its time only, or perhaps of another
                    # machine: nothing in a message says who publishes it.
                    own_clock, others = self._clocks()
                    if own_clock and others and not self._ended:
                        self.get_logger().warning(
                            f'{others[0]} publishes {topic}, too: meanwhile it is not recorded',
                            throttle_duration_sec=SAY_AGAIN,
                        )
                    if self._ended or now > self._announced or others:
                        return
                    self._clock_time = now
                if not latched:
                    self._date(now)
            if self._now < 0:
                self._undated.append((topic, data))
                return
            if topic in tells:
                self._hear_run(_run_of(data))
            again = latched and kind == _NO_STAMP and self.writer.counts[topic]
            if (self._ended or again) and not self.done:
                # Of the next run, not yet known here: topics have no relative order, and each of
                # these descriptions comes once in a run.
                self._ahead.append((topic, data, now if kind != _NO_STAMP else 0))
                return
            self._put(topic, data, max(now, self._begin) if latched else now)
            if self._loss_deadline is not None:
                self._finish()

        return write

    def _make_filter(self, topic: str) -> Callable[[bytes], bool] | None:
        """Test for messages of this machine, on topics that others in ROS publish on, too.

        Theirs have times of another clock, and would count as messages of this run.
        """
        if topic == self.resolve_topic_name('joint_states'):
            names = [name.encode() for name in self.machine.physics.coordinates]
            return lambda data: _names_of(data) == names
        frames = [self.frame(body.name) for body in self.machine.mechanism.bodies]
        if topic == self.resolve_topic_name('robot_description'):
            tags = [f'<link name={quoteattr(x)}'.encode() for x in (self.frame(WORLD), *frames)]
            return lambda data: all(tag in data for tag in tags)
        if topic not in map(self.resolve_topic_name, ('/tf', '/tf_static')):
            return None
        links = [frame.encode() for frame in frames]
        parents, joint = {self.frame(WORLD).encode(), *links}, self.frame('joint/').encode()

        def is_ours(data: bytes) -> bool:
            parent, end = _text(data, _FRAME_IN_ARRAY)
            child, _ = _text(data, end)
            return parent in parents and (child in links or child.startswith(joint))

        return is_ours

    def _put(self, topic: str, data: bytes, now: int) -> None:
        if self.writer.write(topic, data, now) == self._due.get(topic):
            self._review()

    def _date(self, now: int) -> None:
        """Store the time [ns] of a message; the first is that of descriptions before it, too."""
        if self._now < 0:
            self._begin = now
        self._now, undated, self._undated = now, self._undated, []
        for topic, data in undated:
            self._put(topic, data, now)

    def _end_bag(self) -> None:
        self._date(max(self._now, 0))
        self.writer.close()

    def _on_progress(self, message: Any) -> None:
        if message.node in self.partners.names:
            self._hear_run(message.run)
        super()._on_progress(message)

    def on_progress(self, message: Any) -> None:
        """Record a report, report the complete part of the bag, end after all partners."""
        self._date(nanoseconds(message.header.stamp))
        progress = self.resolve_topic_name('progress')
        reports = dict(zip(message.topics, message.counts, strict=True)).get(progress, 1)
        if self.writer.write(progress, serialize(message), self._now) == 1 and reports > 1:
            self._late = '; it came when the run had begun'
            self.get_logger().warning('the run has begun already: the bag lacks its start')
        self._reports.setdefault(message.node, message)
        self._review()
        if self.partners.finished and self._loss_deadline is None:
            self._loss_deadline = time.monotonic() + LOSS_TIMEOUT
            self._loss_timer = self.create_timer(1.0, self._finish)
        if self._loss_deadline is not None:
            self._finish()

    def _missing_counts(self, report: Any) -> dict[str, int]:
        """Number of missing messages by topic, compared with the counts of a report."""
        counts = self.writer.counts
        announced = zip(report.topics, (int(n) for n in report.counts), strict=True)
        return {t: n - counts[t] for t, n in announced if t in counts and counts[t] < n
                and t != self.resolve_topic_name('progress')}  # fmt: skip

    def _review(self) -> None:
        """Update the times up to which nodes are complete, and report."""
        self._due.clear()
        for node, report in list(self._reports.items()):
            current, missing = report, self._missing_counts(report)
            while not missing:
                self._complete[node] = current.time
                newest = self.partners.reports.get(node, current)
                if newest is current:
                    del self._reports[node]
                    break
                current = self._reports[node] = newest
                missing = self._missing_counts(current)
            for topic, n in missing.items():
                self._due[topic] = self.writer.counts[topic] + n
        drive = self.partners.reports.get('crank_drive')
        t = min((self._complete.get(partner, 0.0) for partner in self.partners.names), default=0.0)
        if drive is not None and t >= drive.time:
            self.report(t)  # the drive may be waiting for this
        else:
            self.report_soon(t)

    def _finish(self) -> None:
        """End once all announced messages are in the bag."""
        if self._ended:
            return
        missing = {
            t: n
            for report in self._reports.values()
            for t, n in self._missing_counts(report).items()
        }
        late = self._loss_deadline is not None and time.monotonic() > self._loss_deadline
        # The clock is no result: it is not counted, and messages may be lost.
        if not missing and (late or self._clock_ended()):
            again = self.partners.another_follows
            self.report(self.partners.time, finished=True, again=again)
            self._ended, self.done = True, not again
        elif missing and late:
            topic, count = next(iter(missing.items()))
            said = f'recorder: {count} messages of {topic} were announced, not received'
            raise RunError(said + self._late)

    @property
    def _announced(self) -> int:
        """Time [ns] to which the law is announced in this run, by the last report."""
        drive = self.partners.reports.get('crank_drive')
        return nanoseconds(drive.header.stamp) if drive else 0

    def _clock_ended(self) -> bool:
        """True if the clock of the drive has reached the end, or the drive has none alone."""
        own_clock, others = self._clocks()
        return self._clock_time >= self._announced or not own_clock or bool(others)

    def _clocks(self) -> tuple[bool, list[str]]:
        """True if the drive of this machine has a clock, and the other nodes that have one."""
        drive = full_node_name(self.get_namespace(), 'crank_drive')
        publishers = self.get_publishers_info_by_topic('/clock')
        names = {full_node_name(info.node_namespace, info.node_name) for info in publishers}
        return drive in names, sorted(names - {drive})

    def diagnose(self) -> Diagnosis:
        """Statistics of the bag."""
        found = super().diagnose()
        found.values |= {
            'bag': str(self.writer.path),
            'messages recorded': sum(self.writer.counts.values()),
        }
        return found

    def destroy_node(self) -> None:
        """Finish the bag in any case, with messages received before all nodes were present."""
        if not self.ready and self._early and self.partners.alone:
            self.on_ready()
            self._take_early()
        self._end_bag()
        super().destroy_node()


def _text(data: bytes, start: int) -> tuple[bytes, int]:
    """The text at a byte of a message, and where the next field of 4 bytes or a text begins."""
    end = start + 4 + int.from_bytes(data[start : start + 4], 'little')
    return data[start + 4 : end - 1], end + -end % 4


def _names_of(data: bytes) -> list[bytes]:
    """Names of a JointState, behind its header."""
    _, end = _text(data, _FRAME)
    count, names = int.from_bytes(data[end : end + 4], 'little'), list[bytes]()
    end += 4
    while len(names) < count and end < len(data):
        name, end = _text(data, end)
        names.append(name)
    return names


def _run_of(data: bytes) -> int:
    """Number of the run of a message, behind its header."""
    _, end = _text(data, _FRAME)
    return int.from_bytes(data[end : end + 4], 'little')
