"""Placement of gears in mesh in a mechanism, for closures, readings and drawings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.joints.mesh.compliance import Elasticity
from mechanism_sim.joints.mesh.involute import Gear
from mechanism_sim.planar.mechanism import HigherPair, Prismatic

_WHOLE = 1e-9  # of a wave of an error: what rounding leaves of a whole number in a tooth


class Teeth(NamedTuple):
    """A gear as it stands on its link, or a rack that it could mesh with."""

    name: str
    gear: Gear
    rack: bool = False
    tooth: float = 0.0  #: position of a tooth in its link's frame [rad]; of a rack [m]


@dataclass(frozen=True)
class Harmonic:
    """A part of the transmission error: ``amplitude sin(order (a - start))``.

    `member` says whose angle (or, of a rack, displacement) a against the carrier counts: 0 of
    the first, 1 of the second.
    """

    member: int
    order: float  #: wave number [1/rad], or [1/m] for a rack
    amplitude: float  #: [m] along the line of action
    start: float = 0.0  #: position of zero [rad, m]

    def at(self, places: Sequence[Array]) -> tuple[Array, Array]:
        """Error [m] and its derivative by the position of its member, where both are (N,)."""
        turn = self.order * (places[self.member] - self.start)
        return self.amplitude * np.sin(turn), self.amplitude * self.order * np.cos(turn)


@dataclass(frozen=True)
class PlacedMesh(HigherPair):
    """Teeth of `first` and `second` in mesh, `on_first` and `on_second` their centres.

    For a rack, which is the second, `on_second` is a point of its pitch line. On the left side
    the first gear, turning counterclockwise, drives.
    """

    carrier: str
    waves: tuple[float, float]  #: N of each, negative for internal teeth; of a rack [1/m]
    base_pitch: float  #: [m]
    pressure_angle: float  #: working pressure angle [rad]
    towards: float  #: [rad] from the first centre to the second, in the carrier's frame
    reach: float  #: [m] from the first centre to the pitch point in that direction
    facing: tuple[float, float] = (0.0, 0.0)
    """Where each has its angle zero on the line of centres: angle against the carrier [rad]; of a
    rack the displacement [m] with `on_second` there."""
    guide: Prismatic | None = None  #: guide of a rack on the carrier
    bearings: tuple[str, ...] = ()  #: shafts between gears and carrier, and the guide
    wheels: tuple[Teeth, ...] = ()
    contact_ratio: float = math.nan
    sliding_arm: float = 0.0  #: [m] mean distance of contact from the pitch point
    helix_angle: float = 0.0  #: [rad] on the working pitch circles
    hand: int = 1  #: hand of the first: 1 right, -1 left
    along: tuple[float, float] = (0.0, 0.0)  #: positions of both along their shafts [m]
    phase: float = 0.0  #: u0 [rad]
    errors: tuple[Harmonic, ...] = ()
    play: float = 0.0  #: backlash to either side along the line of action [m]
    elasticity: Elasticity | None = None

    @property
    def per_phase(self) -> float:
        """Displacement along the line of action by phase of the teeth [m/rad]."""
        return self.base_pitch / (2.0 * math.pi)

    @property
    def alike(self) -> tuple[str, ...]:
        """Gears without errors of single teeth: their constraint repeats with every tooth."""
        own = {
            x.member
            for x in self.errors
            for whole in [x.order / self.waves[x.member]]
            if abs(whole - round(whole)) > _WHOLE
        }
        pair = self.first, self.second
        return tuple(link for k, link in enumerate(pair) if k not in own)

    @property
    def sign(self) -> float:
        """-1 if one of the two has internal teeth, else 1."""
        teeth = [
            w for w, link in zip(self.waves, self.links, strict=True) if not self.is_rack(link)
        ]
        return -1.0 if min(teeth) < 0.0 else 1.0

    @property
    def friction_share(self) -> float:
        """Factor on the coefficient of friction in the plane of rotation: 1/cos(beta_b).

        Helical teeth press each other by as much more, normal to their flanks, and slide in that
        plane. With the helix angle psi and the pressure angle phi on the working pitch circles
        the angle on the base circles has ``tan(beta_b) = tan(psi) cos(phi)``.
        """
        return math.hypot(1.0, math.tan(self.helix_angle) * math.cos(self.pressure_angle))

    def is_rack(self, link: str) -> bool:
        """True if one of its links is a rack."""
        return self.guide is not None and self.guide.second == link
