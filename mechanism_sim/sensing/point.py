"""Acceleration of a point of a link along an axis, and rotation, as inputs of instruments."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes, PiecewisePolynomial
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Vector2, factors, product
from mechanism_sim.sensing.chain import Instrument
from mechanism_sim.sensing.channel import Channel, DirectSource
from mechanism_sim.vibration.shaken_frame import VelocitySteps

_TOGETHER = 512  # pieces at whose nodes the acceleration is computed at once


def angle_of(axis: float | str) -> float:
    """Angle [rad] of an axis from that of x, of which 'along' and 'across' are names."""
    return {'along': 0.0, 'across': 0.5 * math.pi}[axis] if isinstance(axis, str) else axis


class PointOnLink(DirectSource):
    """Reads the acceleration of a point from the motion of the links, exactly.

    The point is ``p = sum_k s_k R(theta_k) d_k``, so that its acceleration is
    ``sum_k R(theta_k) ((s'' - s theta'^2) d + (s theta'' + 2 s' theta') E d)``, E turning by 90
    degrees; s is 1 for arms of fixed length, and theta is 0 for those of the ground. On an elastic
    link the axis turns with the cross-section.

    Parameters
    ----------
    mechanism : mechanism of the machine
    link : link that carries the sensor
    at : position [m] in the link's frame; one number: along its x axis
    axis : 'along' the link's x axis or 'across' it (counterclockwise), or its angle from there
        [rad]
    gravity : True if gravity is subtracted from the acceleration, as in real instruments
    transverse : transverse sensitivity, to the acceleration 90 degrees on from the axis
    """

    def __init__(
        self,
        mechanism: Mechanism,
        link: str,
        at: float | Vector2,
        axis: float | str,
        gravity: bool = False,
        transverse: float = 0.0,
    ) -> None:
        self._mechanism, self._link = mechanism, link
        self._place = at if isinstance(at, tuple) else (at, 0.0)
        frame, offset = mechanism.frame(link)
        arms = mechanism.point(link, self._place)
        turns = mechanism.turns(link, self._place)
        names = {frame, *turns, *(name for f, slide in arms for name in (f, *factors(slide)))}
        used = [name for name in mechanism.coordinates if name in names]
        index = used.index
        self._used = [mechanism.coordinates.index(name) for name in used]
        self._arms = [
            (
                None if frame == GROUND else index(frame),
                tuple(index(name) for name in factors(slide)),
                np.array(d),
            )
            for (frame, slide), d in arms.items()
            if frame != GROUND or factors(slide)  # others stand still
        ]
        self._turns = [(index(name), slope) for name, slope in turns.items()]
        turn = offset + angle_of(axis)
        self._turn, self._size = turn + math.atan(transverse), math.hypot(1.0, transverse)
        self._gravity = mechanism.gravity if gravity else (0.0, 0.0)
        self._steps = VelocitySteps()

    @property
    def still(self) -> bool:
        """True if the reading is zero: the point slides across the axis without rotation."""
        c, s = math.cos(self._turn), math.sin(self._turn)
        read = [i is not None or abs(c * x + s * y) > 1e-9 for i, _, (x, y) in self._arms]
        return not any(read) and not self._turns and self._gravity == (0.0, 0.0)

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Acceleration (1, N) [m/s^2] at instants as those of ``curve.at(segments, dt)``."""
        curve = replace(motion.curve, coefficients=motion.curve.coefficients[:, self._used])
        if not isinstance(dt, Nodes):  # the curve has blocks of its own for instants
            return self._reading(curve, segments, dt)[None]
        parts = [segments[k : k + _TOGETHER] for k in range(0, len(segments), _TOGETHER)]
        found = [self._reading(curve, some, dt) for some in parts]
        return np.concatenate([np.zeros(0), *found])[None]

    def _reading(
        self, curve: PiecewisePolynomial, segments: NDArray[np.intp], dt: Array | Nodes
    ) -> Array:
        """`read` (N,), of nodes on so few pieces that they stay in the cache."""
        q, v, a = (x.T for x in curve.locals(segments, dt, (0, 1, 2)))
        axis = self._axis(q)
        gx, gy = self._gravity
        reading = -(gx * np.cos(axis) + gy * np.sin(axis))
        for i, scale, (x, y) in self._arms:
            angle, w, alpha = np.zeros((3, q.shape[1])) if i is None else (q[i], v[i], a[i])
            s, rate, second = product(scale, lambda k: (q[k], v[k], a[k]))
            # components of the arm along the axis and across it, the axis being at `angle`
            apart = -self._turn if self._turns == [(i, 1.0)] else angle - axis
            cosine, sine = np.cos(apart), np.sin(apart)
            along, across = x * cosine - y * sine, -(x * sine + y * cosine)
            reading += (second - s * w**2) * along + (s * alpha + 2.0 * rate * w) * across
        return np.asarray(self._size * reading)

    def impulses(self, motion: Motion) -> Array:
        """Steps of the velocity (m, 1) [m/s] at the start of the m pieces that follow.

        Pieces must come in the order of time; what is a step at the first depends on the last of
        the call before.
        """
        curve = motion.curve
        q = curve.local(np.arange(len(curve)), np.zeros(len(curve))).T
        axis = self._axis(q[self._used])
        steps = self._steps(curve)
        x, y = self._mechanism.trace((self._link, self._place), q, steps)[1]
        return np.asarray(self._size * (x * np.cos(axis) + y * np.sin(axis)))[:, None]

    def _axis(self, q: Array) -> Array:
        """Direction [rad] of the axis in the world, from the coordinates in use."""
        axis = np.full(q.shape[1], self._turn)
        for k, slope in self._turns:
            axis += slope * q[k]
        return axis


class Attitude(DirectSource):
    """The angle of a link, or its rate, as a source of a channel.

    Parameters
    ----------
    derivative : 0 for the angle without whole turns [rad], 1 for its rate [rad/s]
    at : position [m] in the link's frame: an elastic link rotates with its cross-section there
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

    times: Array  #: (N,) due times [s]
    acceleration: Array  #: (N, 2) [m/s^2] less gravity: at rest it points upwards
    angle: Array  #: (N,) angle [rad] of the link in the world, without whole turns
    rate: Array  #: (N,) angular velocity [rad/s]


class InertialUnit:
    """Measures with the chain of an accelerometer along and across the link, and gravity with it.

    On the axis of the accelerometer noise and jitter are those that it has itself. Angle and rate
    are the true ones at the times when samples are due.

    Parameters
    ----------
    link, at, axis, transverse : parameters of the accelerometer, see `PointOnLink`
    instrument, name, drive : parameters of its `Channel`
    """

    def __init__(
        self,
        mechanism: Mechanism,
        link: str,
        at: float | Vector2,
        axis: float | str,
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
        """Readings of full blocks, or all remaining ones if `final`; each is returned once."""
        found = []
        blocks = (channel.blocks(final) for channel in self._channels)
        for x, y, angle, rate in zip(*blocks, strict=True):
            times = x.time + self._period * np.arange(len(x.samples))
            both = np.stack([x.samples, y.samples], axis=1)
            found.append(Readings(times, both, angle.samples, rate.samples))
        return found
