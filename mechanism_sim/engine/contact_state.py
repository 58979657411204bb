"""The contacts at the present state: modes, the contact problem, events so far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, cast

import numpy as np

from mechanism_sim.arrays import Array, Mask
from mechanism_sim.engine.contact import respond
from mechanism_sim.engine.contact.chatter import ChatterRule
from mechanism_sim.engine.contact.impact import Hypothesis
from mechanism_sim.engine.contact.problem import (
    FLIES,
    IDLE,
    STICKS,
    ContactArrays,
    ContactProblem,
    Limits,
    problem_of,
    slip_of,
    turn_idle,
)
from mechanism_sim.engine.dense_output import Status, floats
from mechanism_sim.engine.event_stages import EventStages
from mechanism_sim.engine.events import ImpactLog, Mode, ModeLog
from mechanism_sim.engine.guards import force_scale
from mechanism_sim.engine.present_state import PresentState, rate_of
from mechanism_sim.numerics.complementarity import FORWARD, OPEN, STICK, Indices
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts
_GUARDS = TOLERANCES.guards

SLIDING = {1: Mode.SLIDING_FORWARD, -1: Mode.SLIDING_BACKWARD}
"""Modes of a closed contact by the sign of its slip."""


class ContactState:
    """Modes of the m gaps, and the contact problem of the present instant.

    Parameters
    ----------
    present : the integrator's state
    rule : cut-off of Zeno chatter
    rtol : relative tolerance of a step
    speed : [m/s] reference speed of `rtol`
    crowd : [s] time between events that are close to each other

    Attributes
    ----------
    modes, approach : mode of every gap; speeds of initial contact of compliant contacts [m/s]
    run, known : arrays on which `contact.respond` resolves events, by name and as arguments
    problem, arrays : as of the last `refresh`; only the flags `closed` are current
    impacts, changes : logs of the events since the last `drain`
    stages : kernels of the stages of events
    floors : lowest value of every guard by rounding, not above zero
    """

    def __init__(
        self, present: PresentState, rule: ChatterRule, rtol: float, speed: float, crowd: float
    ) -> None:
        system, gaps = present.system, present.system.gaps
        self.present, self.rule = present, rule
        m = len(gaps)
        names = [gap.name for gap in gaps]
        self.impacts, self.changes = ImpactLog(names), ModeLog(names)
        self.limits = _limits(present, rule, rtol, speed)
        size = system.mechanism.size
        depth = min(_CONTACTS.inside, _CONTACTS.inside_share * size)
        #: [m] depth at which a compliant contact begins
        self.inside = max(depth, self.limits.touching)
        gravity = math.hypot(*system.mechanism.gravity)
        force = system.mechanism.total_mass * (gravity + speed**2 / size)
        self._cone_force = min(_CONTACTS.cone_force, _CONTACTS.cone_share * force)
        self.known, self.run = self._arrays(crowd)
        self.stages = EventStages(present, self.run, self.known, self.impacts, self.changes)
        reals, whole, marks = self.run.reals, self.run.gaps, self.run.marks
        self._reals = floats(reals)
        laws = reals[respond.DRIVES + len(system.prescribed) :].reshape(2, m)
        self.arrays = ContactArrays(
            self.run.terms,
            system.contact_layout,
            laws,
            marks[respond.SHUT],
            whole[respond.HYPOTHESIS],
        )
        self.problem = problem_of(self.arrays)
        floor = float(reals[respond.FLOOR])
        self.floors = [floor if guard.friction else 0.0 for guard in system.guards]
        self.slowest = (
            _CONTACTS.slowest_touch * speed
        )  # [m/s] to which the damping of a touch may refer
        if system.parameters.margin is not None:
            present.pars[system.parameters.margin] = self.limits.bare
        self.modes: tuple[int, ...] = ()
        self.approach = (1.0,) * len(system.parameters.approach)
        self._status = Status((), ())
        self._holding = [*system.set_valued.holding]
        self._acts = bool(self._holding or system.parameters.sides)
        self.set_modes((int(Mode.FREE_FLIGHT),) * m)

    def _arrays(self, crowd: float) -> tuple[tuple[Any, ...], respond.EventArrays]:
        """Arrays on which events are resolved, without logs: flat, then by name."""
        system, present = self.present.system, self.present
        gaps, m, size = system.gaps, len(system.gaps), system.contact_layout.size
        cone = force_scale(system.mechanism) * self._cone_force
        least = max(_GUARDS.slip_scale * self.limits.still, cone)
        reals = [
            0.0, math.inf, -least, system.rounding, -math.inf, crowd, *self.limits,
            *(0.0 for _ in system.prescribed), *(g.restitution for g in gaps),
            *(g.friction for g in gaps),
        ]  # fmt: skip
        frictional = system.dynamics.contacts.frictional
        whole = np.full(respond.COUNTERS + 10 * m, -1)
        values, marks = np.zeros(size + present.seen), np.zeros((6, m), dtype=np.bool_)
        whole[: respond.SIZE] = 0
        whole[respond.SIZE], whole[respond.LAYOUT : respond.COUNTERS] = size, system.contact_layout
        known = present.x, present.parameters, values, np.array(reals), whole, marks
        run = respond.run_of(*known, self.impacts.rows, self.changes.rows)
        run.counters[respond.GUARDS] = len(system.guards)
        own = [guard.gap >= 0 for guard in system.guards]
        run.counters[respond.WATCHED] = all(own) and not system.compliant
        smooth = not (frictional or any(system.rated) or system.dynamics.frictional_joints)
        run.counters[respond.SMOOTH] = smooth
        run.counters[respond.RELATIONS] = bool(system.relations)
        # parameters of each gap's flags; -1 where it has none
        index = system.parameters
        run.gaps[respond.CLOSED] = index.closed
        run.gaps[respond.CLOSED + 1, frictional] = index.sticks
        run.gaps[respond.CLOSED + 2, frictional] = index.slips
        run.gaps[respond.PRESS, : len(index.presses)] = index.presses
        run.gaps[respond.HYPOTHESIS] = [Hypothesis(gap.hypothesis).code for gap in gaps]
        run.gaps[respond.GIVEN], run.gaps[respond.RATED] = 0, system.rated
        run.gaps[respond.FRICTIONAL, : len(frictional)] = frictional
        return known, run

    @property
    def horizon(self) -> float:
        """Longest next step [s]: in a longer one a root close to its start would be missed."""
        return self._reals[respond.HORIZON]

    @horizon.setter
    def horizon(self, longest: float) -> None:
        self._reals[respond.HORIZON] = longest

    def begin_event(self, t: float, earlier: int = 0) -> None:
        """Set the time of an event [s] in the arrays, and the number of those before it there.

        The rates of the drives at that time are set, too.
        """
        respond.begin(self.stages.counters, self._reals, t, earlier)
        laws, tau = self.present.base.laws, self.present.integrator.time
        for k, law in enumerate(laws, start=respond.DRIVES):
            self._reals[k] = rate_of(law, tau)

    @property
    def flying(self) -> bool:
        """True if any gap is open."""
        return int(Mode.FREE_FLIGHT) in self.modes

    @property
    def touching(self) -> Mask:
        """The gaps (m,) that take part in an event, to be changed in place."""
        return cast(Mask, self.run.marks[respond.TOUCHING])

    @property
    def resting(self) -> Mask:
        """Mask (m,) of the following contacts that are at rest."""
        return cast(Mask, self.run.marks[respond.RESTING])

    @property
    def mode_array(self) -> Indices:
        """The modes (m,), to be changed in place."""
        return cast(Indices, self.run.gaps[respond.MODE])

    @property
    def drive_rates(self) -> Array:
        """Rates (p,) [rad/s] of the drives at the present event."""
        return self.run.reals[respond.DRIVES :][: self.arrays.layout.drives]

    @cached_property
    def rated(self) -> Mask:
        """The gaps (m,) that have a rate only."""
        return np.array(self.present.system.rated, dtype=np.bool_)

    @property
    def status(self) -> Status:
        """Modes and switch rows of the next step; the same object until they change."""
        known = self._status
        if not self._acts and known.modes is self.modes and known.approach is self.approach:
            return known
        rows, pars = self.present.rows, self.present.pars
        sides = self.present.system.parameters.sides
        acting = tuple([rows[k] for k in self._holding] + [int(pars[i] > 0.0) for i in sides])
        now = Status(self.modes, self.approach, acting)
        if now != known:
            self._status = known = now
        self.modes, self.approach = known.modes, known.approach
        return known

    def set_modes(self, modes: tuple[int, ...], approach: tuple[float, ...] | None = None) -> None:
        """Set the modes that hold from now on, and the speeds of first touches [m/s]."""
        if approach is not None:
            self.approach = approach
            self.present.set(self.present.system.parameters.approach, approach)
        self.mode_array[:] = modes
        np.greater(self.mode_array, Mode.FREE_FLIGHT, out=self.problem.closed)
        self.write_flags(self.mode_array)
        self.adopt_modes()

    def change(self, gap: int, mode: Mode) -> None:
        """Set the mode of one gap."""
        self.set_modes((*self.modes[:gap], int(mode), *self.modes[gap + 1 :]))

    def adopt_modes(self) -> None:
        """Adopt the modes in the array, with which the equations are already evaluated."""
        self.modes = tuple(self.mode_array.tolist())

    def write_flags(self, modes: Indices) -> None:
        """Set the runtime parameters of the equations to some modes."""
        places = self.run.gaps[respond.CLOSED : respond.PRESS + 1]
        respond.write_flags(modes, self.problem.closed[:0], places, self.present.parameters)

    def record_modes(self, before: tuple[int, ...]) -> None:
        """Enter the changes from other modes to those that hold."""
        for gap, (old, new) in enumerate(zip(before, self.modes, strict=True)):
            if old != new:
                self.changes.enter(self.present.time, gap, new, old)

    def refresh(self) -> None:
        """Evaluate the terms of the contact problem at the present state."""
        self.present.evaluate(
            self.present.system.functions.contact_function, out=self.arrays.terms
        )

    def terms(self) -> ContactProblem:
        """The contact problem at the present state, overwritten by the next call."""
        self.refresh()
        return self.problem

    def closed(self, gap: int) -> bool:
        """True if a gap carries force."""
        return self.modes[gap] > Mode.FREE_FLIGHT

    def slip(self, gap: int) -> int:
        """Direction of slip of a contact with friction, 1 or -1; 0 if it does not slip."""
        return int(slip_of(self.problem, gap, self.limits.still))

    def mode_of_closed(self, gap: int) -> Mode:
        """The mode of a gap that is closed from now on."""
        if not self.problem.friction[gap]:
            return Mode.FOLLOWING
        if slip := self.slip(gap):
            return SLIDING[slip]
        sticks = self.mode_array == STICKS
        sticks[gap] = False  # it carries nothing yet
        carry = np.tile(sticks, 2).astype(float)
        sticks[gap] = True
        grips = np.where(sticks, STICK, np.where(self.mode_array > FLIES, FORWARD, OPEN))
        turn_idle(self.problem, grips, carry)
        return Mode.FOLLOWING if grips[gap] == IDLE else Mode.STICKING

    def mask(self, gaps: Sequence[int]) -> Mask:
        """Flags (m,) of some gaps."""
        mask = np.zeros(len(self.modes), dtype=np.bool_)
        mask[gaps] = True
        return mask


def chosen(mask: Mask) -> list[int]:
    """Indices of what is set."""
    found: list[int] = mask.nonzero()[0].tolist()
    return found


def _limits(present: PresentState, rule: ChatterRule, rtol: float, speed: float) -> Limits:
    touching = _CONTACTS.touching * present.system.rounding
    return Limits(
        touching,
        max(touching, min(rtol, _CONTACTS.tie) * present.system.mechanism.size),
        _CONTACTS.bare * float(np.spacing(speed)),
        max(_CONTACTS.still_least, _CONTACTS.still * rtol) * speed,
        rule.allowed,
        rule.resolved,
    )
