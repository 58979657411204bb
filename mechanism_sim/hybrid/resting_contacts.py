"""Contacts without normal speed: which stay closed, which part, which friction jams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mechanism_sim.contact.problem import Mask, Resting, push, release, rest_now
from mechanism_sim.errors import RunError
from mechanism_sim.hybrid.contact_state import ContactState, chosen
from mechanism_sim.hybrid.frictional_shocks import shock_contacts
from mechanism_sim.hybrid.rubbing_contacts import iterate_friction_modes, set_trial_modes
from mechanism_sim.hybrid.switching import Switching
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts


def rest(
    state: ContactState,
    switching: Switching,
    resting: Mask,
    touching: Mask,
    given: Mapping[int, int] | None = None,
    jams: int = _CONTACTS.jams,
) -> None:
    """Keep closed those of the contacts without normal speed that are pressed together.

    Where no force can keep a contact that slides, friction jams it: an impact without
    collision stops its sliding first.

    Parameters
    ----------
    resting, touching : (m,) contacts at rest, and all whose modes are to be set
    given : signs of contacts that are about to slide
    jams : so many impacts without collision more
    """
    before, log, present = state.modes, state.impacts, state.present
    slips = np.zeros(len(before), dtype=np.int64)
    for i, sign in (given or {}).items():
        slips[i] = sign
    # what coming to rest loses is booked in the impact of this instant, if there was one
    booked = log.count and log.last_time == present.time
    booked = booked and (len(before) > 1 or present.system.frictional)
    state.refresh()
    found = None
    if present.system.dynamics.rubs and not iterate_friction_modes(
        state, switching, resting, touching, slips
    ):
        set_trial_modes(state, switching, state.mode_array)
    else:
        found = rest_now(
            state.arrays,
            state.limits,
            Resting(resting, touching, slips),
            present.drive_rates,
            log.rows[log.count - booked : log.count],
            state.mode_array,
            state.marks.begins,
            state.marks.drawn,
        )
        if not found.solved:
            state.write_flags(state.mode_array)
    if found is None or not found.solved:
        if given:  # those that gave way need not, by rounding
            rest(state, switching, resting, touching, jams=jams)
        else:
            _unjam(state, switching, resting, touching, jams)
        return
    state.horizon = min(state.horizon, found.horizon)
    if found.changed:
        state.adopt_modes()
        state.record_modes(before)
    if found.changed or found.begins:
        state.write_flags(state.mode_array, state.marks.begins if found.begins else None)
    if found.off or found.begins or present.system.relations:
        present.project()
    if found.begins:  # to slide, from a slip of exactly zero
        state.write_flags(state.mode_array)
    if found.parts:
        separate(state, chosen(resting & ~state.problem.closed))
    if found.draws:
        drawn = state.marks.drawn.copy()
        rest(state, switching, resting | drawn, touching | drawn, jams=jams)


def _unjam(
    state: ContactState, switching: Switching, resting: Mask, touching: Mask, jams: int
) -> None:
    """End a slide that no force can keep by an impact without collision."""
    terms, names = state.problem, [state.names[i] for i in chosen(resting)]
    near = touching | (np.abs(terms.value) <= state.limits.touching)
    try:
        if not jams:
            raise ArithmeticError('friction jams again and again')
        after = shock_contacts(state, chosen(near), chosen(resting))
    except ArithmeticError as error:
        raise RunError(
            f'friction jams {", ".join(names)} at t = {state.present.time:.12g} s'
            f'{state.present.where}: neither forces nor finite impulses within the cones of '
            'friction keep the contacts; use less friction'
        ) from error
    rest(state, switching, state.mask(after), near, jams=jams - 1)


def separate(state: ContactState, gaps: Sequence[int]) -> None:
    """Start the flight of gaps a few roundings inside, at rest in the normal direction.

    A flight that started on the wrong side of zero would never be seen to end. Other open
    gaps that touch at rest are moved along, lest they are pushed out.
    """
    limits, present = state.limits, state.present
    for i in (i for i in gaps if state.rated[i]):  # it has no place: roundings of its rate instead
        terms = state.terms()
        faster = limits.bare - float(terms.rate[i])
        push(terms, i, faster / float(terms.compliance[i, i]), 0.0, present.v)
    gaps = [i for i in gaps if not state.rated[i]]
    if not gaps:
        return
    for roundings in (1.0, 2.0, 4.0, 8.0):
        terms = state.terms()
        if roundings > 1.0 and all(terms.value[i] > 0.0 for i in gaps):
            return
        moved = list(gaps)
        if len(state.modes) > 1:
            moved += [
                i
                for i, value in enumerate(terms.value.tolist())
                if not state.closed(i)
                and not state.rated[i]
                and i not in moved
                and abs(value) <= limits.touching
                and abs(terms.rate[i]) <= limits.bare
            ]
        release(terms, state.mask(moved), roundings * present.rounding, present.x)
