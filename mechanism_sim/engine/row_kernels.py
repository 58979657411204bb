"""Steps that follow each other, and the events between them, in machine code.

The functions of an integrator are called as heyoka compiled them, without what Python and its
search for events cost between them. What is not plain ends a row: that step, or the rest of its
event, is left to Python and heyoka, so that all bits are those of steps taken one by one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.clock import rounded_sum
from mechanism_sim.engine.contact.problem import FLIES, STICKS
from mechanism_sim.engine.contact.respond import (
    BESIDE,
    CHANGES,
    CROWDED,
    DONE,
    DRIVES,
    EVENTS,
    FELL,
    GUARD,
    GUARDS,
    HORIZON,
    MISSED,
    MODE,
    SIMULTANEOUS,
    SLIPS,
    STAGE,
    WATCHED,
    EventArrays,
    begin,
    count,
    evaluate,
    has_room,
    past_zero,
    resolve,
    run_of,
)
from mechanism_sim.engine.present_state import rate_of
from mechanism_sim.engine.step_check import StepMotion, doubts
from mechanism_sim.engine.step_roots import NO_FALL, RootArrays, first_fall, shift
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.kernel_code import call_code
from mechanism_sim.numerics.kernels import entry, kernel
from mechanism_sim.tolerances import TOLERANCES

_GUARDS = TOLERANCES.guards
_SINGULAR = TOLERANCES.singular
_STEPS = TOLERANCES.steps

TAU, LIMIT, LONGEST, QUICKEST, STRIDE, BASE, LOW, LENGTH, LARGEST = range(9)
"""Reals of a row: time of the present state and latest end of steps [s]; longest step [s];
fastest stabilisation [1/s]; stride before singular positions [s]; time at local zero [s], and its
rest beyond a float; then outputs of heyoka: length of the step [s], largest magnitude in the
state."""

(_STEP, _OUT, _DOUBTS, MOST, NOTED, _WIDTH, _SIZE, _NEAR, _STABILISATION, _SHORT, _OWN, _LONE,
 _STICKS) = range(13)  # fmt: skip
"""Whole numbers of a row: addresses of heyoka's functions, the third 0 if nothing is steep;
largest number of steps, number of changes of modes; number of states kept, and of all; index of
the state for singular positions, or -1; index of the stabilisation; number of events from which
short steps are not taken here; number of guards whose events are resolved here, the first ones;
whether there is one guard, of a place; whether other equations hold where a contact sticks."""


class RowArrays(NamedTuple):
    """The arrays of a row of up to n steps with m gaps."""

    state: Array  #: state of the integrator, changed in place
    parameters: Array  #: runtime parameters of the integrator, changed in place
    time: Array  #: (1,) time argument of the integrator's functions
    reals: Array  #: see `TAU`
    whole: Indices  #: see `_STEP`
    jets: Array  #: (states + guards, order + 1) Taylor coefficients of a step
    scaled: Array  #: (order + 1,) overwritten
    shut: Indices  #: (guards,) see `stays`
    taus: Array  #: starts [s] of the steps, from the first on
    lengths: Array  #: lengths [s] of the steps, from the first on
    rows: Array  #: (n, width (order + 1)) coefficients of the steps
    motion: StepMotion  #: variables of steep loads over a step
    doubted: Array  #: (2,) overwritten
    roots: RootArrays  #: overwritten
    before: Array  #: state before a step, overwritten
    laws: Array  #: (p, d + 1) coefficients of the laws of drives from the local time zero on
    tape: Array  #: workspace of compact code, else empty
    noted: NDArray[np.int64]  #: (n, 1 + m) steps, and modes after each of them


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
    shift(scaled)
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


@kernel
def _series(row: RowArrays, reach: float) -> float:
    """Taylor series of a step of at most `reach` [s] from the present state; returns its length.

    It is not a number if a value is none.
    """
    reals, step = row.reals, row.whole[_STEP]
    jets, state, parameters, time = row.jets, row.state, row.parameters, row.time
    time[0] = reals[TAU]
    reals[LENGTH] = reach
    length, largest = reals[LENGTH:], reals[LARGEST:]
    if len(row.tape):
        call_code(step, jets, state, parameters, time, length, largest, row.tape)
    else:
        call_code(step, jets, state, parameters, time, length, largest)
    return float(reals[LENGTH]) if reals[LARGEST] < math.inf else math.nan


@kernel
def _holds(row: RowArrays, h: float) -> bool:
    """True if a step of length `h` [s] ends in time, and nothing steep or singular is in it."""
    reals, whole, jets = row.reals, row.whole, row.jets
    tau, near = reals[TAU], whole[_NEAR]
    if not tau < tau + h <= reals[LIMIT]:
        return False
    if whole[_DOUBTS] and doubts(
        whole[_DOUBTS], jets, row.parameters, row.motion, reals[BASE], tau, h, row.doubted
    ):
        return False
    ahead = _SINGULAR.ahead * max(h, reals[STRIDE])
    return near < 0 or not jets[near, 1] + ahead * jets[near, 2] < 0.0


@kernel
def _move(row: RowArrays, h: float) -> None:
    """Move the state to the end of a step."""
    row.reals[LENGTH] = h
    call_code(row.whole[_OUT], row.state, row.jets, row.reals[LENGTH:])


@kernel
def _enter(row: RowArrays, k: int, h: float) -> None:
    """Enter a step as number `k` of the row."""
    jets, order = row.jets, row.jets.shape[1]
    kept = row.rows[k]
    for i in range(row.whole[_WIDTH]):
        kept[i * order : (i + 1) * order] = jets[i]
    row.taus[k], row.lengths[k] = row.reals[TAU], h
    row.reals[TAU] += h


@kernel
def _stabilise(row: RowArrays, h: float) -> None:
    """Let Baumgarte's rate follow the usual step."""
    row.parameters[row.whole[_STABILISATION]] = min(1.0 / h, row.reals[QUICKEST])


