"""Followers of a cam, and where and how each touches it ([V] 4.1, 4.5, 4.6).

Frame and directions are those of `touch`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import inf
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.laws import Law
from mechanism_sim.joints.cam.touch import CamTouch, FramePassage, angle_between, cross, turned


class _Touching(ABC):
    """Common part of all followers."""

    @abstractmethod
    def place(self, point: Array, normal: Array, base_radius: float) -> tuple[Array, Array]:
        """Cam angles and displacements for contact at profile points (2, N) [m] and normals.

        Cam angles (N,) [rad], whose whole turns do not count, and displacements (N,) from the base
        circle: what `touch` gives, from the other side.
        """


class _Rolling(_Touching):
    """Common part of followers with a knife or a roller."""

    roller: float

    @abstractmethod
    def path(self, law: Law, base_radius: float, angle: Array) -> Array:
        """Place of the roller's centre and its two derivatives by the angle, (3, 2, N) [m]."""

    @abstractmethod
    def motion(self, law: Law, base_radius: float, angle: Array) -> tuple[Array, Array]:
        """Direction of motion (2, N) of the roller's centre; rate (N,) of the follower's angle."""

    def touch(self, law: Law, base_radius: float, angle: ArrayLike) -> CamTouch:
        """Contact with a cam of this base radius [m] at angles (N,) [rad] or displacements [m].

        The pitch curve is the path of the roller's centre seen from the cam; the profile lies
        inside of it by the roller's radius. A knife is a roller of radius 0.
        """
        angle, seen = np.atleast_1d(np.asarray(angle, dtype=float)), FramePassage.of(law)
        p, p1, p2 = self.path(law, base_radius, angle)
        along = p1 + seen.velocities(p)
        speed = np.hypot(*along)
        tangent = along / speed
        normal = -turned(tangent)
        w = seen.turning
        curvature = cross(along, p2 + 2.0 * w * turned(p1) - w**2 * p) / speed**3
        with np.errstate(divide='ignore'):
            radius = np.where(curvature == 0.0, inf, 1.0 / curvature - self.roller)
        direction, turning = self.motion(law, base_radius, angle)
        return CamTouch(
            seen.places(p, angle),
            seen.places(p - self.roller * normal, angle),
            seen.directions(normal, angle),
            angle_between(direction, normal),
            curvature,
            radius,
            speed - self.roller * (w + turning),
            speed * (1.0 - self.roller * curvature),
        )


@dataclass(frozen=True)
class Translating(_Rolling):
    """A follower that moves along a line beside the camshaft, with a knife edge or a roller.

    Parameters
    ----------
    offset : of the line from the camshaft, counterclockwise positive [m]; 0 is radial
    roller : its radius [m]; 0 is a knife edge
    """

    offset: float = 0.0
    roller: float = 0.0

    def __post_init__(self) -> None:
        _require(self.roller >= 0, 'the radius of a roller is not negative')

    def path(self, law: Law, base_radius: float, angle: Array) -> Array:
        """Path of the roller's centre and its two derivatives; [V] 4.66 with an offset."""
        prime = base_radius + self.roller
        u, u1, u2 = (law(angle, k) for k in range(3))
        nothing = np.zeros_like(u)
        if law.reciprocating:
            return np.array([(prime + u, nothing + self.offset), (u1, nothing), (u2, nothing)])
        _require(
            abs(self.offset) < prime,
            f'an offset of {self.offset:g} m misses the base circle of {base_radius:g} m',
        )
        lowest = np.sqrt(prime**2 - self.offset**2)
        _require(bool((lowest + u > 0).all()), 'the law takes the follower below the camshaft')
        return np.array([(lowest + u, nothing + self.offset), (u1, nothing), (u2, nothing)])

    def place(self, point: Array, normal: Array, base_radius: float) -> tuple[Array, Array]:
        """Cam angles and displacements: the roller's centre lies on the follower's line."""
        centre = point + self.roller * normal
        square = (centre**2).sum(axis=0) - self.offset**2
        _require(bool((square > 0).all()), 'the line of the follower misses the profile')
        reach, prime = np.sqrt(square), base_radius + self.roller
        angle = np.arctan2(centre[1], centre[0]) - np.arctan2(self.offset, reach)
        return angle, reach - np.sqrt(prime**2 - self.offset**2)

    def motion(self, law: Law, base_radius: float, angle: Array) -> tuple[Array, Array]:
        """Outwards, without turning."""
        return np.array([np.ones_like(angle), np.zeros_like(angle)]), np.zeros_like(angle)


