"""Where the columns of a cycle are least and greatest, finer than their samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.cycles.columns import part_of

Array = NDArray[np.float64]
Sampler = Callable[[Array], Mapping[str, Array]]

_WITHOUT = ('closed.', 'mode.')
_PARTS = 8
_ROUNDS = 5, 12
"""Brackets become four times as narrow in each round. From 1/180 of a cycle five rounds lead to
5e-6 of it, where a parabola is right to 1e-11: wider ones are not parabolas, in narrower ones the
values differ by rounding. The others serve what has a kink or a jump there."""


@dataclass(frozen=True)
class Extreme:
    """The least or greatest value of a column.

    Attributes
    ----------
    value : in the column's SI unit
    t : when [s]
    drive : position of the drive then [rad or m]
    """

    value: float
    t: float
    drive: float


@dataclass(frozen=True)
class Extremes:
    """Both ends of a column's range."""

    least: Extreme
    greatest: Extreme
    rounding: float  #: size of its errors: 1e-12 of the greatest of all columns of its kind

    @property
    def constant(self) -> bool:
        """Whether they differ by rounding only."""
        return self.greatest.value - self.least.value <= self.rounding


@dataclass(frozen=True)
class Swing:
    """How a coordinate moves over a cycle.

    Attributes
    ----------
    size : greatest less least value [rad or m]
    turns : whole turns that it is farther at the end, if the cycle repeats
    rising, falling : time from the least to the greatest value and back [s], where it comes back
        after a period
    """

    size: float
    turns: int
    rising: float | None = None
    falling: float | None = None

    @property
    def time_ratio(self) -> float | None:
        """Slower over faster stroke."""
        if self.rising is None or self.falling is None:
            return None
        return max(self.rising, self.falling) / min(self.rising, self.falling)


def find_extremes(at: Sampler, table: Mapping[str, Array], drive: str) -> dict[str, Extremes]:
    """Least and greatest values of all columns that have some.

    Each is looked for beside the outermost sample, in brackets that are narrowed together.

    Parameters
    ----------
    at : the columns (K,) at any instants (K,) [s]
    table : samples of them, each (N,), SI units
    drive : the column that says where the drive is
    """
    t = table['t']
    names = [n for n in table if n != 't' and part_of(n) != 'direction']
    names = [n for n in names if not n.startswith(_WITHOUT)]
    wanted = [(name, sign) for name in names for sign in (-1.0, 1.0)]
    best = np.array([int(np.argmax(sign * table[name])) for name, sign in wanted])
    when = t[best]
    top = np.array([sign * table[n][k] for (n, sign), k in zip(wanted, best, strict=True)])
    low, high = t[np.maximum(best - 1, 0)], t[np.minimum(best + 1, len(t) - 1)]

    def heights(times: Array) -> Array:
        """The wanted columns (m, K), each at times of its own (m, K), as heights."""
        columns, width = at(times.ravel()), times.shape[1]
        return np.array(
            [
                sign * columns[name][i * width : (i + 1) * width]
                for i, (name, sign) in enumerate(wanted)
            ]
        )

    kinds: dict[str, float] = {}
    for name in names:
        kind = name.partition('.')[0]
        kinds[kind] = max(kinds.get(kind, 0.0), float(np.abs(table[name]).max()))
    rounding = {name: 1e-12 * kinds[name.partition('.')[0]] for name in names}
    blur = np.array([rounding[name] for name, _ in wanted])
    low, high, when, top = _narrowed(low, high, when, top, heights, _ROUNDS[0])
    vertex = np.clip(_vertex(low, high, heights), low, high)
    value = heights(vertex[:, None])[:, 0]
    # near the top values differ by rounding, and the vertex is surer than the highest of them
    flat = value >= top - blur
    *_, when_narrow, top_narrow = _narrowed(low, high, when, top, heights, _ROUNDS[1])
    sharp = top_narrow > np.maximum(value, top) + blur
    when = np.where(sharp, when_narrow, np.where(flat, vertex, when))
    top = np.where(sharp, top_narrow, np.where(flat, value, top))
    where = at(when)[drive]
    found = [
        Extreme(sign * float(top[i]) + 0.0, float(when[i]), float(where[i]))
        for i, (_, sign) in enumerate(wanted)
    ]
    return {n: Extremes(found[2 * i], found[2 * i + 1], rounding[n]) for i, n in enumerate(names)}


def _narrowed(
    low: Array,
    high: Array,
    when: Array,
    top: Array,
    heights: Callable[[Array], Array],
    rounds: int,
) -> tuple[Array, Array, Array, Array]:
    """Brackets (m,) around the highest points, where these are, and how high."""
    rows = np.arange(len(low))
    for _ in range(rounds):
        times = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, _PARTS + 1)
        values = heights(times)
        k = values.argmax(axis=1)
        higher = values[rows, k] > top
        when, top = np.where(higher, times[rows, k], when), np.maximum(top, values[rows, k])
        low = times[rows, np.maximum(k - 1, 0)]
        high = times[rows, np.minimum(k + 1, _PARTS)]
    return low, high, when, top


def _vertex(low: Array, high: Array, heights: Callable[[Array], Array]) -> Array:
    """Of the parabolas through both ends and the middle of the brackets."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    left, top, right = heights(np.column_stack([low, middle, high])).T
    bend = left - 2.0 * top + right
    bent = bend < 0.0
    shift = 0.5 * (left - right) / np.where(bent, bend, 1.0)
    return np.asarray(np.where(bent, middle + half * shift, middle))


def find_swings(
    coordinates: Sequence[str],
    table: Mapping[str, Array],
    extremes: Mapping[str, Extremes],
    period: float | None,
) -> dict[str, Swing]:
    """How far each coordinate goes, and how long it takes both ways.

    Parameters
    ----------
    table : columns (N,) by name, SI units
    period : [s] of the cycle if it repeats
    """
    found = {}
    for name in coordinates:
        position, ends = table[f'position.{name}'], extremes[f'position.{name}']
        size = ends.greatest.value - ends.least.value
        gained = float(position[-1] - position[0])
        if period is None:
            found[name] = Swing(size, 0)
            continue
        turns = round(gained / (2.0 * math.pi)) if abs(gained) > math.pi else 0
        comes_back = abs(gained) <= 1e-6 * size and not ends.constant
        if not comes_back:
            found[name] = Swing(size, turns)
            continue
        rising = (ends.greatest.t - ends.least.t) % period
        found[name] = Swing(size, 0, rising, period - rising)
    return found
