"""Bevel and worm pairs: a ratio of angles, and the forces of their teeth in space ([V] 5.8).

Each shaft is seen along its own axis, towards the reader, and turns in the plane of the machine;
the axes themselves are at an angle in space, which the plane does not know. Those of bevel gears
point away from the apex of their cones, so that the two turn opposite ways. Those of a worm and
its wheel make, with the direction e from worm to wheel, ``z_wheel = e x z_worm``: then a
right-handed worm and its wheel turn the same way.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.mesh.involute import Gear
from mechanism_sim.joints.mesh.reading import GearReading
from mechanism_sim.joints.transmission.constraint import Transmission
from mechanism_sim.planar.view import Draft, PairView, ToothLoad, circle

_FEWEST = 8  # teeth that are drawn as involutes


def pitch_angles(ratio: float, shaft_angle: float = math.pi / 2) -> tuple[float, float]:
    """Half the openings of the pitch cones of driver and driven bevel gear [rad].

    The cones roll on each other, sin gamma_3/sin gamma_2 = N3/N2, and fill the angle between the
    shafts.
    """
    if not (ratio > 0.0 and 0.0 < shaft_angle < math.pi):
        raise InputError('bevel shafts meet at an angle between 0 and 180 deg')
    first = math.atan2(math.sin(shaft_angle), ratio + math.cos(shaft_angle))
    return first, shaft_angle - first


@dataclass(frozen=True)
class SpatialPair(Transmission):
    """Gears on shafts at an angle."""

    untold: ClassVar[tuple[str, ...]] = ('transmission_error', 'mesh_frequency')

    #: direction from each shaft towards the mate, in its own plane [rad]
    facing: tuple[float, float] = (0.0, math.pi)
    along: tuple[float, float] = (0.0, 0.0)  #: positions of both along their shafts [m]

    @property
    @abstractmethod
    def radii(self) -> tuple[float, float]:
        """Radii of the points of force [m]."""

    @property
    @abstractmethod
    def _teeth(self) -> tuple[tuple[int, float], tuple[int, float]]:
        """Numbers of teeth, 0 for threads, and the visible share of their height."""

    @abstractmethod
    def _beside(
        self, view: PairView, tangential: Array
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Tangential force on the first (N,) [N], of that on the second.

        Then radial and axial ones on first and second.
        """

    @property
    def toothed(self) -> tuple[str, ...]:
        """Names of both links, which have teeth."""
        return self.first, self.second

    def tooth_loads(self, view: PairView) -> Sequence[ToothLoad]:
        """Tooth loads at the pitch points: tangential, radial and axial forces."""
        second = view.moment / self.radii[1]
        first, radial_1, axial_1, radial_2, axial_2 = self._beside(view, second)
        found = []
        for link, push, radius, facing, along, radial, axial in zip(
            (self.first, self.second), (first, second), self.radii, self.facing, self.along,
            (radial_1, radial_2), (axial_1, axial_2), strict=True,
        ):  # fmt: skip
            c, s = math.cos(facing), math.sin(facing)
            force = np.array([-s * push - c * radial, c * push - s * radial, axial])
            arm = np.array([radius * c, radius * s, along])[:, None] + np.zeros(view.count)
            found.append(ToothLoad(link, force, arm, False))
        return found

    def draw(self, draft: Draft) -> None:
        """Teeth as each shaft is seen along itself; a worm as its pitch circle, with a notch."""
        for link, at, radius, (teeth, height) in zip(
            (self.first, self.second), (self.on_first, self.on_second), self.radii, self._teeth,
            strict=True,
        ):  # fmt: skip
            rim = circle(radius)
            rim[0] = 0.85 * radius, 0.0
            if teeth >= _FEWEST:
                rim = Gear(teeth, 2.0 * radius / teeth).outline(9, arc=2)
                far = np.hypot(*rim.T)[:, None]
                rim *= (radius + height * (far - radius)) / far
            draft.add('wheel', link, rim + at, size=radius)

    def reading(self, view: PairView) -> GearReading:
        """Motion and torques, and the force on the second."""
        parts = self.tooth_loads(view)[1].components
        total = np.sqrt(sum(x**2 for x in parts.values()))
        return (
            super()
            .reading(view)
            ._replace(
                tooth_force=total,
                tangential_force=parts['tangential'],
                radial_force=parts['radial'],
                axial_force=parts['axial'],
            )
        )


@dataclass(frozen=True)
class BevelPair(SpatialPair):
    """Straight bevel gears, [V] eqs. 5.38 to 5.42."""

    #: radii at the middle of the teeth [m]
    mean_radii: tuple[float, float] = (math.nan, math.nan)
    cones: tuple[float, float] = (math.nan, math.nan)  #: pitch angles [rad]
    pressure_angle: float = math.nan  #: [rad]
    teeth: int = 1  #: number of teeth of the first

    @property
    def radii(self) -> tuple[float, float]:
        """Radii at the middle of the teeth [m]."""
        return self.mean_radii

    @property
    def _teeth(self) -> tuple[tuple[int, float], tuple[int, float]]:
        first, second = self.mean_radii
        mate = round(self.teeth * second / first)
        return (self.teeth, math.cos(self.cones[0])), (mate, math.cos(self.cones[1]))

    def _beside(
        self, view: PairView, tangential: Array
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Tangential, radial and axial forces: normal to the flanks at the cones' common line."""
        first = -float(self.ratio) * view.moment / self.radii[0]
        apart = np.abs(tangential) * math.tan(self.pressure_angle)
        (c1, s1), (c2, s2) = ((math.cos(g), math.sin(g)) for g in self.cones)
        return first, apart * c1, apart * s1, apart * c2, apart * s2
