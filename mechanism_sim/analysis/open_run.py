"""A run from any source: a bag of our own or of another program, a solution, a cycle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mechanism_sim.analysis.message_paths import parse
from mechanism_sim.analysis.record import Record, read_record
from mechanism_sim.analysis.series import Series, recorded
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.recording import Bag, read_bag, scene_text
from mechanism_sim.results.cycle import Cycle
from mechanism_sim.results.solution import Piece
from mechanism_sim.tables import Table

_STATES = 'sensor_msgs/msg/JointState'


class JointStates:
    """Run in joint states of another program's bag, of which no machine is known.

    Attributes
    ----------
    series : recorded values by ``position.JOINT``, ``velocity.JOINT``, ``effort.JOINT``
    """

    def __init__(self, bag: Bag, topic: str) -> None:
        self.path, self.topic = bag.path, topic
        self.series: dict[str, Series] = {}
        for kind in ('position', 'velocity', 'effort'):
            path = parse(f'{topic}.{kind}')
            assert path is not None  # noqa: S101 - the name of a topic and a field
            try:
                (found,) = recorded(bag, [path])
            except InputError:  # many leave out velocities or efforts
                continue
            self.series |= {f'{kind}.{_joint(x.name)}': x for x in found if len(x.t)}

    def columns(self, names: Sequence[str], t: Array) -> Table:
        """Quantities at times (N,) [s] within the recording, between its instants interpolated.

        Positions with the recorded velocities, by cubic Hermite polynomials; all else straight.
        """
        columns: dict[str, Array] = {}
        units: dict[str, str] = {}
        for name in names:
            if name not in self.series:
                raise InputError(
                    f"{self.path}: {self.topic} has no '{name}'{nearest(name, self.series)}; it "
                    f'has {", ".join(self.series)}'
                )
            own = self.series[name]
            if t.min() < own.t[0] or t.max() > own.t[-1]:
                raise InputError(
                    f'{self.path}: {name} is recorded from {own.t[0]:g} s to {own.t[-1]:g} s'
                )
            columns[name], units[name] = self._at(name, own, t), own.unit
        return Table({'t': t, **columns}, {'t': 's', **units})

    def _at(self, name: str, own: Series, t: Array) -> Array:
        kind, _, joint = name.partition('.')
        rate = self.series.get(f'velocity.{joint}')
        rises = np.flatnonzero(np.diff(own.t, prepend=-np.inf) > 0.0)
        if kind != 'position' or rate is None or not np.array_equal(rate.t, own.t):
            return np.asarray(np.interp(t, own.t[rises], own.values[rises]))
        x = own.t[rises], own.values[rises], rate.values[rises]
        return np.asarray(CubicHermiteSpline(*x)(t)) if len(rises) > 1 else own.values[rises]


def _joint(name: str) -> str:
    """The joint in ``/joint_states.position[JOINT]``."""
    return name.rpartition('[')[2].rstrip(']')


def open_run(
    source: Bag | Path | str | Piece | Cycle, namespace: str | None = None
) -> Record | JointStates:
    """A run whose quantities can be asked for: ``open_run('run.mcap').columns(names, t)``.

    >>> import numpy as np
    >>> import mechanism_sim as ms
    >>> run = ms.open_run(ms.simulate('slider_crank', duration='0.1 s'))
    >>> run.columns(['position.piston'], np.array([0.0, 0.1])).units['position.piston']
    'm'

    Parameters
    ----------
    source : a bag, or its path; a solution or one of its pieces; a cycle
    namespace : of the machine, where a bag holds several
    """
    if isinstance(source, Cycle):
        return Record(source.machine, source.solution, {})
    if isinstance(source, Piece):
        return Record(source.machine, source, {})
    bag = source if isinstance(source, Bag) else read_bag(source)
    if scene_text(bag, namespace) is not None:
        return read_record(bag, namespace)
    states = [topic.name for topic in bag.topics.values() if topic.type == _STATES and topic.count]
    if not states:
        raise InputError(f'{bag.path} holds neither a scene nor joint states ({_STATES})')
    if len(states) > 1:
        raise InputError(f'{bag.path} has joint states on {", ".join(states)}: it must be one')
    return JointStates(bag, states[0])
