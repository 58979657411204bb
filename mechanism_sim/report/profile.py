"""The parts that touch in a joint of a machine: their figures, and their outlines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mechanism_sim import output
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, check_known, nearest
from mechanism_sim.export.outline_files import to_dxf, to_svg
from mechanism_sim.joints.bevel.constraint import BevelPair, SpatialPair
from mechanism_sim.joints.cam.constraint import CamPair, GroovePair
from mechanism_sim.joints.cam.followers import Oscillating, OscillatingFlat, Translating
from mechanism_sim.joints.cam.interference import find_cut_away
from mechanism_sim.joints.cam.laws import DERIVATIVES, check_smoothness, spelled
from mechanism_sim.joints.cam.profiles import (
    Cam,
    drawing_angles,
    extent,
    find_flaws,
    greatest,
    smallest_base_radius,
)
from mechanism_sim.joints.cam.sheet import cam_outline
from mechanism_sim.joints.mesh.constraint import GearMesh
from mechanism_sim.joints.mesh.gear_keys import Wheel, read_wheel
from mechanism_sim.joints.mesh.involute import Gear, least_teeth
from mechanism_sim.joints.mesh.pair import Pair
from mechanism_sim.joints.mesh.sheet import (
    gear_and_rack_outline,
    gear_outline,
    pair_outline,
    rack_outline,
)
from mechanism_sim.joints.sheets import Outline
from mechanism_sim.joints.worm.constraint import WormDrive, WormPair
from mechanism_sim.report.sections import Section, text
from mechanism_sim.scene.machine import Machine
from mechanism_sim.units import for_people

#: for which a base radius is proposed [rad]
PRESSURE_ANGLE = math.radians(30.0)
#: teeth of a rack that is drawn by itself
RACK_TEETH = 10

WRITERS = {'.svg': to_svg, '.dxf': to_dxf}


FRICTION = 0.05
"""Coefficient between teeth, if none is given."""


def profile(
    machine: Machine, name: str, gear: str | None = None, friction: float | None = None
) -> tuple[Sheet, Outline | None]:
    """Figures and outline of the cam, or of the gears, of a joint; bevel and worm pairs have none.

    Speeds are those at the start of the scene.

    Parameters
    ----------
    gear : of a mesh: the outline of this one only
    friction : coefficient for the efficiency of teeth, `FRICTION` if not given
    """
    joints = {j.name: j for j in machine.plan.ideal.joints}
    fitting = [n for n, j in joints.items() if isinstance(j, CamPair | GearMesh | SpatialPair)]
    joint = joints.get(name)
    rack = isinstance(joint, GearMesh) and any(w.part.rack for w in _Mesh(machine, joint).wheels)
    if friction is not None and (rack or isinstance(joint, CamPair | BevelPair)):
        raise InputError(
            f'{machine.name}: no figure of {name} depends on friction, only those of gears in '
            'mesh and of worms do'
        )
    if gear and isinstance(joint, CamPair | SpatialPair):
        what = 'a cam, no gears' if isinstance(joint, CamPair) else 'no outline in the plane'
        raise InputError(f'{machine.name}: the joint {name} has {what}')
    rubbing = FRICTION if friction is None else friction
    if isinstance(joint, GearMesh):
        return _Mesh(machine, joint).profile(gear, rubbing)
    if isinstance(joint, CamPair):
        return _cam(machine, joint)
    if isinstance(joint, BevelPair):
        return bevel_sheet(
            f'{machine.name}: bevel gears of {joint.first} and {joint.second}', joint
        ), None
    if isinstance(joint, WormDrive):
        title = f'{machine.name}: worm of {joint.first} and wheel of {joint.second}'
        return worm_sheet(title, joint.worm, rubbing), None
    wrong = 'has neither cam nor teeth' if joint else 'does not exist'
    raise InputError(
        f"{machine.name}: the joint '{name}' {wrong}{nearest(name, fitting)}; joints with a cam "
        f'or teeth: {", ".join(fitting) or "none"}'
    )


def table(machine: Machine, name: str) -> dict[str, Array]:
    """A cam over its turn, see `cam_table`."""
    joint = next((j for j in machine.plan.joints if j.name == name), None)
    if not isinstance(joint, CamPair):
        cams = [j.name for j in machine.plan.joints if isinstance(j, CamPair)]
        raise InputError(
            f'{machine.name}: --table is for cams, and {name} has none; joints with a cam: '
            f'{", ".join(cams) or "none"}'
        )
    return cam_table(joint.cam)


def write(outline: Outline | None, path: Path) -> None:
    """Write an outline as its ending says."""
    if outline is None:
        raise InputError(f'--output {path}: bevel and worm pairs have no outline in the plane')
    output.write_text(path, WRITERS[path.suffix](outline))


def _speed(machine: Machine, link: str) -> float:
    """Of a link at the start [rad/s], or [m/s] if it slides."""
    ideal = machine.plan.ideal
    frame = link if link in ideal.sliding else ideal.frame(link)[0]
    rates = dict(zip(ideal.coordinates, machine.assembly.v.tolist(), strict=True))
    return float(rates.get(frame, 0.0))


def _cam(machine: Machine, joint: CamPair) -> tuple[Sheet, Outline]:
    clearance = None
    if isinstance(joint, GroovePair):
        play = machine.plan.clearances.get(joint.name)
        clearance = 2.0 * (play.radial or 0.0) if play else 0.0
    sense = 1 if joint.distance.slides else joint.sense
    speed = sense * _speed(machine, joint.first)
    title = f'{machine.name}: the cam on {joint.first} that moves {joint.second}'
    return cam_sheet(title, joint.cam, clearance, speed), cam_outline(joint.cam, clearance)


class _Mesh:
    """The gears of one joint."""

    def __init__(self, machine: Machine, joint: GearMesh) -> None:
        self.machine, self.joint = machine, joint
        gears = machine.scene.joints[joint.name].points
        self.wheels = [read_wheel(machine.plan, gear) for gear in gears]

    def profile(self, chosen: str | None, friction: float) -> tuple[Sheet, Outline]:
        """Figures, and the outline of both or of one of them."""
        names = [w.name for w in self.wheels]
        if chosen:
            wrong = f"{self.machine.name}: the joint {self.joint.name} has no gear '{chosen}'"
            check_known(chosen, names, wrong, 'its gears:')
        figures = [*self._common(), *self._between(friction)]
        for wheel in self.wheels:
            if not wheel.part.rack:
                figures += gear_figures(wheel.name, wheel.gear)
        title = f'{self.machine.name}: {names[0]} and {names[1]} in mesh'
        alone = [w for w in self.wheels if w.name == chosen]
        outline = _alone(alone[0]) if alone else self._outline()
        return Sheet(title, tuple(figures)), outline

    def _common(self) -> Iterator[PartFigure]:
        """Common facts of both gears, and how often their teeth meet."""
        first, joint = self.wheels[0], self.joint
        yield PartFigure('module', first.part.module, 'm')
        if first.part.helix_angle:
            yield PartFigure('helix_angle', first.part.helix_angle, 'rad')
            yield PartFigure('transverse_module', first.module, 'm')
        carrier = _speed(self.machine, joint.carrier)
        meetings = [
            w.gear.teeth * abs(_speed(self.machine, w.link) - carrier) / (2.0 * math.pi)
            for w in self.wheels
            if not w.part.rack
        ]
        if frequency := max(meetings):
            yield PartFigure('tooth_frequency', frequency, 'Hz')

    def _between(self, friction: float) -> Iterator[PartFigure]:
        if self.wheels[1].part.rack:
            yield from self._with_rack()
        else:
            yield from pair_figures(self._pair[0], friction)
        if self.joint.name in self.machine.plan.clearances:
            play = self.machine.plan.clearances[self.joint.name].radial or 0.0
            yield PartFigure(
                'backlash_of_the_scene', 2.0 * play / math.cos(self.joint.pressure_angle), 'm'
            )

    @property
    def _pair(self) -> tuple[Pair, tuple[str, str]]:
        """The pinion first, and their names."""
        pinion, wheel = sorted(self.wheels, key=lambda w: w.part.internal)
        one, two = pinion.gear, wheel.gear
        bases = (
            two.base_radius - one.base_radius
            if two.internal
            else two.base_radius + one.base_radius
        )
        pair = Pair(one, two, bases / math.cos(self.joint.pressure_angle))
        return pair, (pinion.name, wheel.name)

    def _with_rack(self) -> Iterator[PartFigure]:
        angle = self.joint.pressure_angle
        yield PartFigure('distance_of_the_pitch_line', self._rack_distance, 'm')
        yield PartFigure('working_pressure_angle', angle, 'rad')
        yield PartFigure('contact_ratio', self.joint.contact_ratio)
        yield PartFigure('backlash', 2.0 * self._rack_stands_off * math.tan(angle), 'm')

    @property
    def _rack_distance(self) -> float:
        """Of its pitch line from the gear's centre [m]."""
        ideal, joint = self.machine.plan.ideal, self.joint
        q = dict(zip(ideal.coordinates, self.machine.assembly.q.tolist(), strict=True))
        centre = ideal.locate(joint.first, q, joint.on_first)
        x, y = ideal.locate(joint.second, q, joint.on_second)
        towards = ideal.angle(joint.carrier, q) + joint.towards
        return (x - centre[0]) * math.cos(towards) + (y - centre[1]) * math.sin(towards)

    @property
    def _rack_stands_off(self) -> float:
        gear: Gear = self.wheels[0].gear
        return max(self._rack_distance - gear.pitch_radius - gear.shift * gear.module, 0.0)

    def _outline(self) -> Outline:
        first, second = self.wheels
        if second.part.rack:
            names = first.name, second.name
            return gear_and_rack_outline(first.gear, self._rack_distance, names)
        return pair_outline(*self._pair)


