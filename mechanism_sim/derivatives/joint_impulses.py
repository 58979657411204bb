"""Derivatives of impulses of friction in ideal joints, beside those of the contacts of an impact.

Both are a fixed point (see `contact.rubbing`): the contacts feel the friction that they make, as a
part of their own impulses. Which slips end is known then, and what is left is linear.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.joint_friction import JointFrictionProblem, friction_impulses

_ROUNDS = 200
_SETTLED = 1e-14
_STILL = 1e-9  # of a bound, and of slips: what is nearer to it may be on either side

Impulses = Callable[[Array, Array], tuple[Array, Array]]
"""Of contacts (n,), and their derivatives (n, C), by compliance (n, n) and its derivatives; those
of rates and coefficients are in the first P of the C columns."""


class ImpactWithJoints(NamedTuple):
    """Impulses of n rows of contacts, and of k joints as shares of them, with derivatives."""

    contacts: tuple[Array, Array]  #: impulses (n,) and derivatives (n, P)
    shares: tuple[Array, Array]  #: shares (k, n) and derivatives (k, n, P)
    lost: Array  #: (P,) derivatives of the joints' dissipation [J]


def beside(
    solve: Impulses,
    A: tuple[Array, Array],
    known: JointFrictionProblem,
    slopes: JointFrictionProblem,
) -> ImpactWithJoints | None:
    """Impulses of contacts and joints together; None if they have no derivatives.

    Parameters
    ----------
    A : compliance (n, n) of the contacts, and its derivatives (n, n, P)
    known, slopes : joint friction problem beside these n rows, and derivatives (..., P)
    """
    (A0, dA), n, k = A, len(A[0]), len(known.rate)
    C, P = known.compliance[:n], dA.shape[2]
    T: Array = np.zeros(k)
    x, none = solve(A0, np.zeros((n, n, 0)))[0], np.zeros((n, n, 0))
    for _ in range(_ROUNDS):
        if not x.any():
            return ImpactWithJoints(
                solve(A0, dA), (np.zeros((k, n)), np.zeros((k, n, P))), np.zeros(P)
            )
        T = friction_impulses(known, x, T)
        before, x = x, solve(A0 + C @ np.outer(T, x / (x @ x)), none)[0]
        if np.abs(x - before).max() <= _SETTLED * np.abs(x).max():
            break
    T = friction_impulses(known, x, T)
    # by keys, by impulses of contacts, by those of joints
    size, share, wide = x @ x, np.outer(T, x / (x @ x)), np.zeros((n, n, P + n + k))
    wide[..., :P] = dA + np.einsum('ijp,jl->ilp', slopes.compliance[:n], share)
    for i in range(n):
        unit = np.eye(n)[i]
        wide[..., P + i] = C @ np.outer(T, unit / size - 2.0 * x[i] * x / size**2)
    for j in range(k):
        wide[..., P + n + j] = np.outer(C[:, j], x / size)
    _, dx = solve(A0 + C @ share, wide)
    M, right = np.eye(n + k), np.zeros((n + k, P))
    M[:n] -= dx[:, P:]
    right[:n] = dx[:, :P]
    found = _of_joints(known, slopes, np.concatenate([x, T]), n)
    if found is None:
        return None
    M[n:], right[n:] = found
    both = np.asarray(np.linalg.solve(M, right), dtype=float)
    every = np.concatenate([x, T])
    dx, dT = both[:n], both[n:]
    moved = np.einsum('kp,n->knp', dT, x) + np.einsum('k,np->knp', T, dx)
    dshare = moved / size - np.einsum('kn,p->knp', share, 2.0 * (x @ dx) / size)
    mean = known.rate + 0.5 * known.compliance.T @ every
    dmean = slopes.rate + 0.5 * (
        known.compliance.T @ both + np.einsum('ikp,i->kp', slopes.compliance, every)
    )
    return ImpactWithJoints((x, dx), (share, dshare), -(T @ dmean + mean @ dT))


def _of_joints(
    known: JointFrictionProblem, slopes: JointFrictionProblem, every: Array, n: int
) -> tuple[Array, Array] | None:
    """Linear equations of the differentials of n and k impulses: rows, right sides (k, P)."""
    k = len(known.rate)
    M, right = np.zeros((k, n + k)), np.zeros((k, slopes.rate.shape[1]))
    force = known.forces @ every
    dforce = np.einsum('cip,i->cp', slopes.forces, every)
    begin = [0, *known.ends.tolist()]
    slip = known.rate + known.compliance.T @ every
    fastest = np.abs(known.compliance * every[:, None]).max(axis=0)
    for j in range(k):
        bound, row, moved = 0.0, np.zeros(n + k), np.zeros(right.shape[1])
        for t in np.flatnonzero(known.owner == j):
            own = slice(begin[t], begin[t + 1])
            size = float(np.sqrt(force[own] @ force[own]))
            if size and known.walls[t] * force[own][-1] >= 0.0:
                mu = known.coefficients[t]
                bound += mu * size
                row += mu * force[own] @ known.forces[own] / size
                moved += slopes.coefficients[t] * size + mu * force[own] @ dforce[own] / size
        T, unit = every[n + j], np.eye(n + k)[n + j]
        slides, ends = abs(slip[j]) > _STILL * fastest[j], abs(T) < bound * (1.0 - _STILL)
        if slides and not ends:
            M[j], right[j] = unit - np.sign(T) * row, np.sign(T) * moved
        elif ends and not slides:
            M[j] = known.compliance[:, j]
            right[j] = -slopes.rate[j] - np.einsum('ip,i->p', slopes.compliance[:, j], every)
        elif bound:
            return None
        else:
            M[j] = unit
    return M, right
