"""Starts at singular positions: possible motions, and the choice of a branch."""

from __future__ import annotations

import math

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.planar import branch
from mechanism_sim.planar.branch import Branch
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.plan import ScenePlan

_AWAY = 0.05  # [rad, or lengths of the mechanism] where the motion is no longer singular
_NEIGHBOURS = 8
_ALIKE = 1e-6


def neighbours(kinematics: Kinematics, q: Array) -> Array:
    """Configurations (n, N) near one of (n,), with displaced driven coordinates.

    The rank of the constraints there is that of the motion, which may be higher than in a
    singular position.
    """
    random = np.random.default_rng(2).standard_normal((len(q), _NEIGHBOURS))
    random[kinematics.held] = np.sign(random[kinematics.held])
    near = q[:, None] + _AWAY * kinematics.scale[:, None] * random
    found, left = kinematics.positions(near)
    far = np.abs((found - q[:, None]) / kinematics.scale[:, None]).max(axis=0)
    return np.asarray(found[:, (left == 0.0) & (far < 1.0)])


def begin(
    plan: ScenePlan,
    kinematics: Kinematics,
    q: Array,
    guess: Array,
    drive: Array,
    pace: float,
) -> tuple[Array, Array]:
    """Branch on which a driven mechanism leaves a singular position: q and dq/du there.

    Of the branches that meet there, the one nearest to the guess; if the guess does
    not decide, one on which no joint is at rest; then that with the least change of rates.

    Parameters
    ----------
    q, guess : (n,)
    drive : (3, p) driven coordinates, rates, accelerations; of p = 1 by themselves, else by time
    pace : rate of that parameter
    """
    found = branch.beginnings(kinematics, q, drive)
    names = kinematics.coordinates
    driven = ', '.join(names[i] for i in kinematics.held)
    count = len(found.width)
    if not count:
        raise InputError(
            f'the start is a singular position from which {driven} cannot move on; start beside '
            "it, or give another 'guess'"
        )
    # positions (B, n, K) reached by the branches, in the drive's direction
    shift = np.linspace(0.0, math.copysign(1.0, pace), 64) * found.width[:, None]
    ahead = found.at(shift)[0].transpose(1, 0, 2)
    offs = (ahead - guess[None, :, None]) / kinematics.scale[:, None]
    distance = np.linalg.norm(offs[:, kinematics.sought], axis=1).min(axis=1)
    idle, bend = _idle(plan.ideal, found), _bend(found, kinematics.scale)
    left = np.arange(count)
    for measure in (distance, idle, bend):
        left = left[measure[left] <= measure[left].min() + _ALIKE]
    if len(left) > 1:
        slopes = found.at(np.zeros((count, 1)))[1][:, left, 0]
        differ = names[int(np.argmax(np.ptp(slopes / kinematics.scale[:, None], axis=1)))]
        raise InputError(
            f'the start is a singular position from which {len(left)} motions are equally '
            f"possible; give in 'guess' where {differ} goes, slightly further on, or start "
            'beside it'
        )
    chosen = found[left]
    place, slope, _ = (x[:, 0, 0] for x in chosen.at(np.zeros((1, 1))))
    return place, slope


def _idle(mechanism: Mechanism, found: Branch) -> Array:
    """Numbers of joints (B,) that do not move on each branch."""
    slopes = found.at(np.linspace(-1.0, 1.0, 5) * found.width[:, None])[1]
    rate = dict(zip(mechanism.coordinates, slopes, strict=True)) | {GROUND: 0.0 * slopes[0]}
    moves = [
        rate[mechanism.frame(j.first)[0]] - rate[mechanism.frame(j.second)[0]]
        for j in mechanism.joints
        if isinstance(j, Revolute)
    ]
    moves += [rate[c] / mechanism.size for c in mechanism.displacements]
    still = np.abs(np.array(moves)).max(axis=2) < _ALIKE
    return np.asarray(still.sum(axis=0), dtype=float)


def _bend(found: Branch, scale: Array) -> Array:
    """Largest deviations (B,) of the branches from their tangents, in scaled coordinates."""
    shift = np.linspace(-1.0, 1.0, 9) * 0.3 * found.width.min()
    place, _, _ = found.at(np.repeat(shift[None], len(found.width), axis=0))
    middle, slope, _ = found.at(np.zeros((len(found.width), 1)))
    return np.asarray(
        (np.abs(place - middle - slope * shift) / scale[:, None, None]).max(axis=(0, 2))
    )