def _alone(wheel: Wheel) -> Outline:
    if wheel.part.rack:
        return rack_outline(RACK_TEETH, wheel.module, wheel.system)
    return gear_outline(wheel.gear)


class PartFigure(NamedTuple):
    """One line of a table."""

    name: str
    value: float
    unit: str = ''  #: SI; empty for a number
    at: float | None = None  #: angle [rad] of the cam, or its displacement [m]


@dataclass(frozen=True)
class Sheet:
    """Facts of a part.

    Parameters
    ----------
    title : a line
    figures : the table
    remarks : sentences
    reciprocating : a cam that slides, so that places on it are in metres
    """

    title: str
    figures: tuple[PartFigure, ...]
    remarks: tuple[str, ...] = ()
    reciprocating: bool = False

    def render(self) -> str:
        """For people: degrees and millimetres, and a column for each gear."""
        common = [_cells(f, self._place(f)) for f in self.figures if '.' not in f.name]
        own: dict[str, dict[str, PartFigure]] = {}
        for figure in self.figures:
            gear, dot, name = figure.name.partition('.')
            if dot:
                own.setdefault(name, {})[gear] = figure
        gears = list(dict.fromkeys(gear for row in own.values() for gear in row))
        columns = [('', *gears, '')] if gears else []
        for name, row in own.items():
            cells = [_cells(row[gear]) if gear in row else ('',) * 3 for gear in gears]
            unit = next(iter(cell[2] for cell in cells if cell[2]), '')
            columns.append((name.replace('_', ' '), *(cell[1] for cell in cells), unit))
        sections = Section(self.title, **_table(common)), Section(**_table(columns))
        return text([*sections, Section(notes=self.remarks)])

    def _place(self, figure: PartFigure) -> str:
        if figure.at is None:
            return ''
        # extremes at breaks of a law are found a hair beside them
        at = round(figure.at, 9) + 0.0
        return f'at {spelled(at, reciprocating=self.reciprocating)}'

    def to_json(self) -> dict[str, object]:
        """In SI units."""
        return {
            'figures': {
                f.name: {'value': f.value, 'unit': f.unit} | ({} if f.at is None else {'at': f.at})
                for f in self.figures
            },
            'remarks': list(self.remarks),
        }


