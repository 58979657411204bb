"""Schema of scene files: every key, its unit, its bounds and its default."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from mechanism_sim.errors import a_or_an, nearest, quoted
from mechanism_sim.joints.joint_keys import JointKeys, keys_of
from mechanism_sim.joints.kinds import KINDS
from mechanism_sim.keys.elastic_keys import ElasticPart
from mechanism_sim.keys.gear_keys import GearPart
from mechanism_sim.keys.quantities import (
    POSITIVE,
    Acceleration,
    AddedInertia,
    Angle,
    AngularAcceleration,
    Displacement,
    Duration,
    Gravity,
    Length,
    LinkMass,
    Mass,
    Offset,
    Part,
    Position,
    Rate,
    Speed,
    Tolerance,
    Torque,
    TorquePerAngle,
    TorquePerSpeed,
    si,
    si_or_point,
)
from mechanism_sim.planar.motor import InductionMotor
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.facts import yaml_text
from mechanism_sim.scene.formula_keys import EffortOrFormula, ForceOrFormula, TorqueOrFormula
from mechanism_sim.scene.loads import LOADS
from mechanism_sim.scene.motion_keys import (
    AnyAcceleration,
    MovesPart,
    PositionPart,
    SpeedPart,
    SwingPart,
)
from mechanism_sim.scene.motion_keys import Speed as MotionSpeed
from mechanism_sim.scene.problems import PartMaker, deeper
from mechanism_sim.scene.sensor_keys import SensorKeys, seated, sensor_keys_of
from mechanism_sim.scene.sensors import SENSORS
from mechanism_sim.scene.table_keys import TablePart
from mechanism_sim.scene.tilted_links import TiltPart
from mechanism_sim.sensing.chain import QUANTITIES, Instrument
from mechanism_sim.sensing.channel import SensorSource
from mechanism_sim.sensing.point import InertialUnit
from mechanism_sim.sensing.presets import PRESETS
from mechanism_sim.units import QuantityValue, plain, to_si_text
from mechanism_sim.vibration.frame import Frame

_PerSpeed = Annotated[float, si('N s/m')]
_PerPosition = Annotated[float, si('N/m')]
Vector = Annotated[tuple[Position, Position], BeforeValidator(plain)]


class _Affine(Part):
    @model_validator(mode='before')
    @classmethod
    def _alone(cls, data: Any) -> Any:
        return {'formula': data} if isinstance(data, str | int | float) else data


class AffineTorque(_Affine):
    """``constant + per_angle * angle + per_speed * speed``; all zero is a free crank.

    A text or a number alone is a formula, or the constant.
    """

    constant: Torque = 0.0
    """Constant part."""
    per_angle: TorquePerAngle = 0.0
    """Times the angle of the link."""
    per_speed: TorquePerSpeed = 0.0
    """Times its speed; negative brakes."""
    formula: TorqueOrFormula | None = None
    """More torque by a formula, as "0.2*current": of t, links, LINK_rate, states, springs."""


class InductionPart(Part):
    """An induction motor by its data sheet (Kloss' formula); signs by its sense of rotation."""

    synchronous_speed: Speed
    """Synchronous speed, at which there is no torque, as 1500 rpm."""
    rated_speed: Speed
    """Speed of the shaft at the rated torque."""
    rated_torque: Torque
    """On the shaft."""
    breakdown_torque: Torque
    """The largest."""

    other_words = {
        **dict.fromkeys(('power', 'rated_power'), "'rated_torque', power over 'rated_speed'"),
        **dict.fromkeys(
            ('frequency', 'poles', 'pole_pairs'),
            "'synchronous_speed', frequency over pairs of poles, as 1500 rpm",
        ),
    }


class MotorPart(Part):
    """A motor, by one of three characteristics of its shaft, and the gear to the link."""

    stall_torque: Torque | None = None
    """Of a direct-current motor, whose torque falls along a straight line: that at rest."""
    no_load_speed: Speed | None = None
    """Of a direct-current motor: that at which there is no torque."""
    curve: TablePart | None = None
    """Torque over speed: {points: [[1400 rpm, 30 N m], ...]}, or of a file {file: motor.csv}."""
    induction: InductionPart | None = None
    """Torque of an induction motor by its data sheet."""
    ratio: Annotated[float, si(''), Field(allow_inf_nan=False)] = 1.0
    """Turns of the shaft in one of the link; negative if it turns the other way."""
    inertia: AddedInertia = 0.0
    """Of what turns with the shaft; on the link it counts with the square of the ratio."""

    other_words = {
        **dict.fromkeys(('rotor_inertia', 'J'), "'inertia'"),
        **dict.fromkeys(('gear_ratio', 'reduction'), "'ratio'"),
        **dict.fromkeys(
            ('voltage', 'nominal_voltage', 'torque_constant', 'kt', 'speed_constant',
             'resistance', 'terminal_resistance'),
            "'stall_torque', voltage times torque constant over resistance, and 'no_load_speed'",
        ),
        **dict.fromkeys(
            ('inductance', 'terminal_inductance', 'current'),
            "a current by 'states', and a 'torque' of the drive that names it",
        ),
    }  # fmt: skip

    @model_validator(mode='after')
    def _one_characteristic(self) -> MotorPart:
        direct = self.stall_torque is not None, self.no_load_speed is not None
        if any(direct) + (self.curve is not None) + (self.induction is not None) != 1 or (
            any(direct) and not all(direct)
        ):
            raise ValueError(
                "needs one of: 'stall_torque' with 'no_load_speed', 'curve', 'induction'"
            )
        if self.ratio == 0.0:
            raise ValueError('has ratio = 0: it must not be zero')
        if self.curve:
            units = [points[0].unit for points in zip(*self.curve.points, strict=True)]
            repeats = self.curve.curve.cyclic
            if units[0] not in ('', 'rad/s') or units[1] not in ('', 'N m') or repeats:
                raise ValueError(
                    "has a curve that is not of speeds and torques, 'rad/s' and 'N m'"
                )
        if (data := self.induction) is not None:
            InductionMotor.of_data_sheet(**dict(data))
        return self


class Commands(Part):
    """Speeds that may be commanded while the machine runs."""

    acceleration: AngularAcceleration
    """Acceleration of the ramp to a commanded speed."""
    fastest: Annotated[Speed, POSITIVE]
    """Largest speed that may be commanded, in both directions."""


class Outputs(Part):
    """Outputs, and how often they are published in simulated time."""

    forces: bool = True
    """Forces of an ideal machine are computed: reactions, torques, energies."""
    joint_states: Rate = 100.0
    """Messages in a simulated second."""
    linkage_state: Rate = 100.0
    """Messages in a simulated second."""
    joint_reactions: Rate = 100.0
    """Messages in a simulated second."""
    wrenches: Rate | None = None
    """Messages of each joint's ``wrench/JOINT``, in a frame ``joint/JOINT``; without: none."""
    transforms: Rate = 50.0
    """Messages of /tf in a simulated second."""
    markers: Rate = 50.0
    """Of forces and clearances, in the display."""
    part_states: Rate = 100.0
    """Of each cam, pair of gears, Geneva wheel and oscillator."""


class Solver(Part):
    """Tolerances of the solution."""

    rtol: Tolerance = 1e-12
    """Error of a step relative to a tenth of the drive's speed."""
    atol: Displacement = 0.0
    """Displacement that may be left out when chatter is ended, if larger."""


class LinkPart(Part, metaclass=PartMaker):
    """A link: its points and mass properties."""

    length: Length | None = None
    """Makes the point `end` at [length, 0]."""
    points: dict[str, Vector] = {}
    """Further points by name, as [x, y] in the link's frame."""
    mass: LinkMass | None = None
    """For all moving links or for none; forces and clearances need it. 0 kg is allowed."""
    inertia: AddedInertia | None = None
    """About the centre of gravity; 0 for a point mass."""
    cog: Offset = 0.0
    """Centre of gravity: along the link, or as [x, y] in its frame."""
    elastic: ElasticPart | None = None
    """Elasticity; the link is rigid if not given."""
    tilt: TiltPart | None = None
    """Tilt out of its plane; it stays in the plane if not given."""

    by_name_alone = True

    other_words = {
        **dict.fromkeys(('I', 'J'), "'inertia', about the centre of gravity"),
        'm': "'mass'",
        'L': "'length'",
    }


class PointMass(Part):
    """A mass at a point of a link, ``LINK.POINT``."""

    at: str
    """LINK.POINT that carries it."""
    mass: Mass
    """Its mass."""


_SPRINGS = {'revolute': ('N m/rad', 'N m s/rad'), 'prismatic': ('N/m', 'N s/m')}
"""Units of stiffness and damping that other programs have within joints."""


def _as_spring(kind: str, key: str, points: Any) -> str:
    """A clause on a spring or damper about a pin or along a guide; nothing of other keys."""
    joined = isinstance(points, list | tuple) and len(points) == 2
    if kind not in _SPRINGS or key not in ('stiffness', 'damping') or not joined:
        return ''
    links = [str(point).partition('.')[0] for point in points]
    moving = links[-1] if links[-1] != GROUND else links[0]
    place = f'between: [{", ".join(links)}]' if kind == 'revolute' else f'coordinate: {moving}'
    unit = _SPRINGS[kind][key == 'damping']
    return f'; here that is springs: {{NAME: {{{place}, {key}: 5 {unit}}}}}'


def _is_nothing(given: Any) -> bool:
    """True of what is as good as left out: empty, or zero, which files write with its unit."""
    try:
        return to_si_text(given).value == 0.0
    except ValueError:
        return not plain(given)


class JointPart(*KINDS.values(), metaclass=PartMaker):  # type: ignore[misc]
    """A joint between points of two links: of one kind."""

    other_words = {
        **dict.fromkeys(
            ('type', 'kind'), 'the key itself, as in revolute: [LINK.POINT, LINK.POINT]'
        ),
        **dict.fromkeys(('hinge', 'pin', 'pivot', 'rotary', 'rotational'), "'revolute'"),
        **dict.fromkeys(
            ('slider', 'sliding', 'slide', 'translational', 'translation', 'linear'), "'prismatic'"
        ),
        **dict.fromkeys(('gear', 'gears', 'gear_pair', 'gear_mesh', 'spur'), "'mesh'"),
        **dict.fromkeys(('chain', 'timing_belt', 'v_belt'), "'belt'"),
        **dict.fromkeys(('weld', 'welded', 'rigid'), "'fixed'"),
        **dict.fromkeys(('play', 'radial'), "'clearance', as in clearance: {radial: 0.1 mm}"),
    }

    @model_validator(mode='before')
    @classmethod
    def _of_its_kind(cls, data: Any) -> Any:
        """Refuse keys of other kinds before their values are read, which these may mean else.

        What is zero or empty is as good as left out: documents have all keys.
        """
        kinds = [k for k in KINDS if isinstance(data, dict) and data.get(k) is not None]
        if len(kinds) != 1:
            return data
        (kind,) = kinds
        others = cls.model_fields.keys() - KINDS[kind].model_fields.keys()
        for key in (key for key, x in data.items() if key in others and not _is_nothing(x)):
            said = f'{key} has no meaning in {a_or_an(kind)} joint'
            there = deeper([KINDS[kind]], key, data)
            said += _as_spring(kind, key, data[kind]) or nearest(key, (), deeper=there)
            raise ValueError(f'has a key of another kind: {said}')
        return data

    @model_validator(mode='after')
    def _one_kind(self) -> JointPart:
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            raise ValueError(
                f'must be of one kind, {", ".join(KINDS)}, with two points such as [crank.end, '
                'rod.start]'
            )
        c, own = self.clearance, self.kind_keys
        if self.friction and not own.friction_keys:
            rubbing = ', '.join(name for name, k in KINDS.items() if k.friction_keys)
            raise ValueError(f'cannot have friction: a {self.kind} has none here, only {rubbing}')
        if c and own.firm:
            raise ValueError(f'cannot have a clearance: {own.firm}')
        if c and (wrong := own.clearance_objection(c)):
            raise ValueError(wrong)
        return self

    @classmethod
    def keys_for(cls, data: Any) -> list[str]:
        """The keys of the kind whose key is there, or else those by which a kind is said."""
        kinds = [kind for kind in KINDS if kind in data]
        if len(kinds) != 1:
            return [*KINDS, *JointKeys.model_fields]
        return keys_of(cls.model_construct(**{kinds[0]: data[kinds[0]]}))


class SensorPart(*SENSORS.values(), metaclass=PartMaker):  # type: ignore[misc]
    """A sensor: of one kind."""

    @property
    def kind_keys(self) -> SensorKeys:
        """Keys and methods of its kind alone, with its values."""
        own: SensorKeys = self.as_kind(SENSORS[self.kind])
        return own

    def source(self, machine: Any) -> SensorSource:
        """Input of its chain."""
        return self.kind_keys.source(machine)

    other_words = {
        'body': "'link'",
        **dict.fromkeys(('rate', 'fs', 'sampling_rate', 'odr'), "'sample_rate'"),
        'sensitivity': 'left out, as samples are in the unit of what is measured',
        'noise_density': "'noise.rms', the density times the root of the bandwidth",
        **dict.fromkeys(('resonance', 'resonant_frequency'), "'transducer.natural_frequency'"),
        **dict.fromkeys(
            ('bandwidth', 'frequency_range'), "'amplifier.high_pass' and 'amplifier.low_pass'"
        ),
        'iepe': "'instrument: iepe'",
    }

    def carrier(self, machine: Any) -> str:
        """The link or frame that carries it."""
        return self.kind_keys.carrier(machine)

    def place(self, machine: Any) -> str:
        """Place of the sensor in words."""
        return self.kind_keys.place(machine)

    def check(self, machine: Any, where: str) -> None:
        """Refuse what no machine has."""
        self.kind_keys.check(machine, where)

    @classmethod
    def keys_for(cls, data: Any) -> list[str]:
        """The keys of its kind."""
        kind = data.get('kind', SensorKeys().kind)
        return (
            sensor_keys_of(SensorKeys(kind=kind))
            if kind in SENSORS
            else ['kind', *cls.model_fields]
        )

    @property
    def measures(self) -> str:
        """Quantity of its samples, one of `QUANTITIES`."""
        return SENSORS[self.kind].reads or str(self.quantity)

    @property
    def unit(self) -> str:
        """Unit of the samples."""
        return QUANTITIES[self.measures]

    @model_validator(mode='before')
    @classmethod
    def _preset(cls, data: Any) -> Any:
        """Fill in what the instrument named here is like."""
        name = data.get('instrument') if isinstance(data, dict) else None
        if name is None:
            return data
        if not isinstance(name, str) or name not in PRESETS:
            raise ValueError(
                f'has the unknown instrument {quoted(name)}: known are '
                f'{", ".join(sorted(PRESETS))}'
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
            if key not in kind.model_fields and getattr(self, key) != field.default:
                raise ValueError(f"has '{key}', which has no meaning for the kind {self.kind}")
        for key in kind.needs:
            if getattr(self, key) is None:
                raise PydanticCustomError('missing_key', '{key} is missing', {'key': key})
        if self.integrator and self.quantity == 'acceleration':
            raise ValueError(
                "has an integrator, but 'quantity' is acceleration: make it velocity or "
                'displacement, or leave the integrator out'
            )
        if self.imu and self.quantity != 'acceleration':
            raise ValueError(f"has 'imu' for accelerations, but measures {self.quantity}")
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
                    f'has {name} in {reading.unit}, but its quantity is {self.measures}: give it '
                    f'in {self.unit}'
                )
        if self.adc.range and not self.adc.range.value:
            raise ValueError('has adc.range = 0: it must be more')
        return self

    def chain(self) -> Instrument:
        """Measurement chain: transfer functions, sampling and noise."""
        return Instrument(**{x.name: getattr(self, x.name) for x in fields(Instrument)})

    def inertial_unit(self, machine: Any, name: str) -> InertialUnit:
        """The inertial unit in its place, to be fed with motion from the start of a run on."""
        return InertialUnit(
            machine.mechanism,
            str(self.link),
            self.at,
            self.axis,
            self.chain(),
            name,
            self.transducer.transverse,
            self.trigger_in(machine),
        )


def _merged(preset: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Keys of both, those of `given` first, level by level."""
    merged = preset | given
    for key, value in preset.items():
        if isinstance(value, dict) and isinstance(given.get(key), dict):
            merged[key] = _merged(value, given[key])
    return merged


class AffineForce(_Affine):
    """``constant + per_position * displacement + per_speed * speed``.

    A text or a number alone is a formula, or the constant.
    """

    constant: Annotated[float, si('N')] = 0.0
    """Constant part."""
    per_position: _PerPosition = 0.0
    """Times the displacement of the link."""
    per_speed: _PerSpeed = 0.0
    """Times its speed; negative brakes."""
    formula: ForceOrFormula | None = None
    """More force by a formula, as "area*p": of t, links, LINK_rate, states, springs."""


class DrivePart(Part, metaclass=PartMaker):
    """Motion of a coordinate by position, speed, moves, a torque, a force, or a motor."""

    coordinate: str | None = None
    """The driven link; the crank if there is one of that name."""
    speed: MotionSpeed | None = None
    """Constant, or over time: a formula of t, or points; with a torque, a force or a motor that at
    the start.
    """
    acceleration: AnyAcceleration | None = None
    """Constant, with the speed at the start."""
    position: PositionPart | None = None
    """Over time, instead of speeds: a formula of t, as "90 deg + 60 deg*sin(pi*t)", or points."""
    moves: MovesPart | None = None
    """Moves from rest to rest, as fast as limits allow, instead of speeds."""
    swing: SwingPart | None = None
    """Oscillation between the limits of the linkage, as a sine of time."""
    profile: SpeedPart | None = None
    """Speeds over time, as `speed` takes them, too."""
    torque: AffineTorque | None = None
    """On a link that turns: an affine law of angle and speed; {} moves freely."""
    force: AffineForce | None = None
    """On a link that slides: an affine law of displacement and speed; {} moves freely."""
    motor: MotorPart | None = None
    """A motor with its characteristic, instead of a torque."""
    commands: Commands | None = None
    """Accept speed commands while the machine runs."""
    effort: EffortOrFormula | None = None
    """Torque or force of the drive, a quantity or a formula, where its motion is prescribed."""
    flywheel: AddedInertia = 0.0
    """Inertia that turns with the link."""
    start_angle: Angle | None = None
    """Of a link that turns, at t = 0; else that of `guess`, or 0."""
    start_position: Position | None = None
    """Of a link that slides, at t = 0; else that of `guess`, or 0."""

    other_words = {
        **dict.fromkeys(('omega', 'rpm', 'n', 'angular_velocity'), "'speed', as in 300 rpm"),
        **dict.fromkeys(('link', 'joint'), "'coordinate', the driven link"),
    }

    @property
    def added_inertia(self) -> float:
        """Inertia that turns with the link beside its own, as seen by it [kg m^2]."""
        m = self.motor
        return self.flywheel + (m.inertia * m.ratio**2 if m else 0.0)


StartValue = QuantityValue | tuple[float, float]
"""Start of a coordinate, or of a point."""
_StartPlace = Annotated[StartValue, si_or_point('m', 'rad', 'm')]
_StartPace = Annotated[StartValue, si_or_point('m/s', 'rad/s', 'm/s')]


class InitialPart(Part):
    """Initial positions and velocities that differ from those of drive and guess."""

    position: dict[str, _StartPlace] = {}
    """Angles and displacements by link; places [x, y] of points by LINK.POINT."""
    velocity: dict[str, _StartPace] = {}
    """Their rates, by link and by LINK.POINT."""
    elastic: Literal['straight', 'smooth'] = 'straight'
    """How elastic links start: straight, or bent by the forces, nearly without vibration."""


class AnyScene(Part):
    """Keys of scenes of every kind."""

    title: str = ''
    """One line for lists; the name of the file if there is none."""
    description: str = ''
    """Purpose of the scene, and where its numbers come from."""
    gravity: Gravity = (0.0, 0.0)
    """Acceleration along x and along y."""
    axial_gravity: Acceleration = 0.0
    """Towards the reader, of links that move along their axes."""
    duration: Duration | None = None
    """Length of a run if none is given; without it the turns that bring all again."""
    start: Literal['seated', 'centred'] = 'seated'
    """Where loose pins start: pressed on their bushings as by an ideal joint, or in the middle."""
    outputs: Outputs = Outputs()
    """Published outputs, and how often."""
    solver: Solver = Solver()
    """Tolerances of the solution."""
    oscillators: dict[str, Frame] = {}
    """Frames on springs that the machine excites, by name."""
    tables: dict[str, TablePart] = {}
    """Curves through points, by the names by which formulas call them, as in press(ram)."""
    measures: dict[str, str] = {}
    """Measures of a run by name, as largest(reaction.pin) or rms(drive_torque, from 2 s)."""

    other_words = {
        **dict.fromkeys(
            ('brake', 'brakes'),
            'loads: {NAME: {at: LINK, torque: -2 N m*sign(LINK_rate)}}, of dry friction',
        ),
        'g': "'gravity', as in gravity: [0, -9.81 m/s^2]",
        'bodies': "'links'",
        'constraints': "'joints'",
        'start': "'initial', as in initial: {position: {LINK: 30 deg}}",
    }

    def to_yaml(self) -> str:
        """The scene as a file gives it, which means the same to the last bit."""
        return yaml_text(self)

    @model_validator(mode='before')
    @classmethod
    def _seat_sensors(cls, data: Any) -> Any:
        """Sensors at named points."""
        return seated(data) if isinstance(data, dict) else data


class Linkage(AnyScene):
    """Keys of a scene that names its links and joints, but for its loads."""

    mechanism: Literal['linkage'] = 'linkage'
    """Written out: links and joints have the names given here."""
    links: dict[str, LinkPart]
    """Lengths, points and masses by name; ground is the frame."""
    joints: dict[str, JointPart]
    """Between points of two links, LINK.POINT, by name."""
    gears: dict[str, GearPart] = {}
    """Teeth that links carry, by name, for joints of the kind mesh."""
    masses: dict[str, PointMass] = {}
    """Point masses that links carry, by name."""
    drive: DrivePart | None = None
    """Main drive; revolutions are turns of this link."""
    drives: dict[str, DrivePart] = {}
    """Further drives, by link."""
    guess: dict[str, _StartPlace] = {}
    """Rough angles and displacements by link, places [x, y] of points by LINK.POINT, which choose
    how loops are closed."""
    initial: InitialPart = InitialPart()
    """Coordinates whose initial values differ from those of drive and guess."""
    sensors: dict[str, SensorPart] = Field({})
    """Accelerometers, encoders and others, by name."""

    @property
    def rough(self) -> dict[str, QuantityValue]:
        """Values of `guess` for links, without places of points."""
        return {c: x for c, x in self.guess.items() if isinstance(x, QuantityValue)}


LOAD_SECTIONS = tuple(LOADS.values())


class Scene(*LOAD_SECTIONS, Linkage, metaclass=PartMaker):  # type: ignore[misc]
    """A scene that names its links and joints.

    In Python it is made of parts or of dictionaries; numbers are in SI units, text has units.

    >>> import mechanism_sim as ms
    >>> bar = ms.LinkPart(length='1 m', mass=1.2, inertia=0.1, cog='50 cm')
    >>> pivot = ms.JointPart(revolute=['ground', 'bar'])
    >>> scene = ms.Scene(title='A bar', links={'bar': bar}, joints={'pivot': pivot},
    ...                  gravity=[0, '-1 g'], initial={'position': {'bar': '30 deg'}})
    >>> ms.simulate(scene, duration='2 s')
    <Solution of scene (smooth dynamics): 2 s in 26 steps, 0 impacts>
    >>> ms.load_scene(scene.to_yaml()).scene == scene
    True
    """
