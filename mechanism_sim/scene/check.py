"""What a scene comes down to: its level, and what was left out and why."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from mechanism_sim.linkages.four_bar import FourBar
from mechanism_sim.linkages.grashof import (
    change_points,
    classify,
    crank_limits,
    crank_turns,
    excess,
    transmission_range,
)
from mechanism_sim.linkages.mobility import mobility
from mechanism_sim.planar.configuration import Constraints, poses
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.mechanism import Mechanism
from mechanism_sim.scene.machine import CLOSING_JOINT, Level, Machine

#: transmission angles [deg] below this are usually avoided
LEAST_TRANSMISSION = 30.0

_WHY = {
    Level.KINEMATIC: 'the crank is prescribed, every joint is ideal, and forces are not asked for '
    'or masses not given: closed-form loop closure',
    Level.INVERSE_DYNAMICS: 'the crank is prescribed, every joint is ideal, and forces are asked '
    'for: closed-form loop closure and a linear solve for the forces',
    Level.SMOOTH: 'every joint is ideal and a torque moves the crank: equations of motion with a '
    'closed loop',
    Level.NONSMOOTH: 'joints have clearance: equations of motion with gaps, and an event loop for '
    'free flight, impact and following',
    Level.COMPLIANT: 'joints have clearance and a law of contact force: equations of motion with '
    'forces where pin and bushing overlap',
}


@dataclass(frozen=True)
class Report:
    """The outcome of `check`."""

    scene: str
    title: str
    level: str
    why: str
    coordinates: dict[str, str]  #: name: prescribed, follows or free
    relations: list[str]
    gaps: list[str]
    left_out: list[str]
    notes: list[str]

    def to_json(self) -> dict[str, object]:
        """As a plain dictionary."""
        return asdict(self)


def check(machine: Machine) -> Report:
    """Look at a scene without running it.

    Raises
    ------
    InputError
        If the machine cannot start where it should; the rest was refused when it was built.
    """
    scene, level = machine.scene, machine.level
    if machine.dynamic:
        machine.initial_state()
    rest = 'free (integrated)' if machine.dynamic else 'follows from the closed loop'
    coordinates = dict.fromkeys(machine.mechanism.coordinates, rest)
    coordinates['crank'] = _drive(machine)
    relations, gaps, warnings = [], [], []
    for joint, c in machine.clearances.items():
        friction = f', friction {c.friction:g}' if c.friction else ''
        gaps.append(
            f'{joint}: pin in bushing, radial clearance {c.radial:g} m, '
            f'{c.hypothesis.capitalize()} restitution {c.restitution:g}{friction}, start '
            f'{scene.start}'
        )
        if c.friction and c.restitution and c.hypothesis == 'newton':
            warnings.append(
                f"{joint}: Newton's restitution with friction can create energy where sliding "
                "stops or turns within an impact; 'hypothesis: poisson' or 'stronge' cannot"
            )
    if not gaps:
        relations.append(f'{CLOSING_JOINT}: closes the loop, 2 equations')
    left_out = []
    if level is not Level.KINEMATIC and not any(scene.gravity):
        left_out.append('gravity: it is zero')
    if level is Level.KINEMATIC:
        left_out.append('masses, gravity and forces: nobody asks for them')
    if gaps:
        if not any(c.friction for c in machine.clearances.values()):
            left_out.append('friction and pin radius: none given')
        if len(gaps) < len(type(scene.joints).model_fields):
            left_out.append('clearance in the other joints: none given')
    if machine.dynamic and 'crank' in machine.system.prescribed:
        left_out.append('crank inertia: its motion is given')
    return Report(
        machine.name,
        scene.title,
        level.value,
        _WHY[level],
        coordinates,
        relations,
        gaps,
        left_out,
        [*warnings, *_notes(machine)],
    )


def _drive(machine: Machine) -> str:
    """What moves the crank."""
    law, profile = machine.law, machine.scene.drive.profile
    if not isinstance(law, DriveLaw):
        constant, per_angle, per_speed = law.coefficients
        return (
            f'free, moved by {constant:g} N m {per_angle:+g} N m/rad times angle {per_speed:+g} '
            f'N m s/rad times speed, from {machine.start_of_crank[1]:g} rad/s'
        )
    if profile:
        return f'prescribed, {len(profile.points)} speeds joined by {profile.ramp} ramps'
    return f'prescribed, {machine.scene.drive.speed:g} rad/s'


def _notes(machine: Machine) -> list[str]:
    scene = machine.scene
    crank = machine.start_of_crank[0]
    coupler, rocker = (float(x) for x in machine.linkage.positions(np.array(crank)))
    start = {'crank': crank, 'coupler': coupler, 'rocker': rocker}
    notes = [mobility_note(machine.ideal, start), *four_bar_notes(machine.linkage)]
    notes += [
        f'sensor {name}: {s.kind} on the {s.link}, {s.at:g} m from its proximal joint, {s.axis} '
        f'the link, {s.sample_rate:g} Hz'
        for name, s in scene.sensors.items()
    ]
    if machine.dynamic:
        notes.append(f'rtol {scene.solver.rtol:g}, atol {scene.solver.atol:g} m')
    return notes


def mobility_note(mechanism: Mechanism, q: Mapping[str, float]) -> str:
    """Degrees of freedom at coordinates, and why they are not as many as Kutzbach counts."""
    seen = mobility(Constraints.of(mechanism), poses(mechanism, q))
    alike = seen.finite == seen.kutzbach
    text = f'mobility: {seen.finite}, {"as" if alike else "where"} Kutzbach counts'
    if not alike:
        text += f' {seen.kutzbach}'
    if seen.instantaneous > seen.finite:
        text += f'; {seen.instantaneous} at the start, which is a singular position'
    if seen.redundant:
        text += f'; {seen.redundancy} redundant among {", ".join(seen.redundant)}'
    return text


def four_bar_notes(linkage: FourBar) -> list[str]:
    """How the links of a four-bar move, and how well the coupler moves the rocker."""
    spare = float(excess(linkage.lengths))
    compared = f'{abs(spare):.6g} m {"less" if spare > 0 else "more"} than'
    if lines := change_points(linkage):
        compared = 'equal to'
    notes = [
        f'Grashof: {classify(linkage.lengths)}, the sum of shortest and longest link is '
        f'{compared} that of the others'
    ]
    if lines:
        angles = ' and '.join(f'{math.degrees(x):g}' for x in lines)
        notes.append(f'change point: all links lie in one line at crank angle {angles} deg')
    elif not crank_turns(linkage):
        low, high = (math.degrees(x) for x in crank_limits(linkage))
        notes.append(f'the crank cannot turn: it stays between {_between(low, high)} deg')
    least, greatest = (math.degrees(x) for x in transmission_range(linkage))
    note = f'transmission angle: {least:.4g} to {greatest:.4g} deg'
    worst = min(least, 180.0 - greatest)
    if worst < LEAST_TRANSMISSION:
        note += f'; within {LEAST_TRANSMISSION:g} deg of 0 or 180 the rocker is hard to move'
    return [*notes, note]


def _between(low: float, high: float) -> str:
    """Limits [deg] of an angle whose absolute value is limited."""
    if high == 180.0:
        return f'{low:.6g} and {360.0 - low:.6g}'
    if low == 0.0:
        return f'{-high:.6g} and {high:.6g}'
    return f'{low:.6g} and {high:.6g}, or {-high:.6g} and {-low:.6g}'


def render(report: Report) -> str:
    """The report as text for people."""
    lines = [f'{report.scene}: {report.title}', f'level: {report.level}', f'  {report.why}']
    lines.append('coordinates')
    lines += [f'  {name}: {what}' for name, what in report.coordinates.items()]
    for heading, items in (
        ('relations', report.relations),
        ('gaps', report.gaps),
        ('left out', report.left_out),
        ('notes', report.notes),
    ):
        if items:
            lines += [heading, *(f'  {item}' for item in items)]
    return '\n'.join(lines)
