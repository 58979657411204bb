"""Measures of a run, taken from its motion piece by piece.

Extremes are those of the motion (`mechanism_sim.numerics.extremes`), integrals and means are
adaptive quadratures over every step of the integrator (`mechanism_sim.numerics.quadrature`),
percentiles and shares of time add up times between crossings of a level
(`mechanism_sim.numerics.monotone`). What may be off by more than 1e-9 of its size says by how
much.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arguments import listed
from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.events import Impacts
from mechanism_sim.errors import InputError, check_known, nearest
from mechanism_sim.numerics.batch_means import ratio
from mechanism_sim.numerics.expressions import numbers
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.measure_accumulators import EXACT, FigureAccumulator, speed_of
from mechanism_sim.results.measure_text import (
    INDICATORS,
    Bound,
    Figure,
    Measure,
    as_row,
    read_all,
)
from mechanism_sim.results.run import IMPACT_UNITS, Piece, is_loss
from mechanism_sim.results.turns import DriveTurns
from mechanism_sim.scene import Machine
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.indicators import Moments
from mechanism_sim.units import product

OVERLOADS = 'overloads'
"""Suffix of a sensor's name: 1 for a sample clipped at the full scale, else 0."""
_OF_EACH = ('mean', 'rms', 'percentile')  # which weigh events by number, not by time


class Measured(NamedTuple):
    """Value of a measure.

    Attributes
    ----------
    value : value in `unit`; NaN without data
    text : text of the measure as written
    resolution : `EXACT`, the error of the value, or the number of its samples
    derivatives : derivatives by path of a number of the scene, if requested
    rounding : error of the value by rounding alone; smaller differences mean equality
    """

    name: str
    value: float
    unit: str
    text: str
    resolution: str
    half_width: float = math.nan
    derivatives: Mapping[str, float] = MappingProxyType({})
    rounding: float = 0.0


