"""A scene by name, path or text as a machine that runs, and for how long."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from mechanism_sim.arguments import listed, public
from mechanism_sim.arrays import Array
from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import SceneError
from mechanism_sim.linkages.drive_range import placed_at
from mechanism_sim.scene.build import build
from mechanism_sim.scene.drives import drive_key, drive_of
from mechanism_sim.scene.facts import units_at
from mechanism_sim.scene.files import check_scene, content_of, overridden
from mechanism_sim.scene.four_bar import FourBarScene
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.motion_keys import SpeedPart
from mechanism_sim.scene.plan import ScenePlan, keeps_speed
from mechanism_sim.scene.remarks import angle_questions, length_questions
from mechanism_sim.scene.schema import InitialPart, Scene
from mechanism_sim.scene.validation import TURN, between_limits, limits_text, validate
from mechanism_sim.units import QuantityValue, argument, written

_PLAYS = 'clearance', 'lift_off', 'backlash'
Source: TypeAlias = str | Path | Mapping[str, Any] | Scene | FourBarScene | Machine
"""All from which `load_scene` makes a machine."""

RAMP = 0.01  # acceleration distance of a drive, as a share of that between limits
_BESIDE = 1e-12  # of the way: so near to a limit, links stand where they do at it, to 1e-6
_MOMENT = 1e-6  # [s] of which no more than the start is looked at


@public
def load_scene(
    source: Source, overrides: Mapping[str, Any] | str | Iterable[str] = (), name: str = 'scene'
) -> Machine:
    """A scene ready to run: one of the package by name, or your own, in any form.

    Numbers are in SI units, text has units as in files (``'64 mm'``); numbers and arrays of NumPy
    and quantities of pint are taken as well.

    >>> import mechanism_sim as ms
    >>> ms.load_scene('pendulum', {'gravity': [0, '-1.62 m/s^2']})
    <Machine pendulum: Pendulum>
    >>> wheel = {'title': 'A wheel', 'mechanism': 'linkage', 'links': {'wheel': {}}}
    >>> wheel |= {'joints': {'axle': {'revolute': ['ground', 'wheel']}}}
    >>> ms.load_scene(wheel | {'drive': {'coordinate': 'wheel', 'speed': '180 rpm'}}, name='wheel')
    <Machine wheel: A wheel>

    Parameters
    ----------
    source : a name such as ``'four_bar_clearance'``, a path such as ``'my/machine.yaml'``, YAML as
        text, a dictionary, a `Scene`, or a machine, which stays as it is without overrides
    overrides : values by dotted path, such as ``{'drive.speed': '300 rpm'}``
    name : name of a machine whose source has none
    """
    overrides = overrides if isinstance(overrides, Mapping) else listed(overrides, 'overrides')
    if isinstance(source, Machine):
        if not overrides:
            return source
        source, name = source.scene, source.name
    given = content_of(source, name, overrides)
    content = overridden(given.file, given.data, overrides, given.folder)
    questions = (*length_questions(content), *angle_questions(content))
    try:
        return build(given.name, check_scene(given.file, content), questions)
    except InputError as error:
        shape = [question for question in questions if question.startswith(('links.', 'joints.'))]
        if not shape:
            raise
        raise InputError(f'{error}; {shape[0]}') from error


def unit_at(scene: Scene, path: str) -> str:
    """SI unit of the number at a dotted path of a scene; empty of a plain one.

    Of several that which the place takes, as rad/s of a drive that turns.
    """
    value, units = units_at(scene, path)
    if isinstance(value, QuantityValue) and len(units) > 1:
        for unit in units:
            with suppress(InputError):
                load_scene(scene, {path: f'{value.value!r} {unit}'})
                return unit
    return units[0] if len(units) == 1 else ''


def span(machine: Machine, revolutions: float | None, duration: float | str | None) -> float:
    """The requested duration [s], from revolutions of the crank or a time, ``'10 s'``.

    If none is asked for, that of the scene, or else as many revolutions as bring all again.
    """
    if revolutions is not None and duration is not None:
        raise InputError('give either revolutions or a duration, not both')
    duration = argument('duration', duration, 's')
    revolutions = argument('revolutions', revolutions, '')
    asked = revolutions if revolutions is not None else duration
    if asked is not None and not (asked > 0.0 and math.isfinite(asked)):
        raise InputError(f'the length of a run must be positive and finite, not {asked:g}')
    if asked is None:
        duration = machine.scene.duration
    if duration is None and revolutions is None:
        duration = machine.drive.repetition.duration
    if duration is None:
        turns = machine.drive.repetition.turns if revolutions is None else revolutions
        duration = machine.drive.time_of(turns)
    return duration


def run_length(machine: Machine, revolutions: float | None, duration: float | str | None) -> float:
    """`span` for commands and nodes, which refuse what cannot be run for so long."""
    end = span(machine, revolutions, duration)
    validate(machine, end)
    return end


def started_at(machine: Machine, angle: float) -> Machine:
    """Copy of a machine with its main drive at another angle [rad] at the start."""
    scene, given = machine.scene, drive_of(machine.plan, machine.plan.main)
    if given is None:
        raise SceneError(f'{machine.name}: there is no drive to start at an angle')
    if given.position:
        key = drive_key(machine.plan, machine.plan.main)
        raise SceneError(f"{machine.name}: '{key}.position' gives where its main drive starts")
    position = {c: x for c, x in scene.initial.position.items() if c != machine.plan.main}
    changed: dict[str, Any] = {
        **_redriven(machine.plan, {'start_angle': angle}),
        'initial': scene.initial.model_copy(update={'position': position}),
    }
    if loop := machine.assembly.loop:
        near = zip(loop.links[1:], loop.positions(angle), strict=True)
        found = {c: QuantityValue(float(x), 'rad') for c, x in near if math.isfinite(x)}
        changed['guess'] = {**scene.guess, **found}
    return replace(machine, scene=scene.model_copy(update=changed))


def has_place(machine: Machine) -> bool:
    """True if the position of its main drive determines the state, as required by `placed`."""
    alone = len(machine.plan.laws) == 1 and keeps_speed(machine.plan, machine.plan.main)
    return alone and not (machine.level.dynamic or machine.assembly.freedom)


def placed(machine: Machine, value: float) -> Machine:
    """Copy of a machine with its prescribed drive elsewhere at the start, on the same branch.

    It runs for a moment only: for what the machine is like at that position.

    Parameters
    ----------
    value : position of the drive [rad, m]; an angle up to whole turns
    """
    plan, main = machine.plan, machine.plan.main
    straight, turned = main in plan.ideal.displacements, TURN * plan.turned.get(main, 0)
    if not has_place(machine):
        raise SceneError(
            f'{machine.name}: its state does not follow from the position of {main} alone: that '
            'needs a single drive, at constant speed, and no clearance'
        )
    q, start = machine.assembly.q, plan.held[main][0]
    goal = value if straight else start + math.remainder(value - start, TURN)
    goals = [goal] if straight else [goal, goal - math.copysign(TURN, goal - start)]
    kinematics = plan.kinematics(plan.prescribed)
    place = next((p for x in goals if (p := placed_at(kinematics, q, x)) is not None), None)
    if place is None:
        shown = written(value, 'm', 9) if straight else f'{math.degrees(value):.9g} deg'
        raise SceneError(f'{machine.name}: {main} cannot be at {shown}: {limits_text(machine)}')
    speed = plan.held[main][1]
    return _moved(machine, place, turned, speed, None, _MOMENT)


def over_range(machine: Machine) -> Machine | None:
    """Copy of a machine with a limited drive, moving from one limit to the other.

    At the speed of its drive, but for the beginning and the end of the way: there the drive starts
    and stops, for at constant speed links would be infinitely fast at the limits. None if it can
    turn round.
    """
    limits = between_limits(machine)
    if limits is None or machine.level.dynamic:
        return None
    plan, main = machine.plan, machine.plan.main
    speed, size = plan.held[main][1], limits.high - limits.low
    beside = _BESIDE * max(size, abs(limits.low), abs(limits.high))
    first = limits.low + beside if speed > 0.0 else limits.high - beside
    place = placed_at(plan.kinematics(plan.prescribed), machine.assembly.q, first)
    if place is None:
        return None
    ramp = 2.0 * RAMP * size / abs(speed)
    # as if from the limit itself, where the motion of all links is smooth
    begun = ramp * math.sqrt(beside / (RAMP * size))
    slow, steady = speed * begun / ramp, ramp - begun + (1.0 - 2.0 * RAMP) * size / abs(speed)
    unit = 'm/s' if main in plan.ideal.displacements else 'rad/s'
    end = steady + ramp - begun
    points = [(0.0, slow), (ramp - begun, speed), (steady, speed), (end, slow)]
    profile = SpeedPart(points=[(t, QuantityValue(x, unit)) for t, x in points])
    turned = TURN * plan.turned.get(main, 0)
    return _moved(machine, place, turned, None, profile, end)


def _moved(
    machine: Machine,
    q: Array,
    turned: float,
    speed: float | None,
    profile: SpeedPart | None,
    duration: float,
) -> Machine:
    """Copy of a machine that starts at coordinates (n,), with another motion of its drive."""
    scene, plan, main = machine.scene, machine.plan, machine.plan.main
    straight = plan.ideal.displacements
    known = dict(zip(plan.ideal.coordinates, q.tolist(), strict=True))
    units = {c: 'm' if c in straight else 'rad' for c in known}
    where = 'start_position' if main in straight else 'start_angle'
    pace = None if speed is None else QuantityValue(speed, f'{units[main]}/s')
    update = dict.fromkeys(('position', 'moves', 'acceleration')) | {
        where: known[main] + turned, 'speed': pace, 'profile': profile,
    }  # fmt: skip
    changed = {
        **_redriven(plan, update),
        'guess': {c: QuantityValue(x, units[c]) for c, x in known.items() if c != main},
        'initial': InitialPart(),
        'duration': duration,
    }
    return replace(machine, scene=scene.model_copy(update=changed))


def _redriven(plan: ScenePlan, update: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a scene with its main drive, of which some keys are others."""
    given = drive_of(plan, plan.main)
    assert given  # noqa: S101 - whoever asks has looked
    own = given.model_copy(update=update)
    if plan.scene.drive:
        return {'drive': own}
    return {'drives': {**plan.scene.drives, plan.main: own}}


def without_clearance(machine: Machine, rigid: bool = False) -> Machine:
    """A machine with every joint ideal: no clearance, lift-off or backlash.

    Where a loose joint let it begin otherwise, it begins as its drives say.

    Parameters
    ----------
    rigid : treat elastic joints as rigid, too
    """
    scene, driven = machine.scene, machine.plan.prescribed
    plays = (*_PLAYS, 'elasticity') if rigid else _PLAYS
    given = scene.initial.position
    update: dict[str, Any] = {
        'joints': {name: _ideal(joint, plays) for name, joint in scene.joints.items()},
        'initial': scene.initial.model_copy(
            update={'position': {n: x for n, x in given.items() if n in driven}, 'velocity': {}}
        ),
        'guess': {
            **{n: x for n, x in given.items() if n not in machine.plan.floating[0]},
            **scene.guess,
        },
    }
    return build(machine.name, scene.model_copy(update=update))


def _ideal(joint: Any, plays: tuple[str, ...]) -> Any:
    update: dict[str, Any] = dict.fromkeys(plays)
    if joint.groove:
        update['groove'] = joint.groove.model_copy(update={'clearance': 0.0, 'restitution': None})
    return joint.model_copy(update=update)
