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
    mass: Mass | None = None
    inertia: Inertia | None = None  #: about the centre of gravity
    cog: Position | None = None  #: from the proximal joint, along the link


class Ground(Part):
    """The frame: the distance of its two joints."""

    length: Length


class FourBarLinks(Part):
    """The links of a four-bar."""

    ground: Ground
    crank: Link
    coupler: Link
    rocker: Link


class Contact(Part):
    """A compliant contact: a law of force instead of a rigid one."""

    law: Literal['hertz', 'hunt_crossley', 'lankarani_nikravesh', 'flores', 'film']
    stiffness: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = (
        None  #: [N/m^exponent]
    )
    exponent: Annotated[float, Field(ge=1.0, le=3.0)] = 1.5
    creep_speed: Annotated[float, si('m/s'), POSITIVE] = 1e-3  #: of smoothed friction
    viscosity: Annotated[float, si('Pa s'), POSITIVE] | None = None  #: of the oil
    width: Length | None = None  #: of the bearing along its axis
    radius: Length | None = None  #: of the journal


class Play(Part):
    """How loose a joint is, and what its contacts are like."""

    radial: Displacement  #: from the middle of the play; 0 for a contact that only lifts off
    restitution: Coefficient
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    friction: Friction = 0.0
    pin_radius: Radius = 0.0
    contact: Contact | None = None  #: without one the contact is rigid


class Clearance(Play):
    """A pin on the first-named link, loose in a bushing on the second-named one."""

    radial: Length


class Joint(Part):
    """What distinguishes a joint from an ideal one."""

    clearance: Clearance | None = None


class FourBarJoints(Part):
    """The joints of a four-bar."""

    ground_crank: Joint = Joint()
    crank_coupler: Joint = Joint()
    coupler_rocker: Joint = Joint()
    rocker_ground: Joint = Joint()


class Profile(Part):
    """Speeds at given times, joined by ramps; the last one stays."""

    points: list[tuple[Time, Speed]] = Field(min_length=1)
    ramp: Literal['linear', 'smooth'] = 'linear'  #: smooth: no jumps of acceleration


class AffineTorque(Part):
    """``constant + per_angle * angle + per_speed * speed``; all zero is a free crank."""

    constant: Torque = 0.0
    per_angle: TorquePerAngle = 0.0
    per_speed: TorquePerSpeed = 0.0


class Motor(Part):
    """The straight line of a direct-current motor."""

    stall_torque: Torque
    no_load_speed: Speed


class Commands(Part):
    """Which speeds may be commanded while the machine runs."""

    acceleration: AngularAcceleration  #: of the ramp to a commanded speed
    fastest: Annotated[Speed, POSITIVE]  #: the largest that is taken, either way


class Drive(Part):
    """What moves the crank: a speed, a profile of speeds, a torque, or a motor."""

    coordinate: Literal['crank'] = 'crank'
    speed: Speed | None = None  #: with a torque or a motor the speed at the start
    profile: Profile | None = None
    torque: AffineTorque | None = None
    motor: Motor | None = None
    commands: Commands | None = None
    flywheel: AddedInertia = 0.0  #: inertia that turns with the crank
    start_angle: Angle = 0.0


class FourBarAngles(Part):
    """Angles set outright."""

    crank: Angle | None = None
    coupler: Angle | None = None
    rocker: Angle | None = None


class FourBarSpeeds(Part):
    """Angular velocities set outright; the crank starts with that of its drive."""

    coupler: Speed | None = None
    rocker: Speed | None = None


class Initial(Part):
    """Coordinates that do not start where `start` would put them."""

    position: FourBarAngles = FourBarAngles()
    velocity: FourBarSpeeds = FourBarSpeeds()


class Outputs(Part):
    """What is published, and how often in simulated time."""

    forces: bool = True  #: reactions, torques and energies
    joint_states: Rate = 100.0
    linkage_state: Rate = 100.0
    joint_reactions: Rate = 100.0
    transforms: Rate = 50.0
    markers: Rate = 50.0  #: of forces, in the display
    part_states: Rate = 100.0  #: of each cam, pair of gears, Geneva wheel and oscillator


class Solver(Part):
    """How exact the solution is to be."""

    rtol: Tolerance = 1e-12  #: error of a step relative to a tenth of the crank's speed
    atol: Displacement = 0.0  #: left out when chatter is ended, see `ChatterRule`


class AnyScene(Part):
    """What scenes of every kind say."""

    title: str
    description: str = ''
    gravity: Gravity = (0.0, 0.0)
    duration: Duration | None = None  #: of a run of which no length is asked; else a revolution
    start: Literal['seated', 'centred'] = 'seated'
    outputs: Outputs = Outputs()
    solver: Solver = Solver()
    oscillators: dict[str, Oscillator] = {}


class FourBarScene(AnyScene):
    """A scene from the four-bar template."""

    mechanism: Literal['four_bar']
    branch: Literal['open', 'crossed'] = 'open'
    links: FourBarLinks
    joints: FourBarJoints = FourBarJoints()
    drive: Drive
    initial: Initial = Initial()
    sensors: dict[str, Sensor] = Field({})
