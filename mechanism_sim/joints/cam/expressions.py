"""Laws of motion of cams as expressions of the cam angle, with their derivatives.

A law made of pieces becomes a table: one row for every piece, of its polynomial about the middle
of the piece and of its wave. The equations of motion know the row of the present piece only.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import heyoka as hy
import numpy as np
from numpy.polynomial import Polynomial

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.laws import Eccentric, Law, Piecewise, Raised
from mechanism_sim.numerics.symbolic import dense, polynomial
from mechanism_sim.planar.frames import Frames, Jet

_LONGEST = 0.5 * math.pi  # [rad] of a row: beyond, its own place would be ambiguous


class Rows(NamedTuple):
    """The pieces of a function as a table.

    Parameters
    ----------
    breaks : (k + 1,) [rad] or [m]
    values : (k, n) the coefficients of the polynomial about the middle of the row, in rising
        order; with waves anywhere also amplitude, frequency and phase there
    terms : how many of them are coefficients
    """

    breaks: Array
    values: Array
    terms: int


@lru_cache(maxsize=16)
def rows_of(function: Piecewise) -> Rows:
    """The rows of a function of pieces; pieces longer than a right angle make several."""
    terms = max(len(p.polynomial) for p in function.pieces)
    waves = any(p.amplitude for p in function.pieces)
    breaks, values = [float(function.breaks[0])], []
    for piece, start in zip(function.pieces, function.breaks.tolist(), strict=False):
        count = math.ceil(piece.length / _LONGEST - 1e-9)
        for i in range(count):
            breaks.append(start + (i + 1) / count * piece.length)
            # a piece as a function of the way from `middle`
            middle = (i + 0.5) / count * piece.length
            coefficients = piece.polynomial(Polynomial([middle, 1.0])).coef.tolist()
            phase = math.remainder(piece.frequency * middle + piece.phase, 2.0 * math.pi)
            padded = [*coefficients, *[0.0] * (terms - len(coefficients))]
            row = [*padded, piece.amplitude, piece.frequency, phase]
            values.append(row if waves else row[:terms])
    breaks[-1] = float(function.breaks[-1])
    return Rows(np.array(breaks), np.array(values), terms)


def displacement(law: Law, name: str, angle: Jet, frames: Frames, count: int = 2) -> list[Jet]:
    """The displacement of a law and its derivatives by the cam angle, `count` in all.

    Parameters
    ----------
    name : of the table in `frames`
    angle : of the cam [rad], of any number of turns; of a cam that slides its displacement [m]

    Raises
    ------
    TypeError
        If the law has no expression.
    """
    x = dense(angle.value)
    if isinstance(law, Eccentric):
        found = _eccentric(law, x)
    elif isinstance(law, Raised):
        found = [law.eccentricity * hy.sin(x + 0.5 * math.pi * k) for k in range(count + 2)]
        found[0] = found[0] + law.eccentricity
    elif isinstance(function := getattr(law, 'function', None), Piecewise):
        rows = rows_of(function)
        periodic = not law.reciprocating
        numbers, angle = frames.table(name, angle, rows.breaks, rows.values, periodic)
        found = _piece(numbers, rows.terms, dense(angle.value), count + 2)
    else:
        raise TypeError(f'no expression of {type(law).__name__}')
    return [angle.chain(*found[k : k + 3]) for k in range(count)]


def _piece(
    numbers: tuple[hy.expression, ...], terms: int, x: hy.expression, orders: int
) -> list[hy.expression]:
    """Polynomial and wave, and derivatives, by Horner."""
    found = polynomial(numbers[:terms], x, orders)
    if len(numbers) > terms:
        amplitude, frequency, phase = numbers[terms:]
        turned = frequency * x + phase
        wave = [amplitude * hy.cos(turned), -(amplitude * frequency * hy.sin(turned))]
        for k in range(2, orders):
            wave.append(-(frequency * frequency * wave[k - 2]))
        found = [p + w for p, w in zip(found, wave, strict=False)]
    return found


def _eccentric(law: Eccentric, angle: hy.expression) -> list[hy.expression]:
    """As `Eccentric`: ``q^2 = R^2 - d^2 cos^2`` differentiated again and again."""
    R, d = law.radius, law.eccentricity
    c, s = d * hy.cos(angle), d * hy.sin(angle)
    q = hy.sqrt(R * R - c * c)
    sine, cosine = 2.0 * c * s, c * c - s * s
    q1 = 0.5 * sine / q
    q2 = (cosine - q1 * q1) / q
    q3 = -(2.0 * sine + 3.0 * q1 * q2) / q
    q4 = -(4.0 * cosine + 4.0 * q1 * q3 + 3.0 * q2 * q2) / q
    return [s + q - (R - d), c + q1, q2 - s, q3 - c, q4 + s]
