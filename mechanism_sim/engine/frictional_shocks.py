"""Impacts without collision: friction stops or turns a slide that no finite force can keep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.impact import ContactImpulse, shock, stop_slide
from mechanism_sim.engine.contact.problem import enter, push
from mechanism_sim.engine.contact.respond import RESTS
from mechanism_sim.engine.contact_state import SLIDING, ContactState, chosen
from mechanism_sim.errors import RunError
from mechanism_sim.tolerances import TOLERANCES

_IMPACTS = TOLERANCES.impacts

_SIGNS = {int(mode): sign for sign, mode in SLIDING.items()}


def unjam(state: ContactState, jams: int) -> int:
    """End a slide that no force can keep by an impact without collision, `jams` times at most.

    Returns
    -------
    The next stage of `contact.respond`.
    """
    terms, resting, present = state.problem, state.resting, state.present
    names = [present.system.gaps[i].name for i in chosen(resting)]
    near = state.touching | (np.abs(terms.value) <= state.limits.touching)
    try:
        if not jams:
            raise ArithmeticError('friction jams again and again')
        after = shock_contacts(state, chosen(near), chosen(resting))
    except ArithmeticError as error:
        raise RunError(
            f'friction jams {", ".join(names)} at t = {present.time:.12g} s{present.where}: '
            'neither forces nor finite impulses within the cones of friction keep the contacts; '
            'use less friction'
        ) from error
    state.resting[:], state.touching[:] = state.mask(after), near
    return RESTS


def shock_contacts(
    state: ContactState,
    gaps: Sequence[int],
    resting: Sequence[int],
    jammed: int | None = None,
) -> list[int]:
    """Apply an impact without collision to gaps, some of which are at rest.

    Parameters
    ----------
    jammed : index of the contact that jams, whose friction is taken as unbounded

    Returns
    -------
    The gaps that rest after it.

    Raises
    ------
    ArithmeticError
        If nothing slides, or no finite impulses keep the contacts.
    """
    terms, still = state.problem, state.limits.still
    rows, A, friction = _coupling(state, gaps)
    rates = terms.rate[rows]
    before = [
        0.0 if r in resting or abs(x) <= still else x
        for r, x in zip(rows, rates.tolist(), strict=True)
    ]
    friction = [math.inf if i == jammed else mu for i, mu in zip(gaps, friction, strict=True)]
    impulses = shock(A, before, terms.free_acceleration[rows], friction)
    after = _apply(state, gaps, impulses)
    return [
        i
        for k, i in enumerate(gaps)
        if after[k] <= max(still, rates[k] * (1.0 + _IMPACTS.parted) if i in resting else 0.0)
    ]


def stop_jammed_slide(state: ContactState, closed: list[int], gap: int) -> list[int]:
    """Apply the impact without collision of closed contacts when the sliding of one jams.

    Returns
    -------
    The gaps that rest after it.
    """
    state.refresh()
    rows, A, friction = _coupling(state, closed)
    slips = [_SIGNS.get(state.modes[i], 0) for i in closed]
    try:
        impulses = stop_slide(A, state.problem.rate[rows], friction, slips)
    except ArithmeticError:
        with suppress(ArithmeticError):  # or else sliding goes on, or ends where contacts rest
            return shock_contacts(state, closed, closed, gap)
    else:
        _apply(state, closed, impulses)
    return closed


def _coupling(state: ContactState, gaps: Sequence[int]) -> tuple[list[int], Array, list[float]]:
    """Rows of gaps, rates of these per unit impulse, and coefficients of friction."""
    terms = state.problem
    rows = [*gaps, *(len(state.modes) + i for i in gaps)]
    friction = np.minimum(terms.friction[gaps], _IMPACTS.rough).tolist()
    return rows, terms.compliance[np.ix_(rows, rows)], friction


def _apply(state: ContactState, gaps: Sequence[int], impulses: Sequence[ContactImpulse]) -> Array:
    """Apply and log impulses of gaps; the rates of all rows after them."""
    terms, log, present = state.problem, state.impacts, state.present
    rows, A, _ = _coupling(state, gaps)
    rates, n = terms.rate[rows], len(gaps)
    after = rates + A @ [*(b.normal for b in impulses), *(b.tangential for b in impulses)]
    log.reserve(n)
    for k, (i, (p, q, _slip)) in enumerate(zip(gaps, impulses, strict=True)):
        if p or q:
            push(terms, i, p, q, present.v)
            pair, row = [k, n + k], log.rows[log.count]
            enter(terms, i, (p, q), rates[pair], after[pair], True, present.instant(), row)
            log.count += 1
    return after
