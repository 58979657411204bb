"""Contact transitions at an event: impact, sticking, sliding, separation.

One set of equations with a flag for each gap serves every pattern of contact: the pattern changes
by parameters, and nothing is compiled at an event. Compliant contacts run by the same flags: with
an event at the touch all pieces are smooth, where friction smoothed over a slip would be stiff.

An event of gaps that are rigid is resolved by `contact.respond`, which asks for functions of the
state as it goes; `_go_on` evaluates them. Switches, friction in ideal joints and compliant
contacts are resolved here.
"""

from __future__ import annotations

from collections.abc import Sequence

from mechanism_sim.engine.compliant_events import initialise_rates, is_leaving, touch_or_part
from mechanism_sim.engine.contact.chatter import ends
from mechanism_sim.engine.contact.problem import DRIVE, LOSS, WORK, T
from mechanism_sim.engine.contact.respond import (
    BESIDE,
    DONE,
    FELL,
    GIVEN,
    GUARD,
    JAMMED,
    RESTS,
    SHOCK,
    SLIP,
    SLIPS,
    STAGE,
    STRIKES,
    UNSOLVED,
    WATCHED,
)
from mechanism_sim.engine.contact_state import SLIDING, ContactState, chosen
from mechanism_sim.engine.contacts_with_joint_friction import (
    add_joint_friction,
    iterate_friction_modes,
    set_trial_modes,
)
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.frictional_shocks import stop_jammed_slide, unjam
from mechanism_sim.engine.guards import Guard
from mechanism_sim.engine.switching import Switching, jammed_joints
from mechanism_sim.errors import RunError
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts


