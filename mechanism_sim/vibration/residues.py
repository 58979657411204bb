"""Partial fractions of ``M u'' + C u' + K u = f``, and of a chain behind it.

With the eigenvectors of the state matrix, ``A V = V diag(p)``, the receptance is

``(M s^2 + C s + K)^-1 = sum_k R_k / (s - p_k)``,  ``R_k = V_u[:, k] (V^-1)_v[k, :] M^-1``

for any damping, and ``u^(d) = sum_k p_k^d R_k z_k`` (and ``M^-1 f`` more for d = 2) with
``z_k' = p_k z_k + f``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mechanism_sim.numerics.rational import Array, ComplexArray, Modes, Rational

_DEFECTIVE = 1e5
"""Condition of the eigenvectors from which on poles are taken for a multiple one."""
_APART = 1e-10
"""By which part damping is changed then: poles move apart by the square root of it."""
_CLOSE = 1e-3
_MOVED = 1e-5
"""Poles of a chain that are nearer than this to one of the system, relative to their size, are
moved so far off it, and the others as far the other way: what changes is of second order."""


class Receptance(NamedTuple):
    """``sum_k residues_k / (s - poles_k)`` of a system of n degrees of freedom."""

    poles: ComplexArray  #: (2 n,) [rad/s]
    residues: ComplexArray  #: (n, n, 2 n)


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
    """From the forces on a system to what comes out of a chain that measures an acceleration.

    Parameters
    ----------
    M : (n, n) its mass matrix
    outputs : (n,) how much of each acceleration is measured
    """
    own = chain.modes()
    poles, places = system.poles.copy(), own.poles.copy()
    for i, p in enumerate(places):
        near = np.abs(poles - p) <= _CLOSE * np.abs(p)
        if near.any():
            poles[near] += _MOVED * p
            places[i] = p - _MOVED * p
    residues, gain, rest = own.residues[0, 0], own.direct[0, 0], outputs @ np.linalg.inv(M)

    def passed(s: ComplexArray) -> ComplexArray:
        """What the chain makes of ``e^(s t)``, with its poles where they are now."""
        return gain + (residues / (s[:, None] - places)).sum(axis=1)

    seen = np.einsum('i,ijk->jk', outputs, system.residues) * poles**2
    at_places = rest + (seen / (places[:, None, None] - poles)).sum(axis=2)
    return Modes(
        np.concatenate([poles, places]),
        np.concatenate([seen * passed(poles), (residues[:, None] * at_places).T], axis=1)[None],
        (gain * rest)[None],
    )
