"""Degrees of freedom of a mechanism: by Kutzbach's count, instantaneous and finite.

Kutzbach's criterion ([V] 1.1) counts links and joints and knows nothing of dimensions. The rank of
the constraints at a configuration does; but it tells only what can begin to move. Whether that
goes on is tried: a little along every such motion, and back to where the joints fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.configuration import Constraints

#: singular values of the constraints below this part of the largest count as zero
RANK_TOLERANCE = 1e-8

PART = 1e-6  # a row's part in a dependency is either of order one or rounding

_AWAY = 0.05  # how far a motion is followed: in radians, or in lengths of the longest link
_NEAR = 1e-3  # how far its neighbours are looked for
_SPREAD = 0.1  # what part of that distance tells a direction from curvature
_FITS = 1e-13  # what the joints may leave where they fit, in lengths of the longest link
_STEPS = 30


class Mobility(NamedTuple):
    """Degrees of freedom of a mechanism at a configuration."""

    kutzbach: int  #: 3 (n - 1) - 2 j1 - j2
    instantaneous: int  #: motions that are possible to first order: 3 (n - 1) - rank
    finite: int  #: motions that go on: dimension of the configurations nearby
    redundant: tuple[str, ...]  #: joints whose constraints here follow from one another
    extra: tuple[str, ...] = ()
    """Of these, those that hold less than their kind does where all earlier ones hold already."""

    @property
    def redundancy(self) -> int:
        """Number of redundant constraints at the configuration."""
        return self.instantaneous - self.kutzbach

    @property
    def repeating(self) -> tuple[str, ...]:
        """Joints whose constraints are redundant wherever the mechanism moves."""
        return self.extra if self.redundancy and self.instantaneous == self.finite else ()


def kutzbach(links: int, lower_pairs: int, higher_pairs: int = 0) -> int:
    """Kutzbach's criterion, [V] 1.1.

    Parameters
    ----------
    links : n, with the frame
    lower_pairs : j1, joints that leave one relative freedom: revolute and prismatic ones, and
        contacts that only slide. A pin that joins k links counts k - 1 times.
    higher_pairs : j2, joints that leave two: pins in slots, contacts that slide and roll
    """
    return 3 * (links - 1) - 2 * lower_pairs - higher_pairs


def mobility(constraints: Constraints, poses: Array) -> Mobility:
    """Mobility of an assembled mechanism by Kutzbach's criterion, and its true one.

    Parameters
    ----------
    poses : (n, 3) x, y [m], angle [rad] of the moving links

    Raises
    ------
    ValueError
        If the joints do not fit at these poses, to 1e-9 of the longest link.
    """
    residual, jacobian = constraints.normalise(poses)
    if not np.all(np.abs(residual) <= 1e-9):
        worst = constraints.rows[int(np.abs(residual).argmax())]
        raise ValueError(f'the mechanism is not assembled: the links of {worst} do not meet')
    counted = sum(j.equations for j in constraints.joints)  # a weld counts as one of each
    lower = sum(j.equations > 1 for j in constraints.joints)
    higher = counted - 2 * lower
    free, dependent = _null_spaces(jacobian)
    parts = np.abs(dependent).max(axis=1, initial=0.0) > PART
    return Mobility(
        kutzbach(len(constraints.links) + 1, lower, higher),
        free.shape[1],
        _finite(constraints, poses, free, dependent),
        tuple(dict.fromkeys(np.array(constraints.rows, dtype=object)[parts])),
        _extra(constraints.rows, jacobian) if dependent.shape[1] else (),
    )


def _extra(rows: Sequence[str], jacobian: Array) -> tuple[str, ...]:
    """Joints whose rows do not all add to the rank of those before them."""
    names, rank, found = np.array(rows, dtype=object), 0, []
    for name in dict.fromkeys(rows):
        upto = int(np.flatnonzero(names == name)[-1]) + 1
        values = np.linalg.svd(jacobian[:upto], compute_uv=False)
        new = int(np.sum(values > RANK_TOLERANCE * values[0]))
        if new - rank < int((names == name).sum()):
            found.append(str(name))
        rank = new
    return tuple(found)


def _null_spaces(jacobian: Array) -> tuple[Array, Array]:
    """Orthonormal bases, as columns, of the motions J v = 0 and the dependencies J^T y = 0."""
    rows, columns = jacobian.shape
    if not rows or not columns:
        return np.eye(columns), np.eye(rows)
    left, values, right = np.linalg.svd(jacobian)
    rank = int(np.sum(values > RANK_TOLERANCE * values[0]))
    return right[rank:].T, left[:, rank:]


def _finite(constraints: Constraints, start: Array, free: Array, dependent: Array) -> int:
    """Dimension of the set of assembled configurations around `start`.

    Where the rows are independent it is the number of motions (implicit function theorem).
    Elsewhere branches may meet, so each that can be found is judged a little away from there.
    """
    count = int(free.shape[1])
    if not dependent.shape[1] or not count:
        return count
    random = np.random.default_rng(0).standard_normal((count, 2 * count + 4))
    directions = free @ random / np.linalg.norm(random, axis=0)
    reached = _reached(constraints, start, directions, _AWAY)
    return max((_dimension(constraints, poses) for poses, _ in reached), default=0)


def _dimension(constraints: Constraints, poses: Array) -> int:
    """Dimension of the assembled configurations around one where no branches meet."""
    free, dependent = _null_spaces(constraints.normalise(poses)[1])
    if not dependent.shape[1]:
        return int(free.shape[1])
    moves = np.array([moved for _, moved in _reached(constraints, poses, free, _NEAR)])
    return int(np.linalg.matrix_rank(moves, tol=_SPREAD * _NEAR)) if moves.size else 0


def _reached(
    constraints: Constraints, start: Array, directions: Array, distance: float
) -> Iterator[tuple[Array, Array]]:
    """Assembled configurations at a distance, each nearest to a column or what is opposite.

    With each comes its displacement from `start`, normalised. They are looked for on a sphere, by
    Gauss and Newton's method: from anywhere else it would fall back to a start where many motions
    begin and few go on.
    """
    for direction in np.concatenate([directions, -directions], axis=1).T:
        moved = distance * direction
        for _ in range(_STEPS):
            poses = start + moved.reshape(start.shape) * constraints.scale
            residual, jacobian = constraints.normalise(poses)
            too_far = (moved @ moved - distance**2) / (2.0 * distance)
            if max(np.abs(residual).max(), abs(too_far)) < _FITS:
                yield poses, moved
                break
            rows, left = np.vstack([jacobian, moved / distance]), np.append(residual, too_far)
            moved = moved - np.linalg.lstsq(rows, left, rcond=1e-10)[0]
