"""A pin in a slot along an arc of a circle.

With Q from the arc's centre to the pin and its radius R, the offset is ``|Q| - R``. The pin
presses on the slot along Q, through the centre: the slot feels no moment about it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from mechanism_sim.numerics.symbolic import Term, dense, div, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames, Jet, lift
from mechanism_sim.planar.mechanism import HigherPair, Mechanism
from mechanism_sim.planar.protocols import Wrench
from mechanism_sim.planar.touch import Touch
from mechanism_sim.planar.view import SLOT, Draft, circle, complex_of, points_of

_ARC = 64  # points of a drawn arc


@dataclass(frozen=True)
class PinInArc(HigherPair):
    """A pin of `first` in a slot of `second` about `on_second`, in which it slides and turns."""

    radius: float = 1.0  #: radius of the slot's centre line [m]

    @property
    def extent(self) -> float:
        """The radius."""
        return self.radius

    def closure(self, mechanism: Mechanism) -> ArcClosure:
        """The pin keeps its distance from the centre."""
        return ArcClosure(self, mechanism)

    def bears(self, _: str) -> bool:
        """Pins and centres are at points."""
        return True

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> Touch:
        """Contact of the pin's surface with the loaded wall."""
        return Touch(self.closure(mechanism), f'{self.name}.friction', radius, at_pin=True)

    def draw(self, draft: Draft) -> None:
        """Draw a pin of `first`, and the slot of `second` over the pin's travel."""
        pin, half = (self.first, self.on_first), SLOT * draft.symbol
        draft.pin(pin, self.name)
        away = complex_of(draft.within(self.second, pin).T - self.on_second)
        turned = np.unwrap(np.angle(away))
        x, y = points_of(self.radius * np.exp(0.5j * (turned.min() + turned.max())))
        draft.reach((self.second, (self.on_second[0] + float(x), self.on_second[1] + float(y))))
        if np.ptp(turned) >= 2.0 * math.pi:
            radii = self.radius + half, max(self.radius - half, 0.0)
            draft.add('wheel', self.second, *(circle(r, self.on_second) for r in radii),
                      size=self.radius)  # fmt: skip
            return
        way = np.exp(1j * np.linspace(turned.min(), turned.max(), _ARC))
        end = half * np.exp(1j * np.linspace(0.0, math.pi, _ARC // 4))
        rim = np.concatenate([
            (self.radius + half) * way, way[-1] * (self.radius + end),
            (self.radius - half) * way[::-1], way[0] * (self.radius - end),
        ])  # fmt: skip
        draft.add('wheel', self.second, points_of(rim) + self.on_second, size=self.radius)


@dataclass(frozen=True)
class ArcClosure(HigherClosure[PinInArc]):
    """The first link's point stays on a circle of the second link."""

    def _apart(self, frames: Frames) -> tuple[Jet, Jet, hy.expression]:
        """Vector from the centre to the pin, and its length [m]."""
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        return x, y, hy.sqrt(2.0 * dense((x.half_square() + y.half_square()).value))

    def values(self, frames: Frames) -> list[Jet]:
        """Radial distance of the pin outside of the centre line [m]."""
        x, y, r = self._apart(frames)
        away = (x.half_square() + y.half_square()).chain(r, 1.0 / r, -1.0 / (r * r * r))
        return [away - lift(dense(frames.parameters(f'{self.name}.radius', self.joint.radius)))]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Wrench of the pin on the slot's wall, along the radius."""
        x, y, r = self._apart(frames)
        return Wrench(*(neg(mul(forces[0], div(part.value, r))) for part in (x, y)))
