"""Progress of long work on a terminal, and the closing lines of a run."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

    from mechanism_sim.nodes.run import Outcome

Show = Callable[..., None]
"""Called with simulated time [s], then real-time factor where known, then impacts so far."""


@contextmanager
def bar(label: str, total: float, quiet: bool) -> Iterator[Show]:
    """A progress bar on standard error: simulated time, real-time factor, impacts so far."""
    if not _watched(quiet):
        yield lambda *_: None
        return
    from rich.progress import TextColumn  # noqa: PLC0415

    done = TextColumn('{task.completed:.3f}/{task.total:.3f} s')
    with _display(done) as display:
        task = display.add_task(label, total=total, note='preparing')

        def show(time: float, *rest: float) -> None:
            *factor, impacts = rest
            note = f'{factor[0]:.1f} x real time, ' if factor else ''
            display.update(task, completed=time, note=f'{note}{impacts:.0f} impacts')

        yield show


@contextmanager
def count(label: str, total: int, quiet: bool) -> Iterator[Callable[..., None]]:
    """A progress bar on standard error for so many runs: finished, failed, time left."""
    if not _watched(quiet):
        yield lambda *_: None
        return
    from rich.progress import MofNCompleteColumn  # noqa: PLC0415

    with _display(MofNCompleteColumn()) as display:
        task = display.add_task(label, total=total, note='')

        def show(finished: int, failed: int = 0) -> None:
            display.update(task, completed=finished, note=f'{failed} failed' if failed else '')

        yield show


@contextmanager
def share(label: str, quiet: bool) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error for work of which the part done is known, as of a file."""
    if not _watched(quiet):
        yield lambda _: None
        return
    from rich.progress import TaskProgressColumn  # noqa: PLC0415

    with _display(TaskProgressColumn()) as display:
        task = display.add_task(label, total=1.0, note='')
        # what is read a second time does not begin anew
        yield lambda done: display.update(task, completed=max(done, display.tasks[0].completed))


@contextmanager
def busy(label: str, quiet: bool) -> Iterator[Callable[[str], None]]:
    """What is going on, and for how long, on standard error, where no end is known beforehand."""
    if not _watched(quiet):
        yield lambda _: None
        return
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    text = TextColumn('{task.description}', markup=False)
    note = TextColumn('{task.fields[note]}', markup=False)
    with _live(SpinnerColumn(), text, TimeElapsedColumn(), note) as display:
        task = display.add_task(label, total=None, note='')
        yield lambda doing: display.update(task, note=doing)


def _watched(quiet: bool) -> bool:
    """Whether somebody looks on, at a terminal that can rewrite a line."""
    return not quiet and sys.stderr.isatty() and os.environ.get('TERM') != 'dumb'


def _display(done: ProgressColumn) -> Progress:
    """A bar between what it is about and how much is done, a note, and the time left."""
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    text = TextColumn('{task.description}', markup=False)
    note = TextColumn('{task.fields[note]}', markup=False)
    return _live(text, BarColumn(), done, note, TimeRemainingColumn())


def _live(*columns: ProgressColumn) -> Progress:
    """A line on standard error that goes away when it ends; standard output is left alone."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import Progress  # noqa: PLC0415

    return Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=False)


def render(outcome: Outcome) -> str:
    """The closing lines of a run."""
    lines = [
        f'{outcome.scene} ({outcome.level}): {outcome.duration:.6g} s simulated in '
        f'{outcome.run_time:.3g} s, {outcome.realtime_factor:.3g} x real time '
        f'({outcome.wall_time:.3g} s with starting and ending)',
        f'  {outcome.impacts} impacts, {sum(outcome.sent.values())} messages',
    ]
    return '\n'.join([*lines, f'  recorded in {outcome.bag}'] if outcome.bag else lines)
