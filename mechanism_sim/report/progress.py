"""Progress of long work on a terminal."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from html import escape
from typing import Any

Show = Callable[..., None]
"""Called with simulated time [s], then real-time factor where known, then impacts so far."""


EVERY = 30.0
"""[s] from line to line of a log."""
_PACE = 4  # runs after the first for an estimate of time left: workers end their first at once
AFTER = 1.0
"""[s] of work after which a notebook shows how far it is."""

_WHAT, _NOTE = '{task.description}', '{task.fields[note]}'


@contextmanager
def bar(label: str, total: float, quiet: bool) -> Iterator[Show]:
    """A progress bar on standard error: simulated time, real-time factor, impacts so far."""
    done = '{task.completed:.3f}/{task.total:.3f} s'
    with _task(label, total, quiet, *_around(done), note='preparing') as update:

        def show(time: float, *rest: float) -> None:
            *factor, impacts = rest
            note = f'{factor[0]:.1f} x real time, ' if factor else ''
            update(completed=time, note=f'{note}{impacts:.0f} impacts')

        yield show


@contextmanager
def count(label: str, total: int, quiet: bool) -> Iterator[Callable[..., None]]:
    """A progress bar on standard error for a number of runs: finished, failed, time left."""
    last = time.monotonic()
    first: tuple[float, int] | None = None  # first report, after imports and compilation
    with _task(label, total, quiet, *_around('MofNCompleteColumn')) as update:

        def show(finished: int, failed: int = 0) -> None:
            nonlocal last, first
            update(completed=finished, note=f'{failed} failed' if failed else '')
            now = time.monotonic()
            if finished and first is None:
                first = now, finished
            # lines for files, where it is no terminal, of work that takes minutes
            if quiet or sys.stderr.isatty() or now < last + EVERY or not finished:
                return
            last = now
            note = f', {failed} failed' if failed else ''
            told = f' of {total}{note}'
            began, before = first or (now, finished)
            if finished >= before + _PACE:
                left = (total - finished) / (finished - before) * (now - began)
                told += f', about {left:.0f} s left'
            if finished > total:  # the number of further runs of a search is unknown
                told = note
            with suppress(OSError):  # as for a log on a full disk
                print(f'{label}: {finished}{told}', file=sys.stderr, flush=True)

        yield show


@contextmanager
def share(label: str, quiet: bool) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error for work of which the part done is known, as of a file."""
    furthest = [0.0]  # reading again does not restart the bar
    with _task(label, 1.0, quiet, *_around('TaskProgressColumn')) as update:

        def show(done: float) -> None:
            furthest[0] = max(done, furthest[0])
            update(completed=furthest[0])

        yield show


@contextmanager
def busy(label: str, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Display of work and its time on standard error, where no end is known beforehand."""
    columns = 'SpinnerColumn', _WHAT, 'TimeElapsedColumn', _NOTE
    with _task(label, None, quiet, *columns) as update:
        yield lambda doing: update(note=doing)


def in_notebook(label: str, total: float) -> Show:
    """Shows progress in the cell of a notebook, where work takes more than a second."""
    began, last = time.monotonic(), [0.0]
    handle: list[Any] = []

    def show(done: float, *_: float) -> None:
        from IPython.display import HTML, display  # noqa: PLC0415 - is there, in a notebook

        now = time.monotonic()
        over = done >= total
        if now < began + AFTER or (now < last[0] + AFTER / 4.0 and not over):
            return
        last[0] = now
        bar = f'{escape(label)} <progress max="1" value="{done / (total or 1.0):.4f}"></progress>'
        left = f' {(total - done) / done * (now - began):.0f} s left' if done else ''
        page = HTML('' if over else f'{bar}{left}')  # type: ignore[no-untyped-call]
        if handle:
            if handle[0]:  # none where IPython is loaded, but no notebook runs
                handle[0].update(page)
        elif not over:
            handle.append(display(page, display_id=True))  # type: ignore[no-untyped-call]

    return show


def _around(done: str) -> tuple[str, ...]:
    """A bar between its label and the progress, a note, and the time left."""
    return _WHAT, 'BarColumn', done, _NOTE, 'TimeRemainingColumn'


@contextmanager
def _task(
    label: str, total: float | None, quiet: bool, *columns: str, note: str = ''
) -> Iterator[Callable[..., None]]:
    """A line on standard error in a terminal, erased at its end.

    Parameters
    ----------
    columns : classes of `rich.progress`, or texts with fields of the task
    """
    if quiet or not sys.stderr.isatty() or os.environ.get('TERM') == 'dumb':
        yield lambda **_: None
        return
    from rich import progress  # noqa: PLC0415
    from rich.console import Console  # noqa: PLC0415

    made = [
        progress.TextColumn(c, markup=False) if '{' in c else getattr(progress, c)()
        for c in columns
    ]
    console = Console(stderr=True)
    with progress.Progress(
        *made, console=console, transient=True, redirect_stdout=False
    ) as display:
        task = display.add_task(label, total=total, note=note)
        yield partial(display.update, task)