@dataclass(frozen=True)
class Oscillating(_Rolling):
    """A follower that swings about a pivot, with a knife edge or a roller at the end of its arm.

    The law is its angle [rad], measured outwards from the position on the base circle.

    Parameters
    ----------
    pivot_distance : from the camshaft, along the x axis [m]
    arm : from the pivot to the roller's centre [m]
    roller : its radius [m]; 0 is a knife edge
    side : 1 if the arm swings counterclockwise as it rises (the roller is then on the clockwise
        side of the line from the camshaft to the pivot), else -1
    """

    pivot_distance: float
    arm: float
    roller: float = 0.0
    side: Literal[1, -1] = 1

    def __post_init__(self) -> None:
        _require(self.roller >= 0, 'the radius of a roller is not negative')
        _require(self.pivot_distance > 0 < self.arm, 'pivot distance and arm are positive')

    def lowest(self, base_radius: float, reciprocating: bool = False) -> float:
        """Angle between arm and line of centres on the base circle, or base line [rad]."""
        a, b, prime = self.pivot_distance, self.arm, base_radius + self.roller
        cosine = (a - prime) / b if reciprocating else (a**2 + b**2 - prime**2) / (2.0 * a * b)
        _require(
            abs(cosine) < 1,
            f'an arm of {b:g} m with its pivot at {a:g} m does not reach the base circle of '
            f'{base_radius:g} m, or lies in the line of centres there',
        )
        return float(np.arccos(cosine))

    def path(self, law: Law, base_radius: float, angle: Array) -> Array:
        """Path of the roller's centre on the swinging arm, and its two derivatives."""
        u, u1, u2 = (law(angle, k) for k in range(3))
        psi = self.lowest(base_radius, law.reciprocating) + u
        c, s = self.arm * np.cos(psi), self.arm * np.sin(psi)
        _require(bool((s > 0).all()), 'the law takes the arm past the line of centres')
        return np.array(
            [
                (self.pivot_distance - c, -self.side * s),
                (s * u1, -self.side * c * u1),
                (s * u2 + c * u1**2, -self.side * (c * u2 - s * u1**2)),
            ]
        )

    def place(self, point: Array, normal: Array, base_radius: float) -> tuple[Array, Array]:
        """Cam angles and displacements, from the triangle of camshaft, pivot, roller's centre."""
        centre, a, b = point + self.roller * normal, self.pivot_distance, self.arm
        cosine = (a**2 + b**2 - (centre**2).sum(axis=0)) / (2.0 * a * b)
        _require(bool((np.abs(cosine) < 1.0).all()), 'the arm does not reach all of the profile')
        psi = np.arccos(cosine)
        bearing = np.arctan2(-self.side * b * np.sin(psi), a - b * cosine)
        angle = np.arctan2(centre[1], centre[0]) - bearing
        return angle, psi - self.lowest(base_radius)

    def motion(self, law: Law, base_radius: float, angle: Array) -> tuple[Array, Array]:
        """Direction of motion, across the arm, and its rate."""
        psi = self.lowest(base_radius, law.reciprocating) + law(angle)
        return np.array([np.sin(psi), -self.side * np.cos(psi)]), self.side * law(angle, 1)


class _Flat(_Touching):
    """Common part of flat-faced followers."""

    @abstractmethod
    def face(self, law: Law, base_radius: float, angle: Array) -> tuple[Array, Array]:
        """The face's distance from the camshaft and the angle of its normal, with derivatives.

        Distance and its two derivatives by the cam angle (3, N) [m]; the normal's angle in the
        frame and its two derivatives (3, N) [rad].
        """

    @abstractmethod
    def motion_at(self, point: Array, rate: Array) -> tuple[Array, Array]:
        """Direction of motion and velocity by the angle of a point of the follower, (2, N)."""

    def touch(self, law: Law, base_radius: float, angle: ArrayLike) -> CamTouch:
        """Contact with a cam of this base radius [m] at angles (N,) [rad] or displacements [m].

        The distance of the face over the angle of its normal is the support function h of the
        profile: h along the normal, h' across, radius of curvature h + h''.
        """
        angle, seen = np.atleast_1d(np.asarray(angle, dtype=float)), FramePassage.of(law)
        (h, h1, h2), (bearing, b1, b2) = self.face(law, base_radius, angle)
        b1 = b1 + seen.turning
        _require(
            bool((b1 > 0).all() or (law.reciprocating and (b1 < 0).all())),
            'a face that does not turn one way all along gives a reciprocating cam no shape: take '
            'a knife edge or a roller'
            if law.reciprocating
            else 'the face of the follower swings back faster than the cam turns',
        )
        normal = np.array([np.cos(bearing), np.sin(bearing)])
        tangent = turned(normal)
        # the distance from the cam's origin grows by the frame's passage too
        h1 = h1 + (normal * seen.velocity).sum(axis=0)
        h2 = h2 + 2.0 * b1 * (tangent * seen.velocity).sum(axis=0)
        across = h1 / b1
        radius = h + (h2 * b1 - h1 * b2) / b1**3
        point = h * normal + across * tangent
        direction, velocity = self.motion_at(point, law(angle, 1))
        with np.errstate(divide='ignore'):
            curvature = 1.0 / radius
        place = seen.places(point, angle)
        return CamTouch(
            place,
            place,
            seen.directions(normal, angle),
            angle_between(direction, normal),
            curvature,
            radius,
            ((velocity + seen.velocities(point)) * tangent).sum(axis=0),
            radius * b1,
        )


