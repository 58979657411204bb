"""Switches between parts of a cycle: flags, and tables of numbers.

The integrator knows the present row only, as runtime parameters; a guard ends a step where the
next row begins. So a table of any length costs the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, IndexArray
from mechanism_sim.errors import RunError
from mechanism_sim.tolerances import TOLERANCES

_SWITCHES = TOLERANCES.switches


HOLDS = 2
"""The row of a switch that holds a motion."""


class Switch(NamedTuple):
    """Switch of a load that acts where a function of coordinates, rates and time is positive.

    Where it acts against the motion on both sides of zero, it holds the motion there, in part:
    A. F. Filippov, "Differential equations with discontinuous righthand sides", 1988, section 4.
    """

    flag: hy.expression  #: symbol of 1 or 0; while the switch holds, of its part
    inside: hy.expression
    holds: hy.expression | None = None  #: symbol of 1 while it holds; None without rates

    @property
    def symbols(self) -> tuple[hy.expression, ...]:
        """The flag, and whether it holds."""
        return (self.flag,) if self.holds is None else (self.flag, self.holds)

    @property
    def guard(self) -> hy.expression:
        """Falls through zero where the flag changes; while it holds, `held_guard` does."""
        beside = (2.0 * self.flag - 1.0) * self.inside
        return beside if self.holds is None else (1.0 - self.holds) * beside + self.holds

    @property
    def held_guard(self) -> hy.expression:
        """Falls through zero where holding ends: its part leaves 0 to 1."""
        return self.flag * (1.0 - self.flag)

    @property
    def place(self) -> hy.expression:
        """Value from which the present row follows."""
        return self.inside

    @property
    def every_row(self) -> Array:
        """Values of the symbols that depend on numbers of a scene: none."""
        return np.zeros((0, len(self.symbols)))

    def row_at(self, place: float) -> int:
        """1 inside, else 0."""
        return int(place > 0.0)

    def row_after(self, row: int, place: float) -> int:
        """The other row; after holding, the row of the position."""
        return int(place > 0.0) if row == HOLDS else 1 - row

    def holding(self, row: int, seen: Sequence[float], place: float) -> int | None:
        """Row that follows one at zero; None if it is that of `row_after`.

        It holds where it acts against the motion on both sides, unless others hold that already.

        Parameters
        ----------
        seen : rates of its function with the flag 0 and 1 while other switches hold; the same
            without any holding, also by contacts; and the present part
        place : value of the function
        """
        below, above, *_, part = seen
        if abs(place) > _SWITCHES.rest:
            return None
        if row == HOLDS:
            return int(part > 0.5)
        opposed = above < -_SWITCHES.felt and below > _SWITCHES.felt
        return HOLDS if opposed and self.acts(seen) else None

    def steps(self, seen: Sequence[float]) -> bool:
        """True if the load alone changes the rate of its function; see `holding`."""
        return seen[2] - seen[3] > _SWITCHES.felt

    def acts(self, seen: Sequence[float]) -> bool:
        """True if the load changes the rate of its function, held by no other; see `holding`."""
        below, above, free_below, free_above, _ = seen
        return below - above > max(_SWITCHES.felt, _SWITCHES.own * abs(free_below - free_above))

    def values(self, row: int) -> list[float]:
        """Values of the symbols."""
        held = [float(row == HOLDS)] if self.holds is not None else []
        return [float(row % HOLDS), *held]

    def values_at(self, places: Array) -> Array:
        """Values of the symbols at positions (N,), without holding: (1, N) or (2, N)."""
        return np.array([places > 0.0, np.zeros_like(places)][: len(self.symbols)], float)


class SwitchTable:
    """Rows of numbers along a coordinate; see `Frames.table` for the parameters.

    With the place x and the middle and the half length of the present row, the guard of a periodic
    table is ``1 - (sin((x - middle)/2)/sin(half/2))^2``, whatever the turns in x; of a straight
    one ``1 - ((x - middle)/half)^2``, the outermost rows being a hair longer for it. Where the
    outermost rows have no end, it is ``(1 + b (x - middle)) (c + d (x - middle))``, with the
    finite end of such a row as its middle.

    Attributes
    ----------
    symbols : symbols of the n numbers of the present row, and of its bounds
    local : position from the middle of the row
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
        self._endless = bool(np.isinf(ends[-1]))
        with np.errstate(invalid='ignore'):
            self._middle, half = 0.5 * (ends[1:] + ends[:-1]), 0.5 * np.diff(ends)
        if self._endless:
            self._middle[[0, -1]] = ends[[1, -2]]
            steep = 1.0 / half
            steep[[0, -1]] = 1.0 / half[[1, -2]]
            first, last = np.arange(len(half)) == 0, np.arange(len(half)) == len(half) - 1
            bounds = [
                self._middle, np.where(first | last, 0.0, steep), np.where(first | last, 0.0, 1.0),
                np.where(last, steep, -steep),
            ]  # fmt: skip
        elif periodic:
            turned = 0.5 * self._middle
            bounds = [np.cos(turned), np.sin(turned), 1.0 / np.sin(0.5 * half)]
        else:
            hair = _SWITCHES.table_end * (ends[-1] - ends[0])
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
            self.guard = 1.0 - share * share
        elif self._endless:
            self.local = place - own[0]
            self.guard = (1.0 + own[1] * self.local) * (own[2] + own[3] * self.local)
        else:
            self.local = place - own[0]
            share = (place - own[1]) * own[2]
            self.guard = 1.0 - share * share

    @property
    def numbers(self) -> tuple[hy.expression, ...]:
        """Symbols of the numbers of the present row."""
        return self.symbols[: self._rows.shape[1]]

    @property
    def every_row(self) -> Array:
        """Values of the symbols in all rows (k, n)."""
        return self._values

    def rows_at(self, places: Array) -> IndexArray:
        """The rows (N,) at positions (N,) [rad, m]."""
        if self._periodic:
            first = self._breaks[0]
            places = first + (places - first) % (2.0 * math.pi)
        return np.searchsorted(self._breaks[1:-1], places, 'right')

    def ends_between(self, start: float, end: float) -> Array:
        """Positions (N,) at which rows end between two positions, in the order of passage."""
        low, high, ends = min(start, end), max(start, end), self._breaks[1:-1]
        if self._periodic:
            period, ends = 2.0 * math.pi, self._breaks[:-1]
            laps = np.arange(math.floor((low - ends[-1]) / period), (high - ends[0]) / period + 1)
            ends = (ends + period * laps[:, None]).ravel()
        inside = ends[(low < ends) & (ends < high)]
        return np.asarray(inside if start <= end else inside[::-1])

    def row_at(self, place: float) -> int:
        """The row at a position [rad, m]."""
        return int(self.rows_at(np.array(place)))

    def row_after(self, row: int, place: float) -> int:
        """The row that begins where another one ends, at a position near its end.

        Raises
        ------
        RunError
            If there is none.
        """
        away = place - float(self._middle[row])
        if self._endless:
            present = self.row_at(place)
            first, last = row == 0, row == len(self._rows) - 1
            onwards = first or (not last and away > 0.0)
            return present if present != row else row + (1 if onwards else -1)
        if self._periodic:
            return (row + (1 if math.sin(away) > 0.0 else -1)) % len(self._rows)
        after = row + (1 if away > 0.0 else -1)
        if not 0 <= after < len(self._rows):
            raise self._outside(place)
        return after

    @property
    def bounded(self) -> bool:
        """True if some positions have no row."""
        return not (self._periodic or self._endless)

    def check(self, places: Array) -> None:
        """Refuse positions (N,) [rad, m] without a row, beyond rounding."""
        first, last = self._breaks[[0, -1]]
        beyond = np.maximum(first - places, places - last)
        if self.bounded and beyond.max(initial=0.0) > 2.0 * _SWITCHES.table_end * (last - first):
            raise self._outside(float(places[beyond.argmax()]))

    def _outside(self, place: float) -> RunError:
        first, last = self._breaks[[0, -1]]
        return RunError(
            f'{self.name} is beyond its law, which is defined from {first:.6g} to {last:.6g} m '
            f'only, at {place:.6g} m'
        )

    def values(self, row: int) -> list[float]:
        """Values of the symbols in a row."""
        found: list[float] = self._values[row].tolist()
        return found

    def values_at(self, places: Array) -> Array:
        """Values of the n symbols at positions (N,): (n, N)."""
        found: Array = self._values[self.rows_at(places)].T
        return found


