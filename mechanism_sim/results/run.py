"""The one loop: a machine is integrated, its motion audited, and handed on piece by piece.

Whoever needs a run reads its pieces or observes them: solutions, streams, nodes, sweeps, studies.
Nobody sees a piece that has not been audited, so that a run that fails does so everywhere alike.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from mechanism_sim.hybrid.audit import Audit, Work
from mechanism_sim.hybrid.energy_terms import EnergyTerms
from mechanism_sim.hybrid.snapshot import Snapshot
from mechanism_sim.results.solution import Piece
from mechanism_sim.scene import Machine
from mechanism_sim.scene.machine import Run

Observer = Callable[[Piece], object]
"""Is handed every piece of a run in order, such as ``digest.add``."""


class Batch(NamedTuple):
    """How much is integrated before it is audited and handed on; motions do not depend on it."""

    steps: int
    stride: int  #: steps after which the time is looked at
    longest: float = math.inf  #: [s] of wall time


BATCH = Batch(8192, 8192)
"""The memory of a run is that of so many steps."""


class Runner:
    """A run of a machine, as far as it has been asked for.

    Parameters
    ----------
    engine : that is started already, instead of a new one
    resume : from where the run goes on
    audited : whether its motion is that of the machine; a shooting method tries motions that may
        violate gaps, and asks for the audit of the one that it ends with

    Attributes
    ----------
    machine : that runs
    engine : that integrates
    audit : of all that has been handed on
    known : time [s] up to which the motion is known, with what the engine holds back
    more : whether there is more to come than the last piece, of what was asked for
    """

    def __init__(
        self,
        machine: Machine,
        engine: Run | None = None,
        resume: Snapshot | None = None,
        audited: bool = True,
    ) -> None:
        self.machine = machine
        self.engine = engine or (machine.resume(resume) if resume else machine.start())
        self.audit = Audit(machine.physics)
        self.known, self.more = self.engine.time, True
        self._audited = audited

    def to(
        self,
        until: float,
        observers: Iterable[Observer] = (),
        final: bool = True,
        batch: Batch | None = None,
        held: Callable[[], object] | None = None,
    ) -> Iterator[Piece]:
        """Go on to a time [s]; at least one piece follows, which may be empty.

        Parameters
        ----------
        observers : called with every piece before it is handed on
        final : whether the last step is cut off there; else it is held back, for what comes later
            may need it whole
        batch : `BATCH` if not given
        held : called before the last step is cut off

        Raises
        ------
        RunError
            If the integration breaks down, or the motion violates a gap or the energy balance.
        """
        self.more = True
        while self.more:
            whole = final and held is None
            self.more = self._integrate(until, whole, batch or BATCH) and self.engine.time < until
            if held and not self.more:
                held()
                self.engine.advance(until, final)
            self.known = self.engine.time if self.more or final else until
            piece = self._piece()
            for observe in observers:
                observe(piece)
            yield piece

    def _integrate(self, until: float, final: bool, batch: Batch) -> bool:
        """Take the steps of a batch; whether there is more to do."""
        engine, began = self.engine, time.monotonic()
        first = engine.steps
        while True:
            before = engine.steps
            engine.advance(until, final, batch.stride)
            if engine.steps - before < batch.stride:
                return False
            long = time.monotonic() - began > batch.longest
            if long or engine.steps - first >= batch.steps:
                return True

    def _piece(self) -> Piece:
        """All that the engine has come to since the last one, audited."""
        motion, impacts, changes = self.engine.drain()
        if not self._audited:
            unknown = Work(*np.full((len(Work._fields), len(motion)), np.nan))
            return Piece(self.machine, motion, EnergyTerms(unknown, impacts), impacts, changes)
        before = self.audit.drive_work, self.audit.dissipated
        work = self.audit.add(motion, impacts)
        self.audit.judge(allowed_penetration(self.machine))
        balance = EnergyTerms(work, impacts, *before)
        return Piece(self.machine, motion, balance, impacts, changes)


def allowed_penetration(machine: Machine) -> float:
    """Violation of a gap [m] that tolerance or rounding explain; beyond it a run fails."""
    solver = machine.scene.solver
    allowed = max(1e3 * solver.rtol * machine.mechanism.size, solver.atol, 1e-12)
    return min([allowed, *(0.1 * c.radial for c in machine.plan.clearances.values() if c.radial)])


def run(
    machine: Machine,
    until: float,
    observers: Iterable[Observer] = (),
    *,
    resume: Snapshot | None = None,
) -> Iterator[Piece]:
    """A run up to a time [s], piece by piece; see `Runner` for one that is asked for in parts."""
    return Runner(machine, resume=resume).to(until, observers)


def prepare(machine: Machine) -> None:
    """Compile all that a run will need, so that it does not wait later."""
    next(Runner(machine).to(1e-6 * min(machine.drive.period, 1.0), batch=Batch(1, 1)))
