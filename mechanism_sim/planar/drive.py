"""Drives of coordinates: a prescribed angle, with laws without end, or a torque."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import chain, pairwise
from math import comb
from typing import Protocol

import numpy as np
from numpy.polynomial import Polynomial, polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.time_series import TimeSeries

#: 2 pi to 60 digits, so that whole turns can be taken off without losing any.
TWO_PI = Fraction('6.28318530717958647692528676655900576839433879875021164194989')


@dataclass(frozen=True)
class DriveLaw:
    """``angle(t) = 2 pi turns + sum_k coefficients[k] (t - reference_time)^k`` from then on."""

    coordinate: str
    coefficients: tuple[float, ...]  #: [rad, rad/s, rad/s^2, ...]
    reference_time: float = 0.0  #: [s]
    valid_from: float = 0.0  #: [s]
    straight: bool = False  #: whether it is a displacement [m], without turns
    turns: int = 0  #: whole turns, kept apart so that no digits are lost

    @property
    def degree(self) -> int:
        """Degree of the polynomial."""
        return len(self.coefficients) - 1

    def continues(self, before: DriveLaw) -> bool:
        """True if angle and speed go on without a jump where this law takes over."""
        at = Fraction(self.valid_from)
        (turns, old), (others, new) = before.about(at), self.about(at)
        angle = (others - turns) * float(TWO_PI) + new[0] - old[0]
        speeds = [law[1] if len(law) > 1 else 0.0 for law in (old, new)]
        return abs(angle) <= 1e-9 and abs(speeds[1] - speeds[0]) <= 1e-9 * max(
            1.0, *map(abs, speeds)
        )

    def about(self, time: Fraction) -> tuple[int, tuple[float, ...]]:
        """Whole turns at `time`, and the law in powers of the time since then.

        The angle left over lies in [0, 2 pi). Exact arithmetic: no digits are lost after however
        many turns.
        """
        since = time - Fraction(self.reference_time) if self.reference_time else time
        turns, local = _about(self.coefficients, *since.as_integer_ratio(), self.straight)
        return self.turns + turns, local

    def towards(self, speed: float, at: float, acceleration: float) -> list[DriveLaw]:
        """The laws that follow this one from `at` [s] on: a ramp, then the steady speed.

        Parameters
        ----------
        speed : [rad/s or m/s] to reach
        acceleration : [rad/s^2 or m/s^2] of the ramp, positive
        """
        turns, (angle, *rates) = self.about(Fraction(at))
        before = rates[0] if rates else 0.0
        if speed == before and not any(rates[1:]):
            return [replace(self, coefficients=(angle, speed), reference_time=at, valid_from=at,
                            turns=turns)]  # fmt: skip
        pull = math.copysign(acceleration, speed - before)
        ramp = replace(
            self, coefficients=(angle, before, 0.5 * pull), reference_time=at, valid_from=at,
            turns=turns,
        )  # fmt: skip
        end = at + (speed - before) / pull
        turns, (angle, *_) = ramp.about(Fraction(end))
        steady = replace(
            ramp, coefficients=(angle, speed), reference_time=end, valid_from=end, turns=turns
        )
        return [ramp, steady] if end > at else [steady]


@lru_cache(maxsize=64)  # studies begin at the same instant again and again
def _about(
    coefficients: tuple[float, ...], shift: int, unit: int, straight: bool
) -> tuple[int, tuple[float, ...]]:
    """`DriveLaw.about` for a time of ``shift/unit`` [s].

    In whole numbers, whose quotient is rounded once: fractions would look for common divisors.
    """
    ratios = [c.as_integer_ratio() for c in coefficients]
    common = max((below for _, below in ratios), default=1)  # all are powers of two
    exact = [above * (common // below) for above, below in ratios]
    last = len(exact) - 1
    moved = [
        sum(
            comb(k, j) * exact[k] * shift ** (k - j) * unit ** (last - k)
            for k in range(j, last + 1)
        )
        for j in range(last + 1)
    ]
    below = [common * unit ** (last - j) for j in range(last + 1)]
    turns = 0
    if not straight:
        whole, part = TWO_PI.numerator * below[0], TWO_PI.denominator
        turns, left = divmod(moved[0] * part, whole)
        moved[0], below[0] = left, below[0] * part
    return turns, tuple(x / y for x, y in zip(moved, below, strict=True))


@dataclass(frozen=True)
class TorqueLaw:
    """``torque = constant + per_angle angle + per_speed rate`` for ``t >= valid_from``.

    A direct-current motor of stall torque T and no-load speed w is ``(T, 0, -T/w)``.
    """

    coordinate: str
    coefficients: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: [N m, N m/rad, N m s/rad]
    valid_from: float = 0.0  #: [s]

    def after(self, turns: int) -> tuple[float, float, float]:
        """Coefficients for angles counted without a number of whole turns."""
        constant, per_angle, per_speed = self.coefficients
        return constant + per_angle * float(turns * TWO_PI), per_angle, per_speed


Law = DriveLaw | TorqueLaw


def speed_profile(
    coordinate: str,
    angle: float,
    points: Sequence[tuple[float, float]],
    smooth: bool,
    straight: bool = False,
    turns: int = 0,
) -> list[DriveLaw]:
    """The laws of a coordinate whose speed passes given points.

    Between two points the speed goes straight, or smoothly by ``3 s^2 - 2 s^3``; before the first
    and after the last it is constant.

    Parameters
    ----------
    angle : [rad] angle at time zero, or displacement [m]
    points : times [s], rising, and speeds [rad/s or m/s]
    straight : True if the coordinate is a displacement
    turns : whole turns at time zero beside the angle
    """
    laws = [DriveLaw(coordinate, (angle, points[0][1]), straight=straight, turns=turns)]

    def go_on(start: float, speed: float, ramp: tuple[float, ...] = ()) -> None:
        turns, (angle, *_) = laws[-1].about(Fraction(start))
        laws.append(DriveLaw(coordinate, (angle, speed, *ramp), start, start, straight, turns))

    for (start, before), (end, after) in pairwise(points):
        T, rise = end - start, after - before
        go_on(start, before, (0.0, rise / T**2, -0.5 * rise / T**3) if smooth else (rise / T / 2,))
    go_on(*points[-1])
    return [law for law, later in zip(laws, [*laws[1:], None], strict=True)
            if later is None or later.valid_from > law.valid_from]  # fmt: skip


def curve_laws(
    coordinate: str, breaks: Array, rows: Array, start: DriveLaw | None, straight: bool
) -> list[DriveLaw]:
    """The laws of a coordinate by polynomials in time: of itself, or of its rate.

    Before the first and after the last the rate stays.

    Parameters
    ----------
    breaks, rows : times (k + 1,) [s], and coefficients (k, n) of powers of the time from each
    start : None for polynomials of the coordinate; for those of the rate, its value at time zero
    """
    times = breaks.tolist()
    if start:
        rows = np.concatenate(
            [np.zeros((len(rows), 1)), rows / np.arange(1, rows.shape[1] + 1)], 1
        )
    laws: list[DriveLaw] = []
    for begin, row in zip(times[:-1], rows.tolist(), strict=True):
        if start and not laws:  # with the rate of the first break from time zero on
            laws.append(replace(start, coefficients=(start.coefficients[0], row[1])))
        elif not start and not laws:
            before = row[0] - row[1] * begin, row[1]
            laws.append(DriveLaw(coordinate, before, 0.0, 0.0, straight))
        turns = 0
        if start:
            turns, (row[0], *_) = laws[-1].about(Fraction(begin))
        laws.append(DriveLaw(coordinate, tuple(row), begin, begin, straight, turns))
    turns, (value, rate, *_) = laws[-1].about(Fraction(times[-1]))
    laws.append(DriveLaw(coordinate, (value, rate), times[-1], times[-1], straight, turns))
    return laws if laws[1].valid_from > 0.0 else laws[1:]


def largest_speed(laws: Sequence[Law]) -> float:
    """Largest speed at the ends of consecutive laws [rad/s]; 0 where torques rule."""
    speeds = [0.0]
    for law, later in zip(laws, [*laws[1:], None], strict=True):
        if isinstance(law, DriveLaw):
            ends = [law.valid_from] + ([later.valid_from] if later else [])
            rate = polynomial.polyder(law.coefficients)
            speeds += [float(polynomial.polyval(t - law.reference_time, rate)) for t in ends]
    return max(map(abs, speeds))


_PATIENCE = 100_000  # largest number of laws of an endless motion up to the next requested angle


def times_of_angles(laws: Iterable[Law], angles: Iterable[float]) -> Iterator[float]:
    """Times [s] at which a coordinate has rotated by rising angles [rad] under its laws.

    Forward or backward: a drive that swings turns on. They end where it never comes so far.
    """
    ways = _one_way(laws)
    way = next(ways, None)
    turned, seen = 0.0, 0
    for angle in angles:
        t = None
        while way and (t := _reached(*way, angle - turned)) is None:
            law, begin, end = way
            if end == math.inf:
                return
            ends = [begin - law.reference_time, end - law.reference_time]
            turning = 0.0, *law.coefficients[1:]  # without its start, which may be far
            before, after = (float(polynomial.polyval(x, turning)) for x in ends)
            turned += abs(after - before)
            seen += 1
            way = next(ways, None) if seen < _PATIENCE else None
        if t is None:
            return
        yield t
        seen = 0


def _one_way(laws: Iterable[Law]) -> Iterator[tuple[DriveLaw, float, float]]:
    """Laws in their order, with the intervals [s] in which each rotates in one direction."""
    known = (law for law in laws if isinstance(law, DriveLaw))
    for law, later in pairwise(chain(known, [None])):
        assert law is not None  # noqa: S101 - only the last is none
        begin, end = law.valid_from, later.valid_from if later else math.inf
        rate = polynomial.polyder(law.coefficients)
        cuts: list[float] = []
        far = max(abs(begin - law.reference_time), abs(end - law.reference_time))
        most = sum(abs(c) * far**k for k, c in enumerate(rate) if k and c)
        if most >= abs(rate[0]) > 0.0 or (most and not rate[0]):
            roots = np.asarray(Polynomial(rate).trim().roots())
            real = np.sort(roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real)
            cuts = [t for t in (law.reference_time + real).tolist() if begin < t < end]
        for a, b in pairwise([begin, *cuts, end]):
            yield law, a, b


def _reached(law: DriveLaw, begin: float, end: float, angle: float) -> float | None:
    """Time at which a law has rotated by `angle` [rad] since `begin` [s], if before `end`."""
    if law.degree == 1 and law.valid_from == law.reference_time:
        speed = abs(law.coefficients[1])
        t = begin + angle / speed if speed else math.inf
        return t if t <= end and t < math.inf else None
    began = begin - law.reference_time
    turning = 0.0, *law.coefficients[1:]
    start = polynomial.polyval(began, turning)
    hits = []
    for sign in (1.0, -1.0):
        shifted = Polynomial(np.array(turning)) - (start + sign * angle)
        roots = np.asarray(shifted.trim().roots())
        real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
        hits += [float(x) for x in real[real > began]]
    times = [law.reference_time + root for root in hits]
    return min((t for t in times if t <= end), default=None)


class LawSource(Protocol):
    """Continues the laws of a coordinate; what follows a law depends on nothing but that law."""

    @property
    def degree(self) -> int:
        """Highest degree of its laws."""

    @property
    def period(self) -> float | None:
        """Period of the coordinate's rate [s]; None if it is unknown."""

    def after(self, law: DriveLaw) -> DriveLaw | None:
        """The law that takes over from one of this source; None if that holds for ever."""


