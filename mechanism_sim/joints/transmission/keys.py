"""Two links that keep a ratio of angles or displacements, with play or without."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any

from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import ClearanceSpec, clearance_spec_of
from mechanism_sim.joints.joint_keys import KINDS, Contacts, JointKeys, Reference
from mechanism_sim.joints.mesh.keys import BacklashPart
from mechanism_sim.joints.transmission.constraint import LooseTransmission, Transmission
from mechanism_sim.keys.gear_keys import MOST_TEETH
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Angle, UnitValue
from mechanism_sim.planar.gaps import walls
from mechanism_sim.planar.mechanism import Mechanism, Prismatic
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
    """A ratio of angles, or of displacements."""

    transmission: Reference | None = None
    """Two links that turn, or slide, at a fixed ratio, by whatever means: a box, a taut rope."""
    ratio: Ratio | None = None
    """Of a transmission, required: speed of the second over the first, as -3/7."""
    backlash: BacklashPart | None = None
    """Backlash of teeth, or between the stops of a transmission, as of dogs on coaxial shafts;
    without it they stay in contact."""

    firm = "the clearance of teeth is their 'backlash'"

    def read(self, names: Names, name: str) -> Transmission:
        """Two links with a ratio."""
        where = f'joints.{name}'
        if self.ratio is None:
            raise InputError(f"{where}.ratio is missing: how fast the second turns, such as '1/2'")
        (a, on_a), (b, on_b) = names.ends(name)
        carrier = carrier_of(names, name, self)
        guides = guides_of(names, where, (a, b), carrier)
        if guides and self.phase:
            raise InputError(f'{where}.phase has no meaning between links that slide')
        given = name, a, b, on_a, on_b, Fraction(self.ratio), self.phase, carrier
        if self.backlash is None:
            return Transmission(*given, guides=guides)
        return LooseTransmission(
            *given, guides=guides, play=self._half(where, self.backlash, bool(guides))
        )

    def _half(self, where: str, backlash: BacklashPart, slides: bool) -> float:
        """Play to either side [rad, m]."""
        key, other = ('width', 'angle') if slides else ('angle', 'width')
        what = 'slide' if slides else 'turn'
        if getattr(backlash, other) is not None:
            raise InputError(
                f"{where}.backlash.{other} has no meaning between links that {what}: give '{key}'"
            )
        play = getattr(backlash, key)
        if play is None:
            example = '2 mm' if slides else '3 deg'
            raise InputError(
                f'{where}.backlash.{key} is missing: how far the second link can {what} from stop '
                f"to stop, such as '{example}'"
            )
        most = 2.0 * math.pi / Fraction(str(self.ratio)).denominator
        if not slides and play >= most:
            raise InputError(
                f'{where}.backlash.angle = {math.degrees(play):g} deg must be less than '
                f'{math.degrees(most):g} deg'
            )
        if backlash.restitution is None:
            raise InputError(f'{where}.backlash.restitution is missing: the stops are rigid')
        if backlash.friction:
            raise InputError(f'{where}.backlash.friction has no meaning: the stops do not slide')
        return 0.5 * float(play)

    def clearance_spec(self, joint: Any) -> ClearanceSpec | None:
        """Backlash as a clearance; None without backlash."""
        return clearance_spec_of(self.backlash, joint.play) if self.backlash else None

    def contacts(self, play: ClearanceSpec, joint: Any, mechanism: Mechanism) -> Contacts:
        """The stops."""
        closure = joint.closure(mechanism)
        return walls(closure, closure.lever * play.radial, 0.0, **play.behaviour()), ()


def guides_of(
    names: Names, where: str, links: tuple[str, str], carrier: str
) -> tuple[Prismatic, ...]:
    """The guides of two links on their carrier; none if they turn."""
    found: dict[str, Prismatic] = {}
    for name, joint in names.scene.joints.items():
        if joint.prismatic:
            guide = joint.kind_keys.read(names, name)
            found |= {link: guide for link in links if {carrier, link} == {*guide.links}}
    if len(found) == 1:
        slides = next(iter(found))
        turns = next(link for link in links if link != slides)
        raise InputError(
            f'{where}: {slides} slides on {carrier}, but {turns} does not: two angles or two '
            "displacements can be tied; a gear and a rack are a 'mesh'"
        )
    return tuple(found[link] for link in links) if found else ()


def carrier_of(names: Names, name: str, joint: Any) -> str:
    """The link from which angles count."""
    carrier, _ = names.find(f'joints.{name}.carrier', joint.carrier or GROUND)
    if carrier in [link for link, _ in names.ends(name)]:
        raise InputError(
            f'joints.{name}: {carrier} carries the {joint.kind}: name two other links'
        )
    return carrier
