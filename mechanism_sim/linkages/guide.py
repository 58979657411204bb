"""A slider with play in its guide: each of its corners may touch a wall.

P. Flores, R. Leine, C. Glocker, Modeling and analysis of planar rigid multibody systems with
translational clearance joints based on the non-smooth dynamics approach, Multibody System
Dynamics 23 (2010).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from mechanism_sim.numerics.symbolic import Term
from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.jet import Jet, lift
from mechanism_sim.planar.loads import Wrench, contact_wrench
from mechanism_sim.planar.mechanism import Mechanism, Vector2
from mechanism_sim.planar.protocols import ForceLaw

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GuideClearance:
    """A corner of a link under the upper, or over the lower wall of a guide along the x axis.

    The distance is ``height - y`` or ``y - height`` of the corner: smooth, with a straight normal.
    """

    name: str
    mechanism: Mechanism
    link: str
    corner: Vector2  #: [m] in the link's frame
    wall: Literal['upper', 'lower']
    height: float  #: [m] of the wall
    restitution: float
    friction: float = 0.0
    hypothesis: str = 'newton'
    law: ForceLaw | None = None

    def stretch(self, value: Term) -> Term:
        """The value is the distance."""
        return hy.expression(1.0)

    def depth(self, value: Term) -> Term:
        """The value is the distance."""
        return -value

    @property
    def _outwards(self) -> float:
        return 1.0 if self.wall == 'upper' else -1.0

    def _place(self, frames: Frames) -> tuple[Jet, Jet]:
        return frames.position(self.mechanism.point(self.link, self.corner), self.name)

    def value(self, frames: Frames) -> Jet:
        """Distance of the corner from the wall [m]."""
        y = self._place(frames)[1]
        height = lift(frames.parameters(f'{self.name}.height', self._outwards * self.height))
        return height - y if self.wall == 'upper' else height + y

    def slip(self, frames: Frames) -> Jet:
        """Velocity of the corner along the outward normal turned by +90 degrees [m/s]."""
        x = self._place(frames)[0]
        along = -x if self.wall == 'upper' else x
        return Jet(None, along.gradient, along.rate, along.curvature)

    @property
    def joint(self) -> str:
        """There is no joint: the gap stands for itself."""
        return self.name

    def wrench(self, frames: Frames, N: Term, T: Term) -> Wrench:
        """On the ground."""
        return contact_wrench(self.normal(frames), N, T)

    def normal(self, _: Frames) -> tuple[Jet, Jet]:
        """Towards the wall."""
        return lift(0.0), lift(self._outwards)

    def distance(self, value: Array) -> Array:
        """The value is the distance."""
        return value


def corners(
    mechanism: Mechanism,
    link: str,
    centre: Vector2,
    half_length: float,
    half_height: float,
    clearance: float,
    restitution: float,
    friction: float = 0.0,
    hypothesis: str = 'newton',
) -> list[GuideClearance]:
    """The four corners of a rectangular slider in a guide about the x axis.

    Parameters
    ----------
    centre : of the slider in its link's frame [m]
    half_length, half_height : of the slider [m]
    clearance : on each side [m]

    Returns
    -------
    Rear and front corner at the upper wall, then at the lower; names ``LINK_1`` to ``LINK_4``.
    """
    found: list[GuideClearance] = []
    for wall, y in (('upper', half_height), ('lower', -half_height)):
        for x in (-half_length, half_length):
            found.append(
                GuideClearance(
                    f'{link}_{len(found) + 1}',
                    mechanism,
                    link,
                    (centre[0] + x, centre[1] + y),
                    'upper' if wall == 'upper' else 'lower',
                    (half_height + clearance) * (1.0 if wall == 'upper' else -1.0),
                    restitution,
                    friction,
                    hypothesis,
                )
            )
    return found
