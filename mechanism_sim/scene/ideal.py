"""A machine without its clearances."""

from __future__ import annotations

from typing import Any

from mechanism_sim.scene.build import build
from mechanism_sim.scene.machine import Machine

_PLAYS = 'clearance', 'lift_off', 'backlash'


def without_clearance(machine: Machine, rigid: bool = False) -> Machine:
    """A machine with every joint ideal: no clearance, lift-off or backlash.

    Where a loose joint let it begin otherwise, it begins as its drives say.

    Parameters
    ----------
    rigid : whether elastic joints are rigid, too
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
