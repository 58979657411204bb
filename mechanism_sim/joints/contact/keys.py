"""Links that touch: round ends, and bars with round ends."""

from __future__ import annotations

from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact.constraint import DiscGap, DiscPair
from mechanism_sim.joints.contact_keys import ClearanceSpec
from mechanism_sim.joints.joint_keys import KINDS, Reference, TouchingKeys
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Length
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.protocols import MotionBound


@KINDS.add('contact')
class ContactKeys(TouchingKeys):
    """Two links in intermittent contact: detents, latches, bumpers."""

    contact: Reference | None = None
    """Centres of two discs, each a point of a link, in unilateral contact."""
    radii: tuple[Length, Length] | None = None
    """Of both pulleys, or of both discs, as [40 mm, 60 mm]; required."""
    to: str | None = None
    """Of a contact, another point LINK.POINT of its second link; from disc to disc between both
    points there is a bar, with the second radius as half of its thickness."""
    firm = 'links in contact separate by themselves'
    friction_keys = (), False

    def read(self, names: Names, name: str) -> DiscPair:
        """Two discs, or a disc and a bar."""
        where = f'joints.{name}'
        if self.radii is None:
            raise InputError(f"{where}.radii is missing: of both discs, such as '[10 mm, 20 mm]'")
        (a, on_a), (b, on_b) = names.ends(name)
        if self.to is None:
            return DiscPair(name, a, b, on_a, on_b, self.radii)
        link, end = names.find(f'{where}.to', self.to)
        if link != b or end == on_b:
            raise InputError(
                f'{where}.to = {self.to} must be another point of {b}, from whose point '
                f'{self.contact[1] if self.contact else b} the bar goes'
            )
        return DiscPair(name, a, b, on_a, on_b, self.radii, end)

    def describe(self, joint: Any) -> str:
        """The surfaces that touch, in words."""
        one, two = joint.radii
        what = 'disc' if joint.end is None else 'bar'
        return (
            f'disc of {joint.first}, radius {one:g} m, against {what} of {joint.second}, radius '
            f'{two:g} m'
        )

    def bounds(self, spec: ClearanceSpec, joint: Any, mechanism: Mechanism) -> list[MotionBound]:
        """Their distance."""
        return [DiscGap(joint, mechanism, **spec.behaviour())]
