"""The one event loop: Taylor steps between events, and what is done at each event.

A step is never cut to please a caller: requests read the step's polynomials. What is published,
and when, therefore cannot change the motion.

Taylor steps of heyoka, because a step is then a polynomial that is sampled, published and searched
for events exactly. SciPy's DOP853 with a careful event loop takes about ten times the CPU time at
rtol 1e-12; it is the second route of the tests.
"""

from __future__ import annotations

import math
import sys
from array import array
from collections import deque
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval

from mechanism_sim.arrays import Array
from mechanism_sim.contact.chatter import ChatterRule
from mechanism_sim.contact.problem import ContactProblem
from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.clock import base_at, horner, take_off_turns
from mechanism_sim.hybrid.compliant_contacts import OngoingTouch, Touches
from mechanism_sim.hybrid.contact_state import ContactState
from mechanism_sim.hybrid.contacts import Contacts
from mechanism_sim.hybrid.dense_output import DenseOutput, Motion, floats
from mechanism_sim.hybrid.events import Impact, ModeChange, StopReason
from mechanism_sim.hybrid.present_state import PresentState
from mechanism_sim.hybrid.singular import SingularPositions
from mechanism_sim.hybrid.snapshot import Snapshot, State
from mechanism_sim.hybrid.step_check import StepCheck
from mechanism_sim.hybrid.system import System
from mechanism_sim.planar.drive import DriveLaw, Law
from mechanism_sim.planar.protocols import Directed
from mechanism_sim.tolerances import TOLERANCES

_SINGULAR = TOLERANCES.singular
_STEPS = TOLERANCES.steps

#: of a guard as it is integrated: a root may be near whatever its rate
_NEAR_ROOT = TOLERANCES.guards.near_root * TOLERANCES.guards.watch_scale


_UNWATCHED = (0.0, 1.0, 0.0)


class _PendingStep(NamedTuple):
    """A step that is known but not yet part of the solution."""

    tau: float  #: [s] where it begins
    h: float  #: [s]
    guard: int | None  #: that ended it
    #: with which stabilisation [1/s], longest step [s] and stride [s]
    taken: tuple[float, float, float]
    origin: Array | None  #: the state at its start, if it was projected then


