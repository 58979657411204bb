"""Transfer functions of linear systems by their zeros and poles, and their partial fractions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array, ComplexArray, Mask
from mechanism_sim.tolerances import TOLERANCES

_HARMONICS = TOLERANCES.harmonics


class Modes(NamedTuple):
    """A linear system: ``y = direct u + sum_k residues_k z_k``, ``z_k' = poles_k z_k + u``.

    Both poles of a conjugate pair are included; poles differ from each other.
    """

    poles: ComplexArray  #: (k,) poles [rad/s]
    residues: ComplexArray  #: (outputs, inputs, k) residues
    direct: Array  #: (outputs, inputs) direct feed-through


@dataclass(frozen=True)
class Rational:
    """``H(s) = gain prod(s - zeros) / prod(s - poles)``; zeros and poles in conjugate pairs."""

    zeros: tuple[complex, ...] = ()  #: [rad/s]
    poles: tuple[complex, ...] = ()  #: [rad/s]
    gain: float = 1.0

    @classmethod
    def of(cls, zeros: ArrayLike, poles: ArrayLike, gain: float) -> Rational:
        """Rational function from sequences, as of `scipy.signal.butter` with ``output='zpk'``."""
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
    """Poles (k,), those that nearly coincide moved apart.

    With m poles in a circle of radius r about c goes ``prod(s - p) - r^m`` in place of
    ``prod(s - p)``, whose roots are about r apart. That changes the transfer function by about
    ``(r / c)^m``, and rounding grows by ``(c / r)^(m - 1)``: r makes both the same. Partial
    fractions of m poles farther apart than that lose no more.
    """
    rest, found = poles, np.zeros(0, complex)
    while cluster := _cluster(rest):
        near, centre, radius = cluster
        shifted = np.poly((rest[near] - centre) / radius)
        undamped = abs(centre.real) <= radius  # aside of their axis they would grow on one side
        shifted[-1] -= (1j ** near.sum() if centre else -1.0) if undamped else 1.0
        moved, rest = centre + radius * np.roots(shifted), rest[~near]
        if abs(centre.imag) > radius:
            moved = np.append(moved, moved.conj())
            rest = rest[np.abs(rest - centre.conjugate()) > radius]
        found = np.append(found, moved)
    return np.append(found, rest)


def _cluster(poles: ComplexArray) -> tuple[Mask, complex, float] | None:
    """Largest cluster of poles too near to each other, if any; its centre and radius."""
    sizes = np.abs(poles)
    for m in range(len(poles), 1, -1):
        apart = (_HARMONICS.lost * _HARMONICS.lost_growth ** (m - 2)) ** (1.0 / (2.0 * m - 1.0))
        radii = np.where(sizes > 0.0, apart * sizes, _HARMONICS.at_zero)
        # conjugates belong together where the real axis is near
        centres = np.where(np.abs(poles.imag) > radii, poles, poles.real)
        near = np.abs(poles - centres[:, None]) <= radii[:, None]
        most = int(near.sum(axis=1).argmax())
        if near[most].sum() >= m:
            return near[most], complex(centres[most]), float(radii[most])
    return None
