"""A scene from start to end in this process: no nodes, no middleware."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.audit import Audit, Work
from mechanism_sim.hybrid.events import Impact, ModeChange, StopReason
from mechanism_sim.hybrid.sampling import Books
from mechanism_sim.hybrid.snapshot import Snapshot
from mechanism_sim.hybrid.solution import Solution, Stats
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import read_scene
from mechanism_sim.scene.machine import Machine

Progress = Callable[[float, int], None]
"""Called now and then with the simulated time [s] and the number of impacts so far."""

_BATCH = 2048


def load_scene(name: str, overrides: Mapping[str, Any] | Iterable[str] = ()) -> Machine:
    """A scene of the package by name, or your own by path, ready to run.

    Parameters
    ----------
    name : such as ``'four_bar_clearance'`` or ``'my/machine.yaml'``
    overrides : values by dotted path, such as ``{'drive.speed': '300 rpm'}``

    Raises
    ------
    InputError
        One sentence that says what is wrong, where, and what is allowed.
    """
    return build(*read_scene(name, overrides))


def span(machine: Machine, revolutions: float | None, duration: float | None) -> float:
    """The duration [s] asked for, as revolutions of the crank or in seconds; 1 revolution if not.

    Raises
    ------
    InputError
        If both are given, or it is not positive and finite.
    """
    if revolutions is not None and duration is not None:
        raise InputError('give either revolutions or a duration, not both')
    asked = revolutions if revolutions is not None else duration
    if asked is not None and not (asked > 0.0 and math.isfinite(asked)):
        raise InputError(f'the length of a run must be positive and finite, not {asked:g}')
    if duration is None:
        duration = machine.time_of(1.0 if revolutions is None else revolutions)
    return duration


def simulate(
    machine: Machine,
    revolutions: float | None = None,
    duration: float | None = None,
    progress: Progress | None = None,
    resume: Snapshot | None = None,
) -> Solution:
    """Run a machine and keep all of its motion.

    Parameters
    ----------
    revolutions : of the crank, or
    duration : [s]; without either one revolution
    progress : called after every batch of steps
    resume : where an earlier run of the same machine stood; the solution begins there, and
        `revolutions` and `duration` count from the beginning of the earlier run

    Raises
    ------
    InputError
        If the length of the run is not positive, or the snapshot is of another machine.
    RunError
        If the integration breaks down, or the finished motion violates a gap.
    """
    end = span(machine, revolutions, duration)
    wall = time.perf_counter()
    run = machine.resume(resume) if resume else machine.start()
    if run.time >= end:
        raise InputError(f'the snapshot is at {run.time:g} s already: ask for more than that')
    physics = machine.physics
    compile_time = time.perf_counter() - wall
    audit = Audit(physics)
    parts: list[Motion] = []
    works: list[Work] = []
    impacts: list[Impact] = []
    modes: list[ModeChange] = []
    cpu, wall = time.process_time(), time.perf_counter()
    snapshot = None
    while run.time < end:
        if snapshot is None:
            steps = run.steps
            run.advance(end, most=_BATCH)
            if run.steps - steps < _BATCH:
                snapshot = machine.snapshot(run)
        else:
            run.advance(end, final=True)
        motion, struck, changed = run.drain()
        works.append(audit.add(motion, struck))
        audit.judge(machine.allowed_penetration)
        parts.append(motion)
        impacts += struck
        modes += changed
        if progress:
            progress(min(run.time, end), len(impacts))
    stats = Stats(
        time.perf_counter() - wall,
        time.process_time() - cpu,
        compile_time,
        run.steps,
        run.events,
    )
    return Solution(
        machine.name,
        machine.level.value,
        physics,
        Motion.joined(parts),
        Books(Work(*np.concatenate(works, axis=1)), impacts),
        impacts,
        modes,
        stats,
        audit.energy,
        audit.max_penetration,
        audit.max_closure_error,
        StopReason.COMPLETE,
        snapshot or machine.snapshot(run),
    )
