"""Rows of steps, and of events between them, each a call of machine code once that pays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from mechanism_sim.engine.contact.respond import DONE, EVENTS, MISSED, STAGE
from mechanism_sim.engine.contacts import Contacts
from mechanism_sim.engine.dense_output import DenseOutput, floats
from mechanism_sim.engine.event_stages import ArrayCall
from mechanism_sim.engine.integrators import Integrators
from mechanism_sim.engine.row_kernels import (
    BASE,
    LARGEST,
    LIMIT,
    LONGEST,
    LOW,
    MOST,
    NOTED,
    QUICKEST,
    STRIDE,
    TAU,
    RowArrays,
    run_row,
    take_row,
)
from mechanism_sim.engine.step_check import NOTHING, StepCheck
from mechanism_sim.engine.step_roots import root_arrays
from mechanism_sim.numerics import kernels
from mechanism_sim.tolerances import TOLERANCES

_STEPS = TOLERANCES.steps

_SAVED = 2e-6  # time [s] that machine code saves for a step


class StepRows:
    """Rows of steps of an integrator, once machine code pays.

    Parameters
    ----------
    output : dense output that steps are entered in
    longest : [s] longest step
    quickest : [1/s] fastest stabilisation
    check : check of steps with steep loads; a step that fails it is left to heyoka

    Attributes
    ----------
    ended : True if the last row ended with an event of which something is left to be done
    resolves : True if events are resolved in rows
    """

    def __init__(
        self,
        contacts: Contacts,
        integrators: Integrators,
        output: DenseOutput,
        longest: float,
        quickest: float,
        check: StepCheck | None = None,
    ) -> None:
        self._contacts, self._output, self._check = contacts, output, check
        self._gaps, self._present = contacts.state, contacts.present
        self._integrators, self._integrator = integrators, integrators.main
        self._row = row = self._arrays()
        self._whole: memoryview[int] = memoryview(cast(Any, row.whole))
        self._now = floats(row.reals)
        self._now[LONGEST], self._now[QUICKEST] = longest, quickest
        #: whether machine code may serve, and does
        self._served, self._serves = bool(self._integrator.with_events), False
        self._plain: Callable[[], int] | None = None
        self._base: object = None
        self._code: Any = None
        self.ended = self.resolves = False
        stages = self._gaps.stages
        stages.rows = ArrayCall(
            run_row, (row, self._present.now, stages.addresses, *self._gaps.known)
        )

    def take(self, tau: float, limit: float, most: int, stride: float) -> float:
        """Take up to `most` steps from `tau` that end not later than `limit`; returns their end.

        Parameters
        ----------
        stride : [s] step length before singular positions
        """
        self.ended = False
        if not (take_row.is_compiled and self._served and self._integrators.main_holds):
            return tau
        row, reals = self._row, self._now
        if not self._serves:
            self._find_code()
            return tau
        if self._base is not self._present.base:
            self._see_base(row)
        reals[TAU], reals[LIMIT], reals[STRIDE] = tau, limit, stride
        self._whole[MOST] = min(most, _STEPS.row)
        if not self.resolves and run_row.is_compiled and self._contacts.in_rows:
            self._gaps.stages.see(MISSED)
            self.resolves = True
        if self.resolves:
            stages = self._gaps.stages
            begun = len(self._output.lengths)
            count = stages.called(stages.rows, DONE, 0, _STEPS.row)
            self.ended = stages.counters[STAGE] != DONE
            self._integrators.expect(stages.counters[EVENTS])
            for at, *modes in row.noted[: self._whole[NOTED]].tolist():
                self._gaps.modes = tuple(modes)
                self._output.mark(self._present.base, self._gaps.status, begun + at)
        else:
            self._plain = self._plain or take_row.bind(row)
            count = self._plain()
        if count:
            self._output.add(row.taus, row.lengths, row.rows[:count])
            return reals[TAU]
        return tau

    def count(self, steps: int) -> None:
        """Count steps that were taken in Python."""
        if self._served and not take_row.is_compiled:
            take_row.charge(_SAVED * steps)

    def _see_base(self, row: RowArrays) -> None:
        """Take over the instant that time counts from, and the laws from there on."""
        self._base = base = self._present.base
        self._now[BASE], self._now[LOW] = base.high, base.low
        row.laws[:] = 0.0
        for own, law in zip(row.laws, base.laws, strict=True):
            own[: len(law)] = law

    def _find_code(self) -> None:
        """Find the functions of the integrator, if their machine code is available."""
        code = self._integrator.llvm_state.object_code  # of compact code several files
        code = code if isinstance(code, bytes) else tuple(code)
        self._code = kernels.foreign_code(code, 'step_e', 'd_out_f')
        check = self._check
        address = check.address if check else 0
        self._served = self._serves = bool(self._code) and (check is None or address > 0)
        if self._serves:
            self._row.whole[:3] = *self._code.addresses, address

    def _arrays(self) -> RowArrays:
        """The arrays, without the addresses of the functions."""
        ta, system, check = self._integrator, self._present.system, self._check
        width, order, guards = system.width, ta.order + 1, len(system.guards)
        near = width + 1 + guards if system.relations else -1
        whole = np.array([
            0, 0, 0, 0, 0, width, ta.dim, near, system.parameters.stabilisation,
            self._integrators.short_from, sum(guard.gap >= 0 for guard in system.guards),
            system.lone, self._integrators.apart,
        ])  # fmt: skip
        closed, most = system.parameters.closed, _STEPS.row
        shut = np.array(
            [closed[g.gap] if g.gap >= 0 and not g.friction else -1 for g in system.guards],
            dtype=np.int64,
        )
        # of all terms, with a row for the last derivatives: at least as large as heyoka's
        tape = np.zeros((order + 1) * len(ta.decomposition) if ta.compact_mode else 0)
        return RowArrays(
            ta.state, ta.pars, np.zeros(1), np.zeros(LARGEST + 1), whole,
            np.zeros((ta.dim + guards, order)), np.zeros(order), shut, np.zeros(most),
            np.zeros(most), np.zeros((most, width * order)), check.motion if check else NOTHING,
            np.zeros(2), root_arrays(order), np.zeros(ta.dim),
            np.zeros((len(system.prescribed), system.degree + 1)), tape,
            np.zeros((most, 1 + len(system.gaps)), dtype=np.int64),
        )  # fmt: skip
