"""Many degrees of freedom: modes, with damping of any kind ([V] 6.13).

    M y'' + C y' + K y = F

Responses to starts and forces, which no machine needs, are in `docs/books/masses.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.errors import InputError

#: share of the largest of its kind below which a value is rounding
ROUNDING = 1e-13


class VibrationModes(NamedTuple):
    """Modes of the undamped system, the slowest first."""

    frequencies: Array  #: natural frequencies (n,) [rad/s]; 0 for a rigid-body mode
    shapes: Array  #: (n, n) mode shapes in columns, with shapes^T M shapes = 1
    decay_rates: Array | None  #: (n,) decay rates [1/s]; None if damping couples the modes


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """Masses, dampers and springs as matrices.

    Parameters
    ----------
    mass : M (n, n) [kg], symmetric and positive definite
    damping : C (n, n) [N s/m]
    stiffness : K (n, n) [N/m], symmetric, without negative eigenvalues
    """

    mass: Array
    damping: Array
    stiffness: Array

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(self.mass))
        for name in ('mass', 'damping', 'stiffness'):
            matrix = np.asarray(getattr(self, name), np.float64)
            if matrix.shape != (n, n) or not np.isfinite(matrix).all():
                raise InputError(f'the {name} matrix is not a square of {n} rows of numbers')
            if name != 'damping' and (
                np.abs(matrix - matrix.T).max() > ROUNDING * np.abs(matrix).max()
            ):
                raise InputError(f'the {name} matrix is not symmetric')
            object.__setattr__(self, name, matrix)
        try:
            scipy.linalg.cholesky(self.mass)
        except np.linalg.LinAlgError:
            raise InputError('the mass matrix is not positive definite') from None
        if (least := self._principal[0].min()) < 0.0:
            raise InputError(f'the stiffness matrix has a negative eigenvalue, {least:.3g}')

    @cached_property
    def modes(self) -> VibrationModes:
        """Natural frequencies, modes, and rates of decay if the damping is proportional.

        Modes of the same frequency are chosen so that the damping does not couple them, if they
        can be.
        """
        squares, Q, loss = self._principal
        L = scipy.linalg.cholesky(self.mass, lower=True)
        shapes = scipy.linalg.solve_triangular(L.T, Q)
        shapes = shapes * np.where(shapes[np.abs(shapes).argmax(axis=0), range(len(L))] < 0, -1, 1)
        return VibrationModes(np.sqrt(squares), shapes, None if loss is None else loss / 2.0)

    @cached_property
    def _principal(self) -> tuple[Array, Array, Array | None]:
        """Eigenvalues of M^-1 K; eigenvectors in mass-normalised coordinates; those of M^-1 C."""
        L = scipy.linalg.cholesky(self.mass, lower=True)
        K, C = (
            scipy.linalg.solve_triangular(
                L, scipy.linalg.solve_triangular(L, matrix, lower=True).T, lower=True
            )
            for matrix in (self.stiffness, self.damping.T)
        )
        K = (K + K.T) / 2.0
        stiffest, strongest = (float(np.linalg.norm(matrix, 2)) or 1.0 for matrix in (K, C))
        # a mixture of both, with an odd share so that no eigenvalues meet by accident
        Q = scipy.linalg.eigh(K / stiffest + 0.6180339887498949 * (C + C.T) / 2.0 / strongest)[1]
        K_modal, C_modal = Q.T @ K @ Q, Q.T @ C @ Q
        order = np.argsort(np.diag(K_modal))
        squares, Q, loss = np.diag(K_modal)[order], Q[:, order], np.diag(C_modal)[order]
        coupling = max(_coupling(K_modal) / stiffest, _coupling(C_modal) / strongest)
        proportional = max(coupling, -loss.min() / strongest) < ROUNDING * len(L)
        if not proportional:
            squares, Q = scipy.linalg.eigh(K)
        squares = np.where(np.abs(squares) < ROUNDING * stiffest, 0.0, squares)
        loss = np.where(loss < np.finfo(np.float64).eps * strongest, 0.0, loss)
        return squares, Q, loss if proportional else None


def _coupling(matrix: Array) -> float:
    """Largest entry off the diagonal."""
    return float(np.abs(matrix - np.diag(np.diag(matrix))).max())


def impedance(mass: Array, damping: Array, stiffness: Array, w: Array) -> ComplexArray:
    """Forces per displacement ``K + i w C - w^2 M`` (N, n, n) at frequencies w (N,) [rad/s]."""
    each = w[:, None, None]
    return np.asarray(stiffness + 1j * each * damping - each**2 * mass, complex)


def state_matrix(mass: Array, damping: Array, stiffness: Array) -> Array:
    """A (2n, 2n) of M y'' + C y' + K y = 0, for the state (y, y'); arguments (n, n)."""
    n = len(mass)
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:] = -np.linalg.solve(mass, np.concatenate([stiffness, damping], axis=1))
    return A
