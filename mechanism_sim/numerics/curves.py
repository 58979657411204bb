"""Curves through points, as polynomials between them: tables of forces, motors, profiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import scipy

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.polynomials import TWO_PI, shift_powers
from mechanism_sim.numerics.sampled import spline_through

Interpolation = Literal['linear', 'cubic', 'quintic']
_Ramp = Literal['linear', 'smooth', 'cubic', 'quintic']

_WIDEST = 0.25 * TWO_PI  # greatest width of an interval of a curve that repeats every turn


@dataclass(frozen=True)
class Curve:
    """A piecewise polynomial, constant before the first and after the last point."""

    #: (k + 1,) between which the polynomials hold; infinite at both ends, or those of a turn
    breaks: Array
    #: (k, n) coefficients of rising powers of the position from its interval's middle, or from the
    #: finite end of an infinite one
    rows: Array
    cyclic: bool = False  #: True if it repeats every turn of the position times the scale
    scale: float = 1.0  #: factor of the positions

    def __call__(self, x: Array) -> Array:
        """Values at positions (N,); at a step the value behind it."""
        x = x * self.scale
        if self.cyclic:
            x = self.breaks[0] + (x - self.breaks[0]) % TWO_PI
        row = np.clip(np.searchsorted(self.breaks, x, 'right') - 1, 0, len(self.rows) - 1)
        with np.errstate(invalid='ignore'):
            origin = 0.5 * (self.breaks[1:] + self.breaks[:-1])
        if not self.cyclic:
            origin[[0, -1]] = self.breaks[[1, -2]]
        powers = (x - origin[row])[:, None] ** np.arange(self.rows.shape[1])
        return np.asarray((self.rows[row] * powers).sum(axis=1))

    def integral(self) -> Curve:
        """Integral from 0, of a curve that does not repeat."""
        count = self.rows.shape[1]
        rows = np.pad(self.rows / np.arange(1.0, count + 1.0), ((0, 0), (1, 0)))
        inner = self.breaks[1:-1]  # where one polynomial follows on another
        origin = np.append(0.5 * (inner[1:] + inner[:-1]), inner[-1])
        powers = np.arange(count + 1)
        for k, (at, place) in enumerate(zip(inner, origin, strict=True)):
            before = inner[0] if k == 0 else origin[k - 1]
            ended = (rows[k] * (at - before) ** powers).sum()
            rows[k + 1, 0] = ended - (rows[k + 1] * (at - place) ** powers).sum()
        found = Curve(self.breaks, rows)
        rows[:, 0] -= found(np.zeros(1))
        return found


def through(
    points: Sequence[tuple[float, float]],
    ramp: _Ramp = 'linear',
    cyclic: bool = False,
    period: float = TWO_PI,
) -> Curve:
    """The curve through points (x, y) whose x do not fall; two of the same x are a step.

    Between steps it is straight, a spline, or smooth: of continuous slope and without extremes of
    its own (cubic Hermite polynomials with the slopes of Fritsch and Butland, SIAM J. Sci. Stat.
    Comput. 5, 1984).

    Parameters
    ----------
    cyclic : True if it repeats after the period, which the points must span

    Raises
    ------
    ValueError
        One sentence: what is wrong with the points.
    """
    x, y = (np.array(column, float) for column in zip(*points, strict=True))
    if len(x) < 2 or (np.diff(x) < 0.0).any() or ((x[2:] == x[:-2]) & (x[1:-1] == x[2:])).any():
        raise ValueError('needs two points or more of increasing x; two of the same x are a step')
    scale = TWO_PI / period if cyclic else 1.0
    x = x * scale
    steps = np.flatnonzero(np.diff(x) == 0.0) + 1
    if cyclic and abs(x[-1] - x[0] - TWO_PI) > 1e-9:
        raise ValueError(
            f'is cyclic, so that its points must span a turn of 360 deg: they span '
            f'{np.degrees(x[-1] - x[0]):.6g} deg'
        )
    parts = [(a, b) for a, b in pairwise([0, *steps, len(x)]) if b > a + 1]
    if not parts:
        raise ValueError('is one step: give a point beside it')
    closes = cyclic and not len(steps) and y[0] == y[-1]
    breaks, rows = [x[0]], []
    for begin, end in parts:
        for a, b, row in _polynomials(x[begin:end], y[begin:end], ramp, closes):
            if x[begin] <= a < x[end - 1]:
                parts_of = max(1, int(np.ceil((b - a) / _WIDEST))) if cyclic else 1
                ends = np.linspace(a, b, parts_of + 1)
                middles = 0.5 * (ends[1:] + ends[:-1])
                rows += list(shift_powers(np.repeat([row], parts_of, axis=0), middles - a))
                breaks += ends[1:].tolist()
    if cyclic:
        breaks[-1] = breaks[0] + TWO_PI
        return Curve(np.array(breaks), np.array(rows), cyclic=True, scale=scale)
    still = np.zeros((2, len(rows[0])))
    still[:, 0] = y[[0, -1]]
    return Curve(np.array([-np.inf, *breaks, np.inf]), np.array([still[0], *rows, still[1]]))


_LEAST = {'linear': 2, 'cubic': 4, 'quintic': 6}
"""Number of points that a spline without end conditions needs."""


def spline(
    x: Array, y: Array, interpolation: Interpolation, periodic: bool = False, rest: bool = False
) -> tuple[Array, Array]:
    """Breaks (k + 1,) and coefficients (k, n) of rising powers of the position from each break.

    The cubic has two continuous derivatives, the quintic four. At the ends, where nothing is said,
    the last polynomials hold over two intervals (cubic) or three (quintic).

    Parameters
    ----------
    x, y : (m,) points with rising x
    periodic : all derivatives at the ends are the same; the values may differ, as of what turns on
    rest : derivatives at the ends are zero: the first, and the second of a quintic

    Raises
    ------
    ValueError
        One sentence: what is wrong with the points.
    """
    least = 3 if periodic else 2 if rest else _LEAST[interpolation]
    if len(x) < least:
        raise ValueError(f'has {len(x)} points: a {interpolation} through them needs {least}')
    if interpolation == 'linear':
        return x, np.stack([y[:-1], np.diff(y) / np.diff(x)], axis=1)
    slope = (y[-1] - y[0]) / (x[-1] - x[0]) if periodic else 0.0
    level = y - slope * (x - x[0])
    if periodic:
        level[-1] = level[0]
    degree = {'cubic': 3, 'quintic': 5}[interpolation]
    found = spline_through(x, level, degree, periodic, rest=rest)
    breaks, rows = found.x, found.c[::-1].T.copy()
    rows[:, 0] += slope * (breaks[:-1] - x[0])
    rows[:, 1] += slope
    return breaks, rows


def _polynomials(
    x: Array, y: Array, ramp: _Ramp, closes: bool
) -> list[tuple[float, float, Array]]:
    """Intervals with the coefficients of rising powers of the position from their starts.

    Of what closes, those of the turns before and behind it may be among them.
    """
    if ramp != 'smooth':
        breaks, rows = spline(x, y, ramp, closes and ramp != 'linear')
        return list(zip(breaks[:-1], breaks[1:], rows, strict=True))
    if closes and len(x) > 2:
        x = np.concatenate([x[-3:-1] - TWO_PI, x, x[1:3] + TWO_PI])
        y = np.concatenate([y[-3:-1], y, y[1:3]])
    found = scipy.interpolate.PchipInterpolator(x, y)
    return list(zip(found.x[:-1], found.x[1:], found.c[::-1].T, strict=True))
