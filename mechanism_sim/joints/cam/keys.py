"""Keys of a cam, from which its law, its follower and the joint of both are made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam import curves
from mechanism_sim.joints.cam.constraint import CamPair, GroovePair
from mechanism_sim.joints.cam.followers import (
    FlatFaced,
    Follower,
    Oscillating,
    OscillatingFlat,
    Translating,
)
from mechanism_sim.joints.cam.interference import find_cut_away
from mechanism_sim.joints.cam.laws import (
    TURN,
    Diagram,
    Eccentric,
    Law,
    MeasuredLaw,
    Piecewise,
    Raised,
    Segment,
    check_smoothness,
    spelled,
)
from mechanism_sim.joints.cam.outlines import CamOutline, Edge, Radii, edge_cam, nose_cam
from mechanism_sim.joints.cam.profiles import Cam, drawing_angles, find_flaws
from mechanism_sim.joints.cam.sheet import CamParts
from mechanism_sim.joints.contact_keys import ClearanceSpec, Contact, Friction, clearance_spec_of
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.transmission.keys import PhaseKeys
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import (
    FROM_FILE,
    Angle,
    AnyPosition,
    Coefficient,
    Displacement,
    Hypothesis,
    Length,
    Part,
    Position,
    Radius,
    si_of,
)
from mechanism_sim.keys.quantities import Friction as FrictionCoefficient
from mechanism_sim.numerics.sampled import describe_peaks, determined
from mechanism_sim.planar.joint_friction import ContactFriction
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import GROUND, Vector2, rotate
from mechanism_sim.units import QuantityValue

Frame: TypeAlias = tuple[Vector2, float, Literal[1, -1]]
"""Centre [m], direction [rad] and sense of a `CamPair`."""

Rise = Annotated[QuantityValue, si_of('m', 'rad')]
"""A displacement of the follower: an angle if it swings."""

_WAYS = 'segments', 'points', 'eccentric', 'tangent', 'arcs', 'profile'

Curve = Literal[
    'cycloidal',
    'harmonic',
    'half_harmonic',
    'four_spline',
    'modified_trapezoid',
    'modified_sine',
    'polynomial_345',
    'polynomial_4567',
    'constant_acceleration',
    'polynomial',
    'spline',
]


_UNIFORM = (
    "'polynomial' with 'conditions' on the velocity at both ends, where the speed jumps, or "
    "'points' of the law with 'degree: 1'"
)


class ConditionPart(Part):
    """Conditions on a polynomial at a place of its segment."""

    at: AnyPosition
    """Position within the segment, counted as `from` and `to`."""
    lift: Rise | None = None
    """Displacement of the follower since the beginning of the segment."""
    velocity: Rise | None = None
    """Derivative of the displacement by the angle, such as 5 mm/rad."""
    acceleration: Rise | None = None
    """Second derivative."""
    jerk: Rise | None = None
    """Third derivative."""


class SegmentPart(Part):
    """A rise, a return or, with no rise, a dwell over an interval of the cam angle.

    Of a cam that slides: of its displacement.
    """

    begin: AnyPosition = Field(alias='from')
    """Angle of the cam, or its displacement if it slides."""
    end: AnyPosition = Field(alias='to')
    """Likewise."""
    rise: Rise = QuantityValue(0.0, '')
    """Of the follower, negative for a return; 0 is a dwell."""
    curve: Curve = 'cycloidal'
    """Law of the segment."""
    conditions: tuple[ConditionPart, ...] = ()
    """Conditions of a polynomial, of degree one less than their number with those at both ends."""
    points: tuple[tuple[float, float], ...] = ()
    """Points of a spline, from [0, 0] to [1, 1]."""
    ends: Literal['clamped', 'natural', 'not-a-knot'] = 'clamped'
    """Of a spline."""

    other_words: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(('simple_harmonic', 'SHM', 'cosine', 'sinusoidal'), "'harmonic'"),
        **dict.fromkeys(('sinoide', 'bestehorn', 'bestehorn_sinoide'), "'cycloidal'"),
        **dict.fromkeys(('parabolic', 'quadratic'), "'constant_acceleration'"),
        **dict.fromkeys(('3-4-5', 'poly345', 'quintic'), "'polynomial_345'"),
        **dict.fromkeys(('4-5-6-7', 'poly4567'), "'polynomial_4567'"),
        **dict.fromkeys(('linear', 'constant_velocity', 'uniform'), _UNIFORM),
    }

    @model_validator(mode='after')
    def _points_make_a_spline(self) -> SegmentPart:
        if bool(self.points) != (self.curve == 'spline'):
            raise ValueError(
                "needs 'points' from [0, 0] to [1, 1] if its curve is a spline, and only then"
            )
        if bool(self.conditions) != (self.curve == 'polynomial'):
            raise ValueError(
                "needs 'conditions', such as {at: 0 deg, velocity: 0}, if its curve is "
                "'polynomial', and only then"
            )
        return self


class NosePart(Part):
    """A cam of a base circle and a round nose, joined by tangents."""

    nose: Length
    """Radius of the nose."""
    lift: Length
    """Height of the nose above the base circle."""
    at: Angle | None = None
    """Angle of the cam at the nose; if not given, the rise begins at 0."""


class FlankPart(NosePart):
    """A cam of a base circle and a round nose, joined by arcs."""

    flank: Position
    """Radius of the flanks; negative if they are concave."""


Point = tuple[Position, Position]


class EdgePart(Part):
    """A line, or an arc counterclockwise from one angle to another, as it is drawn."""

    line: tuple[Point, Point] | None = None
    """Its ends, in the frame of the cam's link."""
    arc: Point | None = None
    """Its centre, in the frame of the cam's link."""
    radius: Length | None = None
    """Of the arc."""
    begin: Angle = Field(0.0, alias='from')
    """Where the arc begins, seen from its centre."""
    end: Angle = Field(TURN, alias='to')
    """Where it ends, counterclockwise."""

    @model_validator(mode='after')
    def _line_or_arc(self) -> EdgePart:
        if (self.line is None) == (self.arc is None) or (self.arc is None) != (
            self.radius is None
        ):
            raise ValueError("needs either 'line', two points, or 'arc', a centre, and 'radius'")
        return self


