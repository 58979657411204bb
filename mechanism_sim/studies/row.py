"""One run of a sweep and the row it makes, in one pass and with bounded memory."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mechanism_sim.hybrid.digest import MotionDigest
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.results.run import Observer
from mechanism_sim.results.simulate import Stream, stream
from mechanism_sim.results.solution import Piece
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.schema import Scene
from mechanism_sim.studies.columns import FIGURES
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.run_bag import RunBag
from mechanism_sim.studies.runs import Row
from mechanism_sim.studies.statistics import StatisticsTally

if TYPE_CHECKING:
    from mechanism_sim.studies.shards import Channels, Shard


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

    def row(self) -> Row:
        """Make the run: its figures, its steps and its digest."""
        machine = Machine(self.name, self.scene)
        figures = _Figures(machine, self)
        run = stream(machine, duration=figures.edges[-1])
        observers: list[Observer] = [figures.add]
        with ExitStack() as files:
            if self.bag:
                bag = files.enter_context(RunBag(self.bag, machine, figures.edges[-1]))
                observers.append(lambda p: bag.add(p.motion, p.impacts, p.modes))
            channels: Channels = {}
            writers = []
            for shard in self.shards:
                writer = shard.writer(self.name, figures.since, channels)
                writers.append(files.enter_context(writer))
                observers.append(writer.add)
            run.finish(observers)
            for writer in writers:
                writer.finish()
        return figures.row(run)


class _Figures:
    """Figures of a row, of a run that comes in pieces.

    Attributes
    ----------
    edges : ends of the intervals that are counted [s]
    since : when the first of them begins of which figures are made [s]
    """

    def __init__(self, machine: Machine, task: SweepTask) -> None:
        self.edges, self._skip = task.extent.edges(machine)
        self.since = self.edges[self._skip]
        self._whole = bool(task.extent.revolutions)
        self._main = machine.physics.coordinates.index(machine.plan.main)
        self._crank = np.full(len(self.edges), math.nan)  # its angle at the edges [rad]
        self._tally, self._digest = StatisticsTally(self.edges), MotionDigest()
        self._peaks = LoadPeaks(machine, self.since)
        self._struck: dict[str, list[float]] = {joint: [] for joint in machine.physics.clearances}
        self._taken = Measurement(machine, task.measures, self.since) if task.measures else None

    def add(self, piece: Piece) -> None:
        """Enter the piece that follows."""
        motion, curve = piece.motion, piece.motion.curve
        if self._taken:
            self._taken.add(piece)
        self._peaks.add(motion)
        self._tally.add(piece)
        if len(curve):
            # the last edge may be the end but for rounding
            inside = (self.edges >= curve.start[0]) & (self.edges <= curve.end * (1.0 + 1e-12))
            at = np.minimum(self.edges[inside], curve.end)
            self._crank[inside] = curve(at)[:, self._main]
        self._digest.add(motion, piece.impacts)
        for impact in piece.impacts:
            if impact.t >= self.since:
                self._struck[impact.joint].append(impact.normal_impulse)

    def row(self, run: Stream) -> Row:
        """The figures of the whole run."""
        turned = np.abs(np.diff(self._crank))[self._skip :] / (2.0 * np.pi)
        if self._whole:
            turned = np.ones_like(turned)  # but for rounding
        found = [x for m in self._tally.means(self._skip, turned) for x in (m.mean, m.half_width)]
        forces, largest = (
            self._peaks.forces,
            {j: max(x, default=0.0) for j, x in self._struck.items()},
        )
        found += [
            turned.sum(),
            max(largest.values(), default=0.0),
            max((peak.value for peak in forces.values()), default=math.nan),
            run.max_penetration,
            run.energy.residual if run.energy else math.nan,
        ]
        figures = {figure.name: x for figure, x in zip(FIGURES, found, strict=True)}
        figures |= {f'largest_force.{joint}': peak.value for joint, peak in forces.items()}
        figures |= {f'largest_torque.{c}': x.value for c, x in self._peaks.torques.items()}
        figures |= {f'impacts.{joint}': len(x) for joint, x in self._struck.items()}
        figures |= {f'largest_impulse.{joint}': x for joint, x in largest.items()}
        figures |= {m.name: m.value for m in (self._taken.found() if self._taken else ())}
        row: Row = {k: float(x) if math.isfinite(x) else None for k, x in figures.items()}
        return row | {'steps': run.stats.steps, 'digest': self._digest.hexdigest()}
