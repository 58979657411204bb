"""Keys of a loose joint and its contacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from mechanism_sim.arrays import Array
from mechanism_sim.engine.contact.compliant import (
    Flores,
    Hertz,
    HuntCrossley,
    LankaraniNikravesh,
    Material,
    hertz_stiffness,
    socket_stiffness,
)
from mechanism_sim.keys.quantities import (
    NOT_NEGATIVE,
    POSITIVE,
    Angle,
    Coefficient,
    Displacement,
    Hypothesis,
    Length,
    Part,
    Position,
    Radius,
    si,
)
from mechanism_sim.keys.quantities import (
    Friction as FrictionCoefficient,
)
from mechanism_sim.numerics.curves import through
from mechanism_sim.numerics.polynomials import TWO_PI
from mechanism_sim.planar.points import rotate
from mechanism_sim.planar.protocols import ForceLaw
from mechanism_sim.units import to_si, to_stiffness


class MaterialPart(Part):
    """An isotropic elastic material."""

    young: Annotated[float, si('Pa'), POSITIVE]
    """Modulus of elasticity."""
    poisson: Annotated[float, si(''), Field(gt=-1.0, le=0.5)] = 0.3
    """Poisson's ratio."""

    @property
    def material(self) -> Material:
        """Material for formulas."""
        return Material(self.young, self.poisson)


