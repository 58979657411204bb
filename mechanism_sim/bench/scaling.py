"""What this package costs against the size of the machine, of its output, and of the run."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechanism_sim.scene import Machine, load_scene, simulate

REVOLUTIONS = 20
JOINTS = ('coupler_rocker', 'crank_coupler', 'rocker_ground', 'ground_crank')
RATES = (1e3, 1e4, 1e5)
LENGTHS = (10, 100, 1000)
REPEATS = 3


@dataclass(frozen=True)
class Cost:
    """One point of a family.

    Attributes
    ----------
    family : what varies
    size : of it
    cpu_per_unit : [s]
    unit : what the time counts
    peak_memory : [B] that Python and NumPy held at most, where it was asked for
    """

    family: str
    size: float
    cpu_per_unit: float
    unit: str
    peak_memory: int | None = None


def scaling(show: Callable[[str], None] = lambda _: None) -> list[Cost]:
    """All families, one after the other."""
    found = []
    for family in (_loose_joints, _sample_rates, _lengths):
        for cost in family():
            show(f'{cost.family} {cost.size:g}: {cost.cpu_per_unit:.3g} s per {cost.unit}')
            found.append(cost)
    return found


def _cpu(work: Callable[[], Any]) -> float:
    """Least CPU time of a few repeats [s]."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


def _loose(count: int) -> Machine:
    clearance = {'radial': 2.54e-4, 'restitution': 0.5}
    overrides = {f'joints.{joint}.clearance': clearance for joint in JOINTS[:count]}
    machine = load_scene('four_bar_clearance', overrides)
    machine.prepare()
    return machine


def _loose_joints() -> Iterator[Cost]:
    """CPU time of a revolution with one to four loose joints."""
    for count in range(1, len(JOINTS) + 1):
        machine = _loose(count)
        solution = min(
            (simulate(machine, revolutions=REVOLUTIONS) for _ in range(REPEATS)),
            key=lambda s: s.stats.cpu_time,
        )
        yield Cost('loose joints', count, solution.stats.cpu_time / REVOLUTIONS, 'revolution')


def _sample_rates() -> Iterator[Cost]:
    """CPU time of sampling everything over a revolution, beyond that of solving."""
    solution = simulate(_loose(1), revolutions=REVOLUTIONS)
    for rate in RATES:
        t = np.arange(0.0, solution.duration, 1.0 / rate)
        cpu = _cpu(lambda t=t: solution.sample(t))  # type: ignore[misc]
        yield Cost('sample rate [Hz], all columns of solve --output', rate, cpu / REVOLUTIONS,
                   'revolution')  # fmt: skip


def _lengths() -> Iterator[Cost]:
    """CPU time of a revolution and peak memory of a run that keeps all of its motion."""
    machine = _loose(1)
    for revolutions in LENGTHS:
        cpu = simulate(machine, revolutions=revolutions).stats.cpu_time
        tracemalloc.start()
        simulate(machine, revolutions=revolutions)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        yield Cost('revolutions, all motion kept', revolutions, cpu / revolutions, 'revolution',
                   peak)  # fmt: skip
