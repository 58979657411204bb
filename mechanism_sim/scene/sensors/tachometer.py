"""Tachometers: the speed of a link by the time between marks that pass a pickup."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import TWO_PI, Times
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.sensor_keys import SENSORS, BetweenKeys, angle_between
from mechanism_sim.sensing.channel import DirectSource, LevelPassage


class Tachometer(DirectSource):
    """A source of samples: the angle between two marks over the time between the last two pulses.

    While the next mark is late, it is that angle over the time since the last one: at most so
    fast can the link be. Before the second pulse it is zero.

    Parameters
    ----------
    mechanism : the machine
    link, relative_to : the first has the marks, the second the pickup
    pulses : in a turn
    """

    def __init__(self, mechanism: Mechanism, link: str, relative_to: str, pulses: int) -> None:
        columns, offset = angle_between(mechanism, link, relative_to)
        # so many times the angle passes zero at every mark
        often = {i: pulses * sign for i, sign in columns.items()}
        self._passage = LevelPassage(-pulses * offset, often)
        self._step = TWO_PI / pulses
        self._pulses = np.zeros(0)  # [s] of this motion, and the last two before it
        self._seen: Motion | None = None

    def read(self, motion: Motion, segments: IndexArray, dt: Times) -> Array:
        """Speed (1, N) [rad/s] at instants as those of ``motion.curve.at(segments, dt)``."""
        if motion is not self._seen:
            self._seen = motion
            self._pulses = np.append(self._pulses[-2:], self._passage.times(motion))
        t = motion.curve.times(segments, np.asarray(dt))
        speed = np.zeros(len(t))
        last = np.searchsorted(self._pulses, t, side='right') - 1
        known = last >= 1
        now, before = self._pulses[last[known]], self._pulses[last[known] - 1]
        speed[known] = self._step / np.maximum(now - before, t[known] - now)
        return speed[None]


@SENSORS.add('tachometer')
class TachometerKeys(BetweenKeys):
    """A pickup that senses marks of a link; the samples are a speed without a sign."""

    pulses: Annotated[int, Field(strict=True, ge=1, le=1000)] = 1
    """Pulses per turn: marks at equal angles, one on the link's x axis."""

    reads = 'angular_velocity'
    does = 'a tachometer times'

    def source(self, machine: Any) -> Tachometer:
        """The speed between pulses."""
        return Tachometer(machine.mechanism, str(self.link), self.relative_to, self.pulses)

    def place(self, machine: Any) -> str:
        """Between two links."""
        return f'of the {self.link} on the {self.relative_to}, pulses in a turn: {self.pulses}'
