"""Response of contacts to an event, on arrays: impact, rest, release, slip and stick.

`respond` takes a stage, goes on until it needs functions of the state at another place, and
returns the stage that follows once they are evaluated; `NEEDS` says which. `resolve` calls their
machine code itself, so that an event is one call. All that is kept of a machine are
`EventArrays`: it may be one of many lanes.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.engine.contact.chatter import ends, left_out, remaining_time
from mechanism_sim.engine.contact.impact import jam_margin
from mechanism_sim.engine.contact.problem import (
    FLIES,
    FOLLOWS,
    RECOVERS,
    SLIDES_BACKWARD,
    SLIDES_FORWARD,
    STICKS,
    ContactArrays,
    ContactProblem,
    Instant,
    Layout,
    Limits,
    Resting,
    T,
    come_to_rest,
    horizon_of,
    impact_of_all,
    part_of,
    problem_of,
    push,
    release,
    slip_of,
)
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.kernel_code import call_code
from mechanism_sim.numerics.kernels import entry, kernel
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts
_GUARDS = TOLERANCES.guards
_IMPACTS = TOLERANCES.impacts
_ROUNDING = TOLERANCES.rounding

DONE, FELL, SLIPS, STRIKES, RESTS, PARTS, PROJECTED, TURNED, MISSED = range(9)
"""Stages: event resolved; zero crossing of a guard of a gap, or of friction; impact; contacts
at rest; separation; after a first and a second projection; search for missed events."""

UNSOLVED, JAMMED, SHOCK, BESIDE = -1, -2, -3, -4
"""Instead of a stage: no impulses satisfy all contacts; no forces keep those at rest; an impact
without collision must stop the slide of the guard's gap, which both continue with `RESTS`; and
after an event in a row of steps: a guard that is of no gap may have fallen."""

NEEDS = ('', *('contact_function',) * 5, *('projection',) * 2, 'watch')
"""Function of the state that is evaluated before each stage."""

(STAGE, GUARD, IMPACTS, CHANGES, TAKEN, TRIES, HELD, DRAWS, BEGINS, ROUNDS, AGAIN, EVENTS,
 SIMULTANEOUS, CROWDED, WATCHED, GUARDS, SMOOTH, RELATIONS, SIZE, LAYOUT) = range(20)  # fmt: skip
COUNTERS = LAYOUT + len(Layout._fields)
"""Columns of the counters of a run: next stage; its guard or gap; numbers of rows in the logs of
impacts and of changes; last stage taken; number of attempts at a separation; gap whose slip ends,
plus 1; whether open gaps close, or slides begin, after this stage; numbers of searches for missed
events and of earlier events at this instant; number of events since the start, of those before the
last at its instant, and before it each close to the next; whether `MISSED` is a stage here; number
of guards, whether all gaps have values and nothing has friction, whether there are loop closures;
number of terms, then their layout."""

TIME, HORIZON, FLOOR, MARGIN, LAST, CROWD, LIMITS, DRIVES = 0, 1, 2, 3, 4, 5, 6, 12
"""Columns of the reals: time [s], longest next step [s], lowest value of guards of friction by
rounding, two roundings of a position [m], time of the last event [s], time between events that are
close [s]; then limits, drive rates, restitutions, frictions."""

MODE, BEFORE, HYPOTHESIS, GIVEN, CLOSED, STICK, SLIP, PRESS, FRICTIONAL, RATED = range(10)
"""Rows of the integers of every gap: mode, mode before the event, restitution hypothesis, sign of
an impending slip; parameters of its four flags or -1; gaps with friction; 1 for a rate only."""

SHUT, TOUCHING, RESTING, _BEGINNING, _DRAWN, _PARTING = range(6)
"""Rows of flags of every gap: closed, in the event, at rest, to slide, closing, separating."""


class EventArrays(NamedTuple):
    """The arrays of a run with m gaps, all changed in place."""

    x: Array  #: (2f,) free coordinates and rates
    parameters: Array  #: runtime parameters of the equations
    terms: Array  #: output of ``contact_function``, see `contact.problem.problem_of`
    seen: Array  #: output of ``watch`` or ``projection``
    reals: Array  #: see `TIME`
    counters: Indices  #: see `STAGE`
    gaps: NDArray[np.int64]  #: (10, m) see `MODE`
    marks: Mask  #: (6, m) see `SHUT`
    impacts: Array  #: (n, 12) log, with room for m rows
    changes: Array  #: (n, 4) log: time, gap, mode, mode before; with room for 2 m rows


Counters: TypeAlias = 'Indices | memoryview[int]'
Reals: TypeAlias = 'Array | memoryview[float]'


class Situation(NamedTuple):
    """Arrays of a run at an event, split into contact problem, limits and instant."""

    run: EventArrays
    c: ContactProblem
    limits: Limits
    now: Instant


@kernel
def run_of(
    x: Array, parameters: Array, values: Array, reals: Array, whole: Indices,
    marks: Mask, impacts: Array, changes: Array,
) -> EventArrays:  # fmt: skip
    """Named arrays of a run: terms at the start of `values`, counters at that of `whole`."""
    size, gaps = whole[SIZE], whole[COUNTERS:].reshape((10, whole[LAYOUT]))
    return EventArrays(
        x, parameters, values[:size], values[size:], reals, whole[:COUNTERS], gaps, marks, impacts,
        changes,
    )  # fmt: skip


@kernel
def situation_of(run: EventArrays) -> Situation:
    """The contact problem, limits and instant of a run's arrays."""
    n, r = run.counters, run.reals
    layout = Layout(n[LAYOUT], n[LAYOUT + 1], n[LAYOUT + 2], n[LAYOUT + 3], n[LAYOUT + 4])
    m, f, p = layout.gaps, layout.free, layout.drives
    at = DRIVES + p
    laws = r[at : at + 2 * m].reshape((2, m))
    arrays = ContactArrays(run.terms, layout, laws, run.marks[SHUT], run.gaps[HYPOTHESIS])
    k = LIMITS
    limits = Limits(r[k], r[k + 1], r[k + 2], r[k + 3], r[k + 4], r[k + 5])
    now = Instant(r[TIME], r[DRIVES:at], run.x[f:])
    return Situation(run, problem_of(arrays), limits, now)


