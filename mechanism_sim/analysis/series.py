"""Quantities of a run over time: from messages of any bag, or from the motion itself."""

from __future__ import annotations

import math
import operator
import re
from array import array
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.csv_tables import assume
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.messages import MessageError, type_name
from mechanism_sim.messages.units import units_of
from mechanism_sim.recording.inventory import displacements, scene_homes
from mechanism_sim.recording.reader import Bag
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.quantity import Quantity
from mechanism_sim.results.ranges import search
from mechanism_sim.results.run import Piece, instants
from mechanism_sim.tables import Table
from ros_interfaces.plain import fields_of
from ros_interfaces.stamps import NANOSECONDS, nanoseconds

_TOPIC = re.compile(r'/?\w+(?:/\w+)*')
_STEP = (
    # names may have brackets themselves, as [arm[1]]
    r'|\[(?P<item>(?:[^\[\]]|\[[^\[\]]*\])*|.*?)\](?=[.\[{]|$)'
    r'|\{(?P<key>\w+(?:\.\w+)*)(?P<sign>==|!=|<=|>=|<|>)(?P<value>"[^"]*"|\'[^\']*\'|[^}]*)\}'
)
_FIELD, _ANY_FIELD = (
    re.compile(rf'\.(?P<field>{field}){_STEP}') for field in (r'\w[\w-]*', r'[^.\[\]{}]+')
)
_SLICE = re.compile(r'(?P<first>-?\d+)?(?:(?P<colon>:)(?P<last>-?\d+)?)?')
_SIGNS: dict[str, Callable[[Any, Any], Any]] = {
    '==': operator.eq, '!=': operator.ne, '<': operator.lt, '<=': operator.le,
    '>': operator.gt, '>=': operator.ge,
}  # fmt: skip
_ARRAYS = list, tuple, np.ndarray, array  # the last is ROS's
PADDING = 'header', 'structure_needs_at_least_one_member'
"""Fields without content: of all messages with a stamp, of empty messages."""

_NAMED = 'name', 'names', 'joint_names'  # fields that name items of others
_NUMBERS = bool, int, float, np.number, np.bool_
_EVENTS = (
    'mechanism_sim/msg/Impact',
    'mechanism_sim/msg/ModeChange',
    'mechanism_sim/msg/SceneChange',
)
_EPOCH = 10**18  # [ns]: what is later counts from 1970
_PER_TURN, _FEWEST, _MOST = 360.0, 2000, 40_000  # instants


@dataclass(frozen=True, eq=False)
class Series:
    """A quantity over time."""

    name: str  #: requested name, with the part of it
    unit: str  #: SI unit; empty for a number, two with an ``or`` if undetermined
    #: (N,) [s], and in the unit
    t: Array
    values: Array
    events: bool = False  #: True if values hold at their instants only
    ideal: bool = False  #: True for the same machine with ideal joints
    #: title of the quantity, and the coordinate, joint or link that it is of, where known
    words: str = ''
    of: str = ''
    run: str = ''  #: name of its run, if there are several

    @classmethod
    def of_quantity(cls, q: Quantity, t: Array, values: Array, ideal: bool = False) -> Series:
        """Series of a quantity of the catalogue."""
        return cls(q.name, q.unit, t, values, ideal=ideal, words=q.title, of=q.of)

    @property
    def line(self) -> str:
        """Label of the line: the name of the quantity, after that of its run if it has one."""
        return f'{self.run}: {self.name}' if self.run else self.name

    @property
    def known(self) -> int:
        """Number of its values but for those that are not a number, as in gaps."""
        return int(np.isfinite(self.values).sum())

    def at(self, t: Array) -> Array:
        """Values at times (N,) [s]: straight between instants, not a number before and after."""
        if np.array_equal(t, self.t):
            return self.values
        kept = self.rising
        return np.asarray(np.interp(t, self.t[kept], self.values[kept], np.nan, np.nan))

    @property
    def rising(self) -> NDArray[np.intp]:
        """The most instants that rise, the first of several choices.

        A single stamp far ahead is left out, and where a clock was set back what it repeats.
        """
        if (np.diff(self.t) > 0.0).all():
            return np.arange(len(self.t))
        # longest rising subsequence by patience sorting, from the end for the first choice
        ends: list[float] = []  # least last value of a sequence of each length
        places: list[int] = []  # and its index
        before = [-1] * len(self.t)
        for k in range(len(self.t) - 1, -1, -1):
            n = bisect_left(ends, x := -float(self.t[k]))
            before[k] = places[n - 1] if n else -1
            ends[n : n + 1], places[n : n + 1] = [x], [k]
        found = places[-1:]
        while found and before[found[-1]] >= 0:
            found.append(before[found[-1]])
        return np.array(found, dtype=np.intp)

    def within(self, start: float | None, end: float | None) -> Series:
        """The part from `start` to `end` [s]."""
        kept = self.t >= (-math.inf if start is None else start)
        kept &= self.t <= (math.inf if end is None else end)
        return replace(self, t=self.t[kept], values=self.values[kept])


