"""Figures of published instants, for bags without the motion or quantities beyond it.

Loads have the names of the catalogue, as where they are taken from a motion (`LoadPeaks`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from operator import sub
from typing import Any, NamedTuple

from mechanism_sim.messages.part_states import kinds_of
from mechanism_sim.results.catalogue import catalogue
from mechanism_sim.results.ranges import Ends, Peak
from mechanism_sim.scene import Machine


class PartKind(NamedTuple):
    """Fields of a kind of parts that are summed up."""

    title: str
    state: str | None  #: field with the state of a part
    names: dict[int, str]  #: names of its values
    fields: tuple[str, ...]  #: fields with ranges in the summary
    part: str = 'joint'  #: field with the name of the part


#: published parts by topic; the numbers are those of the messages
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
        ('x', 'y', 'angle', 'acceleration_x', 'acceleration_y', 'force_x', 'force_y', 'moment',
         'mount_force_x', 'mount_force_y'),
        'oscillator',
    ),
}  # fmt: skip


@dataclass(frozen=True)
class PublishedRange:
    """The range of one quantity in SI units."""

    quantity: str
    lowest: float
    lowest_time: float  #: time of the lowest value [s]
    highest: float
    highest_time: float  #: time of the highest value [s]


@dataclass(frozen=True)
class PartSummary:
    """One part over a run; `share` of the instants by the name of its state sums to 1."""

    joint: str  #: name of the joint, or of an oscillator
    samples: int  #: number of published instants
    share: dict[str, float]
    ranges: tuple[PublishedRange, ...]  #: known ranges only
    of_motion: bool  #: True for ranges of the motion, False for those of instants


@dataclass(frozen=True)
class EnergySummary:
    """Energy balance: kinetic + potential - initial - drive work + dissipated = residual.

    All in [J]; the residual would be 0 without errors of integration.
    """

    samples: int
    start: float  #: time of the first published instant [s]
    end: float  #: time of the last instant, the end of all that follows [s]
    initial: float
    final: float
    drive_work: float
    dissipated: float
    residual_at_end: float
    largest_residual: float  #: largest magnitude of the residual [J]
    largest_residual_time: float  #: time of that residual [s]
    largest_energy: float  #: largest term of the balance [J]
    exchanged: float  #: sum of the changes of all terms from instant to instant [J], reference of
    #: the relative residual, independent of the zero of heights


class PublishedRanges:
    """Least and greatest values, and when, among instants as they are entered."""

    def __init__(self) -> None:
        self.samples = 0
        self.ends: dict[str, Ends] = {}

    def add(self, time: float, values: Iterable[tuple[str, float]]) -> None:
        """Enter an instant; what is not a number has no limit there, or is not known."""
        self.samples += 1
        for name, value in values:
            here = Peak(value, time)
            if not math.isnan(value):
                low, high = self.ends.get(name) or (here, here)
                self.ends[name] = min(low, here), here if value > high.value else high


def loads_of(message: Any) -> Iterator[tuple[str, float]]:
    """The loads in a JointReactions message, by the names of the catalogue."""
    for joint, x, y in zip(message.joints, message.force_x, message.force_y, strict=True):
        yield f'reaction.{joint}.size', math.hypot(x, y)
    yield 'drive_torque', float(message.drive_torque)
    for joint, x, y in zip(message.joints, message.moment_x, message.moment_y, strict=False):
        if x or y:
            yield f'bearing_moment.{joint}.size', math.hypot(x, y)


class PublishedParts:
    """States and ranges of the parts of one kind."""

    def __init__(self, topic: str) -> None:
        self._kind = PARTS[topic]
        self._states: dict[str, Counter[str]] = {}
        self._ranges: dict[str, PublishedRanges] = {}

    def add(self, message: Any) -> None:
        """Enter one instant of one part."""
        kind, part = self._kind, str(getattr(message, self._kind.part))
        state = int(getattr(message, kind.state)) if kind.state else 0
        self._states.setdefault(part, Counter())[kind.names.get(state, str(state))] += 1
        values = ((field, float(getattr(message, field))) for field in kind.fields)
        self._ranges.setdefault(part, PublishedRanges()).add(float(message.time), values)

    def summary(self, of_motion: Mapping[str, Ends]) -> tuple[PartSummary, ...]:
        """The parts, in the order in which they were met.

        Parameters
        ----------
        of_motion : ranges of the motion by the names of the catalogue, as far as it is known
        """
        found = []
        for part, states in self._states.items():
            names = {field: f'{field}.{part}' for field in self._kind.fields}
            known = {f: of_motion[name] for f, name in names.items() if name in of_motion}
            ends, total = known or self._ranges[part].ends, states.total()
            share = {name: count / total for name, count in states.items()}
            ranges = tuple(
                PublishedRange(field, *low, *high) for field, (low, high) in ends.items()
            )
            found.append(
                PartSummary(part, total, share if self._kind.state else {}, ranges, bool(known))
            )
        return tuple(found)


def names_of_parts(machine: Machine) -> Iterator[str]:
    """The quantities of cams, gears and Geneva wheels with computed ranges."""
    known = catalogue(machine)
    for kind in kinds_of(machine).values():
        for joint in kind.joints(machine):
            names = (f'{field}.{joint.name}' for field in PARTS[kind.topic].fields)
            yield from (name for name in names if name in known)


class PublishedEnergies:
    """Follows the balance of energy through LinkageState messages, from the first of them on."""

    def __init__(self) -> None:
        self.samples = 0
        self._first = self._last = 0.0, 0.0, 0.0, 0.0
        self._residual, self._worst, self._worst_time, self._scale = 0.0, 0.0, 0.0, 0.0
        self._exchanged = 0.0
        self._start = self._end = 0.0

    def add(self, message: Any) -> None:
        """Enter one instant; without masses in the scene there are no energies to balance."""
        m = message
        if math.isnan(m.kinetic_energy):
            return
        terms = m.kinetic_energy, m.potential_energy, m.drive_work, m.dissipated
        if not self.samples:
            self._first = self._last = terms
            self._start = self._worst_time = float(m.time)
        self.samples += 1
        self._end = float(m.time)
        self._exchanged += sum(map(abs, map(sub, terms, self._last)))
        self._last = terms
        # Term by term against the first instant: large energies do not hide small changes.
        kinetic, potential, work, dissipated = map(sub, terms, self._first)
        self._residual = kinetic + potential - work + dissipated
        self._scale = max(self._scale, *map(abs, terms))
        if abs(self._residual) > self._worst:
            self._worst, self._worst_time = abs(self._residual), float(m.time)

    def summary(self) -> EnergySummary | None:
        """The balance; None of fewer than two instants, between which nothing can be lost."""
        if self.samples < 2:
            return None
        return EnergySummary(
            samples=self.samples,
            start=self._start,
            end=self._end,
            initial=sum(self._first[:2]),
            final=sum(self._last[:2]),
            drive_work=self._last[2] - self._first[2],
            dissipated=self._last[3] - self._first[3],
            residual_at_end=self._residual,
            largest_residual=self._worst,
            largest_residual_time=self._worst_time,
            largest_energy=self._scale,
            exchanged=self._exchanged,
        )
