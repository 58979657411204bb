"""Joints as equations between the poses of links, whatever the tree of the mechanism.

A pose is where a link's frame lies: x, y [m] and its angle [rad]. The equations serve where all
links are to be treated alike, such as in counting degrees of freedom; motion is computed in the
fewer coordinates of the tree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.planar.mechanism import (
    GROUND,
    Geneva,
    Joint,
    Mechanism,
    PinInSlot,
    Prismatic,
    Revolute,
    SlottedRack,
    Vector2,
)

Array = NDArray[np.float64]
_Row = tuple[float, Array, Array]  # value, gradients by the poses of first and second link


@dataclass(frozen=True)
class Constraints:
    """The equations of joints between links, ``residual(poses) = 0``.

    A revolute joint gives two rows: its point of the first link less that of the second [m]. A
    prismatic joint gives two: the distance of its point of the second link from the line [m], and
    the angle by which the second link is turned too far [rad]. A pin in a slot gives one: the
    distance of the pin from the slot [m]; so do Geneva wheels and racks, where the locked ones
    are held in their place.
    """

    links: tuple[str, ...]  #: the moving links, in the order of poses
    joints: tuple[Joint, ...]

    @classmethod
    def of(cls, mechanism: Mechanism) -> Constraints:
        """Those of all joints of a mechanism, loose ones taken as ideal."""
        return cls(tuple(body.name for body in mechanism.bodies), mechanism.joints)

    @cached_property
    def rows(self) -> tuple[str, ...]:
        """Name of the joint of each row."""
        counts = {Revolute: 2, Prismatic: 2}
        return tuple(j.name for j in self.joints for _ in range(counts.get(type(j), 1)))

    @cached_property
    def size(self) -> float:
        """Longest distance between two joints of one link, or from its origin [m]; 1 if none."""
        points: dict[str, list[Vector2]] = {}
        for j in self.joints:
            points.setdefault(j.first, [(0.0, 0.0)]).append(j.on_first)
            points.setdefault(j.second, [(0.0, 0.0)]).append(j.on_second)
        longest = (math.dist(a, b) for some in points.values() for a in some for b in some)
        return max(longest, default=0.0) or 1.0

    def linearise(self, poses: Array) -> tuple[Array, Array]:
        """What the equations leave, and its derivatives.

        Parameters
        ----------
        poses : (n, 3) x, y [m] and angle [rad] of each link

        Returns
        -------
        residual : (m,) [m], of angles [rad]
        jacobian : (m, 3 n) columns x, y, angle of the first link, then of the second
        """
        place = {link: i for i, link in enumerate(self.links)}
        residual = np.zeros(len(self.rows))
        jacobian = np.zeros((len(self.rows), len(self.links), 3))
        i = 0
        for j in self.joints:
            ends = (j.first, j.second)
            here, there = (np.zeros(3) if x == GROUND else poses[place[x]] for x in ends)
            for value, *gradients in _equations(j, here, there):
                residual[i] = value
                for link, gradient in zip(ends, gradients, strict=True):
                    if link != GROUND:
                        jacobian[i, place[link]] += gradient
                i += 1
        return residual, jacobian.reshape(len(self.rows), 3 * len(self.links))

    def residual(self, poses: Array) -> Array:
        """What the equations leave (m,) at poses (n, 3) [m, rad]."""
        return self.linearise(poses)[0]

    def jacobian(self, poses: Array) -> Array:
        """Derivatives (m, 3 n) of the rows at poses (n, 3)."""
        return self.linearise(poses)[1]

    def normalise(self, poses: Array) -> tuple[Array, Array]:
        """As `linearise`, with every length measured in `size`: free of units."""
        residual, jacobian = self.linearise(poses)
        unit = np.where(self._turns, 1.0, self.size)
        return residual / unit, jacobian * self.scale.ravel() / unit[:, None]

    @property
    def scale(self) -> Array:
        """What a unit of each normalised coordinate is (n, 3) [m, m, rad]."""
        return np.tile([self.size, self.size, 1.0], (len(self.links), 1))

    @cached_property
    def _turns(self) -> NDArray[np.bool_]:
        """Which rows are angles."""
        kinds = {Revolute: (False, False), Prismatic: (False, True)}
        return np.array([t for j in self.joints for t in kinds.get(type(j), (False,))], dtype=bool)


def poses(mechanism: Mechanism, q: Mapping[str, float]) -> Array:
    """Poses (n, 3) [m, rad] of the links of a mechanism at coordinates `q`."""
    links = [body.name for body in mechanism.bodies]
    return np.array([(*mechanism.locate(x, q), mechanism.angle(x, q)) for x in links])


def _turned(pose: Array, at: Vector2) -> tuple[Array, Array]:
    """A point of a link in the world, and its derivative by the angle."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    arm = np.array([cosine * at[0] - sine * at[1], sine * at[0] + cosine * at[1]])
    return pose[:2] + arm, np.array([-arm[1], arm[0]])


