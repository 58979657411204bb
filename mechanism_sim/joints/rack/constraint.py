"""A pin and a slotted rack, which is locked while the pin is out of its slots ([V] 2.6)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import heyoka as hy
import numpy as np

from mechanism_sim.joints.geneva.constraint import GenevaReading, IndexingPair, either, sine
from mechanism_sim.numerics.symbolic import Term, dense, mul
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.planar.protocols import Wrench, moment_of
from mechanism_sim.planar.view import (
    Draft,
    PairView,
)


@dataclass(frozen=True)
class SlottedRack(IndexingPair):
    """A driving pin of `first` and a rack `second` that slides on the ground, slots across it.

    The pin moves the rack while it is on the rack's side of the line along `axis` through the
    crank's centre; in the other half of a turn the rack is locked. `on_first` is the pin,
    `on_second` a point of a slot.
    """

    pitch: float  #: pitch of the slots: twice the radius of the pin's circle [m]
    axis: float  #: [rad] direction of the rack in the world
    centre: Vector2  #: centre of the crank, in the world [m]
    side: Literal[1, -1]  #: side of that line with the rack: 1 on its right, -1 on its left

    @property
    def pitches(self) -> Mapping[str, float]:
        """Pitch of the slots [m], by link."""
        return {self.second: self.pitch}

    def reading(self, view: PairView) -> GenevaReading:
        """The pin moves the rack on its side of the crank's centre."""
        c, s = math.cos(self.axis), math.sin(self.axis)
        centre = np.array(self.centre)[:, None]
        x, y = view.place(self.first, self.on_first) - centre
        fx, fy = view.force
        engaged = self.side * (y * c - x * s) < 0.0
        return self._read(view, engaged, centre, c * fx + s * fy)

    def draw(self, draft: Draft) -> None:
        """A pin, and the slots that it visits, and their neighbours."""
        place = (self.first, self.on_first)
        draft.pin(place, self.name)
        link, base = self.second, np.array(self.on_second)
        axis = self.axis - draft.turned(link)  # a rack does not turn
        pin = draft.within(link, place)
        along, across = (np.array(rotate((1.0, 0.0), axis + a)) for a in (0.0, 0.5 * math.pi))
        from_centre = draft.at(place) - np.array(self.centre)[:, None]
        driven = rotate((1.0, 0.0), self.axis + self.side * 0.5 * math.pi) @ from_centre <= 0.0
        away = (pin - base[:, None])[:, driven if driven.any() else slice(None)]
        slots = np.round(along @ away / self.pitch).astype(int)
        middle = float(across @ (draft.within(link, (GROUND, self.centre))[:, 0] - base))
        spare = 1.5 * draft.symbol
        low, high = middle - self.side * (0.5 * self.pitch + spare), middle + self.side * spare
        for k in range(int(slots.min()) - 1, int(slots.max()) + 2):
            foot = base + k * self.pitch * along
            line = np.array([foot + s * across for s in (low, high)])
            draft.add('slot', link, line)
            draft.reach((link, (float(line[0, 0]), float(line[0, 1]))))

    def closure(self, mechanism: Mechanism) -> RackClosure:
        """Closure without clearance."""
        return RackClosure(self, mechanism)


@dataclass(frozen=True)
class RackClosure(HigherClosure[SlottedRack]):
    """A slotted rack without clearance."""

    def _from_centre(self, frames: Frames, link: str, at: Vector2) -> JetPair:
        """Position of a point of a link: components along the rack and across it [m]."""
        label = f'{self.name}.of:{link}'
        x, y = frames.position(self.mechanism.point(link, at), label)
        ox, oy = frames.position({(GROUND, None): self.joint.centre}, f'{self.name}.centre')
        x, y, p, a = x - ox, y - oy, frames.parameters, self.joint.axis
        c = lift(dense(p(f'{self.name}.axis.x', math.cos(a))))
        s = lift(dense(p(f'{self.name}.axis.y', math.sin(a))))
        return x * c + y * s, y * c - x * s

    def engaged(self, frames: Frames) -> Term:
        """1 while the pin is on the rack's side of the crank's centre."""
        joint = self.joint
        _, across = self._from_centre(frames, joint.first, joint.on_first)
        return frames.switch(self.name, -dense(across.value) * (2.0 * joint.side / joint.pitch))

    def values(self, frames: Frames) -> list[Jet]:
        """Offset of the pin, or of the locked rack, along the rack [m]."""
        wave, *off = self._off(frames)
        return [either(self.engaged(frames), *(sine(x, wave) for x in off))]

    def _off(self, frames: Frames) -> tuple[hy.expression, Jet, Jet]:
        """Wave number of the slots [1/m]; offsets of the pin from one, and of the locked rack."""
        joint = self.joint
        pin, _ = self._from_centre(frames, joint.first, joint.on_first)
        slot, _ = self._from_centre(frames, joint.second, joint.on_second)
        wave = dense(frames.parameters(f'{self.name}.wave', 2.0 * math.pi / joint.pitch))
        return wave, pin - slot, slot

    def facing(self, frames: Frames) -> list[Term]:
        """Cosines whose sines are the offset: on a slot, or, locked, in the middle of two."""
        (wave, *off), on = self._off(frames), self.engaged(frames)
        slot, locked = (hy.cos(wave * dense(x.value)) for x in off)
        return [on * slot - (1.0 - on) * locked]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Wrench along the rack: at the pin, or, if locked, at the slot's own point."""
        joint, on = self.joint, self.engaged(frames)
        push = mul(forces[0], self.values(frames)[0].gradient[joint.second])
        p, a = frames.parameters, joint.axis
        force = (
            mul(push, p(f'{self.name}.axis.x', math.cos(a))),
            mul(push, p(f'{self.name}.axis.y', math.sin(a))),
        )
        x, y = frames.position(self.mechanism.separation(self.name), f'{self.name}.pin')
        return Wrench(*force, mul(on, moment_of((x.value, y.value), force)))
