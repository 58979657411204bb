"""Remarks on a scene: values that look as if their unit were wrong, and keys without effect.

Nothing is refused here. The bounds are a thousand times off the values of usual machines, so that
a remark is worth a check.
"""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from mechanism_sim.documents import texts_of
from mechanism_sim.errors import InputError
from mechanism_sim.linkages.drive_range import drive_range
from mechanism_sim.numerics import formula
from mechanism_sim.numerics.expressions import ExpressionNode
from mechanism_sim.numerics.time_series import summands
from mechanism_sim.planar.drive import DriveLaw
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.drives import drive_of
from mechanism_sim.scene.level import Level
from mechanism_sim.scene.loads import LOADS
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.plan import keeps_speed
from mechanism_sim.scene.repetition import PROSE, WHOLE, calls_of_angles, is_whole
from mechanism_sim.scene.table_keys import TablePart
from mechanism_sim.scene.validation import TURN, way_of
from mechanism_sim.sensing.point import PointOnLink
from mechanism_sim.units import to_si, written

_GYRATION = 30.0
"""Radius of gyration over the size of a link, and of size over radius: a bar has 0.29."""
_ODD = 300.0  # ratio of masses and sizes to their medians, or its inverse, that is implausible
_OTHER_UNIT = 100.0
"""Ratio of a length to the median of lengths in other units, or its inverse.

A wrong unit is a factor of 1000, on lengths that may be several times shorter than others.
"""
_LEAST_PLAY, _MOST_PLAY = 1e-7, 0.1
"""Least radial clearance [m], and largest one over the size of the machine."""
_PLAYS = 'lift_off', 'groove', 'backlash'
_GRAVITY = 1.0, 30.0  # range of gravity [m/s^2], between that of the moon and that of Jupiter
_THICKEST = 10.0
"""Largest viscosity of oil [Pa s], as honey; ISO VG 3200, the thickest, has 2.9 at 40 deg C."""
_FASTEST = 3e4  # largest speed [rad/s], of turbochargers
_ANGLES = 'start_angle', 'axis', 'phase'
"""Keys of angles, beside the coordinates in `guess` and `initial.position`."""
_ROUND = 0.9
"""Share of a turn: an angle that gets that far from its start rotates instead of swinging."""
_NO_FORCES = 'masses are missing, or forces have no limit, and so none are computed'


def plausibility_warnings(machine: Machine) -> list[str]:
    """Questions about values that are about a thousand times off, and warnings of joints."""
    every = [(machine.scene.joints[joint.name], joint) for joint in machine.plan.joints]
    return [
        *machine.questions,
        *(
            text
            for keys, joint in every
            for text in keys.kind_keys.plausibility_warnings(machine, joint)
        ),
        *_inertias(machine),
        *_masses(machine),
        *_plays(machine),
        *_oils(machine),
        *_others(machine),
        *_tables(machine),
        *_bare_angles(machine),
        *_still_sensors(machine),
    ]


def length_questions(content: Mapping[str, Any]) -> Iterator[str]:
    """Questions about lengths in a unit in which few are written, as a crank of 64 m beside mm.

    Parameters
    ----------
    content : keys and values of a scene as in its file, with units
    """
    written = [found for found in _lengths(content.get('links'), 'links', True) if found[3]]
    elsewhere = {key: part for key, part in content.items() if key != 'links'}
    for where, text, unit, value in _lengths(elsewhere, ''):  # small ones are clearances
        others = [abs(x) for _, _, u, x in written if u != unit]
        if others and abs(value) > _OTHER_UNIT * statistics.median(others):
            yield _length_question(where[1:], text, statistics.median(others))
    for where, text, unit, value in written:
        others = [abs(x) for _, _, u, x in written if u != unit]
        if not others or 2 * len(others) < len(written):
            continue
        middle = statistics.median(others)
        even = 2 * len(others) == len(written)  # which is wrong? the larger ones are named
        if not (-1.0 if even else 1.0 / _OTHER_UNIT) < abs(value) / middle < _OTHER_UNIT:
            yield _length_question(where, text, middle)


