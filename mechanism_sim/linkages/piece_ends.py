"""Where pieces of an ideal motion must end, so that nodes on them tell all of loads and switches.

The motion itself is smooth on a sixteenth of a turn. A load along it may be a pulse of a
thousandth of that, and a switch may turn over twice between two nodes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.enclosure import MUCH, MotionSeries, falls, reach_of
from mechanism_sim.planar.steep_loads import ResolvedLoads, SteepLoads
from mechanism_sim.planar.switched_functions import GuardRanges

_FLOOR = 1e-12  # of what moves the lightest link as fast as the drives: no load


class NominalPiece:
    """A candidate for a piece of motion: polynomials of n coordinates.

    Parameters
    ----------
    coefficients : (n, m) of rising powers of the time [s] since its start
    length, time : [s] of it, and at its start
    turns : (n,) whole turns that are left out
    symbols : (r,) values of the switches on it, all of them
    """

    def __init__(
        self,
        coefficients: Array,
        length: float,
        time: float,
        turns: Sequence[int],
        symbols: Array,
    ) -> None:
        self.length, self._time, self.symbols = length, time, symbols
        self._turns = turns
        power = np.arange(coefficients.shape[1])
        scaled = coefficients * length**power
        rates = np.zeros_like(scaled)
        rates[:, :-1] = scaled[:, 1:] * power[1:] / length
        self._series = (scaled, rates)

    def course(
        self,
        moving: Sequence[tuple[int, int]],
        timed: bool,
        turning: Sequence[int],
        symbols: Array,
        parameters: Array,
    ) -> MotionSeries:
        """Series: derivatives and coordinates as in `SteepLoads.moving`, then the time."""
        rows = [self._series[derivative][i] for derivative, i in moving]
        if timed:
            rows.append(np.zeros(self._series[0].shape[1]))
            rows[-1][:2] = self._time, self.length
        series = np.reshape(rows, (len(rows), self._series[0].shape[1]))
        turns = np.array([self._turns[i] for i in turning], float)
        return MotionSeries(series, self.length, np.concatenate([turns, symbols]), parameters)


class LoadsOnPieces:
    """How much of a piece nodes on it resolve all loads.

    Parameters
    ----------
    steep : the loads
    coordinates : their names in the order of those of pieces
    parameters : values of ``par[]``
    nodes : (m,) from 0 to 1, of which the interpolants are
    """

    def __init__(
        self,
        steep: SteepLoads,
        coordinates: Sequence[str],
        parameters: Sequence[float],
        nodes: Array,
    ) -> None:
        self._steep, self._resolved = steep, ResolvedLoads(steep, nodes)
        self._parameters = np.array(parameters)
        self._turning = [coordinates.index(x.rpartition('.')[0]) for x in steep.outside]

    def share(self, piece: NominalPiece, fastest: float) -> float:
        """Share of a piece, from its start, on which the loads are as their nodes have them.

        Parameters
        ----------
        fastest : [1/s] of the drives
        """
        steep = self._steep
        symbols = steep.switched(piece.symbols)
        course = piece.course(steep.moving, steep.timed, self._turning, symbols, self._parameters)
        floor = _FLOOR * max(fastest, 1.0) ** 2 * steep.inertia
        scales = np.append(floor * piece.length, np.full(steep.enclosure.guards, 1e-12))
        if steep.enclosure.doubts(course, scales) < MUCH:
            return 1.0
        found: list[Array] = []

        def look(places: Array) -> Array:
            found.append(places)
            return np.zeros(len(places))

        reach = reach_of(steep.enclosure, course, scales, look, MUCH)
        return self._resolved.longest(course, found, reach, floor)


class HiddenEdges:
    """Where switches turn over between nodes.

    Parameters
    ----------
    guards : of the switches
    coordinates : their names in the order of those of pieces
    parameters : values of ``par[]``
    """

    def __init__(
        self, guards: GuardRanges, coordinates: Sequence[str], parameters: Sequence[float]
    ) -> None:
        self._guards = guards
        self._turning = [coordinates.index(x.rpartition('.')[0]) for x in guards.outside]
        self._parameters = np.array(parameters)

    def within(self, piece: NominalPiece) -> list[float]:
        """Shares of a piece at which present rows have ended, though they hold at its nodes."""
        moving, timed, _, ranges = self._guards
        symbols, known = piece.symbols, self._parameters
        return falls(ranges, piece.course(moving, timed, self._turning, symbols, known))
