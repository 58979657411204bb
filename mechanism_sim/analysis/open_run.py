"""A run from any source, own or of another program, which answers by names of quantities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np
import scipy
from rosbags.interfaces import Nodetype

from mechanism_sim.analysis.record import Record, find_topics, read_record, refuse_empty
from mechanism_sim.analysis.series import (
    PADDING,
    Field,
    Items,
    MessagePath,
    MissingFieldError,
    Series,
    drawn,
    numeric_paths,
    parse,
    recorded,
)
from mechanism_sim.arguments import public
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, check_known, nearest, quoted
from mechanism_sim.messages.units import units_of
from mechanism_sim.output import path_of
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.recording.inventory import prefix_of, scene_text
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.recording.runs import BAG_ENDINGS
from mechanism_sim.results.catalogue import flat
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.run import Piece, seconds_of
from mechanism_sim.scene import Machine
from mechanism_sim.signal_files import read_signals, refuse_signals
from mechanism_sim.tables import Table
from ros_interfaces.definitions import MessageError, field_descriptions

_STATES = 'sensor_msgs/msg/JointState'
_KINDS = 'position', 'velocity', 'effort'  # kinds of its numbers


class MessageRun:
    """Numbers in a bag of another program, of which no machine is known.

    Attributes
    ----------
    bag, namespace : the bag, and the namespace of topics without a leading slash
    series : recorded values of joint states by ``position.JOINT``, ``velocity.JOINT``,
        ``effort.JOINT``, if one topic has such; all other numbers are asked for by their paths
    """

    def __init__(self, bag: Bag, namespace: str | None = None) -> None:
        self.bag, self.path, self.namespace = bag, bag.path, namespace
        if namespace and not any(name.startswith(prefix_of(namespace)) for name in bag.topics):
            find_topics(bag, namespace)  # refuses it

    def __repr__(self) -> str:
        held = [f'{t.count} of {t.name}' for t in self.bag.topics.values() if t.count]
        return f'<MessageRun of {self.path}: messages: {", ".join(held)}>'

    @cached_property
    def series(self) -> dict[str, Series]:
        """Recorded values of joint states."""
        found: list[Series] = []
        with suppress(InputError):  # where it cannot be read
            # many leave out velocities or efforts
            found = self.find(_KINDS, optional=True) if self._topic else []
        return {s.name: s for s in found}

    @cached_property
    def _topic(self) -> str:
        """The topic of joint states, if there is just one."""
        home = prefix_of(self.namespace)
        own = [t for t in self.bag.topics.values() if t.name.startswith(home)]
        states = [t.name for t in own if t.type == _STATES and t.count]
        if self.namespace and len(states) > 1:  # the others are in namespaces below
            states = [name for name in states if name.rpartition('/')[0] == home[:-1]]
        return states[0] if len(states) == 1 else ''

    def listed(self) -> Iterator[Name]:
        """Names of all quantities; an array stands for all its items."""
        yield from (Name(name, x.unit) for name, x in self.series.items())
        yield from _names_in(self.bag)

    def names(self) -> list[str]:
        """Names of all quantities."""
        return [name for name, _ in self.listed()]

    @property
    def usual(self) -> list[str]:
        """Names for an overview: joint states, if there are any."""
        return [*self.series] or self.names()

    def columns(self, names: str | Sequence[str], t: Array) -> Table:
        """Quantities at times (N,) [s] within the recording, between its instants interpolated.

        Positions of joints with the recorded velocities, by cubic Hermite polynomials; all else
        straight. A path ``TOPIC.FIELD`` to an array gives a column for each item.
        """
        t, columns, units = seconds_of(t), {}, {}
        for own in self.find(names):
            known = f'from {own.t.min():g} s to {own.t.max():g} s'
            if len(t) and (t.min() < own.t.min() or t.max() > own.t.max()):
                raise InputError(f'{self.path}: {own.name} is recorded {known}')
            columns[own.name], units[own.name] = self._at(own, t), own.unit
        return Table({'t': t, **columns}, {'t': 's', **units})

    def find(
        self, given: str | Iterable[str | Sequence[str]], optional: bool = False
    ) -> list[Series]:
        """Recorded values of names, at the times of their messages, in one pass over the bag."""
        names, home = [*flat(given)], self.namespace
        paths = {name: path for name in names if (path := _path_in(self.bag, name, home))}
        states = {name: self._path(name) for name in names if name not in paths}
        try:
            read = recorded(self.bag, [*paths.values(), *states.values()], optional)
        except MissingFieldError:
            for name in states.keys() - self.series.keys() - {*_KINDS}:
                self._refuse(name)
            raise
        of = dict(zip([*paths, *states], read, strict=True))
        for name, path in states.items():  # as `listed` names them
            (kind,) = path.fields
            joint = slice(len(f'{path.topic}.{kind}['), -1)  # of ``TOPIC.KIND[JOINT]``
            of[name] = [
                replace(s, name=f'{kind}.{s.name[joint]}', of=s.name[joint]) for s in of[name]
            ]
        return [s for name in names for s in of[name]]

    def one(self, name: str) -> Series:
        """Recorded values of one name, at the times of their messages."""
        return single(self.find([name]), name, self.path)

    def _path(self, name: str) -> MessagePath:
        """The path of joint states, as ``position`` and ``position.JOINT``."""
        kind, _, joint = name.partition('.')
        if not self._topic or kind not in _KINDS:
            self._refuse(name)
        return MessagePath(name, self._topic, (Field(kind), *([Items(joint)] if joint else [])))

    def _refuse(self, name: str) -> NoReturn:
        """Refuse a name that is none."""
        refuse_empty(self.bag)
        known = self.names()
        foreign = scene_text(self.bag, self.namespace) is None
        what = 'scene with a quantity' if foreign else 'message with a number'
        raise InputError(
            f"{self.path} has no {what} '{name}'{nearest(name, known)}; it has "
            f'{", ".join(known) or "no numbers"}'
        )

    def _at(self, own: Series, t: Array) -> Array:
        kind, _, joint = own.name.partition('.')
        rate = None
        if kind == 'position' and own.of == joint:
            with suppress(InputError):  # many leave out velocities
                (rate,) = self.find(f'velocity.{joint}')
        k, straight = own.rising, own.at(t)
        if rate is None or not np.array_equal(rate.t, own.t) or len(k) < 2:
            return straight
        at, *ends = own.t[k], own.values[k], rate.values[k]
        smooth = scipy.interpolate.CubicHermiteSpline(at, *np.nan_to_num(ends))(t)
        unknown = np.isnan(np.interp(t, at, 0.0 * sum(ends)))  # beside a value that is no number
        return np.where(unknown, straight, smooth)


@public
def open_run(
    source: Bag | Path | str | Piece | Cycle | Record | MessageRun, namespace: str | None = None
) -> Record | MessageRun:
    """A run whose quantities can be asked for: ``open_run('run.mcap').columns(names, t)``.

    >>> import numpy as np
    >>> import mechanism_sim as ms
    >>> run = ms.open_run(ms.simulate('slider_crank', duration='0.1 s'))
    >>> run.columns(['position.piston'], np.array([0.0, 0.1])).units['position.piston']
    'm'

    Parameters
    ----------
    source : a bag, of other programs too, or its path; a solution, one of its pieces; a cycle
    namespace : namespace of the machine, if a bag holds several
    """
    if isinstance(source, Record | MessageRun):
        return source
    if isinstance(source, Cycle):
        return Record(source.machine, source.solution, {})
    if isinstance(source, Piece):
        return Record(source.machine, source, {})
    if isinstance(source, Machine):
        raise InputError(f'{source.name} is a machine that has not run yet: simulate it first')
    if not isinstance(source, Bag | Path | str):
        raise InputError(f'{quoted(source)} is not a run: expected a solution, a cycle or a bag')
    if not isinstance(source, Bag):
        refuse_signals(source, 'run')
        source = read_bag(source)
    if scene_text(source, namespace) is not None:
        return read_record(source, namespace)
    run = MessageRun(source, namespace)
    if next(_names_in(source), None) is None:
        raise InputError(f'{source.path} holds neither a scene nor a number: {source.contents()}')
    return run


def run_of_machine(source: Bag | Path | str | Piece | Cycle | Record, what: str) -> Record:
    """A run whose machine is known, which `what` needs."""
    record = open_run(source)
    if not isinstance(record, Record):
        raise InputError(f'{record.path}: {what} needs the machine, and this bag has none')
    return record


def check_run_of(machine: Machine, run: Piece) -> None:
    """Refuse what is no run of a machine with these values."""
    if not isinstance(run, Piece):
        raise InputError(f'{quoted(run)} is not a run: expected a solution of {machine.name}')
    if run.machine is not machine and run.machine.fingerprint != machine.fingerprint:
        raise InputError(
            f'the run is not one of {machine!r}, but of {run.machine!r} or of other values: give '
            'the run without a scene'
        )


def is_run(source: object) -> bool:
    """True if it is a run, or the path of one, and not a scene, which is still to be run."""
    file = isinstance(source, str | Path) and str(source).endswith(BAG_ENDINGS)
    return file or isinstance(source, Piece | Cycle | Bag | Record | MessageRun)


class Name(NamedTuple):
    """Name of a quantity, and its unit; empty for a number."""

    name: str
    unit: str


class Asked:
    """Answers about one run.

    Parameters
    ----------
    bag : path of the bag, if it is recorded
    record : the run itself; by default read from the bag when first needed
    namespace : namespace of the machine, and of topics without a leading slash
    """

    def __init__(
        self, bag: Bag | None, record: Record | None = None, namespace: str | None = None
    ) -> None:
        self._bag, self._given, self._namespace = bag, record, namespace

    @cached_property
    def record(self) -> Record:
        """The run."""
        if self._given is not None or self._bag is None:
            assert self._given is not None  # noqa: S101 - one of both is
            return self._given
        return read_record(self._bag, self._namespace)

    @cached_property
    def messages(self) -> MessageRun | None:
        """Bag of another program, of which no run is known."""
        bag, namespace = self._bag, self._namespace
        if bag is None or self._given is not None or scene_text(bag, namespace) is not None:
            return None
        return MessageRun(bag, namespace)

    def series(
        self,
        names: Sequence[str],
        start: float | None = None,
        end: float | None = None,
        also: Sequence[Series] = (),
    ) -> list[Series]:
        """Series of these names, in their order, from `start` to `end` [s].

        Parameters
        ----------
        also : series of another run, whose instants are added for quantities of the motion
        """
        of_motion = names, start, end, also
        found = self.messages.find(names) if self.messages else self._found(*of_motion)
        kept = [s.within(start, end) for s in found]
        if not any(len(s.t) for s in kept):
            raise InputError(
                f'there are no values of {", ".join(names)} between these times: they go from '
                f'{min(s.t.min() for s in found):g} s to {max(s.t.max() for s in found):g} s'
            )
        return kept

    def in_rows(self, series: Sequence[Series]) -> list[Series]:
        """Series for a table: quantities of the motion where the samples beside them are taken."""
        if self.messages or any(s.ideal for s in series):
            return list(series)
        piece = self.record.piece
        known = {s.name for s in series} & {*piece.catalogue}
        taken = [s.t for s in series if s.name not in known]
        if not (known and taken):
            return list(series)
        t = np.unique(np.concatenate(taken))
        t = t[(t >= self.record.start) & (t <= self.record.end)]
        values = piece.sample(t, sorted(known))
        return [replace(s, t=t, values=values[s.name]) if s.name in known else s for s in series]

    def recorded(self, name: str) -> Series | None:
        """Values that are recorded under a name, all of them; None of a quantity of the motion."""
        if self.messages or self._path(name) or name in self.record.sensors:
            return single(self.series([name]), name, self._bag.path if self._bag else 'the run')
        return None

    def _found(
        self, names: Sequence[str], start: float | None, end: float | None, also: Sequence[Series]
    ) -> list[Series]:
        """Series of the motion, of sensors and of messages of a run."""
        paths = [self._path(name) for name in names]
        messages = iter(recorded(self._bag, [p for p in paths if p]) if self._bag else ())
        found: list[Series] = []
        of_motion = {
            name: self._chosen(name)
            for name, path in zip(names, paths, strict=True)
            if not path and name not in self.record.sensors
        }
        motion: dict[str, Series] = {}
        if wanted := [*dict.fromkeys(chain(*of_motion.values()))]:  # at times that draw all
            begin, finish = self.record.part(start, end)
            rate = 0.0 if self.record.slides else self.record.rate
            lines = drawn(self.record.piece, wanted, begin, finish, rate, also)
            motion = {s.name: s for s in lines}
        for name, path in zip(names, paths, strict=True):
            if path:
                found += next(messages)
            elif name in self.record.sensors:
                found.append(_signal(self.record, name))
            else:
                found += [motion[quantity] for quantity in of_motion[name]]
        return found

    def marks(
        self, start: float | None, end: float | None
    ) -> tuple[Mechanism | None, list[float]]:
        """The mechanism and the times of its impacts [s]; nothing for messages alone."""
        if self._given is None and 'record' not in self.__dict__:
            return None, []
        begin, finish = self.record.part(start, end)
        t = self.record.piece.impacts.column('t')
        return self.record.machine.mechanism, t[(begin <= t) & (t <= finish)].tolist()

    def names(self) -> Iterator[Name]:
        """Names of all quantities: of the motion, then sensors, then fields of messages."""
        if self.messages:
            yield from self.messages.listed()
            return
        record = self.record
        for quantity in record.piece.catalogue.values():
            if quantity.name != 't':
                yield Name(quantity.name, quantity.unit)
        for sensor in record.sampled_sensors:
            yield Name(sensor, record.signal(sensor).unit)
        if self._bag:
            yield from _names_in(self._bag)

    def _chosen(self, name: str) -> list[str]:
        """Names of the quantities of the motion for a name, of one or several."""
        try:
            return self.record.piece.catalogue.choose([name])
        except InputError:
            known = [given.name for given in self.names()]
            known += sorted({name.partition('.')[0] for name in known})
            raise InputError(
                f"there is no '{name}'{nearest(name, known)}; without a name all are listed"
            ) from None

    def _path(self, name: str) -> MessagePath | None:
        return _path_in(self._bag, name, self._namespace) if self._bag else None


def _path_in(bag: Bag, name: str, namespace: str | None = None) -> MessagePath | None:
    """The path into messages of a bag for a name, if there is one."""
    path = parse(name, bag.topics)
    if path is None or not path.steps:
        return None
    for topic in (path.topic, f'{prefix_of(namespace)}{path.topic}', f'/{path.topic}'):
        if topic in bag.topics:
            return MessagePath(name, topic, path.steps)
    return None


def single(found: Sequence[Series], name: str, where: object) -> Series:
    """The only one of the series that a name leads to."""
    if len(found) > 1:
        raise InputError(
            f"{where}: '{name}' leads to several numbers: {', '.join(x.name for x in found)}; "
            'choose one'
        )
    return found[0]


class AskedSignals:
    """Quantities of a file of measured signals, with the interface of a run.

    Parameters
    ----------
    full_scale, scaled, rate : see `read_signals`
    """

    def __init__(
        self, path: Path | str, full_scale: str = '', scaled: bool = True, rate: str = ''
    ) -> None:
        self.path, self.channels = path_of(path), read_signals(path, full_scale, scaled, rate)

    def series(
        self, names: Sequence[str], start: float | None = None, end: float | None = None
    ) -> list[Series]:
        """Series of these channels, in their order, from `start` to `end` [s].

        Where samples are missing there is one that is not a number.
        """
        found = []
        for name in names:
            check_known(name, self.channels, f"{self.path} has no channel '{name}'", 'it has:')
            c = self.channels[name]
            found.append(Series(name, c.unit, *c.parted).within(start, end))
        if not any(len(s.t) for s in found):
            raise InputError(f'there are no values of {", ".join(names)} between these times')
        return found

    def in_rows(self, series: Sequence[Series]) -> list[Series]:
        """Series for a table: what the file has, without the gaps."""
        known = [np.isfinite(s.values) for s in series]
        return [
            replace(s, t=s.t[rows], values=s.values[rows])
            for s, rows in zip(series, known, strict=True)
        ]

    def recorded(self, name: str) -> Series:
        """Values of a channel, all of them."""
        return self.series([name])[0]

    @property
    def usual(self) -> list[str]:
        """Names of all channels."""
        return [*self.channels]

    def names(self) -> Iterator[Name]:
        """All channels."""
        return (Name(name, c.unit) for name, c in self.channels.items())


def _signal(record: Record, sensor: str) -> Series:
    """The samples of a sensor; not a number between runs of samples."""
    signal = record.signal(sensor)
    t = [np.append(x, x[-1]) for x in signal.times]
    values = [np.append(x, np.nan) for x in signal.runs]
    return Series(sensor, signal.unit, np.concatenate(t)[:-1], np.concatenate(values)[:-1])


def _names_in(bag: Bag) -> Iterator[Name]:
    """The numbers in the messages of a bag that can be read, but for headers.

    Of ROS by the definition of the type; of others those that the first message has.
    """
    lost = bag.unreadable()
    for topic in bag.topics.values():
        if not topic.count or topic.name in lost:
            continue
        try:
            yield from _fields(topic.name, topic.type)
        except MessageError:
            for _, message, _ in bag.messages(topic.name):
                yield from (Name(_dotted(topic.name, at), '') for at in numeric_paths(message))
                break


def _dotted(topic: str, path: Sequence[str]) -> str:
    return f'{topic}.{".".join(path)}'


def _fields(topic: str, message: str) -> Iterator[Name]:
    """The numbers in a message of a type that is known here."""

    def walk(kind: str, path: tuple[str, ...]) -> Iterator[Name]:
        for field, described in field_descriptions(kind):
            here = (*path, field)
            if field in PADDING:
                continue
            array = described[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE}
            node, inner = described[1][0] if array else described
            if node == Nodetype.NAME:
                yield from walk(inner, here)
            elif inner[0] != 'string':
                yield Name(_dotted(topic, here), ' or '.join(units_of(message, here)))

    return walk(message, ())
