"""Slotted racks."""

from __future__ import annotations

import math

from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.prismatic.keys import PinKeys
from mechanism_sim.joints.rack.constraint import SlottedRack
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Length
from mechanism_sim.planar.points import GROUND


@KINDS.add('rack')
class RackKeys(PinKeys):
    """A slotted rack."""

    rack: Reference | None = None
    """A pin at the first point, and a slotted rack; one slot is at the second."""
    pitch: Length | None = None
    """Of the slots of a rack; required for it."""

    def read(self, names: Names, name: str) -> SlottedRack:
        """A pin and a rack whose slots it enters along their lines."""
        pin, rack = names.ends(name)
        where = f'joints.{name}'
        centre, on_crank = names.pivot(where, pin[0])
        guides = [
            j
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
        return SlottedRack(name, pin[0], rack[0], pin[1], rack[1], pitch, guides[0].axis, centre)