@entry
def take_row(row: RowArrays) -> int:
    """Take steps until the next one may contain an event; returns their number."""
    whole = row.whole
    for k in range(whole[MOST]):
        h = _series(row, row.reals[LONGEST])
        if not stays(row.jets, whole[_SIZE], row.shut, row.parameters, h, row.scaled):
            return k
        if not _holds(row, h):
            return k
        _move(row, h)
        _enter(row, k, h)
        _stabilise(row, h)
    return int(whole[MOST])


class _Found(NamedTuple):
    """Events in a step."""

    guard: int  #: that falls first, -1 if none does, -2 if heyoka is to say
    h: float  #: [s] length of the step up to there
    doubtful: bool  #: True if another may have been passed over


@kernel
def _search(row: RowArrays, h: float, modes: Indices) -> _Found:
    """Search a step for the first event."""
    first, guards, near, low, fell, end = row.whole[_SIZE], len(row.shut), False, math.inf, -1, h
    for i in range(guards):
        guard, shut = row.jets[first + i], row.shut[i]
        x = end_of(guard, h, shut >= 0 and row.parameters[shut] == 0.0, row.scaled)
        begins = guard[0] < _GUARDS.near_root
        # what let go within the error of the last step's end is an event at its start
        if begins and row.whole[_LONE] and guard[0] < 0.0 and modes[0] != FLIES:
            return _Found(-2, h, True)
        if x < 0.0:
            when = first_fall(guard, h, row.roots)
            if when >= 0.0:
                if when == end:
                    return _Found(-2, h, True)
                if when < end:
                    fell, end = i, when
            elif when != NO_FALL:
                return _Found(-2, h, True)
        near, low = near or begins, min(low, x)
    if fell >= row.whole[_OWN]:
        return _Found(-2, h, True)
    doubtful = near and (not row.whole[_LONE] if fell >= 0 else not low > _GUARDS.near_root)
    return _Found(fell, end, doubtful)


