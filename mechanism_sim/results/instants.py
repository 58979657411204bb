"""Instants at which a motion is drawn: close where it is fast, and on both sides of its events."""

from __future__ import annotations

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.results.run import Piece


def instants(
    piece: Piece, start: float, end: float, density: Array | float, fewest: int, most: int,
    events: int | None = None, steps: bool = False,
) -> Array:  # fmt: skip
    """Times (N,) [s] from `start` to `end`, both included; none twice.

    Parameters
    ----------
    density : of instants [1/s], everywhere or (S + 1,) where steps of the motion meet
    fewest, most : instants beside those at events
    events : of these at most so many, the hardest impacts first, and then changes of mode
    steps : whether the instants are among them where steps of the motion meet
    """
    curve = piece.motion.curve
    if isinstance(density, float):
        marks, dense = np.array([start, end]), np.full(2, density or 1.0)
    else:
        marks, dense = np.append(curve.start, curve.end), density
    passed = np.append(0.0, np.cumsum(0.5 * (dense[1:] + dense[:-1]) * np.diff(marks)))
    count = int(np.clip(int(passed[-1]) + 1, fewest, most))
    even = np.interp(np.linspace(0.0, passed[-1], count), passed, marks)
    hardest = sorted(piece.impacts, key=lambda i: -i.normal_impulse)
    at = np.array([*(i.t for i in hardest), *(c.t for c in piece.modes)][:events], np.float64)
    marked = np.concatenate([np.nextafter(at, -np.inf), at, *([curve.start] if steps else [])])
    t = np.union1d(even, marked[(marked > start) & (marked <= end)])
    return np.unique(np.clip(t, curve.start[0], curve.end))
