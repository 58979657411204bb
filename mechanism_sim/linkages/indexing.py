"""Intermittent motion: a driving pin that moves a slotted follower, which is locked meanwhile.

Slots repeat, so their distance from the pin is written as a periodic function: with N slots on a
wheel, a sine of N times the pin's direction in the wheel's frame ([V] 2.6). A switch tells whether
the pin is in a slot. Where it enters and leaves, the distance from the slot and that from the
locked position agree, and the pin moves along the slot: the motion goes on without an impact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy

from mechanism_sim.numerics.symbolic import Term, add, dense, div, mul, neg
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet, lift
from mechanism_sim.planar.loads import Wrench, moment_of
from mechanism_sim.planar.mechanism import GROUND, Geneva, Mechanism, SlottedRack

Pair = tuple[Jet, Jet]


@dataclass(frozen=True)
class GenevaClosure:
    """A Geneva wheel without play."""

    name: str
    mechanism: Mechanism

    @property
    def _joint(self) -> Geneva:
        joint = self.mechanism.joint(self.name)
        if not isinstance(joint, Geneva):
            raise TypeError(f'{self.name} is not a Geneva wheel')
        return joint

    def _pin(self, frames: Frames) -> Pair:
        """From the wheel's centre to the pin, in the world [m]."""
        return frames.position(self.mechanism.separation(self.name), self.name)

    def engaged(self, frames: Frames) -> Term:
        """1 while the pin is in a slot: nearer to the wheel's centre than the slots' mouths."""
        x, y = self._pin(frames)
        square = frames.parameters(f'{self.name}.entry.square', self._joint.entry**2)
        inside = add(square, neg(mul(x.value, x.value)), neg(mul(y.value, y.value)))
        return frames.switch(self.name, dense(inside) / self._joint.entry**2)

    def offset(self, frames: Frames) -> Jet:
        """How far the pin, or the locked wheel at the slot's mouth, is off its place [m].

        ``(r/N) sin(N (phi - psi))`` with the pin at polar coordinates r, phi about the wheel's
        centre; ``(R/N) sin(N (psi - towards))`` with the slots' mouths at R.
        """
        joint, p = self._joint, frames.parameters
        x, y = self._pin(frames)
        wheel = frames.angle(self.mechanism.frame(joint.second)[0])
        radius, angle = _polar(x, y)
        slot = radius * _sine(angle - wheel, joint.slots)
        towards = lift(dense(p(f'{self.name}.towards', joint.towards)))
        entry = lift(dense(p(f'{self.name}.entry', joint.entry)))
        locked = _sine(wheel - towards, joint.slots) * entry
        return _either(self.engaged(frames), slot, locked)

    def normal(self, frames: Frames) -> Pair:
        """Across the direction from the wheel's centre to the pin."""
        x, y = self._pin(frames)
        half = x.half_square() + y.half_square()
        r = hy.sqrt(2.0 * half.value)
        return -y / r, x / r

    def values(self, frames: Frames) -> list[Jet]:
        """The offset [m]."""
        return [self.offset(frames)]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The pin presses across the slot; the crank's arc through the crank's centre."""
        return self.pressed(frames, forces[0])

    def pressed(self, frames: Frames, force: Term) -> Wrench:
        """What a force along the offset does to the wheel."""
        joint, on = self._joint, self.engaged(frames)
        moment = mul(force, self.offset(frames).gradient[self.mechanism.frame(joint.second)[0]])
        x, y = self._pin(frames)
        r = hy.sqrt(dense((x * x + y * y).value))
        off = 1.0 - on
        p, t = frames.parameters, joint.towards
        distance = dense(p(f'{self.name}.distance', joint.distance))
        sx, cx = p(f'{self.name}.towards.y', math.sin(t)), p(f'{self.name}.towards.x', math.cos(t))
        # across the slot lies the pin's direction turned by 90 degrees
        across, arc = mul(on, moment) / r, mul(off, moment) / distance
        return Wrench(
            add(neg(mul(across, dense(y.value) / r)), neg(mul(arc, sx))),
            add(mul(across, dense(x.value) / r), mul(arc, cx)),
            moment,
        )


@dataclass(frozen=True)
class RackClosure:
    """A slotted rack without play."""

    name: str
    mechanism: Mechanism

    @property
    def _joint(self) -> SlottedRack:
        joint = self.mechanism.joint(self.name)
        if not isinstance(joint, SlottedRack):
            raise TypeError(f'{self.name} is not a slotted rack')
        return joint

    def _along(self, frames: Frames, x: Jet, y: Jet) -> tuple[Jet, Jet]:
        """Components along the rack and across it."""
        p, a = frames.parameters, self._joint.axis
        c = lift(dense(p(f'{self.name}.axis.x', math.cos(a))))
        s = lift(dense(p(f'{self.name}.axis.y', math.sin(a))))
        return x * c + y * s, y * c - x * s

    def _from_centre(self, frames: Frames, link: str, at: tuple[float, float]) -> Pair:
        label = f'{self.name}.{link}'
        x, y = frames.position(self.mechanism.point(link, at), label)
        ox, oy = frames.position({(GROUND, None): self._joint.centre}, f'{self.name}.centre')
        return self._along(frames, x - ox, y - oy)

    def engaged(self, frames: Frames) -> Term:
        """1 while the pin is on the right of the axis through the crank's centre."""
        joint = self._joint
        _, across = self._from_centre(frames, joint.first, joint.on_first)
        return frames.switch(self.name, -dense(across.value) * (2.0 / joint.pitch))

    def normal(self, frames: Frames) -> Pair:
        """Along the rack."""
        p, a = frames.parameters, self._joint.axis
        x, y = p(f'{self.name}.axis.x', math.cos(a)), p(f'{self.name}.axis.y', math.sin(a))
        return lift(dense(x)), lift(dense(y))

    def values(self, frames: Frames) -> list[Jet]:
        """How far the pin, or the locked rack, is off its place along the rack [m]."""
        joint = self._joint
        pin, _ = self._from_centre(frames, joint.first, joint.on_first)
        slot, _ = self._from_centre(frames, joint.second, joint.on_second)
        wave = dense(frames.parameters(f'{self.name}.wave', 2.0 * math.pi / joint.pitch))

        def periodic(x: Jet) -> Jet:
            argument = wave * dense(x.value)
            c, s = hy.cos(argument), hy.sin(argument)
            return x.chain(s / wave, c, -(wave * s))

        return [_either(self.engaged(frames), periodic(pin - slot), periodic(slot))]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Along the rack: at the pin, or, locked, at the slot's own point."""
        joint, on = self._joint, self.engaged(frames)
        push = mul(forces[0], self.values(frames)[0].gradient[joint.second])
        p, a = frames.parameters, joint.axis
        force = (
            mul(push, p(f'{self.name}.axis.x', math.cos(a))),
            mul(push, p(f'{self.name}.axis.y', math.sin(a))),
        )
        x, y = frames.position(self.mechanism.separation(self.name), f'{self.name}.pin')
        return Wrench(*force, mul(on, moment_of((x.value, y.value), force)))


def _polar(x: Jet, y: Jet) -> Pair:
    """Radius and angle of a vector that does not vanish."""
    half = x.half_square() + y.half_square()
    r = hy.sqrt(2.0 * half.value)
    square, turning = r * r, x.across(y)
    angle = Jet(
        hy.atan2(dense(y.value), dense(x.value)),
        {n: div(g, square) for n, g in turning.gradient.items()},
        div(turning.rate, square),
        add(
            div(turning.curvature, square),
            neg(mul(div(turning.rate, square), 2.0 * half.rate / square)),
        ),
    )
    return half.chain(r, 1.0 / r, -1.0 / (square * r)), angle


def _sine(x: Jet, n: int) -> Jet:
    """``sin(n x)/n``."""
    c, s = hy.cos(n * x.value), hy.sin(n * x.value)
    return x.chain(s / n, c, -(n * s))


def _either(flag: Term, a: Jet, b: Jet) -> Jet:
    """The first where the flag is 1, the second where it is 0; the flag does not move."""
    return a * lift(flag) + b * lift(1.0 - flag)
