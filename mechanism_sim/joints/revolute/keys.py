"""Revolute joints: a pin in a bushing, or a shaft in its bearings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.film import ShortBearing
from mechanism_sim.errors import InputError
from mechanism_sim.joints.contact_keys import (
    AxialPlay,
    Clearance,
    ClearanceSpec,
    Friction,
    Misalignment,
)
from mechanism_sim.joints.joint_keys import KINDS, Contacts, Place, Reference
from mechanism_sim.joints.revolute.bearing import BearingClearance, FilmBearing
from mechanism_sim.joints.revolute.bearing_ends import AxialStop, bearing_ends, seat
from mechanism_sim.joints.revolute.worn import LOOKS, FilmProfile, WornShape, worn_shape
from mechanism_sim.joints.revolute.worn_bearing import WornBearing, WornFilm
from mechanism_sim.joints.stops import StopKeys
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import Position
from mechanism_sim.planar.gaps import STOPS, gap_name
from mechanism_sim.planar.joint_friction import JournalFriction
from mechanism_sim.planar.mechanism import Mechanism, Revolute
from mechanism_sim.planar.points import Vector2, rotate
from mechanism_sim.planar.protocols import ForceElement, Gap

_IN_LINE = 1e-5


@KINDS.add('revolute')
class RevoluteKeys(StopKeys):
    """A pin, or a shaft."""

    revolute: Reference | None = None
    """A pin: two points that coincide."""
    bearings: dict[str, Position] = Field({})
    """The two bearings of a shaft, by name: where they lie along it, as `along` of its gears."""
    locating: str | None = None
    """The bearing that takes forces along the shaft; required with bearings."""

    friction_keys = ('radius',), True

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
        """Friction of the pin in its bearing."""
        return [JournalFriction(joint.name, mechanism, given.coefficient, given.radius or 0.0)]

    def clearance_objection(self, given: Clearance) -> str:
        """An objection to a clearance of it; empty if there is none."""
        if given.height:
            return 'has a clearance with height, which applies to blocks in guides'
        if (given.misalignment or given.along) and not given.length:
            what = 'misalignment' if given.misalignment else 'along'
            return f"has a clearance with {what}: it needs 'length', that of the bearing"
        if given.length and given.film:
            return (
                "has a film with length, which is for solid contacts: leave it out, or 'contact'"
            )
        if given.axial and given.film:
            return "has a film with axial, which is for solid contacts: leave it out, or 'contact'"
        if given.profile and given.length:
            return 'has a clearance with profile and length: the axes of worn bearings are in line'
        worn = next((key for key in ('profile', 'wear') if getattr(given, key)), '')
        if worn and not given.wall:
            return f"has {worn} and a film alone: give 'contact.roughness', where its walls touch"
        if given.wear and bool(given.wear.width) == given.film:
            film = 'has wear with width: with a film it is contact.width; leave it out'
            return film if given.film else "has wear without 'width', that of the bearing"
        try:
            if given.reach > 0.0 and (shape := _worn_of(given)):
                _film_profile(given, shape)
        except ValueError as error:
            return str(error)
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

    def contacts(self, spec: ClearanceSpec, joint: Any, mechanism: Mechanism) -> Contacts:
        """The bushing, or both its ends, an oil film, stops along the axis."""
        gaps: list[Gap] = []
        films: list[ForceElement] = []
        name, soft = joint.name, spec.wall == 'soft'
        if film := _oil_film(spec):
            reach = spec.reach if spec.wall else 0.0
            films.append(FilmBearing(name, mechanism, film, reach, soft))
        if spec.wall:
            leans = leaning(mechanism, name, spec)
            gap = BearingClearance(
                name, mechanism, spec.reach, spec.journal, **spec.behaviour(0.5 if leans else 1.0)
            )  # fmt: skip
            if isinstance(spec, Clearance) and (shape := _worn_of(spec)):
                known = {field.name: getattr(gap, field.name) for field in fields(gap)}
                gap = WornBearing(**known, shape=shape)
                if film and (profile := _film_profile(spec, shape)):
                    films = [WornFilm(name, mechanism, film, reach, soft, gap, profile)]
            gaps += bearing_ends(gap, *leans) if leans else [gap]
        if isinstance(spec, Clearance) and spec.axial:
            gaps += _stops(mechanism, name, spec, spec.axial)
        return gaps, films

    def seat(
        self, spec: ClearanceSpec, joint: Any, m: Mechanism, force: Array, place: Place
    ) -> Array:
        """Initial offset of the pin from the bushing's centre under a force (2,) [m]."""
        leans = leaning(m, joint.name, spec)
        axes = (leans.pin, leans.bushing) if leans else ()
        law = spec.law(0.5 if any(map(any, axes)) else 1.0)  # one end of two takes it all
        size = float(np.hypot(*force))
        centred: Array = (spec.radial + (law.resting_depth(size) if law else 0.0)) * force / size
        if place is None:
            return centred
        room, turns = float(np.hypot(*centred)), [m.angle(link, place) for link in joint.links]
        push = centred / room
        if isinstance(spec, Clearance) and (shape := _worn_of(spec)):
            return shape.seat(push, turns) + (room - spec.radial) * push  # of a soft contact
        ends = [np.array(rotate(*turned)) for turned in zip(axes, turns, strict=False)]
        off = 0.5 * leans.length * (ends[0] - ends[1]) if leans else np.zeros(2)
        return seat(room, push, off) if off.any() else centred

    def notes(self, machine: Any, joint: Revolute) -> list[str]:
        """Room of the ends of a bearing, and stops along its axis."""
        spec = machine.plan.clearances.get(joint.name)
        if not isinstance(spec, Clearance):
            return []
        found = []
        if spec.axial:
            faces = spec.axial.face_radius
            found = [
                f'{joint.name}: stops along the axis, play {spec.axial.play:g} m to either, '
                f'{f"faces of radius {faces:g} m" if faces else "without moments"}'
            ]
        if spec.profile and (shape := _worn_of(spec)):
            worn = zip(('bushing', 'pin'), spec.profile.depths(LOOKS), strict=True)
            deep = ', '.join(f'{x} worn up to {d.max():.4g} m' for x, d in worn if d.any())
            found.append(
                f'{joint.name}: {deep or "round"}; {spec.profile.harmonics} harmonics '
                f'approximate the positions of the pin to {shape.off:.2g} m'
            )
        if not spec.length:
            return found
        if leaning(machine.mechanism, joint.name, spec) is None:
            return [
                *found,
                f'{joint.name}: pin and bushing stay parallel: its length has no effect',
            ]
        given = spec.misalignment or Misalignment()
        said = [
            f'{name} inclined by {axis.angle:g} rad'
            for name, axis in (('pin', given.pin), ('bushing', given.bushing))
            if axis
        ]
        most = 2.0 * spec.radial / spec.length
        return [
            *found,
            f'{joint.name}: contacts at both ends of {spec.length:g} m, '
            f'{"".join(f"{x}, " for x in said)}room for {most:.4g} rad',
        ]


