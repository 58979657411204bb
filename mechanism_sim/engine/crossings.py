"""Forces near the singular positions that a motion by equations of motion goes through.

A step across such a position is a polynomial without its highest powers (`engine.singular`). At
the position the closures determine no forces, and a little beside rounding spoils them; they are
read from the polynomials through those farther away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.polynomial import chebyshev

from mechanism_sim.arrays import Array, IndexArray, Mask
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.planar.branch import SAMPLES, limits
from mechanism_sim.tolerances import TOLERANCES

_SINGULAR = TOLERANCES.singular

Segments = IndexArray
Distance = Callable[[Segments, Array], Array]
"""Measure of the closures' independence (K S,) at times (K, S) [s] in segments (K,)."""

_NODES = 33
_DEGREE = 9


class Crossings:
    """Segments that cross a singular position, and the times of the crossings.

    Parameters
    ----------
    motion : motion of all coordinates
    segments : (N,) segments to be searched
    free : indices of the integrated coordinates
    distance : distance from singular positions, see `Distance`

    Attributes
    ----------
    segments : (K,) segments with a crossing
    touch : (K,) times of the crossings since the start of their segments [s]
    """

    def __init__(
        self, motion: Motion, segments: Segments, free: Sequence[int], distance: Distance
    ) -> None:
        curve = motion.curve
        top = curve.coefficients[segments][:, free, -1]
        found = np.unique(segments[(top == 0.0).all(axis=1)])
        places = 0.5 - 0.5 * np.cos(np.pi * np.arange(_NODES) / (_NODES - 1))
        times = curve.duration[found, None] * places
        root = np.sqrt(distance(found, times).reshape(times.shape)) if found.size else times
        kept, touch = [], []
        for k, row in enumerate(root):
            lowest = int(row.argmin())
            if not row[lowest] < _SINGULAR.away * row.max():
                continue
            signed = np.where(np.arange(_NODES) < lowest, -row, row)
            known = row > 0.5 * _SINGULAR.away * row.max()
            fit = chebyshev.chebfit(2.0 * places[known] - 1.0, signed[known], _DEGREE)
            roots = chebyshev.chebroots(fit)
            at = roots.real[np.abs(roots.imag) < _SINGULAR.real_root]
            at = 0.5 + 0.5 * at[np.argsort(np.abs(0.5 + 0.5 * at - places[lowest]))[:1]]
            if at.size:
                kept.append(int(found[k]))
                touch.append(float(at[0] * curve.duration[found[k]]))
        self.segments, self.touch = np.array(kept, dtype=np.intp), np.array(touch)
        self._duration = curve.duration

    def near(self, segments: Segments, dt: Array) -> Mask:
        """Mask of the instants `dt` (N,) [s] so near a crossing that forces are inaccurate."""
        close = np.zeros(len(dt), dtype=bool)
        for segment, touch in zip(self.segments, self.touch, strict=True):
            width = _SINGULAR.away * 0.5 * self._duration[segment]
            close |= (segments == segment) & (np.abs(dt - touch) < width)
        return close

    def limits(
        self, segments: Segments, dt: Array, values: Callable[[Segments, Array], Array]
    ) -> Array:
        """Limits of M functions at instants (N,) near a singular position: (M, N).

        Parameters
        ----------
        segments, dt : (N,) instants
        values : the functions (M, N S) at times (N, S) in segments (N,)

        Returns
        -------
        NaN where a function grows beyond all bounds at the very instant.
        """
        times = dt[:, None] + _SINGULAR.width * self._duration[segments][:, None] * SAMPLES
        touch = dict(zip(self.segments.tolist(), self.touch.tolist(), strict=True))
        away = times - np.array([touch[k] for k in segments.tolist()])[:, None]
        seen = values(segments, times).reshape(-1, *times.shape)
        found = limits(seen, away, np.abs(away))
        return np.where(np.isinf(found), np.nan, found)
