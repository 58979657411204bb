"""Processes of this machine that share work.

Not heyoka's batch mode: steps are a quarter of a run, so that a batch of eight would save a sixth,
for a second event loop.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from mechanism_sim import ending
from mechanism_sim.errors import RunError

Work = TypeVar('Work')
Result = TypeVar('Result')

_HINT = 'the same command goes on from the finished runs, --workers 1 takes the least memory'


def run_local(
    tasks: Sequence[Work], workers: int, work: Callable[[Work], Result], hint: str = _HINT
) -> Generator[Result, None, None]:
    """Results as they are finished, by so many processes that live until the end.

    What a process has compiled serves all its runs that differ in numbers only. Closing the
    iterator ends the processes at once.

    Raises
    ------
    RunError
        If a process dies, with the hint how to go on; or what the work raises.
    """
    if not tasks:
        return
    try:
        with ending.workers(workers) as pool:
            with (
                ending.signals_held()
            ):  # in them Ctrl-C stays so: it is for this process, which ends them
                futures = [pool.submit(work, task) for task in tasks]
            for future in as_completed(futures):
                yield future.result()
    except BrokenProcessPool as error:
        raise RunError(f'a worker process died, perhaps for lack of memory; {hint}') from error