class Contact(Part):
    """A compliant contact: a contact force law instead of a rigid contact."""

    law: Literal['hertz', 'hunt_crossley', 'lankarani_nikravesh', 'flores', 'film']
    """Hertz without loss, three laws with loss by impact, or an oil film."""
    stiffness: Annotated[float, si(''), Field(gt=0.0, allow_inf_nan=False)] | None = None
    """With its unit, as 2e9 N/m^1.5, or in N/m^exponent; required, or `materials`, but for a film,
    whose walls are rigid without."""
    materials: Annotated[list[MaterialPart], Field(min_length=1, max_length=2)] | None = None
    """Of both bodies, or one of both: the stiffness by Hertz, of a ball on a ball or in a socket.
    """
    radii: tuple[Position, Position] | None = None
    """Of both bodies with `materials`, a hollow one negative; of a pin its `radius` will do."""
    exponent: Annotated[float, Field(ge=1.0, le=3.0)] = 1.5
    """Of the depth."""
    viscosity: Annotated[float, si('Pa s'), POSITIVE] | None = None
    """Of the oil; required for a film."""
    width: Length | None = None
    """Of the bearing along its axis; required for a film."""
    radius: Length | None = None
    """Of the journal; required for a film, and of pins with `materials`; else `pin_radius`."""
    cavitation: Literal['guembel', 'none'] = 'guembel'
    """Of a film whose pressure falls below `cavitation_pressure`. It ruptures and carries nothing
    there (Guembel), or it pulls, if the supply's pressure keeps it whole."""
    supply_pressure: Annotated[float, si('Pa'), Field(allow_inf_nan=False)] = 0.0
    """Of the oil at both ends of a film, above that of the surroundings."""
    cavitation_pressure: Annotated[float, si('Pa'), Field(allow_inf_nan=False)] = 0.0
    """At which a film ruptures, above that of the surroundings: negative if oil holds together."""
    roughness: Length | None = None
    """Thickness of a film at which its walls touch; without, they never do."""

    @model_validator(mode='before')
    @classmethod
    def _stiffness_by_its_unit(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not isinstance(text := data.get('stiffness'), str):
            return data
        try:
            exponent = to_si(data.get('exponent') or 1.5, '')
        except ValueError:
            return data  # which is refused by itself
        try:
            return {**data, 'stiffness': to_stiffness(text, exponent)}
        except ValueError as error:
            raise ValueError(f"has stiffness = '{text}', which {error}") from error

    @model_validator(mode='after')
    def _one_stiffness(self) -> Contact:
        if self.materials is None:
            if self.radii:
                raise ValueError("has 'radii' without 'materials'")
            return self
        if self.stiffness is not None:
            raise ValueError("has 'stiffness' and 'materials': keep one")
        if self.exponent != 1.5:
            raise ValueError(
                f'has exponent = {self.exponent:g}: with materials it is 1.5, after Hertz'
            )
        if self.radii and not (math.prod(self.radii) and self.relative_radius > 0.0):
            a, b = self.radii
            raise ValueError(
                f'has radii {a:g} m and {b:g} m, between which no point touches: none may be 0, '
                'and a hollow one, negative, must be larger than the other'
            )
        return self

    @property
    def relative_radius(self) -> float:
        """``1/R = 1/R1 + 1/R2`` [m]; infinite between planes, 0 where there is none."""
        a, b = self.radii or (0.0, 0.0)
        return a * b / (a + b) if a + b else 0.0


class Friction(Part):
    """Coulomb friction in an ideal joint, under its own force."""

    coefficient: Annotated[float, si(''), Field(ge=0.0, allow_inf_nan=False)] = 0.0
    """Coulomb's coefficient, required; a joint that rests sticks with the same."""
    radius: Length | None = None
    """Of a pin, the arm of its friction; required there."""
    length: Length | None = None
    """Of a block along its guide, about its point: its ends carry moments; else none rub."""
    groove: Annotated[float, si('rad'), Field(gt=0.0, lt=math.pi)] | None = None
    """Of a V-belt: between the flanks of its pulleys' grooves; without it the belt is flat."""
    efficiency: Annotated[float, si(''), Field(gt=0.0, le=1.0)] | None = None
    """Of a chain or a toothed belt, in the place of a coefficient."""

    other_words = dict.fromkeys(
        ('dry_torque', 'torque', 'coulomb_torque', 'friction_torque', 'breakaway_torque'),
        'a load: loads: {NAME: {at: LINK, torque: -0.5 N m*sign(LINK_rate)}}',
    )

    @model_validator(mode='after')
    def _one_size(self) -> Friction:
        without = 'coefficient' not in self.model_fields_set
        if without if self.efficiency is None else self.coefficient:
            raise ValueError("needs a 'coefficient', or of a chain its 'efficiency' instead")
        return self


class ClearanceSpec(Part):
    """Clearance of a joint, and the laws of its contacts."""

    radial: Displacement
    """Radial clearance; 0 for a contact that only lifts off."""
    restitution: Coefficient
    """Coefficient of restitution: 0 without rebound, 1 without loss. A film without `roughness`
    needs none."""
    hypothesis: Hypothesis = 'newton'
    """Hypothesis of restitution: ratio of velocities, impulses or energies; equal if smooth."""
    friction: FrictionCoefficient = 0.0
    """Coefficient of Coulomb friction, in impacts and in following."""
    pin_radius: Radius = 0.0
    """The arm of friction; only with friction."""
    contact: Contact | None = None
    """A contact force law or an oil film instead of a rigid contact; for all joints or none."""

    @model_validator(mode='before')
    @classmethod
    def _walls_that_never_touch(cls, data: Any) -> Any:
        contact = data.get('contact') if isinstance(data, dict) else None
        given = vars(contact) if isinstance(contact, Contact) else contact
        given = given if isinstance(given, dict) else {}
        never = given.get('law') == 'film' and not given.get('roughness')
        return {'restitution': 0.0, **data} if never else data

    @model_validator(mode='after')
    def _known_radii(self) -> ClearanceSpec:
        c = self.contact
        if c and c.materials and not c.radii:
            if not (c.radius or self.pin_radius):
                raise ValueError(
                    "has contact.materials without 'contact.radii', or of a pin 'contact.radius'"
                )
            if not self.radial:
                raise ValueError("has contact.materials and no radial: give 'contact.radii'")
        return self

    @property
    def stiffness(self) -> float | None:
        """Stiffness of the compliant contacts [N/m^exponent], given or of the materials."""
        contact = self.contact
        if not contact or not contact.materials:
            return contact.stiffness if contact else None
        pair = contact.materials[0].material, contact.materials[-1].material
        if contact.radii:
            return hertz_stiffness(contact.relative_radius, *pair)
        return socket_stiffness(contact.radius or self.pin_radius, self.radial, *pair)

    @property
    def film(self) -> bool:
        """True if oil fills it."""
        return self.contact is not None and self.contact.law == 'film'

    @property
    def journal(self) -> float:
        """Radius of the pin [m], which of a film is that of its contact."""
        return (self.film and self.contact and self.contact.radius) or self.pin_radius

    @property
    def reach(self) -> float:
        """Distance of the pin from the middle at which the walls touch [m]."""
        return self.radial - ((self.contact and self.contact.roughness) or 0.0)

    @property
    def wall(self) -> Literal['rigid', 'soft', '']:
        """Kind of the contacts of the walls; empty for a film without walls."""
        if self.contact is None:
            return 'rigid'
        if self.film and not self.contact.roughness:
            return ''
        return 'soft' if self.stiffness else 'rigid'

    def law(self, share: float = 1.0) -> ForceLaw | None:
        """Law of the compliant contacts with a share of the stiffness; None for rigid ones."""
        contact, stiffness = self.contact, self.stiffness
        if contact is None or stiffness is None:
            return None
        if contact.law in ('hertz', 'film'):
            return Hertz(share * stiffness, contact.exponent)
        laws: dict[str, Callable[[float, float, float], ForceLaw]] = {
            'hunt_crossley': HuntCrossley,
            'lankarani_nikravesh': LankaraniNikravesh,
            'flores': Flores,
        }
        return laws[contact.law](share * stiffness, self.restitution, contact.exponent)

    def behaviour(self, share: float = 1.0) -> dict[str, Any]:
        """Keywords of a `ContactGap`; `share` is that of the stiffness."""
        given = {key: getattr(self, key) for key in ('restitution', 'friction', 'hypothesis')}
        return {**given, 'law': self.law(share)}


def clearance_spec_of(given: Any, radial: float) -> ClearanceSpec:
    """The clearance of a joint whose keys give restitution and so on under other names."""
    keys = {'hypothesis', 'friction', 'pin_radius', 'contact'} & given.model_fields_set
    said = {key: getattr(given, key) for key in keys}
    return ClearanceSpec(radial=radial, restitution=given.restitution or 0.0, **said)


class Inclination(Part):
    """Inclination of an axis against the normal of the plane of motion."""

    angle: Annotated[float, si('rad'), Field(ge=0.0, lt=0.1)]
    """Small: the equations are of the first order in it."""
    direction: Angle = 0.0
    """In which the axis leans on the side towards the reader, in the frame of its link."""

    @property
    def inclination(self) -> tuple[float, float]:
        """Inclinations along x and y of the link's frame [rad]; exact for quarter turns."""
        return rotate((self.angle, 0.0), self.direction)


class Misalignment(Part):
    """Misalignment of the axes of a bearing, by manufacture."""

    pin: Inclination | None = None
    """Of the pin, on the first-named link."""
    bushing: Inclination | None = None
    """Of the bushing, on the second-named link."""


class WornPart(Part):
    """Depth of wear of a surface, over the angle in the frame of its own link."""

    points: Annotated[list[tuple[Angle, Position]], Field(min_length=4)]
    """Angle and radial depth, such as [30 deg, 12 um], with increasing angles within a turn,
    through which a periodic cubic spline goes; what is built up is negative. Or `file` names a
    file of comma-separated values beside the scene, and `columns` two of its columns.
    """

    @model_validator(mode='after')
    def _is_curve(self) -> WornPart:
        self.depth(np.zeros(1))
        return self

    def depth(self, angles: Array) -> Array:
        """Depths of wear (N,) [m] at angles (N,) [rad]."""
        points = list(self.points)
        if points[-1][0] - points[0][0] < (1.0 - 1e-9) * TWO_PI:
            points.append((points[0][0] + TWO_PI, points[0][1]))
        return through(points, 'cubic', cyclic=True)(angles)


class ProfilesPart(Part):
    """The shapes of a bushing and of a pin that are not round."""

    bushing: WornPart | None = None
    """Of the second-named link."""
    pin: WornPart | None = None
    """Of the first-named link; with it, pin_radius is required."""
    harmonics: Annotated[int, Field(ge=4, le=48)] = 16
    """Of the smooth function that describes the gap: more follow narrower grooves."""

    def depths(self, count: int) -> tuple[Array, Array]:
        """Depths of wear of bushing and pin at even angles from 0 on: (count,) each [m]."""
        angles = TWO_PI / count * np.arange(count, dtype=np.float64)
        bushing, pin = (
            x.depth(angles) if x else np.zeros(count) for x in (self.bushing, self.pin)
        )
        return bushing, pin


class WearPart(Part):
    """Wear of a bearing, for `life`: volume by force times sliding distance, after Archard.

    In oil the force is what the walls carry of it.
    """

    width: Length | None = None
    """Of the bearing along its axis; required, but for a film, whose `contact.width` it is."""
    bushing: Annotated[float, si('m^3/(N m)'), NOT_NEGATIVE] = 0.0
    """Volume worn off it over normal force times sliding distance, such as 1e-7 mm^3/(N m)."""
    pin: Annotated[float, si('m^3/(N m)'), NOT_NEGATIVE] = 0.0
    """Likewise."""
    law: Literal['archard', 'friction_work'] = 'archard'
    """The volume is in proportion to normal force times path, or to the work of friction."""


class AxialPlay(Part):
    """Axial play of a bearing, between stops."""

    play: Length
    """From the middle to either stop."""
    restitution: Coefficient | None = None
    """Coefficient of restitution of the stops; that of the bearing if not given."""
    face_radius: Length | None = None
    """Of the faces that meet, for the moment of those out of line; without, they take none."""
    crown: Length | None = None
    """Of a face's middle above its rim; needed with `face_radius`."""

    @model_validator(mode='after')
    def _faced(self) -> AxialPlay:
        if (self.face_radius is None) != (self.crown is None):
            raise ValueError("needs 'face_radius' and 'crown' together, as 8 mm and 1 um")
        return self


class Clearance(ClearanceSpec):
    """A pin on the first-named link, loose in a bushing on the second-named one; or a block."""

    radial: Length
    """Radius of the circle in which the pin's centre can move; of a block, its play each side."""
    length: Length | None = None
    """Of a bearing along its axis, or of a block along its guide, about the joint's point."""
    along: Position = 0.0
    """Where the middle of a bearing lies along its axis, above the plane of its links."""
    misalignment: Misalignment | None = None
    """Of the axes of pin and bushing, which then touch at the ends of the bearing's length."""
    axial: AxialPlay | None = None
    """Stops along the axis, where a link leans (`tilt`): it can then move along it."""
    height: Length | None = None
    """Of a block across its guide; required there."""
    profile: ProfilesPart | None = None
    """Of a pin and a bushing that are worn, or not round."""
    wear: WearPart | None = None
    """How fast they wear."""

    other_words: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(('diametral', 'diameter'), "'radial', half of it"),
        'mu': "'friction'",
        'e': "'restitution'",
    }

    @field_validator('radial', mode='before')
    @classmethod
    def _loose(cls, value: Any) -> Any:
        if is_zero(value):
            raise ValueError(
                "is out of bounds: it must be more than 0; a joint without play has 'clearance: "
                "null'"
            )
        return value


def is_zero(radial: Any) -> bool:
    """True of a radial clearance as it is written that is none."""
    try:
        return to_si(radial, 'm') == 0.0
    except ValueError:
        return False


OF_PINS = 'misalignment', 'along', 'axial', 'profile', 'wear'
"""Keys of a clearance that only pins in bushings have."""


def in_plane(clearance: Clearance | None) -> Clearance | None:
    """A clearance without stops along the axis."""
    return clearance.model_copy(update={'axial': None}) if clearance else None
