"""A scene from start to end in this process, in pieces or whole: no nodes, no middleware.

A solution is its pieces joined: `stream` is the only way through a run, and its memory is that of
a piece.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Self

from mechanism_sim.arguments import listed, public
from mechanism_sim.engine import plotting
from mechanism_sim.engine.audit import Energy
from mechanism_sim.engine.events import StopReason
from mechanism_sim.engine.snapshot import Snapshot
from mechanism_sim.engine.totals import Totals
from mechanism_sim.errors import InputError, RunError, quoted
from mechanism_sim.numerics.compiled import spent
from mechanism_sim.planar.inverse_dynamics import NoLimit
from mechanism_sim.results.derivatives import AskedDerivatives
from mechanism_sim.results.quantity import View
from mechanism_sim.results.run import Observer, Piece, Runner, Solution, Stats
from mechanism_sim.scene import Machine, Source, load_scene, span
from mechanism_sim.scene.validation import validate_turning

Progress = Callable[[float, int], None]
"""Called now and then with the simulated time [s] and the number of impacts so far."""


class Stream(Runner):
    """A run in pieces, each forgotten when the next one is asked for; iterate over it once.

    After a break between pieces it goes on; where an exception came amid one, by `RunError` not.

    What does not grow with the run is kept here, and is up to date after every piece.

    Parameters
    ----------
    observers : called with every piece before it is handed on; not part of what a run costs

    Attributes
    ----------
    totals : counts and sums of its events
    no_limits : instants of unbounded forces so far
    """

    def __init__(
        self,
        machine: Machine,
        end: float,
        progress: Progress | None,
        resume: Snapshot | None,
        observers: Iterable[Observer] = (),
    ) -> None:
        self._wall_time = self._cpu_time = self._compile_time = 0.0
        self.totals = Totals()
        self.no_limits: list[NoLimit] = []
        with self._timed():
            super().__init__(machine, resume=resume)
        if self.known >= end:
            raise InputError(f'the snapshot is at {self.known:g} s already: choose a longer run')
        self._end, self._progress, self._observers = end, progress, tuple(observers)
        self._snapshot: Snapshot | None = None
        self._last: Piece | None = None
        self._amid = False

    def __repr__(self) -> str:
        return (
            f'<Stream of {self.machine.name}: {self.duration:.6g} s of {self._end:.6g} s, '
            f'{self.totals.impacts} impacts>'
        )

    @contextmanager
    def _timed(self) -> Iterator[None]:
        """Add the elapsed time, without compilation, to that of the run."""
        wall, cpu, made = time.perf_counter(), time.process_time(), spent()
        yield
        compiling = [now - before for now, before in zip(spent(), made, strict=True)]
        self._wall_time += time.perf_counter() - wall - compiling[0]
        self._cpu_time += time.process_time() - cpu - compiling[1]
        self._compile_time += compiling[0]

    def __iter__(self) -> Iterator[Piece]:
        """Run on to the end; the snapshot is that before the last step is cut off."""
        pieces = self.to(self._end, [self._count], held=self._keep)
        while True:
            if self._amid:
                raise RunError(
                    f'{self.machine.name}: this run was interrupted amid a piece, or another '
                    'thread is taking it: begin a new one'
                )
            # also when Ctrl-C comes meanwhile: then nobody knows what is missing
            self._amid = True
            with self._timed():
                piece = next(pieces, None)
            if piece:
                if self._progress:
                    self._progress(min(self.engine.time, self._end), self.totals.impacts)
                for observe in self._observers:
                    observe(piece)
            self._amid = False
            if not piece:
                return
            yield piece

    def _keep(self) -> None:
        if self._snapshot is None:
            self._snapshot = self.machine.snapshot(self.engine)

    def finish(self, observers: Iterable[Observer] = ()) -> Self:
        """Run on to the end, for its observers and these; returns itself."""
        self._observers += tuple(observers)
        for _ in self:
            pass
        return self

    def _count(self, piece: Piece) -> None:
        """Enter a piece in the totals."""
        self.totals.add(piece.impacts, piece.modes)
        for found in self.machine.physics.no_limits(piece.motion):
            if not (self.no_limits and found.is_at(self.no_limits[-1].t)):
                self.no_limits.append(found)
        if len(piece.motion):
            self._last = piece

    @property
    def duration(self) -> float:
        """Simulated time so far [s]."""
        return self._last.motion.curve.end if self._last else self.engine.time

    @property
    def final(self) -> View:
        """The machine at the end of what was run."""
        if self._last is None:
            raise ValueError('nothing has been run yet')
        return self._last.view(self.duration)

    @property
    def energy(self) -> Energy | None:
        """The energy balance so far; ``None`` where masses are not part of the scene."""
        return self.audit.energy

    @property
    def max_penetration(self) -> float:
        """Deepest violation of an open gap so far [m]."""
        return self.audit.max_penetration

    @property
    def max_closure_error(self) -> float:
        """Largest deviation of a closed gap or loop from zero so far [m]."""
        return self.audit.max_closure_error

    @property
    def stats(self) -> Stats:
        """Cost of the run so far, without the processing of its pieces."""
        cost = self._wall_time, self._cpu_time, self._compile_time
        return Stats(*cost, self.engine.steps, self.engine.events)

    @property
    def snapshot(self) -> Snapshot:
        """Snapshot from which a longer run goes on, not later than the end."""
        return self._snapshot or self.machine.snapshot(self.engine)


@public
def stream(
    scene: Source,
    revolutions: float | None = None,
    duration: float | str | None = None,
    progress: Progress | None = None,
    resume: Snapshot | None = None,
    observers: Iterable[Observer] = (),
) -> Stream:
    """Run a machine piece by piece, in memory that does not grow with the length of the run.

    Each `Piece` has some thousand steps, and can be sampled as a whole solution can. The arguments
    are those of `simulate`; `observers` are called with every piece, as ``digest.add``.

    >>> import mechanism_sim as ms
    >>> run = ms.stream('pendulum', duration='2 s')
    >>> max(float(piece.sample(piece.motion.curve.end)['t'][0]) for piece in run)
    2.0
    """
    machine = load_scene(scene)
    end = span(machine, revolutions, duration)
    validate_turning(machine, end)
    progress = progress or plotting.progress(f'simulate {machine.name}', end)
    observers = [*observers] if isinstance(observers, Iterable) else [observers]
    if wrong := [x for x in observers if not callable(x)]:
        raise InputError(f'observers: {quoted(wrong[0])} is not a function')
    return Stream(machine, end, progress, resume, observers)


@public
def simulate(
    scene: Source,
    revolutions: float | None = None,
    duration: float | str | None = None,
    progress: Progress | None = None,
    resume: Snapshot | None = None,
    derivatives: str | Sequence[str] = (),
) -> Solution:
    """Run a machine and keep all of its motion.

    >>> import mechanism_sim as ms
    >>> solution = ms.simulate('slider_crank', duration='0.1 s')
    >>> round(solution.duration, 9)
    0.1

    Parameters
    ----------
    scene : argument of `load_scene`: a machine, a name, a path, YAML, a dictionary
    revolutions : number of revolutions of the crank, or
    duration : [s], or with its unit as ``'10 s'``; without either the scene's, or the
        revolutions that bring all again, most often one
    progress : called after every batch of steps
    resume : snapshot of an earlier run of the same machine; the solution begins there, and
        `revolutions` and `duration` count from the beginning of the earlier run
    derivatives : paths of numbers of the scene, as ``'drive.speed'``, by which the derivatives of
        the run are wanted: `Solution.derivatives`

    Raises
    ------
    InputError
        If the length of the run is not positive, or the snapshot is of another machine.
    RunError
        If the integration breaks down, or the finished motion violates a gap.
    """
    scene = load_scene(scene)
    end = span(scene, revolutions, duration)
    paths = listed(derivatives, 'derivatives')
    asked = AskedDerivatives(scene, paths, end, resume) if paths else None
    run = stream(scene, None, end, progress, resume)
    solution = whole(run, run)
    return replace(solution, derivatives=asked.along(solution)) if asked else solution


def whole(run: Stream, pieces: Iterable[Piece]) -> Solution:
    """The solution of a finished run, from all of its pieces."""
    machine, all_ = run.machine, Piece.joined(pieces)
    return Solution(
        machine,
        all_.motion,
        all_.balance,
        all_.impacts,
        all_.modes,
        machine.name,
        machine.level.value,
        run.stats,
        run.energy,
        run.max_penetration,
        run.max_closure_error,
        StopReason.COMPLETE,
        run.snapshot,
    )
