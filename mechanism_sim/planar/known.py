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

Array = NDArray[np.float64]


class Known:
    """Groups of expressions at given instants; their switches are looked up, not computed.

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
            places = [s.place for s in self._switches]
            self._places = Evaluation(
                compiled.function(places, coordinates), parameters, [len(places)]
            )
        symbols = [x for s in self._switches for x in s.symbols]
        expressions = [dense(x) for group in groups for x in group]
        function = compiled.function(expressions, [*variables, *symbols])
        self._function = Evaluation(function, parameters, [len(group) for group in groups])

    def __call__(self, inputs: Array, switched_at: Array | None = None) -> list[Array]:
        """The groups of results, (size, N) each, at values (v, N) of the variables.

        Rows of switches are those of these coordinates, or of others (n, N).
        """
        if self._switches:
            place = inputs[: self._count] if switched_at is None else switched_at
            (places,) = self._places(place)
            rows = [s.values_at(x) for s, x in zip(self._switches, places, strict=True)]
            inputs = np.concatenate([inputs, *rows])
        return self._function(inputs)


class Edges:
    """Where along a motion other rows of switches begin.

    Parameters
    ----------
    frames : of which all switches are meant

    Attributes
    ----------
    coordinates : the indices of those that it takes to know
    """

    def __init__(self, frames: Frames) -> None:
        self._switches = [*frames.switches.values()]
        coordinates, parameters = [*frames.q.values()], frames.parameters.values
        named = {x for s in self._switches for x in hy.get_variables(s.place)}
        self.coordinates = [i for i, q in enumerate(coordinates) if str(q) in named]
        count = len(self._switches)
        symbols = [x for s in self._switches for x in s.symbols]
        self._places = Evaluation(
            compiled.function([s.place for s in self._switches], coordinates), parameters, [count]
        )
        self._guards = Evaluation(
            compiled.function([s.guard for s in self._switches], [*coordinates, *symbols]),
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
        (places,) = self._places(q[:, None])
        rows = [s.values_at(x) for s, x in zip(self._switches, places, strict=True)]
        return np.concatenate(rows)

    def left(self, q: Array, present: Array) -> Array:
        """What is negative (g, N) at coordinates (n, N) where the present rows have ended."""
        known = np.repeat(present, q.shape[1], axis=1)
        return self._guards(np.concatenate([q, known]))[0]
