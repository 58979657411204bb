"""Normalised curves of a rise: from (0, 0) to (1, 1), over the share of the rise's angle.

A return runs a curve backwards ([V] 4.17). Peaks in the table are of the first, second and third
derivative; what jumps within the rise or at its ends stands last.

===================  =========  =========  =========  ==============================
curve                velocity   acceler.   jerk       jumps
===================  =========  =========  =========  ==============================
CYCLOIDAL            2          2 pi       4 pi^2     jerk at the ends
HARMONIC             pi/2       pi^2/2     pi^3/2     acceleration at the ends
HALF_HARMONIC        pi/2       pi^2/4     pi^3/8     velocity at the upper end
FOUR_SPLINE          3          12         24         acceleration in the middle
CONSTANT_ACCEL.      2          4          0          acceleration at the ends, in the middle
MODIFIED_TRAPEZOID   2          4.888      61.43      jerk at the ends
MODIFIED_SINE        1.760      5.528      69.47      jerk at the ends
POLYNOMIAL_345       1.875      5.774      60         jerk at the ends
POLYNOMIAL_4567      2.1875     7.513      52.5       none of these
===================  =========  =========  =========  ==============================
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import scipy
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.laws import LawPiece, Piecewise, from_spline

#: the ends of a spline: 'natural', 'clamped', 'not-a-knot', or (order, value) for either end
Ends = str | tuple[tuple[int, float], tuple[int, float]]


def _from_acceleration(parts: Sequence[tuple[float, float, float, float]]) -> Piecewise:
    """The rise whose acceleration has this shape: (length, constant, frequency, phase) of parts.

    In each part the acceleration is proportional to ``constant*cos(frequency*s + phase)``; the
    curve is its second integral from rest, divided by the height reached.
    """
    pieces: list[LawPiece] = []
    place = speed = 0.0
    for length, constant, frequency, phase in parts:
        if frequency == 0.0:
            piece = LawPiece(length, Polynomial([place, speed, 0.5 * constant]))
        else:
            wave = -constant / frequency**2
            turning = LawPiece(length, Polynomial([0.0]), wave, frequency, phase)
            line = [place - turning.derivative(0.0, 0), speed - turning.derivative(0.0, 1)]
            piece = LawPiece(length, Polynomial(line), wave, frequency, phase)
        place, speed = piece.derivative(length, 0), piece.derivative(length, 1)
        pieces.append(piece)
    return Piecewise(0.0, [p.scaled(1.0, 1.0 / place) for p in pieces])


#: [V] 4.14
CYCLOIDAL = Piecewise(
    0.0, [LawPiece(1.0, Polynomial([0, 1]), 0.5 / math.pi, 2 * math.pi, math.pi / 2)]
)
#: [V] 4.33
HARMONIC = Piecewise(0.0, [LawPiece(1.0, Polynomial([0.5]), -0.5, math.pi)])
#: [V] A.5 In[1]: a quarter of a cosine
HALF_HARMONIC = Piecewise(0.0, [LawPiece(1.0, Polynomial([1]), -1.0, math.pi / 2)])
#: [V] 4.45 and 4.48: two cubic splines for a rise, two for a return
FOUR_SPLINE = Piecewise(
    0.0,
    [
        LawPiece(0.5, Polynomial([0, 0, 0, 4])),
        LawPiece(0.5, Polynomial([0.5, 3, -6, 4])),
    ],
)
#: two parabolas, the least peak of acceleration there is
CONSTANT_ACCELERATION = Piecewise(
    0.0,
    [
        LawPiece(0.5, Polynomial([0, 0, 2])),
        LawPiece(0.5, Polynomial([0.5, 2, -2])),
    ],
)
#: constant accelerations, joined by quarters and a half of a sine
MODIFIED_TRAPEZOID = _from_acceleration(
    [
        (0.125, 1.0, 4 * math.pi, -math.pi / 2),
        (0.25, 1.0, 0.0, 0.0),
        (0.25, 1.0, 4 * math.pi, 0.0),
        (0.25, -1.0, 0.0, 0.0),
        (0.125, -1.0, 4 * math.pi, 0.0),
    ]
)
#: a slow half of a cosine between quick quarters
MODIFIED_SINE = _from_acceleration(
    [
        (0.125, 1.0, 4 * math.pi, -math.pi / 2),
        (0.75, 1.0, 4 * math.pi / 3, 0.0),
        (0.125, -1.0, 4 * math.pi, 0.0),
    ]
)
#: no velocity nor acceleration at the ends
POLYNOMIAL_345 = Piecewise(0.0, [LawPiece(1.0, Polynomial([0, 0, 0, 10, -15, 6]))])
#: no velocity, acceleration nor jerk at the ends
POLYNOMIAL_4567 = Piecewise(0.0, [LawPiece(1.0, Polynomial([0, 0, 0, 0, 35, -84, 70, -20]))])


def spline_curve(x: ArrayLike, y: ArrayLike, ends: Ends = 'clamped') -> Piecewise:
    """The cubic spline through points of a normalised rise ([V] 4.4.4, general form).

    Parameters
    ----------
    x, y : shape (n,), n >= 2; from (0, 0) to (1, 1), x increasing
    ends : 'clamped' (no velocity), 'natural' (no acceleration), 'not-a-knot', or the order and
        the value of a derivative for either end
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if x.ndim != 1 or x.shape != y.shape or len(x) < 2:
        raise InputError('a spline needs as many places as heights, two at least')
    if (x[0], y[0], x[-1], y[-1]) != (0.0, 0.0, 1.0, 1.0):
        raise InputError('the points of a normalised rise go from (0, 0) to (1, 1)')
    if not (np.diff(x) > 0.0).all():
        raise InputError('the places of a spline increase')
    try:
        return from_spline(scipy.interpolate.CubicSpline(x, y, bc_type=ends))
    except ValueError as error:
        raise InputError(f'no spline passes through these points: {error}') from error


