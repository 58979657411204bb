"""Base of all nodes of a simulation: scene, partners, record of deliveries."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.messages import (
    DiagnosticStatus,
    Progress,
    SetParametersResult,
    stamp,
    uint64_array,
)
from mechanism_sim.nodes.described_node import DescribedNode, Diagnosis
from mechanism_sim.nodes.middleware import Future, Parameter, publish_all
from mechanism_sim.nodes.partners import LONG, Partners
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.scene_values import Content, next_machine
from mechanism_sim.scene import Machine, run_length

_LOOK_PERIOD = 0.02  # [s] polling interval of the graph until all partners are present
_REPORT_PERIOD = 0.01  # [s] interval of reports that are not urgent


class SimulationNode(DescribedNode):
    """A node with a scene that works together with partners.

    Parameters of the node: ``scene`` (name or path), ``overrides`` (``PATH=VALUE`` each,
    an array or one a line; others hold from the next run on), ``duration`` [s] (0: one
    revolution), ``partners`` (names of the other nodes of the run, an array or separated by
    commas), ``listeners`` (likewise, of other nodes that must receive all of this one's results
    from the first on, such as that of ``ros2 bag record``; ``NODE:TOPIC`` for one topic),
    ``partner_timeout`` [s], ``frame_prefix``, put before the name of every frame (the namespace,
    if it is not given).

    Subclasses make their endpoints, the results first, and then `join`; they work in `on_ready`
    and after. A node is `done` when it has nothing left to do. Messages received while it is not
    `active` are queued.

    Raises
    ------
    InputError
        If the scene is not valid.
    RunError
        From callbacks: a partner is missing, or left before it was finished.
    """

    def __init__(self, name: str, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__(name, parameters)
        self.ready = False
        self._once_ready: list[Future] = []  # futures of `until_ready`
        self.active = True
        self.counts: Counter[str] = Counter()
        self.partners = Partners(self)  #: other nodes of the run
        self.declare_frames()
        self._content = Content.declare(self)
        self.add_on_set_parameters_callback(self._judge_content)
        about = 'Length of the run [s]; 0: that of the scene, or the turns that bring all again'
        self.declare('duration', 0.0, about, LONG, read_only=True)
        self._soon: float | None = None
        self._early: list[tuple[Callable[[Any], None], Any]] = []
        self._reported, self._finished = 0.0, False
        #: arrival of the run's first message, by ``time.monotonic`` [s]
        self.first_heard: float | None = None
        #: callbacks before a progress report of a partner, with the number of its run, and after
        self.before_report: Callable[[int], object] = lambda _: None
        self.after_report: Callable[[], None] = lambda: None

    @property
    def run(self) -> int:
        """Number of the run."""
        return self.partners.run

    @cached_property
    def machine(self) -> Machine:
        """The machine of the scene."""
        return self._content.load()

    @cached_property
    def duration(self) -> float:
        """Length of the run [s]."""
        return run_length(self.machine, None, self.value('duration') or None)

    def _judge_content(self, parameters: list[Parameter]) -> Any:
        """Refuse a scene with which no run of these nodes could begin."""
        result = SetParametersResult(successful=True)
        asked = Content.of(self).changed(parameters)
        if asked != Content.of(self):
            try:
                next_machine(self.machine, asked)
            except InputError as error:
                result.successful, result.reason = False, str(error)
        return result

    # --- partners -----------------------------------------------------------------------------

    def join(self) -> None:
        """Announce this node: its endpoints exist, its partners may start."""
        handle = self.once_ready(self._on_progress)

        def take(message: Any) -> None:
            self.partners.see(message)
            handle(message)

        self.create_subscription(Progress, 'progress', take, RESULTS)
        # Declared last: once it is in the graph, all other endpoints are, too.
        self._progress = self.create_publisher(Progress, 'progress', RESULTS)
        self.create_timer(_REPORT_PERIOD, self._report_if_due)
        self.publish_diagnostics()
        self.partners.expect()
        self._watch = self.create_timer(_LOOK_PERIOD, self._look)

    def once_ready(self, handle: Callable[[Any], None]) -> Callable[[Any], None]:
        """Callback that keeps messages for `handle` until all partners are there.

        Messages of another run on the same network are thus never taken for a partner's.
        """

        def take(message: Any) -> None:
            if self.first_heard is None:
                self.first_heard = time.monotonic()
            if self.ready and self.active:
                handle(message)
            else:
                self._early.append((handle, message))

        return take

    async def until_ready(self) -> None:
        """Wait for all partners, since services exist before them."""
        if not self.ready:
            there: Future = Future()
            self._once_ready.append(there)
            await there

    def _take_early(self) -> None:
        """Handle messages received while this node was not ready, or not active."""
        early, self._early = self._early, []
        for handle, message in early:
            handle(message)

    def on_ready(self) -> None:
        """Start of the work, once all partners are present."""

    def on_progress(self, message: Any) -> None:
        """Progress report of a partner."""
        self.after_report()

    def _look(self) -> None:
        """Begin when all partners are present; then check that none leaves."""
        if self.ready:
            if self.first_heard is None and not self.done:
                self.partners.name_silent_topics()
            self.partners.check_presence()
        elif self.partners.gathered():
            self.ready = True
            self.destroy_timer(self._watch)
            self._watch = self.create_timer(0.5, self._look)
            self.on_ready()
            if self.active:
                self._take_early()
            for waiting in self._once_ready:
                waiting.set_result(None)

    def _on_progress(self, message: Any) -> None:
        if message.node in self.partners.names:
            self.before_report(message.run)
        if self.partners.take(message):
            self.on_progress(message)

    def begin_run(self, number: int) -> None:
        """Reset to time 0: records of deliveries, state of partners, machine."""
        self._finished, self.first_heard = False, time.monotonic()
        if Content.of(self) != self._content:
            self.forget_machine()
        self.counts.clear()
        self.partners.begin_run(number)

    def forget_machine(self) -> None:
        """Discard the machine; the next one is built from the present parameters."""
        self._content = Content.of(self)
        for derived in ('machine', 'duration'):
            vars(self).pop(derived, None)

    # --- record of deliveries -------------------------------------------------------------------

    def send(self, publisher: Any, message: Any) -> None:
        """Publish a message, and count it."""
        publisher.publish(message)
        self.counts[publisher.topic_name] += 1

    def send_all(
        self, publisher: Any, count: int, make: Callable[..., Sequence[Any]], *given: Any
    ) -> None:
        """Publish messages in order and count them; they are made only for subscribers."""
        if count and publisher.is_heard():
            publish_all(publisher, make(*given))
        self.counts[publisher.topic_name] += count

    def report_soon(self, t: float) -> None:
        """Report within `_REPORT_PERIOD`; calls within that time are merged."""
        self._soon = t

    def _report_if_due(self) -> None:
        if self._soon is not None:
            self.report(self._soon)

    def report(self, t: float, finished: bool = False, again: bool = False) -> None:
        """Publish the progress of this node and its message counts, this one included.

        A report of its end is the last of a run, whatever messages come later.
        """
        self._soon = None
        if self._finished:
            return
        self._finished = finished
        self.counts[self._progress.topic_name] += 1
        message = Progress(
            node=self.get_name(),
            run=self.run,
            time=float(t),
            finished=finished,
            again=again,
            topics=list(self.counts),
            counts=uint64_array(list(self.counts.values())),
        )
        message.header.stamp = stamp(t)
        self._progress.publish(message)
        self._reported = t

    # --- diagnostics --------------------------------------------------------------------------

    def diagnose(self) -> Diagnosis:
        """Diagnose the state of this node; subclasses add to it."""
        if not self.ready:
            return Diagnosis(DiagnosticStatus.OK, 'waiting for its partners', {})
        sent = sum(self.counts.values())
        values = {'run': self.run, 'time [s]': self._reported, 'messages published': sent}
        message = 'finished' if self.done else 'running'
        return Diagnosis(DiagnosticStatus.OK, message, dict(values))
