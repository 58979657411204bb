"""Revolute joints with clearance: a gap between pin and bushing, or an oil film."""

from __future__ import annotations

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.film import JournalMotion, ShortBearing, Vector
from mechanism_sim.numerics.symbolic import Term, add, dense, mul, neg
from mechanism_sim.planar.frames import Frames, Jet, JetPair
from mechanism_sim.planar.gaps import RoundGap, with_turning
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import Point
from mechanism_sim.planar.protocols import Load, Wrench
from mechanism_sim.tolerances import TOLERANCES


@dataclass(frozen=True)
class BearingClearance(RoundGap):
    """A pin on the first-named link, loose in a bushing on the second-named link.

    With Q from bushing centre to pin centre and radial clearance c, the gap is ``c - |Q|``
    ([SB] 4.2). The engine is given ``(c^2 - Q.Q)/(2 c)``: equal to it at contact in value and in
    first derivative, smooth when the pin is at the centre, and free of a square root.
    """

    name: str
    mechanism: Mechanism
    clearance: float  #: radial clearance c [m]
    pin_radius: float = 0.0  #: radius of the pin [m]

    def value(self, frames: Frames) -> Jet:
        """``(c^2 - Q.Q)/(2 c)`` [m]."""
        x, y = self._pin_in_bushing(frames)
        half = dense(frames.parameters(f'{self.name}.half_clearance', 0.5 * self.clearance))
        gap: Jet = (x.half_square() + y.half_square()) * self._minus_curvature(frames) + half
        return gap

    @property
    def joint(self) -> str:
        """The gap is the joint's only one."""
        return self.name

    @property
    def arm(self) -> float:
        """Distance from the bushing's centre to the contact [m]."""
        return self.pin_radius + self.clearance

    @property
    def room(self) -> float:
        """``-c`` [m]."""
        return -self.clearance

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the pin's surface along the bushing's, ``Q'.t + rp w1 - (rp + c) w2`` [m/s].

        Both surfaces pass the point of contact: at the distance rp from the pin's centre and at
        rp + c from the bushing's. Its rate is ``Q''.t + rp w1' - (rp + c) w2'``. Pressed into one
        another both pass the pin's surface, where c becomes ``|Q|``.
        """
        x, y = self._pin_in_bushing(frames)
        tangential: Jet = -(x.across(y) * self._minus_curvature(frames))
        joint = self.mechanism.joint(self.joint)
        known = frames, self.mechanism, self.name
        if self.law is None:
            return with_turning(tangential, *known, joint.points, (self.pin_radius, -self.arm))
        root, inverse = self.stretched(frames)
        arms = self.pin_radius, -self.pin_radius
        slip = with_turning(inverse.times_rate(tangential), *known, joint.points, arms)
        return with_turning(slip, *known, joint.points[1:], (root * -self.clearance,))

    def normal(self, frames: Frames) -> JetPair:
        """``Q/c``: the direction from bushing centre to pin centre."""
        x, y = self._pin_in_bushing(frames)
        minus = self._minus_curvature(frames)
        return -(x * minus), -(y * minus)

    def touch(self, q: Array) -> tuple[Array, Array | float, Array | float]:
        """``Q/|Q|``, c, and 1."""
        x, y = self.mechanism.trace(self.apart, q)[0]
        return np.array([x, y]) / np.hypot(x, y), self.clearance, 1.0

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench on the bushing's link, about the bushing's centre."""
        arm = frames.parameters(f'{self.name}.arm', self.arm)
        if self.law is not None:
            arm = self.pin_radius + self.clearance * dense(self.stretched(frames)[0].value)
        return self.pressing(frames, self.normal(frames), (N, T), arm)

    def _pin_in_bushing(self, frames: Frames) -> JetPair:
        return frames.position(self.apart, self.name)

    @property
    def apart(self) -> Point:
        """Vector from the bushing's centre to the pin's, in the plane of the contact."""
        return self.mechanism.separation(self.name)

    def _minus_curvature(self, frames: Frames) -> hy.expression:
        """-1/c: a product costs less than a quotient and a change of sign."""
        return dense(frames.parameters(f'{self.name}.minus_curvature', -1.0 / self.clearance))


