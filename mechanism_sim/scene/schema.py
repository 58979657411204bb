"""What a scene file may say: every key, its unit, its bounds and its default."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mechanism_sim.scene.oscillator_keys import Oscillator
from mechanism_sim.scene.quantities import (
    POSITIVE,
    AddedInertia,
    Angle,
    AngularAcceleration,
    Coefficient,
    Displacement,
    Duration,
    Friction,
    Gravity,
    Inertia,
    Length,
    Mass,
    Part,
    Position,
    Radius,
    Rate,
    Speed,
    Time,
    Tolerance,
    Torque,
    TorquePerAngle,
    TorquePerSpeed,
    si,
)
from mechanism_sim.scene.sensor_keys import Sensor


class Link(Part):
    """A link between two joints; mass properties only where forces are wanted."""

    length: Length
    """Distance of the link's two joints."""
    mass: Mass | None = None
    """For all moving links or for none; forces and clearances need it."""
    inertia: Inertia | None = None
    """About the centre of gravity."""
    cog: Position | None = None
    """Centre of gravity from the proximal joint, along the link."""


class Ground(Part):
    """The frame: the distance of its two joints."""

    length: Length
    """Distance of the two joints of the frame."""


class FourBarLinks(Part):
    """The links of a four-bar."""

    ground: Ground
    """The frame."""
    crank: Link
    """The driven link, from ground_crank to crank_coupler."""
    coupler: Link
    """From crank_coupler to coupler_rocker."""
    rocker: Link
    """From rocker_ground to coupler_rocker."""


class Contact(Part):
    """A compliant contact: a law of force instead of a rigid one."""

    law: Literal['hertz', 'hunt_crossley', 'lankarani_nikravesh', 'flores', 'film']
    """Hertz without loss, three laws with loss by impact, or an oil film."""
    stiffness: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None
    """In N/m^exponent; required but for a film."""
    exponent: Annotated[float, Field(ge=1.0, le=3.0)] = 1.5
    """Of the depth."""
    viscosity: Annotated[float, si('Pa s'), POSITIVE] | None = None
    """Of the oil; required for a film."""
    width: Length | None = None
    """Of the bearing along its axis; required for a film."""
    radius: Length | None = None
    """Of the journal; required for a film."""


class Play(Part):
    """How loose a joint is, and what its contacts are like."""

    radial: Displacement
    """How far it can move from the middle; 0 for a contact that only lifts off."""
    restitution: Coefficient
    """Coefficient of restitution: 0 does not bounce, 1 loses nothing."""
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    """What the coefficient relates: speeds, impulses or works; without friction the same."""
    friction: Friction = 0.0
    """Coulomb's coefficient, in impacts and in following."""
    pin_radius: Radius = 0.0
    """The arm of friction; only with friction."""
    contact: Contact | None = None
    """A law of force instead of a rigid contact; for all loose joints or for none."""


class Clearance(Play):
    """A pin on the first-named link, loose in a bushing on the second-named one."""

    radial: Length
    """Radius of the circle in which the pin's centre can move."""


class Joint(Part):
    """What distinguishes a joint from an ideal one."""

    clearance: Clearance | None = None
    """Pin on the first-named link, bushing on the second-named; without it the joint is ideal."""


class FourBarJoints(Part):
    """The joints of a four-bar."""

    ground_crank: Joint = Joint()
    """The crank's bearing in the frame."""
    crank_coupler: Joint = Joint()
    """The crank pin."""
    coupler_rocker: Joint = Joint()
    """The pin between coupler and rocker."""
    rocker_ground: Joint = Joint()
    """The rocker's bearing in the frame."""


class Profile(Part):
    """Speeds at given times, joined by ramps; the last one stays."""

    points: list[tuple[Time, Speed]] = Field(min_length=1)
    """List of [time, speed]; before the first and after the last the speed stays."""
    ramp: Literal['linear', 'smooth'] = 'linear'
    """Between two points; smooth has no jumps of acceleration."""


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


class Drive(Part):
    """What moves the crank: a speed, a profile of speeds, a torque, or a motor."""

    coordinate: Literal['crank'] = 'crank'
    """The driven link."""
    speed: Speed | None = None
    """Constant; with a torque or a motor that at the start. Counterclockwise is positive."""
    profile: Profile | None = None
    """Speeds over time, instead of a constant one."""
    torque: AffineTorque | None = None
    """An affine law of angle and speed, instead of a speed; {} is a free crank."""
    motor: Motor | None = None
    """A direct-current motor, instead of a torque."""
    commands: Commands | None = None
    """Take commands of speed while the machine runs."""
    flywheel: AddedInertia = 0.0
    """Inertia that turns with the crank."""
    start_angle: Angle = 0.0
    """Of the crank at t = 0."""


class FourBarAngles(Part):
    """Angles set outright."""

    crank: Angle | None = None
    """Instead of drive.start_angle."""
    coupler: Angle | None = None
    """Instead of what `start` says."""
    rocker: Angle | None = None
    """Instead of what `start` says."""


class FourBarSpeeds(Part):
    """Angular velocities set outright; the crank starts with that of its drive."""

    coupler: Speed | None = None
    """Instead of what `start` says."""
    rocker: Speed | None = None
    """Instead of what `start` says."""


class Initial(Part):
    """Coordinates that do not start where `start` would put them."""

    position: FourBarAngles = FourBarAngles()
    """Angles, counterclockwise from the x axis."""
    velocity: FourBarSpeeds = FourBarSpeeds()
    """Angular velocities; the crank starts with that of its drive."""


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


class FourBarScene(AnyScene):
    """A scene from the four-bar template."""

    mechanism: Literal['four_bar']
    """A template: links and joints have these names."""
    branch: Literal['open', 'crossed'] = 'open'
    """Where the coupler-rocker joint lies, seen from crank pin to rocker pivot; open: left."""
    links: FourBarLinks
    """What they measure and weigh."""
    joints: FourBarJoints = FourBarJoints()
    """Those that are not ideal."""
    drive: Drive
    """What moves the crank: a speed, a profile, a torque or a motor."""
    initial: Initial = Initial()
    """Coordinates of a loose machine that start elsewhere than `start` says."""
    sensors: dict[str, Sensor] = Field({})
    """Accelerometers, by name."""
