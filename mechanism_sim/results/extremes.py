"""Where columns of a run are least and greatest: of its motion, not of samples of it.

A table of 360 rows misses the peaks of a loose bearing altogether.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.results.quantity import Quantity
from mechanism_sim.results.ranges import search_of

Sampler = Callable[[Array], Mapping[str, Array]]


@dataclass(frozen=True)
class Extreme:
    """The least or greatest value of a column.

    Attributes
    ----------
    value : in the column's SI unit
    t : when [s]
    drive : position of the drive then [rad or m]
    """

    value: float
    t: float
    drive: float


@dataclass(frozen=True)
class Extremes:
    """Both ends of a column's range."""

    least: Extreme
    greatest: Extreme
    rounding: float  #: size of its errors: 1e-12 of the greatest of all columns of its kind

    @property
    def constant(self) -> bool:
        """Whether they differ by rounding only."""
        return self.greatest.value - self.least.value <= self.rounding


def search(
    at: Sampler,
    wanted: Sequence[Quantity],
    spans: tuple[Array, Array],
    size: float,
) -> ExtremeSearch:
    """The search for the extremes of columns, done; limits at events count, from both sides.

    Parameters
    ----------
    at : the columns (K,) at any instants (K,) [s]
    wanted : the columns; rounding is measured by the largest of a unit among those of a kind
    spans : first and last times (m,) [s] of intervals between events
    size : of the machine [m]; gaps and the like are differences of such lengths
    """

    def values(t: Array) -> Array:
        columns = at(t.ravel())
        return np.array([columns[quantity.name] for quantity in wanted])

    found = search_of(wanted, size)
    if wanted:
        found.add(values, *spans)
    return found


def find_extremes(
    at: Sampler, wanted: Sequence[Quantity], spans: tuple[Array, Array], drive: str, size: float
) -> dict[str, Extremes]:
    """Least and greatest values of columns, and when; see `search`.

    Parameters
    ----------
    drive : the column with the position of the drive
    """
    found = search(at, wanted, spans, size)
    least, greatest = (
        [
            Extreme(float(x), float(t), float(where))
            for x, t, where in zip(values, times, at(times)[drive], strict=True)
        ]
        for values, times in (
            (found.least, found.least_time),
            (found.greatest, found.greatest_time),
        )
    )
    rounding = (10.0 * found.rounding).tolist()
    return {
        quantity.name: Extremes(*x)
        for quantity, x in zip(wanted, zip(least, greatest, rounding, strict=True), strict=True)
    }
