"""Values of a running machine that a page can change, and their limits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

from mechanism_sim.export.bending import round_below
from mechanism_sim.messages.part_states import integrator_of
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.scene import Machine
from mechanism_sim.scene.drives import drive_key, drive_of
from mechanism_sim.units import for_people, unrounded

DRIVE = 'crank_drive'
RPM = 30.0 / math.pi
TURN, SLOWEST = 4.0, 1e-3
"""[s] of ours in which a turn can be followed; and the slowest pace."""


@dataclass(frozen=True)
class Control:
    """A value that a slider sets."""

    path: str  #: path in the scene; outside of it, the name of the parameter
    label: str
    unit: str  #: unit of display, of all limits and values here
    low: float
    high: float
    step: float
    value: float
    effect: Literal['now', 'restart']  #: effect on the present run, or by a restart
    scale: float = 1.0  #: value in this unit of 1 in SI units
    #: node and parameter that are set; with a restart the scene's `path` is set
    owner: str = DRIVE
    parameter: str = ''
    quantity: str = ''  #: SI unit of the value in a scene
    logarithmic: bool = False  #: True if equal distances on the slider are equal ratios

    def to_json(self) -> dict[str, Any]:
        """Description for a page."""
        keys = 'path', 'label', 'unit', 'low', 'high', 'step', 'value', 'effect', 'logarithmic'
        return {key: getattr(self, key) for key in keys}

    @property
    def in_scene(self) -> bool:
        """True of a value of the scene, which the next run can have."""
        return '.' in self.path

    def si(self, value: float) -> float:
        """A value [SI] of one that a page gives."""
        return unrounded(value / self.scale)

    def override(self, value: float) -> str:
        """``PATH=VALUE`` for a value of a page."""
        return f'{self.path}={self.si(value)!r} {self.quantity}'.rstrip()

    def at(self, si: float) -> Control:
        """The control where the machine has this value [SI]."""
        return replace(self, value=si * self.scale)


def visible_pace(machine: Machine, duration: float = math.inf) -> float:
    """Seconds of the machine in one of ours in which its motion can be followed, 1 at most.

    At it a turn of the drive, or a run that is shorter, takes about four seconds.
    """
    return round_below(min(max(min(machine.drive.period, duration) / TURN, SLOWEST), 1.0))


def controls(machine: Machine) -> dict[str, Control]:
    """The controls of a machine by their paths."""
    return {control.path: control for control in _all(machine)}


def _all(machine: Machine) -> Iterator[Control]:
    yield Control(
        'realtime_factor', 'Real-time factor', '×', SLOWEST, 10.0, 0.0, 1.0, 'now',
        parameter='realtime_factor', logarithmic=True,
    )  # fmt: skip
    yield from _drive(machine)
    for joint in machine.bearings:
        radial = machine.plan.clearances[joint.name].radial
        unit, scale = for_people('m', 10.0 * radial)
        yield Control(
            f'joints.{joint.name}.clearance.radial', f'Clearance of {joint.name}',
            unit, 0.1 * scale * radial, 10.0 * scale * radial, 0.0, scale * radial, 'restart',
            scale, quantity='m', logarithmic=True,
        )  # fmt: skip
    for name, play in machine.plan.rigid.items():
        path = _path_of_restitution(machine, name)
        if play.contact is None and path:
            yield Control(
                path, f'Restitution of {name}', '', 0.0, 1.0, 0.01, play.restitution,
                'now', owner=integrator_of(machine),
                parameter=f'joints.{name}.clearance.restitution',
            )  # fmt: skip


def _drive(machine: Machine) -> Iterator[Control]:
    """Speed or torque of the main drive: by command if it takes them, else of the next run."""
    law, commands, main = machine.drive.law, machine.drive.commands, machine.plan.main
    given = drive_of(machine.plan, main)
    straight = machine.plan.main in machine.mechanism.displacements
    if not isinstance(law, DriveLaw):
        now = law.coefficients[0]
        if now:
            what, unit = ('Force', 'N') if straight else ('Torque', 'N m')
            unit, scale = for_people(unit, 3.0 * abs(now))
            most = 3.0 * scale * abs(now)
            yield Control(
                'effort', f'{what} of {machine.plan.main}', unit, -most, most,
                most / 300.0, scale * now, 'now', scale, parameter='effort',
            )  # fmt: skip
        return
    label = f'Speed of {machine.plan.main}'
    now = machine.drive.start[1]
    if commands:
        most = RPM * commands.fastest
        yield Control(
            'velocity', label, 'rpm', -most, most, most / 500.0, RPM * now, 'now', RPM,
            parameter='velocity',
        )  # fmt: skip
    elif now and given and given.speed is not None and machine.drive.steady:
        scale, unit, quantity = (1.0, 'm/s', 'm/s') if straight else (RPM, 'rpm', 'rad/s')
        low, high = sorted((0.1 * scale * now, 3.0 * scale * now))
        yield Control(
            f'{drive_key(machine.plan, main)}.speed', label, unit, low, high,
            (high - low) / 500.0, scale * now, 'restart', scale, quantity=quantity,
        )  # fmt: skip


def _path_of_restitution(machine: Machine, name: str) -> str:
    """Path in the scene of a joint's restitution; empty if it takes a default."""
    joint = machine.scene.joints[name]
    for part in ('clearance', 'lift_off', 'groove', 'backlash'):
        if getattr(getattr(joint, part, None), 'restitution', None) is not None:
            return f'joints.{name}.{part}.restitution'
    return ''
