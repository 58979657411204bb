"""Bushings: elastic bearings, between two points that coincide."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import Reference
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import NOT_NEGATIVE, Part, si
from mechanism_sim.linkages.springs import Bushing, SpringLaw, TorsionSpring
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.load_keys import LOADS, ElementKeys, Elements


class BushingStiffness(Part):
    """Stiffness along x and y of the frame of the first link, and about the point."""

    x: Annotated[float, si('N/m'), NOT_NEGATIVE] = 0.0
    """Along x of the first link."""
    y: Annotated[float, si('N/m'), NOT_NEGATIVE] = 0.0
    """Along y of the first link."""
    angle: Annotated[float, si('N m/rad'), NOT_NEGATIVE] = 0.0
    """Against the angle of the second link less that of the first."""


class BushingDamping(Part):
    """Damping along x and y of the frame of the first link, and about the point."""

    x: Annotated[float, si('N s/m'), NOT_NEGATIVE] = 0.0
    """Along x of the first link."""
    y: Annotated[float, si('N s/m'), NOT_NEGATIVE] = 0.0
    """Along y of the first link."""
    angle: Annotated[float, si('N m s/rad'), NOT_NEGATIVE] = 0.0
    """Against the rate of that angle."""


class BushingPart(ElementKeys):
    """An elastic bearing: it holds a point of a link near one of another."""

    between: Reference
    """Two points, LINK.POINT; its axes are those of the first link."""
    stiffness: BushingStiffness
    """Along both axes and about the point."""
    damping: BushingDamping = BushingDamping()
    """Against the rates of all three."""
    free_angle: Annotated[float, si('rad')] = 0.0
    """Angle without torque."""

    def read(self, places: Names, name: str, tree: Mechanism) -> Elements:
        """Read the forces and the moment of the bushing."""
        where = f'bushings.{name}'
        first, second = (places.find(f'{where}.between', p) for p in self.between)
        if first[0] == second[0]:
            raise InputError(f'{where}.between names one link twice')
        k, c = self.stiffness, self.damping
        laws = SpringLaw(k.x, c.x), SpringLaw(k.y, c.y)
        twist, links = SpringLaw(k.angle, c.angle), (first[0], second[0])
        return lambda m: [
            Bushing(where, m, laws, first, second),
            TorsionSpring(f'{where}.angle', m, twist, *links, self.free_angle),
        ]


@LOADS.add('bushings')
class Bushings(Part):
    """The bushings of a scene."""

    bushings: dict[str, BushingPart] = Field({})
    """Elastic bearings between points that coincide, by name."""