class BoundaryCondition(NamedTuple):
    """A value that a derivative of a curve has at a place."""

    at: float  #: position from the beginning of the curve
    order: int  #: order of the derivative, 0 for the displacement
    value: float


MOST_CONDITIONS = 40
_PER_PIECE = 8  # conditions: powers of a shorter part round less than those of a longer one


def polynomial_curve(length: float, conditions: Sequence[BoundaryCondition]) -> Piecewise:
    """The polynomial of least degree that meets conditions, no normalised rise: over `length`.

    As many conditions as coefficients, in exact arithmetic, for powers of high degree are nearly
    dependent; one of many conditions stands as several pieces, of the same polynomial.
    """
    n = len(conditions)
    rows: list[list[Fraction]] = []
    for at, order, value in conditions:
        x = Fraction(at) / Fraction(length)
        powers = [
            math.perm(k, order) * Fraction(x ** (k - order)) if k >= order else Fraction(0)
            for k in range(n)
        ]
        rows.append([*powers, Fraction(value) * Fraction(length) ** order])
    for k in range(n):  # elimination
        pivot = next((i for i in range(k, n) if rows[i][k]), None)
        if pivot is None:
            raise InputError(
                'its conditions do not determine a polynomial: one follows from the others, or '
                'contradicts them'
            )
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(n):
            if i != k and rows[i][k]:
                share = rows[i][k] / rows[k][k]
                rows[i] = [a - share * b for a, b in zip(rows[i], rows[k], strict=True)]
    exact = [rows[k][n] / rows[k][k] for k in range(n)]
    count, pieces = -(-n // _PER_PIECE), []
    for i in range(count):
        x = Fraction(i, count)  # powers of what goes on from there
        shifted = [
            sum(math.comb(j, k) * exact[j] * x ** (j - k) for j in range(k, n)) for k in range(n)
        ]
        scaled = [float(c / Fraction(length) ** k) for k, c in enumerate(shifted)]
        pieces.append(LawPiece(length / count, Polynomial(scaled)))
    return Piecewise(0.0, pieces)
