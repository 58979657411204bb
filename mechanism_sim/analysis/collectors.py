"""Sums over the messages of a bag: modes of joints, fields, deliveries, signals of sensors."""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mechanism_sim.analysis.published import PublishedRange
from mechanism_sim.analysis.series import Field, MessagePath, numeric_paths, recorded
from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Mode, ModeChange
from mechanism_sim.errors import InputError
from mechanism_sim.recording.reader import Bag
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.chain import QUANTITIES
from mechanism_sim.sensing.channel import Block, Channel
from mechanism_sim.sensing.indicators import Indicators, Moments
from mechanism_sim.sensing.spectra import TurnSegments, at_equal_angles, order_spectrum

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
    unknown: int  #: number of values that are NaN or infinite
    start: float  #: time of the first value [s]
    end: float  #: time of the last value [s]


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
        known = np.isfinite(s.values)
        if known.any():
            low, high = int(np.nanargmin(s.values)), int(np.nanargmax(s.values))
            ends = [(float(s.values[k]), float(s.t[k])) for k in (low, high)]
            count, first, last = len(s.t), float(s.t[0]), float(s.t[-1])
            unknown = count - int(known.sum())
            found.append(
                FieldRange(s.name, *ends[0], *ends[1], s.unit, count, unknown, first, last)
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
class MessageAccounts:
    """The accounts of all topics that a node claims.

    A node that did not finish may have sent more than its last message says.
    """

    topics: tuple[TopicAccount, ...]
    finished: tuple[str, ...]  #: names of nodes that finished
    unfinished: tuple[str, ...]  #: names of nodes that did not
    lost: int  #: number of messages sent and not recorded, on all topics


class MessageAccountsCollector:
    """Keeps the last Progress message of every node; a finished one is final."""

    def __init__(self) -> None:
        self._last: dict[str, Any] = {}
        self.end: float | None = None  #: time reached by the most advanced node [s]

    def add(self, message: Any) -> None:
        """Enter the report of a node."""
        self.end = max(float(message.time), self.end if self.end is not None else -float('inf'))
        last = self._last.get(message.node)
        if last is None or not last.finished:
            self._last[message.node] = message

    def summary(self, recorded: Mapping[str, int]) -> MessageAccounts | None:
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
        return MessageAccounts(
            tuple(accounts), finished, unfinished, sum(x.lost for x in accounts)
        )


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
    sample_rate: float  #: sampling rate [Hz]
    missing: int  #: number of samples missing between consecutive blocks
    overloads: int  #: number of samples clipped at full scale
    orders: tuple[tuple[float, float], ...]


class VibrationCollector:
    """Gathers blocks of samples by sensor: those of SensorBlock messages, or of a motion."""

    def __init__(self) -> None:
        self._sensors: dict[str, tuple[SignalCollector, Moments]] = {}
        self._overloads: Counter[str] = Counter()

    def add(self, message: Any) -> None:
        """Enter the block that follows."""
        signal, moments = self._of(message.sensor)
        moments.add(signal.add(message))
        self._overloads[message.sensor] += int(getattr(message, 'overloads', 0))

    def add_blocks(self, machine: Machine, channel: Channel, final: bool = False) -> None:
        """Enter the blocks of a channel that are full, or all that is left of its run."""
        for about, block in _blocks(machine, channel, final):
            signal, moments = self._of(channel.name)
            signal.add_samples(about, block.time, block.samples, block.triggered)
            moments.add(block.samples)
            self._overloads[channel.name] += block.overloads

    def _of(self, sensor: str) -> tuple[SignalCollector, Moments]:
        if sensor not in self._sensors:
            self._sensors[sensor] = SignalCollector(_KEPT), Moments()
        return self._sensors[sensor]

    def summary(self, turned: Callable[[Array], Array]) -> tuple[SensorSummary, ...]:
        """The sensors in alphabetical order, those without a sample left out.

        Parameters
        ----------
        turned : function of times (N,) [s]: revolutions of the crank; nan if unknown
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


@dataclass(frozen=True, eq=False)
class Signal:
    """Samples of one sensor, in runs of samples without a gap."""

    sensor: str
    link: str
    quantity: str  #: measured quantity, one of `QUANTITIES`
    rate: float  #: [Hz]
    starts: tuple[float, ...]  #: time of the first sample of each run [s]
    runs: tuple[Array, ...]  #: samples (N,) of each run

    @property
    def unit(self) -> str:
        """Unit of the samples."""
        return QUANTITIES[self.quantity]

    @property
    def times(self) -> list[Array]:
        """Due times of the samples of each run [s]."""
        pairs = zip(self.starts, self.runs, strict=True)
        return [start + np.arange(len(run)) / self.rate for start, run in pairs]

    @property
    def longest(self) -> Array:
        """The run with the most samples; the first of them if there are several."""
        return max(self.runs, key=len)

    def since(self, t: float) -> Signal:
        """The samples from a time [s] on."""
        found = self.between(t, np.inf)
        if found is None:
            raise InputError(f'sensor {self.sensor} has no samples after {t:.6g} s')
        return found

    def between(self, start: float, end: float) -> Signal | None:
        """The samples from one time [s] to another; None if there are none."""
        found = []
        for begin, t, run in zip(self.starts, self.times, self.runs, strict=True):
            # a sample that is due at the start but for rounding is due there
            first, last = np.searchsorted(t, [start - 1e-6 / self.rate, end])
            if first < last:
                found.append((begin + float(first) / self.rate, run[first:last]))
        if not found:
            return None
        starts, runs = zip(*found, strict=True)
        return replace(self, starts=starts, runs=runs)

    def over_turns(
        self, turned: Callable[[Array], Array], per_turn: int | None = None
    ) -> TurnSegments | None:
        """The signal over the angle of a shaft; None if it has no whole turn, or turns back.

        Parameters
        ----------
        turned : function of times (N,) [s]: revolutions of the shaft; nan if unknown
        per_turn : angles in a turn, see `at_equal_angles`
        """
        angles, values = [], []
        for t, run in zip(self.times, self.runs, strict=True):
            along = turned(t)
            known = np.isfinite(along).astype(np.int8)
            ends = np.flatnonzero(np.diff(known, prepend=0, append=0)).tolist()
            for first, end in zip(ends[::2], ends[1::2], strict=True):
                angles.append(along[first:end])
                values.append(run[first:end])
        try:
            return at_equal_angles(angles, values, per_turn)
        except ValueError:
            return None


class SignalCollector:
    """Puts the signal of one sensor together from its blocks.

    Parameters
    ----------
    most : samples to keep; older ones are forgotten when there are more
    """

    def __init__(self, most: int | None = None) -> None:
        self.missing = 0  #: samples between blocks that should meet and do not
        self._most = most
        self._about: tuple[str, str, str, float] | None = None
        self._blocks: deque[tuple[float, bool, Array]] = deque()  # start, begins a run, samples
        self._kept = 0
        self._due: float | None = None

    def add(self, message: Any) -> Array:
        """Add the SensorBlock that follows, and return its samples (N,)."""
        samples = np.asarray(message.samples, np.float64)
        about = message.sensor, message.link, message.quantity, float(message.sample_rate)
        self.add_samples(about, float(message.time), samples, bool(message.triggered))
        return samples

    def add_samples(
        self, about: tuple[str, str, str, float], time: float, samples: Array, triggered: bool
    ) -> None:
        """Add samples (N,) from a time [s] on, `about` being sensor, link, quantity and rate."""
        if not len(samples):
            return
        rate = about[3]
        late = 0 if self._due is None else round((time - self._due) * rate)
        if not triggered:
            self.missing += max(0, late)
        apart = self._due is None or late != 0 or triggered
        self._about, self._due = about, time + len(samples) / rate
        self._blocks.append((time, apart, samples))
        self._kept += len(samples)
        while self._most and self._kept - len(self._blocks[0][2]) >= self._most:
            self._kept -= len(self._blocks.popleft()[2])

    def signal(self) -> Signal | None:
        """The signal so far; None without a sample."""
        if self._about is None:
            return None
        starts: list[float] = []
        runs: list[list[Array]] = []
        for time, apart, values in self._blocks:
            if apart or not runs:
                starts.append(time)
                runs.append([])
            runs[-1].append(values)
        return Signal(*self._about, tuple(starts), tuple(map(np.concatenate, runs)))


class SignalCollectors(dict[str, SignalCollector]):
    """Signals of several sensors by name."""

    def add(self, message: Any) -> None:
        """Add the SensorBlock that follows, of any of them."""
        self.setdefault(message.sensor, SignalCollector()).add(message)

    def signals(self) -> dict[str, Signal]:
        """Signals that have samples, in alphabetical order of their names."""
        return {name: s for name, c in sorted(self.items()) if (s := c.signal())}


def measured(machine: Machine, motion: Motion, sensor: str) -> Signal:
    """The signal of a sensor of the scene, computed from a motion from the start of a run on.

    It is what the node `sensors` publishes, to the last bit.
    """
    channel, collector = machine.channel(sensor), SignalCollector()
    channel.take(motion)
    for about, block in _blocks(machine, channel, final=True):
        collector.add_samples(about, block.time, block.samples, block.triggered)
    channel.warn()
    signal = collector.signal()
    if signal is None:
        raise InputError(f'sensor {sensor} takes no sample in this run')
    return signal


def _blocks(
    machine: Machine, channel: Channel, final: bool
) -> Iterator[tuple[tuple[str, str, str, float], Block]]:
    """Sensor, link, quantity and rate, and the blocks of a channel."""
    scene = machine.scene.sensors[channel.name]
    about = channel.name, scene.carrier(machine), scene.measures, scene.sample_rate
    yield from ((about, block) for block in channel.blocks(final))