def _cells(figure: PartFigure, *more: str) -> tuple[str, ...]:
    unit, scale = for_people(figure.unit)
    return figure.name.replace('_', ' '), f'{scale * figure.value:.6g}', unit, *more


def _table(rows: Sequence[tuple[str, ...]]) -> dict[str, Any]:
    """A table with numbers to the right; units and what follows them to the left."""
    columns = enumerate(zip(*rows, strict=True))
    texts = [i for i, cells in columns if not any(cell[:1].isdecimal() for cell in cells)]
    return {'table': rows, 'left': texts}


def cam_sheet(
    title: str, cam: Cam, clearance: float | None = None, speed: float | None = None
) -> Sheet:
    """Sizes and limits of a cam, and what is wrong with it.

    Parameters
    ----------
    clearance : of the roller in a groove [m]; None: no groove
    speed : of the cam [rad/s] or [m/s]; without it sliding, or the rolling of a roller, is by
        radians or metres of the cam
    """
    remarks = [str(flaw) for flaw in (*find_flaws(cam, clearance), *find_cut_away(cam))]
    jumps = [str(jump) for jump in check_smoothness(cam.law, 3)]
    figures = list(_cam_figures(cam, speed))
    if isinstance(cam.follower, Translating | Oscillating) and not cam.law.reciprocating:
        try:
            radius = smallest_base_radius(cam.law, cam.follower, PRESSURE_ANGLE)
            figures.append(PartFigure('base_radius_for_30_deg', radius, 'm'))
        except InputError as told:
            remarks.append(f'{told}')
    return Sheet(title, tuple(figures), (*remarks, *jumps), cam.law.reciprocating)


