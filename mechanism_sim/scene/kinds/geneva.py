"""Geneva wheels."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.linkages.indexing import Geneva
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Reference, register
from mechanism_sim.scene.kinds.prismatic import contact_friction
from mechanism_sim.scene.names import Names


class GenevaKeys(JointKeys):
    """A Geneva wheel."""

    geneva: Reference | None = None
    """A pin at the first point, and a Geneva wheel pivoted at the second."""
    slots: Annotated[int, Field(ge=3, le=24)] | None = None
    """Of a Geneva wheel; required for it."""


def _read(places: Names, name: str, joint: GenevaKeys) -> Geneva:
    pin, wheel = places.ends(name)
    where = f'joints.{name}'
    if joint.slots is None:
        raise InputError(f"'{where}.slots' is missing: how many the wheel has")
    (ox, oy), on_crank = places.pivot(where, pin[0])
    (wx, wy), on_wheel = places.pivot(where, wheel[0])
    if wheel[1] != on_wheel:
        raise InputError(f'{where}: name the point where the wheel is pivoted')
    radius, b = math.dist(pin[1], on_crank), math.hypot(ox - wx, oy - wy)
    right = radius / math.sin(math.pi / joint.slots)
    if abs(b - right) > 1e-6 * right:
        raise InputError(
            f'{where}: with {joint.slots} slots and the pin {radius:.9g} m from '
            f'its centre, the centres must be {right:.9g} m apart, not {b:.9g} m: else the '
            'pin strikes the slot where it enters'
        )
    entry = right * math.cos(math.pi / joint.slots)
    towards = math.atan2(oy - wy, ox - wx)
    return Geneva(name, pin[0], wheel[0], pin[1], wheel[1], joint.slots, towards, right, entry)


register(JointKind('geneva', GenevaKeys, _read, friction=contact_friction))
