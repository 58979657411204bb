"""Joints as equations between the poses of links, whatever the tree of the mechanism.

A pose is where a link's frame lies: x, y [m] and its angle [rad]. The equations serve where all
links are to be treated alike, such as in counting degrees of freedom; motion is computed in the
fewer coordinates of the tree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.planar.bodies import Body
from mechanism_sim.planar.closures import closures
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.mechanism import Joint, Mechanism, Prismatic
from mechanism_sim.planar.points import GROUND, LinkPoint, Vector2, rotate


@dataclass(frozen=True)
class Constraints:
    """The closures of joints between links that all float, ``residual(poses) = 0`` [m].

    A revolute joint gives two rows, its point of the first link less that of the second. A
    prismatic joint gives two: the distance of its point of the second link from the line, and the
    sine of the angle by which the second link is turned too far, times `size`. A higher pair gives
    one, such as the distance of a pin from its slot.
    """

    links: tuple[str, ...]  #: the moving links, in the order of poses
    joints: tuple[Joint, ...]

    @classmethod
    def of(cls, mechanism: Mechanism) -> Constraints:
        """Constraints of all joints of a mechanism, loose ones taken as ideal."""
        return cls(tuple(body.name for body in mechanism.bodies), mechanism.joints)

    @cached_property
    def _floating(self) -> Kinematics:
        """The closures, with all joints cut: coordinates are where the links' frames lie."""
        bodies = tuple(Body(link, 1.0, 1.0, (0.0, 0.0)) for link in self.links)
        mechanism = Mechanism(bodies, self.joints, tuple(j.name for j in self.joints))
        return Kinematics(mechanism, closures(mechanism, mechanism.cut), ())

    @property
    def rows(self) -> tuple[str, ...]:
        """Name of the joint of each row."""
        return tuple(self._floating.rows)

    @property
    def size(self) -> float:
        """Size of the mechanism [m]."""
        return self._floating.mechanism.size

    def linearise(self, poses: Array) -> tuple[Array, Array]:
        """Residuals of the closures, and their derivatives.

        Parameters
        ----------
        poses : (n, 3) x, y [m] and angle [rad] of each link

        Returns
        -------
        residual : (m,) [m]
        jacobian : (m, 3 n) columns x, y, angle of the first link, then of the second
        """
        n = len(self.links)
        residual, jacobian = self._floating.closure(
            np.concatenate([poses[:, 2], poses[:, :2].ravel()])[:, None]
        )
        columns = [i for k in range(n) for i in (n + 2 * k, n + 2 * k + 1, k)]
        return residual[0], jacobian[0][:, columns]

    def normalise(self, poses: Array) -> tuple[Array, Array]:
        """Residual and Jacobian as of `linearise`, dimensionless by lengths over `size`."""
        residual, jacobian = self.linearise(poses)
        return residual / self.size, jacobian * self.scale.ravel() / self.size

    @property
    def scale(self) -> Array:
        """Units of the normalised coordinates (n, 3) [m, m, rad]."""
        return np.tile([self.size, self.size, 1.0], (len(self.links), 1))


def poses(mechanism: Mechanism, q: Mapping[str, float]) -> Array:
    """Poses (n, 3) [m, rad] of the links of a mechanism at coordinates `q`."""
    links = [body.name for body in mechanism.bodies]
    return np.array([(*mechanism.locate(x, q), mechanism.angle(x, q)) for x in links])


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


class Poses:
    """Places of links at N instants, and their directions.

    Parameters
    ----------
    q : (n, N) coordinates
    """

    def __init__(self, mechanism: Mechanism, q: Array) -> None:
        self._mechanism, self._q = mechanism, q
        links = [GROUND, *(body.name for body in mechanism.bodies)]
        angles = {link: mechanism.angle_all(link, q) for link in links}
        self.along = {link: np.array([np.cos(x), np.sin(x)]) for link, x in angles.items()}
        """Unit vectors (2, N) along the x axis of each link."""

    def at(self, place: LinkPoint) -> Array:
        """A point of a link in the world (2, N) [m]."""
        link, at = place
        return self._mechanism.locate_all(link, self._q, at)

    def within(self, link: str, place: LinkPoint) -> Array:
        """A point of any link in the frame of this one (2, N) [m]."""
        x, y = self.at(place) - self.at((link, (0.0, 0.0)))
        ux, uy = self.along[link]
        return np.array([ux * x + uy * y, ux * y - uy * x])
