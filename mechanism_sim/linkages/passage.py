"""Forces of a motion beside singular positions: their limits along its branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.planar.branch import SAMPLES, Branch, crossing, determinants, limits
from mechanism_sim.planar.inverse_dynamics import Observation, power
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.tolerances import TOLERANCES

_BRANCHES = TOLERANCES.branches

_SHORTER = 4  # halvings of the time in which forces are compared beside a singular position


@dataclass(frozen=True)
class Passage:
    """Where a motion is near a singular position, and its branch there.

    Attributes
    ----------
    index : (K,) of the instants
    branch : (K,) through their positions, as far as it is known
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
    def independence(self) -> Array:
        """Of the constraints at the instants (K,)."""
        return self.kinematics.independence(self.branch.middle)

    @property
    def duration(self) -> Array:
        """Time (K,) [s] to either side in which the branch is known."""
        return self.branch.width / np.maximum(np.abs(self.pace), 1e-300)

    @property
    def root(self) -> Array:
        """By how much the parameter differs (K,) from that of the singular position."""
        return crossing(self.kinematics, self.branch)

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
        v, a = slope * pace, curvature * pace**2 + slope * bend
        n = len(q)
        return q.reshape(n, -1), v.reshape(n, -1), a.reshape(n, -1)


def with_limits(
    seen: Observation,
    sampled: Callable[[Passage, NDArray[np.intp], float], Observation] | None,
    required: Array,
    passage: Passage,
) -> Observation:
    """An observation with the limits of forces, along their branches, near singular positions.

    Forces without a limit are NaN, and so are those where no branch is known.

    Parameters
    ----------
    sampled : the machine at `SAMPLES` beside some (M,) of the instants, in a share of the width;
        without it only the torque of a single drive is exact
    required : (n, K) generalised forces that closures and drives supply together
    """
    count = len(passage.index)
    found = np.full((len(_stacked(seen)), count), np.inf)
    left, share = np.flatnonzero(passage.branch.found), 1.0
    for _ in range(_SHORTER):
        if sampled is None or not left.size:
            break
        around = sampled(passage[left], left, share)
        shape = len(left), len(SAMPLES)
        independence = passage.kinematics.independence(around.position).reshape(shape)
        determinant = determinants(passage.kinematics, around.position)
        found[:, left] = limits(_stacked(around).reshape(-1, *shape), determinant, independence)
        left = left[np.isinf(found[:, left]).any(axis=0)]
        share *= 0.5
    # where nothing smooth is found a solve must do, but not at the position itself
    beside = passage.branch.found & (passage.independence > _BRANCHES.singular)
    solved = np.where(beside, _stacked(seen)[:, passage.index], np.nan)
    found = np.where(np.isinf(found), solved, found)
    joints, held = len(seen.reaction), passage.kinematics.held
    force, moment, torque, load = np.split(found, [2 * joints, 3 * joints, 3 * joints + len(held)])
    if len(held) == 1 and not len(load):  # closures do no work along the branch
        _, slope, _ = passage.branch.at(np.zeros((count, 1)))
        torque = (slope[:, :, 0] * required).sum(axis=0)[None]
        torque[:, ~passage.branch.found] = np.nan
    seen.reaction[:, :, passage.index] = force.reshape(joints, 2, -1)
    seen.reaction_moment[:, passage.index] = moment
    seen.drive_torque[:, passage.index] = torque
    seen.load[:, passage.index] = load
    return seen._replace(drive_power=power(seen.drive_torque, seen.velocity[held]))


def _stacked(seen: Observation) -> Array:
    """Forces, moments, torques and unknown loads in rows."""
    rows = seen.reaction.reshape(-1, seen.reaction.shape[-1])
    return np.concatenate([rows, seen.reaction_moment, seen.drive_torque, seen.load])
