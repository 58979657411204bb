"""Impacts by the kernels of the engine, with laws and errors as tests write them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mechanism_sim.engine.contact.impact import (
    ContactCompliance,
    ContactImpulse,
    Hypothesis,
    contact_impulses,
    impulses_of_one,
    simultaneous_impulses,
)


@dataclass(frozen=True)
class ImpactLaw:
    """Law of an impact of one contact.

    Attributes
    ----------
    restitution : e, 0 to 1
    friction : Coulomb's coefficient; 0 is the smooth and `math.inf` the rough case of [SB] 5.3
    hypothesis : what e means
    """

    restitution: float
    friction: float = 0.0
    hypothesis: Hypothesis = Hypothesis.NEWTON


def single_impact(
    Ann: float, Ant: float, Att: float, vn: float, vt: float, law: ImpactLaw
) -> ContactImpulse:
    """By Routh's method, a wedged contact an ArithmeticError."""
    p, q, slip = impulses_of_one(
        ContactCompliance(Ann, Ant, Ant, Att),
        vn,
        vt,
        law.restitution,
        law.friction,
        law.hypothesis.code,
    )
    if math.isnan(p):
        raise ArithmeticError('a contact is wedged: no finite impulse ends its approach')
    return ContactImpulse(p, q, slip)


def simultaneous_impact(
    A: Sequence[Sequence[float]], rate: Sequence[float], laws: Sequence[ImpactLaw]
) -> list[ContactImpulse]:
    """Of m contacts that touch at one instant; an ArithmeticError if there is no solution."""
    matrix, before = np.array(A, dtype=float), np.array(rate, dtype=float)
    e = np.array([law.restitution for law in laws])
    friction = np.array([law.friction for law in laws])
    hypotheses = np.array([law.hypothesis.code for law in laws])
    impulses, found = simultaneous_impulses(matrix, before, e, friction, hypotheses)
    if not found:
        raise ArithmeticError('no impulses satisfy all contacts of this instant')
    return contact_impulses(matrix, before, impulses)


def energy_change(
    before: Sequence[float], after: Sequence[float], impulses: Sequence[float]
) -> float:
    """Change of kinetic energy by impulses [J]: each times the mean of its rates [m/s].

    Exact whatever happens during the impact; the work of a drive is not in it.
    """
    return sum(0.5 * p * (u + v) for u, v, p in zip(before, after, impulses, strict=True))
