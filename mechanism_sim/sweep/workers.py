"""Who computes: processes of this machine, or a Dask cluster. The rows are the same."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

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
    before = set(multiprocessing.active_children())
    # libraries of linear algebra would take a thread for every core in every process
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context('spawn'), initializer=_end_with_parent
    )
    try:
        # Processes inherit what is blocked: Ctrl-C is for the parent, which ends them.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            futures = [pool.submit(work, task) for task in tasks]
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        for future in as_completed(futures):
            yield future.result()
    except BrokenProcessPool as error:
        raise RunError(
            'a worker process died, perhaps for lack of memory; the same command goes on from the '
            'finished runs, --workers 1 takes the least memory'
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()


def _end_with_parent() -> None:
    """Let this process end when its parent does, even if that is killed."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


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
