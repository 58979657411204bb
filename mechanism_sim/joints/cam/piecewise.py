"""Functions made of pieces, each a polynomial plus a cosine, and their exact derivatives.

The classical curves of cams are of this kind, and so are splines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array


@dataclass(frozen=True)
class LawPiece:
    """``polynomial(s) + amplitude*cos(frequency*s + phase)`` for s from 0 to `length`."""

    length: float
    polynomial: Polynomial
    amplitude: float = 0.0
    frequency: float = 1.0
    phase: float = 0.0

    def derivative(self, s: float, order: int) -> float:
        """The derivative of an order from 0 up, at s from the beginning of the piece."""
        p = self.polynomial.deriv(order) if order else self.polynomial
        turned = self.frequency * s + self.phase + order * np.pi / 2
        return float(p(s) + self.amplitude * self.frequency**order * np.cos(turned))

    def scaled(self, span: float, height: float) -> LawPiece:
        """The piece drawn `span` times as long and `height` times as high."""
        rows = enumerate(self.polynomial.coef)
        return LawPiece(
            self.length * span,
            Polynomial([height * float(c) / span**k for k, c in rows]),
            self.amplitude * height,
            self.frequency / span,
            self.phase,
        )

    def mirrored(self) -> LawPiece:
        """The piece run backwards."""
        return LawPiece(
            self.length,
            self.polynomial(Polynomial([self.length, -1.0])),
            self.amplitude,
            self.frequency,
            -self.frequency * self.length - self.phase,
        )


class Piecewise:
    """A function of pieces laid end to end.

    Parameters
    ----------
    start : where the first piece begins
    pieces : each of positive length
    """

    def __init__(self, start: float, pieces: Sequence[LawPiece]) -> None:
        self.pieces = tuple(pieces)
        self.breaks: Array = start + np.cumsum([0.0, *(p.length for p in pieces)])
        self._waves: Array = np.array([(p.amplitude, p.frequency, p.phase) for p in pieces]).T

    @cached_property
    def _polynomials(self) -> scipy.interpolate.PPoly:
        size = max(len(p.polynomial) for p in self.pieces)
        rows = [np.pad(p.polynomial.coef, (0, size - len(p.polynomial))) for p in self.pieces]
        return scipy.interpolate.PPoly(np.array(rows).T[::-1], self.breaks)

    def __call__(self, x: ArrayLike, order: int = 0, left: bool = False) -> Array:
        """The derivative of an order from 0 up at x, in the shape of x.

        At a break it is the limit from the right, or from the left if `left`. Beyond the ends
        the outermost pieces go on.
        """
        x = np.asarray(x, dtype=float)
        last = len(self.pieces) - 1
        i = np.clip(np.searchsorted(self.breaks, x, 'left' if left else 'right') - 1, 0, last)
        s = x - self.breaks[i]
        value = np.zeros_like(s)
        for row in self._polynomials.derivative(order).c:
            value = value * s + row[i]
        amplitude, frequency, phase = self._waves[:, i]
        wave = amplitude * frequency**order * np.cos(frequency * s + phase + order * np.pi / 2)
        return np.asarray(value + wave)

    def mirrored(self) -> Piecewise:
        """The function run backwards over the same interval."""
        return Piecewise(float(self.breaks[0]), [p.mirrored() for p in reversed(self.pieces)])


def from_spline(spline: scipy.interpolate.PPoly) -> Piecewise:
    """The pieces of a polynomial spline."""
    parts = zip(np.diff(spline.x), spline.c[::-1].T, strict=True)
    return Piecewise(float(spline.x[0]), [LawPiece(float(h), Polynomial(c)) for h, c in parts])
