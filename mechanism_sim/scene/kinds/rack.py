"""Slotted racks."""

from __future__ import annotations

import math

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.indexing import SlottedRack
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Reference, register
from mechanism_sim.scene.kinds.prismatic import contact_friction
from mechanism_sim.scene.names import Names
from mechanism_sim.scene.quantities import Length


class RackKeys(JointKeys):
    """A slotted rack."""

    rack: Reference | None = None
    """A pin at the first point, and a slotted rack; one slot is at the second."""
    pitch: Length | None = None
    """Of the slots of a rack; required for it."""


def _read(places: Names, name: str, joint: RackKeys) -> SlottedRack:
    pin, rack = places.ends(name)
    where = f'joints.{name}'
    centre, on_crank = places.pivot(where, pin[0])
    guides = [
        j for n, j in places.scene.joints.items()
        if j.prismatic
        and [link for link, _ in places.connected(n)] == [GROUND, rack[0]]
    ]  # fmt: skip
    if not guides:
        raise InputError(
            f'{where}: {rack[0]} must slide on the ground: add a joint '
            f"'prismatic: [ground, {rack[0]}]'"
        )
    pitch = 2.0 * math.dist(pin[1], on_crank)
    if joint.pitch is None or abs(joint.pitch - pitch) > 1e-6 * pitch:
        raise InputError(
            f"'{where}.pitch' must be twice the radius of the pin's circle, "
            f'{pitch:.9g} m: else the pin strikes the slot where it enters'
        )
    return SlottedRack(name, pin[0], rack[0], pin[1], rack[1], pitch, guides[0].axis, centre)


register(JointKind('rack', RackKeys, _read, friction=contact_friction))
