"""What a scene file may say: every key, its unit, its bounds and its default."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from mechanism_sim.errors import nearest
from mechanism_sim.numerics import formula
from mechanism_sim.scene.gear_keys import GearPart
from mechanism_sim.scene.joint_keys import Reference
from mechanism_sim.scene.kinds import KINDS
from mechanism_sim.scene.oscillator_keys import Oscillator
from mechanism_sim.scene.quantities import (
    POSITIVE,
    AddedInertia,
    Angle,
    AngularAcceleration,
    Displacement,
    Duration,
    Gravity,
    Length,
    Mass,
    Part,
    Position,
    Quantity,
    Rate,
    Speed,
    Time,
    Tolerance,
    Torque,
    TorquePerAngle,
    TorquePerSpeed,
    si,
    si_of,
)
from mechanism_sim.scene.sensor_keys import QUANTITIES
from mechanism_sim.scene.sensors import SENSORS
from mechanism_sim.sensing import chain
from mechanism_sim.sensing.presets import PRESETS
from mechanism_sim.units import Measure, to_si

Place = Annotated[Measure, si_of('rad', 'm')]
Pace = Annotated[Measure, si_of('rad/s', 'm/s')]
Stiffness = Annotated[Measure, si_of('N/m', 'N m/rad')]
Damping = Annotated[Measure, si_of('N s/m', 'N m s/rad')]
PerSpeed = Annotated[float, si('N s/m')]
PerPosition = Annotated[float, si('N/m')]


def _or_formula(unit: str) -> Quantity:
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

    return Quantity(read, (unit,), 'a formula')


ForceOrFormula = Annotated[float | str, _or_formula('N')]
TorqueOrFormula = Annotated[float | str, _or_formula('N m')]
Vector = tuple[Position, Position]


class AffineTorque(Part):
    """``constant + per_angle * angle + per_speed * speed``; all zero is a free crank."""

    constant: Torque = 0.0
    """Whatever angle and speed are."""
    per_angle: TorquePerAngle = 0.0
    """Times the angle of the link."""
    per_speed: TorquePerSpeed = 0.0
    """Times its speed; negative brakes."""


class Motor(Part):
    """The straight line of a direct-current motor."""

    stall_torque: Torque
    """Torque at rest."""
    no_load_speed: Speed
    """Speed at which there is no torque."""


class Commands(Part):
    """Which speeds may be commanded while the machine runs."""

    acceleration: AngularAcceleration
    """Of the ramp to a commanded speed."""
    fastest: Annotated[Speed, POSITIVE]
    """The largest speed that is taken, either way."""


class Outputs(Part):
    """What is published, and how often in simulated time."""

    forces: bool = True
    """Whether an ideal machine's forces are computed: reactions, torques, energies."""
    joint_states: Rate = 100.0
    """Messages in a simulated second."""
    linkage_state: Rate = 100.0
    """Messages in a simulated second."""
    joint_reactions: Rate = 100.0
    """Messages in a simulated second."""
    transforms: Rate = 50.0
    """Messages of /tf in a simulated second."""
    markers: Rate = 50.0
    """Of forces and clearances, in the display."""
    part_states: Rate = 100.0
    """Of each cam, pair of gears, Geneva wheel and oscillator."""


class Solver(Part):
    """How exact the solution is to be."""

    rtol: Tolerance = 1e-12
    """Error of a step relative to a tenth of the drive's speed."""
    atol: Displacement = 0.0
    """Displacement that may be left out when chatter is ended, if larger."""


class LinkPart(Part):
    """A link: its points, and what it weighs."""

    length: Length | None = None
    """Makes the point `end` at [length, 0]."""
    points: dict[str, Vector] = {}
    """Further points by name, as [x, y] in the link's frame."""
    mass: Mass | None = None
    """For all moving links or for none; forces and clearances need it."""
    inertia: AddedInertia | None = None
    """About the centre of gravity; 0 for a point mass."""
    cog: Position | Vector = 0.0
    """Centre of gravity: along the link, or as [x, y] in its frame."""


class PointMass(Part):
    """A mass at a point of a link, ``LINK.POINT``."""

    at: str
    """LINK.POINT that carries it."""
    mass: Mass
    """How heavy it is."""


class JointPart(*(kind.keys for kind in KINDS.values())):  # type: ignore[misc]
    """A joint between points of two links: of one kind."""

    @model_validator(mode='after')
    def _one_kind(self) -> JointPart:
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            raise ValueError(
                f'must be of one kind, {", ".join(KINDS)}, with two points such as '
                '[crank.end, rod.start]'
            )
        c, kind = self.clearance, KINDS[kinds[0]]
        if c and kind.firm:
            raise ValueError(f'cannot have a clearance: {kind.firm}')
        if c and kind.name != 'revolute' and (c.friction or c.pin_radius or c.contact):
            raise ValueError(
                f'has a clearance of a {kind.name}, which has radial and restitution only'
            )
        return self


