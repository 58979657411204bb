"""Fourier coefficients of functions that are smooth between known places, and what they leave.

The functions are expanded in Legendre polynomials on intervals that are halved until the expansion
is known to rounding (jumps between the given places end in intervals of no length). Then

    int_-1^1 P_n(x) e^(-i a x) dx = 2 (-i)^n j_n(a)

with the spherical Bessel functions j_n gives the coefficients of all harmonics from the same
expansion, as exact as that is: no harmonic is folded back on another, however high (Filon's
method; DLMF 10.54.2).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.tolerances import TOLERANCES

_HARMONICS = TOLERANCES.harmonics
_QUADRATURE = TOLERANCES.quadrature
_ROUNDING = TOLERANCES.rounding

Functions = Callable[[Array], Array]
"""Values (C, N) of C functions at times (N,) [s]."""

_COUNT = 16  # of nodes and of polynomials in an interval
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_COUNT)
_POLYNOMIALS = np.polynomial.legendre.legvander(_NODES, _COUNT - 1)
_DEGREES = np.arange(_COUNT)
_EXPAND = (2 * _DEGREES + 1) / 2.0 * _WEIGHTS[:, None] * _POLYNOMIALS

_BLOCK = 4096  # intervals, or harmonics times intervals, at once


class PeriodicSpectrum(NamedTuple):
    """C periodic functions, ``mean + sum_k Re(amplitudes[:, k - 1] e^(i k w t))`` and a rest."""

    mean: Array  #: (C,) means
    amplitudes: ComplexArray  #: (C, count) complex amplitudes of the harmonics
    error: Array  #: (C,) error of the mean and of each amplitude
    rest: Array  #: (C,) root mean square of all higher harmonics together

    def without(self, rounding: float) -> PeriodicSpectrum:
        """Spectrum with zeros for amplitudes within rounding."""
        return self._replace(
            mean=np.where(np.abs(self.mean) > rounding, self.mean, 0.0),
            amplitudes=np.where(np.abs(self.amplitudes) > rounding, self.amplitudes, 0.0),
            rest=np.where(self.rest > 10.0 * rounding, self.rest, 0.0),
        )


class _Expansion(NamedTuple):
    """Legendre expansions on K intervals in the order of time."""

    begin: Array  #: (K,) starts [s]
    width: Array  #: (K,) durations [s]
    coefficients: Array  #: (C, K, n) Legendre coefficients
    off: Array  #: (C, K) truncation errors


def spectrum(
    functions: Functions, edges: Array, count: int, floor: Array | None = None
) -> PeriodicSpectrum:
    """The mean and the first `count` harmonics of functions over a period.

    Parameters
    ----------
    functions : functions smooth inside of intervals; never evaluated at the ends of one
    edges : (m + 1,) first and last instant of the period [s], and where the functions jump or
        bend; close enough that no feature hides between the nodes
    floor : (C,) rounding errors of their values
    """
    x = _expanded(functions, edges, floor)
    period = float(edges[-1] - edges[0])
    w = 2.0 * np.pi / period
    k = np.arange(1.0, count + 1.0)
    amplitudes = np.zeros((len(x.coefficients), count), complex)
    middle = x.begin + 0.5 * x.width - edges[0]
    widths, kind = np.unique(x.width, return_inverse=True)
    turned = (-1j) ** _DEGREES[:, None]
    for n in range(count):
        bessel = turned * scipy.special.spherical_jn(_DEGREES[:, None], 0.5 * k[n] * w * widths)
        own = np.einsum('ckn,nk->ck', x.coefficients, bessel[:, kind])
        amplitudes[:, n] = 2.0 / period * (own @ (x.width * np.exp(-1j * k[n] * w * middle)))
    amplitudes *= np.exp(-1j * k * w * edges[0])
    mean = x.coefficients[:, :, 0] @ x.width / period
    largest = np.abs(x.coefficients).sum(axis=2).max(axis=1, initial=0.0)
    error = 2.0 / period * _QUADRATURE.safety * (x.off @ x.width) + _ROUNDING.series * largest
    rest = _rest(x, mean, amplitudes, w)
    return PeriodicSpectrum(mean, amplitudes, error, rest)


def _expanded(functions: Functions, edges: Array, floor: Array | None) -> _Expansion:
    """Expansions on intervals that are halved until they are known."""
    begin, width = edges[:-1].copy(), np.diff(edges)
    begin, width = begin[width > 0.0], width[width > 0.0]
    period, largest = float(edges[-1] - edges[0]), np.zeros(1)
    stalled, parent = np.zeros(len(begin), int), np.full(len(begin), np.inf)
    done: list[_Expansion] = []
    known = 0
    for depth in range(_HARMONICS.halvings + 1):
        c = _coefficients(functions, begin, width)
        largest = np.maximum(largest, np.abs(c).sum(axis=2).max(axis=1, initial=0.0))
        scale = np.maximum(largest, _ROUNDING.least)
        off = np.abs(c[:, :, -2:]).max(axis=2)
        low = np.zeros(1) if floor is None else floor
        # by how much each interval misses what is asked of it; no more than 1 is enough
        resolved = off / np.maximum(_HARMONICS.resolved * scale, low)[:, None]
        small = off * width / (_HARMONICS.small * scale * period)[:, None]
        fault = np.minimum(resolved, small).max(axis=0, initial=0.0)
        if depth:
            twin = np.roll(fault, len(fault) // 2)
            stuck = np.minimum(fault, twin) > _HARMONICS.less * parent
            stalled = np.where(stuck, stalled + 1, 0)
        settled = (fault <= 1.0) | (stalled >= _HARMONICS.stalled) | (depth == _HARMONICS.halvings)
        known += int(settled.sum())
        if known + 2 * int((~settled).sum()) > _HARMONICS.intervals:
            settled[:] = True
        done.append(_Expansion(begin[settled], width[settled], c[:, settled], off[:, settled]))
        left = ~settled
        if not left.any():
            break
        width = np.tile(0.5 * width[left], 2)
        begin = np.append(begin[left], begin[left] + width[: int(left.sum())])
        stalled, parent = np.tile(stalled[left], 2), np.tile(fault[left], 2)
    order = np.concatenate([x.begin for x in done]).argsort(kind='stable')
    return _Expansion(
        np.concatenate([x.begin for x in done])[order],
        np.concatenate([x.width for x in done])[order],
        np.concatenate([x.coefficients for x in done], axis=1)[:, order],
        np.concatenate([x.off for x in done], axis=1)[:, order],
    )


def _coefficients(functions: Functions, begin: Array, width: Array) -> Array:
    """Legendre coefficients (C, K, n) on intervals."""
    found = []
    for first in range(0, len(begin), _BLOCK):
        a, h = begin[first : first + _BLOCK, None], width[first : first + _BLOCK, None]
        t = a + 0.5 * h * (1.0 + _NODES)
        values = functions(t.ravel())
        found.append(values.reshape(len(values), *t.shape) @ _EXPAND)
    return np.concatenate(found, axis=1)


def _rest(x: _Expansion, mean: Array, amplitudes: ComplexArray, w: float) -> Array:
    """Root mean square (C,) of the functions less their harmonics.

    A difference of mean squares (Parseval) would leave the root of rounding. Intervals are parted
    where the highest harmonic asks for more nodes than the expansion has.
    """
    period, count = 2.0 * np.pi / w, amplitudes.shape[1]
    parts = np.maximum(1, np.ceil(count * w * x.width / _COUNT).astype(int))
    total = np.zeros(len(mean))
    for n in range(int(parts.max(initial=0))):
        chosen = np.flatnonzero(parts > n)
        for first in range(0, len(chosen), 256):
            some = chosen[first : first + 256]
            share = parts[some][:, None]
            place = (n + 0.5 * (1.0 + _NODES)) / share  # of the interval, (k, nodes)
            t = x.begin[some, None] + x.width[some, None] * place
            at = np.polynomial.legendre.legvander(2.0 * place - 1.0, _COUNT - 1)
            values = np.einsum('ckn,kjn->ckj', x.coefficients[:, some], at) - mean[:, None, None]
            phase = np.exp(1j * w * t)
            power = np.ones_like(phase)
            for k in range(count):
                power = power * phase
                values -= (amplitudes[:, k, None, None] * power).real
            total += (values**2 * _WEIGHTS).sum(axis=2) @ (0.5 * x.width[some] / share[:, 0])
    return np.asarray(np.sqrt(total / period))
