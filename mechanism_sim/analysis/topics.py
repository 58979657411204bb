"""Which topics of a bag are ours, whatever namespace they were recorded in."""

from __future__ import annotations

from mechanism_sim.errors import InputError
from mechanism_sim.recording import Bag

#: Last part of the name and type of what is analysed.
KINDS = {
    'drive': 'mechanism_sim/msg/DriveLaw',
    'motion': 'mechanism_sim/msg/Motion',
    'impacts': 'mechanism_sim/msg/Impact',
    'mode_changes': 'mechanism_sim/msg/ModeChange',
    'joint_reactions': 'mechanism_sim/msg/JointReactions',
    'linkage_state': 'mechanism_sim/msg/LinkageState',
    'cam_state': 'mechanism_sim/msg/CamState',
    'gear_state': 'mechanism_sim/msg/GearState',
    'geneva_state': 'mechanism_sim/msg/GenevaState',
    'oscillator_state': 'mechanism_sim/msg/OscillatorState',
    'sensors': 'mechanism_sim/msg/SensorBlock',
    'progress': 'mechanism_sim/msg/Progress',
}
#: Kinds told by type alone: every sensor or node may have a topic of its own, of any name.
SHARED = ('sensors', 'progress')
#: What is no longer read, with the version of bags that ended it.
RETIRED = {'mechanism_sim/msg/AccelerometerBlock': 2}


def find_topics(bag: Bag, namespace: str | None = None) -> dict[str, tuple[str, ...]]:
    """The names of the topics of one machine by kind; at most one but for shared kinds.

    Parameters
    ----------
    namespace : of the machine, as '/left'; needed where a bag holds several
    """
    for topic in bag.topics.values():
        if topic.type in RETIRED:
            raise InputError(
                f'{bag.path}: {topic.name} holds {topic.type.rpartition("/")[2]}, as bags before '
                f'version {RETIRED[topic.type]} did; {bag.writer} reads it.'
            )
    prefix = f'{(namespace or "").rstrip("/")}/'
    found: dict[str, tuple[str, ...]] = {}
    for kind, type_name in KINDS.items():
        names = tuple(
            topic.name
            for topic in bag.topics.values()
            if topic.type == type_name
            and topic.name.startswith(prefix)
            and (kind in SHARED or topic.name.rpartition('/')[2] == kind)
        )
        if len(names) > 1 and kind not in SHARED:
            raise InputError(
                f'{bag.path} holds several machines ({", ".join(names)}): choose a namespace.'
            )
        found[kind] = names
    if namespace and not any(found.values()):
        raise InputError(f'{bag.path} has no machine in namespace {namespace}.')
    return found