class ProfilePart(Part):
    """The shape of the cam, from which the motion of its follower follows."""

    of_files: ClassVar[tuple[str, ...]] = (*FROM_FILE, 'layer')

    points: tuple[tuple[Angle, Length], ...] = ()
    """Pairs of an angle and the distance of the profile from the camshaft; angles count as those
    of the law do, from the line of the follower on. They may be in a file, as those of a law.
    """
    degree: Literal[3, 5, 7] = 5
    """Of the spline through these points."""
    error: Displacement = 0.0
    """Standard deviation of measured distances, by which the spline is smoothed."""
    edges: tuple[EdgePart, ...] = ()
    """Instead: lines and arcs, which meet without corners; in any order. Or `file` names a drawing
    (DXF) beside the scene, `layer` one of its layers, and `units` its unit, if it says none.
    """

    @model_validator(mode='after')
    def _points_or_edges(self) -> ProfilePart:
        if bool(self.points) == bool(self.edges):
            raise ValueError("needs either 'points' or 'edges'")
        return self


class LawPart(Part):
    """The displacement of the follower over the place of the cam, in one of six ways."""

    of_files: ClassVar[tuple[str, ...]] = FROM_FILE

    segments: tuple[SegmentPart, ...] = ()
    """Rises and returns, between which the follower dwells."""
    points: tuple[tuple[AnyPosition, Rise], ...] = ()
    """Instead: measured pairs of the cam's angle and the follower's displacement. Or `file` names
    a file of comma-separated values beside the scene, `columns` two of its columns, and `units`
    theirs, such as [deg, mm], if its first line does not.
    """
    degree: Literal[1, 3, 5, 7] = 5
    """Of the spline through these points."""
    error: Rise | None = None
    """Standard deviation of measured displacements, by which the spline is smoothed."""
    eccentric: Length | None = None
    """Instead: eccentricity of a circular cam, on which the follower rises through the middle at
    cam angle 0 wherever its guide points; `check` says where on the cam the centre then is.
    """
    tangent: NosePart | None = None
    """Instead: a base circle and a round nose, joined by tangents."""
    arcs: FlankPart | None = None
    """Instead: a base circle and a round nose, joined by arcs."""
    profile: ProfilePart | None = None
    """Instead: the shape of the cam; `base_radius` follows from it."""

    @model_validator(mode='after')
    def _one_way(self) -> LawPart:
        if sum(bool(getattr(self, way)) for way in _WAYS) != 1:
            raise ValueError(
                f'needs exactly one of {", ".join(map(repr, _WAYS[:-1]))} and {_WAYS[-1]!r}'
            )
        if self.error and not self.points:
            raise ValueError("has an 'error', which is one of measured 'points'")
        return self