def _worn_of(given: Clearance) -> WornShape | None:
    """The shape of a bearing with a profile.

    Raises
    ------
    ValueError
        One sentence: why there is none.
    """
    if not given.profile:
        return None
    bushing, pin = (depth.tobytes() for depth in given.profile.depths(LOOKS))
    return worn_shape(given.reach, given.journal, (bushing, pin), given.profile.harmonics)


def _film_profile(given: Clearance, shape: WornShape) -> FilmProfile | None:
    """Profile of the film between worn walls; None for a dry bearing. ValueError: none is left."""
    if not (given.film and given.profile):
        return None
    depths, roughness = given.profile.depths(LOOKS), given.radial - given.reach
    return FilmProfile.of(shape, depths, given.radial, roughness, given.profile.harmonics)


def _stops(mechanism: Mechanism, joint: str, c: Clearance, axial: AxialPlay) -> Iterator[Gap]:
    """Axial stops of a bearing."""
    e = c.restitution if axial.restitution is None else axial.restitution
    pin, bushing = _inclinations(c)
    own = c.model_copy(update={'restitution': e, 'friction': 0.0})
    face = axial.face_radius or 0.0, axial.crown or 0.0, pin, bushing
    for stop, thrust in zip(STOPS, (1.0, -1.0), strict=True):
        name = gap_name(mechanism, mechanism.joint(joint), stop)
        yield AxialStop(name, joint, mechanism, thrust, axial.play, *face, **own.behaviour())


def _inclinations(clearance: Clearance) -> tuple[Vector2, Vector2]:
    """Inclinations of pin and bushing by manufacture [rad]."""
    given = clearance.misalignment or Misalignment()
    pin, bushing = (x.inclination if x else (0.0, 0.0) for x in (given.pin, given.bushing))
    return pin, bushing


def _oil_film(clearance: ClearanceSpec) -> ShortBearing | None:
    """The film of a lubricated bearing; ``None`` for a dry one."""
    contact = clearance.contact
    if contact is None or contact.law != 'film':
        return None
    given = (contact.viscosity, contact.width, contact.radius)
    viscosity, width, radius = (value or 0.0 for value in given)  # checked to be there
    full = contact.cavitation == 'none'
    supply = contact.supply_pressure - contact.cavitation_pressure
    return ShortBearing(viscosity, width, radius, clearance.radial, full, supply)


class Leaning(NamedTuple):
    """A bearing whose ends differ, see `bearing_ends`."""

    length: float  #: [m]
    pin: Vector2  #: [rad] inclination by manufacture
    bushing: Vector2  #: [rad]
    along: float  #: [m]


def leaning(mechanism: Mechanism, joint: str, clearance: ClearanceSpec) -> Leaning | None:
    """Inclination of the axes of a bearing; None if its ends do not differ.

    Within a hundred thousandth of the clearance at its ends they count as in line.
    """
    if not isinstance(clearance, Clearance) or not clearance.length:
        return None
    length, (pin, bushing) = clearance.length, _inclinations(clearance)
    off = 0.5 * length * (math.hypot(*pin) + math.hypot(*bushing))
    leans = any(mechanism.lean(link, 1.0) for link, _ in mechanism.joint(joint).points)
    if not leans and off <= _IN_LINE * clearance.radial:
        return None
    return Leaning(length, pin, bushing, clearance.along)
