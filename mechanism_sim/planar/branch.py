"""A motion through positions where its constraints are singular: change points, for example.

There the Jacobian of the sought coordinates loses rank, two branches of the motion meet, and the
constraints determine neither rates nor forces; a little beside, rounding spoils them (by eps/s^2
and eps/s^3 at a distance s). But each branch is an analytic curve. It is sampled on both sides,
where it is well determined, and a polynomial through these samples is the branch in between.

The curve has a parameter u: the coordinate of the drive, or time where there are several drives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from mechanism_sim.arrays import Array, IndexArray, Mask
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.tolerances import TOLERANCES

_BRANCHES = TOLERANCES.branches
_ROUNDING = TOLERANCES.rounding


_PAIRS = 12
_DEGREE = 13

# positive Chebyshev points of an even number of them: none in the middle
_POINTS = np.sin((2.0 * np.arange(1, _PAIRS + 1) - 1.0) * np.pi / (4.0 * _PAIRS))
_BOTH = np.concatenate([-_POINTS[::-1], _POINTS])
SAMPLES = _BOTH
"""Positions along a branch at which functions are sampled, as shares of its width."""
_BASIS = chebyshev.chebvander(_BOTH, _DEGREE)
_SLOPE = np.zeros((_DEGREE + 1, _DEGREE + 1))
for _k in range(1, _DEGREE + 1):
    _SLOPE[:_k, _k] = chebyshev.chebder(np.eye(_DEGREE + 1)[_k])[:_k]


@dataclass(frozen=True)
class Branch:
    """Curves of n coordinates through N positions, as Chebyshev polynomials in their parameter."""

    found: Mask  #: (N,) mask of positions with a branch; other entries are meaningless
    width: Array  #: (N,) largest deviation of the parameter from that of the position [rad, m, s]
    coefficients: Array  #: (N, n, d + 1)

    def at(self, shift: Array) -> tuple[Array, Array, Array]:
        """Coordinates, and their first and second derivatives by the parameter, each (n, N, K).

        Parameters
        ----------
        shift : (N, K) change of the parameter from that of the positions
        """
        values = []
        basis, coefficients = chebyshev.chebvander(shift / self.width[:, None], _DEGREE), self
        c = coefficients.coefficients
        for order in range(3):
            values.append(np.einsum('tcm,tkm->ctk', c, basis) / self.width[:, None] ** order)
            c = c @ _SLOPE.T
        return values[0], values[1], values[2]

    @property
    def middle(self) -> Array:
        """The positions (n, N) themselves."""
        return self.at(np.zeros((len(self.width), 1)))[0][:, :, 0]

    def __getitem__(self, chosen: Mask | IndexArray) -> Branch:
        return Branch(self.found[chosen], self.width[chosen], self.coefficients[chosen])


def follow(
    kinematics: Kinematics, q: Array, slope: Array, drive: Array, reach: Array | None = None
) -> Branch:
    """The branches through positions in given directions, where they pass a singular one.

    Parameters
    ----------
    q : (n, N) positions on the branches
    slope : (n, N) dq/du there, accurate enough to distinguish branches
    drive : (3, p, N) held coordinates and their first and second derivatives by u
    reach : (N,) range of u over which the branch is needed
    """
    count = q.shape[1]
    scale = kinematics.scale
    # [rad/u], so that widths are angles or lengths of the mechanism
    pace = (np.abs(drive[1]) / scale[kinematics.held, None]).max(axis=0)
    pace = np.maximum(pace, 1e-300)
    least = np.zeros(count) if reach is None else _BRANCHES.behind * reach * pace
    width = np.maximum(_BRANCHES.width, least) / pace
    found = Branch(np.zeros(count, bool), width, np.zeros((count, len(q), _DEGREE + 1)))
    left = np.flatnonzero(np.isfinite(slope).all(axis=0) & (pace > 1e-200))
    left = left[~_stays(kinematics, q[:, left], slope[:, left] * width[left])]
    for _ in range(_BRANCHES.halvings):
        if not left.size:
            break
        fitted, good = _fitted(
            kinematics, q[:, left], slope[:, left], drive[:, :, left], width[left], pace[left]
        )
        done = left[good]
        found.found[done], found.coefficients[done] = True, fitted[good]
        left = left[~good & (0.5 * width[left] * pace[left] >= least[left])]
        width[left] *= 0.5
    sure = np.flatnonzero(found.found)
    if sure.size:
        found.found[sure] = np.isfinite(crossing(kinematics, found[sure]))
    return found


def _stays(kinematics: Kinematics, q: Array, shift: Array) -> Mask:
    """Mask (N,) of positions whose constraints are as independent one width before and after.

    As of a linkage that turns as one. Then no sample is better determined than the position
    itself, and none beyond is singular.
    """
    here = kinematics.independence(q)
    beside = np.array([kinematics.independence(q + x) for x in (-shift, shift)])
    return np.asarray(((0.5 * here < beside) & (beside < 2.0 * here)).all(axis=0))


def crossing(kinematics: Kinematics, branch: Branch) -> Array:
    """Offset of the parameter to the nearest singular position (N,); infinite: none.

    There the determinant of the constraints changes sign.
    """
    q, _, _ = branch.at(branch.width[:, None] * SAMPLES)
    return branch.width * roots(determinants(kinematics, q.reshape(len(q), -1)))


def determinants(kinematics: Kinematics, q: Array) -> Array:
    """Determinants of the constraints (N, K) in K `SAMPLES` beside N positions, of q (n, N K).

    Redundant rows are combined by the left singular vectors of their most independent sample.
    """
    A = kinematics.directions(q)
    A = A.reshape(-1, len(SAMPLES), *A.shape[1:])
    if A.shape[2] > A.shape[3]:
        best = np.linalg.svd(A, compute_uv=False).min(axis=2).argmax(axis=1)
        left, _, _ = np.linalg.svd(A[np.arange(len(A)), best], full_matrices=False)
        A = left.transpose(0, 2, 1)[:, None] @ A
    return np.asarray(np.linalg.det(A))


def _fitted(
    kinematics: Kinematics, q: Array, slope: Array, drive: Array, width: Array, pace: Array
) -> tuple[Array, Mask]:
    """Coefficients (N, n, d + 1) of the branches on intervals of given widths, and their validity.

    Samples are taken in pairs from the middle outwards. What a pair is off the tangent is first
    guessed from the pair before: its even part grows as the square, its odd part as the cube.
    """
    n, count = q.shape
    sought, scale = kinematics.sought, kinematics.scale
    samples = np.zeros((n, count, 2 * _PAIRS))
    trust = np.zeros((count, 2 * _PAIRS))
    even, odd = np.zeros((n, count)), np.zeros((n, count))
    least = _BRANCHES.trusted * width * pace
    for k, x in enumerate(_POINTS):
        if k:
            ratio = x / _POINTS[k - 1]
            even, odd = even * ratio**2, odd * ratio**3
        u = np.concatenate([-x * width, x * width])
        sign = np.repeat([-1.0, 1.0], count)
        place = np.tile(q + even, 2) + np.tile(slope, 2) * u + sign * np.tile(odd, 2)
        place[kinematics.held] = np.tile(drive[0], 2) + u * (
            np.tile(drive[1], 2) + 0.5 * u * np.tile(drive[2], 2)
        )
        independence = kinematics.independence(place)
        sure = independence > np.tile(least, 2)
        if sure.any():
            closed, open_by = kinematics.positions(place[:, sure])
            place[:, sure] = closed
            sure[sure] = open_by == 0.0
        before, after = place[:, :count], place[:, count:]
        both = sure[:count] & sure[count:]
        even = np.where(both, 0.5 * (before + after) - q, even)
        odd = np.where(both, 0.5 * (after - before) - slope * x * width, odd)
        samples[:, :, _PAIRS - 1 - k], samples[:, :, _PAIRS + k] = before, after
        weight = np.where(sure, independence, 0.0)
        trust[:, _PAIRS - 1 - k], trust[:, _PAIRS + k] = weight[:count], weight[count:]
        hopeful = (trust > 0.0).sum(axis=1) + 2 * (_PAIRS - 1 - k) > _DEGREE + 2
        if not hopeful.any():
            break
    good = (trust > 0.0).sum(axis=1) > _DEGREE + 2
    best = np.maximum(trust.max(axis=1), 1e-300)
    trust /= best[:, None]
    # too few samples make no polynomial
    weighted = np.where(good[:, None], trust, 1.0)[:, :, None] * _BASIS
    values = samples.transpose(1, 2, 0) - q.T[:, None]
    solved = _inverse(weighted) @ (trust[:, :, None] * values)
    misfit = trust * np.abs((_BASIS @ solved - values)[:, :, sought] / scale[sought]).max(axis=2)
    rounding = _ROUNDING.sum * (1.0 + np.abs(q / scale[:, None]).max(axis=0))
    good &= misfit.max(axis=1) <= rounding / best
    bend = 0.25 * drive[2] * width**2
    held = [drive[0] + bend - q[kinematics.held], drive[1] * width, bend]
    solved[:, :, kinematics.held] = 0.0
    solved[:, :3, kinematics.held] = np.array(held).transpose(2, 0, 1)
    solved[:, 0] += q.T
    centre = np.einsum('m,tmc->ct', chebyshev.chebvander(0.0, _DEGREE)[0], solved)
    good &= kinematics.open_beyond_rounding(centre, _BRANCHES.open) == 0.0
    return solved.transpose(0, 2, 1), good


def limits(values: Array, determinant: Array, independence: Array) -> Array:
    """Limits of M functions of time in the middle of N intervals, along a branch.

    Each is the quotient of analytic functions over the determinant of what it was solved from. It
    is a polynomial where that vanishes, if the quotient has a limit there; or the quotient of two.

    Parameters
    ----------
    values : (M, N, K) at the K `SAMPLES` of the intervals
    determinant : (N, K) determinant of the matrix from which they follow
    independence : (N, K) of the constraints: distance of samples from the singular position

    Returns
    -------
    (M, N): NaN where a function grows beyond all bounds at the very middle; infinite where the
    functions are no such quotients, and shorter intervals should be tried.
    """
    trust = independence / independence.max(axis=1, keepdims=True)
    trust = np.where(trust > _BRANCHES.far, trust, 0.0) ** 2
    enough = (trust > 0.0).sum(axis=1) > _DEGREE + 2
    trust[~enough] = 1.0
    weighted = trust[:, :, None] * _BASIS
    inverse = _inverse(weighted)

    def fit(x: Array) -> tuple[Array, Mask]:
        """Coefficients (M, N, d + 1), and whether (M, N) they reproduce the samples."""
        y = np.where(trust > 0.0, trust * x, 0.0)
        c = np.einsum('ndk,mnk->mnd', inverse, y)
        size = np.abs(y).max(axis=2)
        size = np.maximum(size, _BRANCHES.beside * size.max(axis=0))
        off = np.abs(np.einsum('nkd,mnd->mnk', weighted, c) - y).max(axis=2)
        return c, np.asarray(off <= _BRANCHES.misfit * size)

    middle = chebyshev.chebvander(0.0, _DEGREE)[0]
    plain, smooth = fit(values)
    unit = determinant / np.abs(determinant).max(axis=1, keepdims=True)
    below, even = fit(unit[None])
    above, quotient = fit(values * unit)
    root = roots(determinant)
    with np.errstate(divide='ignore', invalid='ignore'):
        ratio = np.where(np.abs(root) > _BRANCHES.at, (above @ middle) / (below @ middle), np.nan)
    ratio = np.where(quotient & even, ratio, np.inf)
    found = np.where(smooth, plain @ middle, ratio)
    return np.asarray(np.where(enough, found, np.inf))


def roots(values: Array) -> Array:
    """Zeros (N,) of functions (N, K), given at `SAMPLES`, nearest to the middle in its width.

    Infinite (N,) if they do not.
    """
    fits = np.linalg.pinv(_BASIS) @ values.T
    slopes = _SLOPE @ fits
    x = np.zeros(len(values))
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        for _ in range(_BRANCHES.newton):
            basis = chebyshev.chebvander(x, _DEGREE).T
            step = (fits * basis).sum(axis=0) / (slopes * basis).sum(axis=0)
            x = np.clip(x - step, -1.5, 1.5)
    return np.asarray(np.where((np.abs(step) < _BRANCHES.at) & (np.abs(x) <= 1.0), x, np.inf))


def _inverse(basis: Array) -> Array:
    """Matrix (N, d + 1, K) from samples (N, K) to the coefficients nearest to them."""
    q, r = np.linalg.qr(basis)
    return np.linalg.solve(r, q.transpose(0, 2, 1))


def beginnings(kinematics: Kinematics, q: Array, drive: Array) -> Branch:
    """All branches, as many as are found, that meet in one singular position.

    Positions a little before and after are looked for in all directions in which the constraints
    let the mechanism go, and count if an analytic curve leads from there through the position.

    Parameters
    ----------
    q : (n,) approximate singular position
    drive : (3, p) as in `follow`
    """
    scale, sought, held = kinematics.scale, kinematics.sought, kinematics.held
    J = kinematics.closure(q[:, None])[1][0] * scale
    pace = float((np.abs(drive[1]) / scale[held]).max())
    right = -J[:, held] @ (drive[1] / scale[held] / pace)
    free = np.linalg.svd(J[:, sought])[2].T
    values = np.linalg.svd(J[:, sought], compute_uv=False)
    rank = int((values > _BRANCHES.loose * values.max(initial=0.0)).sum())
    plain = np.linalg.pinv(J[:, sought], rcond=_BRANCHES.loose) @ right
    random = np.random.default_rng(1).standard_normal((len(sought) - rank, _BRANCHES.tries))
    spread = free[:, rank:] @ (random * np.geomspace(0.2, 5.0, _BRANCHES.tries))
    slopes = []
    for side in (1.0, -1.0):
        place = np.repeat(q[:, None], _BRANCHES.tries, axis=1)
        place[held] += side * _BRANCHES.step * (drive[1] / pace)[:, None]
        off = side * _BRANCHES.step * (plain[:, None] + spread) * scale[sought, None]
        place[sought] += off
        place, left = kinematics.positions(place)
        slope = side * (place - q[:, None]) / scale[:, None] / _BRANCHES.step
        near = (left == 0.0) & (np.abs(slope).max(axis=0) < _BRANCHES.steepest)
        slopes.append(slope[:, near])
    rough = np.concatenate(slopes, axis=1).T
    kept: list[Array] = []
    for slope in rough:
        if all(np.abs(slope - other).max() > 0.5 * _BRANCHES.step for other in kept):
            kept.append(slope)
    count = len(kept)
    tangents = np.array(kept).reshape(count, len(q)).T * scale[:, None] * pace
    each = np.repeat(q[:, None], count, axis=1)
    found = follow(kinematics, each, tangents, np.repeat(drive[:, :, None], count, axis=2))
    found = found[found.found]
    _, tangents, _ = found.at(np.zeros((len(found.found), 1)))
    different: list[int] = []
    for k, tangent in enumerate(tangents[:, :, 0].T / scale / pace):
        others = (tangents[:, j, 0] / scale / pace for j in different)
        if all(np.abs(tangent - other).max() > _BRANCHES.same for other in others):
            different.append(k)
    return found[np.array(different, dtype=np.intp)]