class LiftOffPart(Part):
    """A follower that leaves the cam and strikes it again."""

    restitution: Coefficient
    """Coefficient of restitution: 0 without rebound, 1 without loss."""
    hypothesis: Hypothesis = 'newton'
    """Hypothesis of restitution: the ratio of velocities, of impulses or of energies."""
    friction: FrictionCoefficient = 0.0
    """Coefficient of Coulomb friction."""
    pin_radius: Radius = 0.0
    """Of the pin on which a roller turns; required with friction of one."""
    contact: Contact | None = None
    """A contact force law instead of a rigid contact."""


class GroovePart(Part):
    """A groove that holds the roller."""

    clearance: Displacement
    """Width of the groove less the roller's diameter; 0 for an ideal one."""
    restitution: Coefficient | None = None
    """Of both walls; required with a clearance."""
    hypothesis: Hypothesis = 'newton'
    """Hypothesis of restitution: the ratio of velocities, of impulses or of energies."""
    friction: FrictionCoefficient = 0.0
    """Coefficient of Coulomb friction, on the pin of the roller."""
    pin_radius: Radius = 0.0
    """Of that pin; required with friction."""
    contact: Contact | None = None
    """A contact force law instead of rigid walls."""


@KINDS.add('cam')
class CamKeys(PhaseKeys):
    """A cam and its follower."""

    cam: Reference | None = None
    """A cam's link, and the point of its follower."""
    follower: Literal['knife', 'roller', 'flat'] | None = None
    """Its tip; required for a cam."""
    base_radius: Length | None = None
    """Of the cam's base circle, without the roller; required, but for a profile."""
    roller: Radius = 0.0
    """Radius of the roller; required for one."""
    tilt: Angle = 0.0
    """Of a face that slides: from the motion to its normal, counterclockwise."""
    face: Position = 0.0
    """Of a face that swings: how far beyond the line from pivot to point."""
    side: Literal['left', 'right'] | None = None
    """Where a swinging arm is, seen from the camshaft; required for one."""
    sense: Literal['counterclockwise', 'clockwise'] | None = None
    """In which the cam's angle counts; counterclockwise without it."""
    law: LawPart | None = None
    """Displacement of the follower over the angle of the cam; required."""
    lift_off: LiftOffPart | None = None
    """The follower may leave the cam and meet it again in impacts; without it the cam holds it."""
    groove: GroovePart | None = None
    """A groove holds the roller from both sides."""

    firm = "write 'lift_off' or 'groove'"
    parts = CamParts
    friction_keys = ('radius',), False

    def read(self, names: Names, name: str) -> CamPair:
        """A cam and its follower."""
        cam, follower = names.ends(name)
        reader = _CamReader(names, name, self)
        try:
            return reader.pair(cam, follower)
        except InputError as error:
            if str(error).startswith('joints.'):
                raise
            raise InputError(f'{reader.where}: {error}') from error

    def clearance_spec(self, joint: Any) -> ClearanceSpec | None:
        """The play of a cam that its follower may leave, or of a groove with clearance."""
        off, groove = self.lift_off, self.groove
        if off:
            return clearance_spec_of(off, 0.0)
        if groove and groove.clearance:
            return clearance_spec_of(groove, 0.5 * groove.clearance)
        return None

    def frictions(
        self, given: Friction, joint: Any, mechanism: Mechanism
    ) -> list[ContactFriction]:
        """Friction of the follower; in a groove on both walls."""
        touch = joint.touch(mechanism, given.radius or 0.0)
        if not joint.grooved:
            return [ContactFriction(joint.name, mechanism, given.coefficient, touch)]
        return [
            ContactFriction(joint.name, mechanism, given.coefficient, touch.on(way), way)
            for way in (1, -1)
        ]

    def notes(self, machine: Any, joint: CamPair) -> list[str]:
        """Pressure angle, jumps, whether the cam may pull its follower."""
        cam, name = joint.cam, joint.name
        notes = []
        if joint.name not in machine.plan.clearances and not isinstance(joint, GroovePair):
            notes.append(
                f'{name}: always in contact, so that the cam pulls its follower where the force '
                "is negative; with 'lift_off' it would separate ('mechanism-sim find "
                "--lift-off' gives the speed)"
            )
        pressure = math.degrees(cam.largest_pressure_angle)
        limit = _LARGEST_PRESSURE[joint.distance.swings]
        note = f'{name}: pressure angle up to {pressure:.4g} deg'
        notes.append(note + (f', more than the usual {limit:g} deg' if pressure > limit else ''))
        if isinstance(cam.law, Eccentric | Raised):
            centre = 1e3 * joint.profile(np.array([[0.0], [cam.law.eccentricity]]))
            x, y = (f'{c:.6g} mm' for c in np.round(centre[:, 0], 9) + 0.0)
            notes.append(f'{name}: centre of the circle at [{x}, {y}] of {joint.first}')
        unit = 'm' if joint.distance.slides else 'rad'
        jumps = check_smoothness(cam.law, 2)
        notes += [
            f'{name}: {jump} [per {unit}{"^2" * (jump.order > 1)}]: '
            f'the force {"jumps" if jump.order > 1 else "has no limit"}'
            for jump in jumps
        ]
        if (told := _peaks(machine, joint)) and told[1]:
            notes.append(told[0])
        if cam.corners:
            notes += [f'{name}: {flaw}' for flaw in (*find_flaws(cam), *find_cut_away(cam))]
        return notes

    def plausibility_warnings(self, machine: Any, joint: CamPair) -> list[str]:
        """Accelerations that measured points do not determine."""
        told = _peaks(machine, joint)
        return [told[0]] if told and not told[1] else []


