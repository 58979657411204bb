"""Report on a scene: its level, and what was left out and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.polynomial import polynomial

from mechanism_sim.joints.contact_keys import ClearanceSpec
from mechanism_sim.numerics.sampled import (
    SampledPeak,
    acceleration_peaks,
    describe_peaks,
    determined,
)
from mechanism_sim.planar.drive import DriveLaw, ends
from mechanism_sim.planar.mechanism import HigherPair, Joint, Prismatic, Revolute
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.drives import drive_key, drive_of
from mechanism_sim.scene.elastic_links import elastic_notes
from mechanism_sim.scene.level import Level
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_keys import MotionProfile, SpeedPart
from mechanism_sim.scene.motion_notes import Limit, motion_notes
from mechanism_sim.scene.remarks import plausibility_warnings, unused
from mechanism_sim.scene.schema import SensorPart
from mechanism_sim.scene.start import Start
from mechanism_sim.scene.tilted_links import tilt_notes
from mechanism_sim.scene.validation import TURN, between_limits, limits_text, validate
from mechanism_sim.sensing.presets import PRESETS
from mechanism_sim.units import QuantityValue, counted, for_people

_AHEAD = 10.0  # [s] that are looked at of a motion without end
_CURVE = 8
"""Points between which a speed goes on, of a curve rather than of ramps one after the other."""
_IN_PIECE = 33  # positions in a piece at which accelerations are compared
_WHY = {
    Level.KINEMATIC: 'the drives are prescribed, every joint is ideal, and forces are not '
    'requested, have no limit, or masses are not given: loop closure',
    Level.INVERSE_DYNAMICS: 'the drives are prescribed, every joint is ideal, and forces are '
    'requested: loop closure and a linear solve for the forces',
    Level.SMOOTH: 'every joint is ideal, or a belt that may slip, and the drives leave a motion '
    'free: equations of motion with closed loops',
    Level.NONSMOOTH: '{contacts}: equations of motion with gaps, and an event loop for free '
    'flight, impact and following',
    Level.COMPLIANT: '{contacts} and a law of contact force, or compliant teeth or belts: '
    'equations of motion with forces where parts overlap',
}


_SHOCKS = 'acceleration', 'force'
"""Quantities of which impacts make impulses; samples without a filter do not show these."""


@dataclass(frozen=True)
class GapStart:
    """Initial state of a gap."""

    joint: str
    open: float  #: [m]; negative: pressed in
    closing: float  #: [m/s]; negative: it opens

    def __str__(self) -> str:
        if not self.closing:
            return f'starts open by {self.open:.6g} m, at rest'
        way = 'closing' if self.closing > 0.0 else 'opening'
        return f'starts open by {self.open:.6g} m, {way} at {abs(self.closing):.6g} m/s'


_NOTHING = 1e-12


@dataclass(frozen=True)
class CoordinateStart:
    """A coordinate at the start."""

    words: str  #: description, as "angle of rod"
    value: float  #: [rad, m], all turns counted
    rate: float  #: [rad/s, m/s]
    unit: str

    def __str__(self) -> str:
        shown, scale = for_people(self.unit, abs(self.value))
        rate = f', {self.rate:.6g} {self.unit}/s' if self.rate else ', at rest'
        return f'{self.words}, {scale * self.value:.9g} {shown}{rate}'


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
    starts: dict[str, GapStart]  #: initial state by gap
    limits: list[str]  #: limits that stop the machine, or may: the first of its notes
    left_out: list[str]
    notes: list[str]
    questions: list[str] = field(default_factory=list)  #: values about a thousand times off
    start: dict[str, CoordinateStart] = field(default_factory=dict)  #: of every coordinate
    range: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Limits [rad, m] of a drive at constant speed that comes to one on either side"""

    def to_json(self) -> dict[str, object]:
        """Report as a plain dictionary."""
        found = asdict(self)
        return found if self.range else {k: x for k, x in found.items() if k != 'range'}


