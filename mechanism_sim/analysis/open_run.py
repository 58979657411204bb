"""A run from any source, own or of another program, which answers by names of quantities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype
from scipy.interpolate import CubicHermiteSpline

from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.analysis.series import (
    PADDING,
    MessagePath,
    Series,
    drawn,
    numeric_paths,
    parse,
    recorded,
)
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, check_known, nearest
from mechanism_sim.messages.units import units_of
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.recording.inventory import scene_text
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.recording.runs import BAG_ENDINGS
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.run import Piece
from mechanism_sim.signal_files import read_signals
from mechanism_sim.tables import Table
from ros_interfaces.definitions import MessageError, field_descriptions

_STATES = 'sensor_msgs/msg/JointState'


class MessageRun:
    """Numbers in a bag of another program, of which no machine is known.

    Attributes
    ----------
    series : recorded values of joint states by ``position.JOINT``, ``velocity.JOINT``,
        ``effort.JOINT``, if one topic has such; all other numbers are asked for by their paths
    """

    def __init__(self, bag: Bag) -> None:
        self._bag, self.path = bag, bag.path
        self.series: dict[str, Series] = {}
        states = [t.name for t in bag.topics.values() if t.type == _STATES and t.count]
        for kind in ('position', 'velocity', 'effort') if len(states) == 1 else ():
            with suppress(InputError):  # many leave out velocities or efforts
                found = self._read(f'{states[0]}.{kind}')
                self.series |= {f'{kind}.{_joint(x.name)}': x for x in found if len(x.t)}

    def names(self) -> list[str]:
        """All names that can be asked for; an array stands for all its items."""
        return [*self.series, *(x.name for x in names_in(self._bag) if x.name not in self.series)]

    def columns(self, names: Sequence[str], t: Array) -> Table:
        """Quantities at times (N,) [s] within the recording, between its instants interpolated.

        Positions of joints with the recorded velocities, by cubic Hermite polynomials; all else
        straight. A path ``TOPIC.FIELD`` to an array gives a column for each item.
        """
        columns: dict[str, Array] = {}
        units: dict[str, str] = {}
        for asked in names:
            for own in [self.series[asked]] if asked in self.series else self._read(asked):
                name = asked if asked in self.series else own.name
                if t.min() < own.t[0] or t.max() > own.t.max():
                    raise InputError(
                        f'{self.path}: {name} is recorded from {own.t[0]:g} s to {own.t.max():g} s'
                    )
                columns[name], units[name] = self._at(name, own, t), own.unit
        return Table({'t': t, **columns}, {'t': 's', **units})

    def one(self, name: str) -> Series:
        """Recorded values of one name, at the times of their messages."""
        if name in self.series:
            return self.series[name]
        found = self._read(name)
        if len(found) > 1:
            raise InputError(
                f"{self.path}: '{name}' leads to several numbers: "
                f'{", ".join(x.name for x in found)}; choose one'
            )
        return found[0]

    def _read(self, name: str) -> list[Series]:
        path = parse(name, self._bag.topics)
        if path is None or not path.steps or path.topic not in self._bag.topics:
            known = self.names()
            raise InputError(
                f"{self.path} has no '{name}'{nearest(name, known)}; it has {', '.join(known)}"
            )
        return recorded(self._bag, [path])[0]

    def _at(self, name: str, own: Series, t: Array) -> Array:
        kind, _, joint = name.partition('.')
        rate = self.series.get(f'velocity.{joint}')
        latest = np.maximum.accumulate(own.t)
        rises = np.flatnonzero(np.diff(latest, prepend=-np.inf) > 0.0)
        if kind != 'position' or rate is None or not np.array_equal(rate.t, own.t):
            return np.asarray(np.interp(t, own.t[rises], own.values[rises]))
        x = own.t[rises], own.values[rises], rate.values[rises]
        return np.asarray(CubicHermiteSpline(*x)(t)) if len(rises) > 1 else own.values[rises]


def _joint(name: str) -> str:
    """The joint in ``/joint_states.position[JOINT]``."""
    return name.rpartition('[')[2].rstrip(']')


def open_run(
    source: Bag | Path | str | Piece | Cycle, namespace: str | None = None
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
    namespace : of the machine, where a bag holds several
    """
    if isinstance(source, Cycle):
        return Record(source.machine, source.solution, {})
    if isinstance(source, Piece):
        return Record(source.machine, source, {})
    bag = source if isinstance(source, Bag) else read_bag(source)
    if scene_text(bag, namespace) is not None:
        return read_record(bag, namespace)
    run = MessageRun(bag)
    if not run.names():
        raise InputError(f'{bag.path} holds neither a scene nor a number: {bag.contents()}')
    return run


def is_run(source: object) -> bool:
    """True if it is a run, or the path of one, and not a scene, which is still to be run."""
    file = isinstance(source, str | Path) and str(source).endswith(BAG_ENDINGS)
    return file or isinstance(source, Piece | Cycle | Bag)


class Name(NamedTuple):
    """Name that can be asked for, and its unit; empty for a number."""

    name: str
    unit: str


