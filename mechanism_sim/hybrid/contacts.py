"""Contact transitions at an event: impact, sticking, sliding, separation.

One set of equations with a flag for each gap serves every pattern of contact: the pattern changes
by parameters, and nothing is compiled at an event. Compliant contacts run by the same flags: with
an event at the touch all pieces are smooth, where friction smoothed over a slip would be stiff.

An event goes `handle` -> `_respond` -> `_resolve`, and from there to an impact (`_collide`), to
contacts without normal speed (`resting_contacts.rest`), or to a change of one mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

import numpy as np

from mechanism_sim.contact.chatter import remaining_time
from mechanism_sim.contact.problem import LOSS, horizon_of, impact_now
from mechanism_sim.hybrid.compliant_events import initialise_rates, is_leaving, touch_or_part
from mechanism_sim.hybrid.contact_state import SLIDING, ContactState, chosen
from mechanism_sim.hybrid.events import Mode, ModeChange
from mechanism_sim.hybrid.frictional_shocks import is_jammed, stop_jammed_slide
from mechanism_sim.hybrid.guards import Guard
from mechanism_sim.hybrid.present_state import rate_of
from mechanism_sim.hybrid.resting_contacts import rest, separate
from mechanism_sim.hybrid.rubbing_contacts import add_joint_friction
from mechanism_sim.hybrid.switching import Switching
from mechanism_sim.numerics.kernels import charge
from mechanism_sim.planar.switches import HOLDS
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts
_IMPACTS = TOLERANCES.impacts
_ROUNDING = TOLERANCES.rounding


class Contacts:
    """Resolves events: what became of gaps, switches and friction when a guard fell.

    Parameters
    ----------
    state : the contacts at the integrator's present state
    """

    def __init__(self, state: ContactState) -> None:
        self.state, self.present = state, state.present
        self.switching = Switching(state.present, state.problem)
        self._system = state.present.system

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Let impacts in all gaps of a joint have another coefficient.

        Raises
        ------
        KeyError
            If the joint has no gap.
        """
        own = [i for i, gap in enumerate(self._system.gaps) if gap.joint == joint]
        for i in own:
            self.state.problem.restitution[i] = restitution
        if not own:
            raise KeyError(joint)

    # --- the start ----------------------------------------------------------------------------

    def start(self, closed: Sequence[bool]) -> None:
        """Begin a run: some gaps are closed by decree, those that touch are resolved."""
        state, slipping = self.state, self._system.set_valued.slipping
        if self._system.switches:
            self.switching.find_rows()
            self.switching.pass_edges()
        if slipping:
            self.switching.sides = (1.0,) * len(self._system.parameters.sides)
            if not state.modes:
                self._begin_to_rub()
        state.set_modes((int(Mode.FREE_FLIGHT),) * len(closed))
        if any(closed):
            state.refresh()
            modes = zip(closed, state.modes, strict=True)
            state.set_modes(
                tuple(
                    int(state.mode_of_closed(i)) if shut else mode
                    for i, (shut, mode) in enumerate(modes)
                )
            )
            if self._system.compliant:
                initialise_rates(state)
        if any(closed) or self._system.relations:
            self.present.project()
        self.settle()
        if state.modes and slipping:
            self._begin_to_rub()
        state.mode_changes = [
            ModeChange(self.present.time, name, Mode(mode), Mode.UNKNOWN)
            for name, mode in zip(state.names, state.modes, strict=True)
        ]

    def _begin_to_rub(self) -> None:
        """Note what presses on ideal joints that rub, and what holds there."""
        self.switching.update_sides()
        for k in range(len(self._system.parameters.towards) // 2):
            self.switching.update_pin_direction(k)
        self.switching.hold_or_slide(self._system.set_valued.slipping)
        self._respond_to_missed()

    def settle(self) -> None:
        """Resolve the gaps that touch without an event having said so."""
        state = self.state
        if not state.modes:
            return
        if self._system.compliant:
            self._respond_to_missed()
            return
        terms = state.terms()
        for i, (value, rate) in enumerate(zip(terms.value, terms.rate, strict=False)):
            # as good as resting is what would rise no farther than rounding reaches
            stays = rate <= 0.0 or state.rule.ends(rate, terms.acceleration[i], 1.0, -value)
            if state.closed(i) or (value <= state.limits.touching and stays):
                self._collide(i)
                return

    # --- events -------------------------------------------------------------------------------

    def handle(self, guard: int) -> None:
        """A guard fell through zero."""
        found, count = self._system.guards[guard], len(self._system.guards)
        if self.state.flies_free and found.gap >= 0 and self._bounce(found.gap):
            if self._system.set_valued.holding:
                self.switching.release()
            if count == len(self.state.modes):
                return
        else:
            began = perf_counter()
            self._respond(found)
            charge(perf_counter() - began)
        if count > 1:
            self._respond_to_missed()

    def _respond_to_missed(self) -> None:
        for _ in self._system.guards:
            guard = self.missed_event()
            if guard is None:
                break
            self._respond(self._system.guards[guard])

    def _respond(self, guard: Guard) -> None:
        """Resolve an event while switches that hold act with the parts they have now."""
        rows = self.switching.rows
        held = [k for k in self._system.set_valued.holding if rows[k] == HOLDS]
        if held:
            self.switching.freeze(held)
        self._resolve(guard)
        if held and guard.switch is None:
            self.switching.release()

    def _resolve(self, guard: Guard) -> None:
        """Tell apart by its guard what happened."""
        state, gap = self.state, guard.gap
        if guard == Guard(-1, 0):
            raise self.switching.jammed_joints()
        if guard.pin is not None:
            self.switching.update_pin_direction(guard.pin)
        elif guard.side is not None:
            index = self._system.parameters.sides[guard.side]
            self.present.pars[index] = -self.present.pars[index]
        elif guard.switch is not None:
            self._turn_over(guard.switch)
        elif self._system.compliant:
            self._change_compliant(guard)
        elif guard.friction:
            self._change_friction(guard)
        elif state.closed(gap):
            self._lift_off(gap)
        elif state.rated[gap]:  # no impact: its rate is zero
            at = state.problem.closed | state.mask([gap])
            rest(state, self.switching, at, at)
        else:
            self._collide(gap)

    def _lift_off(self, gap: int) -> None:
        """A closed contact opens."""
        before = self.state.modes
        self.state.change(gap, Mode.FREE_FLIGHT)
        separate(self.state, [gap])
        self.state.record_modes(before)

    def _turn_over(self, switch: int) -> None:
        """A switch passes to its next row: contacts may be off zero from now on."""
        self.switching.turn_over(switch)
        if self._system.relations and not self.present.singular_joints():
            self.present.project()  # another closure may hold from now on
        if any(map(self.state.closed, range(len(self.state.modes)))):
            steps = self._system.frictional or self._system.dynamics.rubs
            if steps or self._jumps:  # a gap may close faster from now on
                self.settle()
            else:
                self.present.project()

    @property
    def _jumps(self) -> bool:
        """True if a closed gap moves, more than by a step's error."""
        count, state = len(self._system.guards), self.state
        seen = self.present.evaluate(self._system.functions.watch).tolist()
        rates = zip(state.modes, seen[count:], strict=False)
        return any(abs(x) > state.limits.still for mode, x in rates if mode > Mode.FREE_FLIGHT)

    def _change_compliant(self, guard: Guard) -> None:
        """A compliant contact touches, parts or recovers, or its friction changes."""
        state, gap, before = self.state, guard.gap, self.state.modes
        if not guard.friction or is_leaving(state, gap):
            touch_or_part(state, gap)
        elif state.modes[gap] == Mode.STICKING:
            # corners that stick to one wall together may creep meanwhile
            state.refresh()
            state.change(gap, SLIDING[state.slip(gap) or -guard.friction])
        else:
            state.change(gap, Mode.STICKING)
            self.present.project()
        state.record_modes(before)

    def _change_friction(self, guard: Guard) -> None:
        """Sticking gives way, or sliding ends or jams."""
        state, gap, before = self.state, guard.gap, self.state.modes
        at = state.problem.closed.copy()
        closed = chosen(at)
        if before[gap] == Mode.STICKING:
            state.change(gap, SLIDING[-guard.friction])
            if is_jammed(state, closed):
                state.set_modes(before)
                rest(state, self.switching, at, at, given={gap: -guard.friction})
            else:
                state.record_modes(before)
        elif guard.friction < 0:
            state.refresh()
            if state.slip(gap):
                stopped = state.mask(stop_jammed_slide(state, closed, gap))
                rest(state, self.switching, stopped, at)
            else:  # nothing to be stopped
                self._lift_off(gap)
        else:
            rest(state, self.switching, at, at)
            if state.modes == before:
                self._hold_slip(gap)

    def _hold_slip(self, gap: int) -> None:
        """Let a slip count as none that has ended and goes nowhere, for other contacts hold it.

        Where two corners of a block rest on one line, the friction of one may be at its bound
        while the other sticks: then its slip is zero but for rounding, which would fall through
        zero for ever. A hair within the bound, friction has no slip to watch.
        """
        c, m = self.state.problem, len(self.state.modes)
        least = _ROUNDING.acceleration * float(np.abs(c.free_acceleration).max(initial=0.0))
        if abs(c.acceleration[m + gap]) <= least:
            self.state.scale_slip(gap, 1.0 - _CONTACTS.held_slip)

    def missed_event(self, seen_now: int | None = None) -> int | None:
        """A guard which is past zero already: the integrator would never see it fall.

        That happens where a step ends within its error of an event. Beside the guard that is
        `seen_now`, others count only beyond what falls at the same instant.
        """
        state, system = self.state, self._system
        seen = self.present.evaluate(system.functions.watch).tolist()
        modes, floors, limits = state.modes, state.floors, state.limits
        if system.lone:  # one gap without friction, the common case
            fell = seen[0] <= 0.0 and (modes[0] > 1 or seen[1] < 0.0)  # 1: free flight
            return 0 if fell and seen_now is None else None
        count = len(floors)
        margin = 0.0 if seen_now is None else limits.touching
        if system.compliant:  # both factors of its guard may have fallen in one step
            for i, value in enumerate(seen[count + len(modes) : count + 2 * len(modes)]):
                # what parts from a depth of roundings is through before the next step can tell
                parts = seen[count + i] > limits.still
                ended = value > margin - (limits.touching if parts else 0.0)
                if modes[i] > 1 and ended and i != seen_now:
                    return i
        if min(seen[:count]) > 0.0:
            return None
        for i, (x, floor) in enumerate(zip(seen, floors, strict=False)):
            if i < len(modes) and modes[i] == 1:
                least = max(margin, limits.bare) if state.rated[i] else margin
                if x <= -least and seen[count + i] < 0.0 and i != seen_now:
                    return i
                continue
            least = floor if seen_now is None else _CONTACTS.same_instant * (floor - margin)
            beyond = x <= least
            if beyond and i != seen_now and not self.switching.leads_back(system.guards[i].switch):
                return i
        return None

    # --- impacts ------------------------------------------------------------------------------

    def _collide(self, gap: int) -> None:
        """Impact in `gap` and in all others that touch; then those at rest are sorted out."""
        state, log, present = self.state, self.state.impacts, self.present
        log.reserve(len(state.modes))
        state.refresh()
        rubs = self._system.dynamics.rubs
        rubbed = add_joint_friction(state, self.switching, gap) if rubs else 0.0
        first, marks = log.count, state.marks
        done = impact_now(
            state.arrays,
            state.limits,
            gap,
            present.instant(),
            log.rows,
            log.count,
            marks.touching,
            marks.resting,
        )
        if not done.found:
            raise ArithmeticError('no impulses satisfy all contacts of this instant')
        log.count = done.entered
        if rubbed and log.count > first:
            log.rows[first, LOSS] += rubbed
        state.horizon = min(state.horizon, done.horizon)
        if done.rests:
            rest(state, self.switching, marks.resting, marks.touching)

    def _bounce(self, i: int) -> bool:
        """Impact of a gap without friction while all fly: `_collide` without its bookkeeping.

        False, and nothing is done, if another gap might touch at the same instant.
        """
        state, present, limits = self.state, self.present, self.state.limits
        f, m, e = present.free, len(state.modes), float(state.problem.restitution[i])
        terms = present.evaluate(self._system.functions.contact_function).tolist()
        if m > 1 and any(x <= limits.tie and k != i for k, x in enumerate(terms[:m])):
            return False
        # as `problem_of` tells them apart
        value, rate, acceleration = terms[i], min(terms[m + i], 0.0), terms[3 * m + i]
        response = 4 * m + i * f
        compliance = 4 * m + m * f + i * (m + 1)
        drive, driven = 4 * m + m * (f + m), len(present.base.laws)
        stop = state.rule.ends(-e * rate, acceleration, e, -value)
        after = 0.0 if stop else -e * rate
        p = (after - rate) / terms[compliance]
        if p > 0.0:
            for k in range(f):
                present.state[f + k] += terms[response + k] * p
            impulse = work = 0.0
            for k, law in enumerate(present.base.laws):
                x = terms[drive + i * driven + k] * p
                impulse += x
                work += x * rate_of(law, present.integrator.time)
            left = remaining_time(-e * rate, acceleration, e) if stop else 0.0
            angle = terms[drive + m * driven + i]
            loss = -0.5 * (rate + after) * p
            state.impacts.enter(
                (present.time, i, angle, -rate, after, p, 0.0, loss, impulse, work, stop, left)
            )
        state.horizon = min(state.horizon, horizon_of(after, acceleration))
        if after <= -_IMPACTS.rebound * rate:
            only = state.mask([i])
            rest(state, self.switching, only, only)
        return True
