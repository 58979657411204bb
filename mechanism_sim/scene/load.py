"""A scene by name, path or text as a machine that runs, and for how long."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import SceneError
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene, content_of, overridden
from mechanism_sim.scene.four_bar import FourBarScene
from mechanism_sim.scene.gate import admit
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.remarks import length_questions
from mechanism_sim.scene.schema import Scene
from mechanism_sim.units import QuantityValue, argument

Source: TypeAlias = str | Path | Mapping[str, Any] | Scene | FourBarScene | Machine
"""All from which `load_scene` makes a machine."""


def load_scene(
    source: Source, overrides: Mapping[str, Any] | Iterable[str] = (), name: str = 'scene'
) -> Machine:
    """A scene ready to run: one of the package by name, or your own, in whatever form it is.

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
    name : of a machine whose source has none
    """
    if isinstance(source, Machine):
        if not overrides:
            return source
        source, name = source.scene, source.name
    given = content_of(source, name)
    content = overridden(given.file, given.data, overrides)
    questions = tuple(length_questions(content))
    try:
        return build(given.name, check_scene(given.file, content), questions)
    except InputError as error:
        if not questions:
            raise
        raise InputError(f'{error}; {questions[0]}') from error


def span(machine: Machine, revolutions: float | None, duration: float | str | None) -> float:
    """The duration [s] asked for, as revolutions of the crank or as a time, ``'10 s'``.

    If none is asked for, that of the scene, or else one revolution.
    """
    if revolutions is not None and duration is not None:
        raise InputError('give either revolutions or a duration, not both')
    duration = argument('duration', duration, 's')
    asked = revolutions if revolutions is not None else duration
    if asked is not None and not (asked > 0.0 and math.isfinite(asked)):
        raise InputError(f'the length of a run must be positive and finite, not {asked:g}')
    if asked is None:
        duration = machine.scene.duration
    if duration is None:
        duration = machine.drive.time_of(1.0 if revolutions is None else revolutions)
    return duration


def run_length(machine: Machine, revolutions: float | None, duration: float | None) -> float:
    """`span` for commands and nodes, which refuse what cannot be run for so long."""
    end = span(machine, revolutions, duration)
    admit(machine, end)
    return end


def started_at(machine: Machine, angle: float) -> Machine:
    """Copy of a machine with its main drive at another angle [rad] at the start."""
    scene = machine.scene
    if not scene.drive:
        raise SceneError(f"{machine.name}: there is no 'drive' to start at an angle")
    position = {c: x for c, x in scene.initial.position.items() if c != machine.plan.main}
    changed: dict[str, Any] = {
        'drive': scene.drive.model_copy(update={'start_angle': angle}),
        'initial': scene.initial.model_copy(update={'position': position}),
    }
    if loop := machine.assembly.loop:
        near = zip(loop.links[1:], loop.positions(angle), strict=True)
        found = {c: QuantityValue(float(x), 'rad') for c, x in near if math.isfinite(x)}
        changed['guess'] = {**scene.guess, **found}
    return replace(machine, scene=scene.model_copy(update=changed))
