"""Ends of pieces of an ideal motion, such that their nodes resolve all loads and switches.

The motion itself is smooth on a sixteenth of a turn. A load along it may be a pulse of a
thousandth of that, and a switch may turn over twice between two nodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.enclosure import MUCH, MotionSeries, falls, reach_of
from mechanism_sim.numerics.polynomials import chebyshev_nodes, shift_powers
from mechanism_sim.planar.steep_loads import ResolvedLoads, SteepLoads
from mechanism_sim.planar.switched_functions import Edges, GuardRanges
from mechanism_sim.tolerances import TOLERANCES

_MECHANISM = TOLERANCES.mechanism

NODES = chebyshev_nodes(15)
"""Nodes of the polynomials of pieces, as shares of their length."""
ENDED = np.array([*NODES, 1.0])
AHEAD = 1e-9  # of a piece: where the rows are looked for that begin at an edge
END = 1e-12  # of a piece: what lies no farther beyond its end is at its end

_EPS = float(np.finfo(float).eps)
_FLOOR = 1e-12  # of what moves the lightest link as fast as the drives: no load
_TENTHS = 10.0 ** -np.arange(1, 9)

States = Callable[[Array], Array]
"""States (2n + k, N) as of `Edges` at times (N,) [s] from the start of a piece."""


def until_switch(
    edges: Edges,
    h: float,
    ahead: float,
    states: States,
    exact: States,
    looked: Sequence[float] = (),
) -> tuple[float, Array]:
    """The next h [s], or as much of it as ends where another row of a switch begins.

    Parameters
    ----------
    ahead : [s] what begins at an edge has the rows that hold so much later
    states : near enough to know whether there is one
    exact : to know where
    looked : [s] times at which it is looked for beside the nodes

    Returns
    -------
    The time [s], and the values (r,) of the switches until then.
    """
    times, rounding = np.sort([*(h * ENDED), *(t for t in looked if t < h)]), _EPS * h
    begun = [0.0, ahead]
    every, first = np.split(states(np.append(times, begun)), [len(times)], axis=1)
    edges.check(every[: (len(every) - len(edges.outside)) // 2])
    for since, state in zip(begun, first.T, strict=True):
        present = edges.present(state)
        seen = edges.left(every, present)
        over = np.flatnonzero((seen < 0.0).any(axis=0))
        if not over.size:
            break
        ends, b = [], times[over[0]]
        for i in np.flatnonzero(seen[:, over[0]] < 0.0):

            def guard(t: Array, i: int = int(i), present: Array = present) -> Array:
                return np.asarray(edges.left(exact(t), present)[i])

            a = times[over[0] - 1] if over[0] else since
            ends.append(_fall(guard, float(a), float(b), rounding))
        if min(ends) > ahead:
            return min(ends), present[:, 0]
    return h, present[:, 0]


def _fall(guard: Callable[[Array], Array], a: float, b: float, width: float) -> float:
    """Time of a guard's fall below zero between times [s], to `width`; `a` without a fall.

    Loops are closed at many times at once, for that costs little more than at one: about where
    the chord falls, by powers of ten, and at quarters, so that each round at least halves it.
    """
    before, after = guard(np.array([a, b])).tolist()
    while before >= 0.0 > after and b - a > width:
        chord = before / (before - after)
        places = np.unique([*(chord - _TENTHS), 0.25, 0.5, 0.75, *(chord + _TENTHS)])
        t = a + (b - a) * places
        t = t[(t > a) & (t < b)]
        if not t.size:
            break
        values = guard(t)
        k = int(np.argmax(values < 0.0)) if (values < 0.0).any() else len(t)
        if k < len(t):
            b, after = float(t[k]), float(values[k])
        if k:
            a, before = float(t[k - 1]), float(values[k - 1])
    return a


class SmoothPiece(NamedTuple):
    """A piece of a motion as closures alone have it."""

    coefficients: Array  #: (n, m) of rising powers of the time [s] since its start
    length: float  #: [s]
    time: float  #: [s] at its start
    turns: Sequence[int]  #: (n,) whole turns that are left out
    fastest: float  #: [1/s] of the drives

    def since(self, begin: float) -> SmoothPiece:
        """The part of it from a time [s] on."""
        by = np.full(len(self.coefficients), begin)
        moved = shift_powers(self.coefficients, by) if begin else self.coefficients
        return self._replace(
            coefficients=moved, length=self.length - begin, time=self.time + begin
        )


class LoadCuts:
    """Cuts of a piece where loads begin or cease to act, or nodes no longer resolve them.

    The motion goes on there as it was: its polynomials are those of both sides.

    Parameters
    ----------
    edges : at which something begins or ceases to act; None if nothing does
    steep : loads that nodes must resolve; None if there are none
    coordinates : names of the n coordinates
    driven : which of them are known by their laws

    Attributes
    ----------
    varied : True if loads follow from more than positions and rates
    """

    def __init__(
        self,
        edges: Edges | None,
        steep: SteepLoads | None,
        coordinates: Sequence[str],
        driven: Sequence[int],
    ) -> None:
        self._edges = edges
        guards = edges.ranges(driven) if edges else None
        self._hidden = (
            HiddenEdges(guards, coordinates, edges.parameters) if edges and guards else None
        )
        self._loads = LoadsOnPieces(steep, coordinates, NODES) if steep else None
        more = (edges and edges.outside) or (steep and (steep.timed or steep.outside))
        self.varied = bool(more)

    def within(
        self,
        piece: SmoothPiece,
        near: Callable[[Edges, Array], Array],
        exact: Callable[[Edges, Array], Array],
    ) -> tuple[float, ...]:
        """Times [s] within a piece, in their order.

        Parameters
        ----------
        near, exact : states (2n + k, N) as of `Edges` at times (N,) [s] from its start, by its
            polynomials and by closures
        """
        cuts, begin = list[float](), 0.0
        while begin < piece.length * (1.0 - END):
            part, looked, seen = piece.since(begin), math.inf, list[float]()
            h, present = part.length, np.zeros(0)
            while True:
                if edges := self._edges:
                    states, exactly = (partial(_later, x, edges, begin) for x in (near, exact))
                    ahead = AHEAD * piece.length
                    h, present = until_switch(edges, h, ahead, states, exactly, seen)
                whole = NominalPiece(part, h, present)
                if self._hidden is None or h >= looked:
                    break
                looked, seen = h, [h * x for x in self._hidden.within(whole)]
                if not seen:
                    break
            resolved = 1.0
            if self._loads and h > _MECHANISM.shortest_part * piece.length:
                resolved = self._loads.share(whole, piece.fastest)
            begin += resolved * h
            cuts.append(begin)
        return tuple(cuts[:-1])


class NominalPiece:
    """A candidate for a piece of motion: polynomials of n coordinates.

    Parameters
    ----------
    piece : of whose beginning it is
    length : [s]
    symbols : (r,) values of the switches on it, all of them
    """

    def __init__(self, piece: SmoothPiece, length: float, symbols: Array) -> None:
        self.length, self._time, self.symbols = length, piece.time, symbols
        self._turns = piece.turns
        power = np.arange(piece.coefficients.shape[1])
        scaled = piece.coefficients * length**power
        rates = np.zeros_like(scaled)
        rates[:, :-1] = scaled[:, 1:] * power[1:] / length
        self._series = (scaled, rates)

    def motion(
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


def _later(
    states: Callable[[Edges, Array], Array], edges: Edges, begin: float, times: Array
) -> Array:
    return states(edges, begin + times)


class LoadsOnPieces:
    """Test of the share of a piece over which its nodes resolve all loads.

    Parameters
    ----------
    steep : the loads
    coordinates : their names in the order of those of pieces
    nodes : (m,) from 0 to 1, of which the interpolants are
    """

    def __init__(self, steep: SteepLoads, coordinates: Sequence[str], nodes: Array) -> None:
        self._steep, self._resolved = steep, ResolvedLoads(steep, nodes)
        self._parameters = np.array(steep.parameters)
        self._turning = [coordinates.index(x.rpartition('.')[0]) for x in steep.outside]

    def share(self, piece: NominalPiece, fastest: float) -> float:
        """Share of a piece, from its start, on which the loads are as their nodes have them.

        Parameters
        ----------
        fastest : [1/s] of the drives
        """
        steep = self._steep
        symbols = steep.switched(piece.symbols)
        motion = piece.motion(steep.moving, steep.timed, self._turning, symbols, self._parameters)
        floor = _FLOOR * max(fastest, 1.0) ** 2 * steep.inertia
        scales = np.append(floor * piece.length, np.full(steep.enclosure.guards, 1e-12))
        if steep.enclosure.doubts(motion, scales) < MUCH:
            return 1.0
        found: list[Array] = []

        def look(places: Array) -> Array:
            found.append(places)
            return np.zeros(len(places))

        reach = reach_of(steep.enclosure, motion, scales, look, MUCH)
        return self._resolved.longest(motion, found, reach, floor)


class HiddenEdges:
    """Search for changes of switches between nodes.

    Parameters
    ----------
    guards : guards of the switches
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
        return falls(ranges, piece.motion(moving, timed, self._turning, symbols, known))
