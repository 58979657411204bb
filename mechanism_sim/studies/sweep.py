"""A whole sweep: missing rows are computed and stored, then the table is written."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechanism_sim import output, tables
from mechanism_sim.arguments import check_options, public
from mechanism_sim.engine import plotting
from mechanism_sim.errors import InputError
from mechanism_sim.scene import Source
from mechanism_sim.studies.columns import overloads_of
from mechanism_sim.studies.journal import Journal, journal_of
from mechanism_sim.studies.plan import Run, SweepPlan, read_plan
from mechanism_sim.studies.row import SweepTask
from mechanism_sim.studies.runs import Row, Show, Workers, has_failed

if TYPE_CHECKING:
    from mechanism_sim.studies.shards import Shard

_LOST = 'the same command goes on from the finished runs, --workers 1 takes the least memory'

_NO_FOLDERS = {*tables.ENDINGS} - {'.parquet'}
"""Endings of files; folders of Parquet files are often called NAME.parquet."""


@dataclass(frozen=True)
class SweepSummary:
    """Summary of a sweep; `cpu_time` [s] is that of the runs computed now, over all workers."""

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


@public
def sweep(
    source: str | Path | Mapping[str, Any],
    file: str | Path | None = None,
    *,
    scene: Source | None = None,
    measures: str | Sequence[str] = (),
    workers: int | None = 1,
    **how: Any,
) -> tables.Table:
    """Run a grid or a list of scenes; a row for each run.

    >>> import mechanism_sim as ms
    >>> grid = {'drive.speed': ['60 rpm', '120 rpm']}
    >>> found = ms.sweep({'revolutions': 1, 'grid': grid}, scene='slider_crank',
    ...                  measures=['top = highest(velocity.piston)'])
    >>> round(float(found['top'][1] / found['top'][0]), 9)
    2.0

    Parameters
    ----------
    source : a sweep of the package, the path of a file, or its keys and values as a dictionary, in
        which scenes have any form for `load_scene`
    file : table to write, with a journal from which an interrupted sweep goes on; none if not
        given
    scene : scene of all runs, if `source` has none, likewise
    measures : more of them, as ``NAME = TEXT`` or ``TEXT``
    workers : processes, a single one this process; None for one for each core, in a script only
        below ``if __name__ == '__main__':``, as two and more
    how : ``dask``, ``bags``, ``windows``, ``restart``, ``show`` of `run_plan`
    """
    how = check_options(sweep, how, run_plan)
    if file:
        tables.check_file('file', file)
    plan = read_plan(source, measures, scene=scene)
    if plan.windows and not (file or how.get('windows')):
        raise InputError(
            "the sweep has windows: give windows='FOLDER', or a file 'NAME.csv', beside which "
            'they come to NAME.windows'
        )
    with tempfile.TemporaryDirectory() as folder:
        table = Path(file) if file else Path(folder) / 'sweep.csv'
        how = {'show': plotting.progress('sweep', plan.size), **how}
        dask = how.pop('dask', None)
        makers = Workers(None if dask and workers == 1 else workers, dask, lost=_LOST)
        _, rows = run_plan(plan, table, makers, **how)
    return tables.Table.of(plan.table(rows))


def run_plan(
    plan: SweepPlan,
    table: Path,
    workers: int | Workers | None = None,
    dask: str | None = None,
    bags: str | Path | None = None,
    windows: str | Path | None = None,
    restart: bool = False,
    show: Show | None = None,
) -> tuple[SweepSummary, list[Row]]:
    """Make the runs of a sweep that are not made yet, and write its table.

    Parameters
    ----------
    table : file to write, whose ending says the format; the journal of finished runs is beside it
    workers : processes, one for each core by default, or what makes the runs; or
    dask : address of a scheduler
    bags : folder for a bag of every run made now, which all workers reach under this name
    windows : folder for the windows, if the sweep has some; likewise
    restart : make all runs anew

    Returns
    -------
    A summary, and the rows in the order of the plan

    Raises
    ------
    StudyInterrupted
        At SIGINT and SIGTERM.
    """
    tables.check_file('-o', table)
    if not isinstance(workers, Workers):
        workers = Workers(workers, dask, apart=True, lost=_LOST)
    began = time.perf_counter()
    into = _window_folder(plan, table, windows, restart)
    # files go by the numbers of runs, which others have in a longer sweep
    keys = None if into or bags or plan.bags else {run.key for run in plan.runs}
    with Journal(table, plan.fingerprint, restart, size=plan.size, keys=keys) as journal:
        every = _tasks(plan, _bag_folder(plan, table, bags), into)
        tasks = [task for task in every if not _is_complete(task, journal.rows.get(task.key))]
        for task in tasks:  # without its windows a run is repeated
            journal.rows.pop(task.key, None)
        with workers:
            workers.do(tasks, journal, show)
        cut = {shard.file.stem: shard.overloads() for task in every for shard in task.shards}
        rows = [
            {overloads_of(s): n for s, n in cut.get(run.stem, {}).items()} | journal.rows[run.key]
            for run in plan.runs
        ]
        plan.write(table, rows)
    plan.warn(rows)
    summary = SweepSummary(
        plan.name,
        str(table),
        len(rows),
        sum(map(has_failed, rows)),
        len(tasks),
        len(every) - len(tasks),
        time.perf_counter() - began,
        journal.cpu,
        sum(shard.count for task in every for shard in task.shards),
        str(into) if into else None,
    )
    return summary, rows


def _is_complete(task: SweepTask, row: Row | None) -> bool:
    """True if a run need not be made: its row is known, and so are its windows if it has any."""
    if row is None:
        return False
    return has_failed(row) or all(shard.file.exists() for shard in task.shards)


def _tasks(plan: SweepPlan, bags: Path | None, windows: Path | None) -> list[SweepTask]:
    """Motions to compute: a motion for all runs that differ in their sensors only."""
    cut: dict[int, Shard] = {}
    if windows:
        from mechanism_sim.studies.shards import shards  # noqa: PLC0415 - pyarrow is slow to load

        cut = shards(plan, windows)
    sharing: dict[str, list[Run]] = {}
    for run in plan.runs:
        sharing.setdefault(run.key, []).append(run)
    tasks = []
    for key, (run, *others) in sharing.items():
        bag = bags / f'{run.stem}.mcap' if bags else None
        files = tuple(cut[r.index] for r in (run, *others)) if cut else ()
        task = SweepTask(key, run.name, run.scene, plan.extent, bag, files, run.measures)
        tasks.append(replace(task, refused=run.refused))
    return tasks


def _bag_folder(plan: SweepPlan, table: Path, bags: str | Path | None) -> Path | None:
    """Folder for the bags of runs; None if none are recorded."""
    if not bags and not plan.bags:
        return None
    folder = Path(bags) if bags else table.with_suffix('.bags')
    return output.make_folder(folder.resolve(), "the bags' folder ")


def _window_folder(
    plan: SweepPlan, table: Path, windows: str | Path | None, restart: bool
) -> Path | None:
    """Folder for windows; None without windows. Windows of this sweep in it stay."""
    if not plan.windows:
        if windows:
            raise InputError(f"--windows {windows}: the sweep has no key 'windows'")
        return None
    folder = Path(windows) if windows else table.with_suffix('.windows')
    if folder.suffix in _NO_FOLDERS:
        raise InputError(
            f'--windows {windows}: windows are Parquet files in a folder: give its name, without '
            f"'{folder.suffix}'"
        )
    folder = output.make_folder(folder.resolve(), "the windows' folder ")
    own = {f'{run.stem}.parquet' for run in plan.runs}
    begun = restart or journal_of(table).exists()
    there = sorted(folder.glob('*.parquet'))
    for file in there:
        if not begun or file.name not in own:
            raise InputError(
                f"'{file}' is not of this sweep, but readers of the folder would read it too: "
                'choose another folder by --windows, or remove it'
            )
    for file in there if restart else ():
        file.unlink()
    return folder