@kernel
def count(n: Counters, reals: Reals, t: float) -> None:
    """Count an event at a time [s], with those before it at the same instant or close by."""
    n[EVENTS] += 1
    n[SIMULTANEOUS] = n[SIMULTANEOUS] + 1 if t == reals[LAST] else 0
    n[CROWDED] = n[CROWDED] + 1 if t - reals[LAST] <= reals[CROWD] else 0
    reals[LAST] = t


@kernel
def begin(n: Counters, reals: Reals, t: float, earlier: int) -> None:
    """Begin to resolve an event at a time [s], after `earlier` ones at this instant."""
    reals[TIME] = t
    n[ROUNDS], n[AGAIN] = 0, earlier


@kernel
def write_flags(
    modes: Indices, sticking: Mask, places: NDArray[np.int64], parameters: Array
) -> None:
    """Write the flags closed, sticks, slips and presses of modes to indices (4, m) if not -1.

    Gaps in `sticking` (m,), or (0,) for none, count as sticking.
    """
    for i in range(len(modes)):
        mode = STICKS if len(sticking) and sticking[i] else modes[i]
        slip = 1.0 if mode == SLIDES_FORWARD else -1.0 if mode == SLIDES_BACKWARD else 0.0
        for k in range(4):
            if places[k, i] >= 0:
                parameters[places[k, i]] = (
                    (1.0 if mode > FLIES else 0.0) if k == 0
                    else (1.0 if mode == STICKS else 0.0) if k == 1
                    else slip if k == 2
                    else (1.0 if FLIES < mode < RECOVERS else 0.0)
                )  # fmt: skip


@kernel
def flag(run: EventArrays, sticking: Mask) -> None:
    """Write the flags of the present modes."""
    write_flags(run.gaps[MODE], sticking, run.gaps[CLOSED : PRESS + 1], run.parameters)


@kernel
def set_mode(run: EventArrays, gap: int, mode: int) -> None:
    """Set the mode of a gap, and enter a change in the log."""
    old = run.gaps[MODE, gap]
    if old != mode:
        row = run.changes[run.counters[CHANGES]]
        row[0], row[1], row[2], row[3] = run.reals[TIME], gap, mode, old
        run.counters[CHANGES] += 1
    run.gaps[MODE, gap], run.marks[SHUT, gap] = mode, mode > FLIES


