"""One run of a sweep and the row it makes, in one pass and with bounded memory."""

from __future__ import annotations

import math
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.digest import MotionDigest
from mechanism_sim.numerics.batch_means import ratio
from mechanism_sim.results.measures import Measurement
from mechanism_sim.results.ranges import LoadPeaks
from mechanism_sim.results.simulate import stream
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.schema import Scene
from mechanism_sim.studies.figures import FIGURES
from mechanism_sim.studies.file_errors import FileError
from mechanism_sim.studies.plan import Extent
from mechanism_sim.studies.run_bag import RunBag
from mechanism_sim.studies.statistics import Tally

if TYPE_CHECKING:
    from mechanism_sim.studies.shards import Channels, Shard, ShardWriter

Value = float | int | str | None
DONE = 'done'


@dataclass(frozen=True)
class Task:
    """Input of a worker for one motion; `bag` is a file to record it in.

    Runs that differ in their sensors only share a motion, and write a shard each.
    """

    key: str
    name: str
    scene: Scene
    extent: Extent
    bag: Path | None = None
    shards: tuple[Shard, ...] = ()
    measures: tuple[str, ...] = ()


class RunResult(NamedTuple):
    """A row, the key of its run, and what it cost [s of CPU]."""

    key: str
    row: dict[str, Value]
    cpu: float


def compute(task: Task) -> RunResult:
    """Make a run; the row of one that fails holds the reason.

    Raises
    ------
    FileError
        If its bag or its windows cannot be written.
    """
    cpu = time.process_time()
    try:
        row = _measure(Machine(task.name, task.scene), task)
    except FileError:
        raise
    except (InputError, RunError) as error:
        row = {'status': str(error)}
    return RunResult(task.key, row, time.process_time() - cpu)


def _measure(machine: Machine, task: Task) -> dict[str, Value]:
    extent = task.extent
    edges, skip = extent.edges(machine)
    physics, peaks = machine.physics, LoadPeaks(machine, edges[skip])
    tally, digest = Tally(edges), MotionDigest()
    crank = np.full(len(edges), math.nan)
    largest = 0.0
    struck: dict[str, list[float]] = {joint: [] for joint in physics.clearances}
    taken = Measurement(machine, task.measures, edges[skip]) if task.measures else None
    run = stream(machine, duration=edges[-1])
    with ExitStack() as files:
        bag = files.enter_context(RunBag(task.bag, machine, edges[-1])) if task.bag else None
        channels: Channels = {}
        writers = _writers(task)
        cut = [
            files.enter_context(write(s, task.name, edges[skip], channels)) for write, s in writers
        ]
        for piece in run:
            motion, impacts = piece.motion, piece.impacts
            if bag:
                bag.add(motion, impacts, piece.modes)
            for shard in cut:
                shard.add(motion)
            if taken:
                taken.add(piece)
            peaks.add(motion)
            tally.add(piece)
            _follow(crank, edges, motion, physics.coordinates.index(machine.main))
            digest.add(motion, impacts)
            for i in impacts:
                if i.t >= edges[skip]:
                    largest = max(largest, i.normal_impulse)
                    struck[i.joint].append(i.normal_impulse)
        for shard in cut:
            shard.finish()
    turned = np.abs(np.diff(crank))[skip:] / (2.0 * np.pi)
    if extent.revolutions:
        turned = np.ones_like(turned)  # but for rounding
    kept, width = tally.table[skip:].T, np.diff(edges)[skip:]
    pairs = [*zip(kept, (turned, turned, turned, width, turned), strict=True), (kept[1], kept[0])]
    figures = [x for pair in pairs for x in ratio(*pair)]
    residual = run.energy.residual if run.energy else math.nan
    force = max((peak.value for peak in peaks.forces.values()), default=math.nan)
    figures += [turned.sum(), largest, force, run.max_penetration, residual]
    row: dict[str, Value] = {
        column.name: float(x) if math.isfinite(x) else None
        for column, x in zip(FIGURES, figures, strict=True)
    }
    own = {f'largest_force.{joint}': peak.value for joint, peak in peaks.forces.items()}
    own |= {f'largest_torque.{c}': peak.value for c, peak in peaks.torques.items()}
    own |= {f'impacts.{joint}': float(len(x)) for joint, x in struck.items()}
    own |= {f'largest_impulse.{joint}': max(x, default=0.0) for joint, x in struck.items()}
    own |= {m.name: m.value for m in (taken.found() if taken else ())}
    row |= {name: float(x) if math.isfinite(x) else None for name, x in own.items()}
    return row | {'steps': run.stats.steps, 'digest': digest.hexdigest(), 'status': DONE}


def _writers(task: Task) -> list[tuple[type[ShardWriter], Shard]]:
    """What writes the windows of a run; most have none."""
    if not task.shards:
        return []
    from mechanism_sim.studies.shards import ShardWriter  # noqa: PLC0415 - seldom needed

    return [(ShardWriter, shard) for shard in task.shards]


def _follow(crank: Array, edges: Array, motion: Motion, index: int) -> None:
    """Enter the crank's angle [rad] at the edges that a batch of steps holds."""
    curve = motion.curve
    if len(curve):
        # the last edge may be the end but for rounding
        inside = (edges >= curve.start[0]) & (edges <= curve.end * (1.0 + 1e-12))
        crank[inside] = curve(np.minimum(edges[inside], curve.end))[:, index]
