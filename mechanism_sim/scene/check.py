"""What a scene comes down to: its level, and what was left out and why."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

import numpy as np

from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.mechanism import HigherPair, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.doubts import doubts
from mechanism_sim.scene.elastic_links import elastic_notes
from mechanism_sim.scene.gate import admit
from mechanism_sim.scene.instruments import sensor_notes
from mechanism_sim.scene.kinds import KINDS
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_notes import Limit, motion_notes
from mechanism_sim.scene.nominal_model import Level
from mechanism_sim.scene.oscillators import oscillator_notes
from mechanism_sim.scene.tilted_links import tilt_notes
from mechanism_sim.scene.unused import unused
from mechanism_sim.units import Measure

_WHY = {
    Level.KINEMATIC: 'the drives are prescribed, every joint is ideal, and forces are not asked '
    'for, have no limit, or masses are not given: loop closure',
    Level.INVERSE_DYNAMICS: 'the drives are prescribed, every joint is ideal, and forces are '
    'asked for: loop closure and a linear solve for the forces',
    Level.SMOOTH: 'every joint is ideal, or a belt that may slip, and the drives leave a motion '
    'free: equations of motion with closed loops',
    Level.NONSMOOTH: 'joints have clearance: equations of motion with gaps, and an event loop for '
    'free flight, impact and following',
    Level.COMPLIANT: 'joints have clearance and a law of contact force, or teeth or belts give '
    'way: equations of motion with forces where parts overlap',
}


@dataclass(frozen=True)
class Start:
    """How a gap starts."""

    joint: str
    open: float  #: [m]; negative: pressed in
    closing: float  #: [m/s]; negative: it opens

    def __str__(self) -> str:
        if not self.closing:
            return f'starts open by {self.open:.6g} m, at rest'
        way = 'closing' if self.closing > 0.0 else 'opening'
        return f'starts open by {self.open:.6g} m, {way} at {abs(self.closing):.6g} m/s'


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
    starts: dict[str, Start]  #: of every gap
    limits: list[str]  #: what stops the machine, or may: the first of its notes
    left_out: list[str]
    notes: list[str]
    questions: list[str] = field(default_factory=list)  #: values about a thousand times off

    def to_json(self) -> dict[str, object]:
        """As a plain dictionary."""
        return asdict(self)


def check(machine: Machine) -> Report:
    """Look at a scene without running it."""
    scene, level = machine.scene, machine.level
    admit(machine)
    rest = 'free (integrated)' if machine.dynamic else 'follows from the closed loops'
    straight = machine.mechanism.displacements
    coordinates = {
        c: ('displacement, ' if c in straight else '') + rest
        for c in machine.mechanism.coordinates
    }
    coordinates |= {c: _drive(machine, c) for c in machine.plan.laws}
    relations, gaps, warnings = [], [], []
    for joint, c in machine.clearances.items():
        pair = machine.mechanism.joint(joint)
        if isinstance(pair, HigherPair) and pair.elastic:
            continue
        if c.friction and c.restitution and c.hypothesis == 'newton':
            warnings.append(
                f"{joint}: Newton's restitution with friction can create energy where sliding "
                "stops or turns within an impact; 'hypothesis: poisson' or 'stronge' cannot"
            )
        friction = f', friction {c.friction:g}' if c.friction else ''
        if isinstance(pair, HigherPair):
            room = f'play {c.radial:g} m to either side' if len(pair.sides) > 1 else 'may lift off'
            gaps.append(
                f'{joint}: {pair.parts}, {room}, {c.hypothesis.capitalize()} restitution '
                f'{c.restitution:g}{friction}'
            )
            continue
        block = isinstance(pair, Prismatic)
        kind = 'block in its guide, play' if block else 'pin in bushing, radial clearance'
        if c.film:
            kind = 'pin in oil, radial clearance'
        if not c.wall:
            gaps.append(f'{joint}: {kind} {c.radial:g} m, walls that never touch')
            continue
        gaps.append(
            f'{joint}: {kind} {c.radial:g} m{" to either side" if block else ""}, '
            f'{c.hypothesis.capitalize()} restitution {c.restitution:g}{friction}, start '
            f'{"centred" if c.film else scene.start}'
        )
    for name in machine.mechanism.cut:
        if name not in machine.clearances:
            single = isinstance(machine.mechanism.joint(name), HigherPair)
            relations.append(f'{name}: closes a loop, {"1 equation" if single else "2 equations"}')
    notes = [*warnings, *_notes(machine)]
    left_out = []
    if level is not Level.KINEMATIC and not any(scene.gravity):
        left_out.append('gravity: it is zero')
    if level is Level.KINEMATIC:
        left_out.append(
            'masses, gravity and forces: '
            + (', '.join(machine.without_forces) + ' takes forces without limit'
               if machine.without_forces else 'nobody asks for them')
        )  # fmt: skip
    left_out += unused(machine)
    if gaps:
        if not any(c.friction for c in machine.clearances.values()):
            left_out.append('friction and pin radius: none given')
        if len(gaps) < sum(isinstance(j, Revolute) for j in machine.plan.joints):
            left_out.append('clearance in the other joints: none given')
    grounded = [{j.first, j.second} for j in machine.plan.joints if GROUND in (j.first, j.second)]
    given = machine.plan.prescribed if machine.dynamic else []
    left_out += [
        f'{c} inertia: its motion is given' for c in given if any(c in ends for ends in grounded)
    ]
    return Report(
        machine.name,
        scene.title,
        level.value,
        _WHY[level],
        coordinates,
        relations,
        gaps,
        _starts(machine),
        [note for note in notes if isinstance(note, Limit)],
        left_out,
        notes,
        doubts(machine),
    )


def _starts(machine: Machine) -> dict[str, Start]:
    """How all gaps start."""
    if not machine.dynamic:
        return {}
    system, state, seen = machine.system, machine.initial_state(), machine.observer
    place = dict(zip(system.free, zip(state.q, state.v, strict=True), strict=True))
    place |= {c: machine.held[c] for c in system.prescribed}
    q, v = np.array([place[c] for c in system.coordinates]).T[:, :, None]
    opened = seen.distances(seen.gap_values(q))[:, 0].tolist()
    closed = (-seen.gap_rates(q, v)[:, 0]).tolist() if system.gaps else []
    size = machine.mechanism.size
    pace = max(1.0, float(np.abs(v).max(initial=0.0)))
    return {
        gap.name: Start(
            gap.joint,
            0.0 if abs(x) < 1e-14 * size else x,
            0.0 if abs(w) < 1e-12 * size * pace else w,
        )
        for gap, x, w in zip(system.gaps, opened, closed, strict=True)
    }


def _drive(machine: Machine, coordinate: str) -> str:
    """What moves a coordinate."""
    laws = machine.plan.laws[coordinate]
    law, straight = laws[0], coordinate in machine.mechanism.displacements
    pace, force, place = ('m/s', 'N', 'm') if straight else ('rad/s', 'N m', 'rad')
    if not isinstance(law, DriveLaw):
        constant, per_angle, per_speed = law.coefficients
        begin = machine.plan.begins.get(coordinate, (0.0, 0.0))[1]
        for motor in machine.plan.motors:
            if motor.coordinate == coordinate:
                return f'free, moved by {motor.name}, from {begin:g} {pace}'
        if not any(law.coefficients):
            return 'free'
        return (
            f'free, moved by {constant:g} {force} {per_angle:+g} {force}/{place} times '
            f'{"displacement" if straight else "angle"} {per_speed:+g} {force} s/{place} times '
            f'speed, from {begin:g} {pace}'
        )
    given = machine.scene.drives.get(coordinate, machine.scene.drive)
    effort = given.effort if given else None
    shown = f'{effort.value:g} {force}' if isinstance(effort, Measure) else effort
    with_effort = '' if effort is None else f', with {shown}'
    if len(laws) > 1:
        return f'prescribed, a profile of speeds in {len(laws)} pieces{with_effort}'
    speed = law.coefficients[1] if law.degree else 0.0
    changing = ' at the start, and then another' if law.degree > 1 else ''
    return f'prescribed, {speed:g} {pace}{changing}{with_effort}'


def _notes(machine: Machine) -> list[str]:
    scene, mechanism = machine.scene, machine.plan.ideal
    start = dict(zip(mechanism.coordinates, machine.assembly.q.tolist(), strict=True))
    notes = motion_notes(mechanism, start, machine.plan.laws)
    for joint in machine.plan.joints:
        notes += KINDS[scene.joints[joint.name].kind].notes(machine, joint)
    rubbing = (f'{f.name}: friction, {f.words}' for f in machine.plan.frictions(mechanism))
    notes += dict.fromkeys(rubbing)
    notes += elastic_notes(machine.mechanism, machine.period, bool(machine.clearances))
    notes += tilt_notes(machine.mechanism)
    notes += sensor_notes(machine)
    notes += oscillator_notes(machine)
    for load in machine.plan.unknowns(machine.plan.ideal):
        notes.append(
            f'{load.name}: its size [{load.unit}] follows from the motion and the efforts'
        )
    if machine.dynamic:
        notes.append(f'rtol {scene.solver.rtol:g}, atol {scene.solver.atol:g} m')
    return notes


def render(report: Report) -> str:
    """The report as text for people."""
    lines = [f'{report.scene}: {report.title}']
    if report.questions:
        lines += ['questions', *(f'  {question}' for question in report.questions)]
    if report.limits:
        lines += ['what may stop it', *(f'  {note}' for note in report.limits)]
    lines += [f'level: {report.level}', f'  {report.why}', 'coordinates']
    lines += [f'  {name}: {what}' for name, what in report.coordinates.items()]
    for heading, items in (
        ('relations', report.relations),
        ('gaps', [*report.gaps, *(f'{name}: {start}' for name, start in report.starts.items())]),
        ('left out', report.left_out),
        ('notes', [note for note in report.notes if note not in report.limits]),
    ):
        if items:
            lines += [heading, *(f'  {item}' for item in items)]
    return '\n'.join(lines)
