"""Incremental encoders: the angle of a link in counts of their lines."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import TWO_PI, Nodes
from mechanism_sim.numerics.rational import Array, Modes, Rational
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.quantities import Angle
from mechanism_sim.scene.sensor_keys import OnLinkKeys, SensorKind, register
from mechanism_sim.scene.sensors._places import angle_between, check_between
from mechanism_sim.sensing.chain import Trigger
from mechanism_sim.sensing.sampling import Passage

EDGES = 4
"""Counts of a line: both edges of two tracks that are a quarter of a line apart."""


class EncoderKeys(OnLinkKeys):
    """An incremental encoder with two tracks, sampled as often as `sample_rate` says."""

    relative_to: str = GROUND
    """The link that carries its head."""
    lines: Annotated[int, Field(strict=True, ge=1, le=1_000_000)] = 1024
    """In a turn; four counts each."""
    index: Angle | None = None
    """Angle of the index line: counts are from there once it has passed, else from the start."""


class Encoder:
    """A source of samples: the angle of a link on another, rounded down to whole counts.

    Parameters
    ----------
    mechanism : the machine
    link, relative_to : the angle of the first on the second is counted
    lines : in a turn
    index : angle [rad] of the index line; counting begins anew where it passes for the first time
    """

    inputs = 1

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
            self._passage = Passage(Trigger(index - self._offset), self._columns)
        self._zero: tuple[int, float] | None = None  # whole turns and angle
        self._passed = math.inf, 0, 0.0  # when, and what is counted from then on
        self._seen: Motion | None = None

    def through(self, chain: Rational) -> Modes:
        """The system from what is read here to what comes out of a chain."""
        return chain.modes()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Counted angle (1, N) [rad] at instants as those of ``motion.curve.at(segments, dt)``."""
        if motion is not self._seen:
            self._seen = motion
            self._look_for_index(motion)
        turns, angle = self._angle(motion, segments, dt)
        assert self._zero is not None  # noqa: S101 - set where the first motion begins
        curve = motion.curve
        t = curve.start[segments] + (curve.start_low[segments] + np.asarray(dt))
        whole, since = (
            np.where(t >= self._passed[0], a, b)
            for a, b in zip(self._passed[1:], self._zero, strict=True)
        )
        counts = self._counts * (turns - whole) + np.floor((angle - since) / self._step)
        return np.asarray(self._step * counts[None])

    def impulses(self, motion: Motion) -> Array:
        """None (m, 1): an angle has no impulses."""
        return np.zeros((len(motion), 1))

    def _angle(
        self, motion: Motion, segments: NDArray[np.intp], dt: Any
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


def _source(machine: Any, sensor: Any) -> Encoder:
    return Encoder(machine.mechanism, sensor.link, sensor.relative_to, sensor.lines, sensor.index)


register(
    SensorKind(
        'encoder',
        EncoderKeys,
        needs=('link',),
        quantity='angle',
        source=_source,
        carrier=lambda machine, sensor: str(sensor.link),  # noqa: ARG005
        place=lambda machine, sensor: (  # noqa: ARG005
            f'of the {sensor.link} on the {sensor.relative_to}, {sensor.lines} lines'
        ),
        check=lambda machine, sensor, where: check_between(
            machine, where, sensor, 'an encoder counts'
        ),
    )
)
