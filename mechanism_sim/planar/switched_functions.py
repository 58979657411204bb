"""Compiled functions of a known motion, from which the rows of switches follow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.compiled import Evaluation
from mechanism_sim.numerics.enclosure import FunctionRanges
from mechanism_sim.numerics.symbolic import Term, dense, substitute
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.switches import Switch, SwitchTable, by_level
from mechanism_sim.tolerances import TOLERANCES

_SWITCHES = TOLERANCES.switches
_LOOKS = np.linspace(0.0, 1.0, 9)
_APPROACHES = 8  # of ends of rows, by the mean slope beside them
_NEAR = 1e-14  # of the time looked at: then the last of them was a rounding


class SwitchedFunction:
    """Groups of expressions at given instants; their switches are looked up, not computed.

    Where the instants belong to segments of a motion, so do their rows: see `Edges.within`.

    Parameters
    ----------
    frames : of the expressions; all of their switches must have been asked for
    groups : groups of expressions
    variables : v symbols; switches that depend on others must not occur in the expressions
    """

    def __init__(
        self, frames: Frames, groups: Sequence[Sequence[Term]], variables: Sequence[hy.expression]
    ) -> None:
        self._switches = _Switches(frames, variables)
        symbols = self._switches.symbols
        terms = [x for group in groups for x in group]
        # a Jacobian of many links is mostly structural zeros, which take long to compile
        sparse = len(terms) > 2 * sum(x is not None for x in terms) > 0
        self._rows = [i for i, x in enumerate(terms) if not (sparse and x is None)]
        expressions = [dense(terms[i]) for i in self._rows]
        sizes = [len(expressions)] if sparse else [len(group) for group in groups]
        self._function = Evaluation(
            expressions, [*variables, *symbols], frames.parameters.values, sizes
        )
        self._ends = np.cumsum([len(group) for group in groups]) if sparse else None

    def __call__(self, inputs: Array, rows: Array | None = None) -> list[Array]:
        """The groups of results, (size, N) each, at values (v, N) of the variables.

        The values (k, N) of the switches are by default those at these positions.
        """
        if self._switches.symbols:
            rows = self._switches(inputs)[1] if rows is None else rows[self._switches.known]
            inputs = np.concatenate([inputs, rows])
        found = self._function(inputs)
        if self._ends is None:
            return found
        every = np.zeros((self._ends[-1], inputs.shape[1]))
        every[self._rows] = found[0]
        return np.split(every, self._ends[:-1])

    def rows(self, inputs: Array) -> Array:
        """The values (k, N) of the switches at values (v, N) of the variables."""
        return self._switches(inputs)[1]


class _Switches:
    """The switches that are determined by given variables, at their values.

    Parameters
    ----------
    variables : v symbols

    Attributes
    ----------
    symbols : r symbols of these switches
    known : (R,) mask of these, or of given variables, among the symbols of all switches
    """

    def __init__(self, frames: Frames, variables: Sequence[hy.expression]) -> None:
        every = [*frames.switches.values()]
        # the expressions of angles that count all their turns, unless the turns are given apart
        places = [s.place for s in every]
        given = {str(x) for x in variables}
        turns = {
            x: hy.expression(0.0)
            for name, x in frames.outside.items()
            if name.endswith('.turns') and str(x) not in given
        }
        places = substitute(places, turns)
        own: list[int] = []
        for k, place in enumerate(places):
            if given.issuperset(hy.get_variables(place)):
                own.append(k)
                given.update(str(x) for x in every[k].symbols)
        self.symbols = [x for k in own for x in every[k].symbols]
        self.known = np.array([str(x) in given for s in every for x in s.symbols], bool)
        self._levels: list[tuple[list[Switch | SwitchTable], Evaluation]] = []
        symbols: list[hy.expression] = []
        chosen = [every[k] for k in own]
        for level in by_level(chosen, [places[k] for k in own]):
            switches = [chosen[k] for k in level]
            function = Evaluation(
                [places[own[k]] for k in level], [*variables, *symbols],
                frames.parameters.values, [len(level)],
            )  # fmt: skip
            self._levels.append((switches, function))
            symbols += [x for s in switches for x in s.symbols]
        self._order = [symbols.index(x) for x in self.symbols]

    def __call__(self, inputs: Array) -> tuple[dict[int, Array], Array]:
        """Positions (N,) by the identity of each switch, and the values (r, N) of their symbols.

        Parameters
        ----------
        inputs : (v, N)
        """
        placed: dict[int, Array] = {}
        count = len(inputs)
        for switches, function in self._levels:
            (places,) = function(inputs)
            placed |= {id(s): x for s, x in zip(switches, places, strict=True)}
            values = [s.values_at(x) for s, x in zip(switches, places, strict=True)]
            inputs = np.concatenate([inputs, *values])
        return placed, inputs[count:][self._order]

    @property
    def depth(self) -> int:
        """Number of levels of switches that depend on each other."""
        return len(self._levels)


class GuardRanges(NamedTuple):
    """Enclosures of guards of switches, and their inputs."""

    moving: list[tuple[int, int]]  #: derivatives and indices of coordinates
    timed: bool  #: whether time is an input, too
    outside: tuple[str, ...]  #: names of whole turns among the inputs
    ranges: FunctionRanges


class Edges:
    """Search along a motion for the changes of switch rows.

    States (2n + k, N) are coordinates, their rates, and the inputs `outside`.

    Parameters
    ----------
    frames : frames of the switches

    Attributes
    ----------
    outside : names of inputs beside the motion: ``time``, ``COORDINATE.turns``
    coordinates : indices of the required coordinates, by their values or their rates
    rated : True if any rate is required
    of_loads : True if some switches belong to loads instead of closures
    parameters : values of ``par[]``
    """

    def __init__(self, frames: Frames) -> None:
        self.outside = tuple(frames.outside)
        variables = [*frames.q.values(), *frames.v.values(), *frames.outside.values()]
        self._every = every = [*frames.switches.values()]
        self._switches = _Switches(frames, variables)
        self._bounded = [s for s in every if isinstance(s, SwitchTable) and s.bounded]
        self._widths = [len(s.symbols) for s in every]
        named = {x for s in every for x in hy.get_variables(s.place)}
        rated = [str(v) in named for v in frames.v.values()]
        self.rated = any(rated)
        self.of_loads = any(':' in name for name in frames.switches)
        self.coordinates = [
            i for i, q in enumerate(frames.q.values()) if str(q) in named or rated[i]
        ]
        self._variables = [*variables, *self._switches.symbols]
        self._frames, self.parameters = frames, frames.parameters.values
        # what rests has a rate that is nothing but rounding
        held = [isinstance(s, Switch) and s.holds is not None for s in every]
        self._slack = np.where(held, _SWITCHES.rest, 0.0)[:, None]

    @cached_property
    def _guards(self) -> Evaluation:
        guards = [s.guard for s in self._every]
        return Evaluation(guards, self._variables, self.parameters, [len(guards)])

    def ranges(self, driven: Sequence[int]) -> GuardRanges | None:
        """Enclosures of the guards of rows; None if no change of rows can be missed.

        Of closures nothing does. Rows of a table follow each other along a coordinate that is
        driven: the next one is left no sooner than at another edge.
        """
        frames = self._frames
        steady = {str([*frames.q.values()][i]) for i in driven}
        guards = [
            s.guard
            for name, s in frames.switches.items()
            if ':' in name
            and not (
                (isinstance(s, SwitchTable) or name in frames.wide)
                and steady.issuperset(hy.get_variables(s.place))
            )
        ]
        if not guards:
            return None
        named = {x for guard in guards for x in hy.get_variables(guard)}
        moving = [
            (derivative, i, x)
            for derivative, symbols in enumerate((frames.q, frames.v))
            for i, x in enumerate(symbols.values())
            if str(x) in named
        ]
        timed = str(frames.outside.get('time')) in named
        turns = {
            n: x for n, x in frames.outside.items() if n.endswith('.turns') and str(x) in named
        }
        moves = [x for *_, x in moving] + ([frames.outside['time']] if timed else [])
        ranges = FunctionRanges(guards, moves, [*turns.values(), *self._switches.symbols])
        return GuardRanges([(d, i) for d, i, _ in moving], timed, tuple(turns), ranges)

    def check(self, q: Array) -> None:
        """Refuse coordinates (n, N) at rest, at time zero, where a switch has no row."""
        if not self._bounded:
            return
        rest = np.zeros((len(q) + len(self.outside), q.shape[1]))
        placed, _ = self._switches(np.concatenate([q, rest]))
        for table in self._bounded:
            table.check(placed[id(table)])

    def row_ends(self, states: Callable[[Array], Array], h: float) -> Array | None:
        """Times (k,) within (0, h) [s] at which rows of tables end, in their order.

        None if they cannot be told all at once: there are switches other than tables, or a place
        turns back, or is not nearly proportional to time.

        Parameters
        ----------
        states : (2n + k, N) at times (N,)
        """
        if not all(isinstance(s, SwitchTable) for s in self._every) or self._switches.depth != 1:
            return None
        times = h * _LOOKS
        placed, found = self._switches(states(times))[0], [np.zeros(0)]
        for table in self._every:
            assert isinstance(table, SwitchTable)  # noqa: S101 - as asked above
            x = placed[id(table)]
            ways = np.sign(np.diff(x))
            if (ways != ways[0]).any():
                return None
            ends = table.ends_between(float(x[0]), float(x[-1]))
            if not ends.size:
                continue
            rising = ways[0] * x
            k = np.searchsorted(rising, ways[0] * ends).clip(1, len(x) - 1)
            low, slope = times[k - 1], (x[k] - x[k - 1]) / (times[k] - times[k - 1])
            t = low + (ends - x[k - 1]) / slope
            for _ in range(_APPROACHES):
                off = self._switches(states(t))[0][id(table)] - ends
                t = t - off / slope
            if (np.abs(off) > _NEAR * np.abs(slope) * h).any():
                return None
            found.append(t)
        return np.unique(np.concatenate(found))

    def present(self, state: Array) -> Array:
        """The values (r, 1) of the switches in a state (2n + k,)."""
        return self._switches(state[:, None])[1]

    def within(self, start: Array, middle: Array) -> Array:
        """The values (r, N) of the switches in N segments of a motion, one row in each.

        They are those at the start, unless their guards have fallen in the middle: a segment
        begins within a rounding of the edge that ended the one before, on either side of it.

        Parameters
        ----------
        start, middle : states (2n + k, N) at both
        """
        values, later = self._switches(start)[1], self._switches(middle)[1]
        for _ in range(self._switches.depth):
            (guards,) = self._guards(np.concatenate([middle, values]))
            left = np.repeat(guards + _SWITCHES.margin <= 0.0, self._widths, axis=0)
            values = np.where(left, later, values)
        return values

    def left(self, states: Array, present: Array) -> Array:
        """Values (g, N), negative in states (2n + k, N) where the present rows have ended."""
        known = np.repeat(present, states.shape[1], axis=1)
        found: Array = self._guards(np.concatenate([states, known]))[0] + self._slack
        return found
