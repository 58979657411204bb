"""A rope through points of any links and over pulleys on them: it pulls, or hangs slack.

Between the centres C of its points, with the radii r of pulleys counted positive where the rope
passes counterclockwise, an open stretch with the unit vector d and its left normal n has

    C2 - C1 = l d + (r2 - r1) n

and the angle theta of d the arc ``r (theta2 - theta1)`` on a pulley between two stretches. The
length is the sum of all l and arcs. As stretches are tangents, its derivative is the sum of
``d . (dC2 - dC1)`` (J. Bernoulli's evolute: what a turn of a tangent takes from one it gives to the
other), and the tension acts along d at the centres. Pulleys turn as they like and without inertia;
the rope has neither mass nor stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet, lift
from mechanism_sim.planar.loads import Load, Wrench, moment_of
from mechanism_sim.planar.mechanism import HigherPair, Mechanism
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.planar.view import Draft, Side, circle

Pair = tuple[Jet, Jet]


class Pulley(NamedTuple):
    """A point of a rope, and the pulley there."""

    place: LinkPoint
    radius: float = 0.0  #: [m] positive where the rope passes counterclockwise; 0 of a point


@dataclass(frozen=True)
class Rope(HigherPair):
    """A rope of a length; `first` and `second` are links of two of its points."""

    one_way: ClassVar[bool] = True
    sides: ClassVar[tuple[Side, ...]] = ('left',)
    parts: ClassVar[str] = 'rope that may hang slack'
    beyond: ClassVar[str] = 'beyond its length'

    pulleys: tuple[Pulley, ...] = ()
    length: float = 0.0  #: [m]

    @property
    def links(self) -> tuple[str, ...]:
        """Of all its points."""
        return tuple(dict.fromkeys(p.place[0] for p in self.pulleys))

    @property
    def extent(self) -> float:
        """Its radii."""
        return max(abs(p.radius) for p in self.pulleys)

    def bears(self, link: str) -> bool:
        """It is at points."""
        return link in self.links

    def closure(self, mechanism: Mechanism) -> RopeClosure:
        """Taut."""
        return RopeClosure(self, mechanism)

    def covered(self) -> Sequence[LinkPoint]:
        """All its points."""
        return [p.place for p in self.pulleys]

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """The pulleys."""
        return [(p.place, abs(p.radius)) for p in self.pulleys if p.radius]

    def draw(self, draft: Draft) -> None:
        """The pulleys, and that links reach to its points."""
        for (link, at), radius in self.pulleys:
            draft.reach((link, at))
            if radius and draft.first(f'{link} {at} {abs(radius):.9g}'):
                draft.add('wheel', link, circle(abs(radius), at), size=abs(radius))


class Stretch(NamedTuple):
    """An open stretch of a rope."""

    length: Jet  #: [m]
    way: Pair  #: unit vector along it


@dataclass(frozen=True)
class RopeClosure(HigherClosure[Rope]):
    """A rope that is taut."""

    def _stretches(self, frames: Frames) -> list[Stretch]:
        m, pulleys = self.mechanism, self.joint.pulleys
        places = [
            frames.position(m.point(*p.place), f'{self.name}.{k}') for k, p in enumerate(pulleys)
        ]
        found = []
        for k, ((x1, y1), (x2, y2)) in enumerate(zip(places, places[1:], strict=False)):
            x, y = x2 - x1, y2 - y1
            off = pulleys[k + 1].radius - pulleys[k].radius
            half = x.half_square() + y.half_square()
            square = 2.0 * dense(half.value)
            across = frames.parameters(f'{self.name}.across.{k}', off)
            if across is not None:
                square = square - across * across
            size = hy.sqrt(square)
            # d(l^2/2) = l dl, and twice: l'' = (l^2/2)'' / l - l'^2 / l
            length = half.chain(size, 1.0 / size, -1.0 / (size * square))
            if pulleys[k].radius or pulleys[k + 1].radius:
                way = _along(x, y, length, across)
            else:  # no arc asks for its derivatives
                way = lift(dense(x.value) / size), lift(dense(y.value) / size)
            found.append(Stretch(length, way))
        return found

    def values(self, frames: Frames) -> list[Jet]:
        """How much longer than the rope the way is on which it lies [m]."""
        stretches = self._stretches(frames)
        total = lift(-dense(frames.parameters(f'{self.name}.length', self.joint.length)))
        for stretch in stretches:
            total = total + stretch.length
        for k, (before, after) in enumerate(zip(stretches, stretches[1:], strict=False)):
            if radius := self.joint.pulleys[k + 1].radius:
                size = dense(frames.parameters(f'{self.name}.radius.{k + 1}', abs(radius)))
                total = total + wrap(before.way, after.way, math.copysign(1.0, radius)) * size
        return [total]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The row draws the points together: along the stretches, at the middles of pulleys."""
        joint, pull = self.joint, neg(forces[0])
        along = [
            (mul(pull, s.way[0].value), mul(pull, s.way[1].value)) for s in self._stretches(frames)
        ]
        loads = []
        for k, p in enumerate(joint.pulleys):
            out = along[k] if k < len(along) else (None, None)
            back = along[k - 1] if k else (None, None)
            force = add(out[0], neg(back[0])), add(out[1], neg(back[1]))
            loads.append(Load(f'{self.name}.{k}', *p.place, force))
        x: Term = None
        y: Term = None
        moment: Term = None
        ox, oy = frames.position(
            self.mechanism.point(joint.second, joint.on_second), f'{self.name}.second'
        )
        for load in (load for load in loads if load.link == joint.second):
            x, y = add(x, load.force[0]), add(y, load.force[1])
            if load.at != joint.on_second:
                px, py = frames.position(self.mechanism.point(load.link, load.at), load.name)
                arm = add(px.value, neg(ox.value)), add(py.value, neg(oy.value))
                moment = add(moment, moment_of(arm, load.force))
        others = tuple(load for load in loads if load.link != joint.second)
        return Wrench(x, y, moment, others)


def _along(x: Jet, y: Jet, length: Jet, across: Term) -> Pair:
    """The unit vector d with ``(x, y) = l d + c n``: ``(l (x, y) + c (y, -x))/(l^2 + c^2)``."""
    c = hy.expression(0.0) if across is None else across
    square = x.half_square() + y.half_square()
    whole = 2.0 * dense(square.value)
    inverse = square.chain(1.0 / whole, -2.0 / (whole * whole), 8.0 / (whole * whole * whole))
    return (length * x + y * c) * inverse, (length * y - x * c) * inverse


def wrap(before: Pair, after: Pair, sense: float) -> Jet:
    """The angle [rad] that a rope turns by, counted in a sense (1 counterclockwise), 0 to 2 pi."""
    (bx, by), (ax, ay) = before, after
    sine = (bx * ay - by * ax) * sense
    cosine = bx * ax + by * ay
    s, c = dense(sine.value), dense(cosine.value)
    value = math.pi + hy.atan2(-s, -c)
    # of unit vectors: d angle = c ds - s dc, and the rate of that but for accelerations
    turned = cosine.across(sine)
    return Jet(value, turned.gradient, turned.rate, turned.curvature)
