"""Base of all nodes of a simulation: the scene, their partners, their record of deliveries."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.messages import (
    DiagnosticStatus,
    Progress,
    SetParametersResult,
    stamp,
    uint64_array,
)
from mechanism_sim.nodes.described_node import DescribedNode, Diagnosis
from mechanism_sim.nodes.middleware import Parameter, publish_all
from mechanism_sim.nodes.qos import RESULTS
from mechanism_sim.nodes.scene_values import SCENE_PARAMETERS, Content, next_machine
from mechanism_sim.scene import Machine, run_length

LOOK_PERIOD = 0.02  # [s] between looks at the graph until everybody is there
SETTLE = 0.3  # [s] until a node that has joined can be sure to see who was there before
REPORT_PERIOD = 0.01  # [s] between reports that are not urgent
SAY_AFTER, SAY_AGAIN = 2.0, 30.0
"""[s] after which a node says for whom it waits, and after which it says so again."""

FAREWELL = 1.0  # [s] a node stays that has found a partner of another version
GONE_AFTER = 3.0  # [s] a partner may be out of the graph before it counts as lost
LONG = 0.0, 1e12  # [s]


class SimulationNode(DescribedNode):
    """A node with a scene that works together with partners.

    Parameters of the node: ``scene`` (name or path), ``overrides`` (``PATH=VALUE``, one a line;
    another text holds from the next run on), ``duration`` [s] (0: one revolution), ``partners``
    (names of the other nodes of the run, separated by commas), ``listeners`` (names of other
    nodes that must receive all of this one's results from the first on, such as that of ``ros2
    bag record``; ``NODE:TOPIC`` for one topic), ``partner_timeout`` [s], ``frame_prefix``, put
    before the name of every frame (the namespace, if it is not given).

    Subclasses make their endpoints, the results first, and then `join`; they work in `on_ready`
    and after. A node is `done` when it has nothing left to do. What comes while it is not `active`
    waits.

    Attributes
    ----------
    first_heard : when the first message of the run came, by ``time.monotonic`` [s]

    Raises
    ------
    InputError
        If the scene is not good.
    RunError
        From callbacks: a partner never came, or left before it was finished.
    """

    def __init__(self, name: str, parameters: Sequence[Parameter] = ()) -> None:
        super().__init__(name, parameters)
        self.ready = False
        self.active = True
        self.run = 0
        self.progress_of: dict[str, Any] = {}
        self.counts: Counter[str] = Counter()
        space = self.get_namespace().strip('/')
        for key, default, about in (
            ('partners', '', 'Names of the other nodes of the run, separated by commas'),
            (
                'listeners',
                '',
                'Nodes that must receive all results, or NODE:TOPIC; commas between',
            ),
            ('frame_prefix', f'{space}/' if space else '', 'Before the name of every frame'),
        ):
            self.declare(key, default, about, read_only=True)
        for key, default, about in SCENE_PARAMETERS:
            self.declare(key, default, f'{about}; from the next reset on; set that of crank_drive')
        self._content = Content.of(self)
        self.add_on_set_parameters_callback(self._judge_content)
        for key, length, about in (
            ('duration', 0.0, 'Length of the run [s]; 0: that of the scene, or one revolution'),
            ('partner_timeout', 20.0, 'How long to wait for partners [s]'),
        ):
            self.declare(key, length, about, LONG, read_only=True)
        self.partners = [p for p in self.names('partners') if p != name]
        self._listeners = self.names('listeners')
        self._different = ''
        self._missing_since: dict[str, float] = {}
        self._seen: set[str] = set()
        self._reporters: set[str] = set()
        self._soon: float | None = None
        self._early: list[tuple[Callable[[Any], None], Any]] = []
        self._reported, self._finished = 0.0, False
        self.first_heard: float | None = None

    def frame(self, link: str) -> str:
        """Name of the frame of a link."""
        return f'{self.value("frame_prefix")}{link}'

    @cached_property
    def machine(self) -> Machine:
        """The machine of the scene."""
        return self._content.load()

    @cached_property
    def duration(self) -> float:
        """Length of the run [s]."""
        return run_length(self.machine, None, self.value('duration') or None)

    def _judge_content(self, parameters: list[Parameter]) -> Any:
        """Refuse a scene that no run of these nodes could begin with."""
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
        """Announce this node: its other endpoints are there, its partners may start."""
        handle = self.once_ready(self._on_progress)

        def take(message: Any) -> None:
            self._reporters.add(message.node)
            handle(message)

        self.create_subscription(Progress, 'progress', take, RESULTS)
        # The last endpoint to be declared: who sees it in the graph can rely on all others.
        self._progress = self.create_publisher(Progress, 'progress', RESULTS)
        self.create_timer(REPORT_PERIOD, self._report_if_due)
        self.publish_diagnostics()
        self._deadline = time.monotonic() + self.value('partner_timeout')
        self._settled = time.monotonic() + SETTLE
        self._watch = self.create_timer(LOOK_PERIOD, self._look)

    def once_ready(self, handle: Callable[[Any], None]) -> Callable[[Any], None]:
        """Callback that keeps messages for `handle` until all partners are there.

        What another run on the same network publishes is then never taken for a partner's.
        """

        def take(message: Any) -> None:
            if self.first_heard is None:
                self.first_heard = time.monotonic()
            if self.ready and self.active:
                handle(message)
            else:
                self._early.append((handle, message))

        return take

    def _take_early(self) -> None:
        """Handle what came while this node was not ready, or not active."""
        early, self._early = self._early, []
        for handle, message in early:
            handle(message)

    def on_ready(self) -> None:
        """All partners are there."""

    def on_progress(self, message: Any) -> None:
        """A partner reports how far it has come."""

    def _look(self) -> None:
        # The last subscription of a node and its last publisher: who sees both sees all before.
        hearing = {s.node_name for s in self.get_subscriptions_info_by_topic('progress')}
        present = [
            p.node_name
            for p in self.get_publishers_info_by_topic('progress')
            if p.node_name in hearing
        ]
        if not self.ready and present.count(self.get_name()) > 1:
            raise RunError(
                f"another '{self.get_name()}' is running in this domain: end it, or give this run "
                'a domain of its own (ROS_DOMAIN_ID=1)'
            )
        # One that was there may have done its part and left before this node is ready, or before
        # the graph had it.
        self._seen.update(present, self._reporters)
        missing = [p for p in self.partners if p not in (present if self.ready else self._seen)]
        if not self.ready:
            unheard = self._unheard()
            if not missing and not unheard and time.monotonic() > self._settled:
                if self._different:
                    raise RunError(self._different)
                if different := self._difference():
                    # The partner has to find this node before it leaves, and to end by itself.
                    self._different, self._settled = different, time.monotonic() + FAREWELL
                    return
                self.ready = True
                self.destroy_timer(self._watch)
                self._watch = self.create_timer(0.5, self._look)
                self.on_ready()
                if self.active:
                    self._take_early()
                return
            if (missing or unheard) and time.monotonic() > self._settled + SAY_AFTER:
                self._say_waiting(', '.join(missing) or ' on '.join(unheard or ()))
            if missing and time.monotonic() > self._deadline:
                waited = self.value('partner_timeout')
                raise RunError(
                    f"{self.get_name()}: waited {waited:g} s for '{missing[0]}', which never came;"
                    f" start it ('mechanism-sim node {missing[0]} --scene {self.value('scene')}')"
                    ' or take it off the partners'
                )
            if unheard and time.monotonic() > self._deadline:
                listener, topic = unheard
                waited = self.value('partner_timeout')
                raise RunError(
                    f"{self.get_name()}: waited {waited:g} s for '{listener}' to subscribe to "
                    f'{topic}; start it, or take it off the listeners'
                )
            return
        now = time.monotonic()
        if self.first_heard is None and not self.done and now > self._settled + SAY_AFTER:
            silent = [t for t in self.heard if not self.get_publishers_info_by_topic(t)]
            if silent:
                self._say_waiting(f'somebody who publishes {", ".join(silent)}')
        for partner in self.partners:
            known = self.progress_of.get(partner)
            if partner not in missing or (known and known.finished) or self.done:
                self._missing_since.pop(partner, None)
            elif now - self._missing_since.setdefault(partner, now) > GONE_AFTER:
                raise RunError(
                    f"{self.get_name()}: '{partner}' left before the run was finished; what came "
                    'until then is kept'
                )

    def _say_waiting(self, for_whom: str) -> None:
        self.get_logger().info(f'waiting for {for_whom}', throttle_duration_sec=SAY_AGAIN)

    def _difference(self) -> str:
        """Describe a partner with other message types, which would receive nothing."""
        for topic in sorted(self.spoken):
            types: dict[str, set[tuple[str, str]]] = {}
            for seen in (self.get_publishers_info_by_topic, self.get_subscriptions_info_by_topic):
                for info in seen(topic):
                    if info.node_namespace == self.get_namespace():
                        known = info.topic_type, str(getattr(info, 'topic_type_hash', ''))
                        types.setdefault(info.node_name, set()).add(known)
            ours = types.get(self.get_name(), set())
            for partner in self.partners:
                if ours and partner in types and not types[partner] & ours:
                    return (
                        f"{self.get_name()}: '{partner}' is of another version: it has another "
                        f'type of messages on {topic}; start all nodes of a run from one version'
                    )
        return ''

    def _unheard(self) -> tuple[str, str] | None:
        """A listener and a topic of results of this node that it has not subscribed to yet."""
        for topic in self.results if self._listeners else ():
            hearing = {s.node_name for s in self.get_subscriptions_info_by_topic(topic)}
            for listener in self._listeners:
                name, _, only = listener.partition(':')
                if name not in hearing and (not only or self.resolve_topic_name(only) == topic):
                    return name, topic
        return None

    def _on_progress(self, message: Any) -> None:
        # A partner may still report of the run before.
        if message.node in self.partners and self.goes_on(message.run):
            self.progress_of[message.node] = message
            self.on_progress(message)

    def goes_on(self, number: int) -> bool:
        """True if a run is the present one, or the next."""
        return self.run <= number <= self.run + 1

    def begin_run(self, number: int) -> None:
        """Everything begins anew at time 0: records of deliveries, state of partners, machine."""
        self.run, self._finished = number, False
        self.first_heard = time.monotonic()
        if Content.of(self) != self._content:
            self.forget_machine()
        self.counts.clear()
        self.progress_of = {n: p for n, p in self.progress_of.items() if p.run >= number}

    def forget_machine(self) -> None:
        """Let the machine be made anew, of the scene that the parameters have now."""
        self._content = Content.of(self)
        for derived in ('machine', 'duration'):
            vars(self).pop(derived, None)

    def partners_time(self) -> float:
        """Time [s] up to which every partner has come; infinite without partners."""
        reports = [self._report_of(partner) for partner in self.partners]
        return min((r.time if r else 0.0 for r in reports), default=float('inf'))

    def partners_began(self) -> bool:
        """True if every partner is in the same run as this node."""
        return all(self._report_of(partner) for partner in self.partners)

    def partners_finished(self) -> bool:
        """True if every partner has published its last."""
        reports = [self._report_of(partner) for partner in self.partners]
        return all(r is not None and r.finished for r in reports)

    def another_follows(self) -> bool:
        """True if another run follows the one that partners have finished."""
        return any(report.again for report in self.progress_of.values())

    def _report_of(self, partner: str) -> Any:
        """The last report of a partner in this run."""
        known = self.progress_of.get(partner)
        return known if known and known.run == self.run else None

    # --- record of deliveries -------------------------------------------------------------------

    def send(self, publisher: Any, message: Any) -> None:
        """Publish a message, and count it."""
        publisher.publish(message)
        self.counts[publisher.topic_name] += 1

    def send_all(self, publisher: Any, messages: Sequence[bytes]) -> None:
        """Publish serialised messages in their order, and count them."""
        publish_all(publisher, messages)
        self.counts[publisher.topic_name] += len(messages)

    def report_soon(self, t: float) -> None:
        """Report within `REPORT_PERIOD`; calls within that time make one report."""
        self._soon = t

    def _report_if_due(self) -> None:
        if self._soon is not None:
            self.report(self._soon)

    def report(self, t: float, finished: bool = False, again: bool = False) -> None:
        """Publish how far this node has come, and what it has published, this included.

        A report of its end is the last of a run, in whatever order messages come after it.
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
        """How this node is; subclasses add to it."""
        if not self.ready:
            return Diagnosis(DiagnosticStatus.OK, 'waiting for its partners', {})
        sent = sum(self.counts.values())
        values = {'run': self.run, 'time [s]': self._reported, 'messages published': sent}
        message = 'finished' if self.done else 'running'
        return Diagnosis(DiagnosticStatus.OK, message, dict(values))