def check(machine: Machine) -> Report:
    """Look at a scene without running it."""
    validate(machine)
    plan, mechanism, level = machine.plan, machine.mechanism, machine.level
    rest = 'free (integrated)' if machine.level.dynamic else 'follows from the closed loops'
    straight = mechanism.displacements
    coordinates = {
        c: ('displacement, ' if c in straight else '') + rest for c in mechanism.coordinates
    }
    coordinates |= {c: _drive(machine, c) for c in plan.laws}
    relations = []
    for name in mechanism.cut:
        count = mechanism.joint(name).equations
        if count and name not in machine.plan.clearances:
            relations.append(f'{name}: closes a loop, {counted(count, "equation")}')
    loose = {n: c for n, c in machine.plan.clearances.items() if n not in plan.elastic}
    gaps = [f'{name}: {_gap(mechanism.joint(name), c, machine)}' for name, c in loose.items()]
    gaps += [
        f'{name}: {keys.kind_keys.describe(mechanism.joint(name))}, {_surfaces(c)}'
        for name, c in plan.touching.items()
        for keys in [machine.scene.joints[name]]
    ]
    notes = _notes(machine, {**loose, **machine.touching})
    return Report(
        machine.name,
        machine.scene.title,
        level.value,
        _WHY[level].format(contacts=_contacts(machine)),
        coordinates,
        relations,
        gaps,
        _starts(machine),
        [note for note in notes if isinstance(note, Limit)],
        _left_out(machine, loose),
        notes,
        [*plausibility_warnings(machine), *_undetermined_accelerations(machine)],
        coordinate_starts(machine),
        _range(machine),
    )


def coordinate_starts(machine: Machine) -> dict[str, CoordinateStart]:
    """Kind and start of every coordinate."""
    mechanism, plan = machine.mechanism, machine.plan
    if machine.level.dynamic:
        state, free = machine.initial_state(), machine.equations.system.free
        turned = (x + TURN * n for x, n in zip(state.q, state.turns, strict=True))
        known = dict(zip(free, zip(turned, state.v, strict=True), strict=True))
        known |= {c: plan.held[c] for c in plan.prescribed}
        wound = {c: plan.turned.get(c, 0) for c in plan.prescribed}
    else:
        at, wound = machine.assembly, plan.turned
        pairs = zip(at.q.tolist(), at.v.tolist(), strict=True)
        known = dict(zip(plan.ideal.coordinates, pairs, strict=True))
    found = {}
    fastest = max((abs(v) for _, v in known.values()), default=0.0)
    for c in mechanism.coordinates:
        straight, link = c in mechanism.displacements, c.partition('.')[0]
        carrier = mechanism.tree_joints.get(link)
        words = f'angle of {c}'
        if straight and c == link and carrier is not None:
            words = f'displacement of {c} along {carrier.name}'
        elif c in mechanism.deformations:
            words = f'deformation {c}'
        elif straight:
            words = f'place of {link} between loose joints, {c.rpartition(".")[2]}'
        size = mechanism.size if straight else 1.0
        value, rate = known[c]  # without what rounding leaves of zero
        value = value if abs(value) > _NOTHING * size else 0.0
        rate = rate if abs(rate) > _NOTHING * size * fastest else 0.0
        value += 0.0 if straight else TURN * wound.get(c, 0)
        found[c] = CoordinateStart(words, value, rate, 'm' if straight else 'rad')
    return found


def _range(machine: Machine) -> dict[str, tuple[float, float]]:
    """Limits of the drive, all turns counted, if it has no full turn."""
    if (found := between_limits(machine)) is None:
        return {}
    turned = TURN * machine.plan.turned.get(machine.plan.main, 0)
    return {machine.plan.main: (found.low + turned, found.high + turned)}


def _contacts(machine: Machine) -> str:
    """Describe which parts may separate and meet."""
    said = ['joints have clearance'] if machine.plan.clearances else []
    return ', '.join([*said, *(['links meet stops or each other'] if machine.touching else [])])