def _peaks(machine: Any, joint: CamPair) -> tuple[str, bool] | None:
    """The accelerations of measured points, and whether these determine them.

    At the largest speed of the cam, if that is known.
    """
    law = joint.cam.law
    if not isinstance(law, MeasuredLaw) or law.degree == 1:
        return None
    drive, unit = machine.drive, 'm' if not joint.distance.swings else 'rad'
    scale, per = 1.0, 'm' if joint.distance.slides else 'rad'
    if joint.first == machine.plan.main and math.isfinite(drive.period):
        scale, per = drive.fastest**2, 's'
    text = describe_peaks(law.peaks, f'{unit}/{per}^2', scale)
    return f'{joint.name}: {text}', determined(law.peaks)


Place = tuple[str, Vector2]
_UNITS = ('rad', 'm')
_RIGHT: dict[Any, Cam] = {}
_MOST = 32  # profiles that are known
#: pressure angles [deg] above these are usually avoided
_LARGEST_PRESSURE = {False: 30.0, True: 45.0}  # for followers that slide, that swing


class _CamReader:
    """One joint with a cam; what it raises without the scene's name gets it from `_read`."""

    def __init__(self, names: Names, name: str, joint: CamKeys) -> None:
        self.names, self.name, self.joint = names, name, joint
        self.where = f'joints.{name}'

    def pair(self, cam: Place, follower: Place) -> CamPair:
        """The joint."""
        joint, (link, at) = self.joint, cam
        self._check_keys()
        carrier = _find_guide(self.names, self.where, *cam, 'cam')
        guide = _find_guide(self.names, self.where, *follower, 'follower')
        self._check_guide(guide)
        self._slides, phase = not carrier.swings, joint.phase
        if self._slides:
            for key in ('phase', 'sense'):
                if getattr(joint, key):
                    raise InputError(
                        f'{self.where}.{key} has no meaning for a cam that slides: its law goes '
                        'over the displacement along its guide'
                    )
            centre, direction, sense = along(carrier, guide)
            phase = -sense * carrier.angle
            x, y = rotate((centre[0] - carrier.at[0], centre[1] - carrier.at[1]), -carrier.angle)
            at = at[0] + x, at[1] + y
        else:
            centre, direction, sense = around(carrier, guide, joint.sense == 'clockwise')
        beside = 0.0
        #: from the frame of the cam's link to that of its follower
        self._frame = at, direction + sense * phase, sense
        if not guide.swings:
            away = guide.at[0] - centre[0], guide.at[1] - centre[1]
            beside = -sense * rotate(away, -direction)[1]
        touching = self._follower(guide, math.dist(guide.at, centre), beside, sense)
        whole = self._cam(guide, touching)
        kind = GroovePair if joint.groove else CamPair
        return kind(
            self.name,
            link,
            follower[0],
            at,
            follower[1],
            whole,
            centre,
            direction,
            sense,
            phase,
            guide.arm,
            beside,
            # a jump of its second order would be one of the gap
            bool(joint.groove and joint.groove.clearance) and not check_smoothness(whole.law, 2),
        )

    def _cam(self, guide: Guide, touching: Follower) -> Cam:
        """The profile; one that was found right is known for a while, for that takes long."""
        key = self.joint.model_dump_json(), guide.swings, self._slides, touching, self._frame
        if key not in _RIGHT:
            law = self.joint.law
            cam = (
                self._shaped(touching)
                if law and not (law.segments or law.points)
                else Cam(self._law(guide, touching), touching, self.joint.base_radius or 0.0)
            )
            self._check_cam(cam)
            if len(_RIGHT) >= _MOST:
                _RIGHT.pop(next(iter(_RIGHT)), None)
            _RIGHT[key] = cam
        return _RIGHT[key]

    def _check_keys(self) -> None:
        """Refuse cams without a key that all need, or with two that exclude each other."""
        joint, where = self.joint, self.where
        for key, what in (
            ('follower', "'knife', 'roller' or 'flat'"),
            (
                'base_radius',
                "the radius of the base circle, or the height of a base line, such as '20 mm'",
            ),
            ('law', f'its displacement by {", ".join(map(repr, _WAYS))}'),
        ):
            if key == 'base_radius' and joint.law and joint.law.profile:
                continue
            if getattr(joint, key) is None:
                raise InputError(f"{where}: '{key}' is missing: {what}")
        if (joint.follower == 'roller') != bool(joint.roller):
            raise InputError(
                f"{where}: 'roller' is missing: the radius of the roller, such as '8 mm'"
                if joint.follower == 'roller'
                else f"{where}: 'roller' is the radius of a roller: write 'follower: roller' too"
            )
        self._check_friction()
        if joint.groove and joint.lift_off:
            raise InputError(f'{where}: lift_off and groove exclude each other: keep one')
        if joint.groove and joint.follower != 'roller':
            raise InputError(f"{where}.groove needs 'follower: roller'")
        if joint.groove and joint.groove.clearance and joint.groove.restitution is None:
            raise InputError(f"{where}: 'groove.restitution' is missing: the clearance needs it")

    def _check_friction(self) -> None:
        """Check the pin radius of a roller with friction; other followers have none."""
        joint, radii = self.joint, []
        if joint.friction:
            radii.append((f'{self.where}.friction', 'radius', joint.friction.radius))
        for key, spec in (('lift_off', joint.lift_off), ('groove', joint.groove)):
            if spec and (spec.friction or spec.pin_radius):
                radii.append((f'{self.where}.{key}', 'pin_radius', spec.pin_radius or None))
        for where, key, radius in radii:
            if joint.follower == 'roller' and radius is None:
                raise InputError(
                    f"{where} needs a '{key}', that of the roller's pin, as {key}: 4 mm"
                )
            if radius is not None and not radius < joint.roller:
                raise InputError(
                    f'{where}.{key} is that of the pin of a roller, and less than the roller'
                )

    def _check_guide(self, guide: Guide) -> None:
        """Check the keys that apply to one kind of guidance only."""
        joint, where = self.joint, self.where
        if guide.swings and joint.side is None:
            raise InputError(
                f"{where}: 'side' is missing: whether the follower touches on the left or on the "
                'right of the line from the camshaft to its pivot'
            )
        if guide.swings and guide.arm == (0.0, 0.0):
            raise InputError(f"{where}: the follower's point must not be its pivot")
        given = {
            'side': guide.swings or joint.side is None,
            'tilt': not joint.tilt or (joint.follower == 'flat' and not guide.swings),
            'face': not joint.face or (joint.follower == 'flat' and guide.swings),
        }
        for key, fits in given.items():
            if not fits:
                raise InputError(
                    f'{where}.{key} has no meaning for a {joint.follower} follower that '
                    f'{"swings" if guide.swings else "slides"}'
                )

    def _follower(self, guide: Guide, distance: float, beside: float, sense: int) -> Follower:
        joint = self.joint
        if not guide.swings:
            if joint.follower == 'flat':
                return FlatFaced(-sense * joint.tilt)
            return Translating(beside, joint.roller)
        side: Literal[1, -1] = 1 if (joint.side == 'left') == (sense == 1) else -1
        if joint.follower == 'flat':
            return OscillatingFlat(distance, joint.face, side)
        return Oscillating(distance, math.hypot(*guide.arm), joint.roller, side)

    def _law(self, guide: Guide, follower: Follower) -> Law:
        given, where = self.joint.law, f'joints.{self.name}.law'
        assert given is not None  # noqa: S101 - checked
        if given.segments:
            return Diagram(
                [
                    self._segment(f'{where}.segments.{i}', s, guide.swings)
                    for i, s in enumerate(given.segments)
                ],
                self._slides,
            )
        ways, rises = (
            [
                self.names.measure(f'{where}.points.{i}', point[k], straight, _UNITS)
                for i, point in enumerate(given.points)
            ]
            for k, straight in enumerate((self._slides, not guide.swings))
        )
        error = 0.0
        if given.error:
            error = self.names.measure(f'{where}.error', given.error, not guide.swings, _UNITS)
            if error < 0.0 or given.degree == 1:
                raise InputError(
                    f'law.error = {error:g} is a standard deviation, not negative, and needs '
                    "'degree' 3, 5 or 7"
                )
        return MeasuredLaw(ways, rises, given.degree, self._slides, error)

    def _shaped(self, follower: Follower) -> Cam:
        """A cam whose shape is given, and the law that follows."""
        law, base = self.joint.law, self.joint.base_radius
        assert law is not None  # noqa: S101 - checked
        way = next(way for way in _WAYS if getattr(law, way))
        if self._slides:
            raise InputError(
                f"law.{way} is for cams that turn: describe this one's by 'segments' or 'points'"
            )
        given = law.profile
        if given is None:
            assert base is not None  # noqa: S101 - checked
            law_on = partial(_law_of_shape, law, follower)
            return Cam(law_on(base), follower, base, law_on)
        if given.points:
            angles, radii = np.transpose(given.points)
            law_of_radii = MeasuredLaw(angles, radii, given.degree, error=given.error)
            outline = CamOutline([Radii(law_of_radii.function)])
        else:
            outline = edge_cam([self._edge(edge) for edge in given.edges])
        found = outline.base_radius
        if base is not None and abs(base - found) > 1e-5 * found:
            raise InputError(
                f'base_radius = {base:g} m is not the least distance of the profile from the '
                f'camshaft, {found:.9g} m: leave it out'
            )
        return Cam(outline.law(follower, found), follower, found)

    def _edge(self, part: EdgePart) -> Edge:
        """A line or an arc of the cam's link, in the frame of the follower."""
        (x, y), angle, sense = self._frame
        ends = part.line
        if ends is not None:
            edge = Edge(complex(*ends[0]), complex(*ends[1]))
        else:
            assert part.arc is not None and part.radius is not None  # noqa: S101, PT018
            edge = Edge.arc(complex(*part.arc), part.radius, part.begin, part.end)
        return edge.moved(complex(x, y), -angle, mirrored=sense > 0)

    def _segment(self, where: str, part: SegmentPart, swings: bool) -> Segment:
        begin, end = (
            self.names.measure(f'{where}.{key}', way, self._slides, _UNITS)
            for key, way in (('from', part.begin), ('to', part.end))
        )
        if not self._slides and end - begin > 2.0 * math.pi * (1.0 + 1e-9):
            raise InputError(
                f'law: the segment from {begin:g} to {end:g} rad is longer than a turn; numbers '
                "without a unit are radians: write for example '30 deg'"
            )
        if end <= begin:
            said = (
                f'law: the segment from {spelled(begin, end, reciprocating=self._slides)} has no'
            )
            if end == begin or self._slides:
                raise InputError(f'{said} {"positive " * (end < begin)}length')
            turned = math.degrees(end) + 360.0 * math.ceil((begin - end) / (2.0 * math.pi))
            raise InputError(
                f'{said} positive length; past a full turn count on, to {turned:g} deg'
            )
        rise = self.names.measure(f'{where}.rise', part.rise, not swings, _UNITS)
        if part.curve == 'polynomial':
            curve = self._polynomial(where, part, (begin, end, rise), swings)
            return Segment(begin, end, rise, curve, own=True)
        if part.curve == 'spline':
            x, y = zip(*part.points, strict=True)
            curve = curves.spline_curve(x, y, part.ends)
        else:
            curve = getattr(curves, part.curve.upper())
        return Segment(begin, end, rise, curve)

    def _polynomial(
        self, where: str, part: SegmentPart, size: tuple[float, float, float], swings: bool
    ) -> Piecewise:
        """The polynomial that meets the conditions of a segment of (begin, end, rise)."""
        begin, end, rise = size
        found = {(0.0, 0): 0.0, (end - begin, 0): rise}
        for i, condition in enumerate(part.conditions):
            place = f'{where}.conditions.{i}'
            at = self.names.measure(f'{place}.at', condition.at, self._slides, _UNITS) - begin
            for limit in (0.0, end - begin):
                at = limit if abs(limit - at) <= 1e-9 * (end - begin) else at
            if not 0.0 <= at <= end - begin:
                raise InputError(
                    f'{place}.at = {spelled(at + begin, reciprocating=self._slides)} lies beyond '
                    f'its segment, {spelled(begin, end, reciprocating=self._slides)}'
                )
            for order, key in enumerate(('lift', 'velocity', 'acceleration', 'jerk')):
                if (value := getattr(condition, key)) is None:
                    continue
                number = self.names.measure(f'{place}.{key}', value, not swings, _UNITS)
                if found.get((at, order), number) != number:
                    raise InputError(
                        f'{place}.{key} = {number:g} contradicts the {found[at, order]:g} that '
                        "another condition, or 'rise', gives there"
                    )
                found[at, order] = number
        if len(found) > curves.MOST_CONDITIONS:
            raise InputError(
                f'{where}.conditions are {len(found)} with those of the ends: at most '
                f'{curves.MOST_CONDITIONS} are allowed'
            )
        return curves.polynomial_curve(
            end - begin, [curves.BoundaryCondition(*key, value) for key, value in found.items()]
        )

    def _check_cam(self, cam: Cam) -> None:
        """Refuse what no follower can follow."""
        for jump in check_smoothness(cam.law, 0):
            raise InputError(
                f'law: {jump}: no follower can follow that; take curves and ends that meet'
            )
        if cam.corners:  # a roller cannot round them: what they cut away of the profile is a note
            return
        clearance = self.joint.groove.clearance if self.joint.groove else None
        swings = isinstance(cam.follower, Oscillating | OscillatingFlat)
        lift = float(np.ptp(cam.law(drawing_angles(cam.law, 0.02))))
        for flaw in [*find_flaws(cam, clearance), *find_cut_away(cam)]:
            ways = [] if self._slides else ['a larger base_radius']
            ways += ['a smaller roller'] if self.joint.roller else []
            ways += [f'a smaller lift than {lift:.4g} {_UNITS[not swings]}']
            raise InputError(f'{flaw}: take {" or ".join(ways)}')


