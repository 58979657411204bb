"""Contact of follower and cam, and the motion of each seen from the other ([V] 4.5).

The frame has the camshaft at its origin and the follower above it, on the x axis; the cam turns
clockwise. Seen from the cam, the follower goes round counterclockwise by the cam angle, and the
profile is the envelope of its positions. At angle 0 both frames agree.

A reciprocating cam ([V] figures 4.5, 4.6) slides along the negative y axis, as the part of a disk
cam under the follower does; seen from it, the follower moves along the y axis by the cam's
displacement. Its base radius is the height of zero displacement above the y axis, which takes the
camshaft's place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.cam.laws import Law


class CamTouch(NamedTuple):
    """Contact of a follower at cam angles or displacements (N,), in the cam's frame.

    Parameters
    ----------
    pitch : centre of the roller, tip of the knife or point of contact of a face, (2, N) [m]
    profile : the point of contact, (2, N) [m]
    normal : out of the cam, (2, N)
    pressure_angle : from the direction in which the follower moves at a positive rate, at its
        `pitch` point, to the normal, counterclockwise, (N,) [rad]
    curvature : of the pitch curve, positive where it bulges, (N,) [1/m]
    curvature_radius : of the profile, negative where it is hollow, (N,) [m]
    sliding : along the face or at the knife; what the rolling of a roller has to take up; per
        radian [m] or metre of the cam, counterclockwise in the cam's frame, (N,)
    rate : how fast the point of contact moves along the profile, counted likewise, (N,)
    """

    pitch: Array
    profile: Array
    normal: Array
    pressure_angle: Array
    curvature: Array
    curvature_radius: Array
    sliding: Array
    rate: Array


class FramePassage(NamedTuple):
    """Motion of the frame relative to the cam per radian, or per metre of a sliding cam."""

    turning: float
    velocity: Array  #: without the turning, (2, 1)

    @classmethod
    def of(cls, law: Law) -> FramePassage:
        """The one that goes with a law."""
        slides = float(law.reciprocating)
        return cls(1.0 - slides, np.array([[0.0], [slides]]))

    def velocities(self, points: Array) -> Array:
        """Velocities of points (2, N) fixed to the frame."""
        return self.turning * turned(points) + self.velocity

    def directions(self, vectors: Array, angle: Array) -> Array:
        """Vectors (2, N) of the frame, seen from the cam."""
        x = self.turning * angle
        return np.cos(x) * vectors + np.sin(x) * turned(vectors)

    def places(self, points: Array, angle: Array) -> Array:
        """Points (2, N) of the frame, seen from the cam."""
        return self.directions(points, angle) + self.velocity * angle


def turned(vectors: Array) -> Array:
    """Vectors (2, N) turned by a right angle, counterclockwise."""
    return np.array([-vectors[1], vectors[0]])


def cross(a: Array, b: Array) -> Array:
    """The part of a product of vectors (2, N) across the plane, (N,)."""
    return np.asarray(a[0] * b[1] - a[1] * b[0])


def angle_between(a: Array, b: Array) -> Array:
    """Angles from the first to the second vectors (2, N) [rad]."""
    return np.asarray(np.arctan2(cross(a, b), (a * b).sum(axis=0)))
