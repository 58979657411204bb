"""Numbers in a bag of another program: what each field says, from when to when, and its range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechanism_sim.analysis.message_paths import Field, MessagePath, numeric_paths
from mechanism_sim.analysis.published import PublishedRange
from mechanism_sim.analysis.series import recorded
from mechanism_sim.errors import InputError
from mechanism_sim.recording import Bag

_LONGEST = 1000  # items of an array; more of them are pictures and scans


@dataclass(frozen=True)
class FieldRange(PublishedRange):
    """The range of a field, or of an item of an array, whose path is `quantity`."""

    unit: str
    samples: int
    start: float  #: [s] of the first of them
    end: float  #: [s]


def field_ranges(bag: Bag) -> tuple[FieldRange, ...]:
    """The ranges of all numeric fields that the first message of a topic has."""
    lost, paths = bag.unreadable(), []
    for topic in (t.name for t in bag.topics.values() if t.count and t.name not in lost):
        for _, message, _ in bag.messages(topic):
            paths += [
                MessagePath(f'{topic}.{".".join(fields)}', topic, tuple(map(Field, fields)))
                for fields in numeric_paths(message, _LONGEST)
            ]
            break
    if not paths:
        raise InputError(f'{bag.path} holds nothing that can be analysed: {bag.contents()}')
    found = []
    for s in (s for group in recorded(bag, paths) for s in group):
        if np.isfinite(s.values).any():
            low, high = int(np.nanargmin(s.values)), int(np.nanargmax(s.values))
            ends = [(float(s.values[k]), float(s.t[k])) for k in (low, high)]
            found.append(
                FieldRange(s.name, *ends[0], *ends[1], s.unit, len(s.t), *map(float, s.t[[0, -1]]))
            )
    return tuple(found)
