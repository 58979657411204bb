"""Drawing of elastic links: deformations magnified by a round factor, with scale bars."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.mechanism import Mechanism

_STATIONS = 41  # points along an axis from which viewers without shape functions draw

_VISIBLE, _MOST = 0.04, 1000.0
"""Share of a machine's size that the largest deflection covers, and greatest magnification."""


@dataclass(frozen=True)
class Bending:
    """The field of displacements of a link, linear in its elastic coordinates.

    The magnified quantity is the distance of the axis from the straight line through the outermost
    joints of the link (from the parallel through a single one), so that these stay where they are.
    """

    beam: Beam
    ends: tuple[float, float]  #: positions [m] of these joints along the axis
    magnified: float = 1.0  #: magnification of deformations

    def fields(self, x: Array) -> tuple[Array, Array, Array]:
        """Displacements along and across the axis [m], and slopes, at x (k,) [m]: (n, k) each."""
        beam, m = self.beam, self.magnified
        modes = len(beam.names) - beam.stretch

        def at(x: Array) -> Array:
            none = np.zeros((len(beam.names), len(x)))
            none[modes:] = beam.elongation(x)
            return np.stack([none, np.pad(beam.deflection(x), ((0, beam.stretch), (0, 0)))])

        first, last = np.array(self.ends)
        base, top = at(np.array([first, last])).transpose(2, 0, 1)[..., None]
        rate = (top - base) / (last - first) if last > first else 0.0 * base
        (along, across) = m * at(x) - (m - 1.0) * (base + rate * (x - first))
        slope = m * np.pad(beam.deflection(x, 1), ((0, beam.stretch), (0, 0)))
        return along, across, slope - (m - 1.0) * rate[1]

    def moved(self, points: Array, amplitudes: Array) -> Array:
        """Deformed points (N, k, 2) [m] of points (k, 2) [m] at elastic coordinates (N, n)."""
        x = np.clip(points[:, 0], 0.0, self.beam.length)
        along, across, slope = self.fields(x)
        across = across + (points[:, 0] - x) * slope
        shifts = np.stack([along - points[:, 1] * slope, across], axis=-1)
        return np.asarray(points + np.tensordot(amplitudes, shifts, 1))

    def to_json(self) -> dict[str, Any]:
        """Fields at equidistant stations along the axis."""
        named = zip(('along', 'across', 'slope'), self.fields(self._stations), strict=True)
        return {'length': self.beam.length, **{name: x.tolist() for name, x in named}}

    @property
    def _stations(self) -> Array:
        return np.linspace(0.0, self.beam.length, _STATIONS)

    def largest(self, amplitudes: Array) -> float:
        """The largest magnified distance [m] at coordinates (N, n)."""
        along, across, _ = replace(self, magnified=2.0).fields(self._stations)
        true = replace(self, magnified=1.0).fields(self._stations)
        bent = np.hypot(amplitudes @ (along - true[0]), amplitudes @ (across - true[1]))
        return float(np.nanmax(bent, initial=0.0))


def bendings(
    mechanism: Mechanism, q: Array, size: float, magnified: float = 0.0
) -> dict[str, Bending]:
    """Drawings of the elastic links of a mechanism over its coordinates q (n, N), by link.

    Parameters
    ----------
    size : size of the machine [m]
    magnified : magnification; 0 for a round number that makes bending visible
    """
    found: dict[str, Bending] = {}
    for link, beam in mechanism.having(Beam).items():
        sides = [
            side for j in mechanism.joints
            for side in j.points
        ]  # fmt: skip
        places = [min(max(at[0], 0.0), beam.length) for name, at in sides if name == link]
        found[link] = Bending(beam, (min(places, default=0.0), max(places, default=0.0)))
    if not magnified:
        bent = [x.largest(q[mechanism.amplitudes(link)].T) for link, x in found.items()]
        share = max(bent, default=0.0) / size
        magnified = round_below(min(max(_VISIBLE / share, 1.0), _MOST)) if share else 1.0
    return {link: replace(x, magnified=magnified) for link, x in found.items()}


def round_below(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... not above a positive value."""
    above = value * (1.0 + 1e-9)  # e.g. a thousand less a rounding error
    decade = 10.0 ** math.floor(math.log10(above))
    return max(x * decade for x in (1.0, 2.0, 5.0) if x * decade <= above)


def scale_bar(width: float) -> tuple[float, str]:
    """A round length [m] of at most a fifth of a drawing's width [m], and its text."""
    length = round_below(0.2 * width)
    unit, name = next(x for x in ((1.0, 'm'), (1e-3, 'mm'), (0.0, 'µm')) if length >= x[0])
    return length, f'{length / (unit or 1e-6):.3g} {name}'
