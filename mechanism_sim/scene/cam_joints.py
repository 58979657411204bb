"""From the keys of a cam to its law, its follower and the joint of both."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from mechanism_sim.cams import curves
from mechanism_sim.cams.followers import (
    FlatFaced,
    Follower,
    Oscillating,
    OscillatingFlat,
    Translating,
)
from mechanism_sim.cams.interference import find_cut_away
from mechanism_sim.cams.laws import (
    Diagram,
    Eccentric,
    Law,
    Measured,
    Raised,
    Segment,
    check_smoothness,
    spelled,
)
from mechanism_sim.cams.pair import CamPair, GroovePair
from mechanism_sim.cams.profiles import Cam, drawing_angles, find_flaws
from mechanism_sim.errors import InputError
from mechanism_sim.planar.mechanism import Vector2, rotate
from mechanism_sim.scene.cam_guides import Guide, along, around, find_guide
from mechanism_sim.scene.cam_keys import SegmentPart
from mechanism_sim.scene.contact_keys import Play
from mechanism_sim.scene.places import Places
from mechanism_sim.scene.schema import JointPart

Place = tuple[str, Vector2]
_UNITS = ('rad', 'm')


def read_cam(places: Places, name: str, joint: JointPart, cam: Place, follower: Place) -> CamPair:
    """The joint of a cam and its follower.

    Raises
    ------
    InputError
        If keys are missing or do not fit, the law jumps or does not come back, or the profile
        would be undercut.
    """
    reader = _Reader(places, name, joint)
    try:
        return reader.pair(cam, follower)
    except InputError as error:
        if str(error).startswith(f'{places.name}: '):
            raise
        raise InputError(f'{reader.where}: {error}') from error


def cam_play(joint: JointPart) -> Play | None:
    """The play of a cam that its follower may leave, or of a groove with clearance."""
    off, groove = joint.lift_off, joint.groove
    if off:
        return Play(
            radial=0.0,
            restitution=off.restitution,
            hypothesis=off.hypothesis,
            contact=off.contact,
        )
    if groove and groove.clearance:
        return Play(
            radial=0.5 * groove.clearance,
            restitution=groove.restitution or 0.0,
            hypothesis=groove.hypothesis,
            contact=groove.contact,
        )
    return None


class _Reader:
    """One joint with a cam; what it raises without the scene's name gets it from `read_cam`."""

    def __init__(self, places: Places, name: str, joint: JointPart) -> None:
        self.places, self.name, self.joint = places, name, joint
        self.where = f'{places.name}: joints.{name}'

    def pair(self, cam: Place, follower: Place) -> CamPair:
        """The joint."""
        joint, (link, at) = self.joint, cam
        self._check_keys()
        carrier = find_guide(self.places, self.where, *cam, 'cam')
        guide = find_guide(self.places, self.where, *follower, 'follower')
        self._check_guide(guide)
        self._slides, phase = not carrier.swings, joint.phase
        if self._slides:
            self._check_straight()
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
        whole = Cam(self._law(guide, touching), touching, joint.base_radius or 0.0)
        self._check_cam(whole)
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
            math.atan2(*guide.arm[::-1]),
            beside,
            # a jump of its second order would be one of the gap
            bool(joint.groove and joint.groove.clearance) and not check_smoothness(whole.law, 2),
        )

    def _check_keys(self) -> None:
        """What every cam needs, and what excludes each other."""
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
        if joint.groove and joint.lift_off:
            raise InputError(f'{where}: lift_off and groove exclude each other: keep one')
        if joint.groove and joint.follower != 'roller':
            raise InputError(f"{where}.groove needs 'follower: roller'")
        if joint.groove and joint.groove.clearance and joint.groove.restitution is None:
            raise InputError(f"{where}: 'groove.restitution' is missing: the clearance needs it")
        if joint.clearance:
            raise InputError(
                f"{where}.clearance has no meaning for a cam: write 'lift_off' or 'groove'"
            )

    def _check_straight(self) -> None:
        """Keys that only cams that turn have."""
        for key in ('phase', 'sense'):
            if getattr(self.joint, key):
                raise InputError(
                    f'{self.where}.{key} has no meaning for a cam that slides: its law goes over '
                    'the displacement along its guide'
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
                    self.places.measure(f'{where}.points.{i}', point[k], straight, _UNITS)
                    for i, point in enumerate(given.points)
                ]
                for k, straight in enumerate((self._slides, not guide.swings))
            )
            return Measured(ways, rises, given.degree, self._slides)
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
            self.places.measure(f'{where}.{key}', way, self._slides, _UNITS)
            for key, way in (('from', part.begin), ('to', part.end))
        )
        if not self._slides and end - begin > 2.0 * math.pi * (1.0 + 1e-9):
            raise InputError(
                f'law: the segment from {begin:g} to {end:g} rad is longer than a turn; '
                "numbers without a unit are radians: write for example '30 deg'"
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
        rise = self.places.measure(f'{where}.rise', part.rise, not swings, _UNITS)
        if part.curve == 'spline':
            x, y = zip(*part.points, strict=True)
            curve = curves.spline_curve(x, y, part.ends)
        else:
            curve = getattr(curves, part.curve.upper())
        return Segment(begin, end, rise, curve)

    def _check_cam(self, cam: Cam) -> None:
        """Refuse what no follower can follow."""
        for jump in check_smoothness(cam.law, 1):
            raise InputError(
                f'law: {jump}: no follower can follow that; take curves and ends that meet'
            )
        clearance = self.joint.groove.clearance if self.joint.groove else None
        swings = isinstance(cam.follower, Oscillating | OscillatingFlat)
        lift = float(np.ptp(cam.law(drawing_angles(cam.law, 0.02))))
        for flaw in [*find_flaws(cam, clearance), *find_cut_away(cam)]:
            ways = [] if self._slides else ['a larger base_radius']
            ways += ['a smaller roller'] if self.joint.roller else []
            ways += [f'a smaller lift than {lift:.4g} {_UNITS[not swings]}']
            raise InputError(f'{flaw}: take {" or ".join(ways)}')
