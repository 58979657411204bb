"""Prismatic joints: a guide along which a point slides."""

from __future__ import annotations

from mechanism_sim.planar.joint_friction import ContactFriction, JointFriction, LineFriction
from mechanism_sim.planar.mechanism import HigherPair, Mechanism, Prismatic
from mechanism_sim.planar.touch import Touch
from mechanism_sim.scene.contact_keys import Clearance, Friction
from mechanism_sim.scene.joint_keys import JointKeys, JointKind, Reference, register
from mechanism_sim.scene.names import Names
from mechanism_sim.scene.quantities import Angle


class AxisKeys(JointKeys):
    """What slides."""

    axis: Angle = 0.0
    """Direction of sliding: in the first link of a prismatic joint, in the second's slot."""


class PrismaticKeys(AxisKeys):
    """A guide."""

    prismatic: Reference | None = None
    """A guide: the second point slides along `axis` through the first."""
    angle: Angle = 0.0
    """Of the second link in the first."""


def _read(places: Names, name: str, joint: PrismaticKeys) -> Prismatic:
    (a, on_a), (b, on_b) = places.ends(name)
    return Prismatic(name, a, b, on_a, on_b, joint.axis, joint.angle)


def line_friction(name: str, given: Friction, mechanism: Mechanism) -> list[JointFriction]:
    """Friction along a guide or a slot."""
    return [LineFriction(name, mechanism, given.coefficient, given.length or 0.0)]


def contact_friction(name: str, given: Friction, mechanism: Mechanism) -> list[JointFriction]:
    """Friction of a pin in a slot that it leaves."""
    joint = mechanism.joint(name)
    assert isinstance(joint, HigherPair)  # noqa: S101 - of such kinds
    touch = joint.touch(mechanism)
    assert isinstance(touch, Touch)  # noqa: S101 - and of no teeth
    return [ContactFriction(name, mechanism, given.coefficient, touch)]


def _wrong_play(given: Clearance) -> str:
    if not (given.length and given.height):
        return "has a clearance that needs 'length' and 'height', those of the block in its guide"
    if wrong := [key for key in ('misalignment', 'along', 'axial') if getattr(given, key)]:
        return f'has a clearance with {wrong[0]}, which is of pins in bushings'
    if given.pin_radius:
        return 'has a clearance with pin_radius: a block has none'
    if given.contact and given.contact.law == 'film':
        return 'has a clearance with a film, which is for pins'
    return ''


register(
    JointKind(
        'prismatic',
        PrismaticKeys,
        _read,
        wrong_play=_wrong_play,
        friction=line_friction,
        rubs_by=(('length',), False),
    )
)
