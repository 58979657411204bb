"""A frame on springs, shaken by a machine that it carries.

One way: the machine moves as if the frame were at rest, which is right to the ratio of their
masses times the square of the frequency ratio of the disturbance. The response is exact for forces
that are polynomials on every piece of the motion, and for the impulses between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.numerics.modal_filter import NODES, ModalFilter, ModalResponse, polynomials
from mechanism_sim.numerics.rational import Modes
from mechanism_sim.vibration.frame import Frame
from mechanism_sim.vibration.shaking import Forces, Shaking


class FrameStates(NamedTuple):
    """A frame at N instants; rows x, y and, if it can turn, angle, (n, N)."""

    position: Array  #: [m, rad] of the centre of gravity, from where mounts carry the frame alone
    velocity: Array  #: [m/s, rad/s]
    acceleration: Array  #: [m/s^2, rad/s^2]
    force: Array  #: [N, N m] of the machine on the frame, without impulses
    mount_force: Array  #: [N, N m] of the mounts on the ground, less the frame's own weight


@dataclass(frozen=True)
class FrameMotion:
    """The motion of a frame on a part of a run.

    Attributes
    ----------
    motion : of the machine on its m pieces
    response : position, velocity and acceleration (3 n) of its modes there
    start : (n,) forces at the start of the run
    """

    frame: Frame
    shaking: Shaking
    motion: Motion
    response: ModalResponse
    start: Array

    def __call__(self, t: Array | float) -> FrameStates:
        """The frame at times `t` (N,) [s] within that part; at an impact, what holds after it.

        Raises
        ------
        ValueError
            For a time outside of it.
        """
        frame, n = self.frame, self.frame.freedom
        k, dt = self.motion.curve.find(np.atleast_1d(np.asarray(t, float)))
        force = self.shaking.read(self.motion, k, dt)
        found = self.response(k, dt).T
        position = found[:n] + np.linalg.solve(frame.K, self.start)[:, None]
        velocity = found[n : 2 * n]
        acceleration = found[2 * n :] + (force - self.start[:, None]) / np.diag(frame.M)[:, None]
        on_ground = frame.K @ position + frame.C @ velocity
        return FrameStates(position, velocity, acceleration, force, on_ground)


class ShakenFrame:
    """A frame that follows the motion of a machine, piece by piece.

    It starts at rest where its mounts bear what acts on it then.

    Parameters
    ----------
    frame : with n degrees of freedom
    forces : of the machine on it
    """

    def __init__(self, frame: Frame, forces: Forces) -> None:
        self.frame = frame
        self._shaking = Shaking(frame, forces)
        poles, residues = frame.receptance
        outputs = np.concatenate([residues * poles**d for d in range(3)])
        nothing = np.zeros((3 * frame.freedom, frame.freedom))
        self._modes = ModalFilter(Modes(poles, outputs, nothing))

    def take(self, motion: Motion) -> FrameMotion:
        """Follow a piece of motion, which comes after that of the last call."""
        shaking = self._shaking
        start = shaking.at_start(motion)
        values = shaking.read(motion, np.arange(len(motion)), NODES) - start[:, None]
        impulses = shaking.impulses(motion)
        response = self._modes.advance(motion.curve.duration, polynomials(values), impulses)
        return FrameMotion(self.frame, shaking, motion, response, start)
