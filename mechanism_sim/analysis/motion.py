"""The motion of a recorded run, as exact as the run: piecewise polynomials, not samples."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.messages.segments import Segments, curve_of, unpack
from mechanism_sim.numerics.polynomials import TWO_PI, PiecewisePolynomial


@dataclass(frozen=True)
class RecordedMotion:
    """Angles of n coordinates over the m recorded segments.

    Times outside of what was recorded raise InputError.
    """

    coordinates: tuple[str, ...]
    joints: tuple[str, ...]
    polynomial: PiecewisePolynomial
    modes: NDArray[np.uint8]  #: (m, r) as in ModeChange

    @property
    def start(self) -> float:
        """Start of the first segment [s]."""
        return float(self.polynomial.start[0])

    @property
    def end(self) -> float:
        """End of the last segment [s]."""
        return self.polynomial.end

    def position(self, t: ArrayLike) -> Array:
        """Return the angles [rad] at times `t` (N,) [s]: (N, n)."""
        return self._at(t, 0)

    def velocity(self, t: ArrayLike) -> Array:
        """Return the angular velocities [rad/s] at times `t` (N,) [s]: (N, n)."""
        return self._at(t, 1)

    def acceleration(self, t: ArrayLike) -> Array:
        """Return the angular accelerations [rad/s^2] at times `t` (N,) [s]: (N, n)."""
        return self._at(t, 2)

    def turned(self, t: ArrayLike, coordinate: str) -> Array:
        """Return the revolutions of a coordinate from the start to times `t` (N,) [s]: (N,).

        Whole turns are subtracted as integers, so that long runs lose no digits.
        """
        i, turns = self.coordinates.index(coordinate), self.polynomial.turns
        within = replace(self.polynomial, turns=np.zeros_like(turns))
        k, dt = self._locate(np.append(self.start, np.asarray(t, np.float64)))
        angle = within.at(k, dt)[:, i]
        since_start = (turns[k, i] - turns[k[0], i]) + (angle - angle[0]) / TWO_PI
        return np.asarray(since_start[1:])

    def covers(self, t: ArrayLike) -> NDArray[np.bool_]:
        """Return whether the motion at times `t` (N,) [s] is recorded: (N,)."""
        return self._find(np.atleast_1d(np.asarray(t, np.float64)))[2]

    def gaps(self) -> list[tuple[float, float]]:
        """Return the spans [s] between segments that should meet and do not: lost messages."""
        return gaps(self.polynomial)

    def _at(self, t: ArrayLike, derivative: int) -> Array:
        k, dt = self._locate(np.atleast_1d(np.asarray(t, np.float64)))
        return self.polynomial.at(k, dt, derivative)

    def _locate(self, t: Array) -> tuple[NDArray[np.intp], Array]:
        """Return the segment of each time and the time since its start [s]."""
        k, dt, covered = self._find(t)
        if not covered.all():
            raise InputError(
                f'the motion at {t[~covered][0]:.9g} s is not recorded; '
                f'the bag has it from {self.start:.9g} s to {self.end:.9g} s'
                f'{" with gaps" if self.gaps() else ""}.'
            )
        return k, dt

    def _find(self, t: Array) -> tuple[NDArray[np.intp], Array, NDArray[np.bool_]]:
        p = self.polynomial
        k = np.clip(np.searchsorted(p.start, t, side='right') - 1, 0, len(p) - 1)
        dt = (t - p.start[k]) - p.start_low[k]
        slack = 4 * np.spacing(abs(self.end))
        return k, dt, (dt >= -slack) & (dt <= p.duration[k] + slack)


def gaps(curve: PiecewisePolynomial) -> list[tuple[float, float]]:
    """The spans [s] between segments that should meet and do not."""
    end = curve.start[:-1] + (curve.start_low[:-1] + curve.duration[:-1])
    slack = 8 * np.spacing(np.abs(curve.start[1:])) + 1e-15
    apart = np.flatnonzero(curve.start[1:] - end > slack)
    return [(float(end[k]), float(curve.start[k + 1])) for k in apart]


def padded(curves: Sequence[PiecewisePolynomial]) -> list[PiecewisePolynomial]:
    """The same, all of the highest degree among them."""
    powers = [curve.coefficients for curve in curves]
    width = max(x.shape[2] for x in powers)
    wide = [np.pad(x, ((0, 0), (0, 0), (0, width - x.shape[2]))) for x in powers]
    return [replace(c, coefficients=x) for c, x in zip(curves, wide, strict=True)]


class MotionCollector:
    """Puts the motion together from its messages.

    Args:
        coordinates: The coordinates to keep; all of them unless told.

    """

    def __init__(self, coordinates: Sequence[str] | None = None) -> None:
        self._wanted = None if coordinates is None else tuple(coordinates)
        self._parts: list[Segments] = []

    def add(self, segments: Segments) -> None:
        """Add the segments that follow. InputError: they are of other coordinates."""
        if self._parts and segments.joints != self._parts[0].joints:
            raise InputError('the joints of the recorded motion change on the way.')
        wanted = segments.coordinates if self._wanted is None else self._wanted
        missing = [name for name in wanted if name not in segments.coordinates]
        if missing or (self._parts and wanted != self._parts[0].coordinates):
            names = ', '.join(segments.coordinates)
            raise InputError(f'the recorded motion is of {names}; {", ".join(wanted)} was wanted.')
        columns = [segments.coordinates.index(name) for name in wanted]
        powers = segments.coefficients[:, columns]
        # A motion of low degree, as of a crank at constant speed, should not cost the memory of
        # the others.
        used = np.flatnonzero(np.any(powers != 0, axis=(0, 1)))
        width = int(used[-1]) + 1 if len(used) else 1
        turns, used_powers = segments.turns[:, columns], powers[:, :, :width].copy()
        kept = replace(segments, coordinates=wanted, turns=turns, coefficients=used_powers)
        self._parts.append(kept)

    def motion(self) -> RecordedMotion | None:
        """Return the motion collected so far; None if there is none."""
        parts = [part for part in self._parts if len(part.start)]
        if not parts:
            return None
        curves = padded([curve_of(part) for part in parts])
        columns = ('start', 'start_low', 'duration', 'turns', 'coefficients')
        joined = (np.concatenate([getattr(c, name) for c in curves]) for name in columns)
        modes = np.concatenate([part.modes for part in parts])
        first = parts[0]
        return RecordedMotion(first.coordinates, first.joints, PiecewisePolynomial(*joined), modes)


def collect_motion(
    messages: Iterable[Any], coordinates: Sequence[str] | None = None
) -> RecordedMotion:
    """Return the motion that Motion messages describe.

    Args:
        messages: The messages in the order of time.
        coordinates: The coordinates to keep; all of them unless told.

    Raises:
        InputError: There are none, or they contradict themselves or each other.

    """
    collector = MotionCollector(coordinates)
    for message in messages:
        collector.add(unpack(message))
    motion = collector.motion()
    if motion is None:
        raise InputError('there is no recorded motion.')
    return motion
