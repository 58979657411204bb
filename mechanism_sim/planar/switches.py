"""What changes from one part of a cycle to another: flags, and tables of numbers.

The integrator knows the present row only, as runtime parameters; a guard ends a step where the
next row begins. So a table of any length costs the same.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.errors import RunError

Array = NDArray[np.float64]

SWITCH_MARGIN = 1e-12
"""How far past zero a switch turns over: as far the other way is the next time."""

_BEYOND = 1e-9  # of its length: what a table that is not periodic allows for rounding at its ends


class Switch(NamedTuple):
    """Something that acts only where a function of the coordinates is positive."""

    flag: hy.expression  #: symbol of 1 or 0
    inside: hy.expression

    @property
    def symbols(self) -> tuple[hy.expression, ...]:
        """The flag."""
        return (self.flag,)

    @property
    def guard(self) -> hy.expression:
        """Falls through zero where the flag changes."""
        return (2.0 * self.flag - 1.0) * self.inside

    @property
    def place(self) -> hy.expression:
        """What the present row follows from."""
        return self.inside

    def check(self, places: Array) -> None:
        """It holds everywhere."""

    def row_at(self, place: float) -> int:
        """1 inside, else 0."""
        return int(place > 0.0)

    def row_after(self, row: int, _: float) -> int:
        """The other one."""
        return 1 - row

    def values(self, row: int) -> list[float]:
        """Of the symbols."""
        return [float(row)]

    def values_at(self, places: Array) -> Array:
        """Of the symbol at places (N,): (1, N)."""
        return (places > 0.0).astype(float)[None]


class Table:
    """Rows of numbers along a coordinate; see `Frames.table` for the parameters.

    With the place x and the middle and the half length of the present row, the guard of a periodic
    table is ``1 - (sin((x - middle)/2)/sin(half/2))^2``, whatever the turns in x; of a straight
    one ``1 - ((x - middle)/half)^2``, the outermost rows being a hair longer for it.

    Attributes
    ----------
    symbols : of the n numbers of the present row, and of its bounds
    local : the place from the middle of the row
    guard : falls through zero where the next row begins
    """

    def __init__(
        self,
        name: str,
        symbol: str,
        place: hy.expression,
        breaks: Array,
        rows: Array,
        periodic: bool,
    ) -> None:
        self.name, self.place = name, place
        self._breaks, self._rows, self._periodic = np.array(breaks), np.array(rows), periodic
        ends = self._breaks
        self._middle, half = 0.5 * (ends[1:] + ends[:-1]), 0.5 * np.diff(ends)
        if periodic:
            turned = 0.5 * self._middle
            bounds = [np.cos(turned), np.sin(turned), 1.0 / np.sin(0.5 * half)]
        else:
            hair = _BEYOND * (ends[-1] - ends[0])
            ends = np.array([ends[0] - hair, *ends[1:-1], ends[-1] + hair])
            bounds = [self._middle, 0.5 * (ends[1:] + ends[:-1]), 2.0 / np.diff(ends)]
        self._values = np.column_stack([self._rows, *bounds])
        self.symbols = tuple(hy.make_vars(f'{symbol}_{k}') for k in range(len(self._values.T)))
        own = self.symbols[self._rows.shape[1] :]
        if periodic:
            c, s = hy.cos(0.5 * place), hy.sin(0.5 * place)
            sine = s * own[0] - c * own[1]
            self.local = 2.0 * hy.atan(sine / (c * own[0] + s * own[1]))
            share = sine * own[2]
        else:
            self.local = place - own[0]
            share = (place - own[1]) * own[2]
        self.guard = 1.0 - share * share

    @property
    def numbers(self) -> tuple[hy.expression, ...]:
        """Symbols of the numbers of the present row."""
        return self.symbols[: self._rows.shape[1]]

    def rows_at(self, places: Array) -> NDArray[np.intp]:
        """The rows (N,) at places (N,) [rad, m]."""
        if self._periodic:
            first = self._breaks[0]
            places = first + (places - first) % (2.0 * math.pi)
        return np.searchsorted(self._breaks[1:-1], places, 'right')

    def row_at(self, place: float) -> int:
        """The row at a place [rad, m]."""
        return int(self.rows_at(np.array(place)))

    def row_after(self, row: int, place: float) -> int:
        """The row that begins where another one ends, at a place near its end.

        Raises
        ------
        RunError
            If there is none.
        """
        away = place - float(self._middle[row])
        if self._periodic:
            return (row + (1 if math.sin(away) > 0.0 else -1)) % len(self._rows)
        after = row + (1 if away > 0.0 else -1)
        if not 0 <= after < len(self._rows):
            raise self._outside(place)
        return after

    def check(self, places: Array) -> None:
        """Refuse places (N,) [rad, m] where no row holds, but for rounding.

        Raises
        ------
        RunError
        """
        first, last = self._breaks[[0, -1]]
        beyond = np.maximum(first - places, places - last)
        if not self._periodic and beyond.max(initial=0.0) > 2.0 * _BEYOND * (last - first):
            raise self._outside(float(places[beyond.argmax()]))

    def _outside(self, place: float) -> RunError:
        first, last = self._breaks[[0, -1]]
        return RunError(
            f'{self.name} comes to {place:.6g} m, but its law goes from {first:.6g} to '
            f'{last:.6g} m only'
        )

    def values(self, row: int) -> list[float]:
        """Of the symbols in a row."""
        found: list[float] = self._values[row].tolist()
        return found

    def values_at(self, places: Array) -> Array:
        """Of the n symbols at places (N,): (n, N)."""
        found: Array = self._values[self.rows_at(places)].T
        return found