def _gap(joint: Joint, c: ClearanceSpec, machine: Machine) -> str:
    """The clearance of a joint, in words."""
    contact = _surfaces(c)
    if isinstance(joint, HigherPair):
        unit = 'rad' if joint.angular_clearance else 'm'
        room = (
            f'play {c.radial:g} {unit} to either side' if len(joint.sides) > 1 else 'may lift off'
        )
        return f'{joint.parts}, {room}, {contact}'
    block = isinstance(joint, Prismatic)
    kind = 'block in its guide, play' if block else 'pin in bushing, radial clearance'
    if c.film:
        kind = 'pin in oil, radial clearance'
    if not c.wall:
        return f'{kind} {c.radial:g} m, walls that never touch'
    start = 'centred' if c.film else machine.scene.start
    side = ' to either side' if block else ''
    return f'{kind} {c.radial:g} m{side}, {contact}, start {start}'


def _surfaces(c: ClearanceSpec) -> str:
    """Laws of impact of contacts, in words."""
    friction = f', friction {c.friction:g}' if c.friction else ''
    contact = f'{c.hypothesis.capitalize()} restitution {c.restitution:g}{friction}'
    if c.contact and c.contact.materials:
        contact += f', stiffness {c.stiffness:.6g} N/m^{c.contact.exponent:g} of its materials'
    return contact


def _left_out(machine: Machine, loose: Mapping[str, ClearanceSpec]) -> list[str]:
    """Physics that the level leaves out, with reasons."""
    plan, level = machine.plan, machine.level
    found = []
    if level is Level.KINEMATIC:
        why = 'not requested'
        if machine.without_forces:
            why = f'{", ".join(machine.without_forces)} needs infinite forces'
        found.append(f'masses, gravity and forces: {why}')
    elif not any(machine.scene.gravity):
        found.append('gravity: it is zero')
    found += unused(machine)
    if smooth := [name for name, c in loose.items() if c.wall and not c.friction]:
        found.append(f'friction in the clearance of {", ".join(smooth)}: none given')
    if loose and len(loose) < sum(isinstance(j, Revolute) for j in plan.joints):
        found.append('clearance in the other joints: none given')
    grounded = [{j.first, j.second} for j in plan.joints if GROUND in (j.first, j.second)]
    given = plan.prescribed if machine.level.dynamic else []
    found += [
        f'{c} inertia: its motion is given' for c in given if any(c in ends for ends in grounded)
    ]
    return found


def _starts(machine: Machine) -> dict[str, GapStart]:
    """Initial states of all gaps."""
    if not machine.level.dynamic:
        return {}
    equations, state = machine.equations, machine.initial_state()
    system, seen = equations.system, equations.observer
    place = dict(zip(system.free, zip(state.q, state.v, strict=True), strict=True))
    place |= {c: machine.plan.held[c] for c in system.prescribed}
    q, v = np.array([place[c] for c in system.coordinates]).T[:, :, None]
    turns = dict(zip(system.free, state.turns, strict=True))
    outside = machine.plan.outside_at_start(system.outside, turns=turns)
    opened = seen.gaps.distances(seen.gaps.values(q, outside))[:, 0].tolist()
    closed = (-seen.gaps.rates(q, v)[:, 0]).tolist() if system.gaps else []
    size = machine.mechanism.size
    pace = max(1.0, float(np.abs(v).max(initial=0.0)))
    return {
        gap.name: GapStart(
            gap.joint,
            0.0 if abs(x) < 1e-14 * size else x,
            0.0 if abs(w) < 1e-12 * size * pace else w,
        )
        for gap, x, w in zip(system.gaps, opened, closed, strict=True)
    }