class SensorPart(*(kind.keys for kind in SENSORS.values())):  # type: ignore[misc]
    """A sensor: of one kind."""

    @property
    def measures(self) -> str:
        """What its samples are, one of `QUANTITIES`."""
        return SENSORS[self.kind].quantity(self)

    @property
    def unit(self) -> str:
        """Of its samples."""
        return QUANTITIES[self.measures]

    @model_validator(mode='before')
    @classmethod
    def _preset(cls, data: Any) -> Any:
        """Fill in what the instrument named here is like."""
        name = data.get('instrument') if isinstance(data, dict) else None
        if name is None:
            return data
        if name not in PRESETS:
            raise ValueError(
                f"has the unknown instrument '{name}': known are {', '.join(sorted(PRESETS))}"
            )
        return _merged(PRESETS[name], data)

    @model_validator(mode='after')
    def _sense(self) -> SensorPart:
        if self.kind not in SENSORS:
            raise ValueError(
                f"has the unknown kind '{self.kind}'{nearest(self.kind, SENSORS)}: known are "
                f'{", ".join(SENSORS)}'
            )
        kind = SENSORS[self.kind]
        for key, field in type(self).model_fields.items():
            if key not in kind.keys.model_fields and getattr(self, key) != field.default:
                raise ValueError(f"has '{key}', which has no meaning for the kind {kind.name}")
        for key in kind.needs:
            if getattr(self, key) is None:
                raise PydanticCustomError('missing_key', '{key} is missing', {'key': key})
        if self.integrator and self.quantity == 'acceleration':
            raise ValueError(
                "has an integrator, but 'quantity' is acceleration: make it velocity or "
                'displacement, or leave the integrator out'
            )
        if self.imu and self.quantity != 'acceleration':
            raise ValueError(f"has 'imu', which shows acceleration, but measures {self.quantity}")
        if self.adc.jitter * self.sample_rate > 0.1:
            raise ValueError(
                f'has adc.jitter = {self.adc.jitter:g} s: it must be at most a tenth of the '
                f'sampling period, {0.1 / self.sample_rate:g} s'
            )
        if self.adc.bits and self.adc.range is None:
            raise ValueError('has adc.bits without adc.range: the steps have no size')
        hum = self.noise.hum
        for name, reading in (
            ('adc.range', self.adc.range),
            ('noise.rms', self.noise.rms),
            ('noise.hum.amplitude', hum.amplitude if hum else None),
        ):
            if reading and reading.unit not in ('', self.unit):
                raise ValueError(
                    f'has {name} in {reading.unit}, but its quantity is {self.measures}: '
                    f'give it in {self.unit}'
                )
        if self.adc.range and not self.adc.range.value:
            raise ValueError('has adc.range = 0: it must be more')
        return self

    def chain(self) -> chain.Instrument:
        """The instrument in the terms of `mechanism_sim.sensing.chain`."""
        adc, noise = self.adc, self.noise
        limit = adc.range.value if adc.range else None
        found = noise.hum
        hum = chain.Hum(found.amplitude.value, found.frequency) if found else None
        return chain.Instrument(
            sample_rate=self.sample_rate,
            transducer=chain.Transducer(**self.transducer.model_dump()),
            amplifier=chain.Amplifier(**self.amplifier.model_dump()),
            integrator=chain.Integrator(
                ('acceleration', 'velocity', 'displacement').index(self.quantity),
                self.integrator.high_pass if self.integrator else None,
            ),
            anti_alias=chain.AntiAlias(**self.anti_alias.model_dump())
            if self.anti_alias
            else None,
            impact_pulse=self.impact_pulse or 0.0,
            trigger=chain.Trigger(**self.trigger.model_dump()) if self.trigger else None,
            converter=chain.Converter(limit, adc.bits, adc.jitter),
            noise=chain.Noise(noise.rms.value, noise.seed, hum),
        )


