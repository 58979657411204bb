"""Links that lean out of their plane: small rotations about two axes fixed in the link.

A link leans by s = (s_x, s_y), the inclinations of its normal along the axes of its frame. Its
point at r in its plane, from the centre of gravity, and z above, is then in the link's frame at

    r + z s - s (s.r)/2    and    z - s.r    above.

Rotations are taken to the second order, and kinetic and potential energy with them, so that the
equations are exact to the first order in s: with gyroscopic and centrifugal terms, and with what
forces in the plane do to a link that leans. Moments in the plane are taken as semitangential
(H. Ziegler, Principles of Structural Stability, 1968): they do no work on s. The centre of gravity
stays in its plane, or moves along the axes by a: all heights are then more by a, and to the same
order a and s have no inertia in common.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from mechanism_sim.planar.bodies import Arms, Body, LinkExtension
from mechanism_sim.planar.points import Point, Vector2


@dataclass(frozen=True)
class Tilt(LinkExtension):
    """Stiffness that holds a rigid link in its plane, and inertia of its motion out of it."""

    mass: float  #: [kg]
    cog: Vector2  #: [m] in the link's frame
    inertia: tuple[float, float, float]  #: [kg m^2] about x, y and normal of the link, at the cog
    rigidity: Vector2  #: [N m/rad] against rotation about the link's x and y axes
    damping: float = 0.0  #: ratio of critical damping of each rotation by itself
    spin: float = 0.0  #: [kg m^2] that turns with the link in the plane, but does not lean
    axial: float | None = None  #: [N/m] stiffness along the axes; None if it does not move there

    scattered: ClassVar[bool] = False
    angles = 'tilt_x', 'tilt_y'

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates: the inclinations, and the displacement along the axes."""
        return self.angles if self.axial is None else (*self.angles, 'axial')

    def rise(self, at: Vector2) -> dict[str, float]:
        """Displacement towards the reader of a point of the link's plane, per coordinate.

        Parameters
        ----------
        at : [m] in the link's frame
        """
        x, y = self.cog[0] - at[0], self.cog[1] - at[1]
        return dict(zip(self.names, (x, y, 1.0), strict=False))

    @cached_property
    def _moments(self) -> tuple[float, float, float]:
        """Second moments of the mass along x, y, z [kg m^2], none of them less than nothing."""
        total = 0.5 * sum(self.inertia)
        x, y, z = (max(0.0, total - own) for own in self.inertia)
        return x, y, z

    def masses(self, body: Body, place: Callable[..., Point]) -> list[tuple[float, Point]]:
        """Six that stand for the link, at its principal axes, two above and below its plane."""
        share, (x, y) = self.mass / 6.0, self.cog
        a, b, c = (math.sqrt(3.0 * moment / self.mass) for moment in self._moments)
        off = (a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c)
        return [
            (share, place((x + sign * u, y + sign * v), sign * w))
            for u, v, w in off
            for sign in (1.0, -1.0)
        ]

    def spin_of(self, body: Body) -> float:
        """Inertia that does not tilt [kg m^2]."""
        return self.spin

    def lean(self, height: float) -> Arms:
        """Displacement of a point above the link's plane by the tilt, to first order."""
        along, across = self.angles
        return {(along,): (height, 0.0), (across,): (0.0, height)}

    def arms(self, at: Vector2) -> Arms:
        """Displacement of a point of the link's plane in its frame, by products of coordinates.

        Parameters
        ----------
        at : [m] in the link's frame
        """
        x, y = at[0] - self.cog[0], at[1] - self.cog[1]
        p, q = self.angles
        found = {(p, p): (-0.5 * x, 0.0), (p, q): (-0.5 * y, -0.5 * x), (q, q): (0.0, -0.5 * y)}
        return {names: d for names, d in found.items() if d != (0.0, 0.0)}

    @property
    def rising(self) -> dict[str, float]:
        """Inertia of the motion out of the plane, by coordinate [kg m^2, kg]."""
        return dict(zip(self.names, (*self._moments[:2], self.mass), strict=False))

    @property
    def _stiffness(self) -> dict[str, float]:
        """Stiffness of each coordinate [N m/rad, N/m]: tilt along x is a rotation about y."""
        return dict(zip(self.names, (*self.rigidity[::-1], self.axial or 0.0), strict=False))

    @property
    def frequencies(self) -> dict[str, float]:
        """Natural angular frequency [rad/s] of each coordinate while the link rests."""
        about_x, about_y, _ = self.inertia
        pairs = zip(self._stiffness.items(), (about_y, about_x, self.mass), strict=False)
        return {name: math.sqrt(k / own) for (name, k), own in pairs}

    @property
    def springs(self) -> dict[str, tuple[float, float]]:
        """Stiffness [N m/rad, N/m] and damping [N m s/rad, N s/m] of each coordinate."""
        rates = self.frequencies
        return {
            name: (k, 2.0 * self.damping * k / rates[name] if k else 0.0)
            for name, k in self._stiffness.items()
        }
