"""What a run leaves behind: motion as polynomials, events, and the energy balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mechanism_sim.hybrid import plotting
from mechanism_sim.hybrid.audit import Energy
from mechanism_sim.hybrid.column_units import IMPACT_UNITS, unit_of
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.digest import MotionDigest
from mechanism_sim.hybrid.events import Impact, ModeChange, StopReason
from mechanism_sim.hybrid.physics import Physics
from mechanism_sim.hybrid.plotting import Rich
from mechanism_sim.hybrid.sampling import EnergyTerms, Samples, sample, table
from mechanism_sim.hybrid.snapshot import Snapshot
from mechanism_sim.hybrid.system import Array
from mechanism_sim.tables import Table


@dataclass(frozen=True)
class Stats:
    """What a run cost."""

    wall_time: float  #: [s] with the start of the run, without compilation
    cpu_time: float  #: [s] of this process, likewise
    compile_time: float  #: [s] in which code was made; 0 where the process had all of it
    steps: int
    switches: int  #: events: impacts and losses of contact


@dataclass(frozen=True)
class Piece(Rich):
    """A part of a run.

    Attributes
    ----------
    motion : polynomials of all coordinates and the state of the gaps
    balance : work and losses of its segments, and what they were before
    impacts, modes : events in the order of time
    """

    physics: Physics
    motion: Motion
    balance: EnergyTerms
    impacts: list[Impact]
    modes: list[ModeChange]

    def __repr__(self) -> str:
        curve = self.motion.curve
        span = f'{curve.start[0]:.6g} s to {curve.end:.6g} s' if len(curve) else 'no motion'
        return f'<Piece of a run: {span}, {len(curve)} steps, {len(self.impacts)} impacts>'

    def impact_table(self) -> Table:
        """The impacts as columns (n,), SI units."""
        names = [n for n in Impact._fields if n != 'joint']
        columns = {n: np.array([float(getattr(i, n)) for i in self.impacts]) for n in names}
        joints = {'joint': np.array([i.joint for i in self.impacts], dtype=str)}
        return Table({'t': columns['t']} | joints | columns, IMPACT_UNITS)

    def samples(self, t: Array | float) -> Samples:
        """Everything at times `t` (N,) [s] in one structure."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        return sample(self.physics, self.motion, self.balance, times)

    def sample(self, t: Array | float) -> Table:
        """Everything at times `t` [s], as arrays (N,) by name.

        ``position.LINK`` [rad, or m for a displacement], ``velocity.LINK``,
        ``acceleration.LINK``, the same of ``LINK.x`` and ``LINK.y`` [m] for links that float;
        with clearance ``gap.JOINT`` [m],
        ``normal_force.JOINT``, ``friction_force.JOINT`` [N], ``closed.JOINT`` (0 or 1),
        ``mode.JOINT`` (the number of a `Mode`); and where the scene has forces
        ``reaction.JOINT.x``, ``.y`` [N] (of the first-named on the second-named link),
        ``.moment`` [N m] about its point on the latter where a joint transmits one,
        ``drive_torque`` [N m, or N] of the first drive and ``drive_torque.COORDINATE`` of others,
        ``load.NAME`` [N, or N m] of loads whose size is unknown,
        ``energy.kinetic``, ``energy.potential``, ``energy.drive_work``,
        ``energy.dissipated`` [J].

        Raises
        ------
        ValueError
            For a time outside of the motion.
        """
        columns = table(self.physics, self.samples(t))
        return Table(columns, {name: unit_of(self, name) for name in columns})

    def plot(self, *names: str, **how: Any) -> Any:
        """Plot quantities by the names of `sample`, or an overview; a Matplotlib figure.

        The keywords are those of `mechanism_sim.report.lines.plot`: ``against='angle'``, and
        ``start`` and ``end`` [s].
        """
        return plotting.plot(self, *names, **how)


@dataclass(frozen=True)
class Solution(Piece):
    """A finished run, kept whole.

    Attributes
    ----------
    scene, level : names
    energy : the energy balance; ``None`` where masses are not part of the scene
    max_penetration, max_closure_error : [m]
    snapshot : from where a longer run goes on, not later than the end
    """

    scene: str
    level: str
    stats: Stats
    energy: Energy | None
    max_penetration: float
    max_closure_error: float
    stop_reason: StopReason
    snapshot: Snapshot

    def __repr__(self) -> str:
        return (
            f'<Solution of {self.scene} ({self.level}): {self.duration:.6g} s in '
            f'{len(self.motion)} steps, {len(self.impacts)} impacts>'
        )

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        return self.motion.curve.end

    def digest(self) -> str:
        """SHA-256 of motion and impacts: equal for runs that are equal bit by bit."""
        digest = MotionDigest()
        digest.add(self.motion, self.impacts)
        return digest.hexdigest()
