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
from collections.abc import Mapping, Sequence
from fractions import Fraction

from numpy.polynomial.polynomial import polyval

from mechanism_sim.engine.clock import base_at
from mechanism_sim.engine.compliant_contacts import OngoingTouch, Touches
from mechanism_sim.engine.contact.chatter import ChatterRule
from mechanism_sim.engine.contact_state import ContactState
from mechanism_sim.engine.contacts import Contacts
from mechanism_sim.engine.dense_output import DenseOutput, Motion, floats
from mechanism_sim.engine.drive_laws import DriveLaws
from mechanism_sim.engine.events import Impacts, ModeChange
from mechanism_sim.engine.integrators import Integrators
from mechanism_sim.engine.present_state import PresentState
from mechanism_sim.engine.singular import SingularPositions
from mechanism_sim.engine.snapshot import Snapshot, State
from mechanism_sim.engine.system import System
from mechanism_sim.engine.taylor_steps import PendingStep, TaylorSteps
from mechanism_sim.engine.thin_films import FilmWatch
from mechanism_sim.planar.drive import DriveLaw, Law, LawSource
from mechanism_sim.tolerances import TOLERANCES

_SINGULAR = TOLERANCES.singular
_STEPS = TOLERANCES.steps


class EventLoop:
    """Runs a system through flight, impact and following.

    Parameters
    ----------
    system : the compiled equations
    laws : one for each prescribed coordinate, then one for each powered coordinate
    state : initial state; open gaps that touch are resolved at once
    rtol : error per step relative to a tenth of the fastest drive's speed, at least 1 rad/s
    atol : [m] displacement that may be left out when chatter is ended
    max_step : [s] longest Taylor step
    compact : compile smaller but slower code (for many coordinates)
    fastest : [rad/s] reference speed of `rtol`; by default of the first laws or the state

    Attributes
    ----------
    films : prediction of the remaining steps, shortened by thin films
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
        self._system = system
        driven = [law.coefficients[1] for law in laws if isinstance(law, DriveLaw) and law.degree]
        turning = [v for v, angular in zip(state.v, system.angular, strict=True) if angular]
        known = [fastest] if fastest else driven or turning
        fastest = max((1.0, *map(abs, known)))
        speed = _STEPS.rate * fastest  # that errors are relative to
        self._integrators = Integrators(system, rtol, speed, compact)
        self._ta = self._integrators.main
        width = system.width
        self._state, self._pars = self._ta.state[:width], floats(self._ta.pars)
        self._state[:] = [*state.q, *state.v, *state.states]
        turns = dict(zip(system.free, state.turns, strict=True))
        self._output = DenseOutput(system, self._ta.order)
        rule = ChatterRule(rtol, atol, system.mechanism.size, system.mechanism.reach)
        self._present = PresentState(system, self._ta, base_at(state.time, laws, turns))
        self._gaps = ContactState(
            self._present, rule, rtol, fastest * system.mechanism.size,
            _STEPS.crowd * _STEPS.shortest * max_step,
        )  # fmt: skip
        self._contacts = Contacts(self._gaps)
        near = width + 1 + len(system.guards)  # after the state, the constant, what guards watch
        self._singular = SingularPositions(system, self._integrators, self._contacts, near)
        directions = floats(self._ta.state)[near + bool(system.relations) :]
        self._laws = DriveLaws(self._present, laws, directions)
        self._laws.count_from(state.time, turns)
        self.films = FilmWatch(self._present, self._laws)
        self._steps = TaylorSteps(
            self._laws,
            self._contacts,
            self._singular,
            self._output,
            self._integrators,
            max_step,
            _STEPS.defect * rtol * speed,
            _STEPS.stabilisation * fastest,
        )
        self._touches = Touches(system) if system.compliant else None
        self._pending: PendingStep | None = None
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
        self._pending = PendingStep(
            self._ta.time - h, h, guard, (0.0, self._steps.longest, 0.0), step.origin
        )
        return True

    def compile(self) -> None:
        """Compile all code that the run may need."""
        self._integrators.compile()

    @property
    def events(self) -> int:
        """Number of events since the start."""
        return self._gaps.stages.counts[2]

    @property
    def steps(self) -> int:
        """Number of steps since the start."""
        return self._output.count

    @property
    def time(self) -> float:
        """Time [s] up to which the solution is known."""
        tau = self._pending.tau if self._pending else self._ta.time
        return self._present.base.at(tau)

    @property
    def longest(self) -> float:
        """Longest step [s]."""
        return self._steps.longest

    def change_law(self, law: Law) -> None:
        """Announce a law that replaces that of its coordinate, see `DriveLaws.announce`."""
        self._laws.announce(law, self.time)

    def go_on_by(self, sources: Mapping[str, LawSource]) -> None:
        """Set sources of laws, by coordinate, for times without an announced law."""
        self._laws.go_on_by(sources)

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
        limit, tau = self._present.base.local(until), ta.time
        while len(lengths) < last:
            step = self._pending
            if step is None:
                tau, h = self._steps.follow(tau, limit, last, self._respond)
                if h is None:
                    continue
                step = self._steps.locate(tau, h)
            end = step.tau + step.h
            # a step beyond `until` stays pending, uncut: where callers look changes no run
            if end > min(limit, self._laws.next_change):
                self._pending = step
                if self._change_law(min(limit, end)):
                    limit, tau = self._present.base.local(until), 0.0
                    continue
                if end > limit:
                    # To its rounded time a run is there: no piece of less than its rounding.
                    if final and self.time < until:
                        self._cut(limit)
                    return
            self._pending = None
            tau = self._enter(step)
            # local times near zero keep all their digits, as do angles without their whole turns
            if end > self._laws.next_base:
                ta.time = end
                self._laws.rebase()
                self._go_on()
                limit, tau = self._present.base.local(until), 0.0
            if step.guard is not None and step.origin is not None:
                self._leave_singular(_SINGULAR.beside)
        ta.time = tau

    def _change_law(self, end: float) -> bool:
        """Cut the pending step where the next law begins, if it does before `end`."""
        change, pending = self._laws.next_change, self._pending
        if pending is None or not (change <= end and change < pending.tau + pending.h):
            return False
        self._cut(change)
        self._laws.switch()
        self._go_on()
        self._contacts.switching.pass_edges()
        self._contacts.settle()
        self._go_on()
        self._leave_singular(_SINGULAR.beside)
        return True

    def _enter(self, step: PendingStep) -> float:
        """Make a step part of the solution, and handle the event that ends it; return its end."""
        output, end = self._output, step.tau + step.h
        if step.h > 0.0:
            output.enter(step.tau, step.h)
            self._laws.since += 1
        if step.guard is not None:
            self._respond(step.guard, end)
        return end

    def _respond(self, guard: int | None, tau: float) -> None:
        """Handle the event at which a guard fell, at the end of the last step.

        Of events that a row of steps has counted there is none: what is left of the last is done.
        """
        self._ta.time = tau
        if guard is None:
            self._contacts.finish()
        else:
            earlier = self._gaps.stages.count(t := self._present.base.at(tau))
            self._integrators.expect(self.events)
            self._contacts.handle(guard, t, earlier)
        self._ta.reset_cooldowns()
        if self._gaps.status is not self._output.status:
            self._mark()

    def preview(self, until: float) -> Motion | None:
        """Solution up to `until` [s], from the step that `advance` to there has held back.

        It is the beginning of the next step, on the same polynomials: whatever law comes from
        `until` on cannot change it. None if the solution has come so far. To be called after
        `drain`.
        """
        if self._pending is None or self.time >= until:
            return None
        h = min(self._present.base.local(until) - self._pending.tau, self._pending.h)
        return self._output.peek(self._pending.tau, h) if h > 0.0 else None

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Set the coefficient of restitution of a joint from now on; KeyError if it has no gap."""
        self._contacts.change_restitution(joint, restitution)

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
        """Continue the integrator from a state that it did not reach by itself."""
        if self._system.guards:
            self._ta.reset_cooldowns()
        self._laws.turn(self._ta.time)
        self._mark()

    def _mark(self) -> None:
        """Set base and status of the steps entered from now on."""
        self._output.mark(self._present.base, self._gaps.status)

    # --- pauses -------------------------------------------------------------------------------

    @property
    def state(self) -> State:
        """The present state; after a call of `advance` with `final` that at its end."""
        f, tau, now = len(self._system.free), self._ta.time, self._state.tolist()
        if self._pending:  # a step that begins where the solution ends
            tau, now = self._pending.tau, self._output.next[:, 0].tolist()
        return State(
            self._present.base.time + Fraction(tau),
            tuple(self._present.base.turns[c] for c in self._system.free),
            tuple(now[:f]),
            tuple(now[f : 2 * f]),
            tuple(self._gaps.closed(i) for i in range(len(self._system.gaps))),
            tuple(now[2 * f :]),
        )

    def restart(self, state: State, laws: Sequence[Law] | None = None) -> None:
        """Begin anew from another state, under the present laws or others; nothing is compiled."""
        if laws is not None:
            self._laws.begin(laws)
        self._output.restart()
        self._state[:] = [*state.q, *state.v, *state.states]
        self._ta.time = 0.0
        self._pars[self._system.parameters.stabilisation] = 0.0
        self._pending = None
        turns = dict(zip(self._system.free, state.turns, strict=True))
        self._laws.count_from(state.time, turns)
        self._gaps.stages.counts = -math.inf, 0, 0
        self._integrators.expect(0)
        self._gaps.impacts.count, self._gaps.horizon = 0, math.inf
        if self._touches:
            self._touches.restart()
        self._begin(state)

    def snapshot(self) -> Snapshot:
        """Snapshot from which a run goes on as if there had been no pause.

        A step that is known but not yet part of the solution is taken anew then.
        """
        gaps, state, tau = self._gaps, self._ta.state, float(self._ta.time)
        alpha, horizon = self._pars[self._system.parameters.stabilisation], gaps.horizon
        stride = self._singular.stride
        if self._pending:
            tau, (alpha, horizon, stride) = self._pending.tau, self._pending.taken
            began = self._pending.origin
            state = self._ta.tc[:, 0] if began is None else began
        touches = self._touches.follow(self._output.motion())[0] if self._touches else ()
        last, simultaneous, events = gaps.stages.counts
        return Snapshot(
            '',
            self._present.base.time,
            tau,
            {c: self._present.base.turns[c] for c in self._system.free},
            tuple(state[: len(self._state)].tolist()),
            tuple(state[len(state) - len(self._laws.directions) :].tolist()),
            self._laws.since,
            gaps.modes,
            gaps.approach,
            self._present.rows,
            touches,
            alpha,
            horizon,
            self._laws.next_base,
            tuple(self._laws.laws),
            tuple(self._laws.coming),
            last,
            (simultaneous, events),
            stride,
            self._contacts.switching.rubbing,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of a run of the same system with the same tolerances."""
        s = snapshot
        laws = self._laws
        laws.restore(s.laws, s.coming)
        self._output.restart()
        laws.count_from(s.base, s.turns)
        self._state[:] = s.state
        self._ta.time = s.tau
        self._pars[self._system.parameters.stabilisation] = s.stabilisation
        self._gaps.set_modes(s.modes, s.approach)
        self._contacts.switching.set_rows(s.switches)
        self._contacts.switching.rubbing = s.rubbing
        if self._touches:
            self._touches.present = tuple(OngoingTouch(*touch) for touch in s.touches)
        self._gaps.horizon = s.horizon
        self._gaps.impacts.count = self._gaps.changes.count = 0
        self._pending = None
        laws.next_base = s.next_base
        self._gaps.stages.counts = s.last_event, *s.events
        self._integrators.expect(self.events)
        self._leave_singular(_SINGULAR.beside)
        self._go_on()
        laws.directions[:] = array('d', s.directions)
        laws.since = s.since
        self._singular.stride = s.stride

    # --- the solution -------------------------------------------------------------------------

    def drain(self) -> tuple[Motion, Impacts, list[ModeChange]]:
        """Motion and events since the last call."""
        impacts, changes = self._gaps.impacts.drain(), self._gaps.changes.drain()
        motion = self._output.drain()
        if self._touches:
            impacts = Impacts.joined([impacts, self._touches.add(motion)])
        return motion, impacts, changes
