"""Strokes and dwells of coordinates, from where a motion reverses and where it stands still."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial

#: share of the range of a coordinate: a shorter way back is rounding, not a reversal
_WAY = 1e-9
#: share of the greatest speed: a segment with a lower speed throughout is a standstill
_SPEED = 1e-9
#: share of the range: smaller reversals are ripples of a standstill, as of measured laws
_RIPPLE = 1e-3
#: share of the period: shorter standstills are the instant of a reversal
_BRIEF = 1e-7
#: share of the range or greatest speed: largest difference of end and start of a period
_REPEATS = 1e-6
#: at which the speed is looked at in a segment: a Taylor step is a fraction of the time in which
#: the motion can turn round twice
_LOOKS = np.linspace(0.0, 1.0, 33)
_BISECTIONS = 60


class Stroke(NamedTuple):
    """The motion from one reversal to the next; it ends where a standstill before that begins."""

    begin: float  #: [s]
    end: float  #: [s]; beyond the end of the period if the stroke goes on in the next one
    start: float  #: position at the beginning [rad or m]
    stop: float  #: position at the end [rad or m]

    @property
    def duration(self) -> float:
        """Duration [s], standstills on the way included."""
        return self.end - self.begin

    @property
    def way(self) -> float:
        """Displacement from start to stop [rad or m], with its sign."""
        return self.stop - self.start


class Dwell(NamedTuple):
    """A standstill."""

    begin: float  #: [s]
    end: float  #: [s]; beyond the end of the period if it goes on in the next one
    position: float  #: [rad or m]

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.end - self.begin


@dataclass(frozen=True)
class Swing:
    """Range and strokes of a coordinate over a cycle.

    Attributes
    ----------
    size : greatest less least value [rad or m]
    turns : whole turns by which an angle grows in the cycle; 0 if they are not whole
    gained : displacement in the cycle [rad or m]
    period : period of the motion apart from its displacement [s]; None if it does not repeat,
        without strokes then
    strokes, dwells : strokes and dwells in a period, in the order of time
    ripple : largest displacement within a standstill [rad or m], 0 for a true one
    """

    size: float
    turns: int
    gained: float = 0.0
    period: float | None = None
    strokes: tuple[Stroke, ...] = ()
    dwells: tuple[Dwell, ...] = ()
    ripple: float = 0.0

    @property
    def comes_back(self) -> bool:
        """True if the coordinate reciprocates in each period."""
        return self.period is not None and abs(self.gained) <= _REPEATS * self.size

    @property
    def rising(self) -> float | None:
        """Duration of rising strokes in a period [s], all together."""
        return self._time(1.0)

    @property
    def falling(self) -> float | None:
        """Duration of falling strokes in a period [s], all together."""
        return self._time(-1.0)

    @property
    def standing(self) -> float | None:
        """Duration of standstills in a period [s], without stops within a stroke."""
        if self.period is None:
            return None
        if not self.strokes:  # it turns one way, with stops, or stands
            return math.fsum(x.duration for x in self.dwells)
        return max(self.period - sum(x.duration for x in self.strokes), 0.0)

    def _time(self, sign: float) -> float | None:
        if not self.comes_back or not self.strokes:
            return None
        return math.fsum(x.duration for x in self.strokes if sign * x.way > 0.0)

    @property
    def time_ratio(self) -> float | None:
        """Slower over faster of two strokes, dwells at their ends left out; None of any other."""
        if not self.comes_back or len(self.strokes) != 2:
            return None
        times = [x.duration for x in self.strokes]
        return max(times) / min(times)


class _Run(NamedTuple):
    """A part of a motion in one direction, 1 or -1, or at rest, 0."""

    way: int
    begin: float
    end: float
    start: float
    stop: float


def find_swings(
    coordinates: Sequence[str],
    angles: Sequence[bool],
    curve: PiecewisePolynomial,
    span: tuple[float, float],
    sizes: Sequence[float],
    period: float | None,
    whole: bool = True,
) -> dict[str, Swing]:
    """Range of coordinates (n,), and their strokes if their motion repeats itself.

    Parameters
    ----------
    angles : (n,) mask of the angles
    curve : motion of the coordinates
    span : begin and end of the cycle [s]
    sizes : (n,) greatest less least values [rad or m]
    period : period of the drive [s], a whole part of the cycle, if that repeats
    whole : True if all is as before after the cycle: then what has moved on by a part of a turn,
        or along a line, does so in every cycle
    """
    ends = np.array(span)
    positions, rates = curve(ends), curve(ends, 1)
    speeds = np.abs(curve(np.linspace(*span, 513), 1)).max(axis=0)
    found = {}
    for i, (name, size) in enumerate(zip(coordinates, sizes, strict=True)):
        gained = float(positions[1, i] - positions[0, i])
        turns = round(gained / TWO_PI) if angles[i] else 0
        turns = turns if abs(gained - TWO_PI * turns) <= _REPEATS * size else 0
        faster = abs(rates[1, i] - rates[0, i])
        moves_on = not turns and abs(gained) > _REPEATS * size
        if period is None or faster > _REPEATS * speeds[i] or (moves_on and not whole):
            found[name] = Swing(size, 0, gained)
            continue
        own = _period(curve, i, span, _REPEATS * size, period, moves_on)
        runs = _runs(curve, i, (span[0], span[0] + own), size, float(speeds[i]))
        each = float(curve(np.array([span[0] + own]))[0, i]) - runs[0].start
        runs, ripple = _without_ripples(runs, _RIPPLE * size, own, each)
        strokes, dwells = _strokes(runs, own, each)
        if strokes and moves_on:  # it goes to and fro elsewhere
            found[name] = Swing(size, 0, gained)
            continue
        found[name] = Swing(size, turns, gained, own, strokes, dwells, ripple)
    return found


def _period(
    curve: PiecewisePolynomial,
    i: int,
    span: tuple[float, float],
    near: float,
    period: float,
    moves_on: bool,
) -> float:
    """Least multiple of the drive's period after which a coordinate repeats itself [s].

    It is as before but for whole turns, or, if it `moves_on`, for any step.
    """
    begin, end = span
    count = round((end - begin) / period)
    t = np.linspace(begin, end, 64 * count + 1)
    x = curve(t)[:, i]
    for n in (n for n in range(1, count) if count % n == 0):
        later = x[64 * n :] - x[: -64 * n]
        off = later - (later[0] if moves_on else TWO_PI * np.round(later / TWO_PI))
        if np.abs(off).max() <= near:
            return n * period
    return end - begin


def _runs(
    curve: PiecewisePolynomial, i: int, span: tuple[float, float], size: float, speed: float
) -> list[_Run]:
    """Parts of a coordinate's motion in one direction or at rest, in the order of time."""
    begin, end = curve.spans(*span)
    t = begin[:, None] + (end - begin)[:, None] * _LOOKS
    k, into = curve.within(t)
    x = curve.at(k, into)[:, i].reshape(t.shape)
    v = curve.at(k, into, 1)[:, i].reshape(t.shape)
    stands = np.abs(v).max(axis=1) <= _SPEED * speed
    # whether the motion turns round between two looks; an instant of rest belongs to what follows
    ways = np.where(v < 0.0, -1, np.where(v > 0.0, 1, 0))
    for n in range(len(_LOOKS) - 2, -1, -1):
        ways[:, n] = np.where(ways[:, n] == 0, ways[:, n + 1], ways[:, n])
    for n in range(1, len(_LOOKS)):
        ways[:, n] = np.where(ways[:, n] == 0, ways[:, n - 1], ways[:, n])
    found: list[_Run] = []
    row, column = np.nonzero((ways[:, 1:] != ways[:, :-1]) & ~stands[:, None])
    turning = reversals(curve, i, k[row], into[row, column], into[row, column + 1])
    for j in range(len(t)):
        if stands[j]:
            found.append(_Run(0, t[j, 0], t[j, -1], x[j, 0], x[j, -1]))
            continue
        inside = np.flatnonzero(row == j)
        at, places = turning[0][inside], turning[1][inside]
        at = at - into[j, 0] + t[j, 0]
        times, values = [t[j, 0], *at, t[j, -1]], [x[j, 0], *places, x[j, -1]]
        starts = [ways[j, 0], *ways[j, column[inside] + 1]]
        parts = [
            _Run(int(way), *times[n : n + 2], *values[n : n + 2]) for n, way in enumerate(starts)
        ]
        # where a law ends smoothly, the sign of the rate is rounding: that belongs to its segment
        found += _merged(parts, _WAY * size, 0.0)
    return _merged(found, _WAY * size, _BRIEF * (span[1] - span[0]))


