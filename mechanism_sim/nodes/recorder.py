"""The recorder: writes everything the run publishes to one MCAP file."""

from __future__ import annotations

import struct
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.messages import Progress, serialize, type_name
from mechanism_sim.middleware import Parameter, QoSProfile
from mechanism_sim.nodes.process import main_of
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.simulation_node import SimulationNode
from mechanism_sim.nodes.topics import topics_of
from mechanism_sim.recording import BagWriter, Qos

_STAMP = struct.Struct('<iI')
_NO_STAMP = 'std_msgs/msg/String'
_IN_ARRAY = 'tf2_msgs/msg/TFMessage', 'visualization_msgs/msg/MarkerArray'
LOSS_TIMEOUT = 10.0  # [s] to wait for messages that were announced and have not come


class Recorder(SimulationNode):
    """Records all topics of a run until every partner has finished and all has come.

    Parameters of the node, besides those of every node: ``file``, the bag to write; ``overwrite``.

    Raises
    ------
    InputError
        If there is no file to write, or it exists already.
    """

    def __init__(self, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__('recorder', parameters)
        self.declare_parameter('file', '')
        self.declare_parameter('overwrite', False)
        if not self.value('file'):
            raise InputError('recorder: give the bag to write, for example --record run.mcap')
        self.machine  # noqa: B018 - a bad scene is refused before a file is made
        self.writer = BagWriter(self.value('file'), overwrite=self.value('overwrite'))
        self._now = 0
        self._expected: Counter[str] = Counter()
        self._loss_deadline: float | None = None
        for topic, kind, qos in topics_of(self.machine, 'display' in self.partners):
            self._record(topic, kind, qos)
        self._add_topic(self.resolve_topic_name('progress'), Progress, RESULTS)
        self.create_timer(0.5, self.writer.flush)
        self.join()

    def _add_topic(self, topic: str, kind: Any, qos: QoSProfile) -> None:
        policies = Qos(
            qos.reliability.name.lower(),
            qos.durability.name.lower(),
            qos.history.name.lower(),
            qos.depth,
        )
        self.writer.add_topic(topic, type_name(kind), policies)

    def _record(self, topic: str, kind: Any, qos: QoSProfile) -> None:
        name = self.resolve_topic_name(topic)
        self._add_topic(name, kind, qos)
        callback = self._writing(name, type_name(kind))
        self.create_subscription(kind, topic, self.once_ready(callback), qos, raw=True)

    def _writing(self, topic: str, kind: str) -> Callable[[bytes], None]:
        """Callback that writes a serialised message at its simulated time."""
        offset = 8 if kind in _IN_ARRAY else 4

        def write(data: bytes) -> None:
            if kind != _NO_STAMP and len(data) >= offset + _STAMP.size:
                seconds, nanoseconds = _STAMP.unpack_from(data, offset)
                self._now = seconds * 1_000_000_000 + nanoseconds
            self.writer.write(topic, data, self._now)
            if self._loss_deadline is not None:
                self._finish()

        return write

    def on_progress(self, message: Any) -> None:
        """Record it, pass on how far the slowest has come, end when all have ended."""
        self._now = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        self.writer.write(self.resolve_topic_name('progress'), serialize(message), self._now)
        self.report_soon(self.partners_time())
        if self.partners_finished():
            self._expected = Counter()
            for known in self.progress_of.values():
                self._expected.update(
                    dict(zip(known.topics, (int(n) for n in known.counts), strict=True))
                )
            self._loss_deadline = time.monotonic() + LOSS_TIMEOUT
            self.create_timer(1.0, self._finish)
            self._finish()

    def _finish(self) -> None:
        """End once everything announced is in the bag."""
        if self.done:
            return
        counts = self.writer.counts
        missing = {
            topic: expected - counts.get(topic, 0)
            for topic, expected in self._expected.items()
            if topic in counts and counts[topic] < expected
        }
        if not missing:
            self.report(self.partners_time(), finished=True)
            self.done = True
        elif self._loss_deadline is not None and time.monotonic() > self._loss_deadline:
            topic, count = next(iter(missing.items()))
            raise RunError(f'recorder: {count} messages of {topic} were announced and never came')

    def destroy_node(self) -> None:
        """Finish the bag, whatever ended the run."""
        self.writer.close()
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Run this node by itself."""
    main_of(Recorder, args)


if __name__ == '__main__':
    main()
