"""Positions of a closed mechanism that follow given positions of its driving coordinates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import RunError
from mechanism_sim.linkages.ideal import LinkageMotion
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.kinematics import Kinematics

_STEP = TWO_PI / 64  # [rad], or parts of 2 pi of the mechanism's size, that Newton's method goes
_SHORTEST = 1e-6  # of a way: shorter steps lead nowhere
_TURNS = 64  # of a driving link, within which a mechanism that repeats is to do so
_SAME = 1e-9  # [rad], or parts of the size: far above the rounding of a turn that was followed


class Tracker:
    """The configuration of a mechanism, moved by its driving coordinates on the branch it is on.

    A slider, an encoder or a controller tells a driving coordinate at some instants; on the way
    from one to the next the mechanism is followed in steps, so that a jump of the input cannot
    bring it to another assembly. Of a jump by many turns only those are followed after which the
    mechanism is where it was.

    Parameters
    ----------
    kinematics : closures, with the p driving coordinates held
    q : (n,) closed configuration at the start [rad, m]
    slope : (n,) direction in which it begins, if it is singular

    Attributes
    ----------
    q : (n,) configuration now; angles go on beyond a turn
    """

    def __init__(self, kinematics: Kinematics, q: Array, slope: Array | None = None) -> None:
        self._motion = LinkageMotion(kinematics)
        self._kinematics = kinematics
        self._slope = slope
        self.q = np.array(q, dtype=float)

    @property
    def driven(self) -> Array:
        """The driving coordinates (p,) now."""
        return np.asarray(self.q[self._motion.driven])

    def to(self, driven: Sequence[float]) -> Array:
        """Configuration (n,) at other driving coordinates (p,), to rounding.

        Raises
        ------
        RunError
            If the loops cannot be closed on the way; the configuration stays as it was.
        """
        end, before = np.asarray(driven, dtype=float), (self.q, self._slope)
        try:
            for k, place in enumerate(end):
                self._take_turns(k, float(place))
            self._go(end)
        except RunError:
            self.q, self._slope = before
            raise
        return self.q

    def _take_turns(self, k: int, end: float) -> None:
        """Turn the k-th driving link by most of the whole turns on its way to `end`.

        Nothing is done if they are few, or if the mechanism does not come back to where it is.
        """
        i = self._motion.driven[k]
        turns = int((end - self.q[i]) / TWO_PI)
        if abs(turns) < 2 or i in self._motion.sliding:
            return
        start, slope, place = self.q, self._slope, self.driven
        angles = np.setdiff1d(np.arange(len(start)), self._motion.sliding)
        for gone in range(1, min(abs(turns) // 2, _TURNS) + 1):
            place[k] = start[i] + math.copysign(TWO_PI * gone, turns)
            try:
                self._go(place)
            except RunError:  # of several drives others may have to move too
                break
            windings = np.zeros(len(start))
            windings[angles] = np.round((self.q - start)[angles] / TWO_PI)
            off = self.q - start - TWO_PI * windings
            if np.abs(off / self._kinematics.scale).max() <= _SAME:
                self.q = start + TWO_PI * windings * (abs(turns) // gone)
                return
        self.q, self._slope = start, slope

    def _go(self, end: Array) -> None:
        """Follow the mechanism to driving coordinates (p,), in a straight line of them."""
        index, start = self._motion.driven, self.driven
        way = end - start
        longest = np.abs(way / self._kinematics.scale[index]).max(initial=0.0)
        step = min(1.0, _STEP / max(longest, 1e-300))  # of the way, which is the time here
        q, slope, gone, still = self.q, self._slope, 0.0, np.zeros_like(way)
        while gone < 1.0:
            ahead = 1.0 if gone + step >= 1.0 - 1e-9 else gone + step
            target = end if ahead == 1.0 else start + way * ahead
            now = np.array([start + way * gone, way, still])
            try:
                found, slope = self._motion.follow(
                    q, np.array([ahead - gone]), target[:, None], now, slope
                )
            except RunError:
                # beside a singular position only a short step tells the branches apart
                step *= 0.25
                if step < _SHORTEST:
                    raise
                continue
            q, gone, step = found[:, 0], ahead, min(2.0 * step, 1.0)
            step = min(step, _STEP / max(longest, 1e-300))
        self.q, self._slope = q, slope

    def rates(self, driven: Sequence[float]) -> Array:
        """Rates (n,) of all coordinates by those (p,) of the driving; NaN where it is singular."""
        given = np.asarray(driven, dtype=float)[:, None]
        return np.asarray(self._kinematics.rates(self.q[:, None], given)[:, 0])
