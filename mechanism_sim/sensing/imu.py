"""An inertial unit on a link: two accelerometers at right angles, and how the link turns."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import Vector2
from mechanism_sim.sensing.chain import Instrument
from mechanism_sim.sensing.channel import Channel, DirectSource
from mechanism_sim.sensing.point import PointOnLink


class Attitude(DirectSource):
    """The angle of a link, or its rate, as a source of a channel.

    Parameters
    ----------
    derivative : 0 for the angle without whole turns [rad], 1 for its rate [rad/s]
    at : [m] in the link's frame: an elastic link turns with its cross-section there
    """

    def __init__(
        self, mechanism: Mechanism, link: str, derivative: int, at: Vector2 = (0.0, 0.0)
    ) -> None:
        _, offset = mechanism.frame(link)
        self._shares = np.zeros(len(mechanism.coordinates))
        for name, slope in mechanism.turns(link, at).items():
            self._shares[mechanism.coordinates.index(name)] = slope
        self._offset, self._derivative = 0.0 if derivative else offset, derivative

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Angle or rate (1, N) at instants as those of ``curve.at(segments, dt)``."""
        turned = motion.curve.local(segments, dt, self._derivative)
        return (turned @ self._shares + self._offset)[None]


class Readings(NamedTuple):
    """N consecutive readings of an inertial unit; x is along the link, y across it."""

    times: Array  #: (N,) [s] when they are due
    acceleration: Array  #: (N, 2) [m/s^2] less that of gravity: at rest it points upwards
    angle: Array  #: (N,) [rad] of the link in the world, without whole turns
    rate: Array  #: (N,) [rad/s]


class InertialUnit:
    """Measures with the chain of an accelerometer along and across the link, and gravity with it.

    On the axis of the accelerometer noise and jitter are those that it has itself. Angle and rate
    are the true ones at the times when samples are due.

    Parameters
    ----------
    link, at, axis, transverse : of the accelerometer, see `PointOnLink`
    instrument, name, drive : as for its `Channel`
    """

    def __init__(
        self,
        mechanism: Mechanism,
        link: str,
        at: float | Vector2,
        axis: str,
        instrument: Instrument,
        name: str,
        transverse: float = 0.0,
        drive: int = 0,
    ) -> None:
        self._period = 1.0 / instrument.sample_rate
        ideal = replace(Instrument(instrument.sample_rate), trigger=instrument.trigger)
        place = at if isinstance(at, tuple) else (at, 0.0)
        self._channels = [
            Channel(
                PointOnLink(mechanism, link, at, way, True, transverse),
                instrument,
                name if way == axis else f'{name}.{way}',
                drive,
            )
            for way in ('along', 'across')
        ]
        self._channels += [
            Channel(Attitude(mechanism, link, derivative, place), ideal, name, drive)
            for derivative in (0, 1)
        ]

    def take(self, motion: Motion) -> None:
        """Measure a piece of motion, which follows that of the last call."""
        for channel in self._channels:
            channel.take(motion)

    def readings(self, final: bool = False) -> list[Readings]:
        """Those of full blocks, or all that is left; each is given once."""
        found = []
        blocks = (channel.blocks(final) for channel in self._channels)
        for x, y, angle, rate in zip(*blocks, strict=True):
            times = x.time + self._period * np.arange(len(x.samples))
            both = np.stack([x.samples, y.samples], axis=1)
            found.append(Readings(times, both, angle.samples, rate.samples))
        return found
