"""The acceleration of a point of a frame on springs as input of an instrument."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.numerics.rational import Modes, Rational
from mechanism_sim.planar.points import Vector2
from mechanism_sim.sensing.point import angle_of
from mechanism_sim.vibration.frame import Frame
from mechanism_sim.vibration.residues import through
from mechanism_sim.vibration.shaken_frame import Forces, Shaking


class PointOnFrame:
    """A source whose inputs are the forces on a frame: the frame is the first part of the chain.

    Parameters
    ----------
    frame : frame with n degrees of freedom
    forces : forces of the machine on the frame
    at : position [m] in the world, like centre of gravity and mounts
    axis : 'along' the world's x axis or 'across' it, or its angle from there [rad]
    gravity : gravity [m/s^2], subtracted from the acceleration
    transverse : transverse sensitivity, to the acceleration 90 degrees on from the axis
    """

    def __init__(
        self,
        frame: Frame,
        forces: Forces,
        at: Vector2,
        axis: float | str,
        gravity: Vector2 = (0.0, 0.0),
        transverse: float = 0.0,
    ) -> None:
        self._frame, self._shaking = frame, Shaking(frame, forces)
        turn = angle_of(axis) + math.atan(transverse)
        way = math.hypot(1.0, transverse) * np.array([math.cos(turn), math.sin(turn)])
        self._outputs = way @ frame.motion_of(at)
        self._weight = -float(way @ gravity)
        self.inputs = frame.freedom + 1  #: number of inputs, n and one more for gravity

    def through(self, chain: Rational) -> Modes:
        """The system from the forces, and from gravity, to the output of a chain."""
        moved = through(self._frame.receptance, self._frame.M, self._outputs, chain)
        still = chain.modes()
        n, m = len(moved.poles), len(still.poles)
        residues = np.zeros((1, self.inputs, n + m), complex)
        residues[:, :-1, :n], residues[:, -1:, n:] = moved.residues, still.residues
        return Modes(
            np.concatenate([moved.poles, still.poles]),
            residues,
            np.concatenate([moved.direct, still.direct], axis=1),
        )

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Forces less those at the start (n, N) [N, N m], and the reading of gravity."""
        start = self._shaking.at_start(motion)
        forces = self._shaking.read(motion, segments, dt) - start[:, None]
        return np.concatenate([forces, np.full((1, forces.shape[1]), self._weight)])

    def impulses(self, motion: Motion) -> Array:
        """Impulses (m, n + 1) [N s, N m s] at the instants at which the m pieces begin."""
        impulses = self._shaking.impulses(motion)
        return np.concatenate([impulses, np.zeros((len(impulses), 1))], axis=1)
