"""Steps that follow each other, taken in one call of machine code.

The functions of an integrator are called as heyoka compiled them, without what Python and its
search for events cost between them. A row ends before a step in which a guard might fall: that
step is heyoka's own, so that all bits are those of steps taken one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.dense_output import BLOCK, DenseOutput, floats
from mechanism_sim.engine.step_check import NOTHING, StepCheck, StepMotion, doubts
from mechanism_sim.engine.system import System
from mechanism_sim.numerics import kernels
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.kernel_code import call_code
from mechanism_sim.numerics.kernels import entry, kernel
from mechanism_sim.tolerances import TOLERANCES

_GUARDS = TOLERANCES.guards
_SINGULAR = TOLERANCES.singular
_STEPS = TOLERANCES.steps

_TAU, LIMIT, LONGEST, _QUICKEST, _STRIDE, BASE, LENGTH, LARGEST = range(8)
"""Reals of a row: time of the present state and latest end of steps [s]; longest step [s];
fastest stabilisation [1/s]; stride before singular positions [s]; time at local zero [s]; then
outputs of heyoka: length of the step [s], largest magnitude in the state."""

STEP, _OUT, _DOUBTS, FIRST, MOST, WIDTH, SIZE, NEAR, STABILISATION = range(9)
"""Whole numbers of a row: addresses of heyoka's functions, the third 0 if nothing is steep; row of
the first step; largest number of steps; number of states kept, and of all; index of the state for
singular positions, or -1; index of the stabilisation."""

_SAVED = 2e-6  # time [s] that machine code saves for a step


class RowArrays(NamedTuple):
    """The arrays of a row of steps."""

    state: Array  #: state of the integrator, changed in place
    parameters: Array  #: runtime parameters of the integrator, changed in place
    time: Array  #: (1,) time argument of the integrator's functions
    reals: Array  #: see `_TAU`
    whole: Indices  #: see `STEP`
    jets: Array  #: (states + guards, order + 1) Taylor coefficients of a step
    scaled: Array  #: (order + 1,) overwritten
    shut: Indices  #: (guards,) see `stays`
    taus: Array  #: starts [s] of the steps, from the first on
    lengths: Array  #: lengths [s] of the steps, from the first on
    rows: Array  #: (n, width (order + 1)) coefficients of the steps
    motion: StepMotion  #: variables of steep loads over a step
    doubted: Array  #: (2,) overwritten


@kernel
def end_of(guard: Array, h: float, opens: bool, scaled: Array) -> float:
    """Value of a guard at the end of a step of length `h`, -1 if it may fall through zero before.

    By Descartes' rule of signs: none falls whose Bernstein coefficients have one sign; they are,
    but for positive factors, the coefficients of ``(1 + x)^n p(h / (1 + x))``. Most guards begin
    larger than all that their other terms can take away.

    Parameters
    ----------
    guard : (n + 1,) coefficients, the constant first
    opens : True if a guard that rises from a rounding below zero counts as positive
    scaled : (n + 1,) overwritten
    """
    n, power, rest, end = len(guard), h, 0.0, float(guard[0])
    scaled[n - 1] = end
    for k in range(1, n):
        x = guard[k] * power
        power *= h
        rest += abs(x)
        end += x
        scaled[n - 1 - k] = x
    if guard[0] > rest:
        return end
    rises = opens and guard[0] > -_GUARDS.near_root and guard[1] > 0.0
    if not (rest < math.inf and (guard[0] > 0.0 or rises)):
        return -1.0
    for i in range(n - 1):
        for k in range(n - 2, i - 1, -1):
            scaled[k] += scaled[k + 1]
    for x in scaled[: n - 1]:
        if x <= 0.0:
            return -1.0
    return end


@kernel
def stays(
    jets: Array, first: int, shut: Indices, parameters: Array, h: float, scaled: Array
) -> bool:
    """True if no guard falls within a step, nor so near its end that the event may be missed.

    Parameters
    ----------
    first : row of the first guard in `jets`
    shut : parameter of the closed flag of each guard's gap; -1 for guards of friction
    """
    near, low = False, math.inf
    for i in range(len(shut)):
        guard = jets[first + i]
        x = end_of(guard, h, shut[i] >= 0 and parameters[shut[i]] == 0.0, scaled)
        if x < 0.0:
            return False
        near, low = near or guard[0] < _GUARDS.near_root, min(low, x)
    return not near or low > _GUARDS.near_root


@entry
def take_row(row: RowArrays) -> int:
    """Take steps until the next one may contain an event; returns their number."""
    state, parameters, time, reals, whole, jets, scaled, shut, taus, lengths, rows, seen, more = (
        row
    )
    near = whole[NEAR]
    for k in range(whole[MOST]):
        tau = reals[_TAU]
        time[0] = tau
        reals[LENGTH] = reals[LONGEST]
        call_code(whole[STEP], jets, state, parameters, time, reals[LENGTH:], reals[LARGEST:])
        h = reals[LENGTH]
        end = tau + h
        if not (tau < end <= reals[LIMIT] and reals[LARGEST] < math.inf):
            return k
        if not stays(jets, whole[SIZE], shut, parameters, h, scaled):
            return k
        if whole[_DOUBTS] and doubts(
            whole[_DOUBTS], jets, parameters, seen, reals[BASE], tau, h, more
        ):
            return k
        if near >= 0:
            ahead = _SINGULAR.ahead * max(h, reals[_STRIDE])
            if jets[near, 1] + ahead * jets[near, 2] < 0.0:
                return k
        kept, order = rows[whole[FIRST] + k], jets.shape[1]
        for i in range(whole[WIDTH]):
            kept[i * order : (i + 1) * order] = jets[i]
        call_code(whole[_OUT], state, jets, reals[LENGTH:])
        taus[k], lengths[k] = tau, h
        parameters[whole[STABILISATION]] = min(1.0 / h, reals[_QUICKEST])
        reals[_TAU] = end
    return int(whole[MOST])


class StepRows:
    """Rows of steps of an integrator, once machine code pays.

    Parameters
    ----------
    output : dense output that steps are entered in
    longest : [s] longest step
    quickest : [1/s] fastest stabilisation
    check : check of steps with steep loads; a step that fails it is left to heyoka
    """

    def __init__(
        self,
        system: System,
        integrator: hy.taylor_adaptive_dbl,
        output: DenseOutput,
        longest: float,
        quickest: float,
        check: StepCheck | None = None,
    ) -> None:
        self._system, self._integrator, self._output = system, integrator, output
        self._check = check
        self._reals = np.zeros(LARGEST + 1)
        self._reals[LONGEST], self._reals[_QUICKEST] = longest, quickest
        self._calls: dict[int, Callable[[], int]] = {}
        self._known: RowArrays | None = None
        # the tape of compact code is heyoka's own
        self._served = not integrator.compact_mode and bool(integrator.with_events)
        self._code: Any = None
        self._taus, self._lengths = floats(np.zeros(_STEPS.row)), floats(np.zeros(_STEPS.row))

    def take(self, tau: float, limit: float, most: int, stride: float, base: float = 0.0) -> float:
        """Take up to `most` steps from `tau` that end not later than `limit`; returns their end.

        Parameters
        ----------
        stride : [s] step length before singular positions
        base : [s] time at the local time zero
        """
        if take_row.run is take_row.function or not self._served:
            return tau
        if self._known is None:
            self._known = self._found()
            return tau
        output, reals, whole = self._output, self._now, self._whole
        block, first = divmod(len(output.lengths), BLOCK)
        if block not in self._calls:
            self._calls[block] = take_row.bind(self._known._replace(rows=output.block(block)))
        reals[_TAU], reals[LIMIT], reals[_STRIDE], reals[BASE] = tau, limit, stride, base
        whole[FIRST], whole[MOST] = first, min(most, BLOCK - first)
        if count := self._calls[block]():
            output.taus += self._taus[:count].tolist()
            output.lengths += self._lengths[:count].tolist()
            output.provide()
            return reals[_TAU]
        return tau

    def count(self, steps: int) -> None:
        """Count steps that were taken in Python."""
        if self._served:
            kernels.charge(_SAVED * steps)

    def _found(self) -> RowArrays | None:
        """The arrays, with the addresses of the functions; None if machine code is unavailable."""
        ta, system = self._integrator, self._system
        self._code = kernels.foreign_code(ta.llvm_state.object_code, 'step_e', 'd_out_f')
        check = self._check
        address = check.address if check else 0
        self._served = self._code is not None and (check is None or address > 0)
        if not self._served:
            return None
        width, order, guards = system.width, ta.order + 1, len(system.guards)
        near = width + 1 + guards if system.relations else -1
        whole = np.array([
            *self._code.addresses, address, 0, 0, width, ta.dim, near,
            system.parameters.stabilisation,
        ])  # fmt: skip
        closed = system.parameters.closed
        shut = np.array([
            closed[g.gap] if g.gap >= 0 and not g.friction else -1 for g in system.guards
        ])  # fmt: skip
        jets, scaled = np.zeros((ta.dim + guards, order)), np.zeros(order)
        self._whole: memoryview[int] = memoryview(cast(Any, whole))
        self._now = floats(self._reals)
        return RowArrays(
            ta.state, ta.pars, np.zeros(1), self._reals, whole, jets, scaled, shut,
            np.asarray(self._taus), np.asarray(self._lengths), np.zeros((0, 0)),
            check.motion if check else NOTHING, np.zeros(2),
        )  # fmt: skip