class Asked:
    """Answers about one run.

    Parameters
    ----------
    bag : where it is recorded, if it is
    record : the run itself; read from the bag when it is first needed if not given
    namespace : of the machine, and of topics that do not begin with a slash
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
        also : of another run, at whose instants quantities of the motion are wanted, too
        """
        paths = [self._path(name) for name in names]
        if self._given is None and None in paths:
            self._refuse_strangers(names[paths.index(None)])
        messages = iter(recorded(self._bag, [p for p in paths if p]) if self._bag else ())
        found: list[Series] = []
        of_motion = {
            name: self._chosen(name)
            for name, path in zip(names, paths, strict=True)
            if not path and name not in self.record.sensors
        }
        motion = self._sampled(dict.fromkeys(chain(*of_motion.values())), start, end, also)
        for name, path in zip(names, paths, strict=True):
            if path:
                found += next(messages)
            elif name in self.record.sensors:
                found.append(_signal(self.record, name))
            else:
                found += [motion[quantity] for quantity in of_motion[name]]
        kept = [s.within(start, end) for s in found]
        if not any(len(s.t) for s in kept):
            raise InputError(
                f'there are no values of {", ".join(names)} between these times: they go from '
                f'{min(s.t[0] for s in found):g} s to {max(s.t[-1] for s in found):g} s'
            )
        return kept

    def marks(
        self, start: float | None, end: float | None
    ) -> tuple[Mechanism | None, list[float]]:
        """The mechanism, and when it had impacts [s]; nothing if only messages were asked for."""
        if self._given is None and 'record' not in self.__dict__:
            return None, []
        begin, finish = self.record.part(start, end)
        struck = [i.t for i in self.record.piece.impacts if begin <= i.t <= finish]
        return self.record.machine.mechanism, struck

    def names(self) -> Iterator[Name]:
        """All that can be asked for: of the motion, then sensors, then fields of messages."""
        if self._bag is None or scene_text(self._bag, self._namespace):
            record = self.record
            for quantity in record.piece.catalogue.values():
                if quantity.name != 't':
                    yield Name(quantity.name, quantity.unit)
            for sensor in record.sampled_sensors:
                yield Name(sensor, record.signal(sensor).unit)
        if self._bag:
            yield from names_in(self._bag)

    def _refuse_strangers(self, name: str) -> None:
        """InputError for a name that is no path, where the bag is of another program."""
        if self._bag and scene_text(self._bag, self._namespace) is None:
            known = [given.name for given in names_in(self._bag)]
            if known:
                raise InputError(
                    f"{self._bag.path} has no scene with a quantity '{name}'"
                    f'{nearest(name, known)}; it has {", ".join(known)}'
                )

    def _chosen(self, name: str) -> list[str]:
        """Names of the quantities of the motion that a name stands for."""
        try:
            return self.record.piece.catalogue.choose([name])
        except InputError:
            known = [given.name for given in self.names()]
            known += sorted({name.partition('.')[0] for name in known})
            raise InputError(
                f"there is no '{name}'{nearest(name, known)}; without a name all are listed"
            ) from None

    def _sampled(
        self,
        names: Iterable[str],
        start: float | None,
        end: float | None,
        also: Sequence[Series],
    ) -> dict[str, Series]:
        """These quantities of the motion, at times that draw all of them."""
        if not (names := [*names]):
            return {}
        record = self.record
        begin, finish = record.part(start, end)
        rate = 0.0 if record.slides else record.rate
        return {s.name: s for s in drawn(record.piece, names, begin, finish, rate, also)}

    def _path(self, name: str) -> MessagePath | None:
        """The path into messages of the bag that a name stands for, if it does."""
        path = parse(name, self._bag.topics if self._bag else ())
        if self._bag is None or path is None or not path.steps:
            return None
        home = (self._namespace or '').rstrip('/')
        for topic in (path.topic, f'{home}/{path.topic}', f'/{path.topic}'):
            if topic in self._bag.topics:
                return MessagePath(name, topic, path.steps)
        return None


class AskedSignals:
    """Answers about a file of measured signals, as `Asked` gives them about a run."""

    def __init__(self, path: Path | str, full_scale: str = '') -> None:
        self._path, self._channels = path, read_signals(path, full_scale)

    def series(
        self, names: Sequence[str], start: float | None = None, end: float | None = None
    ) -> list[Series]:
        """Series of these channels, in their order, from `start` to `end` [s]."""
        found = []
        for name in names:
            check_known(name, self._channels, f"{self._path} has no channel '{name}'", 'it has:')
            c = self._channels[name]
            found.append(Series(name, c.unit, c.times, c.values).within(start, end))
        if not any(len(s.t) for s in found):
            raise InputError(f'there are no values of {", ".join(names)} between these times')
        return found

    def names(self) -> Iterator[Name]:
        """All channels."""
        return (Name(name, c.unit) for name, c in self._channels.items())


def _signal(record: Record, sensor: str) -> Series:
    """The samples of a sensor; not a number between runs of samples."""
    signal = record.signal(sensor)
    t = [np.append(x, x[-1]) for x in signal.times]
    values = [np.append(x, np.nan) for x in signal.runs]
    return Series(sensor, signal.unit, np.concatenate(t)[:-1], np.concatenate(values)[:-1])


def names_in(bag: Bag) -> Iterator[Name]:
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
