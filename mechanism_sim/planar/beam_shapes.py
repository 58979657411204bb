"""Shapes in which a beam of length 1 bends or stretches: modes, and polynomials near to them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import Legendre, legendre

from mechanism_sim.arrays import Array
from mechanism_sim.planar.beam_sections import Taper, nodes

Ends: TypeAlias = Literal['pinned', 'clamped']
Functions: TypeAlias = Literal['modal', 'polynomial']
Way: TypeAlias = Literal['pinned', 'clamped', 'fixed']
"""Reference conditions of bending, and that of stretch."""


def shapes(
    way: Way, functions: Functions, count: int, taper: Taper | None, t: Array, derivative: int
) -> Array:
    """Shapes or their derivatives at places t (...,) from 0 to 1: (count, ...)."""
    if not count:
        return np.zeros((0, *np.shape(t)))
    if taper:
        return tapered(way, functions, count, taper).at(t, derivative)
    if functions == 'polynomial' or way == 'fixed':
        return np.asarray(legendre.legval(2.0 * t - 1.0, _ritz(way, count, derivative)))
    order = np.arange(1, count + 1).reshape(-1, *[1] * np.ndim(t))
    if way == 'pinned':
        k = np.pi * order
        # whole and half multiples of pi exactly: at the ends there is no deflection
        quarters = 2.0 * order * t + derivative
        found = np.sin(0.5 * np.pi * (quarters % 4.0))
        return np.asarray(k**derivative * np.where(quarters % 2.0 == 0.0, 0.0, found))
    return np.array([_cantilever(i, t, derivative) for i in range(count)]).reshape(
        count, *np.shape(t)
    )


def _cantilever(i: int, t: Array, derivative: int) -> Array:
    """``1/2 (cosh kt - cos kt - r (sinh kt - sin kt))`` with ``cos k cosh k = -1``."""
    k = (i + 0.5) * math.pi
    for _ in range(8):
        k += (math.cos(k) + 1.0 / math.cosh(k)) / (math.sin(k) + math.tanh(k) / math.cosh(k))
    wide = math.sinh(k) + math.sin(k)
    r = (math.cosh(k) + math.cos(k)) / wide
    rising = (math.sin(k) - math.cos(k) - math.exp(-k)) / wide  # 1 - r without its rounding
    phase = 0.5 * math.pi * derivative
    found = 0.5 * (rising * np.exp(k * t) + (-1.0) ** derivative * (1.0 + r) * np.exp(-k * t))
    found += -np.cos(k * t + phase) + r * np.sin(k * t + phase)
    return np.asarray(np.where((t == 0.0) & (derivative < 2), 0.0, 0.5 * k**derivative * found))


_T = Legendre([0.5, 0.5], domain=[0.0, 1.0])
_FACTORS = {'pinned': _T * (1.0 - _T), 'clamped': _T * _T, 'fixed': _T}
"""Polynomials on 0 to 1 that keep reference conditions; `fixed` is that of stretch."""


@lru_cache
def _ritz(ends: str, count: int, derivative: int) -> Array:
    """The modes of a beam of length 1 in polynomials ``factor * (degree < count)``.

    Returns
    -------
    Coefficients (degree + 1, count) of Legendre's polynomials on 0 to 1.
    """
    factor, order = _FACTORS[ends], 1 if ends == 'fixed' else 2
    basis = [factor * Legendre.basis(k, domain=[0.0, 1.0]) for k in range(count)]
    places, weights = gauss(count + 6)
    nodes, weights = 0.5 * (1.0 + places), 0.5 * weights
    values = np.array([b(nodes) for b in basis])
    bends = np.array([b.deriv(order)(nodes) for b in basis])
    half = np.linalg.inv(np.linalg.cholesky((values * weights) @ values.T))
    _, vectors = np.linalg.eigh(half @ ((bends * weights) @ bends.T) @ half.T)
    shares = vectors.T @ half
    # of the size of the modes: mean square 1/2, that of a cantilever 1/4; they begin upwards
    shares *= math.sqrt(0.25 if ends == 'clamped' else 0.5)
    first = np.array([b.deriv(2 if ends == 'clamped' else 1)(0.0) for b in basis])
    shares *= np.sign(shares @ first)[:, None]
    some = [np.asarray(b.deriv(derivative).coef if derivative else b.coef, float) for b in basis]
    longest = max(map(len, some))
    padded = np.array([np.pad(x, (0, longest - len(x))) for x in some])
    return np.asarray(padded.T @ shares.T)


@lru_cache
def gauss(count: int) -> tuple[Array, Array]:
    """Places and weights (count,) of Gauss' quadrature from -1 to 1."""
    return legendre.leggauss(count)