def _drive(machine: Machine, coordinate: str) -> str:
    """Cause of the motion of a coordinate, in words."""
    laws = machine.plan.laws[coordinate]
    law, straight = laws[0], coordinate in machine.mechanism.displacements
    pace, force, place = ('m/s', 'N', 'm') if straight else ('rad/s', 'N m', 'rad')
    if not isinstance(law, DriveLaw):
        constant, per_angle, per_speed = law.coefficients
        for motor in machine.plan.motors:
            if motor.coordinate == coordinate:
                return f'free, moved by {motor.name}'
        if not any(law.coefficients):
            return 'free'
        return (
            f'free, moved by {constant:g} {force} {per_angle:+g} {force}/{place} times '
            f'{"displacement" if straight else "angle"} {per_speed:+g} {force} s/{place} times '
            'speed'
        )
    given = drive_of(machine.plan, coordinate)
    effort = given.effort if given else None
    shown = f'{effort.value:g} {force}' if isinstance(effort, QuantityValue) else effort
    with_effort = '' if effort is None else f', with {shown}'
    profile = given and (given.position or given.profile or given.speed)
    if isinstance(profile, MotionProfile):
        return f'prescribed, {profile.words}{with_effort}'
    if given and given.moves:
        again = ', again and again' if given.moves.repeat else ''
        return f'prescribed, {len(given.moves.steps)} moves and dwells{again}{with_effort}'
    speed = machine.plan.held[coordinate][1]
    changing = f' ({speed * 30.0 / math.pi:.6g} rpm)' if speed and not straight else ''
    if law.degree > 1:
        changing += f' at the start and {2.0 * law.coefficients[2]:g} {pace[:-2]}/s^2'
    return f'prescribed, {speed:g} {pace}{changing}{with_effort}'


def _notes(machine: Machine, loose: Mapping[str, ClearanceSpec]) -> list[str]:
    """Remarks on a machine at rest."""
    plan, mechanism = machine.plan, machine.plan.ideal
    notes = [
        f"{joint}: Newton's restitution with friction can create energy where sliding "
        "stops or turns within an impact; 'hypothesis: poisson' or 'stronge' cannot"
        for joint, c in loose.items()
        if c.friction and c.restitution and c.hypothesis == 'newton'
    ]
    start = dict(zip(mechanism.coordinates, machine.assembly.q.tolist(), strict=True))
    if between_limits(machine):
        free = ' without clearance' if machine.plan.clearances else ''
        goes = '' if machine.level.dynamic else "'cycle' goes from one limit to the other; "
        within = "a run that is to stay between them needs a 'duration'"
        notes.append(Limit(f'{limits_text(machine)}{free}: {goes}{within}'))
    notes += motion_notes(mechanism, start, plan.laws)
    notes += _acceleration_notes(machine)
    if machine.physics.undetermined:
        notes.append(machine.nominal.undetermined_text)
    for joint in plan.joints:
        keys = machine.scene.joints[joint.name]
        notes += keys.kind_keys.notes(machine, joint)
    notes += [
        f'{name}: never reached: drives and loops determine all of the motion'
        for name in plan.touching.keys() - machine.touching.keys()
    ]
    notes += dict.fromkeys(f'{f.name}: friction, {f.words}' for f in plan.frictions(mechanism))
    notes += elastic_notes(
        machine.mechanism, machine.drive.period, bool(plan.clearances),
        lambda: Start(
            plan, machine.nominal, machine.equations, machine.drive.period
        ).slow_deformations(),
    )  # fmt: skip
    notes += tilt_notes(machine.mechanism)
    notes += _sensor_notes(machine)
    notes += _oscillator_notes(machine)
    notes += (
        f'{load.name}: its size [{load.unit}] follows from the motion and the efforts'
        for load in plan.unknowns(mechanism)
    )
    if machine.level.dynamic:
        solver = machine.scene.solver
        notes.append(f'rtol {solver.rtol:g}, atol {solver.atol:g} m')
    return notes