class Measurement:
    """Computes measures of a run in pieces, from its start on.

    Parameters
    ----------
    measures : texts by name or as a list, or measures already read
    since, until : the window [s] of figures that name none
    static : True if inertia forces are left out
    begin : [s] earliest time that counts for any figure: a cycle may begin in a run
    """

    def __init__(
        self,
        machine: Machine,
        measures: dict[str, str] | str | Sequence[str] | Sequence[Measure],
        since: float = 0.0,
        until: float = math.inf,
        where: str = 'measures',
        static: bool = False,
        begin: float = -math.inf,
    ) -> None:
        if isinstance(measures, list | tuple) and all(isinstance(m, Measure) for m in measures):
            self.measures: list[Measure] = [*measures]
        else:
            given: Any = measures
            given = given if isinstance(given, dict) else listed(given, where)
            self.measures = read_all(given, where)
        self._machine = machine
        figures = list(dict.fromkeys(f for m in self.measures for f in m.figures))
        over_time = [f for f in figures if not f.of_events]
        names = [n for f in over_time for n in f.names]
        names += [speed_of(machine, f) for f in over_time if f.function == 'work']
        self._quantities = {name: catalogue(machine).find(name) for name in names}
        self._series = EventSeries(machine, [f for f in figures if f.of_events])
        self._turns = DriveTurns(machine, begin)
        limits = Bound(since), Bound(until)
        self._windows: dict[tuple[Bound, Bound, bool], Window] = {}
        self._figures: dict[Figure, Window] = {}
        for f in figures:
            key = f.since or limits[0], f.until or limits[1], f.per_revolution
            turns = f.per_revolution or key[0].revolutions or key[1].revolutions
            if turns and machine.plan.main in machine.mechanism.displacements:
                raise InputError(
                    f'{f.function}({f.argument}): {machine.plan.main} slides: it makes no '
                    'revolutions'
                )
            window = self._windows.setdefault(key, Window(self._turns, *key))
            window.figures.append(f)
            self._figures[f] = window
        for window in self._windows.values():
            window.open(
                partial(FigureAccumulator, machine, self._quantities, static), self._series
            )
        self.units()  # what cannot be added fails before anything runs

    def units(self) -> dict[str, str]:
        """The SI unit of every measure by its name."""
        return {m.name: m.unit(self._unit) for m in self.measures}

    def _unit(self, f: Figure) -> str:
        """The unit of a figure."""
        units = {name: quantity.unit for name, quantity in self._quantities.items()}
        unit = self._series.unit(f) if f.of_events else f.unit(units)
        if f.function == 'integral':
            return product(unit, 's')
        plain = dict.fromkeys(('count', 'share', *INDICATORS), '')
        return {**plain, 'work': 'J'}.get(f.function, unit)

    def add(self, piece: Piece, history: Motion | None = None) -> None:
        """Enter the next piece.

        Parameters
        ----------
        history : input of sensors from the start of the run, if not the piece itself
        """
        if not len(piece.motion):
            return
        self._series.add(piece, history)
        self._turns.add(piece)
        for window in self._windows.values():
            window.add(piece)

    def found(self, silent: bool = False) -> list[Measured]:
        """The measures of all pieces; to be called once, at the end.

        Warns of signals clipped at the full scale, unless this is one of many runs.
        """
        self._series.finish(silent)
        for window in self._windows.values():
            window.finish(self._turns.end)
        results = {f: window.result(f) for f, window in self._figures.items()}
        blurs = {f: window.rounding(f) for f, window in self._figures.items()}
        out, units = [], self.units()
        for measure in self.measures:
            said = dict.fromkeys(results[f][1] for f in measure.figures)
            resolution = ', '.join([s for s in said if s != EXACT]) or EXACT
            x, half = measure.value(lambda f: results[f][0]), self._half_width(measure)
            # size of errors by rounding of its figures, to first order
            values = {f: value for f, (value, _) in results.items()}
            there = measure.value(values.__getitem__)
            off = (
                measure.value((values | {f: values[f] + blurs[f]}).__getitem__) - there
                for f in dict.fromkeys(measure.figures)
            )
            rounding = sum(abs(d) for d in off if math.isfinite(d))
            x = 0.0 if abs(x) <= rounding else x
            out.append(
                Measured(
                    measure.name, x, units[measure.name], measure.text, resolution, half,
                    rounding=rounding,
                )
            )  # fmt: skip
        return out

    def _half_width(self, measure: Measure) -> float:
        """Half width of the 95 % interval of a mean over the revolutions of a loose machine."""
        windows = [self._figures[f] for f in measure.figures]
        if not (self._machine.has_contacts and windows and all(w.per_revolution for w in windows)):
            return math.nan
        turns = zip(*(self._figures[f].each_turn(f) for f in measure.figures), strict=False)
        values = [_of_turn(measure, turn) for turn in turns]
        return ratio(np.array(values), np.ones(len(values)))[1] if len(values) > 1 else math.nan

    def found_each_turn(self) -> list[tuple[str, str, Array]]:
        """Name, unit and values (n,) in n whole revolutions; of measures by `per_turn` only."""
        self._series.finish()
        results = {f: window.each_turn(f) for f, window in self._figures.items()}
        out = []
        for m in self.measures:
            turns = zip(*(results[f] for f in m.figures), strict=True)
            values = [_of_turn(m, turn) for turn in turns]
            unit = self.units()[m.name] if values else ''
            out.append((m.name, unit, np.array(values)))
        return out


def _of_turn(measure: Measure, turn: Sequence[tuple[float, str]]) -> float:
    """A measure by its figures in one revolution."""
    known = dict(zip(measure.figures, [value for value, _ in turn], strict=True))
    return measure.value(known.__getitem__)


def per_turn(measures: Sequence[Measure], skip: int) -> list[Measure]:
    """Measures of every revolution after some that are left out."""
    found = []
    for m in measures:
        if any(f.since or f.until for f in m.figures):
            raise InputError(
                f"'{m.text}': a window does not apply to statistics, which cover every revolution"
            )
        figures = tuple(
            replace(f, since=Bound(float(skip), True), per_revolution=True) for f in m.figures
        )
        found.append(replace(m, figures=figures))
    return found


def check_measures(machine: Machine, measures: dict[str, str] | Sequence[str], where: str) -> None:
    """Refuse measures that cannot be taken of a machine."""
    if measures:
        Measurement(machine, measures, where=where)