def _cam_figures(cam: Cam, speed: float | None) -> Iterator[PartFigure]:
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


def cam_table(cam: Cam) -> dict[str, Array]:
    """A cam over its turn or stroke, (N,) by name, in SI units; both sides of every break.

    Derivatives, and speeds of the point of contact and of sliding, are by radians of the cam, or
    by metres if it slides; the profile is in the frame of `mechanism_sim.joints.cam.touch`.
    """
    law = cam.law
    x = drawing_angles(law, extent(law) / 360)
    touch = cam.at(x)
    return {
        'cam': x,
        **{name: law(x, order) for order, name in enumerate(DERIVATIVES)},
        'pressure_angle': touch.pressure_angle,
        'contact.x': touch.profile[0],
        'contact.y': touch.profile[1],
        'contact_speed': touch.rate,
        'sliding_speed': touch.sliding,
    }


def _radii(cam: Cam) -> Iterator[PartFigure]:
    """Of curvature: where the profile bulges most, and where it is most hollow."""
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


def gear_figures(name: str, gear: Gear) -> Iterator[PartFigure]:
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


def pair_figures(pair: Pair, friction: float) -> Iterator[PartFigure]:
    """Facts of both gears of a pair; the efficiency for a coefficient of friction."""
    yield PartFigure('centre_distance', pair.centre_distance, 'm')
    yield PartFigure('ratio', pair.ratio)
    yield PartFigure('pressure_angle', pair.pinion.system.pressure_angle, 'rad')
    yield PartFigure('working_pressure_angle', pair.pressure_angle, 'rad')
    yield PartFigure('contact_ratio', pair.contact_ratio)
    play = pair.backlash
    yield PartFigure('backlash', play if play > 1e-12 * pair.pinion.module else 0.0, 'm')
    yield PartFigure('tip_clearance', min(pair.clearances), 'm')
    yield PartFigure('efficiency', pair.efficiency(friction))


def bevel_sheet(title: str, pair: BevelPair) -> Sheet:
    """Sizes of bevel gears; what is of each has the name of its link."""
    figures = [
        PartFigure('ratio', 1.0 / float(pair.ratio)),
        PartFigure('shaft_angle', sum(pair.cones), 'rad'),
        PartFigure('pressure_angle', pair.pressure_angle, 'rad'),
    ]
    for link, radius, cone in zip(
        (pair.first, pair.second), pair.mean_radii, pair.cones, strict=True
    ):
        figures.append(PartFigure(f'{link}.pitch_angle', cone, 'rad'))
        figures.append(PartFigure(f'{link}.mean_radius', radius, 'm'))
    return Sheet(title, tuple(figures))


def worm_sheet(title: str, pair: WormPair, friction: float) -> Sheet:
    """Sizes of a worm and its wheel, and their efficiency for a coefficient of friction."""
    figures = [
        PartFigure('ratio', pair.teeth / pair.threads),
        PartFigure('lead', pair.lead, 'm'),
        PartFigure('lead_angle', pair.lead_angle, 'rad'),
        PartFigure('wheel_helix_angle', pair.lead_angle, 'rad'),
        PartFigure('worm_diameter', pair.diameter, 'm'),
        PartFigure('wheel_diameter', pair.wheel_diameter, 'm'),
        PartFigure('centre_distance', pair.centre_distance, 'm'),
        PartFigure('efficiency', pair.forces(1.0, friction).efficiency),
        PartFigure('self_locking_friction', pair.locking_friction),
    ]
    if pair.self_locking(friction):
        remark = f'at a friction of {friction:g} it is self-locking: its wheel cannot drive it'
        return Sheet(title, tuple(figures), (remark,))
    driven = pair.forces(1.0, friction, wheel_drives=True).efficiency
    return Sheet(title, (*figures, PartFigure('efficiency_wheel_drives', driven)))