class EventLoop:
    """Runs a system through flight, impact and following.

    Parameters
    ----------
    system : the compiled equations
    laws : one for each prescribed coordinate, then one for each powered coordinate
    state : where to start; open gaps that touch are resolved at once
    rtol : error per step relative to a tenth of the fastest drive's speed, at least 1 rad/s
    atol : [m] displacement that may be left out when chatter is ended
    max_step : [s] longest Taylor step
    compact : compile smaller but slower code (for many coordinates)
    fastest : [rad/s] speed that the error refers to; of the first laws or the state if not given

    Attributes
    ----------
    events : number of events since the start
    """

    def __init__(
        self,
        system: System,
        laws: Sequence[Law],
        state: State,
        rtol: float,
        atol: float,
        max_step: float,
        compact: bool = False,
        fastest: float | None = None,
    ) -> None:
        self.events = 0
        self._system = system
        self._laws = list(laws)
        self._coming: deque[Law] = deque()
        self._max_step = max_step
        driven = [law.coefficients[1] for law in laws if isinstance(law, DriveLaw) and law.degree]
        turning = [v for v, angular in zip(state.v, system.angular, strict=True) if angular]
        known = [fastest] if fastest else driven or turning
        fastest = max((1.0, *map(abs, known)))
        self._ta = system.integrator(rtol, _STEPS.rate * fastest, compact)
        limit = _STEPS.defect * rtol * _STEPS.rate * fastest
        self._quickest = _STEPS.stabilisation * fastest
        steep = system.steep
        # polynomials of what moves are known as it is
        self._check: StepCheck | None = None
        if steep:
            self._check = StepCheck(system, steep, self._ta, limit)
        quick = (system.lone or not system.guards) and not system.timed
        self._quick = quick and self._check is None
        f, width = len(system.free), self._ta.order + 1
        self._state, self._pars = self._ta.state[: 2 * f], floats(self._ta.pars)
        series = floats(self._ta.tc)
        self._coefficients = series[: 2 * f * width]
        watch = 2 * f + 1  # after the state and the constant
        near = watch + len(system.guards)  # then the distance from singular positions
        self._guard_values = series[watch * width + 1 : near * width : width]
        self._nearness = series[near * width :] if system.relations else _UNWATCHED
        self._turning = [system.prescribed.index(c) for c in system.turning]
        self._directions = floats(self._ta.state)[near + bool(system.relations) :]
        self._step = self._ta.step
        self._stabilisation = system.parameters.stabilisation
        self._state[:] = [*state.q, *state.v]
        turns = dict(zip(system.free, state.turns, strict=True))
        self._base = base_at(state.time, self._laws, turns)
        self._output = DenseOutput(system, self._ta.order)
        rule = ChatterRule(rtol, atol, system.mechanism.size, system.mechanism.reach)
        self._present = PresentState(system, self._ta, self._base)
        self._gaps = ContactState(self._present, rule, rtol, fastest * system.mechanism.size)
        self._contacts = Contacts(self._gaps)
        self._singular = SingularPositions(system, self._ta, self._contacts, near)
        self._start_base()
        self._touches = Touches(system) if system.compliant else None
        self._pending: _PendingStep | None = None
        self._since = 0  # steps since the directions were computed
        self._last_event = float('-inf')
        self._simultaneous = 0
        self._begin(state)

    def _begin(self, state: State) -> None:
        """Resolve the contacts at the start, or leave a singular position."""
        if not self._leave_singular(_SINGULAR.here, first=True):
            self._contacts.start(state.closed)
            self._go_on()

    def _leave_singular(self, distance: float, first: bool = False) -> bool:
        """Take the first step from a singular position; False if there is none so near."""
        if first and self._system.relations and self._system.switches:
            self._contacts.switching.find_rows()  # closures may depend on them
        if not self._singular.is_within(distance):
            return False
        if self._system.gaps:
            if not self._singular.is_within(_SINGULAR.here):
                return False
            raise self._singular.undecided()
        self._go_on()
        h, guard, step = self._singular.begin()
        self._output.next.reshape(-1)[:] = step.terms
        self._pending = _PendingStep(
            self._ta.time - h, h, guard, (0.0, self._max_step, 0.0), step.origin
        )
        return True

    @property
    def steps(self) -> int:
        """Number of steps since the start."""
        return self._output.count

    @property
    def time(self) -> float:
        """Time [s] up to which the solution is known."""
        tau = self._pending.tau if self._pending else self._ta.time
        return self._base.at(tau)

    @property
    def contact_terms(self) -> ContactProblem:
        """The gaps at the present state."""
        return self._gaps.terms()

    def change_law(self, law: Law) -> None:
        """Let a law replace the present one of its coordinate from ``law.valid_from`` on.

        Raises
        ------
        ValueError
            If the motion is already known beyond that time, or the system is not compiled for
            the degree of the law.
        """
        if law.valid_from < self.time:
            raise ValueError(
                f'a law valid from {law.valid_from:.9g} s comes too late: the motion is known '
                f'up to {self.time:.9g} s'
            )
        if isinstance(law, DriveLaw) and law.degree > self._system.degree:
            raise ValueError(
                f'a law of degree {law.degree} needs equations compiled for it; these are for '
                f'degree {self._system.degree}'
            )
        self._coming = deque(sorted((*self._coming, law), key=lambda x: x.valid_from))

    def advance(self, until: float, final: bool = False, most: int | None = None) -> None:
        """Add every step to the solution that ends not later than `until` [s].

        With `final`, the step that holds `until` is added too, cut off there. `most` bounds the
        number of steps added by one call.

        Raises
        ------
        RunError
            If the state becomes infinite, events repeat without progress in time, or a law
            jumps in angle or speed.
        """
        ta, lengths = self._ta, self._output.lengths
        last = len(lengths) + most if most is not None else sys.maxsize
        limit, tau = self._base.local(until), ta.time
        while len(lengths) < last:
            step = self._pending
            if step is None:
                tau, h = self._follow(tau, limit, last)
                if h is None:
                    continue
                step = self._locate(tau, h)
            end = step.tau + step.h
            if end > limit or self._coming:
                self._pending = step
                if self._change_law(min(limit, end)):
                    limit, tau = self._base.local(until), 0.0
                    continue
                if end > limit:
                    if final:
                        self._cut(limit)
                    return
            self._pending = None
            tau = self._enter(step)
            if end > self._next_base:
                ta.time = end
                self._rebase()
                limit, tau = self._base.local(until), 0.0
            if step.guard is not None and step.origin is not None:
                self._leave_singular(_SINGULAR.beside)
        ta.time = tau

    def _follow(self, tau: float, limit: float, last: int) -> tuple[float, float | None]:
        """Take steps from `tau` on, as long as they just follow each other: at most a row.

        Returns where it came to, and the length of a further step that something happened in, if
        any.
        """
        gaps, output, ta, step = self._gaps, self._output, self._ta, self._step
        if self._since >= _STEPS.row:
            self._turn(tau)
        longest = self._max_step
        if not self._quick or self._coming or gaps.horizon < longest:
            if self._system.timed:
                ta.time = tau
            h = step(min(longest, gaps.horizon), True)[1]
            return tau, h if self._check is None else self._checked(tau, h, self._check)
        coefficients, pars, fired = self._coefficients, self._pars, self._system.parameters.fired
        slots, lengths, lone = output.slots, output.lengths, self._system.lone
        enter_tau, enter_length = output.taus.append, lengths.append
        watch, near, stride = self._guard_values, self._nearness, self._singular.stride
        stabilisation, quickest = self._stabilisation, self._quickest
        count, stop = len(lengths), min(limit, self._next_base)
        row = min(count + _STEPS.row - self._since, last, len(slots) - 1)
        for slot in slots[count:row]:
            h = step(longest, True)[1]
            end = tau + h
            if pars[fired] or not end <= stop:
                break
            if lone and watch[0] < _NEAR_ROOT:
                break
            if near[1] + _SINGULAR.ahead * max(h, stride) * near[2] < 0.0:
                break
            slot[:] = coefficients
            enter_tau(tau)
            enter_length(h)
            tau = end
            pars[stabilisation] = min(1.0 / h, quickest)
        else:
            self._since += row - count
            if row == len(slots) - 1:
                output.grow()
            return tau, None
        self._since += len(lengths) - count
        return tau, h

    def _locate(self, tau: float, h: float) -> _PendingStep:
        """The pending step for one from `tau` of length `h` [s] that was just taken."""
        gaps, singular, pars = self._gaps, self._singular, self._pars
        watch, near, longest = self._guard_values, self._nearness, self._max_step
        reach = min(longest, gaps.horizon)
        taken = (pars[self._stabilisation], reach, singular.stride)
        guard = self._system.fired(pars) if pars[self._system.parameters.fired] else None
        if self._system.lone:
            if watch[0] < _NEAR_ROOT:
                if watch[0] < 0.0 and not gaps.flying:
                    # it let go within the error of the last step's end
                    self._back_to(tau)
                    h, guard = 0.0, 0
                else:
                    h, guard = self._look_again(tau, h, guard)
        elif self._system.compliant or (watch and min(watch) < _NEAR_ROOT):
            h, guard = self._look_again(tau, h, guard)
        crossing = None
        if near[1] + _SINGULAR.ahead * max(h, singular.stride) * near[2] < 0.0:
            h, guard, crossing = singular.approach(tau, h, guard)
        if not h > 0.0 and guard is None:
            raise self._breakdown(tau)
        slot = self._output.slots[len(self._output.lengths)]
        slot[:] = crossing.terms if crossing else self._coefficients
        if guard is None and (h < reach or reach == longest):
            pars[self._stabilisation] = min(1.0 / h, self._quickest)
        if reach < longest:
            gaps.horizon = math.inf
        return _PendingStep(tau, h, guard, taken, crossing.origin if crossing else None)

    def _change_law(self, end: float) -> bool:
        """Cut the pending step where the next law begins, if it does before `end`."""
        change = self._base.local(self._coming[0].valid_from) if self._coming else math.inf
        pending = self._pending
        if pending is None or not (change <= end and change < pending.tau + pending.h):
            return False
        self._cut(change)
        self._switch_law(self._coming.popleft())
        self._leave_singular(_SINGULAR.beside)
        return True

    def _enter(self, step: _PendingStep) -> float:
        """Make a step part of the solution, and handle the event that ends it; return its end."""
        output, end = self._output, step.tau + step.h
        if step.h > 0.0:
            output.taus.append(step.tau)
            output.lengths.append(step.h)
            self._since += 1
            if len(output.lengths) == len(output.slots) - 1:
                output.grow()
        if step.guard is not None:
            self._ta.time = end
            self._count_event(end)
            self._contacts.handle(step.guard)
            self._ta.reset_cooldowns()
            if self._gaps.status is not self._marked:
                self._mark()
        return end

    def preview(self, until: float) -> Motion | None:
        """How the solution goes on up to `until` [s], of what `advance` to there held back.

        It is the beginning of the next step, on the same polynomials: whatever law comes from
        `until` on cannot change it. None if the solution has come so far. To be called after
        `drain`.
        """
        if self._pending is None:
            return None
        h = min(self._base.local(until) - self._pending.tau, self._pending.h)
        return self._output.peek(self._pending.tau, h) if h > 0.0 else None

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Let impacts of a joint with clearance have another coefficient, from now on.

        Raises
        ------
        KeyError
            If the joint has no gap.
        """
        self._contacts.change_restitution(joint, restitution)

    def _checked(self, tau: float, h: float, check: StepCheck) -> float:
        """Length of a step, taken anew until no formula turned steep within it unseen.

        A step that ends shortly before a fault is on the same series, of less range: it is looked
        at again, for what that may hide.
        """
        while h > _STEPS.shortest * self._max_step:
            sound, fault = check.reach(self._base.high, tau, h)
            if fault is None:
                break
            self._system.fired(self._pars)
            self._back_to(tau)
            h = self._step(h * (sound or _STEPS.shorter * fault), True)[1]
        return h

    def _look_again(self, tau: float, h: float, guard: int | None) -> tuple[float, int | None]:
        """Length and guard of a step, taken anew where it overlooked an event.

        The search for the roots of a guard gives up where one lies much nearer to the start of a
        step than to its end, or on the point where it bisects; and the root of a step that ends
        within its own error of an impact lies just behind it.
        """
        missed = self._missed(guard)
        while missed is not None and h > _STEPS.shortest * self._max_step:
            self._back_to(tau)
            h = self._step(_STEPS.shorter * h, True)[1]
            guard = self._system.fired(self._pars)
            missed = self._missed(guard)
        return h, guard if missed is None or guard is not None else missed

    def _missed(self, guard: int | None) -> int | None:
        """A guard beyond whose fall a step came to its end, seen by `guard` or by none."""
        if guard is None or len(self._system.guards) > 1:
            return self._contacts.missed_event(guard)
        return None

    def _back_to(self, tau: float) -> None:
        """Undo the last step, which began at `tau`."""
        self._singular.return_to(tau)

    def _breakdown(self, tau: float) -> RunError:
        if self._system.relations:
            self._back_to(tau)
            if self._present.singular_joints():
                return self._singular.undecided()
        self._back_to(tau)
        free = dict(zip(self._system.free, self._state, strict=False))
        driven = zip(self._system.prescribed, self._base.laws, strict=False)
        q = free | {c: horner(law, tau) for c, law in driven}
        place = np.array([[q[c]] for c in self._system.coordinates])
        size = self._system.mechanism.size
        for e in self._system.elements:
            if isinstance(e, Directed) and e.directed and e.length(place)[0] < _STEPS.meet * size:
                return RunError(
                    f'the ends of {e.name} meet at t = {self._base.high + tau:.9g} s, where its '
                    'force has no direction; one without free_length and damping may pass there'
                )
        far = ', or its elastic links bend too far' if self._system.mechanism.beams else ''
        return RunError(
            f'the integration broke down at t = {self._base.high + tau:.9g} s: the state '
            f'became infinite; the mechanism may be at a singular position{far}'
        )

    def _cut(self, at: float) -> None:
        """End the pending step early, at local time `at`, on its own polynomials."""
        if self._pending:
            tau, output, self._pending = self._pending.tau, self._output, None
            self._state[:] = polyval(at - tau, output.next.T)
            if at > tau:
                output.enter(tau, at - tau)
        self._ta.time = at
        self._go_on()

    def _go_on(self) -> None:
        """Let the integrator go on from a state that it did not come to by itself."""
        if self._system.guards:
            self._ta.reset_cooldowns()
        self._turn(self._ta.time)
        self._mark()

    def _mark(self) -> None:
        """Enter what steps are taken with from now on."""
        self._marked = self._gaps.status
        self._output.mark(self._base, self._marked)

    def _turn(self, tau: float) -> None:
        """Set cosine and sine of the steady drives, which drift by a rounding in each step."""
        for i, index in enumerate(self._turning):
            angle = horner(self._base.laws[index], tau)
            self._directions[2 * i], self._directions[2 * i + 1] = math.cos(angle), math.sin(angle)
        self._since = 0

    def _count_event(self, tau: float) -> None:
        self.events += 1
        t = self._base.at(tau)
        self._simultaneous = self._simultaneous + 1 if t == self._last_event else 0
        self._last_event = t
        if self._simultaneous > _STEPS.simultaneous:
            raise RunError(f'{StopReason.NO_PROGRESS.value} (t = {t:.12g} s)')

    # --- laws and bases -----------------------------------------------------------------------

    def _switch_law(self, law: Law) -> None:
        index = [known.coordinate for known in self._laws].index(law.coordinate)
        before = self._laws[index]
        if isinstance(before, DriveLaw) and not (
            isinstance(law, DriveLaw) and law.continues(before)
        ):
            raise RunError(
                f'the law of {law.coordinate} valid from {law.valid_from:.9g} s jumps in angle or '
                'speed, which no drive can follow; join the laws by a ramp'
            )
        self._laws[index] = law
        self._rebase()
        self._contacts.switching.pass_edges()
        self._contacts.settle()
        self._go_on()

    def _rebase(self) -> None:
        """Count time and turns anew from here, so that neither loses digits."""
        turns = {c: self._base.turns[c] for c in self._system.free}
        for i, name in enumerate(self._system.free):
            if not self._system.angular[i]:
                continue
            whole, angle = take_off_turns(float(self._state[i]))
            if whole:
                turns[name] += whole
                self._state[i] = angle
        now = self._base.time + Fraction(self._ta.time)
        self._base = base_at(now, self._laws, turns)
        self._ta.time = 0.0
        self._start_base()
        self._go_on()

    def _start_base(self) -> None:
        for index, law in zip(self._system.parameters.laws, self._base.laws, strict=True):
            for i, coefficient in zip(index, (*law, *[0.0] * len(index)), strict=False):
                self._pars[i] = coefficient
        for index, torque in zip(self._system.parameters.torques, self._base.torques, strict=True):
            for i, coefficient in zip(index, torque, strict=True):
                self._pars[i] = coefficient
        for name, i in zip(self._system.outside, self._system.parameters.outside, strict=True):
            known = name == 'time'
            self._pars[i] = self._base.high if known else self._base.turns[name.rpartition('.')[0]]
        self._present.base = self._base
        rates = self._state[len(self._state) // 2 :][list(self._system.angular)]
        self._next_base = self._base.next_after(float(np.abs(rates).max(initial=0.0)))

    # --- pauses -------------------------------------------------------------------------------

    @property
    def state(self) -> State:
        """The present state; after a call of `advance` with `final` that at its end."""
        f = len(self._system.free)
        return State(
            self._base.time + Fraction(self._ta.time),
            tuple(self._base.turns[c] for c in self._system.free),
            tuple(self._state[:f].tolist()),
            tuple(self._state[f:].tolist()),
            tuple(self._gaps.closed(i) for i in range(len(self._system.gaps))),
        )

    def restart(self, state: State) -> None:
        """Begin anew from another state, under the present laws, without compiling anything."""
        self._output.restart()
        turns = dict(zip(self._system.free, state.turns, strict=True))
        self._base = base_at(state.time, self._laws, turns)
        self._state[:] = [*state.q, *state.v]
        self._ta.time = 0.0
        self._pars[self._stabilisation] = 0.0
        self._pending = None
        self._start_base()
        self._last_event, self._simultaneous, self.events = float('-inf'), 0, 0
        self._gaps.impacts.count, self._gaps.horizon = 0, math.inf
        if self._touches:
            self._touches.restart()
        self._begin(state)

    def snapshot(self) -> Snapshot:
        """Snapshot from which a run goes on as if there had been no pause.

        A step that is known but not yet part of the solution is taken anew then.
        """
        gaps, state, tau = self._gaps, self._ta.state, float(self._ta.time)
        alpha, horizon = self._pars[self._stabilisation], gaps.horizon
        stride = self._singular.stride
        if self._pending:
            tau, (alpha, horizon, stride) = self._pending.tau, self._pending.taken
            began = self._pending.origin
            state = self._ta.tc[:, 0] if began is None else began
        touches = self._touches.follow(self._output.motion())[0] if self._touches else ()
        return Snapshot(
            '',
            self._base.time,
            tau,
            {c: self._base.turns[c] for c in self._system.free},
            tuple(state[: len(self._state)].tolist()),
            tuple(state[len(state) - len(self._directions) :].tolist()),
            self._since,
            gaps.modes,
            gaps.approach,
            self._present.rows,
            touches,
            alpha,
            horizon,
            self._next_base,
            tuple(self._laws),
            tuple(self._coming),
            self._last_event,
            self._simultaneous,
            self.events,
            stride,
            self._contacts.switching.rubbing,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of a run of the same system with the same tolerances."""
        s = snapshot
        self._laws, self._coming = list(s.laws), deque(s.coming)
        self._base = base_at(s.base, self._laws, s.turns)
        self._output.restart()
        self._start_base()
        self._state[:] = s.state
        self._ta.time = s.tau
        self._pars[self._stabilisation] = s.stabilisation
        self._gaps.set_modes(s.modes, s.approach)
        self._contacts.switching.set_rows(s.switches)
        self._contacts.switching.rubbing = s.rubbing
        if self._touches:
            self._touches.present = tuple(OngoingTouch(*touch) for touch in s.touches)
        self._gaps.horizon = s.horizon
        self._gaps.impacts.count, self._gaps.mode_changes = 0, []
        self._pending = None
        self._next_base = s.next_base
        self._last_event, self._simultaneous = s.last_event, s.simultaneous
        self.events = s.events
        self._leave_singular(_SINGULAR.beside)
        self._go_on()
        self._directions[:] = array('d', s.directions)
        self._since = s.since
        self._singular.stride = s.stride

    # --- the solution -------------------------------------------------------------------------

    def drain(self) -> tuple[Motion, list[Impact], list[ModeChange]]:
        """Motion and events since the last call."""
        impacts = self._gaps.impacts.drain()
        changes, self._gaps.mode_changes = self._gaps.mode_changes, []
        motion = self._output.drain()
        if self._touches:
            impacts += self._touches.add(motion)
        return motion, impacts, changes