def recorded(bag: Bag, paths: Sequence[MessagePath], optional: bool = False) -> list[list[Series]]:
    """Values to which each path leads in the messages of a bag, in one pass over it.

    Times are those that messages say themselves, else their stamps, else when they were logged;
    where these count from 1970, from the start of the bag. Arrays of samples, which come with a
    sample rate, are spread over time. Where values are optional, a path may lead to none.
    """
    origin = bag.start if bag.start > _EPOCH else 0
    by_topic: dict[str, list[_Collector]] = {}
    collectors = [_Collector(path, origin) for path in paths]
    for path, collector in zip(paths, collectors, strict=True):
        by_topic.setdefault(path.topic, []).append(collector)
    for topic, message, logged in bag.messages(by_topic):
        for collector in by_topic[topic]:
            collector.add(message, logged)
    homes = scene_homes(bag.topics.values())
    sliding = {home: displacements(bag, home) for home in homes or ['']}
    other = sliding[min(sliding, key=len)]  # of topics that are in no namespace of a scene
    found: list[list[Series]] = [[] for _ in paths]
    for k, (collector, path) in enumerate(zip(collectors, paths, strict=True)):
        with suppress(InputError) if optional else nullcontext():
            found[k] = collector.series(bag, sliding.get(path.topic.rpartition('/')[0], other))
    of = {c.clock: path.topic for c, path in zip(collectors, paths, strict=True)}
    if {'own', 'log'} <= of.keys():
        assume(
            f'{bag.path}: times of {of["log"]} count from the start of the log, those of '
            f'{of["own"]} are its own: they may not fit together'
        )
    return found


class _Collector:
    """Gathers what one path leads to."""

    def __init__(self, path: MessagePath, origin: int) -> None:
        self._path, self._origin = path, origin
        self._found: dict[tuple[str, ...], tuple[array[float], array[float]]] = {}
        self._type, self._unit, self.clock = '', '', 'log' if origin else 'own'
        self._missed: MissingFieldError | None = None
        self._messages = self._unstamped = 0

    def add(self, message: Any, logged: int) -> None:
        """The message that follows, logged at a time [ns]."""
        self._type = self._type or _type(message)
        self._messages += 1
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

    def _time(self, message: Any, logged: int) -> float:
        own = getattr(message, 'time', None)
        if isinstance(own, float):
            since = own > 1e-9 * _EPOCH
            self.clock = '' if since else 'own'
            return own - 1e-9 * self._origin if since else own
        stamped = getattr(
            getattr(message, 'header', message), 'stamp', getattr(message, 'clock', None)
        )
        time = nanoseconds(stamped) if hasattr(stamped, 'nanosec') else 0
        self._unstamped += not time and stamped is not None
        if time:
            self.clock = 'own' if time < _EPOCH else ''
        time = time or logged
        # whole nanoseconds: a float of 1970 on has steps of 0.2 us
        return (time - self._origin if time > _EPOCH else time) / NANOSECONDS

    def series(self, bag: Bag, sliding: Collection[str] | None) -> list[Series]:
        """One for each item."""
        path = self._path
        if not self._found and self._missed:
            raise self._missed
        if not self._found:
            filters = ' and '.join(str(step) for step in path.steps if isinstance(step, Filter))
            what = f' with {filters}' if filters else ''
            raise InputError(f"'{path.text}': {bag.path} has no value{what} on {path.topic}")
        if self._unstamped > 1:  # the first of a simulation may be 0
            share = 'all' if self._unstamped == self._messages else f'{self._unstamped} of'
            assume(
                f'{bag.path}: {share} {self._messages} messages of {path.topic} have no stamp: '
                'their times are those at which they were logged'
            )
        for t, _ in self._found.values():
            for k in np.flatnonzero(np.diff(t) < 0.0)[:1]:
                spans = f'from {t[k]:g} s to {t[k + 1]:g} s'
                assume(f'{bag.path}: times of {path.topic} go back, first {spans}')
        units = [self._unit] if self._unit else _field_units(self._type, path.fields)
        return [
            Series(
                _name(path, which), _unit(units, which, sliding), np.array(t), np.array(values),
                self._type in _EVENTS,
            )
            for which, (t, values) in self._found.items()
        ]  # fmt: skip


