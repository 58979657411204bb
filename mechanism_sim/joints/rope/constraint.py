"""A rope through points of any links and over pulleys on them: in tension, or slack.

Between the centres C of its points, with the radii r of pulleys counted positive where the rope
passes counterclockwise, an open stretch with the unit vector d and its left normal n has

    C2 - C1 = l d + (r2 - r1) n

and the angle theta of d the arc ``r (theta2 - theta1)`` on a pulley between two stretches. The
length is the sum of all l and arcs. As stretches are tangents, its derivative is the sum of
``d . (dC2 - dC1)``: what the turning of a tangent takes from a stretch it gives to the arcs. So
the tension acts along d at the centres. Pulleys turn as they like and without inertia; the rope
has neither mass nor stiffness. On a drum, a pulley at its end, it is wound up: there the arc is
``r (theta - phi)`` with the drum's angle phi, all turns counted, and the tension has a moment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array, ComplexArray
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure, gathered
from mechanism_sim.planar.frames import Frames, Jet, JetPair
from mechanism_sim.planar.gaps import Wall
from mechanism_sim.planar.mechanism import HigherPair, Mechanism
from mechanism_sim.planar.points import LinkPoint
from mechanism_sim.planar.protocols import Load, Wrench
from mechanism_sim.planar.view import Draft, Side, circle


class Drum(NamedTuple):
    """Reference position of a rope on a drum."""

    way: float  #: direction of the rope [rad]
    angle: float  #: angle of the drum's link [rad]
    turns: int = 0  #: whole turns of the link beside that


class Pulley(NamedTuple):
    """A point of a rope, and the pulley there."""

    place: LinkPoint
    radius: float = 0.0  #: [m] positive if the rope passes counterclockwise; 0 for a point
    drum: Drum | None = None  #: reference of a drum at the rope's end


@dataclass(frozen=True)
class Rope(HigherPair):
    """A rope of a length; `first` and `second` are links of two of its points."""

    equations: ClassVar[int] = 0
    sides: ClassVar[tuple[Side, ...]] = ('left',)
    parts: ClassVar[str] = 'rope'

    pulleys: tuple[Pulley, ...] = ()
    length: float = 0.0  #: length of the rope [m]

    @property
    def links(self) -> tuple[str, ...]:
        """Links of all points of the rope."""
        return tuple(dict.fromkeys(p.place[0] for p in self.pulleys))

    @property
    def extent(self) -> float:
        """Largest radius of the pulleys [m]."""
        return max(abs(p.radius) for p in self.pulleys)

    def bears(self, link: str) -> bool:
        """True if a link carries a point of the rope."""
        return link in self.links

    def closure(self, mechanism: Mechanism) -> RopeClosure:
        """Closure of the taut rope."""
        return RopeClosure(self, mechanism)

    def covered(self) -> Sequence[LinkPoint]:
        """All points of the rope."""
        return [p.place for p in self.pulleys]

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """The pulleys."""
        return [(p.place, abs(p.radius)) for p in self.pulleys if p.radius]

    def draw(self, draft: Draft) -> None:
        """Draw the pulleys, and extend links to the points of the rope."""
        for (link, at), radius, _ in self.pulleys:
            draft.reach((link, at))
            if radius and draft.first(f'{link} {at} {abs(radius):.9g}'):
                draft.add('wheel', link, circle(abs(radius), at), size=abs(radius))
        for one, two in pairwise(self.pulleys):
            draft.string((one.place, two.place), (one.radius, two.radius))


class Stretch(NamedTuple):
    """An open stretch of a rope."""

    span: JetPair  #: vector between the centres of its ends [m]
    length: hy.expression  #: length [m]
    way: tuple[hy.expression, hy.expression]  #: unit vector along it

    @property
    def pulled(self) -> Jet:
        """``d . span'``, with ``(n . span')^2/l`` for the turning of d."""
        (x, y), (dx, dy) = self.span, self.way
        along = x * dx + y * dy
        across = dense((y * dx - x * dy).rate)
        turned = across * across / self.length
        return Jet(None, along.gradient, along.rate, add(along.curvature, turned))


@dataclass(frozen=True)
class RopeClosure(HigherClosure[Rope]):
    """A rope that is taut."""

    def _stretches(self, frames: Frames) -> list[Stretch]:
        m, pulleys = self.mechanism, self.joint.pulleys
        places = [
            frames.position(m.point(*p.place), f'{self.name}.{k}') for k, p in enumerate(pulleys)
        ]
        found = []
        for k, ((x1, y1), (x2, y2)) in enumerate(pairwise(places)):
            span = x2 - x1, y2 - y1
            x, y = dense(span[0].value), dense(span[1].value)
            far = x * x + y * y
            off = pulleys[k + 1].radius - pulleys[k].radius
            across = frames.parameters(f'{self.name}.across.{k}', off)
            if across is None:
                length = hy.sqrt(far)
                way = x / length, y / length
            else:  # span = l d + c n
                length = hy.sqrt(far - across * across)
                way = (length * x + across * y) / far, (length * y - across * x) / far
            found.append(Stretch(span, length, way))
        return found

    def values(self, frames: Frames) -> list[Jet]:
        """Excess of the path's length over the rope's [m]."""
        stretches = self._stretches(frames)
        excess = [s.length for s in stretches]
        for k, (before, after) in enumerate(pairwise(stretches), start=1):
            if radius := self.joint.pulleys[k].radius:
                size = dense(frames.parameters(f'{self.name}.radius.{k}', abs(radius)))
                (bx, by), (ax, ay), sense = before.way, after.way, math.copysign(1.0, radius)
                # half a turn and more while the rope bends the other way than the pulley
                wrap = math.pi + hy.atan2(sense * (by * ax - bx * ay), -(bx * ax + by * ay))
                excess.append(size * wrap)
        total = Jet(None, {}, None, None)
        for stretch in stretches:
            total += stretch.pulled
        for k, side in ((0, 1.0), (len(stretches), -1.0)):
            if drum := self.joint.pulleys[k].drum:
                way = stretches[0 if k == 0 else -1].way
                turned = self._off_drum(frames, k, drum, way)
                radius = self.joint.pulleys[k].radius
                size = dense(frames.parameters(f'{self.name}.drum.{k}', radius))
                excess.append(size * dense(turned.value) * side)
                total += Jet(None, turned.gradient, turned.rate, None) * (size * side)
        own = neg(frames.parameters(f'{self.name}.length', self.joint.length))
        return [Jet(add(own, *excess), total.gradient, total.rate, total.curvature)]

    def _off_drum(
        self, frames: Frames, k: int, drum: Drum, way: tuple[hy.expression, hy.expression]
    ) -> Jet:
        """Rotation of the rope off a drum [rad]; the gradient covers the drum's rotation only."""
        link, at = self.joint.pulleys[k].place
        (x, y), (frame, offset) = way, self.mechanism.frame(link)
        c, s = (
            dense(frames.parameters(f'{self.name}.way.{k}.{axis}', value))
            for axis, value in (('x', math.cos(drum.way)), ('y', math.sin(drum.way)))
        )
        swung = hy.atan2(y * c - x * s, x * c + y * s)
        phi = self.mechanism.turning(frames, link, at, f'{self.name}:{k}')
        begun = frames.parameters(f'{self.name}.begun.{k}', offset - drum.angle)
        turns = add(
            frames.turns(frame), neg(frames.parameters(f'{self.name}.turns.{k}', drum.turns))
        )
        wound = add(phi.value, begun, mul(hy.expression(2.0 * math.pi), turns))
        return Jet(add(swung, neg(wound)), (-phi).gradient, neg(phi.rate), None)

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The row draws the points together: along the stretches, at the middles of pulleys."""
        joint, pull = self.joint, neg(forces[0])
        along = [(mul(pull, x), mul(pull, y)) for _, _, (x, y) in self._stretches(frames)]
        loads = []
        for k, p in enumerate(joint.pulleys):
            out = along[k] if k < len(along) else (None, None)
            back = along[k - 1] if k else (None, None)
            force = add(out[0], neg(back[0])), add(out[1], neg(back[1]))
            arm = frames.parameters(f'{self.name}.drum.{k}', p.radius if p.drum else 0.0)
            turn = mul(pull, arm) if k == 0 else neg(mul(pull, arm))
            loads.append(Load(f'{self.name}.{k}', *p.place, force, turn))
        return gathered(joint, self.mechanism, frames, loads)


@dataclass(frozen=True)
class Slack(Wall):
    """Slack of a rope: its length less that of its path."""

    closure: RopeClosure

    def _laid(self, q: Array) -> tuple[Array, ComplexArray]:
        """Lengths (k, N) [m] and directions of its open stretches at q (n, N)."""
        pulleys, tree = self.closure.joint.pulleys, self.closure.mechanism
        places = np.array([tree.locate_all(link, q, at) for (link, at), *_ in pulleys])
        along = np.diff(places[:, 0] + 1j * places[:, 1], axis=0)  # (l + i off) d
        off = np.diff([p.radius for p in pulleys])[:, None]
        lengths = np.sqrt(np.maximum(np.abs(along) ** 2 - off**2, 0.0))
        return lengths, along / (lengths + 1j * off)

    def lengths(self, q: Array) -> Array:
        """Lengths (k, N) [m] of its open stretches at q (n, N)."""
        return self._laid(q)[0]

    def arcs(self, q: Array) -> dict[str, Array]:
        """Wrap angles (N,) [rad] on the pulleys at q (n, N), 0 to 2 pi; by their names."""
        ways, pulleys = self._laid(q)[1], self.closure.joint.pulleys
        found = {}
        for k, p in enumerate(pulleys[1:-1]):
            bend = ways[k + 1] * ways[k].conjugate()
            if p.radius:
                name = f'its pulley on {p.place[0]}, point {k + 2} of {self.joint}'
                angle = np.angle(bend if p.radius > 0.0 else bend.conjugate())
                found[name] = np.mod(angle, 2.0 * math.pi)
        return found

    @property
    def overlap(self) -> str:
        """Words for an overlap: the points of the rope beyond its length."""
        return f'the points of {self.joint} beyond its length'