class Pieces(NamedTuple):
    """Polynomials from break to break on 0 to 1.

    Attributes
    ----------
    breaks : (k + 1,)
    coefficients : (k, degree + 1, count) of Legendre's polynomials from each break to the next
    """

    breaks: Array
    coefficients: Array

    @property
    def order(self) -> int:
        """How many coefficients each has: its degree and one."""
        return int(self.coefficients.shape[1])

    def at(self, t: Array, derivative: int) -> Array:
        """They or their derivatives at places t (...,) from 0 to 1: (count, ...)."""
        t = np.asarray(t, float)
        i = np.clip(np.searchsorted(self.breaks, t, 'right') - 1, 0, len(self.coefficients) - 1)
        start, wide = self.breaks[i], np.diff(self.breaks)
        s = 2.0 * (t - start) / wide[i] - 1.0
        found = np.zeros((self.coefficients.shape[2], *t.shape))
        for k, own in enumerate(self.coefficients):
            scaled = legendre.legder(own, derivative) * (2.0 / wide[k]) ** derivative
            found = np.where(i == k, legendre.legval(s, scaled), found)
        return found


_EXTRA = 12
"""Degrees beyond the number of modes: the last one is then exact to some 1e-9 of its frequency."""


@lru_cache
def tapered(way: Way, functions: Functions, count: int, taper: Taper) -> Pieces:
    """The modes of a beam that tapers, by the method of Ritz.

    Modes are sought among polynomials of a high degree in every interval where the sections
    change evenly, smooth at its ends but for curvature (of stretch, for slope), so that steps and
    corners of the sections cost no accuracy; or among those of the least degree along all.
    """
    order = 1 if way == 'fixed' else 2
    between = taper.breaks / taper.length
    many = len(between) - 1
    if functions == 'polynomial' or way == 'fixed':
        breaks, degree = np.array([0.0, 1.0]), count + (0 if way == 'fixed' else 1)
    else:
        breaks, degree = between, -(-(count + _EXTRA) // many) + 4
    basis = _smooth(way, breaks, degree, order)
    t, weights = nodes(between, degree + 3, 1.0)
    area, moment = taper.shares(t * taper.length)
    values, bends = basis.at(t, 0), basis.at(t, order)
    mass = (values * weights * area) @ values.T
    stiff = (bends * weights * (area if way == 'fixed' else moment)) @ bends.T
    half = np.linalg.inv(np.linalg.cholesky(mass))
    _, vectors = np.linalg.eigh(half @ stiff @ half.T)
    shares = (vectors.T @ half)[:count]
    # of the size of the modes of an even beam, which begin upwards
    shares *= math.sqrt(0.25 if way == 'clamped' else 0.5)
    first = basis.at(np.array(0.0), 2 if way == 'clamped' else 1)
    shares *= np.sign(shares @ first)[:, None]
    return Pieces(breaks, basis.coefficients @ shares.T)


def _smooth(way: Way, breaks: Array, degree: int, order: int) -> Pieces:
    """All polynomials between breaks that keep reference conditions.

    They have `order` derivatives, the value among them, that do not jump.
    """
    many, n = len(breaks) - 1, degree + 1
    single = np.eye(n)
    rows = []

    def ends(k: int, side: float, derivative: int) -> Array:
        row = np.zeros((many, n))
        scale = (2.0 / (breaks[k + 1] - breaks[k])) ** derivative
        row[k] = scale * legendre.legval(side, legendre.legder(single, derivative))
        return row.ravel()

    rows = [ends(0, -1.0, d) for d in range(2 if way == 'clamped' else 1)]
    if way == 'pinned':
        rows.append(ends(many - 1, 1.0, 0))
    for k in range(many - 1):
        for d in range(order):
            scale = (breaks[k + 1] - breaks[k]) ** d
            rows.append(scale * (ends(k, 1.0, d) - ends(k + 1, -1.0, d)))
    kept = np.array(rows)
    _, _, vectors = np.linalg.svd(kept)
    return Pieces(breaks, vectors[len(kept) :].T.reshape(many, n, -1))
