"""Geneva wheels."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.geneva.constraint import Geneva
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.prismatic.keys import PinKeys
from mechanism_sim.keys.names import Names


@KINDS.add('geneva')
class GenevaKeys(PinKeys):
    """A Geneva wheel."""

    geneva: Reference | None = None
    """A pin at the first point, and a Geneva wheel pivoted at the second."""
    slots: Annotated[int, Field(ge=3, le=24)] | None = None
    """Of a Geneva wheel; required for it."""

    def read(self, names: Names, name: str) -> Geneva:
        """A pin and a wheel whose slots it enters along their lines."""
        pin, wheel = names.ends(name)
        where = f'joints.{name}'
        if self.slots is None:
            raise InputError(f"'{where}.slots' is missing: how many the wheel has")
        (ox, oy), on_crank = names.pivot(where, pin[0])
        (wx, wy), on_wheel = names.pivot(where, wheel[0])
        if wheel[1] != on_wheel:
            raise InputError(f'{where}: name the point where the wheel is pivoted')
        radius, b = math.dist(pin[1], on_crank), math.hypot(ox - wx, oy - wy)
        right = radius / math.sin(math.pi / self.slots)
        if abs(b - right) > 1e-6 * right:
            raise InputError(
                f'{where}: with {self.slots} slots and the pin {radius:.9g} m from its centre, '
                f'the centres must be {right:.9g} m apart, not {b:.9g} m: else the pin strikes '
                'the slot where it enters'
            )
        # a millionth is let pass, but dwell and stroke must meet to rounding: the distance of the
        # centres is taken as it is, and the pin is moved along its crank
        (px, py), (cx, cy) = pin[1], on_crank
        share = b * math.sin(math.pi / self.slots) / radius
        at = cx + share * (px - cx), cy + share * (py - cy)
        entry, towards = b * math.cos(math.pi / self.slots), math.atan2(oy - wy, ox - wx)
        return Geneva(name, pin[0], wheel[0], at, wheel[1], self.slots, towards, b, entry)
