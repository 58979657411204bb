"""The one event loop: Taylor steps between events, and what is done at each event.

A step is never cut to please a caller: requests read the step's polynomials. What is published,
and when, therefore cannot change the motion.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval

from mechanism_sim.contact.chatter import ChatterRule
from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.clock import base_at, take_off_turns
from mechanism_sim.hybrid.contacts import Contacts
from mechanism_sim.hybrid.events import Impact, ModeChange, StopReason
from mechanism_sim.hybrid.snapshot import Snapshot, State
from mechanism_sim.hybrid.system import System
from mechanism_sim.hybrid.tape import Motion, Tape, floats
from mechanism_sim.planar.drive import DriveLaw, Law

_MAX_SIMULTANEOUS = 100
_SHORTER = 0.37  # off the powers of two, at which the search for roots bisects
_SHORTEST = 1e-12
_NEAR = 0.05  # of a step: roots nearer to its start may get lost


class _Pending(NamedTuple):
    """A step that is known but not yet part of the solution."""

    tau: float  #: [s] where it begins
    h: float  #: [s]
    guard: int | None  #: that ended it
    taken: tuple[float, float]  #: with which stabilisation [1/s] and longest step [s]


class EventLoop:
    """Runs a system through flight, impact and following.

    Parameters
    ----------
    system : the compiled equations
    laws : one for each prescribed coordinate, then one for each powered coordinate
    state : where to start; open gaps that touch are resolved at once
    rtol : error per step relative to the fastest drive's speed, at least 1 rad/s
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
        fastest = max(1.0, *map(abs, known))
        self._fired: list[int] = []
        self._ta = system.integrator(rtol, fastest, self._fired.append, compact)
        f, width = len(system.free), self._ta.order + 1
        self._state, self._pars = self._ta.state[: 2 * f], self._ta.pars
        series = floats(self._ta.tc)
        self._coefficients = series[: 2 * f * width]
        self._guard_series = series[-width:] if system.lone else series[:0]
        self._step = self._ta.step
        self._stabilisation = system.stabilisation_index
        self._state[:] = [*state.q, *state.v]
        turns = dict(zip(system.free, state.turns, strict=True))
        self._base = base_at(state.time, self._laws, turns)
        self._tape = Tape(system, self._ta.order)
        self._contacts = Contacts(
            system,
            self._ta,
            ChatterRule(rtol, atol, system.mechanism.size),
            self._base,
            rtol,
            fastest * system.mechanism.size,
        )
        self._start_base()
        self._pending: _Pending | None = None
        self._last_event = float('-inf')
        self._simultaneous = 0
        self._contacts.start(state.closed)

    @property
    def steps(self) -> int:
        """Number of steps since the start."""
        return self._tape.count

    @property
    def time(self) -> float:
        """Time [s] up to which the solution is known."""
        tau = self._pending.tau if self._pending else self._ta.time
        return self._base.at(tau)

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
        contacts, tape, ta, step = self._contacts, self._tape, self._ta, self._step
        coefficients, pars, fired = self._coefficients, self._pars, self._fired
        slots, entries, longest = tape.slots, tape.entries, self._max_step
        reach = min(longest, contacts.horizon)
        limit = self._base.local(until)
        watched, lone = bool(contacts.modes), self._system.lone
        watch = self._guard_series  # the derivative of its state is the guard
        stabilisation, alpha = self._stabilisation, float(pars[self._stabilisation])
        last = len(entries) + most if most is not None else math.inf
        pending = self._pending
        while len(entries) < last:
            if pending is None:
                tau = ta.time = ta.time  # heyoka keeps what a float of time rounds away: drop it
                taken = (alpha, reach)
                h = step(reach, True)[1]
                guard = fired.pop() if fired else None
                if lone:
                    start, slope = watch[1], watch[2]
                    if start < _NEAR * h * abs(slope):
                        if start < 0.0 and slope < 0.0:
                            # it fell within the error of the last step's end
                            self._back_to(tau)
                            h, guard = 0.0, 0
                        else:
                            h, guard = self._look_again(tau, h, guard)
                elif watched:
                    h, guard = self._look_again(tau, h, guard)
                if not h > 0.0 and guard is None:
                    raise self._breakdown(tau)
                slots[len(entries)][:] = coefficients
                if guard is None and (h < reach or reach is longest):
                    alpha = pars[stabilisation] = 1.0 / h
                if reach is not longest:
                    reach, contacts.horizon = longest, math.inf
                end = tau + h
            else:
                tau, h, guard, taken = pending
                end = tau + h
            if end > limit or self._coming:
                pending = self._pending = _Pending(tau, h, guard, taken)
                change = self._base.local(self._coming[0].valid_from) if self._coming else math.inf
                if change <= limit and change < end:
                    self._cut(change)
                    self._switch_law(self._coming.popleft())
                    pending, limit = None, self._base.local(until)
                    continue
                if end > limit:
                    if final:
                        self._cut(limit)
                    return
            if pending is not None:
                pending = self._pending = None
            if h > 0.0:
                entries.append((tau, h, contacts.status, tape.base))
                if len(entries) == len(slots):
                    tape.grow()
            if guard is not None:
                self._count_event()
                contacts.handle(guard)
                self._forget_events()
                reach = min(longest, contacts.horizon)
            if end > self._next_base:
                self._rebase()
                limit = self._base.local(until)

    def _look_again(self, tau: float, h: float, guard: int | None) -> tuple[float, int | None]:
        """Length and guard of a step, taken anew where it overlooked an event.

        The search for the roots of a guard gives up where one lies much nearer to the start of a
        step than to its end, or on the point where it bisects; and the root of a step that ends
        within its own error of an impact lies just behind it.
        """
        fired, fallen = self._fired, self._overlooked(guard)
        while fallen is not None and h > _SHORTEST * self._max_step:
            self._back_to(tau)
            h = self._step(_SHORTER * h, True)[1]
            guard = fired.pop() if fired else None
            fallen = self._overlooked(guard)
        return h, guard if fallen is None or guard is not None else fallen

    def _overlooked(self, guard: int | None) -> int | None:
        """A guard beyond whose fall a step came to its end, seen by `guard` or by none."""
        if guard is None or len(self._system.guards) > 1:
            return self._contacts.fallen(guard)
        return None

    def _back_to(self, tau: float) -> None:
        """Undo the last step, which began at `tau`."""
        self._state[:] = self._ta.tc[: len(self._state), 0]
        self._ta.time = tau
        self._forget_events()

    def _breakdown(self, tau: float) -> RunError:
        return RunError(
            f'the integration broke down at t = {self._base.high + tau:.9g} s: the state '
            'became infinite; the mechanism may be at a singular position'
        )

    def _cut(self, at: float) -> None:
        """End the pending step early, at local time `at`, on its own polynomials."""
        if self._pending:
            tau, tape, self._pending = self._pending.tau, self._tape, None
            self._state[:] = polyval(at - tau, tape.next.T)
            if at > tau:
                tape.entries.append((tau, at - tau, self._contacts.status, tape.base))
                if len(tape.entries) == len(tape.slots):
                    tape.grow()
        self._ta.time = at
        self._forget_events()

    def _forget_events(self) -> None:
        """Let the integrator search for events from here as if there had been none."""
        if self._system.guards:
            self._ta.reset_cooldowns()

    def _count_event(self) -> None:
        self.events += 1
        t = self.time
        self._simultaneous = self._simultaneous + 1 if t == self._last_event else 0
        self._last_event = t
        if self._simultaneous > _MAX_SIMULTANEOUS:
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
        self._contacts.settle()

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

    def _start_base(self) -> None:
        for index, law in zip(self._system.law_index, self._base.laws, strict=True):
            self._pars[index[: len(law)]] = law
            self._pars[index[len(law) :]] = 0.0
        for index, torque in zip(self._system.torque_index, self._base.torques, strict=True):
            self._pars[index] = torque
        self._contacts.base = self._base
        self._tape.rebase(self._base)
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
            tuple(self._contacts.closed(i) for i in range(len(self._system.gaps))),
        )

    def restart(self, state: State) -> None:
        """Begin anew from another state, under the present laws, without compiling anything."""
        self._tape.restart()
        turns = dict(zip(self._system.free, state.turns, strict=True))
        self._base = base_at(state.time, self._laws, turns)
        self._state[:] = [*state.q, *state.v]
        self._ta.time = 0.0
        self._pars[self._stabilisation] = 0.0
        self._pending = None
        self._start_base()
        self._forget_events()
        self._last_event, self._simultaneous, self.events = float('-inf'), 0, 0
        self._contacts.impacts, self._contacts.horizon = [], math.inf
        self._contacts.start(state.closed)

    def snapshot(self) -> Snapshot:
        """What it takes to go on as if there had been no pause.

        A step that is known but not yet part of the solution is taken anew then.
        """
        contacts, state, tau = self._contacts, self._state, float(self._ta.time)
        alpha, horizon = float(self._pars[self._stabilisation]), contacts.horizon
        if self._pending:
            tau, (alpha, horizon) = self._pending.tau, self._pending.taken
            state = self._tape.next[:, 0]
        return Snapshot(
            '',
            self._base.time,
            tau,
            {c: self._base.turns[c] for c in self._system.free},
            tuple(state.tolist()),
            contacts.modes,
            contacts.approach,
            alpha,
            horizon,
            self._next_base,
            tuple(self._laws),
            tuple(self._coming),
            self._last_event,
            self._simultaneous,
            self.events,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of a run of the same system with the same tolerances."""
        s = snapshot
        self._laws, self._coming = list(s.laws), deque(s.coming)
        self._base = base_at(s.base, self._laws, s.turns)
        self._tape.restart()
        self._start_base()
        self._state[:] = s.state
        self._ta.time = s.tau
        self._forget_events()
        self._pars[self._stabilisation] = s.stabilisation
        self._contacts.set_modes(s.modes, s.approach)
        self._contacts.horizon = s.horizon
        self._contacts.impacts, self._contacts.mode_changes = [], []
        self._pending = None
        self._next_base = s.next_base
        self._last_event, self._simultaneous = s.last_event, s.simultaneous
        self.events = s.events

    # --- the solution -------------------------------------------------------------------------

    def drain(self) -> tuple[Motion, list[Impact], list[ModeChange]]:
        """Motion and events since the last call."""
        contacts = self._contacts
        impacts, contacts.impacts = contacts.impacts, []
        changes, contacts.mode_changes = contacts.mode_changes, []
        return self._tape.drain(), impacts, changes