@kernel
def _are_clear(run: EventArrays, state: Array, now: Array, addresses: Indices, guard: int) -> bool:
    """True if no other guard has fallen by now; where some are of no gap, none but for sure."""
    evaluate(run, state, now, addresses, MISSED)
    if run.counters[WATCHED]:
        return past_zero(run, guard) < 0
    seen, count = run.seen, run.counters[GUARDS]
    for i in range(count):
        flies = i < len(run.gaps[MODE]) and run.gaps[MODE, i] == FLIES
        if i != guard and seen[i] <= 0.0 and not (flies and seen[count + i] >= 0.0):
            return False
    return True


@kernel
def _stick(modes: Indices) -> bool:
    found = False
    for mode in modes:
        found = found or mode == STICKS
    return found


@kernel
def _note(row: RowArrays, k: int, modes: Indices) -> None:
    """Note the modes after step `k`."""
    noted = row.noted[row.whole[NOTED]]
    noted[0] = k + 1
    noted[1:] = modes
    row.whole[NOTED] += 1


@kernel
def _begin_event(row: RowArrays, run: EventArrays, guard: int, t: float) -> None:
    """Begin the event of a guard at time `t` [s], where the last step ended."""
    n = run.counters
    count(n, run.reals, t)
    begin(n, run.reals, t, n[SIMULTANEOUS])
    for i in range(len(row.laws)):
        run.reals[DRIVES + i] = rate_of(row.laws[i], row.reals[TAU])
    n[GUARD], n[STAGE] = guard, FELL if guard < len(run.gaps[MODE]) else SLIPS


@entry
def run_row(row: RowArrays, now: Array, addresses: Indices, *arrays: Any) -> int:
    """Take steps, and resolve the events at their ends; returns the number of steps.

    It stops before a step of which something is left to heyoka, and after an event of which
    something is left to Python: then the counter of stages is not `DONE`. Where that is not so
    from the first, stages are all that is taken, and the next one is returned.

    Parameters
    ----------
    now, addresses, arrays : of `respond.resolve`; the state is that of the row
    """
    run = run_of(*arrays)
    n, reals, whole = run.counters, row.reals, row.whole
    state = row.state[: whole[_WIDTH]]
    if n[STAGE] != DONE:
        return resolve(state, now, addresses, *arrays)
    whole[NOTED] = 0
    if addresses[MISSED] == 0:
        return 0
    for k in range(whole[MOST]):
        longest = reals[LONGEST]
        reach = min(longest, run.reals[HORIZON])
        if reach < longest and n[EVENTS] >= whole[_SHORT]:
            return k
        full = _series(row, reach)
        found = _search(row, full, run.gaps[MODE])
        guard, h, end = found.guard, found.h, reals[TAU] + found.h
        if guard < -1 or not _holds(row, h):
            return k
        t = 0.0
        if guard >= 0:
            t = rounded_sum(reals[BASE], reals[LOW], end)
            many = n[SIMULTANEOUS] >= _STEPS.simultaneous or n[CROWDED] >= _STEPS.crowded
            if many or not abs(t) < math.inf or not has_room(run):
                return k
        row.before[:] = row.state
        _move(row, h)
        now[len(now) - 1] = end
        if found.doubtful and not _are_clear(run, state, now, addresses, guard):
            row.state[:] = row.before
            return k
        _enter(row, k, h)
        run.reals[HORIZON] = math.inf
        if guard < 0:
            if h < reach or reach == longest:
                _stabilise(row, h)
            continue
        changes = n[CHANGES]
        _begin_event(row, run, guard, t)
        stage = resolve(state, now, addresses, *arrays)
        if n[CHANGES] > changes:
            _note(row, k, run.gaps[MODE])
        if stage != DONE:
            return k + 1
        if not n[WATCHED] and not _are_clear(run, state, now, addresses, -1):
            n[STAGE] = BESIDE
            return k + 1
        if whole[_STICKS] and _stick(run.gaps[MODE]):
            return k + 1
    return int(whole[MOST])