def _merged(preset: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Keys of both, those of `given` first, level by level."""
    merged = preset | given
    for key, value in preset.items():
        if isinstance(value, dict) and isinstance(given.get(key), dict):
            merged[key] = _merged(value, given[key])
    return merged


class ProfilePart(Part):
    """Speeds at given times, joined by ramps; the last one stays."""

    points: list[tuple[Time, Pace]] = Field(min_length=1)
    """List of [time, speed]; before the first and after the last the speed stays."""
    ramp: Literal['linear', 'smooth'] = 'linear'
    """Between two points; smooth has no jumps of acceleration."""


class AffineForce(Part):
    """``constant + per_position * displacement + per_speed * speed``."""

    constant: Annotated[float, si('N')] = 0.0
    """Wherever and however fast it is."""
    per_position: PerPosition = 0.0
    """Times the displacement of the link."""
    per_speed: PerSpeed = 0.0
    """Times its speed; negative brakes."""


class DrivePart(Part):
    """What moves a coordinate: a speed, a profile of speeds, a torque, a force, or a motor."""

    coordinate: str | None = None
    """The driven link; the crank if there is one of that name."""
    speed: Pace | None = None
    """Constant; with a torque, a force or a motor that at the start."""
    profile: ProfilePart | None = None
    """Speeds over time, instead of a constant one."""
    torque: AffineTorque | None = None
    """On a link that turns: an affine law of angle and speed; {} moves freely."""
    force: AffineForce | None = None
    """On a link that slides: an affine law of displacement and speed; {} moves freely."""
    motor: Motor | None = None
    """A direct-current motor, instead of a torque."""
    commands: Commands | None = None
    """Take commands of speed while the machine runs."""
    flywheel: AddedInertia = 0.0
    """Inertia that turns with the link."""
    start_angle: Angle | None = None
    """Of a link that turns, at t = 0; else that of `guess`, or 0."""
    start_position: Position | None = None
    """Of a link that slides, at t = 0; else that of `guess`, or 0."""


class SpringPart(Part):
    """Between two points, or, with an angular stiffness, between two links."""

    between: Reference
    """Two points; two links for a torsion spring."""
    stiffness: Stiffness = Measure(0.0, '')
    """Per length or per angle, which says what kind of spring it is."""
    damping: Damping = Measure(0.0, '')
    """Per speed of the same kind."""
    free_length: Annotated[float, si('m')] | None = None
    """Where it pulls nothing; else 0."""
    free_angle: Angle | None = None
    """Where a torsion spring turns nothing; else 0."""


class DuringPart(Part):
    """A part of the cycle of a coordinate."""

    coordinate: str
    """The link whose angle it is."""
    begin: Angle = Field(alias='from')
    """Where it begins."""
    end: Angle = Field(alias='to')
    """Where it ends, counterclockwise from there."""


class LoadPart(Part):
    """A force at a point of a link, a torque on it, or both."""

    at: str
    """LINK.POINT on which it acts."""
    force: tuple[ForceOrFormula, ForceOrFormula] = (0.0, 0.0)
    """Along x and y; quantities, or formulas such as "-5*vx + 3*sin(20*t)"."""
    torque: TorqueOrFormula = 0.0
    """Counterclockwise; a quantity or a formula."""
    frame: Literal['world', 'link'] = 'world'
    """Whether the force keeps its direction, or turns with the link."""
    during: DuringPart | None = None
    """The part of a cycle in which it acts; else always."""


class InitialPart(Part):
    """Coordinates that do not start where drive and guess would put them."""

    position: dict[str, Place] = {}
    """Angles and displacements by link."""
    velocity: dict[str, Pace] = {}
    """Their rates by link."""


class AnyScene(Part):
    """What scenes of every kind say."""

    title: str
    """One line for lists."""
    description: str = ''
    """What it is, and where its numbers come from."""
    gravity: Gravity = (0.0, 0.0)
    """Acceleration along x and along y."""
    duration: Duration | None = None
    """Of a run of which no length is asked; else one revolution."""
    start: Literal['seated', 'centred'] = 'seated'
    """Where loose pins start: pressed on their bushings as by an ideal joint, or in the middle."""
    outputs: Outputs = Outputs()
    """What is published, and how often."""
    solver: Solver = Solver()
    """How exact the solution is to be."""
    oscillators: dict[str, Oscillator] = {}
    """Frames on springs that the machine shakes, by name."""


class Scene(AnyScene):
    """A scene that names its links and joints."""

    mechanism: Literal['linkage']
    """Written out: links and joints have the names given here."""
    links: dict[str, LinkPart]
    """What they measure and weigh, by name; ground is the frame."""
    joints: dict[str, JointPart]
    """Between points of two links, LINK.POINT, by name."""
    gears: dict[str, GearPart] = {}
    """Teeth that links carry, by name, for joints of the kind mesh."""
    masses: dict[str, PointMass] = {}
    """Point masses that links carry, by name."""
    drive: DrivePart | None = None
    """What moves the machine; revolutions are turns of this link."""
    drives: dict[str, DrivePart] = {}
    """Further drives, by link."""
    guess: dict[str, Place] = {}
    """Rough angles and displacements by link, which choose how loops are closed."""
    springs: dict[str, SpringPart] = {}
    """With their dampers, by name."""
    loads: dict[str, LoadPart] = {}
    """Forces and torques on links, by name."""
    initial: InitialPart = InitialPart()
    """Coordinates that start elsewhere than drive and guess say."""
    sensors: dict[str, SensorPart] = Field({})
    """Accelerometers, encoders and others, by name."""
