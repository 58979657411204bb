"""Piecewise polynomials in time: the form every solution and every motion message has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from time import perf_counter
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, IndexArray, of_one_width
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.kernels import charge, entry

TWO_PI = 2.0 * np.pi
_GATHERED = 2048  # instants whose coefficients are gathered at once
_SAME_RATES = 1e-12  # of the largest of the rates: between two that only rounding tells apart


@entry
def evaluate(
    coefficients: Array, segments: NDArray[np.int64], dt: Array, factors: Array, out: Array
) -> int:
    """Values of r derivatives of n polynomials at K instants in each of some segments.

    Parameters
    ----------
    coefficients : (m n, d + 1) of m segments
    segments : (N,)
    dt : (N K,) [s] since their starts
    factors : (r, d + 1) factors of the powers; zero for the first ones of derivatives
    out : (r n, N K) overwritten
    """
    n, each = len(out) // len(factors), len(dt) // len(segments)
    for s in range(len(segments)):
        for at in range(s * each, (s + 1) * each):
            t = dt[at]
            for k in range(len(factors)):
                for i in range(n):
                    row, x = coefficients[segments[s] * n + i], 0.0
                    for j in range(len(row) - 1, -1, -1):
                        if factors[k, j] == 0.0:
                            break
                        x = x * t + factors[k, j] * row[j]
                    out[k * n + i, at] = x
    return 0


@dataclass(frozen=True)
class Nodes:
    """K positions, equal in every segment: fractions of its duration."""

    fractions: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.fractions)

    @lru_cache  # noqa: B019 - there are two or three of them
    def derivative(self, order: int, count: int) -> Array:
        """Derivatives of the powers below `count`, at the fractions: (count - order, K)."""
        falling = [float(math.perm(j, order)) for j in range(order, count)]
        return (np.vander(self.fractions, count - order, increasing=True) * falling).T.copy()

    @lru_cache  # noqa: B019 - there are two or three of them
    def powers(self, count: int) -> Array:
        """Powers of the fractions, beside their derivatives: (count, 2 K)."""
        values = np.vander(self.fractions, count, increasing=True)
        rates = np.zeros_like(values)
        rates[:, 1:] = values[:, :-1] * np.arange(1.0, count)
        return np.concatenate([values, rates]).T.copy()


Times: TypeAlias = 'Array | Nodes'
"""Times [s] since the starts of segments."""


@dataclass(frozen=True)
class PiecewisePolynomial:
    """n functions of time on m consecutive segments, each a polynomial of degree d.

    ``f_i(t) = 2 pi turns[k, i] + sum_j coefficients[k, i, j] (t - start[k] - start_low[k])^j``
    """

    start: Array  #: (m,) starts [s]
    start_low: Array  #: (m,) [s] remainder that `start` rounds away
    duration: Array  #: (m,) durations [s]
    turns: NDArray[np.int64]  #: (m, n) whole turns
    coefficients: Array  #: (m, n, d + 1)

    def __len__(self) -> int:
        return len(self.start)

    @classmethod
    def joined(cls, curves: Sequence[PiecewisePolynomial]) -> Self:
        """One curve from consecutive ones, of the highest degree among them."""
        *columns, powers = zip(*(c.columns for c in curves), strict=True)
        start, low, duration, turns = map(np.concatenate, columns)
        return cls(start, low, duration, turns, np.concatenate(of_one_width(powers)))

    @property
    def columns(self) -> tuple[NDArray[Any], ...]:
        """Arrays in the order of the class."""
        return self.start, self.start_low, self.duration, self.turns, self.coefficients

    @property
    def end(self) -> float:
        """End of the last segment [s]."""
        return float(self.start[-1] + (self.start_low[-1] + self.duration[-1]))

    def locate(self, t: Array) -> IndexArray:
        """Index of the segment that holds each time; at a boundary the later one.

        Times outside of the segments by more than rounding are refused.
        """
        t = np.asarray(t, dtype=float)
        if not len(self):
            raise InputError('there is no motion to sample: the solution is empty')
        slack = self._slack
        if t.size and not (t.min() >= self.start[0] - slack and t.max() <= self.end + slack):
            raise InputError(
                f'time outside of the solution: asked [{t.min():.9g}, {t.max():.9g}] s, '
                f'solved [{self.start[0]:.9g}, {self.end:.9g}] s'
            )
        return np.clip(np.searchsorted(self.start, t, side='right') - 1, 0, len(self) - 1)

    @property
    def _slack(self) -> float:
        """Rounding of times [s]."""
        return 4.0 * float(np.spacing(max(abs(self.end), 1e-300)))

    def begun_by(self, t: Sequence[float] | Array) -> IndexArray:
        """Index of the first segment that begins at each time [s]; of an event the one after it.

        ``len(self)`` at the end, where none begins any more.
        """
        times = np.asarray(t, dtype=float)
        found: IndexArray = np.searchsorted(self.start, times - self._slack)
        if not len(self._after_no_time):
            return found
        return np.asarray(self._after_no_time[found], np.intp)

    @cached_property
    def _after_no_time(self) -> IndexArray:
        """Indices of each segment, or of the one behind it (m + 1,); empty if all are themselves.

        Where a step happens to end at an event but for rounding, the next finds it at once: a
        segment of no time that goes on without a jump of rates is before the event.
        """
        short = 1 + np.flatnonzero(self.duration[1:] <= self._slack)
        ends = self.local(short - 1, self.duration[short - 1], 1)
        jump = np.abs(self.coefficients[short, :, 1] - ends).max(axis=1, initial=0.0)
        short = short[jump <= _SAME_RATES * np.abs(ends).max(axis=1, initial=0.0)]
        if not len(short):
            return np.zeros(0, np.intp)
        behind = np.arange(len(self) + 1)
        for k in short[::-1]:
            behind[k] = behind[k + 1]
        return behind

    def spans(self, start: float, end: float) -> tuple[Array, Array]:
        """First and last times (k,) [s] from `start` to `end` within each segment.

        Segments shorter than rounding are left out.
        """
        last = np.append(np.nextafter(self.start[1:], -np.inf), self.end)
        first, last = np.maximum(self.start, start), np.minimum(last, end)
        known = first < last
        return first[known], last[known]

    def times(self, segment: IndexArray, dt: Array) -> Array:
        """Times (N,) [s] from times (N,) [s] since the starts of segments (N,)."""
        return np.asarray(self.start[segment] + (self.start_low[segment] + dt))

    def find(self, t: Array) -> tuple[IndexArray, Array]:
        """Segments that hold times `t` (N,) [s], as `locate`, and times since their starts [s]."""
        k = self.locate(t)
        return k, (t - self.start[k]) - self.start_low[k]

    def within(self, t: Array) -> tuple[IndexArray, Array]:
        """Segments (K,) that hold rows of times (K, n) [s], and the times since their starts."""
        k = self.locate(t[:, t.shape[1] // 2])
        return k, (t - self.start[k, None]) - self.start_low[k, None]

    def at(self, segment: IndexArray, dt: Times, derivative: int = 0) -> Array:
        """Value of a derivative at times `dt` after the start of given segments.

        Parameters
        ----------
        segment : (N,) indices
        dt : (N,) [s], or (N, K) or `Nodes` for K times in each of these segments
        derivative : order, 0 for the value itself

        Returns
        -------
        (N, n), or (N K, n) array
        """
        out = self.local(segment, dt, derivative)
        if derivative == 0 and self.turns[segment].any():
            out += TWO_PI * self.turns_at(segment, dt)
        return out

    def turns_at(self, segment: IndexArray, dt: Times) -> NDArray[np.int64]:
        """Whole turns that `local` leaves out, for each instant of `at`."""
        each = len(dt) if isinstance(dt, Nodes) else math.prod(dt.shape[1:])
        return np.repeat(self.turns[segment], each, axis=0)

    def local(self, segment: IndexArray, dt: Times, derivative: int = 0) -> Array:
        """Values without whole turns, so that angles keep their last digits."""
        return self.locals(segment, dt, (derivative,))[0]

    def locals(self, segment: IndexArray, dt: Times, derivatives: Sequence[int]) -> list[Array]:
        """Several derivatives without whole turns; coefficients are gathered once."""
        n, count = self.coefficients.shape[1:]
        if isinstance(dt, Nodes):
            # a small product for each segment: one for all would round by how many there are
            found = []
            for derivative in derivatives:
                widths = np.vander(self.duration[segment], count - derivative, increasing=True)
                scaled = self.coefficients[segment, :, derivative:] * widths[:, None]
                values = scaled @ dt.derivative(derivative, count)
                found.append(values.transpose(1, 0, 2).reshape(n, -1).T)
            return found
        falling = np.array([[float(math.perm(j, d)) for j in range(count)] for d in derivatives])
        if evaluate.is_compiled and dt.size:
            out = np.empty((len(falling) * n, dt.size))
            plain = np.ascontiguousarray(self.coefficients, float).reshape(-1, count)
            instants = np.ascontiguousarray(dt, float).ravel()
            evaluate(plain, np.asarray(segment, np.int64), instants, falling, out)
            return [rows.T for rows in out.reshape(len(falling), n, -1)]
        began = perf_counter()
        outs = [np.zeros((n, *dt.shape)) for _ in derivatives]
        # coefficients are gathered for as many instants as fit in the cache: ten times as fast
        block = max(1, _GATHERED * len(dt) // max(1, dt.size))
        for first in range(0, len(dt), block):
            some = slice(first, first + block)
            rows = np.ascontiguousarray(self.coefficients[segment[some]].transpose(2, 1, 0))
            if dt.ndim == 2:
                rows = rows[..., None]
            by = dt[some]
            for out, derivative, factors in zip(outs, derivatives, falling, strict=True):
                values = out[:, some]
                for j in range(count - 1, derivative - 1, -1):
                    values *= by
                    values += factors[j] * rows[j] if derivative else rows[j]
        charge(perf_counter() - began)
        return [out.reshape(n, -1).T for out in outs]

    def at_nodes(self, segment: IndexArray, nodes: Nodes) -> tuple[Array, Array]:
        """Values and rates (n, N K) as `local` gives them, by one matrix product for each of n.

        Powers of the durations go into the coefficients, powers of the fractions into the matrix.
        Below 2^18 multiplications a product, ``N 2 K (d + 1)``, BLAS starts no threads; they would
        cost several times what they do.
        """
        n, count = self.coefficients.shape[1:]
        duration = self.duration[segment]
        scaled = np.empty((n, len(segment), count))
        widths = np.vander(duration, count, increasing=True)
        np.multiply(self.coefficients[segment].transpose(1, 0, 2), widths, out=scaled)
        values = scaled @ nodes.powers(count)
        k = len(nodes)
        rates = values[:, :, k:] / duration[:, None]
        return values[:, :, :k].reshape(n, -1), rates.reshape(n, -1)

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        """Value of a derivative at times `t` (N,) [s]: (N, n)."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        return self.at(*self.find(t), derivative)


