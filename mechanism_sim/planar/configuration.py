"""Joints as equations between the poses of links, whatever the tree of the mechanism.

A pose is where a link's frame lies: x, y [m] and its angle [rad]. The equations serve where all
links are to be treated alike, such as in counting degrees of freedom; motion is computed in the
fewer coordinates of the tree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.planar.mechanism import (
    Equation,
    HigherPair,
    Joint,
    Mechanism,
    Prismatic,
    Revolute,
)
from mechanism_sim.planar.points import GROUND, Vector2, rotate


@dataclass(frozen=True)
class Constraints:
    """The equations of joints between links, ``residual(poses) = 0``.

    A revolute joint gives two rows: its point of the first link less that of the second [m]. A
    prismatic joint gives two: the distance of its point of the second link from the line [m], and
    the angle by which the second link is turned too far [rad]. A higher pair gives one [m], such
    as the distance of a pin from its slot.
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
        for link, at in (point for j in self.joints for point in j.points):
            points.setdefault(link, [(0.0, 0.0)]).append(at)
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

        def pose(link: str) -> Array:
            return np.zeros(3) if link == GROUND else poses[place[link]]

        for j in self.joints:
            for value, gradients in _equations(j, pose):
                residual[i] = value
                for link, gradient in gradients.items():
                    if link != GROUND:
                        jacobian[i, place[link]] += gradient
                i += 1
        return residual, jacobian.reshape(len(self.rows), 3 * len(self.links))

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


def turned(pose: Array, at: Vector2) -> tuple[Array, Array]:
    """A point of a link in the world, and its derivative by the angle."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    arm = np.array([cosine * at[0] - sine * at[1], sine * at[0] + cosine * at[1]])
    return pose[:2] + arm, np.array([-arm[1], arm[0]])


def _equations(joint: Joint, pose: Callable[[str], Array]) -> Iterator[Equation]:
    """The rows of a joint at the poses of links."""
    if isinstance(joint, HigherPair):
        yield joint.equation(pose)
        return
    first, second = pose(joint.first), pose(joint.second)
    (a, turning_a), (b, turning_b) = turned(first, joint.on_first), turned(second, joint.on_second)
    if isinstance(joint, Revolute):
        for k, along in enumerate(np.eye(2)):
            by_first = np.array([*along, turning_a[k]])
            by_second = -np.array([*along, turning_b[k]])
            yield float(a[k] - b[k]), {joint.first: by_first, joint.second: by_second}
        return
    value, by_first, by_second = off_line(first, joint.axis, (a, turning_a), (b, turning_b))
    yield value, {joint.first: by_first, joint.second: by_second}
    too_far = second[2] - first[2] - joint.angle
    unit = np.array([0.0, 0.0, 1.0])
    yield math.remainder(too_far, 2.0 * math.pi), {joint.first: -unit, joint.second: unit}


def off_line(
    carrier: Array, axis: float, on: tuple[Array, Array], p: tuple[Array, Array]
) -> tuple[float, Array, Array]:
    """Distance of a point from a line along `axis` that a link carries.

    Parameters
    ----------
    carrier : pose (3,) of the link
    axis : direction of the line in the link's frame [rad]
    on, p : a point of the line and the other point, each with its derivative by the angle of its
        link, as of `turned`

    Returns
    -------
    The distance [m], to the left of the line; its derivatives by the poses of the link and of the
    link of the other point (3,).
    """
    angle = carrier[2] + axis
    along = np.array([math.cos(angle), math.sin(angle)])
    normal = np.array([-along[1], along[0]])
    away = p[0] - on[0]
    by_angle = -along @ away - normal @ on[1]
    return (
        float(normal @ away),
        np.array([*-normal, by_angle]),
        np.array([*normal, normal @ p[1]]),
    )


def converted(ideal: Mechanism, loose: Mechanism, q: Array, v: Array) -> tuple[Array, Array]:
    """Coordinates (n,) of a mechanism cut elsewhere and their rates, from those of the ideal one.

    Links move as they do in the ideal one.
    """
    known = dict(zip(ideal.coordinates, np.stack([q, v], axis=1), strict=True))
    known[GROUND] = np.zeros(2)

    def moved(link: str, at: Vector2) -> Array:
        """Position and velocity (2, 2) [m, m/s] of a point."""
        return ideal.trace((link, at), q[:, None], v[:, None])[:, :, 0]

    found = []
    for name in loose.coordinates:
        link, _, axis = name.partition('.')
        if name in ideal.deformations:
            found.append(known[name])
        elif axis in ('x', 'y'):
            found.append(moved(link, loose.body(link).cog)[:, 'xy'.index(axis)])
        elif name in loose.displacements:
            j = loose.tree_joints[link]
            assert isinstance(j, Prismatic)  # noqa: S101 - it carries a displacement
            place, rate = moved(j.second, j.on_second) - moved(j.first, j.on_first)
            frame, offset = ideal.frame(j.first)
            angle, spin = known[frame]
            way = np.array(rotate((1.0, 0.0), angle + offset + j.axis))
            across = np.array([-way[1], way[0]])
            found.append(np.array([place @ way, rate @ way + spin * (place @ across)]))
        else:
            frame, offset = ideal.frame(link)
            found.append(known[frame] + [offset, 0.0])
    both = np.array(found)
    return both[:, 0], both[:, 1]
