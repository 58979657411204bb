"""Sums over the messages of a bag: modes of joints, fields, deliveries, signals of sensors."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechanism_sim.analysis.message_paths import Field, MessagePath, numeric_paths
from mechanism_sim.analysis.published import PublishedRange
from mechanism_sim.analysis.series import recorded
from mechanism_sim.analysis.signals import SignalCollector
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.events import Mode, ModeChange
from mechanism_sim.recording import Bag
from mechanism_sim.sensing.indicators import Indicators, Moments
from mechanism_sim.sensing.spectra import order_spectrum

_KEPT = 2**18  # samples of each sensor, the last ones, of which the strongest orders are sought
_LONGEST = 1000  # items of an array; more of them are pictures and scans


@dataclass(frozen=True)
class JointModes:
    """The modes of one joint over a run: `share` by name of the mode sums to 1."""

    joint: str
    changes: int
    share: dict[str, float]


class ModeShares:
    """Adds up the time between changes of mode: exact, since every change is recorded."""

    def __init__(self) -> None:
        self._first: dict[str, ModeChange] = {}
        self._last: dict[str, ModeChange] = {}
        self._changes: dict[str, int] = defaultdict(int)
        self._time: dict[str, dict[Mode, float]] = defaultdict(lambda: defaultdict(float))

    def add(self, changes: Iterable[ModeChange]) -> None:
        """Enter the changes that follow."""
        for change in changes:
            joint = change.joint
            if joint in self._last:
                last = self._last[joint]
                self._time[joint][last.mode] += change.t - last.t
            else:
                self._first[joint] = change
            self._last[joint] = change
            # the first mode of a run is announced, not changed to
            self._changes[joint] += change.previous != Mode.UNKNOWN

    def summary(self, start: float, end: float) -> tuple[JointModes, ...]:
        """The shares over the span of the run from `start` to `end` [s]."""
        joints = []
        for joint in sorted(self._first):
            time = dict(self._time[joint])
            first, last = self._first[joint], self._last[joint]
            for lasted, mode in ((first.t - start, first.previous), (end - last.t, last.mode)):
                time[mode] = time.get(mode, 0.0) + max(0.0, lasted)
            span = sum(time.values())
            share = {
                mode.name.lower(): lasted / span
                for mode, lasted in sorted(time.items())
                if lasted > 0
            }
            joints.append(JointModes(joint, self._changes[joint], share))
        return tuple(joints)


@dataclass(frozen=True)
class FieldRange(PublishedRange):
    """The range of a field, or of an item of an array, whose path is `quantity`."""

    unit: str
    samples: int
    start: float  #: [s] of the first of them
    end: float  #: [s]


def field_ranges(bag: Bag) -> tuple[FieldRange, ...]:
    """The ranges of all numeric fields that the first message of a topic has."""
    lost, paths = bag.unreadable(), []
    for topic in (t.name for t in bag.topics.values() if t.count and t.name not in lost):
        for _, message, _ in bag.messages(topic):
            paths += [
                MessagePath(f'{topic}.{".".join(fields)}', topic, tuple(map(Field, fields)))
                for fields in numeric_paths(message, _LONGEST)
            ]
            break
    if not paths:
        raise InputError(f'{bag.path} holds nothing that can be analysed: {bag.contents()}')
    found = []
    for s in (s for group in recorded(bag, paths) for s in group):
        if np.isfinite(s.values).any():
            low, high = int(np.nanargmin(s.values)), int(np.nanargmax(s.values))
            ends = [(float(s.values[k]), float(s.t[k])) for k in (low, high)]
            found.append(
                FieldRange(s.name, *ends[0], *ends[1], s.unit, len(s.t), *map(float, s.t[[0, -1]]))
            )
    return tuple(found)


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


@dataclass(frozen=True)
class SensorSummary(Indicators):
    """The signal of one sensor, with its indicators.

    orders: the strongest lines over the crank's orders as (order, amplitude), of the last quarter
    of a million samples or fewer; empty where no whole turn is recorded.
    """

    sensor: str
    link: str
    quantity: str
    unit: str
    sample_rate: float  #: [Hz]
    missing: int  #: samples between blocks that should meet and do not
    overloads: int  #: samples cut at the end of the range
    orders: tuple[tuple[float, float], ...]


class VibrationCollector:
    """Gathers SensorBlock messages by sensor."""

    def __init__(self) -> None:
        self._sensors: dict[str, tuple[SignalCollector, Moments]] = {}
        self._overloads: Counter[str] = Counter()

    def add(self, message: Any) -> None:
        """Enter the block that follows."""
        name = message.sensor
        if name not in self._sensors:
            self._sensors[name] = SignalCollector(_KEPT), Moments()
        signal, moments = self._sensors[name]
        moments.add(signal.add(message))
        self._overloads[name] += int(getattr(message, 'overloads', 0))

    def summary(self, turned: Callable[[Array], Array]) -> tuple[SensorSummary, ...]:
        """The sensors in alphabetical order, those without a sample left out.

        Parameters
        ----------
        turned : revolutions of the crank by times (N,) [s]; nan where they are not known
        """
        found = []
        for name, (collector, moments) in sorted(self._sensors.items()):
            if (signal := collector.signal()) is None:
                continue
            turns = signal.over_turns(turned)
            found.append(
                SensorSummary(
                    **vars(moments.indicators()),
                    sensor=name,
                    link=signal.link,
                    quantity=signal.quantity,
                    unit=signal.unit,
                    sample_rate=signal.rate,
                    missing=collector.missing,
                    overloads=self._overloads[name],
                    orders=tuple(order_spectrum(turns).strongest(3)) if turns else (),
                )
            )
        return tuple(found)
