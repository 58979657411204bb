"""Compiled functions of a motion that is known: which rows of switches hold follows from it."""

from __future__ import annotations

from collections.abc import Sequence

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics import compiled
from mechanism_sim.numerics.evaluation import Evaluation
from mechanism_sim.numerics.symbolic import Term, dense
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.switches import SWITCH_MARGIN, Switch, Table

Array = NDArray[np.float64]


class SwitchedFunction:
    """Groups of expressions at given instants; their switches are looked up, not computed.

    Where the instants belong to segments of a motion, so do their rows: see `Edges.within`.

    Parameters
    ----------
    frames : of the expressions; all of their switches must have been asked for
    groups : of expressions
    variables : v symbols, the coordinates first
    """

    def __init__(
        self, frames: Frames, groups: Sequence[Sequence[Term]], variables: Sequence[hy.expression]
    ) -> None:
        self._switches = [*frames.switches.values()]
        coordinates = [*frames.q.values()]
        self._count = len(coordinates)
        parameters = frames.parameters.values
        if self._switches:
            places = with_all_turns(frames, [s.place for s in self._switches])
            self._places = Evaluation(
                compiled.function(places, coordinates), parameters, [len(places)]
            )
        symbols = [x for s in self._switches for x in s.symbols]
        terms = [x for group in groups for x in group]
        # a Jacobian of many links is mostly structural zeros, which take long to compile
        sparse = len(terms) > 2 * sum(x is not None for x in terms) > 0
        self._rows = [i for i, x in enumerate(terms) if not (sparse and x is None)]
        expressions = [dense(terms[i]) for i in self._rows]
        function = compiled.function(expressions, [*variables, *symbols])
        sizes = [len(expressions)] if sparse else [len(group) for group in groups]
        self._function = Evaluation(function, parameters, sizes)
        self._ends = np.cumsum([len(group) for group in groups]) if sparse else None

    def __call__(self, inputs: Array, rows: Array | None = None) -> list[Array]:
        """The groups of results, (size, N) each, at values (v, N) of the variables.

        The values (k, N) of the switches are those at these places, unless they are given.
        """
        if self._switches:
            if rows is None:
                rows = _values(self._switches, self._places(inputs[: self._count])[0])
            inputs = np.concatenate([inputs, rows])
        found = self._function(inputs)
        if self._ends is None:
            return found
        every = np.zeros((self._ends[-1], inputs.shape[1]))
        every[self._rows] = found[0]
        return np.split(every, self._ends[:-1])


class Edges:
    """Where along a motion other rows of switches begin.

    Parameters
    ----------
    frames : of which all switches are meant

    Attributes
    ----------
    coordinates : the indices of those that it takes to know
    unwound : whether angles must be given with all their turns
    """

    def __init__(self, frames: Frames) -> None:
        self._switches = [*frames.switches.values()]
        coordinates, parameters = [*frames.q.values()], frames.parameters.values
        places = with_all_turns(frames, [s.place for s in self._switches])
        guards = with_all_turns(frames, [s.guard for s in self._switches])
        named = {x for place in places for x in hy.get_variables(place)}
        self.unwound = places != [s.place for s in self._switches]
        self.coordinates = [i for i, q in enumerate(coordinates) if str(q) in named]
        count = len(self._switches)
        symbols = [x for s in self._switches for x in s.symbols]
        self._places = Evaluation(compiled.function(places, coordinates), parameters, [count])
        self._guards = Evaluation(
            compiled.function(guards, [*coordinates, *symbols]),
            parameters,
            [count],
        )

    def check(self, q: Array) -> None:
        """Refuse coordinates (n, N) where a switch has no row.

        Raises
        ------
        RunError
        """
        for known, places in zip(self._switches, self._places(q)[0], strict=True):
            known.check(places)

    def present(self, q: Array) -> Array:
        """The values (k, 1) of the switches at coordinates (n,)."""
        return _values(self._switches, self._places(q[:, None])[0])

    def within(self, start: Array, middle: Array) -> Array:
        """The values (k, N) of the switches in N segments of a motion, one row in each.

        They are those at the start, unless their guards have fallen in the middle: a segment
        begins within a rounding of the edge that ended the one before, on either side of it.

        Parameters
        ----------
        start, middle : coordinates (n, N) there
        """
        (at_start,), (places,) = self._places(start), self._places(middle)
        first = _values(self._switches, at_start)
        (guards,) = self._guards(np.concatenate([middle, first]))
        widths = [len(s.symbols) for s in self._switches]
        left = np.repeat(guards + SWITCH_MARGIN <= 0.0, widths, axis=0)
        return np.where(left, _values(self._switches, places), first)

    def left(self, q: Array, present: Array) -> Array:
        """What is negative (g, N) at coordinates (n, N) where the present rows have ended."""
        known = np.repeat(present, q.shape[1], axis=1)
        return self._guards(np.concatenate([q, known]))[0]


def with_all_turns(frames: Frames, expressions: Sequence[hy.expression]) -> list[hy.expression]:
    """The expressions of angles that count all their turns."""
    turns = {x: hy.expression(0.0) for name, x in frames.outside.items() if name != 'time'}
    return list(hy.subs(list(expressions), turns)) if turns else list(expressions)


def _values(switches: Sequence[Switch | Table], places: Array) -> Array:
    """The values (k, N) of switches at places (s, N)."""
    return np.concatenate([s.values_at(x) for s, x in zip(switches, places, strict=True)])
