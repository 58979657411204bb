"""Figures of gears in mesh, and outlines of gears and racks for a workshop."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import ClassVar

import numpy as np

from mechanism_sim.errors import check_known
from mechanism_sim.joints.mesh.involute import (
    FULL_DEPTH,
    Gear,
    ToothSystem,
    least_teeth,
    rack_teeth,
)
from mechanism_sim.joints.mesh.pair import Pair
from mechanism_sim.joints.mesh.wheels import Wheel, read_wheel
from mechanism_sim.joints.sheets import Circle, JointParts, Outline, PartFigure, Polygon, Sheet
from mechanism_sim.planar.points import Vector2

#: teeth of a rack that is drawn by itself
_RACK_TEETH = 10
#: points of a flank, and within an arc at a tip or root: for a module of 2 mm to 0.03 um
FLANK, ARC = 160, 32


class MeshParts(JointParts):
    """Two gears, or a gear and a rack."""

    whole: ClassVar[str] = ''

    @cached_property
    def wheels(self) -> list[Wheel]:
        """Both gears as the scene gives them."""
        gears = self.machine.scene.joints[self.joint.name].points
        return [read_wheel(self.machine.plan, gear) for gear in gears]

    @property
    def has_friction(self) -> bool:
        """True for two gears, whose efficiency depends on friction."""
        return not any(w.part.rack for w in self.wheels)

    def sheet(self, gear: str | None, friction: float) -> Sheet:
        """Figures, and the outline of both or of one of them."""
        joint, (first, second) = self.joint, self.wheels
        if gear:
            wrong = f"{self.machine.name}: the joint {joint.name} has no gear '{gear}'"
            check_known(gear, [first.name, second.name], wrong, 'its gears:')
        figures = list(self._common())
        if second.part.rack:
            distance, angle = self._rack_distance, joint.pressure_angle
            off = distance - first.gear.pitch_radius - first.gear.shift * first.gear.module
            figures += [
                PartFigure('distance_of_the_pitch_line', distance, 'm'),
                PartFigure('working_pressure_angle', angle, 'rad'),
                PartFigure('contact_ratio', joint.contact_ratio),
                PartFigure('backlash', 2.0 * max(off, 0.0) * math.tan(angle), 'm'),
            ]
            outline = gear_and_rack_outline(first.gear, distance, (first.name, second.name))
        else:
            pinion, wheel = sorted(self.wheels, key=lambda w: w.part.internal)
            bases = wheel.gear.base_radius + joint.sign * pinion.gear.base_radius
            pair = Pair(pinion.gear, wheel.gear, bases / math.cos(joint.pressure_angle))
            figures += _pair_figures(pair, friction * joint.friction_share)
            outline = pair_outline(pair, (pinion.name, wheel.name))
        if play := self.machine.plan.clearances.get(joint.name):
            width = 2.0 * (play.radial or 0.0) / math.cos(joint.pressure_angle)
            figures.append(PartFigure('backlash_of_the_scene', width, 'm'))
        for wheel in self.wheels:
            if not wheel.part.rack:
                figures += _gear_figures(wheel.name, wheel.gear)
            if wheel.name == gear and wheel.part.rack:
                outline = rack_outline(_RACK_TEETH, wheel.module, wheel.system)
            elif wheel.name == gear:
                outline = gear_outline(wheel.gear)
        title = f'{self.machine.name}: {first.name} and {second.name} in mesh'
        return Sheet(title, tuple(figures), outline)

    def _common(self) -> Iterator[PartFigure]:
        """Common facts of both gears, and how often their teeth meet."""
        first, joint = self.wheels[0], self.joint
        yield PartFigure('module', first.part.module, 'm')
        if first.part.helix_angle:
            yield PartFigure('helix_angle', first.part.helix_angle, 'rad')
            yield PartFigure('transverse_module', first.module, 'm')
        carrier = self.speed(joint.carrier)
        meetings = [
            w.gear.teeth * abs(self.speed(w.link) - carrier) / (2.0 * math.pi)
            for w in self.wheels
            if not w.part.rack
        ]
        if frequency := max(meetings):
            yield PartFigure('tooth_frequency', frequency, 'Hz')

    @property
    def _rack_distance(self) -> float:
        """Distance of the rack's pitch line from the gear's centre [m]."""
        ideal, joint = self.machine.plan.ideal, self.joint
        q = dict(zip(ideal.coordinates, self.machine.assembly.q.tolist(), strict=True))
        centre = ideal.locate(joint.first, q, joint.on_first)
        x, y = ideal.locate(joint.second, q, joint.on_second)
        towards = ideal.angle(joint.carrier, q) + joint.towards
        return float((x - centre[0]) * math.cos(towards) + (y - centre[1]) * math.sin(towards))


def _gear_figures(name: str, gear: Gear) -> Iterator[PartFigure]:
    """Sizes of a gear in its plane of rotation, and the limits of undercut if it has any."""
    yield PartFigure(f'{name}.teeth', gear.teeth)
    for circle in ('pitch', 'base', 'tip', 'root'):
        yield PartFigure(f'{name}.{circle}_radius', getattr(gear, f'{circle}_radius'), 'm')
    yield PartFigure(f'{name}.tooth_thickness', gear.thickness(gear.pitch_radius), 'm')
    yield PartFigure(f'{name}.tip_thickness', gear.tip_thickness, 'm')
    yield PartFigure(f'{name}.profile_shift', gear.shift, 'modules')
    if not gear.internal:
        yield PartFigure(f'{name}.least_profile_shift', gear.least_shift, 'modules')
        yield PartFigure(f'{name}.least_teeth', least_teeth(gear.system))
        yield PartFigure(f'{name}.form_radius', gear.form_radius, 'm')


def _pair_figures(pair: Pair, friction: float) -> Iterator[PartFigure]:
    """Facts of both gears of a pair; the efficiency for a coefficient in the plane."""
    yield PartFigure('centre_distance', pair.centre_distance, 'm')
    yield PartFigure('ratio', pair.ratio)
    yield PartFigure('pressure_angle', pair.pinion.system.pressure_angle, 'rad')
    yield PartFigure('working_pressure_angle', pair.pressure_angle, 'rad')
    yield PartFigure('contact_ratio', pair.contact_ratio)
    play = pair.backlash
    yield PartFigure('backlash', play if play > 1e-12 * pair.pinion.module else 0.0, 'm')
    yield PartFigure('tip_clearance', min(pair.clearances), 'm')
    yield PartFigure('efficiency', pair.efficiency(friction))


def gear_outline(gear: Gear, angle: float = 0.0, x: float = 0.0, name: str = '') -> Outline:
    """All teeth, with the pitch, base, tip and root circles.

    The fillets that the cutter leaves at the roots are not drawn.

    Parameters
    ----------
    angle : angle of one of the teeth from the x axis [rad]
    x : position of the shaft on that axis [m]
    name : prefix of the names of curves, as in ``pinion.profile``
    """
    points = gear.outline(FLANK, angle, ARC).T
    teeth = Polygon(f'{name}profile', points + np.array([[x], [0.0]]) if x else points)
    circles = (
        Circle(f'{name}{circle}', getattr(gear, f'{circle}_radius'), (x, 0.0))
        for circle in ('pitch', 'base', 'tip', 'root')
    )
    return Outline((teeth,), tuple(circles), ((x, 0.0),))


def rack_outline(
    teeth: int,
    module: float,
    system: ToothSystem = FULL_DEPTH,
    at: Vector2 | None = None,
    name: str = '',
) -> Outline:
    """The teeth of a rack towards x, its pitch line on the y axis; see `rack_teeth`.

    Parameters
    ----------
    at : of its first tooth, if it is turned about to face the y axis [m]
    name : name, as for `gear_outline`
    """
    points = rack_teeth(teeth, module, system).T
    line = np.array([(0.0, 0.0), points[1, [0, -1]]])
    if at:
        points, line = (np.array(at)[:, None] - curve for curve in (points, line))
    edge, guide = Polygon(f'{name}profile', points, False), Polygon(f'{name}pitch', line, False)
    return Outline((edge,), (guide,), () if at else ((0.0, 0.0),))


def pair_outline(pair: Pair, names: tuple[str, str] = ('pinion', 'wheel')) -> Outline:
    """Two gears in mesh, the flanks on both sides as far from each other as the backlash leaves.

    The pinion's shaft is at the origin, and one of its teeth on the x axis, in a space of the
    wheel.
    """
    # the pinion is inside of an internal wheel, near the side to which its tooth points
    c, facing = (
        (-pair.centre_distance, 0.0) if pair.wheel.internal else (pair.centre_distance, math.pi)
    )
    facing += math.pi / pair.wheel.teeth
    return _together(
        gear_outline(pair.pinion, name=f'{names[0]}.'),
        gear_outline(pair.wheel, facing, c, f'{names[1]}.'),
    )


def gear_and_rack_outline(
    gear: Gear, distance: float, names: tuple[str, str] = ('gear', 'rack')
) -> Outline:
    """A gear and a piece of its rack, as `pair_outline`; the rack is as long as the gear is wide.

    Parameters
    ----------
    distance : distance of the rack's pitch line from the shaft [m]
    """
    teeth = 2 * math.ceil(gear.teeth / 2.0 / math.pi) + 2
    at = distance, 0.5 * (teeth - 1) * gear.circular_pitch
    return _together(
        gear_outline(gear, name=f'{names[0]}.'),
        rack_outline(teeth, gear.module, gear.system, at, f'{names[1]}.'),
    )


def _together(one: Outline, two: Outline) -> Outline:
    return Outline(one.edges + two.edges, one.guides + two.guides, one.shafts + two.shafts)