class Contacts:
    """Resolves events: transitions of gaps, switches and friction when a guard fell.

    Parameters
    ----------
    state : the contacts at the integrator's present state
    """

    def __init__(self, state: ContactState) -> None:
        self.state, self.present = state, state.present
        self.switching = Switching(state.present, state.problem)
        self._system = state.present.system
        #: whether `contact.respond` resolves every event of this system
        self._resolves_all = bool(state.run.counters[WATCHED])

    def change_restitution(self, joint: str, restitution: float) -> None:
        """Set the coefficient of restitution of all gaps of a joint; KeyError if it has none."""
        own = [i for i, gap in enumerate(self._system.gaps) if gap.joint == joint]
        for i in own:
            self.state.problem.restitution[i] = restitution
        if not own:
            raise KeyError(joint)

    # --- the start ----------------------------------------------------------------------------

    def start(self, closed: Sequence[bool]) -> None:
        """Begin a run: set the contacts that start closed, and resolve those that touch."""
        state, slipping = self.state, self._system.set_valued.slipping
        if self._system.switches:
            self.switching.find_rows()
            self.switching.pass_edges()
        if slipping:
            self.switching.sides = (1.0,) * len(self._system.parameters.sides)
            if not state.modes:
                self._initialise_joint_friction()
        state.set_modes((int(Mode.FREE_FLIGHT),) * len(closed))
        if any(closed):
            state.refresh()
            for i, shut in enumerate(closed):
                if shut:
                    state.change(i, state.mode_of_closed(i))
            if self._system.compliant:
                initialise_rates(state)
        if any(closed) or self._system.relations:
            self.present.project()
        if state.modes:  # else what holds by its part would push contacts apart by all of it
            loads = (k for k in self._system.set_valued.holding if k not in slipping)
            self.switching.hold_or_slide([*loads])
        self.settle()
        if state.modes and slipping:
            self._initialise_joint_friction()
        state.changes.count = 0
        for gap, mode in enumerate(state.modes):
            state.changes.enter(self.present.time, gap, mode, Mode.UNKNOWN)

    def _initialise_joint_friction(self) -> None:
        """Initialise friction in ideal joints: sides, directions, and holding."""
        self.switching.update_sides()
        for k in range(len(self._system.parameters.towards) // 2):
            self.switching.update_pin_direction(k)
        self.switching.hold_or_slide(self._system.set_valued.slipping)
        self._respond_to_missed()

    def settle(self) -> None:
        """Resolve the gaps that touch without an event."""
        state = self.state
        if not state.modes:
            return
        if self._system.compliant:
            self._respond_to_missed()
            self._touch_at_rest()
            return
        held = self.switching.freeze()
        terms = state.terms()
        for i, (value, rate) in enumerate(zip(terms.value, terms.rate, strict=False)):
            # as good as resting is what would rise no farther than rounding reaches
            stays = rate <= 0.0 or ends(state.rule.resolved, rate, terms.acceleration[i], -value)
            if state.closed(i) or (value <= state.limits.touching and stays):
                state.begin_event(self.present.time)
                self._go_on(STRIKES, i)
                break
        if held:
            self._release()

    def _touch_at_rest(self) -> None:
        """Begin the contact of compliant gaps that touch, and are pressed together from rest.

        They are at zero but for rounding: from below it, a guard never falls through zero.
        """
        state = self.state
        for i in range(len(state.modes)):
            terms = state.terms()
            rests = abs(terms.value[i]) <= state.limits.touching and terms.rate[i] <= 0.0
            if rests and not state.closed(i) and terms.acceleration[i] < 0.0:
                touch_or_part(state, i)

    # --- events -------------------------------------------------------------------------------

    def handle(self, guard: int, t: float, earlier: int) -> None:
        """Resolve a guard's zero crossing at a time [s], after `earlier` ones at this instant."""
        found = self._system.guards[guard]
        self.state.begin_event(t, earlier)
        self._respond(found, guard)
        if not self._resolves_all and len(self._system.guards) > 1:
            self._respond_to_missed()

    @property
    def in_rows(self) -> bool:
        """True if rows of steps may resolve events of gaps: nothing else has a part in them."""
        rubs = self._system.dynamics.frictional_joints or self._system.set_valued.holding
        return not (rubs or self._system.compliant)

    def finish(self) -> None:
        """Finish the event that a row of steps has begun to resolve."""
        counters = self.state.stages.counters
        if counters[STAGE] != BESIDE:
            self._go_on(counters[STAGE], counters[GUARD])
        if not self._resolves_all and len(self._system.guards) > 1:
            self._respond_to_missed()

    def _respond_to_missed(self) -> None:
        self.state.begin_event(self.present.time)
        for _ in self._system.guards:
            guard = self.missed_event()
            if guard is None:
                break
            self._respond(self._system.guards[guard], guard)

    def _respond(self, guard: Guard, index: int) -> None:
        """Resolve an event while holding switches act with their present parts."""
        if self._resolves_all:
            self._go_on(FELL if index < len(self.state.modes) else SLIPS, index)
            return
        held = self.switching.freeze()
        self._resolve(guard, index)
        if held and guard.switch is None:
            self._release()

    def _release(self) -> None:
        """End the holding of switches whose motion contacts move, or hold themselves.

        The friction of a contact that sticks to a link held by a switch is not determined: the
        contact is set to slide in the direction of its acceleration, at zero slip.
        """
        state, m = self.state, len(self.state.modes)
        for i in range(m):
            if state.modes[i] != Mode.STICKING or self.switching.idle() is None:
                continue
            before = state.modes
            state.change(i, Mode.SLIDING_FORWARD)
            if self.switching.idle() is None:
                self.switching.freeze()
                state.refresh()
                if state.problem.acceleration[m + i] < 0.0:
                    state.change(i, Mode.SLIDING_BACKWARD)
                state.record_modes(before)
            else:
                state.set_modes(before)
        # the work of an impulse that follows an impact belongs to that impact
        stopped, log = self.switching.release(), self.state.impacts
        if log.count and log.rows[log.count - 1, T] == self.present.time:
            log.rows[log.count - 1, [DRIVE, WORK, LOSS]] += stopped

    def _resolve(self, guard: Guard, index: int) -> None:
        """Dispatch an event by its guard."""
        if guard == Guard(-1, 0):
            raise jammed_joints(self.present)
        if guard.pin is not None:
            self.switching.update_pin_direction(guard.pin)
        elif guard.side is not None:
            side = self._system.parameters.sides[guard.side]
            self.present.pars[side] = -self.present.pars[side]
        elif guard.switch is not None:
            self._turn_over(guard.switch)
        elif self._system.compliant:
            self._change_compliant(guard)
        else:
            self._go_on(FELL if index < len(self.state.modes) else SLIPS, index)

    def _go_on(self, stage: int, guard: int) -> None:
        """Resolve an event of a gap, from a stage on."""
        state, jams = self.state, _CONTACTS.jams
        while stage != DONE:
            if stage == JAMMED:
                stage, jams = unjam(state, jams), jams - 1
            elif stage == SHOCK:
                gap = self._system.guards[guard].gap
                closed = chosen(state.problem.closed)
                state.resting[:] = state.mask(stop_jammed_slide(state, closed, gap))
                stage = RESTS
            elif stage == UNSOLVED:
                struck = dict.fromkeys(self._system.gaps[i].joint for i in chosen(state.touching))
                raise RunError(
                    f'at t = {self.present.time:.9g} s no impulses satisfy all contacts that '
                    f'touch: {", ".join(struck)} bear against drives, or one another'
                )
            else:
                frictional = bool(self._system.dynamics.frictional_joints)
                stage = (self._beside_joints if frictional else state.stages.resolve)(stage, guard)
                guard = state.stages.fallen
                if state.stages.changed:
                    state.adopt_modes()

    def _beside_joints(self, stage: int, guard: int) -> int:
        """Stages of an event, as `EventStages.go_on`, where joint friction depends on contacts."""
        state, log, switching = self.state, self.state.impacts, self.switching
        state.stages.see(stage)
        if stage == STRIKES:
            first, lost = log.count, add_joint_friction(state, guard)
            stage = state.stages.go_on(stage, guard)
            if lost and log.count > first:
                log.rows[first, LOSS] += lost
            return stage
        if stage == RESTS and not iterate_friction_modes(
            state, switching, state.resting, state.touching, state.run.gaps[GIVEN]
        ):
            set_trial_modes(state, switching, state.mode_array)
            given, state.run.gaps[GIVEN] = state.run.gaps[GIVEN].any(), 0
            return RESTS if given else JAMMED
        return state.stages.go_on(stage, guard)

    def _turn_over(self, switch: int) -> None:
        """Move a switch to its next row: contacts may be off zero from now on."""
        self.switching.turn_over(switch)
        if self._system.relations and not self.present.singular_joints():
            self.present.project()  # another closure may hold from now on
        if any(map(self.state.closed, range(len(self.state.modes)))):
            steps = self._system.frictional or self._system.dynamics.frictional_joints
            if steps or self._jumps:  # a gap may close faster from now on
                self.settle()
            else:
                self.present.project()

    @property
    def _jumps(self) -> bool:
        """True if a closed gap has a rate beyond a step's error."""
        count, state = len(self._system.guards), self.state
        seen = self.present.evaluate(self._system.functions.watch).tolist()
        rates = zip(state.modes, seen[count:], strict=False)
        return any(abs(x) > state.limits.still for mode, x in rates if mode > Mode.FREE_FLIGHT)

    def _change_compliant(self, guard: Guard) -> None:
        """Resolve an event of a compliant contact: contact, recovery, separation, friction."""
        state, gap, before = self.state, guard.gap, self.state.modes
        if not guard.friction or is_leaving(state, gap):
            touch_or_part(state, gap)
        elif state.modes[gap] == Mode.STICKING:
            # corners that stick to one wall together may creep meanwhile
            state.refresh()
            state.change(gap, SLIDING[state.slip(gap) or -guard.friction])
        else:
            self._end_slip(gap)
        if before[gap] == Mode.STICKING and (idle := self._idle):  # the others rest anew
            state.refresh()
            for i in idle:
                state.change(i, state.mode_of_closed(i))
            self.present.project()
        state.record_modes(before)

    @property
    def _idle(self) -> list[int]:
        """Contacts that leave their friction to others that stick, see `problem.turn_idle`."""
        modes = enumerate(self.state.modes)
        return [i for i, x in modes if x == Mode.FOLLOWING and self.state.problem.friction[i]]

    def _end_slip(self, gap: int) -> None:
        """End the slide of a compliant contact.

        One that is idle from now on stays at its bound if others cannot take its friction.
        """
        state, way = self.state, Mode(self.state.modes[gap])
        flags = self.present.parameters.copy()  # others may be held at their bounds
        state.refresh()
        state.change(gap, Mode.STICKING)  # though its slip is not zero to the last bit
        state.change(gap, state.mode_of_closed(gap))
        self.present.project()
        if gap not in self._idle:
            return
        seen = self.present.evaluate(self._system.functions.watch)
        for k, guard in enumerate(self._system.guards):
            sticks = guard.friction and state.modes[guard.gap] == Mode.STICKING
            if sticks and seen[k] < state.floors[k]:
                state.change(gap, way)
                self.present.parameters[:] = flags
                self.present.parameters[state.run.gaps[SLIP, gap]] *= 1.0 - _CONTACTS.held_slip
                return

    def missed_event(self, seen_now: int | None = None) -> int | None:
        """Guard below zero already, whose fall the integrator cannot detect.

        That happens where a step ends within its error of an event. Beside the guard that is
        `seen_now`, others count only beyond what falls at the same instant.
        """
        state, system = self.state, self._system
        if self._resolves_all:
            return state.stages.past_zero(seen_now)
        seen = self.present.evaluate(system.functions.watch).tolist()
        modes, floors, limits = state.modes, state.floors, state.limits
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
                rated, rate = state.rated[i], seen[count + i]
                least = max(margin, limits.bare) if rated else margin
                rests = not rated and x > -limits.touching and rate >= -limits.bare
                if x <= -least and rate < 0.0 and not rests and i != seen_now:
                    return i
                continue
            least = floor if seen_now is None else _CONTACTS.same_instant * (floor - margin)
            beyond = x <= least
            if beyond and i != seen_now and not self.switching.leads_back(system.guards[i].switch):
                return i
        return None