def reversals(
    curve: PiecewisePolynomial, i: int, k: NDArray[np.intp], low: Array, high: Array
) -> tuple[Array, Array]:
    """Times and positions at which a coordinate's rate changes its sign in segments (K,)."""
    if not len(k):
        return np.zeros(0), np.zeros(0)
    negative = curve.at(k, low, 1)[:, i] < 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        same = (curve.at(k, middle, 1)[:, i] < 0.0) == negative
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low, curve.at(k, low)[:, i]


def one_way_ends(curve: PiecewisePolynomial, i: int) -> Array:
    """Ends of segments [s], and where a coordinate turns back within them."""
    every, begin = np.arange(len(curve)), np.zeros(len(curve))
    first, last = (curve.at(every, dt, 1)[:, i] for dt in (begin, curve.duration))
    k = np.flatnonzero(first * last < 0.0)
    since, _ = reversals(curve, i, k, begin[k], curve.duration[k])
    return np.union1d(np.append(curve.start, curve.end), curve.times(k, since))


def _merged(runs: list[_Run], way: float, brief: float) -> list[_Run]:
    """Runs of the same direction joined; those within rounding go to a neighbour."""
    runs = _joined(runs)
    while len(runs) > 1:
        small = [
            n for n, run in enumerate(runs)
            if (run.end - run.begin <= brief if not run.way else abs(run.stop - run.start) <= way)
        ]  # fmt: skip
        if not small:
            break
        n = min(small, key=lambda n: runs[n].end - runs[n].begin)
        beside = [runs[k].way for k in (n - 1, n + 1) if 0 <= k < len(runs)]
        runs[n] = runs[n]._replace(way=next((way for way in beside if way), 0))
        runs = _joined(runs)
    return runs