class Window:
    """The figures of one window, or of each whole revolution within it."""

    def __init__(self, turns: DriveTurns, since: Bound, until: Bound, each_turn: bool) -> None:
        self.figures: list[Figure] = []
        self._turns, self._since, self._until = turns, since, until
        self.per_revolution = each_turn
        self._accumulators: list[FigureAccumulator] = []
        self._ends: list[float] = []
        self._turn = 0

    def open(
        self, new: Callable[[Sequence[Figure]], FigureAccumulator], series: EventSeries
    ) -> None:
        """Prepare for these figures; `new` makes the accumulator of some of them."""
        self._series = series
        timed = [f for f in self.figures if not f.of_events]
        self._new = partial(new, timed)
        self._accumulator = self._new()

    def add(self, piece: Piece) -> None:
        """Enter a piece."""
        since, until = self._turns.time(self._since), self._turns.time(self._until)
        edges = self._turns.edges
        if not self.per_revolution:
            self._accumulator.add(piece, max(since, self._turns.begin), until)
            return
        while True:
            begin = edges[self._turn]
            over = self._turn + 1 < len(edges)
            end = edges[self._turn + 1] if over else math.inf
            slack = 1e-9 * (abs(begin) + 1e-3)
            counts = begin >= max(since, self._turns.begin) - slack
            counts = counts and (end <= until + slack or not over)
            if counts:
                self._accumulator.add(piece, begin, end)
            if not over:
                return
            if counts:
                self._accumulators.append(self._accumulator)
                self._ends += [begin, end]
                self._accumulator = self._new()
            self._turn += 1

    def finish(self, end: float) -> None:
        """Set the end of the run [s]."""
        self._last = end

    def result(self, f: Figure) -> tuple[float, str]:
        """The value of a figure, and its resolution."""
        if not self.per_revolution:
            since, until = self._turns.time(self._since), self._turns.time(self._until)
            slack, first = 1e-9 * (abs(self._last) + 1e-3), self._turns.begin
            if f.of_events:  # sensors go by all of a run of which this may be a part
                end = min(until, self._last + slack)
                value, note = self._of_events(f, max(since, first), end, last=True)
            else:
                value, note = self._accumulator.result(f)
            # how much of the window the run does not reach, in words
            if since < first - slack:
                lost = f'from {first:.6g} s on, where what was run begins'
            elif since > self._last - slack:
                lost = f'the run ends at {self._last:.6g} s, before the window begins'
            elif math.isfinite(self._until.value) and until > self._last + slack:
                lost = f'up to the end of the run at {self._last:.6g} s'
            else:
                lost = ''
            return value, lost if lost and note == EXACT else ', '.join(filter(None, (note, lost)))
        parts = self.each_turn(f)
        if not parts:
            return math.nan, 'no whole revolution'
        return float(np.mean([x for x, _ in parts])), parts[0][1]

    def rounding(self, f: Figure) -> float:
        """Size of the errors of a figure by rounding; numbers of events have none."""
        if f.of_events:
            return 0.0
        accumulators = self._accumulators if self.per_revolution else [self._accumulator]
        return max((accumulator.rounding(f) for accumulator in accumulators), default=0.0)

    def each_turn(self, f: Figure) -> list[tuple[float, str]]:
        """The values of a figure in every whole revolution, and their resolutions."""
        if f.of_events:
            spans = list(zip(self._ends[::2], self._ends[1::2], strict=True))
            return [self._of_events(f, a, b, last=b == spans[-1][1]) for a, b in spans]
        return [accumulator.result(f) for accumulator in self._accumulators]

    def _of_events(self, f: Figure, since: float, until: float, last: bool) -> tuple[float, str]:
        x, cut = self._series.values(f, since, until, last)
        note = self._series.note(f, len(x), cut)
        if f.function == 'count':
            return float(np.count_nonzero(x) if f.compared else len(x)), note
        if f.function == 'sum':
            return float(x.sum()), note
        if not len(x):
            return math.nan, 'there are none'
        if f.function == 'percentile':
            return float(np.percentile(x, f.percent or 0.0)), note
        if f.function in INDICATORS:
            moments = Moments()
            moments.add(x)
            value = getattr(moments.indicators(), f.function)
            return (math.nan, 'all are alike') if value is None else (value, note)
        simple = {
            'highest': x.max(), 'lowest': x.min(), 'largest': np.abs(x).max(),
            'range': np.ptp(x), 'mean': x.mean(), 'rms': math.sqrt((x**2).mean()),
        }  # fmt: skip
        return float(simple[f.function]), note