def angle_questions(content: Mapping[str, Any]) -> Iterator[str]:
    """Questions about angles of more than a turn without a unit, as 60 where 60 deg is meant.

    And about guides with an angle, but without the axis along which they slide.

    Parameters
    ----------
    content : as for `length_questions`
    """
    joints = content.get('joints')
    joints = joints if isinstance(joints, Mapping) else {}
    slide = {n: p for n, p in joints.items() if isinstance(p, Mapping) and 'prismatic' in p}
    pairs = [p['prismatic'] for p in slide.values() if isinstance(p['prismatic'], list)]
    ends = {str(end).partition('.')[0] for pair in pairs for end in pair}
    for name, part in slide.items():
        if part.get('axis') is None and _is_angle(part.get('angle')):
            yield (
                f'joints.{name} slides along 0 deg of its first link, and its angle turns only '
                'what slides: is the axis meant?'
            )
    for path, value in _plain_numbers(content):
        *_, key = path
        start = path[:-1] in (('guess',), ('initial', 'position')) and key not in ends
        if (start or key in _ANGLES) and abs(value) > TURN * (1.0 + 1e-9):
            yield (
                f'{".".join(path)} = {value:g}: angles without a unit are in radians, this one is '
                f'{math.degrees(value):.6g} deg: is the unit right?'
            )


def _is_angle(value: Any) -> bool:
    """True for an angle other than 0; what is none is refused elsewhere."""
    with suppress(ValueError, TypeError):
        return to_si(value, 'rad') != 0.0
    return False


def _plain_numbers(part: Any, *path: str) -> Iterator[tuple[tuple[str, ...], float]]:
    """Numbers that stand by their keys without a unit, and the keys."""
    if isinstance(part, Mapping):
        for key, value in part.items():
            yield from _plain_numbers(value, *path, str(key))
    elif path and isinstance(part, int | float | str) and not isinstance(part, bool):
        with suppress(ValueError):
            yield path, float(part)


def _length_question(where: str, text: str, middle: float) -> str:
    others = f'the lengths in other units are about {_length(middle)}'
    return f'{where} = {text}: {others}: is the unit right?'


def _lengths(
    part: Any, where: str, of_links: bool = False
) -> Iterator[tuple[str, str, str, float]]:
    """Lengths and points in a part of a scene: path, text, its unit, and value [m].

    Numbers without a unit are in metres; elsewhere than in links they may be anything.
    """
    if isinstance(part, Mapping):
        for key, value in part.items():
            if not of_links or where.count('.') != 1 or key in ('length', 'points'):
                yield from _lengths(value, f'{where}.{key}', of_links)
    elif isinstance(part, list | tuple):
        for value in part:
            yield from _lengths(value, where, of_links)
    elif of_links and isinstance(part, int | float):
        yield where, f'{part:g}', 'm', float(part)
    elif isinstance(part, str):
        unit = part.lstrip('+-0123456789.eE ').strip()
        if unit or of_links:
            with suppress(ValueError):
                yield where, part, unit or 'm', to_si(part, 'm')


def _sizes(machine: Machine) -> dict[str, float]:
    """The largest distance between points of each moving link [m]; 0 of one with one point."""
    sizes = {}
    for link, points in machine.plan.points.items():
        if link != GROUND:
            places = [*points.values(), (0.0, 0.0)]
            sizes[link] = max(math.dist(a, b) for a in places for b in places)
    return sizes


def _still_sensors(machine: Machine) -> Iterator[str]:
    for name, sensor in machine.scene.sensors.items():
        source = sensor.source(machine)
        if isinstance(source, PointOnLink) and source.still:
            yield (
                f'sensors.{name}.axis: the {sensor.link} never moves along it, so that the sensor '
                "reads 0: 'along' is the x axis of the link, whatever guide it has: is another "
                'meant?'
            )


def _inertias(machine: Machine) -> Iterator[str]:
    sizes = _sizes(machine)
    for name in machine.plan.links:
        link, size = machine.scene.links[name], sizes.get(name, 0.0)
        if not (link.mass and link.inertia and size) or name in machine.plan.ideal.displacements:
            continue
        radius = math.sqrt(link.inertia / link.mass)
        if not size / _GYRATION < radius < _GYRATION * size:
            yield (
                f'links.{name}.inertia = {link.inertia:g} kg m^2: its radius of gyration is '
                f'{_length(radius)} on a link of {_length(size)}: is the unit right?'
            )


def _masses(machine: Machine) -> Iterator[str]:
    for key, unit, values in (
        ('mass', 'kg', {n: m for n in machine.plan.links if (m := machine.scene.links[n].mass)}),
        ('size', 'm', {n: size for n, size in _sizes(machine).items() if size}),
    ):
        if len(values) < 3:
            continue
        middle = statistics.median(values.values())
        for name, value in values.items():
            if not middle / _ODD < value < middle * _ODD:
                what = f'links.{name}.mass' if key == 'mass' else f'size of links.{name}'
                yield (
                    f'{what} = {value:g} {unit}: those of the other links are about {middle:g} '
                    f'{unit}: is the unit right?'
                )


