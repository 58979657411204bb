"""From the keys of a cam to its law, its follower and the joint of both."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

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
from mechanism_sim.joints.cam.guides import Guide, along, around, find_guide
from mechanism_sim.joints.cam.interference import find_cut_away
from mechanism_sim.joints.cam.laws import (
    Diagram,
    Eccentric,
    Law,
    MeasuredLaw,
    Raised,
    Segment,
    check_smoothness,
    spelled,
)
from mechanism_sim.joints.cam.profiles import Cam, drawing_angles, find_flaws
from mechanism_sim.joints.contact_keys import Contact, Friction, Play, play_of
from mechanism_sim.joints.joint_keys import KINDS, Reference
from mechanism_sim.joints.transmission.keys import PhaseKeys
from mechanism_sim.keys.names import Names
from mechanism_sim.keys.quantities import (
    Angle,
    Coefficient,
    Displacement,
    Length,
    Part,
    Position,
    Radius,
    si_of,
)
from mechanism_sim.keys.quantities import Friction as FrictionCoefficient
from mechanism_sim.planar.joint_friction import ContactFriction
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.planar.points import Vector2, rotate
from mechanism_sim.units import QuantityValue

Way = Annotated[QuantityValue, si_of('rad', 'm')]
"""An angle of a cam, or a displacement if it slides."""

Rise = Annotated[QuantityValue, si_of('m', 'rad')]
"""A displacement of the follower: an angle if it swings."""

Curve = Literal[
    'cycloidal',
    'harmonic',
    'half_harmonic',
    'four_spline',
    'modified_trapezoid',
    'modified_sine',
    'polynomial_345',
    'polynomial_4567',
    'spline',
]


class SegmentPart(Part):
    """A rise, a return or, with no rise, a dwell over an interval of the cam angle.

    Of a cam that slides: of its displacement.
    """

    begin: Way = Field(alias='from')
    """Angle of the cam, or its displacement if it slides."""
    end: Way = Field(alias='to')
    """Likewise."""
    rise: Rise
    """Of the follower, negative for a return; 0 is a dwell."""
    curve: Curve = 'cycloidal'
    """How it gets there."""
    points: tuple[tuple[float, float], ...] = ()
    """Of a spline, from [0, 0] to [1, 1]."""
    ends: Literal['clamped', 'natural', 'not-a-knot'] = 'clamped'
    """Of a spline."""

    @model_validator(mode='after')
    def _points_make_a_spline(self) -> SegmentPart:
        if bool(self.points) != (self.curve == 'spline'):
            raise ValueError(
                "needs 'points' from [0, 0] to [1, 1] if its curve is a spline, and only then"
            )
        return self


class LawPart(Part):
    """The displacement of the follower over the place of the cam, in one of three ways."""

    segments: tuple[SegmentPart, ...] = ()
    """Rises and returns, between which the follower dwells."""
    points: tuple[tuple[Way, Rise], ...] = ()
    """Instead: measured pairs of the cam's angle and the follower's displacement."""
    degree: Literal[1, 3, 5, 7] = 5
    """Of the spline through these points."""
    eccentric: Length | None = None
    """Instead: the cam is a circle, so far off the camshaft."""

    @model_validator(mode='after')
    def _one_way(self) -> LawPart:
        if sum(map(bool, (self.segments, self.points, self.eccentric))) != 1:
            raise ValueError("needs exactly one of 'segments', 'points' and 'eccentric'")
        return self


class LiftOffPart(Part):
    """A follower that leaves the cam and strikes it again."""

    restitution: Coefficient
    """Coefficient of restitution: 0 does not bounce, 1 loses nothing."""
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    """Quantities that the coefficient relates: speeds, impulses or works."""
    friction: FrictionCoefficient = 0.0
    """Coulomb's coefficient."""
    pin_radius: Radius = 0.0
    """Of the pin on which a roller turns; required with friction of one."""
    contact: Contact | None = None
    """A law of force instead of a rigid contact."""


class GroovePart(Part):
    """A groove that holds the roller."""

    clearance: Displacement
    """Width of the groove less the roller's diameter; 0 for an ideal one."""
    restitution: Coefficient | None = None
    """Of both walls; required with a clearance."""
    hypothesis: Literal['newton', 'poisson', 'stronge'] = 'newton'
    """Quantities that the coefficient relates: speeds, impulses or works."""
    friction: FrictionCoefficient = 0.0
    """Coulomb's coefficient, on the pin of the roller."""
    pin_radius: Radius = 0.0
    """Of that pin; required with friction."""
    contact: Contact | None = None
    """A law of force instead of rigid walls."""


