"""A block on a straight guide that moves as a test wants: motion to feed a channel with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import Chebyshev

from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
from mechanism_sim.sensing.chain import Instrument
from mechanism_sim.sensing.channel import Channel
from mechanism_sim.sensing.point import PointOnLink

DEGREE = 15
BLOCK = Mechanism(
    (Body('block', 1.0, 1.0, (0.0, 0.0)),),
    (Prismatic('guide', 'ground', 'block', (0.0, 0.0), (0.0, 0.0)),),
    (),
)


def motion(
    acceleration: Callable[[np.ndarray], np.ndarray],
    ends: np.ndarray,
    jumps: dict[int, float] | None = None,
) -> Motion:
    """The block under an acceleration [m/s^2], from rest, in pieces that end at `ends` [s].

    `jumps` [m/s] of the velocity at the start of pieces.
    """
    starts = np.concatenate([[0.0], ends[:-1]])
    coefficients = np.zeros((len(ends), 1, DEGREE + 3))
    x = v = 0.0
    for k, (start, end) in enumerate(zip(starts, ends, strict=True)):
        h = end - start
        v += (jumps or {}).get(k, 0.0)
        fitted = Chebyshev.interpolate(
            lambda t, start=start: acceleration(start + t), DEGREE, [0.0, h]
        )
        rate = fitted.integ(1, lbnd=0.0)
        place = rate.integ(1, lbnd=0.0)
        powers = place.convert(kind=np.polynomial.Polynomial).coef
        coefficients[k, 0, : len(powers)] = powers
        coefficients[k, 0, 0] += x
        coefficients[k, 0, 1] += v
        x, v = x + v * h + place(h), v + rate(h)
    m = len(ends)
    curve = PiecewisePolynomial(
        starts, np.zeros(m), ends - starts, np.zeros((m, 1), np.int64), coefficients
    )
    return Motion(curve, np.zeros((m, 0), np.uint8), np.zeros((m, 0)), np.zeros((m, 0, 3)))


def channel(instrument: Instrument, name: str = 'x') -> Channel:
    """An instrument on the block, along its way."""
    return Channel(PointOnLink(BLOCK, 'block', 0.0, 'along'), instrument, name)


def measure(instrument: Instrument, moved: Motion, name: str = 'x') -> np.ndarray:
    """All samples of a motion."""
    measuring = channel(instrument, name)
    measuring.take(moved)
    return np.concatenate([block.samples for block in measuring.blocks(final=True)])
