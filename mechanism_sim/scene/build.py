"""Machines from scenes, with refusal of impossible ones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np

from mechanism_sim.arrays import Array
from mechanism_sim.engine.physics import is_force_open
from mechanism_sim.errors import InputError, check_known
from mechanism_sim.joints.contact_keys import Clearance, ClearanceSpec, Contact
from mechanism_sim.keys.names import scene_errors
from mechanism_sim.linkages.nominal import NominalPhysics
from mechanism_sim.planar.configuration import converted
from mechanism_sim.planar.kinematics import Kinematics
from mechanism_sim.planar.massless import inertial_motion, moving, without_mass
from mechanism_sim.planar.mechanism import HigherPair
from mechanism_sim.planar.points import GROUND
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.level import Level
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_keys import PositionPart
from mechanism_sim.scene.plan import announce
from mechanism_sim.scene.schema import Scene
from mechanism_sim.scene.sensor_keys import check_impulses
from mechanism_sim.scene.singular_start import neighbours
from mechanism_sim.scene.validation import check_scenes_way
from mechanism_sim.tolerances import TOLERANCES
from mechanism_sim.units import QuantityValue, counted

_MARGIN = 0.01
"""Share of the range next to each limit that is left out: at a limit two branches meet."""
_MECHANISM = TOLERANCES.mechanism


def build(name: str, scene: Scene, questions: tuple[str, ...] = ()) -> Machine:
    """Build the machine of a scene; `questions` are plausibility warnings about its file."""
    with scene_errors(name):
        machine = Machine(name, _with_swing(scene), questions)
        _check_freedom(machine)
        _check_mass(machine)
        check_scenes_way(machine)
        _check_unknowns(machine)
        _check_joints(machine)
        _check_redundant(machine)
        _check_oscillators(machine)
        _check_sensors(machine)
    return machine


def rebuilt(
    name: str, content: Mapping[str, Any], values: Mapping[str, Any] = MappingProxyType({})
) -> Machine:
    """The machine of a scene as a file gives it, with other values by dotted path."""
    return build(name, check_scene(name, content, values))


def _check_freedom(machine: Machine) -> None:
    """Refuse a machine that cannot be assembled, or cannot follow its drives."""
    assembly, plan = machine.assembly, machine.plan
    if 0 < assembly.overdriven == len(plan.prescribed) and not assembly.freedom:
        raise InputError(
            f'the mechanism cannot move: with its loops closed by {", ".join(plan.ideal.cut)} '
            f'its joints hold {", ".join(plan.prescribed)} fast: remove a joint, or correct the '
            'ratios that contradict each other'
        )
    if assembly.overdriven:
        count = len(plan.prescribed)
        raise InputError(
            f'{counted(count, "drive")} ({", ".join(plan.prescribed)}): '
            f'{assembly.overdriven} too many: the mechanism has fewer degrees of freedom; '
            'remove a drive'
        )
    if machine.torque_driven and not assembly.freedom:
        raise InputError(
            'the mechanism cannot move: its joints and drives leave it no degree of freedom; it '
            'is a structure'
        )
    given = _weighed(machine)
    if machine.level is Level.SMOOTH and not given:
        degrees = counted(assembly.freedom + len(plan.prescribed), 'degree')
        drives = ', '.join(plan.prescribed) or 'none'
        raise InputError(
            f'the mechanism has {degrees} of freedom, and prescribed '
            f'are {drives}: is a joint or a drive missing? A motion that is left free needs the '
            "mass of every link, 'links.LINK.mass'"
        )


def _weighed(machine: Machine) -> list[str]:
    """The links with a mass of their own."""
    links = ((name, machine.scene.links[name]) for name in machine.plan.links)
    return [name for name, link in links if link.mass is not None or link.elastic]


def _check_mass(machine: Machine) -> None:
    """Refuse links without a mass that forces need, and forces without limit."""
    weighed = _weighed(machine)
    if machine.level.dynamic or (weighed and machine.scene.outputs.forces):
        without = [n for n in machine.plan.links if n not in weighed]
        if without and not machine.plan.weighed:
            raise InputError(
                f"'links.{without[0]}.mass' is missing: forces, torques and clearances need the "
                'mass, inertia and cog of every moving link'
            )
    if not machine.level.dynamic:
        return
    _check_inertia(machine)
    for joint, why in machine.without_forces.items():
        raise InputError(
            f'joints.{joint}.{why}; a scene of {machine.level.value} needs forces: take curves '
            "and ends that meet, or run it as kinematics, with a prescribed 'drive' and without "
            "'lift_off' and clearance"
        )


def _check_unknowns(machine: Machine) -> None:
    """Refuse more or fewer unknown loads than given efforts, and those of an unknown motion."""
    plan = machine.plan
    labels = [load.label for load in plan.unknowns(plan.ideal)]
    if not labels and not plan.efforts:
        return
    unknown = ', '.join(f'loads.{label}' for label in labels) or 'no load'
    given = ', '.join(plan.efforts) or 'none'
    start = f'unknown is {unknown}, and drives with a given effort are {given}'
    if machine.level is not Level.INVERSE_DYNAMICS:
        raise InputError(
            f'{start}: that needs prescribed drives, masses (0 kg will do) and no clearance; this '
            f'scene is one of {machine.level.value}'
        )
    if len(labels) > len(plan.efforts):
        silent = [c for c in plan.prescribed if c not in plan.efforts]
        key = 'drive' if silent[:1] == [machine.plan.main] else f'drives.{(silent or [""])[0]}'
        cure = f"give '{key}.effort'" if silent else "leave out 'unknown: true' of a load"
        raise InputError(
            f'{start}: {len(labels) - len(plan.efforts)} too many are unknown, for each needs a '
            f'prescribed drive whose torque or force is given; {cure}'
        )
    if len(labels) < len(plan.efforts):
        raise InputError(
            f'{start}: {len(plan.efforts) - len(labels)} too few are unknown: nothing would '
            "balance what the drives supply; set 'loads.LOAD.unknown: true', or leave out an "
            "'effort'"
        )
    duration = min(machine.scene.duration or math.inf, machine.drive.period)
    if duration == math.inf:
        return
    run = machine.nominal.run([plan.laws[c][0] for c in plan.prescribed])
    announce(plan, run, {c: plan.laws[c] for c in plan.prescribed})
    motion = run.motion(duration)
    physics = machine.physics
    assert isinstance(physics, NominalPhysics)  # noqa: S101 - its level says so
    segments = np.arange(len(motion))
    work = physics.work_of_unknowns(motion, segments, 0.37 * motion.curve.duration)
    if (np.abs(work) <= _MECHANISM.no_work).all():
        raise InputError(
            f'{start}: the sizes cannot be found, for in the given motion these loads do no work, '
            'or do it in one proportion; let them act where something moves, along its motion'
        )


def _check_inertia(machine: Machine) -> None:
    """Refuse a motion that drives and closed loops leave free and that moves no mass.

    While loose joints are open they keep nothing together.
    """
    mechanism = machine.mechanism
    loops = machine.plan.loops(machine.plan.prescribed)
    at = machine.assembly
    q, _ = converted(machine.plan.ideal, mechanism, at.q, at.v)
    direction = _without_mass(loops, q)
    if direction is not None and loops.rows:  # at this position only, if singular
        _, J = loops.closure(q[:, None])
        beside = neighbours(loops, q)
        ranks = [np.linalg.matrix_rank(x) for x in loops.closure(beside)[1]]
        if ranks and max(ranks) > np.linalg.matrix_rank(J[0]):
            q = beside[:, int(np.argmax(ranks))]
            direction = _without_mass(loops, q)
    if direction is None:
        return
    links = moving(mechanism, q, direction)
    bare = [x for x in links if not mechanism.body(x).mass]
    open_ = ' while loose joints are open,' if machine.plan.clearances else ''
    if len(links) == 1 and not bare:
        (link,) = links
        raise InputError(
            f'nothing that turns with the link {link} has inertia, so that its motion is not '
            f"determined: give 'links.{link}.inertia' more than 0, or its mass away from its joint"
        )
    several = len(links) > 1
    key = f'links.{(bare or links)[0]}'
    raise InputError(
        f'{" and ".join(links)} can move{open_} without moving any mass, so that '
        f"{'their' if several else 'its'} motion is not determined: give '{key}.mass' or "
        f"'{key}.inertia' more than 0, or a point mass that moves along"
    )


def _without_mass(loops: Kinematics, q: Array) -> Array | None:
    """A direction (n,) in which free coordinates move and no mass does; None if there is none."""
    _, J = loops.closure(q[:, None])
    motion = inertial_motion(loops.mechanism, q) * loops.scale
    found = without_mass(motion[:, loops.sought], (J[0] * loops.scale)[:, loops.sought])
    if not found.size:
        return None
    direction = np.zeros(len(q))
    direction[loops.sought] = found[:, 0]
    return direction * loops.scale


def _check_joints(machine: Machine) -> None:
    loose, touching = machine.plan.rigid, machine.plan.touching
    places: dict[str, list[tuple[float, float]]] = {}  # positions of joints, by link
    for link, at in (point for j in machine.plan.joints for point in j.points):
        places.setdefault(link, []).append(at)
    between = [math.dist(a, b) for p in places.values() for a, b in combinations(p, 2)]
    shortest = min((x for x in between if x > 0.0), default=math.inf)
    soft = any(c.wall == 'soft' for c in (*loose.values(), *touching.values()))
    least = _MECHANISM.least_clearance * float(np.spacing(machine.mechanism.reach))
    for joint, clearance in loose.items():
        given = machine.scene.joints[joint]
        keys = (k for k in ('lift_off', 'groove', 'backlash') if getattr(given, k))
        where = f'joints.{joint}.{next(keys, "clearance")}'
        if clearance.radial >= shortest and not _is_angular(machine, joint):
            raise InputError(
                f'{where}.radial = {clearance.radial:g} m is larger than the shortest link '
                f'({shortest:g} m)'
            )
        if 0.0 < clearance.radial < least and not _is_angular(machine, joint):
            key = '.radial =' if where.endswith('clearance') else ' makes a play to either side of'
            raise InputError(
                f'{where}{key} {clearance.radial:g} m: places in a machine of '
                f'{machine.mechanism.reach:.3g} m are known to some '
                f'{np.spacing(machine.mechanism.reach):.1g} m, which allows for {least:.2g} m or '
                'more; leave it out, or give more'
            )
        _check_clearance(where, 'contact', clearance, soft)
        of_materials = clearance.contact and clearance.contact.materials
        shaped = isinstance(clearance, Clearance) and (clearance.profile or clearance.wear)
        rubs = 'friction' in clearance.model_fields_set  # 0, too: studies vary it from there
        if clearance.pin_radius and not (rubs or of_materials or shaped):
            raise InputError(
                f'{where}.pin_radius = {clearance.pin_radius:g} m has no effect without friction: '
                'give friction too, or leave it out'
            )
    for joint, contact in touching.items():
        key, law = machine.scene.joints[joint].kind_keys.touches_by
        _check_clearance(f'joints.{joint}{key}', law, contact, soft)


def _check_clearance(where: str, law: str, spec: ClearanceSpec, soft: bool) -> None:
    """Refuse contacts of a joint that do not go together, or not with those of others.

    Parameters
    ----------
    law : the key of their law of force
    soft : True if any contact of the machine is compliant
    """
    if soft and spec.wall == 'rigid':
        key = f'{law}.stiffness' if spec.film else law
        raise InputError(
            f"{where} has no '{key}', but another joint has: either all loose joints and stops "
            'are compliant or none is'
        )
    _check_contact(f'{where}.{law}', where, spec)
    if spec.wall == 'soft' and math.isinf(spec.friction):
        raise InputError(f'{where}.friction = rough is for rigid contacts only')
    axial = spec.axial if isinstance(spec, Clearance) else None
    dead = not spec.restitution or (axial and axial.restitution == 0.0)
    if spec.contact and spec.contact.law == 'flores' and dead:
        raise InputError(f'{where}: the law of Flores needs a restitution above 0')
    if spec.friction > 10.0 and not math.isinf(spec.friction):
        raise InputError(
            f'{where}.friction = {spec.friction:g} is more than 10: for contacts that never slip '
            "write 'friction: rough'"
        )


def _is_angular(machine: Machine, name: str) -> bool:
    joint = machine.mechanism.joint(name)
    return isinstance(joint, HigherPair) and joint.angular_clearance


_OF_FILMS = (
    'viscosity', 'width', 'radius', 'cavitation', 'roughness', 'supply_pressure',
    'cavitation_pressure',
)  # fmt: skip


def _check_contact(law: str, where: str, clearance: ClearanceSpec) -> None:
    """Refuse contacts without a key that their law needs, or with one that it does not know."""
    contact = clearance.contact
    if contact is None:
        return
    film, thin = clearance.film, contact.roughness
    for key in ('viscosity', 'width', 'radius') if film else ('stiffness',):
        if getattr(clearance if key == 'stiffness' else contact, key) is None:
            raise InputError(f"{law}: '{key}' is missing: the law {contact.law} needs it")
    for key in _OF_FILMS:
        if key == 'radius' and contact.materials:
            continue
        if getattr(contact, key) != Contact.model_fields[key].default and not film:
            raise InputError(f'{law}.{key} applies to the law film only')
    supply, lowest = contact.supply_pressure, contact.cavitation_pressure
    if supply < lowest:
        raise InputError(
            f'{law}.supply_pressure = {supply:g} Pa is less than cavitation_pressure, {lowest:g} '
            'Pa: the film would rupture at its supply'
        )
    if supply > lowest and contact.cavitation == 'none':
        raise InputError(
            f'{law}.cavitation = none: the film is whole whatever the pressure of its '
            "supply: leave it out, or 'supply_pressure' and 'cavitation_pressure'"
        )
    if thin and thin >= clearance.radial:
        raise InputError(
            f'{law}.roughness = {thin:g} m must be less than radial, '
            f'{clearance.radial:g} m: there is no room for oil'
        )
    if film and not thin and (clearance.friction or clearance.stiffness):
        key = 'friction' if clearance.friction else 'contact.stiffness'
        raise InputError(
            f"{where}.{key} has no meaning with a film alone: give 'contact.roughness', at which "
            'its walls touch'
        )
    if not clearance.stiffness and contact.exponent != Contact.model_fields['exponent'].default:
        raise InputError(f"{law}.exponent has no meaning without a 'stiffness' of walls")
    if film and clearance.pin_radius:
        raise InputError(f'{where}.pin_radius: with a film it is contact.radius; leave it out')


def _check_redundant(machine: Machine) -> None:
    """Refuse what needs forces that redundant constraints leave open."""
    if not (machine.level.dynamic or machine.level is Level.INVERSE_DYNAMICS):
        return
    open_ = machine.nominal.undetermined
    count = machine.assembly.redundant
    why = (
        f'{count} of the closure equations follow{"s" * (count == 1)} from the others, so that '
        'this force is not determined; make a joint that is redundant a slot, or an elastic one'
    )
    for f in machine.plan.frictions(machine.mechanism):  # a block has friction by its moment
        if is_force_open(open_, f.name) or (getattr(f, 'length', False) and f.name in open_):
            raise InputError(f'joints.{f.name}.friction follows from its force, but {why}')
    for name, sensor in machine.scene.sensors.items():
        if sensor.kind == 'load_cell' and is_force_open(open_, str(sensor.joint)):
            raise InputError(f'sensors.{name}.joint = {sensor.joint}: {why}')
    for name, part in machine.scene.oscillators.items():
        if joints := [joint for joint in part.joints or () if joint in open_]:
            raise InputError(f'oscillators.{name}.joints: {joints[0]}: {why}')
    if open_ and machine.plan.efforts:
        raise InputError(
            'loads of unknown size and redundant constraints exclude each other: '
            f'{count} of the closure equations follow{"s" * (count == 1)} from the others; make '
            'a joint that is redundant a slot'
        )


def _check_oscillators(machine: Machine) -> None:
    """Frames on springs that can be."""
    grounded = [j.name for j in machine.mechanism.joints if GROUND in (j.first, j.second)]
    for name, part in machine.scene.oscillators.items():
        where = f'oscillators.{name}'
        if not name.isidentifier():
            raise InputError(f"the oscillator name '{name}' must be letters, digits and _")
        if name in (GROUND, *machine.plan.links):
            raise InputError(f"the oscillator '{name}' has the name of a link")
        if not machine.plan.weighed:
            raise InputError(f'{where}: what shakes it needs the masses of all links')
        if part.joints is None:
            continue
        check_impulses(machine)
        if not (machine.level.dynamic or machine.scene.outputs.forces):
            raise InputError(f"{where}.joints: their forces need 'outputs.forces: true'")
        for joint in part.joints:
            wrong = f"{where}.joints: '{joint}' is not a joint of the ground"
            check_known(joint, grounded, wrong, 'those are:')


def _check_sensors(machine: Machine) -> None:
    """Sensors that are somewhere on this machine."""
    for name, sensor in machine.scene.sensors.items():
        where = f'sensors.{name}'
        if not name.isidentifier():
            raise InputError(f"the sensor name '{name}' must be letters, digits and _")
        sensor.check(machine, where)
        if sensor.trigger and machine.plan.main in machine.mechanism.displacements:
            raise InputError(
                f'{where}.trigger needs a drive that turns; {machine.plan.main} slides'
            )


def _with_swing(scene: Scene) -> Scene:
    """The scene, with a formula of its position instead of `drive.swing`."""
    drive = scene.drive
    if any(x.swing for x in scene.drives.values()) or (scene.drives and drive and drive.swing):
        raise InputError("'swing' is for a machine with a single drive, 'drive'")
    if drive is None or drive.swing is None:
        return scene
    beside = [
        k for k in ('position', 'moves', 'profile', 'speed') if getattr(drive, k) is not None
    ]
    if beside:
        raise InputError(f'drive.swing and drive.{beside[0]} exclude each other: keep one')
    steady = drive.model_copy(update={'swing': None, 'speed': QuantityValue(1.0, '')})
    plain = Machine('', scene.model_copy(update={'drive': steady, 'duration': None})).rigid
    plan, c = plain.plan, plain.plan.main
    found = None if plain.torque_driven else plain.nominal.drive_range
    if found is None or not math.isfinite(found.high - found.low):
        raise InputError(f'drive.swing: {c} has no limits on both sides to swing between')
    unit = 'm' if c in plan.ideal.displacements else 'rad'
    turned = 2.0 * math.pi * plan.turned.get(c, 0)
    way, middle = found.high - found.low, turned + 0.5 * (found.low + found.high)
    margin = drive.swing.margin
    aside = _MARGIN * way
    if margin is not None:
        aside = plan.measure('drive.swing.margin', margin, unit == 'm', ('rad', 'm'))
    size, start = 0.5 * way - aside, turned + plan.held[c][0] - middle
    if not size > 0.0 or abs(start) > size:
        raise InputError(
            f'drive.swing: {c} starts at {start + middle:g} {unit}, which is not between '
            f'{middle - size:g} and {middle + size:g} {unit}, its limits with the margin'
        )
    phase, pace = math.asin(start / size), 2.0 * math.pi / drive.swing.period
    text = f'{middle!r} {unit} + {size!r} {unit}*sin({pace!r}*t + {phase!r})'
    position = PositionPart(formula=text.replace('+ -', '- '), points=None)
    update = {'swing': None, 'position': position, 'start_angle': None, 'start_position': None}
    return scene.model_copy(update={'drive': drive.model_copy(update=update)})