def _plays(machine: Machine) -> Iterator[str]:
    size = machine.mechanism.size
    for joint, spec in machine.plan.clearances.items():
        radial, pair = spec.radial, machine.mechanism.joint(joint)
        if isinstance(pair, HigherPair) and pair.angular_clearance:
            continue
        if radial and not _LEAST_PLAY <= radial <= _MOST_PLAY * size:
            part = machine.scene.joints[joint]
            other = next((k for k in _PLAYS if getattr(part, k, None)), '')
            between = f'{other} makes a play of {_length(2.0 * radial)}'
            said = between if other else f'clearance.radial = {_length(radial)}'
            yield (f'joints.{joint}.{said} in a machine of {_length(size)}: is the unit right?')


def _oils(machine: Machine) -> Iterator[str]:
    for joint, spec in machine.plan.clearances.items():
        if spec.contact and (spec.contact.viscosity or 0.0) > _THICKEST:
            yield (
                f'joints.{joint}.clearance.contact.viscosity = {spec.contact.viscosity:g} Pa s is '
                'that of honey or more, those of oils are given in mPa s: is the unit right?'
            )


def _others(machine: Machine) -> Iterator[str]:
    gravity = math.hypot(*machine.scene.gravity)
    if gravity and not _GRAVITY[0] <= gravity <= _GRAVITY[1]:
        yield f'gravity = {gravity:g} m/s^2, on Earth it is 9.81 m/s^2: is the unit right?'
    main, fastest = machine.plan.main, machine.drive.fastest
    if main not in machine.mechanism.displacements and fastest > _FASTEST:
        yield f'{main} turns at {fastest * 30.0 / math.pi:g} rpm: is the unit right?'


def _tables(machine: Machine) -> Iterator[str]:
    """Questions about tables over the angle of a rotating link that do not fit its turns."""
    if not (tables := machine.scene.tables):
        return
    for node, factors in calls_of_angles(machine.plan):
        turning = [(x, n) for x, n in factors.items() if _turns_on(machine, x)]
        if len(turning) == 1:  # of two, their difference need not turn
            yield from _out_of_turn(node, tables[node.name], *turning[0])


def _bare_angles(machine: Machine) -> Iterator[str]:
    """Questions about angles in formulas of more than a turn without a unit, as 60*sin(t)."""
    plan = machine.plan
    straight = plan.ideal.displacements
    links = [link for link in plan.links if link not in straight]
    for path, text in texts_of(plan.scene.to_document(), PROSE):
        driven = path[1] if path[0] == 'drives' else plan.main
        course = path[-2:] == ('position', 'formula') and driven not in straight
        if not course and not any(link in text for link in links):
            continue
        with suppress(InputError):  # words that are no formula
            root = formula.read(text, plan.scene.tables)
            waves = [x for _, x in summands(root) if re.search(r'\b(sin|cos)\(', x.text)]
            found = [(x, _factor(x)) for x in waves if course]
            for node in (n for n in root.walk() if n.kind in ('+', '-', 'compare')):
                sides = [formula.coefficients(x, links) or {} for x in node.args]
                if any({*map(abs, side.values())} == {1.0} for side in sides):
                    found += [(x, _factor(x)) for x in node.args if not x.names]
            for part, value in found:
                if abs(value) > TURN * (1.0 + 1e-9):
                    degrees = f'{math.degrees(value):.6g} deg'
                    where = '.'.join(path).removesuffix('.formula')
                    yield f'{where}: {part.text} is in rad, {degrees}: is a unit missing?'


def _factor(node: ExpressionNode) -> float:
    """Numeric factor of a product without units; 0 if a factor has a unit or is pi."""
    if node.kind in ('*', 'negative'):
        return math.prod(map(_factor, node.args))
    if node.kind == '/':
        above, below = map(_factor, node.args)
        return above / below if below else 0.0
    return 0.0 if node.unit or node.kind == 'pi' else node.value or 1.0


def _out_of_turn(
    node: ExpressionNode, table: TablePart, link: str, factor: float
) -> Iterator[str]:
    """Question about a table whose range does not fit the turns of the link in its argument."""
    (first, _), *_, (last, value) = table.points
    span, where = last.value - first.value, f'tables.{node.name}'
    turns = span / abs(TURN * factor)
    # parts of a turn, or several: cams and valves may have one period in two turns of a crank
    fits = is_whole(factor * TURN * max(1, round(turns)) / span)
    if table.curve.cyclic and not fits:
        yield (
            f'{where} repeats every {math.degrees(span):.6g} deg, no whole part of a turn of '
            f'{link}: {node.text} is another in every turn: is its last point missing?'
        )
    elif not table.curve.cyclic and turns < 1.0 + WHOLE:  # of more, turns are meant to count
        missing = "'periodic: true'" if fits else "'periodic: true' with points over a whole turn"
        yield (
            f'{where} is not periodic, but {link} turns on: {node.text} stays at '
            f'{written(value.value, value.unit)} beyond {math.degrees(last.value):.6g} deg: is '
            f'{missing} missing?'
        )


