"""Bevel gears."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.bevel.constraint import BevelPair, pitch_angles
from mechanism_sim.joints.bevel.sheet import BevelParts
from mechanism_sim.joints.contact_keys import Friction
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.mesh.pair import Path, sliding_arm
from mechanism_sim.joints.transmission.keys import CarrierKeys, carrier_of
from mechanism_sim.keys.gear_keys import MOST_TEETH
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Angle, Displacement, Length, Position
from mechanism_sim.planar.joint_friction import FlankFriction
from mechanism_sim.planar.mechanism import Mechanism

_Count = Annotated[int, Field(ge=1, le=MOST_TEETH)]
Teeth = tuple[_Count, _Count] | _Count


class SpatialKeys(CarrierKeys):
    """Gears on shafts at an angle."""

    teeth: Teeth | None = None
    """Of a bevel pair; of a worm pair threads of the worm and teeth of the wheel; of a ratchet one
    number, those on a turn. Required."""
    pressure_angle: Angle | None = None
    """Of a bevel pair; of a worm pair in the plane normal to the thread; 20 deg without it."""
    facing: tuple[Angle, Angle] | None = None
    """Direction from the shaft of each of such a pair to its mate; 0 and 180 deg if not given."""
    along: tuple[Position, Position] | None = None
    """Where both of such a pair lie along their shafts; in the plane of the machine without it."""

    def both_teeth(self, name: str) -> tuple[int, int]:
        """Numbers of teeth of both links."""
        if isinstance(self.teeth, tuple):
            return self.teeth
        raise InputError(
            f'joints.{name}.teeth = {self.teeth}: it must be a list of two, such as [20, 40]'
        )


@KINDS.add('bevel')
class BevelKeys(SpatialKeys):
    """Straight bevel gears."""

    bevel: Reference | None = None
    """Two links with bevel gears, which turn in opposite senses; axes point away from the apex."""
    module: Length | None = None
    """Module of a bevel pair, at the back cone; required."""
    face_width: Displacement | None = None
    """Length of the teeth of a bevel pair; the force acts in their middle; required."""
    shaft_angle: Angle | None = None
    """Angle between the axes of a bevel pair; 90 deg if not given."""

    firm = 'the backlash of bevel gears is not modelled'
    parts = BevelParts
    friction_keys = (), False

    def read(self, names: Names, name: str) -> BevelPair:
        """A bevel pair."""
        needed(name, self, 'teeth', 'module', 'face_width')
        where = f'joints.{name}'
        (a, on_a), (b, on_b) = names.ends(name)
        module, width = self.module or 0.0, self.face_width or 0.0
        one, two = self.both_teeth(name)
        angle = 0.5 * math.pi if self.shaft_angle is None else self.shaft_angle
        if not 0.0 < angle < math.pi:
            raise InputError(f'{where}.shaft_angle must lie between 0 and 180 deg')
        cones = pitch_angles(two / one, angle)
        if max(cones) >= 0.5 * math.pi:
            raise InputError(
                f'{where}: at a shaft angle of {math.degrees(angle):g} deg one of the gears has '
                'no cone, but an opening of 180 deg or more: take a smaller shaft_angle'
            )
        length = 0.5 * module * one / math.sin(cones[0])
        if width >= length:
            raise InputError(
                f'{where}.face_width = {width:g} m must be less than {length:.6g} m, from back to '
                'apex'
            )
        first, second = (
            0.5 * module * n - 0.5 * width * math.sin(cone)
            for n, cone in zip((one, two), cones, strict=True)
        )
        return BevelPair(
            name, a, b, on_a, on_b, Fraction(-one, two), self.phase,
            carrier_of(names, name, self), *placed(self), (first, second), cones,
            pressure_angle_of(self), one,
        )  # fmt: skip

    def frictions(self, given: Friction, joint: Any, mechanism: Mechanism) -> list[FlankFriction]:
        """Friction of teeth one module high, on spur gears that roll as the cones at mid-face.

        These have the cones' back radii and roll at the shafts' rates times the cosines of the
        cones (T. Tredgold).
        """
        press = joint.pressure_angle
        turns = [math.cos(cone) for cone in joint.cones]
        radii = [r / c for r, c in zip(joint.radii, turns, strict=True)]
        module = 2.0 * joint.radii[0] / joint.teeth
        ends = [
            min(math.sqrt((r + module) ** 2 - (r * math.cos(press)) ** 2) - r * math.sin(press),
                other * math.sin(press))
            for r, other in zip(radii, radii[::-1], strict=True)
        ]  # fmt: skip
        arm = sliding_arm(Path(-ends[1], ends[0]), math.pi * module * math.cos(press))
        return [FlankFriction(
            joint.name, mechanism, given.coefficient, (arm * turns[0], -arm * turns[1]),
            joint.radii[1] * math.cos(press), joint.carrier,
        )]  # fmt: skip


def needed(name: str, joint: SpatialKeys, *keys: str) -> None:
    """Refuse a pair without one of these keys, or with a wrong pressure angle."""
    where = f'joints.{name}'
    for key in keys:
        if getattr(joint, key) is None:
            raise InputError(f'{where}.{key} is missing: a {joint.kind} pair needs it')
    if joint.pressure_angle is not None and not 0.0 < joint.pressure_angle < math.pi / 4:
        raise InputError(f'{where}.pressure_angle must lie between 0 and 45 deg')


def pressure_angle_of(joint: SpatialKeys) -> float:
    """Pressure angle of the pair [rad], 20 degrees unless given."""
    return math.radians(20.0) if joint.pressure_angle is None else joint.pressure_angle


def placed(joint: SpatialKeys) -> tuple[tuple[float, float], tuple[float, float]]:
    """Directions of both gears to their mates [rad], and positions along their shafts [m]."""
    return joint.facing or (0.0, math.pi), joint.along or (0.0, 0.0)
