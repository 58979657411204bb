"""Where the integrator's steps are kept until they are handed on as motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.hybrid.clock import Base
from mechanism_sim.hybrid.system import Array, System
from mechanism_sim.numerics.polynomials import Nodes, PiecewisePolynomial, exact_sum, shift_powers


@dataclass(frozen=True)
class Motion:
    """Motion of all coordinates, and which gaps are closed, on m segments."""

    curve: PiecewisePolynomial  #: of the n coordinates, in the order of the mechanism
    closed: NDArray[np.bool_]  #: (m, gaps)

    def __len__(self) -> int:
        return len(self.curve)

    def closed_at(self, segments: NDArray[np.intp], dt: Array | Nodes) -> NDArray[np.bool_]:
        """Flags (gaps, N) at times `dt`, in the order of ``curve.at(segments, dt)``."""
        each = len(dt.fractions) if isinstance(dt, Nodes) else math.prod(dt.shape[1:])
        return np.repeat(self.closed[segments], each, axis=0).T

    @classmethod
    def joined(cls, parts: list[Motion]) -> Motion:
        """One motion from consecutive parts."""
        curves = [part.curve for part in parts]
        return cls(
            PiecewisePolynomial(
                np.concatenate([c.start for c in curves]),
                np.concatenate([c.start_low for c in curves]),
                np.concatenate([c.duration for c in curves]),
                np.concatenate([c.turns for c in curves]),
                np.concatenate([c.coefficients for c in curves]),
            ),
            np.concatenate([part.closed for part in parts]),
        )


class Tape:
    """Taylor coefficients of the steps since the last `drain`.

    A step is first written to its slot ``buffer[len(entries)]``, then appended to `entries`; the
    event loop does so itself, being the innermost of all loops.

    Attributes
    ----------
    buffer : (capacity, 2 f, order + 1), always with room for one more step
    entries : of every step its start since the base, its length [s], its gaps, its base
    base : index of the present base
    """

    def __init__(self, system: System, coefficients: Array) -> None:
        self.buffer = np.empty((256, *coefficients.shape))
        self.entries: list[tuple[float, float, tuple[bool, ...], int]] = []
        self.base = -1
        self._system = system
        self._bases: list[Base] = []
        self._drained = 0

    @property
    def count(self) -> int:
        """Number of steps since the start."""
        return self._drained + len(self.entries)

    def grow(self) -> None:
        """Make room: the buffer is full."""
        self.buffer = np.concatenate([self.buffer, np.empty_like(self.buffer)])

    def rebase(self, base: Base) -> None:
        """Steps entered from now on count from `base`."""
        self._bases.append(base)
        self.base = len(self._bases) - 1

    def drain(self) -> Motion:
        """The steps since the last call as motion.

        A rate's Taylor polynomial, integrated, gives its angle one order higher than the
        integrator's own.
        """
        system, count = self._system, len(self.entries)
        taus, hs, closed, bases = zip(*self.entries, strict=True) if count else ((),) * 4
        f, order = len(system.free), self.buffer.shape[2]
        coefficients = np.zeros((count, len(system.coordinates), order + 1))
        free = [system.coordinates.index(c) for c in system.free]
        raw = self.buffer[:count]
        coefficients[:, free, 0] = raw[:, :f, 0]
        coefficients[:, free, 1:] = raw[:, f:, :] / np.arange(1.0, order + 1.0)
        tau, of = np.array(taus), np.array(bases, dtype=np.intp)
        for p, name in enumerate(system.prescribed):
            law = np.zeros((len(self._bases), system.degree + 1))
            for row, base in zip(law, self._bases, strict=True):
                row[: len(base.laws[p])] = base.laws[p]
            law = law[of]
            coefficients[:, system.coordinates.index(name), : law.shape[1]] = shift_powers(
                law, tau
            )
        high = np.array([base.high for base in self._bases])[of]
        low = np.array([base.low for base in self._bases])[of]
        turns = [[base.turns[c] for c in system.coordinates] for base in self._bases]
        start, start_low = exact_sum(high, low, tau)
        motion = Motion(
            PiecewisePolynomial(
                start,
                start_low,
                np.array(hs),
                np.array(turns, dtype=np.int64)[of],
                coefficients,
            ),
            np.array(closed, dtype=bool).reshape(count, len(system.gaps)),
        )
        # The next step may be in its slot already: it becomes the first.
        self.buffer[0] = self.buffer[count]
        self._drained += count
        self.entries.clear()
        self._bases = self._bases[-1:]
        self.base = 0
        return motion
