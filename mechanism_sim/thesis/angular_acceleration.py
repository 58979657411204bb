"""The angular acceleration of a link as the input of an instrument."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.numerics.rational import Modes, Rational
from mechanism_sim.planar.mechanism import Mechanism

_ROUNDING = 1e-13
"""Of a speed: steps of it that are smaller are none."""


class TurningLink:
    """A source as `mechanism_sim.sensing.channel.Channel` takes it: exact, impacts included.

    Parameters
    ----------
    mechanism : the machine
    link : one of its links that turns

    Raises
    ------
    ValueError
        If no coordinate is the angle of that link.
    """

    inputs = 1

    def __init__(self, mechanism: Mechanism, link: str) -> None:
        self._index = mechanism.coordinates.index(link)
        self._before: float | None = None

    def through(self, chain: Rational) -> Modes:
        """The system from the angular acceleration to what comes out of a chain."""
        return chain.modes()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Angular acceleration (1, N) [rad/s^2], as ``motion.curve.at(segments, dt, 2)``."""
        return np.asarray(motion.curve.local(segments, dt, 2).T[self._index][None])

    def impulses(self, motion: Motion) -> Array:
        """Steps of the angular velocity (m, 1) [rad/s] at the start of the m pieces that follow.

        Pieces must come in the order of time; what is a step at the first depends on the last of
        the call before.
        """
        curve = motion.curve
        every = np.arange(len(curve))
        after, ends = (
            curve.local(every, dt, 1)[:, self._index]
            for dt in (np.zeros(len(curve)), curve.duration)
        )
        first = after[0] if self._before is None else self._before
        before = np.append(first, ends[:-1])
        self._before = float(ends[-1])
        step = after - before
        step[np.abs(step) <= _ROUNDING * (np.abs(after) + np.abs(before))] = 0.0
        return np.asarray(step[:, None])