@kernel
def fell(run: EventArrays) -> int:
    """Respond to a zero crossing of the guard of a gap."""
    guard, mode = run.counters[GUARD], run.gaps[MODE]
    run.gaps[BEFORE] = mode
    if run.marks[SHUT, guard] or _opens(run, guard):
        return _lift(run, guard)
    if not run.gaps[RATED, guard]:
        alone = run.counters[SMOOTH] > 0
        for k in range(len(mode)):
            near = k != guard and run.terms[k] <= run.reals[LIMITS + 1]
            alone = alone and mode[k] == FLIES and not near
        return _bounce(run, guard) if alone else STRIKES
    run.marks[TOUCHING] = run.marks[SHUT]
    run.marks[TOUCHING, guard] = True
    run.marks[RESTING] = run.marks[TOUCHING]
    return RESTS


@kernel
def _opens(run: EventArrays, gap: int) -> bool:
    """True if an open gap reverses before it closes by more than rounding.

    It has just begun its flight, at zero but for rounding, where its guard falls at once. So it
    goes on to do where it is pressed shut, and drawn open, by rounding only.
    """
    if run.gaps[RATED, gap]:
        return False
    s = situation_of(run)
    rate = min(s.c.rate[gap], 0.0)
    if rate * rate < s.c.acceleration[gap] * s.limits.touching:
        return True
    return bool(run.counters[AGAIN] > _CONTACTS.again and rate >= -s.limits.bare)


