"""Belts and chains: two pulleys whose strands pull, ideal or with the stiffness of the strands.

With unit normals n+ and n- from the first centre to where the strands leave the first pulley, on
the left (+) and on the right (-) of the line of centres u, and t+, t- along the strands to the
second pulley, tensions T+ and T- do to the second pulley

    F = -T+ t+ - T- t-,    M = s r2 (T+ - T-)

about its centre, with s = 1 for an open belt, -1 for a crossed one. As the strands are tangents,
the same two forces balance on the first pulley. The left strand is longer by
``x = r1 a1 - s r2 a2`` than at the start, the right one shorter: an ideal belt keeps x at zero, a
strand of stiffness k pulls with ``T0 + k x + c x'`` if it is taut and that is positive, else not
at all. What x has to do with angles a follows from the power of the strands, T+ x' - T- x'.

A belt that friction holds keeps x' at zero as long as the tensions on the pulley that it wraps
least, by phi, are in a ratio of at most ``e^(mu phi)`` (L. Euler 1762, J. A. Eytelwein 1808); then
it slips at that ratio. Its centres are fixed and it does not stretch: what one strand pulls more
than the pretension T0, the other pulls less (F. Reuleaux), so that the pull ``T+ - T-`` is at most
``2 T0 tanh(mu phi/2)``. Flanks of a groove of angle alpha press with ``1/sin(alpha/2)`` times the
force: so much more is mu of a V-belt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import heyoka as hy
import numpy as np

from mechanism_sim.joints.transmission.constraint import Transmission, TransmissionClosure
from mechanism_sim.linkages.springs import never_against
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2
from mechanism_sim.planar.protocols import ForceElement, Load, Wrench, moment_of
from mechanism_sim.planar.view import Draft, circle


class Strand(NamedTuple):
    """One of the two strands, in the frame of the carrier."""

    leaves: Vector2  #: [m] the first pulley
    meets: Vector2  #: [m] the second pulley
    way: Vector2  #: unit vector between them
    side: float  #: 1 on the left, -1 on the right


@dataclass(frozen=True)
class Belt(Transmission):
    """A belt over two pulleys that turn on a common carrier."""

    radii: tuple[float, float] = (1.0, 1.0)  #: [m]
    centre: Vector2 = (0.0, 0.0)  #: [m] of the first pulley, in the carrier's frame
    apart: Vector2 = (1.0, 0.0)  #: [m] from there to that of the second
    shafts: tuple[str, ...] = ()
    stiffness: float = 0.0  #: [N/m]; 0 for an ideal belt
    damping: float = 0.0  #: [N s/m]
    pretension: float = 0.0  #: [N]
    friction: float | None = None  #: coefficient, if that alone holds it; as on a flat pulley
    begun: tuple[int, int, int] = (0, 0, 0)
    """Whole turns of first, second and carrier that it did not follow: it was put on after."""

    @property
    def bearings(self) -> tuple[str, ...]:
        """The shafts, which its forces load."""
        return self.shafts

    @property
    def elastic(self) -> bool:
        """True if the strands are elastic, or the belt slips."""
        return self.stiffness > 0.0 or self.slips

    @property
    def preloaded(self) -> bool:
        """True if both strands are elastic and in tension at rest."""
        return self.stiffness > 0.0 and self.pretension > 0.0

    @property
    def slips(self) -> bool:
        """True if friction alone holds it."""
        return self.friction is not None

    @property
    def wrap(self) -> float:
        """The smaller angle of contact [rad]; a crossed belt has the same on both pulleys."""
        (r1, r2), s = self.radii, self.sense
        across = math.asin((r1 - s * r2) / math.hypot(*self.apart))
        return math.pi - 2.0 * (abs(across) if s > 0.0 else -across)

    @property
    def most(self) -> float:
        """The largest difference of tensions before it slips [N]."""
        return 2.0 * self.pretension * math.tanh(0.5 * (self.friction or 0.0) * self.wrap)

    @property
    def sense(self) -> float:
        """1 if the pulleys turn the same way, -1 if the belt is crossed."""
        return math.copysign(1.0, self.ratio)

    @property
    def strands(self) -> tuple[Strand, Strand]:
        """Left and right strand."""
        (r1, r2), s, d = self.radii, self.sense, math.hypot(*self.apart)
        slope = (r1 - s * r2) / d
        along, across = slope, math.sqrt(1.0 - slope**2)
        u = self.apart[0] / d, self.apart[1] / d
        found = []
        for side in (1.0, -1.0):
            nx = along * u[0] - side * across * u[1]
            ny = along * u[1] + side * across * u[0]
            leaves = self.centre[0] + r1 * nx, self.centre[1] + r1 * ny
            meets = (
                self.centre[0] + self.apart[0] + s * r2 * nx,
                self.centre[1] + self.apart[1] + s * r2 * ny,
            )
            way = meets[0] - leaves[0], meets[1] - leaves[1]
            length = math.hypot(*way)
            found.append(Strand(leaves, meets, (way[0] / length, way[1] / length), side))
        return found[0], found[1]

    def closure(self, mechanism: Mechanism) -> BeltClosure:
        """The ideal belt."""
        return BeltClosure(self, mechanism)

    def elements(self, mechanism: Mechanism) -> Sequence[ForceElement]:
        """Force elements of elastic or slipping strands."""
        kind = SlippingBelt if self.slips else BeltForce
        return [kind(self, mechanism)] if self.elastic else []

    def draw(self, draft: Draft) -> None:
        """Pulleys, and the strands between them."""
        sides = self.points
        for (link, at), radius in zip(sides, self.radii, strict=True):
            if draft.first(f'{link} {radius:.9g}'):
                draft.add('wheel', link, circle(radius, at), size=radius)
        for strand in self.strands:
            draft.add('belt', self.carrier, np.array([strand.leaves, strand.meets]))

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """The pulleys."""
        sides = self.points
        return list(zip(sides, self.radii, strict=True))


@dataclass(frozen=True)
class BeltClosure(TransmissionClosure):
    """A ratio of angles that strands keep, which load the shafts."""

    joint: Belt

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Wrench of the difference of tensions on the second pulley."""
        moment = super().wrench(frames, forces).moment
        joint = self.joint
        pull = joint.sense * joint.radii[1]
        difference = mul(moment, frames.parameters(f'{self.name}.by_moment', 1.0 / pull))
        half = mul(difference, frames.parameters(f'{self.name}.half', 0.5))
        tensions = half, neg(half)
        return _strand_wrench(joint, self.mechanism, frames, tensions)._replace(moment=moment)