class EventSeries:
    """Events and samples: their instants, and the requested values of each."""

    def __init__(self, machine: Machine, figures: Sequence[Figure]) -> None:
        self._machine = machine
        names = list(dict.fromkeys(n for f in figures for n in f.names))
        self._parts = {name: self._resolve(name) for name in names}
        self._channels: dict[str, Channel] = {
            joint: machine.channel(joint)
            for kind, joint, _ in self._parts.values()
            if kind == 'sensors' and joint
        }
        self._columns: dict[tuple[str, str | None], dict[str, list[NDArray[Any]]]] = {}
        """Columns by kind and joint or sensor, filled piece by piece in the order of time."""
        for kind, joint, key in self._parts.values():
            always = ('t', '', OVERLOADS) if kind == 'sensors' else ('t',)
            columns = self._columns.setdefault((kind, joint), {k: [] for k in always})
            columns.setdefault(key, [])

    def _resolve(self, name: str) -> tuple[str, str | None, str]:
        """Kind, joint or sensor (None for all joints), and key of a name."""
        machine, (kind, *rest) = self._machine, name.split('.')
        if kind == 'sensors':
            sensors = list(machine.scene.sensors)
            key = rest.pop() if rest[1:] == [OVERLOADS] else ''
            named = '.'.join(rest)
            check_known(named, sensors, f"{machine.name} has no sensor '{named}'", 'sensors:')
            return kind, named, key
        joints = machine.physics.clearances
        joint = rest.pop(0) if rest and rest[0] in joints else None
        key = rest.pop(0) if rest else ''
        keys = list(IMPACT_UNITS) if kind == 'impacts' else ['t']
        if rest or (key and key not in keys):
            raise InputError(
                f"{machine.name}: there is no '{name}'"
                f'{nearest(key, [*joints, *keys])}; loose joints: {", ".join(joints) or "none"}; '
                f'of {kind} are known {", ".join(keys)}'
            )
        return kind, joint, key

    def unit(self, f: Figure) -> str:
        """Unit of the values of which a figure is made."""
        return f.unit({name: self._unit_of(name) for name in f.names})

    def _unit_of(self, name: str) -> str:
        kind, joint, key = self._parts[name]
        if kind == 'sensors' and not key:
            return str(self._machine.scene.sensors[str(joint)].unit)
        return IMPACT_UNITS.get(key, '')

    def add(self, piece: Piece, history: Motion | None = None) -> None:
        """Enter the events of the next piece, and the input of sensors."""
        for (kind, joint), columns in self._columns.items():
            if kind == 'sensors':
                channel = self._channels[str(joint)]
                channel.take(piece.motion if history is None else history)
                self._take(channel)
                continue
            if kind == 'impacts':
                impacts = Impacts.of(piece.impacts)
                own = impacts if joint is None else impacts.of_joint(joint)
                for key, parts in columns.items():
                    parts.append(own.column(key) if key else np.ones(len(own)))
                continue
            changes = [c for c in piece.modes if kind == 'modes' or is_loss(c)]
            times = np.array([c.t for c in changes if joint in (None, c.joint)], float)
            for key, parts in columns.items():
                parts.append(times if key else np.ones(len(times)))

    def finish(self, silent: bool = False) -> None:
        """Flush the channels, and warn of clipped samples."""
        for channel in self._channels.values():
            self._take(channel, final=True)
            if not silent:
                channel.warn()
        for columns in self._columns.values():
            for key, parts in columns.items():
                columns[key] = [np.concatenate([np.zeros(0), *parts])]

    def _take(self, channel: Channel, final: bool = False) -> None:
        columns = self._columns['sensors', channel.name]
        for found in channel.samples(final):
            for key, values in zip(('t', '', OVERLOADS), found, strict=True):
                columns[key].append(values)

    def values(self, f: Figure, since: float, until: float, last: bool) -> tuple[Array, int]:
        """Values (n,) of a figure's expression in a window [s], and number of clipped samples."""
        kind, joint, _ = self._parts[f.names[0]]
        known = {key: parts[0] for key, parts in self._columns[kind, joint].items()}
        first = np.searchsorted(known['t'], since)
        end = max(first, np.searchsorted(known['t'], until, side='right' if last else 'left'))
        keys = {name: self._parts[name][2] for name in f.names}
        x = numbers(f.tree, {n: np.asarray(known[k][first:end], float) for n, k in keys.items()})
        cut = known[OVERLOADS][first:end].sum() if kind == 'sensors' else 0
        return as_row(x, int(end - first)), int(cut)

    def note(self, f: Figure, count: int, cut: int) -> str:
        """Describe the number of samples or events of which a figure is made."""
        kind, name, _ = self._parts[f.names[0]]
        if kind != 'sensors':
            return f'of {count} {kind}' if f.function in _OF_EACH else EXACT
        rate = self._machine.scene.sensors[str(name)].sample_rate
        lost = f', {cut} of them CUT at the end of the range' if cut else ''
        return f'of {count} samples at {rate:g} Hz{lost}'