@dataclass(frozen=True)
class FilmBearing:
    """A journal on the first-named link, carried by an oil film in the second-named link."""

    name: str
    mechanism: Mechanism
    film: ShortBearing
    reach: float = 0.0  #: eccentricity at which the walls touch [m]; 0 if never
    soft: bool = False  #: whether the walls are compliant

    @property
    def clearance(self) -> float:
        """Thickness of the film around a journal in the middle [m]."""
        return self.film.clearance

    @property
    def roughness(self) -> float:
        """Thickness of the film at which its walls touch [m]; 0 if they never do."""
        return self.clearance - self.reach if self.reach else 0.0

    def thickness(self, q: Array) -> float:
        """Least thickness of the film [m]; `q` (n, 1)."""
        x, y = self.mechanism.trace(self.mechanism.separation(self.name), q)[0]
        return self.clearance - float(np.hypot(x, y)[0])

    def _motion(self, frames: Frames) -> JournalMotion:
        """Motion of the journal, Q in components, as input of the film."""
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        joint, p = self.mechanism.joint(self.name), frames.parameters
        spins = []
        for link, at in joint.points:
            turns = self.mechanism.turns(link, at).items()
            shares = [
                v if slope == 1.0 else mul(p(f'{self.name}.turn:{c}', slope), v)
                for c, slope in turns
                for v in [frames.v[c]]
            ]
            spins.append(dense(add(*shares)))
        motion = JournalMotion(*map(dense, (x.value, y.value, x.rate, y.rate)), *spins)
        if not self.film.full:
            # where the journal turns back the half that carries changes sides, and its force has a
            # corner, or nearly so, which no series foretells; the rounding of a rest is no turn
            turning = TOLERANCES.guards.slip_scale * self.film.turning(motion)
            frames.switch(f'{self.name}.film', turning + 0.5 * TOLERANCES.switches.margin)
        if not (self.reach and self.soft):
            return motion
        c, closed = self.film.clearance, p.reserve(f'{self.name}.closed')
        square = motion.x * motion.x + motion.y * motion.y + (1.0 - closed) * (c * c)
        share = 1.0 + closed * (self.reach / hy.sqrt(square) - 1.0)
        return motion._replace(share=share)

    def _acts(self, frames: Frames) -> tuple[Vector, Vector, JournalMotion]:
        """Force on the journal, moments on journal and bushing, and the motion."""
        motion = self._motion(frames)
        return self.film.force(motion), self.film.moments(motion), motion

    def loads(self, frames: Frames) -> list[Load]:
        """Loads on journal and bushing, at their centres."""
        (fx, fy), (on_journal, on_bushing), _ = self._acts(frames)
        joint, name = self.mechanism.joint(self.name), self.name
        return [
            Load(f'{name}.first', joint.first, joint.on_first, (fx, fy), on_journal),
            Load(f'{name}.second', joint.second, joint.on_second, (neg(fx), neg(fy)), on_bushing),
        ]

    def wrench(self, frames: Frames) -> Wrench:
        """Wrench on the bushing's link, about the bushing's centre."""
        on_bushing = self.loads(frames)[1]
        return Wrench(*on_bushing.force, on_bushing.moment)

    def energy(self, _: Frames) -> Term:
        """A film stores none."""
        return None

    def power_lost(self, frames: Frames) -> Term:
        """``-(F.Q' + moments.spins)``."""
        (fx, fy), moments, motion = self._acts(frames)
        return neg(
            add(mul(fx, motion.vx), mul(fy, motion.vy), mul(moments[0], motion.spin_journal),
                mul(moments[1], motion.spin_bushing))
        )  # fmt: skip
