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

import math
from functools import lru_cache
from typing import NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.polynomials import Nodes, chebyshev_nodes, fit_powers
from mechanism_sim.numerics.rational import Modes

NODES = Nodes(tuple(chebyshev_nodes(20)))
"""Where inputs are asked for on every piece, to make polynomials of them."""
_SWING_OF = hy.make_vars('t', 'a', 'b')
_T, _A, _B = _SWING_OF
_SWING = hy.exp(hy.par[0] * _T) * (_A * hy.cos(hy.par[1] * _T) - _B * hy.sin(hy.par[1] * _T))
_VECTORS = 64  # numbers that are whole vectors of every processor
_LARGE = 8.0
"""Magnitude of s from which on the first way loses no more digits than the second below it."""
_SERIES = 50
"""Terms of the power series beyond those of the input, at most: ``8^50 / 50! < 1e-19``."""
_SMALL = 1e-19
"""Of a term of that series, beyond which there is none."""
_TOGETHER = 8  # terms by which pieces that are evaluated at once may differ
_PIECES = 1024  # whose coefficients are computed at once


class ModalResponse(NamedTuple):
    """Response of the modes of a system on N pieces, without what passes directly.

    ``y(t) = sum_j forced_j (t / h)^j + Re sum_k free_k e^(p_k t)`` from the start of a piece on.
    """

    poles: ComplexArray  #: (k,) [rad/s]
    durations: Array  #: (N,) [s]
    forced: Array  #: (d + 1, N, outputs)
    terms: NDArray[np.intp]  #: (N,) of `forced` that are not zero
    free: ComplexArray  #: (k, N, outputs)

    def __call__(self, pieces: NDArray[np.intp], t: Array) -> Array:
        """Outputs (M, outputs) at times `t` (M,) [s] after the start of given pieces (M,)."""
        h = self.durations[pieces]
        x = np.divide(t, h, out=np.zeros_like(t), where=h > 0.0)[:, None]
        y = np.zeros((len(t), self.forced.shape[2]))
        needed = self.terms[pieces]
        for first in range(_TOGETHER * ((len(self.forced) - 1) // _TOGETHER), -1, -_TOGETHER):
            those = np.flatnonzero(needed > first)
            some = those if len(those) < len(t) else slice(None)  # then without copies
            k, by, value = pieces[some], x[some], y[some]
            for row in self.forced[first : first + _TOGETHER][::-1]:
                value *= by
                value += row.take(k, axis=0)
            y[some] = value
        for pole, amplitude in zip(self.poles, self.free, strict=True):
            for out in range(y.shape[1]):
                y[:, out] += _swings(pole, amplitude[pieces, out], t)
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
        forced = np.zeros((max(len(x) for x, *_ in parts), len(durations), len(self.direct)))
        for k, (part, *_) in enumerate(parts):
            forced[: len(part), k * _PIECES : k * _PIECES + part.shape[1]] = part
        terms = np.concatenate([terms for _, terms, _ in parts])
        free = np.concatenate([free for *_, free in parts], axis=1)
        return ModalResponse(self._poles, durations, forced, terms, free)

    def _advance(
        self, durations: Array, polynomials: Array, impulses: Array
    ) -> tuple[Array, NDArray[np.intp], ComplexArray]:
        """`forced`, `terms`, `free` of a response on so few pieces that they stay in the cache."""
        s = self._poles[:, None] * durations
        inputs = durations[:, None] * polynomials.transpose(2, 0, 1)
        coefficients, terms = _forced(s, inputs)
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
            most = terms[k].max(initial=0)
            c, r = coefficients[:most, k, :, i, None], residues[k, 0, i]
            forced[:most] += c.real * r.real
            forced[:most] -= c.imag * r.imag
        return forced, terms.max(axis=0, initial=1), free


def _forced(s: ComplexArray, inputs: Array) -> tuple[ComplexArray, NDArray[np.intp]]:
    """Coefficients c_j (j, k, N, inputs) for s (k, N) and inputs h u_j (d + 1, N, inputs).

    And how many of them are not zero (k, N).
    """
    count = len(inputs)
    terms = np.full(s.shape, count)
    if not inputs.any():
        return np.zeros((count, *s.shape, inputs.shape[2]), complex), terms
    size = np.abs(s)
    large = size > _LARGE
    terms[~large] += 1 + np.searchsorted(_reach(count), size[~large])
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=large)[:, :, None]
    coefficients = np.zeros((terms.max(), *s.shape, inputs.shape[2]), complex)
    c = np.zeros_like(coefficients[0])
    for j in range(count - 1, -1, -1):
        c = ((j + 1.0) * c - inputs[j]) * inverse
        coefficients[j] = c
    # the longest series first, so that those that go on are in front
    small, lengths = np.flatnonzero(~large), terms[~large]
    order = np.argsort(-lengths.astype(np.int16), kind='stable')
    small, lengths = small[order], lengths[order]
    slow, piece = s.reshape(-1)[small, None], small % s.shape[1]
    rows = coefficients.reshape(len(coefficients), -1, inputs.shape[2])
    c = np.zeros((len(small), inputs.shape[2]), complex)
    for j in range(1, int(lengths.max(initial=1))):
        n = len(small) if j <= count else int(np.searchsorted(-lengths, -j))
        c = c[:n] * slow[:n]
        if j <= count:
            c += inputs[j - 1, piece]
        c.view(float)[:] /= j
        rows[j, small[:n]] = c
    return coefficients, terms


@lru_cache
def _reach(count: int) -> Array:
    """Magnitudes of s up to which 0, 1, ... `_SERIES` - 1 terms follow those of an input.

    Beside the term of degree `count` the m-th that follows is ``|s|^m count! / (count + m)!``.
    """
    m = np.arange(1, _SERIES + 1)
    sizes = np.array([math.lgamma(count + k + 1) for k in m]) - math.lgamma(count + 1)
    return np.asarray(np.exp((math.log(_SMALL) + sizes) / m))


def _swings(pole: complex, amplitudes: ComplexArray, t: Array) -> Array:
    """``Re(a e^(p t))`` (M,), in a quarter of the time that NumPy takes.

    Whole vectors are computed, for heyoka rounds in another way what is left over of them.
    """
    function, out = compiled.function([_SWING], _SWING_OF), np.empty(len(t))
    for first in range(0, len(t), compiled.COLUMNS):
        some = slice(first, first + compiled.COLUMNS)
        width = len(out[some])
        inputs = np.zeros((3, -(-width // _VECTORS) * _VECTORS))
        inputs[0, :width], a = t[some], amplitudes[some]
        inputs[1, :width], inputs[2, :width] = a.real, a.imag
        pars = np.repeat([[pole.real], [pole.imag]], inputs.shape[1], axis=1)
        out[some] = function(inputs, pars=pars)[0, :width]
    return out


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
