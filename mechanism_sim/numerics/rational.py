"""Transfer functions of linear systems by their zeros and poles, and their partial fractions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_CLOSE = 1e-3
"""Poles nearer to each other than this, relative to their size, are taken for a multiple one."""
_APART = {1: 0.0, 2: 1e-5, 3: 1e-3, 4: 6e-3}
"""How far the poles of a multiple one are moved apart, by its order m: the transfer function
changes by about the m-th power of that, and rounding grows by the (m - 1)-th power of its inverse.
"""
_AT_ZERO = 1e-5
"""[rad/s] what poles at zero are moved apart by."""


class Modes(NamedTuple):
    """A linear system: ``y = direct u + sum_k residues_k z_k``, ``z_k' = poles_k z_k + u``.

    Of a pair of conjugate poles both are here; poles differ from each other.
    """

    poles: ComplexArray  #: (k,) [rad/s]
    residues: ComplexArray  #: (outputs, inputs, k)
    direct: Array  #: (outputs, inputs)


@dataclass(frozen=True)
class Rational:
    """``H(s) = gain prod(s - zeros) / prod(s - poles)``; zeros and poles in conjugate pairs."""

    zeros: tuple[complex, ...] = ()  #: [rad/s]
    poles: tuple[complex, ...] = ()  #: [rad/s]
    gain: float = 1.0

    @classmethod
    def of(cls, zeros: ArrayLike, poles: ArrayLike, gain: float) -> Rational:
        """From sequences, such as those `scipy.signal.butter` gives for ``output='zpk'``."""
        return cls(
            tuple(np.asarray(zeros, complex).tolist()),
            tuple(np.asarray(poles, complex).tolist()),
            float(gain),
        )

    def __mul__(self, other: Rational) -> Rational:
        """One system behind the other; a zero at zero cancels a pole there."""
        zeros, poles = [*self.zeros, *other.zeros], [*self.poles, *other.poles]
        while 0.0 in zeros and 0.0 in poles:
            zeros.remove(0.0)
            poles.remove(0.0)
        return Rational(tuple(zeros), tuple(poles), self.gain * other.gain)

    def __call__(self, s: ArrayLike) -> ComplexArray:
        """Value at complex frequencies `s` [rad/s], of any shape."""
        s = np.asarray(s, complex)
        value = np.full(s.shape, self.gain, complex)
        for z in self.zeros:
            value *= s - z
        for p in self.poles:
            value /= s - p
        return value

    def modes(self) -> Modes:
        """Partial fractions, one input and one output; multiple poles are moved apart a little.

        Raises
        ------
        ValueError
            If there are more zeros than poles: no system of this kind is causal.
        """
        if len(self.zeros) > len(self.poles):
            raise ValueError('a system with more zeros than poles has no partial fractions')
        poles = separated(np.array(self.poles, complex))
        apart = poles[:, None] - poles
        np.fill_diagonal(apart, 1.0)
        to_zeros = poles[:, None] - np.array(self.zeros, complex)
        residues = self.gain * to_zeros.prod(axis=1) / apart.prod(axis=1)
        direct = self.gain if len(self.zeros) == len(self.poles) else 0.0
        return Modes(poles, residues[None, None], np.array([[direct]]))


def separated(poles: ComplexArray) -> ComplexArray:
    """The same poles (k,), those that coincide moved apart on a circle about their place.

    Raises
    ------
    ValueError
        If more than four coincide.
    """
    rest, found = list(poles), []
    while rest:
        p = rest[0]
        near = [q for q in rest if abs(q - p) <= _CLOSE * abs(p)]
        rest = [q for q in rest if abs(q - p) > _CLOSE * abs(p)]
        m = len(near)
        if m not in _APART:
            raise ValueError(f'{m} coinciding poles at {p:g} rad/s are more than four')
        least = min((abs(a - b) for i, a in enumerate(near) for b in near[:i]), default=np.inf)
        radius = _APART[m] * abs(p) if p else _AT_ZERO * (m > 1)
        if least >= radius:
            found += near
            continue
        centre = sum(near) / m
        # about an imaginary direction poles at zero would be stable on neither side
        turn = 1j if not p else 1.0
        circle = turn * np.exp(2j * np.pi * np.arange(m) / m)
        if abs(centre.imag) <= _CLOSE * _APART[m] * abs(centre):  # conjugates met, or real poles
            centre = centre.real
            circle.imag[np.abs(circle.imag) < _CLOSE] = 0.0  # rounding must leave the real axis
        elif p.imag < 0.0:
            circle = circle.conj()
        found += list(centre + radius * circle)
    return np.array(found, complex)