def _oscillator_notes(machine: Machine) -> Iterator[str]:
    """Frames on springs by themselves."""
    carried = sum(body.mass for body in machine.mechanism.bodies)
    for name, part in machine.scene.oscillators.items():
        frame = machine.frame(name)
        pitches = ', '.join(f'{f:.4g}' for f in frame.frequencies)
        by = 'the machine' if part.joints is None else ', '.join(part.joints)
        yield (
            f'oscillator {name}: {frame.mass:g} kg on '
            f'{counted(len(frame.mounts), "mount")}, natural frequencies {pitches} Hz, shaken by '
            f'{by}; it does not move the machine, whose moving links have '
            f'{carried / frame.mass:.2g} of its mass'
        )


def _sensor_notes(machine: Machine) -> Iterator[str]:
    """Places of sensors, and their chains."""
    for name, sensor in machine.scene.sensors.items():
        said = [f'{sensor.kind} {sensor.place(machine)}', f'{sensor.sample_rate:g} Hz']
        yield f'sensor {name}: {", ".join([*said, *_chain(sensor)])}'
        half, corner = 0.5 * sensor.sample_rate, sensor.anti_alias and sensor.anti_alias.frequency
        if corner and corner > half:
            preset = PRESETS.get(sensor.instrument or '', {}).get('sample_rate')
            meant = f'; {sensor.instrument} samples at {preset}' if preset else ''
            yield (
                f'sensor {name}: its anti-alias filter passes {half:g} Hz to {corner:g} Hz, which '
                f'a sample_rate of {sensor.sample_rate:g} Hz folds below {half:g} Hz{meant}'
            )


def _chain(sensor: SensorPart) -> list[str]:
    """Parts of a sensor that are not ideal."""
    transducer, amplifier, adc = sensor.transducer, sensor.amplifier, sensor.adc
    integrated = sensor.quantity != 'acceleration'
    ideal = ['ideal: no impacts in it'] if sensor.measures in _SHOCKS else ['ideal']
    lower = sensor.integrator.high_pass if sensor.integrator else None
    parts: tuple[tuple[Any, Callable[[Any], str]], ...] = (
        (transducer.natural_frequency, lambda f: f'transducer of {f:g} Hz'),
        (amplifier.high_pass, lambda f: f'high-pass {f:g} Hz'),
        (amplifier.low_pass, lambda f: f'low-pass {f:g} Hz'),
        (integrated, lambda _: f'integrated to {sensor.quantity}'),
        (lower, lambda f: f'from {f:g} Hz on'),
        (sensor.anti_alias, lambda a: f'anti-alias filter {a.frequency:g} Hz'),
        (sensor.impact_pulse, lambda s: f'impacts last {s:g} s'),
        (sensor.trigger, lambda t: f'triggered at {t.angle:g} rad'),
        (adc.range, lambda r: f'range {r.value:g} {sensor.unit}'),
        (adc.bits, lambda n: f'{n} bits'),
        (adc.jitter, lambda s: f'jitter {s:g} s'),
        (sensor.noise.rms.value, lambda x: f'noise {x:g} {sensor.unit}'),
        (sensor.noise.hum, lambda h: f'hum {h.amplitude.value:g} at {h.frequency:g} Hz'),
    )
    return [say(value) for value, say in parts if value] or ideal


def render(report: Report) -> str:
    """The report as text."""
    lines = [f'{report.scene}: {report.title}']
    if report.questions:
        lines += ['questions', *(f'  {question}' for question in report.questions)]
    if report.limits:
        lines += ['what limits the motion', *(f'  {note}' for note in report.limits)]
    lines += [f'level: {report.level}', f'  {report.why}', 'coordinates']
    lines += [f'  {name}: {what}' for name, what in report.coordinates.items()]
    lines += ['start', *(f'  {name}: {start}' for name, start in report.start.items())]
    for heading, items in (
        ('relations', report.relations),
        ('gaps', [*report.gaps, *(f'{name}: {start}' for name, start in report.starts.items())]),
        ('left out', report.left_out),
        ('notes', [note for note in report.notes if note not in report.limits]),
    ):
        if items:
            lines += [heading, *(f'  {item}' for item in items)]
    return '\n'.join(lines)


