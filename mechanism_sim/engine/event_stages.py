"""Stages of events: kernels of `contact.respond`, and the functions of the state they need."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact import respond
from mechanism_sim.engine.dense_output import floats
from mechanism_sim.engine.events import ImpactLog, ModeLog, StopReason
from mechanism_sim.engine.present_state import PresentState
from mechanism_sim.errors import RunError
from mechanism_sim.numerics.kernels import BoundCall, Kernel, foreign_code
from mechanism_sim.tolerances import TOLERANCES

_STEPS = TOLERANCES.steps


class ArrayCall:
    """Calls of a kernel on the arrays of a run, which stay where they are, but for the logs."""

    def __init__(self, kernel: Kernel, known: tuple[Any, ...]) -> None:
        self._kernel, self._known = kernel, known
        self._logs: tuple[object, object] = (None, None)
        self._call: BoundCall

    @property
    def compiled(self) -> bool:
        """True once it is machine code."""
        return self._kernel.is_compiled

    def __call__(self, impacts: Array, changes: Array) -> int:
        """Call it with the logs as they are now."""
        rows, more = self._logs
        if rows is not impacts or more is not changes:
            self._logs = impacts, changes
            self._call = BoundCall(self._kernel, *self._known, impacts, changes)
        return self._call()


class EventStages:
    """Takes the stages of events of m gaps, one by one or as many as can be in one call.

    Parameters
    ----------
    present : the integrator's state
    run, known : arrays of a run by name, and as arguments of the kernels without the logs
    impacts, changes : logs

    Attributes
    ----------
    counters : counters of `run`, see `respond.STAGE`
    addresses : of the machine code of functions, see `respond.resolve`
    rows : calls of `row_kernels.run_row`, which takes stages, too; set by what has its arrays
    fallen : guard of the last stage of an event
    changed : True if the last call changed any mode
    """

    def __init__(
        self,
        present: PresentState,
        run: respond.EventArrays,
        known: tuple[Any, ...],
        impacts: ImpactLog,
        changes: ModeLog,
    ) -> None:
        self._present, self._run = present, run
        self._impacts, self._changes = impacts, changes
        self.counters: memoryview[int] = memoryview(cast(Any, run.counters))
        self._reals = floats(run.reals)
        self.fallen, self.changed = respond.DONE, False
        self._one, self._look = ArrayCall(respond.respond, known), ArrayCall(respond.look, known)
        self.addresses = np.zeros(len(respond.NEEDS), dtype=np.int64)
        self._codes: list[Any] = []  # hold what the addresses are of
        state = present.integrator.state[: present.system.width]
        there = state, present.now, self.addresses
        self.rows: ArrayCall
        self._look_there = ArrayCall(respond.look_there, (*there, *known))

    @property
    def counts(self) -> tuple[float, int, int]:
        """Time [s] of the last event, number of those before it at its instant, and of all."""
        n = self.counters
        return self._reals[respond.LAST], n[respond.SIMULTANEOUS], n[respond.EVENTS]

    @counts.setter
    def counts(self, counts: tuple[float, int, int]) -> None:
        n = self.counters
        self._reals[respond.LAST], n[respond.SIMULTANEOUS], n[respond.EVENTS] = counts
        n[respond.CROWDED] = 0

    def count(self, t: float) -> int:
        """Count an event at a time [s]; returns how many were before it at this instant.

        Raises
        ------
        RunError
            If too many follow each other.
        """
        n = self.counters
        respond.count(n, self._reals, t)
        many = n[respond.SIMULTANEOUS] > _STEPS.simultaneous
        if many or n[respond.CROWDED] > _STEPS.crowded:
            raise RunError(f'{StopReason.NO_PROGRESS.value} (t = {t:.12g} s)')
        return n[respond.SIMULTANEOUS]

    def see(self, stage: int) -> None:
        """Evaluate the function that a stage needs, see `respond.NEEDS`, at the present state."""
        name, present, run = respond.NEEDS[stage], self._present, self._run
        function = getattr(present.system.functions, name)
        out = run.terms if stage < respond.PROJECTED else run.seen[: function.nouts]
        present.evaluate(function, out=out)
        if self.rows.compiled and not self.addresses[stage]:
            code = foreign_code(function.llvm_states[0].object_code, 'cfunc')
            if code:  # `resolve` gets the address of the function's machine code
                self._codes.append(code)
                for k, needed in enumerate(respond.NEEDS):
                    if needed == name:
                        self.addresses[k] = code.addresses[0]

    def go_on(self, stage: int, guard: int) -> int:
        """Take a stage whose function is evaluated, for a guard or gap; returns the next one."""
        after = self.called(self._one, stage, guard)
        self.counters[respond.TAKEN] = stage
        return after

    def resolve(self, stage: int, guard: int) -> int:
        """Take stages, for a guard or gap, as far as code is available; returns the next stage."""
        if self.rows.compiled:
            if not self.addresses[stage]:
                self.see(stage)
            self._present.set_time()
            after = self.called(self.rows, stage, guard)
            if after != stage:
                return after
            guard = self.fallen
        if not (stage == respond.STRIKES and self.counters[respond.TAKEN] == respond.FELL):
            self.see(stage)  # else of the same state
        return self.go_on(stage, guard)

    def past_zero(self, fell: int | None) -> int | None:
        """Index of a guard below zero at the present state, other than `fell`; None if none is."""
        beside = -1 if fell is None else fell
        if self.addresses[respond.MISSED]:
            self._present.set_time()
            guard = self.called(self._look_there, respond.MISSED, beside)
        else:
            self.see(respond.MISSED)
            guard = self.called(self._look, respond.MISSED, beside)
        return guard if guard >= 0 else None

    def called(self, call: ArrayCall, stage: int, guard: int, events: int = 1) -> int:
        """Call a kernel with room for some events in the logs, and take over what it entered."""
        counters, impacts, changes = self.counters, self._impacts, self._changes
        gaps = counters[respond.LAYOUT] * events
        impacts.reserve(gaps)
        changes.reserve(2 * gaps)
        counters[respond.STAGE], counters[respond.GUARD] = stage, guard
        counters[respond.IMPACTS], counters[respond.CHANGES] = impacts.count, changes.count
        after = call(impacts.rows, changes.rows)
        self.fallen, impacts.count = counters[respond.GUARD], counters[respond.IMPACTS]
        self.changed = counters[respond.CHANGES] > changes.count
        changes.count = counters[respond.CHANGES]
        return after
