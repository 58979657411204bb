"""Events of compliant contacts: contact, loss of force, recovery, separation."""

from __future__ import annotations

import numpy as np

from mechanism_sim.engine.contact_state import ContactState
from mechanism_sim.engine.events import Mode
from mechanism_sim.tolerances import TOLERANCES

_CONTACTS = TOLERANCES.contacts


def initialise_rates(state: ContactState) -> None:
    """Initialise the approach speeds of contacts closed at the start, from their load.

    Contacts whose force would be tensile are set to `Mode.RECOVERING`.
    """
    terms, speeds = state.terms(), list(state.approach)
    gaps = state.present.system.gaps
    for i, (gap, value) in enumerate(zip(gaps, terms.value, strict=True)):
        if state.closed(i) and gap.law is not None:
            depth = max(0.0, -float(gap.distance(np.array(value))))
            speed = gap.law.loading_speed(depth, 1.0 / terms.compliance[i][i])
            speeds[i] = max(speed, state.slowest)
    state.set_modes(state.modes, tuple(speeds))
    relief = state.terms().relief
    state.set_modes(
        tuple(
            int(Mode.RECOVERING) if state.closed(i) and relief[i] < 0.0 else mode
            for i, mode in enumerate(state.modes)
        )
    )


def touch_or_part(state: ContactState, gap: int) -> None:
    """Begin or end a contact at the present speed, with the gap a rounding beyond zero.

    Or switch a closed contact to recovery without force, or back from it.
    """
    terms, joint = state.terms(), state.present.system.gaps[gap]
    law = joint.law
    if law is None:
        raise ValueError('a compliant contact has a law')
    speeds, opens = list(state.approach), state.closed(gap)
    if opens:
        # the guard is a product: the factor whose zero is nearer in time has fallen
        depth = -float(joint.distance(np.array(terms.value[gap])))
        change = law.damping * abs(terms.acceleration[gap])
        if depth > state.inside and abs(terms.relief[gap] * terms.rate[gap]) < depth * change:
            recovers = state.modes[gap] == Mode.RECOVERING
            state.change(gap, state.mode_of_closed(gap) if recovers else Mode.RECOVERING)
            return
    else:
        mass = 1.0 / terms.compliance[gap][gap]
        load = max(0.0, -terms.acceleration[gap] * mass)
        own, rate = law.loading_speed(law.resting_depth(load), mass), -terms.rate[gap]
        speeds[gap] = max(rate if rate > _CONTACTS.set_down * own else own, state.slowest)
    mode = int(Mode.FREE_FLIGHT if opens else state.mode_of_closed(gap))
    state.set_modes((*state.modes[:gap], mode, *state.modes[gap + 1 :]), tuple(speeds))
    target = state.present.system.rounding if opens else -state.inside
    shift = (target - terms.value[gap]) / terms.compliance[gap][gap]
    for k, w in enumerate(terms.response[gap]):
        state.present.state[k] += w * shift


def is_leaving(state: ContactState, gap: int) -> bool:
    """True if a contact opens: separating at a depth near zero, where its force vanishes."""
    terms = state.terms()
    depth = -float(state.present.system.gaps[gap].distance(np.array(terms.value[gap])))
    return depth <= state.inside and bool(terms.rate[gap] > 0.0)
