"""A Dask cluster instead of the processes of this machine; the rows are the same."""

from __future__ import annotations

from collections.abc import Generator, Sequence

from mechanism_sim.errors import InputError, RunError
from mechanism_sim.packages import needed
from mechanism_sim.studies.row import RunResult, Task, compute


def run_on_cluster(tasks: Sequence[Task], address: str) -> Generator[RunResult, None, None]:
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
    distributed = needed('distributed', 'the option --dask')
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
