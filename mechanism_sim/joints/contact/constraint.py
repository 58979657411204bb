"""A disc of one link that may touch a disc or a bar of another.

With Q from the second's point to the first's and the sum R of the radii, the gap of two discs is
``|Q| - R``. The engine is given ``(Q.Q - R^2)/(2 R)``: equal to it at contact in value and first
derivative, free of a square root. A bar is all places within its half thickness of a segment:
along it ``Q.Q`` is the square of the distance from its line, beyond an end that from the end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import heyoka as hy
import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.numerics.symbolic import Term, dense
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.gaps import RoundGap, with_turning
from mechanism_sim.planar.mechanism import HigherPair, Mechanism
from mechanism_sim.planar.points import LinkPoint, Vector2, rotate
from mechanism_sim.planar.protocols import Wrench
from mechanism_sim.planar.view import Draft, Side, circle

_ACROSS = 48  # points of a drawn disc


@dataclass(frozen=True)
class DiscPair(HigherPair):
    """A disc of `first` and a disc of `second`, or a bar from there to `end`."""

    sides: ClassVar[tuple[Side, ...]] = ()
    parts: ClassVar[str] = 'links that touch'
    equations: ClassVar[int] = 0

    radii: tuple[float, float] = (0.0, 0.0)  #: radii, or half thickness of a bar [m]
    end: Vector2 | None = None  #: end of a bar, in the frame of `second` [m]

    def closure(self, mechanism: Mechanism) -> DiscClosure:
        """Closure of the pair, which has no bilateral constraints."""
        return DiscClosure(self, mechanism)

    def bears(self, link: str) -> bool:
        """Discs are at points; a bar is straight."""
        return self.end is None or link == self.first

    def draw(self, draft: Draft) -> None:
        """Draw both outlines."""
        for (link, at), radius, end in zip(self.points, self.radii, (None, self.end), strict=True):
            if draft.first(f'disc {link} {at} {radius:.9g} {end}'):
                draft.add('wheel', link, _outline(at, radius, end), size=radius)
            draft.reach((link, at))
            if end is not None:
                draft.reach((link, end))

    def discs(self) -> Sequence[tuple[LinkPoint, float]]:
        """Discs of both links, and the disc at the end of a bar."""
        found = list(zip(self.points, self.radii, strict=True))
        return found if self.end is None else [*found, ((self.second, self.end), self.radii[1])]


def _outline(at: Vector2, radius: float, end: Vector2 | None) -> Array:
    """Outline of a disc, or of a bar (k, 2) [m]."""
    if end is None:
        return circle(radius, at)
    way = math.atan2(end[1] - at[1], end[0] - at[0])
    arc = circle(radius, points=_ACROSS)
    order = np.roll(np.arange(_ACROSS), _ACROSS // 4)  # the half at the end comes first
    turned = np.array([rotate((x, y), way) for x, y in arc[order]])
    half = _ACROSS // 2 + 1
    return np.concatenate([turned[:half] + end, np.roll(turned, -half + 1, axis=0)[:half] + at])


@dataclass(frozen=True)
class DiscClosure(HigherClosure[DiscPair]):
    """Closure of a pair without bilateral constraints."""

    def values(self, _: Frames) -> list[Jet]:
        """Constraint values: none."""
        return []

    def wrench(self, _: Frames, __: Sequence[Term]) -> Wrench:
        """Wrench of the constraints: none."""
        return Wrench(None, None)


@dataclass(frozen=True)
class DiscGap(RoundGap):
    """The distance of a disc from a disc or a bar."""

    pair: DiscPair
    mechanism: Mechanism

    @property
    def name(self) -> str:
        """The joint's."""
        return self.pair.name

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.pair.name

    @property
    def room(self) -> float:
        """Sum of the radii [m]."""
        return sum(self.pair.radii)

    @property
    def overlap(self) -> str:
        """One in the other."""
        return f'{self.pair.first} into {self.pair.second} in the contact {self.name}'

    # --- the measure ----------------------------------------------------------------------------

    def value(self, frames: Frames) -> Jet:
        """``(Q.Q - R^2)/(2 R)`` [m]."""
        x, y = self._apart(frames)
        half = self._square(frames, x, y)
        reach = dense(frames.parameters(f'{self.name}.reach', self.room))
        found: Jet = half / reach - lift(0.5 * reach)
        return found

    def _apart(self, frames: Frames) -> JetPair:
        """Vector from the second's point to the first's [m]."""
        return frames.position(self.mechanism.separation(self.name), self.name)

    def _square(self, frames: Frames, x: Jet, y: Jet) -> Jet:
        """Half the square of the distance of middles, or of a middle from a segment."""
        whole: Jet = x.half_square() + y.half_square()
        if self.pair.end is None:
            return whole
        (_, across), past, flags = self._along(frames, x, y)
        fx, fy = past
        beyond: Jet = fx.half_square() + fy.half_square()
        before, after = flags
        on_bar = across.half_square() * (1.0 - before - after)
        found: Jet = on_bar + whole * before + beyond * after
        return found

    def _along(
        self, frames: Frames, x: Jet, y: Jet
    ) -> tuple[JetPair, JetPair, tuple[hy.expression, hy.expression]]:
        """Position of first's centre along and across a bar, and from its end; end flags."""
        ux, uy = self._bar(frames)
        along, across = ux * x + uy * y, ux * y - uy * x
        ends = self.pair.on_second, self.pair.end or self.pair.on_second
        length = dense(frames.parameters(f'{self.name}.bar_length', math.dist(*ends)))
        before = frames.switch(f'{self.name}.start', -dense(along.value))
        after = frames.switch(f'{self.name}.end', dense(along.value) - length)
        return (along, across), (x - ux * length, y - uy * length), (before, after)

    # --- the force ------------------------------------------------------------------------------

    def _nearest(self, frames: Frames) -> JetPair:
        """Vector from the nearest point of the second's middle or segment to the first's."""
        x, y = self._apart(frames)
        if self.pair.end is None:
            return x, y
        (_, across), (ex, ey), (before, after) = self._along(frames, x, y)
        ux, uy = self._bar(frames)
        on = 1.0 - before - after
        return (
            -(across * uy) * on + x * before + ex * after,
            across * ux * on + y * before + ey * after,
        )

    def _bar(self, frames: Frames) -> JetPair:
        """Unit vector along the second's segment."""
        end, start = self.pair.end, self.pair.on_second
        assert end is not None  # noqa: S101 - it is a bar
        way = math.atan2(end[1] - start[1], end[0] - start[0])
        return frames.position(self.mechanism.direction(self.pair.second, way), f'{self.name}.bar')

    def _minus(self, frames: Frames) -> hy.expression:
        return -1.0 / dense(frames.parameters(f'{self.name}.reach', self.room))

    def normal(self, frames: Frames) -> JetPair:
        """Normal from the first's middle to the second, ``-Q/R``."""
        x, y = self._nearest(frames)
        minus = self._minus(frames)
        return x * minus, y * minus

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the first's surface along the second's [m/s], ``Q'.t + r1 w1 + r2 w2``.

        Along a bar it is ``p' + r1 (w1 - w2)`` with the place p along it. Both as rates of what
        has no value. Pressed into one another both pass the first's surface: r2 is |Q| - r1.
        """
        x, y = self._apart(frames)
        minus = self._minus(frames)
        (r1, r2), ends = self.pair.radii, self.pair.points
        m, name = self.mechanism, self.name

        def rolling(slip: Jet, arms: tuple[float, float], part: str) -> Jet:
            if self.law is not None:
                root, inverse = self.stretched(frames)
                slip = inverse.times_rate(slip)
                if not part:
                    slip = with_turning(slip, frames, m, name, ends[1:], (root * self.room,))
                arms = r1, -r1
            return with_turning(slip, frames, m, f'{name}{part}', ends, arms)

        whole = rolling(x.across(y) * minus, (r1, r2), '')
        if self.pair.end is None:
            return whole
        (along, across), (ex, ey), (before, after) = self._along(frames, x, y)
        beyond = rolling(ex.across(ey) * minus, (r1, r2), '')
        # the side on which it lies is the sign of `across`, which in contact is R or -R
        side = -(across * minus)
        flat = rolling(side.times_rate(along), (r1, -r1), '.flat')
        slip: Jet = flat * (1.0 - before - after) + whole * before + beyond * after
        return slip

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench on the second-named link, about its point; it acts at the first's surface."""
        arm = frames.parameters(f'{self.name}.first_radius', self.pair.radii[0])
        return self.pressing(frames, self.normal(frames), (N, T), arm, self._apart(frames))