def _type(message: Any) -> str:
    """Type name of a message; empty for a message without a type, as JSON."""
    return '' if isinstance(message, dict) else type_name(type(message))


def _field_units(kind: str, fields: Sequence[str]) -> tuple[str, ...]:
    """Units of message fields as by `units_of`; empty for an unknown type."""
    try:
        return units_of(kind, fields)
    except MessageError:
        return ()


def _sampled(path: MessagePath, message: Any) -> bool:
    """True if a path leads to all samples of a block."""
    rest = path.steps[1:]
    whole = all(s == Items() for s in rest)
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


def _unit(units: Sequence[str], which: tuple[str, ...], sliding: Collection[str] | None) -> str:
    """The unit of an item: it may depend on whether it turns or slides.

    Parameters
    ----------
    sliding : names of sliding coordinates; None if unknown without a scene
    """
    if len(units) < 2:
        return units[0] if units else ''
    straight = [u for u in units if 'rad' not in u and u != 'N m']
    turning = [u for u in units if u not in straight]
    name = which[-1] if which else ''
    slides = name in (sliding or ()) or name.endswith(('.x', '.y'))
    named = name and not name.isdecimal()
    told = sliding is not None and (not sliding or named)
    if straight and turning and (told or slides):
        return (straight if slides else turning)[0]
    return ' or '.join(units)


def drawn(
    run: Piece | Cycle,
    names: Sequence[str],
    start: float,
    end: float,
    rate: float = 0.0,
    also: Sequence[Series] = (),
) -> list[Series]:
    """Quantities of a run at instants that draw all of them, where they are extreme among them.

    Parameters
    ----------
    rate : turns of the drive per second [Hz]
    also : series of another run, whose instants are added
    """
    piece, known = run.solution if isinstance(run, Cycle) else run, catalogue(run.machine)
    t = instants(piece, start, end, _PER_TURN * abs(rate), _FEWEST, _MOST)
    chosen = [known[name] for name in known.choose(names)]
    own = [quantity for quantity in chosen if quantity.has_extremes and not quantity.cumulative]
    window, size = (float(t[0]), float(t[-1])), run.machine.mechanism.size
    at = partial(_at, run, names=[quantity.name for quantity in own])
    best = search(at, own, piece.motion, window, size)
    t = np.unique(np.concatenate([t, best.least_time, best.greatest_time, *(s.t for s in also)]))
    return sampled(run, names, t[(t >= start) & (t <= end)])


def sampled(run: Piece | Cycle, names: Sequence[str], t: Array) -> list[Series]:
    """Quantities of a run at times (N,) [s], chosen as by `Piece.sample`."""
    known = catalogue(run.machine)
    chosen = known.choose(names)
    columns = _at(run, t, chosen)
    return [Series.of_quantity(known[name], t, columns[name]) for name in chosen]


def _at(run: Piece | Cycle, t: Array, names: Sequence[str]) -> Mapping[str, Array]:
    return run.at(t, names) if isinstance(run, Cycle) else run.sample(t, *names)


def joined(series: Sequence[Series]) -> Table:
    """Series as columns (N,) over one column ``t``; not a number where one has no value."""
    keys = [_numbered(s.t) for s in series]
    rows, places = keys[0], [np.arange(len(key)) for key in keys]
    if not all(np.array_equal(key, rows) for key in keys):
        rows = np.unique(np.concatenate(keys))
        places = [np.searchsorted(rows, key) for key in keys]
    # else of one topic: rows are as recorded, also where a run began anew
    columns, units = {'t': rows.real.copy()}, {'t': 's'}
    for s, place in zip(series, places, strict=True):
        name = f'ideal.{s.name}' if s.ideal else s.line
        column = columns.setdefault(name, np.full(len(rows), np.nan))
        column[place] = s.values
        units[name] = s.unit
    return Table(columns, units)