def chebyshev_nodes(count: int) -> Array:
    """Chebyshev points of the first kind on [0, 1], ascending: (count,)."""
    k = np.arange(count)
    return np.asarray(0.5 * (1.0 - np.cos(np.pi * (k + 0.5) / count)))


def gauss_nodes(count: int) -> tuple[Array, Array]:
    """Gauss-Legendre nodes and weights on [0, 1], each (count,)."""
    x, w = np.polynomial.legendre.leggauss(count)
    return np.asarray(0.5 * (x + 1.0)), np.asarray(0.5 * w)


def double_exponential_nodes(count: int) -> tuple[Array, Array]:
    """Nodes and weights on [0, 1], each (2 count + 1,), for powers that vanish at an end.

    Takahasi and Mori (1974): the trapezoidal rule after ``2 x - 1 = tanh(pi/2 sinh s)``.
    """
    s = np.linspace(-3.0, 3.0, 2 * count + 1)
    slope = 0.25 * np.pi * np.cosh(s) / np.cosh(0.5 * np.pi * np.sinh(s)) ** 2
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * np.pi * np.sinh(s)))), slope * 3.0 / count


@lru_cache
def _chebyshev_matrices(count: int) -> tuple[Array, Array]:
    """Matrices from values at the nodes of [0, 1] to Chebyshev coefficients, from these to powers.

    The second matrix consists of integers up to ``2^(2 d - 1)``. They meet coefficients that decay
    for a smooth function, so nothing is lost; their product, applied to the values, would amplify
    rounding by all of that.
    """
    k, j = np.arange(count)[:, None], np.arange(count)
    # T_k at node j; whole turns are taken off in integers
    at_nodes = (-1.0) ** k * np.cos(np.pi * (k * (2 * j + 1) % (4 * count)) / (2 * count))
    to_chebyshev = at_nodes * (2.0 / count)
    to_chebyshev[0] *= 0.5
    rows = [[1], [-1, 2]]  # T_0 and T_1 of 2 t - 1 in powers of t
    for _ in range(count - 2):
        last, before = [*rows[-1], 0], [*rows[-2], 0, 0]
        shifted = [0, *rows[-1]]
        rows.append([4 * s - 2 * a - b for s, a, b in zip(shifted, last, before, strict=True)])
    to_powers = np.zeros((count, count))
    for degree, row in enumerate(rows[:count]):
        to_powers[: degree + 1, degree] = row
    return np.asarray(to_chebyshev), to_powers


