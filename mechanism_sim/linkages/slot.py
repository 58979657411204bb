"""A pin in a straight slot, and what it transmits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mechanism_sim.numerics.symbolic import Term, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.configuration import off_line, turned
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet
from mechanism_sim.planar.loads import Wrench, moment_of
from mechanism_sim.planar.mechanism import Equation, HigherPair, Mechanism, Pose
from mechanism_sim.planar.touch import Touch
from mechanism_sim.planar.view import Draft


@dataclass(frozen=True)
class PinInSlot(HigherPair):
    """A pin of `first` in a straight slot of `second`, which slides and turns.

    `on_second` is a point of the slot's centre line.
    """

    axis: float = 0.0  #: [rad] direction of the slot in the frame of `second`

    def draw(self, draft: Draft) -> None:
        """A pin of `first`, and the slot of `second`."""
        pin = self.first, self.on_first
        draft.pin(pin, self.name)
        way = draft.within(self.second, pin)
        draft.rail('slot', (self.second, self.on_second), self.axis, way)

    def closure(self, mechanism: Mechanism) -> SlotClosure:
        """The pin stays on the centre line."""
        return SlotClosure(self, mechanism)

    def touch(self, mechanism: Mechanism, radius: float = 0.0) -> Touch:
        """Where the pin touches a wall."""
        return Touch(self.closure(mechanism), f'{self.name}.friction', radius, at_pin=True)

    def equation(self, pose: Callable[[str], Pose]) -> Equation:
        """The distance of the pin from the centre line [m]."""
        slot = pose(self.second)
        on, pin = turned(slot, self.on_second), turned(pose(self.first), self.on_first)
        value, by_slot, by_pin = off_line(slot, self.axis, on, pin)
        return value, {self.first: by_pin, self.second: by_slot}


@dataclass(frozen=True)
class SlotClosure(HigherClosure[PinInSlot]):
    """A pin in a slot: the first link's point stays on a line of the second link."""

    def normal(self, frames: Frames) -> tuple[Jet, Jet]:
        """Across the slot, 90 degrees counterclockwise from its axis."""
        joint = self.joint
        normal = self.mechanism.direction(joint.second, joint.axis + 0.5 * math.pi)
        return frames.position(normal, f'{self.name}.normal')

    def values(self, frames: Frames) -> list[Jet]:
        """Distance of the pin from the centre line [m]."""
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        nx, ny = self.normal(frames)
        return [nx * x + ny * y]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """The slot's wall feels the pin where the pin is."""
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        nx, ny = self.normal(frames)
        force = neg(mul(forces[0], nx.value)), neg(mul(forces[0], ny.value))
        return Wrench(*force, moment_of((x.value, y.value), force))
