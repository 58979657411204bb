"""Time of a long run: exact bases, and small numbers counted from them.

Angles and times of a run of a million turns keep all their digits, because the integrator only
ever sees the time since the last base and angles without their whole turns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import fsum

from mechanism_sim.numerics.kernels import kernel
from mechanism_sim.planar.drive import TWO_PI, DriveLaw, Law, TorqueLaw


@dataclass(frozen=True)
class Base:
    """An instant from which the integrator counts time."""

    time: Fraction  #: [s], exact
    #: whole turns by coordinate, to be added to angles counted from this base
    turns: Mapping[str, int]
    #: coefficients of the prescribed coordinates, in powers of the time since the base
    laws: tuple[tuple[float, ...], ...]
    #: coefficients of the torque laws, for angles counted from here
    torques: tuple[tuple[float, ...], ...] = ()

    @cached_property
    def high(self) -> float:
        """The time rounded to a float [s]."""
        return float(self.time)

    @cached_property
    def low(self) -> float:
        """Remainder [s] that `high` rounds away."""
        return float(self.time - Fraction(self.high))

    def at(self, tau: float) -> float:
        """Time [s] at local time tau, correctly rounded: independent of the base."""
        return fsum((self.high, self.low, tau))

    def local(self, t: float) -> float:
        """Time since the base [s] of a time since the start of the run."""
        a, b = t.as_integer_ratio()
        n, d = self.time.as_integer_ratio()
        return (a * d - n * b) / (b * d)  # as fractions round it, but without reducing them


@kernel
def _two_sum(a: float, b: float) -> tuple[float, float]:
    """Sum, and what it rounds away (Knuth)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@kernel
def rounded_sum(high: float, low: float, tau: float) -> float:
    """Sum as of `Base.at`, or not a number where that lies between two floats but for its end.

    What the last addition rounds, and what was left out before, decide together only where the
    former is half a unit in the last place.
    """
    upper, left = _two_sum(low, tau)
    total, more = _two_sum(high, upper)
    rest, lost = _two_sum(more, left)
    rounded = total + rest
    twice = 2.0 * (rest - (rounded - total))
    if lost != 0.0 and twice != 0.0 and (rounded + twice) - rounded == twice:
        return math.nan
    return rounded


def base_at(time: Fraction, laws: Sequence[Law], turns: Mapping[str, int]) -> Base:
    """The base at `time`; `turns` are those of the coordinates that no law prescribes."""
    whole = dict(turns)
    local = []
    for law in laws:
        if isinstance(law, DriveLaw):
            whole[law.coordinate], coefficients = law.about(time)
            local.append(tuple(coefficients))
    torques = [law.after(whole[law.coordinate]) for law in laws if isinstance(law, TorqueLaw)]
    return Base(time, whole, tuple(local), tuple(torques))


def horner(coefficients: Sequence[float], x: float) -> float:
    """Value of a polynomial at one x, in plain floats: much faster than NumPy there."""
    value = 0.0
    for c in reversed(coefficients):
        value = value * x + c
    return value


def take_off_turns(angle: float) -> tuple[int, float]:
    """Whole turns in an angle [rad], and the remainder, smaller than a turn."""
    if abs(angle) < 6.0:  # less than a turn
        return 0, angle + 0.0
    whole = int(Fraction(angle) / TWO_PI)
    return whole, float(Fraction(angle) - whole * TWO_PI)