class ToothTable(SwitchTable):
    """Teeth that a pawl passes in one direction: a row each, which ends at the next only.

    A pawl that rests on a tooth is at the beginning of its row.

    Parameters
    ----------
    place : angle of the pawl [rad], of any number of turns; a tooth is at zero
    count : number of teeth on a turn, at least 3
    """

    def __init__(self, name: str, symbol: str, place: hy.expression, count: int) -> None:
        self.name, self.place = name, place
        self._count, self._periodic, self._endless = count, True, False
        angles = 2.0 * math.pi / count * np.arange(count)
        self._values = np.column_stack([np.cos(angles), np.sin(angles)])
        self._rows = np.zeros((count, 0))
        self.symbols = c, s = tuple(hy.make_vars(f'{symbol}_{k}') for k in range(2))
        x, y = hy.cos(place), hy.sin(place)
        self.local = hy.atan2(y * c - x * s, x * c + y * s)
        self.guard = 1.0 - self.local * (0.5 * count / math.pi)

    def rows_at(self, places: Array) -> IndexArray:
        """Numbers (N,) of the teeth last passed by pawls at positions (N,) [rad]."""
        passed = (places + _SWITCHES.tooth) * (0.5 * self._count / math.pi)
        return np.floor(passed).astype(np.intp) % self._count

    def row_after(self, row: int, place: float) -> int:
        """The next one."""
        return (row + 1) % self._count


def by_level(
    switches: Sequence[Switch | SwitchTable], places: Sequence[hy.expression] | None = None
) -> list[list[int]]:
    """The switches that depend on motion alone, those that depend on rows of these, and so on.

    Parameters
    ----------
    places : expressions of their positions; by default their own
    """
    levels: dict[str, int] = {}
    found: list[list[int]] = []
    for k, switch in enumerate(switches):
        named = hy.get_variables(switch.place if places is None else places[k])
        level = 1 + max((levels.get(x, -1) for x in named), default=-1)
        levels |= dict.fromkeys(map(str, switch.symbols), level)
        found += [[] for _ in range(level + 1 - len(found))]
        found[level].append(k)
    return found
