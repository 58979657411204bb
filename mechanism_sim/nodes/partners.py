"""The other nodes of a run: their presence in the graph, and their reports."""

from __future__ import annotations

import math
import secrets
import time
from typing import Any
from weakref import WeakKeyDictionary

from mechanism_sim.errors import RunError
from mechanism_sim.messages import Float64
from mechanism_sim.nodes.described_node import DescribedNode

SETTLE = 0.3  # [s] until a process that has joined sees all earlier ones
_JOINED: WeakKeyDictionary[Any, float] = WeakKeyDictionary()  # [s] of joining, by context
_BEGAN = '_began'  # namespace of topics of new runs: hidden by ROS
SAY_AFTER, SAY_AGAIN = 2.0, 30.0
"""[s] after which a node says for whom it waits, and after which it says so again."""

FAREWELL = 1.0  # [s] delay before a node with a partner of another version ends
GONE_AFTER = 3.0  # [s] absence from the graph after which a partner is lost
LONG = 0.0, 1e12  # [s] range of durations


class Partners:
    """The nodes that a run waits for, and those that must receive this one's results.

    Parameters of the node: ``partners``, ``listeners``, ``partner_timeout``.
    """

    def __init__(self, node: DescribedNode) -> None:
        for key, about in (
            ('partners', 'Names of the other nodes of the run; in one text, separated by commas'),
            ('listeners', 'Nodes that must receive all results, or NODE:TOPIC; likewise'),
        ):
            node.declare_list(key, about, read_only=True)
        node.declare('partner_timeout', 20.0, 'How long to wait for partners [s]', LONG, True)
        self._node, self._listeners = node, node.names('listeners')
        #: names of the partners
        self.names = [p for p in node.names('partners') if p != node.get_name()]
        self.run = 0  #: number of the run of this node
        self.reports: dict[str, Any] = {}  #: last report by partner, of this run or the next
        self._seen: set[str] = set()
        self._ids: dict[str, tuple[int, ...]] = {}  # ids by partner at the start of this run
        self._different = ''
        self.alone = False  #: True if an earlier run would have been detected, and there is none
        self._mark: Any = None
        self._missing_since: dict[str, float] = {}
        self._said: dict[str, float] = {}  # [s] time of the last log entry by kind of waiting

    # --- their reports --------------------------------------------------------------------------

    def begin_run(self, number: int) -> None:
        """Discard reports of the previous run; a partner may already be in the new one."""
        self.run = number
        self.reports = {n: p for n, p in self.reports.items() if p.run >= number}

    def goes_on(self, number: int) -> bool:
        """True if a run is the present one, or the next."""
        return self.run <= number <= self.run + 1

    def see(self, message: Any) -> None:
        """Record that a node has reported, of any name and run."""
        self._seen.add(message.node)

    def take(self, message: Any) -> bool:
        """Store the report of a partner; False for other nodes and for the previous run."""
        if message.node not in self.names or not self.goes_on(message.run):
            return False
        self.reports[message.node] = message
        return True

    @property
    def _present_reports(self) -> list[Any]:
        """The last report of every partner in this run; None if there is none."""
        known = [self.reports.get(partner) for partner in self.names]
        return [r if r and r.run == self.run else None for r in known]

    @property
    def time(self) -> float:
        """Time [s] reached by every partner; infinite without partners."""
        return min((r.time if r else 0.0 for r in self._present_reports), default=float('inf'))

    @property
    def began(self) -> bool:
        """True if every partner is in the same run as this node."""
        return all(self._present_reports)

    @property
    def finished(self) -> bool:
        """True if every partner has published its last message."""
        return all(r and r.finished for r in self._present_reports)

    @property
    def another_follows(self) -> bool:
        """True if another run follows the one that partners have finished."""
        return any(report.again for report in self.reports.values())

    # --- their presence -------------------------------------------------------------------------

    def expect(self) -> None:
        """Start of waiting for partners."""
        now = time.monotonic()
        self._deadline = now + self._node.value('partner_timeout')
        self._settled = _JOINED.setdefault(self._node.context, now) + SETTLE

    def gathered(self) -> bool:
        """True if all are present; RunError if one is missing too long, or of another version."""
        name, now, ids = self._node.get_name(), time.monotonic(), self._present()
        self._ids.update(ids)
        present = [node for node, _ in ids]
        # the first node is not stopped by later ones of its name, which end themselves
        known = self.names if self._mark else [name, *self.names]
        self._refuse(present, dict.fromkeys(known, 1))
        self.alone = now > self._settled
        # A partner may have finished and left before this node is ready, or before
        # it was in the graph.
        self._seen.update(present)
        missing, unheard = [p for p in self.names if p not in self._seen], self._unheard()
        if not missing and not unheard:
            if now <= self._settled:
                return False
            if self._different:
                raise RunError(self._different)
            self._different = self._difference()
            # The partner has to find this node before it leaves, and to end by itself.
            self._settled = now + FAREWELL if self._different else self._settled
            return not self._different
        self.say_waiting(', '.join(missing) or ' on '.join(unheard or ()))
        if now <= self._deadline:
            return False
        said = f'{name}: waited {self._node.value("partner_timeout"):g} s for'
        if missing:
            raise RunError(
                f"{said} '{missing[0]}', which did not appear; start it ('mechanism-sim node "
                f"{missing[0]} --scene {self._node.value('scene')}') or leave it out"
            )
        listener, topic = unheard or ('', '')
        raise RunError(f"{said} '{listener}' to subscribe to {topic}; start it, or leave it out")

    def show_start(self) -> None:
        """Show the start time of this node in the graph, before the node itself."""
        name = f'{_BEGAN}/t{time.time_ns():020}_{secrets.token_hex(4)}'
        self._mark = self._node.create_publisher(Float64, name, 1)

    def came_first(self) -> bool:
        """True once no partner can be older than this node; RunError if one is.

        Among nodes that begin at the same time, the first waits until the others have left.
        """
        name, now = self._node.get_name(), time.monotonic()
        present = [node for node, _ in self._present()]
        others = present.count(name) > 1
        waits = others and self._is_first() and now <= self._deadline
        self._refuse(present, dict.fromkeys(self.names, 0) | {name: len(present) if waits else 1})
        return now > self._settled and not others

    def _is_first(self) -> bool:
        """True if no other node in the graph shows an earlier start."""
        own: str = self._mark.topic_name
        topics, above = self._node.get_topic_names_and_types(), f'{own.rpartition("/")[0]}/'
        return own == min([own, *(topic for topic, _ in topics if topic.startswith(above))])

    def _refuse(self, present: list[str], most: dict[str, int]) -> None:
        """RunError if there are more nodes of a name in the graph than allowed by `most`."""
        self.alone = False
        for name, count in most.items():
            if present.count(name) > count:
                raise RunError(
                    f"another '{name}' is running in this domain: end it, or give this run a "
                    'domain of its own (ROS_DOMAIN_ID=1), or a namespace (--namespace left)'
                )

    def check_presence(self) -> None:
        """Raise RunError if a partner has left before it finished.

        Another node of its name, as after a restart, has no state of the run.
        """
        now, present = time.monotonic(), self._present()
        self._ids = dict(present) | self._ids
        for partner in self.names:
            known, there = self.reports.get(partner), (partner, self._ids.get(partner)) in present
            if there or (known and known.finished) or self._node.done:
                self._missing_since.pop(partner, None)
            elif now - self._missing_since.setdefault(partner, now) > GONE_AFTER:
                anew = ', and another of its name has begun' if partner in dict(present) else ''
                raise RunError(
                    f"{self._node.get_name()}: '{partner}' left before the run was finished"
                    f'{anew}; what was received until then is kept'
                )

    def name_silent_topics(self) -> None:
        """Log the topics without a publisher."""
        node = self._node
        if silent := [t for t in node.heard if not node.get_publishers_info_by_topic(t)]:
            self.say_waiting(f'a publisher of {", ".join(silent)}')

    def say_waiting(
        self, for_whom: str, since: float | None = None, kind: str = 'partners'
    ) -> None:
        """Log the nodes this one waits for, after a delay, and at long intervals for each kind.

        Parameters
        ----------
        since : start of waiting by ``time.monotonic`` [s]; default: that for partners
        """
        now, began = time.monotonic(), self._settled if since is None else since
        if now > began + SAY_AFTER and now > self._said.get(kind, -math.inf) + SAY_AGAIN:
            self._said[kind] = now
            self._node.get_logger().info(f'waiting for {for_whom}')

    def _present(self) -> list[tuple[str, tuple[int, ...]]]:
        """Names and ids of the complete nodes in the graph, this one included."""
        # The last subscription and publisher of a node: if both are visible, all others are.
        node = self._node
        hearing = {s.node_name for s in node.get_subscriptions_info_by_topic('progress')}
        speaking = node.get_publishers_info_by_topic('progress')
        return [(p.node_name, tuple(p.endpoint_gid)) for p in speaking if p.node_name in hearing]

    def _difference(self) -> str:
        """Sentence on a partner with other message types, which would receive nothing."""
        node = self._node
        for topic in sorted(node.spoken):
            types: dict[str, set[tuple[str, str]]] = {}
            for seen in (node.get_publishers_info_by_topic, node.get_subscriptions_info_by_topic):
                for info in seen(topic):
                    if info.node_namespace == node.get_namespace():
                        known = info.topic_type, str(getattr(info, 'topic_type_hash', ''))
                        types.setdefault(info.node_name, set()).add(known)
            ours = types.get(node.get_name(), set())
            for partner in self.names:
                if ours and partner in types and not types[partner] & ours:
                    return (
                        f"{node.get_name()}: '{partner}' is of another version: it has another "
                        f'type of messages on {topic}; start all nodes of a run from one version'
                    )
        return ''

    def _unheard(self) -> tuple[str, str] | None:
        """A listener, and a topic of this node's results to which it has not yet subscribed."""
        node = self._node
        for topic in node.results if self._listeners else ():
            hearing = {s.node_name for s in node.get_subscriptions_info_by_topic(topic)}
            for listener in self._listeners:
                name, _, only = listener.partition(':')
                if name not in hearing and (not only or node.resolve_topic_name(only) == topic):
                    return name, topic
        return None
