"""A weld of two links, and what it transmits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from mechanism_sim.numerics.symbolic import Term, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet
from mechanism_sim.planar.loads import Wrench
from mechanism_sim.planar.mechanism import HigherPair, Mechanism
from mechanism_sim.planar.view import Draft, Side


@dataclass(frozen=True)
class Weld(HigherPair):
    """Links whose points coincide and that do not turn against each other."""

    sides: ClassVar[tuple[Side, ...]] = ()
    parts: ClassVar[str] = 'links that are one'
    equations: ClassVar[int] = 3

    angle: float = 0.0  #: [rad] of the frame of `second` in that of `first`

    def closure(self, mechanism: Mechanism) -> WeldClosure:
        """They are one."""
        return WeldClosure(self, mechanism)

    def bears(self, _: str) -> bool:
        """It holds the cross-section at its point."""
        return True

    def draw(self, draft: Draft) -> None:
        """Both links reach there."""
        for place in self.points:
            draft.reach(place)


@dataclass(frozen=True)
class WeldClosure(HigherClosure[Weld]):
    """Points coincide, cross-sections there keep their angle."""

    def _directions(self, frames: Frames) -> tuple[tuple[Jet, Jet], tuple[Jet, Jet]]:
        """Of the second link's x axis as the first link holds it, and as it is."""
        j, m = self.joint, self.mechanism
        held = m.direction(j.first, j.angle, j.on_first)
        own = m.direction(j.second, 0.0, j.on_second)
        return (
            frames.position(held, f'{self.name}.first.x'),
            frames.position(own, f'{self.name}.second.x'),
        )

    def values(self, frames: Frames) -> list[Jet]:
        """From the second's point to the first's [m]; sine of the angle, times the size [m]."""
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        (ux, uy), (vx, vy) = self._directions(frames)
        size = dense(frames.parameters(f'{self.name}.size', self.mechanism.size))
        return [x, y, (ux * vy - uy * vx) * size]

    def facing(self, frames: Frames) -> list[Term]:
        """The cosine of that angle: half a turn has the same sine as none."""
        (ux, uy), (vx, vy) = self._directions(frames)
        return [(ux * vx + uy * vy).value]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The rows push on the first link, and turn the second."""
        moment = mul(forces[2], frames.parameters(f'{self.name}.size', self.mechanism.size))
        return Wrench(neg(forces[0]), neg(forces[1]), moment)
