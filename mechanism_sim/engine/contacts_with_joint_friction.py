"""Contacts with friction in ideal joints, which follows from the contact forces.

What friction in ideal joints makes of the contact problem depends on the modes and impulses that
come of it. They are iterated together; where that goes to and fro, all modes are tried.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from mechanism_sim.arrays import Mask
from mechanism_sim.engine.contact.joint_friction import joint_friction_problem, loss, with_friction
from mechanism_sim.engine.contact.problem import (
    FLIES,
    FOLLOWS,
    GAP,
    NORMAL,
    SLIDES_BACKWARD,
    SLIDES_FORWARD,
    STICKS,
    TANGENTIAL,
    Resting,
    impact_now,
    rest_now,
)
from mechanism_sim.engine.contact_state import ContactState, chosen
from mechanism_sim.engine.guards import Guard
from mechanism_sim.engine.switching import Switching, jammed_joints
from mechanism_sim.numerics.complementarity import Indices
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts
_IMPACTS = TOLERANCES.impacts
_ROUNDING = TOLERANCES.rounding


def add_joint_friction(state: ContactState, gap: int) -> float:
    """Change the contact problem of an impact by the friction that it makes in ideal joints.

    Returns
    -------
    Energy dissipated by joint friction [J].
    """
    present, plain, m = state.present, state.arrays.terms.copy(), len(state.modes)
    function, sizes = present.system.functions.joint_friction_function
    layout = state.arrays.layout
    friction = joint_friction_problem(present.evaluate(function), sizes, *layout[1:4])
    rows, T, lost = np.empty((m, len(state.impacts.rows[0]))), np.zeros(len(sizes)), 0.0
    before = np.zeros(layout.rows)
    # fixed-point iteration: contact impulses make friction in joints, which changes the contact
    # problem; the impacts are tried on copies of the rates, only the problem is kept
    for _ in range(_IMPACTS.joint_rounds):
        now = present.instant()
        done = impact_now(
            state.arrays,
            state.limits,
            gap,
            now._replace(v=now.v.copy()),
            rows,
            0,
            state.touching,
            state.resting,
        )
        x = np.zeros(layout.rows)
        for row in rows[: done.entered]:
            x[int(row[GAP])] = row[NORMAL]
            x[m + int(row[GAP]) :: m] = row[TANGENTIAL]
        if not x.any():
            break
        lost = loss(friction, x, T)
        if (left := np.abs(x - before).max() / np.abs(x).max()) <= _IMPACTS.joint:
            break
        state.arrays.terms[:], before = plain, x
        T = with_friction(state.problem, friction, x, T)
    else:
        if left > _IMPACTS.joint_rough:
            raise jammed_joints(state.present)
    return lost


def iterate_friction_modes(
    state: ContactState, switching: Switching, resting: Mask, touching: Mask, slips: Indices
) -> bool:
    """Set friction in ideal joints to that of the modes it causes, if there are any."""
    modes, closed = state.mode_array.copy(), state.problem.closed.copy()
    begins, drawn = np.zeros((2, len(modes)), dtype=np.bool_)
    arrays, contacts = state.arrays._replace(closed=closed), Resting(resting, touching, slips)
    drives, unlogged = state.present.drive_rates, state.impacts.rows[:0]
    seen: set[bytes] = set()
    while modes.tobytes() not in seen:
        seen.add(modes.tobytes())
        rest = rest_now(arrays, state.limits, contacts, drives, unlogged, modes, begins, drawn)
        if not (rest.solved and rest.changed):
            return True
        set_trial_modes(state, switching, modes)
    # each of these modes makes a friction under which others follow: some go with their own
    known = resting.sum() <= _CONTACTS.enumerated
    for tried in _possible_modes(state, resting, slips) if known else ():
        set_trial_modes(state, switching, tried)
        if _is_consistent(state, tried, resting):
            return True
    return not known


def set_trial_modes(state: ContactState, switching: Switching, modes: Indices) -> None:
    """Set friction in ideal joints, and the contact problem, to those of some modes."""
    state.write_flags(modes)
    switching.update_sides()
    state.refresh()


def _possible_modes(state: ContactState, resting: Mask, slips: Indices) -> Iterator[Indices]:
    """Modes (m,) of all gaps, of those at rest all that their slips allow."""
    gaps = chosen(resting)
    choices: list[tuple[int, ...]] = []
    for i in gaps:
        way = int(slips[i]) or state.slip(i)
        if not state.problem.friction[i]:
            choices.append((FOLLOWS, FLIES))
        elif way:
            choices.append((SLIDES_FORWARD if way > 0 else SLIDES_BACKWARD, FLIES))
        else:
            choices.append((STICKS, SLIDES_FORWARD, SLIDES_BACKWARD, FLIES))
    for combination in product(*choices):
        modes = state.mode_array.copy()
        modes[gaps] = combination
        yield modes


def _is_consistent(state: ContactState, modes: Indices, resting: Mask) -> bool:
    """True if gaps at rest stay in the trial modes under the friction of these modes."""
    m, c, system = len(modes), state.problem, state.present.system
    seen = state.present.evaluate(system.functions.watch)
    if any(seen[k] <= 0.0 for k, guard in enumerate(system.guards) if guard == Guard(-1, 0)):
        return False
    least = -_ROUNDING.acceleration * np.abs(c.free_acceleration).max(initial=0.0)
    for i in chosen(resting):
        if modes[i] == FLIES:
            if c.acceleration[i] < least:
                return False
            continue
        way = {SLIDES_FORWARD: 1.0, SLIDES_BACKWARD: -1.0}.get(int(modes[i]), 0.0)
        if way and not state.slip(i) and way * c.acceleration[m + i] < least:
            return False
        for k, guard in enumerate(system.guards):
            slides = way and guard.friction > 0
            if guard.gap == i and not slides and seen[k] < min(state.floors[k], 0.0):
                return False
    return True
