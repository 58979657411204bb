"""Many runs: tasks in, rows out, with any workers.

A task holds all that its row follows from, and can be sent to another process. So rows are the
same in this process, in any number of others and on a cluster, in whatever order they come.

Not heyoka's batch mode: steps are a quarter of a run, so that a batch of eight would save a sixth,
for a second event loop.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

from mechanism_sim import process_exit
from mechanism_sim.arguments import as_annotated
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.packages import needed

Row = dict[str, Any]
"""The result of a run: its figures by name, None where there is none, and its status."""
DONE = 'done'
"""Status of a run that did not fail; of another it is the reason."""

Show = Callable[[int, int], None]
"""Called with the number of finished runs, and of those that failed."""


class Task(Protocol):
    """Work that one process can do by itself, and that only fails by itself.

    Attributes
    ----------
    key : names its row
    """

    @property
    def key(self) -> str: ...  # noqa: D102

    def row(self) -> Row:
        """Run what is to be run; InputError and RunError are failures of this run alone."""


@dataclass(frozen=True)
class Call:
    """A task that is a function and its arguments."""

    key: str
    function: Callable[..., Row]
    arguments: tuple[Any, ...]

    def row(self) -> Row:
        """Row that the function returns."""
        return self.function(*self.arguments)


class RunResult(NamedTuple):
    """A row, the key of its task, what it cost [s of CPU], and why it failed if it did."""

    key: str
    row: Row
    cpu: float
    error: Exception | None = None


class FileError(RunError):
    """A file of a run cannot be written: this ends the study, not only the run."""


@contextmanager
def file_errors(file: Path | None = None) -> Iterator[None]:
    """Raise `FileError` where a file cannot be written."""
    try:
        yield
    except OSError as error:
        raise FileError(f"'{file}' cannot be written: {error.strerror or error}") from error
    except (InputError, RunError) as error:
        raise FileError(str(error)) from error


def compute(task: Task) -> RunResult:
    """Do a task; the row of one that fails holds the reason."""
    cpu = time.process_time()
    try:
        row, failure = task.row() | {'status': DONE}, None
    except FileError:
        raise
    except (InputError, RunError) as error:
        row, failure = {'status': str(error)}, error
    return RunResult(task.key, row, time.process_time() - cpu, failure)


def has_failed(row: Row) -> bool:
    """True if a row is that of a run that failed."""
    return bool(row['status'] != DONE)


class FinishedRows:
    """Rows of finished runs."""

    def __init__(self) -> None:
        self.rows: dict[str, Row] = {}  #: rows by key
        self.failed = 0  #: number of rows of failed runs
        self.errors: dict[str, Exception] = {}  #: errors of added failed rows, by key
        self.cpu = 0.0  #: CPU time of added rows [s]

    def add(self, finished: RunResult) -> None:
        """Keep a finished run."""
        self.rows[finished.key] = finished.row
        self.failed += has_failed(finished.row)
        if finished.error:
            self.errors[finished.key] = finished.error
        self.cpu += finished.cpu


def _is_unguarded() -> bool:
    """True if this process runs a script that does not ask who reads it."""
    main = sys.modules['__main__']
    file = getattr(main, '__file__', None)
    if file is None or getattr(main, '__spec__', None) is not None:
        return False  # a console or a notebook; a module, which workers do not read
    try:
        return '__main__' not in Path(file).read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError):
        return False


def cores() -> int:
    """Number of processor cores available to this process."""
    return len(os.sched_getaffinity(0))


class Workers:
    """Processes of this machine that do tasks, or a Dask cluster; they live as long as its block.

    What a process has compiled serves all its runs that differ in numbers only. Leaving the block
    ends the processes at once.

    Parameters
    ----------
    count : number of workers; default: one for each core; a single one is this process
    dask : address of a scheduler, whose workers do it instead
    apart : True if a single one is a process of its own, whose end is not that of this one
    lost : action if a process dies
    """

    def __init__(
        self,
        count: int | None = None,
        dask: str | None = None,
        apart: bool = False,
        lost: str = '--workers 1 takes the least memory',
    ) -> None:
        if count is not None and (count < 1 or dask):
            raise InputError(
                '--workers must be at least 1'
                if count < 1
                else '--workers and --dask exclude each other: a cluster has workers of its own'
            )
        self._count, self._dask = count or cores(), dask
        self._here = self._count == 1 and not apart
        self._lost, self._started = lost, ExitStack()
        self._submit: Callable[[Task], Any] | None = None

    @classmethod
    def of(cls, given: int | Workers | None) -> Workers:
        """Workers by their number, as functions take it."""
        if isinstance(given, Workers):
            return given
        return cls(as_annotated('workers', given, 'int | None'))

    def do(
        self, tasks: Sequence[Task], rows: FinishedRows, show: Show | None = None
    ) -> dict[str, Row]:
        """Add the rows of tasks that are not there as they are finished, and return all."""
        for finished in self._results([task for task in tasks if task.key not in rows.rows]):
            rows.add(finished)
            if show:
                show(len(rows.rows), rows.failed)
        return rows.rows

    def do_all(
        self, tasks: Sequence[Task], show: Show | None = None, rows: FinishedRows | None = None
    ) -> list[Row]:
        """The rows of tasks in their order; the first that fails raises its error."""
        rows = rows or FinishedRows()
        self.do(tasks, rows, show)
        for task in tasks:
            if error := rows.errors.get(task.key):
                raise error
        return [rows.rows[task.key] for task in tasks]

    def _results(self, tasks: Sequence[Task]) -> Iterator[RunResult]:
        if not tasks:
            return iter(())
        if self._dask:
            return self._on_cluster(tasks, self._dask)
        return map(compute, tasks) if self._here else self._in_processes(tasks)

    def _in_processes(self, tasks: Iterable[Task]) -> Iterator[RunResult]:
        if _is_unguarded():
            raise InputError(
                f'workers = {self._count}: every worker reads the script anew, so that the call '
                "must stand in it below if __name__ == '__main__':"
            )
        try:
            with process_exit.signals_held():  # Ctrl-C is for this process, which ends the others
                if not self._submit:
                    pool = self._started.enter_context(process_exit.workers(self._count))
                    self._submit = lambda task: pool.submit(compute, task)
                futures = [*map(self._submit, tasks)]
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool as error:
            raise RunError(
                f'a worker process died, perhaps for lack of memory; {self._lost}'
            ) from error

    def _on_cluster(self, tasks: Iterable[Task], address: str) -> Iterator[RunResult]:
        distributed = needed('distributed', 'the option --dask')
        if not self._submit:
            try:
                client = self._started.enter_context(distributed.Client(address))
            except (OSError, ValueError) as error:
                raise InputError(f"there is no Dask scheduler at '{address}'") from error
            self._submit = lambda task: client.submit(compute, task, pure=False)
        futures = [*map(self._submit, tasks)]
        try:
            for future in distributed.as_completed(futures):
                yield future.result()
                future.release()
        except (distributed.KilledWorker, distributed.CancelledError, OSError) as error:
            raise RunError(
                f'the cluster lost a run ({type(error).__name__}); {self._lost}'
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: Any) -> None:
        self._submit = None  # entering the block again starts others
        self._started.__exit__(*failure)