def _acceleration_notes(machine: Machine) -> Iterator[str]:
    """The largest acceleration of each drive that is given over time."""
    for c, key, profile in _profiles(machine):
        size, at = _largest(machine, c)
        yield f'{key}: largest acceleration {abs(size):.6g} {_unit(machine, c)} at t = {at:.6g} s'
        if (peaks := _peaks(profile)) and determined(peaks):
            yield f'{key}: {describe_peaks(peaks, _unit(machine, c))}'


def _undetermined_accelerations(machine: Machine) -> Iterator[str]:
    """A question for each drive whose acceleration its points do not determine."""
    for c, key, profile in _profiles(machine):
        if isinstance(profile, SpeedPart) and profile.ramp == 'smooth':
            rises = np.diff([x.value for _, x in profile.given])
            if (stops := int((rises[1:] * rises[:-1] > 0.0).sum())) >= _CURVE:
                yield (
                    f'{key}.ramp: smooth takes the acceleration to zero at {stops} points '
                    'between which the speed continues: through points of a curve take '
                    "'interpolation: cubic'"
                )
        if (peaks := _peaks(profile)) and not determined(peaks):
            yield f'{key}: {describe_peaks(peaks, _unit(machine, c))}'


def _unit(machine: Machine, c: str) -> str:
    return 'm/s^2' if c in machine.mechanism.displacements else 'rad/s^2'


def _profiles(machine: Machine) -> Iterator[tuple[str, str, MotionProfile | None]]:
    """Coordinates whose motion is given over time, by which key, and its course, if no moves."""
    for c in machine.plan.prescribed:
        drive, key = drive_of(machine.plan, c), drive_key(machine.plan, c)
        assert drive is not None  # noqa: S101 - it is prescribed
        if drive.moves:
            yield c, f'{key}.moves', None
        for name in ('position', 'speed', 'profile'):
            if isinstance(profile := getattr(drive, name), MotionProfile):
                yield c, f'{key}.{name}', profile


def _peaks(profile: MotionProfile | None) -> tuple[SampledPeak, SampledPeak] | None:
    """Extreme accelerations by points; None of formulas, moves and ramps."""
    if profile is None or not profile.given:
        return None
    rate = isinstance(profile, SpeedPart)
    how = profile.interpolation or ('linear' if rate else 'cubic')
    if how == 'linear':
        return None
    t, y = np.array([(t, x.value) for t, x in profile.given]).T
    if profile.periodic:  # what turns on has the same accelerations without its turns
        y = y - (y[-1] - y[0]) * (t - t[0]) / (t[-1] - t[0])
        y[-1] = y[0]
    degree = {'cubic': 3, 'quintic': 5}[how]
    rest = profile.ends == 'rest'
    return acceleration_peaks(t, y, degree, profile.periodic, rest=rest, order=2 - rate)


def _largest(machine: Machine, c: str) -> tuple[float, float]:
    """The largest acceleration of a prescribed coordinate, with its sign, and when [s]."""
    duration = machine.scene.duration or _AHEAD
    best = 0.0, 0.0
    for law, begin, end in ends(*machine.plan.laws_until(c, duration)):
        second = polynomial.polyder(law.coefficients, 2)
        at = np.linspace(begin, end, _IN_PIECE) - law.reference_time
        values = np.abs(polynomial.polyval(at, second))
        if values.max() < abs(best[0]):
            continue
        places = at[values.argmax()][None]
        if len(second) > 2:  # refined where its own derivative is zero
            roots = polynomial.polyroots(polynomial.polyder(second))
            real = roots[np.abs(roots.imag) < 1e-9].real
            places = np.append(places, real[(real > at[0]) & (real < at[-1])])
        sizes = polynomial.polyval(places, second)
        k = int(np.abs(sizes).argmax())
        if abs(sizes[k]) > abs(best[0]):
            best = float(sizes[k]), float(places[k] + law.reference_time)
    return best