def unrolled(laws: Sequence[Law], source: LawSource | None) -> Iterator[Law]:
    """Laws in the order in which they take over, those of a source behind them."""
    yield from laws
    law: Law | None = laws[-1]
    while source and isinstance(law, DriveLaw) and (law := source.after(law)):
        yield law


@dataclass(frozen=True)
class FormulaLaws:
    """A coordinate, or its rate, by a formula of the time."""

    coordinate: str
    series: TimeSeries
    straight: bool
    rate: bool  #: True if the formula gives the rate

    @property
    def degree(self) -> int:
        """Degree of the series, integrated if it is a rate."""
        return max(len(self.series.piece(0.0).exact), len(self.series.piece(0.0).series)) - (
            not self.rate
        )

    @property
    def period(self) -> float | None:
        """See `LawSource`."""
        return self.series.period

    def first(self, angle: float = 0.0, turns: int = 0) -> DriveLaw:
        """The law at the start; there a coordinate given by its rate is at `angle` [rad, m]."""
        return self._law(0.0, turns, angle)

    def after(self, law: DriveLaw) -> DriveLaw | None:
        """See `LawSource`."""
        end = self.series.piece(law.valid_from).end
        if end == math.inf:
            return None
        turns, (angle, *_) = law.about(Fraction(end))
        return self._law(end, turns, angle)

    def _law(self, start: float, turns: int, angle: float) -> DriveLaw:
        piece = self.series.piece(start)
        n = max(len(piece.exact), len(piece.series))
        powers = [
            sum(map(Fraction, (*piece.exact[k : k + 1], *piece.series[k : k + 1].tolist())))
            for k in range(n)
        ]
        if self.rate:
            since = Fraction(start) - Fraction(piece.middle)
            integrated = [Fraction(x) / (k + 1) for k, x in enumerate(powers)]
            powers = [Fraction(0), *integrated]
            gone = Fraction(0)
            for x in reversed(powers):
                gone = gone * since + x
            powers[0] = Fraction(angle) - gone
        else:
            turns = 0
        if not self.straight:
            whole = math.floor(powers[0] / TWO_PI)
            turns, powers[0] = turns + whole, powers[0] - whole * TWO_PI
        return DriveLaw(
            self.coordinate, tuple(map(float, powers)), piece.middle, start, self.straight, turns
        )


