"""One run of a sweep and the row it makes, in one pass and with bounded memory."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mechanism_sim.engine.digest import MotionDigest
from mechanism_sim.engine.events import Impacts
from mechanism_sim.errors import InputError
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.results.run import Observer, Piece
from mechanism_sim.results.simulate import Stream, stream, whole
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.schema import Scene
from mechanism_sim.studies.columns import FIGURES, MEANS
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.run_bag import RunBag
from mechanism_sim.studies.runs import Row
from mechanism_sim.studies.statistics import StatisticsAccumulator

if TYPE_CHECKING:
    from mechanism_sim.studies.shards import Channels, Shard

SOLUTION = 'solution'
"""Key of a row's whole run."""
_BY_TURNS = ('revolutions', *(x for m in MEANS for x in (m.name, f'{m.name}_half_width')))


@dataclass(frozen=True)
class SweepTask:
    """One motion of a sweep; `bag` is a file to record it in.

    Runs that differ in their sensors only share a motion, and write a shard each.
    """

    key: str
    name: str
    scene: Scene
    extent: Extent
    bag: Path | None = None
    shards: tuple[Shard, ...] = ()
    measures: tuple[str, ...] = ()
    #: columns of the row; expensive ones not among them are not computed
    wanted: frozenset[str] | None = None
    keep: bool = False  #: include the whole run as `SOLUTION`
    refused: str = ''  #: why there is no run, as `plan.Run` has it

    def row(self) -> Row:
        """Make the run: its figures, its steps and its digest."""
        if self.refused:
            raise InputError(self.refused)
        machine = Machine(self.name, self.scene)
        figures = _Figures(machine, self)
        run = stream(machine, duration=figures.edges[-1])
        observers: list[Observer] = [figures.add]
        with ExitStack() as files:
            if self.bag:
                bag = files.enter_context(RunBag(self.bag, machine, figures.edges[-1]))
                observers.append(bag.add)
            pieces: list[Piece] = []
            if self.keep:
                observers.append(pieces.append)
            channels: Channels = {}
            writers = []
            for shard in self.shards:
                writer = shard.writer(self.name, figures.since, channels)
                writers.append(files.enter_context(writer))
                observers.append(writer.add)
            run.finish(observers)
            for writer in writers:
                writer.finish()
        row = figures.row(run)
        return row | {SOLUTION: whole(run, pieces)} if self.keep else row

    def wants(self, *names: str) -> bool:
        """True if any of these columns is wanted, or one of a joint or drive that begins so."""
        given = self.wanted
        return given is None or any(c in names or c.partition('.')[0] in names for c in given)


class _Figures:
    """Figures of a row, from a run in pieces."""

    def __init__(self, machine: Machine, task: SweepTask) -> None:
        #: ends of the intervals that are counted [s]
        self.edges, self._skip = task.extent.edges(machine)
        self.since = self.edges[self._skip]  #: start of the first that counts for figures [s]
        self._whole = bool(task.extent.revolutions)
        self._main = machine.physics.coordinates.index(machine.plan.main)
        self._slides = machine.plan.main in machine.mechanism.displacements
        self._crank = np.full(len(self.edges), math.nan)  # crank angle at the edges [rad]
        self._accumulator = StatisticsAccumulator(self.edges) if task.wants(*_BY_TURNS) else None
        self._digest = MotionDigest() if task.wants('digest') else None
        loads = task.wants('largest_force', 'largest_torque')
        self._peaks = LoadPeaks(machine, self.since) if loads else None
        self._impulses: dict[str, list[float]] = {
            joint: [] for joint in machine.physics.clearances
        }
        self._taken = Measurement(machine, task.measures, self.since) if task.measures else None

    def add(self, piece: Piece) -> None:
        """Enter the next piece."""
        motion, curve = piece.motion, piece.motion.curve
        if self._taken:
            self._taken.add(piece)
        if self._peaks:
            self._peaks.add(motion)
        if self._accumulator:
            self._accumulator.add(piece)
        if self._digest:
            self._digest.add(motion, piece.impacts)
        if len(curve):
            # the last edge may be the end but for rounding
            inside = (self.edges >= curve.start[0]) & (self.edges <= curve.end * (1.0 + 1e-12))
            at = np.minimum(self.edges[inside], curve.end)
            self._crank[inside] = curve(at)[:, self._main]
        impacts = Impacts.of(piece.impacts)
        impacts = impacts.where(impacts.column('t') >= self.since)
        for joint, impulse in zip(impacts.gaps, impacts.column('normal_impulse'), strict=True):
            self._impulses[impacts.joints[joint]].append(float(impulse))

    def row(self, run: Stream) -> Row:
        """The figures of the whole run."""
        figures: dict[str, float] = {}
        if self._accumulator:
            steps = np.diff(self._crank)[self._skip :]
            turned = np.abs(steps) / (2.0 * np.pi)
            if self._whole:
                turned = np.ones_like(turned)  # but for rounding
            turns = float(turned.sum())
            if self._slides or steps.min() < 0.0 < steps.max():  # it makes no turns
                turned, turns = np.full(len(steps), 1.0 / len(steps)), math.nan
            means = self._accumulator.means(self._skip, turned)
            found = [x for m in means for x in (m.mean, m.half_width)]
            figures |= zip((f.name for f in FIGURES), [*found, turns], strict=False)
        largest = {j: max(x, default=0.0) for j, x in self._impulses.items()}
        figures['largest_impulse'] = max(largest.values(), default=0.0)
        if self._peaks:
            forces, torques = self._peaks.forces, self._peaks.torques
            figures['largest_force'] = max((p.value for p in forces.values()), default=math.nan)
            figures |= {f'largest_force.{joint}': peak.value for joint, peak in forces.items()}
            figures |= {f'largest_torque.{c}': peak.value for c, peak in torques.items()}
        figures['max_penetration'] = run.max_penetration
        figures['energy_residual'] = run.energy.residual if run.energy else math.nan
        figures |= {f'impacts.{joint}': len(x) for joint, x in self._impulses.items()}
        figures |= {f'largest_impulse.{joint}': x for joint, x in largest.items()}
        figures |= {
            m.name: m.value for m in (self._taken.found(silent=True) if self._taken else ())
        }
        row: Row = {k: float(x) if math.isfinite(x) else None for k, x in figures.items()}
        digest = {'digest': self._digest.hexdigest()} if self._digest else {}
        return row | {'steps': run.stats.steps} | digest
