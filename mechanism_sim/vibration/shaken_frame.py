"""A frame on springs, shaken by a machine that it carries.

One way: the machine moves as if the frame were at rest, which is right to the ratio of their
masses times the square of the frequency ratio of the disturbance. The response is exact for forces
that are polynomials on every piece of the motion, and for the impulses between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.physics import Physics, outside, rows
from mechanism_sim.errors import RunError
from mechanism_sim.numerics.modal_filter import NODES, ModalFilter, ModalResponse, polynomials
from mechanism_sim.numerics.polynomials import (
    Nodes,
    PiecewisePolynomial,
    chebyshev_coefficients,
)
from mechanism_sim.numerics.rational import Modes
from mechanism_sim.planar.shaking import ShakingForce
from mechanism_sim.vibration.frame import Frame

_UNRESOLVED = 1e-6
"""Share of the largest force above which higher harmonics of a piece are too large."""
_ROUNDING = 1e-12  # share of the largest rate of a coordinate below which its steps are negligible


class Forces(Protocol):
    """Forces on the ground at instants of a motion; moments about the origin."""

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Force x, y [N] and moment [N m] (3, N) at instants as of ``motion.curve.at``."""

    def impulses(self, motion: Motion, segments: NDArray[np.intp], step: Array) -> Array:
        """Their integrals (3, N) [N s, N m s] over the instants at which segments (N,) begin.

        The rates of the coordinates make a `step` (n, N) there.
        """


class WholeMachine:
    """Force of a whole machine on its ground, impacts included.

    Parameters
    ----------
    force : shaking force from the momentum of its links
    physics : physics of the machine
    """

    def __init__(self, force: ShakingForce, physics: Physics) -> None:
        self._force, self._physics = force, physics
        self._coordinates = physics.coordinates

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Force and moment."""
        q, v, a = (x.T for x in motion.curve.locals(segments, dt, (0, 1, 2)))
        seen = self._physics.observe(motion, segments, dt) if self._force.unknown else None
        return self.along(motion, segments, dt, (q, v, a), seen.load if seen else None)

    def along(
        self,
        motion: Motion,
        segments: NDArray[np.intp],
        dt: Array | Nodes,
        trajectory: tuple[Array, Array, Array],
        sizes: Array | None,
        static: bool = False,
    ) -> Array:
        """Force and moment along coordinates, rates and accelerations (n, N) that are known.

        Parameters
        ----------
        sizes, static : as for `ShakingForce`
        """
        curve, states = motion.curve, motion.state_curve
        known = rows(self._force.edges, self._coordinates, curve, segments, dt, states)
        if known is not None:
            for name, part in self._physics.switch_parts(motion, segments, dt).items():
                if name in self._force.flags:
                    known[self._force.flags[name]] = part
        outer = outside(self._force.outside, self._coordinates, curve, segments, dt, states)
        return self._force(trajectory, outer, known, sizes, static)

    def impulses(self, motion: Motion, segments: NDArray[np.intp], step: Array) -> Array:
        """Impulse and its moment."""
        q = motion.curve.local(segments, np.zeros(len(segments))).T
        return self._force.impulse(q, step)


class VelocitySteps:
    """Steps of the rates of the coordinates, for one listener, in the order of time."""

    def __init__(self) -> None:
        self._before: Array | None = None

    def __call__(self, curve: PiecewisePolynomial) -> Array:
        """Steps (coordinates, m) where the m pieces of a curve begin, which follows the last."""
        every = np.arange(len(curve))
        after = curve.local(every, np.zeros(len(curve)), 1)
        ends = curve.local(every, curve.duration, 1)
        first = after[:1] if self._before is None else self._before
        before = np.concatenate([first, ends[:-1]])
        self._before = ends[-1:]
        step = after - before
        small = _ROUNDING * np.maximum(np.abs(after), np.abs(before)).max(axis=1)
        step[np.abs(step).max(axis=1) <= small] = 0.0
        return np.asarray(step.T)


class Shaking:
    """Forces on a frame, in its coordinates, for one listener.

    Pieces of motion must come in the order of time.

    Parameters
    ----------
    frame : with n degrees of freedom
    forces : forces of the machine on it
    """

    def __init__(self, frame: Frame, forces: Forces) -> None:
        self.inputs = frame.freedom  #: number n of inputs
        self._cog, self._forces = frame.cog, forces
        self._steps = VelocitySteps()
        self._start: Array | None = None

    def at_start(self, motion: Motion) -> Array:
        """Force when the first motion begins (n,): the mounts bear it then."""
        if self._start is None:
            first = np.zeros(1, np.intp)
            self._start = self.read(motion, first, np.zeros(1))[:, 0]
        return self._start

    def read(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """Forces (n, N) [N, N m about the centre of gravity] at instants as of a curve's `at`."""
        return self._about_cog(self._forces.read(motion, segments, dt))

    def impulses(self, motion: Motion) -> Array:
        """Impulses (m, n) [N s, N m s] at the instants at which the m pieces begin.

        Raises
        ------
        RunError
            If loads change so fast that polynomials on these pieces do not follow them.
        """
        self._check(motion)
        return self.steps(motion)

    def steps(self, motion: Motion) -> Array:
        """Impulses (m, n) as those of `impulses`, however fast loads change."""
        step = self._steps(motion.curve)
        found = np.zeros((len(motion), self.inputs))
        sudden = np.flatnonzero(step.any(axis=0))
        if sudden.size:
            impulses = self._forces.impulses(motion, sudden, step[:, sudden])
            found[sudden] = self._about_cog(impulses).T
        return found

    def _check(self, motion: Motion) -> None:
        """Refuse forces that polynomials do not follow, where loads rule no length of pieces."""
        if motion.modes.shape[1]:
            return
        every = np.arange(len(motion))
        values = self.read(motion, every, NODES).reshape(-1, len(motion), len(NODES))
        sizes = np.abs(chebyshev_coefficients(values)).max(axis=1)
        if (sizes[:, -2:].max(axis=1) > _UNRESOLVED * sizes.max()).any():
            raise RunError(
                'the forces on a frame change too fast for the pieces of its motion: loads by '
                'formulas must not be much faster than the machine'
            )

    def _about_cog(self, forces: Array) -> Array:
        x, y, moment = forces
        about = moment - self._cog[0] * y + self._cog[1] * x
        return np.array([x, y, about])[: self.inputs]


class FrameStates(NamedTuple):
    """A frame at N instants; rows x, y and, if it can turn, angle, (n, N)."""

    position: Array  #: displacement [m, rad] of the centre of gravity from rest without machine
    velocity: Array  #: [m/s, rad/s]
    acceleration: Array  #: [m/s^2, rad/s^2]
    force: Array  #: force [N, N m] of the machine on the frame, without impulses
    mount_force: Array  #: force [N, N m] of the mounts on the ground, less the frame's own weight


@dataclass(frozen=True)
class FrameMotion:
    """The motion of a frame on a part of a run."""

    frame: Frame
    shaking: Shaking
    motion: Motion  #: motion of the machine on its m pieces
    response: ModalResponse  #: response of its modes there: position, velocity, acceleration (3 n)
    start: Array  #: (n,) forces at the start of the run

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
        found = self.response(k, dt)
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
    forces : forces of the machine on it
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