def _equations(joint: Joint, first: Array, second: Array) -> Iterator[_Row]:
    """The rows of a joint at the poses (3,) of its links."""
    a, turning_a = _turned(first, joint.on_first)
    b, turning_b = _turned(second, joint.on_second)
    if isinstance(joint, Revolute):
        for k, along in enumerate(np.eye(2)):
            by_first = np.array([*along, turning_a[k]])
            yield a[k] - b[k], by_first, -np.array([*along, turning_b[k]])
        return
    if isinstance(joint, PinInSlot):  # the line is the second link's
        value, by_second, by_first = _off_line(second, joint.axis, b, turning_b, a, turning_a)
        yield value, by_first, by_second
        return
    if isinstance(joint, Geneva | SlottedRack):
        yield _indexed(joint, second, (a, turning_a), (b, turning_b))
        return
    yield _off_line(first, joint.axis, a, turning_a, b, turning_b)
    turned = second[2] - first[2] - joint.angle
    unit = np.array([0.0, 0.0, 1.0])
    yield math.remainder(turned, 2.0 * math.pi), -unit, unit


def _indexed(
    joint: Geneva | SlottedRack, second: Array, pin: tuple[Array, Array], on: tuple[Array, Array]
) -> _Row:
    """Distance of the pin from the nearest slot, or of the locked follower from its place."""
    (a, turning_a), (b, turning_b) = pin, on
    if isinstance(joint, Geneva):
        between, z = 2.0 * math.pi / joint.slots, a - b
        if math.hypot(*z) >= joint.entry:
            turned = math.remainder(second[2] - joint.towards - 0.5 * between, between)
            return joint.entry * turned, np.zeros(3), np.array([0.0, 0.0, joint.entry])
        nearest = between * round((math.atan2(z[1], z[0]) - second[2]) / between)
        value, by_second, by_first = _off_line(second, nearest, b, turning_b, a, turning_a)
        return value, by_first, by_second
    u = np.array([math.cos(joint.axis), math.sin(joint.axis)])
    by_rack = np.array([*u, u @ turning_b])
    if u[0] * (a[1] - joint.centre[1]) - u[1] * (a[0] - joint.centre[0]) >= 0.0:
        off = math.remainder(u @ (b - joint.centre) - 0.5 * joint.pitch, joint.pitch)
        return off, np.zeros(3), by_rack
    off = math.remainder(u @ (a - b), joint.pitch)
    return off, np.array([*u, u @ turning_a]), -by_rack


def _off_line(
    carrier: Array, axis: float, on: Array, turning_on: Array, p: Array, turning_p: Array
) -> _Row:
    """Distance of the point p from the line through `on` that a link carries along."""
    angle = carrier[2] + axis
    along = np.array([math.cos(angle), math.sin(angle)])
    normal = np.array([-along[1], along[0]])
    by_angle = -along @ (p - on) - normal @ turning_on
    by_carrier = np.array([*-normal, by_angle])
    return float(normal @ (p - on)), by_carrier, np.array([*normal, normal @ turning_p])
