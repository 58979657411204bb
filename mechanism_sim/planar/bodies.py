"""Links as bodies, and how a kind of link extends them by coordinates of its own."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

from mechanism_sim.planar.frames import Frames
from mechanism_sim.planar.points import Point, Vector2

Arms: TypeAlias = dict[tuple[str, ...], Vector2]
"""Vectors of a link's frame by products of its own coordinates."""


class LinkExtension(ABC):
    """Coordinates of a link beside those of a rigid body, and their effects on it.

    A method that a kind does not override adds nothing.
    """

    #: moves points of its link in the link's frame; False if it moves the whole link
    flexible: ClassVar[bool] = True
    #: turns cross-sections of its link against each other
    bends: ClassVar[bool] = False
    #: has masses that move against each other, so that the centre of gravity is a sum over them
    scattered: ClassVar[bool] = True

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""

    @property
    def angles(self) -> tuple[str, ...]:
        """Coordinates that are angles."""
        return ()

    @abstractmethod
    def masses(self, body: Body, place: Callable[..., Point]) -> Iterable[tuple[float, Point]]:
        """Masses [kg] and their points, whose motion is that of all of the link.

        Parameters
        ----------
        place : position of a point of the link, from a point of its plane and a height above [m]
        """

    def spin_of(self, body: Body) -> float:
        """Moment of inertia [kg m^2] that turns with the link's frame beside the masses."""
        return body.inertia

    @property
    def rising(self) -> Mapping[str, float]:
        """Inertia of the motion out of the plane, by coordinate [kg m^2, kg]."""
        return {}

    @property
    def tilting_spins(self) -> Mapping[tuple[str, str], float]:
        """Moments of inertia [kg m^2] about axes that spin and tilt, by the slopes along x, y."""
        return {}

    def extent(self, body: Body) -> float:
        """Least distance from the centre of gravity to which masses extend [m]."""
        return 0.0

    def arms(self, at: Vector2) -> Arms:
        """Displacement of a point of the link in the link's frame."""
        return {}

    def turned(self, at: Vector2, v: Vector2) -> Arms:
        """Change of a vector that is fixed to the cross-section at a point."""
        return {}

    def lean(self, height: float) -> Arms:
        """Displacement, in the link's frame, of a point above the link's plane [m]."""
        return {}

    def rise(self, at: Vector2) -> dict[str, float]:
        """Displacement along the axes of a point of the link's plane, per coordinate."""
        return {}

    def slopes(self, at: Vector2) -> dict[str, float]:
        """Rotation of a cross-section per coordinate [rad/m]."""
        return {}

    def moved(self, link: str) -> Point:
        """Common displacement of all points of the link in the world."""
        return {}

    @property
    def springs(self) -> Mapping[str, tuple[float, float]]:
        """Stiffness and damping of each coordinate that has such forces only."""
        return {}

    def forces(self, link: str, frames: Frames) -> Any:
        """Other forces: `elastic` and `other` by coordinate, `energy`, `loss`; None if none."""
        return None


@dataclass(frozen=True)
class Body:
    """A link; mass, inertia and centre of gravity are those of the undeformed one.

    Mass and inertia of a rotor are those of all disks and supports, the centre of gravity is that
    of the link's own disk.
    """

    name: str
    mass: float  #: [kg]
    inertia: float  #: [kg m^2] about the centre of gravity
    cog: Vector2  #: [m] centre of gravity in the link's frame
    extension: LinkExtension | None = None

    @property
    def disk_radius(self) -> float:
        """Radius of a uniform disk with this mass and inertia [m]."""
        return math.sqrt(2.0 * self.inertia / self.mass) if self.mass else 0.0
