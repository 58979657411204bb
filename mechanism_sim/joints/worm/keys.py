"""Worms and their wheels."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, Literal

from mechanism_sim.errors import InputError
from mechanism_sim.joints.bevel.keys import SpatialKeys, needed, placed, pressure_angle_of
from mechanism_sim.joints.contact_keys import Friction
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.transmission.keys import carrier_of
from mechanism_sim.joints.worm.constraint import WormDrive, WormPair
from mechanism_sim.joints.worm.sheet import WormParts
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Angle, Length
from mechanism_sim.planar.joint_friction import FlankFriction
from mechanism_sim.planar.mechanism import Mechanism


@KINDS.add('worm')
class WormKeys(SpatialKeys):
    """A worm and its wheel on shafts at 90 degrees."""

    worm: Reference | None = None
    """Links of a worm and of its wheel."""
    diameter: Length | None = None
    """Pitch diameter of a worm; required."""
    lead_angle: Angle | None = None
    """Of a worm's thread, which is the helix angle of its wheel; required."""
    hand: Literal['right', 'left'] | None = None
    """Of a worm, right without it: then its wheel turns the same way, each seen on its axis."""

    firm = 'the backlash of a worm is not modelled'
    parts = WormParts
    friction_keys = (), False

    def read(self, names: Names, name: str) -> WormDrive:
        """A worm and its wheel."""
        needed(name, self, 'teeth', 'diameter', 'lead_angle')
        (a, on_a), (b, on_b) = names.ends(name)
        threads, teeth = self.both_teeth(name)
        lead = self.lead_angle or 0.0
        if not 0.0 < lead < 0.5 * math.pi:
            raise InputError(f'joints.{name}.lead_angle must lie between 0 and 90 deg')
        sizes = WormPair(threads, teeth, self.diameter or 0.0, lead, pressure_angle_of(self))
        hand = -1 if self.hand == 'left' else 1
        return WormDrive(
            name, a, b, on_a, on_b, Fraction(hand * threads, teeth), self.phase,
            carrier_of(names, name, self), *placed(self), sizes, hand,
        )  # fmt: skip

    def frictions(self, given: Friction, joint: Any, mechanism: Mechanism) -> list[FlankFriction]:
        """Friction along the thread, [V] eqs. 5.52 to 5.59."""
        lead, press, (r2, r3) = joint.worm.lead_angle, joint.worm.pressure_angle, joint.radii
        return [FlankFriction(
            joint.name, mechanism, given.coefficient,
            (r2 * math.cos(lead), joint.hand * r3 * math.sin(lead)),
            r3 * math.cos(press) * math.cos(lead), joint.carrier,
        )]  # fmt: skip

    def notes(self, machine: Any, joint: WormDrive) -> list[str]:
        """The friction that it could bear."""
        given = machine.scene.joints[joint.name].friction
        return [
            f'{joint.name}: {"its" if given else "without friction; a"} coefficient of friction '
            f'{f"is {given.coefficient:g}; " if given else ""}'
            f'from {joint.worm.locking_friction:.4g} on the wheel cannot drive the worm'
        ]
