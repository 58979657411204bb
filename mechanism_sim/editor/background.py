"""Checks and runs of a document in a process of its own, which ends with its parent."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from threading import Thread
from typing import Any, NamedTuple

from mechanism_sim import process_exit, strict_json
from mechanism_sim.editor.processes import LARGEST, crowded, work_unseen
from mechanism_sim.errors import InputError, RunError
from mechanism_sim.memory import give_back, resident
from mechanism_sim.packages import reason

PATIENCE = 2.0
"""[s] for a run to notice that it is not wanted any more; then its process is ended."""

_UNTIL = 2.0  # [s] of a run whose length neither the scene says nor the speed of its drive

_OFTEN = 0.2  # [s] between reports of progress


class Job(NamedTuple):
    """A document to be checked and run."""

    number: int  #: number of the document's state
    name: str
    content: dict[str, Any]  #: keys and values of the scene
    #: keys and values with a worn bearing, and its joint and clearance; or None
    worn: tuple[dict[str, Any], dict[str, Any]] | None = None


class Background:
    """Runs the newest of the jobs that are given.

    Parameters
    ----------
    hear : callback from another thread, with (number, kind, JSON text) of a result: kinds
        are ``checked``, ``progress``, ``run``, ``worn`` and ``problem``
    """

    def __init__(self, hear: Callable[[int, str, str], None]) -> None:
        self._hear = hear
        self._process: Any = None
        self._jobs: SimpleQueue[Job | None] = SimpleQueue()
        self._since: float | None = None
        self._busy = False

    def submit(self, job: Job) -> None:
        """Run a document in place of the present job."""
        if self._process is None or not self._process.is_alive():
            try:
                self._start()
            except (OSError, RuntimeError) as error:  # no memory, no processes, no threads
                self.close()
                text = f'it cannot be checked and run: no process starts ({reason(error)})'
                self._hear(job.number, 'problem', strict_json.dumps(text))
                return
        self._since, self._busy = (time.monotonic() if self._busy else None), True
        self._jobs.put(job)

    def look(self, newest: Callable[[], Job | None]) -> None:
        """End a process whose job is outdated, and begin with the newest job.

        An idle process with much memory is ended, too: the next job begins a new one.
        """
        if self._process is not None and not self._busy and resident(self._process.pid) > LARGEST:
            self.close()
        if self._since is not None and time.monotonic() > self._since + PATIENCE:
            self.close()
            if job := newest():
                self.submit(job)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        self._process, self._since, self._busy = None, None, False

    def _start(self) -> None:
        context = get_context('spawn')
        link, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs,), daemon=True)
        with theirs, process_exit.signals_held():
            process.start()
        self._process = process
        self._jobs.put(None)  # ends the threads of earlier processes
        self._jobs = SimpleQueue()
        Thread(target=_give, args=(link, self._jobs), daemon=True).start()
        Thread(target=self._listen, args=(link,), daemon=True).start()

    def _listen(self, link: Connection) -> None:
        try:
            while True:
                number, kind, text = link.recv()
                if kind == 'begun':
                    self._since = None
                elif kind == 'idle':
                    self._busy = False
                else:
                    self._hear(number, kind, text)
        except (EOFError, OSError):
            pass  # process has ended


def _give(link: Connection, jobs: SimpleQueue[Job | None]) -> None:
    """Send jobs to a process, which may be slow to receive them, until the end."""
    with suppress(OSError):  # process has ended
        while job := jobs.get():
            link.send(job)


class _NotWanted(Exception):  # noqa: N818 - no error: the job is dropped
    """Signal that a newer job makes this one superfluous."""


def _serve(link: Connection) -> None:
    """Carry out jobs until the connection ends."""
    work_unseen('run')
    shown = -1  # state number of the run shown
    try:
        job = link.recv()
        from mechanism_sim.numerics.compiled import forget_for_others  # noqa: PLC0415

        forget_for_others(crowded)
        while True:
            while link.poll():
                job = link.recv()
            link.send((job.number, 'begun', ''))
            try:
                problem = '' if shown == job.number else _problem(job, link)
                if problem:
                    link.send((job.number, 'problem', strict_json.dumps(problem)))
                else:
                    shown = job.number
                    _wear(job, link)
            except _NotWanted:
                continue
            give_back()
            link.send((job.number, 'idle', ''))
            job = link.recv()
    except (EOFError, BrokenPipeError):
        return


def _problem(job: Job, link: Connection) -> str:
    """Carry out a job; returns the reason of a failure, or an empty text."""
    try:
        _work(job, link)
    except (_NotWanted, EOFError, BrokenPipeError):
        raise
    except (InputError, RunError) as error:
        return str(error)
    except Exception as error:
        return f'it cannot be checked and run ({reason(error)})'
    return ''


def _work(job: Job, link: Connection) -> None:
    from mechanism_sim.results.measures import check_measures  # noqa: PLC0415
    from mechanism_sim.scene.build import build  # noqa: PLC0415
    from mechanism_sim.scene.check import check  # noqa: PLC0415
    from mechanism_sim.scene.files import check_scene  # noqa: PLC0415

    machine = build(job.name, check_scene(job.name, job.content))
    if machine.scene.measures:
        check_measures(machine, machine.scene.measures, f'{machine.name}: measures')
    link.send((job.number, 'checked', strict_json.dumps(check(machine).to_json())))
    shown = _shown(*_run(machine, job.number, link))
    link.send((job.number, 'run', strict_json.dumps(shown)))


def _wear(job: Job, link: Connection) -> None:
    """Run the machine with a worn bearing: its figures, or the reason of a failure."""
    from mechanism_sim.scene.build import build  # noqa: PLC0415
    from mechanism_sim.scene.files import check_scene  # noqa: PLC0415

    if job.worn is None:
        return
    content, said = job.worn
    found: dict[str, Any]
    try:
        machine = build(job.name, check_scene(job.name, content))
        found = {'figures': _figures(*_run(machine, job.number, link))}
    except (InputError, RunError) as error:
        found = {'problem': str(error)}
    link.send((job.number, 'worn', strict_json.dumps({**said, **found})))


def _run(machine: Any, number: int, link: Connection) -> tuple[Any, Any]:
    """A machine over its length, or over the range of its drive, and its solution."""
    from mechanism_sim.results.simulate import simulate  # noqa: PLC0415
    from mechanism_sim.scene import over_range, run_length  # noqa: PLC0415

    machine = over_range(machine) or machine
    try:
        end = run_length(machine, None, None)
    except InputError:
        if machine.scene.duration is not None:
            raise
        end = run_length(machine, None, _UNTIL)  # the speed of a motor is unknown before the run
    last = time.monotonic()

    def show(t: float, _impacts: int) -> None:
        nonlocal last
        if link.poll():
            raise _NotWanted
        if time.monotonic() > last + _OFTEN:
            last = time.monotonic()
            link.send((number, 'progress', strict_json.dumps(t / end)))

    solution = simulate(machine, duration=end, progress=show)
    show(end, 0)
    give_back()
    return machine, solution


def _shown(machine: Any, solution: Any) -> dict[str, Any]:
    """Frames of a run that a page plays, and its figures."""
    from mechanism_sim.analysis.record import Record  # noqa: PLC0415
    from mechanism_sim.pages.recorded import recorded  # noqa: PLC0415

    record = Record(machine, solution, {})
    figures = _figures(machine, solution)
    shown = recorded(record).to_json()
    return {**shown, 'figures': figures, 'digest': record.digest(), 'end': record.end}


Figure = tuple[str, str, float | None, str, float | None]
"""Quantity, part, value (None: without limit), unit, and instant [s] if there is one."""


def _figures(machine: Any, solution: Any) -> list[Figure]:
    """Largest loads of a run, and its impacts."""
    from mechanism_sim.results.ranges import LoadPeaks  # noqa: PLC0415

    peaks = LoadPeaks(machine)
    peaks.add(solution.motion)
    straight = machine.mechanism.displacements
    figures: list[Figure] = []
    for joint, peak in peaks.forces.items():
        figures.append(('force', joint, _finite(peak.value), 'N', peak.time))
    for c, peak in peaks.torques.items():
        unit = 'N' if c in straight else 'N m'
        figures.append(('drive', c, _finite(peak.value), unit, peak.time))
    if machine.has_contacts:
        hardest = max(solution.impacts, key=lambda i: i.normal_impulse, default=None)
        figures.append(('impacts', '', len(solution.impacts), '', None))
        if hardest:
            figures.append(
                ('hardest', hardest.joint, hardest.normal_impulse, 'N s', float(hardest.t))
            )
    return figures


def _finite(value: float) -> float | None:
    return value if abs(value) < float('inf') else None
