"""A pin in a straight slot, and what it transmits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mechanism_sim.numerics.symbolic import Term, dense, mul, neg
from mechanism_sim.planar.closures import HigherClosure
from mechanism_sim.planar.frames import Frames, Jet, JetPair
from mechanism_sim.planar.gaps import Wall, with_turning
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, StraightLine
from mechanism_sim.planar.protocols import Wrench, contact_wrench, moment_of
from mechanism_sim.planar.rails import Foot, along, rail_of
from mechanism_sim.planar.view import Draft


@dataclass(frozen=True)
class PinInSlot(HigherPair):
    """A pin of `first` in a straight slot of `second`, which slides and turns.

    `on_second` is a point of the slot's centre line.
    """

    axis: float = 0.0  #: direction of the slot in the frame of `second` [rad]

    def draw(self, draft: Draft) -> None:
        """A pin of `first`, and the slot of `second`."""
        pin = self.first, self.on_first
        draft.pin(pin, self.name)
        way = draft.within(self.second, pin)
        draft.rail('slot', (self.second, self.on_second), self.axis, way)

    @property
    def line(self) -> StraightLine:
        """The centre line of the slot."""
        return StraightLine(self.second, self.on_second, self.axis)

    def closure(self, mechanism: Mechanism) -> SlotClosure:
        """The pin stays on the centre line."""
        return SlotClosure(self, mechanism)

    @property
    def rubbing_wall(self) -> type[Wall]:
        """Class of the wall along which the pin's surface slides."""
        return SlotWall

    def bears(self, _: str) -> bool:
        """Pins are at points, slots at cross-sections or along the axis."""
        return True


@dataclass(frozen=True)
class SlotClosure(HigherClosure[PinInSlot]):
    """A pin in a slot: the first link's point stays on a line of the second link."""

    def normal(self, frames: Frames) -> JetPair:
        """Normal of the slot, 90 degrees counterclockwise from its axis."""
        if foot := self.foot(frames):
            return foot.normal
        return along(self.mechanism, frames, self.joint.line, 0.5 * math.pi, f'{self.name}.normal')

    def foot(self, frames: Frames) -> Foot | None:
        """Foot of the pin on an elastic link that carries the slot; None on a rigid one."""
        j, m = self.joint, self.mechanism
        rail = rail_of(m, self.name, j.line)
        if rail is None:
            return None
        label = f'{self.name}.first'
        pin = frames.position(m.point(j.first, j.on_first), label)
        return rail.foot(frames, pin, self.name)

    def values(self, frames: Frames) -> list[Jet]:
        """Distance of the pin from the centre line [m]."""
        if foot := self.foot(frames):
            return [foot.away]
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        nx, ny = self.normal(frames)
        return [nx * x + ny * y]

    def wrench(self, frames: Frames, forces: Sequence[Term]) -> Wrench:
        """Wrench of the pin on the slot's wall, at the pin."""
        x, y = frames.position(self.mechanism.separation(self.name), self.name)
        nx, ny = self.normal(frames)
        force = neg(mul(forces[0], nx.value)), neg(mul(forces[0], ny.value))
        return Wrench(*force, moment_of((x.value, y.value), force))


@dataclass(frozen=True)
class SlotWall(Wall):
    """A wall of a slot with clearance, with friction on its pin."""

    pin_radius: float = 0.0  #: radius of the pin [m]

    def _foot(self, frames: Frames) -> Foot | None:
        return self.closure.foot(frames) if isinstance(self.closure, SlotClosure) else None

    def normal(self, frames: Frames) -> JetPair:
        """Normal from the centre line to the wall."""
        m, line, left = self.closure.mechanism, self.closure.joint.line, self.side == 'left'
        if foot := self._foot(frames):
            x, y = foot.normal
            return (x, y) if left else (-x, -y)
        assert line is not None  # noqa: S101 - that of the slot
        side = 0.5 * math.pi if left else -0.5 * math.pi
        return along(m, frames, line, side, f'{self.name}.normal')

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the pin's surface along the wall, in the direction of the normal turned.

        The pin's own along the slot, and its radius times its turning on the slot.
        """
        joint, mechanism = self.closure.joint, self.closure.mechanism
        ends, arms = joint.points, (self.pin_radius, -self.pin_radius)
        if foot := self._foot(frames):  # the rail turns with its own slope, not by cross-sections
            slip = -foot.slip if self.side == 'left' else foot.slip
            slip -= foot.turned * dense(frames.parameters(f'{self.name}.slip', self.pin_radius))
            bent = frozenset(mechanism.deformations)
            slip = with_turning(slip, frames, mechanism, self.name, ends[:1], arms[:1])
            return with_turning(slip, frames, mechanism, self.name, ends[1:], arms[1:], bent)
        nx, ny = self.normal(frames)
        x, y = frames.position(mechanism.separation(self.joint), self.joint)
        slip = (nx * y - ny * x).as_rate
        return with_turning(slip, frames, mechanism, self.name, ends, arms)

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench of the pin on the slot, where it touches."""
        place = frames.position(self.closure.mechanism.separation(self.joint), self.joint)
        arm = frames.parameters(f'{self.name}.pin_radius', self.pin_radius)
        return contact_wrench(self.normal(frames), N, T, arm, place)
