"""The crank as the clock of a machine: how far it is, and how often it went round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechanism_sim.analysis.motion import RecordedMotion
from mechanism_sim.arrays import Array
from mechanism_sim.numerics.polynomials import TWO_PI


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

    Args:
        motion: Of the crank alone; None if it is not recorded.
        slides: Whether it is a displacement, which has neither angle nor revolutions.

    """

    def __init__(self, motion: RecordedMotion | None, slides: bool = False) -> None:
        self._motion = motion
        self._slides = slides
        self._net = 0.0 if motion is None else float(self._signed(motion, [motion.end])[0])

    def turned(self, t: Array) -> Array:
        """Return the revolutions since the start by times (N,) [s], nan where not recorded."""
        turned = np.full(len(t), np.nan)
        if self._motion is not None and not self._slides:
            known = self._motion.covers(t)
            turned[known] = self._signed(self._motion, t[known])
        return -turned if self._net < 0 else turned

    def angle(self, t: float) -> float | None:
        """Return the angle at time t [s], in [0, 2 pi); None where not recorded."""
        if self._motion is None or self._slides or not self._motion.covers([t])[0]:
            return None
        return float(np.mod(self._motion.position([t])[0, 0], TWO_PI))

    def summary(self, coordinates: tuple[str, ...]) -> MotionSummary | None:
        """Return the summary of the motion, which is of `coordinates`; None if not recorded."""
        motion = self._motion
        if motion is None:
            return None
        lasted = motion.end - motion.start
        return MotionSummary(
            coordinates=coordinates,
            segments=len(motion.polynomial),
            start=motion.start,
            end=motion.end,
            crank=motion.coordinates[0],
            revolutions=None if self._slides else abs(self._net),
            mean_speed=TWO_PI * self._net / lasted if lasted > 0 else 0.0,
            gaps=tuple(motion.gaps()),
        )

    @staticmethod
    def _signed(motion: RecordedMotion, t: Array | list[float]) -> Array:
        return motion.turned(t, motion.coordinates[0])
