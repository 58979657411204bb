"""A run as lines to be drawn: over all of it, over its last turns, and those of its ideal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.deviation import ideal_record
from mechanism_sim.analysis.record import Record
from mechanism_sim.analysis.series import Series
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.report.charts.lines import OVER_TIME, TURNS, Abscissa, over_turns
from mechanism_sim.report.charts.thinning import MOST, Envelope, HeldLevels, SampledLine, thinned
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantity import Quantity, Shown, View
from mechanism_sim.scene import Machine
from mechanism_sim.units import written
from mechanism_sim.vibration.shaken_frame import FrameMotion

_SHOWN = 2  # turns of the main drive that are shown in full; of a machine that repeats one will do
_SAME = 1e-6  # [rad] or [m] of drives that follow the same law
_BLOCK = 2**15  # places at once, but for those of a single segment
_FEWEST = 4  # places in each
_PER_TURN = 400  # places at least
_TOLD_APART = 0.25  # of a turn from one extreme to the next, or less
_LOADS = 'N', 'N m'


class ChartWindow:
    """A part of a run; every quantity in it is a line.

    Each step of the integration is read at several places from its start to its end. Steps are
    short where much happens and end at events, so that what happens is met at any length of run.

    Parameters
    ----------
    start, end : start and end of the part [s]
    frames : quantities of frames on springs, all over the run
    again : turns of the drive over which there is a `reach`; 0 for none
    """

    def __init__(
        self, record: Record, start: float, end: float, frames: Sequence[Quantity] = (),
        again: int = 0,
    ) -> None:  # fmt: skip
        self.record, self.start, self.end = record, start, end
        #: quantities drawn as lines, by name
        self.quantities = {q.name: q for q in (*_charted(record.machine), *frames)}
        self._reach = Envelope(len(self.quantities), span=360.0 * again) if again else None
        self._levels = HeldLevels([n for n, q in self.quantities.items() if q.unit in _LOADS])

    @cached_property
    def lines(self) -> dict[str, SampledLine]:
        """Lines by name: quantities of the catalogue that make lines, and frames on springs."""
        curve = self.record.piece.motion.curve
        first, last = curve.locate(np.array([self.start, self.end]))
        segments = np.arange(first, last + 1)
        low = np.maximum(self.start - curve.start[segments], 0.0)
        high = np.minimum(self.end - curve.start[segments], curve.duration[segments])
        high = np.maximum(high, low)
        counts = np.maximum(np.ceil((high - low) / self.longest).astype(int) + 1, _FEWEST)
        blocks = self._blocks(segments, low, high, counts)
        lines = thinned(blocks, int(counts.sum()), (self.start, self.end))
        return dict(zip(self.quantities, lines, strict=True))

    @cached_property
    def reach(self) -> dict[str, Array]:
        """Ranges over all turns of the drive by name, over its angle (3, N) [deg].

        Nothing where they are not many.
        """
        names = self.lines  # on whose way it is found
        return dict(zip(names, self._reach.rows(), strict=True)) if self._reach else {}

    @property
    def levels(self) -> HeldLevels:
        """Levels of forces and torques that are not exceeded in a share of the time."""
        _ = self.lines  # on whose way they are found
        return self._levels

    def series(self, name: str, ideal: bool = False) -> Series:
        """The line of a quantity with its words and unit."""
        return Series.of_quantity(self.quantities[name], *self.lines[name], ideal)

    @property
    def longest(self) -> float:
        """Time from one place to the next at most [s]."""
        record = self.record
        if abs(record.rate) * (record.end - record.start) >= 1.0:
            return 1.0 / (abs(record.rate) * _PER_TURN)
        return (self.end - self.start) / (MOST // 2)

    def _blocks(
        self, segments: NDArray[np.intp], low: Array, high: Array, counts: NDArray[np.intp]
    ) -> Iterator[tuple[Array, Array]]:
        curve = self.record.piece.motion.curve
        loads = np.isin([*self.quantities], self._levels.names)
        firsts = np.flatnonzero(np.diff(np.cumsum(counts) // _BLOCK)) + 1
        for chosen in np.split(np.arange(len(segments)), firsts):
            n = counts[chosen]
            of = np.repeat(np.arange(len(n)), n)
            share = (np.arange(len(of)) - np.repeat(np.cumsum(n) - n, n)) / (n - 1)[of]
            dt = low[chosen][of] + (high - low)[chosen][of] * share
            k = segments[chosen][of]
            t = np.clip(curve.start[k] + dt, self.start, self.end)
            view = View(self.record.machine, self.record.piece.motion, k, dt, t=t)
            values = np.array([q.evaluate(view) for q in self.quantities.values()], np.float64)
            if self._reach:
                self._reach.add(self.record.degrees(t), values)
            self._levels.add_steps(values[loads], share, ((high - low)[chosen] / (n - 1))[of])
            yield t, values


def _charted(machine: Machine) -> Iterator[Quantity]:
    """The quantities of a machine that make lines."""
    pairs = [j for j in machine.mechanism.joints if isinstance(j, HigherPair)]
    also = {
        f'{field}.{pair.name}'
        for pair in pairs
        for fields in pair.charts.values()
        for field in fields
    } | {f'reaction.{joint.name}.size' for joint in machine.mechanism.joints}
    for name, quantity in catalogue(machine).items():
        shown = quantity.shown >= Shown.PARTS or name in also
        if shown and not (quantity.counted or quantity.cumulative):
            yield quantity


def _of_frame(name: str, frame: FrameMotion) -> Iterator[Quantity]:
    """``oscillator.NAME.x``, ``.y``, ``.force_x``, ``.force_y`` of a frame on springs."""
    for k, axis in enumerate('xy'):
        yield Quantity(
            f'oscillator.{name}.{axis}', 'm', f'displacement of {name}, {axis}', name,
            lambda view, k=k: frame(view.t).position[k], part=axis,  # type: ignore[misc]
        )  # fmt: skip
        yield Quantity(
            f'oscillator.{name}.force_{axis}', 'N', f'force of {name} on the ground, {axis}', name,
            lambda view, k=k: frame(view.t).mount_force[k], part=axis,  # type: ignore[misc]
        )  # fmt: skip


class ChartedRun:
    """Quantities and marks of a run that charts draw."""

    def __init__(self, record: Record, skip: int = 0) -> None:
        self.record = record
        self.begin = record.begin(skip)  #: from when on it counts [s]
        self._frames = [
            quantity
            for name in record.machine.scene.oscillators
            for quantity in _of_frame(name, record.machine.oscillator(name).take(record.history))
        ]
        #: turns on the axis of an angle; the last turns of the main drive, from and up to: whole
        #: ones from angle zero on, or the last one from any angle, or as many as bring all again;
        #: None if it makes none
        self.again, self.turns = _last_turns(record, skip)
        first, last = record.whole_turns(skip) if record.has_turns else (0, 0)
        many = record.machine.level.dynamic and last - first > TURNS * self.again
        reach = self.again if many else 0
        #: all of it from then on
        self.run = ChartWindow(record, self.begin, record.end, self._frames, reach)
        self.detail = self.run  #: these turns; all of the run if there are none
        if self.turns:
            start, end = record.times_at(np.array(self.turns)).tolist()
            self.detail = ChartWindow(record, start, end, self._frames)

    @property
    def over(self) -> Abscissa:
        """The angle of the main drive, or time where it makes no turns."""
        if self.turns is None:
            return OVER_TIME
        return over_turns(self.record.machine.plan.main, self.record.degrees, self.again)

    @property
    def long(self) -> bool:
        """True if the run is long enough for a chart besides that of its detail."""
        return self.run.end - self.run.start > 1.2 * (self.detail.end - self.detail.start)

    @property
    def whole(self) -> str:
        """Words for all of it, and for what is drawn of turns that cannot be told apart."""
        each = 2.0 * (self.run.end - self.run.start) / MOST  # as `thinned` has it
        if not self.turns or each * abs(self.record.rate) < _TOLD_APART:
            return 'the whole run'
        return f'the whole run: least and largest of each {written(each, "s", 3)}'

    def windows(self, key: str) -> Iterator[tuple[ChartWindow, str, str]]:
        """Windows over time that are worth a chart, in words, and the key of its chart."""
        if self.long:
            yield self.detail, 'the last turns', key
        yield self.run, self.whole, f'{key}-run'

    @cached_property
    def ideal(self) -> ChartWindow | None:
        """The detail of the same machine with ideal joints under the same drive.

        None where the machine is ideal itself, the drives do not prescribe the motion or were
        commanded otherwise, or the ideal machine does not get through it.
        """
        machine, detail = self.record.machine, self.detail
        if not machine.level.dynamic:
            return None
        try:
            beside = ideal_record(self.record, detail.start)
        except (InputError, RunError):
            return None  # then there is nothing to compare with
        if beside.machine.level.dynamic:
            return None
        end = min(detail.end, beside.end)
        t = np.linspace(detail.start, end, 9)
        own, told = (_driven(x, t) for x in (self.record, beside))
        if not np.allclose(own, told, rtol=0.0, atol=_SAME):
            return None
        return ChartWindow(beside, detail.start, end)


def _last_turns(record: Record, skip: int) -> tuple[int, tuple[float, float] | None]:
    """Number of turns after which all repeats, or 1, and the interval of turns shown."""
    begin, end = record.turned(np.array([record.begin(skip), record.end])).tolist()
    for again in dict.fromkeys([record.machine.drive.repetition.turns, 1]):
        if record.has_turns:
            first, last = record.whole_turns(skip)
            shown = again * (_SHOWN if record.machine.level.dynamic else 1)
            if last - first >= again:
                return again, (max(first, last - shown), last)
        if end - begin >= again - 1e-9:  # nor is it where the drive slides: no number
            with suppress(InputError):  # it may reverse meanwhile
                record.times_at(np.array([end - again]))
                return again, (end - again, end)
    return 1, None


def _driven(record: Record, t: Array) -> Array:
    """The prescribed coordinates at times (N,) [s]."""
    names = record.machine.physics.coordinates
    chosen = [names.index(c) for c in record.machine.plan.prescribed]
    return record.piece.motion.curve(t)[:, chosen]