def fit_powers(values: Array, width: float) -> Array:
    """Interpolating polynomials in powers of ``t`` on [0, width].

    Parameters
    ----------
    values : (..., d + 1) values at ``width * chebyshev_nodes(d + 1)``
    width : [s]

    Returns
    -------
    (..., d + 1) coefficients of rising powers
    """
    count = values.shape[-1]
    to_chebyshev, to_powers = _chebyshev_matrices(count)
    middle = values[..., count // 2]  # without it there is less to round
    powers = ((values - middle[..., None]) @ to_chebyshev.T) @ to_powers.T
    powers[..., 0] += middle
    return np.asarray(powers / width ** np.arange(count))


def chebyshev_coefficients(values: Array) -> Array:
    """Chebyshev coefficients (..., d + 1) of values at ``chebyshev_nodes(d + 1)``."""
    return np.asarray(values @ _chebyshev_matrices(values.shape[-1])[0].T)


def shift_powers(coefficients: Array, by: Array) -> Array:
    """Coefficients (N, d + 1) of N polynomials in powers of ``t - by`` instead of ``t``."""
    rows = coefficients.copy()
    d = rows.shape[1] - 1
    for i in range(d):
        for j in range(d - 1, i - 1, -1):
            rows[:, j] += by * rows[:, j + 1]
    return rows


def first_due(t: float, rate: float) -> int:
    """Number of the first of samples at multiples of ``1 / rate`` that is due at `t` [s] or later.

    ``t * rate`` alone may round past it: 0.07 s at 100 Hz are more than 7.
    """
    k = math.ceil(t * rate)
    k -= (k - 1) / rate >= t
    return k + (k / rate < t)


def exact_sum(high: Array, low: Array, x: Array) -> tuple[Array, Array]:
    """``high + low + x`` rounded to a float, and the remainder; `low` is below an ulp."""
    total = high + x
    part = total - high
    rest = ((high - (total - part)) + (x - part)) + low
    rounded = total + rest
    return rounded, rest - (rounded - total)
