"""Revolute joints: a pin in a bushing, or a shaft in its bearings."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import Clearance, Friction, Misalignment
from mechanism_sim.joints.joint_keys import KINDS, JointKeys, Reference
from mechanism_sim.joints.revolute.clearances import leaning
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Position
from mechanism_sim.planar.joint_friction import JournalFriction
from mechanism_sim.planar.mechanism import Mechanism, Revolute


@KINDS.add('revolute')
class RevoluteKeys(JointKeys):
    """A pin, or a shaft."""

    revolute: Reference | None = None
    """A pin: two points that coincide."""
    bearings: dict[str, Position] = Field({})
    """The two bearings of a shaft, by name: where they lie along it, as `along` of its gears."""
    locating: str | None = None
    """The bearing that takes forces along the shaft; required with bearings."""

    rubs_by = ('radius',), True

    def read(self, names: Names, name: str) -> Revolute:
        """A pin or a shaft."""
        where, given = f'joints.{name}', self.bearings
        if given and len({*given.values()}) != 2:
            raise InputError(
                f'{where}.bearings: a shaft has two bearings, at different places: write for '
                "example '{left: -30 mm, right: 40 mm}'"
            )
        if bool(given) != bool(self.locating) or (self.locating and self.locating not in given):
            raise InputError(
                f"{where}: 'bearings' and 'locating' belong together; locating names one of them: "
                f'{", ".join(given) or "none"}'
            )
        if given and self.clearance:
            raise InputError(f'{where}: bearings of a shaft are ideal: leave out its clearance')
        (a, on_a), (b, on_b) = names.ends(name)
        return Revolute(name, a, b, on_a, on_b)

    def frictions(
        self, given: Friction, joint: Any, mechanism: Mechanism
    ) -> list[JournalFriction]:
        """Of the pin in its bearing."""
        return [JournalFriction(joint.name, mechanism, given.coefficient, given.radius or 0.0)]

    def wrong_play(self, given: Clearance) -> str:
        """An objection to a clearance of it; empty if there is none."""
        if given.height:
            return 'has a clearance with height, which is of blocks in guides'
        if (given.misalignment or given.along) and not given.length:
            what = 'misalignment' if given.misalignment else 'along'
            return f"has a clearance with {what}: it needs 'length', that of the bearing"
        if given.length and given.film:
            return (
                "has a film with length, which is for solid contacts: leave it out, or 'contact'"
            )
        if given.axial and given.film:
            return "has a film with axial, which is for solid contacts: leave it out, or 'contact'"
        if not given.misalignment or not given.length:
            return ''
        most = 2.0 * given.radial / given.length
        both = given.misalignment.pin, given.misalignment.bushing
        angle = sum(x.angle for x in both if x)
        if angle >= most:
            return (
                f'has axes inclined by {angle:.4g} rad, but in a bearing {given.length:g} m long '
                f'with a radial clearance of {given.radial:g} m a pin has room up to {most:.4g} '
                'rad: give less misalignment, a shorter bearing or more clearance'
            )
        return ''

    def notes(self, machine: Any, joint: Revolute) -> list[str]:
        """Room of the ends of a bearing, and stops along its axis."""
        play = machine.clearances.get(joint.name)
        if not isinstance(play, Clearance):
            return []
        found = []
        if play.axial:
            faces = play.axial.face_radius
            found = [
                f'{joint.name}: stops along the axis, play {play.axial.play:g} m to either, '
                f'{f"faces of radius {faces:g} m" if faces else "without moments"}'
            ]
        if not play.length:
            return found
        if leaning(machine.mechanism, joint.name, play) is None:
            return [
                *found,
                f'{joint.name}: pin and bushing stay in line: its length changes nothing',
            ]
        given = play.misalignment or Misalignment()
        said = [
            f'{name} inclined by {axis.angle:g} rad'
            for name, axis in (('pin', given.pin), ('bushing', given.bushing))
            if axis
        ]
        most = 2.0 * play.radial / play.length
        return [
            *found,
            f'{joint.name}: contacts at both ends of {play.length:g} m, '
            f'{"".join(f"{x}, " for x in said)}room for {most:.4g} rad',
        ]