@kernel
def slips(run: EventArrays) -> int:
    """Respond to a guard of friction: sticking changes to slip, or slip ends or jams."""
    k = run.counters[GUARD] - len(run.gaps[MODE])
    gap, sign = run.gaps[FRICTIONAL, k // 2], 1 - 2 * (k % 2)
    run.gaps[BEFORE] = run.gaps[MODE]
    run.marks[TOUCHING] = run.marks[SHUT]
    run.marks[RESTING] = run.marks[SHUT]
    s = situation_of(run)
    if run.gaps[MODE, gap] == STICKS:
        if _idle(s) or _would_jam(s, gap, -sign):
            run.gaps[GIVEN, gap] = -sign
            return RESTS
        set_mode(run, gap, SLIDES_FORWARD if sign < 0 else SLIDES_BACKWARD)
        flag(run, run.marks[SHUT, :0])
        return _after(run)
    if sign > 0:
        run.counters[HELD] = gap + 1
        return RESTS
    # what jams; or there is nothing to be stopped
    return SHOCK if slip_of(s.c, gap, s.limits.still) else _lift(run, gap)


@kernel
def _idle(s: Situation) -> bool:
    """True if a contact leaves its friction to others that stick, see `problem.turn_idle`."""
    for i in range(len(s.c.value)):
        if s.run.gaps[MODE, i] == FOLLOWS and s.c.friction[i] > 0.0:
            return True
    return False


@kernel
def _would_jam(s: Situation, gap: int, way: int) -> bool:
    """True if the closed contacts could not slide if one of them began to."""
    rows, A, _ = part_of(s.c, s.run.marks[SHUT])
    friction, slip = np.empty(len(rows)), np.zeros(len(rows), dtype=np.int64)
    for k in range(len(rows)):
        mode = s.run.gaps[MODE, rows[k]]
        friction[k] = min(s.c.friction[rows[k]], _IMPACTS.rough)
        slip[k] = 1 if mode == SLIDES_FORWARD else -1 if mode == SLIDES_BACKWARD else 0
        if rows[k] == gap:
            slip[k] = way
    return jam_margin(A, friction, slip) <= _GUARDS.jammed


@kernel
def _lift(run: EventArrays, gap: int) -> int:
    """Open a contact that was closed, or let an open one stay open."""
    set_mode(run, gap, FLIES)
    flag(run, run.marks[SHUT, :0])
    run.marks[_PARTING] = False
    run.marks[_PARTING, gap] = True
    run.counters[DRAWS] = 0
    if run.gaps[STICK, gap] >= 0 and _idle(situation_of(run)):  # the others rest anew
        run.marks[_DRAWN] = False
        run.marks[TOUCHING] = run.marks[SHUT]
        run.marks[RESTING] = run.marks[SHUT]
        run.counters[DRAWS] = 1
    return PARTS


@kernel
def _bounce(run: EventArrays, i: int) -> int:
    """Impact of a frictionless gap while no other contact is closed, in few operations."""
    s = situation_of(run)
    c, limits, drives, e = s.c, s.limits, s.now.drives, s.c.restitution[i]
    rate, acceleration = min(c.rate[i], 0.0), c.acceleration[i]
    rise = left_out(limits.allowed, limits.resolved, e)
    stop = ends(rise, -e * rate, acceleration, -c.value[i])
    after = 0.0 if stop else -e * rate
    p = (after - rate) / c.compliance[i, i]
    if p > 0.0:
        push(c, i, p, 0.0, s.now.v)
        row = run.impacts[run.counters[IMPACTS]]
        given = work = 0.0
        for k in range(len(drives)):
            x = c.drive_response[i, k] * p
            given += x
            work += x * drives[k]
        row[0], row[1], row[2], row[3], row[4] = s.now.time, i, c.normal_angle[i], -rate, after
        row[5], row[6], row[7], row[8] = p, 0.0, -0.5 * (rate + after) * p, given
        row[9], row[10] = work, 1.0 if stop else 0.0
        row[11] = remaining_time(-e * rate, acceleration, e) if stop else 0.0
        run.counters[IMPACTS] += 1
    run.reals[HORIZON] = min(run.reals[HORIZON], horizon_of(after, acceleration))
    if after <= -_IMPACTS.rebound * rate:
        run.marks[TOUCHING] = False
        run.marks[TOUCHING, i] = True
        run.marks[RESTING] = run.marks[TOUCHING]
        return RESTS
    return DONE if run.counters[GUARDS] == len(c.value) else _after(run)


@kernel
def strikes(run: EventArrays) -> int:
    """Impact in a gap and in all others that touch."""
    run.gaps[BEFORE] = run.gaps[MODE]
    s = situation_of(run)
    done = impact_of_all(
        s.c,
        s.limits,
        run.counters[GUARD],
        s.now,
        run.impacts,
        run.counters[IMPACTS],
        run.marks[TOUCHING],
        run.marks[RESTING],
    )
    if not done.found:
        return UNSOLVED
    run.counters[IMPACTS] = done.entered
    run.reals[HORIZON] = min(run.reals[HORIZON], done.horizon)
    return RESTS if done.rests else _after(run)


@kernel
def rests(run: EventArrays) -> int:
    """Keep closed those of the contacts without normal speed that are pressed together.

    Where no force can keep a contact that slides, friction jams it.
    """
    s = situation_of(run)
    c, m, n = s.c, len(s.c.value), run.counters
    none, given = run.marks[SHUT, :0], run.gaps[GIVEN]
    old = run.gaps[MODE].copy()
    # what coming to rest loses is booked in the impact of this instant, if there was one
    count = n[IMPACTS]
    booked = count > 0 and run.impacts[count - 1, T] == run.reals[TIME]
    booked = booked and (m > 1 or len(c.rate) > m)
    found = come_to_rest(
        c, s.limits, Resting(run.marks[RESTING], run.marks[TOUCHING], given), s.now.drives,
        run.impacts[count - 1 if booked else count : count], run.gaps[MODE], run.marks[_BEGINNING],
        run.marks[_DRAWN],
    )  # fmt: skip
    eased = given.any()
    given[:] = 0
    if not found.solved:
        flag(run, none)
        return RESTS if eased else JAMMED  # those that gave way need not, by rounding
    run.reals[HORIZON] = min(run.reals[HORIZON], found.horizon)
    for i in range(m):
        mode = run.gaps[MODE, i]
        run.gaps[MODE, i] = old[i]
        set_mode(run, i, mode)
    if found.changed or found.begins:
        flag(run, run.marks[_BEGINNING] if found.begins else none)
    run.marks[_PARTING] = False
    if found.parts:
        for i in range(m):
            run.marks[_PARTING, i] = run.marks[RESTING, i] and not run.marks[SHUT, i]
    n[DRAWS], n[BEGINS] = found.draws, found.begins
    if found.off or found.begins or n[RELATIONS]:
        return PROJECTED
    return _next(run)


@kernel
def projected(run: EventArrays) -> int:
    """Continue after closures and closed contacts were projected to zero, at state `seen`."""
    size, stage = len(run.x), run.counters[STAGE]
    first = size // 2 if stage == TURNED else 0
    for k in range(first, size):
        run.x[k] = run.seen[k]
    frictional = run.gaps[STICK, 0] >= 0 or run.gaps[STICK].max() >= 0
    # what moved positions by a rounding turned the normals of fine clearances
    if stage == PROJECTED and frictional and run.marks[SHUT].any():
        return TURNED
    if run.counters[BEGINS]:  # to slide, from a slip of exactly zero
        run.counters[BEGINS] = 0
        flag(run, run.marks[SHUT, :0])
    return _next(run)


@kernel
def _next(run: EventArrays) -> int:
    """Next stage after contacts came to rest: opening contacts part, then drawn ones rest."""
    run.counters[TRIES] = 0
    if run.marks[_PARTING].any():
        return PARTS
    if run.counters[DRAWS]:
        run.counters[DRAWS] = 0
        for i in range(run.gaps.shape[1]):
            if run.marks[_DRAWN, i]:
                run.marks[RESTING, i] = run.marks[TOUCHING, i] = True
        return RESTS
    return _after(run)


@kernel
def part(run: EventArrays) -> int:
    """Start the flight of gaps a few roundings inside, at rest in the normal direction.

    A flight that started on the wrong side of zero would never be seen to end; one that has
    begun before, and fell, was not far enough inside to be told from zero. Other open gaps that
    touch at rest are moved along, lest they are pushed out.
    """
    s = situation_of(run)
    c, limits, m = s.c, s.limits, len(s.c.value)
    parting, tries = run.marks[_PARTING], run.counters[TRIES]
    clear = True
    for i in range(m):
        if not parting[i]:
            continue
        if run.gaps[RATED, i]:  # it has no place: roundings of its rate instead
            push(c, i, (limits.bare - c.rate[i]) / c.compliance[i, i], 0.0, s.now.v)
            parting[i] = False
            return _next(run)
        flew = run.gaps[BEFORE, i] == FLIES
        clear = clear and c.value[i] > (limits.touching if flew else 0.0)
    if tries == 4 or (tries > 0 and clear):
        parting[:] = False
        return _next(run)
    moved = parting.copy()
    for i in range(m):
        free = m > 1 and not (run.marks[SHUT, i] or run.gaps[RATED, i])
        if free and abs(c.value[i]) <= limits.touching and abs(c.rate[i]) <= limits.bare:
            moved[i] = True
    release(c, moved, (1 << tries) * run.reals[MARGIN], limits.bare, run.x)
    run.counters[TRIES] = tries + 1
    return PARTS


@kernel
def _after(run: EventArrays) -> int:
    """End an event: suppress a slip that cannot grow, then search for missed events."""
    n = run.counters
    if n[HELD]:
        _hold_slip(run, n[HELD] - 1)
        n[HELD] = 0
    if n[WATCHED] and n[ROUNDS] < n[GUARDS] and n[GUARDS] > 1:
        n[ROUNDS] += 1
        return MISSED
    return DONE


@kernel
def _hold_slip(run: EventArrays, gap: int) -> None:
    """Suppress a slip that has ended but cannot grow, as other contacts hold it.

    Where two corners of a block rest on one line, the friction of one may be at its bound
    while the other sticks: then its slip is zero but for rounding, which would fall through
    zero for ever. A rounding within the bound, friction has no slip to watch.
    """
    if (run.gaps[MODE] != run.gaps[BEFORE]).any():
        return
    c, least = situation_of(run).c, 0.0
    for x in c.free_acceleration:
        least = max(least, _ROUNDING.acceleration * abs(x))
    if abs(c.acceleration[len(c.value) + gap]) <= least:
        run.parameters[run.gaps[SLIP, gap]] *= 1.0 - _CONTACTS.held_slip


@kernel
def missed(run: EventArrays) -> int:
    """Respond to a guard below zero already, whose fall the integrator cannot detect."""
    guard = past_zero(run, -1)
    if guard < 0:
        return DONE
    run.counters[GUARD] = guard
    return FELL if guard < len(run.gaps[MODE]) else SLIPS


@kernel
def past_zero(run: EventArrays, fell: int) -> int:
    """Index of a guard of a gap or its friction below zero, by ``watch``; -1 for none.

    That happens where a step ends within its error of an event. Beside the guard that
    `fell`, others count only beyond what falls at the same instant.
    """
    seen, count, m = run.seen, run.counters[GUARDS], run.gaps.shape[1]
    floor, touching, bare = run.reals[FLOOR], run.reals[LIMITS], run.reals[LIMITS + 2]
    margin = 0.0 if fell < 0 else touching
    for i in range(count):
        if seen[i] > 0.0 or i == fell:
            continue
        if i < m and run.gaps[MODE, i] == FLIES:
            rated = run.gaps[RATED, i]
            least = max(margin, bare) if rated else margin
            # what leaves its place to others rests within rounding of zero, to either side
            rests = not rated and seen[i] > -touching and seen[count + i] >= -bare
            if seen[i] <= -least and seen[count + i] < 0.0 and not rests:
                return i
            continue
        least = floor if i >= m else 0.0
        if fell >= 0:
            least = _CONTACTS.same_instant * (least - margin)
        if seen[i] <= least:
            return i
    return -1


@entry
def look(*arrays: Any) -> int:
    """Index of a guard below zero beside that of the counters, by ``watch``; -1 for none.

    Parameters
    ----------
    arrays : those of `run_of`
    """
    run = run_of(*arrays)
    return past_zero(run, run.counters[GUARD])


@entry
def look_there(state: Array, now: Array, addresses: Indices, *arrays: Any) -> int:
    """Call `look` at the state itself; the first arguments are those of `resolve`."""
    run = run_of(*arrays)
    evaluate(run, state, now, addresses, MISSED)
    return past_zero(run, run.counters[GUARD])


@entry
def respond(*arrays: Any) -> int:
    """Take the stage of the counters; returns the next stage.

    Parameters
    ----------
    arrays : those of `run_of`
    """
    run = run_of(*arrays)
    stage = run.counters[STAGE]
    if stage == FELL:
        return fell(run)
    if stage == SLIPS:
        return slips(run)
    if stage == STRIKES:
        return strikes(run)
    if stage == RESTS:
        return rests(run)
    if stage == PARTS:
        return part(run)
    if stage == MISSED:
        return missed(run)
    return projected(run)


@kernel
def evaluate(run: EventArrays, state: Array, now: Array, addresses: Indices, stage: int) -> None:
    """Call the machine code of what a stage needs."""
    width = len(state)
    now[:width] = state
    now[width : width + len(run.parameters)] = run.parameters
    if stage < PROJECTED:
        call_code(addresses[stage], run.terms, now, now, now)
    else:
        call_code(addresses[stage], run.seen, now, now, now)


@kernel
def has_room(run: EventArrays) -> bool:
    """True if the logs have room for what a stage enters."""
    n, m = run.counters, run.gaps.shape[1]
    room = n[IMPACTS] + m <= len(run.impacts) and n[CHANGES] + 2 * m <= len(run.changes)
    return bool(room)


_ENDLESS = 2**62


@kernel
def resolve(state: Array, now: Array, addresses: Indices, *arrays: Any) -> int:
    """Take stages from that of the counters on; returns the next stage, `DONE` at the end.

    It stops before a stage whose function has no address, or for which the logs have no room.

    Parameters
    ----------
    state : (w,) of the integrator
    now : (w + parameters + 1,) the argument of functions, with its time set
    addresses : by stage, of the machine code of `NEEDS`; 0 if unavailable
    arrays : those of `run_of`
    """
    run = run_of(*arrays)
    n = run.counters
    for _ in range(_ENDLESS):
        stage = n[STAGE]
        if stage <= DONE or addresses[stage] == 0 or not has_room(run):
            break
        if not (stage == STRIKES and n[TAKEN] == FELL):  # of the same state
            evaluate(run, state, now, addresses, stage)
        after = respond(*arrays)
        n[STAGE], n[TAKEN] = after, stage
    return int(n[STAGE])
