"""The response of a linear system to piecewise polynomials and impulses, without a time step.

Mode by mode, ``z' = p z + u``. On a piece of duration h, with ``x = t / h``, ``s = p h`` and
``u = sum_j u_j x^j``, that is ``dz/dx = s z + h u``, and

``z = c(x) + (z(0) - c(0)) e^(s x)``

with any polynomial c that solves it. Where s is large, that is the one of the degree of u, from
``s c_j = (j + 1) c_(j + 1) - h u_j`` downwards; where it is small, the power series of the
response from rest, from ``(j + 1) c_(j + 1) = s c_j + h u_j`` upwards until no more comes. Nothing
is approximated however fast the mode and however long the piece. Convolution for each sample took
five times as long.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.numerics.polynomials import Nodes, chebyshev_nodes, fit_powers
from mechanism_sim.numerics.rational import Modes

NODES = Nodes(tuple(chebyshev_nodes(20)))
"""Where inputs are asked for on every piece, to make polynomials of them."""
_LARGE = 8.0
"""Magnitude of s from which on the first way loses no more digits than the second below it."""
_SERIES = 50
"""Terms of the power series: ``8^50 / 50! < 1e-19``."""
_PIECES = 512  # whose coefficients are computed at once


class ModalResponse(NamedTuple):
    """Response of the modes of a system on N pieces, without what passes directly.

    ``y(t) = sum_j forced_j (t / h)^j + Re sum_k free_k e^(p_k t)`` from the start of a piece on.
    """

    poles: ComplexArray  #: (k,) [rad/s]
    durations: Array  #: (N,) [s]
    forced: Array  #: (d + 1, N, outputs)
    free: ComplexArray  #: (k, N, outputs)

    def __call__(self, pieces: NDArray[np.intp], t: Array) -> Array:
        """Outputs (M, outputs) at times `t` (M,) [s] after the start of given pieces (M,)."""
        h = self.durations[pieces]
        x = np.divide(t, h, out=np.zeros_like(t), where=h > 0.0)[:, None]
        y = np.zeros((len(t), self.forced.shape[2]))
        for row in self.forced[::-1]:
            y *= x
            y += row.take(pieces, axis=0)
        for pole, amplitude in zip(self.poles, self.free, strict=True):
            y += (amplitude[pieces] * np.exp(pole * t)[:, None]).real
        return y


class ModalFilter:
    """A linear system in time.

    Parameters
    ----------
    modes : poles with residues

    Attributes
    ----------
    state : (k, inputs) of the modes that are kept, one of each conjugate pair
    """

    def __init__(self, modes: Modes) -> None:
        kept = modes.poles.imag >= 0.0
        self._poles = modes.poles[kept]
        twice = np.where(self._poles.imag > 0.0, 2.0, 1.0)
        self._residues = (modes.residues[:, :, kept] * twice).transpose(2, 1, 0)
        self.direct = modes.direct
        self.state = np.zeros((len(self._poles), modes.direct.shape[1]), complex)

    def __len__(self) -> int:
        return len(self._poles)

    @property
    def numbers(self) -> Array:
        """All (n,) of which the system is made."""
        parts = self._poles, self._residues, self.direct
        return np.concatenate([x.astype(complex).ravel().view(float) for x in parts])

    def advance(self, durations: Array, polynomials: Array, impulses: Array) -> ModalResponse:
        """Go on through N pieces.

        Parameters
        ----------
        durations : (N,) [s]
        polynomials : (N, inputs, d + 1) of the inputs, by powers of the fraction of the piece
        impulses : (N, inputs) at the start of each piece, integrals of the input over it

        Returns
        -------
        What the modes give on these pieces
        """
        parts = [
            self._advance(durations[some], polynomials[some], impulses[some])
            for first in range(0, max(1, len(durations)), _PIECES)
            for some in [slice(first, first + _PIECES)]
        ]
        # a part whose modes are all fast has no power series: its further terms are zero
        terms = max(len(forced) for forced, _ in parts)
        forced = np.zeros((terms, len(durations), self._residues.shape[2]))
        for k, (part, _) in enumerate(parts):
            forced[: len(part), k * _PIECES : k * _PIECES + part.shape[1]] = part
        free = np.concatenate([free for _, free in parts], axis=1)
        return ModalResponse(self._poles, durations, forced, free)

    def _advance(
        self, durations: Array, polynomials: Array, impulses: Array
    ) -> tuple[Array, ComplexArray]:
        """`forced` and `free` of a response on so few pieces that all of it stays in the cache."""
        s = self._poles[:, None] * durations
        coefficients = _forced(s, durations[:, None] * polynomials.transpose(2, 0, 1))
        begin = coefficients[0]
        decay = np.exp(s)[:, :, None]
        gained = sum(coefficients[1:], begin) - decay * begin
        states = np.empty_like(gained)
        for k, i in np.ndindex(self.state.shape):  # plain numbers: far faster than array elements
            z, passed = complex(self.state[k, i]), []
            steps = decay[k, :, 0].tolist(), gained[k, :, i].tolist(), impulses[:, i].tolist()
            for factor, gain, impulse in zip(*steps, strict=True):
                z += impulse
                passed.append(z)
                z = factor * z + gain
            states[k, :, i], self.state[k, i] = passed, z
        residues = self._residues[:, None]
        free = ((states - begin)[..., None] * residues).sum(axis=2)
        forced = np.zeros((*coefficients[:, 0, :, 0].shape, residues.shape[3]))
        for k, i in np.ndindex(self.state.shape):  # sums and complex products round by length
            c, r = coefficients[:, k, :, i, None], residues[k, 0, i]
            forced += c.real * r.real
            forced -= c.imag * r.imag
        return forced, free


def _forced(s: ComplexArray, inputs: Array) -> ComplexArray:
    """Coefficients c_j (j, k, N, inputs) for s (k, N) and inputs h u_j (d + 1, N, inputs)."""
    large = np.abs(s) > _LARGE
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=large)[:, :, None]
    count = len(inputs)
    series = _SERIES if not large.all() and inputs.any() else 0
    coefficients = np.zeros((count + series, *s.shape, inputs.shape[2]), complex)
    c = np.zeros_like(coefficients[0])
    for j in range(count - 1, -1, -1):
        c = ((j + 1.0) * c - inputs[j]) * inverse
        coefficients[j] = c
    if series:
        slow, small = np.where(large, 0.0, s)[:, :, None], ~large[:, :, None]
        c = np.zeros_like(c)
        for j in range(1, count + series):
            c *= slow
            if j <= count:
                c += small * inputs[j - 1]
            c /= j
            coefficients[j] += c
    return coefficients


def polynomials(values: Array) -> Array:
    """Inputs as `ModalFilter.advance` takes them: polynomials (N, inputs, d + 1) of N pieces.

    Parameters
    ----------
    values : (inputs, N K) of the inputs at the K = d + 1 `NODES` of each piece
    """
    values = values.reshape(len(values), -1, len(NODES)).transpose(1, 0, 2)
    return fit_powers(values, 1.0)


def silent(inputs: int, pieces: int) -> tuple[Array, Array]:
    """Polynomials (pieces, inputs, 1) of no input, and impulses (pieces, inputs) of none."""
    return np.zeros((pieces, inputs, 1)), np.zeros((pieces, inputs))
