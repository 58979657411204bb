"""Measuring: every method of a problem at every setting, in turn, so that all share the noise."""

from __future__ import annotations

import gc
import os
import platform
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median

import heyoka as hy
import numpy as np

from benchmarks.problem import Method, Outcome, Problem, Run
from mechanism_sim.errors import RunError

BUDGET = 3.0
"""CPU time [s] after which a method at a setting is not repeated any more."""

BATCH = 5e-3
"""CPU time [s] that quick runs are repeated for at least, to be measured together."""

HEAVY = 0.1
"""CPU time [s] from which on the first run counts, although caches were cold."""

LIBRARIES = (
    'heyoka', 'numpy', 'scipy', 'numba', 'exudyn', 'mujoco', 'drake', 'mechanism_sim',
)  # fmt: skip

Show = Callable[[str], None]


@dataclass
class Row:
    """A method at a setting.

    Attributes
    ----------
    compile_time : [s] CPU time of the preparation, compilation included
    times : [s] CPU time per unit of every repeat
    error : in the problem's unit; not a number where it failed
    failure : what ended it
    """

    method: Method
    tolerance: float
    compile_time: float = 0.0
    times: list[float] = field(default_factory=list)
    error: float = float('nan')
    steps: int | None = None
    impacts: int | None = None
    failure: str = ''

    @property
    def fastest(self) -> float:
        """Least CPU time per unit [s]."""
        return min(self.times, default=float('nan'))

    @property
    def median(self) -> float:
        """Median CPU time per unit [s]."""
        return median(self.times) if self.times else float('nan')


@dataclass(frozen=True)
class Measurement:
    """A problem that was measured: its rows, and the methods left out, with the reason."""

    problem: Problem
    rows: tuple[Row, ...]
    skipped: dict[str, str]

    def cheapest(self, name: str, error: float) -> Row | None:
        """The cheapest row of a method whose error is as small as that, or its most exact row."""
        rows = [row for row in self.rows if row.method.name == name and np.isfinite(row.error)]
        good = [row for row in rows if row.error <= error]
        if good:
            return min(good, key=lambda row: row.fastest)
        return min(rows, key=lambda row: row.error, default=None)


def measure(
    problem: Problem,
    repeats: int = 7,
    methods: Collection[str] | None = None,
    tolerances: Sequence[float] = (),
    show: Show = lambda _: None,
) -> Measurement:
    """Measure a problem.

    Parameters
    ----------
    repeats : of every method at every setting, fewer where `BUDGET` is used up
    methods : names of those wanted; all if not given
    tolerances : replace the settings of the methods whose setting is rtol
    show : called with the present action
    """
    from_disk = hy.llvm_state.get_diskcache_enabled()
    hy.llvm_state.set_diskcache_enabled(False)  # compile times are those of the first time
    skipped: dict[str, str] = {}
    pairs: list[tuple[Row, Run]] = []
    rows: list[Row] = []
    for method in problem.methods:
        if methods is not None and method.name not in methods:
            continue
        reason = method.missing()
        if reason:
            skipped[method.name] = reason
            continue
        asked = tolerances if tolerances and method.setting == 'rtol' else method.settings
        for setting in asked:
            show(f'{problem.name}: preparing {method.name}, {method.setting} {setting:g}')
            row = Row(method, setting)
            rows.append(row)
            run = _first(problem, row)
            if run:
                pairs.append((row, run))
    gc.collect()
    gc.freeze()  # what was prepared is not searched for garbage while others run
    try:
        for i in range(1, repeats):
            show(f'{problem.name}: repeat {i + 1} of {repeats}')
            for row, run in pairs:
                if sum(row.times) * problem.amount < BUDGET:
                    row.times.append(_time_run(run)[0] / problem.amount)
    finally:
        gc.unfreeze()
        hy.llvm_state.set_diskcache_enabled(from_disk)
    return Measurement(problem, tuple(rows), skipped)


def _first(problem: Problem, row: Row) -> Run | None:
    """Prepare a row and run it once; ``None`` if it fails."""
    began = time.process_time()
    try:
        hy.llvm_state.clear_memcache()
        run = row.method.prepare(row.tolerance)
        row.compile_time = time.process_time() - began
        seconds, outcome = _time_run(run, once=True)
        if seconds < HEAVY:  # caches are warm from now on
            seconds, outcome = _time_run(run)
    except RunError as error:
        row.failure = str(error)
        return None
    row.times.append(seconds / problem.amount)
    row.error = problem.error(outcome.answer)
    row.steps, row.impacts = outcome.steps, outcome.impacts
    return run


def _time_run(run: Run, once: bool = False) -> tuple[float, Outcome]:
    """CPU time [s] of a run, the mean over a batch of quick ones, and its outcome."""
    count, began = 0, time.process_time()
    while True:
        answer = run()
        count += 1
        taken = time.process_time() - began
        if once or taken >= BATCH:
            break
    outcome = answer()
    return (taken / count if outcome.cpu_time is None else outcome.cpu_time), outcome


def machine() -> dict[str, object]:
    """Machine on which the measurements are made."""
    versions: dict[str, str] = {}
    for name in LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return {
        'processor': _processor(),
        'cores': os.cpu_count(),
        'system': f'{platform.system()} {platform.machine()}',
        'python': platform.python_version(),
        'libraries': versions,
    }


def _processor() -> str:
    cpuinfo = Path('/proc/cpuinfo')
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding='utf-8').splitlines():
            key, _, value = line.partition(':')
            if key.strip() == 'model name':
                return value.strip()
    return platform.processor() or platform.machine()
