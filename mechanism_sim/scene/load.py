"""A scene by name, path or text as a machine that runs, and for how long."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from mechanism_sim.errors import InputError
from mechanism_sim.keys.names import SceneError
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene, find_scene, overridden, read_yaml
from mechanism_sim.scene.gate import admit
from mechanism_sim.scene.machine import Machine
from mechanism_sim.scene.remarks import length_questions
from mechanism_sim.units import QuantityValue


def load_scene(name: str, overrides: Mapping[str, Any] | Iterable[str] = ()) -> Machine:
    """A scene of the package by name, or your own by path, ready to run.

    Parameters
    ----------
    name : such as ``'four_bar_clearance'`` or ``'my/machine.yaml'``
    overrides : values by dotted path, such as ``{'drive.speed': '300 rpm'}``
    """
    path = find_scene(name)
    content = overridden(path.name, read_yaml(path, 'scene'), overrides)
    return build(path.stem, check_scene(path.name, content), tuple(length_questions(content)))


def span(machine: Machine, revolutions: float | None, duration: float | None) -> float:
    """The duration [s] asked for, as revolutions of the crank or in seconds.

    If none is asked for, that of the scene, or else one revolution.
    """
    if revolutions is not None and duration is not None:
        raise InputError('give either revolutions or a duration, not both')
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
