"""The contacts of a mechanism at one instant as arrays, and what an instant does to them.

A machine is not needed for any of it: the arrays say how its gaps answer to impulses. Rows are the
normals of all gaps and, if any gap has friction, the tangents of all gaps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.engine.contact.chatter import ends, left_out, remaining_time
from mechanism_sim.engine.contact.impact import (
    ContactCompliance,
    impulses_of_one,
    simultaneous_impulses,
)
from mechanism_sim.numerics.complementarity import (
    BACKWARD,
    FORWARD,
    OPEN,
    STICK,
    FrictionalProblem,
    Indices,
    largest,
    solve_contacts,
    solve_semidefinite,
)
from mechanism_sim.numerics.kernels import entry, kernel
from mechanism_sim.tolerances import TOLERANCES

_CHATTER = TOLERANCES.chatter
_IMPACTS = TOLERANCES.impacts


class ContactProblem(NamedTuple):
    """The m gaps at one state: r rows, f free coordinates, p drives that hold their law."""

    value: Array  #: (m,) gaps [m]
    rate: Array  #: (r,) normal, then tangential rates [m/s]
    free_acceleration: Array  #: (r,) derivatives of `rate` without contact forces [m/s^2]
    acceleration: Array  #: (r,) derivatives with the forces of the gaps now closed [m/s^2]
    response: Array  #: (r, f) rates of free coordinates per unit impulse, loops closed
    compliance: Array  #: (r, r) rates of the rows per unit impulse [1/kg]
    drive_response: Array  #: (r, p) impulse of the drives per unit impulse
    normal_angle: Array  #: (m,) directions of the normals [rad]
    relief: Array  #: (m,) `CompliantLaw.relief` [m/s]; (0,) without compliant contacts
    closed: Mask  #: (m,) gaps that carry force
    restitution: Array  #: (m,) coefficients of restitution
    friction: Array  #: (m,) Coulomb's coefficients
    hypothesis: Indices  #: (m,) restitution hypotheses, `impact.Hypothesis.code`


class Limits(NamedTuple):
    """Limits below which contacts count as at rest, or as touching."""

    touching: float  #: [m] gaps smaller than this count as closed
    tie: float  #: [m] approaching gaps smaller than this take part in the same impact
    bare: float  #: [m/s] rounding error of a rate after an impact
    still: float  #: [m/s] error of a step: slower sliding or separation counts as rest
    allowed: float  #: [m] rise of rebounds that are left out, see `chatter.ChatterRule`
    resolved: float  #: [m] smallest rise that exceeds rounding


class Instant(NamedTuple):
    """Time of an impact, and the rates there."""

    time: float  #: [s]
    drives: Array  #: (p,) rates of the drives [rad/s]
    v: Array  #: (f,) rates of the free coordinates, which impulses change in place


class Resting(NamedTuple):
    """Contacts without normal speed, of which some stay closed."""

    resting: Mask  #: (m,) contacts without normal speed
    touching: Mask  #: (m,) contacts whose modes are to be set: at rest, or separating
    given: Indices  #: (m,) slip signs of contacts about to slide, else 0


class Layout(NamedTuple):
    """Sizes of the parts of a `ContactProblem`."""

    gaps: int
    rows: int
    free: int
    drives: int
    compliant: int  #: number of gaps with a relief

    @property
    def size(self) -> int:
        """Number of all terms, which are stored one after another, see `problem_of`."""
        m, r, f, p, compliant = self
        return 2 * m + 3 * r + r * (f + r + p) + compliant


class ContactArrays(NamedTuple):
    """Arrays from which `problem_of` makes a contact problem: few to pass to a kernel."""

    terms: Array  #: all terms in one row, as output of `PresentFunctions.contact_function`
    layout: Layout
    laws: Array  #: (2, m) coefficients of restitution and of friction
    closed: Mask  #: (m,)
    hypothesis: Indices  #: (m,)


class ImpactOutcome(NamedTuple):
    """Outcome of an impact."""

    rests: bool  #: whether a contact is at rest after the impact, or was closed before
    horizon: float  #: [s] longest next step
    entered: int  #: number of rows in the log
    found: bool  #: whether impulses satisfy all contacts


class Rest(NamedTuple):
    """Outcome for contacts without normal speed."""

    solved: bool  #: whether forces keep contacts closed; if not, the rest does not apply
    changed: bool  #: whether any mode changed
    begins: bool  #: whether a contact begins to slide whose slip can be set to zero first
    parts: bool  #: whether a contact opens
    off: bool  #: whether a closed gap deviates from zero, in value or rate, beyond rounding
    draws: bool  #: whether open gaps are closed by those closed now
    horizon: float  #: [s] longest next step


FLIES, FOLLOWS, STICKS, SLIDES_FORWARD, SLIDES_BACKWARD, RECOVERS = range(1, 7)
"""Modes of a contact: open; closed without friction; closed with friction; see `Mode`."""

IDLE = 4  # a grip beside those of `complementarity`, see `turn_idle`

T, GAP, ANGLE, APPROACH, REBOUND, NORMAL, TANGENTIAL, LOSS, DRIVE, WORK, ENDS, LEFT = range(12)
"""Columns of a log of impacts: time [s], index of the gap, and what `engine.events.Impact` has."""


@kernel
def problem_of(arrays: ContactArrays) -> ContactProblem:
    """Views of the terms, with the coefficients of restitution and friction."""
    terms, layout, laws, closed, hypothesis = arrays
    m, r, f, p, compliant = layout
    at = m + 3 * r
    return ContactProblem(
        terms[:m],
        terms[m : m + r],
        terms[m + r : m + 2 * r],
        terms[m + 2 * r : at],
        terms[at : at + r * f].reshape((r, f)),
        terms[at + r * f : at + r * (f + r)].reshape((r, r)),
        terms[at + r * (f + r) : at + r * (f + r + p)].reshape((r, p)),
        terms[at + r * (f + r + p) : at + r * (f + r + p) + m],
        terms[at + r * (f + r + p) + m : at + r * (f + r + p) + m + compliant],
        closed,
        laws[0],
        laws[1],
        hypothesis,
    )


@kernel
def horizon_of(rebound: float, acceleration: float) -> float:
    """The time [s] of 100 flights that fall back steadily: no next step should be longer.

    A number off the powers of two, at which the search for roots bisects.
    """
    if rebound > 0.0 and acceleration < 0.0:
        return -2.0 * _CHATTER.flights * rebound / acceleration
    return math.inf


@kernel
def part_of(c: ContactProblem, gaps: Mask) -> tuple[Indices, Array, Array]:
    """Indices (k,) of some gaps, their compliance (2k, 2k) and rates (2k,), tangents always."""
    m, k = len(c.value), 0
    rows = np.empty(m, dtype=np.int64)
    for i in range(m):
        if gaps[i]:
            rows[k] = i
            k += 1
    A, v = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
    halves = 2 if len(c.rate) > m else 1
    for a in range(halves):
        for i in range(k):
            v[a * k + i] = c.rate[a * m + rows[i]]
            for b in range(halves):
                for j in range(k):
                    A[a * k + i, b * k + j] = c.compliance[a * m + rows[i], b * m + rows[j]]
    return rows[:k], A, v


@kernel
def impulses(
    A: Array, rate: Array, e: Array, mu: Array, hypothesis: Indices
) -> tuple[Array, Array, bool]:
    """Impulses (2m,) of an impact, the rates (2m,) after it, and whether there are any."""
    m = len(e)
    if m == 1:
        x = np.zeros(2)
        Ant, Atn = A[0, 1], A[1, 0]
        if abs(Atn - Ant) <= _IMPACTS.symmetric * math.sqrt(A[0, 0] * A[1, 1]):
            Atn = Ant
        own = ContactCompliance(A[0, 0], Ant, Atn, A[1, 1])
        x[0], x[1], _ = impulses_of_one(own, rate[0], rate[1], e[0], mu[0], hypothesis[0])
        found = not math.isnan(x[0])
    else:
        x, found = simultaneous_impulses(A, rate, e, mu, hypothesis)
        if not found:  # Moreau's form may have no solution with friction; two phases always have
            x, found = simultaneous_impulses(A, rate, e, mu, np.ones(m, dtype=np.int64))
    after = np.empty(2 * m)
    for r in range(2 * m):
        after[r] = rate[r]
        gained = 0.0
        for k in range(2 * m):
            gained += A[r, k] * x[k]
        after[r] += gained
    return x, after, found


@kernel
def push(c: ContactProblem, gap: int, p: float, q: float, v: Array) -> None:
    """Add to rates (f,) of the free coordinates what impulses of a gap make, in place."""
    m = len(c.value)
    for k in range(len(v)):
        v[k] += c.response[gap, k] * p
    if q != 0.0:
        for k in range(len(v)):
            v[k] += c.response[m + gap, k] * q


@kernel
def enter(
    c: ContactProblem,
    gap: int,
    impulse: tuple[float, float],
    before: Array,
    after: Array,
    stop: bool,
    now: Instant,
    row: Array,
) -> None:
    """Write an impact to a row of the log.

    Parameters
    ----------
    impulse : normal and tangential [N s]
    before, after : (2,) normal and tangential rate [m/s]
    stop : True if the impact ends a chatter sequence
    """
    m, e, (p, q), drives = len(c.value), c.restitution[gap], impulse, now.drives
    given = work = 0.0
    for k in range(len(drives)):
        x = c.drive_response[gap, k] * p
        if q != 0.0:
            x += c.drive_response[m + gap, k] * q
        given += x
        work += x * drives[k]
    row[T], row[GAP], row[ANGLE] = now.time, gap, c.normal_angle[gap]
    row[APPROACH], row[REBOUND] = -before[0], max(after[0], 0.0)
    row[NORMAL], row[TANGENTIAL] = p, q
    slid = -0.5 * (before[1] + after[1]) * q
    row[LOSS] = -0.5 * (before[0] + after[0]) * p + slid
    row[DRIVE], row[WORK] = given, work
    row[ENDS] = 1.0 if stop else 0.0
    row[LEFT] = remaining_time(-e * before[0], c.acceleration[gap], e) if stop else 0.0


@kernel
def is_last(c: ContactProblem, gap: int, rebound: float, rise: float) -> bool:
    """True if a rebound [m/s] of a gap rises by at most `rise` [m], or not above zero."""
    return ends(rise, rebound, c.acceleration[gap], -c.value[gap])


@kernel
def impact_of_all(
    c: ContactProblem,
    limits: Limits,
    gap: int,
    now: Instant,
    log: Array,
    count: int,
    touching: Mask,
    resting: Mask,
) -> ImpactOutcome:
    """Impact in a gap and in all others that touch.

    A rebound that is the end of a chatter is left out. What is closed already, or parts, does not
    rebound; it takes part.

    Parameters
    ----------
    now : time and rates of the impact; rates are changed in place
    log : (n, 12) with room for m rows from `count` on
    touching : (m,) set: which contacts take part
    resting : (m,) set: which of them are at rest after it
    """
    m, rests = len(c.value), False
    resting[:] = False
    for i in range(m):
        touching[i] = (
            i == gap
            or c.closed[i]
            or abs(c.value[i]) <= limits.touching
            or (c.value[i] <= limits.tie and c.rate[i] < 0.0)
        )
    rows, A, rate = part_of(c, touching)
    n = len(rows)
    e, mu, hypothesis = np.empty(n), np.empty(n), np.empty(n, dtype=np.int64)
    for k in range(n):
        i = rows[k]
        for r in (k, n + k):  # what is closed is at rest but for a step's error
            if c.closed[i] and abs(rate[r]) <= limits.still:
                rate[r] = 0.0
        e[k] = 0.0 if c.closed[i] or rate[k] >= 0.0 else c.restitution[i]
        mu[k], hypothesis[k] = c.friction[i], c.hypothesis[i]
    # first with restitution; contacts whose rebound would be the last of a chatter then get e = 0,
    # and the impact is solved again, as their impulses change those of the others
    x, after, found = impulses(A, rate, e, mu, hypothesis)
    ended, again = np.zeros(n, dtype=np.bool_), False
    for k in range(n):
        i = rows[k]
        ended[k] = is_last(c, i, after[k], left_out(limits.allowed, limits.resolved, e[k]))
        if ended[k] and e[k] > 0.0:
            e[k], again = 0.0, True
    if found and again:
        x, after, found = impulses(A, rate, e, mu, hypothesis)
    if not found:
        return ImpactOutcome(False, math.inf, count, False)
    horizon = math.inf
    old, new = np.empty(2), np.empty(2)
    for k in range(n):
        i, p, q = rows[k], x[k], x[n + k]
        if p > 0.0 or q != 0.0:
            push(c, i, p, q, now.v)
            # a closed contact takes part in the impacts of others
            if not c.closed[i] or max(p, abs(q)) * A[k, k] > limits.bare:
                old[0], old[1], new[0], new[1] = rate[k], rate[n + k], after[k], after[n + k]
                enter(c, i, (p, q), old, new, ended[k], now, log[count])
                count += 1
        # at rest as well is what would rise no farther than rounding reaches
        low = is_last(c, i, after[k], limits.resolved)
        stays = limits.still if c.closed[i] else limits.bare
        resting[i] = low or after[k] <= max(-_IMPACTS.rebound * rate[k], stays)
        rests = rests or resting[i] or c.closed[i]
        if not resting[i]:
            # a root near the start of a long step is lost: the rebound's return bounds the next
            horizon = min(horizon, horizon_of(after[k], c.acceleration[i]))
    return ImpactOutcome(rests, horizon, count, True)


@kernel
def slip_of(c: ContactProblem, gap: int, still: float) -> int:
    """Direction of slip of a contact with friction, 1 or -1; 0 if it is not above `still`."""
    if c.friction[gap] == 0.0:
        return 0
    speed = c.rate[len(c.value) + gap]
    return 0 if abs(speed) <= still else 1 if speed > 0.0 else -1


@kernel
def press(
    c: ContactProblem, limits: Limits, resting: Mask, given: Indices
) -> tuple[Indices, Array, bool]:
    """Grips of contacts without normal speed, and the forces that keep them closed.

    Parameters
    ----------
    resting : (m,) which they are
    given : (m,) signs of the slips of those that are about to slide, else 0

    Returns
    -------
    (m,) grips, `complementarity.OPEN` of those that open; (r,) forces [N]; and whether any forces
    keep the others: friction may jam them
    """
    m = len(c.value)
    grips, forces = np.zeros(m, dtype=np.int64), np.zeros(len(c.rate))
    rows, A, _ = part_of(c, resting)
    n = len(rows)
    b, mu, least = np.zeros(2 * n), np.zeros(n), np.zeros(2 * n)
    slip = np.zeros(n, dtype=np.int64)
    frictional = len(c.rate) > m
    for k in range(n):
        b[k] = c.free_acceleration[rows[k]]
        if frictional:
            b[n + k] = c.free_acceleration[m + rows[k]]
            mu[k] = min(c.friction[rows[k]], _IMPACTS.rough)
    # what slides no farther than rounding reaches may as well be at rest
    slow = max(limits.still, math.sqrt(2.0 * limits.touching * largest(c.free_acceleration)))
    # slow slips count as none at first; if the forces then drive a contact against its true slip,
    # the slips are taken as they are
    for still in (slow, limits.still):
        for k in range(n):
            i = rows[k]
            slip[k] = given[i] if given[i] != 0 else slip_of(c, i, still)
        x, found, solved = solve_contacts(FrictionalProblem(A, b, mu, slip, least))
        if not solved:
            return grips, forces, False
        agree = True
        for k in range(n):
            i = rows[k]
            grips[i] = found[k] if x[k] > 0.0 else OPEN
            sign = 1 if grips[i] == FORWARD else -1 if grips[i] == BACKWARD else 0
            if given[i] == 0 and sign * slip_of(c, i, limits.still) < 0:
                agree = False
        if agree or not frictional:
            break
    for k in range(n):
        i = rows[k]
        if grips[i] != OPEN:
            forces[i] = x[k]
            if frictional:
                forces[m + i] = x[n + k]
    return grips, forces, True


@kernel
def book_rest(c: ContactProblem, limits: Limits, kept: Mask, drives: Array, row: Array) -> None:
    """Add to an impact in the log the work that brings almost resting rows to rest.

    The energy that this loses is ``-w . x/2`` with the rates w before it and its impulses x.

    Parameters
    ----------
    kept : (r,) rows that are kept at rest from now on
    drives : (p,) rates of the drives [rad/s]
    row : row of the log, changed in place
    """
    r, n = len(c.rate), 0
    rows = np.empty(r, dtype=np.int64)
    for i in range(r):
        if kept[i]:
            rows[n] = i
            n += 1
    K, left, fastest = np.empty((n, n)), np.empty((n, 1)), 0.0
    for i in range(n):
        left[i, 0] = -c.rate[rows[i]]
        fastest = max(fastest, abs(left[i, 0]))
        for k in range(n):
            K[i, k] = c.compliance[rows[i], rows[k]]
    if fastest <= limits.bare:
        return
    x = solve_semidefinite(K, left)
    for i in range(n):
        row[LOSS] -= 0.5 * c.rate[rows[i]] * x[i, 0]
        for k in range(len(drives)):
            push = c.drive_response[rows[i], k] * x[i, 0]
            row[DRIVE] += push
            row[WORK] += push * drives[k]


@kernel
def independence(c: ContactProblem, r: int, rows: Indices, L: Array, n: int) -> float:
    """Share of a row that is left when its parts along n others are taken off, 0 to 1.

    Parameters
    ----------
    rows : (k,) the others, of which the first n count
    L : (k, k) their Cholesky factor, each scaled to length one; its row n is set
    """
    m = len(c.value)
    # some slips are prescribed, always or at an instant
    if not c.compliance[r, r] > _IMPACTS.prescribed * c.compliance[r % m, r % m]:
        return 0.0
    left = 1.0
    for k in range(n):
        x = c.compliance[r, rows[k]] / math.sqrt(
            c.compliance[r, r] * c.compliance[rows[k], rows[k]]
        )
        for j in range(k):
            x -= L[n, j] * L[k, j]
        L[n, k] = x / L[k, k]
        left -= L[n, k] ** 2
    L[n, n] = math.sqrt(max(left, 0.0))
    return left


@kernel
def turn_determined(c: ContactProblem, grips: Indices) -> None:
    """Let contacts count as sliding, in place, whose slips the closed gaps determine alone.

    Where they stick, their friction is any within the cone: it moves nothing, and equations that
    ask for it are singular. So it is at its bound, on the side on which it presses less.
    """
    m, n = len(c.value), 0
    rows, L = np.empty(m + 1, dtype=np.int64), np.empty((m + 1, m + 1))
    for i in range(m):
        if grips[i] != OPEN and independence(c, i, rows, L, n) > _IMPACTS.independent:
            rows[n] = i
            n += 1
    for i in range(m):
        sticks = grips[i] == STICK and c.friction[i] > 0.0
        if sticks and not independence(c, m + i, rows, L, n) > _IMPACTS.determined:
            grips[i] = BACKWARD if c.compliance[i, m + i] > 0.0 else FORWARD


@kernel
def turn_idle(c: ContactProblem, grips: Indices, forces: Array) -> None:
    """Let contacts count as idle, in place, whose slips those that stick keep at zero already.

    How both share the friction is not determined, as under two feet of a block: equations that
    ask for it are singular. So those that carry none in a solution `forces` (r,) carry none.
    No normal of compliant contacts is kept at zero, only slips are.
    """
    m, n = len(c.value), 0
    rows, L = np.empty(2 * m, dtype=np.int64), np.empty((2 * m, 2 * m))
    for at in range(3 * m):  # normals first, then what carries friction
        i = at % m
        if at < m:
            kept = grips[i] != OPEN and len(c.relief) == 0
            if kept and independence(c, i, rows, L, n) > _IMPACTS.independent:
                rows[n] = i
                n += 1
        elif grips[i] == STICK and c.friction[i] > 0.0 and (forces[m + i] != 0.0) == (at < 2 * m):
            if independence(c, m + i, rows, L, n) > _IMPACTS.determined:
                rows[n] = m + i
                n += 1
            elif at >= 2 * m:
                grips[i] = IDLE


@kernel
def begin(c: ContactProblem, limits: Limits, grips: Indices, kept: Mask) -> Mask:
    """Contacts (m,) that begin to slide and whose slips can all be brought to zero at once.

    Parameters
    ----------
    kept : (r,) rows that are kept at rest from now on; those of these contacts are added, in place
    """
    m, n = len(c.value), 0
    begins = np.zeros(m, dtype=np.bool_)
    if len(c.rate) == m:
        return begins
    rows, L = np.empty(2 * m, dtype=np.int64), np.empty((2 * m, 2 * m))
    for at in range(3 * m):  # first what is kept; rows that depend on those before are left out
        r = at if at < 2 * m else at - m
        if at < 2 * m:
            wanted = kept[r]
        else:
            slides = grips[r - m] == FORWARD or grips[r - m] == BACKWARD
            wanted = slides and slip_of(c, r - m, limits.still) == 0
        if wanted and independence(c, r, rows, L, n) > _IMPACTS.independent:
            rows[n] = r
            n += 1
            if at >= 2 * m:
                begins[r - m] = kept[r] = True
    return begins


@kernel
def come_to_rest(
    c: ContactProblem,
    limits: Limits,
    contacts: Resting,
    drives: Array,
    last: Array,
    modes: Indices,
    begins: Mask,
    drawn: Mask,
) -> Rest:
    """Bring contacts without normal speed to rest: those pressed together stay closed.

    Parameters
    ----------
    drives : (p,) rates of the drives [rad/s]
    last : (1, 12) impact of this instant, to whose loss that of the stop is added; or (0, 12)
    modes : (m,) changed in place, with ``c.closed``
    begins : (m,) set: which begin to slide, see `begin`
    drawn : (m,) set: see `induced_closures`
    """
    m, resting, touching = len(c.value), contacts.resting, contacts.touching
    grips, forces, solved = press(c, limits, resting, contacts.given)
    if not solved:
        return Rest(False, False, False, False, False, False, math.inf)
    if len(c.rate) > m:
        turn_determined(c, grips)
        turn_idle(c, grips, forces)
    changed = parts = False
    kept = np.zeros(len(c.rate), dtype=np.bool_)
    for i in range(m):
        stays = grips[i] != OPEN
        parts = parts or (resting[i] and not stays)
        if not (touching[i] or stays):
            continue
        mode = FLIES
        if stays:
            kept[i] = True
            mode = FOLLOWS
            if c.friction[i] > 0.0:
                kept[m + i] = grips[i] == STICK
                mode = (
                    STICKS if grips[i] == STICK
                    else FOLLOWS if grips[i] == IDLE
                    else SLIDES_FORWARD if grips[i] == FORWARD
                    else SLIDES_BACKWARD
                )  # fmt: skip
        changed = changed or modes[i] != mode
        modes[i], c.closed[i] = mode, stays
    if len(last):
        book_rest(c, limits, kept, drives, last[0])
    begins[:] = begin(c, limits, grips, kept)
    # whether positions or rates of kept rows need a projection before the run goes on
    off = False
    for r in range(len(kept)):
        if kept[r]:
            off = off or abs(c.rate[r]) > limits.bare
            off = off or (r < m and abs(c.value[r]) > limits.touching)
    # accelerations under these forces decide which open gaps are drawn shut
    for r in range(len(kept)):
        gained = 0.0
        for k in range(len(kept)):
            gained += c.compliance[r, k] * forces[k]
        c.acceleration[r] = c.free_acceleration[r] + gained
    drawn[:], horizon = induced_closures(c, limits, resting)
    return Rest(
        True, changed, bool(begins.any()), bool(parts), bool(off), bool(drawn.any()), horizon
    )


@kernel
def release(c: ContactProblem, gaps: Mask, target: float, bare: float, x: Array) -> None:
    """Move a state so that gaps are `target` [m] wide and at rest in the normal direction.

    Those that rise faster than `bare` [m/s] go on to: what stopped them would do work.

    Parameters
    ----------
    gaps : (m,) which
    x : (2f,) free coordinates and their rates, changed in place
    """
    rows, A, rate = part_of(c, gaps)
    n, f = len(rows), len(x) // 2
    K, off = np.empty((n, n)), np.empty((n, 2))
    for i in range(n):
        off[i, 0] = target - c.value[rows[i]]
        off[i, 1] = -rate[i] if rate[i] <= bare else 0.0
        for k in range(n):
            K[i, k] = A[i, k]
    moves = solve_semidefinite(K, off)
    for i in range(n):
        for k in range(f):
            x[k] += c.response[rows[i], k] * moves[i, 0]
            x[f + k] += c.response[rows[i], k] * moves[i, 1]


@kernel
def induced_closures(c: ContactProblem, limits: Limits, known: Mask) -> tuple[Mask, float]:
    """Open gaps (m,) that those now closed draw shut before they rise; the horizon [s] of others.

    Parameters
    ----------
    known : (m,) gaps to be left out
    """
    m = len(c.value)
    drawn, horizon = np.zeros(m, dtype=np.bool_), math.inf
    for i in range(m):
        if c.closed[i] or known[i]:
            continue
        rate, acceleration = c.rate[i], c.acceleration[i]
        rises = rate > 0.0 and not is_last(c, i, rate, limits.resolved)
        near = c.value[i] <= limits.touching and rate >= -limits.bare
        if near and acceleration < 0.0 and not rises:
            drawn[i] = True
        else:
            horizon = min(horizon, horizon_of(rate, acceleration))
    return drawn, horizon


@entry
def impact_now(
    arrays: ContactArrays,
    limits: Limits,
    gap: int,
    now: Instant,
    log: Array,
    count: int,
    touching: Mask,
    resting: Mask,
) -> ImpactOutcome:
    """`impact_of_all` of the problem that `problem_of` makes."""
    return impact_of_all(problem_of(arrays), limits, gap, now, log, count, touching, resting)


@entry
def rest_now(
    arrays: ContactArrays,
    limits: Limits,
    contacts: Resting,
    drives: Array,
    last: Array,
    modes: Indices,
    begins: Mask,
    drawn: Mask,
) -> Rest:
    """`come_to_rest` of the problem that `problem_of` makes."""
    c = problem_of(arrays)
    return come_to_rest(c, limits, contacts, drives, last, modes, begins, drawn)
