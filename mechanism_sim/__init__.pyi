"""Public names for editors and type checkers, written by `python docs/signatures.py`."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol, TypeAlias

from mechanism_sim.keys.quantities import Part
from mechanism_sim.scene import schema as _schema
from mechanism_sim.report.shown import animate as animate
from mechanism_sim.studies.basins import basins as basins
from mechanism_sim.studies.bifurcation import bifurcation as bifurcation
from mechanism_sim.studies.continuation import branches as branches
from mechanism_sim.results.cycle import cycle as cycle
from mechanism_sim.report.shown import draw as draw
from mechanism_sim.studies.ensemble import ensemble as ensemble
from mechanism_sim.report.typeset import equations as equations
from mechanism_sim.pages.notebook import explore as explore
from mechanism_sim.studies.find import find as find
from mechanism_sim.studies.four_bars import find_four_bars as find_four_bars
from mechanism_sim.studies.life import life as life
from mechanism_sim.scene.load import load_scene as load_scene
from mechanism_sim.studies.lyapunov import lyapunov as lyapunov
from mechanism_sim.analysis.measure import measure as measure
from mechanism_sim.analysis.open_run import open_run as open_run
from mechanism_sim.pages.notebook import play as play
from mechanism_sim.report.shown import plot as plot
from mechanism_sim.pages.writing import report as report
from mechanism_sim.catalogue import scene_names as scene_names
from mechanism_sim.results.simulate import simulate as simulate
from mechanism_sim.results.simulate import stream as stream
from mechanism_sim.studies.sweep import sweep as sweep

class _HasUnits(Protocol):
    def to_base_units(self) -> Any: ...

Quantity: TypeAlias = float | str | _HasUnits
"""A number in SI units, text with a unit, or a quantity of pint."""
__version__: str

def __getattr__(name: str) -> Any: ...

class DrivePart(_schema.DrivePart):
    """Motion of a coordinate by position, speed, moves, a torque, a force, or a motor."""

    def __init__(
        self,
        *,
        coordinate: str | None = ...,
        speed: Part | Mapping[str, Any] | Quantity | None = ...,
        acceleration: Quantity | None = ...,
        position: Part | Mapping[str, Any] | Quantity | None = ...,
        moves: Part | Mapping[str, Any] | None = ...,
        swing: Part | Mapping[str, Any] | None = ...,
        profile: Part | Mapping[str, Any] | Quantity | None = ...,
        torque: Part | Mapping[str, Any] | Quantity | None = ...,
        force: Part | Mapping[str, Any] | Quantity | None = ...,
        motor: Part | Mapping[str, Any] | None = ...,
        commands: Part | Mapping[str, Any] | None = ...,
        effort: Quantity | None = ...,
        flywheel: Quantity | None = ...,
        start_angle: Quantity | None = ...,
        start_position: Quantity | None = ...,
    ) -> None:
        r"""
        coordinate : The driven link; the crank if there is one of that name.
        speed : Constant, or over time: a formula of t, or points; with a torque, a force or a motor that at the start. [rad/s or m/s or a formula of t, or points]
        acceleration : Constant, with the speed at the start. [rad/s^2 or m/s^2]
        position : Over time, instead of speeds: a formula of t, as "90 deg + 60 deg*sin(pi*t)", or points.
        moves : Moves from rest to rest, as fast as limits allow, instead of speeds.
        swing : Oscillation between the limits of the linkage, as a sine of time.
        profile : Speeds over time, as `speed` takes them, too.
        torque : On a link that turns: an affine law of angle and speed; {} moves freely.
        force : On a link that slides: an affine law of displacement and speed; {} moves freely.
        motor : A motor with its characteristic, instead of a torque.
        commands : Accept speed commands while the machine runs.
        effort : Torque or force of the drive, a quantity or a formula, where its motion is prescribed. [N m or N or a formula]
        flywheel : Inertia that turns with the link. [kg m^2, >= 0]
        start_angle : Of a link that turns, at t = 0; else that of `guess`, or 0. [rad]
        start_position : Of a link that slides, at t = 0; else that of `guess`, or 0. [m]
        """

class JointPart(_schema.JointPart):
    """A joint between points of two links: of one kind."""

    def __init__(
        self,
        *,
        clearance: Part | Mapping[str, Any] | None = ...,
        friction: Part | Mapping[str, Any] | None = ...,
        phase: Quantity | None = ...,
        carrier: str | None = ...,
        teeth: Any = ...,
        pressure_angle: Quantity | None = ...,
        facing: Quantity | None = ...,
        along: Quantity | None = ...,
        worm: Any = ...,
        diameter: Quantity | None = ...,
        lead_angle: Quantity | None = ...,
        hand: Literal['left', 'right'] | None = ...,
        transmission: Any = ...,
        ratio: Quantity | None = ...,
        backlash: Part | Mapping[str, Any] | None = ...,
        stops: Part | Mapping[str, Any] | None = ...,
        axis: Quantity | None = ...,
        slot: Any = ...,
        rotor: Any = ...,
        supports: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        shaft: Part | Mapping[str, Any] | None = ...,
        disks: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        diametral_inertia: Quantity | None = ...,
        external_damping: Quantity | None = ...,
        drives: Literal['counterclockwise', 'clockwise'] | None = ...,
        restitution: Quantity | None = ...,
        hypothesis: Literal['newton', 'poisson', 'stronge'] | None = ...,
        compliance: Part | Mapping[str, Any] | None = ...,
        rope: Any = ...,
        length: Quantity | None = ...,
        pulleys: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        revolute: Any = ...,
        bearings: Any = ...,
        locating: str | None = ...,
        ratchet: Any = ...,
        rack: Any = ...,
        pitch: Quantity | None = ...,
        prismatic: Any = ...,
        angle: Quantity | None = ...,
        mesh: Any = ...,
        elasticity: Part | Mapping[str, Any] | None = ...,
        error: Part | Mapping[str, Any] | None = ...,
        geneva: Any = ...,
        slots: Any = ...,
        freewheel: Any = ...,
        fixed: Any = ...,
        contact: Any = ...,
        radii: Quantity | None = ...,
        to: str | None = ...,
        cam: Any = ...,
        follower: Literal['knife', 'roller', 'flat'] | None = ...,
        base_radius: Quantity | None = ...,
        roller: Quantity | None = ...,
        tilt: Quantity | None = ...,
        face: Quantity | None = ...,
        side: Literal['left', 'right'] | None = ...,
        sense: Literal['counterclockwise', 'clockwise'] | None = ...,
        law: Part | Mapping[str, Any] | None = ...,
        lift_off: Part | Mapping[str, Any] | None = ...,
        groove: Part | Mapping[str, Any] | None = ...,
        bevel: Any = ...,
        module: Quantity | None = ...,
        face_width: Quantity | None = ...,
        shaft_angle: Quantity | None = ...,
        belt: Any = ...,
        crossed: bool | None = ...,
        stiffness: Quantity | None = ...,
        damping: Quantity | None = ...,
        pretension: Quantity | None = ...,
        arc_slot: Any = ...,
        radius: Quantity | None = ...,
    ) -> None:
        r"""
        clearance : Pin on the first-named link, loose in the second; without it the joint is ideal.
        friction : Of an ideal joint; a loose one has its own in its clearance.
        phase : Angle of the cam, or of the second link of a transmission, when the first is at 0. [rad]
        carrier : Link that carries both shafts; the ground if not given.
        teeth : Of a bevel pair; of a worm pair threads of the worm and teeth of the wheel; of a ratchet one number, those on a turn. Required.
        pressure_angle : Of a bevel pair; of a worm pair in the plane normal to the thread; 20 deg without it. [rad]
        facing : Direction from the shaft of each of such a pair to its mate; 0 and 180 deg if not given. [rad]
        along : Where both of such a pair lie along their shafts; in the plane of the machine without it. [m]
        worm : Links of a worm and of its wheel.
        diameter : Pitch diameter of a worm; required. [m, > 0]
        lead_angle : Of a worm's thread, which is the helix angle of its wheel; required. [rad]
        hand : Of a worm, right without it: then its wheel turns the same way, each seen on its axis. [left or right]
        transmission : Two links that turn, or slide, at a fixed ratio, by whatever means: a box, a taut rope.
        ratio : Of a transmission, required: speed of the second over the first, as -3/7.
        backlash : Backlash of teeth, or between the stops of a transmission, as of dogs on coaxial shafts; without it they stay in contact.
        stops : Limits of its angle or displacement, with impacts and contact there.
        axis : Direction of sliding: in the first link of a prismatic joint, in the second's slot. [rad]
        slot : A pin at the first point, in a slot of the second link.
        rotor : The ground where the axis is at rest, and the disk's middle.
        supports : Of a rotor, by name; required.
        shaft : Of a rotor that bends; without it the shaft is rigid.
        disks : Of a rotor, those beside the link's own, by name.
        diametral_inertia : Of a rotor's disk about a diameter; without it the disk's tilt has no inertia. [kg m^2, >= 0]
        external_damping : Of a rotor, at the disk. [N s/m or a pair along x and y]
        drives : Of a freewheel or ratchet: how the first turns where it takes the second along, counterclockwise without it. Of links that slide that is along their guides. [counterclockwise or clockwise]
        restitution : Of a contact, ratchet or rope, its coefficient of restitution, 0 without a bounce, 1 loses nothing. [0 to 1]
        hypothesis : Of the same, quantities that the coefficient relates: speeds (without it), impulses or works. [newton, poisson or stronge]
        compliance : Of the same, a law of force instead of rigid surfaces; of a rope, how it stretches.
        rope : A rope through points in this order: fixed to the first and the last, free in between. It pulls, or hangs slack, and tightens with an impact.
        length : Of a rope; without it that of its way at the start. [m, > 0]
        pulleys : Of a rope: pulleys at its points, by their names, or drums at its ends, on which it is wound as their links turn; others have no radius.
        revolute : A pin: two points that coincide.
        bearings : The two bearings of a shaft, by name: where they lie along it, as `along` of its gears. [m]
        locating : The bearing that takes forces along the shaft; required with bearings.
        ratchet : Two links on one axis, as of a freewheel, that hold each other by teeth and a pawl.
        rack : A pin at the first point, and a slotted rack; one slot is at the second. The pin moves the rack while it is on that slot point's side of the centre of its circle.
        pitch : Of the slots of a rack; required for it. [m, > 0]
        prismatic : A guide: the second point slides along `axis` through the first.
        angle : Of the second link in the first. [rad]
        mesh : Two gears, by their names; a rack is named second.
        elasticity : Compliance of the teeth.
        error : Transmission error along the line of action, zero at the start.
        geneva : A pin at the first point, and a Geneva wheel pivoted at the second.
        slots : Of a Geneva wheel; required for it. [whole number, 3 to 24]
        freewheel : Two links on one axis: the first takes the second along one way, and is overrun by it.
        fixed : Two points that coincide, of links that do not turn against each other: a weld.
        contact : Centres of two discs, each a point of a link, in unilateral contact.
        radii : Radii of the first and the second pulley, to the middle of the belt; required. [m]
        to : Of a contact, another point LINK.POINT of its second link; from disc to disc between both points there is a bar, with the second radius as half of its thickness.
        cam : A cam's link, and the point of its follower.
        follower : Its tip; required for a cam. [knife, roller or flat]
        base_radius : Of the cam's base circle, without the roller; required, but for a profile. [m, > 0]
        roller : Radius of the roller; required for one. [m, >= 0]
        tilt : Of a face that slides: from the motion to its normal, counterclockwise. [rad]
        face : Of a face that swings: how far beyond the line from pivot to point. [m]
        side : Where a swinging arm is, seen from the camshaft; required for one. [left or right]
        sense : In which the cam's angle counts; counterclockwise without it. [counterclockwise or clockwise]
        law : Displacement of the follower over the angle of the cam; required.
        lift_off : The follower may leave the cam and meet it again in impacts; without it the cam holds it.
        groove : A groove holds the roller from both sides.
        bevel : Two links with bevel gears, which turn in opposite senses; axes point away from the apex.
        module : Module of a bevel pair, at the back cone; required. [m, > 0]
        face_width : Length of the teeth of a bevel pair; the force acts in their middle; required. [m, >= 0]
        shaft_angle : Angle between the axes of a bevel pair; 90 deg if not given. [rad]
        belt : Centres of the two pulleys or chain wheels.
        crossed : True if the strands cross, so that the pulleys turn in opposite directions. [true or false]
        stiffness : Stiffness of each strand; without it the belt is ideal. [N/m, > 0]
        damping : Damping of each strand while it is taut. [N s/m, >= 0]
        pretension : In each strand at the start, or on the mean of both where friction holds the belt; 0 for a chain, of which one strand pulls at a time. [N, >= 0]
        arc_slot : A pin at the first point, in a slot of the second link whose centre is the second point.
        radius : Of the centre line of such a slot; required for it. [m, > 0]
        """

class LinkPart(_schema.LinkPart):
    """A link: its points and mass properties."""

    def __init__(
        self,
        *,
        length: Quantity | None = ...,
        points: Any = ...,
        mass: Quantity | None = ...,
        inertia: Quantity | None = ...,
        cog: Quantity | None = ...,
        elastic: Part | Mapping[str, Any] | None = ...,
        tilt: Part | Mapping[str, Any] | None = ...,
    ) -> None:
        r"""
        length : Makes the point `end` at [length, 0]. [m, > 0]
        points : Further points by name, as [x, y] in the link's frame. [m]
        mass : For all moving links or for none; forces and clearances need it. 0 kg is allowed. [kg, >= 0]
        inertia : About the centre of gravity; 0 for a point mass. [kg m^2, >= 0]
        cog : Centre of gravity: along the link, or as [x, y] in its frame. [m or a pair [x, y]]
        elastic : Elasticity; the link is rigid if not given.
        tilt : Tilt out of its plane; it stays in the plane if not given.
        """

class Scene(_schema.Scene):
    """A scene that names its links and joints."""

    def __init__(
        self,
        *,
        links: Mapping[str, LinkPart | Mapping[str, Any]],
        joints: Mapping[str, JointPart | Mapping[str, Any]],
        title: str | None = ...,
        description: str | None = ...,
        gravity: Any = ...,
        axial_gravity: Quantity | None = ...,
        duration: Quantity | None = ...,
        start: Literal['seated', 'centred'] | None = ...,
        outputs: Part | Mapping[str, Any] | None = ...,
        solver: Part | Mapping[str, Any] | None = ...,
        oscillators: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        tables: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        measures: Any = ...,
        mechanism: Literal['linkage'] | None = ...,
        gears: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        masses: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        drive: DrivePart | Mapping[str, Any] | None = ...,
        drives: Mapping[str, DrivePart | Mapping[str, Any]] | None = ...,
        guess: Any = ...,
        initial: Part | Mapping[str, Any] | None = ...,
        sensors: Mapping[str, SensorPart | Mapping[str, Any]] | None = ...,
        bushings: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        loads: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        servos: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        springs: Mapping[str, Part | Mapping[str, Any]] | None = ...,
        states: Mapping[str, Part | Mapping[str, Any]] | None = ...,
    ) -> None:
        r"""
        links : Lengths, points and masses by name; ground is the frame.
        joints : Between points of two links, LINK.POINT, by name.
        title : One line for lists; the name of the file if there is none.
        description : Purpose of the scene, and where its numbers come from.
        gravity : Acceleration along x and along y. [m/s^2]
        axial_gravity : Towards the reader, of links that move along their axes. [m/s^2]
        duration : Length of a run if none is given; without it the turns that bring all again. [s, > 0]
        start : Where loose pins start: pressed on their bushings as by an ideal joint, or in the middle. [seated or centred]
        outputs : Published outputs, and how often.
        solver : Tolerances of the solution.
        oscillators : Frames on springs that the machine excites, by name.
        tables : Curves through points, by the names by which formulas call them, as in press(ram).
        measures : Measures of a run by name, as largest(reaction.pin) or rms(drive_torque, from 2 s).
        mechanism : Written out: links and joints have the names given here.
        gears : Teeth that links carry, by name, for joints of the kind mesh.
        masses : Point masses that links carry, by name.
        drive : Main drive; revolutions are turns of this link.
        drives : Further drives, by link.
        guess : Rough angles and displacements by link, places [x, y] of points by LINK.POINT, which choose how loops are closed. [rad or m or [x, y] of a point in m]
        initial : Coordinates whose initial values differ from those of drive and guess.
        sensors : Accelerometers, encoders and others, by name.
        bushings : Elastic bearings between points that coincide, by name.
        loads : Forces and torques on links, by name.
        servos : Controllers of angles and lengths, by name.
        springs : With their dampers, by name.
        states : Of first order: what has a rate but no inertia, by the names by which formulas know them.
        """

class SensorPart(_schema.SensorPart):
    """A sensor: of one kind."""

    def __init__(
        self,
        *,
        kind: str | None = ...,
        sample_rate: Quantity | None = ...,
        trigger: Part | Mapping[str, Any] | None = ...,
        amplifier: Part | Mapping[str, Any] | None = ...,
        anti_alias: Part | Mapping[str, Any] | None = ...,
        adc: Part | Mapping[str, Any] | None = ...,
        noise: Part | Mapping[str, Any] | None = ...,
        impact_pulse: Quantity | None = ...,
        link: str | None = ...,
        relative_to: str | None = ...,
        pulses: Any = ...,
        at: Quantity | None = ...,
        joint: str | None = ...,
        direction: Quantity | None = ...,
        lines: Any = ...,
        index: Quantity | None = ...,
        between: Any = ...,
        axis: Quantity | None = ...,
        instrument: str | None = ...,
        gravity: bool | None = ...,
        transducer: Part | Mapping[str, Any] | None = ...,
        quantity: Literal['acceleration', 'velocity', 'displacement'] | None = ...,
        integrator: Part | Mapping[str, Any] | None = ...,
        imu: bool | None = ...,
    ) -> None:
        r"""
        kind : Kind of sensor.
        sample_rate : In simulated time. [Hz, > 0]
        trigger : Blocks that begin at an angle of the drive; {} is enough.
        amplifier : Its filters.
        anti_alias : The filter before sampling.
        adc : Analogue-to-digital converter.
        noise : Noise added to the samples.
        impact_pulse : Duration of an impact, as half a sine; impulses if not given. [s, > 0]
        link : Required: the moving link that carries it; of an accelerometer also a frame on springs.
        relative_to : The link that carries its head.
        pulses : Pulses per turn: marks at equal angles, one on the link's x axis. [whole number, 1 to 1000]
        at : From the link's origin: along the link, as [x, y] in its frame, or a point of it by name. [m or a pair [x, y]]
        joint : Required: the joint it is in.
        direction : Of what it reads, in the frame of the joint's second link; 0: along that link. [rad]
        lines : Lines per turn; four counts each. [whole number, 1 to 1e+06]
        index : Angle of the index line: counts are from there once it has passed, else from the start. [rad]
        between : Required: the points, LINK.POINT, between which its wire is taut.
        axis : Direction of its reading: along the link, 90 degrees counterclockwise from that, or another angle from the link's x axis. [rad or along or across]
        instrument : A preset; keys given here replace its parts.
        gravity : True if it senses acceleration less that of gravity. [true or false]
        transducer : The seismic mass.
        quantity : Quantity of the samples: integrated never, once or twice. [acceleration, velocity or displacement]
        integrator : The integrating circuit; only where something is integrated.
        imu : True to publish it as sensor_msgs/Imu, too. [true or false]
        """
