"""A run from any source: a bag of our own or of another program, a solution, a cycle."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mechanism_sim.analysis.quantity_lookup import names_in
from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.analysis.series import Series, parse, recorded
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.recording.inventory import scene_text
from mechanism_sim.recording.reader import Bag, read_bag
from mechanism_sim.recording.runs import BAG_ENDINGS
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.run import Piece
from mechanism_sim.tables import Table

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
