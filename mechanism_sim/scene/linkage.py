"""What a scene file says of a linkage that is written out: links, joints, drives, forces."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from mechanism_sim.numerics import formula
from mechanism_sim.scene.cam_keys import CamKeys
from mechanism_sim.scene.gear_keys import GearKeys, GearPart
from mechanism_sim.scene.quantities import (
    AddedInertia,
    Angle,
    Length,
    Mass,
    Part,
    Position,
    Time,
)
from mechanism_sim.scene.schema import AffineTorque, AnyScene, Clearance, Commands, Motor
from mechanism_sim.scene.sensor_keys import Sensor
from mechanism_sim.units import Measure, to_si, to_si_of


def _either(*units: str) -> BeforeValidator:
    """A quantity of one of several kinds, which the coordinate it belongs to decides."""
    return BeforeValidator(lambda value: to_si_of(value, units))


Place = Annotated[Measure, _either('rad', 'm')]
Pace = Annotated[Measure, _either('rad/s', 'm/s')]
Stiffness = Annotated[Measure, _either('N/m', 'N m/rad'), Field()]
Damping = Annotated[Measure, _either('N s/m', 'N m s/rad')]
PerSpeed = Annotated[float, BeforeValidator(lambda x: to_si(x, 'N s/m'))]
PerPosition = Annotated[float, BeforeValidator(lambda x: to_si(x, 'N/m'))]


def _or_formula(unit: str) -> BeforeValidator:
    """A quantity, or a formula in SI units such as ``-5*vx + 3*sin(20*t)``."""

    def read(value: Any) -> float | str:
        try:
            return to_si(value, unit)
        except ValueError as error:
            if not isinstance(value, str):
                raise
            try:
                formula.names(value)
            except ValueError as other:
                raise (other if '(' in value else error) from error
            return value

    return BeforeValidator(read)


Force = Annotated[float | str, _or_formula('N')]
Torque = Annotated[float | str, _or_formula('N m')]
Vector = tuple[Position, Position]


class LinkageLink(Part):
    """A link: its points, and what it weighs."""

    length: Length | None = None  #: from `start` to `end`
    points: dict[str, Vector] = {}
    mass: Mass | None = None
    inertia: AddedInertia | None = None  #: about the centre of gravity; 0 for a point mass
    cog: Position | Vector = 0.0


class PointMass(Part):
    """A mass at a point of a link, ``LINK.POINT``."""

    at: str
    mass: Mass


Reference = Annotated[list[str], Field(min_length=2, max_length=2)]


KINDS = 'revolute', 'prismatic', 'slot', 'geneva', 'rack', 'cam', 'mesh', 'transmission'


class LinkageJoint(CamKeys, GearKeys):
    """A joint between points of two links: of one kind."""

    revolute: Reference | None = None
    prismatic: Reference | None = None
    slot: Reference | None = None
    geneva: Reference | None = None
    rack: Reference | None = None
    cam: Reference | None = None
    mesh: Reference | None = None
    transmission: Reference | None = None
    slots: Annotated[int, Field(ge=3, le=24)] | None = None  #: of a Geneva wheel
    pitch: Length | None = None  #: of the slots of a rack
    axis: Angle = 0.0  #: of sliding: in the first link of a prismatic joint, in the second's slot
    angle: Angle = 0.0  #: of the second link in the first, for a prismatic joint
    phase: Angle = 0.0  #: of a cam or, in a transmission, of the second when the first is at 0
    clearance: Clearance | None = None

    @model_validator(mode='after')
    def _one_kind(self) -> LinkageJoint:
        kinds = [k for k in KINDS if getattr(self, k) is not None]
        if len(kinds) != 1:
            raise ValueError(
                f'must be of one kind, {", ".join(KINDS)}, with two points such as '
                '[crank.end, rod.start]'
            )
        c = self.clearance
        if c and kinds[0] in ('mesh', 'transmission'):
            raise ValueError("cannot have a clearance: the play of teeth is their 'backlash'")
        if c and kinds == ['prismatic']:
            raise ValueError('cannot have a clearance: guides have none here')
        if c and kinds != ['revolute'] and (c.friction or c.pin_radius or c.contact):
            raise ValueError(
                f'has a clearance of a {kinds[0]}, which has radial and restitution only'
            )
        return self

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        return next(k for k in KINDS if getattr(self, k) is not None)

    @property
    def points(self) -> list[str]:
        """The two points."""
        points: list[str] = getattr(self, self.kind)
        return points


class LinkageProfile(Part):
    """Speeds at given times, joined by ramps; the last one stays."""

    points: list[tuple[Time, Pace]] = Field(min_length=1)
    ramp: Literal['linear', 'smooth'] = 'linear'


class AffineForce(Part):
    """``constant + per_position * displacement + per_speed * speed``."""

    constant: Annotated[float, BeforeValidator(lambda x: to_si(x, 'N'))] = 0.0
    per_position: PerPosition = 0.0
    per_speed: PerSpeed = 0.0


class LinkageDrive(Part):
    """What moves a coordinate: a speed, a profile of speeds, a torque, a force, or a motor."""

    coordinate: str | None = None
    speed: Pace | None = None  #: with a torque, a force or a motor the speed at the start
    profile: LinkageProfile | None = None
    torque: AffineTorque | None = None
    force: AffineForce | None = None
    motor: Motor | None = None
    commands: Commands | None = None
    flywheel: AddedInertia = 0.0
    start_angle: Angle | None = None
    start_position: Position | None = None


class SpringPart(Part):
    """Between two points, or, with an angular stiffness, between two links."""

    between: Reference
    stiffness: Stiffness = Measure(0.0, '')
    damping: Damping = Measure(0.0, '')
    free_length: Annotated[float, BeforeValidator(lambda x: to_si(x, 'm'))] | None = None
    free_angle: Angle | None = None


class DuringPart(Part):
    """A part of the cycle of a coordinate."""

    coordinate: str
    begin: Angle = Field(alias='from')
    end: Angle = Field(alias='to')


class LoadPart(Part):
    """A force at a point of a link, a torque on it, or both."""

    at: str
    force: tuple[Force, Force] = (0.0, 0.0)
    torque: Torque = 0.0
    frame: Literal['world', 'link'] = 'world'
    during: DuringPart | None = None


class LinkageInitial(Part):
    """Coordinates that do not start where drive and guess would put them."""

    position: dict[str, Place] = {}
    velocity: dict[str, Pace] = {}


class LinkageScene(AnyScene):
    """A scene that names its links and joints."""

    mechanism: Literal['linkage']
    links: dict[str, LinkageLink]
    joints: dict[str, LinkageJoint]
    gears: dict[str, GearPart] = {}
    masses: dict[str, PointMass] = {}
    drive: LinkageDrive | None = None
    drives: dict[str, LinkageDrive] = {}
    guess: dict[str, Place] = {}
    springs: dict[str, SpringPart] = {}
    loads: dict[str, LoadPart] = {}
    initial: LinkageInitial = LinkageInitial()
    sensors: dict[str, Sensor] = Field({})
