"""How a machine moves, and what its drives and joints bear: charts over the drive's angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.export.palette import numbers
from mechanism_sim.linkages.slot import PinInSlot
from mechanism_sim.planar.mechanism import Prismatic
from mechanism_sim.report.charts.chart import Chart, Section, polar
from mechanism_sim.report.charts.chart import Curve as Drawing
from mechanism_sim.report.charts.course import Course, Window
from mechanism_sim.report.charts.curves import Curve, over_drive, over_time, quantities
from mechanism_sim.results.catalogue import catalogue

Vector = Sequence[Array]

_NOTHING = 1e-9
"""Of the largest of its kind: what is less is rounding."""

_KINDS = {
    'position': ('Angles', 'Displacements'),
    'velocity': ('Angular velocities', 'Velocities'),
    'acceleration': ('Angular accelerations', 'Accelerations'),
}


def over(course: Course) -> str:
    """In words, what is to be seen over which turns."""
    if course.turns is None:
        return f'Over time, for the {course.record.machine.main} makes no whole turn.'
    first, last = course.turns
    main, count = course.record.machine.main, round(last - first)
    turns = 'The last whole turn' if count == 1 else f'The last {count} whole turns'
    found = f'{turns} of the {main}'
    if course.run.reach:
        found = f'The last whole turn of the {main}, and pale the range of all turns'
    elif count > 1:
        found += ', the latest strong and the one before it faint'
    if course.ideal is not None:
        found += '; the thick pale line is the same machine with ideal joints'
    return f'{found}.'


def motion(course: Course) -> Section:
    """Angles, rates and accelerations of all coordinates but those of elastic links."""
    machine = course.record.machine
    physics, rotors, charts = machine.physics, machine.mechanism.rotors, []
    own = numbers(machine.mechanism)
    for kind, titles in _KINDS.items():
        for straight, title in zip((False, True), titles, strict=True):
            curves = [
                Curve(f'{kind}.{c}', c, own.get(c, i))
                for i, c in enumerate(physics.coordinates)
                if (c in physics.displacements) == straight
                and (c not in machine.mechanism.deformations or c.partition('.')[0] in rotors)
            ]
            if kind == 'position' and course.turns:
                curves = [c for c in curves if c.label != machine.main]
            if kind == 'acceleration':  # of a drive at constant speed there is none
                curves = [c for c in curves if _varies(course, c)]
            if any(_varies(course, c) for c in curves):
                unit = catalogue(machine)[curves[0].column].unit
                key = f'motion-{kind}-{"straight" if straight else "turning"}'
                words = title.lower()[:-1].replace('velocitie', 'velocity')
                charts.append(over_drive(course, key, title, curves, words, unit))
    main = machine.main
    speed = Curve(f'velocity.{main}', main, own.get(main, 0))
    if course.turns and course.long and _varies(course, speed):
        title = f'Speed of the {main} over the whole run'
        charts.append(over_time(course, 'motion-speed-run', title, [speed], 'speed', 'rad/s'))
    return Section('motion', 'Motion', over(course), tuple(charts))


def _varies(course: Course, curve: Curve) -> bool:
    values = course.detail.lines[curve.column].values
    return bool(np.ptp(values) > _NOTHING * np.abs(values).max())


def elastic(course: Course) -> Section | None:
    """Deflection and stress of elastic links."""
    beams = course.record.machine.mechanism.beams
    charts: list[Chart] = []
    for kind, title, unit in (
        ('deflection', 'Deflection in the middle', 'm'), ('stress', 'Largest stress', 'Pa'),
    ):  # fmt: skip
        curves = [
            Curve(f'{kind}.{link}', link, i)
            for i, (link, beam) in enumerate(beams.items())
            if kind == 'deflection' or beam.fibre is not None
        ]
        charts += quantities(course, f'elastic-{kind}', title, curves, kind, unit)
    text = 'Deflection is across the link; stress is that at the outer fibres.'
    return Section('elastic', 'Elastic links', text, tuple(charts)) if charts else None


def forces(course: Course) -> Section | None:
    """Forces in all joints: their size, and as vectors."""
    machine = course.record.machine
    if not machine.physics.has_forces:
        return None
    joints = machine.physics.joints
    curves = [Curve(f'reaction.{j}.size', j, i) for i, j in enumerate(joints)]
    title = 'Force in each joint'
    charts = quantities(course, 'forces', title, curves, 'force', 'N', run=True)
    if not charts:
        return None
    lines = course.detail.lines
    tilting = [j for j in joints if f'bearing_moment.{j}.size' in lines]
    if tilting:
        curves = [Curve(f'bearing_moment.{j}.size', j, joints.index(j)) for j in tilting]
        title = 'Moment of each bearing that holds its pin by both ends'
        charts.append(over_drive(course, 'bearing-moments', title, curves, 'moment', 'N m'))
    largest = {joint: lines[f'reaction.{joint}.size'].values.max() for joint in joints}
    charts += [
        _hodograph(course, joint, i)
        for i, joint in enumerate(joints)
        if largest[joint] > _NOTHING * max(largest.values())
    ]
    text = (
        'Round charts show the force as a vector in the world: '
        'that of the first-named on the second-named link of the joint, without the impulses of '
        'impacts.'
    )
    return Section('forces', 'Joint forces', text, tuple(charts))


def _hodograph(course: Course, joint: str, number: int) -> Chart:
    """The force of a joint, and beneath it that of the ideal machine."""
    pair = course.record.machine.mechanism.joint(joint)
    title = f'{joint}: {pair.first} on {pair.second}'
    beneath = None
    if course.ideal is not None and f'reaction.{joint}.x' in course.ideal.lines:
        beneath = _vector(course.ideal, joint)[1]
    of = f'reaction.{joint}'
    return hodograph(
        f'forces-{joint}', title, of, *_vector(course.detail, joint), number, beneath, joint
    )


def hodograph(
    key: str, title: str, of: str, t: Array, force: Vector, number: int,
    ideal: Vector | None = None, joint: str = '',
) -> Chart:  # fmt: skip
    """A force (2, N) [N] at times (N,) [s] as a vector in the world, a dot where it begins."""

    def curve(vector: Vector, **more: Any) -> Drawing:
        x, y = vector
        direction = np.degrees(np.arctan2(y, x))
        return Drawing(direction, np.hypot(x, y), of=of, colour=number, **more)

    own = curve(force, when=t)
    curves = [own, own.start()]
    if ideal is not None:
        curves = [curve(ideal, look='ideal'), *curves]
    return polar(key, title, 'N', curves, joint, 'force')


def _vector(window: Window, joint: str) -> tuple[Array, Vector]:
    """Times [s], and a force [N], where the line of its size is."""
    record = window.record
    t = np.unique(window.lines[f'reaction.{joint}.size'].at)
    seen = record.piece.physics.observe(record.piece.motion, *record.piece.motion.curve.find(t))
    return t, seen.reaction[record.piece.physics.joints.index(joint)]


def drive(course: Course) -> Section | None:
    """Torque or force of every drive."""
    machine = course.record.machine
    physics = machine.physics
    if not physics.has_forces or not physics.driven:
        return None
    charts: list[Chart] = []
    own = numbers(machine.mechanism)
    for straight, word in ((False, 'torque'), (True, 'force')):
        curves = [
            Curve('drive_torque' if not i else f'drive_torque.{c}', c, own.get(c, i))
            for i, c in enumerate(physics.driven)
            if (c in physics.displacements) == straight
        ]
        unit = 'N' if straight else 'N m'
        key, title = f'drive-{word}', f'Drive {word}'
        charts += quantities(course, key, title, curves, word, unit, run=True)
    return Section('drive', 'Drive', '', tuple(charts))


def guides(course: Course) -> Section | None:
    """Forces and moments that guides and slots transmit."""
    machine = course.record.machine
    names = machine.physics.joints
    joints = [j for j in machine.mechanism.joints if isinstance(j, Prismatic | PinInSlot)]
    if not machine.physics.has_forces or not joints:
        return None

    def curves(kind: str) -> list[Curve]:
        return [Curve(f'reaction.{j.name}.{kind}', j.name, names.index(j.name)) for j in joints]

    title, text = 'Force across each guide and slot', ''
    charts = quantities(course, 'guides-force', title, curves('size'), 'force', 'N')
    if charts and any(isinstance(j, Prismatic) for j in joints):
        title = 'Moment in each guide'
        charts.append(
            over_drive(course, 'guides-moment', title, curves('moment'), 'moment', 'N m')
        )
        text = (
            'The moment is that of the first-named on the second-named link, about the point that '
            'slides.'
        )
    return Section('guides', 'Guides and slots', text, tuple(charts)) if charts else None
