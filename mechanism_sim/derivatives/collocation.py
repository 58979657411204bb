"""Variational equations along a known motion, segment by segment, by collocation.

A step's polynomial is known, so its variations obey linear equations with known coefficients. They
are solved at the nodes of Gauss and Legendre, where a polynomial through K accelerations is exact
to the order 2K at the end of the step (E. Hairer, G. Wanner, Solving Ordinary Differential
Equations II, 1996, IV.5), and of degree K between: no second integration, and no columns for what
only an integrator needs.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Legendre, Polynomial, legendre

from mechanism_sim.arrays import Array
from mechanism_sim.derivatives.linearised import Slopes
from mechanism_sim.numerics.polynomials import Nodes

COUNT = 8
"""Nodes of a step, which is an eighth of the radius of convergence of its series."""


class Collocation(NamedTuple):
    """Interpolation of K values on [0, 1]."""

    nodes: Nodes
    powers: Array  #: (K, K) coefficients of rising powers of each Lagrange polynomial
    once: Array  #: (K, K) integrals from 0 to each node, of each Lagrange polynomial
    twice: Array  #: (K, K) integrals of `once`
    ends: Array  #: (2, K) first and second integrals from 0 to 1


@cache
def rule() -> Collocation:
    """The rule, by Legendre polynomials, whose sums at these nodes are well conditioned."""
    x, w = legendre.leggauss(COUNT)
    shares = legendre.legvander(x, COUNT - 1) * w[:, None] * (np.arange(COUNT) + 0.5)
    each = [Legendre(row, domain=[0.0, 1.0]) for row in shares]
    nodes = 0.5 + 0.5 * x
    ends = [*nodes, 1.0]
    once, twice = (np.array([p.integ(m, lbnd=0.0)(ends) for p in each]).T for m in (1, 2))
    return Collocation(
        Nodes(tuple(nodes.tolist())),
        np.array([p.convert(kind=Polynomial).coef for p in each]),
        once[:-1],
        twice[:-1],
        np.array([once[-1], twice[-1]]),
    )


class Steps(NamedTuple):
    """Variations in N segments, of C columns each: first those by the state at the starts."""

    rates: Array  #: (N, K, f + s, C) accelerations and rates of states at the nodes
    end: Array  #: (N, 2f + s, C) variations of the state at the ends


def solve(slopes: Slopes, free: list[int], h: Array, forced: Array) -> Steps:
    """Variations of the state in N segments.

    Parameters
    ----------
    slopes : derivatives at the nodes, segment by segment
    free : indices of the free coordinates
    h : (N,) durations [s]
    forced : (N, K, f + s, P) rates by P keys at constant state
    """
    known, count = rule(), len(h)
    f, w = len(free), forced.shape[2]
    s, K = w - f, COUNT

    def nodes(x: Array) -> Array:
        """Array (N, K, f + s, columns) at the nodes."""
        return np.moveaxis(x, -1, 0).reshape(count, K, w, -1)

    Jq, Jv, Js = (nodes(x) for x in (slopes.q[:, free], slopes.v[:, free], slopes.states))
    wide = h[:, None, None, None]
    # rates U at node j by those at node k, coordinates and rates being integrals of them
    parts = np.zeros((count, K, w, K, w))
    parts[..., :f] = -np.einsum('njil,jk->njikl', Jq * wide * wide, known.twice)
    parts[..., :f] -= np.einsum('njil,jk->njikl', Jv * wide, known.once)
    if s:
        parts[..., f:] = -np.einsum('njil,jk->njikl', Js * wide, known.once)
    M = parts.reshape(count, K * w, K * w)
    M[:, range(K * w), range(K * w)] += 1.0
    since = np.array(known.nodes.fractions)[:, None, None]
    right = np.concatenate([Jq, Jv + Jq * (wide * since), Js, forced], axis=3)
    U = np.linalg.solve(M, right.reshape(count, K * w, -1)).reshape(right.shape)
    end = np.zeros((count, 2 * f + s, right.shape[3]))
    i = np.arange(f)
    end[:, i, i] = end[:, f + i, f + i] = 1.0
    end[:, i, f + i] = h[:, None]
    end[:, range(2 * f, 2 * f + s), range(2 * f, 2 * f + s)] = 1.0
    once, twice = known.ends
    wide = h[:, None, None]
    end[:, :f] += wide * wide * np.einsum('k,nkic->nic', twice, U[:, :, :f])
    end[:, f:] += wide * np.einsum('k,nkic->nic', once, U)
    return Steps(U, end)


def powers(start: Array, rates: Array, h: Array, f: int) -> tuple[Array, Array]:
    """Polynomials of the time since the starts of N segments, of coordinates and of states.

    Parameters
    ----------
    start : (N, 2f + s, P) variations of the state at the starts
    rates : (N, K, f + s, P)

    Returns
    -------
    (N, f, K + 2, P) and (N, s, K + 1, P)
    """
    count, K, w, P = rates.shape
    found = (rule().powers.T @ rates.reshape(count, K, w * P)).reshape(count, K, w, P)
    found = np.moveaxis(found, 1, 2) / h[:, None, None, None] ** np.arange(COUNT)[:, None]
    j = np.arange(1.0, COUNT + 1.0)[:, None]
    q = np.concatenate(
        [start[:, :f, None], start[:, f : 2 * f, None], found[:, :f] / (j * (j + 1.0))], axis=2
    )
    return q, np.concatenate([start[:, 2 * f :, None], found[:, f:] / j], axis=2)
