"""Sliding contacts of higher pairs: point of contact, slip, wrench of friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, add, dense, div, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import PairClosure
from mechanism_sim.planar.protocols import Load, Wrench, moment_of

Point = tuple[Term, Term]


@dataclass(frozen=True)
class Touch:
    """Contact whose point follows from the line of action of the closure's force.

    It is the point of the line that is nearest to the joint's point on one of the links, or
    `offset` beside that, along the positive force on the second: a roller touches by its radius
    before its centre, and a pin behind it.
    """

    closure: PairClosure
    name: str  #: of its parameters
    offset: float = 0.0  #: offset along the positive force on the second [m]
    at_pin: bool = False  #: whether the joint's point on the first-named link counts
    share: float = 1.0  #: factor of the coefficient; of a roller, pin radius over its own

    def on(self, way: float) -> Touch:
        """Contact on the wall that presses on the second along (1) or against (-1) the force."""
        return replace(self, name=f'{self.name}.{way:g}', offset=way * self.offset)

    @property
    def _ends(self) -> tuple[tuple[str, str, tuple[float, float]], ...]:
        j = self.closure.joint
        return ('first', j.first, j.on_first), ('second', j.second, j.on_second)

    def _points(self, frames: Frames) -> tuple[JetPair, JetPair]:
        m = self.closure.mechanism
        one, two = (
            frames.position(m.point(link, at), f'{self.name}.{which}')
            for which, link, at in self._ends
        )
        return one, two

    def contact(self, frames: Frames) -> tuple[Point, Point]:
        """Unit normal on the second-named link; from its point to the contact [m]."""
        unit = self.closure.wrench(frames, [hy.expression(1.0)])
        x, y = dense(unit.x), dense(unit.y)
        size = hy.sqrt(x * x + y * y)
        nx, ny = x / size, y / size
        off, moment = frames.parameters(f'{self.name}.offset', self.offset), unit.moment
        px = py = None  # from there to the pin
        if self.at_pin:
            (x1, y1), (x2, y2) = self._points(frames)
            px, py = add(x1.value, neg(x2.value)), add(y1.value, neg(y2.value))
            moment = add(moment, neg(moment_of((px, py), (x, y))))
        arm = div(moment, size)
        from_point = add(px, mul(arm, ny), mul(off, nx)), add(py, neg(mul(arm, nx)), mul(off, ny))
        return (nx, ny), from_point

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the second-named link on the first, along the normal turned by +90."""
        m = self.closure.mechanism
        (nx, ny), (dx, dy) = self.contact(frames)
        (x1, y1), (x2, y2) = self._points(frames)
        w1, w2 = (
            m.turning(frames, link, at, f'{self.name}.{which}').rate
            for which, link, at in self._ends
        )
        from_first = add(x2.value, dx, neg(x1.value)), add(y2.value, dy, neg(y1.value))
        vx = add(x2.rate, neg(mul(w2, dy)), neg(x1.rate), mul(w1, from_first[1]))
        vy = add(y2.rate, mul(w2, dx), neg(y1.rate), neg(mul(w1, from_first[0])))
        rate = add(mul(vy, nx), neg(mul(vx, ny)))
        if rate is None:
            return lift(0.0)
        slopes = {c: hy.diff(rate, frames.v[c]) for c in frames.coordinates}
        bends = [hy.diff(rate, frames.q[c]) * frames.v[c] for c in frames.coordinates]
        return Jet(None, slopes, rate, hy.sum(bends))

    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """Wrench on the second-named link of a force T along the slip."""
        (nx, ny), arm = self.contact(frames)
        force = neg(mul(T, ny)), mul(T, nx)
        return Wrench(*force, moment_of(arm, force))

    def loads(self, frames: Frames, T: Term) -> list[Load]:
        """Opposite forces at the contact."""
        x, y, moment, _ = self.wrench(frames, T)
        (x1, y1), (x2, y2) = self._points(frames)
        between = add(x2.value, neg(x1.value)), add(y2.value, neg(y1.value))
        back = neg(x), neg(y)
        other = add(neg(moment), moment_of(between, back))
        j = self.closure.joint
        return [
            Load(f'{self.name}.first', j.first, j.on_first, back, other),
            Load(f'{self.name}.second', j.second, j.on_second, (x, y), moment),
        ]

    def engaged(self, frames: Frames) -> Term:
        """1 while there is friction, 0 where something else holds the links; None if always."""
        engaged = getattr(self.closure, 'engaged', None)
        return engaged(frames) if engaged else None


@dataclass(frozen=True)
class TurningTouch:
    """Sliding of teeth: mean distance from the pitch point times relative angular velocity.

    Its friction is a couple.
    """

    closure: PairClosure
    name: str  #: of its parameters
    arm: float  #: mean distance from the pitch point [m]
    share: float = 1.0  #: factor of the coefficient, for the force in the plane

    def on(self, way: float) -> TurningTouch:
        """Contact on either flank, with the same slip."""
        return self

    def slip(self, frames: Frames) -> Jet:
        """Slip of the second-named link on the first [m/s]."""
        j, m = self.closure.joint, self.closure.mechanism
        first = frames.turn(m.turns(j.first, j.on_first), f'{self.name}.first')
        second = frames.turn(m.turns(j.second, j.on_second), f'{self.name}.second')
        turned = (second - first) * lift(dense(frames.parameters(f'{self.name}.arm', self.arm)))
        return turned.as_rate

    def wrench(self, frames: Frames, T: Term) -> Wrench:
        """A moment."""
        return Wrench(None, None, mul(T, frames.parameters(f'{self.name}.arm', self.arm)))

    def engaged(self, frames: Frames) -> Term:
        """Always."""
        return None
