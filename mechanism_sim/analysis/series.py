"""Numbers of a run over time: out of messages of any bag, or of the motion itself."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mechanism_sim.analysis.message_paths import Filter, Items, MessagePath, MissingFieldError
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.messages import MessageError, type_name
from mechanism_sim.messages.units import units_of
from mechanism_sim.recording import Bag, displacements
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.instants import instants
from mechanism_sim.results.quantity import Quantity
from mechanism_sim.results.ranges import search
from mechanism_sim.results.solution import Piece
from ros_interfaces.stamps import seconds

_EVENTS = (
    'mechanism_sim/msg/Impact',
    'mechanism_sim/msg/ModeChange',
    'mechanism_sim/msg/SceneChange',
)
_EPOCH = 1e9  # [s]: what is later counts from 1970
_PER_TURN, _FEWEST, _MOST = 360.0, 2000, 40_000  # instants


@dataclass(frozen=True, eq=False)
class Series:
    """A quantity over time.

    Attributes
    ----------
    name : what was asked for, and which part of it
    unit : SI; empty for a number, two with an ``or`` where nobody says which
    t, values : (N,) [s], and in the unit
    events : whether values hold at their instants only
    ideal : whether it is of the same machine with ideal joints
    words, of : title of the quantity, and the coordinate, joint or link that it is of, where known
    """

    name: str
    unit: str
    t: Array
    values: Array
    events: bool = False
    ideal: bool = False
    words: str = ''
    of: str = ''

    @classmethod
    def of_quantity(cls, q: Quantity, t: Array, values: Array, ideal: bool = False) -> Series:
        """Of a quantity of the catalogue."""
        return cls(q.name, q.unit, t, values, ideal=ideal, words=q.title, of=q.of)

    def within(self, start: float | None, end: float | None) -> Series:
        """The part from `start` to `end` [s]."""
        kept = np.ones(len(self.t), bool)
        kept &= True if start is None else self.t >= start
        kept &= True if end is None else self.t <= end
        return replace(self, t=self.t[kept], values=self.values[kept])


def recorded(bag: Bag, paths: Sequence[MessagePath]) -> list[list[Series]]:
    """Values to which each path leads in the messages of a bag, in one pass over it.

    Times are those that messages say themselves, else their stamps, else when they were logged;
    where these count from 1970, from the start of the bag. Arrays of samples, which come with a
    sample rate, are spread over time.
    """
    origin = bag.start * 1e-9 if bag.start * 1e-9 > _EPOCH else 0.0
    by_topic: dict[str, list[_Collector]] = {}
    collectors = [_Collector(path, origin) for path in paths]
    for path, collector in zip(paths, collectors, strict=True):
        by_topic.setdefault(path.topic, []).append(collector)
    for topic, message, logged in bag.messages(by_topic):
        for collector in by_topic[topic]:
            collector.add(message, logged / 1e9)
    sliding = displacements(bag)
    return [collector.series(bag, sliding) for collector in collectors]


class _Collector:
    """Gathers what one path leads to."""

    def __init__(self, path: MessagePath, origin: float) -> None:
        self._path, self._origin = path, origin
        self._found: dict[tuple[str, ...], tuple[array[float], array[float]]] = {}
        self._type, self._unit = '', ''
        self._missed: MissingFieldError | None = None

    def add(self, message: Any, logged: float) -> None:
        """The message that follows, logged at a time [s]."""
        self._type = self._type or _type(message)
        try:
            values = self._path.values(message)
        except MissingFieldError as error:  # others may have it
            self._missed = error
            return
        time = self._time(message, logged)
        if _sampled(self._path, message) and values:
            ts, xs = self._found.setdefault((), (array('d'), array('d')))
            self._unit = getattr(message, 'unit', '')
            ts.extend(time + np.arange(len(values)) / message.sample_rate)
            xs.extend(value for value, _ in values)
            return
        for value, which in values:
            ts, xs = self._found.setdefault(which, (array('d'), array('d')))
            ts.append(time)
            xs.append(value)

    def _time(self, message: Any, logged: float) -> float:
        own = getattr(message, 'time', None)
        if isinstance(own, float):
            return own
        stamped = getattr(
            getattr(message, 'header', message), 'stamp', getattr(message, 'clock', None)
        )
        time = seconds(stamped) if hasattr(stamped, 'nanosec') else 0.0
        time = time or logged
        return time - self._origin if time > _EPOCH else time

    def series(self, bag: Bag, sliding: Collection[str]) -> list[Series]:
        """One for each item."""
        path = self._path
        if not self._found and self._missed:
            raise self._missed
        if not self._found:
            filters = ' and '.join(str(step) for step in path.steps if isinstance(step, Filter))
            what = f' with {filters}' if filters else ''
            raise InputError(f"'{path.text}': {bag.path} has no value{what} on {path.topic}")
        units = [self._unit] if self._unit else field_units(self._type, path.fields)
        return [
            Series(
                _name(path, which), _unit(units, which, sliding), np.array(t), np.array(values),
                self._type in _EVENTS,
            )
            for which, (t, values) in self._found.items()
        ]  # fmt: skip


def _type(message: Any) -> str:
    """Of a message; empty where it has none, as JSON."""
    return '' if isinstance(message, dict) else type_name(type(message))


def field_units(kind: str, fields: Sequence[str]) -> tuple[str, ...]:
    """As `units_of`; none of a type that is not known here."""
    try:
        return units_of(kind, fields)
    except MessageError:
        return ()


def _sampled(path: MessagePath, message: Any) -> bool:
    """True if a path leads to all samples of a block."""
    rest = path.steps[1:]
    whole = all(isinstance(s, Items) and s == Items(None, None) for s in rest)
    return len(path.fields) == 1 and whole and getattr(message, 'sample_rate', 0.0) > 0.0 and (
        not np.isscalar(getattr(message, path.fields[0], 0.0))
    )  # fmt: skip


def _name(path: MessagePath, which: tuple[str, ...]) -> str:
    """The path to one item; itself a path."""
    left = list(which)
    text = path.topic
    for step in path.steps:
        if isinstance(step, Items):
            text += f'[{left.pop(0)}]' if left else '[:]'
        elif isinstance(step, Filter):
            text += f'{{{step}}}'
        else:
            text += f'.{step.name}'
    return text + ''.join(f'[{item}]' for item in left)


def _unit(units: Sequence[str], which: tuple[str, ...], sliding: Collection[str]) -> str:
    """The unit of an item: it may depend on whether it turns or slides."""
    if len(units) < 2:
        return units[0] if units else ''
    straight = [u for u in units if 'rad' not in u and u != 'N m']
    turning = [u for u in units if u not in straight]
    name = which[-1] if which else ''
    slides = name in sliding or name.endswith(('.x', '.y'))
    if straight and turning and (not sliding or (name and not name.isdecimal()) or slides):
        return (straight if slides else turning)[0]
    return ' or '.join(units)


def drawn(
    run: Piece | Cycle, names: Sequence[str], start: float, end: float, rate: float = 0.0
) -> list[Series]:
    """Quantities of a run at instants that draw all of them, where they are extreme among them.

    Parameters
    ----------
    rate : turns of the drive a second [Hz]
    """
    piece, known = run.solution if isinstance(run, Cycle) else run, catalogue(run.machine)
    t = instants(piece, start, end, _PER_TURN * abs(rate), _FEWEST, _MOST)
    chosen = [known[name] for name in known.choose(names)]
    own = [quantity for quantity in chosen if quantity.has_extremes and not quantity.cumulative]
    spans, size = piece.motion.curve.spans(t[0], t[-1]), run.machine.mechanism.size
    best = search(lambda x: _at(run, x, [quantity.name for quantity in own]), own, spans, size)
    t = np.union1d(t, np.concatenate([best.least_time, best.greatest_time]))
    return sampled(run, names, t[np.isfinite(t)])


def sampled(run: Piece | Cycle, names: Sequence[str], t: Array) -> list[Series]:
    """Quantities of a run at times (N,) [s], chosen as by `Piece.sample`."""
    known = catalogue(run.machine)
    chosen = known.choose(names)
    columns = _at(run, t, chosen)
    return [Series.of_quantity(known[name], t, columns[name]) for name in chosen]


def _at(run: Piece | Cycle, t: Array, names: Sequence[str]) -> Mapping[str, Array]:
    return run.at(t, names) if isinstance(run, Cycle) else run.sample(t, *names)


def joined(series: Sequence[Series]) -> dict[str, Array]:
    """Series as columns (N,) over one column ``t``; not a number where one has no value."""
    keys = [_numbered(s.t) for s in series]
    rows = sorted(set().union(*keys))
    place = {key: i for i, key in enumerate(rows)}
    columns = {'t': np.array([t for t, _ in rows])}
    for s, key in zip(series, keys, strict=True):
        name = f'ideal.{s.name}' if s.ideal else s.name
        column = columns.setdefault(name, np.full(len(rows), np.nan))
        column[[place[k] for k in key]] = s.values
    return columns


def _numbered(t: Array) -> list[tuple[float, int]]:
    """Each time, and how many times it was there before: several impacts may be at one instant."""
    seen: Counter[float] = Counter()
    keys = []
    for time in t.tolist():
        keys.append((time, seen[time]))
        seen[time] += 1
    return keys
