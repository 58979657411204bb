"""Columns by name at any instants of a motion; only those asked for are computed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.cycles.columns import WORK, columns_of_parts, unit_of
from mechanism_sim.cycles.forces import Forces
from mechanism_sim.cycles.points import named_points
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.physics import each_instant
from mechanism_sim.hybrid.sampling import EnergyTerms, Samples, sample, table
from mechanism_sim.numerics.polynomials import Nodes
from mechanism_sim.planar.paths import Paths
from mechanism_sim.scene import Machine

_INSTANT = 1e-6  # [s] that is run to know which columns there are
_KINDS = 'position', 'velocity', 'acceleration'


class Quantities:
    """What is known of a machine at any instant, by the names of `Cycle` and `Solution.sample`.

    A vector goes by its name without ``.size``; ``motor.torque``, ``motor.speed`` are those of the
    shaft of a motor behind its gear, ``motor.power`` that of the drive.

    Parameters
    ----------
    names : those that are wanted

    Attributes
    ----------
    units : SI units by name
    """

    def __init__(self, machine: Machine, names: Iterable[str]) -> None:
        self._machine = machine
        self._parts = False
        self._forces: Forces | None = None
        self._paths: dict[str, Paths] = {}
        self._columns: dict[str, tuple[str, float]] = {}
        self.units: dict[str, str] = {}
        self.with_work = False
        wanted = list(dict.fromkeys(names))
        if wanted:
            self._find(wanted)

    def _find(self, wanted: list[str]) -> None:
        """Choose what must be computed for these names."""
        machine, physics = self._machine, self._machine.physics
        run = machine.start()
        run.advance(_INSTANT * min(machine.period, 1.0), final=True, most=1)
        motion = run.drain()[0]
        zero = np.zeros(1)
        known = dict.fromkeys(self._at(motion, np.zeros(1, np.intp), zero))
        if physics.has_forces:
            known |= dict.fromkeys(f'reaction.{joint}.moment' for joint in physics.joints)
        places = named_points(machine)
        points = {f'{kind}.{p}.{axis}': p for kind in _KINDS for p in places for axis in 'xy'}
        for name in wanted:
            column, factor = self._motor(name)
            if f'{column}.size' in known:
                column = f'{column}.size'
            elif column not in known and column in points:
                point = points[column]
                self._paths[point] = Paths(machine.mechanism, [places[point]])
            elif column not in known and column not in WORK and column != 't':
                if not self._parts:
                    self._parts = True
                    known |= dict.fromkeys(self._at(motion, np.zeros(1, np.intp), zero))
                if column not in known and physics.has_forces and self._forces is None:
                    local = any(n.endswith(('.along', '.across')) for n in wanted)
                    self._forces = Forces(machine, local)
                    known |= dict.fromkeys(self._at(motion, np.zeros(1, np.intp), zero))
                if f'{column}.size' in known:
                    column = f'{column}.size'
                elif column not in known:
                    self._refuse(name, [*known, *points])
            self._columns[name] = column, factor
            self.units[name] = unit_of(machine, column)
        self.with_work = any(column in WORK for column, _ in self._columns.values())

    def _refuse(self, name: str, known: list[str]) -> None:
        machine = self._machine
        short = [n.removesuffix('.size') for n in known]
        kinds = ', '.join(dict.fromkeys(n.partition('.')[0] for n in known))
        why = '' if machine.physics.has_forces else '; its forces are not computed'
        raise InputError(
            f"{machine.name}: there is no quantity '{name}'{nearest(name, short)}; quantities "
            f'begin with {kinds}{why}'
        )

    def _motor(self, name: str) -> tuple[str, float]:
        """The column behind a name, and by what it is multiplied."""
        if not name.startswith('motor.'):
            return name, 1.0
        drive, main = self._machine.scene.drive, self._machine.main
        motor = drive.motor if drive else None
        if motor is None:
            raise InputError(
                f"{self._machine.name}: '{name}': the drive is no motor; drive_torque and "
                f'velocity.{main} are those of any drive'
            )
        columns = {
            'torque': ('drive_torque', 1.0 / motor.ratio),
            'speed': (f'velocity.{main}', motor.ratio),
            'power': ('drive_power', 1.0),
        }
        part = name.partition('.')[2]
        if part not in columns:
            raise InputError(
                f"{self._machine.name}: a motor has no '{part}'{nearest(part, columns)}: "
                f'it has {", ".join(columns)}'
            )
        return columns[part]

    def at(
        self,
        motion: Motion,
        balance: EnergyTerms,
        segments: NDArray[np.intp],
        dt: Array | Nodes,
    ) -> dict[str, Array]:
        """The quantities (N,) by name, at instants as those of ``motion.curve.at(segments, dt)``.

        Parameters
        ----------
        balance : of the motion, for what was done so far
        """
        columns = self._at(motion, segments, dt, balance if self.with_work else None)
        count, found = len(columns['t']), {}
        for name, (column, factor) in self._columns.items():
            x = columns.get(column)  # one that is zero may lack
            found[name] = np.zeros(count) if x is None else factor * x if factor != 1.0 else x
        return found

    def _at(
        self,
        motion: Motion,
        segments: NDArray[np.intp],
        dt: Array | Nodes,
        balance: EnergyTerms | None = None,
    ) -> dict[str, Array]:
        physics, curve = self._machine.physics, motion.curve
        each, since = each_instant(curve, segments, dt)
        t = curve.start[each] + (curve.start_low[each] + since)
        seen = physics.observe(motion, segments, dt)
        none = np.full(len(t), np.nan)
        s = Samples(t, motion.modes_at(segments, dt), seen, none, none)
        if balance is not None:
            done = sample(physics, motion, balance, np.clip(t, curve.start[0], curve.end))
            s = s._replace(drive_work=done.drive_work, dissipated=done.dissipated)
        columns = table(physics, s)
        if physics.has_forces:
            columns['drive_power'] = seen.drive_power
            for i, joint in enumerate(physics.joints):
                x, y = seen.reaction[i]
                columns[f'reaction.{joint}.size'] = np.hypot(x, y)
            for coordinate, row in zip(physics.driven, seen.drive_torque, strict=True):
                columns[f'drive_torque.{coordinate}'] = row
        if self._parts:
            columns |= columns_of_parts(self._machine, s)
        for point, paths in self._paths.items():
            (track,) = paths(seen.local, seen.velocity, seen.acceleration)
            columns |= {
                f'{kind}.{point}.{axis}': row
                for kind, pair in zip(_KINDS, track, strict=True)
                for axis, row in zip('xy', pair, strict=True)
            }
        if self._forces:
            columns |= self._forces.columns(t, seen)
        return columns
