"""Figures of a cam, and its outline for a workshop."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.joints.cam.followers import Oscillating, OscillatingFlat, Translating
from mechanism_sim.joints.cam.interference import find_cut_away
from mechanism_sim.joints.cam.laws import DERIVATIVES, check_smoothness
from mechanism_sim.joints.cam.outlines import OutlineLaw
from mechanism_sim.joints.cam.profiles import (
    Cam,
    distinct,
    drawing_angles,
    extent,
    find_flaws,
    greatest,
    outline_angles,
)
from mechanism_sim.joints.sheets import Circle, JointParts, Outline, PartFigure, Polygon, Sheet
from mechanism_sim.tables import Table

#: for which a base radius is proposed [rad]
_PRESSURE_ANGLE = math.radians(30.0)
_BESIDE = 1e-11  # of the largest value: beside a break, what is less is 0


class CamParts(JointParts):
    """A cam and its follower."""

    whole: ClassVar[str] = 'a cam, no gears'

    def sheet(self, gear: str | None, friction: float) -> Sheet:
        """Sizes and limits of the cam, and what is wrong with it; its outline on its link."""
        joint, clearance = self.joint, None
        if joint.grooved:
            spec = self.machine.plan.clearances.get(joint.name)
            clearance = 2.0 * (spec.radial or 0.0) if spec else 0.0
        sense = 1 if joint.distance.slides else joint.sense
        cam, law = joint.cam, joint.cam.law
        remarks = [str(flaw) for flaw in (*find_flaws(cam, clearance), *find_cut_away(cam))]
        figures = list(_cam_figures(cam, sense * self.speed(joint.first)))
        # a profile that is given has but one base circle
        given = isinstance(law, OutlineLaw) and cam.law_on is None
        rises = isinstance(cam.follower, Translating | Oscillating)
        if rises and not law.reciprocating and not given:
            try:
                radius = cam.smallest_base_radius(_PRESSURE_ANGLE)
                figures.append(PartFigure('base_radius_for_30_deg', radius, 'm'))
            except InputError as told:
                remarks.append(f'{told}')
        return Sheet(
            f'{self.machine.name}: the cam on {joint.first} that moves {joint.second}',
            tuple(figures),
            cam_outline(cam, clearance).placed(joint.profile),
            (*remarks, *(str(jump) for jump in check_smoothness(law, 3))),
            'm' if law.reciprocating else 'rad',
        )

    def table(self) -> Table:
        """The cam over its turn or stroke, (N,) by name, in SI units; both sides of every break.

        Derivatives, and speeds of the point of contact and of sliding, are by radians of the cam,
        or by metres if it slides, and count as those of `mechanism_sim.joints.cam.touch`. The
        profile is in the frame of the cam's link.
        """
        cam = self.joint.cam
        law, swings = cam.law, isinstance(cam.follower, Oscillating | OscillatingFlat)
        x = drawing_angles(law, extent(law) / 360)
        touch = cam.at(x)
        contact = self.joint.profile(touch.profile)
        columns = {
            **{name: law(x, order) for order, name in enumerate(DERIVATIVES)},
            'pressure_angle': touch.pressure_angle,
            'contact.x': contact[0],
            'contact.y': contact[1],
            'contact_speed': touch.rate,
            'sliding_speed': touch.sliding,
        }
        for values in columns.values():
            values[np.abs(values) <= _BESIDE * np.abs(values).max()] = 0.0
        # sides of a break are computed a little beside it
        breaks = np.asarray(law.breaks)
        nearest = breaks[np.abs(x[:, None] - breaks).argmin(axis=1)]
        x = np.where(np.abs(x - nearest) <= _BESIDE * extent(law), nearest, x)
        of, lift = 'm' if law.reciprocating else 'rad', 'rad' if swings else 'm'
        units = {'cam': of, 'pressure_angle': 'rad', 'contact.x': 'm', 'contact.y': 'm'}
        units |= {name: _per(lift, of, order) for order, name in enumerate(DERIVATIVES)}
        units |= dict.fromkeys(('contact_speed', 'sliding_speed'), _per('m', of, 1))
        return Table({'cam': x, **columns}, units)


def _per(unit: str, of: str, order: int) -> str:
    """The unit of a derivative by what is in the unit `of`."""
    above, power = ('1', order - 1) if unit == of and order else (unit, order)
    if power <= 0:
        return '' if above == '1' else unit
    return f'{above}/{of}^{power}' if power > 1 else f'{above}/{of}'


def _cam_figures(cam: Cam, speed: float) -> Iterator[PartFigure]:
    """Figures of a cam at a speed [rad/s, m/s]; at rest per radian or metre of the cam."""
    law, follower = cam.law, cam.follower
    swings = isinstance(follower, Oscillating | OscillatingFlat)
    yield PartFigure('base_radius', cam.base_radius, 'm')
    top, highest = greatest(law, law)
    lowest = -greatest(law, lambda x: -law(x))[1]
    yield PartFigure('lift', highest - lowest, 'rad' if swings else 'm', top)
    at, value = greatest(law, lambda x: np.abs(cam.at(x).pressure_angle))
    yield PartFigure('largest_pressure_angle', value, 'rad', at)
    yield from _radii(cam)
    at, value = greatest(law, lambda x: np.abs(cam.at(x).sliding))
    by = 'm' if law.reciprocating else 'rad'
    motion = 'rolling' if getattr(follower, 'roller', 0.0) else 'sliding'
    if speed:
        yield PartFigure('cam_speed', speed, f'{by}/s')
        yield PartFigure(f'largest_{motion}_velocity', value * abs(speed), 'm/s', at)
        at, value = greatest(law, lambda x: np.abs(cam.at(x).rate))
        yield PartFigure('largest_contact_velocity', value * abs(speed), 'm/s', at)
    else:
        yield PartFigure(f'largest_{motion}', value, f'm/{by}', at)


def _radii(cam: Cam) -> Iterator[PartFigure]:
    """Radii of curvature where the profile is most convex and most hollow."""
    roller = getattr(cam.follower, 'roller', None)
    if roller is None:
        at, least = greatest(cam.law, lambda x: -cam.at(x).curvature_radius)
        yield PartFigure('smallest_radius_of_curvature', -least, 'm', at)
        return
    at, bulge = greatest(cam.law, lambda x: cam.at(x).curvature)
    if bulge > 0.0:
        yield PartFigure('smallest_radius_of_curvature', 1.0 / bulge - roller, 'm', at)
    at, hollow = greatest(cam.law, lambda x: -cam.at(x).curvature)
    if hollow > 0.0:
        yield PartFigure('smallest_hollow_radius', 1.0 / hollow + roller, 'm', at)


def cam_outline(cam: Cam, clearance: float | None = None) -> Outline:
    """The profile of a cam, with the pitch curve of its roller and the base circle.

    It is in the frame of `touch`, in which cams turn clockwise: `PlacedCam.profile` takes it to
    that of a link. `profiles.find_flaws` and `interference.find_cut_away` say whether it can be
    cut.

    Parameters
    ----------
    clearance : of the roller in a groove [m], which then has both walls; None: no groove
    """
    at = outline_angles(cam.law)
    touch, closed = cam.at(at), not cam.law.reciprocating
    walls = {'profile': touch.profile}
    if clearance is not None:
        walls = dict(zip(('inner', 'outer'), cam.groove(at, clearance), strict=True))
    guides: list[Polygon | Circle] = []
    if getattr(cam.follower, 'roller', 0.0) > 0.0:
        guides.append(Polygon('pitch', distinct(touch.pitch, closed), closed))
    if closed:
        guides.append(Circle('base', cam.base_radius))
    else:
        # under the points of contact: off the law's places where the guide is beside the cam's
        line = np.array([(cam.base_radius, cam.base_radius), touch.profile[1, [0, -1]]])
        guides.append(Polygon('base', line, closed=False))
    edges = [Polygon(name, distinct(wall, closed), closed) for name, wall in walls.items()]
    return Outline(tuple(edges), tuple(guides))