def _turns_on(machine: Machine, link: str) -> bool:
    """True for a drive that rotates beyond a turn, and for a link rotating with it, as by gears.

    As far as the laws of drives and a linkage with a single one tell: what a motor moves turns,
    what a torque moves may come to rest.
    """
    plan, turn = machine.plan, machine.drive.period
    until = machine.scene.duration or (2.0 * turn if math.isfinite(turn) else 0.0)
    drive = link if link in plan.laws else plan.main
    laws, until = plan.laws_until(drive, until) if drive in plan.laws else ((), until)
    steady, straight = bool(laws) and keeps_speed(plan, drive), drive in plan.ideal.displacements
    if not laws or (steady and not any(laws[0].coefficients[1:])):
        return False
    if not isinstance(laws[0], DriveLaw):
        given = drive_of(plan, drive)
        if given is None or not given.motor:
            return False
    elif not steady and not straight:
        low, high = way_of(laws, until)
        if high - low <= TURN:
            return False
    ideal = machine.rigid
    at, free = ideal.assembly, drive not in plan.prescribed
    if len(plan.laws) > 1 or at.freedom != free or at.overdriven:
        return link == drive and not straight
    found = drive_range(ideal.plan.kinematics([drive]), at.q, ideal.nominal.reach)
    k = ideal.plan.ideal.coordinates.index(link)
    return not found.limited and bool(abs(found.at_high[k] - at.q[k]) > _ROUND * TURN)


def _length(x: float) -> str:
    return written(x, 'm', 3)


def unused(machine: Machine) -> list[str]:
    """Sentences on given keys without effect at the level of the run."""
    return [*_solver(machine), *_start(machine), *_forces(machine), *_unnamed(machine)]


def _solver(machine: Machine) -> Iterator[str]:
    solver, default = machine.scene.solver, type(machine.scene.solver)()
    if not machine.level.dynamic:
        for key in ('rtol', 'atol'):
            if getattr(solver, key) != getattr(default, key):
                yield (
                    f'solver.{key} has no effect: the motion follows from closed loops, and '
                    'nothing is integrated'
                )
    elif solver.atol and not machine.has_contacts:
        yield 'solver.atol has no effect: no joint has a clearance in which impacts could chatter'


def _start(machine: Machine) -> Iterator[str]:
    scene = machine.scene
    if scene.start != 'seated' and not machine.plan.clearances:
        yield f"start = '{scene.start}' has no effect: no joint has a clearance"
    if scene.initial.elastic != 'straight' and not machine.mechanism.deformations:
        yield f"initial.elastic = '{scene.initial.elastic}' has no effect: no link is elastic"


def no_forces(machine: Machine) -> str:
    """Reason why a kinematic machine has no forces."""
    return _NO_FORCES if machine.scene.outputs.forces else 'outputs.forces is false'


def _forces(machine: Machine) -> Iterator[str]:
    scene, outputs = machine.scene, machine.scene.outputs
    if machine.level.dynamic and not outputs.forces:
        yield 'outputs.forces = false has no effect: the motion follows from forces'
    axial = any(c.endswith('.axial') for c in machine.mechanism.deformations)
    if scene.axial_gravity and not axial:
        yield "axial_gravity: no joint of a link with 'tilt' has 'axial' play"
    if machine.level is not Level.KINEMATIC:
        return
    if outputs.wrenches:
        yield f'outputs.wrenches has no effect: {no_forces(machine)}'
    if outputs.forces:  # else it is plain that nobody asks for them
        for section in LOADS:
            for name in getattr(scene, section):
                yield f'{section}.{name} has no effect: {_NO_FORCES}'
        for name, joint in scene.joints.items():
            if joint.friction and (joint.friction.coefficient or joint.friction.efficiency):
                yield f'joints.{name}.friction has no effect: {_NO_FORCES}'


def _unnamed(machine: Machine) -> Iterator[str]:
    """Sentences on tables and gears that nothing in the scene refers to."""
    content = machine.scene.to_document()
    for section in ('tables', 'gears'):
        own = content.pop(section)
        part = [content, own] if section == 'gears' else content
        texts = ' '.join(text for _, text in texts_of(part))
        for name in own:
            if not re.search(rf'\b{re.escape(name)}\b', texts):
                yield f'{section}.{name} has no effect: nothing refers to it'
