"""Pieces of an ideal motion by what they follow from: a steady drive comes by them every turn."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.linkages.ideal import IdealMotion
from mechanism_sim.linkages.piece_ends import END

_GRID = 2.0**38
"""Places in 1 rad, or in the size of the mechanism, to which a start is rounded."""
_MOST = 4096

Place: TypeAlias = tuple[bytes, float, float, float]
"""Positions on the grid, the rate of the drive, length of a piece, and the share tried first."""


class NextPiece(NamedTuple):
    """A piece of a motion, and how the run goes on behind it."""

    length: float  #: [s]
    coefficients: Array  #: (n, m) of powers of the time
    slope: Array | None  #: at its end, as of `IdealMotion.follow`
    switched: bool  #: whether a switch ends it
    share: float  #: of the greatest length, that was tried last
    smooth: bool  #: whether one of twice the length is as exact
    cuts: tuple[float, ...] = ()  #: [s] within it, at which loads begin or cease to act


class KnownPieces:
    """Pieces that begin at places of a grid, and those that begin beside them.

    What is computed depends on the place alone, so that it is the same to the bit whether it is
    found here or made again.

    Parameters
    ----------
    ideal : of whose motion they are, n coordinates
    scale : (n,) [m] or [rad]
    """

    def __init__(self, ideal: IdealMotion, scale: Array) -> None:
        self._driven, self._scale = ideal.driven, scale
        more = len(ideal.driven) != 1 or ideal.driven[0] in ideal.sliding
        self._more = more or bool(ideal.edges and ideal.edges.outside)
        self._pieces: dict[Place, NextPiece | None] = {}

    def __contains__(self, place: Place) -> bool:
        return place in self._pieces

    def place(
        self, last: Array, local: tuple[float, ...], length: float, share: float
    ) -> Place | None:
        """The place next to positions (n,); None if the drive is not steady, or more counts.

        Parameters
        ----------
        local : the law of the drive in powers of the time from now on
        """
        if self._more or len(local) != 2 or not local[1]:
            return None
        start = last / self._scale
        start[self._driven] = local[0]
        return np.round(start * _GRID).tobytes(), local[1], length, share

    def start(self, place: Place) -> Array:
        """Positions (n,) there."""
        return np.asarray(np.frombuffer(place[0]) / _GRID * self._scale)

    def enter(self, place: Place, piece: NextPiece | None) -> None:
        """Keep the piece from there on; None, or one with a slope, if the place is not enough."""
        if len(self._pieces) >= _MOST:
            self._pieces.clear()
        self._pieces[place] = piece if piece and piece.slope is None else None

    def beside(self, place: Place, local: tuple[float, ...]) -> NextPiece | None:
        """The piece that begins beside a place, where the law of the drive has it.

        The first derivatives move its polynomials there: the square of what is left is nothing.
        """
        if (piece := self._pieces[place]) is None:
            return None
        off = (local[0] - float(self.start(place)[self._driven[0]])) / local[1]
        coefficients = piece.coefficients.copy()
        power = np.arange(1.0, coefficients.shape[1])
        coefficients[:, :-1] += off * power * coefficients[:, 1:]
        coefficients[self._driven, :2] = local
        length = min(piece.length - off * piece.switched, place[2])  # a switch may be at its end
        if length <= abs(off):
            return None
        last = length * (1.0 - END)
        cuts = tuple(t - off for t in piece.cuts if 0.0 < t - off < last)
        return piece._replace(length=length, coefficients=coefficients, cuts=cuts)
