"""Forces and moments on links."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from mechanism_sim.numerics.symbolic import Term, add, mul, neg
from mechanism_sim.planar.frames import Jet
from mechanism_sim.planar.points import Vector2


@dataclass(frozen=True)
class Load:
    """A force at a point of a link, and a moment."""

    name: str  #: of the parameters of its point
    link: str
    at: Vector2  #: [m] in the link's frame
    force: tuple[Term, Term] = (None, None)  #: [N] in the world
    moment: Term = None  #: [N m]


class Wrench(NamedTuple):
    """Force and moment of the first-named on the second-named link of a joint.

    The moment is about the joint's point on the second-named link. `others` are the loads on all
    links but the second-named, where they are not just its opposite on the first-named.
    """

    x: Term  #: [N]
    y: Term  #: [N]
    moment: Term = None  #: [N m]
    others: tuple[Load, ...] | None = None


def contact_wrench(normal: tuple[Jet, Jet], N: Term, T: Term, arm: Term = None) -> Wrench:
    """Wrench of a contact on the second-named link.

    Parameters
    ----------
    normal : unit vector along which the first-named link presses
    N, T : normal force, and friction on the first-named link along the normal turned by +90
        degrees [N]
    arm : from the joint's point on the second-named link to the contact, along the normal [m]
    """
    x, y = normal
    return Wrench(
        add(mul(N, x.value), mul(T, y.value)),
        add(mul(N, y.value), neg(mul(T, x.value))),
        neg(mul(arm, T)),
    )


def together(a: Wrench, b: Wrench) -> Wrench:
    """The sum of two wrenches about the same point."""
    others = None if a.others is None and b.others is None else (a.others or ()) + (b.others or ())
    return Wrench(add(a.x, b.x), add(a.y, b.y), add(a.moment, b.moment), others)


def moment_of(arm: tuple[Term, Term], force: tuple[Term, Term]) -> Term:
    """``arm x force``."""
    return add(mul(arm[0], force[1]), neg(mul(arm[1], force[0])))
