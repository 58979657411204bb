"""What can be said of a machine once its motion is known."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.hybrid.system import Array, System
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.planar.inverse_dynamics import Observation


class Physics(Protocol):
    """A machine of any level, seen through its motion."""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all joints."""

    @property
    def clearances(self) -> tuple[str, ...]:
        """Names of the joints with clearance."""

    @property
    def has_forces(self) -> bool:
        """Whether forces and energies are known, or only motion."""

    def observe(
        self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes
    ) -> Observation:
        """The machine at times `dt` after the start of `segments`.

        `segments` (N,) with `dt` (N,) [s] are N instants; with `dt` (N, K) or `Nodes` K in each.
        """

    def open_gaps(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The gaps (m, N) [m] then, infinite where closed; nothing is assumed of forces."""

    def closure_error(
        self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes, observed: Observation
    ) -> float:
        """Largest distance [m] that should be zero: in closed gaps, or where loops close.

        `observed` is what `observe` says of the same instants.
        """


class DynamicPhysics:
    """Equations of motion: accelerations and forces follow from state and mode of contact."""

    has_forces = True

    def __init__(self, system: System) -> None:
        self.system = system
        self.coordinates = system.coordinates
        self.joints = tuple(joint.name for joint in system.mechanism.joints)
        self.clearances = tuple(gap.name for gap in system.gaps)

    def observe(
        self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes
    ) -> Observation:
        """The machine at times `dt` (N,) after the start of `segments` (N,)."""
        curve, driven = motion.curve, self.system.prescribed_index
        q, v = (curve.at(segments, dt, derivative).T for derivative in (0, 1))
        steady = self.system.degree <= 1
        powered = self.system.driven_index[len(driven) :]
        constant, per_angle, per_speed = motion.torques_at(segments, dt).transpose(1, 0, 2)
        return self.system.observe(
            q,
            v,
            np.zeros_like(q[driven]) if steady else curve.at(segments, dt, 2).T[driven],
            motion.modes_at(segments, dt),
            constant + per_angle * q[powered] + per_speed * v[powered],
            motion.approach_at(segments, dt),
        )

    def open_gaps(self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The gaps (m, N) [m] then, infinite where closed."""
        values = self.system.gap_values(motion.curve.at(segments, dt).T)
        gaps = self.system.distances(values)
        return np.where(motion.closed_at(segments, dt), np.inf, gaps)

    def closure_error(
        self, motion: Motion, segments: NDArray[np.intp], dt: Array | Nodes, observed: Observation
    ) -> float:
        """Largest distance from zero [m], of closed gaps and of closures."""
        closed = observed.gap[motion.closed_at(segments, dt)]
        largest = float(np.abs(closed).max(initial=0.0))
        if self.system.relations:
            left = self.system.closures(observed.position)
            largest = max(largest, float(np.abs(left).max(initial=0.0)))
        return largest
