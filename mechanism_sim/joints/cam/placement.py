"""A cam and its follower in a mechanism: where both are, as readings and drawings need it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.distance import Distance
from mechanism_sim.joints.cam.profiles import Cam
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import Vector2, rotate
from mechanism_sim.planar.view import Side


@dataclass(frozen=True)
class PlacedCam(HigherPair):
    """A cam on `first` and a follower on `second`: where both are.

    `on_first` is the camshaft's axis, `on_second` the centre of the roller, the tip of the knife
    or a point of the face. The frame of `followers` has its origin on the axis and its x axis
    along `direction`; the cam angle is ``sense * angle of first + phase``.

    A cam that slides keeps the cam angle 0. What its law goes over is how far it has slid along
    the negative y axis; `on_first` is the point that is then in the origin, abreast of the pivot
    of a swinging follower.
    """

    cam: Cam
    centre: Vector2  #: [m] of the camshaft, or of the origin in its place, in the world
    direction: float  #: [rad] in which the follower rises, or from the camshaft to its pivot
    sense: Literal[1, -1] = 1  #: 1 if the cam angle grows with the angle of `first`
    phase: float = 0.0  #: [rad]
    arm: Vector2 = (1.0, 0.0)
    """From the pivot of a swinging follower to its point [m], in its own frame."""
    beside: float = 0.0  #: [m] from the line through the camshaft to the point of a face

    exact: bool = False  #: distances of a roller to the second order, as grooves with play need

    sides: ClassVar[tuple[Side, ...]] = ('right',)
    grooved: ClassVar[bool] = False

    @property
    def arm_angle(self) -> float:
        """Of the arm or face of a swinging follower, in its own frame [rad]."""
        return math.atan2(*self.arm[::-1])

    @property
    def pivot(self) -> Vector2:
        """Of a swinging follower, in its own frame [m]."""
        return self.on_second[0] - self.arm[0], self.on_second[1] - self.arm[1]

    @cached_property
    def distance(self) -> Distance:
        """Of the follower from the cam."""
        return Distance(self.name, self.cam, self.beside, self.exact)

    @property
    def mirror(self) -> int:
        """-1 where the frame of `followers`, in which cams turn clockwise, is seen mirrored."""
        return -self.sense

    @property
    def swing(self) -> int:
        """1 if the place of a swinging follower grows as it turns counterclockwise."""
        side: int = getattr(self.cam.follower, 'side', 1)
        return self.mirror * side

    def world(self, vector: Vector2) -> Vector2:
        """A vector of the frame of `followers` in the world."""
        return rotate((vector[0], self.mirror * vector[1]), self.direction)

    def profile(self, points: Array) -> Array:
        """Points (2, N) of the profile as `Cam` gives them, in the frame of `first` [m]."""
        x, y = points
        angle = self.direction + self.sense * self.phase
        c, s = math.cos(angle), math.sin(angle)
        y = self.mirror * y
        placed: Array = np.array([c * x - s * y, s * x + c * y])
        placed += np.array(self.on_first)[:, None]
        return placed
