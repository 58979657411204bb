"""Pieces of an ideal motion by position: with a steady drive they repeat every turn."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.linkages.ideal import IdealMotion, LinkageMotion
from mechanism_sim.linkages.piece_ends import END
from mechanism_sim.planar.mechanism import HigherPair

_GRID = 2.0**38  # number of grid positions in 1 rad, or in the size of the mechanism
_MOST = 4096
_ALIKE = 1e-9  # closures, of the size of the mechanism, and their slopes: the same

Place: TypeAlias = tuple[bytes, float, float, float]
"""Positions on the grid, the rate of the drive, length of a piece, and the share tried first."""


class NextPiece(NamedTuple):
    """A piece of a motion, with data for the next one."""

    length: float  #: duration [s]
    coefficients: Array  #: (n, m) coefficients of powers of the time
    slope: Array | None  #: direction at its end, see `LinkageMotion.follow`
    switched: bool  #: whether a switch ends it
    share: float  #: share of the greatest length that was tried last
    smooth: bool  #: whether a piece of twice the length would be as exact
    cuts: tuple[float, ...] = ()  #: times [s] within it of onset or end of loads


class KnownPieces:
    """Pieces that begin at positions of a grid, and those that begin beside them.

    What is computed depends on the place alone, so that it is the same to the bit whether it is
    found here or made again.

    Parameters
    ----------
    ideal : ideal motion of n coordinates
    scale : (n,) scales of the coordinates [m] or [rad]
    first : (n,) a place of the motion

    Attributes
    ----------
    pitches : displacements, by their numbers, and after how far [m] closures are as before
    """

    def __init__(self, ideal: IdealMotion, scale: Array, first: Array) -> None:
        self._driven, self._scale = ideal.driven, scale
        self.pitches = _pitches(ideal, first)
        more = len(ideal.driven) != 1 or ideal.driven[0] in ideal.sliding
        self._more = more or bool(ideal.edges and ideal.edges.outside)
        self._pieces: dict[Place, NextPiece | None] = {}

    def __contains__(self, place: Place) -> bool:
        return place in self._pieces

    def place(
        self, last: Array, local: tuple[float, ...], length: float, share: float
    ) -> Place | None:
        """Grid position next to positions (n,); None unless these and a steady drive suffice.

        Parameters
        ----------
        local : the law of the drive in powers of the time from now on
        """
        if self._more or len(local) != 2 or not local[1]:
            return None
        start = (last - self.passed(last)) / self._scale
        start[self._driven] = local[0]
        return np.round(start * _GRID).tobytes(), local[1], length, share

    def passed(self, last: Array) -> Array:
        """Whole pitches (n,) in positions (n,): closures are the same without them."""
        whole = np.zeros_like(last)
        for i, pitch in self.pitches.items():
            whole[i] = pitch * math.floor(last[i] / pitch)
        return whole

    def start(self, place: Place) -> Array:
        """Positions (n,) of a grid position."""
        return np.asarray(np.frombuffer(place[0]) / _GRID * self._scale)

    def enter(self, place: Place, piece: NextPiece | None) -> None:
        """Keep the piece from there on; None, or one with a slope, if the place is not enough."""
        if len(self._pieces) >= _MOST:
            self._pieces.clear()
        self._pieces[place] = piece if piece and piece.slope is None else None

    def beside(self, place: Place, local: tuple[float, ...]) -> NextPiece | None:
        """Piece that begins beside a grid position, by the law of the drive.

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


def _pitches(ideal: IdealMotion, first: Array) -> dict[int, float]:
    """Periods [m] of displacements, by index, after which all closures repeat.

    Joints say what they repeat themselves after; others of the machine may not.

    Parameters
    ----------
    first : (n,) a place of the motion
    """
    found: dict[int, float] = {}
    if not isinstance(ideal, LinkageMotion) or (
        ideal.edges and {*ideal.edges.coordinates} - {*ideal.driven}
    ):
        return found
    mechanism = ideal.kinematics.mechanism
    pairs = [joint for joint in mechanism.joints if isinstance(joint, HigherPair)]
    pitches = {link: pitch for joint in pairs for link, pitch in joint.pitches.items()}
    for i in {*ideal.sliding} - {*ideal.driven}:
        if pitch := pitches.get(ideal.coordinates[i]):
            places = np.repeat(first[:, None], 3, axis=1)
            places[i] += pitch * np.arange(3)
            off, slopes = ideal.kinematics.closure(places)
            alike = np.abs(slopes - slopes[:1]).max() <= _ALIKE
            if alike and np.abs(off - off[:1]).max() <= _ALIKE * mechanism.size:
                found[i] = pitch
    return found
