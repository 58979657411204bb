"""Forces of a motion beside singular positions: their limits along its branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.planar.branch import SAMPLES, Branch, limits, roots
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.kinematics import Kinematics

Array = NDArray[np.float64]

_SHORTER = 4  # halvings of the time in which forces are compared beside a singular position


@dataclass(frozen=True)
class Passage:
    """Where a motion is near a singular position, and its branch there.

    Attributes
    ----------
    index : (K,) of the instants
    branch : (K,) through their positions
    pace, bend : (K,) rate and acceleration of the branch's parameter
    """

    kinematics: Kinematics
    index: NDArray[np.intp]
    branch: Branch
    pace: Array
    bend: Array

    def __getitem__(self, chosen: NDArray[np.intp]) -> Passage:
        return replace(
            self, index=self.index[chosen], branch=self.branch[chosen],
            pace=self.pace[chosen], bend=self.bend[chosen],
        )  # fmt: skip

    @property
    def duration(self) -> Array:
        """Time (K,) [s] to either side in which the branch is known; infinite at rest."""
        width = self.branch.width
        with np.errstate(divide='ignore'):
            root = np.sqrt(self.pace**2 + 2.0 * np.abs(self.bend) * width)
            return np.asarray(2.0 * width / (np.abs(self.pace) + root))

    @property
    def root(self) -> Array:
        """By how much the parameter differs (K,) from that of the singular position."""
        q, _, _ = self.branch.at(self.branch.width[:, None] * SAMPLES)
        determinant = self.kinematics.determinant(q.reshape(len(q), -1))
        return self.branch.width * roots(determinant.reshape(-1, len(SAMPLES)))

    def states(self, times: Array, driven: Array) -> tuple[Array, Array, Array]:
        """Coordinates, rates and accelerations (n, K S) at S times beside each instant.

        Parameters
        ----------
        times : (K, S) [s] from the instants on
        driven : (3, p, K, S) the driven coordinates then, their rates and accelerations
        """
        shift, pace, bend = times, np.ones_like(times), np.zeros_like(times)
        held = self.kinematics.held
        if len(held) == 1:
            first = self.branch.at(np.zeros_like(times[:, :1]))[0][held[0]]
            shift, pace, bend = driven[0, 0] - first, driven[1, 0], driven[2, 0]
        q, slope, curvature = self.branch.at(shift)
        found = q, slope * pace, curvature * pace**2 + slope * bend
        return tuple(x.reshape(len(x), -1) for x in found)


Sampled = Callable[[Passage, PiecewisePolynomial, NDArray[np.intp], Array, Array], Observation]


def with_limits(
    seen: Observation,
    sampled: Sampled,
    curve: PiecewisePolynomial,
    segments: NDArray[np.intp],
    dt: Array,
    passage: Passage,
) -> Observation:
    """An observation with the limits of forces, along their branches, near singular positions.

    Forces without a limit are NaN.

    Parameters
    ----------
    sampled : the machine at times beside the instants of a passage
    segments, dt : (K,) of these instants
    """
    found = np.full((len(_stacked(seen)), len(dt)), np.inf)
    left, share = np.flatnonzero(np.isfinite(passage.duration)), 1.0
    for _ in range(_SHORTER):
        if not left.size:
            break
        part = passage[left]
        beside = (share * part.duration)[:, None] * SAMPLES
        around = sampled(part, curve, segments[left], dt[left], beside)
        independence = part.kinematics.independence(around.position).reshape(beside.shape)
        determinant = part.kinematics.determinant(around.position).reshape(beside.shape)
        values = _stacked(around).reshape(-1, *beside.shape)
        found[:, left] = limits(values, determinant, independence)
        left = left[np.isinf(found[:, left]).any(axis=0)]
        share *= 0.5
    found[np.isinf(found)] = np.nan
    joints = len(seen.reaction)
    force, moment, torque = np.split(found, [2 * joints, 3 * joints])
    seen.reaction[:, :, passage.index] = force.reshape(joints, 2, -1)
    seen.reaction_moment[:, passage.index] = moment
    seen.drive_torque[:, passage.index] = torque
    power = (seen.drive_torque * seen.velocity[passage.kinematics.held]).sum(axis=0)
    return seen._replace(drive_power=power)


def _stacked(seen: Observation) -> Array:
    """Forces, moments and torques in rows."""
    rows = seen.reaction.reshape(-1, seen.reaction.shape[-1])
    return np.concatenate([rows, seen.reaction_moment, seen.drive_torque])
