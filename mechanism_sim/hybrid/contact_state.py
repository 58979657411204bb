"""The contacts at the present state: modes, the contact problem, events so far."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.contact.chatter import ChatterRule
from mechanism_sim.contact.impact import Hypothesis
from mechanism_sim.contact.problem import (
    FLIES,
    RECOVERS,
    SLIDES_BACKWARD,
    SLIDES_FORWARD,
    STICKS,
    ContactArrays,
    ContactProblem,
    Limits,
    Mask,
    problem_of,
    slip_of,
)
from mechanism_sim.hybrid.dense_output import Status
from mechanism_sim.hybrid.events import ImpactLog, Mode, ModeChange
from mechanism_sim.hybrid.present_state import PresentState
from mechanism_sim.hybrid.system import System
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.numerics.kernels import kernel
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts
_GUARDS = TOLERANCES.guards


SLIDING = {1: Mode.SLIDING_FORWARD, 0: Mode.STICKING, -1: Mode.SLIDING_BACKWARD}
"""Modes of a closed contact with friction by the sign of its slip."""


class Marks(NamedTuple):
    """Gaps (m,) that the kernels mark: what they return beside their scalars."""

    touching: Mask
    resting: Mask
    begins: Mask
    drawn: Mask


class ContactState:
    """Modes of the m gaps, and the contact problem of the present instant.

    Parameters
    ----------
    present : the integrator's state
    rule : when bounces are left out
    rtol : relative error of a step
    speed : [m/s] that this error refers to

    Attributes
    ----------
    modes, approach : of every gap, and the speeds of first touches of compliant contacts [m/s]
    flying : whether any gap is open
    flies_free : whether all are, and no friction or compliance takes part in an impact
    problem, arrays : as of the last `refresh`, except for what is closed
    impacts, mode_changes : the events so far
    floors : of every guard, what it may be below zero by rounding
    horizon : [s] longest next step: a root much nearer to its start than to its end gets lost
    """

    def __init__(
        self, present: PresentState, rule: ChatterRule, rtol: float, speed: float
    ) -> None:
        system, gaps = present.system, present.system.gaps
        self.present, self.rule = present, rule
        m = len(gaps)
        self.names = [gap.name for gap in gaps]
        self.impacts = ImpactLog(self.names)
        self.mode_changes: list[ModeChange] = []
        self.horizon = float('inf')
        self.arrays = ContactArrays(
            np.zeros(system.contact_layout.size),
            system.contact_layout,
            np.array([[g.restitution for g in gaps], [g.friction for g in gaps]], dtype=float),
            np.zeros(m, dtype=np.bool_),
            np.array([Hypothesis(gap.hypothesis).code for gap in gaps], dtype=np.int64),
        )
        self.problem = problem_of(self.arrays)
        self.mode_array = np.zeros(m, dtype=np.int64)
        self.marks = Marks(*np.zeros((4, m), dtype=np.bool_))
        self._flag_index = _flag_index(system)
        self.limits = _limits(present, rule, rtol, speed)
        least = max(
            _GUARDS.slip_scale * self.limits.still, _GUARDS.force_scale * _CONTACTS.cone_force
        )
        self.floors = [-least if guard.friction else 0.0 for guard in system.guards]
        self.slowest = (
            _CONTACTS.slowest_touch * speed
        )  # [m/s] to which the damping of a touch may refer
        if system.parameters.margin is not None:
            present.pars[system.parameters.margin] = self.limits.bare
        self.approach = (1.0,) * len(system.parameters.approach)
        self._status = Status((), ())
        self._holding = [*system.set_valued.holding]
        self.set_modes((int(Mode.FREE_FLIGHT),) * m)

    @cached_property
    def rated(self) -> Mask:
        """The gaps (m,) that have a rate only."""
        return np.array(self.present.system.rated, dtype=np.bool_)

    @property
    def status(self) -> Status:
        """Contacts and switches that a step is taken with; the same object until it changes."""
        rows, pars = self.present.rows, self.present.pars
        sides = self.present.system.parameters.sides
        acting = tuple([rows[k] for k in self._holding] + [int(pars[i] > 0.0) for i in sides])
        now = Status(self.modes, self.approach, acting)
        if now != self._status:
            self._status = now
        return self._status

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
        """Make the modes in the array, of which the equations know, those that hold."""
        self.modes = tuple(self.mode_array.tolist())
        self.flying = int(Mode.FREE_FLIGHT) in self.modes
        known = self.present.system
        smooth = not (known.frictional or known.compliant or known.dynamics.rubs)
        smooth = smooth and not self.rated.any()
        self.flies_free = smooth and not self.problem.closed.any()

    def write_flags(self, modes: Indices, sticking: Mask | None = None) -> None:
        """Tell the equations some modes; of gaps in `sticking`, that they stick."""
        none = self.problem.closed[:0]
        write_flags(
            modes, none if sticking is None else sticking, self._flag_index,
            self.present.parameters,
        )  # fmt: skip

    def scale_slip(self, gap: int, factor: float) -> None:
        """Change the flag of a slip: friction acts with a part of its bound."""
        self.present.pars[self._flag_index[2, gap]] *= factor

    def record_modes(self, before: tuple[int, ...]) -> None:
        """Enter the changes from other modes to those that hold."""
        for name, old, new in zip(self.names, before, self.modes, strict=True):
            if old != new:
                change = ModeChange(self.present.time, name, Mode(new), Mode(old))
                self.mode_changes.append(change)

    def refresh(self) -> None:
        """Evaluate the terms of the contact problem at the present state."""
        self.present.evaluate(
            self.present.system.functions.contact_function, out=self.arrays.terms
        )

    def terms(self) -> ContactProblem:
        """The contact problem at the present state, until asked again."""
        self.refresh()
        return self.problem

    def closed(self, gap: int) -> bool:
        """True if a gap carries force."""
        return self.modes[gap] > Mode.FREE_FLIGHT

    def slip(self, gap: int) -> int:
        """Which way a contact with friction slides, 0 if not at all."""
        return int(slip_of(self.problem, gap, self.limits.still))

    def mode_of_closed(self, gap: int) -> Mode:
        """The mode of a gap that is closed from now on."""
        return SLIDING[self.slip(gap)] if self.problem.friction[gap] else Mode.FOLLOWING

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
    touching = _CONTACTS.touching * present.rounding
    return Limits(
        touching,
        max(touching, min(rtol, _CONTACTS.tie) * present.system.mechanism.size),
        _CONTACTS.bare * float(np.spacing(speed)),
        max(_CONTACTS.still_least, _CONTACTS.still * rtol) * speed,
        rule.allowed,
        rule.resolved,
    )


def _flag_index(system: System) -> NDArray[np.int64]:
    """Parameters (4, m) of every gap: closed, sticks, slips, presses; -1 where it has none."""
    found = np.full((4, len(system.gaps)), -1)
    found[0] = system.parameters.closed
    found[1, system.dynamics.contacts.frictional] = system.parameters.sticks
    found[2, system.dynamics.contacts.frictional] = system.parameters.slips
    found[3, : len(system.parameters.presses)] = system.parameters.presses
    return found


@kernel
def write_flags(
    modes: Indices, sticking: Mask, places: NDArray[np.int64], parameters: Array
) -> None:
    """The flags closed, sticks, slips and presses of modes, in their places (4, m) if not -1.

    Those set in `sticking` (m,), or of none (0,), count as if they stuck.
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
