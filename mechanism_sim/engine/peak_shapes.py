"""Durations of load peaks above half of their height, and their impulses.

A peak of some microseconds and one of a second are not the same to a bearing: the duration tells
them apart, and the impulse is what a mass feels of it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import PiecewisePolynomial, Times
from mechanism_sim.numerics.quadrature import Parts, integrate
from mechanism_sim.tolerances import TOLERANCES

_PEAKS = TOLERANCES.peaks

Magnitude = Callable[[IndexArray, Times], Array]
"""Magnitudes (N,) of a load in segments of a motion, instants as of ``curve.at``."""


_LOOKS = np.linspace(0.0, 1.0, 17)  # of a segment
_AT_ONCE = 16  # segments


class PeakShape(NamedTuple):
    """The time around a peak in which a load is above half of it."""

    begin: float  #: time of the rise above half of the peak [s]
    end: float  #: time of the fall below half of the peak [s]
    impulse: float  #: integral of the magnitude over that time [N s, N m s]
    whole: bool  #: whether both times lie within the known motion

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.end - self.begin


def peak_shape(
    magnitude: Magnitude, curve: PiecewisePolynomial, time: float, height: float
) -> PeakShape:
    """The shape of a peak of some height at a time [s] of a motion."""
    k, into = _place(magnitude, curve, time)
    low = _side(magnitude, curve, k, into, _PEAKS.level * height, -1)
    high = _side(magnitude, curve, k, into, _PEAKS.level * height, 1)
    segments = np.arange(low.segment, high.segment + 1)
    begin, end = np.zeros(len(segments)), curve.duration[segments].copy()
    begin[0], end[-1] = low.into, high.into
    held = begin < end
    parts = Parts(segments[held], begin[held], end[held], np.zeros(int(held.sum()), bool))
    found = integrate(lambda k, dt: magnitude(k, dt)[None], parts)
    first, last = (
        float(curve.start[x.segment] + (curve.start_low[x.segment] + x.into)) for x in (low, high)
    )
    return PeakShape(first, last, float(found.value.sum()), low.known and high.known)


class PeakOutlines:
    """The shapes of the peaks of C loads in a motion that comes in batches.

    The shape of a peak longer than the segments that are kept is cut off there.

    Parameters
    ----------
    values : the loads (C, N) in segments of a motion, instants as of ``curve.at``
    count : number C of loads
    """

    def __init__(
        self,
        values: Callable[[Motion, IndexArray, Times], Array],
        count: int,
    ) -> None:
        self._values = values
        self._batches: deque[Motion] = deque()  # the last ones
        self._kept = 0  # segments in them
        self._known: list[tuple[float, PeakShape] | None] = [None] * count
        self._seen = [-math.inf] * count  # [s] up to which the motion was known then

    def add(self, motion: Motion, peaks: Callable[[], Sequence[tuple[float, float]]]) -> None:
        """Enter the next segments; `peaks` returns values and times [s] of the peaks so far.

        They are looked at before segments are let go, not in every batch: a steady load is largest
        somewhere else in each, by rounding, and lasts as long as all that is kept.
        """
        self._batches.append(motion)
        self._kept += len(motion)
        if self._kept >= 2 * _PEAKS.kept:
            self._look(peaks(), anyway=False)
            while self._kept - len(self._batches[0]) >= _PEAKS.kept:
                self._kept -= len(self._batches.popleft())

    def shapes(self, peaks: Sequence[tuple[float, float]]) -> list[PeakShape | None]:
        """Shapes of the peaks, as far as they are known."""
        self._look(peaks, anyway=True)
        return [
            known[1] if known and known[0] == time else None
            for (_, time), known in zip(peaks, self._known, strict=False)
        ]

    def _look(self, peaks: Sequence[tuple[float, float]], anyway: bool) -> None:
        """Update the shapes of peaks that are new, or were incomplete.

        A lasting peak is updated when a quarter more of it is known, or if `anyway` is set.
        """
        if not self._batches:
            return
        whole = Motion.joined([*self._batches]) if len(self._batches) > 1 else self._batches[0]
        curve = whole.curve
        for i, (value, time) in enumerate(peaks):
            if not (curve.start[0] <= time <= curve.end and value):
                continue
            known, seen = self._known[i], self._seen[i]
            if known and known[0] == time:
                shape = known[1]
                if shape.whole or shape.begin < curve.start[0] or seen == curve.end:
                    continue
                if not anyway and curve.end - seen < 0.25 * shape.duration:
                    continue

            def size(k: IndexArray, dt: Times, i: int = i) -> Array:
                return np.asarray(np.abs(self._values(whole, k, dt)[i]))

            self._known[i] = time, peak_shape(size, curve, time, abs(value))
            self._seen[i] = curve.end


def _place(magnitude: Magnitude, curve: PiecewisePolynomial, time: float) -> tuple[int, float]:
    """Segment and time since its start [s]: at a jump those on whose side the load is larger."""
    (k,), (into,) = curve.find(np.array([time]))
    near = _PEAKS.time * float(np.spacing(abs(time) + TOLERANCES.rounding.least))
    found = [(int(k), float(into))]
    if into <= near and k > 0:
        found.append((int(k) - 1, float(curve.duration[k - 1])))
    if into >= curve.duration[k] - near and k + 1 < len(curve):
        found.append((int(k) + 1, 0.0))
    sizes = magnitude(np.array([x for x, _ in found]), np.array([x for _, x in found]))
    return found[int(np.nan_to_num(sizes).argmax())]


class _Side(NamedTuple):
    segment: int
    into: float  # [s] after its start
    known: bool  # whether the load falls below the level there


def _side(
    magnitude: Magnitude, curve: PiecewisePolynomial, k: int, into: float, level: float, way: int
) -> _Side:
    """Position at which a load falls below a level, before (-1) or after (1) an instant."""
    last = 0 if way < 0 else len(curve) - 1
    limit = max(last, k - _PEAKS.most) if way < 0 else min(last, k + _PEAKS.most)
    first = k
    while way * (limit - first) >= 0:
        segments = np.arange(first, first + way * min(_AT_ONCE, way * (limit - first) + 1), way)
        dt = curve.duration[segments, None] * _LOOKS[::way]
        if first == k:
            ends = (0.0, into) if way < 0 else (into, float(curve.duration[k]))
            dt[0] = np.linspace(*ends, len(_LOOKS))[::way]
        below = magnitude(segments, dt).reshape(dt.shape) < level
        if below.any():
            row, column = divmod(int(below.ravel().argmax()), len(_LOOKS))
            segment = int(segments[row])
            if not column:  # it falls where the segment before ends, if it is not there already
                return _Side(segment, float(dt[row, 0]), True)
            inner, outer = float(dt[row, column - 1]), float(dt[row, column])
            for _ in range(_PEAKS.rounds):
                within = np.linspace(inner, outer, len(_LOOKS))
                low = magnitude(np.array([segment]), within[None]) < level
                low[[0, -1]] = False, True
                k = int(low.argmax())
                inner, outer = float(within[k - 1]), float(within[k])
            return _Side(segment, inner, True)
        first = int(segments[-1]) + way
    return _Side(limit, 0.0 if way < 0 else float(curve.duration[limit]), False)