def _law_of_shape(given: LawPart, follower: Follower, base: float) -> Law:
    """The law of an eccentric cam, or of one with a round nose, on a base circle [m]."""
    if e := given.eccentric:
        if follower == FlatFaced():
            return Raised(e)
        if isinstance(follower, Translating) and abs(follower.offset) <= 1e-12 * base:
            return Eccentric(base + e + follower.roller, e)
        raise InputError(
            'law.eccentric is for followers that slide on a line through the camshaft, or with a '
            "face across it: describe this one's law by 'points'"
        )
    part = given.tangent or given.arcs
    assert part is not None  # noqa: S101 - checked
    flank = part.flank if isinstance(part, FlankPart) else math.inf
    return nose_cam(base, part.nose, part.lift, flank, part.at).law(follower, base)


class Guide(NamedTuple):
    """Guidance of a cam or a follower by the ground: a pivot or a straight guide."""

    swings: bool  #: or turns
    at: Vector2  #: [m] its pivot, or its point when its displacement is zero, in the world
    arm: Vector2  #: [m] from its pivot to its point, in its own frame
    axis: float = 0.0  #: [rad] along which it slides
    angle: float = 0.0  #: [rad] of its frame if it slides


def _find_guide(names: Names, where: str, link: str, at: Vector2, what: str) -> Guide:
    """Find the ground joint that guides a link with the point `at` [m].

    Parameters
    ----------
    where : the joint that asks
    what : ``cam`` or ``follower``
    """
    for name, joint in names.scene.joints.items():
        if joint.kind not in ('revolute', 'prismatic'):
            continue
        (a, on_a), (b, on_b) = names.connected(name)
        if {a, b} != {GROUND, link}:
            continue
        if joint.clearance:
            raise InputError(f'{where}: the joint {name} of its {what} cannot be loose')
        if joint.revolute:
            pivot, own = (on_a, on_b) if a == GROUND else (on_b, on_a)
            return Guide(True, pivot, (at[0] - own[0], at[1] - own[1]))
        if a == GROUND:
            x, y = rotate((at[0] - on_b[0], at[1] - on_b[1]), joint.angle)
            start = on_a[0] + x, on_a[1] + y
            return Guide(False, start, (0.0, 0.0), joint.axis, joint.angle)
    moves = 'turn or slide' if what == 'cam' else 'slide or swing'
    raise InputError(
        f"{where}: the {what} {link} must {moves} on the ground: add a joint 'prismatic: [ground, "
        f"{link}]' or 'revolute: [ground, {link}]'"
    )


