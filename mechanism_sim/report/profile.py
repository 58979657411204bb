"""The parts that touch in a joint of a machine: their figures, and their outlines."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from mechanism_sim import output
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError, nearest
from mechanism_sim.export.dxf import to_dxf
from mechanism_sim.export.outlines import (
    Outline,
    cam_outline,
    gear_and_rack_outline,
    gear_outline,
    pair_outline,
    rack_outline,
)
from mechanism_sim.export.svg import to_svg
from mechanism_sim.joints.bevel.constraint import BevelPair, SpatialPair
from mechanism_sim.joints.cam.constraint import CamPair, GroovePair
from mechanism_sim.joints.mesh.gear_keys import Wheel, read_wheel
from mechanism_sim.joints.mesh.involute import Gear
from mechanism_sim.joints.mesh.joint import GearMesh
from mechanism_sim.joints.mesh.pair import Pair
from mechanism_sim.joints.worm.constraint import WormDrive
from mechanism_sim.report.parts import (
    PartFigure,
    Sheet,
    bevel_sheet,
    cam_sheet,
    cam_table,
    gear_figures,
    pair_figures,
    worm_sheet,
)
from mechanism_sim.scene.machine import Machine

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
        if chosen and chosen not in names:
            raise InputError(
                f"{self.machine.name}: the joint {self.joint.name} has no gear '{chosen}'"
                f'{nearest(chosen, names)}; its gears: {", ".join(names)}'
            )
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
