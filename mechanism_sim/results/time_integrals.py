"""Integrals over time of functions of a motion that comes in pieces, and what they may be off."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mechanism_sim.hybrid.audit import recovers
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.quadrature import Assumptions, Parts, Values, integrate
from mechanism_sim.tolerances import TOLERANCES

_AUDIT = TOLERANCES.audit

EXACT = 'of the motion'


class Estimate(NamedTuple):
    """A figure, and what it may be off."""

    value: float
    error: float
    size: float  #: by which the error is to be measured

    def note(self, unit: str) -> str:
        """`EXACT`, or what is to be said of the figure."""
        if not math.isfinite(self.value):
            return 'it is not finite for a part of the time'
        if self.error <= _AUDIT.promised * self.size:
            return EXACT
        return f'its error may be {self.error:.1g} {unit}'.rstrip()


class TimeIntegrals:
    """Integrals of C functions over time, entered piece by piece.

    Every mean, root mean square, integral and work that is told of a motion is taken here, so that
    the same figure is the same number wherever it is asked for.
    """

    def __init__(self, count: int, corners: bool = False) -> None:
        self.time, self._corners = 0.0, corners
        self._sums = np.zeros((3, count))  # value, error, size
        self._largest = np.zeros(count)

    def add(self, values: Values, motion: Motion, parts: Parts) -> None:
        """Enter parts of a motion, in the order of time.

        Parameters
        ----------
        values : (C, K n) as for `mechanism_sim.numerics.quadrature.integrate`
        """
        if not len(parts.segment) or not len(self._largest):
            return
        flags, kind = recovers(motion, parts.segment), Assumptions(corners=self._corners)
        found = integrate(values, parts, flags, self._largest, assumed=kind)
        self._largest = found.largest
        self._sums += [x.sum(axis=1) for x in (found.value, found.error, found.size)]
        self.time += float((parts.end - parts.begin).sum())

    def integral(self, i: int) -> Estimate:
        """Of function i."""
        return Estimate(*self._sums[:, i].tolist())

    def mean(self, i: int) -> Estimate:
        """Of function i; not a number without any time."""
        return Estimate(*(self._sums[:, i] / (self.time or math.nan)).tolist())

    def root(self, i: int) -> Estimate:
        """The root of the mean of function i, which is a square."""
        square = self.mean(i)
        if not math.isfinite(square.value):
            return square
        value = math.sqrt(max(square.value, 0.0))
        # the root of a square that is nothing but error is off by the root of that error
        least = math.sqrt(square.error)
        return Estimate(value, square.error / max(value, least) if least else 0.0, value)
