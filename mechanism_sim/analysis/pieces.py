"""A recorded run, piece by piece as it was published, whether its machine is known or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np

from mechanism_sim.errors import InputError
from mechanism_sim.hybrid.dense_output import Motion
from mechanism_sim.hybrid.events import Impact, Mode, ModeChange
from mechanism_sim.messages.segments import motion_of
from mechanism_sim.numerics.polynomials import PiecewisePolynomial
from mechanism_sim.recording.reader import Bag

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
_RUN = 'motion', 'impacts', 'mode_changes'
_ZEROS = np.zeros((0, 0))
NOTHING = Motion(
    PiecewisePolynomial(
        np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 0), np.int64), np.zeros((0, 0, 1))
    ),
    np.zeros((0, 0), np.uint8), _ZEROS, np.zeros((0, 0, 3)),
)  # fmt: skip
"""Motion of no segments."""

_IMPACT = attrgetter(*('time' if name == 't' else name for name in Impact._fields
                       if name != 'drive_work'))  # fmt: skip
_WORK = Impact._fields.index('drive_work')


@dataclass(frozen=True)
class RecordedPiece:
    """A message of the motion, and the events that were published since the one before.

    Attributes
    ----------
    coordinates, joints : names of the columns of the motion; empty where it is not recorded
    """

    coordinates: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    motion: Motion = NOTHING
    impacts: list[Impact] = field(default_factory=list)
    modes: list[ModeChange] = field(default_factory=list)


def pieces(
    bag: Bag,
    namespace: str | None = None,
    others: Mapping[str, Callable[[Any], object]] | None = None,
) -> Iterator[RecordedPiece]:
    """The pieces of a run, in one pass over its bag; at the end, events without a motion.

    Parameters
    ----------
    namespace : of the machine, where the bag holds several
    others : are handed messages of further kinds of topics (see `KINDS`) as they come
    """
    others, topics = others or {}, find_topics(bag, namespace)
    kinds = {name: kind for kind in (*_RUN, *others) for name in topics[kind]}
    impacts: list[Impact] = []
    modes: list[ModeChange] = []
    for topic, message, _ in bag.messages(kinds):
        kind = kinds[topic]
        if kind == 'impacts':
            values = _IMPACT(message)
            impacts.append(Impact._make((*values[:_WORK], np.nan, *values[_WORK:])))
        elif kind == 'mode_changes':
            modes.append(_mode_change(bag, message))
        elif kind == 'motion':
            names = tuple(message.coordinates), tuple(message.joints)
            yield RecordedPiece(*names, motion_of(message), impacts, modes)
            impacts, modes = [], []
        else:
            others[kind](message)
    if impacts or modes:
        yield RecordedPiece(impacts=impacts, modes=modes)


def _mode_change(bag: Bag, message: Any) -> ModeChange:
    try:
        modes = Mode(message.mode), Mode(message.previous_mode)
    except ValueError as error:
        raise InputError(f'{bag.path}, topic mode_changes: {error}.') from error
    return ModeChange(message.time, message.joint, *modes)


def gaps(curve: PiecewisePolynomial) -> list[tuple[float, float]]:
    """The spans [s] between segments that should meet and do not: lost messages."""
    end = curve.start[:-1] + (curve.start_low[:-1] + curve.duration[:-1])
    slack = 8 * np.spacing(np.abs(curve.start[1:])) + 1e-15
    apart = np.flatnonzero(curve.start[1:] - end > slack)
    return [(float(end[k]), float(curve.start[k + 1])) for k in apart]


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
        raise InputError(f'{bag.path} has nothing of a machine in namespace {namespace}.')
    return found
