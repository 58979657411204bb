"""The record of deliveries: what the nodes say they sent against what the bag holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class TopicAccount:
    """One topic: `sent` sums over the nodes that publish it; `lost` are those not in the bag."""

    topic: str
    sent: int
    recorded: int
    lost: int


@dataclass(frozen=True)
class Ledger:
    """The accounts of all topics that a node claims.

    A node that did not finish may have sent more than its last message says.
    """

    topics: tuple[TopicAccount, ...]
    finished: tuple[str, ...]  #: nodes
    unfinished: tuple[str, ...]  #: nodes
    lost: int  #: messages sent and not recorded, on all topics


class LedgerCollector:
    """Keeps the last Progress message of every node; a finished one is final."""

    def __init__(self) -> None:
        self._last: dict[str, Any] = {}
        self.end: float | None = None  #: [s] time up to which the furthest node came

    def add(self, message: Any) -> None:
        """Enter what a node says."""
        self.end = max(float(message.time), self.end if self.end is not None else -float('inf'))
        last = self._last.get(message.node)
        if last is None or not last.finished:
            self._last[message.node] = message

    def summary(self, recorded: Mapping[str, int]) -> Ledger | None:
        """The accounts; None without a message.

        Parameters
        ----------
        recorded : messages in the bag by full name of the topic
        """
        if not self._last:
            return None
        sent: Counter[str] = Counter()
        for message in self._last.values():
            for topic, count in zip(message.topics, message.counts, strict=True):
                sent[_full_name(topic, recorded)] += int(count)
        accounts = []
        for name in sorted(sent):
            held = recorded.get(name, 0)
            accounts.append(TopicAccount(name, sent[name], held, max(0, sent[name] - held)))
        finished, unfinished = (
            tuple(sorted(node for node, m in self._last.items() if bool(m.finished) is wanted))
            for wanted in (True, False)
        )
        return Ledger(tuple(accounts), finished, unfinished, sum(x.lost for x in accounts))


def _full_name(topic: str, recorded: Mapping[str, int]) -> str:
    """The name in the bag of what a node may call by a relative name."""
    if topic in recorded or topic.startswith('/'):
        return topic
    matches = [name for name in recorded if name.endswith(f'/{topic}')]
    return matches[0] if len(matches) == 1 else f'/{topic}'
