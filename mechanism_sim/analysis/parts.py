"""What cams, gears, Geneva wheels and frames did: the range of what was published of them."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple


class PartKind(NamedTuple):
    """What is summed up of a kind of parts."""

    title: str
    state: str | None  #: the field that says in what state a part is
    names: dict[int, str]  #: of its values
    fields: tuple[str, ...]  #: whose ranges are wanted
    part: str = 'joint'  #: the field that names it


#: by topic; the numbers are those of the messages
PARTS = {
    'cam_state': PartKind(
        'cams',
        'mode',
        {0: 'unknown', 1: 'contact', 2: 'lifted', 3: 'outer', 4: 'guided'},
        ('lift', 'gap', 'contact_force', 'pressure_angle', 'cam_torque'),
    ),
    'gear_state': PartKind(
        'gears',
        'mode',
        {0: 'unknown', 1: 'left', 2: 'right', 3: 'free', 4: 'meshed'},
        ('transmission_error', 'tooth_force', 'first_torque', 'second_torque', 'mesh_frequency'),
    ),
    'geneva_state': PartKind(
        'Geneva drives',
        'engaged',
        {0: 'locked', 1: 'engaged'},
        ('driven_velocity', 'driven_acceleration', 'driven_effort', 'driver_torque'),
    ),
    'oscillator_state': PartKind(
        'oscillators',
        None,
        {},
        (
            'x',
            'y',
            'angle',
            'acceleration_x',
            'acceleration_y',
            'force_x',
            'force_y',
            'moment',
            'mount_force_x',
            'mount_force_y',
        ),
        'oscillator',
    ),
}


@dataclass(frozen=True)
class Range:
    """The range of one quantity in SI units, among the instants that were published."""

    quantity: str
    lowest: float
    lowest_time: float  #: [s]
    highest: float
    highest_time: float  #: [s]


@dataclass(frozen=True)
class PartSummary:
    """One part over a run; `share` of the instants by the name of its state sums to 1."""

    joint: str  #: or the name of an oscillator
    samples: int
    share: dict[str, float]
    ranges: tuple[Range, ...]  #: without those of which nothing is known


class PartCollector:
    """Keeps the ranges of messages of one kind."""

    def __init__(self, kind: PartKind) -> None:
        self._kind = kind
        self._states: dict[str, Counter[str]] = {}
        self._ranges: dict[tuple[str, str], Range] = {}

    def add(self, message: Any) -> None:
        """Take in one instant of one part."""
        joint, time = str(getattr(message, self._kind.part)), float(message.time)
        counts = self._states.setdefault(joint, Counter())
        state = int(getattr(message, self._kind.state)) if self._kind.state else 0
        counts[self._kind.names.get(state, str(state))] += 1
        for field in self._kind.fields:
            value = float(getattr(message, field))
            if math.isnan(value):
                continue
            old = self._ranges.get((joint, field)) or Range(field, value, time, value, time)
            low = min((old.lowest, old.lowest_time), (value, time))
            high = (value, time) if value > old.highest else (old.highest, old.highest_time)
            self._ranges[joint, field] = Range(field, *low, *high)

    def summary(self) -> tuple[PartSummary, ...]:
        """The parts, in the order in which they were met."""
        return tuple(
            PartSummary(
                joint,
                states.total(),
                {name: count / states.total() for name, count in states.items()}
                if self._kind.state
                else {},
                tuple(r for (of, _), r in self._ranges.items() if of == joint),
            )
            for joint, states in self._states.items()
        )
