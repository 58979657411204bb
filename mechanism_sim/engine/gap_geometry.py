"""Gaps and closures at given coordinates: values, rates, distances; no forces are assumed."""

from __future__ import annotations

from functools import cached_property

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.system import System
from mechanism_sim.planar.switched_functions import SwitchedFunction
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts


class GapGeometry:
    """Functions of coordinates and rates, compiled when they are first called for."""

    def __init__(self, system: System) -> None:
        self._system = system

    def distances(self, values: Array) -> Array:
        """The gaps (m, N) [m] from their values in the measure of each."""
        rows = [g.distance(row) for g, row in zip(self._system.gaps, values, strict=True)]
        return np.array(rows).reshape(values.shape)

    @cached_property
    def _values(self) -> SwitchedFunction:
        frames = self._system.equations.frames
        values = [jet.value for jet in self._system.dynamics.contacts.normal]
        known = [*self._positions, *frames.outside.values()]
        return SwitchedFunction(frames, [values], known)

    @property
    def _positions(self) -> list[hy.expression]:
        return list(self._system.equations.frames.q.values())

    @cached_property
    def closure_distance(self) -> SwitchedFunction:
        """Measure (1, N) of the closures' independence by coordinates (n, N); 0 if singular."""
        return SwitchedFunction(
            self._system.equations.frames, [[self._system.dynamics.distance]], self._positions
        )

    @cached_property
    def _rates(self) -> SwitchedFunction:
        frames, normal = self._system.equations.frames, self._system.dynamics.contacts.normal
        groups = [
            [jet.rate for jet in normal],
            [g.stretch(jet.value) for g, jet in zip(self._system.gaps, normal, strict=True)],
            [jet.value for jet in normal],
            *([pair[k].rate for pair in self._system.run.normals] for k in (0, 1)),
        ]
        known = [*frames.q.values(), *frames.v.values(), *frames.outside.values()]
        return SwitchedFunction(frames, groups, known)

    def rates(self, q: Array, v: Array) -> Array:
        """Opening rates of the gaps (m, N) [m/s] at coordinates and rates (n, N).

        From the centre of its bushing a pin comes nearer in every direction, as fast as it moves:
        there the normal Q/c turns with Q'/c, and the measure of the gap is c/2.
        """
        none = np.zeros((len(self._system.outside), q.shape[1]))  # no rate depends on it
        rates, stretch, value, nx, ny = self._rates(np.concatenate([q, v, none]))
        # by rounding it may be the root of less than zero
        central = ~(stretch >= _CONTACTS.central)
        opening: Array = np.where(
            central, -2.0 * value * np.hypot(nx, ny), rates / np.where(central, 1.0, stretch)
        )
        return opening

    def values(self, q: Array, outside: Array, rows: Array | None = None) -> Array:
        """The gaps (m, N) [m] in their own measure at coordinates q (n, N).

        Parameters
        ----------
        outside : (k, N) values of `Frames.outside`
        rows : (r, N) values of the switches; by default those at these positions
        """
        if not self._system.gaps:
            return np.zeros((0, q.shape[1]))
        found: Array = self._values(np.concatenate([q, outside]), rows)[0]
        return found