class RepeatedLaws:
    """Laws of one period again and again, each time in exact arithmetic from the first.

    Parameters
    ----------
    laws : laws of one period, the first valid from its beginning
    period : [s]
    way : [rad or m] displacement in a period, exact
    """

    def __init__(self, laws: Sequence[DriveLaw], period: Fraction, way: Fraction) -> None:
        self._laws, self._period, self._way = tuple(laws), period, way
        self._starts = [Fraction(law.valid_from) for law in laws]
        self._ends = [*self._starts[1:], self._starts[0] + period]
        self.degree = max(law.degree for law in laws)

    @property
    def period(self) -> float:
        """See `LawSource`."""
        return float(self._period)

    def first(self) -> DriveLaw:
        """The law that holds at the start of a run."""
        cycle, number = self._place(Fraction(0))
        return replace(self._law(cycle, number, Fraction(0)), valid_from=0.0)

    def after(self, law: DriveLaw) -> DriveLaw:
        """See `LawSource`."""
        cycle, number = self._place(Fraction(law.valid_from))
        number += 1
        if number == len(self._laws):
            cycle, number = cycle + 1, 0
        return self._law(cycle, number, self._starts[number] + cycle * self._period)

    def _place(self, time: Fraction) -> tuple[int, int]:
        """Numbers of the period and of its law that hold from a time [s] on, within rounding."""
        cycle = (time - self._starts[0]) // self._period
        since = time - cycle * self._period
        number = bisect_right(self._starts, since) - 1
        # a time that was rounded may lie just before the law that takes over then
        slack = Fraction(math.ulp(float(time)))
        if self._ends[number] - since <= slack:
            number += 1
        return cycle + number // len(self._laws), number % len(self._laws)

    def _law(self, cycle: int, number: int, begin: Fraction) -> DriveLaw:
        law, start = self._laws[number], float(begin)
        turns, (place, *rates) = law.about(Fraction(start) - cycle * self._period)
        gone, whole = Fraction(place) + cycle * self._way, 0
        if not law.straight:
            whole, gone = divmod(gone, TWO_PI)
        return replace(
            law,
            coefficients=(float(gone), *rates),
            reference_time=start,
            valid_from=start,
            turns=turns + whole,
        )


def ends(laws: Sequence[Law], duration: float) -> Iterator[tuple[DriveLaw, float, float]]:
    """Prescribed laws, each with the times [s] between which it holds in so long a run."""
    for law, later in zip(laws, [*laws[1:], None], strict=True):
        end = min(duration, later.valid_from if later else math.inf)
        if isinstance(law, DriveLaw) and law.valid_from <= end:
            yield law, law.valid_from, end
