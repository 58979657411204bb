"""The crank as the clock of a recorded run: how far it is, and how often it went round."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.analysis.pieces import RecordedPiece, gaps
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial
from mechanism_sim.results.turns import Place, beginning, turns_at


@dataclass(frozen=True)
class MotionSummary:
    """The recorded motion. `gaps` are spans [s] inside it that are missing."""

    coordinates: tuple[str, ...]
    segments: int
    start: float  #: [s]
    end: float  #: [s]
    crank: str  #: the coordinate whose revolutions are counted
    revolutions: float | None  #: of it, in the direction in which it ends up; None if it slides
    mean_speed: float  #: of it [rad/s or m/s], with its sign
    gaps: tuple[tuple[float, float], ...]


class Crank:
    """Where the crank is at given times, as far as its motion is recorded.

    Of all the motion only the crank's is kept: a long run has millions of segments.

    Parameters
    ----------
    driven : the coordinate that is driven, if that is known; else that of the name ``crank``, or
        the first
    displacements : coordinates that slide, which have neither angles nor revolutions
    """

    def __init__(self, driven: str | None, displacements: Collection[str]) -> None:
        self._preferred, self._displacements = (driven, 'crank'), displacements
        self._names: tuple[tuple[str, ...], tuple[str, ...]] | None = None
        self._index = 0
        self._parts: list[PiecewisePolynomial] = []

    def add(self, piece: RecordedPiece) -> None:
        """Enter the piece that follows."""
        if not len(piece.motion):
            return
        names = piece.coordinates, piece.joints
        if self._names is None:
            self._names = names
            known = [n for n in (*self._preferred, *names[0]) if n in names[0]]
            self._index = names[0].index(known[0])
        if names != self._names:
            raise InputError(
                'coordinates or joints of the recorded motion change during the recording.'
            )
        curve, own = piece.motion.curve, slice(self._index, self._index + 1)
        # a motion of low degree, as of a crank at constant speed, should not cost the memory of
        # the others
        used = np.flatnonzero(np.any(curve.coefficients[:, own] != 0, axis=(0, 1)))
        powers = curve.coefficients[:, own, : int(used.max(initial=0)) + 1]
        self._parts.append(replace(curve, turns=curve.turns[:, own], coefficients=powers.copy()))

    @cached_property
    def curve(self) -> PiecewisePolynomial | None:
        """Of the crank, once all pieces are entered; None if no motion is recorded."""
        return PiecewisePolynomial.joined(self._parts) if self._parts else None

    def turned(self, t: Array) -> Array:
        """Revolutions (N,) since the start by times (N,) [s]; nan where not recorded."""
        turned = np.full(len(t), np.nan)
        if self.curve is not None and not self._slides:
            k, dt, known = self._find(self.curve, t)
            turned[known] = turns_at(self.curve, 0, k[known], dt[known], self._start)
        return -turned if self._net < 0 else turned

    def angle(self, t: float) -> float | None:
        """The angle at time t [s], in [0, 2 pi); None where not recorded."""
        if self.curve is None or self._slides:
            return None
        k, dt, known = self._find(self.curve, np.array([t]))
        return float(np.mod(self.curve.at(k, dt)[0, 0], TWO_PI)) if known[0] else None

    def summary(self) -> MotionSummary | None:
        """Summary of the recorded motion; None without any."""
        c = self.curve
        if c is None or self._names is None:
            return None
        lasted = c.end - float(c.start[0])
        return MotionSummary(
            coordinates=self._names[0],
            segments=len(c),
            start=float(c.start[0]),
            end=c.end,
            crank=self._names[0][self._index],
            revolutions=None if self._slides else abs(self._net),
            mean_speed=TWO_PI * self._net / lasted if lasted > 0 else 0.0,
            gaps=tuple(gaps(c)),
        )

    @property
    def _slides(self) -> bool:
        return self._names is not None and self._names[0][self._index] in self._displacements

    @cached_property
    def _net(self) -> float:
        """Revolutions over the run, with their sign."""
        c = self.curve
        if c is None:
            return 0.0
        return float(turns_at(c, 0, np.array([len(c) - 1]), c.duration[-1:], self._start)[0])

    @cached_property
    def _start(self) -> Place:
        return beginning(self.curve, 0) if self.curve is not None else (0, 0.0)

    @staticmethod
    def _find(
        c: PiecewisePolynomial, t: Array
    ) -> tuple[NDArray[np.intp], Array, NDArray[np.bool_]]:
        """The segment of each time, the time since its start [s], and whether it is recorded."""
        k = np.clip(np.searchsorted(c.start, t, side='right') - 1, 0, len(c) - 1)
        dt = (t - c.start[k]) - c.start_low[k]
        slack = 4 * np.spacing(abs(c.end))
        return k, dt, (dt >= -slack) & (dt <= c.duration[k] + slack)