def _numbered(t: Array) -> ComplexArray:
    """Each time, and how many times it was there before as the imaginary part, which sorts so.

    Several impacts may be at one instant.
    """
    order = np.argsort(t, kind='stable')
    first = np.flatnonzero(np.diff(t[order], prepend=np.nan) != 0.0)
    before = np.empty(len(t))
    before[order] = np.arange(len(t)) - np.repeat(first, np.diff(first, append=len(t)))
    return np.asarray(t + 1j * before)


class MissingFieldError(InputError):
    """A message that may leave out fields, or items of an array, has not this one."""


class Value(NamedTuple):
    """A number in a message, with the names and indices of its path."""

    value: float
    which: tuple[str, ...]


@dataclass(frozen=True)
class Field:
    """A step to a field."""

    name: str


@dataclass(frozen=True)
class Items:
    """A step to items of an array: one by its name, else its number, or from one to another."""

    text: str = ':'


@dataclass(frozen=True)
class Filter:
    """A step that only messages pass whose field has such a value."""

    keys: tuple[str, ...]
    sign: str
    value: Any

    def __str__(self) -> str:
        shown = f'"{self.value}"' if isinstance(self.value, str) else f'{self.value}'
        return f'{".".join(self.keys)}{self.sign}{shown}'


@dataclass(frozen=True)
class MessagePath:
    """Path to numbers in the messages of a topic."""

    text: str  #: text as written
    topic: str
    steps: tuple[Field | Items | Filter, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        """Fields along the path."""
        return tuple(step.name for step in self.steps if isinstance(step, Field))

    def values(self, message: Any) -> list[Value]:
        """The numbers of a message; none if it does not pass a filter."""
        return list(self._walk(message, self.steps, (), ()))

    def _walk(
        self, at: Any, steps: tuple[Field | Items | Filter, ...], names: Any, which: Any
    ) -> Iterator[Value]:
        """The numbers at the end of the steps; `names` are those of the items of an array."""
        if isinstance(at, _ARRAYS) and not (steps and isinstance(steps[0], Items)):
            steps = (Items(), *steps)
        if not steps:
            yield Value(self._number(at), which)
            return
        step, rest = steps[0], steps[1:]
        if isinstance(step, Filter):
            if self._passes(step, at):
                yield from self._walk(at, rest, names, which)
        elif isinstance(step, Field):
            value = self.field(at, step.name)
            yield from self._walk(value, rest, _names(at, step.name, value), which)
        else:
            for i in self._chosen(at, step, names):
                yield from self._walk(at[i], rest, (), (*which, names[i] if names else str(i)))

    def _chosen(self, at: Any, step: Items, names: Any) -> range:
        if not isinstance(at, _ARRAYS):
            raise InputError(f"'{self.text}': what is before [ is not an array")
        n = len(at)
        if step.text in names:  # a name may be a number
            i = names.index(step.text)
            return range(i, i + 1)
        found = _SLICE.fullmatch(step.text)
        if found is None:
            known = f'; there are: {", ".join(names)}' if names else ''
            raise MissingFieldError(
                f"'{self.text}': there is no '{step.text}'{nearest(step.text, names)}{known}"
            )
        first, last = (
            int(x) + n * x.startswith('-') if x else None for x in found.group('first', 'last')
        )
        if first is not None and not found['colon']:
            if not 0 <= first < n:
                raise MissingFieldError(f"'{self.text}': the array has {n} items, numbered from 0")
            return range(first, first + 1)
        return range(max(0, first or 0), min(n, n if last is None else last + 1))

    def field(self, message: Any, name: str) -> Any:
        """A field of a message."""
        known = _field_names(message)
        if known is None:
            raise InputError(f"'{self.text}': a number has no field '{name}'")
        if name not in known:
            error = MissingFieldError if isinstance(message, dict) else InputError
            raise error(
                f"'{self.text}': {_kind(message)} has no field '{name}'"
                f'{nearest(name, known)}; there are: {", ".join(known)}'
            )
        return _field_value(message, name)

    def _passes(self, step: Filter, message: Any) -> bool:
        value = message
        for key in step.keys:
            value = self.field(value, key)
        if isinstance(value, str) is not isinstance(step.value, str):
            return step.sign == '!='
        return bool(_SIGNS[step.sign](value, step.value))

    def _number(self, value: Any) -> float:
        if isinstance(value, _NUMBERS):
            return float(value)
        if isinstance(value, str):
            raise InputError(f"'{self.text}' is text, not a number")
        known = _field_names(value)
        if known is None:
            raise InputError(f"'{self.text}' is not a number")
        raise InputError(f"'{self.text}' is a message: choose one of {', '.join(known)}")


def _field_names(message: Any) -> Sequence[str] | None:
    """Fields of a message, or of a dictionary that stands for one; None of anything else."""
    if isinstance(message, dict):
        return [str(name) for name in message]
    if hasattr(message, '__msgtype__') or hasattr(message, 'get_fields_and_field_types'):
        return fields_of(message)
    return None


def _field_value(message: Any, name: str) -> Any:
    """A field that `_field_names` has."""
    if isinstance(message, dict):
        return message[name]
    return getattr(message, name if hasattr(message, name) else f'{name}_')


def numeric_paths(message: Any, longest: float = math.inf) -> Iterator[tuple[str, ...]]:
    """The fields of a message that hold numbers, without its header; of an array those of one.

    Parameters
    ----------
    longest : largest number of items of an array that is not left out
    """

    def walk(at: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        for name in _field_names(at) or ():
            if name in PADDING:
                continue
            here, value = (*path, name), _field_value(at, name)
            if isinstance(value, _ARRAYS):
                value = value[0] if 0 < len(value) <= longest else None
            if _field_names(value) is not None:
                yield from walk(value, here)
            elif isinstance(value, _NUMBERS):
                yield here

    return walk(message, ())


def _kind(message: Any) -> str:
    return 'the message' if isinstance(message, dict) else type_name(type(message))


def _names(message: Any, name: str, value: Any) -> list[str]:
    """Names of the items of an array: the last array of texts before it, if it is as long."""
    if not isinstance(value, _ARRAYS):
        return []
    texts: list[str] = []
    of = ''
    for field in _field_names(message) or ():
        if field == name:
            break
        found = _field_value(message, field)
        if isinstance(found, list) and found and all(isinstance(x, str) for x in found):
            texts, of = found, field
    if len(texts) == len(value) == len(set(texts)):
        return texts
    if len(value) and of in _NAMED:
        repeated = len(texts) == len(value)
        why = 'repeats names' if repeated else f'has {len(texts)} for {len(value)} items'
        assume(f"'{of}' of {_kind(message)} {why} of '{name}': they go by their numbers")
    return []


def parse(text: str, topics: Collection[str] = ()) -> MessagePath | None:
    """A path ``TOPIC.FIELD`` with indices ``[0]``, ``[1:3]``, ``[NAME]`` and ``{key==value}``.

    As in Foxglove both ends of a slice belong to it; an item may also be named as in the array of
    names before it, whatever characters the name has. None if the text is no such path.

    Parameters
    ----------
    topics : names that are known; those of others than ROS, and fields, may have any characters
    """
    longest = max((x for x in topics if text.startswith(f'{x}.')), key=len, default='')
    if not longest and (found := _TOPIC.match(text)):
        longest = found.group()
    if not longest:
        return None
    step_of = _ANY_FIELD if longest in topics else _FIELD
    steps: list[Field | Items | Filter] = []
    place = len(longest)
    while place < len(text):
        step = step_of.match(text, place)
        if step is None:
            return None
        place = step.end()
        if step['field'] is not None:
            steps.append(Field(step['field']))
        elif step['key'] is not None:
            steps.append(
                Filter(tuple(step['key'].split('.')), step['sign'], _value(step['value']))
            )
        else:
            steps.append(Items(step['item']))
    return MessagePath(text, longest, tuple(steps))


def _value(text: str) -> Any:
    """A number, a truth value, or text, whose quotes the shell may have taken."""
    if text[:1] in ('"', "'"):
        return text[1:-1]
    if text in ('true', 'false'):
        return text == 'true'
    try:
        return float(text)
    except ValueError:
        return text
