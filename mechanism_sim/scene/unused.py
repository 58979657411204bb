"""Keys of a scene that change nothing of its machine: said, not passed over in silence."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from mechanism_sim.scene.loads import LOADS
from mechanism_sim.scene.machine import Level, Machine

_NO_FORCES = 'masses are missing, or forces have no limit, and so none are computed'


def unused(machine: Machine) -> list[str]:
    """A sentence for every key that is given and has no effect at the level that runs."""
    return [*_solver(machine), *_start(machine), *_forces(machine), *_unnamed(machine)]


def _solver(machine: Machine) -> Iterator[str]:
    solver, default = machine.scene.solver, type(machine.scene.solver)()
    if not machine.dynamic:
        for key in ('rtol', 'atol'):
            if getattr(solver, key) != getattr(default, key):
                yield (
                    f'solver.{key} has no effect: the motion follows from closed loops, and '
                    'nothing is integrated'
                )
    elif solver.atol and not machine.clearances:
        yield 'solver.atol has no effect: no joint has a clearance in which impacts could chatter'


def _start(machine: Machine) -> Iterator[str]:
    scene = machine.scene
    if scene.start != 'seated' and not machine.clearances:
        yield f"start = '{scene.start}' has no effect: no joint has a clearance"
    if scene.initial.elastic != 'straight' and not machine.mechanism.deformations:
        yield f"initial.elastic = '{scene.initial.elastic}' has no effect: no link is elastic"


def _forces(machine: Machine) -> Iterator[str]:
    scene, outputs = machine.scene, machine.scene.outputs
    if machine.dynamic and not outputs.forces:
        yield 'outputs.forces = false has no effect: the motion follows from forces'
    axial = any(c.endswith('.axial') for c in machine.mechanism.deformations)
    if scene.axial_gravity and not axial:
        yield "axial_gravity: no joint of a link with 'tilt' has 'axial' play"
    if machine.level is not Level.KINEMATIC:
        return
    if outputs.wrenches:
        why = _NO_FORCES if outputs.forces else 'outputs.forces is false'
        yield f'outputs.wrenches has no effect: {why}'
    if outputs.forces:  # else it is plain that nobody asks for them
        for section in LOADS:
            for name in getattr(scene, section):
                yield f'{section}.{name} has no effect: {_NO_FORCES}'
        for name, joint in scene.joints.items():
            if joint.friction and (joint.friction.coefficient or joint.friction.efficiency):
                yield f'joints.{name}.friction has no effect: {_NO_FORCES}'


def _unnamed(machine: Machine) -> Iterator[str]:
    """Tables and gears that nothing of the scene names."""
    content = machine.scene.to_document()
    for section in ('tables', 'gears'):
        own = content.pop(section)
        texts = ' '.join(_texts([content, own] if section == 'gears' else content))
        for name in own:
            if not re.search(rf'\b{re.escape(name)}\b', texts):
                yield f'{section}.{name} has no effect: nothing names it'


def _texts(part: Any) -> Iterator[str]:
    """All texts in the values of a part of a scene."""
    if isinstance(part, str):
        yield part
    elif isinstance(part, dict):
        for value in part.values():
            yield from _texts(value)
    elif isinstance(part, list | tuple):
        for value in part:
            yield from _texts(value)
