"""Where pieces of an ideal motion must end, so that nodes on them tell all of loads and switches.

The motion itself is smooth on a sixteenth of a turn. A load along it may be a pulse of a
thousandth of that, and a switch may turn over twice between two nodes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.enclosure import MUCH, Course, falls, reach_of
from mechanism_sim.numerics.polynomials import chebyshev_coefficients
from mechanism_sim.planar.steep_loads import SteepLoads
from mechanism_sim.planar.switched_functions import GuardRanges

Array = NDArray[np.float64]

_RESOLVED = 1e-8  # of a load's largest size on a piece: what its interpolant may be off
SHORTEST = 2.0**-30  # of a usual piece: shorter ones would never come past a pole
_CLOSE = 9  # places that are compared where a load falls right behind the start of a piece
_FLOOR = 1e-12  # of what moves the lightest link as fast as the drives: no load


class Piece:
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
    ) -> Course:
        """What runs: derivatives and coordinates as in `SteepLoads.moving`, then the time."""
        rows = [self._series[derivative][i] for derivative, i in moving]
        if timed:
            rows.append(np.zeros(self._series[0].shape[1]))
            rows[-1][:2] = self._time, self.length
        series = np.reshape(rows, (len(rows), self._series[0].shape[1]))
        turns = np.array([self._turns[i] for i in turning], float)
        return Course(series, self.length, np.concatenate([turns, symbols]), parameters)


class ResolvedLoads:
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
        self._steep, self._nodes = steep, nodes
        self._parameters = np.array(parameters)
        self._turning = [coordinates.index(x.rpartition('.')[0]) for x in steep.outside]
        self._loads = compiled.function(steep.loads, steep.variables)

    def share(self, piece: Piece, fastest: float) -> float:
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

        reach = reach_of(steep.enclosure, course, scales, look)
        places = np.sort(np.concatenate([[0.0], *found]))
        if reach.fault is not None:
            places = places[places <= max(reach.fault, places[1])]
        return self._longest(course, places, floor)

    def _longest(self, course: Course, places: Array, floor: Array) -> float:
        """The last of places, from 0 on, whose interpolant is right at all of them before it."""
        values = self._values(course, places)
        finite = np.asarray(np.isfinite(values).all(axis=0))
        if not finite[0]:  # whoever asks for forces there is told so
            return 1.0
        count = len(places) if finite.all() else int(finite.argmin())
        low, high = 1, count + 1
        tried = count  # mostly it is all of it
        while high - low > 1:
            if self._is_resolved(course, places[:tried], values[:, :tried], floor):
                low = tried
            else:
                high = tried
            tried = (low + high) // 2
        if low > 1:
            return float(places[low - 1])
        # a load that falls steeply right behind the start: there nobody has looked yet
        end = 0.5 * float(places[1])
        while end > SHORTEST:
            places = np.linspace(0.0, end, _CLOSE)
            if self._is_resolved(course, places, self._values(course, places), floor):
                return end
            end *= 0.5
        return SHORTEST

    def _is_resolved(self, course: Course, places: Array, values: Array, floor: Array) -> bool:
        end = places[-1]
        known = self._values(course, end * self._nodes)
        series = chebyshev_coefficients(known)
        at = np.polynomial.chebyshev.chebvander(2.0 * places / end - 1.0, series.shape[1] - 1)
        size = np.maximum(np.abs(values).max(axis=1), np.abs(known).max(axis=1))
        off = np.abs(series @ at.T - values).max(axis=1)
        return bool((off <= _RESOLVED * size + floor).all())

    def _values(self, course: Course, places: Array) -> Array:
        """The loads (l, N) at places."""
        series, _, fixed, parameters = course
        count = len(places)
        given = np.concatenate([
            series @ places ** np.arange(series.shape[1])[:, None],
            np.repeat(fixed[:, None], count, axis=1),
        ])  # fmt: skip
        known = np.repeat(parameters[: self._loads.nparams, None], count, axis=1)
        return np.asarray(self._loads(given, pars=known))


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

    def within(self, piece: Piece) -> list[float]:
        """Shares of a piece at which present rows have ended, though they hold at its nodes."""
        moving, timed, _, ranges = self._guards
        symbols, known = piece.symbols, self._parameters
        return falls(ranges, piece.course(moving, timed, self._turning, symbols, known))
