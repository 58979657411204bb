"""The response of a linear system to piecewise polynomials and impulses, without a time step.

Mode by mode, ``z' = p z + u``. On a piece of duration h, with ``x = t / h``, ``s = p h`` and
``u = sum_j u_j x^j``, that is ``dz/dx = s z + h u``, and

``z = c(x) + (z(0) - c(0)) e^(s x)``

with any polynomial c that solves it. Where s is large, that is the one of the degree of u, from
``s c_j = (j + 1) c_(j + 1) - h u_j`` downwards; where it is small, the power series of the
response from rest, from ``(j + 1) c_(j + 1) = s c_j + h u_j`` upwards until no more comes. Nothing
is approximated however fast the mode and however long the piece.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, ComplexArray, IndexArray
from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.kernels import Kernel, entry
from mechanism_sim.numerics.polynomials import Nodes, chebyshev_nodes, fit_powers
from mechanism_sim.numerics.rational import Modes

NODES = Nodes(tuple(chebyshev_nodes(20)))
"""Positions at which inputs are sampled on every piece, for their polynomials."""
_SWING_OF = hy.make_vars('t', 'a', 'b')
_T, _A, _B = _SWING_OF
_SWING = hy.exp(hy.par[0] * _T) * (_A * hy.cos(hy.par[1] * _T) - _B * hy.sin(hy.par[1] * _T))
_VECTORS = 64  # numbers that are whole vectors of every processor
_LARGE = 8.0
"""Magnitude of s above which the downward recurrence is used, below it the power series."""
_SERIES = 50
"""Terms of the power series beyond those of the input, at most: ``8^50 / 50! < 1e-19``."""
_SMALL = 1e-19  # relative size of a term of that series below which it ends
_OPERATION = 5e-7  # [s] that a term costs as Python


class ModePasses(NamedTuple):
    """One mode that one input drives through N pieces, all in real and imaginary parts."""

    pole: Array  #: (2,) pole [rad/s]
    residue: Array  #: (outputs, 2) residues
    durations: Array  #: (N,) [s]
    decay: Array  #: (N, 2) values of ``e^s``
    terms: Indices  #: (N,) number of terms of c: d + 1 downwards, more as series, 0 if no input
    inputs: Array  #: (N, d + 1) coefficients of the input
    impulses: Array  #: (N,) impulses at the starts
    state: Array  #: (2,) z before the first piece, overwritten by z after the last
    forced: Array  #: (N, terms outputs) output by the coefficients of c, added in place
    free: Array  #: (2 outputs, N) output by the free response, added in place


@entry
def pass_through(mode: ModePasses) -> int:
    """Let a mode pass through all pieces, by the equations at the head of this module."""
    pole, residue, durations, decay, terms, inputs, impulses, state, forced, free = mode
    count, outputs = inputs.shape[1], len(residue)
    x, y = state[0], state[1]
    for n in range(len(durations)):
        h = durations[n]
        sx, sy = pole[0] * h, pole[1] * h
        cx, cy, begin_x, begin_y, end_x, end_y = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if terms[n] == count:
            square = sx * sx + sy * sy
            inverse_x, inverse_y = sx / square, -sy / square
            for j in range(count - 1, -1, -1):
                ax, ay = (j + 1.0) * cx - h * inputs[n, j], (j + 1.0) * cy
                cx, cy = ax * inverse_x - ay * inverse_y, ax * inverse_y + ay * inverse_x
                end_x += cx
                end_y += cy
                for i in range(outputs):
                    forced[n, j * outputs + i] += cx * residue[i, 0] - cy * residue[i, 1]
            begin_x, begin_y = cx, cy
        else:
            for j in range(1, terms[n]):
                ax, ay = cx * sx - cy * sy, cx * sy + cy * sx
                if j <= count:
                    ax += h * inputs[n, j - 1]
                cx, cy = ax / j, ay / j
                end_x += cx
                end_y += cy
                for i in range(outputs):
                    forced[n, j * outputs + i] += cx * residue[i, 0] - cy * residue[i, 1]
        x += impulses[n] - begin_x
        y -= begin_y
        for i in range(outputs):
            free[2 * i, n] += x * residue[i, 0] - y * residue[i, 1]
            free[2 * i + 1, n] += x * residue[i, 1] + y * residue[i, 0]
        x, y = (
            end_x + (decay[n, 0] * x - decay[n, 1] * y),
            end_y + (decay[n, 0] * y + decay[n, 1] * x),
        )
    state[0], state[1] = x, y
    return 0


@entry
def add_forced(forced: Array, terms: Indices, pieces: Indices, x: Array, y: Array) -> int:
    """Add polynomials at fractions x (M,) of pieces (M,) to outputs y (outputs, M)."""
    outputs = len(y)
    for m in range(len(x)):
        n = pieces[m]
        for i in range(outputs):
            value = 0.0
            for j in range(terms[n] - 1, -1, -1):
                value = value * x[m] + forced[n, j * outputs + i]
            y[i, m] += value
    return 0


def _call(kernel: Kernel, operations: int, *args: Any) -> None:
    """Call a kernel, as machine code if so many operations would cost more than to have it."""
    if not kernel.is_compiled:
        kernel.charge(_OPERATION * operations)
    kernel(*args)


class ModalResponse(NamedTuple):
    """Response of the modes of a system on N pieces, without direct feed-through.

    ``y(t) = sum_j forced_j (t / h)^j + Re sum_k free_k e^(p_k t)`` from the start of a piece on.
    """

    poles: ComplexArray  #: (k,) poles [rad/s]
    durations: Array  #: (N,) [s]
    forced: Array  #: (N, terms outputs)
    terms: Indices  #: (N,) number of terms of `forced` that are not zero
    free: Array  #: (k, 2 outputs, N) real and imaginary parts of each output

    def __call__(self, pieces: IndexArray, t: Array) -> Array:
        """Outputs (outputs, M) at times `t` (M,) [s] after the start of given pieces (M,)."""
        h = self.durations[pieces]
        x = np.divide(t, h, out=np.zeros_like(t), where=h > 0.0)
        y = np.zeros((self.free.shape[1] // 2, len(t)))
        operations = len(y) * int(self.terms[pieces].sum())
        _call(add_forced, operations, self.forced, self.terms, pieces, x, y)
        self._add_free(pieces, t, y)
        return y

    def _add_free(self, pieces: IndexArray, t: Array, y: Array) -> None:
        """Add ``Re(free e^(p t))`` to `y` (outputs, M), in half of the time that NumPy takes.

        Whole vectors are computed, for heyoka rounds in another way what is left over of them.
        """
        function, width = compiled.function([_SWING], _SWING_OF), compiled.COLUMNS
        pars = [np.full((2, width), [[p.real], [p.imag]]) for p in self.poles]
        inputs, found = np.zeros((3, width)), np.empty((1, width))
        for first in range(0, len(t), width):
            k = pieces[first : first + width]
            if len(k) < width:
                size = -(-len(k) // _VECTORS) * _VECTORS
                inputs, found = np.zeros((3, size)), np.empty((1, size))
                pars = [p[:, :size].copy() for p in pars]
            own = slice(len(k))
            inputs[0, own] = t[first : first + width]
            for pole, parts in zip(pars, self.free, strict=True):
                for i, row in enumerate(y[:, first : first + width]):
                    parts[2 * i : 2 * i + 2].take(k, axis=1, out=inputs[1:, own], mode='clip')
                    row[:] += function(inputs, outputs=found, pars=pole)[0, own]


class ModalFilter:
    """A linear system in time.

    Parameters
    ----------
    modes : poles with residues

    Attributes
    ----------
    state : (k, inputs, 2) state of the modes, one of each conjugate pair
    """

    def __init__(self, modes: Modes) -> None:
        kept = modes.poles.imag >= 0.0
        self._poles = modes.poles[kept]
        twice = np.where(self._poles.imag > 0.0, 2.0, 1.0)
        residues = modes.residues[:, :, kept] * twice
        self._residues = np.ascontiguousarray(residues.transpose(2, 1, 0), complex)
        self.direct = modes.direct
        self.state = np.zeros((len(self._poles), modes.direct.shape[1], 2))

    def __len__(self) -> int:
        return len(self._poles)

    @property
    def numbers(self) -> Array:
        """All numbers (n,) of the system."""
        parts = self._poles, self._residues, self.direct
        return np.concatenate([x.astype(complex).ravel().view(float) for x in parts])

    def advance(self, durations: Array, polynomials: Array, impulses: Array) -> ModalResponse:
        """Advance the state through N pieces.

        Parameters
        ----------
        durations : (N,) durations [s]
        polynomials : (N, inputs, d + 1) of the inputs, by powers of the fraction of the piece
        impulses : (N, inputs) impulses of the inputs at the start of each piece

        Returns
        -------
        Response of the modes on these pieces
        """
        durations = np.ascontiguousarray(durations, float)
        count, outputs = polynomials.shape[2], len(self.direct)
        sizes = np.abs(self._poles)[:, None] * durations
        terms = np.where(sizes > _LARGE, count, 0)
        small = sizes <= _LARGE
        terms[small] = count + 1 + np.searchsorted(_reach(count), sizes[small])
        terms = terms * polynomials.any(axis=(1, 2))
        needed = terms.max(axis=0, initial=0)
        forced = np.zeros((len(durations), needed.max(initial=0) * outputs))
        free = np.zeros((len(self._poles), 2 * outputs, len(durations)))
        for k, pole in enumerate(self._poles):
            decay = np.exp(pole * durations).view(float).reshape(-1, 2)
            for i, state in enumerate(self.state[k]):
                mode = ModePasses(
                    np.array([pole.real, pole.imag]),
                    self._residues[k, i].view(float).reshape(-1, 2),
                    durations,
                    decay,
                    terms[k],
                    np.ascontiguousarray(polynomials[:, i]),
                    np.ascontiguousarray(impulses[:, i]),
                    state,
                    forced,
                    free[k],
                )
                _call(pass_through, (1 + outputs) * int(terms[k].sum()) + len(durations), mode)
        return ModalResponse(self._poles, durations, forced, needed, free)


@lru_cache
def _reach(count: int) -> Array:
    """Magnitudes of s up to which 0, 1, ... `_SERIES` - 1 terms follow those of an input.

    Beside the term of degree `count` the m-th that follows is ``|s|^m count! / (count + m)!``.
    """
    m = np.arange(1, _SERIES + 1)
    sizes = np.array([math.lgamma(count + k + 1) for k in m]) - math.lgamma(count + 1)
    return np.asarray(np.exp((math.log(_SMALL) + sizes) / m))


def polynomials(values: Array) -> Array:
    """Inputs as `ModalFilter.advance` takes them: polynomials (N, inputs, d + 1) of N pieces.

    Parameters
    ----------
    values : (inputs, N K) values of the inputs at the K = d + 1 `NODES` of each piece
    """
    values = values.reshape(len(values), -1, len(NODES)).transpose(1, 0, 2)
    return fit_powers(values, 1.0)


def silent(inputs: int, pieces: int) -> tuple[Array, Array]:
    """Polynomials (pieces, inputs, 1) of no input, and impulses (pieces, inputs) of none."""
    return np.zeros((pieces, inputs, 1)), np.zeros((pieces, inputs))
