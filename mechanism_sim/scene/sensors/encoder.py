"""Incremental encoders: the angle of a link in counts of their lines."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.keys.quantities import Angle
from mechanism_sim.numerics.polynomials import TWO_PI, Times
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.sensor_keys import SENSORS, BetweenKeys, angle_between
from mechanism_sim.sensing.channel import DirectSource, LevelPassage

EDGES = 4
"""Counts of a line: both edges of two tracks that are a quarter of a line apart."""


class Encoder(DirectSource):
    """A source of samples: the angle of a link on another, rounded down to whole counts.

    Parameters
    ----------
    mechanism : the machine
    link, relative_to : the angle of the first on the second is counted
    lines : in a turn
    index : angle [rad] of the index line; counting begins anew where it passes for the first time
    """

    def __init__(
        self,
        mechanism: Mechanism,
        link: str,
        relative_to: str,
        lines: int,
        index: float | None = None,
    ) -> None:
        self._columns, self._offset = angle_between(mechanism, link, relative_to)
        self._counts = EDGES * lines
        self._step = TWO_PI / self._counts
        self._index, self._passage = index, None
        if index is not None:
            self._passage = LevelPassage(index - self._offset, self._columns)
        self._zero: tuple[int, float] | None = None  # whole turns and angle
        self._passed = math.inf, 0, 0.0  # when, and what is counted from then on
        self._seen: Motion | None = None

    def read(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Counted angle (1, N) [rad] at instants as those of ``motion.curve.at(segments, dt)``."""
        if motion is not self._seen:
            self._seen = motion
            self._look_for_index(motion)
        turns, angle = self._angle(motion, segments, dt)
        assert self._zero is not None  # noqa: S101 - set where the first motion begins
        t = motion.curve.times(segments, np.asarray(dt))
        whole, since = (
            np.where(t >= self._passed[0], a, b)
            for a, b in zip(self._passed[1:], self._zero, strict=True)
        )
        counts = self._counts * (turns - whole) + np.floor((angle - since) / self._step)
        return np.asarray(self._step * counts[None])

    def _angle(
        self, motion: Motion, segments: IndexArray, dt: Any
    ) -> tuple[NDArray[np.int64], Array]:
        """Whole turns (N,), and the angle beside them (N,) [rad]."""
        curve = motion.curve
        turns, q = curve.turns_at(segments, dt).T, curve.local(segments, dt).T
        whole = sum(int(sign) * turns[i] for i, sign in self._columns.items())
        angle = self._offset + sum(sign * q[i] for i, sign in self._columns.items())
        return np.asarray(whole), np.asarray(angle)

    def _look_for_index(self, motion: Motion) -> None:
        """Keep where counting begins, and when the index passes for the first time."""
        if self._zero is None:
            (turns,), (angle,) = self._angle(motion, np.zeros(1, np.intp), np.zeros(1))
            self._zero = int(turns), float(angle)
        if self._passage is None or math.isfinite(self._passed[0]):
            return
        if times := self._passage.times(motion):
            assert self._index is not None  # noqa: S101 - there is a passage
            k, dt = motion.curve.find(np.array(times[:1]))
            (turns,), (angle,) = self._angle(motion, k, dt)
            more = round((float(angle) - self._index) / TWO_PI)
            self._passed = times[0], int(turns) + more, self._index


@SENSORS.add('encoder')
class EncoderKeys(BetweenKeys):
    """An incremental encoder with two tracks, sampled at `sample_rate`."""

    lines: Annotated[int, Field(strict=True, ge=1, le=1_000_000)] = 1024
    """Lines per turn; four counts each."""
    index: Angle | None = None
    """Angle of the index line: counts are from there once it has passed, else from the start."""

    reads = 'angle'
    does = 'an encoder counts'

    def source(self, machine: Any) -> Encoder:
        """The counted angle."""
        mechanism, link = machine.mechanism, str(self.link)
        return Encoder(mechanism, link, self.relative_to, self.lines, self.index)

    def place(self, machine: Any) -> str:
        """Between two links."""
        return f'of the {self.link} on the {self.relative_to}, {self.lines} lines'
