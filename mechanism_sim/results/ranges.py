"""Extremes of quantities over a run, of the motion itself instead of samples.

A table of 360 rows misses the peaks of a loose bearing altogether.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import Motion
from mechanism_sim.engine.peak_shapes import PeakOutlines, PeakShape
from mechanism_sim.engine.physics import is_force_open
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantity import Quantity, View
from mechanism_sim.scene import Machine


class Peak(NamedTuple):
    """An extreme value of a quantity."""

    value: float  #: in the unit of the quantity, with its sign
    time: float  #: [s]


Ends = tuple[Peak, Peak]
"""Least and greatest value."""


def largest(ends: Mapping[str, Ends]) -> dict[str, Peak]:
    """The values with the largest magnitudes by name."""
    return {name: low if -low.value > high.value else high for name, (low, high) in ends.items()}


@dataclass(frozen=True)
class Extreme:
    """The least or greatest value of a column of a cycle.

    Attributes
    ----------
    value : in the column's SI unit
    t : time [s]
    drive : position of the drive at that time [rad or m]
    """

    value: float
    t: float
    drive: float


@dataclass(frozen=True)
class Extremes:
    """Least and greatest value of a column."""

    least: Extreme
    greatest: Extreme
    #: rounding error: 1e-12 of the greatest of all columns of its kind, or of forces at an arm
    rounding: float

    @property
    def constant(self) -> bool:
        """True if both differ by rounding only."""
        return self.greatest.value - self.least.value <= self.rounding

    def without_rounding(self, values: Array) -> Array:
        """The column, or one value of it if all that varies is rounding: 0 if that is rounding."""
        if not self.constant:
            return values
        value = self.least.value
        return np.full_like(values, value if abs(value) > self.rounding else 0.0)


def _search_of(
    wanted: Sequence[Quantity], size: float, magnitudes: Collection[str] = ()
) -> ExtremeSearch:
    """The search for extremes of quantities of a machine of some size [m].

    For names in `magnitudes` only the extreme farther from zero is searched.

    Rounding is measured by the largest value of a kind in one unit; that of gaps and the like,
    which are differences of lengths, by the size of the machine, that of moments and torques by
    forces with such an arm, too.
    """
    groups = [(quantity.kind, quantity.unit) for quantity in wanted]
    differences: dict[Hashable, float] = {(q.kind, q.unit): size for q in wanted if q.difference}
    sizes = [quantity.part == 'size' for quantity in wanted]
    either = [quantity.name in magnitudes for quantity in wanted]
    arms: dict[Hashable, tuple[Hashable, float]] = {
        group: (('reaction', 'N'), size) for group in groups if group[1] == 'N m'
    }
    return ExtremeSearch(groups, differences, sizes, either, arms)


def travel(machine: Machine, motion: Motion) -> float:
    """Largest displacement [m] in a motion, a scale of rounding."""
    slides = machine.mechanism.displacements
    own = [k for k, c in enumerate(machine.physics.coordinates) if c in slides]
    return float(np.abs(motion.curve.coefficients[:, own, 0]).max(initial=0.0))


def search(
    at: Callable[[Array], Mapping[str, Array]],
    wanted: Sequence[Quantity],
    motion: Motion,
    window: tuple[float, float],
    size: float,
) -> ExtremeSearch:
    """The search for the extremes of columns, done; limits at events count, from both sides.

    Parameters
    ----------
    at : function of instants (K,) [s] that returns the columns (K,)
    motion : motion of the columns
    window : first and last instant [s]
    """

    def values(t: Array) -> Array:
        columns = at(t.ravel())
        return np.array([columns[quantity.name] for quantity in wanted])

    found = _search_of(wanted, size)
    if wanted:
        start, end = motion.curve.spans(*window)
        alike = motion.alike(motion.curve.locate(0.5 * (start + end)))
        # those that the window cuts are like no other
        alike[[0, -1]] = alike.max() + 1 + np.arange(2)
        found.add(values, start, end, alike=alike)
    return found


class QuantityRanges:
    """Least and greatest values of quantities, and when, of the motion itself.

    Parameters
    ----------
    names : names of quantities
    since : [s] time before which nothing counts
    shapes : names whose peaks' durations are computed, see `PeakOutlines`
    magnitudes : names of which only the extreme farther from zero is searched
    """

    def __init__(
        self,
        machine: Machine,
        names: Sequence[str],
        since: float = -math.inf,
        shapes: Collection[str] = (),
        magnitudes: Collection[str] = (),
    ) -> None:
        self._machine, self._since, self.names = machine, since, [*names]
        self._wanted = [catalogue(machine)[name] for name in names]
        self._search = _search_of(self._wanted, machine.mechanism.size, magnitudes)
        self._shaped = shapes
        self._outlines = PeakOutlines(self._values, len(self.names)) if shapes else None

    def add(self, motion: Motion) -> None:
        """Enter the segments that follow."""
        if self.names and len(motion):
            self._search.enlarge(travel(self._machine, motion))
            self._search.add_motion(partial(self._values, motion), motion.curve, self._since)
            if self._outlines:
                self._outlines.add(motion, self._tops)

    def _values(self, motion: Motion, k: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The quantities, instants as in `Physics.observe`."""
        view = View(self._machine, motion, k, dt)
        return np.array([quantity.evaluate(view) for quantity in self._wanted])

    def ends(self) -> dict[str, Ends]:
        """Least and greatest value by name, of quantities that were ever finite."""
        s = self._search
        least, greatest = (
            [Peak(float(x), float(t)) for x, t in zip(values, times, strict=True)]
            for values, times in ((s.least, s.least_time), (s.greatest, s.greatest_time))
        )
        known = zip(self.names, least, greatest, strict=True)
        return {name: (low, high) for name, low, high in known if not math.isnan(low.time)}

    def shapes(self) -> dict[str, PeakShape]:
        """Shapes of the peaks, as far as they are known."""
        found = self._outlines.shapes(self._tops()) if self._outlines else []
        return {name: shape for name, shape in zip(self.names, found, strict=False) if shape}

    def _tops(self) -> list[Peak]:
        """The peaks whose shapes are requested, placeholders for others."""
        peaks = largest(self.ends())
        none = Peak(0.0, math.nan)
        return [peaks.get(n, none) if n in self._shaped else none for n in self.names]


