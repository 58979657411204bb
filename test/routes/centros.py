"""Instantaneous centres: the point about which one link turns against another at an instant.

A link that turns at rate w moves its points by u + w k x p, with the velocity u of its point at
the origin. Two links move alike where the differences U of u and W of w give U + W k x p = 0, that
is at p = (-U_y, U_x)/W. Where W is zero one link slides along the other, and the centre lies at
infinity, square to the sliding.

In a mechanism of one degree of freedom the centres do not depend on how fast it moves.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.linkages.mobility import RANK_TOLERANCE
from mechanism_sim.planar.configuration import Constraints
from mechanism_sim.planar.points import GROUND

Array = NDArray[np.float64]

#: rotations slower than this part of the fastest motion count as none
TOLERANCE = 1e-12


class Centre(NamedTuple):
    """Homogeneous coordinates of a centre, of length one; all NaN for links that move as one."""

    x: float
    y: float
    w: float  #: zero for a centre at infinity, in the direction (x, y)

    @property
    def point(self) -> tuple[float, float]:
        """Position [m]; infinite or NaN if it is not in the plane."""
        return (self.x / self.w, self.y / self.w) if self.w else (float('inf'), float('inf'))


def velocities(constraints: Constraints, poses: Array) -> Array:
    """Velocities (n, 3) [m/s, m/s, rad/s] of the links of a mechanism that can move in one way.

    The largest part is 1 rad/s, or the longest link a second.

    Raises
    ------
    ValueError
        If it can move in none or in several ways at these poses (n, 3).
    """
    _, values, right = np.linalg.svd(constraints.normalise(poses)[1])
    ways = right.shape[0] - int(np.sum(values > RANK_TOLERANCE * values[0]))
    if ways != 1:
        raise ValueError(f'centres need one way to move, but here there are {ways}')
    motion = right[-1] / right[-1][np.abs(right[-1]).argmax()]
    return np.asarray(motion.reshape(poses.shape) * constraints.scale)


def centre(first: tuple[Array, Array], second: tuple[Array, Array], size: float = 1.0) -> Centre:
    """Instantaneous centre of two links.

    Parameters
    ----------
    first, second : pose (3,) [m, m, rad] and velocity (3,) [m/s, m/s, rad/s] of each
    size : length [m] of the links: it tells a rotation from a sliding
    """
    twists = [
        np.array([v[0] + v[2] * pose[1], v[1] - v[2] * pose[0], v[2]])
        for pose, v in (first, second)
    ]
    x, y, w = twists[1] - twists[0]
    fastest = max(np.hypot(t[0], t[1]) + size * abs(t[2]) for t in twists)
    if np.hypot(x, y) + size * abs(w) <= TOLERANCE * fastest:
        return Centre(np.nan, np.nan, np.nan)
    if size * abs(w) <= TOLERANCE * fastest:
        w = 0.0
    length = np.sqrt(x * x + y * y + w * w)
    return Centre(float(-y / length), float(x / length), float(w / length))


def centres(
    constraints: Constraints, poses: Array, speeds: Array | None = None
) -> dict[tuple[str, str], Centre]:
    """Instantaneous centres of all pairs of links, the ground among them: n (n - 1)/2 of n links.

    Parameters
    ----------
    poses : (n, 3) x, y [m], angle [rad] of the moving links
    speeds : (n, 3) their velocities; by default those of the one way in which they can move

    Raises
    ------
    ValueError
        Without velocities, if the mechanism can move in none or in several ways.
    """
    if speeds is None:
        speeds = velocities(constraints, poses)
    moving = dict(zip(constraints.links, zip(poses, speeds, strict=True), strict=True))
    links = {GROUND: (np.zeros(3), np.zeros(3)), **moving}
    return {
        (a, b): centre(links[a], links[b], constraints.size) for a, b in combinations(links, 2)
    }


def velocity_ratio(found: dict[tuple[str, str], Centre], of: str, to: str) -> float:
    """Rate of one link over that of another, from centres alone.

    Both links move the point of their common centre alike, each about its centre on the ground, so
    the rates are inversely as the distances of these from the common centre. Zero where the one
    does not turn, infinite where the other does not; NaN where all three centres coincide.
    """
    common = found[(of, to) if (of, to) in found else (to, of)]
    one, other = found[GROUND, of], found[GROUND, to]
    # homogeneous, so that points at infinity need no cases
    near = other.w * (np.array(common[:2]) * one.w - np.array(one[:2]) * common.w)
    far = one.w * (np.array(common[:2]) * other.w - np.array(other[:2]) * common.w)
    along = near if near @ near > far @ far else far
    with np.errstate(divide='ignore', invalid='ignore'):
        return float(np.divide(far @ along, near @ along))
