"""A whole sweep: what is missing is computed, what is computed is kept, the table comes last."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

from mechanism_sim.errors import InputError
from mechanism_sim.sweep.plan import Plan, Run
from mechanism_sim.sweep.row import DONE, Task, Value
from mechanism_sim.sweep.store import Journal, write_table
from mechanism_sim.sweep.workers import on_cluster, on_this_machine

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

    def to_json(self) -> dict[str, object]:
        """As a plain dictionary."""
        return asdict(self)


class Interrupted(Exception):  # noqa: N818 - nothing went wrong
    """SIGINT or SIGTERM ended a sweep; the text says how to go on."""


def sweep(
    plan: Plan,
    table: Path,
    workers: int | None = None,
    dask: str | None = None,
    bags: str | None = None,
    restart: bool = False,
    show: Show | None = None,
) -> tuple[Summary, list[dict[str, Value]]]:
    """Make the runs of a sweep that are not made yet, and write its table.

    Parameters
    ----------
    table : Parquet file to write; the journal of finished runs is beside it
    workers : processes, one for each core by default; or
    dask : address of a scheduler
    bags : folder for a bag of every run made now, which all workers reach under this name
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
    Interrupted
        At SIGINT.
    """
    check_table(table)
    if workers is not None and (workers < 1 or dask):
        raise InputError(
            '--workers must be at least 1'
            if workers < 1
            else '--workers and --dask exclude each other: a cluster has workers of its own'
        )
    began, cpu = time.perf_counter(), 0.0
    with Journal(table, plan, restart) as journal:
        folder = _bag_folder(plan, table, bags)
        unique: dict[str, Task] = {}
        for run in plan.runs:
            unique.setdefault(run.key, _task(plan, run, folder))
        kept = len(journal.rows)
        tasks = [task for key, task in unique.items() if key not in journal.rows]
        failed = sum(map(_failed, journal.rows.values()))
        cores = len(os.sched_getaffinity(0))
        source = on_cluster(tasks, dask) if dask else on_this_machine(tasks, workers or cores)
        try:
            with closing(source) as finished:
                for one in finished:
                    journal.add(one)
                    cpu += one.cpu
                    failed += _failed(one.row)
                    if show:
                        show(len(journal.rows), failed)
        except KeyboardInterrupt:
            raise Interrupted(
                f'interrupted after {len(journal.rows)} of {plan.size} runs, which are kept in '
                f"'{journal.path}'; the same command goes on from there"
            ) from None
        rows = [journal.rows[run.key] for run in plan.runs]
        write_table(table, plan, rows)
    wall, failed = time.perf_counter() - began, sum(map(_failed, rows))
    return Summary(plan.name, str(table), len(rows), failed, len(tasks), kept, wall, cpu), rows


def _task(plan: Plan, run: Run, folder: Path | None) -> Task:
    bag = folder / f'run_{run.index:05d}.mcap' if folder else None
    return Task(run.key, run.name, run.scene, plan.extent, bag)


def _bag_folder(plan: Plan, table: Path, bags: str | None) -> Path | None:
    """Where runs are to be recorded, if they are."""
    if not bags and not plan.bags:
        return None
    folder = (Path(bags) if bags else table.with_suffix('.bags')).resolve()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the bags' folder '{folder}' cannot be made: {error.strerror}"
        ) from error
    return folder


def check_table(table: Path) -> None:
    """Refuse a table that cannot be written.

    Raises
    ------
    InputError
    """
    if table.suffix != '.parquet':
        raise InputError(f'-o {table}: the ending must be .parquet')
    if not table.resolve().parent.is_dir():
        raise InputError(f"-o {table}: there is no directory '{table.parent}'")


def _failed(row: dict[str, Value]) -> bool:
    return row['status'] != DONE
