"""Laws of motion without end: each piece follows from the one before, as runs come to it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Protocol

from mechanism_sim.numerics.time_series import TimeSeries
from mechanism_sim.planar.drive import TWO_PI, DriveLaw, Law


class LawSource(Protocol):
    """Continues the laws of a coordinate; what follows a law depends on nothing but that law."""

    @property
    def degree(self) -> int:
        """Highest degree of its laws."""

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
    """A coordinate, or its rate, by a formula of the time.

    Attributes
    ----------
    rate : whether the formula is that of the rate
    """

    coordinate: str
    series: TimeSeries
    straight: bool
    rate: bool

    @property
    def degree(self) -> int:
        """Of what the series has, integrated if it is a rate."""
        return max(len(self.series.piece(0.0).exact), len(self.series.piece(0.0).series)) - (
            not self.rate
        )

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
    laws : of one period, whose first takes over where it begins
    period : [s]
    turns : whole turns made in a period
    """

    def __init__(self, laws: Sequence[DriveLaw], period: Fraction, turns: int = 0) -> None:
        self._laws, self._period, self._turns = tuple(laws), period, turns
        self._starts = [Fraction(law.valid_from) for law in laws]
        self._ends = [*self._starts[1:], self._starts[0] + period]
        self.degree = max(law.degree for law in laws)

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
        """Number of the period and of the law in it that hold from a time [s] on, but rounding."""
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
        turns, local = law.about(Fraction(start) - cycle * self._period)
        return replace(
            law,
            coefficients=local,
            reference_time=start,
            valid_from=start,
            turns=turns + cycle * self._turns,
        )


def ends(laws: Sequence[Law], duration: float) -> Iterator[tuple[DriveLaw, float, float]]:
    """Prescribed laws, each with the times [s] between which it holds in so long a run."""
    for law, later in zip(laws, [*laws[1:], None], strict=True):
        end = min(duration, later.valid_from if later else math.inf)
        if isinstance(law, DriveLaw) and law.valid_from <= end:
            yield law, law.valid_from, end
