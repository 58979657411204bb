"""A block with clearance in its guide: each of its corners may touch a wall.

P. Flores, R. Leine, C. Glocker, Modeling and analysis of planar rigid multibody systems with
translational clearance joints based on the non-smooth dynamics approach, Multibody System
Dynamics 23 (2010).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from mechanism_sim.numerics.symbolic import Term, dense
from mechanism_sim.planar.frames import Frames, Jet, JetPair, lift
from mechanism_sim.planar.gaps import SIDES, MeasuredGap, gap_name
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
from mechanism_sim.planar.points import Vector2, rotate
from mechanism_sim.planar.protocols import Wrench, contact_wrench
from mechanism_sim.planar.rails import Foot, along, rail_of
from mechanism_sim.planar.view import Side


@dataclass(frozen=True)
class GuideClearance(MeasuredGap):
    """A corner of a block and the wall of its guide, to the left or right of the guide's axis.

    With the corner at h to the left of the axis, the gap is ``width - h`` or ``width + h``:
    smooth, with a normal that turns with the guide.
    """

    joint: str
    name: str
    mechanism: Mechanism
    side: Side
    corner: Vector2  #: [m] in the block's frame
    width: float  #: half width of the guide, from its axis [m]

    softness: ClassVar[float] = 1e-6
    """Two corners that stick to one wall hold the same: they share it, giving way so little."""

    @property
    def _guide(self) -> Prismatic:
        joint = self.mechanism.joint(self.joint)
        if not isinstance(joint, Prismatic):
            raise TypeError(f'{self.joint} is not a prismatic joint')
        return joint

    def _along(self, frames: Frames, angle: float, what: str) -> JetPair:
        return along(self.mechanism, frames, self._guide.line, angle, f'{self.joint}.{what}')

    def _foot(self, frames: Frames) -> Foot | None:
        """Foot of the corner on an elastic link that carries the guide; None on a rigid one."""
        j, m = self._guide, self.mechanism
        rail = rail_of(m, self.joint, j.line)
        if rail is None:
            return None
        corner = frames.position(m.point(j.second, self.corner), f'{self.name}.corner')
        return rail.foot(frames, corner, self.name, thick=True)

    def _off(self, frames: Frames, on: Vector2, link: str, what: str) -> JetPair:
        """The corner from a point of a link."""
        joint = self._guide
        corner = frames.position(
            self.mechanism.point(joint.second, self.corner), f'{self.name}.corner'
        )
        origin = frames.position(self.mechanism.point(link, on), f'{self.joint}.{what}')
        return corner[0] - origin[0], corner[1] - origin[1]

    def value(self, frames: Frames) -> Jet:
        """Distance of the corner from the wall [m]."""
        width = lift(dense(frames.parameters(f'{self.joint}.width', self.width)))
        if foot := self._foot(frames):
            height = foot.away
        else:
            x, y = self._off(frames, self._guide.on_first, self._guide.first, 'axis')
            nx, ny = self._along(frames, 0.5 * math.pi, 'normal')
            height = nx * x + ny * y
        return width - height if self.side == 'left' else width + height

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the wall along the corner, in the direction of the normal turned by +90."""
        if foot := self._foot(frames):
            return -foot.slip if self.side == 'left' else foot.slip
        x, y = self._off(frames, self._guide.on_first, self._guide.first, 'axis')
        ux, uy = self._along(frames, 0.0, 'along')
        way = ux * x + uy * y
        return (-way if self.side == 'left' else way).as_rate

    def normal(self, frames: Frames) -> JetPair:
        """Normal from the wall to the axis."""
        foot = self._foot(frames)
        nx, ny = foot.normal if foot else self._along(frames, 0.5 * math.pi, 'normal')
        return (-nx, -ny) if self.side == 'left' else (nx, ny)

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """Wrench of the wall on the block, at the corner."""
        place = self._off(frames, self._guide.on_second, self._guide.second, 'block')
        return contact_wrench(self.normal(frames), N, T, place=place)


def corners(
    mechanism: Mechanism, joint: str, size: Vector2, clearance: float, **behaviour: Any
) -> Iterator[GuideClearance]:
    """The four corners of a block in its guide, the joint's point in its middle.

    Parameters
    ----------
    joint : a prismatic joint that is cut; the block is its second link
    size : size of the block along and across the guide [m]
    clearance : clearance on each side [m]
    """
    guide = mechanism.joint(joint)
    if not isinstance(guide, Prismatic):
        raise TypeError(f'{joint} is not a prismatic joint')
    (length, height), (x, y) = size, guide.on_second
    for end, side in SIDES:
        along = 0.5 * length * (1.0 if end == 'front' else -1.0)
        across = 0.5 * height * (1.0 if side == 'left' else -1.0)
        dx, dy = rotate((along, across), guide.axis - guide.angle)
        yield GuideClearance(
            joint, gap_name(mechanism, guide, f'{end}_{side}'), mechanism, side, (x + dx, y + dy),
            0.5 * height + clearance, **behaviour,
        )  # fmt: skip
