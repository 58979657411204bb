"""Protocols of relations (bilateral) and of gaps (unilateral), as the engine asks for them.

Both are functions of the coordinates, written with the poses that `Frames` gives; these carry
their derivatives along, so that Jacobian rows and curvature terms follow by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import heyoka as hy

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, add, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, JetPair
from mechanism_sim.planar.points import Point, Vector2
from mechanism_sim.planar.view import Draft


class Relation(Protocol):
    """A bilateral constraint of one joint: every component is kept at zero."""

    @property
    def name(self) -> str:
        """Name of the joint."""

    def values(self, frames: Frames) -> list[Jet]:
        """The components that vanish [m]."""

    def facing(self, frames: Frames) -> list[Term]:
        """Terms positive where the joint is closed, negative half a turn or half a slot off.

        There the components of some kinds vanish, too.
        """

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Wrench of the first-named on the second-named link, by the forces along the rows."""


@runtime_checkable
class ForceElement(Protocol):
    """Forces on links that need no gap, such as those of an oil film or a spring."""

    @property
    def name(self) -> str:
        """Name of the element, which is that of the joint if it replaces one."""

    def loads(self, frames: Frames) -> list[Load]:
        """Loads on the links; of a joint on the first-named, then the second-named link."""

    def power_lost(self, frames: Frames) -> Term:
        """Power that it dissipates [W]; negative if it feeds energy in."""

    def energy(self, frames: Frames) -> Term:
        """Energy that it stores [J]."""


@runtime_checkable
class OilFilm(ForceElement, Protocol):
    """Oil film between a journal and its bushing, with a damping that grows as it thins."""

    @property
    def clearance(self) -> float:
        """Thickness of the film around a centred journal [m]."""

    @property
    def roughness(self) -> float:
        """Thickness at which its walls touch [m]; 0 if they never do."""

    def thickness(self, q: Array) -> float:
        """Least thickness [m] at coordinates (n, 1)."""


@runtime_checkable
class FirstOrderState(ForceElement, Protocol):
    """A variable of a machine with a rate but no inertia: a pressure, a current, an integral.

    As a force element it acts on nothing; what acts are loads that name it.
    """

    @property
    def label(self) -> str:
        """Name of the state without that of its section."""

    @property
    def start(self) -> float:
        """Initial value, in the state's own unit."""

    @property
    def scale(self) -> float:
        """The size to which its errors are relative: a power of two, so that nothing rounds."""

    def rate(self, frames: Frames) -> hy.expression:
        """Rate of the state [1/s in its own unit]."""


@runtime_checkable
class JointForce(ForceElement, Protocol):
    """A force element in the place of a joint."""

    def wrench(self, frames: Frames) -> Wrench:
        """Wrench of the first-named on the second-named link.

        Further loads act on other links. The wrench need not have a Taylor series.
        """


@runtime_checkable
class Directed(ForceElement, Protocol):
    """A force along the line between two points, which may need a direction."""

    @property
    def directed(self) -> bool:
        """True if the points must not meet."""

    @property
    def jumps(self) -> bool:
        """True if its force jumps where the points pass each other along their line."""

    def between(self, q: Array) -> Array:
        """Vector from the first to the second (2, N) [m] at coordinates q (n, N)."""