class _Tension(NamedTuple):
    """Tension of an elastic strand."""

    taut: Term  #: 1 where it is, else 0
    length: Term  #: [m] by which it is stretched
    rate: Term  #: [m/s] of that
    stored: Term  #: [N] by its stiffness
    whole: Term  #: [N] with its damping, and never less than zero


@dataclass(frozen=True)
class BeltForce:
    """Belt with elastic strands, in the place of a joint."""

    joint: Belt
    mechanism: Mechanism

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.joint.name

    def _stretch(self, frames: Frames) -> tuple[Term, Term]:
        """Elongation of the left strand [m], and its rate [m/s]."""
        joint, m, p = self.joint, self.mechanism, frames.parameters
        (r1, r2), s = joint.radii, joint.sense
        value: Term = p(f'{self.name}.phase', s * r2 * joint.phase)
        rate: Term = None
        turning = (
            (joint.first, joint.on_first, r1), (joint.second, joint.on_second, -s * r2),
            (joint.carrier, (0.0, 0.0), s * r2 - r1),
        )  # fmt: skip
        for k, (link, at, arm) in enumerate(turning):
            frame, offset = m.frame(link)
            lever = p(f'{self.name}.arm.{k}', arm)
            value = add(value, p(f'{self.name}.offset.{k}', arm * offset))
            if frame != GROUND:
                begun = p(f'{self.name}.begun.{k}', float(joint.begun[k]))
                turns = add(frames.turns(frame), neg(begun))
                angle = frames.q[frame] + 2.0 * math.pi * turns
                value = add(value, mul(lever, angle))
                rate = add(rate, mul(lever, frames.v[frame]))
            bent = m.bent(frames, link, at, f'{self.name}:{link}')
            value, rate = add(value, mul(lever, bent.value)), add(rate, mul(lever, bent.rate))
        return value, rate

    def _strands(self, frames: Frames) -> list[_Tension]:
        """The left one, and the right one."""
        joint, p = self.joint, frames.parameters
        x, x_rate = self._stretch(frames)
        start = p(f'{self.name}.stretched', joint.pretension / joint.stiffness)
        k = p(f'{self.name}.stiffness', joint.stiffness)
        c = p(f'{self.name}.damping', joint.damping)
        found = []
        for side, own, rate in (('left', x, x_rate), ('right', neg(x), neg(x_rate))):
            length = add(start, own)
            taut = frames.switch(f'{self.name}.{side}', dense(length) / joint.radii[0])
            stored, total = mul(k, length), add(mul(k, length), mul(c, rate))
            if joint.damping:
                size = dense(k) * joint.radii[0]
                total = never_against(frames, f'{self.name}.{side}', 1, total, size)
            found.append(_Tension(taut, length, rate, mul(taut, stored), mul(taut, total)))
        return found

    def _tensions(self, frames: Frames) -> tuple[Term, Term]:
        left, right = self._strands(frames)
        return left.whole, right.whole

    def wrench(self, frames: Frames) -> Wrench:
        """Wrench of the strands on the second pulley."""
        return _strand_wrench(self.joint, self.mechanism, frames, self._tensions(frames))

    def loads(self, frames: Frames) -> list[Load]:
        """Loads on both pulleys, which balance each other."""
        joint, w = self.joint, self.wrench(frames)
        ux, uy = frames.position(
            self.mechanism.direction(joint.carrier, math.atan2(*joint.apart[::-1])),
            f'{self.name}.centres',
        )
        d = frames.parameters(f'{self.name}.apart', math.hypot(*joint.apart))
        lever = mul(d, moment_of((ux.value, uy.value), (w.x, w.y)))
        return [
            Load(f'{self.name}.first', joint.first, joint.on_first, (neg(w.x), neg(w.y)),
                 neg(add(w.moment, lever))),
            Load(f'{self.name}.second', joint.second, joint.on_second, (w.x, w.y), w.moment),
        ]  # fmt: skip

    def power_lost(self, frames: Frames) -> Term:
        """Power dissipated in the strands [W]: ``c x'^2`` of those in tension."""
        return add(*(
            mul(add(s.whole, neg(s.stored)), s.rate) for s in self._strands(frames)
        ))  # fmt: skip

    def energy(self, frames: Frames) -> Term:
        """``k length^2/2`` of the strands that are taut."""
        k = frames.parameters(f'{self.name}.stiffness', self.joint.stiffness)
        half = mul(k, hy.expression(0.5))
        return add(*(
            mul(s.taut, mul(half, mul(s.length, s.length))) for s in self._strands(frames)
        ))  # fmt: skip


