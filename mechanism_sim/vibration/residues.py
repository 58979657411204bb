"""Partial fractions of ``M u'' + C u' + K u = f``, and of a chain behind it.

With the eigenvectors of the state matrix, ``A V = V diag(p)``, the receptance is

``(M s^2 + C s + K)^-1 = sum_k R_k / (s - p_k)``,  ``R_k = V_u[:, k] (V^-1)_v[k, :] M^-1``

for any damping, and ``u^(d) = sum_k p_k^d R_k z_k`` (and ``M^-1 f`` more for d = 2) with
``z_k' = p_k z_k + f``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.numerics.rational import Modes, Rational

_DEFECTIVE = 1e5  # condition number of the eigenvectors above which poles count as a multiple one
_APART = 1e-10  # relative change of damping then: poles move apart by the square root of it
_MEET = 1e-5
"""A pole of a chain that is nearer than this to one of the system, relative to their size, makes a
double one with it, of which two halves are moved so far apart: what changes is of second order.
"""


class Receptance(NamedTuple):
    """``sum_k residues_k / (s - poles_k)`` of a system of n degrees of freedom."""

    poles: ComplexArray  #: (2 n,) poles [rad/s]
    residues: ComplexArray  #: (n, n, 2 n) residues


def receptance(M: Array, C: Array, K: Array) -> Receptance:
    """Poles and residues of a system with n degrees of freedom.

    Parameters
    ----------
    M, C, K : (n, n) mass, damping and stiffness; M and K positive definite
    """
    inverse = np.linalg.inv(M)
    unit = float(np.sqrt(np.abs(np.linalg.eigvals(inverse @ K)).max()))
    poles, vectors = _eigen(inverse @ C / unit, inverse @ K / unit**2)
    if np.linalg.cond(vectors) > _DEFECTIVE:
        poles, vectors = _eigen(inverse @ C * ((1.0 + _APART) / unit), inverse @ K / unit**2)
    n = len(M)
    driven = np.linalg.solve(vectors, np.vstack([np.zeros((n, n)), inverse / unit]))
    residues = np.einsum('ik,kj->ijk', vectors[:n], driven)
    return Receptance(poles * unit, residues)


def _eigen(C: Array, K: Array) -> tuple[ComplexArray, ComplexArray]:
    """Eigenvalues and eigenvectors of the state matrix for a mass matrix of ones."""
    n = len(C)
    poles, vectors = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))
    return poles.astype(complex), vectors.astype(complex)


def through(system: Receptance, M: Array, outputs: Array, chain: Rational) -> Modes:
    """Modes from the forces on a system to the output of a chain that measures an acceleration.

    Parameters
    ----------
    M : (n, n) mass matrix
    outputs : (n,) factors of the accelerations in the measured one
    """
    own = chain.modes()
    rest = outputs @ np.linalg.inv(M)
    seen = np.einsum('i,ijk->jk', outputs, system.residues) * system.poles**2

    def moved(s: ComplexArray) -> ComplexArray:
        """The system alone (n, N)."""
        return np.asarray(
            rest[:, None] + (seen[:, None] / (s[:, None] - system.poles)).sum(axis=2)
        )

    def passed(s: ComplexArray) -> ComplexArray:
        """The chain alone (N,)."""
        fractions = own.residues[0, 0] / (s[:, None] - own.poles)
        return np.asarray(own.direct[0, 0] + fractions.sum(axis=1))

    apart = np.abs(system.poles[:, None] - own.poles)
    meet = apart <= _MEET * np.abs(own.poles)
    single, other = ~meet.any(axis=1), ~meet.any(axis=0)
    poles = [system.poles[single], own.poles[other]]
    residues = [
        seen[:, single] * passed(poles[0]),
        own.residues[0, 0, other] * moved(poles[1]),
    ]
    for j in np.flatnonzero(~other):
        p, q = system.poles[meet[:, j]].mean(), own.poles[j]
        middle = 0.5 * (p + q)
        halves = middle * (1.0 + _MEET * np.array([1.0, -1.0]))
        share = (halves - p) * (halves - q) / (halves - halves[::-1])
        poles.append(halves)
        residues.append(moved(halves) * passed(halves) * share)
    return Modes(
        np.concatenate(poles),
        np.concatenate(residues, axis=1)[None],
        (own.direct[0, 0] * rest)[None],
    )
