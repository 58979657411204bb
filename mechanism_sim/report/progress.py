"""Progress of long work on a terminal, and the closing lines of a run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mechanism_sim.nodes.run import Outcome

Show = Callable[..., None]
"""Called with simulated time [s], then real-time factor where known, then impacts so far."""


@contextmanager
def bar(label: str, total: float, quiet: bool) -> Iterator[Show]:
    """A progress bar on standard error: simulated time, real-time factor, impacts so far."""
    if quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    columns = (
        TextColumn('{task.description}'),
        BarColumn(),
        TextColumn('{task.completed:.3f}/{task.total:.3f} s'),
        TextColumn('{task.fields[note]}'),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task = display.add_task(label, total=total, note='')

        def show(time: float, *rest: float) -> None:
            *factor, impacts = rest
            note = f'{factor[0]:.1f} x real time, ' if factor else ''
            display.update(task, completed=time, note=f'{note}{impacts:.0f} impacts')

        yield show


@contextmanager
def count(label: str, total: int, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error for so many runs: finished, failed, time left."""
    if quiet or not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn('{task.fields[note]}'),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task = display.add_task(label, total=total, note='')

        def show(finished: int, failed: int) -> None:
            display.update(task, completed=finished, note=f'{failed} failed' if failed else '')

        yield show


@contextmanager
def busy(label: str, quiet: bool) -> Iterator[None]:
    """Says on standard error what goes on, of which nobody knows how long it takes."""
    if quiet or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console  # noqa: PLC0415

    with Console(stderr=True).status(label):
        yield


def render(outcome: Outcome) -> str:
    """The closing lines of a run."""
    lines = [
        f'{outcome.scene} ({outcome.level}): {outcome.duration:.6g} s simulated in '
        f'{outcome.wall_time:.2f} s, {outcome.realtime_factor:.1f} x real time while running',
        f'  {outcome.impacts} impacts, {sum(outcome.sent.values())} messages',
    ]
    return '\n'.join([*lines, f'  recorded in {outcome.bag}'] if outcome.bag else lines)