@dataclass(frozen=True)
class FlatFaced(_Flat):
    """A translating follower with a face across its direction, or tilted.

    Where its axis is does not matter to the cam: the contact moves along the face by the
    velocity du/dtheta times the cosine of the tilt.

    Parameters
    ----------
    tilt : from the direction of motion to the normal of the face, counterclockwise [rad]; it is
        the pressure angle
    """

    tilt: float = 0.0

    def __post_init__(self) -> None:
        _require(abs(self.tilt) < 0.5 * np.pi, 'a face is tilted by less than 90 deg')

    def face(self, law: Law, base_radius: float, angle: Array) -> tuple[Array, Array]:
        """Base radius, and the part of the displacement along the normal."""
        h = np.cos(self.tilt) * np.array([law(angle, k) for k in range(3)])
        h[0] += base_radius
        _require(bool((h[0] > 0).all()), 'the law takes the follower below the camshaft')
        nothing = np.zeros_like(angle)
        return h, np.array([nothing + self.tilt, nothing, nothing])

    def place(self, point: Array, normal: Array, base_radius: float) -> tuple[Array, Array]:
        """Cam angles and displacements, from the tangent's distance from the camshaft."""
        away = (point * normal).sum(axis=0) - base_radius
        return np.arctan2(normal[1], normal[0]) - self.tilt, away / np.cos(self.tilt)

    def motion_at(self, point: Array, rate: Array) -> tuple[Array, Array]:
        """Outwards."""
        outwards = np.array([np.ones_like(rate), np.zeros_like(rate)])
        return outwards, outwards * rate


@dataclass(frozen=True)
class OscillatingFlat(_Flat):
    """A follower that swings about a pivot, with a straight face.

    The law is its angle [rad], measured outwards from the position on the base circle.

    Parameters
    ----------
    pivot_distance : from the camshaft, along the x axis [m]
    face_offset : of the face from the pivot, away from the cam positive [m]
    side : 1 if the face swings counterclockwise as it rises, else -1
    """

    pivot_distance: float
    face_offset: float = 0.0
    side: Literal[1, -1] = 1

    def __post_init__(self) -> None:
        _require(self.pivot_distance > 0, 'a pivot distance is positive')

    def lowest(self, base_radius: float) -> float:
        """Angle between face and line of centres on the base circle [rad]."""
        a, sine = self.pivot_distance, (base_radius - self.face_offset) / self.pivot_distance
        _require(
            abs(sine) < 1,
            f'a pivot at {a:g} m is too near for a base circle of {base_radius:g} m',
        )
        return float(np.arcsin(sine))

    def face(self, law: Law, base_radius: float, angle: Array) -> tuple[Array, Array]:
        """The line past the pivot."""
        a = self.pivot_distance
        u, u1, u2 = (law(angle, k) for k in range(3))
        psi = self.lowest(base_radius) + u
        c, s = a * np.cos(psi), a * np.sin(psi)
        h = np.array([s + self.face_offset, c * u1, c * u2 - s * u1**2])
        return h, self.side * np.array([psi - np.pi / 2, u1, u2])

    def place(self, point: Array, normal: Array, base_radius: float) -> tuple[Array, Array]:
        """Cam angles and displacements, from the tangent's distance from the camshaft."""
        away = (point * normal).sum(axis=0) - self.face_offset
        sine = away / self.pivot_distance
        _require(bool((np.abs(sine) < 1.0).all()), 'the profile reaches the pivot')
        psi = np.arcsin(sine)
        angle = np.arctan2(normal[1], normal[0]) - self.side * (psi - 0.5 * np.pi)
        return angle, psi - self.lowest(base_radius)

    def motion_at(self, point: Array, rate: Array) -> tuple[Array, Array]:
        """Direction of motion at a point, across the line from the pivot, and velocity."""
        arm = point - np.array([[self.pivot_distance], [0.0]])
        direction = self.side * turned(arm)
        return direction, direction * rate


Follower = Translating | Oscillating | FlatFaced | OscillatingFlat


def _require(holds: bool, sentence: str) -> None:
    if not holds:
        raise InputError(sentence)
