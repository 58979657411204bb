"""Bushings: springs and dampers in both directions between points that coincide."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import heyoka as hy

from mechanism_sim.linkages.elements import SceneElement
from mechanism_sim.linkages.springs import SpringLaw
from mechanism_sim.numerics.symbolic import Term, add, mul, neg
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.loads import Load, moment_of
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, LinkPoint
from mechanism_sim.planar.virtual_work import located

_AXES = 'x', 'y'
_TURN = {'axis.x': math.cos, 'axis.y': math.sin}


@dataclass(frozen=True)
class Bushing(SceneElement):
    """Forces on a point of the second link by its place beside one of the first, in its frame.

    Both forces act where the second point is, so that they are opposite also while it is away.
    """

    mechanism: Mechanism
    laws: tuple[SpringLaw, SpringLaw]  #: along x and y of the first link's frame
    first: LinkPoint
    second: LinkPoint

    def _away(self, frames: Frames) -> tuple[list[Term], list[Term]]:
        """Place of the second point beside the first in the first's frame [m], and its rate."""
        ends = [Load(f'{self.key}.{n}', *getattr(self, n)) for n in ('first', 'second')]
        first, second = (located(load, frames, self.mechanism) for load in ends)
        x, y = (b - a for a, b in zip(first, second, strict=True))
        frame, _ = self.mechanism.frame(self.first[0])
        turning = None if frame == GROUND else frames.v[frame]
        place, rate = [], []
        for ux, uy in self._axes(frames):
            place.append(add(mul(ux, x.value), mul(uy, y.value)))
            rate.append(add(mul(ux, x.rate), mul(uy, y.rate)))
        return place, [
            add(rate[0], mul(turning, place[1])),
            add(rate[1], neg(mul(turning, place[0]))),
        ]

    def _axes(self, frames: Frames) -> list[tuple[Term, Term]]:
        frame, offset = self.mechanism.frame(self.first[0])
        one = hy.expression(1.0)
        axes = [(one, None), (None, one)]
        if offset:
            c, s = (frames.parameters(f'{self.key}.{n}', f(offset)) for n, f in _TURN.items())
            axes = [(c, s), (neg(s), c)]
        return [frames.world(frame, *axis) for axis in axes]

    def _each(self, frames: Frames) -> list[tuple[SpringLaw, str, Term, Term, Mapping[str, Term]]]:
        """Law, key of its parameters, place and rate along each axis."""
        if not all(law.numbers for law in self.laws):
            frames.formulas.add(self.name)
        keys = (f'{self.key}.{axis}' for axis in _AXES)
        return [(*x, {}) for x in zip(self.laws, keys, *self._away(frames), strict=True)]

    def loads(self, frames: Frames) -> list[Load]:
        """The forces at both points, and the moment of the first's about its point."""
        pulls = [law.pull(frames, *known) for law, *known in self._each(frames)]
        (ux, uy), (vx, vy) = self._axes(frames)
        x, y = (add(mul(pulls[0], u), mul(pulls[1], v)) for u, v in ((ux, vx), (uy, vy)))
        place = self._away(frames)[0]
        moment = moment_of((place[0], place[1]), (pulls[0], pulls[1]))
        return [
            Load(f'{self.key}.first', *self.first, (x, y), moment),
            Load(f'{self.key}.second', *self.second, (neg(x), neg(y))),
        ]

    def power_lost(self, frames: Frames) -> Term:
        """That of both directions."""
        return add(*(law.power_lost(frames, *known) for law, *known in self._each(frames)))

    def energy(self, frames: Frames) -> Term:
        """That of both directions."""
        return add(*(law.energy(frames, *known[:2]) for law, *known in self._each(frames)))
