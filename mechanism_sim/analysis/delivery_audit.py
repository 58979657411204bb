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
        self._counts: dict[str, dict[str, int]] = {}
        self._finished: dict[str, bool] = {}
        self.end: float | None = None  #: [s] time up to which the furthest node came

    def add(self, message: Any) -> None:
        """Take in what a node says."""
        self.end = max(float(message.time), self.end if self.end is not None else -float('inf'))
        if self._finished.get(message.node):
            return
        self._finished[message.node] = bool(message.finished)
        counts = (int(count) for count in message.counts)
        self._counts[message.node] = dict(zip(message.topics, counts, strict=True))

    def summary(self, recorded: Mapping[str, int]) -> Ledger | None:
        """Return the accounts; None without a message.

        Args:
            recorded: Messages in the bag by full name of the topic.

        """
        if not self._counts:
            return None
        sent: Counter[str] = Counter()
        for counts in self._counts.values():
            for topic, count in counts.items():
                sent[_full_name(topic, recorded)] += count
        accounts = tuple(
            _account(name, sent[name], recorded.get(name, 0)) for name in sorted(sent)
        )
        return Ledger(
            accounts,
            tuple(sorted(node for node, finished in self._finished.items() if finished)),
            tuple(sorted(node for node, finished in self._finished.items() if not finished)),
            sum(account.lost for account in accounts),
        )


def _account(topic: str, sent: int, recorded: int) -> TopicAccount:
    return TopicAccount(topic, sent, recorded, max(0, sent - recorded))


def _full_name(topic: str, recorded: Mapping[str, int]) -> str:
    """Return the name in the bag of what a node may call by a relative name."""
    if topic in recorded or topic.startswith('/'):
        return topic
    matches = [name for name in recorded if name.endswith(f'/{topic}')]
    return matches[0] if len(matches) == 1 else f'/{topic}'
