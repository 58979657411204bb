"""Slotted racks."""

from __future__ import annotations

import math
from typing import Literal

from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.prismatic.keys import PinKeys
from mechanism_sim.joints.rack.constraint import SlottedRack
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Length
from mechanism_sim.planar.points import GROUND, rotate


@KINDS.add('rack')
class RackKeys(PinKeys):
    """A slotted rack."""

    rack: Reference | None = None
    """A pin at the first point, and a slotted rack; one slot is at the second.

    The pin moves the rack while it is on that slot point's side of the centre of its circle.
    """
    pitch: Length | None = None
    """Of the slots of a rack; required for it."""

    def read(self, names: Names, name: str) -> SlottedRack:
        """A pin and a rack whose slots it enters along their lines."""
        pin, rack = names.ends(name)
        where = f'joints.{name}'
        centre, on_crank = names.pivot(where, pin[0])
        guides = [
            (j, *(at for _, at in names.connected(n)))
            for n, j in names.scene.joints.items()
            if j.prismatic and [link for link, _ in names.connected(n)] == [GROUND, rack[0]]
        ]
        if not guides:
            raise InputError(
                f"{where}: {rack[0]} must slide on the ground: add a joint 'prismatic: [ground, "
                f"{rack[0]}]'"
            )
        pitch = 2.0 * math.dist(pin[1], on_crank)
        if self.pitch is None or abs(self.pitch - pitch) > 1e-6 * pitch:
            raise InputError(
                f"'{where}.pitch' must be twice the radius of the pin's circle, {pitch:.9g} m: "
                'else the pin strikes the slot where it enters'
            )
        guide, seat, own = guides[0]
        turned = rotate((rack[1][0] - own[0], rack[1][1] - own[1]), guide.angle)
        from_centre = [a + b - c for a, b, c in zip(seat, turned, centre, strict=True)]
        across = rotate((from_centre[0], from_centre[1]), -guide.axis)[1]
        if abs(across) <= 1e-9 * pitch:
            raise InputError(
                f'{where}.rack: the point of {rack[0]} slides through the centre of {pin[0]}, so '
                'that neither half of a turn is on its side: give a point nearer to the guide'
            )
        side: Literal[1, -1] = 1 if across < 0.0 else -1
        return SlottedRack(name, pin[0], rack[0], pin[1], rack[1], pitch, guide.axis, centre, side)
