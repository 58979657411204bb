"""Tachometers: the speed of a link by the time between marks that pass a pickup."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import TWO_PI, Nodes
from mechanism_sim.numerics.rational import Array, Modes, Rational
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.sensor_keys import OnLinkKeys, SensorKind, register
from mechanism_sim.scene.sensors._places import angle_between, check_between
from mechanism_sim.sensing.chain import Trigger
from mechanism_sim.sensing.sampling import Passage


class TachometerKeys(OnLinkKeys):
    """A pickup that marks of a link pass; the samples are a speed without a sign."""

    relative_to: str = GROUND
    """The link that carries its head."""
    pulses: Annotated[int, Field(strict=True, ge=1, le=1000)] = 1
    """In a turn: marks at equal angles, one on the link's x axis."""


class Tachometer:
    """A source of samples: the angle between two marks over the time between the last two pulses.

    While the next mark is late, it is that angle over the time since the last one: at most so
    fast can the link be. Before the second pulse it is zero.

    Parameters
    ----------
    mechanism : the machine
    link, relative_to : the first has the marks, the second the pickup
    pulses : in a turn
    """

    inputs = 1

    def __init__(self, mechanism: Mechanism, link: str, relative_to: str, pulses: int) -> None:
        columns, offset = angle_between(mechanism, link, relative_to)
        # so many times the angle passes zero at every mark
        often = {i: pulses * sign for i, sign in columns.items()}
        self._passage = Passage(Trigger(-pulses * offset), often)
        self._step = TWO_PI / pulses
        self._pulses = np.zeros(0)  # [s] of this motion, and the last two before it
        self._seen: Motion | None = None

    def through(self, chain: Rational) -> Modes:
        """The system from what is read here to what comes out of a chain."""
        return chain.modes()

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Speed (1, N) [rad/s] at instants as those of ``motion.curve.at(segments, dt)``."""
        if motion is not self._seen:
            self._seen = motion
            self._pulses = np.append(self._pulses[-2:], self._passage.times(motion))
        curve = motion.curve
        t = curve.start[segments] + (curve.start_low[segments] + np.asarray(dt))
        speed = np.zeros(len(t))
        last = np.searchsorted(self._pulses, t, side='right') - 1
        known = last >= 1
        now, before = self._pulses[last[known]], self._pulses[last[known] - 1]
        speed[known] = self._step / np.maximum(now - before, t[known] - now)
        return speed[None]

    def impulses(self, motion: Motion) -> Array:
        """None (m, 1): pulses are of angles, which have no impulses."""
        return np.zeros((len(motion), 1))


register(
    SensorKind(
        'tachometer',
        TachometerKeys,
        needs=('link',),
        quantity='angular_velocity',
        source=lambda machine, sensor: Tachometer(
            machine.mechanism, sensor.link, sensor.relative_to, sensor.pulses
        ),
        carrier=lambda machine, sensor: str(sensor.link),  # noqa: ARG005
        place=lambda machine, sensor: (  # noqa: ARG005
            f'of the {sensor.link} on the {sensor.relative_to}, pulses in a turn: {sensor.pulses}'
        ),
        check=lambda machine, sensor, where: check_between(
            machine, where, sensor, 'a tachometer times'
        ),
    )
)