@dataclass(frozen=True)
class SlippingBelt(BeltForce):
    """A belt that friction holds, or lets slip: the pull acts against the slip x'."""

    def _pull(self, frames: Frames) -> tuple[Term, Term]:
        """Difference of tensions [N], and the slip [m/s]."""
        _, rate = self._stretch(frames)
        slips = frames.slip(f'joints:{self.name}.friction', dense(rate)).flag
        most = frames.parameters(f'{self.name}.most', self.joint.most)
        return mul(most, 2.0 * slips - 1.0), rate

    def _tensions(self, frames: Frames) -> tuple[Term, Term]:
        half = mul(hy.expression(0.5), self._pull(frames)[0])
        mean = frames.parameters(f'{self.name}.pretension', self.joint.pretension)
        return add(mean, half), add(mean, neg(half))

    def power_lost(self, frames: Frames) -> Term:
        """Pull times slip."""
        return mul(*self._pull(frames))

    def energy(self, _: Frames) -> Term:
        """Stored energy: none."""
        return None


def _strand_wrench(
    joint: Belt, mechanism: Mechanism, frames: Frames, tensions: tuple[Term, Term]
) -> Wrench:
    """Wrench on the second pulley of tensions [N] of the left and the right strand."""
    x: Term = None
    y: Term = None
    for strand, tension in zip(joint.strands, tensions, strict=True):
        angle = math.atan2(*strand.way[::-1])
        name = f'{joint.name}.strand.{strand.side:g}'
        tx, ty = frames.position(mechanism.direction(joint.carrier, angle), name)
        x, y = add(x, neg(mul(tension, tx.value))), add(y, neg(mul(tension, ty.value)))
    lever = frames.parameters(f'{joint.name}.pull', joint.sense * joint.radii[1])
    return Wrench(x, y, mul(lever, add(tensions[0], neg(tensions[1]))))
