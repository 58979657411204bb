"""The response of a linear system to piecewise polynomials and impulses, without a time step.

Mode by mode, ``z' = p z + u``. Where u is a polynomial in ``x = t / h``,

``z(t) = e^(p t) z(0) + t sum_j b_j x^j g_j(p t)``,  ``g_j(s) = int_0^1 e^(s (1 - y)) y^j dy``,

so that nothing is approximated however fast the mode and however long the piece.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.rational import Array, ComplexArray, Modes

_FORWARD = 8.0
"""Magnitude from which the recurrence of g_j runs upwards without loss."""
_EPS = 1e-18


class ModalFilter:
    """A linear system in time.

    Parameters
    ----------
    modes : poles with residues

    Attributes
    ----------
    state : (inputs, k) of the modes that are kept, one of each conjugate pair
    """

    def __init__(self, modes: Modes) -> None:
        kept = modes.poles.imag >= 0.0
        self._poles = modes.poles[kept]
        twice = np.where(self._poles.imag > 0.0, 2.0, 1.0)
        self._residues = modes.residues[:, :, kept] * twice
        self.direct = modes.direct
        self.state = np.zeros((modes.direct.shape[1], len(self._poles)), complex)

    def __len__(self) -> int:
        return len(self._poles)

    def advance(self, durations: Array, polynomials: Array, impulses: Array) -> ComplexArray:
        """Go on through N pieces.

        Parameters
        ----------
        durations : (N,) [s]
        polynomials : (N, inputs, d + 1) of the inputs, by powers of the fraction of the piece
        impulses : (N, inputs) at the start of each piece, integrals of the input over it

        Returns
        -------
        (N, inputs, k) states at the start of each piece, after its impulse
        """
        gained = self._gained(durations, polynomials, np.ones(len(durations)))
        decay = np.exp(durations[:, None] * self._poles)
        states = np.empty_like(gained)
        z = self.state
        for i in range(len(durations)):
            z = states[i] = z + impulses[i][:, None]
            z = decay[i] * z + gained[i]
        self.state = z
        return states

    def read(
        self, states: ComplexArray, durations: Array, polynomials: Array, fractions: Array
    ) -> Array:
        """What the modes give at M instants, without what passes directly: (M, outputs).

        Parameters
        ----------
        states : (M, inputs, k) at the start of the pieces
        durations : (M,) [s] of the pieces
        polynomials : (M, inputs, d + 1)
        fractions : (M,) of the pieces
        """
        dt = durations * fractions
        z = np.exp(dt[:, None] * self._poles)[:, None] * states
        z += self._gained(dt, polynomials, fractions)
        return np.asarray(np.einsum('oik,mik->mo', self._residues, z).real)

    def _gained(self, dt: Array, polynomials: Array, fractions: Array) -> ComplexArray:
        """What the inputs add in the course of `dt` (M,): (M, inputs, k)."""
        shape = (*polynomials.shape[:2], len(self._poles))
        gained = np.zeros(shape, complex)
        if not gained.size:
            return gained
        powers = fractions[:, None] ** np.arange(polynomials.shape[2])
        weights = polynomials * (dt[:, None] * powers)[:, None]
        for j, g in _moments(dt[:, None] * self._poles, polynomials.shape[2]):
            gained += weights[:, :, j, None] * g[:, None]
        return gained


def _moments(s: ComplexArray, count: int) -> list[tuple[int, ComplexArray]]:
    """``g_j(s) = int_0^1 e^(s (1 - y)) y^j dy`` for ``j < count``.

    By parts, ``s g_j = j g_(j - 1) - 1``: upwards where s is large, downwards where it is small,
    from so far above that what is not known there is gone.
    """
    found = np.empty((count, *s.shape), complex)
    large = np.abs(s) > _FORWARD
    z = s[large]
    g = np.expm1(z) / z
    for j in range(count):
        if j:
            g = (j * g - 1.0) / z
        found[j, large] = g
    z = s[~large]
    top, rest = count, 1.0
    while rest > _EPS:
        rest *= _FORWARD / top
        top += 1
    g = np.full(z.shape, 1.0 / (top + 1.0), complex)
    for j in range(top, 0, -1):
        g = (z * g + 1.0) / j
        if j <= count:
            found[j - 1, ~large] = g
    return list(enumerate(found))


def silent(inputs: int, pieces: int) -> tuple[NDArray[np.float64], Array]:
    """Polynomials (pieces, inputs, 1) of no input, and impulses (pieces, inputs) of none."""
    return np.zeros((pieces, inputs, 1)), np.zeros((pieces, inputs))