class Rubbing(Protocol):
    """Sliding contact of the links of a higher pair, with friction."""

    @property
    def share(self) -> float:
        """Share of the coefficient of friction that acts."""

    def on(self, way: float) -> Rubbing:
        """Contact on the wall that presses on the second along (1) or against (-1) the force."""

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the second-named link on the first [m/s]."""

    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """Wrench on the second-named link of a force T along the slip."""

    def engaged(self, frames: Frames) -> Term:
        """1 while there is friction, 0 where something else holds the links; None if always."""


class ForceLaw(Protocol):
    """Compliant contact law; a law of `contact.compliant`."""

    @property
    def damping(self) -> Any:
        """Damping coefficient, which raises the force while closing; zero for an elastic law."""

    def normal_force(self, depth: Any, rate: Any, approach: Any) -> Any:
        """Force [N] at a depth [m], its rate [m/s], and the speed of initial contact [m/s]."""

    def relief(self, rate: Any, approach: Any) -> Any:
        """Rate [m/s] of the sign of the force; without force where it is negative."""

    def resting_depth(self, load: float) -> float:
        """Depth [m] under a load [N] that rests."""

    def loading_speed(self, depth: float, mass: float) -> float:
        """Largest closing speed [m/s] of a mass [kg] under a load that rests at a depth [m]."""

    def elastic_energy(self, depth: Any) -> Any:
        """Energy stored at a depth [J]."""


class Gap(Protocol):
    """A unilateral constraint: a distance that never becomes negative."""

    @property
    def name(self) -> str:
        """Name of the gap, which is that of the joint if this has no other gap."""

    @property
    def joint(self) -> str:
        """Name of the joint."""

    @property
    def restitution(self) -> float:
        """Coefficient of restitution, 0 to 1."""

    @property
    def friction(self) -> float:
        """Coulomb's coefficient of friction; infinite for contacts that never slip."""

    @property
    def hypothesis(self) -> str:
        """Law that the coefficient of restitution belongs to: 'newton', 'poisson' or 'stronge'."""

    @property
    def law(self) -> ForceLaw | None:
        """Law of a compliant contact; ``None`` for a rigid one."""

    def stretch(self, value: Term) -> Term:
        """Derivative of the value by the distance, at a value that may be negative."""

    def depth(self, value: Term) -> Term:
        """Penetration of the links [m], for a negative value."""

    def value(self, frames: Frames) -> Jet:
        """The distance [m] for small distances; smooth wherever the motion can go.

        Its Jacobian times the normal force is the generalised force of the contact. A contact that
        bounds a rate only, as a freewheel does, has no value: it closes when its rate falls to
        zero.
        """

    def slip(self, frames: Frames) -> Jet:
        """Tangential velocity [m/s] of the first-named link on the second at the contact.

        Only gradient, rate and curvature are meant: it need not be the rate of anything. The
        positive direction is that of the normal turned by +90 degrees. Asked for only where there
        is friction.
        """

    def normal(self, frames: Frames) -> JetPair:
        """Direction in which the first-named link presses on the second when closed."""

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench of the first-named on the second-named link, by normal force and friction [N].

        The friction force acts on the first-named link, along the normal turned by +90 degrees.
        """

    def distance(self, value: Array) -> Array:
        """The distance in metres that belongs to values of `value`."""


@runtime_checkable
class MotionBound(Gap, Protocol):
    """Gap of a joint beside its constraint or clearance: a stop, or contact of links."""

    @property
    def overlap(self) -> str:
        """Describe the overlap of a negative gap in words."""

    def draw(self, draft: Draft) -> None:
        """Add the stop to a drawing, unless the joint shows it."""


@runtime_checkable
class EndGap(Gap, Protocol):
    """Gap at an end of a joint: its force is axial, or has a moment out of the plane."""

    @property
    def thrust(self) -> float:
        """Share of the normal force on the second-named link towards the reader: 1, -1 or 0."""

    def moment(self, q: Array, N: Array, T: Array) -> Array:
        """Moment (2, N) [N m] on the second-named link about the middle of the joint.

        Parameters
        ----------
        q : (n, N) coordinates
        N, T : (N,) normal and friction force [N]
        """


@runtime_checkable
class WrappedGap(Gap, Protocol):
    """The slack of a rope, whose open stretches have a length and which does not leave pulleys."""

    def lengths(self, q: Array) -> Array:
        """Lengths (k, N) [m] of its open stretches at q (n, N)."""

    def arcs(self, q: Array) -> dict[str, Array]:
        """Wrap angles (N,) [rad] on the pulleys at q (n, N), 0 to 2 pi; by their names."""


@runtime_checkable
class BearingGap(Gap, Protocol):
    """Clearance joint: a pin in a bushing, with contact and wear all around."""

    @property
    def apart(self) -> Point:
        """Vector Q from the bushing's centre to the pin's."""

    def touch(self, q: Array) -> tuple[Array, Array | float, Array | float]:
        """Normal (2, N) from bushing to pin, along it Q (N,) [m], force of a unit multiplier.

        At coordinates q (n, N). The force is 1 where the gap is a distance.
        """


@dataclass(frozen=True)
class Load:
    """A force at a point of a link, and a moment."""

    name: str  #: name of the parameters of its point
    link: str
    at: Vector2  #: point of action [m] in the link's frame
    force: tuple[Term, Term] = (None, None)  #: [N] components in the world
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


def contact_wrench(
    normal: JetPair,
    N: Term,
    T: Term,
    arm: Term = None,
    place: JetPair | None = None,
) -> Wrench:
    """Wrench of a contact on the second-named link.

    Parameters
    ----------
    normal : unit vector along which the first-named link presses
    N, T : normal force, and friction on the first-named link along the normal turned by +90
        degrees [N]
    arm : distance from the joint's point on the second-named link along the normal [m]
    place : vector from that point to the start of the arm, if not zero [m]
    """
    x, y = normal
    force = add(mul(N, x.value), mul(T, y.value)), add(mul(N, y.value), neg(mul(T, x.value)))
    moment = moment_of((place[0].value, place[1].value), force) if place else None
    return Wrench(*force, add(moment, neg(mul(arm, T))))


def together(a: Wrench, b: Wrench) -> Wrench:
    """The sum of two wrenches about the same point."""
    others = None if a.others is None and b.others is None else (a.others or ()) + (b.others or ())
    return Wrench(add(a.x, b.x), add(a.y, b.y), add(a.moment, b.moment), others)


def moment_of(arm: tuple[Term, Term], force: tuple[Term, Term]) -> Term:
    """``arm x force``."""
    return add(mul(arm[0], force[1]), neg(mul(arm[1], force[0])))
