"""Who computes: processes of this machine, or a Dask cluster. The rows are the same."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from mechanism_sim import ending
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.sweep.row import Finished, Task, compute

Work = TypeVar('Work')
Result = TypeVar('Result')


def on_this_machine(
    tasks: Sequence[Work], workers: int, work: Callable[[Work], Result]
) -> Generator[Result, None, None]:
    """Results as they are finished, by so many processes that live until the end.

    What a process has compiled serves all its runs that differ in numbers only. Closing the
    iterator ends the processes at once.

    Raises
    ------
    RunError
        If a process dies, or a bag cannot be written.
    """
    if not tasks:
        return
    try:
        with ending.workers(workers) as pool:
            with ending.held():  # in them Ctrl-C stays so: it is for this process, which ends them
                futures = [pool.submit(work, task) for task in tasks]
            for future in as_completed(futures):
                yield future.result()
    except BrokenProcessPool as error:
        raise RunError(
            'a worker process died, perhaps for lack of memory; the same command goes on from the '
            'finished runs, --workers 1 takes the least memory'
        ) from error


def on_cluster(tasks: Sequence[Task], address: str) -> Generator[Finished, None, None]:
    """Rows as they are finished, by the workers of the Dask scheduler at an address.

    Raises
    ------
    InputError
        If Dask is not installed, or there is no scheduler.
    RunError
        If the cluster loses a run, or a bag cannot be written.
    """
    if not tasks:
        return
    try:
        import distributed  # noqa: PLC0415 - an optional package
    except ImportError as error:
        raise InputError(
            "--dask needs the package 'distributed': pip install 'mechanism_sim[cluster]'"
        ) from error
    try:
        client = distributed.Client(address)
    except (OSError, ValueError) as error:
        raise InputError(f"there is no Dask scheduler at '{address}'") from error
    with client:
        futures = [client.submit(compute, task, pure=False) for task in tasks]
        try:
            for future in distributed.as_completed(futures):
                yield future.result()
                future.release()
        except (distributed.KilledWorker, distributed.CancelledError, OSError) as error:
            raise RunError(
                f'the cluster lost a run ({type(error).__name__}); the same command goes on from '
                'the finished runs'
            ) from error
