"""Ranges of quantities, and the largest loads, of a motion that comes in pieces."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.peak_shapes import PeakOutlines, PeakShape
from mechanism_sim.numerics.extremes import ExtremeSearch
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.quantity import Quantity
from mechanism_sim.results.view import View
from mechanism_sim.scene import Machine


class Peak(NamedTuple):
    """The largest magnitude of something."""

    value: float  #: in the unit of the quantity, with its sign
    time: float  #: [s]


def search_of(wanted: Sequence[Quantity], size: float) -> ExtremeSearch:
    """The search for extremes of quantities of a machine of some size [m].

    Rounding is measured by the largest value of a kind in one unit; that of gaps and the like,
    which are differences of lengths, by the size of the machine.
    """
    groups = [(quantity.kind, quantity.unit) for quantity in wanted]
    differences: dict[Hashable, float] = {(q.kind, q.unit): size for q in wanted if q.difference}
    return ExtremeSearch(groups, differences, [quantity.part == 'size' for quantity in wanted])


class Ranges:
    """Least and greatest values of quantities, and when, of the motion itself.

    Parameters
    ----------
    names : of quantities
    since : [s] what is earlier does not count
    shapes : whether to look how long peaks last, as `PeakOutlines` do
    """

    def __init__(
        self,
        machine: Machine,
        names: Sequence[str],
        since: float = -math.inf,
        shapes: bool = False,
    ) -> None:
        self._machine, self._since, self.names = machine, since, [*names]
        self._wanted = [catalogue(machine)[name] for name in names]
        self._search = search_of(self._wanted, machine.mechanism.size)
        self._outlines = PeakOutlines(self._values, len(self.names)) if shapes else None

    def add(self, motion: Motion) -> None:
        """Enter the segments that follow."""
        if self.names and len(motion):
            self._search.add_motion(partial(self._values, motion), motion.curve, self._since)
            if self._outlines:
                self._outlines.add(motion, self._tops())

    def _values(self, motion: Motion, k: NDArray[np.intp], dt: Array | Nodes) -> Array:
        """The quantities, instants as in `Physics.observe`."""
        view = View(self._machine, motion, k, dt)
        return np.array([quantity.evaluate(view) for quantity in self._wanted])

    def ends(self) -> dict[str, tuple[Peak, Peak]]:
        """Least and greatest value by name, of what was ever finite."""
        s = self._search
        least, greatest = (
            [Peak(float(x), float(t)) for x, t in zip(values, times, strict=True)]
            for values, times in ((s.least, s.least_time), (s.greatest, s.greatest_time))
        )
        known = zip(self.names, least, greatest, strict=True)
        return {name: (low, high) for name, low, high in known if not math.isnan(low.time)}

    def peaks(self) -> dict[str, Peak]:
        """The values with the largest magnitudes by name."""
        return {
            name: low if -low.value > high.value else high
            for name, (low, high) in self.ends().items()
        }

    def shapes(self) -> dict[str, PeakShape]:
        """Of the peaks, as far as they are known."""
        found = self._outlines.shapes(self._tops()) if self._outlines else []
        return {name: shape for name, shape in zip(self.names, found, strict=False) if shape}

    def _tops(self) -> list[Peak]:
        peaks = self.peaks()
        return [peaks.get(name, Peak(0.0, math.nan)) for name in self.names]


class LoadPeaks:
    """The largest force in each joint and effort of each drive; impulses of impacts are no forces.

    Parameters
    ----------
    since, shapes : as for `Ranges`
    """

    def __init__(self, machine: Machine, since: float = -math.inf, shapes: bool = False) -> None:
        physics = machine.physics
        self._physics, self._since = physics, since
        self._joints = {joint: f'reaction.{joint}.size' for joint in physics.joints}
        self._drives = {c: f'drive_torque.{c}' for c in physics.driven}
        names = [*self._joints.values(), *self._drives.values()] if physics.has_forces else []
        self._ranges = Ranges(machine, names, since, shapes)
        self._unbounded: dict[str, float] = {}  # joints, and when their forces have no limit [s]

    def add(self, motion: Motion) -> None:
        """Enter the segments that follow."""
        if self._physics.has_forces and len(motion):
            self._ranges.add(motion)
            for found in self._physics.no_limits(motion):
                if found.t >= self._since:
                    self._unbounded |= dict.fromkeys(found.joints, found.t)

    @property
    def forces(self) -> dict[str, Peak]:
        """By joint, infinite where it has no limit; empty without motion or forces."""
        peaks = self._ranges.peaks()
        found = {joint: peaks[name] for joint, name in self._joints.items() if name in peaks}
        return found | {joint: Peak(math.inf, t) for joint, t in self._unbounded.items()}

    @property
    def torques(self) -> dict[str, Peak]:
        """By driven coordinate; empty without motion or forces."""
        peaks = self._ranges.peaks()
        return {c: peaks[name] for c, name in self._drives.items() if name in peaks}

    @property
    def shapes(self) -> tuple[dict[str, PeakShape], dict[str, PeakShape]]:
        """Of the forces by joint and of the torques by coordinate, as far as they are known."""
        found = self._ranges.shapes()
        forces, torques = (
            {of: found[name] for of, name in names.items() if name in found}
            for names in (self._joints, self._drives)
        )
        return forces, torques