_TOGETHER = 2048  # segments; messages of nodes bring them one by one

_OF_BEARINGS = ('bearing_force', 'size'), ('bearing_force', 'axial'), ('bearing_moment', 'size')


class LoadPeaks:
    """The largest force in each joint and effort of each drive; impulses of impacts are no forces.

    Parameters
    ----------
    since : as for `QuantityRanges`
    shapes : True if durations of the peaks are computed
    bearings : True if loads of bearings of shafts, and of tilting bearings, are included
    others : further quantities whose ranges are computed in the same pass
    """

    def __init__(
        self,
        machine: Machine,
        since: float = -math.inf,
        shapes: bool = False,
        bearings: bool = False,
        others: Iterable[str] = (),
    ) -> None:
        self.machine, physics = machine, machine.physics
        self._physics, self._since = physics, since
        known = [j for j in physics.joints if not is_force_open(physics.undetermined, j)]
        self._joints = {f'reaction.{joint}.size': joint for joint in known}
        driven = sorted(physics.driven, key=lambda c: c != machine.plan.main)  # the main one first
        self._drives = {f'drive_torque.{c}': c for c in driven}
        self._loads = [*self._joints, *self._drives] if physics.has_forces else []
        if bearings:
            # of shafts, shaft by shaft, and of bearings that tilt
            chosen = [
                quantity
                for quantity in catalogue(machine).values()
                if (quantity.kind, quantity.part) in _OF_BEARINGS
                or (quantity.kind == 'axial_force' and quantity.of in machine.physics.tilting)
            ]
            of = [*dict.fromkeys(quantity.of for quantity in chosen)]
            chosen.sort(key=lambda q: (of.index(q.of), q.part == 'axial'))
            self._loads += [quantity.name for quantity in chosen]
        others = [*others]
        self._ranges = QuantityRanges(
            machine,
            [*self._loads, *others],
            since,
            self._loads if shapes else (),
            {*self._loads} - {*others},
        )
        self._unbounded: dict[str, float] = {}  # forces without a limit, and when [s]
        self._waiting: list[Motion] = []

    def add(self, motion: Motion) -> None:
        """Enter the segments that follow; they are looked at some at once, which costs less."""
        self._waiting.append(motion)
        if sum(map(len, self._waiting)) >= _TOGETHER:
            self._look()

    def _look(self) -> None:
        """Look at the segments that were entered."""
        if not self._waiting:
            return
        motion = Motion.joined(self._waiting) if len(self._waiting) > 1 else self._waiting[0]
        self._waiting.clear()
        self._ranges.add(motion)
        for part in motion.parts(_TOGETHER) if self._physics.has_forces else ():
            for found in self._physics.no_limits(part):
                if found.t >= self._since:
                    names = (f'reaction.{joint}.size' for joint in found.joints)
                    self._unbounded |= dict.fromkeys(names, found.t)

    def ends(self) -> dict[str, Ends]:
        """Ends of all quantities, as `QuantityRanges` has them."""
        self._look()
        return self._ranges.ends()

    def peaks(self) -> dict[str, Peak]:
        """Peak loads by the names of the catalogue, infinite where unbounded."""
        found = largest(self.ends())
        known = {name: found[name] for name in self._loads if name in found}
        return known | {name: Peak(math.inf, t) for name, t in self._unbounded.items()}

    @property
    def forces(self) -> dict[str, Peak]:
        """Peaks of forces by joint; empty without motion or forces."""
        return {self._joints[n]: peak for n, peak in self.peaks().items() if n in self._joints}

    @property
    def torques(self) -> dict[str, Peak]:
        """Peaks of efforts by driven coordinate; empty without motion or forces."""
        return {self._drives[n]: peak for n, peak in self.peaks().items() if n in self._drives}

    def shapes(self) -> dict[str, PeakShape]:
        """Shapes of the peaks by the names of the catalogue, as far as they are known."""
        self._look()
        return self._ranges.shapes()
