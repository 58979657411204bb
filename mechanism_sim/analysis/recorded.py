"""The run that a bag holds, as the engine had it: its machine, its motion, its impacts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from mechanism_sim.analysis.topics import find_topics
from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.events import Impact
from mechanism_sim.hybrid.tape import Motion
from mechanism_sim.messages.segments import motion_of
from mechanism_sim.recording import Bag, read_bag, scene_text
from mechanism_sim.scene.build import build
from mechanism_sim.scene.files import check_scene
from mechanism_sim.scene.machine import Machine


class Recorded(NamedTuple):
    """A run read back from a bag."""

    machine: Machine
    motion: Motion
    impacts: list[Impact]


def recorded_machine(bag: Bag) -> Machine:
    """Return the machine that a bag was recorded of, from its topic `scene`.

    Raises:
        InputError: The bag does not have the scene, or not as this version writes it.

    """
    try:
        content = json.loads(scene_text(bag) or '')
        name, scene = str(content['name']), content['scene']
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f'{bag.path} does not hold the scene it was recorded of.') from error
    return build(name, check_scene(f'{bag.path}, topic scene', scene))


def recorded(bag: Bag | Path | str, *, namespace: str | None = None) -> Recorded:
    """Return the run in a bag, in memory.

    Args:
        bag: The bag, or its path.
        namespace: Which machine, where a bag holds several, as '/left'.

    Raises:
        InputError: Not a bag, or its scene or its motion is missing.

    """
    if not isinstance(bag, Bag):
        bag = read_bag(bag)
    machine, topics = recorded_machine(bag), find_topics(bag, namespace)
    parts, impacts = [], []
    for topic, message, _ in bag.messages([*topics['motion'], *topics['impacts']]):
        if topic in topics['motion']:
            parts.append(motion_of(message))
        else:
            impacts.append(_impact(message))
    if not parts:
        raise InputError(f'{bag.path} holds no motion.')
    return Recorded(machine, Motion.joined(parts), impacts)


def _impact(message: Any) -> Impact:
    """The event of a message, but for the work of the drive, which messages do not tell."""
    told = {name: getattr(message, name) for name in Impact._fields if hasattr(message, name)}
    return Impact(t=message.time, drive_work=float('nan'), **told)
