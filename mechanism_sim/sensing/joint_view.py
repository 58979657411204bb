"""One joint of a machine at many instants, the input of readings of all kinds of joints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechanism_sim.arrays import Array
from mechanism_sim.engine.events import Mode
from mechanism_sim.engine.physics import Physics, known_wrench
from mechanism_sim.planar.elastic import Beam
from mechanism_sim.planar.gaps import wall_name
from mechanism_sim.planar.inverse_dynamics import Observation
from mechanism_sim.planar.mechanism import HigherPair, Joint, Mechanism
from mechanism_sim.planar.points import GROUND, Point, Vector2, trace
from mechanism_sim.planar.view import Side, Trajectory


@dataclass(frozen=True)
class JointView:
    """A joint at N instants of an observed machine."""

    mechanism: Mechanism
    joint: Joint
    physics: Physics
    observed: Observation
    #: (m, N) modes of the gaps of the machine, see `mechanism_sim.engine.events.Mode`
    modes: NDArray[np.uint8]

    @property
    def count(self) -> int:
        """Number N of instants."""
        return int(self.observed.position.shape[1])

    def trajectory(self, link: str, at: Vector2 | None = None) -> Trajectory:
        """Trajectory of a link: its displacement if a guide carries it, else its angle."""
        if link in self.mechanism.sliding:
            return self._coordinate(link)
        return self.turning(link, at)

    def turning(self, link: str, at: Vector2 | None = None) -> Trajectory:
        """Angle of a link in the world, with its rates; of an elastic one at a point of it."""
        frame, offset = self.mechanism.frame(link)
        turn = self._coordinate(frame)
        if at and link in self.mechanism.having(Beam):
            turns = self.mechanism.turns(link, at).items()
            turn = Trajectory(
                *np.sum([x * np.array(self._coordinate(c)) for c, x in turns], axis=0)
            )
        return turn._replace(position=turn.position + offset)

    def chord(self, link: str, a: Vector2, b: Vector2) -> Trajectory:
        """Rotation of a link by the line from one point of it to another."""
        turn = self.turning(link)
        if link not in self.mechanism.having(Beam):
            return turn
        z, v, w = self.path(link, b) - self.path(link, a)
        square = (z * z).sum(axis=0)
        rate = (z[0] * v[1] - z[1] * v[0]) / square
        slowed = 2.0 * rate * (z * v).sum(axis=0)
        angle = np.arctan2(z[1], z[0]) - math.atan2(b[1] - a[1], b[0] - a[0])
        off = np.remainder(angle - turn.position + math.pi, 2.0 * math.pi) - math.pi
        second = (z[0] * w[1] - z[1] * w[0] - slowed) / square
        return Trajectory(turn.position + off, rate, second, turn.turned)

    def place(self, link: str, at: Vector2) -> Array:
        """World coordinates (2, N) [m] of a point of a link."""
        place: Array = self.path(link, at)[0]
        return place

    def path(self, link: str, at: Vector2) -> Array:
        """A point of a link in the world with its velocity and acceleration, (3, 2, N) [m, s]."""
        return self.trace(self.mechanism.point(link, at))

    def trace(self, point: Point) -> Array:
        """Motion (3, 2, N) of a sum over arms."""
        return trace(point, self._coordinate, self.count)

    @cached_property
    def _wrench(self) -> Array:
        return known_wrench(self.physics, self.observed, self.joint.name)

    @property
    def force(self) -> Array:
        """Force (2, N) [N] of the first-named on the second-named link; NaN if not known."""
        return self._wrench[:2]

    @property
    def moment(self) -> Array:
        """Moment (N,) [N m] of the first-named link, about the joint's point on the second."""
        return np.asarray(self._wrench[2])

    @property
    def friction_loss(self) -> Array:
        """Power (N,) lost to friction in the ideal joint [W]."""
        friction, o = self.physics.frictions.get(self.joint.name), self.observed
        if friction is None:
            return np.zeros(self.count)
        i = self.physics.joints.index(self.joint.name)
        return friction.loss(o.reaction[i], o.reaction_moment[i], o.local, o.velocity)

    @property
    def foot(self) -> Array:
        """Point of action of the force (2, N) [m]: the joint's point on the second-named link.

        In a higher pair the contact moves: there it is the foot of the joint's point on
        the force's line of action, or the point itself without a force.
        """
        point, force = self.place(self.joint.second, self.joint.on_second), self.force
        if not isinstance(self.joint, HigherPair):
            return point
        square = (force**2).sum(axis=0)
        lever = np.divide(self.moment, square, out=np.zeros_like(square), where=square > 0.0)
        return np.asarray(point + lever * np.array([force[1], -force[0]]))

    def moment_on_first(self, centre: Array) -> Array:
        """Moment (N,) [N m] of the second-named on the first-named link, about points (2, N)."""
        x, y = self.place(self.joint.second, self.joint.on_second) - centre
        fx, fy = self.force
        moment: Array = -(self.moment + x * fy - y * fx)
        return moment

    def gap(self, side: Side | None = None) -> tuple[Array, NDArray[np.bool_]] | None:
        """Distance (N,) [m] and closed mask (N,) of the joint's gap at a side."""
        name = self.joint.name
        if side and isinstance(self.joint, HigherPair):
            name = wall_name(self.mechanism, self.joint, side)
        if name not in self.physics.clearances:
            return None
        k = self.physics.clearances.index(name)
        return self.observed.gap[k], self.modes[k] > Mode.FREE_FLIGHT

    def _coordinate(self, name: str) -> Trajectory:
        o = self.observed
        if name == GROUND:
            return Trajectory(*np.zeros((4, o.position.shape[1])))
        i = self.physics.coordinates.index(name)
        place = o.local[i]
        return Trajectory(place, o.velocity[i], o.acceleration[i], o.position[i] - place)
