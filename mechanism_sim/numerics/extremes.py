"""Least and greatest values of functions of time that are smooth on known intervals.

Each interval is interpolated at Chebyshev nodes (Trefethen, Approximation Theory and Approximation
Practice, ch. 3 and 8). The trailing coefficients and the misfit at both ends bound what the
interpolant may be off; an interval that cannot beat what was found elsewhere is dropped, one that
could but is not resolved is halved, and of the others the functions themselves are evaluated where
the interpolant is extreme. What is reported is therefore a value of the function, at its time.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, IndexArray, Mask, joined, some
from mechanism_sim.numerics.polynomials import (
    Nodes,
    PiecewisePolynomial,
    Times,
    chebyshev_coefficients,
    chebyshev_nodes,
)
from mechanism_sim.tolerances import TOLERANCES

_EXTREMES = TOLERANCES.extremes
_ROUNDING = TOLERANCES.rounding

Functions = Callable[[Array], Array]
_Glance = Callable[[slice], Array]
Values = Callable[[IndexArray, Times], Array]


_COUNT = 12  # nodes: enough for a step of a Taylor method, a third of the radius of convergence
_NODES = chebyshev_nodes(_COUNT)
_FEW = chebyshev_nodes(5)  # to tell which intervals are worth a look
GLANCES = Nodes(tuple(_FEW.tolist()))
"""Places at which functions are sampled before it is known which intervals matter."""

_PLACES = np.cos(np.linspace(np.pi, 0.0, 8 * _COUNT + 1))  # in [-1, 1], both ends among them
_GRID: Array = np.array(np.polynomial.chebyshev.chebvander(_PLACES, _COUNT - 1).T, np.float64)
_DEGREES = np.arange(_COUNT)
_SLOPE = np.zeros((_COUNT, _COUNT))  # from Chebyshev coefficients to those of the derivative
_SLOPE[:, :-1] = np.polynomial.chebyshev.chebder(np.eye(_COUNT), axis=1)
_BETWEEN = 1.0 / np.cos(np.pi / 16.0) - 1.0
"""Rise of a polynomial between the places of the grid, of its range (Ehlich and Zeller)."""
_BLOCK, _GLANCE = 64, 2048  # intervals at once, to look through and to choose from
_PRODUCT = 1024  # intervals in one matrix product: BLAS starts no threads for so few
_MOST = 16  # intervals that are halved at once


class _Pairs(NamedTuple):
    """Intervals in each of which one function may exceed what was found so far."""

    row: IndexArray  #: index of the height: functions, then the functions negated
    interval: IndexArray


class _Intervals(NamedTuple):
    """K intervals under search, with results of the intervals they are halves of."""

    a: Array  #: (K,) starts [s]
    b: Array  #: (K,) ends [s]
    wanted: Mask  #: (2 C, K) mask of heights that may be exceeded there
    error: Array  #: (C, K) errors of the interpolants before the last halving
    stalled: NDArray[np.int8]  #: (C, K) number of successive halvings without improvement
    bound: Array  #: (2 C, K) upper bounds of the heights

    def halves(self) -> _Intervals:
        """All first halves, then all second ones."""
        middle = 0.5 * (self.a + self.b)
        twice: Any = (np.tile(x, 2) for x in self[2:])
        return _Intervals(np.append(self.a, middle), np.append(middle, self.b), *twice)


class ExtremeSearch:
    """Finds the least and the greatest value of C functions, over intervals that are added.

    Parameters
    ----------
    groups : (C,) group of each function; rounding is relative to the largest of a group
    sizes : magnitudes of cancelled terms, by group
    positive : mask of functions that are never negative, such as magnitudes of forces
    magnitudes : mask of functions of which only the extreme farther from zero is searched, as for
        a magnitude
    arms : by group another one and the factor of its magnitudes, from which the group follows

    Attributes
    ----------
    least, greatest : (C,) values; NaN for a function that was never finite
    least_time, greatest_time : (C,) times [s]; the earliest of several equal to rounding
    """

    def __init__(
        self,
        groups: Sequence[Hashable],
        sizes: Mapping[Hashable, float] = MappingProxyType({}),
        positive: Sequence[bool] | None = None,
        magnitudes: Sequence[bool] | None = None,
        arms: Mapping[Hashable, tuple[Hashable, float]] = MappingProxyType({}),
    ) -> None:
        known = list(dict.fromkeys(groups))
        self._group = np.array([known.index(g) for g in groups], np.intp)
        self._largest = np.array([sizes.get(g, 0.0) for g in known])
        self._sized = [known.index(g) for g in sizes if g in known]
        self._arms = [
            (known.index(g), known.index(of), arm)
            for g, (of, arm) in arms.items()
            if g in known and of in known
        ]
        count = len(groups)
        at_least = np.zeros(count, bool) if positive is None else np.asarray(positive)
        self._highest = np.append(np.full(count, np.inf), np.where(at_least, 0.0, np.inf))
        self._either = np.zeros(count, bool) if magnitudes is None else np.asarray(magnitudes)
        self._top = np.full(2 * count, -np.inf)
        self._time = np.full(2 * count, np.nan)

    def enlarge(self, size: float) -> None:
        """Raise the magnitude of cancelled terms in groups with a size to a new minimum."""
        self._largest[self._sized] = np.fmax(self._largest[self._sized], size)

    @property
    def least(self) -> Array:
        """Least values (C,)."""
        return self._finite_values(-self._top[len(self._group) :])

    @property
    def greatest(self) -> Array:
        """Greatest values (C,)."""
        return self._finite_values(self._top[: len(self._group)])

    @property
    def least_time(self) -> Array:
        """Times of the least values (C,) [s]."""
        return self._time[len(self._group) :]

    @property
    def greatest_time(self) -> Array:
        """Times of the greatest values (C,) [s]."""
        return self._time[: len(self._group)]

    @property
    def rounding(self) -> Array:
        """Rounding errors (C,): smaller differences count as equality."""
        largest = self._largest.copy()
        for group, of, arm in self._arms:
            largest[group] = max(largest[group], arm * largest[of])
        return np.asarray(_ROUNDING.value * largest[self._group])

    @property
    def _limit(self) -> Array:
        """Heights (2 C,) that must be exceeded to matter."""
        return np.asarray(self._reached(self._top) + np.tile(self.rounding, 2))

    def _reached(self, heights: Array) -> Array:
        """Heights (2 C,) to be exceeded: of a magnitude the larger of both extremes."""
        count = len(self._group)
        larger = np.tile(np.fmax(heights[:count], heights[count:]), 2)
        return np.where(np.tile(self._either, 2), larger, heights)

    def _finite_values(self, x: Array) -> Array:
        return np.where(np.isnan(self._time[: len(x)]), np.nan, x + 0.0)

    def add_motion(
        self, values: Values, curve: PiecewisePolynomial, since: float = -np.inf
    ) -> None:
        """Look through the segments of a motion from some time [s] on.

        Parameters
        ----------
        values : (C, K n) in K segments at times (K, n) [s] after their starts, or at n nodes
        """
        start, end = curve.spans(since, np.inf)
        k = curve.locate(0.5 * (start + end))
        self.add(
            lambda t: values(*curve.within(t)), start, end, lambda some: values(k[some], GLANCES)
        )

    def add(
        self,
        functions: Functions,
        start: Array,
        end: Array,
        glance: _Glance | None = None,
        alike: IndexArray | None = None,
    ) -> None:
        """Look through intervals (m,) [s], ends included, on each of which all is smooth.

        Parameters
        ----------
        functions : values (C, K n) at times (K, n); each row lies in one interval
        glance : values (C, 5 K) at Chebyshev nodes of some intervals, or of more around them
        alike : (m,) numbers of intervals: functions that agree at these nodes in two of one number
            agree throughout, and are looked into once
        """
        count = 0 if alike is None else int(alike.max(initial=-1)) + 1
        done, shapes = 0, np.full((len(self._group), count, len(_FEW)), np.nan)
        while done < len(start):
            block = slice(done, done + _GLANCE)
            a, b = start[block], end[block]
            done += len(a)
            few = a[:, None] + (b - a)[:, None] * _FEW
            values = glance(block) if glance else functions(few)
            bound = self._glanced(values)
            if alike is not None:
                bound[self._repeated(values, alike[block], shapes)] = -np.inf
            left = np.arange(len(a))
            while True:
                above = ~(bound[:, left] <= self._limit[:, None])
                left = left[above.any(axis=0)]
                if not len(left):
                    break
                now, left = left[:_BLOCK], left[_BLOCK:]
                self._look_through(functions, a[now], b[now])

    def _glanced(self, values: Array) -> Array:
        """Upper bounds of heights (2 C, K) in intervals, by values (C, 5 K) at nodes in each.

        It is minus infinity where another of these intervals is seen to reach higher.
        """
        known = np.where(np.isfinite(values), values, np.nan)
        high = np.fmax.reduce(known, axis=1, initial=-np.inf)
        low = np.fmin.reduce(known, axis=1, initial=np.inf)
        blur = _EXTREMES.glanced * np.fmax(np.abs(high), np.abs(low))
        seen = self._reached(np.concatenate([high - blur, -low - blur]))
        c = chebyshev_coefficients(values.reshape(len(self._group), -1, len(_FEW)))
        above = 4.0 * np.abs(c[:, :, -2:]).max(axis=2) + 0.25 * np.abs(c[:, :, -3])
        bound = _bounds(c, _GRID[: len(_FEW), ::3], above, self._highest)
        return np.where(bound < seen[:, None], -np.inf, bound)

    def _repeated(self, values: Array, alike: IndexArray, shapes: Array) -> Mask:
        """Tell which heights (2 C, K) repeat those of an interval, by values (C, 5 K) at nodes.

        `shapes` (C, numbers, 5) has what is known of each number, and gets what is new.
        """
        values = values.reshape(len(self._group), -1, len(_FEW))
        new, first = np.unique(alike, return_index=True)
        unknown = np.isnan(shapes[:, new]).all(axis=(0, 2))
        shapes[:, new[unknown]] = values[:, first[unknown]]
        sizes = self._largest.copy()
        seen = np.fmax.reduce(np.abs(values), axis=(1, 2), where=np.isfinite(values), initial=0.0)
        np.maximum.at(sizes, self._group, seen)
        off = np.abs(values - shapes[:, alike]).max(axis=2)
        same = off <= _EXTREMES.glanced * sizes[self._group][:, None]
        same[:, first[unknown]] = False
        return np.tile(same, (2, 1))

    def _look_through(self, functions: Functions, a: Array, b: Array) -> None:
        count = len(self._group)
        every = np.full((2 * count, len(a)), np.inf)
        stalled = np.zeros((count, len(a)), np.int8)
        wanted = every > 0.0
        pending = self._examine(functions, _Intervals(a, b, wanted, every[:count], stalled, every))
        for _ in range(_EXTREMES.rounds):
            excess = (pending.bound - self._limit[:, None]).max(axis=0, initial=-np.inf)
            order = np.argsort(-excess, kind='stable')[: int((excess > 0.0).sum())]
            if not len(order):
                return
            found = self._examine(functions, some(pending, order[:_MOST]).halves())
            pending = joined([some(pending, order[_MOST:]), found])

    def _examine(self, functions: Functions, x: _Intervals) -> _Intervals:
        """Look into intervals; those remain that are to be halved."""
        values = self._enter(functions, x.a, x.b)
        c = chebyshev_coefficients(values[:, :, 2:-2])
        error = _error(c, values)
        # rounding is in both halves of an interval, a corner or a peak in one
        smaller = np.minimum(error, np.roll(error, len(x.a) // 2, axis=1))
        stalled = np.where(smaller > _EXTREMES.less * x.error, x.stalled + 1, 0).astype(np.int8)
        pairs, place, height = self._possible(c, error, x.wanted)
        t = x.a[pairs.interval] + 0.5 * (place + 1.0) * (x.b - x.a)[pairs.interval]
        self._enter_tops(functions, pairs, t, x.a, x.b)
        spread = _EXTREMES.resolved * np.ptp(values, axis=2)
        resolved = error <= np.maximum(spread, self.rounding[:, None])
        short = x.b - x.a <= 4 * _EXTREMES.inset * np.spacing(np.abs(x.b))
        done = np.tile(resolved | (stalled >= _EXTREMES.stalled) | short, (2, 1))
        bound = np.full(x.wanted.shape, -np.inf)
        bound[pairs] = np.minimum(
            height + 2.0 * error[pairs.row % len(error), pairs.interval], self._highest[pairs.row]
        )
        bound[done] = -np.inf
        left = _Intervals(x.a, x.b, bound > -np.inf, error, stalled, bound)
        return some(left, np.flatnonzero(left.wanted.any(axis=0)))

    def _enter(self, functions: Functions, a: Array, b: Array) -> Array:
        """The functions at both ends, close to these, and at the nodes between: (C, K, n + 4)."""
        inset = np.minimum(_EXTREMES.inset * np.spacing(np.abs(b)), 0.25 * (b - a))
        t = np.column_stack([a, a + inset, a[:, None] + (b - a)[:, None] * _NODES, b - inset, b])
        values = functions(t).reshape(-1, *t.shape)
        flat = np.where(np.isfinite(values), values, np.nan).reshape(len(values), -1)
        sizes = np.fmax.reduce(np.abs(flat), axis=1, initial=0.0)
        np.maximum.at(self._largest, self._group, sizes)
        for first, sign in ((0, 1.0), (len(flat), -1.0)):
            heights = np.where(np.isnan(flat), -np.inf, sign * flat)
            k = heights.argmax(axis=1)
            found = heights[np.arange(len(flat)), k]
            rows = first + np.flatnonzero(
                found > self._top[first : first + len(flat)] + (self.rounding)
            )
            self._top[rows], self._time[rows] = found[rows - first], t.ravel()[k[rows - first]]
        return values

    def _possible(self, c: Array, error: Array, wanted: Mask) -> tuple[_Pairs, Array, Array]:
        """Candidates of higher values: places in [-1, 1], heights by the interpolants."""
        bound = _bounds(c, _GRID, 2.0 * error, self._highest)
        limit, count = self._limit, len(self._group)
        row, interval = np.nonzero(wanted & ~(bound <= limit[:, None]))
        signed = np.where(row < count, 1.0, -1.0)[:, None] * c[row % count, interval]
        place = _summit(signed)
        height = (signed * _chebyshev(place)).sum(axis=1)
        near = ~(height + 2.0 * error[row % count, interval] <= limit[row])
        return _Pairs(row[near], interval[near]), place[near], height[near]

    def _enter_tops(
        self, functions: Functions, pairs: _Pairs, t: Array, a: Array, b: Array
    ) -> None:
        """Enter the functions at the maxima of interpolants.

        There they differ by rounding from what is close by, and the place is surer than that of
        the highest of them.
        """
        if not len(t):
            return
        count = len(self._group)
        values = functions(t[:, None])[pairs.row % count, np.arange(len(t))]
        heights = np.where(pairs.row < count, values, -values)
        for i in np.argsort(t, kind='stable').tolist():
            row, k, height = pairs.row[i], pairs.interval[i], heights[i]
            blur = self.rounding[row % count]
            here = a[k] <= self._time[row] <= b[k]
            if height > self._top[row] + blur or (here and height >= self._top[row] - blur):
                self._top[row], self._time[row] = height, t[i]


def _bounds(c: Array, grid: Array, above: Array, highest: Array) -> Array:
    """Upper bounds of heights (2 C, K), by interpolants (C, K, n) and their errors (C, K)."""
    high, low = np.empty(c.shape[:2]), np.empty(c.shape[:2])
    for first in range(0, c.shape[1], _PRODUCT):
        some = slice(first, first + _PRODUCT)
        # intervals last: extremes over the last axis take several times as long
        dense = grid.T @ c[:, some].transpose(0, 2, 1)
        dense.max(axis=1, out=high[:, some])
        dense.min(axis=1, out=low[:, some])
    above = above + _BETWEEN * (high - low)
    return np.asarray(np.minimum(np.concatenate([high + above, above - low]), highest[:, None]))


def _error(c: Array, values: Array) -> Array:
    """Errors of interpolants (C, K, n), by their last terms and their misfit at the ends.

    Where there is a corner, terms fall as ``1 / n^2``: those left out add up to n times one of the
    last. At an end another value may hold than beside it; the one that fits better counts.
    """
    tail = np.abs(c[:, :, -3:]).max(axis=2)
    ends = c @ _GRID[:, [0, -1]]
    off = np.abs(np.stack([ends - values[:, :, [0, -1]], ends - values[:, :, [1, -2]]]))
    return np.asarray(4 * _COUNT * tail + off.min(axis=0).max(axis=2))


def _summit(c: Array) -> Array:
    """Maximisers (P,) of polynomials (P, n) in [-1, 1], by Newton's method from a grid."""
    dense = c @ _GRID
    k = dense.argmax(axis=1)
    low, high = _PLACES[np.maximum(k - 1, 0)], _PLACES[np.minimum(k + 1, len(_PLACES) - 1)]
    x = _PLACES[k]
    slope = c @ _SLOPE
    bend = slope @ _SLOPE
    for _ in range(6):
        at = _chebyshev(x)
        rate, second = np.einsum('pk,pk->p', slope, at), np.einsum('pk,pk->p', bend, at)
        step = np.divide(rate, second, out=np.zeros_like(rate), where=second < 0.0)
        x = np.clip(x - step, low, high)
    best = _PLACES[k]
    better = (c * _chebyshev(x)).sum(axis=1) >= dense[np.arange(len(k)), k]
    return np.asarray(np.where(better, x, best))


def _chebyshev(x: Array) -> Array:
    return np.asarray(np.cos(np.arccos(x)[:, None] * _DEGREES))
