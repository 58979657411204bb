"""A worm and its wheel: a ratio of angles, and the forces of their teeth in space ([V] 5.8).

All forces act at the pitch point. A component's value is its size; its direction: tangential
against the motion of the driver and with that of the driven gear, radial towards the gear's own
axis, axial along it, opposite on the two gears in space.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.bevel.constraint import SpatialPair
from mechanism_sim.planar.view import PairView


@dataclass(frozen=True)
class WormPair:
    """A worm and its wheel on shafts at 90 deg, [V] 5.8.4.

    Parameters
    ----------
    threads, teeth : N2 of the worm, N3 of the wheel
    diameter : pitch diameter d2 of the worm [m]
    lead_angle : lead angle lambda [rad]; the helix angle of the wheel is the same
    pressure_angle : pressure angle in the plane normal to the thread [rad]
    """

    threads: int
    teeth: int
    diameter: float
    lead_angle: float
    pressure_angle: float = math.radians(20)

    @property
    def lead(self) -> float:
        """Advance of a thread in one turn [m]: pi d2 tan lambda; [V] eq. 5.44 misprints it."""
        return math.pi * self.diameter * math.tan(self.lead_angle)

    @property
    def wheel_diameter(self) -> float:
        """Pitch diameter d3 of the wheel [m], [V] eq. 5.47."""
        return self.lead * self.teeth / (math.pi * self.threads)

    @property
    def centre_distance(self) -> float:
        """Centre distance of the shafts [m]."""
        return (self.diameter + self.wheel_diameter) / 2.0

    @property
    def locking_friction(self) -> float:
        """Coefficient of friction from which on the wheel cannot drive: cos phi_n tan lambda."""
        return math.cos(self.pressure_angle) * math.tan(self.lead_angle)

    def self_locking(self, friction: float) -> bool:
        """True if the wheel cannot drive the worm."""
        return friction >= self.locking_friction

    def efficiency(self, friction: float = 0.0, *, wheel_drives: bool = False) -> float:
        """Power out over power in, by normal force and Coulomb's friction along the helix."""
        if not 0.0 <= friction < math.inf:
            raise InputError('a coefficient of friction is not negative')
        mu = -friction if wheel_drives else friction
        press = math.cos(self.pressure_angle)
        c, s = math.cos(self.lead_angle), math.sin(self.lead_angle)
        # per unit of normal force, along the worm's motion and along its axis
        around, along = press * s + mu * c, press * c - mu * s
        if min(around, along) <= 0.0:
            raise InputError(
                'the worm is self-locking: its wheel cannot drive it'
                if wheel_drives
                else 'friction is too large for so steep a worm'
            )
        driven_by_worm = math.tan(self.lead_angle) * along / around
        return 1.0 / driven_by_worm if wheel_drives else driven_by_worm


_UNIT = WormPair(1, 1, 1.0, math.pi / 4)  # fields after others with defaults need one


@dataclass(frozen=True)
class WormDrive(SpatialPair):
    """A worm, the first, and its wheel on shafts at 90 degrees, [V] 5.8.4."""

    worm: WormPair = _UNIT  #: sizes of the pair
    hand: int = 1  #: 1 right, -1 left

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
        """Forces beside the tangential one: the axial force on one is tangential on the other.

        Both together, with friction or without, leave the force normal to the flanks.
        """
        lead, press = self.worm.lead_angle, self.worm.pressure_angle
        around = self.efforts(view)[0] / self.radii[0]
        across = tangential * math.cos(lead) - self.hand * around * math.sin(lead)
        apart = np.abs(across) * math.tan(press)
        return around, apart, tangential, apart, around
