"""Two links whose angles keep a ratio."""

from __future__ import annotations

from fractions import Fraction
from typing import Annotated, Any

from mechanism_sim.errors import InputError
from mechanism_sim.joints.joint_keys import KINDS, JointKeys, Reference
from mechanism_sim.joints.mesh.gear_keys import MOST_TEETH
from mechanism_sim.joints.transmission.constraint import Transmission
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Angle, UnitValue
from mechanism_sim.planar.points import GROUND


def _fraction(value: Any) -> str:
    """A ratio of whole numbers, such as ``1/2``."""
    try:
        ratio = Fraction(str(value).replace(' ', ''))
    except (ValueError, ZeroDivisionError) as error:
        raise ValueError("is not a ratio of whole numbers: write for example '1/2'") from error
    if not ratio or ratio.denominator > MOST_TEETH or abs(ratio.numerator) > MOST_TEETH:
        raise ValueError(
            f"is not a ratio of whole numbers from 1 to {MOST_TEETH}: write for example '1/2'"
        )
    return str(ratio)


Ratio = Annotated[str, UnitValue(_fraction, ('',))]


class PhaseKeys(JointKeys):
    """Joints whose angle counts from a phase."""

    phase: Angle = 0.0
    """Angle of the cam, or of the second link of a transmission, when the first is at 0."""


class CarrierKeys(PhaseKeys):
    """Joints of two links that turn on a third."""

    carrier: str | None = None
    """Of a transmission, bevel or worm pair: the link from which angles count; else the ground."""


@KINDS.add('transmission')
class TransmissionKeys(CarrierKeys):
    """A ratio of angles."""

    transmission: Reference | None = None
    """Two links whose angles keep a ratio, by whatever means: a box."""
    ratio: Ratio | None = None
    """Of a transmission, required: speed of the second over the first, as -3/7."""

    firm = "the play of teeth is their 'backlash'"

    def read(self, names: Names, name: str) -> Transmission:
        """Two links with a ratio."""
        where = f'joints.{name}'
        if self.ratio is None:
            raise InputError(f"{where}.ratio is missing: how fast the second turns, such as '1/2'")
        (a, on_a), (b, on_b) = names.ends(name)
        carrier = carrier_of(names, name, self)
        return Transmission(
            name, a, b, on_a, on_b, Fraction(self.ratio), self.phase, carrier
        )  # fmt: skip


def carrier_of(names: Names, name: str, joint: Any) -> str:
    """The link from which angles count."""
    carrier, _ = names.find(f'joints.{name}.carrier', joint.carrier or GROUND)
    if carrier in [link for link, _ in names.ends(name)]:
        raise InputError(
            f'joints.{name}: {carrier} carries the {joint.kind}: name two other links'
        )
    return carrier