@KINDS.add('cam')
class CamKeys(PhaseKeys):
    """A cam and its follower."""

    cam: Reference | None = None
    """A cam's link, and the point of its follower."""
    follower: Literal['knife', 'roller', 'flat'] | None = None
    """Its tip; required for a cam."""
    base_radius: Length | None = None
    """Of the cam's base circle, without the roller; required."""
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
    rubs_by = ('radius',), False

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

    def play(self, joint: Any) -> Play | None:
        """The play of a cam that its follower may leave, or of a groove with clearance."""
        off, groove = self.lift_off, self.groove
        if off:
            return play_of(off, 0.0)
        if groove and groove.clearance:
            return play_of(groove, 0.5 * groove.clearance)
        return None

    def frictions(
        self, given: Friction, joint: Any, mechanism: Mechanism
    ) -> list[ContactFriction]:
        """Of the follower, on both walls of a groove."""
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
                "is negative; with 'lift_off' it would part (the command lift-off says from which "
                'speed)'
            )
        pressure = math.degrees(cam.largest_pressure_angle)
        limit = LARGEST_PRESSURE[joint.distance.swings]
        note = f'{name}: pressure angle up to {pressure:.4g} deg'
        notes.append(note + (f', more than the usual {limit:g} deg' if pressure > limit else ''))
        unit = 'm' if joint.distance.slides else 'rad'
        jumps = check_smoothness(cam.law, 2)
        notes += [
            f'{name}: {jump} [per {unit}{"^2" * (jump.order > 1)}]: '
            f'the force {"jumps" if jump.order > 1 else "has no limit"}'
            for jump in jumps
        ]
        if cam.corners:
            notes += [f'{name}: {flaw}' for flaw in (*find_flaws(cam), *find_cut_away(cam))]
        return notes


Place = tuple[str, Vector2]
_UNITS = ('rad', 'm')
_RIGHT: dict[Any, Cam] = {}
_MOST = 32  # profiles that are known
#: pressure angles [deg] above these are usually avoided
LARGEST_PRESSURE = {False: 30.0, True: 45.0}  # for followers that slide, that swing


class _CamReader:
    """One joint with a cam; what it raises without the scene's name gets it from `_read`."""

    def __init__(self, names: Names, name: str, joint: CamKeys) -> None:
        self.names, self.name, self.joint = names, name, joint
        self.where = f'joints.{name}'

    def pair(self, cam: Place, follower: Place) -> CamPair:
        """The joint."""
        joint, (link, at) = self.joint, cam
        self._check_keys()
        carrier = find_guide(self.names, self.where, *cam, 'cam')
        guide = find_guide(self.names, self.where, *follower, 'follower')
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
        key = self.joint.model_dump_json(), guide.swings, self._slides, touching
        if key not in _RIGHT:
            cam = Cam(self._law(guide, touching), touching, self.joint.base_radius or 0.0)
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
            ('law', "its displacement by 'segments', 'points' or 'eccentric'"),
        ):
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
        """A roller rubs on its pin, which must be smaller; nothing else has one."""
        joint, rubs = self.joint, []
        if joint.friction:
            rubs.append((f'{self.where}.friction', 'radius', joint.friction.radius))
        for key, play in (('lift_off', joint.lift_off), ('groove', joint.groove)):
            if play and (play.friction or play.pin_radius):
                rubs.append((f'{self.where}.{key}', 'pin_radius', play.pin_radius or None))
        for where, key, radius in rubs:
            if joint.follower == 'roller' and radius is None:
                raise InputError(
                    f"{where} needs a '{key}', that of the roller's pin, as {key}: 4 mm"
                )
            if radius is not None and not radius < joint.roller:
                raise InputError(
                    f'{where}.{key} is that of the pin of a roller, and less than the roller'
                )

    def _check_guide(self, guide: Guide) -> None:
        """Keys that only one way of moving has."""
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
        if given.points:
            ways, rises = (
                [
                    self.names.measure(f'{where}.points.{i}', point[k], straight, _UNITS)
                    for i, point in enumerate(given.points)
                ]
                for k, straight in enumerate((self._slides, not guide.swings))
            )
            return MeasuredLaw(ways, rises, given.degree, self._slides)
        if self._slides:
            raise InputError(
                "law.eccentric is for cams that turn: describe this one's by 'segments' or "
                "'points'"
            )
        e, radius = given.eccentric or 0.0, self.joint.base_radius or 0.0
        if follower == FlatFaced():
            return Raised(e)
        if isinstance(follower, Translating) and abs(follower.offset) <= 1e-12 * radius:
            return Eccentric(radius + e + follower.roller, e)
        raise InputError(
            'law.eccentric is for followers that slide on a line through the camshaft, or with a '
            "face across it: describe this one's law by 'points'"
        )

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
        if part.curve == 'spline':
            x, y = zip(*part.points, strict=True)
            curve = curves.spline_curve(x, y, part.ends)
        else:
            curve = getattr(curves, part.curve.upper())
        return Segment(begin, end, rise, curve)

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