def _joined(runs: list[_Run]) -> list[_Run]:
    """Neighbours of the same direction as one."""
    found = runs[:1]
    for run in runs[1:]:
        if run.way == found[-1].way:
            found[-1] = found[-1]._replace(end=run.end, stop=run.stop)
        else:
            found.append(run)
    return found


def _around(runs: list[_Run], period: float, gained: float) -> list[_Run]:
    """Runs of a period; one that continues beyond its end is the last."""
    if len(runs) < 2 or runs[0].way != runs[-1].way:
        return runs
    first, *middle, last = runs
    return [*middle, last._replace(end=first.end + period, stop=first.stop + gained)]


def _without_ripples(
    runs: list[_Run], most: float, period: float, gained: float
) -> tuple[list[_Run], float]:
    """Runs in which short ways to and fro are standstills, and how far the longest of these go.

    Those between two parts of a motion the same way are no standstill but belong to it.

    Parameters
    ----------
    most : largest displacement of a ripple [rad or m]
    gained : displacement in a period [rad or m]
    """

    def later(run: _Run) -> _Run:
        begin, end = run.begin + period, run.end + period
        return run._replace(begin=begin, end=end, start=run.start + gained, stop=run.stop + gained)

    around = _around(runs, period, gained)
    small = [not run.way or abs(run.stop - run.start) <= most for run in around]
    if all(small) or not any(run.way and s for run, s in zip(around, small, strict=True)):
        return runs, 0.0
    k = small.index(False)  # from a motion on, so that no standstill is cut in two
    around, small = [*around[k:], *map(later, around[:k])], [*small[k:], *small[:k]]
    found: list[_Run] = []
    ripple, k = 0.0, 0
    for flat, group in groupby(range(len(around)), key=small.__getitem__):
        part = [around[n] for n in group]
        places = [x for run in part for x in (run.start, run.stop)]
        reach, k = max(places) - min(places), k + len(part)
        if not flat or reach > most:
            found += part
            continue
        before, after = found[-1].way, around[k % len(around)].way
        stands = [run for run in part if not run.way]
        way = before if before == after and not stands else 0
        at = 0.5 * (max(places) + min(places))
        if stands:
            at = max(stands, key=lambda run: run.end - run.begin).start
        start, stop = (part[0].start, part[-1].stop) if way else (at, at)
        found.append(_Run(way, part[0].begin, part[-1].end, start, stop))
        ripple = ripple if way else max(ripple, reach)
    return _merged(found, 0.0, 0.0), ripple


def _strokes(
    runs: list[_Run], period: float, gained: float
) -> tuple[tuple[Stroke, ...], tuple[Dwell, ...]]:
    """Strokes and dwells of a motion that repeats itself.

    Parameters
    ----------
    gained : displacement in a period: whole turns
    """
    if not any(run.way for run in runs):
        return (), tuple(Dwell(run.begin, run.end, run.start) for run in runs)
    runs = _around(runs, period, gained)
    dwells = tuple(Dwell(run.begin, run.end, run.start) for run in runs if not run.way)
    # a stop on the way does not end a stroke: only a reversal does
    whole = _around(_joined([run for run in runs if run.way]), period, gained)
    if len(whole) < 2:
        return (), dwells
    return tuple(Stroke(*run[1:]) for run in whole), dwells
