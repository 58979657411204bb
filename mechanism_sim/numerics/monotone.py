"""Functions of time as polynomials on parts on each of which they rise or fall.

Intervals are halved until the interpolant at Gauss nodes has last coefficients that do not matter,
and cut where it is extreme. Then the time that a function is below a level is a sum over parts,
and the level below which it is for some share of the time a root of that.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.polynomial import legendre

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.numerics.polynomials import gauss_nodes
from mechanism_sim.numerics.quadrature import Parts, Values
from mechanism_sim.tolerances import TOLERANCES

_QUADRATURE = TOLERANCES.quadrature


_COUNT = 12
_PLACES = gauss_nodes(_COUNT)[0]
_TO_SERIES = (
    (2.0 * np.arange(_COUNT) + 1.0)
    * gauss_nodes(_COUNT)[1][:, None]
    * legendre.legvander(2.0 * _PLACES - 1.0, _COUNT - 1)
)
_GRID = -np.cos(np.linspace(0.0, np.pi, 4 * _COUNT + 1))  # in [-1, 1], both ends among them
_ON_GRID = legendre.legvander(_GRID, _COUNT - 1).T.copy()
_NEWTON, _BISECTIONS = 6, 52


class Monotone(NamedTuple):
    """P parts in the order of time; those of a segment in order."""

    segment: IndexArray  #: (P,) indices of the segments
    begin: Array  #: (P,) start [s] of the polynomial's interval in its segment
    width: Array  #: (P,) duration [s] of that interval
    low: Array  #: (P,) position in [-1, 1] where the part begins
    high: Array  #: (P,) position where it ends
    first: Array  #: (P,) value at `low`
    last: Array  #: (P,) value at `high`
    series: Array  #: (P, n) coefficients in Legendre polynomials
    error: float = 0.0  #: error of the polynomials
    lost: float = 0.0  #: time [s] in which the function is not finite

    @property
    def duration(self) -> Array:
        """Durations (P,) [s] of the parts."""
        return np.asarray(0.5 * self.width * (self.high - self.low))

    def crossings(self, level: float, of: IndexArray) -> Array:
        """Positions in [-1, 1] at which some of the parts cross a level."""
        a, b = self.low[of], self.high[of]
        rises, series = self.last[of] > self.first[of], self.series[of]
        for _ in range(_BISECTIONS):
            middle = 0.5 * (a + b)
            above = _at(series, middle) > level
            a, b = np.where(above == rises, a, middle), np.where(above == rises, middle, b)
        return np.asarray(0.5 * (a + b))

    def time_below(self, level: float) -> float:
        """Total time for which the function is not above a level [s]."""
        least, most = np.minimum(self.first, self.last), np.maximum(self.first, self.last)
        across = np.flatnonzero((least <= level) & (level < most))
        share = (self.crossings(level, across) - self.low[across]) / (
            self.high[across] - self.low[across]
        )
        share = np.where(self.last[across] > self.first[across], share, 1.0 - share)
        below = float(self.duration[most <= level].sum())
        return below + float((self.duration[across] * share).sum())

    def quantile(self, share: float) -> float:
        """Level that the function does not exceed for a share of the time."""
        least = float(np.minimum(self.first, self.last).min())
        most = float(np.maximum(self.first, self.last).max())
        wanted = share * float(self.duration.sum())
        if least == most or self.time_below(least) >= wanted:
            return least
        slack = np.spacing(wanted)
        if self.time_below(np.nextafter(most, least)) < wanted - 8.0 * slack:
            return most
        return float(
            scipy.optimize.brentq(
                lambda y: self.time_below(y) - wanted,
                least,
                most,
                xtol=_QUADRATURE.quantile * (most - least),
            )
        )


def joined(parts: list[Monotone]) -> Monotone:
    """One from several, in the order of time."""
    arrays: Any = (np.concatenate(x) for x in zip(*(p[:8] for p in parts), strict=True))
    found = Monotone(*arrays)
    return found._replace(error=max(p.error for p in parts), lost=sum(p.lost for p in parts))


def monotone(values: Values, parts: Parts, largest: float = 0.0) -> tuple[Monotone, float]:
    """One function on intervals in the order of time, and its largest magnitude so far.

    Parameters
    ----------
    values : (1, K n) as for `mechanism_sim.numerics.quadrature.integrate`
    largest : magnitude before the first of the intervals
    """
    interval = np.arange(len(parts.segment))
    begin, width = parts.begin, parts.end - parts.begin
    scale = np.zeros(len(begin))
    found, error, lost = [], 0.0, 0.0
    for depth in range(_QUADRATURE.halvings):
        series, top, finite = _series(values, parts.segment[interval], begin, width)
        if not depth:
            scale = np.maximum.accumulate(np.append(largest, top))[1:]
            largest = float(scale[-1]) if len(scale) else largest
        tail = _QUADRATURE.safety * np.abs(series[:, -3:]).max(axis=1)
        known = finite == _COUNT
        np.maximum.at(scale, interval, top)
        done = known & (tail <= _QUADRATURE.relative * scale[interval])
        pending = np.bincount(interval[~done & (finite > 0)], minlength=len(scale))
        done |= known & (pending[interval] > _QUADRATURE.parts)
        error = max(error, float(tail[done].max(initial=0.0)))
        lost += float(width[finite == 0].sum())
        kept = np.flatnonzero(done)
        found.append((parts.segment[interval[kept]], begin[kept], width[kept], series[kept]))
        again = np.flatnonzero(~done & (finite > 0))
        if not len(again):
            break  # else what is left after the last halving is the instant of a jump
        half = 0.5 * width[again]
        begin, width = np.append(begin[again], begin[again] + half), np.tile(half, 2)
        interval = np.tile(interval[again], 2)
    rows = [np.concatenate(x) for x in zip(*found, strict=True)]
    order = np.lexsort((rows[1], rows[0]))
    return _cut(*(x[order] for x in rows))._replace(error=error, lost=lost), largest


def _series(
    values: Values, segment: IndexArray, begin: Array, width: Array
) -> tuple[Array, Array, IndexArray]:
    """Coefficients (K, n), largest magnitudes (K,), and numbers of finite values (K,)."""
    dt = begin[:, None] + width[:, None] * _PLACES
    with np.errstate(invalid='ignore', over='ignore'):
        x = np.asarray(values(segment, dt), float).reshape(dt.shape)
    finite = np.isfinite(x)
    x = np.where(finite, x, 0.0)
    middle = x[:, _COUNT // 2]  # without it there is less to round, and nothing of a constant
    series = (x - middle[:, None]) @ _TO_SERIES
    series[:, 0] += middle
    return series, np.abs(x).max(axis=1, initial=0.0), finite.sum(axis=1)


def _cut(segment: IndexArray, begin: Array, width: Array, series: Array) -> Monotone:
    """Cut polynomials where they are extreme, found on a grid and then by Newton's method."""
    dense = series @ _ON_GRID
    slope = np.diff(dense, axis=1)
    turns = np.sign(slope[:, 1:]) * np.sign(slope[:, :-1]) < 0.0
    which, k = np.nonzero(turns)
    own = series[which]
    rate: Array = np.asarray(legendre.legder(own, axis=1), np.float64)
    bend: Array = np.asarray(legendre.legder(rate, axis=1), np.float64)
    place = _GRID[k + 1]
    for _ in range(_NEWTON):
        second = _at(bend, place)
        step = np.divide(_at(rate, place), second, out=np.zeros_like(place), where=second != 0.0)
        place = np.clip(place - step, _GRID[k], _GRID[k + 2])
    every = np.arange(len(series))
    owner = np.concatenate([every, which])
    low = np.append(np.full(len(series), -1.0), place)
    order = np.lexsort((low, owner))
    owner, low = owner[order], low[order]
    ends = np.append(owner[1:] != owner[:-1], True) if len(owner) else np.zeros(0, bool)
    high = np.where(ends, 1.0, np.append(low[1:], 1.0))
    some = low < high
    owner, low, high = owner[some], low[some], high[some]
    own = series[owner]
    return Monotone(
        segment[owner], begin[owner], width[owner], low, high, _at(own, low), _at(own, high), own
    )


def _at(series: Array, place: Array) -> Array:
    """Values (P,) of polynomials (P, n), each at its position (P,)."""
    return np.asarray((series * legendre.legvander(place, series.shape[1] - 1)).sum(axis=1))
