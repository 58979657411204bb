"""A worm and its wheel: a ratio of angles, and the forces of their teeth in space ([V] 5.8)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.bevel.constraint import SpatialPair
from mechanism_sim.joints.worm.forces import WormPair
from mechanism_sim.planar.points import GROUND
from mechanism_sim.planar.view import PairView

_UNIT = WormPair(1, 1, 1.0, math.pi / 4)  # fields after others with defaults need one


@dataclass(frozen=True)
class WormDrive(SpatialPair):
    """A worm, the first, and its wheel on shafts at 90 degrees, [V] 5.8.4.

    Attributes
    ----------
    worm : its sizes
    hand : 1 right, -1 left
    friction : Coulomb's coefficient
    """

    worm: WormPair = _UNIT
    hand: int = 1
    friction: float = 0.0

    @property
    def radii(self) -> tuple[float, float]:
        """Pitch radii [m]."""
        return 0.5 * self.worm.diameter, 0.5 * self.worm.wheel_diameter

    @property
    def _teeth(self) -> tuple[tuple[int, float], tuple[int, float]]:
        return (0, 1.0), (self.worm.teeth, 1.0)

    def _beside(
        self, view: PairView, tangential: Array
    ) -> tuple[Array, Array, Array, Array, Array]:
        """The axial force on the worm is the tangential one of its wheel, and so the other way.

        The normal force F and ``mu F`` against the sliding along the thread, which the worm's turn
        begins with, make both; at rest friction is not known and left out.
        """
        lead, press, hand = self.worm.lead_angle, self.worm.pressure_angle, self.hand
        if not self.friction:
            apart = np.abs(tangential) * math.tan(press) / math.cos(lead)
            around = -hand * math.tan(lead) * tangential
            first = -float(self.ratio) * view.moment / self.radii[0]
            return first, apart, tangential, apart, around
        speed = view.turning(self.first)[1]
        if self.carrier != GROUND:
            speed = speed - view.turning(self.carrier)[1]
        rub = self.friction * np.sign(speed) * np.sign(tangential)
        across = math.cos(press)
        F = tangential / (across * math.cos(lead) - hand * rub * math.sin(lead))
        around = -F * (hand * across * math.sin(lead) + rub * math.cos(lead))
        apart = np.abs(F) * math.sin(press)
        return around, apart, tangential, apart, around
