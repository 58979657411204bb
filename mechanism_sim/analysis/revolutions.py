"""Revolutions of the main drive of a run as its clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.results.solution import Piece
from mechanism_sim.results.turns import turns_at
from mechanism_sim.scene import Machine

_NEWTON = 50


@dataclass(frozen=True, eq=False)
class Revolutions:
    """A run, and where its main drive is when.

    Turns are counted from angle zero on, in the direction in which the drive ends up.

    Attributes
    ----------
    piece : its motion and events
    """

    machine: Machine
    piece: Piece

    @property
    def start(self) -> float:
        """Of the motion [s]."""
        return float(self.piece.motion.curve.start[0])

    @property
    def end(self) -> float:
        """Of the motion [s]."""
        return self.piece.motion.curve.end

    @property
    def slides(self) -> bool:
        """True if the main drive moves straight, so that it makes no turns."""
        return self.machine.plan.main in self.machine.physics.displacements

    @cached_property
    def _drive(self) -> int:
        return self.machine.physics.coordinates.index(self.machine.plan.main)

    @cached_property
    def _sense(self) -> float:
        """1 if the main drive turns counterclockwise, -1 if clockwise."""
        first, last = self._angle(np.array([self.start, self.end]))
        return -1.0 if last < first else 1.0

    def _angle(self, t: Array) -> Array:
        return self.piece.motion.curve(t)[:, self._drive]

    def turned(self, t: Array) -> Array:
        """Angle of the main drive in turns at times (N,) [s]: (N,), rising.

        Not a number outside of the motion, and of a drive that slides.
        """
        inside = (t >= self.start) & (t <= self.end) & (not self.slides)
        turned = np.full(len(t), np.nan)
        curve = self.piece.motion.curve
        turned[inside] = self._sense * turns_at(curve, self._drive, *curve.find(t[inside]))
        return turned

    def angle(self, t: Array) -> Array:
        """Angle of the main drive at times (N,) [s] in [0, 2 pi); nan of a drive that slides."""
        if self.slides:
            return np.full(len(t), np.nan)
        return np.asarray(np.mod(self._angle(t), TWO_PI))

    @property
    def turns(self) -> tuple[int, int]:
        """The whole turns from angle zero to angle zero within the motion: from, and up to."""
        first, last = self.turned(np.array([self.start, self.end]))
        return math.ceil(first - 1e-9), math.floor(last + 1e-9)

    def whole_turns(self, skip: int = 0) -> tuple[int, int]:
        """The whole turns without the first `skip` of them."""
        if self.slides:
            raise InputError(
                f'{self.machine.name}: {self.machine.plan.main} moves in a straight line: it '
                'makes no turns'
            )
        first, last = self.turns
        if first + skip >= last:
            raise InputError(
                f'{self.machine.name}: the run has {max(0, last - first)} whole turns of '
                f'{self.machine.plan.main}; {skip + 1} are needed'
            )
        return first + skip, last

    @property
    def has_turns(self) -> bool:
        """True if the run has a whole turn of a drive that turns one way only."""
        if self.slides:
            return False
        first, last = self.turns
        return first < last and bool(np.all(np.diff(self._marks[1]) >= 0.0))

    @property
    def rate(self) -> float:
        """Turns of the main drive a second, in the mean [Hz]."""
        first, last = self.turned(np.array([self.start, self.end]))
        return float((last - first) / (self.end - self.start))

    def begin(self, skip: int) -> float:
        """When so many whole turns of the main drive are over [s]; the start of the run for 0."""
        if not skip:
            return self.start
        return float(self.times_at(np.array([self.whole_turns(skip)[0]]))[0])

    @cached_property
    def _marks(self) -> tuple[Array, Array]:
        """Times [s] at which pieces of the motion meet, and the turns of the drive then."""
        marks = np.append(self.piece.motion.curve.start, self.end)
        return marks, self.turned(marks)

    def times_at(self, turns: Array) -> Array:
        """When the main drive has made `turns` (N,), as `turned` counts them [s]."""
        marks, passed = self._marks
        if np.any(np.diff(passed) < 0.0):
            raise InputError(f'{self.machine.name}: {self.machine.plan.main} turns back')
        curve, per_turn = self.piece.motion.curve, self._sense / TWO_PI
        t = np.interp(turns, passed, marks)
        for _ in range(_NEWTON):
            k, dt = curve.find(t)
            off = per_turn * curve.at(k, dt)[:, self._drive] - turns
            rate = per_turn * curve.at(k, dt, 1)[:, self._drive]
            # where it starts from rest, its angle of the start is reached at rate zero
            step = np.divide(off, rate, out=np.zeros_like(off), where=(off != 0.0) & (rate != 0.0))
            t = np.clip(t - step, self.start, self.end)
            if np.abs(step).max(initial=0.0) <= 4.0 * np.spacing(self.end):
                break
        return np.asarray(t)
