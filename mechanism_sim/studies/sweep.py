"""A whole sweep: what is missing is computed, what is computed is kept, the table comes last."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mechanism_sim import output, tables
from mechanism_sim.errors import InputError
from mechanism_sim.studies.cluster import run_on_cluster
from mechanism_sim.studies.journal import Journal, journal_of, write_table
from mechanism_sim.studies.plan import Plan, Run
from mechanism_sim.studies.row import DONE, Task, Value, compute
from mechanism_sim.studies.workers import run_local

if TYPE_CHECKING:
    from mechanism_sim.studies.shards import Shard

Show = Callable[[int, int], None]
"""Called with the number of finished runs, and of those that failed."""


@dataclass(frozen=True)
class Summary:
    """How a sweep went; `cpu_time` [s] is that of the runs computed now, over all workers."""

    sweep: str
    table: str
    runs: int
    failed: int
    computed: int
    kept: int
    wall_time: float
    cpu_time: float
    windows: int = 0
    windows_folder: str | None = None


class SweepInterrupted(Exception):  # noqa: N818 - nothing went wrong
    """SIGINT or SIGTERM ended a sweep; the text tells how to resume it."""


def sweep(
    plan: Plan,
    table: Path,
    workers: int | None = None,
    dask: str | None = None,
    bags: str | None = None,
    windows: str | None = None,
    restart: bool = False,
    show: Show | None = None,
) -> tuple[Summary, list[dict[str, Value]]]:
    """Make the runs of a sweep that are not made yet, and write its table.

    Parameters
    ----------
    table : file to write, whose ending says the format; the journal of finished runs is beside it
    workers : processes, one for each core by default; or
    dask : address of a scheduler
    bags : folder for a bag of every run made now, which all workers reach under this name
    windows : folder for the windows, if the sweep has some; likewise
    restart : make all runs anew

    Returns
    -------
    A summary, and the rows in the order of the plan

    Raises
    ------
    InputError
        If the table or its journal cannot be written or are of something else.
    RunError
        If the workers cannot go on.
    SweepInterrupted
        At SIGINT and SIGTERM.
    """
    tables.check_file('-o', table)
    if workers is not None and (workers < 1 or dask):
        raise InputError(
            '--workers must be at least 1'
            if workers < 1
            else '--workers and --dask exclude each other: a cluster has workers of its own'
        )
    began, cpu = time.perf_counter(), 0.0
    fresh = not restart and not journal_of(table).exists()
    into = _window_folder(plan, table, windows, fresh)
    cut: dict[int, Shard] = {}
    if into:
        from mechanism_sim.studies.shards import name_of, shards  # noqa: PLC0415 - seldom needed

        if restart:
            for run in plan.runs:
                (into / name_of(run)).unlink(missing_ok=True)
    with Journal(table, plan, restart) as journal:
        cut = shards(plan, into) if into else {}
        unique = _tasks(plan, _bag_folder(plan, table, bags), cut)
        tasks = [t for key, t in unique.items() if not _is_complete(t, journal.rows.get(key))]
        finished = kept = len(unique) - len(tasks)
        failed = sum(map(has_failed, journal.rows.values()))
        cores = len(os.sched_getaffinity(0))
        source = (
            run_on_cluster(tasks, dask) if dask else run_local(tasks, workers or cores, compute)
        )
        try:
            with closing(source) as results:
                for one in results:
                    journal.add(one)
                    finished += 1
                    cpu += one.cpu
                    failed += has_failed(one.row)
                    if show:
                        show(finished, failed)
        except KeyboardInterrupt:
            raise SweepInterrupted(
                f'interrupted after {finished} of {plan.size} runs, which are kept in '
                f"'{journal.path}'; the same command goes on from there"
            ) from None
        rows = [journal.rows[run.key] for run in plan.runs]
        write_table(table, plan, rows)
    summary = Summary(
        plan.name,
        str(table),
        len(rows),
        sum(map(has_failed, rows)),
        len(tasks),
        kept,
        time.perf_counter() - began,
        cpu,
        _windows_in(cut),
        str(into) if into else None,
    )
    return summary, rows


def _windows_in(cut: Mapping[int, Shard]) -> int:
    """How many windows there are."""
    if not cut:
        return 0
    from mechanism_sim.studies.shards import windows_in  # noqa: PLC0415 - seldom needed

    return windows_in(cut.values())


def _is_complete(task: Task, row: dict[str, Value] | None) -> bool:
    """Whether a run need not be made: its row is known, and so are its windows if it has any."""
    if row is None:
        return False
    return has_failed(row) or all(shard.file.exists() for shard in task.shards)


def _tasks(plan: Plan, bags: Path | None, cut: Mapping[int, Shard]) -> dict[str, Task]:
    """What is to be computed, by key: a motion for all runs that differ in their sensors only."""
    sharing: dict[str, list[Run]] = {}
    for run in plan.runs:
        sharing.setdefault(run.key, []).append(run)
    tasks = {}
    for key, (run, *others) in sharing.items():
        bag = bags / f'run_{run.index:05d}.mcap' if bags else None
        files = tuple(cut[r.index] for r in (run, *others)) if cut else ()
        tasks[key] = Task(key, run.name, run.scene, plan.extent, bag, files, run.measures)
    return tasks


def _bag_folder(plan: Plan, table: Path, bags: str | None) -> Path | None:
    """Where runs are to be recorded, if they are."""
    if not bags and not plan.bags:
        return None
    folder = Path(bags) if bags else table.with_suffix('.bags')
    return output.make_folder(folder.resolve(), "the bags' folder ")


def _window_folder(plan: Plan, table: Path, windows: str | None, fresh: bool) -> Path | None:
    """Where windows are to be written, if there are any."""
    if not plan.windows:
        if windows:
            raise InputError(f"--windows {windows}: the sweep has no key 'windows'")
        return None
    folder = Path(windows) if windows else table.with_suffix('.windows')
    folder = output.make_folder(folder.resolve(), "the windows' folder ")
    from mechanism_sim.studies.shards import name_of  # noqa: PLC0415 - seldom needed

    own = set() if fresh else {name_of(run) for run in plan.runs}
    for file in sorted(folder.glob('*.parquet')):
        if file.name not in own:
            raise InputError(
                f"'{file}' is not of this sweep, but readers of the folder would read it too: "
                'choose another folder by --windows, or remove it'
            )
    return folder


def has_failed(row: dict[str, Value]) -> bool:
    """Whether a row is that of a run that failed."""
    return row['status'] != DONE