def around(cam: Guide, follower: Guide, clockwise: bool) -> Frame:
    """Frame of a turning cam, `clockwise` if its angle grows in that sense."""
    if cam.arm != (0.0, 0.0):
        raise InputError('name the point where the cam turns on the ground')
    (x, y), (px, py) = cam.at, follower.at
    direction = math.atan2(py - y, px - x) if follower.swings else follower.axis
    return cam.at, direction, -1 if clockwise else 1


def along(cam: Guide, follower: Guide) -> Frame:
    """Frame of a sliding cam: the centre is abreast of the pivot of a swinging follower."""
    (x, y), (px, py) = cam.at, follower.at
    if follower.swings:
        way, across = rotate((px - x, py - y), -cam.axis)
        dx, dy = rotate((way, 0.0), cam.axis)
        direction = cam.axis + math.copysign(0.5 * math.pi, across)
        return (x + dx, y + dy), direction, -1 if across > 0.0 else 1
    across = math.sin(follower.axis - cam.axis)
    if abs(across) < 1.0 - 1e-15:
        given, *right = (
            math.degrees(a) for a in (follower.axis, cam.axis + 0.5 * math.pi,
                                      cam.axis - 0.5 * math.pi)
        )  # fmt: skip
        raise InputError(
            'a cam that slides moves followers that slide square to it: the axis of its follower '
            f'must be {right[0]:g} or {right[1]:g} deg, not {given:g} deg'
        )
    return cam.at, follower.axis, -1 if across > 0.0 else 1
