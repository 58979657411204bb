"""Run by names: quantities of its motion, sensors, paths into messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype

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
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.messages.units import units_of
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.recording.inventory import scene_text
from mechanism_sim.recording.reader import Bag
from ros_interfaces.definitions import MessageError, field_descriptions


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
        self, names: Sequence[str], start: float | None = None, end: float | None = None
    ) -> list[Series]:
        """Series of these names, in their order, from `start` to `end` [s]."""
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
        motion = self._sampled(dict.fromkeys(chain(*of_motion.values())), start, end)
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
        self, names: Iterable[str], start: float | None, end: float | None
    ) -> dict[str, Series]:
        """These quantities of the motion, at times that draw all of them."""
        if not (names := [*names]):
            return {}
        record = self.record
        begin, finish = record.part(start, end)
        rate = 0.0 if record.slides else record.rate
        return {s.name: s for s in drawn(record.piece, names, begin, finish, rate)}

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
